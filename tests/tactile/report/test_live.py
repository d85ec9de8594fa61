"""What a terminal and other programs are told of live recognition."""

from __future__ import annotations

import dataclasses
import itertools
import re

import numpy as np
import pytest
from rich.cells import cell_len

from fuzzytree.tactile.recognition.live import Latency, LiveResult, LiveView
from fuzzytree.tactile.recognition.recogniser import State
from fuzzytree.tactile.report.live import (
    PALETTE,
    Look,
    counts,
    escaped,
    line,
    line_facts,
    picture,
    screen,
    shades,
    status,
    timing,
    visible,
)
from fuzzytree.tactile.sensor import Cells, Counters, Frame

CELLS = np.array([[0, 10, 20], [0, 255, 30]], np.int64)
ANSWER = LiveResult(
    Frame(CELLS, 1.25, 55), State.OBJECT, 1, "soft", (0.0, 0.75), 1, 4e-4, "a cell"
)
VIEW = LiveView(
    source="/dev/ttyUSB0",
    model="grip",
    classes=("firm", "soft"),
    full=255,
    cells=CELLS,
    answer=ANSWER,
    rate=43.96,
    latency=Latency(4e-4, 9e-4, 2e-3),
    counters=dataclasses.asdict(Counters(bytes=900, frames=56, damaged=2)),
    refused=0,
    trouble="",
    silent_s=0.01,
    is_over=False,
)


def bare(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


def test_a_screen_shows_class_strengths_counters_and_latency() -> None:
    assert screen(VIEW, 70, 12, look="plain", times=1).split("\n") == [
        "/dev/ttyUSB0 -> grip",
        " .::::  soft",
        " .@@::  ",
        "        firm 0.00 ",
        "        soft 0.75 ################",
        "",
        "56 frames, 900 B, 2 damaged",
        "44.0 frames/s; answer after 0.40 ms (99 %: 0.90, largest: 2.00)",
        "Ctrl-C ends",
    ]


@pytest.mark.parametrize("look", ["plain", "256", "full"])
@pytest.mark.parametrize("size", [(80, 24), (200, 60), (30, 12), (12, 5), (1, 1)])
def test_a_screen_is_never_larger_than_the_terminal(
    look: Look, size: tuple[int, int]
) -> None:
    columns, lines = size
    classes = tuple(f"class number {place}" for place in range(40))
    answer = dataclasses.replace(ANSWER, strengths=(0.5,) * 40)
    cells = np.zeros((16, 16), np.int64)
    view = dataclasses.replace(VIEW, classes=classes, answer=answer, cells=cells)
    found = screen(view, columns, lines, look=look, times=3).split("\n")
    assert len(found) <= lines
    assert max(cell_len(bare(text)) for text in found) <= max(columns, 2)


def test_a_picture_takes_the_largest_number_of_points_that_fits() -> None:
    cells = np.zeros((4, 4), np.int64)
    for lines, found in ((2, 2), (4, 4), (6, 6), (60, 6)):
        assert len(picture(cells, 255, 80, lines, look="full", times=3)) == found


def test_a_sensor_larger_than_the_terminal_loses_no_pressed_cell() -> None:
    cells = np.zeros((64, 64), np.int64)
    cells[37, 11] = 255
    found = picture(cells, 255, 40, 10, look="plain", times=3)
    assert len(found) <= 10
    assert "".join(found).count("@@") == 1


def test_without_colour_there_is_no_code_that_controls_a_terminal() -> None:
    assert "\x1b" not in screen(VIEW, 80, 24, look="plain", times=3)


def test_the_colours_of_a_pressed_cell_are_those_of_the_palette() -> None:
    (found,) = picture(CELLS, 255, 3, 1, look="full", times=1)
    r, g, b = PALETTE[255]
    assert f"48;2;{r};{g};{b}m" in found
    assert len(bare(found)) == 3


def test_the_palette_grows_steadily_brighter() -> None:
    light = [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in PALETTE]
    assert all(after >= before - 1.0 for before, after in itertools.pairwise(light))
    assert light[255] - light[0] > 200


def test_shades_are_shares_of_full() -> None:
    cells: Cells = np.array([[0, 500, 1000, 1200]])
    assert shades(cells, 1000, 1).tolist() == [[0, 128, 255, 255]]


def test_a_status_reports_of_trouble_of_silence_and_of_the_end() -> None:
    assert status(VIEW) == ""
    silent = dataclasses.replace(VIEW, trouble="the board is silent", silent_s=7.4)
    assert status(silent) == "the board is silent; no frame for 7 s"
    over = dataclasses.replace(silent, is_over=True)
    assert status(over) == "the source is gone: no more frames"


def test_before_the_first_frame_a_screen_says_that_it_waits() -> None:
    view = dataclasses.replace(VIEW, answer=None, cells=None, latency=None)
    found = screen(view, 80, 24, look="plain", times=3)
    assert "waiting for the first frame" in found
    assert timing(view) == ""


def test_counters_of_failures_are_reported_above_zero_only() -> None:
    assert counts(VIEW) == "56 frames, 900 B, 2 damaged"
    assert counts(dataclasses.replace(VIEW, refused=3)).endswith("2 damaged, 3 refused")


def test_no_name_of_a_class_controls_the_terminal() -> None:
    evil = "a\x1b[2J\x07\nb\x9b1m"
    answer = dataclasses.replace(ANSWER, label=evil)
    view = dataclasses.replace(VIEW, classes=("firm", evil), answer=answer)
    found = screen(view, 80, 24, look="plain", times=1)
    assert visible(evil) == "a?[2J??b?1m"
    assert visible(evil) in found
    assert not set(found) & set("\x1b\x07\x9b")


def test_a_line_has_six_fields_between_tabs() -> None:
    assert line(ANSWER) == "1.25\t55\tobject\tsoft\t0.75\t1"
    nothing = dataclasses.replace(ANSWER, state=State.NOTHING, code=-1, label="")
    assert line(nothing) == "1.25\t55\tnothing\t\t0.75\t1"
    assert line_facts(nothing)["class"] is None


def test_a_name_with_tabs_and_ends_of_lines_stays_one_field() -> None:
    assert escaped("a\tb\\c\r\n") == "a\\tb\\\\c\\r\\n"
    assert escaped("\x1b[2J\x9b\u202eä") == "\\x1b[2J\\x9b\\u202eä"
    assert line(dataclasses.replace(ANSWER, label="a\tb\n")).count("\t") == 5

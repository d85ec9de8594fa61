"""What a terminal and other programs are told of live recognition."""

from __future__ import annotations

import dataclasses
import itertools
import re

import numpy as np
import pytest
from rich.cells import cell_len

import fuzzytree as ft
from fuzzytree.tactile.recognition.live import (
    Latency,
    LiveResult,
    LiveView,
    SensorObject,
)
from fuzzytree.tactile.recognition.objects import Region
from fuzzytree.tactile.recognition.recogniser import Recogniser, State
from fuzzytree.tactile.report.live import (
    PALETTE,
    Look,
    counts,
    line_facts,
    lines,
    picture,
    screen,
    shades,
    status,
    timing,
)
from fuzzytree.tactile.rest import RestEvent
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor

CELLS = np.array([[0, 10, 20], [0, 255, 30]], np.int64)
AREAS = np.array([[1.0], [9.0]])
SOFT = SensorObject(
    number=3,
    state=State.OBJECT,
    code=1,
    label="soft",
    strengths=(0.0, 0.75),
    region=Region(CELLS, (0, 1, 2, 3), 4, 315),
    recogniser=Recogniser(
        ft.learn(
            ft.table(np.array([[1.0], [9.0]]), columns=["area"]), target=["a", "b"]
        ),
        Sensor(2, 3),
    ),
)
ANSWER = LiveResult(
    frame=Frame(CELLS, 1.25, 55),
    cells=CELLS,
    sensor=Sensor(2, 3),
    objects=(SOFT,),
    left_out=0,
    saturated=1,
    latency_s=4e-4,
    trouble="a cell",
    events=(),
)


def showing(**changes: object) -> LiveResult:
    """Return the answer with a changed object."""
    other = dataclasses.replace(SOFT, **changes)  # type: ignore[arg-type] # by name
    return dataclasses.replace(ANSWER, objects=(other,))


VIEW = LiveView(
    source="/dev/ttyUSB0",
    model="grip",
    classes=("firm", "soft"),
    sensor=Sensor(2, 3),
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
        " .@@::  centre +0.2, -0.4; 4 cells",
        "        ",
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
    columns, most = size
    classes = tuple(f"class number {place}" for place in range(40))
    answer = showing(strengths=(0.5,) * 40)
    answer = dataclasses.replace(answer, cells=np.zeros((16, 16), np.int64))
    view = dataclasses.replace(VIEW, classes=classes, answer=answer)
    found = screen(view, columns, most, look=look, times=3).split("\n")
    assert len(found) <= most
    assert max(cell_len(bare(text)) for text in found) <= max(columns, 2)


def test_a_picture_takes_the_largest_number_of_points_that_fits() -> None:
    cells = np.zeros((4, 4), np.int64)
    for most, found in ((2, 2), (4, 4), (6, 6), (60, 6)):
        assert len(picture(cells, 255, 80, most, look="full", times=3)) == found


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
    view = dataclasses.replace(VIEW, answer=None, latency=None)
    found = screen(view, 80, 24, look="plain", times=3)
    assert "waiting for the first frame" in found
    assert timing(view) == ""


def test_counters_of_failures_are_reported_above_zero_only() -> None:
    assert counts(VIEW) == "56 frames, 900 B, 2 damaged"
    assert counts(dataclasses.replace(VIEW, refused=3)).endswith("2 damaged, 3 refused")


def test_no_name_of_a_class_controls_the_terminal() -> None:
    evil = "a\x1b[2J\x07\nb\x9b1m"
    answer = showing(label=evil)
    view = dataclasses.replace(VIEW, classes=("firm", evil), answer=answer)
    found = screen(view, 80, 24, look="plain", times=1)
    assert r"a\x1b[2J\x07\nb\x9b1m" in found
    assert not set(found) & set("\x1b\x07\x9b")


def test_a_line_has_twelve_fields_between_tabs() -> None:
    place = "3\t0.159\t-0.405\t31.957\t4\t1.2353\t0,1,2,3"
    assert lines(ANSWER) == f"1.25\t55\tobject\tsoft\t0.75\t1\t{place}"
    unknown = showing(state=State.UNKNOWN, code=-1, label="")
    assert lines(unknown) == f"1.25\t55\tunknown\t\t0.75\t1\t{place}"
    nothing = dataclasses.replace(ANSWER, objects=())
    assert lines(nothing) == "1.25\t55\tnothing\t\t0.0\t1\t\t\t\t\t\t\t"
    assert line_facts(nothing)[0]["class"] is None


def test_two_objects_are_two_lines_and_stand_in_the_headline() -> None:
    two = dataclasses.replace(
        ANSWER, objects=(SOFT, dataclasses.replace(SOFT, number=4, label="firm"))
    )
    assert [one["object"] for one in line_facts(two)] == [3, 4]
    assert lines(two).count("\n") == 1
    view = dataclasses.replace(VIEW, answer=two)
    found = screen(view, 80, 24, look="plain", times=1)
    assert "soft + firm" in found
    assert "4 centre +0.2, -0.4; 4 cells" in found


def test_changes_of_what_cells_read_at_rest_are_sentences() -> None:
    assert RestEvent("tare").text == (
        "tared: what the cells read now is their baseline"
    )
    assert RestEvent("hot", ((2, 5),)).text == (
        "hot cells, masked: r2 c5 (pressed alone all the time)"
    )


def test_a_name_with_tabs_and_ends_of_lines_stays_one_field() -> None:
    for name, text in (
        ("a\tb\\c\r\n", r"a\tb\\c\r\n"),
        ("\x1b[2J\x9b\u202eä", r"\x1b[2J\x9b\u202eä"),
    ):
        assert lines(showing(label=name)).split("\t")[3] == text

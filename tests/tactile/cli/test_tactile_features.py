"""`fuzzytree tactile features`: frames as a table."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.cli.program import main
from fuzzytree.tactile.board_file import board_text
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import Recorder
from fuzzytree.tactile.presses import labelled
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from tests.tactile.archives import write_presses


@pytest.fixture
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    cells = np.zeros((4, 6, 6), np.uint8)
    cells[0, 1:3, 1:3] = 90
    cells[1, 1:5, 1:5] = 255
    cells[3, 2, 2:5] = 40
    label, subject = np.array([0, 1, 0, 0]), np.array([1, 1, 2, 2])
    names = ("small", "large")
    write_presses("f.npz", labelled(cells, Sensor(6, 6), label, names, subject))
    return "f.npz"


def test_frames_become_a_table_that_a_tree_is_learnt_from(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["tactile", "features", frames, "--features", "S1,area", "-o", "t.csv"]
    assert main(words) == 0
    rows = [*csv.reader(Path("t.csv").read_text().splitlines())]
    assert rows[0] == ["S1", "area", "class", "subject"]
    assert [row[1:] for row in rows[1:]] == [
        ["4.0", "small", "1"], ["16.0", "large", "1"], ["3.0", "small", "2"],
    ]  # fmt: skip
    assert capsys.readouterr().err == (
        "read     f.npz   4 frames of 6 x 6 cells\n"
        "left out 1 frame nothing presses\n"
        "full     1 frame a cell takes no more\n"
        "wrote    t.csv   2 features; next: fuzzytree learn t.csv --target class "
        "-o tree.yaml --groups subject\n"
    )
    words = ["learn", "t.csv", "--target", "class", "-o", "tree.yaml"]
    assert main([*words, "--ignore", "subject", "--no-test", "--quiet"]) == 0


def test_without_an_output_the_costs_are_listed(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tactile", "features", frames, "--features", "S1,S10", "--json"]) == 0
    costs = json.loads(capsys.readouterr().out)["costs"]
    assert 0 < costs["S1"] < costs["S10"]
    assert main(["tactile", "features", frames, "--features", "force"]) == 0
    assert capsys.readouterr().out.split()[1:] == ["force"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["no.ftr"], "no.ftr: holds no frame\n"),
        (
            ["no.ftr", "--board", "b.yaml"],
            "no.ftr: a recording has its own board; name no other one\n",
        ),
        (["none.npz"], "none.npz: cannot be read: no such file or directory\n"),
        (["bad.npz"], "bad.npz: is no numpy archive (.npz): File is not a zip file\n"),
        (["f.npz", "--full", "0"], "f.npz: full lies in 1 to 65535, not 0\n"),
        (
            ["f.npz", "--features", "cell r6 c0"],
            "'cell r6 c0' lies outside a sensor of 6 x 6 cells\n",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_done_is_one_sentence(
    frames: str, capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    Path("bad.npz").write_text("no archive")
    board = Board("mat", Sensor(6, 6), Marker("AA 55"))
    Recorder("no.ftr", board).close()
    Path("b.yaml").write_text(board_text(board))
    assert main(["tactile", "features", *words]) == 2
    assert capsys.readouterr().err == text
    assert not Path("t.csv").exists()


def test_files_of_one_class_each_become_one_table(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = np.zeros((2, 6, 6), np.uint8)
    cells[0, 1:3, 1:3] = 90
    for name, rest in (("cup", 0), ("pen", 9)):
        board = Board("mat", Sensor(6, 6, baseline=(rest,) * 36), Marker("AA 55"))
        with Recorder(f"{name}.ftr", board) as recorder:
            for number, frame in enumerate(cells):
                recorder.write(Frame(frame, float(number), number), Counters())
    words = ["tactile", "features", "cup=cup.ftr", "a pen=pen.ftr", "cup=cup.ftr"]
    assert main([*words, "--features", "S1,force", "-o", "t.csv"]) == 0
    assert Path("t.csv").read_text().splitlines()[1:] == [
        "0.7058823529411765,1.411764705882353,cup,1",
        "0.7058823529411765,1.411764705882353,a pen,2",  # 9 less everywhere: a shift
        "0.7058823529411765,1.411764705882353,cup,3",
    ]
    assert capsys.readouterr().err.splitlines()[:2] == [
        "read     cup=cup.ftr   2 frames of 6 x 6 cells",
        "read     a pen=pen.ftr 2 frames of 6 x 6 cells",
    ]
    assert main([*words, "--features", "S1", "-o", "t.csv", "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out)["placements"] == {"cup": 2, "a pen": 1}
    refused = {
        ("cup.ftr", "pen=pen.ftr"): "of several files, each has a class: "
        "CLASS=cup.ftr, not cup.ftr\n"
        "  fuzzytree tactile features --help lists the options\n",
        ("cup=cup.ftr", "f=f.npz"): "of f=f.npz and cup=cup.ftr, only one states "
        "subjects\n",
        ("cup=cup.ftr", "f=g.npz"): "f=g.npz: is of another sensor (6 x 6 cells, full "
        "255, threshold 3) than cup=cup.ftr (6 x 6 cells, full 255, threshold 0)\n",
    }
    write_presses("g.npz", labelled(cells, Sensor(6, 6, 255, 3)))
    for given, text in refused.items():
        assert main(["tactile", "features", *given]) == 2
        assert capsys.readouterr().err == text


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes")
def test_a_pipe_is_refused_and_not_waited_for(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo("pipe")
    assert main(["tactile", "features", "pipe"]) == 2
    assert capsys.readouterr().err == "pipe: is no file\n"


def test_a_recording_is_seen_as_live_sees_it(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    board = Board("mat", Sensor(8, 8, threshold=4), Marker("AA 55"))
    cells = np.zeros((90, 8, 8), np.int64)
    for placement in range(3):
        cells[30 * placement + 5 : 30 * placement + 25, 2:5, 2:5] = 80
    cells[40:50, 6:8, 6:8] = 50  # something else lies beside it
    cells[30:] += 9  # all cells have moved
    with Recorder("bar.ftr", board) as recorder:
        for number, frame in enumerate(cells):
            recorder.write(Frame(frame, number / 44, number), Counters())
    words = ["tactile", "features", "bar=bar.ftr", "--features", "area,force"]
    assert main([*words, "-o", "t.csv"]) == 0
    rows = Path("t.csv").read_text("utf-8").splitlines()
    assert rows[0] == "area,force,class,placement"
    force = 9 * 80 / 255
    assert rows[1:] == [f"9.0,{force},bar,{n // 20 + 1}" for n in range(60)]
    said = capsys.readouterr().err
    assert "left out 30 frames   nothing presses" in said
    assert "several  10 frames   several objects: the one of the largest" in said
    assert "learn t.csv --target class -o tree.yaml --groups placement" in said

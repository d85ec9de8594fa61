"""Calibrations: fitted to known loads, kept in files, felt by features."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.errors import InvalidModelError, ReadError, TableError
from fuzzytree.model import FloatArray
from fuzzytree.tactile.board_file import board_text, load_board, read_board
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.calibration import (
    STEPS,
    Calibration,
    fit_forces,
    fit_pressures,
)
from fuzzytree.tactile.link.recording import FrameRecord, Recorder
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.rest import Rest
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from tests.tactile.replays import replayed

LAW = Calibration("kPa", ((100.0, 10.0), (200.0, 40.0)))
SHAPE = (6, 5)


def felt(pressure: FloatArray | float, gains: FloatArray) -> FloatArray:
    """Return readings of a sensor of which 255 counts are about 94 kPa."""
    curve: FloatArray = 255 * (1 - np.exp(-np.asarray(pressure) / 60.0)) / gains
    return np.rint(curve)


def test_a_curve_and_gains_are_found_again_from_even_loads() -> None:
    random = np.random.default_rng(0)
    gains = np.exp(random.normal(0.0, 0.15, SHAPE))
    loads = [5.0, 10.0, 20.0, 40.0, 60.0]
    law = fit_pressures(loads, [felt(load, gains) for load in loads], "kPa")
    rest = Rest(Sensor(*SHAPE), 0.0, law)
    for load in (7.0, 15.0, 30.0, 50.0):  # between the loads, and rounded to counts
        steps = rest(felt(load, gains).astype(np.int64), 0.0)
        found = steps * rest.bare.top / rest.bare.full
        assert np.abs(found / load - 1).max() < 0.08
        assert abs(np.median(found) / load - 1) < 0.04


def test_without_a_calibration_the_same_cells_differ_by_their_gains() -> None:
    gains = np.exp(np.random.default_rng(0).normal(0.0, 0.15, SHAPE))
    cells = felt(30.0, gains)
    assert cells.max() / cells.min() > 1.5


def test_a_curve_is_found_from_weights_that_lie_on_some_cells() -> None:
    random = np.random.default_rng(1)
    forces, readings = [], []
    for size in (1.0, 2.0, 4.0, 8.0, 12.0, 16.0):
        pressures = np.zeros(SHAPE)
        pressures[1:4, 1:4] = size * random.uniform(0.5, 1.5, (3, 3))
        forces.append(float(pressures.sum()))
        readings.append(felt(pressures, np.ones(SHAPE)))
    law = fit_forces(forces, readings, "N")
    for force, cells in zip(forces, readings, strict=True):
        assert law.pressures(cells.astype(np.int64)).sum() == pytest.approx(
            force, rel=0.03
        )


def test_a_calibration_keeps_its_way_through_a_file() -> None:
    gains = tuple(1.0 + place / 64 for place in range(6))
    law = Calibration("N", ((20.0, 0.5), (90.0, 3.25)), gains)
    board = Board("mat", Sensor(2, 3), Marker("AA 55"), calibration=law)
    assert read_board(board_text(board).encode(), "mat.yaml") == board


def test_pressed_cells_stay_pressed_and_full_is_the_last_step() -> None:
    found = LAW.steps(np.array([[0, 1, 255]]), 255)
    assert found.tolist() == [[0, found[0, 1], STEPS]]
    assert found[0, 1] >= 1


def test_the_unit_reaches_frames_features_and_answers() -> None:
    values = np.array([[30.0], [40.0], [200.0], [220.0]])
    tree = ft.learn(
        ft.table(values, columns=["force"]),
        target=["a", "a", "b", "b"],
        units={"force": "kPa"},
    )
    cells = np.zeros((6, 6), np.int64)
    cells[2:4, 2:4] = 200
    record = FrameRecord(Frame(cells, 0.0, 0), Counters(frames=1))
    live = Live(tree, Sensor(6, 6), replayed([record], 0.0), "x", calibration=LAW)
    (answer,) = live.answers()
    (thing,) = answer.objects
    assert answer.sensor.unit == "kPa"
    assert answer.sensor.range_text == "56.5 kPa"
    assert answer.pressures is not None
    assert answer.cells is not None
    assert answer.pressures[2, 2] == pytest.approx(40.0, abs=0.01)
    assert thing.force == pytest.approx(160.0, abs=0.02)
    assert thing.label == "b"
    force = ft.tactile.features_of(answer.cells, "force, peak", answer.sensor)
    assert force[0].tolist() == pytest.approx([160.0, 40.0], abs=0.02)


def test_a_calibration_that_falls_is_refused_with_its_place() -> None:
    with pytest.raises(InvalidModelError) as caught:
        Calibration("kPa", ((100.0, 10.0), (90.0, 9.0)))
    assert [text for _, text in caught.value.mistakes] == [
        "the reading 90 does not rise above 100: a calibration never falls",
        "the pressure 9 does not rise above 10: a calibration never falls",
    ]


def test_a_file_with_too_few_gains_is_refused() -> None:
    text = """
format: fuzzytree-board/1
name: mat
sensor: {rows: 2, columns: 2}
marker: {bytes: AA 55}
calibration: {unit: kPa, points: [[10, 1]], gains: [1, 2]}
"""
    with pytest.raises(ReadError, match="a calibration has 4 gains, not 2"):
        read_board(text.encode(), "mat.yaml")


@pytest.mark.parametrize(
    ("loads", "levels", "text"),
    [
        ([], [], "a calibration needs a load above 0 with its frames"),
        ([-1.0], [5], "a load is above 0, not -1"),
        ([1.0], [0], "at the load 1 no cell reads anything"),
        ([1.0, 1.0], [5, 6], "the load 1 kPa comes twice"),
        (
            [1.0, 2.0],
            [60, 40],
            "at 2 kPa the cells read 40, no more than 60 at 1 kPa: "
            "a calibration never falls",
        ),
    ],
)
def test_loads_that_give_no_curve_are_refused(
    loads: list[float], levels: list[int], text: str
) -> None:
    readings = [np.full(SHAPE, float(level)) for level in levels]
    with pytest.raises(TableError) as caught:
        fit_pressures(loads, readings, "kPa")
    assert str(caught.value) == text


def test_a_model_of_another_unit_is_refused() -> None:
    values = np.array([[30.0], [40.0], [200.0], [220.0]])
    rows = ft.table(values, columns=["force"])
    tree = ft.learn(rows, target=["a", "a", "b", "b"], name="m", units={"force": "N"})
    for law, unit in ((LAW, "kPa"), (None, "shares of full")):
        with pytest.raises(TableError) as caught:
            Live(tree, Sensor(6, 6), replayed([], 0.0), "x", calibration=law)
        text = f"m: 'force' is in N, and the frames are in {unit}"
        assert str(caught.value) == text


def test_calibrate_writes_a_board_that_live_features_and_learn_understand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    board = Board("mat", Sensor(*SHAPE, threshold=3), Marker("AA 55"))
    Path("mat.yaml").write_text(board_text(board), "utf-8")
    for load in (10, 20, 40):
        cells = felt(float(load), np.ones(SHAPE)).astype(np.int64)
        with Recorder(f"{load}.ftr", board) as recorder:
            for number in range(30):
                shown = cells * (number >= 5)
                recorder.write(Frame(shown, number / 44, number), Counters())
    words = ["tactile", "calibrate", "mat.yaml", "10=10.ftr", "20=20.ftr", "40=40.ftr"]
    assert main([*words, "-o", "kpa.yaml"]) == 0
    law = load_board("kpa.yaml").calibration
    assert law is not None
    assert [point[1] for point in law.points] == [10.0, 20.0, 40.0]
    said = capsys.readouterr().err
    assert "gains    1 to 1" in said
    assert "full is " in said

    other = Board("pad", Sensor(2, 2), Marker("AA 55"))
    with Recorder("other.ftr", other) as recorder:
        recorder.write(Frame(np.ones((2, 2), np.int64), 0.0, 0), Counters())
    with Recorder("empty.ftr", board):
        pass
    wrong = {
        "5=other.ftr": "other.ftr: is a recording of another board, pad",
        "5=empty.ftr": "empty.ftr: holds no frame, so the load has nothing to show",
        "5=none.ftr": "none.ftr: cannot be read: no such file or directory",
        "five=10.ftr": "'five=10.ftr': write LOAD=FILE, such as 10=ten.ftr",
    }
    for text, sentence in wrong.items():
        assert main(["tactile", "calibrate", "mat.yaml", text, "-o", "no.yaml"]) == 2
        assert capsys.readouterr().err.splitlines()[0] == sentence
        assert not Path("no.yaml").exists()


def test_features_of_archives_and_tables_are_in_the_unit_of_their_board(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    board = Board("mat", Sensor(2, 2), Marker("AA 55"), calibration=LAW)
    Path("kpa.yaml").write_text(board_text(board), "utf-8")
    np.savez("a.npz", frames=np.array([[[100, 0], [200, 0]]], np.uint8))
    Path("a.csv").write_text("r0c0,r0c1,r1c0,r1c1\n100,0,200,0\n", "utf-8")
    for name in ("a.npz", "a.csv"):
        words = ["tactile", "features", name, "--board", "kpa.yaml", "-o", "-"]
        assert main([*words, "--features", "force"]) == 0
        force = float(capsys.readouterr().out.splitlines()[1].split(",")[0])
        assert force == pytest.approx(50.0, abs=0.01)
    Path("m.yaml").write_text("", "utf-8")
    assert main(["tactile", "export", "m.yaml", "m.onnx", "--board", "kpa.yaml"]) == 2
    said = capsys.readouterr().err.splitlines()[0]
    text = "a file from frame to class takes readings; name a board without one"
    assert said == f"kpa.yaml is calibrated, and {text}"

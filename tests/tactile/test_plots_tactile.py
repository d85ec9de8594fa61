"""Pictures of frames and confusions show what they were given, and no more."""

from __future__ import annotations

import base64
import importlib.metadata
import itertools
import re
import shlex
import struct
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import interpolation
import numpy as np
import numpy.typing as npt
import pytest
from confusion import draw_confusion
from figures import drawn

from fuzzytree.tactile.interpolation import interpolated
from fuzzytree.tactile.plots import TIMES, draw_frames
from fuzzytree.tactile.report.live import PALETTE
from fuzzytree.tactile.sensor import Sensor

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from fuzzytree.report import Picture

pytest.importorskip("matplotlib", reason="matplotlib is not installed")

DOCS = Path(__file__).resolve().parents[2] / "docs" / "explanation"
DRAWN_BY = "3.11.2"
SCRIPT = "python benchmarks/interpolation.py --draw"
SVG = "{http://www.w3.org/2000/svg}"

SENSOR = Sensor(2, 2)
FRAME = np.array([[[0, 4], [8, 2]]])


def words(figure: Figure) -> list[Text]:
    return [text for axes in figure.axes for text in axes.texts if text.get_text()]


def said(figure: Figure) -> set[str]:
    return {text.get_text() for text in words(figure)}


def overlapping(figure: Figure) -> list[tuple[str, str]]:
    """Return all pairs of words that cover each other."""
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in words(figure)]
    return [
        (one, two)
        for (one, a), (two, b) in itertools.combinations(boxes, 2)
        if a.overlaps(b)
    ]


def groups(picture: Picture) -> list[Any]:
    """Return what is drawn of each frame, and the scale last."""
    root = ET.fromstring(picture.svg)
    return [one for one in root.iter(f"{SVG}g") if one.find(f"{SVG}image") is not None]


def dots(image: Any) -> npt.NDArray[np.int64]:
    """Return the colours of an image, of shape (rows, columns, 3)."""
    content = base64.b64decode(image.attrib["href"].partition(",")[2])
    columns, rows = struct.unpack(">II", content[16:24])
    places = [content.index(kind) for kind in (b"PLTE", b"IDAT")]
    sizes = [struct.unpack(">I", content[k - 4 : k])[0] for k in places]
    palette, packed = (
        content[k + 4 : k + 4 + size] for k, size in zip(places, sizes, strict=True)
    )
    lines = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(rows, columns + 1)
    colours = np.frombuffer(palette, np.uint8).reshape(-1, 3).astype(np.int64)
    return colours[lines[:, 1:]]


def drawn_dots(picture: Picture) -> list[npt.NDArray[np.int64]]:
    """Return the colours of all frames, without the scale."""
    return [dots(one.find(f"{SVG}image")) for one in groups(picture)[:-1]]


def test_every_dot_has_the_colour_of_its_share_of_the_largest() -> None:
    found = drawn_dots(draw_frames(SENSOR, FRAME, ["a"]))
    assert len(found) == len(TIMES)
    for times, colours in zip(TIMES, found, strict=True):
        shares = np.rint(255 * interpolated(FRAME[0], times) / 8).astype(int)
        assert (colours == np.array(PALETTE)[shares]).all()


def test_colours_of_pressure_grow_evenly_lighter() -> None:
    rgb = np.asarray(PALETTE) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lightness = np.cbrt(linear @ [0.2126, 0.7152, 0.0722])
    assert (np.diff(lightness[::8]) > 0.0).all()


def test_all_frames_share_the_scale_of_the_largest() -> None:
    both = np.concatenate([FRAME, FRAME * 3])
    picture = draw_frames(SENSOR, both, ["a", "b"])
    *_, scale = groups(picture)
    numbers = [one.text for one in scale.iter(f"{SVG}text")]
    assert numbers == ["0", "5", "10", "15", "20", "reading"]
    alone = draw_frames(SENSOR, FRAME, ["a"])
    assert (drawn_dots(alone)[0] != drawn_dots(picture)[0]).any()


def test_the_scale_of_a_calibrated_sensor_has_its_unit() -> None:
    sensor = Sensor(2, 2, 16, top=40.0, unit="kPa")
    *_, scale = groups(draw_frames(sensor, FRAME, ["a"]))
    numbers = [one.text for one in scale.iter(f"{SVG}text")]
    assert numbers == ["0", "5", "10", "15", "20", "kPa"]


def test_a_frame_without_pressure_has_one_colour_and_no_centre() -> None:
    picture = draw_frames(Sensor(3, 4), np.zeros((1, 3, 4), int), ["a"])
    assert (drawn_dots(picture)[0] == PALETTE[0]).all()
    assert 'class="centre"' not in picture.svg


def test_the_centre_of_pressure_lies_where_the_features_say() -> None:
    cells = np.zeros((1, 10, 10), int)
    cells[0, 6:10, 7] = 9
    parts = [
        {part.attrib.get("class"): part.attrib for part in one}
        for one in groups(draw_frames(Sensor(10, 10), cells, ["a"]))[:-1]
    ]
    for part in parts:  # a cell is 15 points wide, and the centre 7 points
        assert (part["centre"]["x"], part["centre"]["y"]) == ("109", "116.5")
        line = [float(part["axis"][name]) for name in ("x1", "x2", "y1", "y2")]
        assert line == pytest.approx([112.5, 112.5, 150.0, 90.0])


@pytest.mark.parametrize("shape", [(4, 8), (8, 2), (1, 256)])
def test_frames_of_any_shape_keep_square_cells(shape: tuple[int, int]) -> None:
    rows, columns = shape
    picture = draw_frames(Sensor(rows, columns), np.ones((1, *shape), int), ["a"])
    box = groups(picture)[0].find(f"{SVG}image").attrib
    assert float(box["width"]) == pytest.approx(150.0 * columns / max(shape), rel=0.01)
    assert float(box["height"]) == max(150.0 * rows / max(shape), 8.0)


def test_titles_stay_within_the_picture() -> None:
    both = np.concatenate([FRAME, FRAME])
    found = draw_frames(SENSOR, both, ["wide <name> " * 50, "b"]).svg
    assert "…</text>" in found
    assert ">b</text>" in found
    letters = [len(one.text or "") for one in ET.fromstring(found).iter(f"{SVG}text")]
    assert max(letters) < 92


def test_a_confusion_shows_counts_rates_and_the_whole() -> None:
    figure = draw_confusion(np.array([[48, 2, 0], [7, 42, 1]]), ["bar", "disc"])
    assert said(figure) >= {
        "48", "2", "7", "42", "1", "bar", "disc", "none of them",
        "96.0 %", "84.0 %", "90.0 %",
    }  # fmt: skip
    assert "0" not in said(figure)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("count", [1, 2, 12])
def test_no_words_of_a_confusion_cover_each_other(count: int) -> None:
    table = np.full((count, count + 1), 3) + np.eye(count, count + 1, dtype=int) * 9990
    names = [f"rectangle in {k}" for k in range(count)]
    figure = draw_confusion(table, names, title="all")
    slanted = {text.get_text() for text in words(figure) if text.get_rotation()}
    covered = overlapping(figure)
    # The boxes of slanted names meet; the names, in parallel, do not.
    assert [pair for pair in covered if not slanted.issuperset(pair)] == []


def test_a_class_that_never_was_has_no_rate() -> None:
    figure = draw_confusion(np.array([[5, 0], [0, 0]]), ["a", "b"])
    assert {"100.0 %", "-"} <= said(figure)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        (np.zeros((2, 2)), "a confusion table holds whole numbers of at least 0"),
        (
            np.array([[0, -1], [0, 0]]),
            "a confusion table holds whole numbers of at least 0",
        ),
        (np.zeros((3, 3), int), "a table of shape (3, 3) does not fit 2 classes"),
    ],
)
def test_tables_that_are_no_confusion_are_refused(
    table: npt.NDArray[Any], text: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        draw_confusion(table, ["a", "b"])
    assert str(caught.value) == text


def test_the_same_pictures_are_the_same_bytes_whatever_a_users_settings() -> None:
    import matplotlib as mpl

    table = np.eye(2, dtype=int)
    plain = drawn(draw_confusion(table, ["a", "b"]))
    with mpl.rc_context({"font.size": 20, "axes.grid": True, "image.origin": "lower"}):
        assert drawn(draw_confusion(table, ["a", "b"])) == plain
    assert draw_frames(SENSOR, FRAME, ["a"]) == draw_frames(SENSOR, FRAME, ["a"])


def test_the_pictures_of_the_docs_are_those_of_their_script() -> None:
    hand = (DOCS / "interpolation-hand.svg").read_text("utf-8")
    assert interpolation.picture_of_a_hand().svg == hand, SCRIPT
    if importlib.metadata.version("matplotlib") != DRAWN_BY:
        pytest.skip(f"drawn by matplotlib {DRAWN_BY}, and others place letters apart")
    weights = (DOCS / "interpolation-weights.svg").read_bytes()
    assert drawn(interpolation.picture_of_weights()) == weights, SCRIPT


def test_the_bilinear_values_of_the_script_are_those_of_a_tent() -> None:
    cells = np.array([[0.0, 4.0], [8.0, 12.0]])
    found = interpolation.bilinear(cells, 2)
    assert found[1].tolist() == [2.0, 3.0, 5.0, 6.0]
    assert found[:, 0].tolist() == [0.0, 2.0, 6.0, 8.0]


def _page() -> str:
    return (DOCS / "interpolation.md").read_text("utf-8")


def test_the_example_of_the_page_gives_the_papers_cells() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", _page(), re.DOTALL)
    found: dict[str, Any] = {}
    exec(code.replace("print(", "shown = ("), found)  # our own page
    assert found["shown"][0].tolist() == [100.0, 83.3, 66.7, 50.0]


@pytest.mark.heavy
def test_the_commands_of_the_page_write_what_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fuzzytree.cli.program import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(DOCS.parents[1] / "examples")
    (block,) = re.findall(r"```sh\n(.*?)```", _page(), re.DOTALL)
    for line in block.splitlines():
        words = shlex.split(line)[1:]
        assert main(words) == 0
        assert Path(words[-1]).stat().st_size > 0


@pytest.mark.heavy
def test_the_errors_of_the_page_are_those_that_its_script_finds(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("scipy", reason="scipy is not installed")
    interpolation.print_errors()
    assert capsys.readouterr().out in _page()

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

from fuzzytree.tactile.plots import COLOURS, MOST_FRAMES, FrameAxis, draw_frames

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from fuzzytree.report import Picture

pytest.importorskip("matplotlib", reason="matplotlib is not installed")

DOCS = Path(__file__).resolve().parents[2] / "docs" / "explanation"
DRAWN_BY = "3.11.2"
SCRIPT = "python benchmarks/interpolation.py --draw"
SVG = "{http://www.w3.org/2000/svg}"

FRAME = np.array([[0, 4], [8, 2]])


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


def first_dots(picture: Picture) -> npt.NDArray[np.int64]:
    return dots(groups(picture)[0].find(f"{SVG}image"))


def test_every_dot_of_a_frame_has_the_colour_of_its_cell() -> None:
    found = first_dots(draw_frames([FRAME]))
    side = found.shape[0] // 2
    for (row, column), value in np.ndenumerate(FRAME):
        cell = found[row * side : (row + 1) * side, column * side : (column + 1) * side]
        wanted = COLOURS[int(np.ceil(value / 8.0 * (len(COLOURS) - 1)))]
        assert (cell == wanted).all()


def test_colours_of_pressure_grow_evenly_darker() -> None:
    rgb = np.asarray(COLOURS[1:]) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lightness = np.cbrt(linear @ [0.2126, 0.7152, 0.0722])
    assert (np.diff(lightness[::8]) < 0.0).all()
    assert lightness[0] > 0.9
    assert lightness[-1] < 0.3


def test_all_frames_share_the_scale_of_the_largest() -> None:
    picture = draw_frames([FRAME, FRAME * 3])
    *_, scale = groups(picture)
    numbers = [one.text for one in scale.iter(f"{SVG}text")]
    assert numbers == ["0", "5", "10", "15", "20", "pressure"]
    assert (first_dots(draw_frames([FRAME, FRAME])) != first_dots(picture)).any()


def test_a_frame_without_pressure_is_white() -> None:
    assert (first_dots(draw_frames([np.zeros((3, 4))])) == 255).all()


def test_the_centre_of_pressure_lies_where_the_features_say() -> None:
    one = FrameAxis(x=0.5, y=-0.5, angle_deg=90.0, length=1.0)
    picture = draw_frames([np.ones((6, 6))], axes=[one], cells=[(2, 2)])
    parts = {part.attrib.get("class"): part.attrib for part in groups(picture)[0]}
    # A frame is 150 points wide, and the centre in the lower right of 2 x 2 cells.
    assert (parts["centre"]["x"], parts["centre"]["y"]) == ("109", "109")
    line = [float(parts["axis"][name]) for name in ("x1", "x2", "y1", "y2")]
    assert line == pytest.approx([112.5, 112.5, 187.5, 37.5])


def test_frames_of_any_shape_keep_square_cells() -> None:
    shapes = [(4, 8), (8, 2), (1, 300)]
    drawn = groups(draw_frames([np.ones(shape) for shape in shapes]))
    for one, (rows, columns) in zip(drawn, shapes[:2], strict=False):
        box = one.find(f"{SVG}image").attrib
        sides = float(box["width"]) / columns, float(box["height"]) / rows
        assert sides[0] == pytest.approx(sides[1], rel=0.01)


def test_titles_stand_above_their_frames_and_stay_within_the_picture() -> None:
    picture = draw_frames([FRAME] * 5, titles=list("abcde"), title="five")
    titles = [one.find(f"{SVG}text").text for one in groups(picture)[:5]]
    assert titles == list("abcde")
    assert ">five</text>" in picture.svg
    long = draw_frames(
        [FRAME, FRAME], titles=["wide <name> " * 50, "b"], title="x" * 99
    )
    assert "…</text>" in long.svg
    assert (
        max(len(one.text or "") for one in ET.fromstring(long.svg).iter(f"{SVG}text"))
        < 60
    )


@pytest.mark.parametrize(
    ("frames", "options", "text"),
    [
        ([], {}, f"a picture has 1 to {MOST_FRAMES} frames, not 0"),
        ([FRAME, FRAME[0]], {}, "frame 2 of shape (2,) is no matrix of finite numbers"),
        ([FRAME], {"titles": ["a", "b"]}, "2 titles for 1 frames"),
    ],
)
def test_frames_that_are_none_are_refused(
    frames: list[npt.NDArray[Any]], options: dict[str, Any], text: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        draw_frames(frames, **options)
    assert str(caught.value) == text


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
    frames = [FRAME, FRAME]
    axes = [None, FrameAxis(0.0, 0.0, 45.0)]
    assert draw_frames(frames, axes=axes) == draw_frames(frames, axes=axes)


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

"""Pictures of frames and confusions show what they were given, and no more."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import interpolation
import numpy as np
import numpy.typing as npt
import pytest
from confusion import draw_confusion

from fuzzytree.errors import MissingExtraError
from fuzzytree.report import plots
from fuzzytree.report.plots.sheet import drawn
from fuzzytree.tactile.plots import MOST_FRAMES, FrameAxis, colours, draw_frames

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure
    from matplotlib.text import Text

pytest.importorskip("matplotlib", reason="matplotlib is not installed")

DOCS = Path(__file__).resolve().parents[2] / "docs" / "explanation"
DRAWN_BY = "3.11.2"

FRAME = np.array([[0, 4], [8, 2]])


def images(figure: Figure) -> list[Any]:
    return [image for axes in figure.axes for image in axes.images]


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


def test_every_dot_of_a_frame_has_the_colour_of_its_cell() -> None:
    (image,) = images(draw_frames([FRAME]))
    dots = image.to_rgba(image.get_array(), norm=True)
    side = dots.shape[0] // 2
    scale = colours()
    for (row, column), value in np.ndenumerate(FRAME):
        found = dots[row * side : (row + 1) * side, column * side : (column + 1) * side]
        wanted = scale(value / 8.0) if value else (1.0, 1.0, 1.0, 1.0)
        assert np.allclose(found, wanted)


def test_colours_of_pressure_grow_evenly_darker() -> None:
    rgb = np.asarray(colours()(range(colours().N)))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lightness = np.cbrt(linear @ [0.2126, 0.7152, 0.0722])
    steps = np.diff(lightness)
    assert (steps < 0.0).all()
    assert steps.min() > 3.0 * steps.max()


def test_all_frames_share_the_scale_of_the_largest() -> None:
    figure = draw_frames([FRAME, FRAME * 3])
    assert {image.get_clim() for image in images(figure)[:2]} == {(0.0, 24.0)}
    assert figure.axes[-1].get_ylabel() == "pressure"


def test_a_frame_without_pressure_is_white() -> None:
    (image,) = images(draw_frames([np.zeros((3, 4))]))
    assert image.get_array().mask.all()


def test_the_centre_of_pressure_lies_where_the_features_say() -> None:
    one = FrameAxis(x=0.5, y=-0.5, angle_deg=90.0, length=1.0)
    figure = draw_frames([np.ones((6, 6))], axes=[one], cells=[(2, 2)])
    found = {
        line.get_gid(): np.asarray(line.get_xydata()) for line in figure.axes[0].lines
    }
    assert found["centre"].tolist() == [[4.5, 1.5]]  # the lower right of 2 x 2 cells
    assert found["axis"].ravel().tolist() == pytest.approx([4.5, -1.5, 4.5, 4.5])


def test_frames_of_any_shape_keep_square_cells() -> None:
    figure = draw_frames([np.ones((4, 8)), np.ones((8, 2)), np.ones((1, 300))])
    width, height = figure.get_size_inches()
    for axes, (rows, columns) in zip(figure.axes, [(4, 8), (8, 2)], strict=False):
        box = axes.get_position()
        assert box.width * width / columns == pytest.approx(box.height * height / rows)


def test_titles_stand_above_their_frames() -> None:
    figure = draw_frames([FRAME] * 5, titles=list("abcde"), title="five")
    assert [axes.get_title() for axes in figure.axes[:5]] == list("abcde")
    assert figure.texts[0].get_text() == "five"


def test_titles_are_no_formulas_and_stay_within_the_picture() -> None:
    name = "$\\frac{" + "wide name " * 50
    figure = draw_frames([FRAME, FRAME], titles=[name, "$a$"], title=name)
    figure.draw_without_rendering()
    (title,) = figure.texts
    above = figure.axes[0].title
    for text in (title, above):
        assert text.get_window_extent().x1 <= figure.bbox.x1
        assert text.get_text().endswith("…")
    assert above.get_window_extent().width <= figure.axes[0].get_window_extent().width


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


def pictures() -> list[Figure]:
    return [
        draw_frames([FRAME, FRAME], axes=[None, FrameAxis(0.0, 0.0, 45.0)]),
        draw_confusion(np.eye(2, dtype=int), ["a", "b"]),
    ]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("suffix", plots.SUFFIXES)
def test_the_same_pictures_are_the_same_bytes(suffix: str) -> None:
    for one, two in zip(pictures(), pictures(), strict=True):
        assert drawn(one, suffix) == drawn(two, suffix)


def test_a_users_settings_change_nothing() -> None:
    import matplotlib as mpl

    plain = [drawn(one, ".svg") for one in pictures()]
    with mpl.rc_context({"font.size": 20, "axes.grid": True, "image.origin": "lower"}):
        assert [drawn(one, ".svg") for one in pictures()] == plain


def test_drawing_without_matplotlib_says_what_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(_name: str) -> None:
        return None

    monkeypatch.setattr(importlib.util, "find_spec", none)
    draws: list[Callable[[], object]] = [
        lambda: draw_frames([FRAME]),
        lambda: draw_confusion(np.eye(2, dtype=int), ["a", "b"]),
    ]
    for draw in draws:
        with pytest.raises(MissingExtraError, match="pip install 'matplotlib"):
            draw()


@pytest.mark.parametrize("name", ["weights", "a_hand"])
def test_the_pictures_of_the_docs_are_those_of_their_script(
    name: str, tmp_path: Path
) -> None:
    if importlib.metadata.version("matplotlib") != DRAWN_BY:
        pytest.skip(f"drawn by matplotlib {DRAWN_BY}, and others place letters apart")
    again = tmp_path / "again.svg"
    plots.save(getattr(interpolation, f"picture_of_{name}")(), again)
    file = DOCS / f"interpolation-{name.removeprefix('a_')}.svg"
    assert again.read_bytes() == file.read_bytes(), (
        "python benchmarks/interpolation.py --draw"
    )


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

"""A sheet of paper for pictures, and pictures as SVG or PNG files.

The axes of a sheet are in inches; words are measured before they stand. The same
picture gives the same bytes.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.files import PathLike, write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".svg", ".png")
"""What a picture's file name can end in."""

DOTS = 200
"""Dots per inch of a PNG: a figure eight inches wide has 1,600 of them."""

# Letters are drawn as paths, so an SVG looks alike where a font is missing, and the
# names of its parts come from a fixed salt instead of chance.
_SETTINGS: Any = {"svg.hashsalt": "fuzzytree", "svg.fonttype": "path"}


@contextlib.contextmanager
def style() -> Generator[None]:
    """Draw by the library's own defaults, whatever the user's settings are.

    Raises:
        MissingExtraError: If matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError(f"drawing pictures needs {install_hint('plots')}")
    import matplotlib as mpl
    from matplotlib import style as styles

    with styles.context("default"), mpl.rc_context(_SETTINGS):
        yield


def save(figure: Figure, path: PathLike) -> None:
    """Write a figure as SVG or PNG, by the suffix of the file's name.

    The file has no date and no program's name in it, and takes the old one's place
    only when it is whole.

    Raises:
        ValueError: If the suffix is neither.
        WriteError: If the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        name = os.fspath(path)
        raise ValueError(f"{name}: a picture's name ends in {' or '.join(SUFFIXES)}")
    write_atomically(path, drawn(figure, suffix))


def drawn(figure: Figure, suffix: str) -> bytes:
    """Return a figure as the content of a file with that suffix."""
    content = io.BytesIO()
    nothing: dict[str, Any] = {"Date": None, "Creator": None}
    if suffix == ".png":
        nothing = {"Software": None}
    with style():
        figure.savefig(content, format=suffix[1:], dpi=DOTS, metadata=nothing)
    return content.getvalue()


SIZE = 8.0
"""Of letters, in points."""

LINE, FAINT, WORD = "#8c959f", "#57606a", "#24292f"
"""The colours of lines, of words beside others, and of words."""

MARGIN = 0.16
"""Around a picture, in inches."""

TITLE = 0.36
"""Of the words above a picture, in inches."""


class Sheet:
    """A figure whose axes count inches, x to the right and y down, without lines."""

    def __init__(self) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.figure: Figure = Figure()
        canvas: Any = FigureCanvasAgg(self.figure)
        self._renderer: Any = canvas.get_renderer()
        self.axes: Axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()

    def width(self, text: str, size: float = SIZE, *, bold: bool = False) -> float:
        """Return how wide words are, in inches."""
        drawn = self.figure.text(
            0,
            0,
            text,
            fontsize=size,
            fontweight="bold" if bold else "normal",
            parse_math=False,
        )
        wide: float = drawn.get_window_extent(self._renderer).width
        drawn.remove()
        return wide / self.figure.dpi

    def resize(self, width: float, height: float) -> None:
        """Make the sheet this large."""
        self.figure.set_size_inches(width, height)
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(height, 0.0)

    def write(self, x: float, y: float, text: str, **style: Any) -> None:
        """Write words; a name with the signs of a formula is no formula.

        Args:
            x: In inches from the left.
            y: In inches from the top.
            text: The words.
            style: What matplotlib's `Text` takes, other than small, faint words whose
                left end stands at x, and whose middle at y.
        """
        usual = {"fontsize": SIZE, "color": FAINT, "va": "center_baseline"}
        fixed = {"rotation_mode": "anchor", "parse_math": False, "zorder": 3}
        whole: dict[str, Any] = {**usual, **style, **fixed}
        self.axes.text(x, y, text, **whole)

    def write_title(self, text: str) -> None:
        """Write words at the top."""
        style = {"fontsize": SIZE + 3, "fontweight": "bold", "color": "black"}
        self.write(MARGIN, MARGIN, text, va="top", **style)


def short(text: str, longest: int) -> str:
    """Return a text in one line; what is longer than `longest` letters is cut.

    Example:
        >>> short("a hand  in 45 degrees", 10)
        'a hand in…'
    """
    text = " ".join(text.split())
    return text if len(text) <= longest else f"{text[: longest - 1].rstrip()}…"

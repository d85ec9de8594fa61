"""A confusion table as a picture: what was there, and what it was taken for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from figures import SIZE, style

from fuzzytree.report import cut

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Counts = npt.NDArray[np.integer]

MOST_CLASSES = 60
"""The most classes in one picture."""

RIGHT, WRONG = "#0072b2", "#c04d00"
"""The colours of what was taken for itself, and for something else."""

_THERE, _TAKEN = "what was there", "what it was taken for"
_CELL = 0.46  # inches
_LONGEST = 24  # letters of a name; what is longer is cut and ends in dots
_GAP = 0.09
_RATES = 0.62  # the column of rates
_WORDS = 0.22  # the words that name a side
_SLANT_DEG = 38.0  # of the names of columns
_DARK = 0.55  # above this share of a row, letters are white


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


def draw_confusion(
    matrix: Counts,
    classes: Sequence[str],
    *,
    title: str = "",
    other: str = "none of them",
) -> Figure:
    """Draw how often each class was taken for each class, and the rate of each.

    A row is a class that was there; it has the number of each class that it was taken
    for, in a colour as strong as the number's share of the row. At the right stands
    the share that was right, and in the corner below that of all.

    Args:
        matrix: Whole numbers of shape (classes, classes), or one column more for what
            was taken for none of the classes.
        classes: In the order of rows and columns.
        title: Above the picture.
        other: What the further column is called.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If the matrix is none of counts, or does not fit the classes.
        MissingExtraError: If matplotlib is not installed.
    """
    counts = _checked(np.asarray(matrix), classes)
    names = [cut(name, _LONGEST) for name in classes]
    heads = [*names, cut(other, _LONGEST)][: counts.shape[1]]
    with style():
        sheet = Sheet()
        left = MARGIN + _WORDS + max(map(sheet.width, names)) + _GAP
        slant = math.radians(_SLANT_DEG)
        long = max(map(sheet.width, heads))
        top = MARGIN + (TITLE if title else 0.0) + long * math.sin(slant) + _GAP + 0.1
        wide, high = (side * _CELL for side in counts.shape[::-1])
        left = max(left, MARGIN + sheet.width(_TAKEN) - wide)
        right = max(_RATES, long * math.cos(slant) - _CELL / 2.0) + MARGIN
        least = sheet.width(title, SIZE + 3, bold=True) + 2.0 * MARGIN
        width = max(left + wide + right, least)
        sheet.resize(width, top + high + _CELL + MARGIN)
        sheet.write_title(title)
        _write_names(sheet, names, heads, left, top)
        _draw_cells(sheet, counts, left, top)
        _write_rates(sheet, counts, left + wide, top)
    return sheet.figure


def rate_text(right: int, total: int) -> str:
    """Return a share as a picture shows it, in thousandths.

    Example:
        >>> rate_text(314, 350), rate_text(0, 0)
        ('89.7 %', '-')
    """
    return f"{right / total * 100.0:.1f} %" if total else "-"


def _checked(counts: Counts, classes: Sequence[str]) -> Counts:
    number = len(classes)
    if not 1 <= number <= MOST_CLASSES:
        raise ValueError(f"a picture has 1 to {MOST_CLASSES} classes, not {number}")
    if counts.shape not in ((number, number), (number, number + 1)):
        raise ValueError(
            f"a table of shape {counts.shape} does not fit {number} classes"
        )
    if counts.dtype.kind not in "iu" or bool((counts < 0).any()):
        raise ValueError("a confusion table holds whole numbers of at least 0")
    return counts


def _write_names(
    sheet: Sheet, names: Sequence[str], heads: Sequence[str], left: float, top: float
) -> None:
    high = len(names) * _CELL
    for number, name in enumerate(names):
        y = top + (number + 0.5) * _CELL
        sheet.write(left - _GAP, y, name, color=WORD, ha="right")
    for number, head in enumerate(heads):
        x = left + (number + 0.4) * _CELL
        y = top - _GAP
        sheet.write(x, y, head, color=WORD, va="baseline", rotation=_SLANT_DEG)
    middle, below = top + high / 2.0, top + high + _CELL / 2.0
    sheet.write(MARGIN, middle, _THERE, ha="center", va="top", rotation=90.0)
    sheet.write(left + len(heads) * _CELL, below, _TAKEN, ha="right")


def _draw_cells(sheet: Sheet, counts: Counts, left: float, top: float) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Rectangle

    totals = counts.sum(axis=1)
    for (row, column), count in np.ndenumerate(counts):
        share = float(count / totals[row]) if totals[row] else 0.0
        ink = to_rgb(RIGHT if row == column else WRONG)
        x, y = left + column * _CELL, top + row * _CELL
        sheet.axes.add_patch(
            Rectangle(
                (x, y),
                _CELL,
                _CELL,
                facecolor=[1.0 - share**0.7 * (1.0 - part) for part in ink],
                edgecolor="#d0d7de",
                linewidth=0.6,
            )
        )
        if count:
            colour = "white" if share > _DARK else WORD
            middle = x + _CELL / 2.0, y + _CELL / 2.0
            is_right = row == column
            sheet.write(
                *middle,
                f"{count:,}",
                color=colour,
                fontweight="bold" if is_right else "normal",
                ha="center",
            )
    sheet.axes.add_patch(
        Rectangle(
            (left, top),
            counts.shape[1] * _CELL,
            counts.shape[0] * _CELL,
            fill=False,
            edgecolor=LINE,
            linewidth=0.8,
        )
    )


def _write_rates(sheet: Sheet, counts: Counts, left: float, top: float) -> None:
    right = counts.diagonal()
    totals = counts.sum(axis=1)
    x = left + _RATES
    for row, (good, total) in enumerate(zip(right, totals, strict=True)):
        y = top + (row + 0.5) * _CELL
        sheet.write(x, y, rate_text(int(good), int(total)), color=WORD, ha="right")
    whole = rate_text(int(right.sum()), int(totals.sum()))
    y = top + (len(counts) + 0.5) * _CELL
    sheet.write(x, y, whole, color="black", fontweight="bold", ha="right")

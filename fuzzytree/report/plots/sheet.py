"""A sheet of paper: axes in inches, on which words are measured before they stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = 8.0
"""Of letters, in points."""

LINE, FAINT, WORD = "#8c959f", "#57606a", "#24292f"
"""The colours of lines, of words beside others, and of words."""

MARGIN = 0.16
"""Around a picture, in inches."""

TITLE = 0.36
"""Of the words above a picture, in inches."""


class Sheet:
    """A figure whose axes count inches, x to the right and y down.

    Attributes:
        figure: As large as `resize` said.
        axes: All of it, without lines.
    """

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
            0, 0, text, fontsize=size, fontweight=_weight(bold), parse_math=False
        )
        wide: float = drawn.get_window_extent(self._renderer).width
        drawn.remove()
        return wide / self.figure.dpi

    def resize(self, width: float, height: float) -> None:
        """Make the sheet this large."""
        self.figure.set_size_inches(width, height)
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(height, 0.0)

    def write(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = SIZE,
        bold: bool = False,
        colour: str = FAINT,
        ha: Literal["left", "center", "right"] = "left",
        va: Literal["center_baseline", "baseline", "top", "center"] = "center_baseline",
        turn_deg: float = 0.0,
    ) -> None:
        """Write words; a name with the signs of a formula is no formula."""
        self.axes.text(
            x,
            y,
            text,
            fontsize=size,
            fontweight=_weight(bold),
            color=colour,
            ha=ha,
            va=va,
            rotation=turn_deg,
            rotation_mode="anchor",
            parse_math=False,
            zorder=3,
        )

    def write_title(self, text: str) -> None:
        """Write words at the top."""
        self.write(
            MARGIN, MARGIN, text, size=SIZE + 3, bold=True, colour="black", va="top"
        )


def _weight(bold: bool) -> Literal["bold", "normal"]:
    return "bold" if bold else "normal"


def short(text: str, longest: int) -> str:
    """Return a text in one line; what is longer than `longest` letters is cut.

    Example:
        >>> short("a hand  in 45 degrees", 10)
        'a hand in…'
    """
    text = " ".join(text.split())
    return text if len(text) <= longest else f"{text[: longest - 1].rstrip()}…"

"""Labels beside points, placed one after another where nothing lies under them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Boxes = npt.NDArray[np.float64]

SIZE = 8.0
"""Of letters, in points."""

_DISTANCES = (7.0, 12.0, 18.0, 26.0, 36.0, 48.0, 62.0, 80.0, 100.0)  # in points
_SIDES = tuple(
    (horizontal, vertical)
    for horizontal, vertical in itertools.product((1, -1, 0), (0, 1, -1))
    if horizontal or vertical
)
_DOT = 4.5  # half the width of a marker, in points
_LEADER = 14.0  # a label farther away is tied to its point by a line
_MARGIN = 1.5


class Label(NamedTuple):
    """What to write beside a point.

    Attributes:
        text: The words.
        axes: Where the point is drawn.
        x: Of the point, in its data.
        y: The same.
        colour: Of the words.
        is_needed: Whether it is placed even where it covers something.
    """

    text: str
    axes: Axes
    x: float
    y: float
    colour: str
    is_needed: bool = True


class Spot(NamedTuple):
    """Where a label may stand: its middle and box, in pixels.

    Attributes:
        across: From the point to the middle.
        above: The same, upwards.
        box: Left, bottom, right, top.
        is_far: Whether a line must tie it to its point.
    """

    across: float
    above: float
    box: npt.NDArray[np.float64]
    is_far: bool


def place(figure: Figure, labels: Sequence[Label], taken: Boxes) -> None:
    """Write labels beside their points; those that find no room are left out.

    Greedy: the labels come in their order, and each tries eight sides at growing
    distances and takes the first place that covers no marker and no label. Of a
    needed label that finds none, the place that covers least is taken.

    Args:
        figure: Whose layout is final.
        labels: The most important first.
        taken: Boxes that must stay free, shape (boxes, 4): left, bottom, right, top
            in pixels.
    """
    canvas: Any = figure.canvas
    renderer = canvas.get_renderer()
    scale = figure.dpi / 72.0
    dots = np.array([_dot(label, scale) for label in labels]).reshape(-1, 4)
    boxes = np.concatenate([taken, dots])
    for label in labels:
        width, height = _extent(label, renderer)
        spot = _best_spot(label, width, height, boxes, scale)
        if spot is not None:
            boxes = np.concatenate([boxes, spot.box[None]])
            _write(label, spot, scale)


def dots_of(axes: Axes, points: Boxes, scale: float) -> Boxes:
    """Return the boxes of markers at some points of axes, in pixels."""
    if not len(points):
        return np.empty((0, 4))
    middle = np.asarray(axes.transData.transform(points))
    half = _DOT * scale
    return np.concatenate([middle - half, middle + half], axis=1)


def _dot(label: Label, scale: float) -> npt.NDArray[np.float64]:
    point = np.array([[label.x, label.y]])
    box: npt.NDArray[np.float64] = dots_of(label.axes, point, scale)[0]
    return box


def _extent(label: Label, renderer: Any) -> tuple[float, float]:
    """Return the width and height of a label in pixels."""
    drawn = label.axes.text(0, 0, label.text, fontsize=SIZE)
    box = drawn.get_window_extent(renderer)
    drawn.remove()
    return box.width, box.height


def _best_spot(
    label: Label, width: float, height: float, boxes: Boxes, scale: float
) -> Spot | None:
    best: Spot | None = None
    least = np.inf
    frame = label.axes.get_window_extent()
    for spot in _spots(label, width, height, scale):
        left, bottom, right, top = spot.box
        if left < frame.x0 or right > frame.x1 or bottom < frame.y0 or top > frame.y1:
            continue
        covered = _covered(spot.box, boxes)
        if covered == 0.0:
            return spot
        if label.is_needed and covered < least:
            best, least = spot, covered
    return best


def _spots(label: Label, width: float, height: float, scale: float) -> Iterator[Spot]:
    """Yield the places of a label around its point, the nearest first."""
    point = label.axes.transData.transform((label.x, label.y))
    half = np.array([width, height]) / 2.0
    margin = _MARGIN * scale
    for distance, (right, up) in itertools.product(_DISTANCES, _SIDES):
        away = np.array([right, up]) * (distance * scale + half)
        middle = point + away
        box = np.concatenate([middle - half - margin, middle + half + margin])
        yield Spot(float(away[0]), float(away[1]), box, distance > _LEADER)


def _covered(box: npt.NDArray[np.float64], boxes: Boxes) -> float:
    """Return the area that a box shares with others."""
    low = np.maximum(boxes[:, :2], box[:2])
    high = np.minimum(boxes[:, 2:], box[2:])
    return float(np.prod(np.maximum(high - low, 0.0), axis=1).sum())


def _write(label: Label, spot: Spot, scale: float) -> None:
    line = {"arrowstyle": "-", "color": label.colour, "linewidth": 0.5, "shrinkB": 3}
    label.axes.annotate(
        label.text,
        (label.x, label.y),
        xytext=(spot.across / scale, spot.above / scale),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SIZE,
        color=label.colour,
        arrowprops=line if spot.is_far else None,
        zorder=6,
    )

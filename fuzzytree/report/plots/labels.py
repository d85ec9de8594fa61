"""Labels beside points, placed one after another where nothing lies under them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Boxes = npt.NDArray[np.float64]

SIZE = 8.0
"""Of letters, in points."""

_HALO = 2.0  # points of white around letters, so that lines under them do no harm
_WEIGHTS = (20.0, 1.0)  # of covering markers and words, and of covering lines

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
        is_needed: Whether it is placed even where it covers a marker or a label.
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
        leader: Boxes along the line that ties it to its point; none if it is near.
    """

    across: float
    above: float
    box: npt.NDArray[np.float64]
    leader: Boxes


def place(figure: Figure, labels: Sequence[Label], taken: Boxes) -> None:
    """Write labels beside their points; those that find no room are left out.

    Greedy: the labels come in their order, and each tries eight sides at growing
    distances and takes the place that covers least, the nearest of equal ones. Lines
    may be covered where it must be; markers and words by needed labels only.

    Args:
        figure: Whose layout is final.
        labels: The most important first.
        taken: Boxes of markers and words, shape (boxes, 4): left, bottom, right, top
            in pixels.
    """
    canvas: Any = figure.canvas
    renderer = canvas.get_renderer()
    scale = figure.dpi / 72.0
    lines = {axes: lines_of(axes, scale) for axes in figure.axes}
    for label in labels:
        width, height = _extent(label, renderer)
        spots = _spots(label, width, height, scale)
        spot = _best_spot(label, spots, taken, lines[label.axes])
        if spot is not None:
            taken = np.concatenate([taken, spot.box[None], spot.leader])
            _write(label, spot, scale)


def dots_of(axes: Axes, points: Boxes, scale: float) -> Boxes:
    """Return the boxes of markers at some points of axes, in pixels."""
    if not len(points):
        return np.empty((0, 4))
    middle = np.asarray(axes.transData.transform(points))
    half = _DOT * scale
    return np.concatenate([middle - half, middle + half], axis=1)


def lines_of(axes: Axes, scale: float) -> Boxes:
    """Return thin boxes around all lines of axes; they are level or upright."""
    paths = [
        line.get_transform().transform_path(line.get_path())
        for line in axes.lines
        if line.get_linestyle() != "None"
    ]
    for bars in axes.collections:
        paths += map(bars.get_transform().transform_path, bars.get_paths())
    points = [np.asarray(path.vertices, np.float64) for path in paths]
    if not points:
        return np.empty((0, 4))
    start = np.concatenate([line[:-1] for line in points])
    end = np.concatenate([line[1:] for line in points])
    half = 0.5 * scale
    low, high = np.minimum(start, end) - half, np.maximum(start, end) + half
    return np.concatenate([low, high], axis=1)


def _extent(label: Label, renderer: Any) -> tuple[float, float]:
    """Return the width and height of a label in pixels."""
    drawn = label.axes.text(0, 0, label.text, **_font(label))
    box = drawn.get_window_extent(renderer)
    drawn.remove()
    return box.width, box.height


def _best_spot(
    label: Label, spots: Iterable[Spot], taken: Boxes, lines: Boxes
) -> Spot | None:
    """Return the spot within the axes that covers least; None if none will do."""
    best: Spot | None = None
    least = np.inf
    frame = label.axes.get_window_extent()
    for spot in spots:
        left, bottom, right, top = spot.box
        if left < frame.x0 or right > frame.x1 or bottom < frame.y0 or top > frame.y1:
            continue
        hard = _covered(spot.box, taken)
        hard += sum(_covered(box, taken) for box in spot.leader)
        cost = _WEIGHTS[0] * hard + _WEIGHTS[1] * _covered(spot.box, lines)
        if cost < least and (label.is_needed or hard == 0.0):
            best, least = spot, cost
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
        leader = np.empty((0, 4))
        if distance > _LEADER:
            dots = point + np.linspace(_DOT * 2.0 / distance, 1.0, 16)[:, None] * away
            is_between = np.any((dots < box[:2]) | (dots > box[2:]), axis=1)
            dots = dots[is_between]
            leader = np.concatenate([dots - margin, dots + margin], axis=1)
        yield Spot(float(away[0]), float(away[1]), box, leader)


def _covered(box: npt.NDArray[np.float64], boxes: Boxes) -> float:
    """Return the area that a box shares with others."""
    low = np.maximum(boxes[:, :2], box[:2])
    high = np.minimum(boxes[:, 2:], box[2:])
    return float(np.prod(np.maximum(high - low, 0.0), axis=1).sum())


def _write(label: Label, spot: Spot, scale: float) -> None:
    from matplotlib.patheffects import withStroke

    ground = label.axes.get_facecolor()
    line = {"arrowstyle": "-", "color": label.colour, "linewidth": 0.5, "shrinkB": 3}
    words = label.axes.annotate(
        label.text,
        (label.x, label.y),
        xytext=(spot.across / scale, spot.above / scale),
        textcoords="offset points",
        ha="center",
        va="center",
        color=label.colour,
        arrowprops=line if len(spot.leader) else None,
        zorder=6,
        **_font(label),
    )
    words.set_path_effects([withStroke(linewidth=_HALO, foreground=ground)])


def _font(label: Label) -> Any:
    if label.is_needed:
        return {"fontsize": SIZE, "fontweight": "bold"}
    return {"fontsize": SIZE - 1.0}

"""The two pictures of the page: labels at the lines, colours for every eye."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from figures import drawn, style
from matplotlib.figure import Figure

from paper.inference import wilson
from paper.judging import PRIMARY, Line, Verdict, lines, verdicts
from paper.records import Claims

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#24292f"
FAINT = "#57606a"
COLOURS = {
    "reference": "#CC79A7",
    "native": "#0072B2",
    "onnxruntime float64": "#D55E00",
    "scikit-fuzzy": "#009E73",
}
TREE, RAW, WRONG, NONE = "#0072B2", "#E69F00", "#8c959f", "#d0d7de"
GAP = 0.24  # between labels at the end of lines, in decades
PANELS = tuple((kind, is_batch) for kind in ("raw", "relative") for is_batch in (0, 1))


def speed(claims: Claims) -> Figure:
    """Return how many times the tree's price each way of running rules costs."""
    figure = Figure(figsize=(10.0, 9.0), layout="constrained", facecolor="white")
    figure.suptitle(
        "What a rule base costs for a row, in units of its tree in the same runtime",
        color=INK,
        fontsize=13,
    )
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    found = list(lines(claims))
    for axis, (kind, is_batch) in zip(axes.flat, PANELS, strict=True):
        _plain(axis)
        rows = "rows in a batch" if is_batch else "one row at a time"
        axis.set_title(f"{kind} rules, {rows}", color=INK, fontsize=11, loc="left")
        chosen = [line for line in found if line.kind == kind]
        _growth(axis, [line for line in chosen if line.is_batch == bool(is_batch)])
    for axis in axes[:, 0]:
        axis.set_ylabel("times the tree's time", color=INK)
    figure.supxlabel(
        "rules n\n\nThick: multiway trees, bars are 95 % intervals. Thin: grown trees. "
        "Dashed: best-first.",
        color=FAINT,
        fontsize=9,
    )
    return figure


def svg(draw: Callable[[Claims], Figure], claims: Claims) -> bytes:
    """Return a picture as SVG: the same numbers give the same bytes."""
    with style():
        return drawn(draw(claims))


def _growth(axis: Axes, chosen: Sequence[Line]) -> None:
    axis.set_xscale("log")
    axis.set_yscale("log")
    sizes = sorted({size for line in chosen for size in line.sizes}) or [1]
    ends = [sizes[0], sizes[-1]]
    axis.plot(ends, ends, color=INK, linewidth=1.0, linestyle=":")
    axis.plot(ends, [1.0, 1.0], color=FAINT, linewidth=1.0)
    axis.annotate(
        "the tree",
        (sizes[0], 1.0),
        xytext=(0, -3),
        textcoords="offset points",
        color=FAINT,
        fontsize=9,
        va="top",
    )
    labels = [(float(sizes[-1]), "n times", INK)]
    for line in chosen:
        colour = COLOURS[line.runtime]
        is_first = line.family == PRIMARY
        style = "--" if line.what == "best-first" else "-"
        axis.plot(
            line.sizes,
            line.ratios,
            color=colour,
            linestyle=style,
            linewidth=2.0 if is_first else 0.9,
            alpha=1.0 if is_first else 0.55,
            gid=f"{line.what} {line.runtime} {line.family}",
        )
        if is_first:
            _bars(axis, line, colour)
            name = "best-first" if line.what == "best-first" else line.runtime
            if line.sizes[-1] == sizes[-1]:
                labels.append((line.ratios[-1], name, colour))
            else:
                place = (line.sizes[-1], line.ratios[-1])
                _label(axis, place, name, colour)
    heights = _apart([value for value, _, _ in labels])
    for (_, name, colour), height in zip(labels, heights, strict=True):
        _label(axis, (sizes[-1], height), name, colour)
    axis.set_xlim(sizes[0] / 1.3, sizes[-1] * 12)
    ratios = [ratio for line in chosen for ratio in line.ratios]
    axis.set_ylim(0.25, 3.0 * max([*ratios, sizes[-1]]))


def _bars(axis: Axes, line: Line, colour: str) -> None:
    known = [price.to_tree for price in line.prices if price.to_tree]
    below = [max(t.median - t.low, 0.0) for t in known]
    above = [max(t.high - t.median, 0.0) for t in known]
    axis.errorbar(
        line.sizes,
        line.ratios,
        yerr=[below, above],
        fmt="o",
        color=colour,
        markersize=3.5,
        elinewidth=1.2,
    )


def _label(axis: Axes, place: tuple[float, float], name: str, colour: str) -> None:
    axis.annotate(
        name.removesuffix(" float64"),
        place,
        xytext=(6, 0),
        textcoords="offset points",
        color=colour,
        fontsize=9,
        va="center",
    )


def _apart(values: Sequence[float]) -> list[float]:
    """Return heights near the values and at least `GAP` decades from each other."""
    step = 10.0**GAP
    order = sorted(range(len(values)), key=values.__getitem__)
    heights = list(values)
    for _ in range(100):  # each pass halves what overlaps
        for low, high in itertools.pairwise(order):
            ratio = heights[high] / heights[low]
            if ratio < step:
                push = (step / ratio) ** 0.5
                heights[low], heights[high] = heights[low] / push, heights[high] * push
    return heights


def agreement(claims: Claims) -> Figure:
    """Return where raw rules and tree differ, and which of them is right there."""
    found = verdicts(claims.comparisons)
    height = 1.8 + 0.3 * len(found)
    figure = Figure(figsize=(10.0, height), layout="constrained", facecolor="white")
    figure.suptitle("Raw rules and their tree on test rows", color=INK, fontsize=13)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2), sharey=True)
    for axis in (left, right):
        _plain(axis)
    _who_is_right(left, found)
    _share_of_tree(right, found)
    left.set_yticks(range(len(found)), [_name(verdict) for verdict in found])
    left.invert_yaxis()
    left.set_title(
        "answers that differ: who is right", color=INK, fontsize=11, loc="left"
    )
    right.set_title(
        "rows where one is right: the tree's share",
        color=INK,
        fontsize=11,
        loc="left",
    )
    return figure


def _name(verdict: Verdict) -> str:
    found = verdict.comparison
    return f"{found.table}, {found.mode}, {found.conjunction}"


def _who_is_right(axis: Axes, found: Sequence[Verdict]) -> None:
    names = ("tree", "raw rules", "neither", "no raw rule fires")
    colours = (TREE, RAW, WRONG, NONE)
    counts = [
        (one.tree_only, one.raw_only, one.both_wrong, one.uncovered)
        for one in (verdict.comparison for verdict in found)
    ]
    totals = [verdict.comparison.answers for verdict in found]
    start = [0.0] * len(found)
    for place, (name, colour) in enumerate(zip(names, colours, strict=True)):
        shares = [100 * c[place] / t for c, t in zip(counts, totals, strict=True)]
        axis.barh(range(len(found)), shares, left=start, color=colour, label=name)
        start = [a + b for a, b in zip(start, shares, strict=True)]
    for row, total in enumerate(start):
        axis.annotate(
            f"{total:.1f} %",
            (total, row),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            color=FAINT,
        )
    axis.set_xlim(0, max([*start, 1.0]) * 1.15)
    axis.set_xlabel("per cent of all answers", color=INK)
    axis.legend(loc="upper right", frameon=False, fontsize=9, labelcolor=INK)


def _share_of_tree(axis: Axes, found: Sequence[Verdict]) -> None:
    axis.axvline(50, color=FAINT, linewidth=1.0, linestyle=":")
    for row, verdict in enumerate(found):
        tree, raw = verdict.comparison.votes
        if not tree + raw:
            axis.text(50, row, "no such row", color=FAINT, fontsize=8.5, ha="center")
            continue
        share = tree / (tree + raw)
        low, high = wilson(share, tree + raw)
        colour = {"tree": TREE, "raw rules": RAW, "open": WRONG}[verdict.winner]
        axis.plot([100 * low, 100 * high], [row, row], color=colour, linewidth=2.0)
        axis.plot([100 * share], [row], "o", color=colour, markersize=6)
    axis.set_xlim(0, 100)
    axis.set_xlabel("per cent, 95 % interval; grey: open", color=INK)


def _plain(axis: Axes) -> None:
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    for side in ("bottom", "left"):
        axis.spines[side].set_color(FAINT)
    axis.tick_params(colors=INK, labelsize=9)
    axis.grid(color="#eaeef2", linewidth=0.8)
    axis.set_axisbelow(True)

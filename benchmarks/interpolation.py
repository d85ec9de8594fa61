"""Fuzzy interpolation beside others: where they differ, how near, and how fast.

    python benchmarks/interpolation.py [--draw] [--errors] [--times]

`--draw` writes the pictures of docs/explanation/interpolation.md; the other two print
its tables. Without any, all three are done. SciPy and OpenCV are measured where
installed.
"""

from __future__ import annotations

import argparse
import importlib.util
import timeit
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from figures import SIZE, drawn, style

from fuzzytree.tactile.interpolation import interpolated
from fuzzytree.tactile.plots import draw_frames
from fuzzytree.tactile.presses import read_frames
from fuzzytree.tactile.report.live import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fuzzytree.report import Picture

Floats = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs" / "explanation"
HAND = ROOT / "examples" / "tactile" / "hand.npz"  # a press of the simulator
TIMES = (3, 5, 7)
SIDE = 16
FIELDS = 200
MOST = 0.1  # the end of the scale of differences
_PANEL = 1.75  # inches
_COLOURS = ((255, 255, 255), *PALETTE[235:8:-1])  # white for nothing, dark for much


def main() -> None:
    """Do what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("draw", "errors", "times"):
        parser.add_argument(f"--{name}", action="store_true")
    asked = {name for name, wanted in vars(parser.parse_args()).items() if wanted}
    if not asked or "draw" in asked:
        (DOCS / "interpolation-weights.svg").write_bytes(drawn(picture_of_weights()))
        picture_of_a_hand().save(DOCS / "interpolation-hand.svg")
    if not asked or "errors" in asked:
        print_errors()
    if not asked or "times" in asked:
        print_times()


def bilinear(cells: npt.NDArray[Any], times: int) -> Floats:
    """Return bilinear values at the points of `interpolated`."""
    found: Floats = np.asarray(cells, np.float64)
    for axis in (-1, -2):
        side = found.shape[axis]
        place = (2 * np.arange(times * side) + 1 - times) / (2 * times)
        before = np.floor(place).astype(int)
        share = place - before
        if axis == -2:
            share = share[:, None]
        near = found.take(np.clip(before, 0, side - 1), axis)
        far = found.take(np.clip(before + 1, 0, side - 1), axis)
        found = near * (1.0 - share) + far * share
    return found


def picture_of_weights() -> Figure:
    """Draw how much a cell weighs around its centre, both ways, and the difference."""
    times = 61
    single = np.zeros((3, 3), np.uint8)
    single[1, 1] = 1
    fuzzy, plain = interpolated(single, times), bilinear(single, times)
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.colors import ListedColormap
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 2.75))
        FigureCanvasAgg(figure)
        high = _PANEL / 2.75
        first, second, third, lines = (
            figure.add_axes((left / 8.0, 0.165, _PANEL / 8.0, high))
            for left in (0.1, 2.0, 3.9, 6.12)
        )
        levels = np.linspace(0.1, 0.9, 9)
        strong = {
            "vmin": 0.0,
            "vmax": 1.0,
            "cmap": ListedColormap(np.divide(_COLOURS, 255)),
        }
        _show(first, fuzzy, "fuzzy", levels, strong)
        _show(second, plain, "bilinear", levels, strong)
        levels = np.delete(np.linspace(-MOST, MOST, 11), 5)  # 0 is no line but a plane
        both = {"vmin": -MOST, "vmax": MOST, "cmap": "PuOr"}
        _show(third, fuzzy - plain, "fuzzy minus bilinear", levels, both)
        for axes in (first, second):
            axes.set_xlabel("cells from the centre; a line each 0.1", fontsize=SIZE - 1)
        text = "violet more, orange less, each 0.02"
        third.set_xlabel(text, fontsize=SIZE - 1)
        _draw_profiles(lines, fuzzy, plain, times)
        title = "How much a cell weighs around its centre"
        figure.text(0.012, 0.97, title, fontsize=SIZE + 3, fontweight="bold", va="top")
    return figure


def _show(
    axes: Axes, image: Floats, title: str, levels: Floats, options: Mapping[str, Any]
) -> None:
    """Draw weights within a cell of the centre, with lines of equal weight."""
    ends = (-1.5, 1.5, -1.5, 1.5)
    axes.imshow(image, interpolation="none", extent=ends, **options)
    dark = np.abs(levels) > 0.55
    axes.contour(
        image,
        levels=levels,
        extent=ends,
        origin="upper",
        colors=["white" if is_dark else "#24292f" for is_dark in dark],
        linewidths=0.5,
        linestyles="solid",
    )
    axes.set_xlim(-1.0, 1.0)
    axes.set_ylim(-1.0, 1.0)
    axes.set_xticks([-1, 0, 1], ["-1", "0", "1"])
    axes.set_yticks([])
    axes.tick_params(labelsize=SIZE - 1, length=2.5)
    axes.set_title(title, fontsize=SIZE + 1, pad=5)


def _draw_profiles(axes: Axes, fuzzy: Floats, plain: Floats, times: int) -> None:
    """Draw the weights along a row of cells, and along a diagonal."""
    place = (2 * np.arange(3 * times) + 1 - 3 * times) / (2 * times)
    middle = 3 * times // 2
    axes.plot(place, fuzzy[middle], color="#8c959f", label="both, along a row")
    axes.plot(place, fuzzy.diagonal(), color="#0072b2", label="fuzzy, diagonal")
    axes.plot(
        place, plain.diagonal(), color="#c04d00", linestyle="--",
        label="bilinear, diagonal",
    )  # fmt: skip
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.02)
    axes.tick_params(labelsize=SIZE - 1, length=2.5)
    axes.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    axes.set_title("weight", fontsize=SIZE + 1, pad=5)
    axes.set_xlabel("cells to the right (and up)", fontsize=SIZE - 1)
    axes.legend(fontsize=SIZE - 1.5, frameon=False, handlelength=1.6)


def picture_of_a_hand() -> Picture:
    """Draw a press of a hand at each number of times (paper, Fig. 6)."""
    given = read_frames(HAND)
    title = "One press of a hand, interpolated"
    return draw_frames(given.sensor, given.frames, [title])


def fields(width: float) -> Iterator[Callable[[Floats, Floats], Floats]]:
    """Yield smooth fields of pressure: three round hills of that width each."""
    chance = np.random.default_rng(7)
    for _ in range(FIELDS):
        x, y = chance.uniform(0.0, SIDE, (2, 3))
        high = chance.uniform(0.3, 1.0, 3)

        def field(
            right: Floats, up: Floats, x: Floats = x, y: Floats = y, high: Floats = high
        ) -> Floats:
            far = (right[..., None] - x) ** 2 + (up[..., None] - y) ** 2
            found: Floats = (high * np.exp(-far / (2.0 * width**2))).sum(axis=-1)
            return found

        yield field


def ways() -> Mapping[str, Callable[[Floats, int], Floats]]:
    """Return the ways to interpolate; all give the same points."""
    found: dict[str, Callable[[Floats, int], Floats]] = {
        "nearest": lambda cells, n: np.repeat(np.repeat(cells, n, 0), n, 1),
        "fuzzy": lambda cells, n: interpolated(_whole(cells), n) / _UNIT,
        "bilinear": bilinear,
    }
    if importlib.util.find_spec("scipy"):
        from scipy import ndimage

        def spline(cells: Floats, times: int) -> Floats:
            found: Any = ndimage.zoom(
                cells, times, order=3, mode="nearest", grid_mode=True
            )
            return np.asarray(found, np.float64)

        found["cubic spline"] = spline
    return found


_UNIT = 2.0**40


def _whole(cells: Floats) -> npt.NDArray[np.int64]:
    """Return pressures as the whole numbers that `interpolated` takes."""
    return np.rint(cells * _UNIT).astype(np.int64)


def print_errors() -> None:
    """Print the errors of smooth fields, as shares of the highest pressure."""
    print(f"| width of a hill | {' | '.join(ways())} |")
    print(f"| --- |{' --- |' * len(ways())}")
    for width in (0.75, 1.0, 1.5, 2.0, 3.0):
        squares = dict.fromkeys(ways(), 0.0)
        worst = dict.fromkeys(ways(), 0.0)
        for field in fields(width):
            cells, points = (_sampled(field, times) for times in (1, 7))
            top = float(cells.max())
            for name, way in ways().items():
                error = (way(cells, 7) - points)[7:-7, 7:-7] / top
                squares[name] += float(np.mean(error**2)) / FIELDS
                worst[name] = max(worst[name], float(np.abs(error).max()))
        row = [f"{squares[k] ** 0.5:.2%} ({worst[k]:.1%})" for k in squares]
        print(f"| {width:g} cells | {' | '.join(row).replace('%', ' %')} |")


def _sampled(field: Callable[[Floats, Floats], Floats], times: int) -> Floats:
    place = (np.arange(SIDE * times) + 0.5) / times
    return field(*np.meshgrid(place, place))


def print_times() -> None:
    """Print microseconds for a frame of 16 x 16 cells."""
    chance = np.random.default_rng(1)
    frames = chance.integers(0, 256, (1000, SIDE, SIDE), dtype=np.uint8)
    print("| | 3 times | 5 times | 7 times |\n| --- | --- | --- | --- |")
    for name, step in _candidates(frames).items():
        cells = [f"{_microseconds(step, times):.3g}" for times in TIMES]
        print(f"| {name} | {' | '.join(cells)} |")


def _candidates(frames: npt.NDArray[np.uint8]) -> dict[str, Callable[[int], float]]:
    """Return what does some frames, and how many they were."""
    one, single = frames[0], frames[0].astype(np.float32)
    double = single.astype(np.float64)

    def alone(times: int) -> float:
        interpolated(one, times)
        return 1.0

    def alone32(times: int) -> float:
        interpolated(one, times, dtype=np.float32)
        return 1.0

    def many(times: int) -> float:
        interpolated(frames, times)
        return float(len(frames))

    def many32(times: int) -> float:
        interpolated(frames, times, dtype=np.float32)
        return float(len(frames))

    found: dict[str, Callable[[int], float]] = {
        "fuzzy, one frame": alone,
        "fuzzy, one frame, float32": alone32,
        "fuzzy, 1000 frames, each": many,
        "fuzzy, 1000 frames, float32, each": many32,
    }
    if importlib.util.find_spec("scipy"):
        from scipy import ndimage

        def zoomed(times: int) -> float:
            ndimage.zoom(double, times, order=1, mode="nearest", grid_mode=True)
            return 1.0

        found["SciPy `zoom`, order 1 (bilinear), one frame"] = zoomed
    if importlib.util.find_spec("cv2"):
        import cv2

        def resized(times: int) -> float:
            cv2.resize(single, None, fx=times, fy=times)
            return 1.0

        found["OpenCV `resize` (bilinear), one frame, float32"] = resized
    return found


def _microseconds(step: Callable[[int], float], times: int) -> float:
    """Return the least time for a frame: others on the machine only add to it."""
    frames = step(times)
    number = 1 if frames > 1.0 else 300
    rounds = timeit.repeat(lambda: step(times), number=number, repeat=9)
    return min(rounds) / number / frames * 1e6


if __name__ == "__main__":
    main()

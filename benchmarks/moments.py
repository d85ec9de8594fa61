"""Errors of moments against fractions, and what features cost in time.

python benchmarks/moments.py            print both tables
python benchmarks/moments.py --write    put the errors into docs/explanation/moments.md
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from fractions import Fraction
from math import comb
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from exact_features import exact_features

from fuzzytree.tactile.features import costs
from fuzzytree.tactile.features.names import FEATURES, PAPER
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "moments.md"
SENSOR = Sensor(32, 32)
_ROWS, _COLUMNS = np.mgrid[:32, :32]


def blobs(count: int = 40, seed: int = 3) -> Cells:
    """Return frames with one round object each."""
    draw = np.random.default_rng(seed)
    frames = np.empty((count, 32, 32), np.int64)
    for frame in frames:
        x, wide, y, high = draw.uniform([12, 2, 12, 2], [20, 7, 20, 7])
        away = ((_COLUMNS - x) / wide) ** 2 + ((_ROWS - y) / high) ** 2
        frame[:] = np.rint(250 * np.exp(-away / 2))
    return frames


def nearly_symmetric(frames: Cells) -> Cells:
    """Return frames that a half turn changes in one count."""
    found = np.maximum(frames, frames[:, ::-1, ::-1])
    found[:, 5, 9] += 1
    return np.asarray(np.minimum(found, 255))


def raw_then_binomial(frames: Cells) -> FloatArray:
    """Return S1 to S11 from sums about the corner, moved to the centre at the end."""
    g = frames / 255.0
    x, y = _COLUMNS.astype(float), -_ROWS.astype(float)

    def about_corner(p: int, q: int) -> FloatArray:
        return np.asarray((g * x**p * y**q).sum(axis=(1, 2)))

    mass = about_corner(0, 0)
    cx, cy = about_corner(1, 0) / mass, about_corner(0, 1) / mass

    def m(p: int, q: int) -> FloatArray:
        total = np.zeros_like(mass)
        for i in range(p + 1):
            for j in range(q + 1):
                weight = comb(p, i) * comb(q, j) * (-cx) ** (p - i) * (-cy) ** (q - j)
                total += weight * about_corner(i, j)
        return total

    c20 = m(2, 0) - m(0, 2) + 2j * m(1, 1)
    c30 = m(3, 0) - 3 * m(1, 2) + 1j * (3 * m(2, 1) - m(0, 3))
    c21 = m(3, 0) + m(1, 2) + 1j * (m(2, 1) + m(0, 3))
    c40 = m(4, 0) - 6 * m(2, 2) + m(0, 4) + 4j * (m(3, 1) - m(1, 3))
    c31 = m(4, 0) - m(0, 4) + 2j * (m(3, 1) + m(1, 3))
    return np.array(
        [
            m(2, 0) + m(0, 2),
            *(abs(c) ** 2 for c in (c20, c30, c21)),
            2 * (c30.conj() * c21**3).real,
            2 * (c21**2 * c20.conj()).real,
            *(abs(c) ** 2 for c in (c40, c31)),
            m(4, 0) + 2 * m(2, 2) + m(0, 4),
            2 * (c40.conj() * c31**2).real,
            2 * (c31 * c20.conj()).real,
        ]
    )


WAYS: dict[str, Callable[[Cells], FloatArray]] = {
    "raw then binomial": raw_then_binomial,
    "frames": lambda frames: FramePlan(SENSOR, PAPER)(frames).values,
}


def errors(found: FloatArray, exact: list[tuple[Fraction, ...]]) -> list[float]:
    """Return the largest relative error of each feature."""
    return [
        max(
            float(abs(Fraction(float(value)) - wanted[line]) / abs(wanted[line]))
            for value, wanted in zip(found[line], exact, strict=True)
        )
        for line in range(len(found))
    ]


def error_table() -> str:
    """Return the errors as a table in Markdown."""
    lines = [f"| frames | computed as | {' | '.join(PAPER)} |"]
    lines.append("| --- " * (len(PAPER) + 2) + "|")
    for title, frames in (
        ("blobs", blobs()),
        ("nearly symmetric", nearly_symmetric(blobs())),
    ):
        exact = [exact_features(SENSOR, frame, PAPER) for frame in frames]
        for way, computed in WAYS.items():
            cells = [f"{error:.0e}" for error in errors(computed(frames), exact)]
            lines.append(f"| {title} | {way} | {' | '.join(cells)} |")
    return "\n".join(lines)


def cost_lines(count: int = 20_000) -> list[str]:
    """Return each feature's cost in operations beside its time."""
    sensor = Sensor(16, 16)
    frames = np.random.default_rng(0).integers(0, 256, (count, 16, 16))
    frames = frames.astype(np.uint8)
    known = costs(sensor, list(FEATURES))
    lines: list[str] = []
    times: list[float] = []
    for name in FEATURES:
        plan, best = FramePlan(sensor, [name]), np.inf
        for _ in range(5):
            begin = time.perf_counter()
            plan(frames)
            best = min(best, time.perf_counter() - begin)
        times.append(best / count * 1e9)
        lines.append(f"{known[name]:8.0f} {times[-1]:8.0f} ns  {name}")
    one, two = np.argsort(np.argsort([list(known.values()), times], axis=1), axis=1)
    ranked = np.atleast_2d(np.corrcoef(one, two))[0, 1]
    lines.append(f"correlation of their ranks {ranked:.2f}")
    return lines


def main() -> None:
    """Print the tables, or write the first one."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true")
    table = error_table()
    if parser.parse_args().write:
        head, mark, rest = PAGE.read_text("utf-8").partition("<!-- errors -->\n")
        after = rest.partition("\n`raw then binomial` is")
        PAGE.write_text(f"{head}{mark}\n{table}\n{after[1]}{after[2]}", "utf-8")
        return
    print(table, *cost_lines(), sep="\n")


if __name__ == "__main__":
    main()

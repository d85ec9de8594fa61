"""Fuzzylite 6 compiled with a smaller bound for what it takes for equal.

The program takes values within 1e-6 for equal. Where only that parts its answers from
ours, the same library without it must give our numbers.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

SOURCE = Path(__file__).with_name("fuzzylite_exact.cpp")
USUAL, NONE = "1e-6", "1e-16"
"""The bound of fuzzylite's program, and one below the distance of doubles."""


def compiled(compiler: str, folder: Path) -> Path:
    """Return the program, made by a C++ compiler with Debian's libfuzzylite-dev."""
    target = folder / "fuzzylite_exact"
    words = [compiler, "-O1", str(SOURCE), "-o", str(target), "-lfuzzylite"]
    subprocess.run(words, check=True, capture_output=True, timeout=300)
    return target


def exact_answers(
    engine: Path,
    content: bytes,
    rows: Sequence[Sequence[float]],
    kind: str,
    *,
    bound: str = NONE,
) -> list[tuple[float, ...]]:
    """Return the outputs for each row, by a file of a kind (fll, fcl or fis)."""
    model = engine.with_name(f"exact.{kind}")
    model.write_bytes(content)
    done = subprocess.run(
        [engine, model, bound],
        input="".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows),
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    lines = done.stdout.splitlines()
    found = [tuple(map(float, line.split())) for line in lines]
    assert len(found) == len(rows)
    return found

"""The paper's claims about speed and reliability, measured.

    python benchmarks/claims.py [--quick] [--budget SECONDS] [--folder FOLDER]

It takes six minutes on one free core. After Ctrl-C, what was measured by then is
written. With --quick, a trial of half a minute is written into out/ and not into
docs/explanation/. With --again, the page and its pictures are made from the numbers of
the last time.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from paper import pictures
from paper.agreement import LOADERS, comparisons
from paper.page import page
from paper.records import Claims, Comparison, Size, from_json
from paper.speed import ROUNDS, SIZES, Bench

from fuzzytree.benchmarking.machine import after, machine
from fuzzytree.files import write_atomically

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("matplotlib", "onnx", "onnxruntime", "scikit-fuzzy", "scikit-learn")
SEEDS = 5
QUICK_SIZES = (7, 50, 300)
SHARE = 0.4  # of the time for the data sets


def main() -> int:
    """Measure and write what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few sizes, one seed")
    parser.add_argument("--again", action="store_true", help="measure nothing")
    parser.add_argument("--budget", type=float, default=400.0, metavar="SECONDS")
    parser.add_argument(
        "--folder", type=Path, help="docs/explanation, or out with --quick"
    )
    options = parser.parse_args()
    if not options.budget > 0:
        parser.error(f"the budget must be more than 0 seconds, not {options.budget:g}")
    folder = options.folder or ROOT / ("out" if options.quick else "docs/explanation")
    if options.again:
        claims = from_json((folder / "claims.json").read_bytes())
    else:
        claims = measured(options.budget, is_quick=options.quick)
    write(claims, folder)
    print(f"wrote {folder / 'claims.md'}")
    return 0


def measured(budget: float, *, is_quick: bool) -> Claims:
    """Measure everything, or what there was time for."""
    begin = time.monotonic()
    before = machine(PACKAGES)
    tables = ["iris", "wine"] if is_quick else list(LOADERS)
    found: list[Comparison] = []
    sizes: list[Size] = []
    omissions: list[str] = []
    bench = Bench(rounds=3 if is_quick else ROUNDS, tell=_tell)
    try:
        seeds = 1 if is_quick else SEEDS
        for one in comparisons(tables, seeds, seconds=budget * SHARE, tell=_tell):
            found.append(one)
        done = len(found[0].of_seeds)
        if done < seeds:
            omissions.append(f"{seeds - done} of {seeds} seeds: the time was over")
        left = budget - (time.monotonic() - begin)
        numbers = QUICK_SIZES if is_quick else SIZES
        for size in bench.sizes(numbers, seconds=left):
            sizes.append(size)
    except KeyboardInterrupt:
        omissions.append("what came after an interruption by the user")
    omissions += bench.omissions
    return Claims(
        after(before, ()),
        tuple(sizes),
        tuple(found),
        tuple(omissions),
        is_quick,
    )


def write(claims: Claims, folder: Path) -> None:
    """Write the page, its pictures and the numbers into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "claims.json", claims.to_json().encode())
    write_atomically(folder / "claims.md", page(claims).encode())
    for name, picture in (
        ("claims-speed.svg", pictures.speed),
        ("claims-agreement.svg", pictures.agreement),
    ):
        write_atomically(folder / name, pictures.svg(picture, claims))


def _tell(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

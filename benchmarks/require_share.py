"""How many requirements on third-party systems are decided, and in how much CPU time.

`python benchmarks/require_share.py` takes 20 systems of pyfuzzylite with an output, and
requires of each that the output stays above what random rows show (less 5 % of what
they span), that it rises with the first input, changes by at most three times that
slope which would lead from its least to its largest value, and exists everywhere.
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path

import fuzzylite
import numpy as np

import fuzzytree as ft
from fuzzytree.model import FuzzySystem
from fuzzytree.runtimes import run_system

SYSTEMS, ROWS = 20, 1000


def main() -> None:
    """Print a line for each system, then the shares."""
    root = Path(fuzzylite.__file__).parent / "examples"
    files = [one for one in sorted(root.rglob("*.fll")) if "terms" not in one.parts]
    counts: Counter[str] = Counter()
    begin = time.process_time()
    for file in files[:: len(files) // SYSTEMS][:SYSTEMS]:
        start = time.process_time()
        result = ft.require(str(file), sentences(str(file)), allow_loss=True)
        verdicts = [answer.verdict for answer in result.answers]
        counts.update(verdicts)
        spent = time.process_time() - start
        print(f"{spent:6.2f} s  {file.relative_to(root)}: {', '.join(verdicts)}")
        for answer in result.answers:
            if answer.verdict == "OPEN":
                print(f"          {answer.requirement}: {answer.sentence}")
    spent = time.process_time() - begin
    print(f"{dict(counts)} of {counts.total()} in {spent:.1f} s")


def sentences(file: str) -> list[str]:
    """Return four requirements on the first output of a system."""
    system = ft.load(file, allow_loss=True)
    assert isinstance(system, FuzzySystem)
    chance, inputs = np.random.default_rng(0), system.variables
    ends = [(one.low or 0.0, 1.0 if one.high is None else one.high) for one in inputs]
    rows = np.array([chance.uniform(*pair, ROWS) for pair in ends])
    output, x = system.outputs[0], inputs[0]
    seen = run_system(system)(rows).outputs
    assert seen is not None
    low, high = np.nanmin(seen), np.nanmax(seen)
    slope = 3.0 * (high - low) / (ends[0][1] - ends[0][0])
    return [
        f"'{output.name}' is at least {float(low - 0.05 * (high - low))!r}",
        f"'{output.name}' rises with '{x.name}'",
        f"'{output.name}' changes by at most {float(slope)!r} per '{x.name}'",
        "every input gets an output",
    ]


if __name__ == "__main__":
    main()

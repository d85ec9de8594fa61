"""N3: neither the order of rows nor their company changes a bit of an answer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.checking.stability.carriers import Ready, made_ready, ready, unequal
from fuzzytree.checking.stability.results import Criterion, judged
from fuzzytree.model.contracts import Model, Outcome, Runtime

if TYPE_CHECKING:
    from fuzzytree.checking.stability.carriers import BoolArray
    from fuzzytree.model.contracts import FloatArray

BATCHES = (1, 7, 33, 1000)
"""Rows answered at a time."""

_CALLS = 40  # batches of each size, taken from all over the rows
_ADVICE = (
    "the runtime's answer to a row depends on the rows beside it; fix the order of its "
    "sums, or use another one"
)


def order(model: Model, runtimes: Sequence[Runtime], values: FloatArray) -> Criterion:
    """Permute, repeat and cut up the rows, and reorder the inputs; demand equal bits.

    Args:
        model: A tree or a rule base.
        runtimes: What to run.
        values: Shape (inputs, rows).
    """
    faults: list[str] = []
    skipped: list[str] = []
    cases = 0
    for one in ready(model, runtimes, skipped):
        rows = one.some(values)
        whole = one.run(rows)
        for said, wrong in (*_tries(one, rows, whole), *_renumbered(one, rows, whole)):
            cases += wrong.size
            if wrong.any():
                faults.append(
                    f"{one.title}: {int(wrong.sum())} of {wrong.size} rows are "
                    f"answered differently {said}"
                )
    return judged("N3", cases, faults, advice=_ADVICE, skipped=skipped)


def _tries(
    one: Ready, rows: FloatArray, whole: Outcome
) -> Iterator[tuple[str, BoolArray]]:
    """Yield what was done to the rows, and which were then answered differently."""
    count = rows.shape[1]
    mixed = np.random.default_rng(0).permutation(count)
    yield "in another order", unequal(one.run(rows[:, mixed]), whole.part(mixed))
    twice = np.repeat(np.arange(count), 2)
    yield (
        "when each stands twice",
        unequal(one.run(rows[:, twice]), whole.part(twice)),
    )
    large = max(BATCHES)
    if count < large and not one.runtime.is_slow:
        many = np.resize(np.arange(count), large)
        yield f"among {large}", unequal(one.run(rows[:, many]), whole.part(many))
    for size in BATCHES:
        starts = np.arange(0, count, size)
        for start in starts[:: -(-len(starts) // _CALLS)] if size < count else ():
            some = np.arange(start, min(start + size, count))
            found = one.run(np.ascontiguousarray(rows[:, some]))
            yield f"in a batch of {len(some)}", unequal(found, whole.part(some))


def _renumbered(
    one: Ready, rows: FloatArray, whole: Outcome
) -> Iterator[tuple[str, BoolArray]]:
    """Yield the same for a model whose inputs stand in the opposite order."""
    inputs = [v for v in one.model.variables if not v.parts]
    if len(inputs) < 2:
        return
    others = [v for v in one.model.variables if v.parts]
    turned = msgspec.structs.replace(one.model, variables=(*reversed(inputs), *others))
    after = made_ready(one.representation, turned, one.runtime, [])
    if after is not None:
        found = after.run(np.ascontiguousarray(rows[::-1]))
        yield "when the inputs stand in another order", unequal(found, whole)

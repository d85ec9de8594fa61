"""Where engines answer otherwise by a file that does not say which one it is for."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from msgspec.structs import replace

from fuzzytree.model import FloatArray, FuzzySystem, Loss, Reading
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Aim, range_rows, system_probes

_ROWS = 200  # of each kind: on landmarks, drawn evenly, and aimed at rules
_AGREEMENT = 1e-9  # relative; engines of one meaning are as near in our tests


def with_answers(reading: Reading, rivals: Iterable[Reading]) -> Reading:
    """Return a reading that names a point where rivals have another answer.

    A difference is a loss. It is a remark if it is gone where both look at the same
    samples of a range, which is an error of either engine and no other meaning.

    Args:
        reading: What was read of a file that names no dialect.
        rivals: The same file, as other engines have it.
    """
    losses, remarks = list(reading.losses), list(reading.remarks)
    for rival in rivals:
        first, second = reading.model, rival.model
        if not isinstance(first, FuzzySystem) or not isinstance(second, FuzzySystem):
            continue
        names = reading.dialect, rival.dialect
        way_out = f"pass --from {names[0]} or --from {names[1]}"
        outputs = [
            replace(output, defuzzifier=other.defuzzifier)
            for output, other in zip(second.outputs, first.outputs, strict=True)
        ]
        alike = replace(second, outputs=tuple(outputs))
        if sentence := _difference(first, alike, names):
            losses.append(Loss("engines", f"{sentence}; {way_out}"))
        elif sentence := _difference(first, second, names):
            remarks.append(f"engines sample ranges otherwise: {sentence}; {way_out}")
    return replace(reading, losses=tuple(losses), remarks=tuple(remarks))


def _difference(
    first: FuzzySystem, second: FuzzySystem, names: tuple[str, str]
) -> str | None:
    """Return what two systems answer where they differ most; None if they agree.

    Rows to which one of them has no number are left out: it is no answer.
    """
    if first == second:
        return None
    values = _values(first)
    answers = [run_system(system)(values).outputs for system in (first, second)]
    apart = np.abs(answers[0] - answers[1])
    apart /= np.maximum(np.abs(answers[0]), 1.0)
    apart = np.where(np.isfinite(apart), apart, 0.0)
    if not apart.size or apart.max() <= _AGREEMENT:
        return None
    output, row = np.unravel_index(apart.argmax(), apart.shape)
    point = [
        f"{name} = {value!r}"
        for name, value in zip(first.inputs, values[:, row].tolist(), strict=True)
    ]
    shown = [
        f"{answer[output, row]:.9g} in {name}"
        for answer, name in zip(answers, names, strict=True)
    ]
    return (
        f"{first.outputs[output].name} is {' and '.join(shown)} at {', '.join(point)}"
    )


def _values(system: FuzzySystem) -> FloatArray:
    """Return rows that tell meanings apart, of shape (columns, rows).

    Numbers have four digits, so that people can try what they read.
    """
    aim = Aim(system)
    rows = [*range_rows(system, _ROWS), *system_probes(system, limit=_ROWS)]
    rows += [aim.row(rule) for rule in system.rules[:_ROWS]]
    table = [[float(f"{row[name]:.4g}") for row in rows] for name in system.inputs]
    values = np.array(table, np.float64).reshape(len(system.inputs), len(rows))
    result: FloatArray = values[:, np.isfinite(values).all(axis=0)]
    return result

"""Where engines answer otherwise by a file that does not say which one it is for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, FuzzySystem, Loss, Reading
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Aim, range_rows, system_probes

_ROWS = 200  # of each kind: on landmarks, drawn evenly, and aimed at rules
_AGREEMENT = 1e-9  # relative; engines of one meaning are as near in our tests


def with_answers(reading: Reading, read: Callable[..., Reading]) -> Reading:
    """Return a reading that names a point where rivals have another answer.

    A difference is a loss. It is a remark if it is gone where both look at the same
    samples of a range, which is an error of either engine and no other meaning.

    Args:
        reading: What was read of a file that names no dialect.
        read: Reads the same file in another `dialect`.
    """
    losses, remarks = list(reading.losses), list(reading.remarks)
    for dialect in reading.rivals:
        try:
            rival = read(dialect=dialect)
        except ReadError:
            continue  # that engine refuses the file
        first, second = reading.model, rival.model
        if not isinstance(first, FuzzySystem) or not isinstance(second, FuzzySystem):
            continue
        outputs = [
            replace(output, defuzzifier=other.defuzzifier)
            for output, other in zip(second.outputs, first.outputs, strict=True)
        ]
        alike = replace(second, outputs=tuple(outputs))
        systems = {reading.dialect: first, rival.dialect: second}
        if place := _place(first, alike):
            losses.append(Loss("engines", _sentence(systems, *place)))
        elif place := _place(first, second):
            sentence = _sentence(systems, *place)
            remarks.append(f"engines sample ranges otherwise: {sentence}")
    return replace(reading, losses=tuple(losses), remarks=tuple(remarks))


def _place(first: FuzzySystem, second: FuzzySystem) -> tuple[int, FloatArray] | None:
    """Return the output and the values at which two systems differ most, if they do.

    Rows to which one of them has no number are left out: it is no answer.
    """
    if first == second:
        return None
    values = _values(first)
    answers = [_outputs(system, values) for system in (first, second)]
    apart = np.abs(answers[0] - answers[1]) / np.maximum(np.abs(answers[0]), 1.0)
    apart = np.where(np.isfinite(apart), apart, 0.0)
    if not apart.size or apart.max() <= _AGREEMENT:
        return None
    output, row = np.unravel_index(apart.argmax(), apart.shape)
    return int(output), values[:, [row]]


def _sentence(
    systems: Mapping[str, FuzzySystem], output: int, values: FloatArray
) -> str:
    """Return what dialects of a file answer to one row, and how to choose one."""
    answers = [
        f"{_outputs(system, values)[output, 0]:.9g} in {name}"
        for name, system in systems.items()
    ]
    system, *_ = systems.values()
    row = zip(system.inputs, values[:, 0].tolist(), strict=True)
    point = ", ".join(f"{name} = {value!r}" for name, value in row)
    choice = " or ".join(f"--from {name}" for name in systems)
    name = system.outputs[output].name
    return f"{name} is {' and '.join(answers)} at {point}; pass {choice}"


def _outputs(system: FuzzySystem, values: FloatArray) -> FloatArray:
    outputs = run_system(system)(values).outputs
    assert outputs is not None  # a system has some; for type checkers
    return outputs


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

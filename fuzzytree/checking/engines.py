"""Where engines answer otherwise by a file that does not say which one it is for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, FuzzySystem, Loss, Reading, SystemOutput
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Aim, infer, range_rows, system_probes

_ROWS = 200  # of each kind: on landmarks, drawn evenly, and aimed at rules
_FEW = 4  # which are tried before all
_AGREEMENT = 1e-9  # of the largest number; engines of one meaning are nearer in tests


def with_answers(reading: Reading, read: Callable[..., Reading]) -> Reading:
    """Return a reading that names a point where rivals have another answer.

    A difference is a loss. It is a remark if it is gone where both look at the same
    samples of a range, which is an error of either engine and no other meaning.

    Args:
        reading: What was read of a file that names no dialect.
        read: Reads the same file in another `dialect`.
    """
    if not reading.model.outputs:
        return reading
    system = cast("FuzzySystem", reading.model)
    losses, remarks = list(reading.losses), list(reading.remarks)
    values = _values(system)
    for dialect in reading.rivals:
        try:
            rival = read(dialect=dialect)
        except ReadError:
            continue  # that engine refuses the file
        other = cast("FuzzySystem", rival.model)  # of the same file
        if other == system:
            continue
        alike = replace(other, outputs=_alike(other.outputs, system.outputs))
        meant = None if alike == system else _place(system, alike, values)
        place = meant or _place(system, other, values)
        if place is None:
            continue
        output, row = place
        point = dict(zip(system.inputs, values[:, row].tolist(), strict=True))
        ours, theirs = (infer(one, point).outputs[output] for one in (system, other))
        sentence = (
            f"{system.outputs[output].name} is {ours:.9g} in "
            f"{reading.dialect} and {theirs:.9g} in {rival.dialect} at "
            f"{', '.join(f'{name} = {value!r}' for name, value in point.items())}; "
            f"pass --from {reading.dialect} or --from {rival.dialect}"
        )
        if meant:
            losses.append(Loss("engines", sentence))
        else:
            remarks.append(f"engines sample ranges otherwise: {sentence}")
    return replace(reading, losses=tuple(losses), remarks=tuple(remarks))


def _alike(
    theirs: Sequence[SystemOutput], ours: Sequence[SystemOutput]
) -> tuple[SystemOutput, ...]:
    """Return outputs with our samples, and our default where either has none.

    A default that only one of two has changes no number that both have.
    """
    return tuple(
        replace(
            their,
            defuzzifier=our.defuzzifier,
            default=our.default
            if None in (our.default, their.default)
            else their.default,
        )
        for their, our in zip(theirs, ours, strict=True)
    )


def _place(
    system: FuzzySystem, other: FuzzySystem, values: FloatArray
) -> tuple[int, int] | None:
    """Return an output and a row in which two systems differ, if they do.

    A few rows often suffice, and cost less than the programs that run all of them.
    """
    rows = values.shape[1]
    for row in range(0, rows, max(rows // _FEW, 1)):
        point = dict(zip(system.inputs, values[:, row].tolist(), strict=True))
        ours, theirs = (
            np.array([infer(one, point).outputs]).T for one in (system, other)
        )
        apart = _distances(ours, theirs)
        if apart.max() > _AGREEMENT:
            return int(apart.argmax()), row
    apart = _distances(_outputs(system, values), _outputs(other, values))
    if not apart.size or apart.max() <= _AGREEMENT:
        return None
    index = np.unravel_index(apart.argmax(), apart.shape)
    return int(index[0]), int(index[1])


def _distances(ours: FloatArray, theirs: FloatArray) -> FloatArray:
    """Return how far numbers are apart, as parts of the largest of each output.

    Rows for which one of them has no number count as equal: it is no answer.
    """
    with np.errstate(invalid="ignore"):  # of infinite numbers
        apart = np.nan_to_num(np.abs(ours - theirs), posinf=0.0)
    sizes = np.nan_to_num(np.abs(ours), posinf=0.0).max(axis=1, initial=0.0)
    result: FloatArray = apart / np.where(sizes > 0.0, sizes, 1.0).reshape(-1, 1)
    return result


def _outputs(system: FuzzySystem, values: FloatArray) -> FloatArray:
    outputs = run_system(system, with_strengths=False)(values).outputs
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

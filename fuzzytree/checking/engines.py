"""Where engines answer otherwise by a file that does not say which one it is for."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, FuzzySystem, Loss, Reading
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Aim, range_rows, system_probes

_ROWS = 200  # of each kind: on landmarks, drawn evenly, and aimed at rules
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
    answers = _outputs(system, values)
    for dialect in reading.rivals:
        try:
            rival = read(dialect=dialect)
        except ReadError:
            continue  # that engine refuses the file
        other = cast("FuzzySystem", rival.model)  # of the same file
        if other == system:
            continue
        sampled = [
            replace(theirs, defuzzifier=ours.defuzzifier)
            for theirs, ours in zip(other.outputs, system.outputs, strict=True)
        ]
        alike = replace(other, outputs=tuple(sampled))
        others = _outputs(other, values)
        meant = answers if alike == system else _outputs(alike, values)
        place = _place(answers, meant) or _place(answers, others)
        if place is None:
            continue
        output, row = place
        point = zip(system.inputs, values[:, row].tolist(), strict=True)
        sentence = (
            f"{system.outputs[output].name} is {answers[place]:.9g} in "
            f"{reading.dialect} and {others[place]:.9g} in {rival.dialect} at "
            f"{', '.join(f'{name} = {value!r}' for name, value in point)}; "
            f"pass --from {reading.dialect} or --from {rival.dialect}"
        )
        if _place(answers, meant):
            losses.append(Loss("engines", sentence))
        else:
            remarks.append(f"engines sample ranges otherwise: {sentence}")
    return replace(reading, losses=tuple(losses), remarks=tuple(remarks))


def _place(ours: FloatArray, theirs: FloatArray) -> tuple[int, int] | None:
    """Return the output and the row in which numbers differ most, if they do.

    Rows for which one of them has no number are left out: it is no answer.
    """
    with np.errstate(invalid="ignore"):  # of infinite numbers
        apart = np.nan_to_num(np.abs(ours - theirs), posinf=0.0)
    sizes = np.nan_to_num(np.abs(ours), posinf=0.0).max(axis=1, initial=0.0)
    apart /= np.where(sizes > 0.0, sizes, 1.0).reshape(-1, 1)
    if not apart.size or apart.max() <= _AGREEMENT:
        return None
    output, row = np.unravel_index(apart.argmax(), apart.shape)
    return int(output), int(row)


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

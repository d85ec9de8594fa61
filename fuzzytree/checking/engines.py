"""Where engines answer otherwise by a file that does not say which one it is for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, FuzzySystem, Loss, Reading, SystemOutput
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import (
    Aim,
    infer,
    landmarks_of,
    range_rows,
    row_values,
    system_probes,
)

_ROWS = 200  # of each kind: on landmarks, drawn evenly, and aimed at rules
_FEW = 4  # which are tried before all where rules are many
_MANY_RULES = 100
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
        model = cast("FuzzySystem", rival.model)  # of the same file
        other = _with_default(model, system)
        if other == system:
            continue
        sampled = [
            replace(theirs, defuzzifier=ours.defuzzifier)
            for theirs, ours in zip(other.outputs, system.outputs, strict=True)
        ]
        alike = replace(other, outputs=tuple(sampled))
        meant = None if alike == system else _place(system, alike, values)
        place = meant
        if not meant and alike != other:
            place = _place(system, other, values)
        if place is None:
            continue
        output, row, ours = place
        point = _point(system, values, row)
        theirs = infer(other, point).outputs[output]
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


def _with_default(other: FuzzySystem, system: FuzzySystem) -> FuzzySystem:
    """Return a system with the defaults of another where only one of them has one.

    Such a default changes no number that both have.
    """
    outputs = tuple(
        replace(theirs, default=ours.default)
        if None in (theirs.default, ours.default)
        else theirs
        for theirs, ours in zip(other.outputs, system.outputs, strict=True)
    )
    return other if outputs == other.outputs else replace(other, outputs=outputs)


def _point(system: FuzzySystem, values: FloatArray, row: int) -> dict[str, float]:
    return dict(zip(system.inputs, values[:, row].tolist(), strict=True))


def _place(
    system: FuzzySystem, other: FuzzySystem, values: FloatArray
) -> tuple[int, int, float] | None:
    """Return an output and a row in which two systems differ, and the first's number.

    All rows show where they differ most. Where rules are many, a few rows often
    suffice, and cost less than the programs that run all of them.
    """
    rows = values.shape[1] if len(system.rules) > _MANY_RULES else 0
    noise = np.array([_noise(output) for output in system.outputs])
    for row in range(0, rows, max(rows // _FEW, 1)):
        point = _point(system, values, row)
        ours, theirs = (
            np.array([infer(model, point).outputs]).T for model in (system, other)
        )
        apart = _distances(ours, theirs, noise)
        if apart.max() > _AGREEMENT:
            output = int(apart.argmax())
            return output, row, float(ours[output, 0])
    ours = _outputs(system, values)
    noise[np.isinf(noise)] = 0.0
    apart = _distances(ours, _outputs(other, values), noise)
    if not apart.size or apart.max() <= _AGREEMENT:
        return None
    index = np.unravel_index(apart.argmax(), apart.shape)
    return int(index[0]), int(index[1]), float(ours[index])


def _noise(output: SystemOutput) -> float:
    """Return below which size an output is 0 but for rounding; inf if unknown.

    Sums of thousands of numbers round by less than 1e-12 of the largest; with
    `_AGREEMENT`, that is a thousandth of the numbers that make up the output's terms.
    """
    ends = [end for end in (output.low, output.high) if end is not None]
    points = [x for term in output.terms for x in landmarks_of(term.function)]
    return max((abs(x) / 1000 for x in ends + points), default=math.inf)


def _distances(ours: FloatArray, theirs: FloatArray, noise: FloatArray) -> FloatArray:
    """Return how far numbers are apart, as parts of the largest of each output.

    Rows for which one of them has no number count as equal: it is no answer.

    Args:
        ours: Shape (outputs, rows).
        theirs: Of the same shape.
        noise: Sizes for the outputs whose numbers are all smaller.
    """
    with np.errstate(invalid="ignore"):  # of infinite numbers
        apart = np.nan_to_num(np.abs(ours - theirs), posinf=0.0)
    sizes = np.nan_to_num(np.abs(ours), posinf=0.0).max(axis=1, initial=0.0)
    sizes = np.maximum(sizes, noise)
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
    short = [{name: float(f"{x:.4g}") for name, x in row.items()} for row in rows]
    values = row_values(system, short)
    result: FloatArray = values[:, np.isfinite(values).all(axis=0)]
    return result

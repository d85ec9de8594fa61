"""Where an engine answers otherwise than its own files read here."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.model.contracts import Loss
from fuzzytree.model.system import Arc, Concave, Formula, Number, SCurve, SystemOutput


def fuzzylite_losses(output: SystemOutput) -> Iterator[Loss]:
    """Yield where fuzzylite 6 finds other numbers for an output of its own dialects.

    Args:
        output: As it is read; `docs/reference/interop.md` tells how the two were
        compared.

    Example:
        >>> from fuzzytree.model.system import Defuzzifier, Label
        >>> how = Defuzzifier("weighted average")
        >>> falling = Label("little", Concave(0.5, 0.4))
        >>> output = SystemOutput("tip", (falling,), 0.0, 1.0, how)
        >>> [loss.where for loss in fuzzylite_losses(output)]
        ["output 'tip'"]
    """
    where = f"output {output.name!r}"
    if output.defuzzifier.method == "mean of maximum":
        yield Loss(
            where,
            "the mean of all values of the largest degree answers; fuzzylite 6 takes "
            "the first stretch of such values, and degrees within 1e-6 as equal",
        )
    curves = {type(label.curve) for label in output.labels}
    if output.defuzzifier.is_weighted and curves & {SCurve, Concave, Arc}:
        yield Loss(
            where,
            "where a term has a degree is computed exactly; fuzzylite 6 finds other "
            "values for SShape, ZShape and Concave",
        )


def constant_degrees(output: SystemOutput) -> Iterator[str]:
    """Yield a remark on each number that is a degree because a curve is sampled.

    Args:
        output: As it is read from FLL, or from FCL in fuzzylite's dialect.

    Example:
        >>> from fuzzytree.model.system import Defuzzifier, Label
        >>> low = Label("low", Formula(Number(0.3)))
        >>> how = Defuzzifier("centroid")
        >>> len([*constant_degrees(SystemOutput("tip", (low,), 0.0, 1.0, how))])
        1
    """
    if output.defuzzifier.is_weighted:
        return
    for label in output.labels:
        match label.curve:
            case Formula(Number(value)):
                yield (
                    f"term {label.name!r} of {output.name!r} has the degree {value!r} "
                    "everywhere, as in fuzzylite; to answer numbers, choose a weighted "
                    "defuzzifier"
                )
            case _:
                pass

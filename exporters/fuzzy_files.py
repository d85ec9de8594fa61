"""What the writers of FCL, FLL, FIS and FML share: names, refusals and rewriting."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Defuzzifier,
    FuzzySystem,
    Linear,
    Loss,
    NameMap,
    Points,
    RuleBase,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    changes_text,
)
from fuzzytree.semantics import (
    Always,
    Scores,
    as_system,
    cast_losses,
    cast_remarks,
    facts_of,
    has_numbers,
    pointed,
)

TITLE = "Written by fuzzytree."


class FileSystem(NamedTuple):
    """The system that a file is of.

    Attributes:
        system: The system.
        losses: What it lost on the way.
        remarks: How its numbers are to be read.
        facts: Of rules, what a file has no place for; empty of a system.
        is_relative: Whether it is of the relative rules of a tree.
    """

    system: FuzzySystem
    losses: list[Loss]
    remarks: list[str]
    facts: str = ""
    is_relative: bool = False


def file_system(
    model: RuleBase | FuzzySystem,
    tolerance: float,
    scores: Scores = "rule",
    *,
    always: Always = "nothing",
) -> FileSystem:
    """Return rules as the system of their scores with points, and a system as it is."""
    if isinstance(model, FuzzySystem):
        return FileSystem(model, [], [])
    rules, lost = pointed(model, tolerance)
    return FileSystem(
        as_system(rules, scores, always=always),
        [*cast_losses(model, scores), *lost],
        [*cast_remarks(model, scores)],
        facts_of(model, scores, always=always),
        is_relative=model.kind == "relative",
    )


def refuse_scores(model: RuleBase | FuzzySystem, scores: str, usual: str) -> None:
    """Refuse scores of a system.

    Raises:
        ValueError: If they are not the usual ones.
    """
    if model.outputs and scores != usual:
        raise ValueError("scores: are of rules; a system has outputs of its own")


class FileNames(msgspec.Struct, frozen=True):
    """The names in a file.

    Attributes:
        variables: Of inputs and outputs.
        labels: Of the terms of each variable.
        system: Of the system, where the file has a place for it.
    """

    variables: NameMap
    labels: Mapping[str, NameMap]
    system: NameMap = NameMap({})

    def words(self, variable: str, label: str | None) -> tuple[str, str]:
        """Return the words for a variable and one of its terms, `any` for none."""
        term = "any" if label is None else self.labels[variable][label]
        return self.variables[variable], term

    def changed(self) -> dict[str, str]:
        """Return the file's name for each name that is another in the file."""
        variables = self.variables.changed
        changed = {**variables, **self.system.changed}
        for names in self.labels.values():
            changed |= names.changed
        return changed | variables

    def remarks(self, system: FuzzySystem) -> list[str]:
        """Return a remark on the changed names, if there are any."""
        text = changes_text(self.changed(), [one.name for one in system.variables])
        return [text] if text else []


def refuse(name: str, to: str, reasons: Iterable[str]) -> None:
    """Refuse a model if there are reasons.

    Raises:
        LossError: With all of them.
    """
    listed = "".join(f"\n  {reason}" for reason in reasons)
    if listed:
        raise LossError(f"cannot write {name} as {to}:{listed}")


def with_labels(
    system: FuzzySystem,
    change: Callable[[Variable | SystemOutput], Iterable[Term]],
) -> FuzzySystem:
    """Return a system whose variables have other terms."""
    inputs = tuple(replace(v, terms=tuple(change(v))) for v in system.variables)
    outputs = tuple(replace(v, terms=tuple(change(v))) for v in system.outputs)
    return replace(system, variables=inputs, outputs=outputs)


def without_heights(system: FuzzySystem, to: str, losses: list[Loss]) -> FuzzySystem:
    """Return a system whose terms all have the height 1.

    A height is multiplied into the degrees of points; a number of a weighted output
    has none.

    Raises:
        LossError: If a term with another height is not a list of points.
    """

    def scaled(variable: Variable | SystemOutput, label: Term) -> Term:
        is_number = has_numbers(variable) and isinstance(
            label.function, Singleton | Linear
        )
        if label.height == 1.0 or is_number:
            return replace(label, height=1.0)
        where = f"term {label.name!r} of {variable.name!r}"
        if not isinstance(label.function, Points):
            raise LossError(
                f"{where} has the height {label.height!r}, and {to} has no heights"
            )
        what = f"its height {label.height!r} is in its points, which are rounded"
        losses.append(Loss(where, what, 2.0**-52))
        degrees = tuple(label.height * degree for degree in label.function.degrees)
        return Term(label.name, Points(label.function.values, degrees))

    return with_labels(system, lambda v: [scaled(v, one) for one in v.terms])


def grid_losses(output: SystemOutput, usual: Defuzzifier, whose: str) -> Iterator[Loss]:
    """Yield that a file stands for other samples, the usual ones of its engine."""
    how = output.defuzzifier
    has_curve = not all(isinstance(one.function, Singleton) for one in output.terms)
    own, other = (how.samples, how.grid), (usual.samples, usual.grid)
    if how.is_weighted or own == other or not has_curve:
        return
    what = (
        f"its curve is sampled at {how.samples} values ({how.grid}), and {whose} "
        f"{usual.samples} ({usual.grid})"
    )
    if how.samples == usual.samples and {*own, *other} >= {"middle", "low ends"}:
        half = ((output.high or 0.0) - (output.low or 0.0)) / (2 * how.samples)
        way = "higher" if usual.grid == "middle" else "lower"
        what += f", each half a piece ({half:.3g}) {way}"
    yield Loss(f"output {output.name!r}", what)

"""The terms that conditions of a system ask: exact shapes, and curves between lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction

from fuzzytree.auditing.engine.domain import Domain, span
from fuzzytree.auditing.engine.states import Declined
from fuzzytree.auditing.findings.enclosing import (
    Enclosed,
    Name,
    Range,
    enclosed,
    gap,
    pointed,
    scaled,
)
from fuzzytree.auditing.findings.hedging import hedged
from fuzzytree.auditing.findings.records import Answer, Label
from fuzzytree.model.rulebase import Points, Shape, Term, Variable, shape_mistakes
from fuzzytree.model.system import FuzzySystem, Hedge, SystemInput, questions
from fuzzytree.model.system import Label as SystemLabel
from fuzzytree.semantics.conversion.shapes import shape_of


class Terms:
    """The terms of each input.

    Args:
        plain: Those with an exact shape, by variable and name.
        held: Those between two lines.
        ranges: The values of each input, as far as they are known.

    Attributes:
        plain: As given.
        held: As given.
        made: Hedged terms that conditions ask, by variable and a name of their own.
    """

    def __init__(
        self,
        plain: Mapping[str, Mapping[str, Shape]],
        held: Mapping[Name, Enclosed] | None = None,
        ranges: Mapping[str, Range | None] | None = None,
    ) -> None:
        self.plain = plain
        self.held = held or {}
        self.ranges = ranges or {}
        self.made: dict[Name, Enclosed] = {}

    def knows(self, variable: str, term: str) -> bool:
        """Return whether rules can ask a term."""
        return term in self.plain[variable] or (variable, term) in self.held

    def pointed(self, variable: str, term: str) -> Enclosed | None:
        """Return a term between lines of points, or as points; None if it has none."""
        known = {**self.held, **self.made}.get((variable, term))
        if known is not None:
            return known
        return pointed(self.plain[variable][term], self.ranges.get(variable))

    def hedged(self, variable: str, term: str, hedges: Sequence[Hedge]) -> str | None:
        """Return the name of a hedged term, which rules can then ask.

        Returns:
            None if there are no lines between which it is.
        """
        found = self.pointed(variable, term)
        for hedge in reversed(hedges):
            found = found and hedged(found, hedge)
        if found is None:
            return None
        name = " ".join((*hedges, term))
        while (
            self.knows(variable, name)
            or self.made.get((variable, name), found) != found
        ):
            name += "'"
        self.made[variable, name] = found
        return name

    def variable(self, one: SystemInput) -> Variable:
        """Return an input as a variable; what is held is there as its lower line."""
        shapes = {**self.plain[one.name]}
        for (variable, term), found in {**self.held, **self.made}.items():
            if variable == one.name:
                shapes[term] = found.lower
        terms = tuple(Term(name, shape) for name, shape in shapes.items())
        return Variable(one.name, terms, one.unit, one.low, one.high, one.parts)


def ranges_of(system: FuzzySystem, domain: Domain) -> dict[str, Range | None]:
    """Return the values of each input on a domain, None where they are not known."""
    found: dict[str, Range | None] = {}
    for one in system.inputs:
        needed = [part.input for part in one.parts] or [one.name]
        found[one.name] = None
        if all(domain.side(name) is not None for name in needed):
            low, high = span(Variable(one.name, parts=one.parts), domain)
            found[one.name] = (low, high) if low <= high else None
    return found


def terms_of(
    system: FuzzySystem, ranges: Mapping[str, Range | None]
) -> tuple[Terms, tuple[Answer, ...]]:
    """Return the terms of a system's inputs, and what is to be said of some.

    Args:
        system: The system.
        ranges: The values of each input.
    """
    plain: dict[str, dict[str, Shape]] = {}
    held: dict[Name, Enclosed] = {}
    answers: list[Answer] = []
    asking = Counter(
        key
        for rule in system.rules
        for key in {(asked.variable, asked.label) for asked in questions(rule.when)}
    )
    for one in system.inputs:
        plain[one.name] = {}
        for label in one.labels:
            is_moved = bool(one.parts) and one.clips
            shape = None if is_moved else _shape(label)
            if shape is not None:
                plain[one.name][label.name] = shape
                continue
            found = None if is_moved else _between(label, ranges[one.name])
            if found is not None:
                held[one.name, label.name] = found
            count = asking[one.name, label.name]
            few = {0: "no rule asks", 1: "1 rule asks"}
            asks = few.get(count, f"{count} rules ask")
            told = _told(one, label, found, ranges[one.name])
            answers.append(_answer(one, label, told, f"{asks} for it"))
    return Terms(plain, held, ranges), tuple(answers)


def _shape(label: SystemLabel) -> Shape | None:
    """Return the exact shape of a term, with its height; None if there is none."""
    shape = shape_of(label.curve)
    if shape is None or label.height == 1.0:
        return None if shape is None or any(shape_mistakes(shape)) else shape
    if not isinstance(shape, Points):
        return None
    found = scaled(Enclosed(shape, shape, (shape,)), label.height)
    return found.lower if found is not None and found.is_exact else None


def _between(label: SystemLabel, of: Range | None) -> Enclosed | None:
    shape = shape_of(label.curve)
    if shape is not None and any(shape_mistakes(shape)):
        return None
    found = enclosed(label.curve, of)
    return found and (found if label.height == 1.0 else scaled(found, label.height))


def _told(
    one: SystemInput, label: SystemLabel, found: Enclosed | None, of: Range | None
) -> tuple[str, str]:
    """Return what becomes of a term, and why."""
    kind = str(label.curve.__struct_config__.tag)
    reason = f"its curve ({kind}) has no exact method"
    if one.parts and one.clips:
        reason = "a combination that is moved into a range has no exact method"
    if found is None:
        return "is not taken over", reason
    if of is None and isinstance(found.lower, Points):
        of = Fraction(found.lower.values[0]), Fraction(found.lower.values[-1])
    apart = f" {float(gap(found, of)):.2g} apart" if of else ""
    return (
        f"is asked between two lines{apart} at most",
        f"{reason}; its shape and its overlaps are not asked",
    )


def _answer(
    one: SystemInput, label: SystemLabel, told: tuple[str, str], asks: str
) -> Answer:
    name, (what, reason) = f"term {label.name!r} of {one.name!r}", told
    return Answer(
        "FTD02",
        name,
        f"{name} {what}: {reason}; {asks}",
        Declined("FTD02", f"{reason}; {asks}"),
        is_finding=False,
        terms=(Label(one.name, label.name),),
    )

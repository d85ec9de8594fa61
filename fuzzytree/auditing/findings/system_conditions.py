"""Terms and conditions of fuzzy systems as propositions of rules, where that is exact.

A condition becomes *ways*: each way is a number of propositions that are all true, and
the condition is as true as the best of its ways. Under minimum and maximum, or product
and maximum, `a and (b or c)` is as strong as the stronger of `a and b` and `a and c`,
and 1 minus the least is the largest of 1 minus each.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, Literal, NoReturn

from fuzzytree.auditing.engine.domain import Domain, span
from fuzzytree.auditing.engine.states import Declined
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.curve_bounds import (
    CurveBounds,
    Interval,
    Name,
    as_points,
    curve_bounds,
    gap,
    scale,
)
from fuzzytree.auditing.findings.records import AuditAnswer, TermName
from fuzzytree.model import (
    And,
    Condition,
    Conjunction,
    FuzzySystem,
    Hedge,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    Shape,
    Term,
    Variable,
    questions,
)
from fuzzytree.model import Term as SystemLabel
from fuzzytree.semantics import shape_of


class SystemTerms:
    """The terms of each input: exact ones, bounded ones, and `made` for hedges."""

    def __init__(
        self,
        plain: Mapping[str, Mapping[str, Shape]],
        bounds: Mapping[Name, CurveBounds],
        labels: Mapping[Name, SystemLabel],
        ranges: Mapping[str, Interval | None],
    ) -> None:
        self.plain, self.bounds = plain, bounds
        self.labels, self.ranges = labels, ranges
        self.hedged_terms: dict[Name, CurveBounds] = {}

    def knows(self, variable: str, term: str) -> bool:
        """Return whether rules can use a term."""
        return term in self.plain[variable] or (variable, term) in self.bounds

    def pointed(self, variable: str, term: str) -> CurveBounds | None:
        """Return a term between lines of points, or as points; None if it has none."""
        known = {**self.bounds, **self.hedged_terms}.get((variable, term))
        if known is not None:
            return known
        return as_points(self.plain[variable][term], self.ranges.get(variable))

    def hedged(self, variable: str, term: str, hedges: Sequence[Hedge]) -> str | None:
        """Return the name of a hedged term, which rules can then use.

        Returns:
            None if there are no lines between which it is.
        """
        label, of = self.labels[variable, term], self.ranges[variable]
        lines = curve_bounds(label.function, of, label.height, tuple(hedges))
        if lines is None:
            return None
        name = " ".join((*hedges, term))
        while (
            self.knows(variable, name)
            or self.hedged_terms.get((variable, name), lines) != lines
        ):
            name += "'"
        self.hedged_terms[variable, name] = lines
        return name

    def variable(self, one: Variable) -> Variable:
        """Return an input as a variable; an inexact term has its lower line."""
        shapes = {**self.plain[one.name]}
        for (variable, term), lines in {**self.bounds, **self.hedged_terms}.items():
            if variable == one.name:
                shapes[term] = lines.lower
        terms = tuple(Term(name, shape) for name, shape in shapes.items())
        return Variable(one.name, terms, one.unit, one.low, one.high, one.parts)


def ranges_of(system: FuzzySystem, domain: Domain) -> dict[str, Interval | None]:
    """Return the values of each input on a domain, None where they are not known."""
    ranges: dict[str, Interval | None] = {}
    for one in system.variables:
        needed = [part.input for part in one.parts] or [one.name]
        ranges[one.name] = None
        if all(domain.side(name) is not None for name in needed):
            low, high = span(Variable(one.name, parts=one.parts), domain)
            ranges[one.name] = (low, high) if low <= high else None
    return ranges


def terms_of(
    system: FuzzySystem, ranges: Mapping[str, Interval | None]
) -> tuple[SystemTerms, tuple[AuditAnswer, ...]]:
    """Return the terms of a system's inputs, and what is to be said of some."""
    plain: dict[str, dict[str, Shape]] = {}
    bounds: dict[Name, CurveBounds] = {}
    answers: list[AuditAnswer] = []
    uses = Counter(
        key
        for rule in system.rules
        for key in {(one.variable, one.term) for one in questions(rule.when)}
    )
    for one in system.variables:
        plain[one.name] = {}
        for label in one.terms:
            is_moved = bool(one.parts) and one.clips
            shape = None if is_moved else _shape(label)
            if shape is not None:
                plain[one.name][label.name] = shape
                continue
            lines = None if is_moved else _between(label, ranges[one.name])
            if lines is not None:
                bounds[one.name, label.name] = lines
            count = uses[one.name, label.name]
            few = {0: "no rule uses it", 1: "1 rule uses it"}
            users = few.get(count, f"{count} rules use it")
            answers.append(_answer(one, label, lines, ranges[one.name], users))
    labels = {(one.name, of.name): of for one in system.variables for of in one.terms}
    return SystemTerms(plain, bounds, labels, ranges), tuple(answers)


def _shape(label: SystemLabel) -> Shape | None:
    """Return the exact shape of a term, with its height; None if there is none."""
    shape = shape_of(label.function)
    if shape is None or label.height == 1.0:
        return None if shape is None or any(shape.mistakes()) else shape
    if not isinstance(shape, Points):
        return None
    lines = scale(CurveBounds(shape, shape, (shape,)), label.height)
    return lines.lower if lines is not None and lines.is_exact else None


def _between(label: SystemLabel, of: Interval | None) -> CurveBounds | None:
    shape = shape_of(label.function)
    if shape is not None and any(shape.mistakes()):
        return None
    return curve_bounds(label.function, of, label.height)


def _answer(
    one: Variable,
    label: SystemLabel,
    lines: CurveBounds | None,
    of: Interval | None,
    users: str,
) -> AuditAnswer:
    """Return what becomes of a term, and why."""
    name, message = f"term {label.name!r} of {one.name!r}", "FTD.left-out"
    facts: dict[str, float] = {}
    kind = str(label.function.__struct_config__.tag)
    reason = f"its curve ({kind}) has no exact method"
    if one.parts and one.clips:
        reason = "a combination that is moved into a range has no exact method"
    if lines is not None:
        if of is None and isinstance(lines.lower, Points):
            of = Fraction(lines.lower.values[0]), Fraction(lines.lower.values[-1])
        message = "FTD.bounded"
        facts = {"apart": float(gap(lines, of))} if of else {}
        reason += "; its shape and its overlaps are not checked"
    state = Declined("FTD02", f"{reason}; {users}")
    terms = (TermName(one.name, label.name),)
    return audit_answer(message, name, state, terms=terms, facts=facts)


MOST_WAYS: Final = 64
"""The most rules that one rule of a system becomes."""

MOST_QUESTIONS: Final = 1_000
"""The most propositions in the condition of a rule."""

Way = tuple[Proposition, ...]
"""Propositions that all hold."""

_ALWAYS: tuple[Way, ...] = ((),)
_NEVER: tuple[Way, ...] = ()


class DecliningError(Exception):
    """A condition has no exact counterpart; the code and the reason say why."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


def decline(code: str, reason: str) -> NoReturn:
    """Raise DecliningError."""
    raise DecliningError(code, reason)


class Conditions:
    """Makes ways of a block's conditions: each holds as far as the best of them."""

    def __init__(
        self, conjunction: Conjunction, terms: SystemTerms, block: RuleBlock
    ) -> None:
        self.conjunction = conjunction
        self.terms = terms
        self.block = block

    def ways(self, condition: Condition | None, *, negated: bool = False) -> list[Way]:
        """Return the ways in which a condition is true, or is not if negated.

        Raises:
            DecliningError: If it has none that are exact.
        """
        match condition:
            case None:
                return [*_ALWAYS]
            case Proposition():
                return self._proposition(condition, negated=negated)
            case Not(part=part):
                return self.ways(part, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self.ways(part, negated=negated)
            case And(parts=parts):
                self._check_joint("and", negated=negated)
                return self._joined(parts, is_union=negated, negated=negated)
            case Or(parts=parts):
                whole = self._one_proposition(parts, negated=negated)
                if whole is not None:
                    return [(whole,)]
                self._check_joint("or", negated=negated)
                return self._joined(parts, is_union=not negated, negated=negated)

    def _proposition(self, one: Proposition, *, negated: bool) -> list[Way]:
        """Return the only way of a proposition: a proposition, or always, or never."""
        hedges = one.hedges
        while hedges and hedges[0] == "not":
            negated, hedges = not negated, hedges[1:]
        if hedges and hedges[0] == "any":
            return [*(_NEVER if negated else _ALWAYS)]
        if "any" in hedges:
            decline("FTD07", f"the hedge {hedges[0]!r} of 'any' has no exact method")
        if one.variable not in self.terms.plain:
            decline("FTD07", f"it uses the output {one.variable!r}")
        if one.term is None or not self.terms.knows(one.variable, one.term):
            name = f"{one.term!r} of {one.variable!r}"
            decline("FTD02", f"the curve of {name} has no exact method")
        if hedges:
            term = self.terms.hedged(one.variable, one.term, hedges)
            if term is None:
                decline("FTD07", f"the hedge {hedges[0]!r} has no exact method")
            return [(Proposition(one.variable, (term,), ("not",) if negated else ()),)]
        return [(Proposition(one.variable, (one.term,), ("not",) if negated else ()),)]

    def _one_proposition(
        self, parts: Sequence[Condition], *, negated: bool
    ) -> Proposition | None:
        """Return `x is a or b` as one proposition, if it is that and a maximum."""
        plain = [*_plain_questions(parts)]
        if self.block.disjunction != "maximum" or None in plain:
            return None
        ways = [
            way for one in plain if one for way in self._proposition(one, negated=False)
        ]
        propositions = [way[0] for way in ways]
        if len({proposition.variable for proposition in propositions}) > 1:
            return None
        terms = dict.fromkeys(
            term for proposition in propositions for term in proposition.terms
        )
        return Proposition(
            propositions[0].variable, tuple(terms), ("not",) if negated else ()
        )

    def _check_joint(self, word: Literal["and", "or"], *, negated: bool) -> None:
        """Raise unless a joint is a minimum, maximum or product where that is exact."""
        block = self.block
        norm = block.conjunction if word == "and" else block.disjunction
        exact = {"and": ("minimum", "product"), "or": ("maximum",)}[word]
        if norm not in exact:
            decline("FTD01", f"its {word!r} is the {norm}, which has no exact method")
        if word == "and" and negated and norm == "product":
            decline("FTD07", "it negates a product, which has no exact method")
        if word == "or" and negated and self.conjunction == "product":
            decline("FTD07", "it negates an 'or' within rules that multiply")
        if word == "and" and not negated and norm != self.conjunction:
            text = f"its 'and' is the {norm}, and that of most rules is another"
            decline("FTD01", text)

    def _joined(
        self, parts: Sequence[Condition], *, is_union: bool, negated: bool
    ) -> list[Way]:
        whole = [*(_NEVER if is_union else _ALWAYS)]
        for part in parts:
            ways = self.ways(part, negated=negated)
            count = len(whole) + len(ways) if is_union else len(whole) * len(ways)
            if count > MOST_WAYS:
                decline("FTD05", f"it can hold in more than {MOST_WAYS} ways")
            if is_union:
                whole += ways
            else:
                pairs = itertools.product(whole, ways)
                whole = [self._both(one, other) for one, other in pairs]
            whole = [*dict.fromkeys(whole)]
        return whole

    def _both(self, one: Way, other: Way) -> Way:
        """Return propositions of both; a minimum does not change by repetition."""
        both = (*one, *other)
        return tuple(dict.fromkeys(both)) if self.conjunction == "minimum" else both


def _plain_questions(parts: Iterable[Condition]) -> Iterator[Proposition | None]:
    """Yield the questions that parts join by or alone; None for anything else."""
    for part in parts:
        match part:
            case Or(parts=inner):
                yield from _plain_questions(inner)
            case Proposition(hedges=(), term=str()):
                yield part
            case _:
                yield None

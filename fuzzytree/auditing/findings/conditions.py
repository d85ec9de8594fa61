"""Conditions of fuzzy systems as ways in which they hold, where that is exact.

A way is a number of clauses that all hold; a condition holds as far as the best of its
ways. Under minimum and maximum, or product and maximum, `a and (b or c)` is as strong
as the stronger of `a and b` and `a and c`, and 1 minus the least is the largest of 1
minus each.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, Literal, NoReturn

from fuzzytree.auditing.findings.system_terms import Terms
from fuzzytree.model.rulebase import Clause, Conjunction
from fuzzytree.model.system import And, Condition, Is, Not, Or, RuleBlock

MOST_WAYS: Final = 64
"""The most rules that one rule of a system becomes."""

MOST_QUESTIONS: Final = 1_000
"""The most that a rule may ask."""

NORMS: Mapping[str | None, Conjunction] = {"minimum": "min", "product": "product"}
"""The norms with an exact method, and what rules of ours call them."""

Way = tuple[Clause, ...]
"""Clauses that all hold."""

_ALWAYS: tuple[Way, ...] = ((),)
_NEVER: tuple[Way, ...] = ()


class DecliningError(Exception):
    """A condition has no exact counterpart.

    Attributes:
        code: Why, as a code of an audit.
        reason: Why, in a sentence.
    """

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


def decline(code: str, reason: str) -> NoReturn:
    """Raise DecliningError."""
    raise DecliningError(code, reason)


class Conditions:
    """Makes ways of a block's conditions: each holds as far as the best of them.

    Args:
        conjunction: The AND of the rules that ways become part of.
        terms: The terms of each input.
        block: The block, whose norms join the conditions.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> line = Points((0.0, 1.0), (0.0, 1.0))
        >>> terms = Terms({"a": {"high": line}, "b": {"high": line}})
        >>> made = Conditions("min", terms, RuleBlock(()))
        >>> len(made.ways(Or((Is("a", "high"), Is("b", "high")))))
        2
    """

    def __init__(
        self, conjunction: Conjunction, terms: Terms, block: RuleBlock
    ) -> None:
        self.conjunction = conjunction
        self.terms = terms
        self.block = block

    def ways(self, condition: Condition | None, *, negated: bool = False) -> list[Way]:
        """Return the ways in which a condition holds; none if it never does.

        Args:
            condition: The condition; None holds always.
            negated: Whether the ways in which it does not hold are asked for.

        Raises:
            DecliningError: If it has none that are exact.
        """
        match condition:
            case None:
                return [*_ALWAYS]
            case Is():
                return self._asked(condition, negated=negated)
            case Not(part=part):
                return self.ways(part, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self.ways(part, negated=negated)
            case And(parts=parts):
                self._check_joint("and", negated=negated)
                return self._joined(parts, is_union=negated, negated=negated)
            case Or(parts=parts):
                whole = self._one_clause(parts, negated=negated)
                if whole is not None:
                    return [(whole,)]
                self._check_joint("or", negated=negated)
                return self._joined(parts, is_union=not negated, negated=negated)

    def _asked(self, asked: Is, *, negated: bool) -> list[Way]:
        """Return the only way of a question: a clause, or always, or never."""
        hedges = asked.hedges
        while hedges and hedges[0] == "not":
            negated, hedges = not negated, hedges[1:]
        if hedges and hedges[0] == "any":
            return [*(_NEVER if negated else _ALWAYS)]
        if "any" in hedges:
            decline("FTD07", f"the hedge {hedges[0]!r} of 'any' has no exact method")
        if asked.variable not in self.terms.plain:
            decline("FTD07", f"it asks the output {asked.variable!r}")
        if asked.label is None or not self.terms.knows(asked.variable, asked.label):
            name = f"{asked.label!r} of {asked.variable!r}"
            decline("FTD02", f"the curve of {name} has no exact method")
        if hedges:
            made = self.terms.hedged(asked.variable, asked.label, hedges)
            if made is None:
                decline("FTD07", f"the hedge {hedges[0]!r} has no exact method")
            return [(Clause(asked.variable, (made,), negated),)]
        return [(Clause(asked.variable, (asked.label,), negated),)]

    def _one_clause(
        self, parts: Sequence[Condition], *, negated: bool
    ) -> Clause | None:
        """Return `x is a or b` as one clause, if it is that and a maximum."""
        asked = [*_plain_questions(parts)]
        if self.block.disjunction != "maximum" or None in asked:
            return None
        ways = [way for one in asked if one for way in self._asked(one, negated=False)]
        clauses = [way[0] for way in ways]
        if len({clause.variable for clause in clauses}) > 1:
            return None
        terms = dict.fromkeys(term for clause in clauses for term in clause.terms)
        return Clause(clauses[0].variable, tuple(terms), negated)

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
        if word == "and" and not negated and NORMS[norm] != self.conjunction:
            text = f"its 'and' is the {norm}, and that of most rules is another"
            decline("FTD01", text)

    def _joined(
        self, parts: Sequence[Condition], *, is_union: bool, negated: bool
    ) -> list[Way]:
        found = [*(_NEVER if is_union else _ALWAYS)]
        for part in parts:
            ways = self.ways(part, negated=negated)
            count = len(found) + len(ways) if is_union else len(found) * len(ways)
            if count > MOST_WAYS:
                decline("FTD05", f"it can hold in more than {MOST_WAYS} ways")
            if is_union:
                found += ways
            else:
                pairs = itertools.product(found, ways)
                found = [self._both(one, other) for one, other in pairs]
            found = [*dict.fromkeys(found)]
        return found

    def _both(self, one: Way, other: Way) -> Way:
        """Return clauses of both; a minimum does not change by asking twice."""
        both = (*one, *other)
        return tuple(dict.fromkeys(both)) if self.conjunction == "min" else both


def _plain_questions(parts: Iterable[Condition]) -> Iterator[Is | None]:
    """Yield the questions that parts join by or alone; None for anything else."""
    for part in parts:
        match part:
            case Or(parts=inner):
                yield from _plain_questions(inner)
            case Is(hedges=(), label=str()):
                yield part
            case _:
                yield None

"""Rules in FML: clauses that are all joined by and, or all by or.

Several terms of one variable, joined otherwise than the rule, are a term of their own
with a circular definition: that is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.exporters.fuzzy_files import refuse
from fuzzytree.exporters.xml_text import XmlElement, element, text_element
from fuzzytree.formats import FML_SNORMS, FML_TNORMS, MODIFIERS, word_for
from fuzzytree.model import (
    And,
    Condition,
    FuzzySystem,
    Hedge,
    Linear,
    Loss,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    SCurve,
    Singleton,
    SystemOutput,
    SystemRule,
    questions,
    unlike,
)
from fuzzytree.semantics import operands, split

Clause = tuple[str, str, str]
"""A variable, a term, and a modifier, which may be empty."""

_WORDS: Final[dict[Hedge, str]] = {meant: word for word, meant in MODIFIERS.items()}


class CircularTerm(msgspec.Struct, frozen=True):
    """A term that is an and or an or of others.

    Attributes:
        name: What it is called.
        parts: The terms and whether they are negated.
        word: `and` or `or`.
        norm: FML's word for the norm that joins them.
    """

    name: str
    parts: tuple[tuple[str, bool], ...]
    word: str
    norm: str

    def definition(self, term: Callable[[str, str], str], variable: str) -> XmlElement:
        """Return the definition: two parts at a time, the first ones innermost."""
        key = "t-norm" if self.word == "and" else "t-conorm"
        whole, *others = (
            text_element(
                "termName",
                term(variable, label),
                complement="true" if is_negated else None,
            )
            for label, is_negated in self.parts
        )
        for other in others:
            whole = element(self.word, whole, other, **{key: self.norm})
        return whole


class FmlRule(msgspec.Struct, frozen=True):
    """A rule with its clauses."""

    clauses: tuple[Clause, ...]
    concluded: tuple[tuple[str, str], ...]
    weight: float
    is_or: bool


Base = tuple[str, RuleBlock, tuple[FmlRule, ...]]
"""The kind (mamdani, tsk, tsukamoto), the block it comes from, and its rules."""


class FmlRules:
    """The rules of a system in FML.

    Attributes:
        bases: The rules.
        made: The terms that they need, by variable.
        losses: What was lost.

    Raises:
        LossError: With every rule that has no place in FML.
    """

    def __init__(self, system: FuzzySystem) -> None:
        self.bases: list[Base] = []
        self.made: dict[str, list[CircularTerm]] = {}
        self.losses: list[Loss] = []
        self._system = system
        self._kinds = {one.name: _kind(one) for one in system.outputs}
        self._taken = {
            one.name: [label.name for label in one.terms] for one in system.variables
        }
        reasons: list[str] = []
        number = 0
        for block in system.blocks:
            result: dict[str, list[FmlRule]] = {}
            for rule in block.rules:
                number += 1
                try:
                    several = self._placed(rule, block)
                except LossError as error:
                    reasons.append(f"rule {number}: {error}")
                    continue
                if len(several) > len({kind for kind, _ in several}):
                    count = len(several)
                    what = f"it is {count} rules, joined by maximum: that is equivalent"
                    self.losses.append(Loss(f"rule {number}", what, 0.0))
                for kind, one in several:
                    result.setdefault(kind, []).append(one)
            self.bases += [(kind, block, tuple(own)) for kind, own in result.items()]
        reasons += [
            f"output {name!r}: its terms are of several kinds, and FML has one for each"
            for name, kind in self._kinds.items()
            if kind == "mixed"
        ]
        if len(system.all_variables) < 2:
            reasons.append("FML needs at least two variables")
        if not self.bases and not reasons:
            reasons.append("FML needs at least one rule")
        refuse(system.name, "fml", reasons)

    def _placed(self, rule: SystemRule, block: RuleBlock) -> list[tuple[str, FmlRule]]:
        """Return a rule by the kind of its outputs; several if it mixes and and or."""
        try:
            return [*self._rules(rule, block)]
        except LossError:
            is_curve = all(self._kinds[one.output] == "mamdani" for one in rule.then)
            rules = split(rule, block, self._system) if is_curve else ()
            if len(rules) < 2:
                raise
        return [pair for one in rules for pair in self._rules(one, block)]

    def _rules(
        self, rule: SystemRule, block: RuleBlock
    ) -> Iterator[tuple[str, FmlRule]]:
        """Yield a rule for each kind of output that it concludes."""
        if rule.when is None:
            raise LossError("it has no condition, and a rule of FML must have one")
        if any(one.hedges for one in rule.then):
            raise LossError("FML has no hedges of conclusions")
        is_or, kinds = isinstance(rule.when, Or), self._kinds
        clauses = [self._clause(part, block) for part in operands(rule.when, block)]
        for kind in dict.fromkeys(kinds[one.output] for one in rule.then):
            then = [one for one in rule.then if kinds[one.output] == kind]
            concluded = tuple((one.output, one.term) for one in then)
            yield kind, FmlRule(tuple(clauses), concluded, rule.weight, is_or)

    def _clause(self, condition: Condition, block: RuleBlock) -> Clause:
        match condition:
            case Proposition(variable=variable) if variable in self._kinds:
                raise LossError(f"it tests the output {variable!r}")
            case Proposition(variable=variable, term=label, hedges=hedges):
                return self._question(variable, label, hedges)
            case Not(part=Proposition(variable=variable, term=label, hedges=hedges)):
                return self._question(variable, label, ("not", *hedges))
            case Not(part=And() | Or() as part):
                variable, label, _ = self._circular(part, block)
                return variable, label, "not"
            case And() | Or():
                return self._circular(condition, block)
            case _:
                raise LossError("it has a not within a not")

    def _question(
        self, variable: str, label: str | None, hedges: Sequence[Hedge]
    ) -> Clause:
        if hedges[-1:] == ("any",) and len(hedges) == 1:
            names = self._taken[variable]
            if not names:
                raise LossError(f"{variable!r} has no term that a rule could test")
            return variable, label or names[0], "any"
        if label is None or len(hedges) > 1 or any(one not in _WORDS for one in hedges):
            raise LossError(f"FML has no way to say {' '.join(hedges)!r}")
        return variable, label, _WORDS[hedges[0]] if hedges else ""

    def _circular(self, condition: And | Or, block: RuleBlock) -> Clause:
        """Return a clause on a term that combines several of one variable."""
        propositions = [*questions(condition)]
        variables = {one.variable for one in propositions}
        if len(variables) > 1 or len(propositions) != len(condition.parts):
            raise LossError("it mixes and, or and not over several inputs")
        (variable,) = variables
        parts: list[tuple[str, bool]] = []
        for part in condition.parts:
            match part:
                case Proposition(term=str(label), hedges=()):
                    parts.append((label, False))
                case (
                    Proposition(term=str(label), hedges=("not",))
                    | Not(part=Proposition(term=str(label), hedges=()))
                ):
                    parts.append((label, True))
                case _:
                    raise LossError(f"terms of {variable!r} are joined with hedges")
        is_or = isinstance(condition, Or)
        norms = FML_SNORMS if is_or else FML_TNORMS
        meant = block.disjunction if is_or else block.conjunction
        norm = word_for(norms, meant)
        if not norm:
            raise LossError(f"FML has no {meant}")
        word = "or" if is_or else "and"
        if len(parts) == 1:
            return variable, parts[0][0], "not" if parts[0][1] else ""
        for one in self.made.setdefault(variable, []):
            if (one.parts, one.word, one.norm) == (tuple(parts), word, norm):
                return variable, one.name, ""
        shown = f" {word} ".join(f"{'not ' * is_not}{label}" for label, is_not in parts)
        name = unlike(shown[:60], self._taken[variable])
        self._taken[variable].append(name)
        self.made[variable].append(CircularTerm(name, tuple(parts), word, norm))
        return variable, name, ""


def _kind(output: SystemOutput) -> str:
    if not output.defuzzifier.is_weighted:
        return "mamdani"
    curves = [label.function for label in output.terms]
    if all(isinstance(curve, Singleton | Linear) for curve in curves):
        return "tsk"
    is_monotone = all(
        isinstance(curve, SCurve)
        or (isinstance(curve, Points) and sorted(curve.degrees) == [0.0, 1.0])
        for curve in curves
    )
    return "tsukamoto" if is_monotone else "mixed"

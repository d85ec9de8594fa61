"""Rules as the decider takes them: literals on axes, joined by minimum or product.

Norm, weight and hedges belong to the rule, so that rules of two models stand side by
side. A rule of a system in which OR is the maximum becomes several, its ways: it holds
as far as the best of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Literal as Choice
from typing import NamedTuple, NoReturn

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.lines import Hedged
from fuzzytree.model import (
    And,
    Condition,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Hedge,
    Linear,
    MembershipFunction,
    Not,
    Or,
    Proposition,
    RuleBase,
    RuleBlock,
    Variable,
    questions,
)
from fuzzytree.semantics import rules_from_tree, shape_of

MOST_WAYS = 64
"""The most rules that one rule of a system becomes."""

MOST_QUESTIONS = 1_000
"""The most propositions in a condition."""

Norm = Choice["minimum", "product"]


class Literal(msgspec.Struct, frozen=True, cache_hash=True):
    """`variable is a or b`, perhaps negated, times a weight, less a lead."""

    functions: tuple[MembershipFunction, ...]
    negated: bool = False
    scale: Fraction = ONE
    lowered: Fraction = ZERO


class BaseRule(NamedTuple):
    """A rule of the decider.

    Attributes:
        literals: What must hold: the name of an axis, and a literal on it.
        norm: How they are joined.
        factor: Its strength where all of them are 1; a weight of a minimum also scales
            its literals.
        then: What it concludes: a class, or the text of its conclusions.
        number: The number of its rule in the model, from 1, over all blocks.
        name: What messages call it.
        conclusions: Of a system, pairs of output and term.
        when: What must hold, as people read it.
        model: The place of its model, where several stand side by side.
    """

    literals: tuple[tuple[str, Literal], ...]
    norm: Norm
    factor: Fraction
    then: str
    number: int
    name: str
    conclusions: tuple[tuple[str, str], ...] = ()
    model: int = 0
    when: tuple[Proposition, ...] = ()


class LeftOut(NamedTuple):
    """A rule of a system that the decider cannot take, by the code of the reason."""

    name: str
    number: int
    code: str
    reason: str


class ModelRules(NamedTuple):
    """The rules of a model.

    Attributes:
        rules: Those that may fire.
        silent: The name and the number of rules that never do, as their text says.
        left_out: Rules without an exact method.
    """

    rules: tuple[BaseRule, ...]
    silent: tuple[tuple[str, int, str], ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    uncovered: str | None = None


def rules_of(model: Document) -> ModelRules:
    """Return the rules of a tree (the relative ones), a rule base or a system.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> rules_of(random_tree(1)).rules[0].name
        'rule 1'
    """
    match model:
        case FuzzyTree():
            return rules_of(rules_from_tree(model))
        case RuleBase():
            terms = _functions(model.variables)
            norm = model.semantics.conjunction
            every = [
                BaseRule(
                    tuple(_literal(p, terms) for p in rule.when),
                    norm if len(rule.when) > 1 else "minimum",
                    ONE,
                    rule.then,
                    number,
                    f"rule {number}",
                    when=rule.when,
                )
                for number, rule in enumerate(model.rules, 1)
            ]
            return ModelRules(tuple(every), uncovered=model.semantics.uncovered)
        case FuzzySystem():
            return _of_system(model)


_Terms = dict[tuple[str, str], MembershipFunction]


def _functions(variables: Iterable[Variable]) -> _Terms:
    result: _Terms = {}
    for variable in variables:
        for term in variable.terms:
            function: MembershipFunction = term.function
            shape = shape_of(term.function)
            if shape is not None and not any(shape.mistakes()):
                function = shape
            if term.height != 1.0:
                function = Hedged(function, term.height, ())
            result[variable.name, term.name] = function
    return result


def _literal(proposition: Proposition, terms: _Terms) -> tuple[str, Literal]:
    name, hedges = proposition.variable, proposition.hedges
    functions = tuple(terms[name, term] for term in proposition.terms)
    if proposition.negated:
        hedges = hedges[1:]
    if hedges:
        functions = tuple(_with_hedges(function, hedges) for function in functions)
    return name, Literal(functions, proposition.negated)


def _with_hedges(
    function: MembershipFunction, hedges: tuple[Hedge, ...]
) -> MembershipFunction:
    if isinstance(function, Hedged):
        return Hedged(function.function, function.height, hedges)
    return Hedged(function, 1.0, hedges)


# --- systems


class _DecliningError(Exception):
    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


def _decline(code: str, reason: str) -> NoReturn:
    raise _DecliningError(code, reason)


_Way = tuple[Proposition, ...]


def _of_system(system: FuzzySystem) -> ModelRules:
    terms = _functions(system.variables)
    usable = {v.name: not (v.parts and v.clips) for v in system.variables}
    rules: list[BaseRule] = []
    silent: list[tuple[str, int, str]] = []
    left_out: list[LeftOut] = []
    number = 0
    for position, block in enumerate(system.blocks, 1):
        end = f" of block {position}" if len(system.blocks) > 1 else ""
        for index, rule in enumerate(block.rules, 1):
            number += 1
            name = f"rule {index}{end}"
            if rule.weight == 0.0:
                silent.append((name, number, "weight-0"))
                continue
            try:
                if sum(1 for _ in questions(rule.when)) > MOST_QUESTIONS:
                    _decline("FTD05", f"it has more than {MOST_QUESTIONS} propositions")
                ways = _Conditions(terms, usable, block).ways(rule.when)
            except _DecliningError as error:
                left_out.append(LeftOut(name, number, error.code, error.reason))
                continue
            if not ways:
                silent.append((name, number, "never-true"))
            then = " and ".join(
                " ".join((c.output, "is", *c.hedges, c.term)) for c in rule.then
            )
            pairs = tuple((c.output, c.term) for c in rule.then)
            for place, way in enumerate(ways, 1):
                own = name if len(ways) == 1 else f"way {place} of {name}"
                norm: Norm = "minimum"
                if block.conjunction == "product" and len(way) > 1:
                    norm = "product"
                weight = Fraction(rule.weight)
                literals = tuple(_literal(proposition, terms) for proposition in way)
                if norm == "minimum":
                    literals = tuple(
                        (axis, replace(literal, scale=weight))
                        for axis, literal in literals
                    )
                made = BaseRule(literals, norm, weight, then, number, own, pairs)
                rules.append(made._replace(when=way))
    return ModelRules(tuple(rules), tuple(silent), tuple(left_out))


class _Conditions:
    """The ways in which conditions of a block hold."""

    def __init__(
        self, terms: _Terms, usable: dict[str, bool], block: RuleBlock
    ) -> None:
        self.terms, self.usable, self.block = terms, usable, block

    def ways(self, condition: Condition | None, *, negated: bool = False) -> list[_Way]:
        """Return the ways; none if it never holds."""
        match condition:
            case None:
                return [()]
            case Proposition():
                return self._proposition(condition, negated=negated)
            case Not(part=part):
                return self.ways(part, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self.ways(part, negated=negated)
            case And(parts=parts):
                self._check("and", negated=negated)
                return self._join(parts, is_union=negated, negated=negated)
            case Or(parts=parts):
                if self.block.disjunction == "maximum":
                    whole = self._one_proposition(parts, negated=negated)
                    if whole is not None:
                        return [(whole,)]
                self._check("or", negated=negated)
                return self._join(parts, is_union=not negated, negated=negated)

    def _proposition(self, proposition: Proposition, *, negated: bool) -> list[_Way]:
        name, hedges = proposition.variable, proposition.hedges
        while hedges and hedges[0] == "not":
            negated, hedges = not negated, hedges[1:]
        if hedges and hedges[0] == "any":
            return [] if negated else [()]
        if "any" in hedges:
            _decline("FTD07", f"the hedge {hedges[0]!r} of 'any' has no exact method")
        if name not in self.usable:
            _decline("FTD07", f"it uses the output {name!r}")
        function = self.terms.get((name, proposition.term or ""))
        inner = function.function if isinstance(function, Hedged) else function
        where = f"{proposition.term!r} of {name!r}"
        if function is None or isinstance(inner, Formula | Linear):
            _decline("FTD02", f"the curve of {where} has no exact method")
        if not self.usable[name]:
            text = "a combination that is moved into a range has no exact method"
            _decline("FTD02", f"{name!r}: {text}")
        own: tuple[Hedge, ...] = ("not", *hedges) if negated else hedges
        return [(replace(proposition, hedges=own),)]

    def _one_proposition(
        self, parts: Sequence[Condition], *, negated: bool
    ) -> Proposition | None:
        """Return `x is a or x is b` as one proposition, if it is that."""
        every = [*_alternatives(parts)]
        plain = [p for p in every if p is not None and not p.hedges]
        if len(plain) < len(every) or len({p.variable for p in plain}) > 1:
            return None
        for proposition in plain:
            self._proposition(proposition, negated=False)
        terms = dict.fromkeys(term for p in plain for term in p.terms)
        return Proposition(plain[0].variable, tuple(terms), ("not",) if negated else ())

    def _check(self, word: Choice["and", "or"], *, negated: bool) -> None:
        """Raise unless a joint is exact as ways of minima or products."""
        block = self.block
        norm = block.conjunction if word == "and" else block.disjunction
        exact = {"and": ("minimum", "product"), "or": ("maximum",)}[word]
        if norm not in exact:
            _decline("FTD01", f"its {word!r} is the {norm}, which has no exact method")
        if word == "and" and negated and norm == "product":
            _decline("FTD07", "it negates a product, which has no exact method")
        if word == "or" and negated and block.conjunction == "product":
            _decline("FTD07", "it negates an 'or' within rules that multiply")

    def _join(
        self, parts: Sequence[Condition], *, is_union: bool, negated: bool
    ) -> list[_Way]:
        whole: list[_Way] = [] if is_union else [()]
        for part in parts:
            ways = self.ways(part, negated=negated)
            count = len(whole) + len(ways) if is_union else len(whole) * len(ways)
            if count > MOST_WAYS:
                _decline("FTD05", f"it can hold in more than {MOST_WAYS} ways")
            if is_union:
                whole += ways
            else:
                whole = [a + b for a, b in itertools.product(whole, ways)]
            whole = [*dict.fromkeys(whole)]
        if self.block.conjunction != "product":
            return [tuple(dict.fromkeys(way)) for way in whole]
        return whole


def _alternatives(parts: Iterable[Condition]) -> Iterator[Proposition | None]:
    """Yield the propositions that OR joins; None for anything else."""
    for part in parts:
        match part:
            case Or(parts=inner):
                yield from _alternatives(inner)
            case Proposition():
                yield part
            case _:
                yield None

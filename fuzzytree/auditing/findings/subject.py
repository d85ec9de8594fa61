"""What an audit is about: the rules of a model as every family of questions sees them.

Rule bases and trees are audited as they are. A fuzzy system that only stands for a rule
base is audited as that one. Of any other system the conditions are audited, as rules
whose classes are the texts of what they conclude; `fuzzytree.auditing.decide.rules`
says how. What outputs make of them, their curves and numbers, is not part of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.decide import Answer, Base, Budget, Open
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.axes import function_lines
from fuzzytree.auditing.decide.claims import Claims
from fuzzytree.auditing.decide.domain import Domain, DomainSide, span
from fuzzytree.auditing.decide.lines import Hedged
from fuzzytree.auditing.decide.pairs import Pairs
from fuzzytree.auditing.decide.rules import BaseRule, LeftOut, rules_of
from fuzzytree.auditing.decide.states import Declined, Proved, State
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FactValue,
    Measure,
    Policy,
    SourceFile,
    TermName,
)
from fuzzytree.model import (
    And,
    Band,
    Conjunction,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Linear,
    MembershipFunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Term,
    Variable,
    joints,
    questions,
)
from fuzzytree.numerics import outwards
from fuzzytree.semantics import as_rules, rules_from_tree, shape_of

if TYPE_CHECKING:
    from fuzzytree.auditing.findings.locations import ModelFile
    from fuzzytree.auditing.findings.results import LoadedResult
    from fuzzytree.model import FloatArray, IntArray

Name = tuple[str, str]
"""A variable, and one of its terms."""


class AuditRows(msgspec.Struct, frozen=True, eq=False):
    """Rows of a table, and what messages call it.

    `values` has the shape (inputs, rows), in the order of the model's inputs; `codes`
    the number of each row's class, -1 if it has none of the model's; it is None if the
    table has no column of classes.
    """

    name: str
    values: FloatArray
    codes: IntArray | None = None


class Material(msgspec.Struct, frozen=True, eq=False):
    """What an audit is about, each file of it read once: it may change meanwhile.

    `data` is the file of the rows, `results` what other verbs found of the model.
    """

    model: Document
    file: ModelFile | None = None
    rows: AuditRows | None = None
    data: SourceFile | None = None
    results: tuple[LoadedResult, ...] = ()


class AuditView(msgspec.Struct, frozen=True, eq=False):
    """A model's rules as they are audited.

    Attributes:
        rules: The rules as people read them, without weights; None if not one rule of
            a system could be taken over.
        base_rules: The same rules as the decider takes them.
        domain: Where inputs are moved into their range, not beyond it.
        tree, system: The model they come from, if it is one.
        raw: The raw rules of a tree with fitted sets.
        rule_names: Such as `rule 2 of block 1`; empty where rules are numbered.
        numbers: The number in the model of each rule, from 1, over all blocks.
        declined: What was left out, and why; and rules that can never fire.
        left_out: The number in the model of each rule that is named there.
        is_whole: Whether no rule is left out that may fire.
        curves: The functions of a system's terms that lines enclose.
        inexact: Those and all others that have no exact shape, hedged ones too; in
            `rules` a plateau stands for each.
    """

    rules: RuleBase | None
    base_rules: tuple[BaseRule, ...]
    policy: Policy
    domain: Domain
    tree: FuzzyTree | None = None
    raw: RuleBase | None = None
    system: FuzzySystem | None = None
    rule_names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    declined: tuple[AuditAnswer, ...] = ()
    is_whole: bool = True
    curves: Mapping[Name, MembershipFunction] = {}
    inexact: frozenset[Name] = frozenset()
    left_out: Mapping[str, int] = {}

    def rule_name(self, number: int) -> str:
        """Return what messages call a rule."""
        return self.rule_names[number - 1] if self.rule_names else f"rule {number}"


class Subject(AuditView, frozen=True, eq=False, kw_only=True):
    """A model with at least one rule, as the families of questions receive it.

    `budget` says how many steps are left, `pairs` answers of its rules; `row` is one
    whose nearest other decision is sought.
    """

    rules: RuleBase
    settings: AuditSettings
    budget: Budget
    pairs: Pairs
    rows: AuditRows | None = None
    row: Mapping[str, float] | None = None

    @property
    def claims(self) -> Claims:
        """What is asked of the rules."""
        return self.pairs.claims

    @property
    def base(self) -> Base:
        """The rules, ready for questions."""
        return self.pairs.base

    def answer(
        self,
        message: str,
        places: Sequence[int],
        state: State,
        *measures: Measure,
        subject: str = "",
        terms: tuple[TermName, ...] = (),
        facts: Mapping[str, FactValue] = MappingProxyType({}),
    ) -> AuditAnswer:
        """Return an answer about rules at some positions; `subject` may name more."""
        rules = tuple(place + 1 for place in places)
        subject = subject or " and ".join(map(self.rule_name, rules))
        return audit_answer(
            message, subject, state, *measures, facts=facts, rules=rules, terms=terms
        )

    def class_at(
        self, point: Mapping[str, Fraction], without: int | None = None
    ) -> str | None:
        """Return the class at a point, perhaps without the rule at a position."""
        every = [place for place in range(self.base.count) if place != without]
        low, _ = self.base.strengths(point, every)
        best = max(every, key=lambda place: (low[place], -place), default=None)
        if best is None or low[best] <= 0:
            return self.policy.uncovered
        return self.base.rules[best].then


def subject_of(
    viewed: AuditView,
    settings: AuditSettings,
    budget: Budget | None = None,
    rows: AuditRows | None = None,
    row: Mapping[str, float] | None = None,
) -> Subject:
    """Return the rules of a view, ready for questions."""
    is_class = viewed.policy.decision == "strongest" or viewed.system is None
    model = viewed.rules if is_class else viewed.system
    if model is None:
        raise ValueError("there is no rule to audit")
    variables = {variable.name: variable for variable in model.variables}
    base = Base(viewed.base_rules, variables, viewed.domain, seed=settings.seed)
    budget = budget or Budget(int(settings.budget * 1e6))
    pairs = Pairs(Claims(base, viewed.policy.uncovered))
    return Subject(
        **msgspec.structs.asdict(viewed),
        settings=settings,
        budget=budget,
        pairs=pairs,
        rows=rows,
        row=row,
    )


def state_of(answer: Answer) -> State:
    """Return an answer without a point as a state."""
    if isinstance(answer, NoPoint):
        return Proved(answer.how, tuple(place + 1 for place in answer.rivals))
    assert isinstance(answer, Open)  # a point needs claims
    return Declined(answer.code, answer.why)


# --- the rules of a model


def view(model: Document, domain: Domain) -> AuditView:
    """Return the rules of a model as they are audited on a domain.

    Of a tree these are its relative rules, which decide as it does; of a system those
    of the rule base that it stands for, or its conditions.
    """
    match model:
        case RuleBase():
            return _of_rules(model, domain)
        case FuzzyTree():
            raw = rules_from_tree(model, "raw") if model.sets else None
            whole = _of_rules(rules_from_tree(model), domain)
            return replace(whole, tree=model, raw=raw)
        case FuzzySystem():
            rules = as_rules(model)
            if rules is None:
                return _of_system(model, domain)
            return replace(_of_rules(rules, domain), system=model)


def _of_rules(rules: RuleBase, domain: Domain) -> AuditView:
    meant = rules.semantics
    policy = Policy(meant.conjunction, "strongest", meant.uncovered, meant.missing)
    every = rules_of(rules).rules
    return AuditView(
        rules, every, policy, domain, numbers=tuple(rule.number for rule in every)
    )


# --- systems


def _of_system(system: FuzzySystem, domain: Domain) -> AuditView:
    conjunction = _conjunction(system)
    sides, answers = _within(system, domain)
    shapes = {
        (v.name, t.name): shape
        for v in system.variables
        for t in v.terms
        if not _is_moved(v) and (shape := _shape(t)) is not None
    }
    curves = dict(_curves(system, sides, shapes))
    answers += _of_terms(system, shapes, curves, sides)
    every = rules_of(system)
    left = {rule.number: rule for rule in every.left_out}
    for rule in every.rules:
        if len(rule.literals) > 1 and rule.norm != conjunction:
            text = f"its 'and' is the {rule.norm}, and that of most rules is another"
            name = rule.name.partition(" of ")[2] if "way " in rule.name else rule.name
            left[rule.number] = LeftOut(name, rule.number, "FTD01", text)
    kept = [rule for rule in every.rules if rule.number not in left]
    for position, block in enumerate(system.blocks, 1):
        if block.activation.method != "general":
            why = f"it is {block.activation.method!r}; only conditions are audited"
            name = f"the activation of block {position}"
            answers.append(_refusal("FTD07", name, why))
    answers += (_refusal(o.code, o.name, o.reason) for o in left.values())
    proof = Proved("read off the rule; no input was needed")
    answers += (
        audit_answer(f"FT101.{why}", name, proof) for name, _, why in every.silent
    )
    whens = [tuple(map(_readable, rule.when)) for rule in kept]
    terms = dict.fromkeys(
        (p.variable, term) for when in whens for p in when for term in p.terms
    )
    terms |= {(v.name, t.name): None for v in system.variables for t in v.terms}
    rules = None
    if kept:
        pairs = zip(whens, kept, strict=True)
        rules = RuleBase(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in kept)),
            tuple(_with_terms(v, shapes, terms) for v in system.variables),
            tuple(Rule(when, rule.then) for when, rule in pairs),
            Semantics(conjunction),
        )
    return AuditView(
        rules,
        tuple(kept),
        Policy(conjunction, "all"),
        sides,
        system=system,
        rule_names=tuple(rule.name for rule in kept),
        numbers=tuple(rule.number for rule in kept),
        declined=tuple(answers),
        left_out={o.name: o.number for o in left.values()}
        | {name: number for name, number, _ in every.silent},
        is_whole=not left,
        curves=curves,
        inexact=frozenset(terms.keys() - shapes.keys()),
    )


def _conjunction(system: FuzzySystem) -> Conjunction:
    """Return the AND of most rules that have one, of those with an exact method."""
    counts: dict[Conjunction, int] = {"minimum": 0, "product": 0}
    for block in system.blocks:
        norm = block.conjunction
        if norm == "minimum" or norm == "product":
            counts[norm] += sum(And in joints(rule.when) for rule in block.rules)
    return "product" if counts["product"] > counts["minimum"] else "minimum"


def _within(system: FuzzySystem, domain: Domain) -> tuple[Domain, list[AuditAnswer]]:
    """Return the domain within the ranges that inputs are moved into."""
    clipped = {v.name: v for v in system.variables if v.clips and not v.parts}
    sides: list[DomainSide] = []
    answers: list[AuditAnswer] = []
    for side in domain.sides:
        ends = [side.low, side.high]
        if variable := clipped.get(side.variable):
            if variable.low is not None:
                ends = [max(end, variable.low) for end in ends]
            if variable.high is not None:
                ends = [min(end, variable.high) for end in ends]
        low, high = ends
        if (low, high) != (side.low, side.high):
            why = (
                f"values outside its range are moved to its ends, so its domain is "
                f"from {low!r} to {high!r}"
            )
            answers.append(_refusal("FTD07", f"input {side.variable!r}", why))
        sides.append(replace(side, low=low, high=high))
    return Domain(tuple(sides)), answers


def _refusal(code: str, subject: str, reason: str) -> AuditAnswer:
    return audit_answer("FTD.left-out", subject, Declined(code, reason))


# --- terms


def _shape(term: Term) -> Shape | None:
    """Return the exact shape of a term, with its height; None if there is none."""
    shape = shape_of(term.function)
    if shape is None or any(shape.mistakes()):
        return None
    if term.height == 1.0:
        return shape
    if not isinstance(shape, Points):
        return None
    degrees = tuple(degree * term.height for degree in shape.degrees)
    exact = [Fraction(degree) * Fraction(term.height) for degree in shape.degrees]
    return Points(shape.values, degrees) if [*map(Fraction, degrees)] == exact else None


def _readable(p: Proposition) -> Proposition:
    """Return a proposition whose hedges are part of the name of its term."""
    hedges = p.hedges[p.negated :]
    terms = tuple(" ".join((*hedges, term)) for term in p.terms)
    return Proposition(p.variable, terms, ("not",) if p.negated else ())


def _with_terms(
    v: Variable, shapes: dict[Name, Shape], names: Iterable[Name]
) -> Variable:
    """Return an input with some terms; a plateau stands for one without a shape."""
    terms = tuple(
        Term(name, shapes.get((of, name), Band())) for of, name in names if of == v.name
    )
    return Variable(v.name, terms, v.unit, v.low, v.high, v.parts)


def _curves(
    system: FuzzySystem, domain: Domain, shapes: dict[Name, Shape]
) -> Iterator[tuple[Name, MembershipFunction]]:
    """Yield the functions of terms that lines enclose, and that are none."""
    for variable in system.variables:
        names = [part.input for part in variable.parts] or [variable.name]
        if any(domain.side(name) is None for name in names) or _is_moved(variable):
            continue
        for term in variable.terms:
            shape = shape_of(term.function)
            is_wrong = shape is not None and any(shape.mistakes())
            is_free = isinstance(term.function, Formula | Linear) or is_wrong
            if (variable.name, term.name) not in shapes and not is_free:
                function = Hedged(term.function, term.height, ())
                yield (variable.name, term.name), function


def _is_moved(variable: Variable) -> bool:
    """Return whether a combination is moved into a range."""
    return bool(variable.parts and variable.clips)


def _of_terms(
    system: FuzzySystem,
    shapes: dict[Name, Shape],
    curves: dict[Name, MembershipFunction],
    domain: Domain,
) -> Iterator[AuditAnswer]:
    """Yield what becomes of terms without an exact shape, and why."""
    uses = Counter(
        key
        for rule in system.rules
        for key in {(p.variable, p.term) for p in questions(rule.when)}
    )
    every = [
        (variable, term) for variable in system.variables for term in variable.terms
    ]
    for variable, term in every:
        key = variable.name, term.name
        if key in shapes:
            continue
        message, facts = "FTD.left-out", dict[str, float]()
        tag = term.function.__struct_config__.tag
        reason = f"its curve ({tag}) has no exact method"
        if _is_moved(variable):
            reason = "a combination that is moved into a range has no exact method"
        if key in curves:
            message = "FTD.bounded"
            reason += "; its shape and its overlaps are not checked"
            both = function_lines(curves[key], *span(variable, domain))
            pairs = zip(both.lower.at, both.upper.at, strict=True)
            apart = max((high - low for low, high in pairs), default=Fraction(0))
            facts = {"apart": outwards(apart)[1]}
        few = {0: "no rule uses it", 1: "1 rule uses it"}
        reason += f"; {few.get(uses[key], f'{uses[key]} rules use it')}"
        title, state = f"term {term.name!r} of {key[0]!r}", Declined("FTD02", reason)
        names = (TermName(*key),)
        yield audit_answer(message, title, state, terms=names, facts=facts)

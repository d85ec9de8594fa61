"""What an audit is about, in the form that every family of questions takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING

import msgspec

from fuzzytree.auditing.decide import Answer, Base, Budget, Open
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.claims import Claims
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.pairs import Pairs
from fuzzytree.auditing.decide.rules import BaseRule
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
    Document,
    FuzzySystem,
    FuzzyTree,
    MembershipFunction,
    RuleBase,
)

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
    asked = viewed.rules if is_class else viewed.system
    if asked is None:
        raise ValueError("there is no rule to audit")
    variables = {variable.name: variable for variable in asked.variables}
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

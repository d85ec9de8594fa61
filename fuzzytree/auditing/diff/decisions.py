"""Where two models decide differently, and how that comes about.

The same operations on the same numbers prove decisions equal on any input. Otherwise
rows of data, points drawn from the domain and probes of both models are tried, each
answered exactly; and where these show no difference, the decider proves that there is
none on the domain, or finds it, or leaves a bracket
(`fuzzytree.auditing.diff.agreement`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.domain import Domain, simplified
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Span,
    State,
    Witness,
    answer_text,
    point_of,
)
from fuzzytree.auditing.diff.agreement import Agreement, Prediction
from fuzzytree.auditing.diff.difference_records import DecisionEvidence
from fuzzytree.auditing.diff.regions import difference_region
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FactValue,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.support import (
    rows_outside,
    sample_points,
    sampled_share,
)
from fuzzytree.model import (
    Document,
    FloatArray,
    FuzzyTree,
    IntArray,
    Rule,
    RuleBase,
    Variable,
)
from fuzzytree.numerics import MISSING, TIE, UNCOVERED, Decisions, decide
from fuzzytree.semantics import probe_values, proof_faults, unguarded

_PROBES = 4_000  # of each model
_MOST_LISTED = 24  # pairs of classes with a witness each
_POINTS = 0.5  # of the budget is for single points, the rest for proofs
_PORTION = 1024  # rows between two looks at the budget
_MOST_REGIONS = 4  # of which the box is looked for

Progress = Callable[[str, float], None]


def silent(_: str, __: float) -> None:
    """Report nothing."""


class RulePair(msgspec.Struct, frozen=True, eq=False):
    """Two models as rules, and where they are compared.

    Attributes:
        inputs: The inputs of either, the old ones first.
        domain: A side for each.
        trees: The trees that the rules come from, if both are trees.
    """

    old: RuleBase
    new: RuleBase
    inputs: tuple[str, ...]
    domain: Domain
    trees: tuple[FuzzyTree, FuzzyTree] | None = None

    def decide(self, model: RuleBase, values: FloatArray) -> Decisions:
        """Return one model's exact answers to rows of shape (inputs, rows)."""
        rows = values[[self.inputs.index(name) for name in model.inputs]]
        return decide(model, rows, with_strengths=False)

    def labels(self, both: tuple[Decisions, Decisions]) -> tuple[IntArray, IntArray]:
        """Return the classes of both answers, numbered alike; -1 is no class."""
        known = list(dict.fromkeys((*self.old.classes, *self.new.classes)))
        one, other = (
            np.array([*map(known.index, model.classes), -1], np.int64)[decided.label]
            for model, decided in zip((self.old, self.new), both, strict=True)
        )
        return one, other


def all_inputs(old: Document, new: Document) -> tuple[str, ...]:
    """Return the columns that either of two models needs, the old ones first."""
    return tuple(dict.fromkeys((*old.inputs, *new.inputs)))


def union(old: Document, new: Document) -> RuleBase:
    """Return a rule base with the inputs of both models, and no proposition.

    Raises:
        ValueError: If a category stands at two places.
    """
    inputs: dict[str, Variable] = {}
    for variable in (*old.variables, *new.variables):
        if variable.parts:
            continue
        plain = msgspec.structs.replace(variable, terms=(), clips=False)
        known = inputs.setdefault(variable.name, plain)
        both = (known.categories, variable.categories)
        if any(one != other for one, other in zip(*both, strict=False)):
            raise ValueError(
                f"the categories of {variable.name!r} are {', '.join(both[0])} in one "
                f"model and {', '.join(both[1])} in the other, so that one code is "
                "two values"
            )
        if len(both[1]) > len(both[0]):
            inputs[variable.name] = plain
    names = all_inputs(old, new)
    rows = tuple(inputs[name] for name in names)
    return RuleBase("both", ("x",), rows, (Rule((), "x"),))


def decisions(
    pair: RulePair,
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress = silent,
) -> tuple[list[AuditAnswer], DecisionEvidence]:
    """Return what is known of decisions, and how those that differ come about."""
    whole = _same_everywhere(pair)
    if whole is not None:
        return [whole], DecisionEvidence(is_equal=True)
    differences = _Differences(pair, budget.share(_POINTS))
    answers: list[AuditAnswer] = []
    if rows is not None:
        answers.append(_on_rows(rows, differences))
    both = union(pair.old, pair.new)
    values = sample_points(both, pair.domain, settings.rows, settings.seed)
    many, count = differences.add(values)
    probes = _probes(pair)
    differences.add(probes[:, ~rows_outside(both, pair.domain, probes)])
    if not differences.witnesses:
        report("proving that decisions are equal", 0.3)
        state = differences.both.state(budget)
        if isinstance(state, Witness):
            differences.add_point(point_of(state.point))
        else:
            answers.insert(0, _equal_answer(pair, state))
    if differences.witnesses:
        answers = [*_witness_answers(differences), *answers]
    is_open = not isinstance(answers[0].state, Proved)
    if count and is_open:
        answers.append(_drawn_answer(many, count, settings.seed))
    if is_open and differences.left:
        why = "the budget for single points was spent"
        answers.append(left_out(f"{differences.left} points", why))
    return answers, differences.evidence(is_equal=not is_open)


def _same_everywhere(pair: RulePair) -> AuditAnswer | None:
    """Return that both perform the same operations on the same numbers, if they do."""
    old, new = pair.old, pair.new
    faults = [*proof_faults(old, new), *unguarded(old, new), *unguarded(new, old)]
    if faults or old.inputs != new.inputs:
        return None
    how = "both take the same curves of the same inputs in the same rules, on any input"
    facts = {"where": ""}
    return audit_answer("FT801.alike", "decisions", Proved(how), facts=facts)


def _equal_answer(pair: RulePair, state: State) -> AuditAnswer:
    if isinstance(state, Bracket):
        margin = {"margin": state.high}
        return audit_answer("FT801.margin", "decisions", state, facts=margin)
    old, new = pair.old, pair.new
    where = " everywhere on the domain"
    if old.semantics.missing != new.semantics.missing or unguarded(old, new):
        where += ", where no value is missing"
    return audit_answer("FT801.alike", "decisions", state, facts={"where": where})


def _on_rows(rows: AuditRows, differences: _Differences) -> AuditAnswer:
    hits, count = differences.add(rows.values, name="row")
    total = rows.values.shape[1]
    state = sampled_share(
        "rows that are classified differently", hits, count, rows.name
    )
    facts: dict[str, FactValue] = {"table": rows.name}
    if count < total:
        facts["total"] = total
    return audit_answer("FT801.rows", "rows", state, is_finding=hits > 0, facts=facts)


def _drawn_answer(hits: int, rows: int, seed: int) -> AuditAnswer:
    how = f"{rows} points drawn evenly from the domain, seed {seed}"
    state = sampled_share("the domain that is classified differently", hits, rows, how)
    return audit_answer("FT801.domain", "domain", state, is_finding=hits > 0)


def left_out(points: str, reason: str = "the budget was spent") -> AuditAnswer:
    """Return that some points were not compared."""
    state, facts = Declined("FTD03", reason), {"points": points}
    return audit_answer("FT801.not-compared", "points", state, facts=facts)


def _witness_answers(differences: _Differences) -> Iterator[AuditAnswer]:
    """Yield a witness for each pair of classes, the clearest one that is known."""
    both = differences.both
    known = sorted(differences.witnesses.items(), key=lambda item: str(item[0]))
    for number, (labels, (_, name, found_at)) in enumerate(known[:_MOST_LISTED]):
        point = found_at if name else _simple(both, labels, found_at)
        one, other = both.predictions(point)
        state = both.witness(point)
        assert state is not None  # only such points are kept
        spans: tuple[Span, ...] = ()
        if number < _MOST_REGIONS:
            spans = difference_region(both, point)
        state = msgspec.structs.replace(state, region=spans)
        facts = {"row": name} if name else {}
        facts |= {"old": _answered(one), "new": _answered(other)}
        title = " -> ".join(map(answer_text, labels))
        yield audit_answer("FT801.differs", title, state, region=spans, facts=facts)
    if len(known) > _MOST_LISTED:
        state = both.witness(known[_MOST_LISTED][1][2])
        assert state is not None
        left = {"count": len(known) - _MOST_LISTED}
        yield audit_answer("FT801.more", "more", state, facts=left)


def _simple(
    both: Agreement, labels: tuple[str | None, ...], point: dict[str, Fraction]
) -> dict[str, Fraction]:
    """Return a point of few digits at which both models answer the same as here."""

    def holds(tried: Mapping[str, Fraction]) -> bool:
        return tuple(one.label for one in both.predictions(tried)) == labels

    return simplified(point, both.base.domain, holds)


def _answered(one: Prediction) -> str:
    if not one.rule:
        return f"{answer_text(one.label)}, for no rule fires"
    how = f"rule {one.rule}, the first of equals" if one.is_tie else f"rule {one.rule}"
    return f"{answer_text(one.label)} by {how}"


class _Differences:
    """Points at which two models answer differently, and how that comes about."""

    def __init__(self, pair: RulePair, budget: Budget) -> None:
        self.pair, self.budget, self.left = pair, budget, 0
        self.both = Agreement(
            pair.old, pair.new, pair.domain, are_trees=pair.trees is not None
        )
        self.witnesses: dict[
            tuple[str | None, str | None], tuple[float, str, dict[str, Fraction]]
        ] = {}
        self.old_rules: set[int] = set()
        self.new_rules: set[int] = set()
        self.has_tie = self.has_none = False

    def add(self, values: FloatArray, name: str = "") -> tuple[int, int]:
        """Compare the answers to some rows, as long as steps are left.

        Returns:
            How many differ, of how many that were looked at.
        """
        hits = count = 0
        for part in portions(values.shape[1], self.both.base.count, self.budget):
            hits += self._add(values[:, part], name, part.start)
            count = part.stop
        self.left += values.shape[1] - count
        return hits, count

    def _add(self, values: FloatArray, name: str, start: int) -> int:
        pair = self.pair
        both = pair.decide(pair.old, values), pair.decide(pair.new, values)
        one, other = self.pair.labels(both)
        rows = np.flatnonzero(one != other)
        margins = np.minimum(both[0].margin, both[1].margin)
        missing = (both[0].status == MISSING) | (both[1].status == MISSING)
        known = rows[~missing[rows]]
        self.old_rules |= {*both[0].rule[known].tolist()} - {0}
        self.new_rules |= {*both[1].rule[known].tolist()} - {0}
        status = np.concatenate([each.status[known] for each in both])
        self.has_tie |= bool((status == TIE).any())
        self.has_none |= bool((status == UNCOVERED).any())
        for row in _clearest(one[known], other[known], margins[known]):
            place = int(known[row])
            title = f"{name} {start + place + 1}" if name else ""
            point: dict[str, Fraction] = {}
            for key, x in zip(pair.inputs, values[:, place].tolist(), strict=True):
                side = pair.domain.side(key)
                stand_in = None if side is None else side.missing
                if math.isfinite(x) or stand_in is not None:
                    point[key] = Fraction(x if math.isfinite(x) else stand_in or 0)
            if point.keys() == {*pair.inputs}:
                self.add_point(point, float(margins[place]), title)
        return int(rows.size)

    def add_point(
        self, point: dict[str, Fraction], margin: float = 0.0, name: str = ""
    ) -> None:
        """Keep a point, if its pair of classes has no clearer one."""
        one, other = self.both.predictions(point)
        if one.label == other.label:
            return
        self.old_rules |= {one.rule} - {0}
        self.new_rules |= {other.rule} - {0}
        self.has_tie |= one.is_tie or other.is_tie
        self.has_none |= not (one.rule and other.rule)
        kept = self.witnesses.get((one.label, other.label))
        is_better = kept is not None and margin > kept[0] and (name or not kept[1])
        if kept is None or is_better:
            self.witnesses[one.label, other.label] = (margin, name, point)

    def evidence(self, *, is_equal: bool) -> DecisionEvidence:
        """Return how differing decisions come about."""
        rules = frozenset(self.old_rules), frozenset(self.new_rules)
        return DecisionEvidence(*rules, self.has_tie, self.has_none, is_equal)


def portions(count: int, steps: int, budget: Budget) -> Iterator[slice]:
    """Yield parts of some rows, of so many steps each, until the budget is spent."""
    start = 0
    while start < count:
        size = min(_PORTION, max(budget.left // steps, 1))
        part = slice(start, min(start + size, count))
        try:
            budget.spend((part.stop - start) * steps)
        except OutOfStepsError:
            return
        yield part
        start = part.stop


def _clearest(one: IntArray, other: IntArray, margins: FloatArray) -> list[int]:
    """Return the row with the largest margin for each pair of classes."""
    best: dict[tuple[int, int], int] = {}
    for row, key in enumerate(zip(one.tolist(), other.tolist(), strict=True)):
        if key not in best or margins[row] > margins[best[key]]:
            best[key] = row
    return list(best.values())


def _probes(pair: RulePair) -> FloatArray:
    """Return the probes of both models; other inputs stay in the middle."""
    low, high = ends_of(pair.domain, pair.inputs)
    probes: list[FloatArray] = []
    for model in (pair.old, pair.new):
        known = probe_values(model, _PROBES)
        values = np.repeat(low / 2 + high / 2, known.shape[1], axis=1)
        values[[pair.inputs.index(name) for name in model.inputs]] = known
        probes.append(values)
    return np.hstack(probes)


def ends_of(domain: Domain, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends of some inputs, each of shape (inputs, 1)."""
    sides = {side.variable: side for side in domain.sides}
    ends = [(sides[name].low, sides[name].high) for name in names]
    low, high = np.array(ends).reshape(len(names), 2).T
    return low[:, None], high[:, None]

"""Where two models decide differently, and how that comes about.

The same operations on the same numbers prove decisions equal on any input. Otherwise
rows of data, points drawn from the domain and probes of both models are tried, each
answered exactly; and where these show no difference, the decider proves that there is
none on the domain, or finds it, or leaves a bracket
(`fuzzytree.auditing.diff.agreement`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import simplify
from fuzzytree.auditing.decide.states import (
    Bracket,
    Proved,
    Span,
    State,
    Witness,
    answer_text,
    point_of,
)
from fuzzytree.auditing.diff.agreement import Agreement, Prediction
from fuzzytree.auditing.diff.records import Evidence
from fuzzytree.auditing.diff.regions import difference_region
from fuzzytree.auditing.diff.samples import Differences, Pair, Progress, left_out
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, AuditSettings, FactValue
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.support import share_in_sample
from fuzzytree.model import FloatArray, RuleBase
from fuzzytree.numerics import MISSING, TIE, UNCOVERED, decide
from fuzzytree.semantics import probe_values, proof_faults, unguarded

_PROBES = 4_000  # of each model
_MOST_LISTED = 24  # pairs of classes with a witness each
_POINTS = 0.5  # of the budget is for single points, the rest for proofs
_MOST_REGIONS = 4  # of which the box is looked for


def class_answers(
    pair: Pair[RuleBase],
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress,
) -> tuple[list[AuditAnswer], Evidence]:
    """Return what is known of decisions, and how those that differ come about."""
    old, new = pair.old, pair.new
    faults = [*proof_faults(old, new), *unguarded(old, new), *unguarded(new, old)]
    if not faults and old.inputs == new.inputs:
        how = "both take the same curves of the same inputs in the same rules"
        state: State = Proved(f"{how}, on any input")
        answer = audit_answer("FT801.alike", "decisions", state, facts={"where": ""})
        return [answer], Evidence(is_equal=True)
    differences = _Decisions(pair)
    points = budget.share(_POINTS)
    answers: list[AuditAnswer] = []
    if rows is not None:
        answers.append(_on_rows(rows, differences, points))
    many, count = differences.add(pair.draw(settings.rows, settings.seed), points)
    probes = pair.within(probe_values(model, _PROBES) for model in (old, new))
    differences.add(probes, points)
    if not differences.witnesses:
        report("proving that decisions are equal", 0.3)
        state = differences.both.state(budget)
        if isinstance(state, Witness):
            differences.add_point(point_of(state.point))
        else:
            answers.insert(0, _equal_answer(pair, state))
    answers = [*_witness_answers(differences), *answers]
    is_equal = isinstance(answers[0].state, Proved)
    if count and not is_equal:
        how = f"{count} points drawn evenly from the domain, seed {settings.seed}"
        of = "the domain that is classified differently"
        state, is_finding = share_in_sample(of, many, count, how), many > 0
        answer = audit_answer("FT801.domain", "domain", state, is_finding=is_finding)
        answers.append(answer)
    if differences.left and not is_equal:
        why = "the budget for single points was spent"
        answers.append(left_out("points", f"{differences.left} points", why))
    return answers, differences.evidence(is_equal=is_equal)


def _equal_answer(pair: Pair[RuleBase], state: State) -> AuditAnswer:
    if isinstance(state, Bracket):
        margin = {"margin": state.high}
        return audit_answer("FT801.margin", "decisions", state, facts=margin)
    old, new = pair.old, pair.new
    where = " everywhere on the domain"
    if old.semantics.missing != new.semantics.missing or unguarded(old, new):
        where += ", where no value is missing"
    return audit_answer("FT801.alike", "decisions", state, facts={"where": where})


def _on_rows(rows: AuditRows, differences: _Decisions, budget: Budget) -> AuditAnswer:
    hits, count = differences.add(rows.values, budget, "row")
    total = rows.values.shape[1]
    of = "rows that are classified differently"
    state = share_in_sample(of, hits, count, rows.name)
    facts: dict[str, FactValue] = {"table": rows.name}
    if count < total:
        facts["total"] = total
    return audit_answer("FT801.rows", "rows", state, is_finding=hits > 0, facts=facts)


def _witness_answers(differences: _Decisions) -> Iterator[AuditAnswer]:
    """Yield a witness for each pair of classes, the clearest one that is known."""
    both = differences.both
    witnesses = sorted(differences.witnesses.items(), key=lambda item: str(item[0]))
    for number, (labels, (_, name, start)) in enumerate(witnesses[:_MOST_LISTED]):
        point = start if name else _simple(both, labels, start)
        spans: tuple[Span, ...] = ()
        if number < _MOST_REGIONS:
            spans = difference_region(both, point)
        state = msgspec.structs.replace(both.witness(point), region=spans)
        old, new = map(_prediction_text, both.predictions(point))
        facts = {"row": name} if name else {}
        facts |= {"old": old, "new": new}
        title = " -> ".join(map(answer_text, labels))
        yield audit_answer("FT801.differs", title, state, region=spans, facts=facts)
    if len(witnesses) > _MOST_LISTED:
        state = both.witness(witnesses[_MOST_LISTED][1][2])
        left = {"count": len(witnesses) - _MOST_LISTED}
        yield audit_answer("FT801.more", "more", state, facts=left)


def _simple(
    both: Agreement, labels: tuple[str | None, ...], point: dict[str, Fraction]
) -> dict[str, Fraction]:
    """Return a point of few digits at which both models answer the same as here."""

    def holds(tried: Mapping[str, Fraction]) -> bool:
        return both.labels(tried) == labels

    return simplify(point, both.base.domain, holds)


def _prediction_text(prediction: Prediction) -> str:
    label = answer_text(prediction.label)
    if not prediction.rule:
        return f"{label}, for no rule fires"
    which = ", the first of equals" if prediction.is_tie else ""
    return f"{label} by rule {prediction.rule}{which}"


class _Decisions(Differences):
    """Points at which two models answer differently, and how that comes about.

    Attributes:
        witnesses: For two classes a margin, the name of the row, and the point.
    """

    def __init__(self, pair: Pair[RuleBase]) -> None:
        self.pair = pair
        self.both = Agreement(pair.old, pair.new, pair.domain, are_trees=pair.are_trees)
        super().__init__(self.both.base.count)
        self.witnesses: dict[
            tuple[str | None, ...], tuple[float, str, dict[str, Fraction]]
        ] = {}
        self.rules: tuple[set[int], set[int]] = (set(), set())
        self.has_tie = self.has_none = False

    def compare(self, values: FloatArray, name: str, start: int) -> int:
        """Return on how many rows classes differ; keep the clearest of each two."""
        pair = self.pair
        both = [
            decide(model, pair.rows_of(model, values), with_strengths=False)
            for model in (pair.old, pair.new)
        ]
        old, new = (
            [(*model.classes, None)[place] for place in result.label.tolist()]
            for model, result in zip((pair.old, pair.new), both, strict=True)
        )
        is_other = np.array([a != b for a, b in zip(old, new, strict=True)], np.bool_)
        missing = (both[0].status == MISSING) | (both[1].status == MISSING)
        rows = np.flatnonzero(is_other & ~missing)
        for result, rules in zip(both, self.rules, strict=True):
            rules |= {*result.rule[rows].tolist()} - {0}
            self.has_tie |= bool((result.status[rows] == TIE).any())
            self.has_none |= bool((result.status[rows] == UNCOVERED).any())
        margins = np.minimum(both[0].margin, both[1].margin)
        clearest: dict[tuple[str | None, str | None], int] = {}
        for row in rows[np.argsort(-margins[rows], kind="stable")].tolist():
            clearest.setdefault((old[row], new[row]), row)
        for row in clearest.values():
            title = f"{name} {start + row + 1}" if name else ""
            point: dict[str, Fraction] = {}
            for key, x in zip(pair.inputs, values[:, row].tolist(), strict=True):
                side = pair.domain.side(key)
                stand_in = None if side is None else side.missing
                if math.isfinite(x) or stand_in is not None:
                    point[key] = Fraction(x if math.isfinite(x) else stand_in or 0)
            if point.keys() == {*pair.inputs}:
                self.add_point(point, float(margins[row]), title)
        return int(is_other.sum())

    def add_point(
        self, point: dict[str, Fraction], margin: float = 0.0, name: str = ""
    ) -> None:
        """Keep a point, if its pair of classes has no clearer one."""
        predictions, labels = self.both.predictions(point), self.both.labels(point)
        if labels[0] == labels[1]:
            return
        for prediction, rules in zip(predictions, self.rules, strict=True):
            rules |= {prediction.rule} - {0}
            self.has_tie |= prediction.is_tie
            self.has_none |= not prediction.rule
        kept = self.witnesses.get(labels)
        if kept is None or (margin > kept[0] and (name or not kept[1])):
            self.witnesses[labels] = (margin, name, point)

    def evidence(self, *, is_equal: bool) -> Evidence:
        """Return how differing decisions come about."""
        old, new = map(frozenset, self.rules)
        return Evidence(old, new, self.has_tie, self.has_none, is_equal)

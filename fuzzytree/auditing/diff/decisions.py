"""Where two models decide differently, and how that comes about.

The same operations on the same numbers prove decisions equal on any input. Otherwise
rows of data, probes of both models, points drawn from the domain and points beside
decision boundaries are tried, each answered exactly; and where these show no
difference, boxes prove that there is none on the domain, or find it, or leave a bracket
(`fuzzytree.auditing.engine.equivalence`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.auditing.diff.difference_records import DecisionEvidence
from fuzzytree.auditing.diff.matching import have_same_classes
from fuzzytree.auditing.engine.arrangement import (
    ExactPrediction,
    difference_at,
    prediction_at,
)
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.equivalence import OF, difference_region, equivalence
from fuzzytree.auditing.engine.probes import ends_of
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    Span,
    State,
    Witness,
    answer_text,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import simplified
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FactValue,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.support import sample_points, sampled_share
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
_SEGMENTS = 64  # between points of different decisions, halved down to doubles
_HALVINGS = 70
_MOST_LISTED = 24  # pairs of classes with a witness each
_POINTS = 0.5  # of the budget is for single points, the rest for proofs
_PORTION = 64  # rows between two looks at the clock, at first
_MOST_REGIONS = 4  # of which the box is looked for


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
    clock: Clock,
) -> tuple[list[AuditAnswer], DecisionEvidence]:
    """Return what is known of decisions, and how those that differ come about."""
    whole = _same_everywhere(pair)
    if whole is not None:
        return [whole], DecisionEvidence(is_equal=True)
    differences = _Differences(pair, clock.share(_POINTS))
    answers: list[AuditAnswer] = []
    if rows is not None:
        answers.append(_on_rows(rows, differences))
    values = sample_points(
        union(pair.old, pair.new), pair.domain, settings.rows, settings.seed
    )
    many, count = differences.add(values)
    differences.add(_probes(pair))
    if not differences.witnesses:
        differences.add(_boundaries(differences, values))
    if differences.witnesses:
        answers = [*_witness_answers(pair, differences), *answers]
    else:
        clock.report("proving that decisions are equal", 0.3)
        state = _alike(pair, clock)
        if isinstance(state, Witness):
            differences.add_point(point_of(state.point))
            answers = [*_witness_answers(pair, differences), *answers]
        else:
            answers.insert(0, _equal_answer(pair, state))
    is_open = not isinstance(answers[0].state, Proved)
    if count and is_open:
        answers.append(_drawn_answer(many, count, settings.seed))
    if is_open and (differences.left or differences.is_cut):
        points = (
            f"{differences.left} points"
            if differences.left
            else "points beside decision boundaries"
        )
        answers.append(left_out(points, "the budget for single points was spent"))
    return answers, differences.evidence(is_equal=not is_open)


def _alike(pair: RulePair, clock: Clock) -> State:
    """Return whether both answer alike; the budget is kept even within a box."""
    try:
        with enforced(clock):
            state = equivalence(pair.old, pair.new, pair.domain, clock)
    except OutOfTimeError:
        state = Bracket(OF, 0.0, 1.0, "the budget was spent within a box")
    if isinstance(state, Bracket) and have_same_classes(pair.old, pair.new):
        why = "each class has the same rules: answers differ only where classes tie"
        return Bracket(OF, 0.0, 0.0, why)
    return state


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


def _witness_answers(
    pair: RulePair, differences: _Differences
) -> Iterator[AuditAnswer]:
    """Yield a witness for each pair of classes, the clearest one that is known."""
    known = sorted(differences.witnesses.items(), key=lambda item: str(item[0]))
    for number, (labels, (_, name, found_at)) in enumerate(known[:_MOST_LISTED]):
        point = found_at if name else _simple(pair, labels, found_at)
        one, other = prediction_at(pair.old, point), prediction_at(pair.new, point)
        state = difference_at(pair.old, pair.new, point)
        assert state is not None  # only such points are kept
        spans: tuple[Span, ...] = ()
        if number < _MOST_REGIONS:
            spans = difference_region(pair.old, pair.new, pair.domain, point)
        state = msgspec.structs.replace(state, region=spans)
        facts = {"row": name} if name else {}
        facts |= {"old": _answered(one), "new": _answered(other)}
        title = " -> ".join(map(answer_text, labels))
        yield audit_answer("FT801.differs", title, state, region=spans, facts=facts)
    if len(known) > _MOST_LISTED:
        left = len(known) - _MOST_LISTED
        point = known[_MOST_LISTED][1][2]
        state = difference_at(pair.old, pair.new, point)
        assert state is not None
        yield audit_answer("FT801.more", "more", state, facts={"count": left})


def _simple(
    pair: RulePair, labels: tuple[str | None, str | None], point: dict[str, Fraction]
) -> dict[str, Fraction]:
    """Return a point of few digits at which both models answer the same as here."""

    def holds(tried: Mapping[str, Fraction]) -> bool:
        both = (prediction_at(model, tried).label for model in (pair.old, pair.new))
        return tuple(both) == labels

    return simplified(point, pair.domain, holds)


def _answered(one: ExactPrediction) -> str:
    if not one.rule:
        return f"{answer_text(one.label)}, for no rule fires"
    how = f"rule {one.rule}, the first of equals" if one.is_tie else f"rule {one.rule}"
    return f"{answer_text(one.label)} by {how}"


class _Differences:
    """Points at which two models answer differently, and how that comes about."""

    def __init__(self, pair: RulePair, clock: Clock) -> None:
        self.pair, self.clock, self.left, self.is_cut = pair, clock, 0, False
        self.witnesses: dict[
            tuple[str | None, str | None], tuple[float, str, dict[str, Fraction]]
        ] = {}
        self.old_rules: set[int] = set()
        self.new_rules: set[int] = set()
        self.has_tie = self.has_none = False

    def add(self, values: FloatArray, name: str = "") -> tuple[int, int]:
        """Compare the answers to some rows, as long as there is time.

        Returns:
            How many differ, of how many that were looked at.
        """
        hits = count = 0
        for part in portions(values.shape[1], self.clock):
            hits += self._add(values[:, part], name, part.start)
            count = min(part.stop, values.shape[1])
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
            x = zip(self.pair.inputs, values[:, place].tolist(), strict=True)
            point = {key: Fraction(value) for key, value in x}
            title = f"{name} {start + place + 1}" if name else ""
            self.add_point(point, float(margins[place]), title)
        return int(rows.size)

    def add_point(
        self, point: dict[str, Fraction], margin: float = 0.0, name: str = ""
    ) -> None:
        """Keep a point, if its pair of classes has no clearer one."""
        one = prediction_at(self.pair.old, point)
        other = prediction_at(self.pair.new, point)
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


def portions(count: int, clock: Clock) -> Iterator[slice]:
    """Yield parts of some rows until the clock is over: at least one, if there are any.

    Rows in fractions take long: parts grow as long as they take little of what is left.
    """
    start, size = 0, _PORTION
    while start < count and (not start or not clock.is_over):
        before = clock.left_s
        yield slice(start, start + size)
        start += size
        left = clock.left_s
        if math.isinf(left) or (before - left) * 16 < left:
            size *= 2


def _clearest(one: IntArray, other: IntArray, margins: FloatArray) -> list[int]:
    """Return the row with the largest margin for each pair of classes."""
    best: dict[tuple[int, int], int] = {}
    for row, key in enumerate(zip(one.tolist(), other.tolist(), strict=True)):
        if key not in best or margins[row] > margins[best[key]]:
            best[key] = row
    return list(best.values())


def inside(values: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the points that are within some ends; shape (inputs, points)."""
    kept: FloatArray = values[:, ((values >= low) & (values <= high)).all(axis=0)]
    return kept


def _probes(pair: RulePair) -> FloatArray:
    """Return the probes of both models that are on the domain."""
    low, high = ends_of(pair.domain, pair.inputs)
    probes: list[FloatArray] = []
    for model in (pair.old, pair.new):
        known = probe_values(model, _PROBES)
        # An input that this model does not use stays in the middle of its side.
        values = np.repeat(low / 2 + high / 2, known.shape[1], axis=1)
        values[[pair.inputs.index(name) for name in model.inputs]] = known
        probes.append(values)
    return inside(np.hstack(probes), low, high)


def _boundaries(differences: _Differences, values: FloatArray) -> FloatArray:
    """Return points beside the old model's decision boundaries, to the last double.

    Points of different decisions are joined, and the line is halved as long as its
    ends are decided differently by the old model, or until the clock is over.
    """
    if not values.shape[1]:
        return values
    pair, clock = differences.pair, differences.clock
    parts: list[IntArray] = []
    labels = pairs = np.zeros(0, np.int64)
    for part in portions(values.shape[1], clock):
        parts.append(pair.decide(pair.old, values[:, part]).label)
        labels = np.concatenate(parts)
        pairs = np.flatnonzero(labels[:-1] != labels[1:])[:_SEGMENTS]
        if pairs.size == _SEGMENTS:
            break
    differences.is_cut = pairs.size < _SEGMENTS and labels.size < values.shape[1]
    low, high, known = values[:, pairs], values[:, pairs + 1], labels[pairs]
    points = [low, high]
    for _ in range(_HALVINGS if pairs.size else 0):
        if clock.is_over:
            differences.is_cut = True
            break
        middle = low / 2 + high / 2
        is_low = pair.decide(pair.old, middle).label == known
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        points.append(middle)
    return np.hstack(points)

"""How the numbers of two fuzzy systems differ: proved alike, shown, or bounded.

Outputs that are computed by the same operations, or are the same function of real
numbers, are proved alike. The others are compared on rows of data, on probes of both
systems and on points drawn from the domain; the point where one differs most is
reported, and a bound says how far the two can be apart at most, in real numbers: a
weighted average moves by no more than its numbers do while the degrees stay, and always
lies between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.answers import ZERO
from fuzzytree.auditing.decide.domain import Domain, simplify
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Witness,
    coordinates,
)
from fuzzytree.auditing.diff.keys import Curves, Entry, Keys, facts_of
from fuzzytree.auditing.diff.records import Evidence
from fuzzytree.auditing.diff.samples import Differences, Pair, Progress, left_out
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FactValue,
    Measure,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.support import share_in_sample
from fuzzytree.model import (
    FloatArray,
    Formula,
    FuzzySystem,
    Linear,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    sampled_values,
)
from fuzzytree.numerics import outwards
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import joined_outputs, probe_values

_PROBES = 2_000  # of each system
_DRAWN = 4_000  # at most, for numbers take longer than decisions
_STEPS = 10  # of a rule in a row
_ROUNDING = 1e-9  # relative; what one function of real numbers may differ by
_MOST_SHOWN = 0.9  # of the largest difference, at a witness of fewer digits
_HOW = "as the reference computes it"
_SPENT = "the budget was spent"

Point = Mapping[str, Fraction]
_Sum = tuple[Point, Fraction]
_Ends = tuple[Fraction, Fraction]
_Bound = tuple[Fraction, str]


class _Alike(NamedTuple):
    """How an output is known to be alike, and where."""

    how: str
    where: str


_SAME = _Alike("both perform the same operations on the same numbers", "")
_WITHIN = _Alike(_SAME.how, " everywhere on the domain")
_ROUNDED = _Alike(
    "both are one function of real numbers: equal curves in equal rules",
    " everywhere on the domain, but for rounding",
)


def number_answers(
    pair: Pair[FuzzySystem],
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress,
) -> tuple[list[AuditAnswer], Evidence]:
    """Return what is known of the numbers that two systems have in common."""
    answers = [*_answers(pair, rows, settings, budget, report)]
    is_equal = any(answer.subject == "decisions" for answer in answers)  # proved
    has_number = any(answer.is_finding for answer in answers)
    return answers, Evidence(is_equal=is_equal, has_number=has_number)


def _answers(
    pair: Pair[FuzzySystem],
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress,
) -> Iterator[AuditAnswer]:
    steps = _STEPS * (len(pair.old.rules) + len(pair.new.rules))
    try:
        budget.spend(steps)
    except OutOfStepsError:
        yield left_out("numbers", "the numbers of the two", _SPENT)
        return
    proofs = _proofs(pair)
    left = [name for name, proof in proofs.items() if proof is not _SAME]
    if not left:
        if proofs:
            yield _all_alike(pair, _SAME)
        return
    is_rounded = [proofs[name] is _ROUNDED for name in left]
    differences = _Numbers(pair, left, is_rounded, steps)
    answers = [*_sample_answers(differences, rows, settings, budget, report)]
    if not differences.largest and None not in proofs.values():
        size = Measure("largest difference by rounding", differences.rounding)
        if any(is_rounded):
            yield _all_alike(pair, _ROUNDED, size)
        else:
            yield _all_alike(pair, _WITHIN)
        yield from answers
        return
    yield from (
        differences.witness(name) for name in left if name in differences.largest
    )
    yield from answers
    for name, proof in proofs.items():
        if proof is not None and name not in differences.largest:
            facts, state = {"where": proof.where}, Proved(proof.how)
            yield audit_answer("FT801.output-alike", name, state, facts=facts)
    for name, proof in proofs.items():
        if proof is None:
            yield differences.bound(name)


def _proofs(pair: Pair[FuzzySystem]) -> dict[str, _Alike | None]:
    """Return how each output of both is known to be alike; None if it is not."""
    both, curves, domain = (pair.old, pair.new), Curves(), pair.domain
    kinds = (
        (_SAME, [Keys(system) for system in both]),
        (_WITHIN, [Keys(system, domain) for system in both]),
        (_ROUNDED, [Keys(system, domain, curves) for system in both]),
    )
    names = [output.name for output in pair.new.outputs]
    result: dict[str, _Alike | None]
    result = {of.name: None for of in pair.old.outputs if of.name in names}
    for (proof, (old, new)), name in itertools.product(reversed(kinds), result):
        key = old.output(name)
        if key is not None and key == new.output(name):
            result[name] = proof
    return result


def _all_alike(
    pair: Pair[FuzzySystem], proof: _Alike, *measures: Measure
) -> AuditAnswer:
    is_whole = {*pair.old.inputs} == {*pair.new.inputs}
    where = proof.where + ("" if is_whole else ", where no value is missing")
    key, subject = "FT801.numbers-alike", "decisions"
    facts = {"where": where}
    return audit_answer(key, subject, Proved(proof.how), *measures, facts=facts)


def _sample_answers(
    differences: _Numbers,
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress,
) -> Iterator[AuditAnswer]:
    """Yield how often outputs differ, and what the budget left out."""
    pair, seed = differences.pair, settings.seed
    samples: list[tuple[str, FloatArray, str]] = []
    if rows is not None:
        samples.append(("rows", rows.values, f"rows of {rows.name}"))
    probes = pair.within(
        probe_values(system, _PROBES) for system in (pair.old, pair.new)
    )
    samples.append(("probes", probes, "probes of both systems within the domain"))
    points = pair.draw(min(settings.rows, _DRAWN), seed)
    samples.append(
        ("domain", points, f"points drawn evenly from the domain, seed {seed}")
    )
    for place, (subject, values, how) in enumerate(samples):
        report("comparing numbers", place / len(samples))
        share = budget.share(1.0 / (len(samples) - place))
        hits, count = differences.add(values, share)
        if not count:
            continue
        of = "rows in which an output differs"
        state = share_in_sample(of, hits, count, f"{count} {how}")
        facts: dict[str, FactValue] = {"from": how}
        if not hits and differences.rounding:
            facts["rounding"] = differences.rounding
        yield audit_answer(
            "FT801.outputs", subject, state, is_finding=hits > 0, facts=facts
        )
    if differences.left:
        yield left_out("points", f"{differences.left} points", _SPENT)


class _Numbers(Differences):
    """Where outputs were seen to differ.

    Attributes:
        largest: The largest difference of each, and its point.
        rounding: The largest difference of those that are one function.
    """

    def __init__(
        self,
        pair: Pair[FuzzySystem],
        outputs: Sequence[str],
        is_rounded: Sequence[bool],
        steps: int,
    ) -> None:
        super().__init__(steps)
        self.pair, self.outputs = pair, outputs
        self.is_rounded = np.array(is_rounded)
        self.systems = (pair.old, pair.new)
        load = baseline().load
        self.runs = [load(system, with_strengths=False) for system in self.systems]
        self.largest: dict[str, tuple[float, dict[str, float]]] = {}
        self.rounding = 0.0

    def compare(self, values: FloatArray, name: str, start: int) -> int:
        """Return on how many rows an output differs; keep where it does most."""
        old, new = self._numbers(values)
        gap = _gap(old, new)
        size = np.fmax(np.fmax(np.abs(old), np.abs(new)), 1.0)
        is_small = self.is_rounded[:, None] & (gap <= _ROUNDING * size)
        self.rounding = max(self.rounding, float(gap[is_small].max(initial=0.0)))
        gap[is_small] = 0.0
        points = np.where(np.isfinite(values).all(axis=0), gap, 0.0)
        for place, row in enumerate(points.argmax(axis=1).tolist()):
            output, most_here = self.outputs[place], float(points[place, row])
            if most_here > self.largest.get(output, (0.0, {}))[0]:
                point = zip(self.pair.inputs, values[:, row].tolist(), strict=True)
                self.largest[output] = most_here, dict(point)
        return int((gap > 0.0).any(axis=0).sum())

    def _numbers(self, values: FloatArray) -> list[FloatArray]:
        """Return what both compute, each of shape (outputs, rows)."""
        numbers: list[FloatArray] = []
        for system, run in zip(self.systems, self.runs, strict=True):
            names = [output.name for output in system.outputs]
            outputs = run(self.pair.rows_of(system, values)).outputs
            assert outputs is not None  # both are systems
            numbers.append(outputs[[names.index(name) for name in self.outputs]])
        return numbers

    def witness(self, name: str) -> AuditAnswer:
        """Return where an output differs most, of what was seen."""
        largest, start = self.largest[name]
        place, inputs = self.outputs.index(name), self.pair.inputs

        def numbers(point: Mapping[str, Fraction]) -> tuple[float, float, float]:
            values = np.array([[float(point[key])] for key in inputs])
            was, now = (table[place] for table in self._numbers(values))
            return float(_gap(was, now)[0]), float(was[0]), float(now[0])

        def is_large(point: Mapping[str, Fraction]) -> bool:
            return numbers(point)[0] >= largest * _MOST_SHOWN

        row = {key: Fraction(value) for key, value in start.items()}
        point = simplify(row, self.pair.domain, is_large)
        gap, was, now = numbers(point)
        facts = {"now": _text(now), "was": _text(was), "how": _HOW}
        measure = Measure("largest difference", gap)
        state = Witness(coordinates(point), ())
        return audit_answer("FT801.output-differs", name, state, measure, facts=facts)

    def bound(self, name: str) -> AuditAnswer:
        """Return between which numbers the largest difference of an output lies."""
        of = f"the largest difference of {name!r} where both answer a number"
        bound = most(*self.systems, name, self.pair.domain)
        title = f"bound of {name}"
        if bound is None:
            state = Declined("FTD02", "nothing bounds what its rules conclude")
            return audit_answer("FT801.no-bound", title, state, facts={"output": name})
        high = outwards(bound[0])[1]
        gap, point = self.largest.get(name, (0.0, {}))
        is_within = math.isfinite(gap) and all(
            side.low <= point[side.variable] <= side.high
            for side in self.pair.domain.sides
            if side.variable in point
        )
        low = min(gap, high) if is_within else 0.0
        facts: dict[str, FactValue] = {"output": name, "most": high}
        bracket = Bracket(of, low, high, bound[1])
        return audit_answer("FT801.bound", title, bracket, facts=facts)


def _gap(old: FloatArray, new: FloatArray) -> FloatArray:
    """Return how far numbers are apart: infinitely, if one alone is none."""
    with np.errstate(invalid="ignore", over="ignore"):
        gap = np.abs(old - new)
    gap[(old == new) | (np.isnan(old) & np.isnan(new))] = 0.0
    gap[np.isnan(gap)] = np.inf
    return gap


def _text(number: float) -> str:
    return "no number" if math.isnan(number) else repr(number)


# --- bounds


def _clamp(variable: SystemOutput | Variable, value: Fraction) -> Fraction:
    low, high = variable.low, variable.high
    value = value if low is None else max(value, Fraction(low))
    return value if high is None else min(value, Fraction(high))


def _linear(term: Term, system: FuzzySystem) -> _Sum | None:
    """Return the number of a term as a sum of columns; None if it is none."""
    match term.function:
        case Singleton(value=value):
            return {}, Fraction(value)
        case Linear(weights=weights, offset=offset):
            pairs = zip(system.inputs, weights, strict=True)
            return {name: Fraction(w) for name, w in pairs if w}, Fraction(offset)
        case _:
            return None


def most(
    old: FuzzySystem, new: FuzzySystem, output: str, domain: Domain
) -> _Bound | None:
    """Return how far an output of two systems is apart at most, and why.

    It holds in real numbers, for points of the domain at which both answer a number.

    Returns:
        None where nothing bounds the output, such as a formula.
    """
    before, after = (_Output(system, output, domain) for system in (old, new))
    bounds = (_shift_bound(before, after), _span_bound(before, after))
    return min(filter(None, bounds), key=itemgetter(0), default=None)


class _Output:
    """An output of a system on a domain, and what its rules conclude of it."""

    def __init__(self, system: FuzzySystem, output: str, domain: Domain) -> None:
        keys = Keys(system, domain)
        self.system, self.domain = system, domain
        self.output = keys.outputs[output]
        self.entries: Sequence[Entry] = [*keys.entries(output)]
        self.is_joined = output in joined_outputs(system)
        self.is_sum = self.output.defuzzifier.method == "weighted sum"

    @property
    def is_small(self) -> bool:
        """Whether no degree of a condition is above 1."""
        variables, blocks = self.system.variables, self.system.blocks
        curves = [term.function for v in variables for term in v.terms]
        is_sum = any(block.disjunction == "sum" for block in blocks)
        return not (is_sum or any(isinstance(curve, Formula) for curve in curves))

    def sums(self) -> Iterable[_Sum | None]:
        """Yield each number as a sum of columns; None if it is none that is bounded."""
        clipped = {v.name for v in self.system.variables if v.clips}
        for entry in self.entries:
            linear = _linear(entry.term, self.system)
            is_plain = linear is not None and not clipped & {*linear[0]}
            yield linear if is_plain else None

    def span(self) -> _Ends | None:
        """Return between which ends the output lies."""
        output = self.output
        spans: list[_Ends | None] = []
        if self.is_sum:
            return None
        if self.output.defuzzifier.is_weighted:
            spans += [sum_ and _ends(*sum_, self.domain) for sum_ in self.sums()]
        else:  # singletons may lie beyond the range
            xs = [output.low or 0.0, output.high or 0.0, *sampled_values(output)]
            spans.append((Fraction(min(xs)), Fraction(max(xs))))
        if output.default is not None:
            spans.append((Fraction(output.default), Fraction(output.default)))
        ends = [end for span in spans if span for end in span]
        if None in spans or not ends:
            return None
        low, high = min(ends), max(ends)
        if output.clips:
            return _clamp(output, low), _clamp(output, high)
        return low, high


def _ends(weights: Point, offset: Fraction, domain: Domain) -> _Ends | None:
    """Return between which ends a sum of columns lies."""
    low = high = offset
    for name, weight in weights.items():
        side = domain.side(name)
        if side is None:
            return None
        ends = sorted(weight * end for end in side.ends)
        low, high = low + ends[0], high + ends[1]
    return low, high


def _span_bound(old: _Output, new: _Output) -> _Bound | None:
    """Return how far apart numbers are that lie between some ends."""
    a, b = old.span(), new.span()
    if a is None or b is None:
        return None
    apart = max(abs(b[1] - a[0]), abs(a[1] - b[0]))
    return apart, "both answers lie between the numbers that rules conclude"


def _shift_bound(old: _Output, new: _Output) -> _Bound | None:
    """Return the bound where only numbers differ, and all degrees are the same."""
    degrees, others = (
        [facts_of(of.output), *((e.strength, e.term.height) for e in of.entries)]
        for of in (old, new)
    )
    is_large = old.is_sum and not (old.is_small and new.is_small)
    is_weighted = old.output.defuzzifier.is_weighted
    is_free = is_weighted and not (is_large or old.is_joined or new.is_joined)
    if degrees != others or not is_free:
        return None
    moves = [ZERO]
    for entry, a, b in zip(old.entries, old.sums(), new.sums(), strict=True):
        if a is None or b is None:
            return None
        weights = {n: a[0].get(n, ZERO) - b[0].get(n, ZERO) for n in {**a[0], **b[0]}}
        ends = _ends(weights, a[1] - b[1], old.domain)
        if ends is None:
            return None
        scale = Fraction(entry.most) if old.is_sum else 1
        moves.append(scale * max(abs(ends[0]), abs(ends[1])))
    bound = sum(moves, ZERO) if old.is_sum else max(moves)
    before, after = old.output.default, new.output.default
    if before != after:
        if before is None or after is None:
            return None
        bound = max(bound, abs(Fraction(before) - Fraction(after)))
    return (
        bound,
        "degrees are the same, and no number that rules conclude moves by more",
    )

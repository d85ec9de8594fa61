"""How the numbers of two fuzzy systems differ: proved alike, shown, or bounded.

Outputs that are computed by the same operations, or are the same function of real
numbers, are proved alike. The others are compared on probes of both systems, on points
drawn from the domain and on rows of data; the point where one differs most is reported
with all digits, in fractions where the systems allow it, and a bound says how far the
two can be apart at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.domain import Domain, simplified
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Witness,
    coordinates,
)
from fuzzytree.auditing.diff.decisions import (
    Progress,
    ends_of,
    left_out,
    portions,
    silent,
    union,
)
from fuzzytree.auditing.diff.matching import Curves
from fuzzytree.auditing.diff.system_bounds import ExactSystem, NotExactError, most
from fuzzytree.auditing.diff.system_keys import function_keys, operation_keys
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FactValue,
    Measure,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.support import (
    rows_outside,
    sample_points,
    sampled_share,
)
from fuzzytree.model import FloatArray, FuzzySystem, SystemRun
from fuzzytree.numerics import outwards
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import system_probes

_PROBES = 2_000  # of each system
_DRAWN = 4_000  # at most, for numbers take longer than decisions
_STEPS = 10  # of a rule in a row
_ROUNDING = 1e-9  # relative; what one function of real numbers may differ by
_MOST_SHOWN = 0.9  # of the largest difference, at a witness of fewer digits


class SystemPair(NamedTuple):
    """Two systems, and where they are compared: a side for each column of either."""

    old: FuzzySystem
    new: FuzzySystem
    columns: tuple[str, ...]
    domain: Domain

    @property
    def rules(self) -> int:
        """How many rules both have together."""
        return len(self.old.rules) + len(self.new.rules)

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of the outputs that both have."""
        names = {one.name for one in self.new.outputs}
        return tuple(one.name for one in self.old.outputs if one.name in names)


def number_answers(
    pair: SystemPair,
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress = silent,
) -> list[AuditAnswer]:
    """Return what is known of the numbers that two systems have in common."""
    try:
        budget.spend(_STEPS * pair.rules)
    except OutOfStepsError:
        left = left_out("the numbers of the two")
        return [msgspec.structs.replace(left, subject="numbers")]
    hows = _hows(pair)
    open_ = [name for name, how in hows.items() if how is not _SAME]
    if not open_:
        return [_proved(pair, "", _SAME.how)] if hows else []
    runs = [run_system(system) for system in (pair.old, pair.new)]
    rounded = frozenset(name for name, how in hows.items() if how is _ROUNDED)
    differences = _Differences(pair, open_, rounded, runs)
    answers = [*_sampled(differences, rows, settings, budget, report)]
    if differences.differing:
        answers = [*map(differences.witness, differences.differing), *answers]
    elif None not in hows.values():
        text = " everywhere on the domain"
        if not rounded:
            return [_proved(pair, text, _SAME.how), *answers]
        whole = _proved(pair, f"{text}, but for rounding", _ROUNDED.how)
        most = Measure("largest difference by rounding", differences.rounding)
        return [msgspec.structs.replace(whole, measures=(most,)), *answers]
    for name, known in hows.items():
        if known is not None and name not in differences.largest:
            facts, how = {"where": known.where}, Proved(known.how)
            answers.append(audit_answer("FT801.output-alike", name, how, facts=facts))
    answers += [differences.bound(name) for name, how in hows.items() if how is None]
    return answers


class _Alike(NamedTuple):
    """How an output is known to be alike, and where."""

    how: str
    where: str


_SAME = _Alike("both perform the same operations on the same numbers", "")
_HELD = _Alike(_SAME.how, " everywhere on the domain")
_ROUNDED = _Alike(
    "both are one function of real numbers: equal curves in equal rules",
    " everywhere on the domain, but for rounding",
)


def _hows(pair: SystemPair) -> dict[str, _Alike | None]:
    """Return how each output of both is known to be alike; None if it is not."""
    both, curves = (pair.old, pair.new), Curves()
    keys = (
        (_SAME, [operation_keys(system) for system in both]),
        (_HELD, [operation_keys(system, pair.domain) for system in both]),
        (_ROUNDED, [function_keys(system, curves, pair.domain) for system in both]),
    )
    return {
        name: next(
            (how for how, (a, b) in keys if name in a and a[name] == b.get(name)), None
        )
        for name in pair.outputs
    }


def _proved(pair: SystemPair, where: str, how: str) -> AuditAnswer:
    if {*pair.old.inputs} != {*pair.new.inputs}:
        where += ", where no value is missing"
    facts = {"where": where}
    return audit_answer("FT801.numbers-alike", "decisions", Proved(how), facts=facts)


def _sampled(
    differences: _Differences,
    rows: AuditRows | None,
    settings: AuditSettings,
    budget: Budget,
    report: Progress,
) -> Iterator[AuditAnswer]:
    """Yield how often outputs differ, and what the budget left out."""
    pair = differences.pair
    low, high = ends_of(pair.domain, pair.columns)
    drawn, seed = min(settings.rows, _DRAWN), settings.seed
    both = union(pair.old, pair.new)
    points = sample_points(both, pair.domain, drawn, seed)
    samples: list[tuple[str, FloatArray, str]] = []
    if rows is not None:
        samples.append(("rows", rows.values, f"rows of {rows.name}"))
    parts = [_probes(one, pair.columns, low, high) for one in (pair.old, pair.new)]
    probes = np.hstack(parts)
    probes = probes[:, ~rows_outside(both, pair.domain, probes)]
    samples.append(("probes", probes, "probes of both systems within the domain"))
    how = f"points drawn evenly from the domain, seed {seed}"
    samples.append(("domain", points, how))
    left = 0
    for place, (subject, values, how) in enumerate(samples):
        report("comparing numbers", place / len(samples))
        hits, number = differences.add(
            values, budget.share(1.0 / (len(samples) - place))
        )
        left += values.shape[1] - number
        if number:
            yield _counted(differences, subject, hits, number, how)
    if left:
        yield left_out(f"{left} points")


def _counted(
    differences: _Differences, subject: str, hits: int, rows: int, how: str
) -> AuditAnswer:
    state = sampled_share(
        "rows in which an output differs", hits, rows, f"{rows} {how}"
    )
    facts: dict[str, FactValue] = {"from": how}
    if not hits and differences.rounding:
        facts["rounding"] = differences.rounding
    return audit_answer(
        "FT801.outputs", subject, state, is_finding=hits > 0, facts=facts
    )


def _probes(
    system: FuzzySystem, columns: Sequence[str], low: FloatArray, high: FloatArray
) -> FloatArray:
    known = system_probes(system, limit=_PROBES)
    middle = (low / 2 + high / 2)[:, 0].tolist()
    table = [
        [row.get(name, at) for row in known]
        for name, at in zip(columns, middle, strict=True)
    ]
    return np.array(table, np.float64).reshape(len(columns), len(known))


class _Largest(NamedTuple):
    """Where an output was seen to differ most."""

    gap: float
    was: float
    now: float
    row: Mapping[str, float]


class _Differences:
    """Where outputs were seen to differ."""

    def __init__(
        self,
        pair: SystemPair,
        outputs: Sequence[str],
        rounded: frozenset[str],
        runs: Sequence[SystemRun],
    ) -> None:
        self.pair, self.outputs, self.runs = pair, outputs, runs
        self.is_rounded = np.array([name in rounded for name in outputs])
        self.exact = [ExactSystem(one, pair.domain) for one in (pair.old, pair.new)]
        self.largest: dict[str, _Largest] = {}
        self.rounding = 0.0

    @property
    def differing(self) -> list[str]:
        """The outputs that were seen to differ."""
        return [name for name in self.outputs if name in self.largest]

    def add(self, values: FloatArray, budget: Budget) -> tuple[int, int]:
        """Compare some rows as long as steps are left; return how many differ, of."""
        hits = count = 0
        for part in portions(values.shape[1], _STEPS * self.pair.rules, budget):
            hits += self._add(values[:, part])
            count = part.stop
        return hits, count

    def _add(self, values: FloatArray) -> int:
        one, other = self._numbers(values)
        with np.errstate(invalid="ignore", over="ignore"):
            gap = np.abs(one - other)
            size = np.fmax(np.fmax(np.abs(one), np.abs(other)), 1.0)
        gap[(one == other) | (np.isnan(one) & np.isnan(other))] = 0.0
        gap[np.isnan(gap)] = np.inf
        is_small = self.is_rounded[:, None] & (gap <= _ROUNDING * size)
        self.rounding = max(self.rounding, float(gap[is_small].max(initial=0.0)))
        gap[is_small] = 0.0
        for place, row in enumerate(gap.argmax(axis=1).tolist()):
            name, most_ = self.outputs[place], float(gap[place, row])
            kept = self.largest.get(name)
            if most_ and (kept is None or most_ > kept.gap):
                at = zip(self.pair.columns, values[:, row].tolist(), strict=True)
                was, now = float(one[place, row]), float(other[place, row])
                self.largest[name] = _Largest(most_, was, now, dict(at))
        return int((gap > 0.0).any(axis=0).sum())

    def _numbers(self, values: FloatArray) -> list[FloatArray]:
        """Return what both compute, each of shape (outputs, rows)."""
        numbers: list[FloatArray] = []
        pair = self.pair
        for system, run in zip((pair.old, pair.new), self.runs, strict=True):
            rows = values[[pair.columns.index(name) for name in system.inputs]]
            known = [one.name for one in system.outputs]
            numbers.append(run(rows).outputs[[known.index(n) for n in self.outputs]])
        return numbers

    def witness(self, name: str) -> AuditAnswer:
        """Return where an output differs most, of what was seen."""
        largest = self.largest[name]
        point = {key: Fraction(value) for key, value in largest.row.items()}
        how = "as the reference computes it"
        facts = {"now": _shown(largest.now), "was": _shown(largest.was)}
        measure = Measure("largest difference", largest.gap)
        try:
            point = self._simple(name, point)
            was, now = self._exact(name, point)
            apart = None if was is None or now is None else abs(now - was)
            if apart != 0:
                how = "in fractions"
                facts = {"now": _shown(now), "was": _shown(was)}
                exact = None if apart is None else str(apart)
                gap = math.inf if apart is None else float(apart)
                measure = Measure("largest difference", gap, exact)
            else:  # rounding alone
                point = {key: Fraction(value) for key, value in largest.row.items()}
        except NotExactError:
            pass
        state = Witness(coordinates(point), ())
        return audit_answer(
            "FT801.output-differs",
            name,
            state,
            measure,
            facts={**facts, "how": how},
        )

    def _exact(
        self, name: str, point: Mapping[str, Fraction]
    ) -> tuple[Fraction | None, Fraction | None]:
        """Return the numbers of an output in both systems, in fractions."""
        old, new = self.exact
        return old.number(name, point), new.number(name, point)

    def _simple(self, name: str, point: Mapping[str, Fraction]) -> dict[str, Fraction]:
        """Return a point of few digits where an output differs nearly as much."""
        least = self._apart(name, point) * _MOST_SHOWN
        return simplified(
            point, self.pair.domain, lambda tried: self._apart(name, tried) >= least
        )

    def _apart(self, name: str, point: Mapping[str, Fraction]) -> float:
        was, now = self._exact(name, point)
        if was is None or now is None:
            return 0.0 if was is now else math.inf
        return float(abs(now - was))

    def bound(self, name: str) -> AuditAnswer:
        """Return between which numbers the largest difference of an output lies."""
        of = f"the largest difference of {name!r} where both answer a number"
        known = most(self.pair.old, self.pair.new, name, self.pair.domain)
        title = f"bound of {name}"
        if known is None:
            reason = "nothing bounds what its rules conclude"
            declined, facts = Declined("FTD02", reason), {"output": name}
            return audit_answer("FT801.no-bound", title, declined, facts=facts)
        (bound, why), low = known, 0.0
        high, largest = outwards(bound)[1], self.largest.get(name)
        if largest is not None and math.isfinite(largest.gap):
            is_within = all(
                side.low <= largest.row[side.variable] <= side.high
                for side in self.pair.domain.sides
                if side.variable in largest.row
            )
            low = min(largest.gap, high) if is_within else 0.0
        state = Bracket(of, low, high, why)
        return audit_answer(
            "FT801.bound", title, state, facts={"output": name, "most": high}
        )


def _shown(number: Fraction | float | None) -> str:
    if number is None or math.isnan(number):
        return "no number"
    return repr(float(number))

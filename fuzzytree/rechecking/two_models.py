"""A comparison of two models, checked again: its witnesses, and what is called alike.

Rules are alike if they are the same, one after the other, whatever terms are called:
rules of one class that follow each other may change places, and one that never fires
or that such a neighbour hides may be missing. Systems are alike if their files are,
but for names, units and notes. Whatever else is alike is not decided here.
"""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from fractions import Fraction

from fuzzytree.rechecking.case import Case, class_at, values_of
from fuzzytree.rechecking.cells import Interval
from fuzzytree.rechecking.checks import check_message, check_sample, check_source
from fuzzytree.rechecking.curves import bounds, is_straight, knots
from fuzzytree.rechecking.models import ONE, Curve, Facts, Model, Variable
from fuzzytree.rechecking.outcomes import (
    STEPS_IN_ALL,
    Limit,
    Report,
    UndecidedError,
    require,
)
from fuzzytree.rechecking.records import (
    Answer,
    Bracket,
    Computed,
    Declined,
    Difference,
    Proved,
    Sampled,
    Witness,
    built,
    read_json,
)

UNCHECKED = "the version, the hashes of the models' contents, the table, the changes"
Names = tuple[str, str, str]


def recheck_difference(diff: bytes, old: bytes, new: bytes, names: Names) -> Report:
    """Check a comparison against the two models that it is of.

    `names`: what messages call the three.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    facts, both = _read(diff, (old, new), names, Limit())
    report = Report(UNCHECKED)
    report.codes = [one.code for one in facts.answers]
    for one, case, content, name in zip(
        (facts.old, facts.new), both, (old, new), names[1:], strict=True
    ):
        report.expect(one.name == case.model.name, f"the name of {name} is another one")
        check_source(report, one.file, content, name)
    is_changed = any(one.is_finding for one in facts.answers)
    breaks = any(one.grade == "breaking" for one in facts.changes)
    known = [one for one in facts.answers if isinstance(one.state, Proved | Computed)]
    is_open = any(isinstance(one.state, Bracket | Declined) for one in facts.answers)
    is_equal = any(one.subject == "decisions" for one in known) and not is_open
    verdict = "changed" if is_changed else "equal" if is_equal else "open"
    report.expect(facts.verdict == verdict, f"the verdict is {verdict}")
    is_ok = not is_changed and not breaks
    report.expect(facts.ok is is_ok, f"it is {'' if is_ok else 'not '}ok")
    for number, answer in enumerate(facts.answers, 1):
        _check_answer(both, report, answer, number)
    return report


def undecided_difference(
    diff: bytes, old: bytes, new: bytes, is_late: Callable[[], bool]
) -> dict[int, str]:
    """Return the PROVED answers of a comparison that are not decided again here.

    Returns:
        By the position of each what is wrong with it; nothing if it is beyond the
        limits.

    Raises:
        CannotRunError: If a model cannot be read.
    """
    names = "the comparison", "old.yaml", "new.yaml"
    facts, both = _read(diff, (old, new), names, Limit(STEPS_IN_ALL, is_late))
    result: dict[int, str] = {}
    for place, answer in enumerate(facts.answers):
        report = Report()
        if isinstance(answer.state, Proved):
            _check_answer(both, report, answer, place + 1)
            if not report.counts["answers PROVED, decided again"]:
                result[place] = report.first
    return result


def _read(
    diff: bytes, models: tuple[bytes, bytes], names: Names, limit: Limit
) -> tuple[Difference, tuple[Case, Case]]:
    facts: Difference = built(Difference, read_json(diff, names[0]), names[0])
    old, new = (
        Case(facts, Model(content, name), limit)
        for content, name in zip(models, names[1:], strict=True)
    )
    return facts, (old, new)


def _check_answer(
    both: tuple[Case, Case], report: Report, answer: Answer, number: int
) -> None:
    with report.answer(number, answer, both[0].limit):
        check_message(answer)
        report.counts["sentences written again"] += 1
        state = answer.state
        if isinstance(state, Sampled):
            check_sample(state)
            raise UndecidedError("a sample is not drawn again here")
        if isinstance(state, Witness):
            _check_witness(both, state)
            report.counts["answers with a WITNESS, evaluated again"] += 1
        elif isinstance(state, Proved | Computed):
            if answer.subject != "decisions":
                raise UndecidedError("one output of several")
            _alike(both, str(answer.facts.get("where", "")))
            kind = type(state).__name__.upper()
            report.counts[f"answers {kind}, decided again"] += 1
        else:
            raise UndecidedError("what is open is not looked at here")


def _check_witness(both: tuple[Case, Case], state: Witness) -> None:
    """Check that both models predict at a point what is claimed of them."""
    point = values_of(state.point)
    inputs = {name for case in both for name in case.inputs}
    require(point.keys() == inputs, "the point does not have a value of every input")
    require(all(case.is_within(point) for case in both), "it lies outside the domain")
    said = {claim.of: claim.label for claim in state.claims if claim.kind == "decides"}
    if not said:
        raise UndecidedError("numbers of outputs are not computed here")
    require(said.keys() == {"old", "new"}, "it is not claimed what both predict")
    require(said["old"] != said["new"], "both predict the same")
    if any(case.model.form == "system" for case in both):
        raise UndecidedError("a system that stands for rules")
    predicted = [class_at(case.rules, point) for case in both]
    text = f"the models predict {predicted[0]!r} and {predicted[1]!r}"
    require(predicted == [said["old"], said["new"]], text)


# --- what is alike


def _alike(both: tuple[Case, Case], where: str) -> None:
    """Check that two models decide alike.

    `where`: empty if it is so of any input, also outside of the domain.
    """
    a, b = (case.model for case in both)
    is_same = (a.form == "system") is (b.form == "system")
    if a.form == "system":
        is_same &= _system_form(a.facts) == _system_form(b.facts)
        require(is_same or a.form == b.form, "one of them is no system")
    else:
        is_same &= (a.is_product, a.uncovered) == (b.is_product, b.uncovered)
        if "missing" not in where:
            is_same &= a.missing == b.missing and _axes(a) == _axes(b)
        one, other = (_form(case, case.numbers, is_on_domain=False) for case in both)
        if one != other and is_same and where:
            one, other = (_form(c, _needed(c), is_on_domain=True) for c in both)
        is_same &= one == other
    if not is_same:
        raise UndecidedError("rules that are not the same, one after the other")


def _axes(model: Model) -> set[Hashable]:
    return {*map(_axis, model.variables.values())}


def _axis(variable: Variable) -> Hashable:
    ends = (variable.low, variable.high) if variable.is_clipped else None
    return variable.parts or variable.name, ends


def _needed(case: Case) -> list[int]:
    """Return the rules that fire, and that no neighbour of their class hides."""
    kept = [n for n in case.numbers if case.beats([n], ())]
    for number in [*kept]:
        blocks = (
            {*block} for _, block in itertools.groupby(kept, lambda n: case.then(n))
        )
        mates = next(block for block in blocks if number in block) - {number}
        if not all(case.beats([number], [n]) for n in mates):
            kept.remove(number)
    return kept


def _form(case: Case, kept: Sequence[int], *, is_on_domain: bool) -> list[Hashable]:
    """Return what rules mean, those of one class that follow each other together."""
    return [
        (label, frozenset(_antecedent(case, n, is_on_domain) for n in block))
        for label, block in itertools.groupby(kept, lambda n: case.then(n))
    ]


def _antecedent(case: Case, number: int, is_on_domain: bool) -> Hashable:
    counts = Counter[Hashable]()
    for one in case.rules.rules[number - 1].when:
        variable = case.rules.variables[one.variable]
        ends = case.ends(variable) if is_on_domain else None
        curves = frozenset(_curve_form(variable.curves[t], ends) for t in one.terms)
        counts[_axis(variable), one.negated, one.weight, curves] += 1
    return frozenset(counts.items()) if case.rules.is_product else frozenset(counts)


def _curve_form(curve: Curve, ends: Interval | None) -> Hashable:
    """Return a key, equal for straight curves of equal degrees, between some ends."""
    if not is_straight(curve):
        return curve
    inner = knots(curve) or [ONE]
    low, high = ends or (inner[0] - 1, inner[-1] + 1)
    order = sorted({low, high, *(x for x in inner if low < x < high)})
    result: list[tuple[Fraction | None, Fraction, Fraction, Fraction]] = []
    for a, b in itertools.pairwise(order):
        xs = (2 * a + b) / 3, (a + 2 * b) / 3
        p, q = (bounds(curve, x, x)[0] for x in xs)
        slope = (q - p) / (xs[1] - xs[0])
        offset, degree = p - slope * xs[0], bounds(curve, a, a)[0]
        is_on = result and result[-1][2:] == (slope, offset)
        if not is_on or degree != slope * a + offset:
            start = None if a == low and ends is None else a
            result.append((start, offset if start is None else degree, slope, offset))
    return tuple(result), ends and bounds(curve, high, high)


def _system_form(top: Facts) -> str:
    """Return a system's file without what is for people only."""
    outputs = [_without(one, "unit") for one in top["outputs"]]
    inputs: list[Facts] = []
    for one in top.get("variables", []):
        is_free = "outside" not in one.get("range", {})
        terms = {"terms": sorted(one.get("terms", []), key=repr)}
        inputs.append(_without(one, "unit", *["range"] * is_free) | terms)
    if "'linear'" not in repr(outputs):  # whose weights are in the order of inputs
        inputs.sort(key=repr)
    blocks: list[Facts] = []
    for block in top["blocks"]:
        rules = [one for one in block["rules"] if one.get("weight", 1)]
        rules = [_without(one, "name") for one in rules]
        blocks.append(_without(block, "name") | {"rules": rules})
    return json.dumps([top["semantics"], inputs, outputs, blocks], sort_keys=True)


def _without(facts: Facts, *names: str) -> Facts:
    return {key: one for key, one in facts.items() if key not in names}

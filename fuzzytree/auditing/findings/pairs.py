"""Questions about two rules: is one subsumed, masked, a duplicate, or in conflict?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.compared import Dominance, JointMaximum, RuleDistance
from fuzzytree.auditing.engine.states import (
    Declined,
    Proved,
    State,
    Witness,
    counted,
)
from fuzzytree.auditing.engine.witnesses import coupled
from fuzzytree.auditing.findings.bounded_arrangement import (
    BoundedArrangement,
    bounded_arrangement,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.propositions import proposition_answers
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.terms import measure
from fuzzytree.model import FloatArray

NEARLY: Final = Fraction(1, 10**6)
"""Two antecedents are nearly the same if no degree differs by more than this."""

_ONE_LEVEL: Final = Fraction(1, 10**9)
"""Bounds of a highest common level that are no further apart are shown as one."""

MOST_SHOWN: Final = 20
"""The most conflicts that are listed one by one."""

Pair = tuple[int, int]


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer what is to be said of pairs of rules, and of single propositions."""
    compared = bounded_arrangement(subject)
    if compared.lower.is_empty:
        return
    yield from _hidden(subject, compared, is_alike=True)
    if subject.policy.decision == "strongest":
        yield from _hidden(subject, compared, is_alike=False)
    yield from _copied(subject, compared)
    if subject.rules.kind != "relative":
        yield from _conflicts(subject, compared)
    if subject.policy.decision == "strongest":
        yield from proposition_answers(subject)


def _then(subject: Subject, number: int) -> str:
    return subject.rules.rules[number - 1].then


def _pairs(subject: Subject, *, is_alike: bool) -> Iterator[Pair]:
    """Yield the pairs of rules of one class, or of two; not ways of one rule."""
    count = len(subject.rules.rules)
    for one, other in itertools.combinations(range(1, count + 1), 2):
        subject.clock.check()
        is_same = _then(subject, one) == _then(subject, other)
        if is_same is is_alike and not _is_one(subject, one, other):
            yield one, other


def _is_one(subject: Subject, one: int, other: int) -> bool:
    """Return whether two rules are two ways in which one rule of a system holds."""
    return subject.numbers[one - 1] == subject.numbers[other - 1]


def _noun(subject: Subject) -> str:
    return "class" if subject.policy.decision == "strongest" else "conclusion"


# --- FT104 and FT105: is one rule at least as strong everywhere?


def _hidden(
    subject: Subject, compared: BoundedArrangement, *, is_alike: bool
) -> Iterator[AuditAnswer]:
    """Answer which rules another one hides, of their class (FT104) or not (FT105)."""
    tested = undecided = 0
    hiding: dict[int, list[int]] = {}
    for first, second in _pairs(subject, is_alike=is_alike):
        if not (compared.fires[first - 1] and compared.fires[second - 1]):
            continue
        tested += 1
        forth = compared.never_weaker(first, second)
        back: Dominance = "not"
        if is_alike:
            back = compared.never_weaker(second, first)
        elif forth != "always":
            back = compared.from_below.above(second, first)
        undecided += "open" in (forth, back)
        if forth == "always":
            hiding.setdefault(second, []).append(first)
        elif back == "always":
            hiding.setdefault(first, []).append(second)
    for weak, strong in sorted(hiding.items()):
        message, verb = "FT104.subsumed", "subsume"
        if not is_alike:
            is_before, verb = strong[0] < weak, "mask"
            message = "FT105.masked" if is_before else "FT105.weaker"
        yield audit_answer(
            message,
            subject.rule_name(weak),
            Proved(_how(compared)),
            rules=(weak, *strong),
            measures=(Measure(f"rules that {verb} it", len(strong)),),
            facts={
                "by": subject.rule_name(strong[0]),
                "noun": _noun(subject),
                "then": _then(subject, strong[0]),
            },
        )
    if tested:
        counts = tested, len(hiding), undecided
        yield _rest_of_strengths(subject, compared, counts, is_alike=is_alike)


def _how(compared: BoundedArrangement) -> str:
    means = "ratios of degrees" if compared.is_product else "orders of degrees"
    axes = counted(len(compared.lower.axes), "axis", "axes")
    return f"{means} on {axes} were compared"


def _rest_of_strengths(
    subject: Subject,
    compared: BoundedArrangement,
    counts: tuple[int, int, int],
    *,
    is_alike: bool,
) -> AuditAnswer:
    """Return what is known of all pairs of which nothing is found."""
    tested, hidden, undecided = counts
    silent = len(compared.fires) - int(compared.fires.sum())
    facts: dict[str, FactValue] = {"noun": _noun(subject)}
    if hidden:
        facts["listed"] = hidden
    state: State = Proved(_how(compared))
    if coupled(compared.lower):
        state = Declined("FTD04", "the inputs of variables depend on each other")
    elif undecided:
        pairs = counted(undecided, "pair")
        state = Declined("FTD02", f"{pairs} of strengths are too near to compare")
    measures = (
        Measure("pairs", tested),
        Measure("pairs too near to compare", undecided),
        Measure("rules that never fire", silent),
    )
    message = "FT104.others" if is_alike else "FT105.others"
    return audit_answer(
        message, "pairs of rules", state, measures=measures, facts=facts
    )


# --- FT106: do two rules have the same antecedent?


def _copied(subject: Subject, compared: BoundedArrangement) -> Iterator[AuditAnswer]:
    count = len(subject.rules.rules)
    copies: list[tuple[Pair, RuleDistance]] = []
    pairs = near = 0
    for pair in itertools.combinations(range(1, count + 1), 2):
        subject.clock.check()
        if _is_one(subject, *pair):
            continue
        pairs += 1
        known = compared.distance(*pair, NEARLY)
        if known is None:
            near += compared.is_near(*pair, NEARLY)
        elif known.whole <= NEARLY:
            copies.append((pair, known))
        else:
            near += 1
    decides = subject.policy.decision == "strongest"
    for pair, distance in copies:
        facts = _facts(subject, pair)
        message = "FT106.contradiction" if decides else "FT106.different"
        measures: tuple[Measure, ...] = (measure("largest distance", distance.each),)
        if distance.each.high:
            variable = compared.lower.axes[distance.axis].variable
            facts["variable"] = variable.name
            measures += (
                Measure("place of it", float(distance.at), unit=variable.unit),
            )
        yield audit_answer(
            "FT106.same" if facts["then"] == facts["other"] else message,
            _both(subject, pair),
            Proved("their curves were compared piece by piece in fractions"),
            rules=pair,
            measures=measures,
            facts=facts,
        )
    if not pairs:
        return
    state: State = Proved(
        f"somewhere their degrees differ by more than {float(NEARLY):g}"
    )
    if near:
        reason = f"{counted(near, 'pair')} of degrees are too near to compare"
        state = Declined("FTD02", reason)
    yield audit_answer(
        "FT106.others",
        "pairs of rules",
        state,
        measures=(Measure("pairs", pairs),),
        facts={"listed": len(copies)} if copies else {},
    )


def _both(subject: Subject, pair: Pair) -> str:
    first, second = (subject.rule_name(number) for number in pair)
    return f"{first} and {second}"


def _facts(subject: Subject, pair: Pair) -> dict[str, FactValue]:
    """Return what two rules conclude, and what that is called."""
    one, other = (_then(subject, number) for number in pair)
    return {"noun": _noun(subject), "then": one, "other": other}


# --- FT201: do rules of different classes reach a level together?


def _conflicts(subject: Subject, compared: BoundedArrangement) -> Iterator[AuditAnswer]:
    level = subject.settings.level
    near: list[tuple[float, Pair]] = []
    clean = 0
    bounds: dict[int, FloatArray] = {}
    for one, other in _pairs(subject, is_alike=False):
        if not _may_conflict(subject, one, other):
            continue
        if one not in bounds:
            bounds[one] = compared.highest(one)
        most = float(bounds[one][other - 1])
        if most < level:
            clean += 1
        else:
            near.append((-most, (one, other)))
    near.sort()
    listed = hidden = 0
    own = subject.clock.share(0.5)
    for place, (_, pair) in enumerate(near):
        if own.is_over or (listed == MOST_SHOWN and not compared.is_product):
            hidden += len(near) - place
            break
        subject.clock.check()
        joint = compared.meet(*pair, Fraction(level), subject.clock.share(0.05))
        is_shown = isinstance(joint.state, Witness)
        if joint.level.high < level or isinstance(joint.state, Proved):
            clean += 1
        elif is_shown and listed == MOST_SHOWN:
            hidden += 1
        else:
            listed += is_shown
            yield _conflict(subject, pair, joint)
    if clean or hidden:
        yield _rest_of_conflicts(subject, compared, clean, hidden)


def _may_conflict(subject: Subject, one: int, other: int) -> bool:
    """Return whether two rules say different things of one output."""
    if subject.policy.decision == "strongest" or subject.system is None:
        return True
    parts = [
        {
            (output.name, part)
            for output in subject.system.outputs
            for part in _then(subject, number).split(" and ")
            if part.startswith(f"{output.name} is ")
        }
        for number in (one, other)
    ]
    shared = {name for name, _ in parts[0]} & {name for name, _ in parts[1]}
    return any(name in shared for name, _ in parts[0] ^ parts[1])


def _conflict(subject: Subject, pair: Pair, joint: JointMaximum) -> AuditAnswer:
    low, high = joint.level
    both, state, facts = _both(subject, pair), joint.state, _facts(subject, pair)
    most = Measure("highest common level at most", float(high))
    if not isinstance(state, Witness):
        return audit_answer(
            "FT201.may", both, state, rules=pair, measures=(most,), facts=facts
        )
    # A point in fractions may fall a little short of a level that is irrational.
    shown = [Fraction(one.level or 0) for one in state.claims]
    facts["level"] = float(low)
    if max(shown, default=low) < low:
        facts["falls short"] = float(low - max(shown))
    exact = str(low) if low == high else None
    measures: tuple[Measure, ...]
    measures = (Measure("highest common level", float(low), exact),)
    if high - low > _ONE_LEVEL:
        measures = (Measure("highest common level at least", float(low)), most)
    return audit_answer(
        "FT201.conflict",
        both,
        state,
        rules=pair,
        region=state.region,
        measures=measures,
        facts=facts,
    )


def _rest_of_conflicts(
    subject: Subject, compared: BoundedArrangement, clean: int, hidden: int
) -> AuditAnswer:
    is_one = _noun(subject) == "class"
    facts: dict[str, FactValue] = {
        "level": subject.settings.level,
        "nouns": "classes" if is_one else "conclusions",
    }
    means = "products" if compared.is_product else "minima"
    return audit_answer(
        "FT201.unlisted" if hidden else "FT201.never",
        "pairs of rules",
        Proved(f"the largest {means} of degrees were found on each axis"),
        measures=(
            Measure("pairs that never do", clean),
            Measure("pairs not listed", hidden),
        ),
        facts=facts,
    )

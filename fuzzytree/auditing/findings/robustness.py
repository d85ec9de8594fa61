"""How far a row is from the nearest other decision: its certified radius."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.domain import contains, variable_value
from fuzzytree.auditing.engine.nearest import Nearest
from fuzzytree.auditing.engine.regions import regions
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    answer_text,
    coordinates,
    number_text,
    percent,
)
from fuzzytree.auditing.findings.deciders import Decider, decider_of
from fuzzytree.auditing.findings.nearby import narrowed_state, not_asked
from fuzzytree.auditing.findings.records import Answer, Measure
from fuzzytree.auditing.findings.rows import (
    OF_RANGES,
    Points,
    distance_measure,
    points_of,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.trees import too_many
from fuzzytree.numerics.exact import outwards

MOST_ROWS = 50
"""Rows whose radius is sought by strengths."""

MOST_ROWS_OF_TREE = 1000
"""Rows whose radius is sought by regions, which is quick."""

SHOWN_ROWS = 5
"""Rows of the smallest radius that have an answer of their own."""

ASIDE = ", places where strengths only touch aside"
"""What a sentence adds where rules of other classes go first in a tie."""

_PART = 0.9  # of the time, to seek; what is found must still be told
_MOST_NAMED = 4  # inputs in a sentence


# --- a row


def radius(subject: Subject, row: Mapping[str, float]) -> Answer:
    """Return how far the nearest point is that is decided otherwise than a row.

    Args:
        subject: The model, of which one class decides.
        row: A value for each input.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    point = _point(subject, row)
    decider = decider_of(subject)
    found = decider.nearest_other(point, subject.clock)
    return _answer(decider, "the row", point, found)


def row_answers(subject: Subject, row: Mapping[str, float]) -> Iterator[Answer]:
    """Yield how a row is decided, and how far the nearest other decision is.

    Args:
        subject: The model; nothing is asked where more than one rule answers.
        row: A value for each input.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    declined = _declined(subject)
    if declined is not None:
        yield Answer("FT204", "row", NOT_SOUGHT, declined, False)
        return
    point = _point(subject, row)
    label, by = decider_of(subject).decided(point)
    claim = Claim("decides", of=decider_of(subject).of, label=label)
    yield Answer(
        code="FT204",
        subject="row",
        sentence=f"the row is decided as {answer_text(label)} by {by}",
        state=Witness(coordinates(point), (claim,)),
        is_finding=False,
    )
    yield radius(subject, row)


NOT_SOUGHT = "the nearest other decision is not sought"


def _declined(subject: Subject) -> Declined | None:
    """Return why no row of a model is asked about, None if rows are."""
    if subject.policy.decision != "strongest":
        why = "every rule takes part in the answer, so that no class decides"
        return Declined("FTD07", why)
    if not subject.is_whole:
        return Declined("FTD07", "rules are left out that may decide")
    return None if subject.tree is None else too_many(regions(subject.tree))


def _point(subject: Subject, row: Mapping[str, float]) -> dict[str, Fraction]:
    point = {name: Fraction(float(row[name])) for name in subject.rules.inputs}
    for variable in subject.rules.variables:
        side = subject.domain.side(variable.name)
        if not contains(subject.domain, [variable], point) and side is not None:
            raise ValueError(
                f"the row lies outside the domain: {variable.name!r} is "
                f"{float(variable_value(variable, point))!r}, and the domain is "
                f"{side.low!r} to {side.high!r}; "
                f"widen it (--limits '{variable.name}=LOW:HIGH')"
            )
    return point


def _answer(
    decider: Decider, name: str, point: Mapping[str, Fraction], found: Nearest
) -> Answer:
    own, _ = decider.decided(point)
    aside = ASIDE if decider.leaves_out(own) else ""
    what = f"the distance from {name} to another decision"
    if found.point is None or found.high is None:
        if found.is_none:
            text = f"all of the domain is decided as {name}, {answer_text(own)}{aside}"
            state: State = Proved("other decisions asked on the whole domain")
        else:
            text = f"no decision other than {answer_text(own)} is known around {name}"
            state = Bracket(what, outwards(found.low)[0], 1.0, found.why)
        return Answer("FT204", name.removeprefix("the "), text, state, False)
    other, _ = decider.decided(found.point)
    claim = Claim("decides", of=decider.of, label=other)
    moved = [axis for axis, value in found.point.items() if value != point[axis]]
    told = _told(decider, point, found.point, moved)
    changed = " and ".join(f"{axis!r} is {told[axis]}" for axis in moved)
    if len(moved) > _MOST_NAMED:
        changed = f"{len(moved)} inputs move by no more than {percent(found.high)}"
    text = (
        f"{name} stays {answer_text(own)} within {percent(found.low)} {OF_RANGES}"
        f"{aside}; where {changed} it is {answer_text(other)}"
    )
    return Answer(
        code="FT204",
        subject=name.removeprefix("the "),
        sentence=text,
        state=narrowed_state(what, found.low, found, [claim], found.why),
        is_finding=False,
        measures=(
            distance_measure("certified radius", found.low),
            distance_measure("distance of the witness", found.high),
        ),
    )


def _told(
    decider: Decider,
    row: Mapping[str, Fraction],
    point: Mapping[str, Fraction],
    moved: Sequence[str],
) -> Mapping[str, str]:
    """Return the values of a point in the fewest digits that are decided like it."""
    other, _ = decider.decided(point)
    for digits in range(6, 18) if len(moved) <= _MOST_NAMED else ():
        told = {axis: f"{float(point[axis]):.{digits}g}" for axis in moved}
        near = {axis: Fraction(text) for axis, text in told.items()}
        if decider.decided({**point, **near})[0] == other:
            return told
    return {axis: _moved(point[axis], row[axis]) for axis in moved}


def _moved(value: Fraction, own: Fraction) -> str:
    """Return a value in so many digits that it looks unlike the row's own."""
    near = float(value)
    if number_text(near) != number_text(float(own)):
        return number_text(near)
    if near != float(own):
        return repr(near)
    return f"a hair {'above' if value > own else 'below'} {near!r}"


# --- all rows


def answers(subject: Subject) -> Iterator[Answer]:
    """Yield how far rows are from another decision: the nearest of them, and in all.

    Nothing is asked where more than one rule answers.
    """
    if subject.policy.decision != "strongest":
        return
    declined = _declined(subject)
    if declined is None and subject.rows is None:
        declined = Declined("FTD06", "rows are needed (--data TABLE)")
    if declined is not None or subject.rows is None:
        assert declined is not None  # set above where there are no rows
        yield Answer("FT204", "rows", NOT_SOUGHT, declined, False)
        return
    points = points_of(subject, subject.rows)
    decider = decider_of(subject)
    clock = subject.clock.share(_PART)
    asked: list[_Asked] = []
    most = MOST_ROWS if subject.tree is None else MOST_ROWS_OF_TREE
    chosen = points.at[:most]
    decider.look([point for _, point in chosen])
    for number, point in chosen:
        if clock.is_over:
            break
        subject.clock.tell(f"radius of row {number}", len(asked) / len(chosen))
        found = decider.nearest_other(point, clock)
        is_worth_telling = found.is_narrow or (not asked and found.high is not None)
        if clock.is_over and not is_worth_telling:
            break
        answer = _answer(decider, f"row {number}", point, found)
        is_aside = decider.leaves_out(decider.decided(point)[0])
        asked.append(_Asked(number, found.low, answer, is_aside))
    asked.sort(key=lambda one: (one.low, one.number))
    yield _in_all(points, asked)
    yield from (one.answer for one in asked[:SHOWN_ROWS])
    if 0 < len(asked) < len(chosen):
        yield not_asked("FT204", len(chosen) - len(asked))


class _Asked(NamedTuple):
    number: int
    low: Fraction
    answer: Answer
    is_aside: bool


def _in_all(points: Points, asked: Sequence[_Asked]) -> Answer:
    """Return an answer about all rows together; `asked` is in order of their radius."""
    count = Measure("rows asked", len(asked))
    if not asked:
        state = (
            Declined("FTD03", "the budget was spent before the first row")
            if points.at
            else Declined("FTD06", "no row lies in the domain")
        )
        return Answer("FT204", "rows", NOT_SOUGHT, state, False, measures=(count,))
    first = asked[0]
    least = first.low
    aside = ASIDE if any(one.is_aside for one in asked) else ""
    of_all = "" if len(asked) == len(points.at) else "with the smallest margins "
    median = statistics.median_low([one.low for one in asked])
    return Answer(
        code="FT204",
        subject="rows",
        sentence=f"of {points.text} {len(asked)} different ones {of_all}were asked: "
        f"each keeps its decision within at least {percent(least)} {OF_RANGES}, half "
        f"of them within {percent(median)}{aside}",
        state=first.answer.state,
        is_finding=False,
        measures=(
            count,
            distance_measure("smallest certified radius", least),
            distance_measure("median certified radius", median),
            Measure("row", first.number),
        ),
    )

"""What a witness shows: its point, its claims there, and its region."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from fuzzytree.rechecking.case import CLOSE, Case, class_at, strengths
from fuzzytree.rechecking.claims import without
from fuzzytree.rechecking.curves import ZERO
from fuzzytree.rechecking.outcomes import Report, require
from fuzzytree.rechecking.records import Answer, Span, Witness, fraction
from fuzzytree.rechecking.words import is_plain, stretch_word

CLOSE_LEVEL = Fraction(1, 10**9)
"""How far a level of a witness may be rounded."""


def check_spans(case: Case, region: tuple[Span, ...]) -> None:
    """Refuse a region of unknown variables or with swapped ends."""
    for span in region:
        is_known = span.variable in case.model.variables
        require(is_known, f"no variable {span.variable!r}")
        is_ordered = span.low is None or span.high is None or span.low <= span.high
        require(is_ordered, f"the region's ends in {span.variable!r} are swapped")
        variable, side = (
            case.model.variables[span.variable],
            case.sides.get(span.variable),
        )
        word = ""
        if not variable.parts:
            low, high = case.ends(variable)
            low = low if span.low is None else Fraction(span.low)
            high = high if span.high is None else Fraction(span.high)
            word = stretch_word(variable, side, low, high)
        require(span.word == word, f"{span.variable!r} is {word!r}, not {span.word!r}")


def check_witness(case: Case, report: Report, answer: Answer, state: Witness) -> None:
    """Check a witness: its claims at its point, and at corners of its region."""
    point = case.check_point(report, state.point, state.claims)
    is_same = answer.region in ((), state.region)
    require(is_same, "the answer's region is not that of its witness")
    require(bool(state.claims), "a witness of which nothing is claimed")
    levels = [claim for claim in state.claims if claim.kind == "strength"]
    is_own = not levels or not answer.rules
    if not is_own:  # the first rule of the answer that is so strong
        same = (levels[0]._replace(rules=(n,)) for n in answer.rules)
        first = next((one for one in same if case.holds(one, point)), None)
        is_own = levels[0] == first
    require(is_own, "the strength of another rule is claimed")
    check_spans(case, state.region)
    for span in state.region:
        x = case.model.variables[span.variable].at(point)
        is_above = span.low is None or span.low <= x
        is_in = is_above and (span.high is None or x <= span.high)
        require(is_in, f"the witness lies outside its region in {span.variable!r}")
    lasting = [
        c for c in state.claims if c.kind not in ("strength", "degree", "reaches")
    ]
    for other in case.corners(state.region, point):
        for claim in lasting:
            off = ZERO if claim.kind in ("below", "covered") else CLOSE
            is_so = case.holds(claim, other, off)
            require(is_so, f"{claim.kind} fails within the region")
        report.counts["points of regions"] += 1
    if answer.message in SHOWS:
        SHOWS[answer.message](case, answer, state)


def _shows_win(case: Case, answer: Answer, state: Witness) -> None:
    (number,) = answer.rules
    rivals = {*case.rivals(number)}
    if answer.code == "FT103":
        rivals = {*case.numbers} - {number}
    if answer.message == "FT101.fires":
        rivals = set()
    beats = [c for c in state.claims if (c.kind, c.rules) == ("beats", (number,))]
    is_all = any(rivals == {*claim.rivals} for claim in beats)
    require(is_all, "it is not claimed that the rule beats all these others")


def _shows_tie(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a claim compares rules that tie with all others."""
    met = [c for c in state.claims if c.kind == "ties"]
    every = {*case.numbers}
    if answer.code == "FT101":  # others of its class do not matter
        every = {*answer.rules, *case.rivals(answer.rules[0])}
    is_all = any(
        {*answer.rules} <= {*c.rules} and every <= {*c.rules, *c.rivals} for c in met
    )
    require(is_all, "it is not claimed that they tie above all others")
    if answer.code == "FT202":
        require(len({*map(case.then, answer.rules)}) == 2, "the rules are of one class")


def _shows_lead(case: Case, answer: Answer, state: Witness) -> None:
    _shows_win(case, answer, state)
    every = strengths(case.rules, case.point_of(state.point))
    number = answer.rules[0]
    rivals = [every[n - 1][1] for n in case.rivals(number)]
    lead = every[number - 1][1] - max(rivals, default=ZERO)
    entry = answer.measure("largest lead, at least")
    is_so = entry >= case.settings.lead and lead >= Fraction(entry)
    require(is_so, "the rule does not lead by so much there")


def _shows_need(case: Case, answer: Answer, state: Witness) -> None:
    rest, point = without(case, answer), case.point_of(state.point)
    every, place = [*case.rules.rules], answer.rules[0] - 1
    every[place] = rest
    before, after = (
        class_at(case.rules, point),
        class_at(case.rules._replace(rules=tuple(every)), point),
    )
    require(before != after == case.then(place + 1), "it does not matter there")
    require(answer.facts.get("before") == before, f"the class there is {before!r}")


def _shows_conflict(case: Case, answer: Answer, state: Witness) -> None:
    level = Fraction(case.settings.level)
    met = [c for c in state.claims if c.kind == "reaches" and c.rules == answer.rules]
    is_high = any(fraction(claim.level) >= level for claim in met)
    require(is_high, "it is not claimed that both reach the level")
    require(len({*map(case.then, answer.rules)}) == 2, "the rules are of one class")
    low = answer.measures[0].value
    require(answer.facts["level"] == low, "the level is another one")
    every = strengths(case.rules, case.point_of(state.point))
    reached = min(every[n - 1][1] for n in answer.rules)
    off = Fraction(answer.facts.get("falls short", 0)) + CLOSE_LEVEL
    require(reached >= Fraction(low) - off, "less is reached there")


def _shows_difference(case: Case, answer: Answer, state: Witness) -> None:
    said = {claim.of: claim.label for claim in state.claims if claim.kind == "decides"}
    require(said.keys() == {"tree", "raw rules"}, "it is not claimed what both answer")
    require(said["tree"] != said["raw rules"], "the two answers are the same")
    is_so = (
        answer.facts["then"] == said["tree"]
        and answer.facts["other"] == said["raw rules"]
    )
    require(is_so, "the two answer something else")


def _shows_region(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a leaf's witness reaches it, and that its region is of its path."""
    (number,) = answer.rules
    is_there = case.model.leaf_at(case.point_of(state.point)) == number
    require(is_there, "the witness reaches another leaf")
    label = case.model.leaves[number - 1]
    require([c.label for c in state.claims] == [label], "it is not the leaf's class")
    ends: dict[str, set[float]] = {}
    for node, _ in case.model.paths[number - 1]:
        ends.setdefault(node["ask"], set()).update(node["cuts"])
    is_path = {span.variable for span in state.region} == ends.keys()
    require(is_path, "not the variables of its path")
    for span in state.region:
        side = case.sides.get(span.variable)
        known = ends[span.variable] | ({side.low, side.high} if side else set())
        both = {span.low, span.high} - {None}
        is_end = side is None or {span.low, span.high} <= known
        if side is not None and not is_plain(side):
            is_end = all(side.has(Fraction(end)) for end in both if end is not None)
        require(is_end, f"the path leads elsewhere in {span.variable!r}")


def _shows_gap(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claim that every rule is low enough."""
    is_weak = answer.message == "FT301.weak"
    level = Fraction(case.settings.epsilon) if is_weak else ZERO
    below = [c for c in state.claims if c.kind == "below"]
    met = [c for c in below if {*c.rules} == {*case.numbers}]
    is_low = any(fraction(claim.level) <= level for claim in met)
    require(is_low, "it is not claimed that all rules are below")


SHOWS: dict[str, Callable[[Case, Answer, Witness], None]] = {
    "FT101.wins": _shows_win,
    "FT101.fires": _shows_win,
    "FT101.decides-by-place": _shows_tie,
    "FT102.leads": _shows_lead,
    "FT103.alone": _shows_win,
    "FT103.by-place": _shows_tie,
    "FT107.needed": _shows_need,
    "FT201.conflict": _shows_conflict,
    "FT202.tie": _shows_tie,
    "FT203.differs": _shows_difference,
    "FT205.region": _shows_region,
    "FT301.weak": _shows_gap,
    "FT301.gap": _shows_gap,
    "FT301.gap-with-class": _shows_gap,
    "FT301.gap-of-system": _shows_gap,
}
"""What the claims of a witness must say, by message."""

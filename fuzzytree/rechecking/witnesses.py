"""What a witness shows: its point, its claims there, and its region."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from fuzzytree.rechecking.case import Case, class_at, strengths
from fuzzytree.rechecking.claims import without
from fuzzytree.rechecking.curves import ZERO
from fuzzytree.rechecking.outcomes import Report, require
from fuzzytree.rechecking.records import Answer, Claim, Span, Witness, fraction
from fuzzytree.rechecking.words import is_plain, stretch_word

CLOSE_LEVEL = Fraction(1, 10**9)
"""How far a level of a witness may be rounded."""


def check_spans(case: Case, region: tuple[Span, ...]) -> None:
    """Refuse a region of unknown variables, with swapped ends or in other words."""
    for span in region:
        variable = case.model.variables.get(span.variable)
        require(variable is not None, f"no variable {span.variable!r}")
        is_ordered = span.low is None or span.high is None or span.low <= span.high
        require(is_ordered, f"the region's ends in {span.variable!r} are swapped")
        word = ""
        if variable is not None and not variable.parts:
            low, high = case.ends(variable)
            low = low if span.low is None else Fraction(span.low)
            high = high if span.high is None else Fraction(span.high)
            word = stretch_word(variable, case.sides.get(span.variable), low, high)
        require(span.word == word, f"{span.variable!r} is {word!r}, not {span.word!r}")


def check_witness(case: Case, report: Report, answer: Answer, state: Witness) -> None:
    """Check a witness: its claims at its point, and what its message says of it."""
    point = case.check_point(report, state.point, state.claims)
    is_same = answer.region in ((), state.region)
    require(is_same, "the answer's region is not that of its witness")
    require(bool(state.claims), "a witness of which nothing is claimed")
    levels = [claim for claim in state.claims if claim.kind == "strength"]
    if levels and answer.rules:  # of the first rule of the answer that is so strong
        same = (levels[0]._replace(rules=(n,)) for n in answer.rules)
        first = next((claim for claim in same if case.holds(claim, point)), None)
        require(levels[0] == first, "the strength of another rule is claimed")
    check_spans(case, state.region)
    for span in state.region:
        x = case.model.variables[span.variable].at(point)
        is_in = span.low is None or span.low <= x
        is_in &= span.high is None or x <= span.high
        require(is_in, f"the witness lies outside its region in {span.variable!r}")
    if answer.message in SHOWS:
        SHOWS[answer.message](case, answer, state)


def _of_kind(state: Witness, kind: str) -> list[Claim]:
    return [claim for claim in state.claims if claim.kind == kind]


def _shows_win(case: Case, answer: Answer, state: Witness) -> None:
    (number,), claims = answer.rules, _of_kind(state, "beats")
    rivals = {*case.rivals(number)}
    if answer.message == "FT101.fires":
        rivals = set()
    is_all = any((c.rules, {*c.rivals}) == ((number,), rivals) for c in claims)
    require(is_all, "it is not claimed that the rule beats all these others")
    if answer.code == "FT102":
        every = [most for _, most in strengths(case.rules, case.point_of(state.point))]
        others = (every[n - 1] for n in rivals)
        lead = every[number - 1] - max(others, default=ZERO)
        least = answer.measure("largest lead, at least")
        is_so = least >= case.settings.lead and lead >= Fraction(least)
        require(is_so, "the rule does not lead by so much there")


def _shows_tie(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a claim compares rules that tie with all others."""
    every, own = {*case.numbers}, {*answer.rules}
    claims = _of_kind(state, "ties")
    if answer.code == "FT101":  # others of its class do not matter
        every = own | {*case.rivals(answer.rules[0])}
    is_all = any(own <= {*c.rules} and every <= {*c.rules, *c.rivals} for c in claims)
    require(is_all, "it is not claimed that they tie above all others")
    is_two = answer.code != "FT202" or len({*map(case.then, answer.rules)}) == 2
    require(is_two, "the rules are of one class")


def _shows_need(case: Case, answer: Answer, state: Witness) -> None:
    point, place = case.point_of(state.point), answer.rules[0] - 1
    every = [*case.rules.rules]
    if answer.code == "FT107":
        every[place] = without(case, answer)
    else:
        del every[place]
    before = class_at(case.rules, point)
    after = class_at(case.rules._replace(rules=tuple(every)), point)
    own = after if answer.code == "FT107" else before
    require(before != after and own == case.then(place + 1), "it does not matter there")
    require(answer.facts.get("before") == before, f"the class there is {before!r}")
    require(answer.facts.get("then") == after, f"it becomes {after!r}")


def _shows_conflict(case: Case, answer: Answer, state: Witness) -> None:
    level, low = Fraction(case.settings.level), answer.measures[0].value
    claims = _of_kind(state, "reaches")
    is_high = any(
        c.rules == answer.rules and fraction(c.level) >= level for c in claims
    )
    require(is_high, "it is not claimed that both reach the level")
    require(len({*map(case.then, answer.rules)}) == 2, "the rules are of one class")
    require(answer.facts["level"] == low, "the level is another one")
    every = strengths(case.rules, case.point_of(state.point))
    most = min(every[n - 1][1] for n in answer.rules)
    off = Fraction(answer.facts.get("falls short", 0)) + CLOSE_LEVEL
    require(most >= Fraction(low) - off, "less is reached there")


def _shows_difference(case: Case, answer: Answer, state: Witness) -> None:
    classes = {claim.of: claim.label for claim in _of_kind(state, "decides")}
    require(
        classes.keys() == {"tree", "raw rules"}, "it is not claimed what both answer"
    )
    both = classes["tree"], classes["raw rules"]
    require(both[0] != both[1], "the two answers are the same")
    is_so = (answer.facts["then"], answer.facts["other"]) == both
    require(is_so, "the two answer something else")


def _shows_region(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a leaf's witness reaches it, and that its region is of its path."""
    (number,) = answer.rules
    is_there = case.model.leaf_at(case.point_of(state.point)) == number
    require(is_there, "the witness reaches another leaf")
    label = case.model.leaves[number - 1]
    require([c.label for c in state.claims] == [label], "it is not the leaf's class")
    ends: dict[str, set[float | None]] = {}
    for node, _ in case.model.paths[number - 1]:
        ends.setdefault(node["ask"], set()).update(node["cuts"])
    is_path = {span.variable for span in state.region} == ends.keys()
    require(is_path, "not the variables of its path")
    for span in state.region:
        side = case.sides.get(span.variable)
        if side is None:
            continue
        both = {span.low, span.high}
        is_end = both <= ends[span.variable] | {side.low, side.high}
        if not is_plain(side):
            is_end = all(side.has(Fraction(end)) for end in both if end is not None)
        require(is_end, f"the path leads elsewhere in {span.variable!r}")


def _shows_gap(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claim that every rule is low enough."""
    is_weak = answer.message == "FT301.weak"
    level = Fraction(case.settings.epsilon) if is_weak else ZERO
    claims = [c for c in _of_kind(state, "below") if {*c.rules} == {*case.numbers}]
    is_low = any(fraction(claim.level) <= level for claim in claims)
    require(is_low, "it is not claimed that all rules are below")


_MESSAGES: dict[Callable[[Case, Answer, Witness], None], str] = {
    _shows_win: "FT101.wins FT101.fires FT102.leads",
    _shows_tie: "FT101.decides-by-place FT202.tie",
    _shows_need: "FT103.needed FT107.needed",
    _shows_conflict: "FT201.conflict",
    _shows_difference: "FT203.differs",
    _shows_region: "FT205.region",
    _shows_gap: "FT301.weak FT301.gap FT301.gap-with-class FT301.gap-of-system",
}
SHOWS = {name: shows for shows, names in _MESSAGES.items() for name in names.split()}
"""What the claims of a witness must say, by message."""

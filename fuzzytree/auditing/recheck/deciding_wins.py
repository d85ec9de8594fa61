"""Rules that win, tie or fire nowhere: FT101, FT102, FT103, FT202, FT301."""

from __future__ import annotations

from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import Answer, Witness, fraction
from fuzzytree.auditing.recheck.cases import LEVELS, Case, counted, level_of
from fuzzytree.auditing.recheck.claims import point_of
from fuzzytree.auditing.recheck.deciding_leaves import dead_leaf
from fuzzytree.auditing.recheck.meaning import Point, strengths
from fuzzytree.auditing.recheck.model_records import Tree
from fuzzytree.auditing.recheck.outcomes import UndecidedError, require
from fuzzytree.auditing.recheck.polynomials import ZERO
from fuzzytree.auditing.recheck.views import View


def dead(case: Case, answer: Answer) -> None:
    """Ask whether a rule is anywhere stronger than those of other classes."""
    if isinstance(case.model, Tree):
        dead_leaf(case, case.model, answer)
        return
    if case.view is not None:
        silent(case, case.view, answer)
        return
    require(len(answer.rules) > 0, "no rule is named")
    number = answer.rules[0]
    rivals = [case.asked(n) for n in case.numbers if case.then(n) != case.then(number)]
    wins = case.beats(case.asked(number), rivals)
    case.never(wins, "the rule wins somewhere")


def silent(case: Case, view: View, answer: Answer) -> None:
    """Ask whether a rule of a system fires, in any of its ways."""
    require(answer.is_finding, "a finding that is none")
    if not answer.rules:
        require(answer.subject in view.silent, "its text lets it fire")
        return
    case.never(case.fire(*answer.rules), "the rule fires somewhere")


def superfluous(case: Case, answer: Answer) -> None:
    """Ask whether a rule is anywhere stronger than all, or first of the strongest."""
    require(len(answer.rules) == 1 and answer.is_finding, "it is of no rule")
    number = answer.rules[0]
    mine, then = case.asked(number), case.then(number)
    others = [n for n in case.numbers if n != number]
    wins = case.beats(mine, [case.asked(n) for n in others])
    case.never(wins, "it is stronger than all somewhere")
    later = [n for n in others if n > number and case.then(n) != then]
    for other in (n for n in others if case.then(n) == then):
        # one that hides it, with no other class between the two
        is_between = any(n < other for n in later)
        if not is_between and not case.beats(mine, [case.asked(other)]):
            return
    if any(case.tie(number, other) for other in later):
        raise UndecidedError("it ties with a later rule, and its place may decide")


def tied(case: Case, answer: Answer) -> None:
    """Count the pairs of rules of two classes, and those that are told."""
    pairs = len(case.pairs(alike=False))
    told = sum(bool(one.rules) for one in case.coded("FT202"))
    counted(answer, {"pairs": pairs, "pairs told one by one": told}, 2)
    require(not answer.is_finding, "that others do not tie is no finding")
    known = {one.rules for one in case.coded("FT202") if one.rules}
    total = next((m.value for m in answer.measures if m.name == "pairs that tie"), told)
    if total != told:
        raise UndecidedError("which pairs are not told is not known")
    for pair in case.pairs(alike=False):
        if pair not in known:
            text = f"rules {pair[0]} and {pair[1]} tie as the strongest"
            case.never(case.tie(*pair), text)


def covered(case: Case, answer: Answer) -> None:
    """Ask whether some rule fires everywhere, or reaches epsilon everywhere."""
    grid = case.grid
    if answer.subject == "cover":
        is_gap = grid.is_bare(grid.of)
        if is_gap is None:
            raise UndecidedError("a curve may touch 0 where it is not known exactly")
        case.never(is_gap, "there are points at which no rule fires")
        return
    if case.rules.semantics.conjunction != "min":
        raise UndecidedError("gaps under product are not decided again here")
    below = grid.gap(Fraction(case.audit.settings.epsilon), is_above=False)
    is_gap = grid.leaves(None, grid.of, below)
    case.never(is_gap, "there are points at which every rule is below epsilon")
    least_cover(case, answer)


def least_cover(case: Case, answer: Answer) -> None:
    """Ask whether the strength where it is least lies between those that are told."""
    grid, told = case.grid, [level_of(m) for m in answer.measures if m.name in LEVELS]
    require(len(told) == 2 and 0 <= told[0] <= told[1] <= 1, "no least strength")
    if told[0] > 0:
        is_less = grid.leaves(None, grid.of, grid.gap(told[0], is_above=False))
        case.never(is_less, "somewhere every rule is weaker than is told")
    if told[1] < 1 and case.is_free:
        is_seen = grid.leaves(None, grid.of, grid.gap(told[1], is_above=True))
        require(is_seen, "everywhere some rule is stronger than is told")


def shows_win(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that a claim compares the rule with every rule that it is about."""
    require(len(answer.rules) == 1, "it is of no rule")
    number = answer.rules[0]
    if case.view is not None:
        fired = [claim.rules for claim in state.claims if claim.kind == "beats"]
        is_found = (number,) in fired and not answer.is_finding
        require(is_found, "it is not claimed that the rule fires")
        return
    rivals = {n for n in case.numbers if n != number}
    if answer.code != "FT103":
        rivals = {n for n in rivals if case.then(n) != case.then(number)}
    ties = [c for c in state.claims if c.kind == "ties" and number in c.rules]
    if answer.is_finding or (answer.code == "FT103" and ties):  # it ties, and is first
        require(bool(ties), "it is not claimed that the rule ties")
        return
    beats = [c for c in state.claims if (c.kind, c.rules) == ("beats", (number,))]
    is_all = any(rivals <= {*claim.rivals} for claim in beats)
    require(is_all, "it is not claimed that the rule beats all these others")


def lead(case: Case, number: int, point: Point) -> Fraction:
    """Return by how much a rule is above those of other classes at a point."""
    every = strengths(case.rules, point)
    then = case.then(number)
    others = (every[n - 1] for n in case.numbers if case.then(n) != then)
    return every[number - 1] - max(others, default=ZERO)


def shows_lead(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that the rule leads at the witness by as much as is told."""
    require(len(answer.rules) == 1 and not answer.is_finding, "it is of no rule")
    found = lead(case, answer.rules[0], point_of(state.point))
    told = [m.value for m in answer.measures if m.name == "largest lead, at least"]
    is_so = len(told) == 1 and found >= Fraction(told[0]) >= case.audit.settings.lead
    require(is_so, "the rule does not lead by so much there")
    shows_win(case, answer, state)


def shows_tie(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that a claim compares two rules of two classes with every other rule."""
    ties = [c for c in state.claims if c.kind == "ties"]
    met = [c for c in ties if {*answer.rules} <= {*c.rules}]
    is_all = any({*c.rules, *c.rivals} == {*case.numbers} for c in met)
    require(is_all and answer.is_finding, "it is not claimed that the two tie")
    case.differ(answer.rules)


def shows_gap(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that every rule is claimed to be low enough."""
    is_gap = answer.subject.startswith("gap ")
    level = ZERO if is_gap else Fraction(case.audit.settings.epsilon)
    below = [c for c in state.claims if c.kind == "below"]
    met = [c for c in below if {*c.rules} == {*case.numbers}]
    is_low = any(fraction(claim.level or "1") <= level for claim in met)
    require(is_low and answer.is_finding, "it is not claimed that all rules are below")
    if not is_gap and case.rules.semantics.conjunction == "min":
        least_cover(case, answer)

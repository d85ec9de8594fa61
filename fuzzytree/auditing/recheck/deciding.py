"""The check of each code: of a proof, and of the claims of a witness."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import (
    Answer,
    Declined,
    Label,
    Witness,
    fraction,
)
from fuzzytree.auditing.recheck.cases import (
    LEVELS,
    NEAR,
    Case,
    counted,
    end_of,
    level_of,
    point_of,
)
from fuzzytree.auditing.recheck.forms import proposition_text, propositions_of
from fuzzytree.auditing.recheck.grid import FINE, RuleBits
from fuzzytree.auditing.recheck.meaning import (
    Point,
    View,
    answer_of,
    leaf_of,
    strengths,
)
from fuzzytree.auditing.recheck.model_records import Proposition, Rules, Tree, Variable
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.polynomials import ZERO

Interval = tuple[Fraction, Fraction, bool]  # True opens the low end


def dead_leaf(case: Case, tree: Tree, answer: Answer) -> None:
    """Check that a leaf is not reached, or that the audit has all such leaves."""
    reached = {
        number
        for number in case.numbers
        if all(_ways(case, number, variable) for variable in tree.variables)
    }
    if answer.is_finding:
        case.never(not reached.isdisjoint(answer.rules), "the leaf is reached")
    elif not answer.rules:
        entries = {one.rules for one in case.coded("FT101") if one.is_finding}
        hidden = {(number,) for number in {*case.numbers} - reached}
        missing = [number for (number,) in sorted(hidden - entries)]
        require(not missing, f"leaves that are not reached are missing: {missing}")


def shows_region(case: Case, answer: Answer, state: Witness) -> None:
    """Compare the region of a leaf with the intervals on the path to it."""
    tree = case.model
    if not isinstance(tree, Tree) or len(answer.rules) != 1:
        raise DoesNotHoldError("it is of no leaf")
    number = answer.rules[0]
    is_there = leaf_of(tree, point_of(state.point)) == number
    require(is_there, "the witness reaches another leaf")
    label = tree.leaves[number - 1].label
    require([c.label for c in state.claims] == [label], "it is not the leaf's class")
    used = {node.variable for node, _ in case.paths[number]}
    require({s.variable for s in state.region} == used, "not the variables of its path")
    for span in state.region:
        is_one = any(
            math.isclose(span.low or 0.0, low, rel_tol=2.0**-50)
            and math.isclose(span.high or 0.0, high, rel_tol=2.0**-50)
            for low, high, _ in _ways(case, number, case.variables[span.variable])
        )
        require(is_one, f"the path leads elsewhere in {span.variable!r}")


def shows_difference(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claim that the tree and its raw rules predict two classes."""
    said = {claim.of: claim.label for claim in state.claims if claim.kind == "decides"}
    require(said.keys() == {"tree", "raw rules"}, "it is not claimed what both answer")
    is_near = not answer.rules  # the nearest to a row is no finding
    require(answer.is_finding or is_near, "two answers that differ are a finding")
    require(said["tree"] != said["raw rules"], "the two answers are the same")


def _ways(case: Case, number: int, variable: Variable) -> list[Interval]:
    """Return the values of a variable that lead to a leaf."""
    line = case.line(variable)
    met: list[Interval] = [(line.low, line.high, False)]
    for node, way in case.paths[number]:
        if node.variable == variable.name:
            ends = zip((None, *node.cuts), (*node.cuts, None), node.owners, strict=True)
            place = node.branches.index(way)
            mine = [(low, high) for low, high, owner in ends if owner == place]
            met = [_met(one, low, high) for one in met for low, high in mine]
    return [one for one in met if one[0] < one[1] or (one[0] == one[1] and not one[2])]


def _met(one: Interval, low: float | None, high: float | None) -> Interval:
    """Return what an interval has in common with `low < x <= high`."""
    start, end, is_open = one
    if low is not None and low >= start:
        start, is_open = Fraction(low), True
    return start, end if high is None else min(end, Fraction(high)), is_open


# --- pairs of rules, and propositions: FT104 to FT107, FT201


def hidden(case: Case, answer: Answer) -> None:
    """Check the rules that hide another; or all pairs without a finding."""
    is_alike = answer.code == "FT104"
    if not answer.rules:
        _check_not_hidden(case, answer, is_alike=is_alike)
        return
    weak, *strong = answer.rules
    for number in strong:
        is_one = case.then(number) == case.then(weak)
        require(is_one == is_alike, "the classes are not so")
        beats = case.beats(weak, [number])
        case.never(beats, f"rule {weak} is somewhere stronger than rule {number}")
        if not is_alike and number > weak:
            text = "that it is always strictly weaker is not checked here"
            raise UndecidedError(text)
    counted(answer, {"rules that subsume it": len(strong)}, is_alike)
    counted(answer, {"rules that mask it": len(strong)}, not is_alike)


def _check_not_hidden(case: Case, answer: Answer, *, is_alike: bool) -> None:
    pairs = [pair for pair in case.pairs(alike=is_alike) if case.fire(*pair)]
    silent = sum(not case.fire(number) for number in case.numbers)
    counts = {"pairs": len(pairs), "pairs too near to compare": 0}
    counted(answer, counts | {"rules that never fire": silent}, 3)
    entries = {(a.rules[0], n) for a in case.coded(answer.code) for n in a.rules[1:]}
    for pair in pairs:
        if pair in entries or pair[::-1] in entries:
            continue
        for first, second in (pair, pair[::-1]) if is_alike else (pair,):
            beats = case.beats(second, [first])
            require(beats, f"rule {second} hides behind {first}")


def copied(case: Case, answer: Answer) -> None:
    """Check that neither of two equal rules is ever stronger."""
    if not answer.rules:
        pairs = case.pairs(alike=True) + case.pairs(alike=False)
        counted(answer, {"pairs": len(pairs)}, 1)
        text = "that no other two rules are nearly alike is not checked here"
        raise UndecidedError(text)
    first, second = answer.rules
    is_one = case.then(first) == case.then(second)
    graver = "error" if case.view is None else "info"
    severity = "warning" if is_one else graver
    require(answer.severity == severity, "the classes are not so")
    if all(measure.exact != "0" for measure in answer.measures):  # their distance
        raise UndecidedError("the distance of curves that differ is not measured here")
    if case.bits_of(first) != case.bits_of(second):
        is_more = case.beats(first, [second]) or case.beats(second, [first])
        require(not is_more, "the two rules are not alike")


def apart(case: Case, answer: Answer) -> None:
    """Check that no pair without a finding can reach the level together."""
    if case.rules.semantics.conjunction != "minimum":
        raise UndecidedError("conflicts under product are not decided again here")
    entries = {one.rules for one in case.coded("FT201")}
    level, grid = Fraction(case.audit.settings.level), case.grid
    rest = [pair for pair in case.pairs(alike=False) if pair not in entries]
    if case.view is not None:
        rest = [pair for pair in rest if case.view.may_conflict(*pair)]
    omitted = next((m.value for m in answer.measures if "not listed" in m.name), 0)
    require(answer.is_finding == (omitted > 0), "a finding that is none")
    counted(answer, {"pairs that never do": len(rest) - omitted}, 1)
    if omitted:
        raise UndecidedError("which pairs are left out is not known")
    for one, other in rest:
        both = _union(case.bits_of(one), case.bits_of(other))
        if not grid.leaves(both, (), grid.gap(level, is_above=False)):
            continue
        is_met = level < 1 and grid.leaves(both, (), grid.gap(level, is_above=True))
        case.never(is_met, f"rules {one} and {other} reach the level together")
        raise UndecidedError(f"rules {one} and {other} touch the level")


def highest(case: Case, answer: Answer) -> None:
    """Check that two rules reach no higher level together than the reported one."""
    if case.rules.semantics.conjunction != "minimum":
        raise UndecidedError("conflicts under product are not decided again here")
    tops = [one for one in answer.measures if one.name in LEVELS]
    require(len(tops) == 1 and len(answer.rules) == 2, "it has no highest level")
    top, grid = end_of(tops[0]), case.grid
    both = _union(*map(case.bits_of, answer.rules))
    require(0 <= top <= 1 + NEAR, "a level outside 0 to 1")
    if 0 < top <= 1 and case.is_free and tops[0].exact is not None:
        is_near = grid.leaves(both, (), grid.gap(top, is_above=False))
        require(is_near, "both do not reach so high a level together")
    if top >= 1:
        return
    band = grid.gap(top, is_above=True)
    case.never(grid.leaves(both, (), band), "both reach a higher level together")
    low, high = grid.levels.bands[band]
    if low < high and grid.leaves(both, (), band, is_gap=False):
        raise UndecidedError("two critical levels are too near to distinguish")


def needless(case: Case, answer: Answer) -> None:
    """Check that a rule without a proposition is nowhere stronger than with it."""
    if not answer.rules:
        raise UndecidedError("which other propositions matter is not known")
    require(len(answer.rules) == 1, "it is of no rule")
    if not answer.terms:
        require(not answer.is_finding, "it is of no proposition of the rule")
        require(not case.fire(*answer.rules), "the rule fires somewhere")
        return
    rest, number = case.grid.bits_of(_without(case, answer)), answer.rules[0]
    if case.beats(rest, [number]):
        _decides_alike(case, number, rest)


def _decides_alike(case: Case, number: int, rest: RuleBits) -> None:
    """Check that a rule that becomes stronger changes no decision.

    It does where it wins and a rule of another class was above all of its own class;
    or where no rule fired; it may where it ties with a later rule of another class.
    """
    grid, then = case.grid, case.then(number)
    own = [n for n in case.numbers if case.then(n) == then]
    is_more = any(
        case.beats(_union(rest, case.bits_of(n)), own)
        or (
            n > number
            and case.ties.tie(rest, case.bits_of(n), [*map(case.bits_of, own)])
        )
        for n in case.rivals(number)
    )
    if case.rules.semantics.uncovered != then:
        is_more |= grid.leaves(rest, grid.of, grid.gap(ZERO, is_above=True))
    if is_more:
        raise UndecidedError("the rule is stronger without it, if not in its answers")


def _union(one: RuleBits, other: RuleBits) -> RuleBits:
    """Return the functions that either of two rules uses."""
    return tuple(a | b for a, b in zip(one, other, strict=True))


def _without(case: Case, answer: Answer) -> tuple[Proposition, ...]:
    """Return a rule's propositions without the one that an answer is about."""
    when, result = (
        case.rules.rules[answer.rules[0] - 1].when,
        propositions_of(case, answer),
    )
    if len(result) > 1:  # one of them is negated: only the subject says which
        result = [
            c for c in result if answer.subject.endswith(repr(proposition_text(c)))
        ]
    require(len(result) == 1, "it is of no proposition of the rule")
    place = when.index(result.pop())
    return (*when[:place], *when[place + 1 :])


def shows_need(case: Case, answer: Answer, state: Witness) -> None:
    """Check that the prediction at the witness differs without the proposition."""
    rest, point = _without(case, answer), point_of(state.point)
    every, place = list(case.rules.rules), answer.rules[0] - 1
    every[place] = every[place]._replace(when=rest)
    other = answer_of(case.rules._replace(rules=tuple(every)), point)
    is_other = other != answer_of(case.rules, point) and not answer.is_finding
    require(is_other, "the proposition does not matter there")


def shows_conflict(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claim that two rules of two classes reach the level together."""
    level = Fraction(case.audit.settings.level)
    met = [c for c in state.claims if c.kind == "reaches" and c.rules == answer.rules]
    is_high = any(fraction(claim.level or "0") >= level for claim in met)
    is_claimed = is_high and answer.is_finding
    require(is_claimed, "it is not claimed that both reach the level")
    require(len({*map(case.then, answer.rules)}) == 2, "the rules are of one class")
    if case.rules.semantics.conjunction == "minimum":
        highest(case, answer)


# --- terms, and their use: FT401, FT403, FT404, FT501


def heights(case: Case, answer: Answer) -> None:
    """Compare the terms that do not reach the level with the findings."""
    level = case.audit.settings.level
    low = {label: height for label, height in case.heights.items() if height < level}
    entries = [one.terms[0] for one in case.coded("FT401") if one.terms]
    entries = [label for label in entries if label in case.heights]
    require(entries == list(low), "other terms are too low")
    if any(label not in case.heights for label in answer.terms):
        raise UndecidedError("the height of a curve that is no polynomial")
    for label in answer.terms:
        is_empty = answer.severity == "error"
        require(is_empty == (not low[label]), f"{label.term!r} is empty, or is not")
        value = next((m.value for m in answer.measures if m.name == "height"), -1.0)
        require(abs(value - low[label]) <= 2.0**-30, f"the height of {label.term!r}")


def overlaps(case: Case, answer: Answer) -> None:
    """Compare the shared areas of pairs of terms with the findings."""
    limit = Fraction(case.audit.settings.overlap)
    known = {labels: share for labels, share in case.shares.items() if share}
    near = {labels: share for labels, share in known.items() if share[1] >= limit}
    if any(low < limit for low, _ in near.values()):
        raise UndecidedError("a shared area is too near to the limit to decide")
    entries = [one for one in case.coded("FT403") if one.terms]
    entries = [one for one in entries if not isinstance(one.state, Declined)]
    is_near = {one.terms for one in entries} <= near.keys()
    require(is_near, "two terms are easy to distinguish")
    if not answer.terms:
        is_more = len(near) > len(entries)
        require(answer.is_finding == is_more, "a finding that is none")
        counts = {
            "pairs not listed": len(near) - len(entries),
            "pairs apart": len(known) - len(near),
            "pairs without area": len(case.shares) - len(known),
        }
        counted(answer, counts, len(counts))
        return
    low, high = near[answer.terms]
    value = Fraction(next(m.value for m in answer.measures if "shared" in m.name))
    require(low - FINE <= value <= high + FINE, "the share is another one")


def unused(case: Case, answer: Answer) -> None:
    """Compare the terms and variables that no rule uses with the findings."""
    every, used = case.terms, _used_terms(case.rules)
    if case.view is not None:  # the system itself is read, rules left out or not
        inputs = case.view.system.inputs
        every = [Label(v.name, label.name) for v in inputs for label in v.terms]
        used = case.view.questions()
    needed = {variable for variable, _ in used}
    names = [v.name for v in case.rules.variables]
    for variable in case.rules.variables:
        if variable.name in needed:
            needed |= {part.input for part in variable.parts}
    idle = [f"variable {name!r}" for name in names if name not in needed]
    rest = [pair for pair in every if pair[0] in needed and pair not in used]
    idle += [f"term {term!r} of {name!r}" for name, term in rest]
    needed, used = needed.intersection(names), used.intersection(every)
    entries = [one.subject for one in case.coded("FT404") if one.is_finding]
    require(entries == idle, "other terms or variables are unused")
    counts = {"variables in use": len(needed), "terms in use": len(used)}
    counted(answer, counts, 0 if answer.is_finding else 2)


def complexity(case: Case, answer: Answer) -> None:
    """Count rules, propositions, terms and variables."""
    lengths, used = [len(r.when) for r in case.rules.rules], _used_terms(case.rules)
    counts: dict[str, float] = {
        "rules": len(lengths),
        "propositions": sum(lengths),
        "most propositions of a rule": max(lengths),
        "propositions per rule": sum(lengths) / len(lengths),
        "distinct terms in use": len(used),
        "variables in use": len({variable for variable, _ in used}),
    }
    if isinstance(case.model, Tree):
        counts["depth of the tree"] = max(map(len, case.paths.values()))
    counted(answer, counts, len(counts))
    text = "its counts are right; the index of Nauck is not worked out here"
    raise UndecidedError(text)


def _used_terms(rules: Rules) -> set[tuple[str, str]]:
    """Return the variable and term of every proposition of the rules."""
    propositions = [proposition for rule in rules.rules for proposition in rule.when]
    return {
        (proposition.variable, term)
        for proposition in propositions
        for term in proposition.terms
    }


# --- rules that win, tie or fire nowhere: FT101 to FT103, FT202, FT301


def dead(case: Case, answer: Answer) -> None:
    """Check that a rule is nowhere stronger than those of other classes."""
    if isinstance(case.model, Tree):
        dead_leaf(case, case.model, answer)
        return
    if case.view is not None:
        silent(case, case.view, answer)
        return
    require(len(answer.rules) > 0, "no rule is named")
    number = answer.rules[0]
    wins = case.beats(number, case.rivals(number))
    case.never(wins, "the rule wins somewhere")


def silent(case: Case, view: View, answer: Answer) -> None:
    """Check that a rule of a system never fires, in any of its ways."""
    require(answer.is_finding, "a finding that is none")
    if not answer.rules:
        require(answer.subject in view.silent, "its text lets it fire")
        return
    case.never(case.fire(*answer.rules), "the rule fires somewhere")


def superfluous(case: Case, answer: Answer) -> None:
    """Check that a rule is nowhere stronger than all, or first of the strongest."""
    require(len(answer.rules) == 1 and answer.is_finding, "it is of no rule")
    number = answer.rules[0]
    others, rivals = [n for n in case.numbers if n != number], case.rivals(number)
    case.never(case.beats(number, others), "it is stronger than all somewhere")
    later = [n for n in rivals if n > number]
    for other in (n for n in others if n not in rivals):
        # one that hides it, with no other class between the two
        is_between = any(n < other for n in later)
        if not is_between and not case.beats(number, [other]):
            return
    if any(case.tie(number, other) for other in later):
        raise UndecidedError("it ties with a later rule, and its place may decide")


def ties_of_classes(case: Case, answer: Answer) -> None:
    """Count the pairs of rules of two classes, and those with a finding."""
    pairs = case.pairs(alike=False)
    known = [one.rules for one in case.coded("FT202") if one.rules]
    counted(answer, {"pairs": len(pairs), "pairs listed": len(known)}, 2)
    require(not answer.is_finding, "that others do not tie is no finding")
    totals = [m.value for m in answer.measures if m.name == "pairs that tie"]
    if totals and totals[0] != len(known):
        raise UndecidedError("which pairs are left out is not known")
    for pair in pairs:
        if pair not in known:
            text = f"rules {pair[0]} and {pair[1]} tie as the strongest"
            case.never(case.tie(*pair), text)


def covered(case: Case, answer: Answer) -> None:
    """Check that some rule fires everywhere, or reaches epsilon everywhere."""
    grid = case.grid
    if answer.subject == "cover":
        is_gap = grid.is_bare(grid.of)
        if is_gap is None:
            raise UndecidedError("a curve may touch 0 where it is not known exactly")
        case.never(is_gap, "there are points at which no rule fires")
        return
    if case.rules.semantics.conjunction != "minimum":
        raise UndecidedError("gaps under product are not decided again here")
    below = grid.gap(Fraction(case.audit.settings.epsilon), is_above=False)
    is_gap = grid.leaves(None, grid.of, below)
    case.never(is_gap, "there are points at which every rule is below epsilon")
    least_cover(case, answer)


def least_cover(case: Case, answer: Answer) -> None:
    """Check that the strength where it is least lies between the reported bounds."""
    grid, ends = case.grid, [m for m in answer.measures if m.name in LEVELS]
    entries = [*map(level_of, ends)]
    is_one = len(entries) == 2 and 0 <= entries[0] <= entries[1] <= 1
    require(is_one, "no least strength")
    if entries[0] > 0:
        is_less = grid.leaves(None, grid.of, grid.gap(entries[0], is_above=False))
        case.never(is_less, "somewhere every rule is weaker than reported")
    if entries[1] < 1 and case.is_free:
        is_low = grid.leaves(None, grid.of, grid.gap(entries[1], is_above=True))
        require(is_low, "everywhere some rule is stronger than reported")


def shows_win(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a claim compares the rule with all of its rivals."""
    require(len(answer.rules) == 1, "it is of no rule")
    number = answer.rules[0]
    if case.view is not None:
        fired = [claim.rules for claim in state.claims if claim.kind == "beats"]
        is_claimed = (number,) in fired and not answer.is_finding
        require(is_claimed, "it is not claimed that the rule fires")
        return
    rivals = {*case.rivals(number)}
    if answer.code == "FT103":
        rivals = {*case.numbers} - {number}
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
    others = (every[n - 1] for n in case.rivals(number))
    return every[number - 1] - max(others, default=ZERO)


def shows_lead(case: Case, answer: Answer, state: Witness) -> None:
    """Check that the rule leads at the witness by the reported lead."""
    require(len(answer.rules) == 1 and not answer.is_finding, "it is of no rule")
    result = lead(case, answer.rules[0], point_of(state.point))
    entries = [m.value for m in answer.measures if m.name == "largest lead, at least"]
    is_so = len(entries) == 1 and entries[0] >= case.audit.settings.lead
    is_so = is_so and result >= Fraction(entries[0])
    require(is_so, "the rule does not lead by so much there")
    shows_win(case, answer, state)


def shows_tie(case: Case, answer: Answer, state: Witness) -> None:
    """Check that a claim compares two rules of two classes with all others."""
    ties = [c for c in state.claims if c.kind == "ties"]
    met = [c for c in ties if {*answer.rules} <= {*c.rules}]
    is_all = any({*c.rules, *c.rivals} == {*case.numbers} for c in met)
    require(is_all and answer.is_finding, "it is not claimed that the two tie")
    require(len({*map(case.then, answer.rules)}) == 2, "the rules are of one class")


def shows_gap(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claim that every rule is low enough."""
    is_gap = answer.subject.startswith("gap ")
    level = ZERO if is_gap else Fraction(case.audit.settings.epsilon)
    below = [c for c in state.claims if c.kind == "below"]
    met = [c for c in below if {*c.rules} == {*case.numbers}]
    is_low = any(fraction(claim.level or "1") <= level for claim in met)
    require(is_low and answer.is_finding, "it is not claimed that all rules are below")
    if not is_gap and case.rules.semantics.conjunction == "minimum":
        least_cover(case, answer)


# --- the check of each code

PROOFS: dict[str, Callable[[Case, Answer], None]] = {
    "FT101": dead,
    "FT103": superfluous,
    "FT104": hidden,
    "FT105": hidden,
    "FT106": copied,
    "FT107": needless,
    "FT201": apart,
    "FT202": ties_of_classes,
    "FT301": covered,
    "FT401": heights,
    "FT403": overlaps,
    "FT404": unused,
    "FT501": complexity,
}
SHOWS: dict[str, Callable[[Case, Answer, Witness], None]] = {
    "FT101": shows_win,
    "FT102": shows_lead,
    "FT103": shows_win,
    "FT107": shows_need,
    "FT201": shows_conflict,
    "FT202": shows_tie,
    "FT203": shows_difference,
    "FT205": shows_region,
    "FT301": shows_gap,
}
WHY = {
    "FT402": "the turning points of curves are not looked at here",
    "FT601": "nothing is run here but the model itself",
    "FT602": "nothing is run here but the model itself",
}
"""Why proofs of these codes are not decided again."""

"""Pairs of rules, and clauses: FT104 to FT107, FT201."""

from __future__ import annotations

from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import Answer, Label, Witness, fraction
from fuzzytree.auditing.recheck.cases import LEVELS, NEAR, Case, counted, end_of
from fuzzytree.auditing.recheck.claims import point_of
from fuzzytree.auditing.recheck.grid import Asked
from fuzzytree.auditing.recheck.meaning import answer_of
from fuzzytree.auditing.recheck.model_records import Clause
from fuzzytree.auditing.recheck.outcomes import UndecidedError, require
from fuzzytree.auditing.recheck.polynomials import ZERO


def hidden(case: Case, answer: Answer) -> None:
    """Ask each rule that is told to hide another; or all pairs that are not told."""
    if answer.rules:
        _told_to_hide(case, answer)
    else:
        _not_told_to_hide(case, answer)


def _told_to_hide(case: Case, answer: Answer) -> None:
    weak, *strong = answer.rules
    for number in strong:
        is_one = case.then(number) == case.then(weak)
        require(is_one == (answer.code == "FT104"), "the classes are not so")
        beats = case.beats(case.asked(weak), [case.asked(number)])
        case.never(beats, f"rule {weak} is somewhere stronger than rule {number}")
        if answer.code == "FT105" and number > weak:
            raise UndecidedError("that it is always strictly weaker is not asked here")
    counted(answer, {"rules that subsume it": len(strong)}, answer.code == "FT104")
    counted(answer, {"rules that mask it": len(strong)}, answer.code == "FT105")


def _not_told_to_hide(case: Case, answer: Answer) -> None:
    is_alike = answer.code == "FT104"
    pairs = [pair for pair in case.pairs(alike=is_alike) if case.fire(*pair)]
    silent = sum(not case.fire(number) for number in case.numbers)
    counts = {"pairs": len(pairs), "pairs too near to tell": 0}
    counts["rules that never fire"] = silent
    counted(answer, counts, 3)
    told = {(a.rules[0], n) for a in case.coded(answer.code) for n in a.rules[1:]}
    for first, second in pairs:
        if (first, second) in told or (second, first) in told:
            continue
        one, other = case.asked(first), case.asked(second)
        require(case.beats(other, [one]), f"rule {second} hides behind {first}")
        if is_alike:
            require(case.beats(one, [other]), f"rule {first} hides behind {second}")


def _is_copy(answer: Answer) -> bool:
    """Return whether two rules are told to be at no distance of each other."""
    return any(measure.exact == "0" for measure in answer.measures)


def copied(case: Case, answer: Answer) -> None:
    """Ask whether one of two rules that are told to be alike is ever stronger."""
    if not answer.rules:
        pairs = case.pairs(alike=True) + case.pairs(alike=False)
        counted(answer, {"pairs": len(pairs)}, 1)
        text = "that no other two rules are nearly alike is not asked here"
        raise UndecidedError(text)
    first, second = answer.rules
    is_one = case.then(first) == case.then(second)
    graver = "error" if case.view is None else "info"
    severity = "warning" if is_one else graver
    require(answer.severity == severity, "the classes are not so")
    if not _is_copy(answer):
        raise UndecidedError("the distance of curves that differ is not measured here")
    one, other = case.asked(first), case.asked(second)
    if one != other:
        is_more = case.beats(one, [other]) or case.beats(other, [one])
        require(not is_more, "the two rules are not alike")


def apart(case: Case, answer: Answer) -> None:
    """Ask of each pair that is not told whether both rules can reach the level."""
    if case.rules.semantics.conjunction != "min":
        raise UndecidedError("conflicts under product are not decided again here")
    told = {one.rules for one in case.coded("FT201")}
    level, grid = Fraction(case.audit.settings.level), case.grid
    rest = [pair for pair in case.pairs(alike=False) if pair not in told]
    if case.view is not None:
        rest = [pair for pair in rest if case.view.may_conflict(*pair)]
    untold = next((m.value for m in answer.measures if "not told" in m.name), 0)
    require(answer.is_finding == (untold > 0), "a finding that is none")
    counted(answer, {"pairs that never do": len(rest) - untold}, 1)
    if untold:
        raise UndecidedError("which pairs are not told is not known")
    for one, other in rest:
        both = _union(case.asked(one), case.asked(other))
        if not grid.leaves(both, (), grid.gap(level, is_above=False)):
            continue
        is_met = level < 1 and grid.leaves(both, (), grid.gap(level, is_above=True))
        case.never(is_met, f"rules {one} and {other} reach the level together")
        raise UndecidedError(f"rules {one} and {other} touch the level")


def highest(case: Case, answer: Answer) -> None:
    """Ask whether two rules reach a level together above the one that is told.

    Raises:
        UndecidedError: If that cannot be told here.
    """
    if case.rules.semantics.conjunction != "min":
        raise UndecidedError("conflicts under product are not decided again here")
    tops = [one for one in answer.measures if one.name in LEVELS]
    require(len(tops) == 1 and len(answer.rules) == 2, "it tells no highest level")
    top, grid = end_of(tops[0]), case.grid
    both = _union(*map(case.asked, answer.rules))
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
        raise UndecidedError("two critical levels are too near to tell apart")


def needless(case: Case, answer: Answer) -> None:
    """Ask whether a rule without a clause is anywhere stronger than with it."""
    if not answer.rules:
        raise UndecidedError("which other clauses matter is not known")
    require(len(answer.rules) == 1, "it is of no rule")
    if not answer.terms:
        require(not answer.is_finding, "it is of no clause of the rule")
        require(not case.fire(*answer.rules), "the rule fires somewhere")
        return
    rest, number = case.grid.asked(_without(case, answer)), answer.rules[0]
    if case.beats(rest, [case.asked(number)]):
        _decides_alike(case, number, rest)


def _decides_alike(case: Case, number: int, rest: Asked) -> None:
    """Ask whether a rule that becomes stronger decides what was decided otherwise.

    It does if it wins where a rule of another class was above all of its own class; or
    where no rule fired; or it may if it ties with a later rule of another class.
    """
    grid, then = case.grid, case.then(number)
    own = [case.asked(n) for n in case.numbers if case.then(n) == then]
    others = [n for n in case.numbers if case.then(n) != then]
    is_more = any(
        case.beats(_union(rest, case.asked(n)), own)
        or (n > number and case.ties.tie(rest, case.asked(n), own))
        for n in others
    )
    if case.rules.semantics.uncovered != then:
        is_more |= grid.leaves(rest, grid.of, grid.gap(ZERO, is_above=True))
    if is_more:
        raise UndecidedError("the rule is stronger without it, if not in its answers")


def _union(one: Asked, other: Asked) -> Asked:
    """Return what two rules ask together."""
    return tuple(a | b for a, b in zip(one, other, strict=True))


def _without(case: Case, answer: Answer) -> tuple[Clause, ...]:
    """Return a rule's clauses without the one that an answer is about."""
    when = case.rules.rules[answer.rules[0] - 1].when
    asked = {c: tuple(Label(c.variable, term) for term in c.terms) for c in when}
    found = {clause for clause, labels in asked.items() if labels == answer.terms}
    if len(found) > 1:  # one of them is negated: only the subject says which
        found = {c for c in found if answer.subject.endswith(repr(_text(c)))}
    require(len(found) == 1, "it is of no clause of the rule")
    place = when.index(found.pop())
    return (*when[:place], *when[place + 1 :])


def _text(clause: Clause) -> str:
    verb = "is not" if clause.negated else "is"
    return f"{clause.variable} {verb} {' or '.join(clause.terms)}"


def shows_need(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that the answer at the witness is another one without the clause."""
    rest, point = _without(case, answer), point_of(state.point)
    every, place = list(case.rules.rules), answer.rules[0] - 1
    every[place] = every[place]._replace(when=rest)
    other = answer_of(case.rules._replace(rules=tuple(every)), point)
    is_other = other != answer_of(case.rules, point) and not answer.is_finding
    require(is_other, "the clause does not matter there")


def shows_conflict(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that two rules of two classes are claimed to reach the level together."""
    level = Fraction(case.audit.settings.level)
    met = [c for c in state.claims if c.kind == "reaches" and c.rules == answer.rules]
    is_high = any(fraction(claim.level or "0") >= level for claim in met)
    is_found = is_high and answer.is_finding
    require(is_found, "it is not claimed that both reach the level")
    case.differ(answer.rules)
    if case.rules.semantics.conjunction == "min":
        highest(case, answer)

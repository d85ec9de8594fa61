"""Every message that can be PROVED, decided again."""

from __future__ import annotations

import functools
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

from fuzzytree.rechecking import boxes
from fuzzytree.rechecking.case import STEPS, Case
from fuzzytree.rechecking.cells import (
    Axis,
    Cell,
    Cells,
    Interval,
    numbers_in,
)
from fuzzytree.rechecking.curves import bounds, is_straight, knots
from fuzzytree.rechecking.models import (
    ONE,
    ZERO,
    Curve,
    Proposition,
    Rule,
    Rules,
    Variable,
)
from fuzzytree.rechecking.outcomes import UndecidedError, require
from fuzzytree.rechecking.records import Answer, fraction

NEARLY = Fraction(1, 10**6)
SHALLOW, TRACE = Fraction(1, 100), Fraction(1, 10**12)
ROUNDED, ULP = Fraction(1, 10**9), Fraction(1, 2**53)
"""How far a measure may be from what is worked out here."""


def near(value: float, low: Fraction, high: Fraction, what: str) -> None:
    """Refuse a number outside of what is worked out here, but for its rounding."""
    slack = ROUNDED * max(ONE, abs(low))
    require(low - slack <= value <= high + slack, f"{what} is {float(low):.6g}")


def counted(answer: Answer, **counts: float) -> None:
    """Refuse an answer whose measures are other counts than these."""
    for name, count in counts.items():
        name = name.replace("_", " ")
        require(answer.measure(name) == count, f"{name}: {count:g} are counted here")


# --- rules that win, fire or tie nowhere: FT101, FT103, FT202, FT204


def never_wins(case: Case, answer: Answer) -> None:
    """Check that a rule is nowhere stronger than those of other classes."""
    (number,) = answer.rules
    rivals = case.rivals(number)
    require(not case.beats([number], rivals), "the rule wins somewhere")
    if answer.message == "FT101.never-wins":
        later = [n for n in rivals if n > number]
        is_tie = any(case.tie(number, n, rivals) for n in later)
        require(not is_tie or any(n < number for n in rivals), "its place decides")
        if is_tie:
            raise UndecidedError("where it ties, an earlier rule of another class may")


def never_fires(case: Case, answer: Answer) -> None:
    """Check that a rule is 0 everywhere."""
    require(not case.beats(answer.rules, ()), "the rule fires somewhere")


def silent(case: Case, answer: Answer) -> None:
    """Check that a rule of a system never fires, as its text says."""
    require(answer.subject in case.model.silent, "its text lets it fire")


def ways_to(
    case: Case, number: int, variable: Variable
) -> list[tuple[Fraction, Fraction, bool]]:
    """Return the intervals of a variable that lead to a leaf; True is an open start."""
    low, high = case.ends(variable)
    met = [(low, high, False)]
    for node, place in case.model.paths[number - 1]:
        if node["ask"] == variable.name:
            cuts = [*map(Fraction, node["cuts"])]
            owners = zip(
                (None, *cuts), (*cuts, None), node["interval owners"], strict=True
            )
            mine = [(a, b) for a, b, owner in owners if owner == place + 1]
            met = [
                (
                    start if a is None else max(start, a),
                    end if b is None else min(end, b),
                    is_open if a is None or a < start else True,
                )
                for start, end, is_open in met
                for a, b in mine
            ]
    return [one for one in met if one[0] < one[1] or (one[0] == one[1] and not one[2])]


def live_leaves(case: Case) -> set[int]:
    """Return the leaves that values of each variable, taken alone, lead to."""
    variables = case.model.variables.values()
    return {n for n in case.numbers if all(ways_to(case, n, v) for v in variables)}


def dead_leaf(case: Case, answer: Answer) -> None:
    """Check that no values lead to a leaf."""
    if answer.rules[0] in live_leaves(case):
        require(not case.is_free, "the leaf is reached")
        raise UndecidedError("variables share inputs, which needs more than cells")


def reached_leaves(case: Case, answer: Answer) -> None:
    """Check that the findings are all leaves that are not reached."""
    live, dead = live_leaves(case), {one.rules[0] for one in case.coded("FT101.leaf-")}
    require(
        answer.facts["live"] == len(case.numbers) - len(dead),
        "other leaves are reached",
    )
    require(answer.facts["leaves"] == len(case.numbers), "there are other leaves")
    shown = {one.rules[0] for one in case.coded("FT205.region")}
    if not case.is_free and not live - dead <= shown:
        raise UndecidedError("variables share inputs, which needs more than cells")
    require({*case.numbers} - live <= dead, "leaves that are not reached are missing")


def superfluous(case: Case, answer: Answer) -> None:
    """Check that a rule is nowhere stronger than all, or first of the strongest."""
    (number,) = answer.rules
    others, rivals = [n for n in case.numbers if n != number], case.rivals(number)
    require(not case.beats([number], others), "it is stronger than all somewhere")
    later = [n for n in rivals if n > number]
    for other in (n for n in others if n not in rivals):
        # one that hides it, with no other class between the two
        if not any(n < other for n in later) and not case.beats([number], [other]):
            return
    is_tie = any(case.tie(number, n, others) for n in later)
    require(not is_tie, "it ties with a later rule, and its place decides")


def no_other_ties(case: Case, answer: Answer) -> None:
    """Check that no other pair of rules of two classes ties."""
    pairs, known = (
        case.pairs(alike=False),
        {one.rules for one in case.coded("FT202.tie")},
    )
    counted(answer, pairs=len(pairs), pairs_listed=len(known), pairs_left_open=0)
    if answer.measure("pairs that tie") != len(known):
        raise UndecidedError("which pairs are left out is not known")
    for pair in pairs:
        if pair not in known:
            text = f"rules {pair[0]} and {pair[1]} tie as the strongest"
            require(not case.tie(*pair, case.numbers), text)


def one_class(case: Case, answer: Answer) -> None:
    """Check that one class is decided everywhere."""
    label = answer.facts.get("then")
    own = case.own(label)
    others = [n for n in case.numbers if n not in own]
    is_other = any(case.beats([n], own) for n in others)
    if case.rules.uncovered != label:
        is_other |= case.refined(lambda cells: cells.is_bare())
    require(not is_other, "another class is decided somewhere")


# --- pairs of rules, and propositions: FT104 to FT107, FT201


def hidden(case: Case, answer: Answer) -> None:
    """Check that each of some rules is at least as strong as the first one."""
    weak, *strong = answer.rules
    is_alike = answer.code == "FT104"
    counted(
        answer, **{f"rules_that_{'subsume' if is_alike else 'mask'}_it": len(strong)}
    )
    for number in strong:
        require(
            (case.then(number) == case.then(weak)) is is_alike, "the classes are not so"
        )
        beats = case.beats([weak], [number])
        require(not beats, f"rule {weak} is somewhere stronger than rule {number}")
        if not is_alike and number > weak:
            is_tie = case.tie(weak, number, ())
            require(not is_tie, f"rule {weak} is somewhere as strong as rule {number}")
    is_before = is_alike or (strong[0] < weak) is (answer.message == "FT105.masked")
    require(is_before, "the order of the rules is another one")


def no_other_hidden(case: Case, answer: Answer) -> None:
    """Check that each rule of other pairs is somewhere the stronger one."""
    is_alike = answer.code == "FT104"
    fires = {n for n in case.numbers if case.beats([n], ())}
    pairs = [pair for pair in case.pairs(alike=is_alike) if {*pair} <= fires]
    silent_count = len(case.numbers) - len(fires)
    counted(
        answer,
        pairs=len(pairs),
        pairs_too_near_to_compare=0,
        rules_that_never_fire=silent_count,
    )
    listed = case.coded("FT104.sub") if is_alike else case.coded("FT105.")
    known = {(one.rules[0], n) for one in listed for n in one.rules[1:]}
    for pair in pairs:
        if pair not in known and pair[::-1] not in known:
            for first, second in (pair, pair[::-1]) if is_alike else (pair,):
                beats = case.beats([second], [first])
                require(beats, f"rule {second} hides behind {first}")


def distance(
    case: Case, one: int, other: int, step: int = 8, *, least: bool = False
) -> tuple[Fraction, Fraction]:
    """Return how far two rules' degrees are apart on one axis, and on all together.

    Lower bounds with `least`, else upper ones.
    """
    cells = case.cells(step)
    each, total = ZERO, ZERO
    for place, axis in enumerate(cells.axes):
        both = [numbers_in(cells.of[k - 1][place]) for k in (one, other)]
        gap = ZERO
        for cell in axis.cells if both[0] != both[1] else ():
            a, b = (
                [_whole(case, of, cell, lines) for lines in (cell.lower, cell.upper)]
                for of in both
            )
            for k in (0, 1):
                far = max(a[0][k] - b[1][k], b[0][k] - a[1][k])
                far = far if least else max(a[1][k] - b[0][k], b[1][k] - a[0][k])
                gap = max(gap, far)
            if least and gap > NEARLY:
                return gap, gap
        each, total = max(each, gap), total + gap
    return each, total if case.rules.is_product else each


def _whole(
    case: Case, numbers: Sequence[int], cell: Cell, lines: Sequence[Interval]
) -> Interval:
    """Return a rule's degree on an axis at both ends of a cell."""
    ends = [lines[n] for n in numbers]
    if not case.rules.is_product:
        p, q = (min((one[k] for one in ends), default=ONE) for k in (0, 1))
        return p, q
    if len(ends) > 1 and cell.low < cell.high and any(p != q for p, q in ends):
        raise UndecidedError("products of several degrees of one variable")
    p, q = (math.prod((one[k] for one in ends), start=ONE) for k in (0, 1))
    return p, q


def same(case: Case, answer: Answer) -> None:
    """Check that two rules have nearly the same antecedent."""
    each, whole = distance(case, *answer.rules)
    require(whole <= NEARLY, "the two antecedents differ")
    near(answer.measure("largest distance"), each, each, "their largest distance")
    is_one = case.then(answer.rules[0]) == case.then(answer.rules[1])
    kind = "contradiction" if case.model.form != "system" else "different"
    require(
        answer.message == f"FT106.{'same' if is_one else kind}",
        "the classes are not so",
    )


def no_others_same(case: Case, answer: Answer) -> None:
    """Check that the antecedents of all other pairs of rules differ."""
    pairs, known = (
        case.pairs(),
        {one.rules for one in case.coded("FT106.") if one.rules},
    )
    counted(answer, pairs=len(pairs))
    for pair in pairs:
        if pair in known:
            continue
        if all(
            distance(case, *pair, step, least=True)[1] <= NEARLY for step in STEPS[:2]
        ):
            is_same = distance(case, *pair)[1] <= NEARLY
            require(
                not is_same, f"rules {pair[0]} and {pair[1]} have the same antecedent"
            )
            raise UndecidedError("curves that are nearly equal")


def without(case: Case, answer: Answer) -> Rule:
    """Return the rule of an answer without the proposition that it is about."""
    rule = case.rules.rules[answer.rules[0] - 1]
    labels = [tuple(one) for one in answer.terms]
    for place, proposition in enumerate(rule.when):
        is_it = [(proposition.variable, term) for term in proposition.terms] == labels
        if is_it and answer.facts.get("proposition") == str(proposition):
            return rule._replace(when=(*rule.when[:place], *rule.when[place + 1 :]))
    require(False, "it is of no proposition of the rule")
    raise AssertionError


def irrelevant(case: Case, answer: Answer) -> None:
    """Check that a rule without a proposition decides no input that it did not decide.

    It does where it wins and a rule of another class was above all of its own class;
    or where no rule fired; it may where it ties with a later rule of another class.
    """
    rest = case.number_of(without(case, answer))
    (number,) = answer.rules
    own, rivals = case.own(case.then(number)), case.rivals(number)
    if not case.beats([rest], [number]):
        return
    later = [n for n in rivals if n > number]
    if any(case.tie(rest, n, case.numbers) for n in later):
        raise UndecidedError("the rule ties without it, and its place may decide")
    if not case.may(lambda: case.beats([rest], case.numbers)):
        return
    is_more = case.rules.uncovered != case.then(number) or any(
        case.beats([rest, n], own) for n in rivals
    )
    if is_more:
        raise UndecidedError("the rule is stronger without it, if not in its answers")


def apart(case: Case, answer: Answer) -> None:
    """Check that no pair without a finding reaches the level together."""
    level = Fraction(case.settings.level)
    listed = {one.rules for one in case.coded("FT201.") if one.rules}
    rest = [
        p
        for p in case.pairs(alike=False)
        if p not in listed and case.model.may_conflict(*p)
    ]
    omitted = answer.measure("pairs not listed")
    counted(answer, pairs_that_never_do=len(rest) - omitted)
    together, limits = [], 0
    for pair in rest:
        if case.rules.is_product:
            is_met = case.beats(pair, (), low=level)
        else:
            is_met = case.refined(functools.partial(_meet, pair, level))
            limits += is_met and _highest(pair, case.cells(STEPS[0])) == level
        together += [pair] if is_met else []
    if len(together) - limits <= omitted < len(together):
        raise UndecidedError("a level that degrees may reach only as a limit")
    text = f"{together[:3]} reach the level together" if together else "fewer do"
    require(len(together) == omitted, text)


def _meet(pair: tuple[int, int], level: Fraction, cells: Cells) -> bool:
    return _highest(pair, cells) >= level


def _highest(pair: tuple[int, int], cells: Cells) -> Fraction:
    return cells.highest(*(cells.of[n - 1] for n in pair))


def top(case: Case, answer: Answer) -> None:
    """Check the highest level that two rules reach together."""
    if case.rules.is_product:
        raise UndecidedError("the highest common level of products")
    cells = case.cells(STEPS[0])
    highest = cells.highest(*(cells.of[n - 1] for n in answer.rules))
    is_one = len(answer.measures) == 1 and cells.is_exact and case.is_free
    value = answer.measures[-1].value
    if is_one:
        near(value, highest - NEARLY, highest + NEARLY, "the highest common level")
        exact = fraction(answer.measures[0].exact or str(highest))
        is_near = abs(exact - highest) <= ULP  # a flank is that much below 1
        require(is_near, "the highest common level is another one")


# --- where no rule fires: FT301, FT203


def fires(case: Case, answer: Answer) -> None:
    """Check that some rule fires everywhere."""
    require(case.model.is_whole, "rules that are left out may fire")
    is_bare = case.refined(lambda cells: cells.is_bare())
    require(not is_bare, "there are points at which no rule fires")


def reaches(case: Case, answer: Answer) -> None:
    """Check that some rule reaches epsilon everywhere, and how little is least."""
    epsilon = Fraction(case.settings.epsilon)
    is_less = case.beats((), case.numbers, high=epsilon)
    require(not is_less, "there are points at which every rule is below epsilon")
    least_cover(case, answer)


def least_cover(case: Case, answer: Answer) -> None:
    """Check that the strength where it is least lies between the reported bounds."""
    low, high = (
        Fraction(answer.measure(f"strength where it is least, at {end}"))
        for end in ("least", "most")
    )
    require(0 <= low <= high <= 1, "no least strength")
    is_less = bool(low) and case.beats((), case.numbers, high=low)
    require(not is_less, "somewhere every rule is weaker than reported")
    if not case.rules.is_product and high < 1:
        cells = case.cells(STEPS[0])
        if cells.is_exact and case.is_free:
            text = "everywhere some rule is stronger than reported"
            require(cells.least_cover() <= high + ROUNDED, text)


def alike_leaves(case: Case, answer: Answer) -> None:
    """Check that the raw rules decide as the tree does in all other leaves."""
    listed = {one.rules[0] for one in case.coded("FT203.") if one.rules}
    live = live_leaves(case)
    count = len(case.numbers)
    require(answer.facts["leaves"] == count, "there are other leaves")
    require(answer.facts["alike"] == count - len(listed), "in other leaves")
    for number in sorted(live - listed):
        _alike(case, number)


def _alike(case: Case, number: int) -> None:
    raw, label = case.model.raw, case.model.leaves[number - 1]
    require(raw is not None, "there are no raw rules")
    assert raw is not None
    used = [
        v
        for v in case.model.variables.values()
        if any(v.name == node["ask"] for node, _ in case.model.paths[number - 1])
    ]
    ways = [[(a, b) for a, b, _ in ways_to(case, number, v)] for v in used]
    if math.prod(map(len, ways)) > 64:
        raise UndecidedError("a leaf of too many boxes")
    for way in itertools.product(*ways):
        ends = {v.name: case.ends(v) for v in raw.variables.values()}
        ends |= {v.name: one for v, one in zip(used, way, strict=True)}
        own = [n for n, rule in enumerate(raw.rules) if rule.then == label]
        for step in STEPS:
            cells = Cells(raw.rules, raw.variables, ends, (), step, case.limit)
            if not _may_differ(cells, raw, own, label):
                break
        else:
            raise UndecidedError("curves that are no lines, and too near to each other")


def _may_differ(cells: Cells, raw: Rules, own: list[int], label: str) -> bool:
    if raw.uncovered != label and cells.is_bare():
        return True
    others = [n for n in range(len(raw.rules)) if n not in own]
    if raw.is_product:
        return any(
            boxes.exists(cells, [cells.of[n]], [cells.of[m] for m in own])
            for n in others
        )
    return any(cells.exists([cells.of[n]], sum(1 << m for m in own)) for n in others)


# --- terms, and their use: FT401 to FT404, FT501


def plain_terms(case: Case) -> list[tuple[Variable, str, Curve]]:
    """Return the terms whose curves are compared with each other."""
    aside = {tuple(t) for one in case.coded("FTD.") for t in one.terms}
    return [
        (v, term, curve)
        for v in case.model.variables.values()
        for term, curve in v.curves.items()
        if (v.name, term) not in aside
    ]


def axis_of(
    case: Case, variable: Variable, terms: Iterable[str], step: int = 32
) -> Axis:
    """Return the cells of a variable with some of its terms."""
    propositions = [Proposition(variable.name, (term,)) for term in terms]
    return Axis(variable, case.ends(variable), propositions, step, case.limit)


def height(case: Case, variable: Variable, term: str) -> Interval:
    """Return between which numbers the largest degree of a term in the domain lies."""
    curve, (low, high) = variable.curves[term], case.ends(variable)
    ends = [x for x in (low, *knots(curve), high) if low <= x <= high]
    best = max(bounds(curve, x, x)[0] for x in ends)
    if best == curve.height:
        return best, best
    axis = axis_of(case, variable, [term])
    most = max(max(cell.upper[0]) for cell in axis.cells)
    return (most if is_straight(curve) else best), most


def heights(case: Case, answer: Answer) -> None:
    """Check that the findings are the terms that do not reach the level."""
    level = Fraction(case.settings.level)
    listed = {tuple(one.terms[0]) for one in case.coded("FT401.") if one.terms}
    every = {
        (v.name, t): v
        for v in case.model.variables.values()
        for t, c in v.curves.items()
        if c.kind != "formula"
    }
    rest = [height(case, v, key[1]) for key, v in every.items() if key not in listed]
    require(answer.facts["count"] == len(rest), "other terms reach it")
    if any(low < level <= high for low, high in rest):
        raise UndecidedError("a height too near to the level")
    require(all(low >= level for low, _ in rest), "a term does not reach the level")
    least = min(low for low, _ in rest) - SHALLOW, min(high for _, high in rest)
    if all(is_straight(v.curves[key[1]]) for key, v in every.items()):
        least = least[1], least[1]
    near(answer.measure("lowest height"), *least, "the lowest height")


def low_term(case: Case, answer: Answer) -> None:
    """Check the height of a term that does not reach the level."""
    variable = case.model.variables[answer.terms[0].variable]
    low, high = height(case, variable, answer.terms[0].term)
    require(high < Fraction(case.settings.level), "the term reaches the level")
    is_empty = answer.message == "FT401.empty"
    require(not low if is_empty else bool(high), "it is empty, or is not")
    if is_empty and high:
        raise UndecidedError("a curve that may be a little above 0")
    near(answer.measure("height"), low, high, "the height")
    require(
        answer.facts["low"] == float(case.ends(variable)[0]), "the range is another one"
    )
    require(
        answer.facts["high"] == float(case.ends(variable)[1]),
        "the range is another one",
    )


def shape_defects(case: Case, variable: Variable, term: str) -> tuple[set[str], int]:
    """Return the kinds of defects of a term's shape, and how many small ones it has."""
    curve = variable.curves[term]
    if not is_straight(curve):
        raise UndecidedError("the turning points of curves that are no lines")
    axis, result = axis_of(case, variable, [term]), set[str]()
    walk = [y for cell in axis.cells for y in cell.lower[0]]
    deep, every = (_dips(walk, least) for least in (SHALLOW, TRACE))
    result |= {"peaks"} if deep else set()
    if largest(curve) < 1:
        result.add("subnormal")
    share = _share(case, variable, term)
    result |= {"outside"} if share is not None and 0 < share < Fraction(1, 2) else set()
    return result, every - deep


def largest(curve: Curve) -> Fraction:
    """Return the largest degree of a straight curve anywhere."""
    top = max(curve.numbers[1]) if curve.kind == "points" else 1
    return Fraction(top) * curve.height


def _dips(walk: list[Fraction], least: Fraction) -> int:
    """Return how often values fall by so much and rise by so much again."""
    count, high, low = 0, walk[0], walk[0]
    for y in walk:
        if high - low >= least and y - low >= least:
            count, high, low = count + 1, y, y
        if y > high and high - low < least:
            high = low = y
        low = min(low, y)
    return count


def _share(case: Case, variable: Variable, term: str) -> Fraction | None:
    """Return the share of a curve's area that is in the domain; None without an end."""
    curve, (low, high) = variable.curves[term], case.ends(variable)
    ends = knots(curve)
    if low == high or not ends or ends[0] == ends[-1]:
        return None
    if any(bounds(curve, x, x)[1] for x in (ends[0] - 1, ends[-1] + 1)):
        return None
    parts = []
    for a, b in ((max(low, ends[0]), min(high, ends[-1])), (ends[0], ends[-1])):
        proposition = Proposition(variable.name, (term,))
        axis = Axis(variable, (a, b), [proposition], 1, case.limit)
        areas = ((c.high - c.low) * sum(c.lower[0]) / 2 for c in axis.cells)
        parts.append(sum(areas, start=ZERO) if a < b else ZERO)
    return parts[0] / parts[1] if parts[1] else None


def well_shaped(case: Case, answer: Answer) -> None:
    """Check that the findings are all defects of shape."""
    listed = {
        (*one.terms[0], one.message[6:]) for one in case.coded("FT402.") if one.terms
    }
    found, small, sound = set[tuple[str, str, str]](), 0, 0
    for variable, term, _ in plain_terms(case):
        kinds, shallow = shape_defects(case, variable, term)
        found |= {(variable.name, term, kind) for kind in kinds}
        small, sound = small + shallow, sound + (not kinds)
    require(listed == found, "other terms have defects of shape")
    require(answer.facts["count"] == sound, "other terms are well shaped")
    counted(answer, smaller_excesses_and_dips=small)


def defect(case: Case, answer: Answer) -> None:
    """Check a defect of a term's shape."""
    name, term = answer.terms[0]
    variable, kind = case.model.variables[name], answer.message[6:]
    require(
        kind in shape_defects(case, variable, term)[0], "the term has no such defect"
    )
    curve = variable.curves[term]
    if kind == "subnormal":
        most = largest(curve)
        near(answer.measure("largest degree"), most, most, "the largest degree")
    if kind == "outside":
        share = _share(case, variable, term) or ZERO
        near(
            answer.measure("share of its area on the domain"), share, share, "the share"
        )
    if kind == "peaks":
        walk = [
            y for cell in axis_of(case, variable, [term]).cells for y in cell.lower[0]
        ]
        counted(answer, peaks=_dips(walk, SHALLOW) + 1)


@functools.lru_cache(maxsize=1)
def shared_areas(case: Case) -> dict[tuple[tuple[str, str], ...], Interval | None]:
    """Return the shared area of each pair of terms of a variable; None without area."""
    result: dict[tuple[tuple[str, str], ...], Interval | None] = {}
    for (v, one, _), (w, other, _) in itertools.combinations(plain_terms(case), 2):
        if v.name != w.name:
            continue
        axis, sums = axis_of(case, v, [one, other]), [ZERO] * 4
        for cell in axis.cells:  # of equal terms one line
            width = (cell.high - cell.low) / 2
            areas = [
                width * sum(choose(lines, key=sum))
                for lines in (cell.lower, cell.upper)
                for choose in (min, max)
            ]
            sums = [s + x for s, x in zip(sums, areas, strict=True)]
        least, joined, most, joined_most = sums
        share = None
        if joined_most:
            share = least / joined_most, min(most / joined, ONE) if joined else ONE
        result[(v.name, one), (w.name, other)] = share
    return result


def overlaps(case: Case, answer: Answer) -> None:
    """Check that the findings are the pairs of terms that share so much area."""
    limit, shares = Fraction(case.settings.overlap), shared_areas(case)
    listed = {tuple(map(tuple, one.terms)) for one in case.coded("FT403.") if one.terms}
    known = {key: one for key, one in shares.items() if one is not None}
    rest = [one for key, one in known.items() if key not in listed]
    if any(low < limit <= high + ROUNDED for low, high in rest):
        raise UndecidedError("a shared area too near to the limit")
    near_ones = {key for key, (low, _) in known.items() if low >= limit} | listed
    counted(
        answer,
        pairs_apart=len(known) - len(near_ones),
        pairs_not_listed=len(near_ones) - len(listed),
        pairs_without_area=len(shares) - len(known),
    )


def overlap(case: Case, answer: Answer) -> None:
    """Check the share of their area that two terms have in common."""
    share = shared_areas(case)[tuple((name, term) for name, term in answer.terms)]
    limit = Fraction(case.settings.overlap)
    require(
        share is not None and share[1] + ROUNDED >= limit,
        "they are easy to distinguish",
    )
    assert share is not None
    near(answer.measure("shared area by joined area"), *share, "their share")
    if share[0] < limit:
        raise UndecidedError("a shared area too near to the limit")


def unused(case: Case, answer: Answer) -> None:
    """Check that the findings are the terms and variables that no rule uses."""
    model, used = case.model, case.model.asked
    needed = {variable for variable, _ in used}
    for variable in model.variables.values():
        if variable.name in needed:
            needed |= {name for name, *_ in variable.parts}
    idle = [f"variable {name!r}" for name in model.variables if name not in needed]
    rest = [pair for pair in model.labels if pair[0] in needed and pair not in used]
    idle += [f"term {term!r} of {name!r}" for name, term in rest]
    listed = [one.subject for one in case.coded("FT404.unused")]
    require(listed == idle, "other terms or variables are unused")
    if answer.message == "FT404.used":
        counts = needed.intersection(model.variables), used.intersection(model.labels)
        counted(answer, variables_in_use=len(counts[0]), terms_in_use=len(counts[1]))


def size(case: Case, answer: Answer) -> None:
    """Check the counts of rules, propositions and terms, and the index of Nauck."""
    rules = case.rules.rules
    lengths = case.model.lengths
    propositions = [[c for c in rule.when if any(c.terms)] for rule in rules]
    used = {(c.variable, t) for when in propositions for c in when for t in c.terms}
    counted(
        answer,
        rules=len(lengths),
        propositions=sum(lengths),
        most_propositions_of_a_rule=max(lengths),
        propositions_per_rule=sum(lengths) / len(lengths),
        distinct_terms_in_use=len(used),
        variables_in_use=len({variable for variable, _ in used}),
    )
    if case.model.form == "tree":
        counted(answer, depth_of_the_tree=max(map(len, case.model.paths)))
    if not any(one.name == "index of Nauck" for one in answer.measures):
        return
    names = {variable for variable, _ in used}
    terms = Counter(v.name for v, *_ in plain_terms(case))
    shares = [Fraction(1, max(terms[name] - 1, 1)) for name in names]
    complexity = Fraction(
        case.model.class_count, sum(len({c.variable for c in w}) for w in propositions)
    )
    whole = complexity * sum(shares, start=ZERO) / len(shares)
    factors = [answer.measure(f"{one} of Nauck") for one in ("complexity", "coverage")]
    near(factors[0], complexity, complexity, "complexity")
    # how well terms cover their range is not integrated again
    product = whole * Fraction(factors[1])
    near(answer.measure("index of Nauck"), product, product, "the index")
    partition = whole / complexity
    near(answer.measure("partition of Nauck"), partition, partition, "partition")


PROOFS: dict[str, Callable[[Case, Answer], None]] = {
    "FT101.never-wins": never_wins,
    "FT101.may-decide-by-place": never_wins,
    "FT101.never-fires": never_fires,
    "FT101.weight-0": silent,
    "FT101.never-true": silent,
    "FT101.leaves": reached_leaves,
    "FT101.leaf-excluded": dead_leaf,
    "FT101.leaf-outside": dead_leaf,
    "FT101.leaf-unmet": dead_leaf,
    "FT103.superfluous": superfluous,
    "FT104.subsumed": hidden,
    "FT104.others": no_other_hidden,
    "FT105.masked": hidden,
    "FT105.weaker": hidden,
    "FT105.others": no_other_hidden,
    "FT106.same": same,
    "FT106.contradiction": same,
    "FT106.different": same,
    "FT106.others": no_others_same,
    "FT107.irrelevant": irrelevant,
    "FT107.silent": never_fires,
    "FT201.never": apart,
    "FT201.unlisted": apart,
    "FT202.others": no_other_ties,
    "FT203.leaves": alike_leaves,
    "FT204.alike": one_class,
    "FT301.fires": fires,
    "FT301.reaches": reaches,
    "FT401.reached": heights,
    "FT401.low": low_term,
    "FT401.empty": low_term,
    "FT402.sound": well_shaped,
    "FT402.subnormal": defect,
    "FT402.outside": defect,
    "FT402.peaks": defect,
    "FT403.equal": overlap,
    "FT403.within": overlap,
    "FT403.similar": overlap,
    "FT403.others": overlaps,
    "FT403.unlisted": overlaps,
    "FT404.unused": unused,
    "FT404.used": unused,
    "FT501.size": size,
    "FT501.size-of-view": size,
}
"""How each message that can be PROVED is decided again."""

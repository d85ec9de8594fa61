"""What a PROVED answer says of all of the domain, as claims that a solver decides.

A claim is written from an answer's message, rules, facts and measures, never from its
sentence. Most are asserted as their contrary, and `unsat` proves them; a claim that
something exists is asserted as it is, unless a known point shows it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.curves import ZERO, Curve, bounds, is_straight, knots
from fuzzytree.rechecking.models import Rule, Variable
from fuzzytree.rechecking.outcomes import UndecidedError, require
from fuzzytree.rechecking.records import Answer, Proved
from fuzzytree.rechecking.smt import all_of, any_of

NEARLY = Fraction(1, 10**6)
_ROUNDED = Fraction(1, 10**9)
_MOST = 5000
"""The most claims of an answer."""


class Statement(NamedTuple):
    """A claim for a solver.

    Attributes:
        text: What is claimed.
        formula: What is asserted.
        expected: The answer that proves the claim.
        is_sure: Whether the other answer refutes it; else it touches only, or more is
            claimed than the audit says.
    """

    text: str
    formula: str
    expected: str = "unsat"
    is_sure: bool = True


Statements = Iterator[Statement]


def statements(case: Case, answer: Answer) -> list[Statement]:
    """Return the claims of an answer; none if reading the model decides it.

    Raises:
        DoesNotHoldError: If the answer is not so.
        UndecidedError: If no solver of lines and polynomials can decide it.
    """
    if answer.message not in CLAIMS:
        raise UndecidedError("no solver of lines and polynomials is asked for it")
    every = CLAIMS[answer.message](case, answer)
    result = [*itertools.islice(every, _MOST + 1)]
    if len(result) > _MOST:
        raise UndecidedError(f"more than {_MOST:,} claims")
    return result


def _over(case: Case, number: int, rivals: Iterable[int], sign: str = ">") -> list[str]:
    """Return that a rule fires, and is above rivals."""
    own = case.symbol(number)
    return [f"(> {own} 0.0)", *(f"({sign} {own} {case.symbol(n)})" for n in rivals)]


def _rivals(case: Case, answer: Answer, every: list[int]) -> list[int]:
    """Return the rivals that suffice for a proof; all if it names none."""
    named = answer.state.rivals if isinstance(answer.state, Proved) else ()
    require({*named} <= {*every}, "a rival that is none")
    return [*named] or every


def _names(case: Case, numbers: Iterable[int]) -> str:
    return ", ".join(map(case.name, numbers))


# --- rules that win, lead, fire, or are needed


def never_wins(case: Case, answer: Answer) -> Statements:
    """Claim that rivals are nowhere weaker than a rule."""
    (number,) = answer.rules
    others = case.rivals(number)
    if answer.code == "FT103":
        others = [n for n in case.numbers if n != number]
    rivals = _rivals(case, answer, others)
    text = f"{case.name(number)} is nowhere stronger than {_names(case, rivals)}"
    yield Statement(text, all_of(_over(case, number, rivals)))


def never_fires(case: Case, answer: Answer) -> Statements:
    """Claim that a rule is 0 everywhere, in each of its ways."""
    of = case.model.numbers
    for number in case.numbers:
        if of[number - 1] == of[answer.rules[0] - 1]:
            text = f"{case.name(number)} never fires"
            yield Statement(text, case.reaches(number, ">", ZERO))


def silent(case: Case, answer: Answer) -> Statements:
    """Check that a rule of a system never fires, as its text says."""
    require(answer.subject in case.model.silent, "its text lets it fire")
    yield from ()


def no_lead(case: Case, answer: Answer) -> Statements:
    """Claim that a rule leads nowhere by as much as the largest lead, at most."""
    (number,) = answer.rules
    lead = Fraction(answer.measure("largest lead, at most")) + _ROUNDED
    own, rivals = case.symbol(number), case.rivals(number)
    text = f"{case.name(number)} leads nowhere by {float(lead):g}"
    by = case.script.number(lead)
    over = [f"(> {own} (+ {by} {case.symbol(n)}))" for n in rivals]
    yield Statement(text, all_of([f"(> {own} {by})", *over]))


def path_to(case: Case, number: int) -> str:
    """Return that the nodes of a tree lead to a leaf."""
    formulas = []
    for node, place in case.model.paths[number - 1]:
        own = case.script.value(case.model.variables[node["ask"]])
        cuts = [case.script.number(Fraction(cut)) for cut in node["cuts"]]
        ends = zip(["", *cuts], [*cuts, ""], node["interval owners"], strict=True)
        ways = (
            all_of(
                ([f"(> {own} {low})"] if low else [])
                + ([f"(<= {own} {high})"] if high else [])
            )
            for low, high, owner in ends
            if owner == place + 1
        )
        formulas.append(any_of(ways))
    return all_of(formulas)


def dead_leaf(case: Case, answer: Answer) -> Statements:
    """Claim that no values lead to a leaf."""
    (number,) = answer.rules
    yield Statement(f"nothing leads to leaf {number}", path_to(case, number))


def reached_leaves(case: Case, answer: Answer) -> Statements:
    """Claim that values lead to each leaf without a finding."""
    dead = {one.rules[0] for one in case.coded("FT101.leaf-")}
    count = len(case.numbers)
    is_so = (answer.facts["live"], answer.facts["leaves"]) == (count - len(dead), count)
    require(is_so, "other leaves are reached")
    seen = {case.model.leaf_at(point) for point, _ in case.known}
    for number in case.numbers:
        if number not in dead | seen:
            yield Statement(
                f"values lead to leaf {number}", path_to(case, number), "sat"
            )


def one_class(case: Case, answer: Answer) -> Statements:
    """Claim that one class is decided everywhere, apart from exact ties."""
    label = answer.facts.get("then")
    own = case.own(str(label)) if label is not None else []
    others = (all_of(_over(case, n, own)) for n in case.numbers if n not in own)
    yield Statement(f"no class is decided but {label!r}", any_of(others))
    if case.rules.uncovered != label:
        yield _no_gap(case)


# --- pairs of rules, and propositions


def hidden(case: Case, answer: Answer) -> Statements:
    """Claim that some rules are nowhere weaker than the first one."""
    weak, *strong = answer.rules
    is_alike = answer.code == "FT104"
    count = answer.measure(f"rules that {'subsume' if is_alike else 'mask'} it")
    require(count == len(strong), "their number is another one")
    for number in strong:
        is_one = case.then(number) == case.then(weak)
        require(is_one is is_alike, "the classes are not so")
        text = f"{case.name(weak)} is nowhere stronger than {case.name(number)}"
        yield Statement(text, all_of(_over(case, weak, [number])))
    is_before = is_alike or (strong[0] < weak) is (answer.message == "FT105.masked")
    require(is_before, "the order of the rules is another one")


def no_other_hidden(case: Case, answer: Answer) -> Statements:
    """Claim that each rule of other pairs is somewhere the stronger one."""
    is_alike, fires = answer.code == "FT104", case.above[0]
    pairs = [pair for pair in case.pairs(alike=is_alike) if {*pair} <= fires]
    counts = answer.measure("pairs"), answer.measure("rules that never fire")
    if counts != (len(pairs), len(case.numbers) - len(fires)):
        raise UndecidedError("rules that fire only where no point is known")
    listed = case.coded("FT104.sub") if is_alike else case.coded("FT105.")
    known = {(one.rules[0], n) for one in listed for n in one.rules[1:]}
    for pair in pairs:
        if pair in known or pair[::-1] in known:
            continue
        for first, second in (pair, pair[::-1]) if is_alike else (pair,):
            if second not in case.above[first]:
                text = f"{case.name(second)} is somewhere above {case.name(first)}"
                yield Statement(text, all_of(_over(case, second, [first])), "sat")


def _apart(case: Case, one: int, other: int) -> str:
    """Return that the degrees of two rules differ on some axis."""
    both = [
        case.script.on_axes(case.rules.rules[n - 1], case.rules) for n in (one, other)
    ]
    off, formulas = case.script.number(NEARLY), []
    for name in dict.fromkeys([*both[0], *both[1]]):
        a, b = (of.get(name, "1.0") for of in both)
        if a != b:
            formulas += [f"(> {a} (+ {b} {off}))", f"(> {b} (+ {a} {off}))"]
    return any_of(formulas)


def same(case: Case, answer: Answer) -> Statements:
    """Claim that two rules have nearly the same antecedent."""
    is_one = case.then(answer.rules[0]) == case.then(answer.rules[1])
    kind = "contradiction" if case.model.form != "system" else "different"
    wanted = f"FT106.{'same' if is_one else kind}"
    require(answer.message == wanted, "the classes are not so")
    text = f"the degrees of {_names(case, answer.rules)} differ nowhere by 1e-6"
    yield Statement(text, _apart(case, *answer.rules))


def no_others_same(case: Case, answer: Answer) -> Statements:
    """Claim that the antecedents of all other pairs differ."""
    pairs = case.pairs()
    require(answer.measure("pairs") == len(pairs), f"there are {len(pairs)} pairs")
    rest = {*pairs} - {one.rules for one in case.coded("FT106.")}
    off = len(case.model.variables) * NEARLY if case.rules.is_product else NEARLY
    for _, every in case.known:
        rest = {
            (one, other)
            for one, other in rest
            if every[one - 1][0] <= every[other - 1][1] + off
            and every[other - 1][0] <= every[one - 1][1] + off
        }
    for one, other in sorted(rest):
        text = f"{case.name(one)} and {case.name(other)} differ somewhere"
        formula, is_sure = _apart(case, one, other), not case.rules.is_product
        yield Statement(text, formula, "sat", is_sure)


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


def irrelevant(case: Case, answer: Answer) -> Statements:
    """Claim that a rule without a proposition takes no input from another class.

    First apart from exact ties; then also where rules tie.
    """
    (number,) = answer.rules
    name = f"{case.name(number)} without {answer.facts['proposition']}"
    rest = case.script.add_rule(name, without(case, answer), case.rules)
    own, rivals = case.own(case.then(number)), case.rivals(number)
    bare = [f"(<= {case.symbol(n)} 0.0)" for n in case.numbers]
    is_covered = case.rules.uncovered == case.then(number)
    for is_strict in (True, False):
        over = [f"(> {rest} 0.0)"]
        for n in rivals:
            sign = ">" if is_strict or n < number else ">="
            over.append(f"({sign} {rest} {case.symbol(n)})")
        other = [
            all_of(
                f"({'>' if is_strict or k < n else '>='} {case.symbol(n)} "
                f"{case.symbol(k)})"
                for k in own
            )
            for n in rivals
        ]
        fires = any_of(f"(> {case.symbol(n)} 0.0)" for n in rivals)
        ways = [all_of([fires, any_of(other)])] + [all_of(bare)] * (not is_covered)
        text = f"{name} decides the same"
        if is_strict:
            text += ", apart from exact ties"
        yield Statement(text, all_of([*over, any_of(ways)]), is_sure=is_strict)


def apart(case: Case, answer: Answer) -> Statements:
    """Claim that no pair without a finding reaches the level together."""
    level = Fraction(case.settings.level)
    listed = {one.rules for one in case.coded("FT201.") if one.rules}
    rest = conflicting_pairs(case) - listed
    omitted, clean = (
        answer.measure(f"pairs {which}") for which in ("not listed", "that never do")
    )
    require(clean == len(rest) - omitted, "their number is another one")
    if omitted:
        points = [strengths for _, strengths in case.known]
        meet = {
            (a, b)
            for a, b in rest
            if any(min(s[a - 1][0], s[b - 1][0]) >= level for s in points)
        }
        if len(meet) < omitted:
            raise UndecidedError("which pairs are left out is not known")
        rest -= meet
        omitted -= len(meet)
    require(omitted >= 0, "more pairs reach the level together")
    for pair in sorted(rest):
        formula = all_of(case.reaches(n, ">=", level) for n in pair)
        text = f"{_names(case, pair)} never reach {float(level):g} together"
        yield Statement(text, formula)


def no_higher(case: Case, answer: Answer) -> Statements:
    """Claim that two rules reach no higher level together than the reported one."""
    high = Fraction(answer.measures[-1].value) + _ROUNDED
    text = f"{_names(case, answer.rules)} reach no more than {float(high):g} together"
    yield Statement(text, all_of(case.reaches(n, ">", high) for n in answer.rules))


def ties(case: Case, answer: Answer) -> Statements:
    """Check the number of pairs that tie; that others do not is not decided."""
    listed = len(case.coded("FT202.tie"))
    _count(answer, pairs=len(case.pairs(alike=False)), pairs_listed=listed)
    raise UndecidedError("ties on more than a surface")
    yield


def conflicting_pairs(case: Case) -> set[tuple[int, int]]:
    """Return the pairs of rules that say different things of one output."""
    pairs = case.pairs(alike=False)
    return {pair for pair in pairs if case.model.may_conflict(*pair)}


# --- where no rule fires


def _no_gap(case: Case, beside: Iterable[str] = ()) -> Statement:
    """Claim that some rule fires everywhere, but on surfaces."""
    points = frozenset(
        name
        for name, side in case.sides.items()
        if side.low == side.high or case.model.variables[name].categories
    )
    zeros = (case.script.zero(rule, case.rules, points) for rule in case.rules.rules)
    text = "some rule fires everywhere" + (" but in the gaps listed" if beside else "")
    return Statement(text, all_of([*zeros, *beside]))


def fires(case: Case, answer: Answer) -> Statements:
    """Claim that some rule fires everywhere."""
    require(case.model.is_whole, "rules that are left out may fire")
    yield _no_gap(case)


def covers(case: Case, answer: Answer) -> Statements:
    """Claim that some rule is everywhere as strong as where it is least, at least."""
    low = Fraction(answer.measure("strength where it is least, at least"))
    levels = {low} if case.script.is_exact else set()
    if answer.message == "FT301.reaches":
        levels.add(Fraction(case.settings.epsilon))
    for level in levels - {ZERO}:
        text = f"some rule reaches {float(level):g} everywhere"
        least = case.script.number(level)
        weak = (f"(< {case.symbol(n)} {least})" for n in case.numbers)
        yield Statement(text, all_of(weak))


def no_more_gaps(case: Case, gaps: list[Answer]) -> Statement:
    """Claim that no rule-free part of the domain lies outside of the listed gaps."""
    beside = []
    for gap in gaps:
        sides = []
        for span in gap.region:
            own = case.script.value(case.model.variables[span.variable])
            if span.low is not None:
                low = Fraction(math.nextafter(span.low, -math.inf))
                sides.append(f"(< {own} {case.script.number(low)})")
            if span.high is not None:
                high = Fraction(math.nextafter(span.high, math.inf))
                sides.append(f"(> {own} {case.script.number(high)})")
        beside.append(any_of(sides))
    return _no_gap(case, beside)


# --- terms


def low_term(case: Case, answer: Answer) -> Statements:
    """Claim that a term is nowhere above the reported height, and below the level."""
    variable, term = (
        case.model.variables[answer.terms[0].variable],
        answer.terms[0].term,
    )
    height, level = answer.measure("height"), Fraction(case.settings.level)
    is_empty = answer.message == "FT401.empty"
    require(is_empty is (not height), "it is empty, or is not")
    low, high = case.ends(variable)
    ends = answer.facts["low"], answer.facts["high"]
    require(ends == (float(low), float(high)), "the range is another one")
    most = case.script.number(Fraction(height) + (_ROUNDED if height else 0))
    degree = case.script.degree(variable, term)
    text = (
        f"{variable.name} is {term} is nowhere above {height:g}, nor {float(level):g}"
    )
    over = [f"(> {degree} {most})", f"(>= {degree} {case.script.number(level)})"]
    yield Statement(text, any_of(over))


def heights(case: Case, answer: Answer) -> Statements:
    """Claim that all terms without a finding reach the level."""
    level = Fraction(case.settings.level)
    listed = {tuple(one.terms[0]) for one in case.coded("FT401.") if one.terms}
    count = 0
    for variable in case.model.variables.values():
        for term, curve in variable.curves.items():
            if (variable.name, term) in listed or curve.kind == "formula":
                continue
            count += 1
            if _height(case, variable, curve) < level:
                degree, at_least = case.script.degree(variable, term), level
                formula = f"(>= {degree} {case.script.number(at_least)})"
                text = f"{variable.name} is {term} reaches {float(level):g}"
                yield Statement(text, formula, "sat")
    require(answer.facts["count"] == count, "other terms reach it")


def _height(case: Case, variable: Variable, curve: Curve) -> Fraction:
    """Return the largest degree at the ends of the domain and where a curve changes."""
    low, high = case.ends(variable)
    ends = [low, high, *(x for x in knots(curve) if low < x < high)]
    return max(bounds(curve, x, x)[0] for x in ends)


def plain_terms(case: Case) -> list[tuple[Variable, str, Curve]]:
    """Return the terms whose curves are compared with each other."""
    aside = {tuple(t) for one in case.coded("FTD.") for t in one.terms}
    return [
        (variable, term, curve)
        for variable in case.model.variables.values()
        for term, curve in variable.curves.items()
        if (variable.name, term) not in aside
    ]


def well_shaped(case: Case, answer: Answer) -> Statements:
    """Check the number of terms without a finding; their shapes are not decided."""
    listed = {tuple(one.terms[0]) for one in case.coded("FT402.") if one.terms}
    count = len(plain_terms(case)) - len(listed)
    require(answer.facts["count"] == count, "other terms are well shaped")
    raise UndecidedError("the shapes of terms")
    yield


def subnormal(case: Case, answer: Answer) -> Statements:
    """Check the largest degree of a term that does not reach 1."""
    curve = case.model.variables[answer.terms[0].variable].curves[answer.terms[0].term]
    if not is_straight(curve):
        raise UndecidedError("the largest degree of a curve that is no line")
    top = max(curve.numbers[1]) if curve.kind == "points" else 1
    most = float(Fraction(top) * curve.height)
    is_so = math.isclose(answer.measure("largest degree"), most) and most < 1
    require(is_so, f"the largest degree is {most:.6g}")
    yield from ()


def overlaps(case: Case, answer: Answer) -> Statements:
    """Check the number of pairs of terms; their areas are not integrated."""
    every = itertools.combinations(plain_terms(case), 2)
    count = sum(one[0].name == other[0].name for one, other in every)
    kinds = ("apart", "not listed", "without area")
    rest = sum(answer.measure(f"pairs {kind}") for kind in kinds)
    listed = len([one for one in case.coded("FT403.") if one.terms])
    require(count == rest + listed, f"there are {count} pairs of terms")
    raise UndecidedError("areas of terms")
    yield


def unused(case: Case, answer: Answer) -> Statements:
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
        _count(answer, variables_in_use=len(counts[0]), terms_in_use=len(counts[1]))
    yield from ()


def _count(answer: Answer, **counts: float) -> None:
    """Refuse an answer whose measures are other counts than these."""
    for name, count in counts.items():
        name = name.replace("_", " ")
        require(answer.measure(name) == count, f"{name}: {count:g} are counted here")


def size(case: Case, answer: Answer) -> None:
    """Check the counts of rules, propositions and terms."""
    lengths = case.model.lengths
    propositions = [[c for c in rule.when if any(c.terms)] for rule in case.rules.rules]
    used = {(c.variable, t) for when in propositions for c in when for t in c.terms}
    _count(
        answer,
        rules=len(lengths),
        propositions=sum(lengths),
        most_propositions_of_a_rule=max(lengths),
        propositions_per_rule=sum(lengths) / len(lengths),
        distinct_terms_in_use=len(used),
        variables_in_use=len({variable for variable, _ in used}),
    )
    if case.model.form == "tree":
        _count(answer, depth_of_the_tree=max(map(len, case.model.paths)))
    names = {one.name: one.value for one in answer.measures}
    if "index of Nauck" in names:
        parts = (names[f"{one} of Nauck"] for one in ("complexity", "coverage"))
        product = math.prod(parts) * names["partition of Nauck"]
        is_near = math.isclose(names["index of Nauck"], product, rel_tol=1e-9)
        require(is_near, f"the index of Nauck is {product:.6g}")


CLAIMS: dict[str, Callable[[Case, Answer], Statements]] = {
    "FT101.never-wins": never_wins,
    "FT101.may-decide-by-place": never_wins,
    "FT101.never-fires": never_fires,
    "FT101.weight-0": silent,
    "FT101.never-true": silent,
    "FT101.leaves": reached_leaves,
    "FT101.leaf-excluded": dead_leaf,
    "FT101.leaf-outside": dead_leaf,
    "FT101.leaf-unmet": dead_leaf,
    "FT103.superfluous": never_wins,
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
    "FT202.others": ties,
    "FT204.alike": one_class,
    "FT301.fires": fires,
    "FT301.reaches": covers,
    "FT401.reached": heights,
    "FT401.low": low_term,
    "FT401.empty": low_term,
    "FT402.sound": well_shaped,
    "FT402.subnormal": subnormal,
    "FT403.others": overlaps,
    "FT403.unlisted": overlaps,
    "FT404.unused": unused,
    "FT404.used": unused,
}
"""The claims of each message that can be PROVED, or how reading decides it."""

BOUNDS: dict[str, Callable[[Case, Answer], Statements]] = {
    "FT102.marginal": no_lead,
    "FT102.between": no_lead,
    "FT201.conflict": no_higher,
    "FT201.may": no_higher,
    "FT301.weak": covers,
}
"""What answers with a bracket or a witness claim of all of the domain."""

PROVABLE = (
    *CLAIMS,
    *("FT107.more", "FT203.leaves", "FT402.outside", "FT402.peaks"),
    *("FT403.equal", "FT403.within", "FT403.similar"),
)
"""The messages of answers that must be PROVED, but for those that may be open."""


def bound_statements(case: Case, answer: Answer) -> list[Statement]:
    """Return the claims of an answer with a bracket or a witness; mostly none."""
    known = BOUNDS.get(answer.message)
    return [] if known is None else [*known(case, answer)]

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
from fuzzytree.rechecking.curves import ZERO, bounds, turns
from fuzzytree.rechecking.models import Rule
from fuzzytree.rechecking.outcomes import DoesNotHoldError, UndecidedError, require
from fuzzytree.rechecking.records import Answer, Proved, Span, Witness
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
    claims = CLAIMS[answer.message](case, answer)
    result = [*itertools.islice(claims, _MOST + 1)]
    if len(result) > _MOST:
        raise UndecidedError(f"more than {_MOST:,} claims")
    return result


def _names(case: Case, numbers: Iterable[int]) -> str:
    return ", ".join(map(case.name, numbers))


# --- rules that win, lead, fire, or are needed


def never_wins(case: Case, answer: Answer) -> Statements:
    """Claim that rivals, those that the proof names or all, are nowhere weaker."""
    (number,) = answer.rules
    rivals = case.rivals(number)
    if isinstance(answer.state, Proved) and answer.state.rivals:
        require({*answer.state.rivals} <= {*rivals}, "a rival that is none")
        rivals = [*answer.state.rivals]
    text = f"{case.name(number)} is nowhere stronger than {_names(case, rivals)}"
    yield Statement(text, case.over(number, rivals))


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
        above = ["true", *(f"(> {own} {cut})" for cut in cuts)]
        below = [*(f"(<= {own} {cut})" for cut in cuts), "true"]
        ends = zip(above, below, node["interval owners"], strict=True)
        formulas.append(
            any_of(all_of([low, high]) for low, high, to in ends if to == place + 1)
        )
    return all_of(formulas)


def dead_leaf(case: Case, answer: Answer) -> Statements:
    """Claim that no values lead to a leaf."""
    (number,) = answer.rules
    yield Statement(f"nothing leads to leaf {number}", path_to(case, number))


def live_leaves(case: Case, answer: Answer) -> Statements:
    """Claim that values lead to each leaf without a finding."""
    dead = {o.rules[0] for o in case.coded("FT101.leaf-")}
    count = len(case.numbers)
    is_so = (answer.facts["live"], answer.facts["leaves"]) == (count - len(dead), count)
    require(is_so, "other leaves are reached")
    for number in {*case.numbers} - dead:
        text = f"values lead to leaf {number}"
        yield Statement(text, path_to(case, number), "sat")


def same_class(case: Case, answer: Answer) -> Statements:
    """Claim that one class is decided everywhere, apart from exact ties."""
    label = answer.facts.get("then")
    own = case.own(label)
    others = (case.over(n, own) for n in case.numbers if n not in own)
    yield Statement(f"no class is decided but {label!r}", any_of(others))
    if case.rules.uncovered != label:
        yield _no_gap(case)


# --- pairs of rules, and propositions


def hidden(case: Case, answer: Answer) -> Statements:
    """Claim that some rules are nowhere weaker than the first one."""
    weak, *strong = answer.rules
    is_alike = answer.code == "FT104"
    for number in strong:
        is_same = case.then(number) == case.then(weak)
        require(is_same is is_alike, "the classes are not so")
        text = f"{case.name(weak)} is nowhere stronger than {case.name(number)}"
        yield Statement(text, case.over(weak, [number]))
    is_before = is_alike or (strong[0] < weak) is (answer.message == "FT105.masked")
    require(is_before, "the order of the rules is another one")


def no_other_hidden(case: Case, answer: Answer) -> Statements:
    """Claim that each rule of other pairs is somewhere the stronger one."""
    is_alike, live = answer.code == "FT104", case.live()
    pairs = [pair for pair in case.pairs(alike=is_alike) if {*pair} <= live]
    if answer.measure("pairs") != len(pairs):
        raise UndecidedError("which rules never fire is not known")
    listed = case.coded("FT104.sub") if is_alike else case.coded("FT105.")
    hides = {(o.rules[0], n) for o in listed for n in o.rules[1:]}
    for pair in pairs:
        if pair in hides or pair[::-1] in hides:
            continue
        for weak, strong in (pair, pair[::-1]) if is_alike else (pair,):
            if not case.is_above(strong, weak):
                text = f"{case.name(strong)} is somewhere above {case.name(weak)}"
                is_sure = any(every[strong - 1][0] > 0 for _, every in case.samples)
                yield Statement(text, case.over(strong, [weak]), "sat", is_sure)


def _apart(case: Case, a: int, b: int) -> str:
    """Return that the degrees of two rules differ on some axis."""
    rules = [case.rules.rules[n - 1] for n in (a, b)]
    axes = [case.script.on_axes(rule, case.rules) for rule in rules]
    off = case.script.number(NEARLY)
    both = [[of.get(n, "1.0") for of in axes] for n in {**axes[0], **axes[1]}]
    every = [(p, q) for x, y in both if x != y for p, q in ((x, y), (y, x))]
    return any_of(f"(> {p} (+ {q} {off}))" for p, q in every)


def same(case: Case, answer: Answer) -> Statements:
    """Claim that two rules have nearly the same antecedent."""
    is_same = case.then(answer.rules[0]) == case.then(answer.rules[1])
    require(is_same is (answer.message == "FT106.same"), "the classes are not so")
    text = f"the degrees of {_names(case, answer.rules)} differ nowhere by 1e-6"
    yield Statement(text, _apart(case, *answer.rules))


def no_others_same(case: Case, answer: Answer) -> Statements:
    """Claim that the antecedents of all other pairs differ."""
    off = len(case.model.variables) * NEARLY if case.rules.is_product else NEARLY
    for a, b in sorted({*case.pairs()} - {o.rules for o in case.coded("FT106.")}):
        sides = [(s[a - 1], s[b - 1]) for _, s in case.samples]
        if all(x[0] <= y[1] + off and y[0] <= x[1] + off for x, y in sides):
            text = f"{case.name(a)} and {case.name(b)} differ somewhere"
            is_sure = not case.rules.is_product
            yield Statement(text, _apart(case, a, b), "sat", is_sure)


def without(case: Case, answer: Answer) -> Rule:
    """Return the rule of an answer without the proposition that it is about."""
    rule = case.rules.rules[answer.rules[0] - 1]
    labels = [tuple(label) for label in answer.terms]
    for place, proposition in enumerate(rule.when):
        is_it = [(proposition.variable, term) for term in proposition.terms] == labels
        if is_it and answer.facts.get("proposition") == str(proposition):
            return rule._replace(when=(*rule.when[:place], *rule.when[place + 1 :]))
    raise DoesNotHoldError("it is of no proposition of the rule")


def irrelevant(case: Case, answer: Answer) -> Statements:
    """Claim that a rule without a proposition takes no input from another class."""
    (number,) = answer.rules
    name = f"{case.name(number)} without {answer.facts['proposition']}"
    symbols = [*map(case.symbol, case.numbers)]
    rest = case.script.add_rule(name, without(case, answer), case.rules)
    others = [*symbols[: number - 1], rest, *symbols[number:]]
    yield from _unchanged(case, number, others, symbols, name)


def superfluous(case: Case, answer: Answer) -> Statements:
    """Claim that no input has another class without a rule."""
    (number,) = answer.rules
    symbols = [*map(case.symbol, case.numbers)]
    others = [*symbols[: number - 1], "0.0", *symbols[number:]]
    name = f"a model without {case.name(number)}"
    yield from _unchanged(case, number, symbols, others, name)


def _unchanged(
    case: Case, number: int, own: list[str], others: list[str], name: str
) -> Statements:
    """Claim that where a rule decides by some strengths, its class does by others.

    First apart from exact ties; then also where rules tie.
    """
    bare = all_of(f"(<= {strength} 0.0)" for strength in others)
    for is_strict in (True, False):
        ways = [case.wins(n, others, is_strict=is_strict) for n in case.rivals(number)]
        ways += [bare] * (case.rules.uncovered != case.then(number))
        formula = all_of([case.wins(number, own, is_strict=is_strict), any_of(ways)])
        tail = ", apart from exact ties" if is_strict else ""
        text = f"{name} decides the same{tail}"
        yield Statement(text, formula, is_sure=is_strict)


def apart(case: Case, answer: Answer) -> Statements:
    """Claim that no pair without a finding reaches the level together."""
    level = Fraction(case.settings.level)
    rest = case.conflicts() - {o.rules for o in case.coded("FT201.")}
    omitted = int(answer.measure("pairs not listed"))
    _count(answer, "pairs that never do", len(rest) - omitted)
    if omitted:
        raise UndecidedError("which pairs are left out is not known")
    for pair in sorted(rest):
        formula = all_of(case.reaches(n, ">=", level) for n in pair)
        text = f"{_names(case, pair)} never reach {float(level):g} together"
        yield Statement(text, formula)


def no_higher(case: Case, answer: Answer) -> Statements:
    """Claim that two rules reach no higher level together than the reported one."""
    high = Fraction(answer.measures[-1].value) + _ROUNDED
    text = f"{_names(case, answer.rules)} reach no more than {float(high):g} together"
    yield Statement(text, all_of(case.reaches(n, ">", high) for n in answer.rules))


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


def _beyond(case: Case, span: Span, way: float) -> Iterator[str]:
    """Yield that a variable is outside a span, made wider or narrower by doubles."""
    own = case.script.value(case.model.variables[span.variable])
    for end, sign, far in ((span.low, "<", -way), (span.high, ">", way)):
        if end is not None:
            moved = end if span.low == span.high else math.nextafter(end, far)
            yield f"({sign} {own} {case.script.number(Fraction(moved))})"


def within(case: Case, answer: Answer) -> Statements:
    """Claim that what an answer says of its witness is so in all of its region."""
    spans = answer.state.region if isinstance(answer.state, Witness) else ()
    outside = [f for span in spans for f in _beyond(case, span, -math.inf)]
    if answer.code == "FT205":
        wrong = f"(not {path_to(case, answer.rules[0])})"
    else:
        is_weak = answer.message == "FT301.weak"
        level = Fraction(case.settings.epsilon) if is_weak else ZERO
        sign = ">=" if is_weak else ">"
        wrong = any_of(case.reaches(n, sign, level) for n in case.numbers)
        yield from covers(case, answer) if is_weak else ()
    if outside:
        text = f"{answer.subject} is so in all of its region"
        yield Statement(text, all_of([f"(not {any_of(outside)})", wrong]))


def no_more_gaps(case: Case, gaps: list[Answer]) -> Statement:
    """Claim that no rule-free part of the domain lies outside of the listed gaps."""
    every = (
        any_of(f for span in gap.region for f in _beyond(case, span, math.inf))
        for gap in gaps
    )
    return _no_gap(case, [*every])


# --- terms, and what is counted


def low_term(case: Case, answer: Answer) -> Statements:
    """Claim that a term is nowhere above the reported height, and below the level."""
    (label,) = answer.terms
    height, level = answer.measure("height"), case.settings.level
    require((answer.message == "FT401.empty") is (not height), "it is not empty")
    degree = case.script.degree(case.model.variables[label.variable], label.term)
    most = case.script.number(Fraction(height) + (_ROUNDED if height else 0))
    over = [f"(> {degree} {most})"]
    over.append(f"(>= {degree} {case.script.number(Fraction(level))})")
    text = (
        f"{label.variable} is {label.term} is nowhere above {height:g}, nor {level:g}"
    )
    yield Statement(text, any_of(over))


def heights(case: Case, answer: Answer) -> Statements:
    """Claim that all terms without a finding reach the level."""
    level = Fraction(case.settings.level)
    rest = [label for label in _rest(case, answer) if _is_evaluated(case, label)]
    require(answer.facts["count"] == len(rest), "other terms reach it")
    for name, term in rest:
        variable = case.model.variables[name]
        curve, (low, high) = variable.curves[term], case.ends(variable)
        ends = [low, high, *(x for x in turns(curve) if low < x < high)]
        if all(bounds(curve, x, x)[0] < level for x in ends):
            degree = case.script.degree(variable, term)
            formula = f"(>= {degree} {case.script.number(level)})"
            text = f"{name} is {term} reaches {float(level):g}"
            yield Statement(text, formula, "sat")


def _is_evaluated(case: Case, label: tuple[str, str]) -> bool:
    return case.model.variables[label[0]].curves[label[1]].kind != "formula"


def _rest(case: Case, answer: Answer) -> list[tuple[str, str]]:
    """Return the terms without a finding of an answer's code."""
    listed = {tuple(o.terms[0]) for o in case.coded(f"{answer.code}.") if o.terms}
    return [label for label in case.model.labels if label not in listed]


def counted(case: Case, answer: Answer) -> Statements:
    """Check that findings and the rest are everything; the rest is not decided."""
    aside = {tuple(label) for o in case.coded("FTD.") for label in o.terms}
    listed = len([o for o in case.coded(f"{answer.code}.") if o.terms or o.rules])
    if answer.code == "FT202":
        _count(answer, "pairs", len(case.pairs(alike=False)))
        _count(answer, "pairs listed", listed)
        raise UndecidedError("ties on more than a surface")
    if answer.code == "FT402":
        count = len([label for label in _rest(case, answer) if label not in aside])
        require(answer.facts["count"] == count, "other terms are well shaped")
        raise UndecidedError("the shapes of terms")
    names = [name for name, term in case.model.labels if (name, term) not in aside]
    pairs = sum(a == b for a, b in itertools.combinations(names, 2))
    kinds = ("apart", "not listed", "without area")
    rest = sum(answer.measure(f"pairs {kind}") for kind in kinds)
    require(pairs == rest + listed, f"there are {pairs} pairs of terms")
    raise UndecidedError("areas of terms")
    yield


def unused(case: Case, answer: Answer) -> Statements:
    """Check that the findings are the terms and variables that no rule uses."""
    model, labels = case.model, case.model.labels_in_use
    names = {variable for variable, _ in labels}
    for variable in model.variables.values():
        if variable.name in names:
            names |= {name for name, *_ in variable.parts}
    idle = [f"variable {name!r}" for name in model.variables if name not in names]
    rest = [pair for pair in model.labels if pair[0] in names and pair not in labels]
    idle += [f"term {term!r} of {name!r}" for name, term in rest]
    listed = [o.subject for o in case.coded("FT404.unused")]
    require(listed == idle, "other terms or variables are unused")
    yield from ()


def _count(answer: Answer, name: str, count: int) -> None:
    """Refuse an answer whose measure is another count."""
    require(answer.measure(name) == count, f"{name}: {count} are counted here")


Claims = Callable[[Case, Answer], Statements]
_MESSAGES: dict[Claims, str] = {
    never_wins: "FT101.never-wins FT101.may-decide-by-place",
    never_fires: "FT101.never-fires FT107.silent",
    silent: "FT101.weight-0 FT101.never-true",
    live_leaves: "FT101.leaves",
    dead_leaf: "FT101.leaf-excluded FT101.leaf-outside FT101.leaf-unmet",
    hidden: "FT104.subsumed FT105.masked FT105.weaker",
    no_other_hidden: "FT104.others FT105.others",
    same: "FT106.same FT106.contradiction FT106.different",
    no_others_same: "FT106.others",
    superfluous: "FT103.superfluous",
    irrelevant: "FT107.irrelevant",
    apart: "FT201.never FT201.unlisted",
    same_class: "FT204.alike",
    fires: "FT301.fires",
    covers: "FT301.reaches",
    heights: "FT401.reached",
    low_term: "FT401.low FT401.empty",
    counted: "FT202.others FT402.sound FT403.others FT403.unlisted",
    unused: "FT404.unused FT404.used",
}
CLAIMS = {name: claims for claims, names in _MESSAGES.items() for name in names.split()}
"""The claims of each message that can be PROVED, or how reading decides it."""

BOUNDS: dict[str, Claims] = {
    **dict.fromkeys(("FT102.marginal", "FT102.between"), no_lead),
    **dict.fromkeys(("FT201.conflict", "FT201.may"), no_higher),
    **dict.fromkeys(("FT301.gap", "FT301.gap-with-class"), within),
    **dict.fromkeys(("FT205.region", "FT301.gap-of-system", "FT301.weak"), within),
}
"""What answers with a bracket or a witness claim of all of the domain."""

PROVABLE = (
    *CLAIMS,
    *("FT107.more", "FT203.leaves", "FT402.outside", "FT402.peaks", "FT402.subnormal"),
    *("FT403.equal", "FT403.within", "FT403.similar"),
)
"""The messages of answers that must be PROVED, but for those that may be open."""

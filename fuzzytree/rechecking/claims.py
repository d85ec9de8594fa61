"""What each answer says, as claims that a solver decides, and what its witness shows.

A function of `CHECKS` checks what reading and evaluating can decide of an answer, and
yields the rest as claims. They are written from an answer's message, rules, facts and
measures, never from its sentence. Most are asserted as their contrary, and `unsat`
proves them; a claim that something exists is asserted as it is, unless a known point
shows it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.rechecking.case import Case, class_at, strengths
from fuzzytree.rechecking.curves import ZERO, bounds, turns
from fuzzytree.rechecking.models import Rule
from fuzzytree.rechecking.outcomes import DoesNotHoldError, UndecidedError, require
from fuzzytree.rechecking.records import (
    Answer,
    Claim,
    Proved,
    Span,
    Witness,
    fraction,
)
from fuzzytree.rechecking.smt import all_of, any_of
from fuzzytree.rechecking.words import is_plain

NEARLY = Fraction(1, 10**6)
ROUNDED = Fraction(1, 10**9)


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


def witness_claims(answer: Answer, kind: str) -> list[Claim]:
    """Return what is claimed of a kind at the point of an answer."""
    return [claim for claim in answer.witness.claims if claim.kind == kind]


# --- rules that win, lead, fire, or are needed


def wins(case: Case, answer: Answer) -> None:
    """Check that a rule beats all rivals at a point, or fires there, or leads."""
    (number,) = answer.rules
    rivals = () if answer.message == "FT101.fires" else case.rivals(number)
    is_all = any(
        claim.rules == (number,) and {*claim.rivals} == {*rivals}
        for claim in witness_claims(answer, "beats")
    )
    require(is_all, "it is not claimed that the rule beats all these others")
    if answer.code == "FT102":
        every = _strengths(case, answer)
        lead = every[number - 1] - max((every[n - 1] for n in rivals), default=ZERO)
        least = answer.measure("largest lead, at least")
        is_so = least >= case.settings.lead and lead >= Fraction(least)
        require(is_so, "the rule does not lead by so much there")


def _strengths(case: Case, answer: Answer) -> list[Fraction]:
    """Return the strengths of all rules at a witness, at most."""
    point = case.point_of(answer.witness.point)
    return [most for _, most in strengths(case.rules, point)]


def never_wins(case: Case, answer: Answer) -> Statements:
    """Claim that rivals, those that the proof names or all, are nowhere weaker."""
    (number,) = answer.rules
    rivals = case.rivals(number)
    if isinstance(answer.state, Proved) and answer.state.rivals:
        require({*answer.state.rivals} <= {*rivals}, "a rival that is none")
        rivals = [*answer.state.rivals]
    text = f"{case.name(number)} is nowhere stronger than {case.name(*rivals)}"
    yield Statement(text, case.over(number, rivals))


def never_fires(case: Case, answer: Answer) -> Statements:
    """Claim that a rule is 0 everywhere, in each of its ways."""
    for number in case.numbers:
        if case.rule(number).number == case.rule(answer.rules[0]).number:
            text = f"{case.name(number)} never fires"
            yield Statement(text, case.reaches(number, ">", ZERO))


def silent(case: Case, answer: Answer) -> None:
    """Check that a rule of a system never fires, as its text says."""
    require(answer.subject in case.model.silent, "its text lets it fire")


def no_lead(case: Case, answer: Answer) -> Statements:
    """Claim that a rule leads nowhere by as much as the largest lead, at most."""
    (number,) = answer.rules
    lead = Fraction(answer.measure("largest lead, at most")) + ROUNDED
    own, by = case.symbol(number), case.script.number(lead)
    over = [f"(> {own} (+ {by} {case.symbol(n)}))" for n in case.rivals(number)]
    text = f"{case.name(number)} leads nowhere by {float(lead):g}"
    yield Statement(text, all_of([f"(> {own} {by})", *over]))


def ties(case: Case, answer: Answer) -> None:
    """Check that a claim compares rules that tie with all others."""
    every, own = {*case.numbers}, {*answer.rules}
    if answer.code == "FT101":  # others of its class do not matter
        every = own | {*case.rivals(answer.rules[0])}
    is_all = any(
        own <= {*claim.rules} and every <= {*claim.rules, *claim.rivals}
        for claim in witness_claims(answer, "ties")
    )
    require(is_all, "it is not claimed that they tie above all others")
    is_two = answer.code != "FT202" or len({*map(case.then, answer.rules)}) == 2
    require(is_two, "the rules are of one class")


def without(case: Case, answer: Answer) -> Rule:
    """Return the rule of an answer without the proposition that it is about."""
    rule = case.rule(answer.rules[0])
    labels = [tuple(label) for label in answer.terms]
    for place, proposition in enumerate(rule.when):
        is_it = [(proposition.variable, term) for term in proposition.terms] == labels
        if is_it and answer.facts.get("proposition") == str(proposition):
            return rule._replace(when=(*rule.when[:place], *rule.when[place + 1 :]))
    raise DoesNotHoldError("it is of no proposition of the rule")


def matters(case: Case, answer: Answer) -> None:
    """Check that without a rule, or a proposition, another class is predicted."""
    point, place = case.point_of(answer.witness.point), answer.rules[0] - 1
    rest = [without(case, answer)] if answer.code == "FT107" else []
    every = (*case.rules.rules[:place], *rest, *case.rules.rules[place + 1 :])
    before = class_at(case.rules, point)
    after = class_at(case.rules._replace(rules=every), point)
    own = after if rest else before
    require(before != after and own == case.then(place + 1), "it does not matter there")
    require(answer.facts.get("before") == before, f"the class there is {before!r}")
    require(answer.facts.get("then") == after, f"it becomes {after!r}")


def never_matters(case: Case, answer: Answer) -> Statements:
    """Claim that the same is decided without a rule, or one of its propositions."""
    (number,) = answer.rules
    own = [*map(case.symbol, case.numbers)]
    others, name = [*own], f"a model without {case.name(number)}"
    if answer.code == "FT107":  # its rest takes no input from another class
        name = f"{case.name(number)} without {answer.facts['proposition']}"
        rest = without(case, answer)._replace(name=name)
        own[number - 1] = case.script.add_rule(rest, case.rules)
    else:
        others[number - 1] = "0.0"
    for is_strict in (True, False):
        yield agreement(name, number, (case, own), (case, others), is_strict=is_strict)


Model = tuple[Case, list[str]]


def agreement(
    name: str, number: int, old: Model, new: Model, *, is_strict: bool
) -> Statement:
    """Claim that where a rule of a model decides, no other class of another one does.

    Apart from exact ties, or also where rules tie.
    """
    (case, own), (other, strengths_of_other) = old, new
    then = case.then(number)
    ways = [
        other.wins(n, strengths_of_other, is_strict=is_strict)
        for n in other.numbers
        if other.then(n) != then
    ]
    if other.rules.uncovered != then and (case is other or not is_strict):
        ways.append(all_of(f"(<= {strength} 0.0)" for strength in strengths_of_other))
    formula = all_of([case.wins(number, own, is_strict=is_strict), any_of(ways)])
    tail = ", apart from exact ties" if is_strict else ""
    return Statement(f"{name} decides the same{tail}", formula, is_sure=is_strict)


# --- trees


def path_to(case: Case, number: int) -> str:
    """Return that the nodes of a tree lead to a leaf."""
    formulas: list[str] = []
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
    live = {*case.numbers} - {o.rules[0] for o in case.answers_of("FT101.leaf-")}
    counts = len(live), len(case.numbers)
    is_so = (answer.facts["live"], answer.facts["leaves"]) == counts
    require(is_so, "other leaves are reached")
    for number in live:
        text = f"values lead to leaf {number}"
        yield Statement(text, path_to(case, number), "sat")


def leaf_region(case: Case, answer: Answer) -> Statements:
    """Check that a witness reaches its leaf; claim that all of its region does."""
    (number,), state = answer.rules, answer.witness
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
        if side is not None:
            both = {span.low, span.high}
            is_end = both <= ends[span.variable] | {side.low, side.high}
            if not is_plain(side):
                is_end = all(side.has(Fraction(end)) for end in both if end is not None)
            require(is_end, f"the path leads elsewhere in {span.variable!r}")
    yield from _in_region(case, answer, f"(not {path_to(case, number)})")


def raw_rules_differ(case: Case, answer: Answer) -> None:
    """Check that a tree and its raw rules are claimed to answer differently."""
    classes = {c.of: c.label for c in witness_claims(answer, "decides")}
    is_both = classes.keys() == {"tree", "raw rules"}
    require(is_both, "it is not claimed what both answer")
    both = classes["tree"], classes["raw rules"]
    require(both[0] != both[1], "the two answers are the same")
    is_so = (answer.facts["then"], answer.facts["other"]) == both
    require(is_so, "the two answer something else")


def same_class(case: Case, answer: Answer) -> Statements:
    """Claim that one class is decided everywhere, apart from exact ties."""
    label = answer.facts.get("then")
    own = [n for n in case.numbers if case.then(n) == label]
    others = (case.over(n, own) for n in case.numbers if n not in own)
    yield Statement(f"no class is decided but {label!r}", any_of(others))
    if case.rules.uncovered != label:
        yield no_gap(case)


# --- pairs of rules


def dominance(case: Case, answer: Answer) -> Statements:
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


def no_other_dominance(case: Case, answer: Answer) -> Statements:
    """Claim that each rule of other pairs is somewhere the stronger one."""
    is_alike = answer.code == "FT104"
    pairs = case.live_pairs(alike=is_alike)
    if answer.measure("pairs") != len(pairs):
        raise UndecidedError("which rules never fire is not known")
    answers = case.answers_of("FT104.sub" if is_alike else "FT105.")
    hides = {(o.rules[0], n) for o in answers for n in o.rules[1:]}
    for pair in pairs:
        if pair in hides or pair[::-1] in hides:
            continue
        for weak, strong in (pair, pair[::-1]) if is_alike else (pair,):
            samples = [(every[weak - 1], every[strong - 1]) for every in case.samples]
            if not any(high[0] > low[1] for low, high in samples):
                text = f"{case.name(strong)} is somewhere above {case.name(weak)}"
                is_sure = any(high[0] > 0 for _, high in samples)
                yield Statement(text, case.over(strong, [weak]), "sat", is_sure)


def _apart(case: Case, a: int, b: int) -> str:
    """Return that the degrees of two rules differ on some axis."""
    axes = [case.script.on_axes(case.rule(n), case.rules) for n in (a, b)]
    off = case.script.number(NEARLY)
    both = [[of.get(n, "1.0") for of in axes] for n in {**axes[0], **axes[1]}]
    every = [(p, q) for x, y in both if x != y for p, q in ((x, y), (y, x))]
    return any_of(f"(> {p} (+ {q} {off}))" for p, q in every)


def same(case: Case, answer: Answer) -> Statements:
    """Claim that two rules have nearly the same antecedent."""
    is_same = case.then(answer.rules[0]) == case.then(answer.rules[1])
    require(is_same is (answer.message == "FT106.same"), "the classes are not so")
    text = f"the degrees of {case.name(*answer.rules)} differ nowhere by 1e-6"
    yield Statement(text, _apart(case, *answer.rules))


def no_others_same(case: Case, answer: Answer) -> Statements:
    """Claim that the antecedents of all other pairs differ."""
    is_product = case.rules.is_product
    off = len(case.model.variables) * NEARLY if is_product else NEARLY
    for a, b in sorted({*case.pairs()} - {o.rules for o in case.answers_of("FT106.")}):
        samples = [(every[a - 1], every[b - 1]) for every in case.samples]
        if all(x[0] <= y[1] + off and y[0] <= x[1] + off for x, y in samples):
            text = f"{case.name(a)} and {case.name(b)} differ somewhere"
            yield Statement(text, _apart(case, a, b), "sat", not is_product)


def apart(case: Case, answer: Answer) -> Statements:
    """Claim that no pair without a finding reaches the level together."""
    level = Fraction(case.settings.level)
    rest = case.conflicts() - {o.rules for o in case.answers_of("FT201.")}
    omitted = int(answer.measure("pairs not listed"))
    _check_count(answer, "pairs that never do", len(rest) - omitted)
    if omitted:
        raise UndecidedError("which pairs are left out is not known")
    for pair in sorted(rest):
        text = f"{case.name(*pair)} never reach {float(level):g} together"
        yield Statement(text, all_of(case.reaches(n, ">=", level) for n in pair))


def conflict(case: Case, answer: Answer) -> Statements:
    """Claim that two rules reach no higher level together; check that they reach it."""
    if isinstance(answer.state, Witness):
        level, low = Fraction(case.settings.level), answer.measures[0].value
        is_high = any(
            claim.rules == answer.rules and fraction(claim.level) >= level
            for claim in witness_claims(answer, "reaches")
        )
        require(is_high, "it is not claimed that both reach the level")
        is_two = len({*map(case.then, answer.rules)}) == 2
        require(is_two, "the rules are of one class")
        require(answer.facts["level"] == low, "the level is another one")
        every = _strengths(case, answer)
        most = min(every[n - 1] for n in answer.rules)
        off = Fraction(answer.facts.get("falls short", 0)) + ROUNDED
        require(most >= Fraction(low) - off, "less is reached there")
    high = Fraction(answer.measures[-1].value) + ROUNDED
    text = f"{case.name(*answer.rules)} reach no more than {float(high):g} together"
    yield Statement(text, all_of(case.reaches(n, ">", high) for n in answer.rules))


# --- where no rule fires


def no_gap(case: Case, gaps: Iterable[Answer] = ()) -> Statement:
    """Claim that some rule fires everywhere but in gaps, and on surfaces."""
    points = frozenset(
        name
        for name, side in case.sides.items()
        if side.low == side.high or case.model.variables[name].categories
    )
    formulas = [case.script.zero(rule, case.rules, points) for rule in case.rules.rules]
    text = "some rule fires on each part with a width"
    text += " but the gaps listed" if gaps else ""
    for gap in gaps:
        beyond = (f for span in gap.region for f in _beyond(case, span, math.inf))
        formulas.append(any_of(beyond))
    return Statement(text, all_of(formulas))


def fires(case: Case, answer: Answer) -> Statements:
    """Claim that some rule fires everywhere."""
    require(case.model.is_whole, "rules that are left out may fire")
    yield no_gap(case)


def covers(case: Case, answer: Answer) -> Statements:
    """Claim that some rule is everywhere as strong as where it is least, at least."""
    low = Fraction(answer.measure("strength where it is least, at least"))
    symbols = [case.symbol(n) for n in case.numbers]  # whose curves may be no lines
    levels = {low} if case.script.is_exact else set()
    if answer.message == "FT301.reaches":
        levels.add(Fraction(case.settings.epsilon))
    for level in levels - {ZERO}:
        least = case.script.number(level)
        weak = (f"(< {symbol} {least})" for symbol in symbols)
        yield Statement(f"some rule reaches {float(level):g} everywhere", all_of(weak))


def gap(case: Case, answer: Answer) -> Statements:
    """Claim that every rule is as low in all of a region as at its witness."""
    level, sign = ZERO, ">"
    if answer.message == "FT301.weak":
        level, sign = Fraction(case.settings.epsilon), ">="
        yield from covers(case, answer)
    is_low = any(
        {*claim.rules} == {*case.numbers} and fraction(claim.level) <= level
        for claim in witness_claims(answer, "below")
    )
    require(is_low, "it is not claimed that all rules are below")
    wrong = any_of(case.reaches(n, sign, level) for n in case.numbers)
    yield from _in_region(case, answer, wrong)


def _in_region(case: Case, answer: Answer, wrong: str) -> Statements:
    """Claim that something is wrong nowhere in the region of a witness."""
    spans = answer.witness.region
    outside = [f for span in spans for f in _beyond(case, span, -math.inf)]
    if outside:
        text = f"{answer.subject} is so in all of its region"
        yield Statement(text, all_of([f"(not {any_of(outside)})", wrong]))


def _beyond(case: Case, span: Span, way: float) -> Iterator[str]:
    """Yield that a variable is outside a span, made wider or narrower by doubles."""
    own = case.script.value(case.model.variables[span.variable])
    for end, sign, far in ((span.low, "<", -way), (span.high, ">", way)):
        if end is not None:
            moved = end if span.low == span.high else math.nextafter(end, far)
            yield f"({sign} {own} {case.script.number(Fraction(moved))})"


# --- terms, and what is counted


def low_term(case: Case, answer: Answer) -> Statements:
    """Claim that a term is nowhere above the reported height, and below the level."""
    ((name, term),) = answer.terms
    height, level = answer.measure("height"), case.settings.level
    require((answer.message == "FT401.empty") is (not height), "it is not empty")
    degree = case.script.degree(case.model.variables[name], term)
    most = case.script.number(Fraction(height) + (ROUNDED if height else 0))
    least = case.script.number(Fraction(level))
    text = f"{name} is {term} is nowhere above {height:g}, nor {level:g}"
    yield Statement(text, any_of([f"(> {degree} {most})", f"(>= {degree} {least})"]))


def heights(case: Case, answer: Answer) -> Statements:
    """Claim that all terms without a finding reach the level."""
    level, variables = Fraction(case.settings.level), case.model.variables
    rest = [
        (variables[name], term)
        for name, term in _rest(case, answer)
        if variables[name].curves[term].kind != "formula"
    ]
    require(answer.facts["count"] == len(rest), "other terms reach it")
    for variable, term in rest:
        curve, (low, high) = variable.curves[term], case.ends(variable)
        ends = [low, high, *(x for x in turns(curve) if low < x < high)]
        if all(bounds(curve, x, x)[0] < level for x in ends):
            degree = case.script.degree(variable, term)
            formula = f"(>= {degree} {case.script.number(level)})"
            text = f"{variable.name} is {term} reaches {float(level):g}"
            yield Statement(text, formula, "sat")


def _rest(case: Case, answer: Answer) -> list[tuple[str, str]]:
    """Return the terms without a finding of an answer's code."""
    answers = case.answers_of(f"{answer.code}.")
    listed = {tuple(o.terms[0]) for o in answers if o.terms}
    return [label for label in case.model.labels if label not in listed]


def counts(case: Case, answer: Answer) -> None:
    """Check that findings and the rest are everything; the rest is not decided."""
    aside = {tuple(label) for o in case.answers_of("FTD.") for label in o.terms}
    answers = case.answers_of(f"{answer.code}.")
    listed = len([o for o in answers if o.terms or o.rules])
    if answer.code == "FT202":
        _check_count(answer, "pairs", len(case.pairs(alike=False)))
        _check_count(answer, "pairs listed", listed)
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


def idle_names(case: Case, answer: Answer) -> None:
    """Check that the findings are the terms and variables that no rule uses."""
    model, labels = case.model, case.model.labels_in_use
    names = {variable for variable, _ in labels}
    for variable in model.variables.values():
        if variable.name in names:
            names |= {name for name, *_ in variable.parts}
    idle = [f"variable {name!r}" for name in model.variables if name not in names]
    rest = [pair for pair in model.labels if pair[0] in names and pair not in labels]
    idle += [f"term {term!r} of {name!r}" for name, term in rest]
    subjects = [o.subject for o in case.answers_of("FT404.unused")]
    require(subjects == idle, "other terms or variables are unused")


def _check_count(answer: Answer, name: str, count: int) -> None:
    """Refuse an answer whose measure is another count."""
    require(answer.measure(name) == count, f"{name}: {count} are counted here")


def leave_open(case: Case, answer: Answer) -> None:
    """Leave an answer undecided."""
    raise UndecidedError("no solver of lines and polynomials is asked for it")


Check = Callable[[Case, Answer], Statements | None]
"""Claims for a solver; None if all is decided here."""


def _table(messages: dict[Check, str]) -> dict[str, Check]:
    return {name: check for check, names in messages.items() for name in names.split()}


PROOFS = _table(
    {
        never_wins: "FT101.never-wins FT101.may-decide-by-place",
        never_fires: "FT101.never-fires FT107.silent",
        silent: "FT101.weight-0 FT101.never-true",
        live_leaves: "FT101.leaves",
        dead_leaf: "FT101.leaf-excluded FT101.leaf-outside FT101.leaf-unmet",
        dominance: "FT104.subsumed FT105.masked FT105.weaker",
        no_other_dominance: "FT104.others FT105.others",
        same: "FT106.same FT106.contradiction FT106.different",
        no_others_same: "FT106.others",
        never_matters: "FT103.superfluous FT107.irrelevant",
        apart: "FT201.never FT201.unlisted",
        same_class: "FT204.alike",
        fires: "FT301.fires",
        covers: "FT301.reaches",
        heights: "FT401.reached",
        low_term: "FT401.low FT401.empty",
        counts: "FT202.others FT402.sound FT403.others FT403.unlisted",
        idle_names: "FT404.unused FT404.used",
        leave_open: "FT107.more FT203.leaves FT402.outside FT402.peaks "
        "FT402.subnormal FT403.equal FT403.within FT403.similar",
    }
)
"""How each message is checked that must be PROVED, but for those that may be open."""

WITNESSES = _table(
    {
        wins: "FT101.wins FT101.fires FT102.leads",
        ties: "FT101.decides-by-place FT202.tie",
        matters: "FT103.needed FT107.needed",
        conflict: "FT201.conflict",
        raw_rules_differ: "FT203.differs",
        leaf_region: "FT205.region",
        gap: "FT301.weak FT301.gap FT301.gap-with-class FT301.gap-of-system",
    }
)
"""How each message is checked that needs a witness."""

BRACKETS = _table({no_lead: "FT102.marginal FT102.between", conflict: "FT201.may"})
"""How the bounds of others are checked."""

"""A rule base as a program: every rule is fired, the first of the strongest wins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fuzzytree.model import (
    WEIGHT_OF_ONE,
    FuzzyTree,
    Proposition,
    Rule,
    RuleBase,
    SystemOutput,
    Variable,
    parts_of,
    proposition_text,
    shapes_of,
    squarings,
)
from fuzzytree.semantics.programs.steps import Maker, Place, Program, Result, result_of

DECIDED, TIE, UNCOVERED, MISSING = 0.0, 1.0, 2.0, 3.0


def from_rules(rules: RuleBase, *, probabilities: bool = False) -> Program:
    """Return the program of a rule base.

    It performs the operations of `fuzzytree.semantics.reference.evaluate` in the same
    order, so its strengths have the same bits. Rows with a value that is missing or not
    finite, or with a combination that is not, have strengths NaN, rule 0 and status 3.

    Args:
        rules: The rule base.
        probabilities: Whether the probability of each class is a result; the rule base
            must have them.

    Returns:
        A program with the results `strength` of each rule, `rule`, `status`, `class`
        and, if requested, `probability` of each class.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> program = from_rules(rules)
        >>> len(program.of("strength")) == len(rules.rules)
        True
    """
    make = Maker()
    known, axes = input_values(make, rules.variables)
    strengths = _strengths(make, rules, axes)
    with make.topic("highest strength"):
        best = make.chain("maximum", strengths)
    hits: list[Place] = []
    for number, strength in enumerate(strengths, 1):
        with make.topic(f"rule {number}"):
            hits.append(make.equal(strength, best))
    with make.topic("winner"):
        rule = _first(make, hits, list(range(1, len(hits) + 1)))
    with make.topic("last winner"):
        last = _first(make, hits[::-1], list(range(len(hits), 0, -1)))
    zero = make.constant(0.0)
    is_none = make.equal(best, zero)
    rule = make.where(is_none, zero, rule)
    tie, decided = make.constant(TIE), make.constant(DECIDED)
    status = make.where(make.equal(rule, last), decided, tie)
    status = make.where(is_none, UNCOVERED, status)
    rule = make.where(known, rule, zero)
    status = make.where(known, status, MISSING)
    answer = make.where(known, _answer(make, rules, rule), _code(make, rules))
    nothing = make.constant(float("nan"))
    shown = [make.where(known, strength, nothing) for strength in strengths]
    results = [result_of("strength", str(n), s) for n, s in enumerate(shown, 1)]
    results += [
        result_of("rule", "rule", rule),
        result_of("status", "status", status),
        result_of("class", "class", answer),
    ]
    if probabilities:
        results += _probabilities(make, rules, strengths, rule)
    return make.program(rules.name, rules.inputs, tuple(results))


def from_axes(tree: FuzzyTree) -> Program:
    """Return a program with the value of each variable: inputs, then combinations."""
    make = Maker()
    order = sorted(tree.variables, key=lambda variable: bool(variable.parts))
    _, axes = input_values(make, order)
    results = [result_of("output", one.name, axes[one.name]) for one in order]
    return make.program(tree.name, tree.inputs, tuple(results))


def input_values(
    make: Maker, variables: Iterable[Variable]
) -> tuple[Place, dict[str, Place]]:
    """Return whether all values are finite, and each variable's value in its range.

    A combination is the sum of its parts in order. What stands for a missing value
    replaces one that is not finite.
    """
    results: list[Place] = []
    values: dict[str, Place] = {}
    for one in variables:
        with make.topic(one.name):
            terms = [p.weight * (values[p.input] - p.centre) for p in one.parts]
            value = make.chain("add", terms) if terms else make.input(one.name)
            if one.missing is not None:
                is_known = make("is_finite", value)
                value = make.where(is_known, value, one.missing)
            results.append(make.titled(value, one.name))
            values[one.name] = clamped(make, one, value) if one.clips else value
            make.titled(values[one.name], f"{one.name} clamped")
    with make.topic("inputs"):
        if not results:  # all of no values are finite
            results = [make.constant(0.0)]
        return make.chain("and", [make("is_finite", one) for one in results]), values


def clamped(make: Maker, one: Variable | SystemOutput, value: Place) -> Place:
    """Return a value moved into a range; NaN stays NaN."""
    result = value
    if one.high is not None:
        high = make.constant(one.high)
        result = make.where(make.less(high, value), high, result)
    if one.low is not None:
        low = make.constant(one.low)
        result = make.where(make.less(value, low), low, result)
    return result


def _strengths(make: Maker, rules: RuleBase, axes: dict[str, Place]) -> list[Place]:
    shapes = shapes_of(rules.variables)
    degrees: dict[Proposition, Place] = {}

    def proposition_degree(proposition: Proposition) -> Place:
        if proposition not in degrees:
            x = axes[proposition.variable]
            terms: list[Place] = []
            for term in proposition.terms:
                title = f"{proposition.variable} is {term}"
                with make.topic(title):
                    degree = shapes[proposition.variable, term].degree(make, x)
                    terms.append(make.titled(degree, title))
            with make.topic(proposition_text(proposition)):
                highest = make.chain("maximum", terms)
                if proposition.negated:
                    highest = 1.0 - highest
            degrees[proposition] = highest
        return degrees[proposition]

    is_product = rules.semantics.conjunction == "product"
    join = "multiply" if is_product else "minimum"

    def strength(number: int, rule: Rule) -> Place:
        parts = [proposition_degree(proposition) for proposition in rule.when]
        with make.topic(f"rule {number}"):
            whole = make.chain(join, parts) if parts else make.constant(1.0)
            return make.titled(whole, f"rule {number} strength")

    return [strength(number, rule) for number, rule in enumerate(rules.rules, 1)]


def _first(make: Maker, hits: list[Place], numbers: list[int]) -> Place:
    """Return the number of the first hit, 0 without one."""
    chosen = make.constant(float(numbers[-1]))
    pairs = list(zip(hits, numbers, strict=True))
    for hit, number in reversed(pairs[:-1]):
        chosen = make.where(hit, float(number), chosen)
    return chosen


def _probabilities(
    make: Maker, rules: RuleBase, strengths: list[Place], rule: Place
) -> Iterator[Result]:
    """Yield the probability of each class, as `fuzzytree.model.probabilities` says."""
    weights: list[Place] = []
    for number, strength in enumerate(strengths, 1):
        with make.topic(f"weight of rule {number}"):
            for _ in range(squarings(rules.semantics.sharpness)):
                strength = strength * strength
            weights.append(make("floor", strength * float(WEIGHT_OF_ONE)))
    vectors = [parts_of(one.probabilities) for one in rules.rules]
    zero, owners = make.constant(0.0), [float(_place_of(rules, r)) for r in rules.rules]
    winner = make.table("pick", rule, [-1.0, *owners])
    counts: list[Place] = []
    others: list[Place] = []
    is_own: list[Place] = []
    for code, name in enumerate(rules.classes):
        with make.topic(f"count of {name}"):
            pairs = zip(weights, (vector[code] for vector in vectors), strict=True)
            shares = [weight * float(part) for weight, part in pairs if part]
            counts.append(make.chain("add", shares) if shares else zero)
            is_own.append(make.equal(winner, make.constant(float(code))))
            others.append(make.where(is_own[-1], zero, counts[-1]))
    with make.topic("counts"):
        least = make.chain("maximum", others) + 1.0
        pairs_of = zip(counts, is_own, strict=True)
        counts = [make.where(o, make("maximum", n, least), n) for n, o in pairs_of]
        total = make.chain("add", counts)
    is_none, nothing = make.equal(rule, zero), make.constant(float("nan"))
    for name, count in zip(rules.classes, counts, strict=True):
        share = make.where(is_none, nothing, count / total)
        yield result_of("probability", name, share)


def _place_of(rules: RuleBase, rule: Rule) -> int:
    return rules.classes.index(rule.then)


def _answer(make: Maker, rules: RuleBase, rule: Place) -> Place:
    """Return the class of the winning rule, or the answer where none fires."""
    place = {label: float(number) for number, label in enumerate(rules.classes)}
    uncovered = rules.semantics.uncovered
    none = -1.0 if uncovered is None else place[uncovered]
    return make.table("pick", rule, [none, *(place[r.then] for r in rules.rules)])


def _code(make: Maker, rules: RuleBase) -> Place:
    missing = rules.semantics.missing
    code = -1 if missing is None else rules.classes.index(missing)
    return make.constant(float(code))

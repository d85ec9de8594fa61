"""Rule bases to prove things about, made from a seed."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Literal

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Side as Half

Kind = Literal["lr", "points", "band", "mixed"]


def random_base(
    seed: int,
    rules: int = 7,
    features: int = 4,
    conjunction: Conjunction = "minimum",
    kind: Kind = "lr",
    *,
    classes: int = 0,
    shared: float = 0.0,
    odd: float = 0.0,
    combinations: int = 0,
) -> RuleBase:
    """Return rules with one proposition for each variable, on [0, 1] each.

    Args:
        seed: The same seed makes the same rules.
        rules: How many.
        features: How many inputs, `x1` and so on.
        conjunction: The AND.
        kind: `lr` for the paper's sets with curves of degree six, `points` for
            triangles and trapezoids, `band` for plateaus with flanks, `mixed` for all.
        classes: How many; as many as rules, at most three, if it is 0.
        shared: How likely a proposition uses the term of another rule.
        odd: How likely a proposition is negated, has two terms, or stands twice.
        combinations: How many variables are sums of two inputs.
    """
    chance = random.Random(f"{seed} {rules} {features} {kind}")
    names = [f"x{number}" for number in range(1, features + 1)]
    mixed = [f"mix{number}" for number in range(1, combinations + 1)]
    labels = tuple(f"class {n}" for n in range(1, (classes or min(rules, 3)) + 1))
    terms: dict[str, list[Term]] = {name: [] for name in (*names, *mixed)}
    made = []
    for number in range(rules):
        when = []
        for name in (*names, *mixed):
            when += _propositions(chance, name, terms[name], kind, shared, odd)
        made.append(Rule(tuple(when), labels[number % len(labels)]))
    variables = [
        Variable(name, tuple(terms[name]), low=0.0, high=1.0) for name in names
    ]
    variables += [
        Variable(
            name,
            tuple(terms[name]),
            parts=tuple(
                Part(one, chance.uniform(-1.0, 1.0), chance.random())
                for one in chance.sample(names, 2)
            ),
        )
        for name in mixed
    ]
    return RuleBase(
        f"base {seed}", labels, tuple(variables), tuple(made), Semantics(conjunction)
    )


def unit_domain(rules: RuleBase, low: float = 0.0, high: float = 1.0) -> Domain:
    """Return the box with the same ends for each input."""
    return Domain(tuple(DomainSide(name, low, high) for name in rules.inputs))


def _propositions(
    chance: random.Random,
    name: str,
    terms: list[Term],
    kind: Kind,
    shared: float,
    odd: float,
) -> list[Proposition]:
    def term() -> str:
        if not terms or chance.random() >= shared:
            terms.append(Term(f"term {len(terms) + 1}", random_shape(chance, kind)))
            return terms[-1].name
        return chance.choice(terms).name

    found = [Proposition(name, (term(),))]
    if chance.random() < odd:
        found[0] = Proposition(name, (term(),), hedges=("not",))
    if chance.random() < odd:
        found.append(Proposition(name, tuple({term(): None, term(): None})))
    return found


def random_shape(chance: random.Random, kind: Kind) -> Shape:
    """Return a shape whose degree 1 lies about [0, 1]."""
    makers: dict[str, Callable[[random.Random], Shape]] = {
        "lr": _lr,
        "points": _points,
        "band": _band,
    }
    chosen = chance.choice(list(makers)) if kind == "mixed" else kind
    return makers[chosen](chance)


def _lr(chance: random.Random) -> LR:
    return LR(chance.random(), _half(chance), _half(chance))


def _half(chance: random.Random) -> Half:
    """Return a bell with a ripple, fitted by a polynomial of degree six in t."""
    v = np.cos(np.linspace(0.0, np.pi, 33))[:-1]  # t = 0 is left out
    t = (v + 1.0) / 2.0
    fall = np.exp(-chance.uniform(0.7, 2.5) * t**2)
    ripple = chance.uniform(0.0, 0.05) * np.sin(chance.uniform(4.0, 9.0) * t) * t
    curve = np.polynomial.polynomial.polyfit(v, (1.0 - fall - ripple) / t, 5)
    spread, reach = chance.uniform(0.1, 0.4), chance.uniform(1.5, 5.0)
    return Half(spread, tuple(round(float(c), 9) for c in curve), reach)


def _points(chance: random.Random) -> Points:
    middle, left, right = chance.random(), *(chance.uniform(0.1, 0.7) for _ in "lr")
    if chance.random() < 0.5:
        values = [middle - left, middle, middle + right]
        return Points(tuple(values), (0.0, 1.0, 0.0))
    values = [middle - left, middle, middle + right / 2, middle + right]
    return Points(tuple(values), (0.0, 1.0, 1.0, 0.0))


def _band(chance: random.Random) -> Band:
    low = chance.uniform(-0.1, 0.9)
    high = low + chance.uniform(0.05, 0.3)
    left, right = (
        None if chance.random() < 0.1 else start + sign * chance.uniform(0.1, 0.8)
        for start, sign in ((low, -1), (high, 1))
    )
    return Band(low, high, left, right)


def _curve(chance: random.Random) -> tuple[float, ...]:
    if chance.random() < 0.3:
        return (1.0,)
    b1 = chance.uniform(0.3, 1.0)
    b2 = chance.uniform(0.0, b1)
    # Bernstein coefficients 0, b2, b1, 1 in q: rising, 0 at q = 0, 1 at q = 1.
    return (3 * b2, 3 * b1 - 6 * b2, 1 - 3 * b1 + 3 * b2)


def with_hidden_rule(rules: RuleBase, level: float = 0.9) -> RuleBase:
    """Return rules with three more, of which the last never wins if `level >= 0.7`.

    On the first input it reaches 0.7 at 0.5, where one of the two before it ends and
    the other begins to reach `level`; neither alone suffices. Below 0.7 it wins in a
    sliver about 0.5.
    """
    first, *others = (variable for variable in rules.variables if not variable.parts)
    added: dict[str, tuple[Term, ...]] = {
        first.name: (
            Term("left", Points((0.5, 0.6), (level, 0.0))),
            Term("right", Points((0.4, 0.5), (0.0, level))),
            Term("middle", Points((0.2, 0.5, 0.8), (0.0, 0.7, 0.0))),
        )
    }
    for place, variable in enumerate(others):
        peak = 0.3 + 0.4 * place / len(others)
        narrow = Points((0.1, peak, 0.9), (0.0, 0.8, 0.0))
        added[variable.name] = (
            Term("wide", Points((0.05, peak, 0.95), (0.0, 1.0, 0.0))),
            Term("broad", Points((0.1, peak, 0.9), (0.0, 0.9, 0.0))),
            Term("narrow", narrow),
        )
        if level < 0.7:  # then only the first input tells them apart
            alike = (Term(term.name, narrow) for term in added[variable.name])
            added[variable.name] = tuple(alike)
    variables = tuple(
        replace(variable, terms=(*variable.terms, *added.get(variable.name, ())))
        for variable in rules.variables
    )
    made = tuple(
        Rule(
            tuple(
                Proposition(name, (terms[place].name,)) for name, terms in added.items()
            ),
            rules.classes[0] if place < 2 else rules.classes[1],
        )
        for place in range(3)
    )
    return replace(rules, variables=variables, rules=(*rules.rules, *made))

"""Random rule bases with steps and slopes on one axis, curves, or categories."""

from __future__ import annotations

import random
from typing import Literal

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.model import (
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
    Side,
    Term,
    Variable,
)

Kind = Literal["steps", "curves", "categories"]


def random_base(
    seed: int, kind: Kind = "steps", conjunction: Conjunction = "minimum", sums: int = 0
) -> tuple[RuleBase, Domain]:
    """Return 4 to 9 rules on 1 to 4 inputs, and their domain."""
    chance = random.Random(f"{seed} {kind} {conjunction}")
    inputs = [f"x{n}" for n in range(chance.randint(1, 4))]
    variables: list[Variable] = []
    sides: list[DomainSide] = []
    for n, name in enumerate(inputs):
        terms = tuple(Term(f"t{k}", _shape(chance, kind)) for k in range(4))
        if kind == "categories" and n % 2 == 0:
            values = ("blue", "green", "red", "white", "yellow")
            terms = tuple(Term(f"t{k}", _choice(chance)) for k in range(4))
            variables.append(Variable(name, terms, categories=values, missing=-1.0))
            codes = tuple(map(float, range(5)))
            sides.append(DomainSide(name, 0.0, 4.0, values=codes, missing=-1.0))
        elif kind == "categories":
            missing = chance.choice([None, 5.5, 1.25])
            is_whole = chance.random() < 0.5
            variable = Variable(name, terms, low=0.0, high=4.0, missing=missing)
            variables.append(replace(variable, is_whole=is_whole))
            sides.append(DomainSide(name, 0.0, 4.0, is_whole=is_whole, missing=missing))
        else:
            variables.append(Variable(name, terms, low=0.0, high=4.0))
            sides.append(DomainSide(name, 0.0, 4.0))
    for n in range(sums if len(inputs) > 1 else 0):
        pair = chance.sample(inputs, 2)
        parts = tuple(Part(of, chance.choice([-1.0, 0.5, 1.0, 2.0])) for of in pair)
        terms = tuple(Term(f"t{k}", _shape(chance, kind)) for k in range(4))
        variables.append(Variable(f"s{n}", terms, parts=parts))
    rules = []
    for _ in range(chance.randint(4, 9)):
        names = chance.sample(variables, chance.randint(1, len(variables)))
        when = tuple(_proposition(chance, variable.name) for variable in names)
        rules.append(Rule(when, chance.choice("abc")))
    base = RuleBase(
        f"base {seed}",
        ("a", "b", "c"),
        tuple(variables),
        tuple(rules),
        Semantics(conjunction),
    )
    return base, Domain(tuple(sides))


def _proposition(chance: random.Random, name: str) -> Proposition:
    terms = tuple(chance.sample(["t0", "t1", "t2", "t3"], chance.choice([1, 1, 1, 2])))
    return Proposition(name, terms, ("not",) if chance.random() < 0.25 else ())


def _shape(chance: random.Random, kind: Kind) -> Shape:
    numbers = sorted(round(chance.uniform(-1, 5), 1) for _ in range(4))
    if kind == "curves" and chance.random() < 0.5:
        sides = [Side(chance.uniform(0.3, 1), (1.0, 0.5, -0.2), 2.0) for _ in "ab"]
        return LR(numbers[1], *sides)
    if chance.random() < 0.5 or len(set(numbers)) < 4:
        low, high = sorted({numbers[0], numbers[3]} | {numbers[0] + 1.0})[:2]
        return Band(low, high, *chance.choice([(None, None), (low - 1.0, high + 1.5)]))
    degrees = chance.choice(
        [(0.0, 1.0, 1.0, 0.0), (0.0, 0.8, 0.3, 0.0), (1.0, 0.4, 0.4, 0.2)]
    )
    return Points(tuple(numbers), degrees)


def _choice(chance: random.Random) -> Shape:
    """Return the degrees of five categories."""
    degrees = tuple(chance.choice([0.0, 0.25, 0.5, 1.0, 1.0]) for _ in range(5))
    return Points(tuple(map(float, range(5))), degrees)

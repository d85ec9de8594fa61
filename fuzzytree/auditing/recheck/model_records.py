"""The fields of a model, in the order of its fingerprint."""

# ruff: noqa: D101 - docs/reference/yaml-format.md says what the records hold

from __future__ import annotations

from typing import Any, Literal, NamedTuple


class Band(NamedTuple):
    low: float | None = None
    high: float | None = None
    left: float | None = None
    right: float | None = None


class Side(NamedTuple):
    spread: float
    curve: tuple[float, ...]
    reach: float


class LR(NamedTuple):
    mean: float
    left: Side
    right: Side


class Points(NamedTuple):
    values: tuple[float, ...]
    degrees: tuple[float, ...]


class Curve(NamedTuple):
    """A curve of a fuzzy system that is none of the shapes: its kind and its facts."""

    kind: str
    facts: tuple[tuple[str, Any], ...]


class Scaled(NamedTuple):
    """A shape that is multiplied by a height, and then changed by hedges."""

    shape: Shape
    height: float
    hedges: tuple[str, ...]


Shape = Band | LR | Points | Curve | Scaled


class Term(NamedTuple):
    name: str
    function: Shape
    height: float = 1.0


class Part(NamedTuple):
    input: str
    weight: float
    centre: float = 0.0


class Variable(NamedTuple):
    name: str
    terms: tuple[Term, ...] = ()
    unit: str = ""
    low: float | None = None
    high: float | None = None
    parts: tuple[Part, ...] = ()
    clips: bool = False


class Proposition(NamedTuple):
    variable: str
    terms: tuple[str, ...]
    negated: bool = False


class Rule(NamedTuple):
    when: tuple[Proposition, ...]
    then: str
    support: int | None = None


class Semantics(NamedTuple):
    conjunction: Literal["minimum", "product"]
    uncovered: str | None
    missing: str | None
    label_type: str | None = None  # number or boolean; None for text


class Rules(NamedTuple):
    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    semantics: Semantics
    kind: str | None = None
    columns: tuple[str, ...] = ()


class Leaf(NamedTuple):
    label: str
    pattern: str = ""
    support: int | None = None


class Branch(NamedTuple):
    terms: tuple[str, ...]
    sets: tuple[str, ...]
    node: int | None
    leaf: int | None


class Node(NamedTuple):
    variable: str
    cuts: tuple[float, ...]
    owners: tuple[int, ...]  # the branch of each interval `cuts[i-1] < x <= cuts[i]`
    branches: tuple[Branch, ...]


class Sets(NamedTuple):
    variable: str
    terms: tuple[Term, ...]


class Tree(NamedTuple):
    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    nodes: tuple[Node, ...]
    leaves: tuple[Leaf, ...]
    sets: tuple[Sets, ...]
    semantics: Semantics
    columns: tuple[str, ...] = ()


class Defuzzifier(NamedTuple):
    method: str
    samples: int
    grid: str


class Output(NamedTuple):
    name: str
    terms: tuple[Term, ...]
    low: float | None
    high: float | None
    defuzzifier: Defuzzifier
    aggregation: str | None
    default: float | None
    clips: bool = False
    unit: str = ""


class Is(NamedTuple):
    variable: str
    label: str | None
    hedges: tuple[str, ...]


class And(NamedTuple):
    parts: tuple[Condition, ...]


class Or(NamedTuple):
    parts: tuple[Condition, ...]


class Not(NamedTuple):
    part: Condition


Condition = Is | And | Or | Not


class Conclusion(NamedTuple):
    output: str
    label: str
    hedges: tuple[str, ...]


class SystemRule(NamedTuple):
    when: Condition | None
    then: tuple[Conclusion, ...]
    weight: float = 1.0
    name: str = ""


class Activation(NamedTuple):
    method: str
    count_: int = 1  # `count` is a method of tuples
    threshold: float = 0.0
    relation: str = ">="


class Block(NamedTuple):
    rules: tuple[SystemRule, ...]
    conjunction: str | None
    disjunction: str | None
    implication: str | None
    activation: Activation
    name: str = ""


class System(NamedTuple):
    name: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Output, ...]
    blocks: tuple[Block, ...]
    note: str = ""


Model = Rules | Tree

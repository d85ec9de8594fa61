"""The fields of a model, in the order of its fingerprint."""

# ruff: noqa: D101 - docs/yaml-format.md says what the records hold

from __future__ import annotations

from typing import Literal, NamedTuple


class Flank(NamedTuple):
    start: float
    end: float
    curve: tuple[float, ...]
    error: float | None


class Band(NamedTuple):
    low: float | None
    high: float | None
    left: Flank | None
    right: Flank | None


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


Shape = Band | LR | Points


class Term(NamedTuple):
    name: str
    shape: Shape


class Part(NamedTuple):
    input: str
    weight: float
    centre: float


class Variable(NamedTuple):
    name: str
    terms: tuple[Term, ...]
    unit: str
    low: float | None
    high: float | None
    parts: tuple[Part, ...]


class Clause(NamedTuple):
    variable: str
    terms: tuple[str, ...]
    negated: bool = False


class Rule(NamedTuple):
    when: tuple[Clause, ...]
    then: str
    support: int | None


class Semantics(NamedTuple):
    conjunction: Literal["min", "product"]
    uncovered: str | None
    missing: str | None


class Rules(NamedTuple):
    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    semantics: Semantics
    kind: str | None
    columns: tuple[str, ...]


class Leaf(NamedTuple):
    label: str
    pattern: str
    support: int | None


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
    columns: tuple[str, ...]


Model = Rules | Tree

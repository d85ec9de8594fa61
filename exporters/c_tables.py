"""A rule base or a tree as lists of numbers, for generated C and its self-test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fuzzytree.exporters.c_text import CNumbers
from fuzzytree.exporters.program_text import TreeTest, places_of, tree_tests
from fuzzytree.model import (
    LR,
    Band,
    FuzzyTree,
    Model,
    Points,
    Proposition,
    RuleBase,
    Shape,
    Side,
    outline,
    sentence,
    shapes_of,
)

LOW_END, HIGH_END, LEFT_SIDE, RIGHT_SIDE, POINTS = range(5)


@dataclass(slots=True)
class RulePrefixes:
    """The beginnings of all rules, each once, in the order of a walk.

    Attributes:
        proposition: The last proposition of each.
        skip: The place behind all that begin with it.
        rule: The rule that it is the whole of, from 1, or 0.
        depth: How many propositions it has.
    """

    proposition: list[int] = field(default_factory=list[int])
    skip: list[int] = field(default_factory=list[int])
    rule: list[int] = field(default_factory=list[int])
    depth: list[int] = field(default_factory=list[int])


@dataclass(slots=True)
class Tables:
    """A rule base as lists of numbers, which C and Python read alike.

    An atom is one end of a band, one side of an LR set, or points; the degree of a term
    is the smallest of its atoms, of a proposition the largest of its terms.

    Attributes:
        number: The numbers of all atoms.
        kind: The kind of each atom.
        count: How many numbers, coefficients or points it has.
        first: Where its numbers begin.
        term_first: Where the atoms of each term begin; one more entry than terms.
        proposition_line: The value that each proposition tests.
        proposition_first: Where the terms of each proposition begin; one more entry.
        proposition_term: The terms of all propositions.
        negated: 1 where a proposition is negated.
        places: The rules.
        label: The class of each rule.
    """

    number: list[float]
    kind: list[int]
    count: list[int]
    first: list[int]
    term_first: list[int]
    proposition_line: list[int]
    proposition_first: list[int]
    proposition_term: list[int]
    negated: list[int]
    places: RulePrefixes
    label: list[int]


_ALWAYS = Proposition("", ())


def tables_of(rules: RuleBase, line: Mapping[str, int], numbers: CNumbers) -> Tables:
    """Return a rule base as lists of numbers of a type."""
    shapes = shapes_of(rules.variables)
    places, propositions = _places(rules)
    keys = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    at = {key: place for place, key in enumerate(keys)}
    labels = {label: place for place, label in enumerate(rules.classes)}
    result = Tables([], [], [], [], [0], [], [0], [], [], places, [])
    for key in keys:
        _add_term(result, shapes[key], numbers)
    for proposition in propositions:
        result.proposition_line.append(line.get(proposition.variable, 0))
        result.proposition_term += [
            at[proposition.variable, term] for term in proposition.terms
        ]
        result.proposition_first.append(len(result.proposition_term))
        result.negated.append(int(proposition.negated))
    result.label = [labels[rule.then] for rule in rules.rules]
    return result


def _places(rules: RuleBase) -> tuple[RulePrefixes, list[Proposition]]:
    """Return the tree of the rules' beginnings, and the distinct propositions.

    A rule whose propositions are another's beginning gets a place of its own below,
    whose proposition always holds.
    """
    children: list[dict[Proposition, int]] = [{}]
    ending: list[list[int]] = [[]]
    for number, one in enumerate(rules.rules, 1):
        here = 0
        for proposition in one.when:
            if proposition not in children[here]:
                children[here][proposition] = len(children)
                children.append({})
                ending.append([])
            here = children[here][proposition]
        ending[here].append(number)
    propositions: dict[Proposition, int] = {}
    result = RulePrefixes()
    todo: list[
        tuple[Proposition, int, int, int]
    ] = []  # proposition, fork or -1, rule, depth

    def expand(fork: int, depth: int) -> None:
        own = ending[fork] if fork == 0 or children[fork] else ending[fork][1:]
        below = [(_ALWAYS, -1, rule, depth) for rule in own]
        for proposition, child in children[fork].items():
            is_whole = not children[child]
            below.append(
                (proposition, child, ending[child][0] if is_whole else 0, depth)
            )
        todo.extend(reversed(below))

    expand(0, 1)
    while todo:
        proposition, fork, rule, depth = todo.pop()
        result.proposition.append(
            propositions.setdefault(proposition, len(propositions))
        )
        result.rule.append(rule)
        result.depth.append(depth)
        if fork >= 0:
            expand(fork, depth + 1)
    _add_skips(result)
    return result, list(propositions)


def _add_skips(places: RulePrefixes) -> None:
    places.skip = [len(places.depth)] * len(places.depth)
    open_ones: list[int] = []
    for place, depth in enumerate(places.depth):
        while open_ones and places.depth[open_ones[-1]] >= depth:
            places.skip[open_ones.pop()] = place
        open_ones.append(place)


def _add_term(result: Tables, shape: Shape, numbers: CNumbers) -> None:
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            ends = ((LOW_END, low, left), (HIGH_END, high, right))
            for kind, bound, end in ends:
                if bound is not None:
                    own = _edge(bound, end, numbers)
                    _add(result, kind, len(own), own)
        case LR(mean=mean, left=below, right=above):
            for kind, sign, side in (
                (LEFT_SIDE, -1.0, below),
                (RIGHT_SIDE, 1.0, above),
            ):
                _add(result, kind, len(side.curve), _side(mean, sign, side, numbers))
        case Points(values=values):
            _add(result, POINTS, len(values), _points(shape, numbers))
    result.term_first.append(len(result.kind))


def _add(result: Tables, kind: int, count: int, own: list[float]) -> None:
    result.kind.append(kind)
    result.count.append(count)
    result.first.append(len(result.number))
    result.number += own


def _edge(bound: float, end: float | None, numbers: CNumbers) -> list[float]:
    """Return the bound; with a flank also its end and its width."""
    if end is None:
        return numbers.rounded([bound])
    return [
        *numbers.rounded([bound, end]),
        *numbers.rounded([bound - end], is_divisor=True),
    ]


def _side(mean: float, sign: float, side: Side, numbers: CNumbers) -> list[float]:
    """Return mean, signed spread, reach, length of the tail, and the curve."""
    return [
        *numbers.rounded([mean]),
        *numbers.rounded([sign * side.spread], is_divisor=True),
        *numbers.rounded([side.reach]),
        *numbers.rounded([side.reach - 1.0], is_divisor=True),
        *numbers.rounded(side.curve),
    ]


def _points(points: Points, numbers: CNumbers) -> list[float]:
    """Return the values of points, then their degrees; below 1 they stay below 1."""
    degrees = [
        min(near, numbers.below_one) if exact < 1.0 else near
        for exact, near in zip(
            points.degrees, numbers.rounded(points.degrees), strict=True
        )
    ]
    return [*numbers.rounded(points.values), *degrees]


class CModel:
    """A model with the tables of its file.

    Attributes:
        model: The model.
        numbers: The type of its numbers.
        line: The place of each variable's value.
        tests: Of a tree.
        tables: Of a rule base, else None.
        outline: The rules or the tree for people, a line each.
    """

    def __init__(self, model: Model, numbers: CNumbers) -> None:
        self.model, self.numbers = model, numbers
        self.line = places_of(model.variables)
        self.tests: list[TreeTest] = []
        self.tables: Tables | None = None
        match model:
            case RuleBase():
                self.tables = tables_of(model, self.line, numbers)
                sentences = map(sentence, model.rules)
                self.outline = [f"{k}. {text}" for k, text in enumerate(sentences, 1)]
            case FuzzyTree():
                self.tests = tree_tests(model)
                self.outline = [*outline(model)]

"""A tree or rule base as rows of numbers and names, for the functions of the reference.

Generated Python and JavaScript hold these rows as literals and read them alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.model import (
    LR,
    Band,
    Flank,
    FuzzyTree,
    Node,
    Points,
    RuleBase,
    Shape,
    Side,
    Variable,
    intervals,
    shapes_of,
)

Row = tuple[object, ...]


def places_of(variables: Sequence[Variable]) -> dict[str, int]:
    """Return the place of each variable's value: inputs first, then combinations."""
    inputs = [variable.name for variable in variables if not variable.parts]
    mixed = [variable.name for variable in variables if variable.parts]
    return {name: place for place, name in enumerate([*inputs, *mixed])}


def combination_row(variable: Variable, places: dict[str, int]) -> Row:
    """Return the place of an input, weight and centre of each part."""
    return tuple((places[p.input], p.weight, p.centre) for p in variable.parts)


def targets_of(node: Node) -> tuple[int, ...]:
    """Return, for each interval, the place of the next node or -k for leaf k."""
    ends = [
        -branch.leaf if branch.leaf is not None else (branch.node or 0) - 1
        for branch in node.branches
    ]
    return tuple(ends[owner] for owner in node.owners)


def node_rows(
    tree: FuzzyTree, places: dict[str, int]
) -> Iterator[tuple[Row, Node, list[str]]]:
    """Yield each node's place of the value, cuts and targets; and its terms' names."""
    for node in tree.nodes:
        counts = [0] * len(node.branches)
        names: list[str] = []
        for owner, _ in zip(node.owners, intervals(node), strict=True):
            names.append(node.branches[owner].terms[counts[owner]])
            counts[owner] += 1
        yield (places[node.variable], node.cuts, targets_of(node)), node, names


class RuleRows:
    """A rule base as rows.

    Attributes:
        clauses: The place of the value, the places of terms, and if it is negated.
        rules: The places of each rule's clauses.
        terms: Variable and name of each term, and its kind and numbers.
    """

    def __init__(self, rules: RuleBase, places: dict[str, int]) -> None:
        shapes = shapes_of(rules.variables)
        clauses = list(dict.fromkeys(c for rule in rules.rules for c in rule.when))
        keys = dict.fromkeys((c.variable, term) for c in clauses for term in c.terms)
        term = {key: place for place, key in enumerate(keys)}
        clause = {one: place for place, one in enumerate(clauses)}
        self.clauses: list[Row] = [
            (
                places[one.variable],
                tuple(term[one.variable, name] for name in one.terms),
                one.negated,
            )
            for one in clauses
        ]
        self.rules = [tuple(clause[one] for one in rule.when) for rule in rules.rules]
        self.terms = [(*key, _shape_row(shapes[key])) for key in keys]


def _shape_row(shape: Shape) -> Row:
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            return "band", low, high, _flank(left), _flank(right)
        case LR(mean=mean, left=left, right=right):
            return "lr", mean, _side(left), _side(right)
        case Points(values=values, degrees=degrees):
            return "points", values, degrees


def _flank(flank: Flank | None) -> Row | None:
    return None if flank is None else (flank.start, flank.end, flank.curve)


def _side(side: Side) -> Row:
    return side.spread, side.reach, side.curve

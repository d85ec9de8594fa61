"""How a model that was read back stands to the one that was written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, get_args

from msgspec.structs import replace

from fuzzytree.checking.anonymous import anonymous
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Document, Reading, Written
from fuzzytree.model.rulebase import (
    Band,
    Points,
    RuleBase,
    Shape,
    Term,
    fingerprint,
    shapes_of,
)
from fuzzytree.model.system import (
    Condition,
    Curve,
    FuzzySystem,
    Is,
    Trapezoid,
    questions,
)
from fuzzytree.semantics.conversion import Scores, as_system
from fuzzytree.semantics.conversion.points import EXACT, straightened
from fuzzytree.semantics.probing import landmarks
from fuzzytree.semantics.reference import degree

Likeness = Literal["equal", "alike", "renamed", "other"]


def likeness(model: Document, written: Written, again: Reading) -> Likeness:
    """Return how what was read back stands to what was written.

    Args:
        model: What was written.
        written: The file.
        again: What it was read as.

    Returns:
        `equal` in every number and name; `alike` but for names, notes and units, or
        lines that became points, of which remarks were made; `renamed`, the same
        without a remark; or `other`.
    """
    if fingerprint(again.model) == fingerprint(model):
        return "equal"
    if not is_alike(model, again.model):
        return "other"
    return "alike" if written.remarks or again.remarks else "renamed"


def is_alike(model: Document, other: Document) -> bool:
    """Return whether two models answer alike by their form, whatever they are called.

    A rule base is like each of the systems that decide alike, and straight curves are
    like the points that have their degrees to 2^-52.
    """
    mark = _mark(other)
    if any(_mark(one) == mark for one in _stand_ins(model)):
        return True
    if isinstance(model, RuleBase) and isinstance(other, RuleBase):
        return _have_the_same_lines(model, other)
    return False


def _mark(model: Document) -> str:
    if isinstance(model, FuzzySystem):
        model = _settled(model)
    return fingerprint(anonymous(model))


def _settled(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules ask nothing where the answer is always 1.

    Formats without rules that always hold ask a term of degree 1 everywhere; it goes
    too, unless another rule asks it. A missing value answers NaN either way.
    """
    everywhere = {
        (one.name, label.name)
        for one in system.inputs
        for label in one.labels
        if label.height == 1.0 and _is_everywhere(label.curve)
    }

    def asks(when: Condition | None) -> Condition | None:
        match when:
            case Is(variable=name, label=label, hedges=()) if (
                label is not None and (name, label) in everywhere
            ):
                return None
            case Is(label=None, hedges=("any",)):
                return None
            case _:
                return when

    blocks = tuple(
        replace(
            block,
            rules=tuple(replace(rule, when=asks(rule.when)) for rule in block.rules),
        )
        for block in system.blocks
    )
    if blocks == system.blocks:
        return system
    asked = {
        (one.variable, one.label)
        for block in blocks
        for rule in block.rules
        for one in questions(rule.when)
    }
    idle = everywhere - asked
    inputs = tuple(
        replace(
            one, labels=tuple(x for x in one.labels if (one.name, x.name) not in idle)
        )
        for one in system.inputs
    )
    return replace(system, inputs=inputs, blocks=blocks)


def _is_everywhere(curve: Curve) -> bool:
    match curve:
        case Band(low=None, high=None) | Trapezoid(a=None, d=None):
            return True
        case Points(degrees=degrees):
            return set(degrees) == {1.0}
        case _:
            return False


def _have_the_same_lines(one: RuleBase, other: RuleBase) -> bool:
    """Return whether two rule bases differ by nothing but how lines are written."""
    first, second = anonymous(one), anonymous(other)
    assert isinstance(first, RuleBase)  # it keeps the kind of a model
    assert isinstance(second, RuleBase)
    left, right = shapes_of(first.variables), shapes_of(second.variables)
    if left.keys() != right.keys() or _bare(first) != _bare(second):
        return False
    return all(
        shape == right[place] or _is_same_line(shape, right[place])
        for place, shape in left.items()
    )


def _bare(rules: RuleBase) -> RuleBase:
    variables = tuple(
        replace(v, terms=tuple(Term(term.name, Band()) for term in v.terms))
        for v in rules.variables
    )
    return replace(rules, variables=variables)


def _is_same_line(one: Shape, other: Shape) -> bool:
    """Return whether two polylines have the same degrees at every double, to 2^-52.

    Between two neighbouring landmarks of either both are lines, so they are the same
    where they agree at the doubles beside both landmarks. Where one is exactly 1 or 0,
    the other is so too: decisions of relative rules hang on that.
    """
    if not (_is_polyline(one) and _is_polyline(other)):
        return False
    marks = {*landmarks(one), *landmarks(other), 0.0}
    beside = {
        value
        for mark in marks
        for far in (-math.inf, math.inf)
        for near in (math.nextafter(mark, far),)
        for value in (mark, near, math.nextafter(near, far))
    }
    pairs = [(degree(one, x), degree(other, x)) for x in beside if math.isfinite(x)]
    return all(
        abs(a - b) <= EXACT and (a == 1.0) == (b == 1.0) and (a == 0.0) == (b == 0.0)
        for a, b in pairs
    )


def _is_polyline(shape: Shape) -> bool:
    if isinstance(shape, Band):
        flanks = (shape.left, shape.right)
        return all(flank is None or len(flank.curve) == 1 for flank in flanks)
    return isinstance(shape, Points)


def _stand_ins(model: Document) -> Iterator[Document]:
    """Yield what a file may hold in the place of a model, deciding alike."""
    yield model
    if isinstance(model, FuzzySystem):
        straight = straightened(model)
        if straight is not None:
            yield straight
    if isinstance(model, RuleBase):
        for one in filter(None, (model, straightened(model))):
            yield one
            yield from _systems(one)


def _systems(rules: RuleBase) -> Iterator[FuzzySystem]:
    for scores in get_args(Scores):
        try:
            yield as_system(rules, scores)
        except LossError:
            continue

"""How a model that was read back stands to the one that was written."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Literal, cast, get_args

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Band,
    Condition,
    Curve,
    Document,
    FuzzySystem,
    Points,
    Proposition,
    Reading,
    RuleBase,
    Term,
    Trapezoid,
    Written,
    fingerprint,
    questions,
)
from fuzzytree.semantics import Scores, as_system, canonical_form, points_once

Likeness = Literal["equal", "alike", "renamed", "other"]


def equivalence(model: Document, written: Written, again: Reading) -> Likeness:
    """Return how what was read back stands to what was written.

    Returns:
        `equal` in every number and name; `alike` but for names, notes and units, of
        which remarks were made; `renamed`, the same without a remark; or `other`.
    """
    if fingerprint(again.model) == fingerprint(model):
        return "equal"
    if not is_equivalent(model, again.model):
        return "other"
    return "alike" if written.remarks or again.remarks else "renamed"


def is_equivalent(model: Document, other: Document) -> bool:
    """Return whether two models answer alike by their form, whatever they are called.

    A rule base is like each of the systems that decide alike, and a band is like the
    points that stand for it in a file (`band_of`).
    """
    mark = _mark(other)
    return any(_mark(one) == mark for one in _stand_ins(model))


def with_functions(model: Document, change: Callable[[Curve], Curve]) -> Document:
    """Return a model whose inputs have other membership functions."""

    def term(old: Term) -> Term:
        return replace(old, function=change(old.function))

    variables = (replace(v, terms=tuple(map(term, v.terms))) for v in model.variables)
    return replace(model, variables=tuple(variables))


def as_points_once(curve: Curve) -> Curve:
    """Return points in which one that stands twice stands once, as FLL has them."""
    return points_once(curve) if isinstance(curve, Points) else curve


def _mark(model: Document) -> str:
    if model.outputs:
        model = _settled(cast("FuzzySystem", model))
    return fingerprint(canonical_form(model))


def _settled(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules ask nothing where the answer is always 1.

    Formats without rules that always hold ask a term of degree 1 everywhere; it goes
    too, unless another rule tests it. A missing value answers NaN either way.
    """
    everywhere = {
        (one.name, label.name)
        for one in system.variables
        for label in one.terms
        if label.height == 1.0 and _is_everywhere(label.function)
    }

    def reduced(when: Condition | None) -> Condition | None:
        match when:
            case Proposition(variable=name, term=label, hedges=()) if (
                label is not None and (name, label) in everywhere
            ):
                return None
            case Proposition(term=None, hedges=("any",)):
                return None
            case _:
                return when

    blocks = tuple(
        replace(
            block,
            rules=tuple(replace(rule, when=reduced(rule.when)) for rule in block.rules),
        )
        for block in system.blocks
    )
    if blocks == system.blocks:
        return system
    used = {
        (one.variable, one.term)
        for block in blocks
        for rule in block.rules
        for one in questions(rule.when)
    }
    idle = everywhere - used
    inputs = tuple(
        replace(
            one, terms=tuple(x for x in one.terms if (one.name, x.name) not in idle)
        )
        for one in system.variables
    )
    return replace(system, variables=inputs, blocks=blocks)


def _is_everywhere(curve: Curve) -> bool:
    match curve:
        case Band(low=None, high=None) | Trapezoid(a=None, d=None):
            return True
        case Points(degrees=degrees):
            return set(degrees) == {1.0}
        case _:
            return False


def _stand_ins(model: Document) -> Iterator[Document]:
    """Yield what a file may hold in the place of a model, deciding alike."""
    yield model
    if model.rules and not model.outputs:
        for scores in get_args(Scores):
            with contextlib.suppress(LossError):
                yield as_system(cast("RuleBase", model), scores)

"""Models up to names: one form for all that answer alike by how they are made."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from msgspec.structs import replace

from fuzzytree.model import (
    And,
    Band,
    Call,
    Conclusion,
    Condition,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Hedge,
    Leaf,
    Name,
    Node,
    Not,
    Or,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Sets,
    Shape,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    combined,
    joints,
)
from fuzzytree.semantics.conversion.joint_terms import operands
from fuzzytree.semantics.conversion.points import band_of, shape_of, stepped

Names = Mapping[str, str]


class _NewNames(NamedTuple):
    """The new names of a model's parts, by their old ones.

    Attributes:
        variables: Of the variables.
        terms: Of the terms of each variable.
        sets: Of the fitted sets of each variable of a tree.
        classes: Of the classes; None stays None.
    """

    variables: Names
    terms: Mapping[str, Names]
    sets: Mapping[str, Names]
    classes: Mapping[str | None, str | None]


def canonical_form(model: Document) -> Document:
    """Return a model whose parts are called by their places: `v1`, `t1`, `c1`.

    Units, notes, supports, training columns and the origin of terms are left out, and
    ranges where no value is moved into them and no curve is looked at in them. Curves
    with the same degrees at every double are alike, and so are conditions that min or
    max joins in another order; norms that no rule uses are left out.

    Example:
        >>> from fuzzytree.model.rulebase import RuleBase, Rule, Variable
        >>> one = RuleBase("a", ("x",), (Variable("p"),), (Rule((), "x"),))
        >>> two = RuleBase("b", ("y",), (Variable("q", unit="mm"),), (Rule((), "y"),))
        >>> canonical_form(one) == canonical_form(two)
        True
    """
    terms = {one.name: one.terms for one in model.variables}
    terms |= {output.name: output.terms for output in model.outputs}
    names = _NewNames(
        _numbered("v", terms),
        {name: _numbered("t", (t.name for t in own)) for name, own in terms.items()},
        {s.variable: _numbered("t", (t.name for t in s.terms)) for s in model.sets},
        {None: None} | {name: f"c{k}" for k, name in enumerate(model.classes, 1)},
    )
    form: Document = _renamed(model, names)
    return form


def _numbered(letter: str, names: Iterable[str]) -> Names:
    return {name: f"{letter}{k}" for k, name in enumerate(names, 1)}


def _renamed(part: Any, names: _NewNames) -> Any:
    """Return a model or a part with new names, without what decides nothing."""

    def new(one: Any) -> Any:
        return _renamed(one, names)

    match part:
        case tuple():
            return tuple(map(new, part))
        case RuleBase() | FuzzyTree():
            classes = tuple(filter(None, names.classes.values()))
            keys = ("variables", "semantics", *_OWN[type(part)])
            parts = {key: new(getattr(part, key)) for key in keys}
            return type(part)(name="m", classes=classes, **parts)
        case FuzzySystem():
            blocks = tuple(_block(one, part, names) for one in part.blocks)
            return FuzzySystem("m", new(part.variables), new(part.outputs), blocks)
        case Semantics(uncovered=uncovered, missing=missing):
            answers = names.classes[uncovered], names.classes[missing]
            return Semantics(part.conjunction, *answers)
        case Variable(name=name, terms=terms):
            return Variable(
                names.variables[name],
                _terms(terms, names.terms[name], names, are_numbers=False),
                low=part.low if part.clips else None,
                high=part.high if part.clips else None,
                clips=part.clips,
                parts=new(part.parts),
                categories=part.categories,
                missing=part.missing,
            )
        case Sets(variable=name, terms=terms):
            renamed = _terms(terms, names.sets[name], names, are_numbers=False)
            return Sets(names.variables[name], renamed)
        case Part():
            return Part(names.variables[part.input], part.weight, part.centre)
        case Rule():
            return Rule(new(part.when), names.classes[part.then] or "")
        case Proposition(variable=name):
            known = names.terms[name]
            alternatives = tuple(known[term] for term in part.terms)
            hedges = _hedges(part.hedges)
            return Proposition(names.variables[name], alternatives, hedges)
        case Node(variable=name):
            known, sets = names.terms[name], names.sets.get(name)
            branches = tuple(
                replace(
                    one,
                    terms=tuple(known[term] for term in one.terms),
                    sets=tuple(sets[term] for term in one.sets) if sets else (),
                )
                for one in part.branches
            )
            return Node(names.variables[name], part.cuts, part.owners, branches)
        case Leaf():
            return Leaf(names.classes[part.label] or "")
        case _:
            return _renamed_system(part, names)


_OWN: Mapping[type[Document], tuple[str, ...]] = {
    RuleBase: ("rules",),
    FuzzyTree: ("nodes", "leaves", "sets"),
}
"""The parts of a model beside variables and semantics."""


def points_once(points: Points) -> Points:
    """Return points in which one that stands twice stands once."""
    pairs = dict.fromkeys(zip(points.values, points.degrees, strict=True))
    return Points(tuple(x for x, _ in pairs), tuple(y for _, y in pairs))


def _shape(shape: Shape) -> Shape:
    """Return one shape for all that have its degrees; a band for its points."""
    if isinstance(shape, Points):
        shape = points_once(Points(stepped(shape.values), shape.degrees))
    band = band_of(shape) or shape
    if not isinstance(band, Band):
        return shape
    if band.left is not None and math.nextafter(band.left, math.inf) == band.low:
        band = replace(band, left=None)  # no double lies on the flank
    if band.right is not None and math.nextafter(band.right, -math.inf) == band.high:
        band = replace(band, right=None)
    return band


def _renamed_system(part: Any, names: _NewNames) -> Any:
    """Return a part of a fuzzy system likewise."""

    def new(one: Any) -> Any:
        return _renamed(one, names)

    match part:
        case SystemOutput(name=name, defuzzifier=how):
            is_free = how.is_weighted and not part.clips
            return replace(
                part,
                name=names.variables[name],
                terms=_terms(
                    part.terms, names.terms[name], names, are_numbers=how.is_weighted
                ),
                low=None if is_free else part.low,
                high=None if is_free else part.high,
                defuzzifier=type(how)(how.method) if how.is_weighted else how,
                unit="",
            )
        case Formula(expression=expression):
            return Formula(new(expression))
        case Name(name=name):
            return Name(name if name == "x" else names.variables.get(name, name))
        case Call(function=function, arguments=arguments):
            return Call(function, new(arguments))
        case And(parts=parts) | Or(parts=parts):
            return type(part)(new(parts))
        case Not(part=Proposition() as inner):
            return new(replace(inner, hedges=("not", *inner.hedges)))
        case Not(part=inner):
            return Not(new(inner))
        case Conclusion(output=output, term=label):
            label = names.terms[output][label]
            return Conclusion(names.variables[output], label, _hedges(part.hedges))
        case _:
            return part


def _terms(
    terms: tuple[Term, ...], renamed: Names, names: _NewNames, *, are_numbers: bool
) -> tuple[Term, ...]:
    results: list[Term] = []
    for one in terms:
        curve = _renamed_system(one.function, names)
        shape = None if are_numbers or curve is not one.function else shape_of(curve)
        curve = curve if shape is None else _shape(shape)
        results.append(replace(one, name=renamed[one.name], function=curve))
    return tuple(results)


def _block(block: RuleBlock, system: FuzzySystem, names: _NewNames) -> RuleBlock:
    rules = tuple(
        SystemRule(
            rule.when and _ordered(_renamed(rule.when, names), block),
            _renamed(rule.then, names),
            rule.weight,
        )
        for rule in block.rules
    )
    kinds = [one for rule in rules for one in joints(rule.when)]
    looked_at = {o.name for o in system.outputs if not o.defuzzifier.is_weighted}
    concluded = {one.output for rule in block.rules for one in rule.then}
    return replace(
        block,
        rules=rules,
        conjunction=block.conjunction if And in kinds else None,
        disjunction=block.disjunction if Or in kinds else None,
        implication=block.implication if looked_at & concluded else None,
        name="",
    )


def _ordered(condition: Condition, block: RuleBlock) -> Condition:
    """Return a condition whose parts stand in order where it changes no bit.

    An AND at the beginning of an AND is one AND with it, under min anywhere; the same
    holds for OR and max.
    """
    match condition:
        case Not(part=part):
            return Not(_ordered(part, block))
        case And(parts=parts) | Or(parts=parts):
            kind = type(condition)
            joined = kind(tuple(_ordered(part, block) for part in parts))
            ordered = operands(joined, block)
            norm = block.conjunction if kind is And else block.disjunction
            if norm in ("minimum", "maximum"):
                ordered.sort(key=repr)
            return combined(kind, ordered)
        case _:
            return condition


def _hedges(hedges: tuple[Hedge, ...]) -> tuple[Hedge, ...]:
    """Return hedges with `very very` as two: both are the square of the square."""
    twice: tuple[Hedge, ...] = ("very", "very")
    plain: list[Hedge] = []
    for hedge in hedges:
        plain.extend(twice if hedge == "very very" else (hedge,))
    return tuple(plain)

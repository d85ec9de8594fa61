"""Records of a file to parts of the model; the model checks what they mean together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import get_args

import msgspec
from msgspec.structs import astuple

from fuzzytree.formats.formulas import FormulaError, parse
from fuzzytree.formats.text_files import MOST_SHOWN
from fuzzytree.formats.yaml import layout
from fuzzytree.formats.yaml.binding import shortened
from fuzzytree.formats.yaml.conditions import (
    SentenceError,
    parse_conclusions,
    parse_condition,
)
from fuzzytree.model import (
    LR,
    PARTS,
    Activation,
    And,
    Band,
    Binary,
    Branch,
    Condition,
    Curve,
    Defuzzifier,
    Formula,
    Leaf,
    Mistake,
    Node,
    Part,
    Path,
    Points,
    Probabilities,
    RuleBlock,
    Semantics,
    Sets,
    Shape,
    Side,
    Sigmoid,
    SystemCurve,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
    combined,
    name_choice,
    parts_of,
)


def variable(
    path: Path, one: layout.VariableOfModel, mistakes: list[Mistake]
) -> Variable:
    """Return an input or a combination."""
    low, high, clips = range_of(one.range)
    return Variable(
        name=one.name,
        terms=terms(path, one.terms, mistakes),
        unit=one.unit or "",
        low=low,
        high=high,
        parts=tuple(Part(p.input, p.weight, p.centre) for p in one.sum_of),
        clips=clips,
        categories=one.categories,
        missing=one.missing_as,
        is_whole=one.numbers == "whole",
    )


def bare_variable(name: str, terms: Sequence[str]) -> Variable:
    """Return a variable of which only names are known."""
    return Variable(name, tuple(Term(one, Band()) for one in terms))


def output(
    path: Path, one: layout.OutputOfSystem, mistakes: list[Mistake]
) -> SystemOutput:
    """Return an output of a system."""
    low, high, clips = range_of(one.range)
    how = Defuzzifier(one.defuzzifier, one.samples, one.grid)
    labels = terms(path, one.terms, mistakes)
    return SystemOutput(
        *(one.name, labels, low, high, how, one.aggregation, one.default),
        clips=clips,
        unit=one.unit or "",
    )


def bare_output(name: str, terms: Sequence[str]) -> SystemOutput:
    """Return an output of which only names are known."""
    labels = bare_variable(name, terms).terms
    return SystemOutput(name, labels, None, None, Defuzzifier("weighted sum"))


def range_of(
    one: layout.RangeOfVariable | None,
) -> tuple[float | None, float | None, bool]:
    """Return both ends of a range, and whether it clips."""
    return (
        (None, None, False) if one is None else (one.from_, one.to, bool(one.outside))
    )


def terms(
    path: Path, terms: Sequence[layout.TermOfVariable], mistakes: list[Mistake]
) -> tuple[Term, ...]:
    """Return terms; that of a wrong formula stands for any."""
    results: list[Term] = []
    for index, one in enumerate(terms):
        curve = _curve(one)
        if one.formula is not None and len(mistakes) < MOST_SHOWN:
            try:
                curve = Formula(parse(one.formula))
            except FormulaError as error:
                text = f"term {one.name!r}, character {error.column}: {error.sentence}"
                mistakes.append(((*path, "terms", index, "formula"), text))
        results.append(Term(one.name, curve, one.height))
    return tuple(results)


def _curve(one: layout.TermOfVariable) -> Curve:
    """Return the one curve that is given; the layout has checked its form."""
    if one.trapezoid is not None:
        return _trapezoid(*one.trapezoid)
    if one.triangle is not None:
        a, b, d = one.triangle
        return Trapezoid(a, b, b, d)
    if one.at_least is not None:
        return Binary(one.at_least)
    if one.at_most is not None:
        return Binary(one.at_most, is_above=False)
    for kind in get_args(SystemCurve):
        field = str(kind.__struct_config__.tag).replace(" ", "_")
        value = getattr(one, field, None)
        if value is not None and kind is not Formula:
            curve: Curve = kind(*_arguments(value))
            return curve
    return _shape(one)


def _arguments(value: object) -> tuple[object, ...]:
    """Return the numbers of a curve, and the sigmoids that it consists of."""
    match value:
        case layout.FileRecord():
            return astuple(value)
        case tuple():
            both = layout.SigmoidCurve
            return tuple(
                Sigmoid(*astuple(v)) if isinstance(v, both) else v for v in value
            )
        case _:
            return (value,)


def _trapezoid(a: float, b: float, c: float, d: float) -> Trapezoid:
    return Trapezoid(None if a == -math.inf else a, b, c, None if d == math.inf else d)


def _shape(one: layout.TermOfVariable) -> Shape:
    """Return the shape of a term."""
    if one.points is not None:
        pairs = zip(*one.points, strict=True)
        return Points(*map(tuple, pairs))
    if one.mean is None:
        return Band(one.above, one.up_to, one.zero_up_to, one.zero_from)
    if one.left is not None and one.right is not None:
        return LR(one.mean, _side(one.left), _side(one.right))
    # The layout's forms demand these three where the sides are not given.
    spread, curve, reach = one.spread or 0.0, one.curve or (), one.reach or 0.0
    side = Side(spread, curve, reach)
    return LR(one.mean, side, side)


def _side(side: layout.HalfSet) -> Side:
    return Side(side.spread, side.curve, side.reach)


def semantics(value: layout.RuleSemantics | layout.TreeSemantics | None) -> Semantics:
    """Return the semantics, the defaults if there are none."""
    if value is None:
        return Semantics()
    return Semantics(
        value.and_,
        _answer(value.uncovered),
        _answer(value.missing),
        value.label_type or msgspec.UNSET,
        value.sharpness or msgspec.UNSET,
        msgspec.UNSET if value.floor is None else value.floor,
    )


def _answer(text: str) -> str | None:
    return None if text == "no class" else text.removeprefix("class ")


def conditions(
    path: Path,
    sentences: Sequence[str],
    known: dict[str, Condition | None],
    mistakes: list[Mistake],
) -> list[Condition]:
    """Return the conditions of a rule that can be read; equal sentences share theirs.

    `known` has those of the rules before it, None for what is no condition.
    """
    for index, text in enumerate(sentences):
        if text not in known and len(mistakes) < MOST_SHOWN:
            try:
                known[text] = parse_condition(text)
            except SentenceError as error:
                known[text] = None
                where = (*path, "when", index)
                mistakes.append((where, f"{shortened(text)}: {error}"))
    return [one for text in sentences if (one := known.get(text)) is not None]


def system_rule(
    path: Path,
    one: layout.RuleOfSystem | None,
    known: dict[str, Condition | None],
    mistakes: list[Mistake],
) -> SystemRule | None:
    """Return a rule of a system, or None if it is broken."""
    if one is None or len(mistakes) >= MOST_SHOWN:
        return None
    parts = conditions(path, one.if_, known, mistakes)
    when = combined(And, parts) if parts else None
    try:
        then = parse_conclusions(one.then)
    except SentenceError as error:
        mistakes.append(((*path, "then"), f"{shortened(one.then)}: {error}"))
        return None
    return SystemRule(when, then, one.weight, one.name or "")


def block(head: layout.BlockHead | None, rules: tuple[SystemRule, ...]) -> RuleBlock:
    """Return a block; a broken one has operators that are never wrong."""
    if head is None:
        return RuleBlock(rules, "minimum", "maximum", "minimum")
    how = head.activation
    return RuleBlock(
        rules,
        head.and_,
        head.or_,
        head.implication,
        Activation(how.method, how.count, how.threshold, how.relation),
        head.name or "",
    )


def leaf(
    path: Path, one: layout.End, classes: Sequence[str], mistakes: list[Mistake]
) -> Leaf:
    """Return a leaf."""
    shares = probabilities(path, one.probabilities, classes, mistakes)
    rows = counts(path, one.counts, classes, mistakes)
    return Leaf(one.class_, one.pattern or "", one.support, shares, rows)


def counts(
    path: Path,
    listed: Mapping[str, int] | None,
    classes: Sequence[str],
    mistakes: list[Mistake],
) -> tuple[int, ...]:
    """Return the training rows of each class, none where they are unknown."""
    if listed is None:
        return ()
    _check_classes((*path, "counts"), listed, classes, mistakes)
    return tuple(listed.get(name, 0) for name in classes)


def probabilities(
    path: Path,
    listed: Mapping[str, float] | None,
    classes: Sequence[str],
    mistakes: list[Mistake],
) -> Probabilities:
    """Return the probability of each class; classes left out share the rest evenly."""
    if listed is None:
        return msgspec.UNSET
    place = (*path, "probabilities")
    _check_classes(place, listed, classes, mistakes)
    others = len(classes) - len(listed)
    rest = PARTS - sum(parts_of(tuple(listed.values())))
    if others > 0 and rest % others:
        text = f"{others} classes cannot share {rest / PARTS!r} evenly in millionths"
        mistakes.append((place, text))
    share = rest // max(others, 1) / PARTS
    return tuple(listed.get(name, share) for name in classes)


def _check_classes(
    path: Path,
    listed: Iterable[str],
    classes: Sequence[str],
    mistakes: list[Mistake],
) -> None:
    """Report names that are no class."""
    for name in listed:
        if name not in classes:
            mistakes.append((path, f"no class {name!r}; {name_choice(name, classes)}"))


def sets(path: Path, one: layout.SetsOfVariable, mistakes: list[Mistake]) -> Sets:
    """Return the fitted sets on a variable."""
    return Sets(one.variable, terms(path, one.terms, mistakes))


def node(one: layout.NodeOfTree) -> Node:
    """Return a node; its owners count from 0, those of the file from 1."""
    branches = tuple(_branch(way) for way in one.branches)
    owners = tuple(owner - 1 for owner in one.interval_owners)
    return Node(one.ask, one.cuts, owners or tuple(range(len(branches))), branches)


def _branch(way: layout.Way) -> Branch:
    kind, number = way.go_to.split(" ")
    if kind == "node":
        return Branch(way.is_, way.sets, node=int(number))
    return Branch(way.is_, way.sets, leaf=int(number))

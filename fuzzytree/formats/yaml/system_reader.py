"""Nodes of a YAML file to a fuzzy system; see `docs/reference/systems.md`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.formulas import FormulaError, parse
from fuzzytree.formats.text_files import MOST_SHOWN, FileMistake
from fuzzytree.formats.yaml import layout, values
from fuzzytree.formats.yaml.binding import (
    Entries,
    bind,
    entries,
    located,
    not_a_list,
    record,
    record_at,
    records_at,
    shortened,
    variables_at,
)
from fuzzytree.formats.yaml.conditions import (
    SentenceError,
    parse_conclusions,
    parse_condition,
)
from fuzzytree.formats.yaml.nodes import ListNode, MappingNode
from fuzzytree.model import (
    Activation,
    Arc,
    Band,
    Bell,
    Binary,
    Concave,
    Conclusion,
    Condition,
    Cosine,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Mistake,
    Number,
    Part,
    Path,
    PiCurve,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    SystemInput,
    SystemOutput,
    SystemRule,
    SystemTerm,
    Trapezoid,
    TwoGaussians,
)


def read_system(
    root: MappingNode, file_mistakes: list[FileMistake]
) -> FuzzySystem | None:
    """Return the system of a file of `kind: system`.

    Returns:
        The system, or None after adding why there is none. With mistakes added it may
        be one with placeholders.
    """
    kept = entries(root, layout.SystemFile, file_mistakes)
    head = record(kept, layout.SystemHead, file_mistakes)
    record_at(kept, "semantics", layout.SystemSemantics, file_mistakes)
    mistakes: list[Mistake] = []
    broken: set[Path] = set()
    inputs = variables_at(
        kept,
        "inputs",
        layout.InputOfSystem,
        file_mistakes,
        lambda path, one: _input(path, one, mistakes),
        lambda name, terms: SystemInput(name, _bare(terms)),
        broken,
    )
    outputs = variables_at(
        kept,
        "outputs",
        layout.OutputOfSystem,
        file_mistakes,
        lambda path, one: _output(path, one, mistakes),
        lambda name, terms: SystemOutput(
            name, _bare(terms), None, None, Defuzzifier("weighted sum")
        ),
        broken,
    )
    blocks = _blocks(kept, file_mistakes, mistakes, broken, _spare(outputs or ()))
    file_mistakes += located(root, mistakes)
    if head is None or inputs is None or outputs is None or blocks is None:
        return None
    try:
        return FuzzySystem(head.name, inputs, outputs, blocks, head.note or "")
    except InvalidModelError as error:
        file_mistakes += located(root, error.mistakes, broken)
        return None


def _input(
    path: Path, one: layout.InputOfSystem, mistakes: list[Mistake]
) -> SystemInput:
    low, high, clips = _range(one.range)
    parts = tuple(Part(p.input, p.weight, p.centre) for p in one.sum_of)
    labels = _labels(path, one.terms, mistakes)
    return SystemInput(one.name, labels, low, high, clips, one.unit or "", parts)


def _output(
    path: Path, one: layout.OutputOfSystem, mistakes: list[Mistake]
) -> SystemOutput:
    low, high, clips = _range(one.range)
    how = Defuzzifier(one.defuzzifier, one.samples, one.grid)
    labels = _labels(path, one.terms, mistakes)
    return SystemOutput(
        *(one.name, labels, low, high, how, one.aggregation, one.default),
        clips=clips,
        unit=one.unit or "",
    )


def _bare(names: Sequence[str]) -> tuple[SystemTerm, ...]:
    return tuple(SystemTerm(name, Band()) for name in names)


def _range(
    one: layout.RangeOfSystem | None,
) -> tuple[float | None, float | None, bool]:
    """Return both ends of a range, and whether it clips."""
    return (
        (None, None, False) if one is None else (one.from_, one.to, bool(one.outside))
    )


def _labels(
    path: Path, terms: Sequence[layout.LabelOfVariable], mistakes: list[Mistake]
) -> tuple[SystemTerm, ...]:
    labels: list[SystemTerm] = []
    for index, one in enumerate(terms):
        curve = _curve(one)
        if one.formula is not None and len(mistakes) < MOST_SHOWN:
            try:
                curve = Formula(parse(one.formula))
            except FormulaError as error:
                text = f"term {one.name!r}, character {error.column}: {error.sentence}"
                mistakes.append(((*path, "labels", index, "formula"), text))
        labels.append(SystemTerm(one.name, curve, one.height))
    return tuple(labels)


def _curve(one: layout.LabelOfVariable) -> Curve:
    """Return the one curve that is given."""
    for field, build in _CURVES.items():
        value = getattr(one, field)
        if value is not None:
            return build(value)
    return values.shape(one)


def _trapezoid(corners: Sequence[float]) -> Trapezoid:
    a, b, c, d = corners
    return Trapezoid(None if a == -math.inf else a, b, c, None if d == math.inf else d)


def _sigmoid(one: layout.SigmoidCurve) -> Sigmoid:
    return Sigmoid(one.inflection, one.slope)


_CURVES: Final[Mapping[str, Callable[[Any], Curve]]] = {
    "trapezoid": _trapezoid,
    "triangle": lambda one: Trapezoid(one[0], one[1], one[1], one[2]),
    "gaussian": lambda one: Gaussian(one.mean, one.deviation),
    "two_gaussians": lambda one: TwoGaussians(
        one.left, one.left_deviation, one.right, one.right_deviation
    ),
    "bell": lambda one: Bell(one.center, one.width, one.slope),
    "sigmoid": _sigmoid,
    "sigmoid_difference": lambda one: SigmoidDifference(*map(_sigmoid, one)),
    "sigmoid_product": lambda one: SigmoidProduct(*map(_sigmoid, one)),
    "s": lambda one: SCurve(one.start, one.end),
    "pi": lambda one: PiCurve(*one),
    "cosine": lambda one: Cosine(one.center, one.width),
    "concave": lambda one: Concave(one.inflection, one.end),
    "spike": lambda one: Spike(one.center, one.width),
    "arc": lambda one: Arc(one.start, one.end),
    "semi_ellipse": lambda one: SemiEllipse(one.start, one.end),
    "at_least": lambda one: Binary(one, is_above=True),
    "at_most": lambda one: Binary(one, is_above=False),
    "singleton": Singleton,
    "linear": lambda one: Linear(one.weights, one.offset),
    "formula": lambda one: Formula(Number(0.0)),  # until it is parsed
}
"""What each field of `LabelOfVariable` becomes; the layout has checked its form."""


def _spare(outputs: Sequence[SystemOutput]) -> SystemRule | None:
    """Return a rule that is always right, to stand in the place of a broken one."""
    for output in outputs:
        for label in output.labels:
            return SystemRule(None, (Conclusion(output.name, label.name),))
    return None


def _blocks(
    kept: Entries,
    file_mistakes: list[FileMistake],
    mistakes: list[Mistake],
    broken: set[Path],
    spare: SystemRule | None,
) -> tuple[RuleBlock, ...] | None:
    """Return the blocks; a broken one has operators that are never wrong.

    In the place of a broken rule stands the spare one; None is returned without it.
    """
    node = kept.get("blocks")
    if not isinstance(node, ListNode):
        if node is not None:
            not_a_list(node, "blocks", file_mistakes)
        return None
    blocks: list[RuleBlock] = []
    for position, item in enumerate(node.items):
        if not isinstance(item, MappingNode):
            bind(item, layout.BlockOfSystem, file_mistakes)
            return None
        own = entries(item, layout.BlockOfSystem, file_mistakes)
        head = record(own, layout.BlockHead, file_mistakes)
        bound = records_at(own, "rules", layout.RuleOfSystem, file_mistakes)
        rules: list[SystemRule] = []
        for index, one in enumerate(bound or ()):
            path: Path = ("blocks", position, "rules", index)
            rule = _rule(path, one, mistakes)
            if rule is None:
                broken.add(path)
                rule = spare
            if rule is None:
                return None
            rules.append(rule)
        blocks.append(_block(head, tuple(rules)))
    return tuple(blocks)


def _block(head: layout.BlockHead | None, rules: tuple[SystemRule, ...]) -> RuleBlock:
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


def _rule(
    path: Path, one: layout.RuleOfSystem | None, mistakes: list[Mistake]
) -> SystemRule | None:
    """Return a rule, or None if it is broken."""
    if one is None or len(mistakes) >= MOST_SHOWN:
        return None
    count = len(mistakes)
    when: Condition | None = None
    then: tuple[Conclusion, ...] = ()
    try:
        when = parse_condition(one.if_)
    except SentenceError as error:
        mistakes.append(((*path, "when"), f"{shortened(one.if_)}: {error}"))
    try:
        then = parse_conclusions(one.then)
    except SentenceError as error:
        mistakes.append(((*path, "then"), f"{shortened(one.then)}: {error}"))
    if len(mistakes) > count:
        return None
    return SystemRule(when, then, one.weight, one.name or "")

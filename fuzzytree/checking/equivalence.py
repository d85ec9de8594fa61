"""How a model that was read back stands to the one that was written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, get_args

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    And,
    Band,
    Branch,
    Call,
    Clause,
    Conclusion,
    Condition,
    Curve,
    Document,
    Expression,
    Flank,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Hedge,
    Is,
    Leaf,
    Name,
    Node,
    Not,
    Or,
    Part,
    Points,
    Reading,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Sets,
    Shape,
    SystemInput,
    SystemOutput,
    SystemRule,
    SystemTerm,
    Term,
    Trapezoid,
    Variable,
    Written,
    fingerprint,
    joints,
    questions,
    shapes_of,
)
from fuzzytree.semantics import (
    EXACT,
    Scores,
    as_system,
    degree,
    landmarks,
    shape_of,
    stepped,
    straightened,
)

Likeness = Literal["equal", "alike", "renamed", "other"]


def equivalence(model: Document, written: Written, again: Reading) -> Likeness:
    """Return how what was read back stands to what was written.

    Returns:
        `equal` in every number and name; `alike` but for names, notes and units, or
        lines that became points, of which remarks were made; `renamed`, the same
        without a remark; or `other`.
    """
    if fingerprint(again.model) == fingerprint(model):
        return "equal"
    if not is_equivalent(model, again.model):
        return "other"
    return "alike" if written.remarks or again.remarks else "renamed"


def is_equivalent(model: Document, other: Document) -> bool:
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
    return fingerprint(canonical_form(model))


def _settled(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules ask nothing where the answer is always 1.

    Formats without rules that always hold ask a term of degree 1 everywhere; it goes
    too, unless another rule tests it. A missing value answers NaN either way.
    """
    everywhere = {
        (one.name, label.name)
        for one in system.inputs
        for label in one.labels
        if label.height == 1.0 and _is_everywhere(label.curve)
    }

    def reduced(when: Condition | None) -> Condition | None:
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
            rules=tuple(replace(rule, when=reduced(rule.when)) for rule in block.rules),
        )
        for block in system.blocks
    )
    if blocks == system.blocks:
        return system
    used = {
        (one.variable, one.label)
        for block in blocks
        for rule in block.rules
        for one in questions(rule.when)
    }
    idle = everywhere - used
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
    first, second = canonical_form(one), canonical_form(other)
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


Names = Mapping[str, str]
Labels = Mapping[str, Names]


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
    match model:
        case FuzzySystem():
            return _system(model)
        case RuleBase():
            return _rules(model)
        case FuzzyTree():
            return _tree(model)


def _numbered(letter: str, names: Iterable[str]) -> Names:
    return {name: f"{letter}{k}" for k, name in enumerate(names, 1)}


def _rules(rules: RuleBase) -> RuleBase:
    names = _numbered("v", (v.name for v in rules.variables))
    terms = {v.name: _numbered("t", (t.name for t in v.terms)) for v in rules.variables}
    classes = _numbered("c", rules.classes)
    return RuleBase(
        name="m",
        classes=tuple(classes.values()),
        variables=_variables(rules.variables, names, terms),
        rules=tuple(
            Rule(_clauses(rule.when, names, terms), classes[rule.then])
            for rule in rules.rules
        ),
        semantics=_semantics(rules.semantics, classes),
    )


def _tree(tree: FuzzyTree) -> FuzzyTree:
    names = _numbered("v", (v.name for v in tree.variables))
    terms = {v.name: _numbered("t", (t.name for t in v.terms)) for v in tree.variables}
    sets = {s.variable: _numbered("t", (t.name for t in s.terms)) for s in tree.sets}
    classes = _numbered("c", tree.classes)

    def branch(one: Branch, variable: str) -> Branch:
        names_of_terms = tuple(terms[variable][name] for name in one.terms)
        fitted = tuple(sets[variable][name] for name in one.sets) if sets else ()
        return replace(one, terms=names_of_terms, sets=fitted)

    return FuzzyTree(
        name="m",
        classes=tuple(classes.values()),
        variables=_variables(tree.variables, names, terms),
        nodes=tuple(
            Node(
                names[node.variable],
                node.cuts,
                node.owners,
                tuple(branch(one, node.variable) for one in node.branches),
            )
            for node in tree.nodes
        ),
        leaves=tuple(Leaf(classes[leaf.label]) for leaf in tree.leaves),
        sets=tuple(
            Sets(names[one.variable], _terms(one.terms, sets[one.variable]))
            for one in tree.sets
        ),
        semantics=_semantics(tree.semantics, classes),
    )


def _variables(
    variables: tuple[Variable, ...], names: Names, terms: Labels
) -> tuple[Variable, ...]:
    return tuple(
        Variable(
            names[one.name],
            _terms(one.terms, terms[one.name]),
            parts=_parts(one.parts, names),
        )
        for one in variables
    )


def _terms(terms: tuple[Term, ...], names: Names) -> tuple[Term, ...]:
    return tuple(Term(names[one.name], _shape(one.shape)) for one in terms)


def _shape(shape: Shape) -> Shape:
    if isinstance(shape, Band):
        return replace(shape, left=_flank(shape.left), right=_flank(shape.right))
    if isinstance(shape, Points):
        return Points(stepped(shape.values), shape.degrees)
    return shape


def _flank(flank: Flank | None) -> Flank | None:
    return None if flank is None else replace(flank, error=None)


def _parts(parts: tuple[Part, ...], names: Names) -> tuple[Part, ...]:
    return tuple(Part(names[one.input], one.weight, one.centre) for one in parts)


def _clauses(
    when: tuple[Clause, ...], names: Names, terms: Labels
) -> tuple[Clause, ...]:
    return tuple(
        Clause(
            names[one.variable],
            tuple(terms[one.variable][name] for name in one.terms),
            one.negated,
        )
        for one in when
    )


def _semantics(semantics: Semantics, classes: Names) -> Semantics:
    uncovered, missing = semantics.uncovered, semantics.missing
    return Semantics(
        semantics.conjunction,
        None if uncovered is None else classes[uncovered],
        None if missing is None else classes[missing],
    )


def _system(system: FuzzySystem) -> FuzzySystem:
    names = _numbered("v", (one.name for one in system.variables))
    labels = {
        one.name: _numbered("t", (label.name for label in one.labels))
        for one in system.variables
    }
    return FuzzySystem(
        name="m",
        inputs=tuple(_input(one, names, labels) for one in system.inputs),
        outputs=tuple(_output(one, names, labels) for one in system.outputs),
        blocks=tuple(_block(one, system, names, labels) for one in system.blocks),
    )


def _input(one: SystemInput, names: Names, labels: Labels) -> SystemInput:
    return SystemInput(
        names[one.name],
        _labels(one.labels, names, labels[one.name], are_numbers=False),
        low=one.low if one.clips else None,
        high=one.high if one.clips else None,
        clips=one.clips,
        parts=_parts(one.parts, names),
    )


def _output(one: SystemOutput, names: Names, labels: Labels) -> SystemOutput:
    is_free = one.defuzzifier.is_weighted and not one.clips
    how = one.defuzzifier
    if how.is_weighted:
        how = type(how)(how.method)
    return replace(
        one,
        name=names[one.name],
        labels=_labels(
            one.labels, names, labels[one.name], are_numbers=how.is_weighted
        ),
        low=None if is_free else one.low,
        high=None if is_free else one.high,
        defuzzifier=how,
        unit="",
    )


def _labels(
    labels: tuple[SystemTerm, ...], variables: Names, names: Names, *, are_numbers: bool
) -> tuple[SystemTerm, ...]:
    return tuple(
        replace(
            one,
            name=names[one.name],
            curve=_curve(one.curve, variables, is_number=are_numbers),
        )
        for one in labels
    )


def _curve(curve: Curve, names: Names, *, is_number: bool) -> Curve:
    if isinstance(curve, Formula):
        return Formula(_expression(curve.expression, names))
    shape = None if is_number else shape_of(curve)
    return curve if shape is None else _shape(shape)


def _expression(expression: Expression, names: Names) -> Expression:
    match expression:
        case Name(name=name):
            return Name(name if name == "x" else names.get(name, name))
        case Call(function=function, arguments=arguments):
            return Call(function, tuple(_expression(one, names) for one in arguments))
        case _:
            return expression


def _block(
    block: RuleBlock, system: FuzzySystem, names: Names, labels: Labels
) -> RuleBlock:
    rules = tuple(
        SystemRule(
            None
            if rule.when is None
            else _ordered(_condition(rule.when, names, labels), block),
            tuple(_conclusion(one, names, labels) for one in rule.then),
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
            is_free = (
                block.conjunction == "minimum"
                if kind is And
                else block.disjunction == "maximum"
            )
            ordered = [_ordered(part, block) for part in parts]
            if is_free:
                ordered = sorted(
                    (
                        inner
                        for part in ordered
                        for inner in (part.parts if isinstance(part, kind) else (part,))
                    ),
                    key=repr,
                )
            elif isinstance(ordered[0], kind):
                ordered[:1] = ordered[0].parts
            return ordered[0] if len(ordered) == 1 else kind(tuple(ordered))
        case _:
            return condition


def _condition(condition: Condition, names: Names, labels: Labels) -> Condition:
    match condition:
        case Is(variable=variable, label=label, hedges=hedges):
            known = labels[variable]
            name = None if label is None else known[label]
            return Is(names[variable], name, _hedges(hedges))
        case And(parts=parts):
            return And(tuple(_condition(one, names, labels) for one in parts))
        case Or(parts=parts):
            return Or(tuple(_condition(one, names, labels) for one in parts))
        case Not(part=Is() as part):
            negated = replace(part, hedges=("not", *part.hedges))
            return _condition(negated, names, labels)
        case Not(part=part):
            return Not(_condition(part, names, labels))


def _conclusion(one: Conclusion, names: Names, labels: Labels) -> Conclusion:
    label = labels[one.output][one.label]
    return Conclusion(names[one.output], label, _hedges(one.hedges))


def _hedges(hedges: tuple[Hedge, ...]) -> tuple[Hedge, ...]:
    """Return hedges with `very very` as two: both are the square of the square."""
    twice: tuple[Hedge, ...] = ("very", "very")
    plain: list[Hedge] = []
    for hedge in hedges:
        plain.extend(twice if hedge == "very very" else (hedge,))
    return tuple(plain)

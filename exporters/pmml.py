"""PMML 4.4: models that any engine of the Data Mining Group's format runs.

**Rules.** Each term, each combination and each rule's strength is a derived field. The
number of the first strongest rule is one too: the least k whose strength equals the
largest. A tree model of one level then says its class; the node's number is the rule's.
So the decision is that of the rule base, ties included. Degrees are arithmetic in the
reference's order (`curves="exact"`), or PMML's own lists of points, `NormContinuous`.

**Trees** are tree models with the same cuts. **Systems** are their programs
(`fuzzytree.exporters.pmml_system`).

A row with a value that is missing or not finite has a branch of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Literal

from fuzzytree.exporters.pmml_elements import (
    NUMBER,
    TEXT,
    Functions,
    apply,
    constant,
    derived,
    joined,
    norm_continuous,
    ref,
    schema,
)
from fuzzytree.exporters.pmml_system import MOST_FIELDS, SystemFields, step_value
from fuzzytree.exporters.program_text import (
    named_steps,
    rated_rules,
    source_of,
    strengths_of,
    title_of,
)
from fuzzytree.exporters.xml_text import XmlElement, element, text_of
from fuzzytree.model import (
    WEIGHT_OF_ONE,
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Loss,
    Model,
    Node,
    Points,
    RuleBase,
    Variable,
    Written,
    fingerprint,
    intervals,
    parts_of,
    refusal,
    sentence,
    shapes_of,
    squarings,
    unlike,
)
from fuzzytree.semantics import pointed

_MISSING, _UNCOVERED = -1.0, 0.0  # numbers in the place of a rule's


def write(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    curves: Literal["exact", "points"] = "exact",
    tolerance: float = 1e-3,
    probabilities: bool = False,
) -> Written:
    """Return a tree, a rule base or a system as a PMML file, in UTF-8.

    Args:
        model: A tree, a rule base or a system.
        allow_loss: Whether curves may become points, if they are written as such.
        curves: `exact`: degrees are arithmetic, with the reference's bits. `points`:
            every term is a `NormContinuous`.
        tolerance: The largest error of a degree for `points`.
        probabilities: Whether the probability of each class is an output; the model
            must be a rule base that has them.

    Raises:
        LossError: If curves would become points and `allow_loss` is False; if a system
            needs too many fields, or functions that PMML does not have.
        ValueError: If `curves` is neither of the two, or `points` for other than rules;
            if probabilities are wanted that the model does not have.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> written = write(random_tree(0))
        >>> print(written.content.decode().splitlines()[1])
        <PMML version="4.4" xmlns="http://www.dmg.org/PMML-4_4">
    """
    if curves not in ("exact", "points"):
        raise ValueError(f"curves are exact or points, not {curves!r}")
    if probabilities:
        rated_rules(model, "pmml")
    losses: tuple[Loss, ...] = ()
    if curves == "points" and (model.outputs or not model.rules):
        raise ValueError("curves: points are for rules; a tree or a system is none")
    match model:
        case FuzzySystem():
            return _written_system(model)
        case FuzzyTree():
            names = _Names(model)
            fields, body = _tree(model, names)
        case RuleBase():
            if curves == "points":
                model, losses = pointed(model, tolerance)
            if losses and not allow_loss:
                raise refusal(model.name, "pmml", losses)
            names = _Names(model)
            fields, body = _rules(
                model, names, is_exact=curves == "exact", is_rated=probabilities
            )
    source = source_of(write, model, locals())
    transformations = [*names.functions.defined.values(), *names.axes, *fields]
    values = [element("Value", value=name) for name in model.classes]
    target = element("DataField", *values, name=names.target, **TEXT)
    data = element("DataDictionary", *_columns(model.variables), target)
    dictionary = element("TransformationDictionary", *transformations)
    content = _content(_header(model, source), data, dictionary, body)
    return Written(content, losses)


def _written_system(system: FuzzySystem) -> Written:
    """Return a system: its program, and a model that hands on the first output."""
    taken = {one.name for one in system.all_variables}
    system_fields = SystemFields(system, taken)
    first, *others = system.outputs
    result = unlike("result", taken)
    how = {"feature": "transformedValue", **NUMBER}
    outputs = [
        element("OutputField", value, name=one.name, **how)
        for one, value in zip(others, system_fields.outputs[1:], strict=True)
    ]
    predictor = element("NumericPredictor", name=result, coefficient="1")
    model = element(
        "RegressionModel",
        schema(system.variables, first.name),
        *([element("Output", *outputs)] if outputs else []),
        element("RegressionTable", predictor, intercept="0"),
        modelName=system.name,
        functionName="regression",
    )
    target = element("DataField", name=first.name, **NUMBER)
    dictionary = element(
        "TransformationDictionary",
        *system_fields.functions.values(),
        *system_fields.fields,
        derived(result, system_fields.outputs[0]),
    )
    data = element("DataDictionary", *_columns(system.variables), target)
    header = _heading(system, {"fingerprint": fingerprint(system)})
    content = _content(header, data, dictionary, model)
    remark = "exp, powers and the like are good to a few last digits"
    return Written(content, (), (remark,) if system_fields.is_inexact else ())


def _content(*parts: XmlElement) -> bytes:
    xmlns = "http://www.dmg.org/PMML-4_4"
    root = element("PMML", *parts, version="4.4", xmlns=xmlns)
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n{text_of(root)}\n'
    return text.encode("utf-8")


_FINITE = element(
    "Interval",
    closure="closedClosed",
    leftMargin=repr(-sys.float_info.max),
    rightMargin=repr(sys.float_info.max),
)


class _Names:
    """Names of the file, besides those of variables and classes, and its functions.

    Attributes:
        target: The field of the class.
        functions: The functions.
        axes: The fields of combinations.
    """

    def __init__(self, model: Model) -> None:
        self._taken = {variable.name for variable in model.variables}
        self.target = self.new("class")
        self.functions = Functions()
        self.axes = [*_axes(model.variables, self.functions)]

    def new(self, name: str) -> str:
        """Return a name for one more field."""
        result = unlike(name, self._taken)
        self._taken.add(result)
        return result


def _header(model: Model, source: str) -> XmlElement:
    facts = {
        "fingerprint": source,
        "uncovered": _answer(model.semantics.uncovered),
        "missing": _answer(model.semantics.missing),
        "and": model.semantics.conjunction,
    }
    return _heading(model, facts)


def _heading(model: Document, facts: Mapping[str, str]) -> XmlElement:
    return element(
        "Header",
        *(_extension(name, text) for name, text in facts.items()),
        element("Application", name="fuzzytree"),
        description=f"{title_of(model, model.name)}.",
    )


def _answer(label: str | None) -> str:
    return "no class" if label is None else f"class {label}"


def _extension(name: str, value: str) -> XmlElement:
    return element("Extension", extender="fuzzytree", name=name, value=value)


def _columns(variables: Iterable[Variable]) -> Iterator[XmlElement]:
    for variable in variables:
        if variable.parts:
            continue
        known = {
            "unit": variable.unit,
            "low": "" if variable.low is None else repr(float(variable.low)),
            "high": "" if variable.high is None else repr(float(variable.high)),
        }
        names = {f"category {k}": name for k, name in enumerate(variable.categories)}
        finite = [] if variable.missing is None else [_FINITE]
        yield element(
            "DataField",
            *(_extension(name, text) for name, text in (known | names).items() if text),
            *finite,
            name=variable.name,
            **NUMBER,
        )


def _axes(variables: Sequence[Variable], functions: Functions) -> Iterator[XmlElement]:
    """Yield the field of each combination; missing where a summand is not finite."""
    for variable in variables:
        if variable.parts:
            summands = [
                apply(
                    "*",
                    constant(part.weight),
                    apply("-", ref(part.input), constant(part.centre)),
                )
                for part in variable.parts
            ]
            yield derived(variable.name, functions.total(summands))


def _usable(variables: Sequence[Variable], functions: Functions) -> XmlElement:
    """Return 1 where every value is there and finite, and 0 elsewhere."""
    parts = [functions.finite(ref(v.name)) for v in variables]
    return joined("min", parts) if parts else constant(1.0)


def _model(
    model: Model,
    names: _Names,
    outputs: Iterable[XmlElement],
    nodes: Iterable[XmlElement],
) -> XmlElement:
    """Return a tree model whose answer is null where no node of the root fits."""
    fields = [
        element("OutputField", name=names.new(name), **TEXT, feature=feature)
        for name, feature in (("answer", "predictedValue"), ("rule", "entityId"))
    ]
    return element(
        "TreeModel",
        schema(model.variables, names.target),
        element("Output", *fields, *outputs),
        element("Node", element("True"), *nodes, id="0"),
        modelName=model.name,
        functionName="classification",
        missingValueStrategy="nullPrediction",
        noTrueChildStrategy="returnNullPrediction",
        splitCharacteristic="multiSplit",
    )


def _rules(
    rules: RuleBase, names: _Names, *, is_exact: bool, is_rated: bool
) -> tuple[list[XmlElement], XmlElement]:
    """Return the derived fields and the model of a rule base."""
    program, places = strengths_of(rules)
    shapes = shapes_of(rules.variables)
    titles = [f"{variable} is {term}" for variable, term in shapes]
    terms = {
        title: key
        for title, key in zip(titles, shapes, strict=True)
        if titles.count(title) == 1
    }
    fields: list[XmlElement] = []
    known: dict[int, XmlElement] = {}
    named = named_steps(program, places)
    for place, title in named.items():
        name = names.new(title or f"step {place}")
        value = step_value(program, place, known)
        if title in terms and not is_exact:
            shape = shapes[terms[title]]
            if isinstance(shape, Points):
                value = norm_continuous(shape, terms[title][0])
        fields.append(derived(name, value))
        known[place] = ref(name)
    strengths = [names.new(f"strength {k}") for k in range(1, len(rules.rules) + 1)]
    for strength, place in zip(strengths, places, strict=True):
        value = known.get(place) or step_value(program, place, known)
        fields.append(derived(strength, value))
    usable, best = names.new("usable"), names.new("best")
    fields.append(derived(usable, _usable(rules.variables, names.functions)))
    fields.append(derived(best, joined("max", list(map(ref, strengths)))))
    winner = names.new("winner")
    fields.append(derived(winner, _winner(strengths, usable, best)))
    outputs = [*_outputs(rules, strengths, usable, names)]
    if is_rated:
        more, shares = _probabilities(rules, strengths, winner, names)
        fields += more
        outputs += shares
    return fields, _model(rules, names, outputs, _rule_nodes(rules, winner))


def _winner(strengths: Sequence[str], usable: str, best: str) -> XmlElement:
    """Return the number of the first strongest rule."""
    none = float(len(strengths) + 1)
    candidates = [
        apply("if", apply("equal", ref(name), ref(best)), constant(k), constant(none))
        for k, name in enumerate(strengths, 1)
    ]
    fired = apply("greaterThan", ref(best), constant(0.0))
    result = apply("if", fired, joined("min", candidates), constant(_UNCOVERED))
    is_usable = apply("equal", ref(usable), constant(1.0))
    return apply("if", is_usable, result, constant(_MISSING))


def _outputs(
    rules: RuleBase, strengths: Sequence[str], usable: str, names: _Names
) -> Iterator[XmlElement]:
    """Yield the strength of each rule, and of each class's strongest."""
    is_usable = apply("equal", ref(usable), constant(1.0))

    def output(name: str, value: XmlElement) -> XmlElement:
        return _output(names.new(name), apply("if", is_usable, value))

    for k, strength in enumerate(strengths, 1):
        yield output(f"strength of rule {k}", ref(strength))
    own: dict[str, list[XmlElement]] = {name: [] for name in rules.classes}
    for strength, rule in zip(strengths, rules.rules, strict=True):
        own[rule.then].append(ref(strength))
    for name, parts in own.items():
        value = joined("max", parts) if parts else constant(0.0)
        yield output(f"strength of class {name}", value)


def _output(name: str, value: XmlElement) -> XmlElement:
    how = {"feature": "transformedValue", **NUMBER}
    return element("OutputField", value, name=name, **how)


def _probabilities(
    rules: RuleBase, strengths: Sequence[str], winner: str, names: _Names
) -> tuple[list[XmlElement], list[XmlElement]]:
    """Return the fields and outputs of the classes' probabilities.

    `fuzzytree.model.probabilities` says what they are. Sums are of whole numbers.
    """
    fields: list[XmlElement] = []

    def field(name: str, value: XmlElement) -> XmlElement:
        fields.append(derived(names.new(name), value))
        return ref(fields[-1].attributes["name"])

    weights: list[XmlElement] = []
    for k, strength in enumerate(strengths, 1):
        power = ref(strength)
        for step in range(1, squarings(rules.semantics.sharpness) + 1):
            power = field(f"power {2**step} of rule {k}", apply("*", power, power))
        whole = apply("*", power, constant(WEIGHT_OF_ONE))
        weights.append(field(f"weight of rule {k}", apply("floor", whole)))
    counts: list[XmlElement] = []
    is_own: list[XmlElement] = []
    for code, name in enumerate(rules.classes):
        shares = [
            apply("*", weight, constant(parts_of(rule.probabilities)[code]))
            for weight, rule in zip(weights, rules.rules, strict=True)
        ]
        counts.append(field(f"count of {name}", joined("sum", shares)))
        own = [k for k, rule in enumerate(rules.rules, 1) if rule.then == name]
        is_own.append(
            apply("isIn", ref(winner), *(constant(float(k)) for k in own or [-2]))
        )
    pairs = [*zip(counts, is_own, strict=True)]
    others = [apply("if", own, constant(0.0), count) for count, own in pairs]
    top = apply("+", joined("max", others), constant(1.0))
    least = field("least count", top)
    raised = [
        field(f"raised count of {name}", apply("if", own, apply("max", n, least), n))
        for name, (n, own) in zip(rules.classes, pairs, strict=True)
    ]
    total = field("total count", joined("sum", raised))
    is_decided = apply("greaterThan", ref(winner), constant(0.0))
    outputs = [
        _output(
            names.new(f"probability of class {name}"),
            apply("if", is_decided, apply("/", count, total)),
        )
        for name, count in zip(rules.classes, raised, strict=True)
    ]
    return fields, outputs


def _rule_nodes(rules: RuleBase, winner: str) -> Iterator[XmlElement]:
    for k, rule in enumerate(rules.rules, 1):
        is_winner = _predicate(winner, "equal", float(k))
        result = _node(is_winner, str(k), rule.then, rule.support)
        text = _extension("rule", sentence(rule))
        yield result._replace(children=(text, *result.children))
    for number, name, label in (
        (_UNCOVERED, "uncovered", rules.semantics.uncovered),
        (_MISSING, "missing", rules.semantics.missing),
    ):
        if label is not None:
            yield _node(_predicate(winner, "equal", number), name, label)


def _predicate(field: str, operator: str, value: float) -> XmlElement:
    return element(
        "SimplePredicate", field=field, operator=operator, value=repr(float(value))
    )


def _tree(tree: FuzzyTree, names: _Names) -> tuple[list[XmlElement], XmlElement]:
    """Return the derived fields and the model of a tree."""
    usable = names.new("usable")
    fields = [derived(usable, _usable(tree.variables, names.functions))]
    is_usable = _predicate(usable, "equal", 1.0)
    children: dict[int, list[XmlElement]] = {}  # a node's have higher numbers

    def node(predicate: XmlElement, number: int | None, end: int) -> XmlElement:
        """Return a node of the tree, or a leaf if it has no number."""
        if number is not None:
            inner = children.pop(number)
            return element("Node", predicate, *inner, id=f"node {number}")
        leaf = tree.leaves[end - 1]
        return _node(predicate, str(end), leaf.label, leaf.support)

    for number in range(len(tree.nodes), 0, -1):
        own = tree.nodes[number - 1]
        children[number] = [
            node(_owned(own, owner, own.variable), branch.node, branch.leaf or 0)
            for owner, branch in enumerate(own.branches)
        ]
    nodes = [node(is_usable, 1 if tree.nodes else None, 1)]
    if tree.semantics.missing is not None:
        is_missing = _predicate(usable, "equal", 0.0)
        nodes.append(_node(is_missing, "missing", tree.semantics.missing))
    return fields, _model(tree, names, (), nodes)


def _node(
    predicate: XmlElement, id_: str, label: str, count: int | None = None
) -> XmlElement:
    support = None if count is None else str(count)
    return element("Node", predicate, id=id_, score=label, recordCount=support)


def _owned(node: Node, owner: int, field: str) -> XmlElement:
    """Return whether a value lies in one of the intervals that a branch owns."""
    parts: list[XmlElement] = []
    for one, (low, high) in zip(node.owners, intervals(node), strict=True):
        if one != owner:
            continue
        ends: list[XmlElement] = []
        if low is not None:
            ends.append(_predicate(field, "greaterThan", low))
        if high is not None:
            ends.append(_predicate(field, "lessOrEqual", high))
        parts.append(_compound("and", ends))
    return _compound("or", parts)


def _compound(operator: str, parts: list[XmlElement]) -> XmlElement:
    if len(parts) == 1:
        return parts[0]
    return element("CompoundPredicate", *parts, booleanOperator=operator)


FORMAT = Format(
    name="pmml",
    suffixes=(".pmml",),
    write=write,
    cannot=(
        "a pmml file runs, but is not read back as what it was written from",
        f"systems of more than {MOST_FIELDS:,} steps, or functions that PMML lacks",
    ),
    dtype="float64",
)

"""Rule bases, trees and systems as YAML that reads like something a person wrote.

Nothing is lost: reading what was written gives an equal model, bit for bit. Words and
numbers are written so that readers of YAML 1.1 and of YAML 1.2 see the same.
`docs/reference/yaml-format.md` describes the file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

import msgspec

from fuzzytree import formats
from fuzzytree.errors import LossError
from fuzzytree.exporters.yaml_text import (
    Entry,
    Noted,
    Short,
    joined,
    name_losses,
    named_shape,
    numbers,
    range_ends,
    summand,
    text_losses,
)
from fuzzytree.formats import (
    LARGEST_COUNT,
    LONGEST_NOTE,
    LONGEST_SENTENCE,
    FormulaError,
    conclusions_text,
    condition_sentence,
    condition_texts,
    parse,
    read_yaml,
    text_of,
)
from fuzzytree.model import (
    LR,
    Activation,
    Band,
    Binary,
    Branch,
    Curve,
    Defuzzifier,
    Document,
    Format,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Leaf,
    Linear,
    Loss,
    Model,
    Node,
    PiCurve,
    Points,
    Probabilities,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
    Written,
)

_TITLES: Final = {
    "rule base": "# A fuzzy rule base of fuzzytree: IF propositions THEN class.",
    "tree": "# A fuzzy decision tree of fuzzytree: node 1 is the root.",
    "system": "# A fuzzy system of fuzzytree: rules whose conclusions become numbers.",
}
_ORIGINS: Final = {
    "relative": "these rules equal the tree that they come from",
    "raw": "the fitted sets of a tree as they are",
}


def write(model: Document, /, *, allow_loss: bool = False) -> Written:
    """Return a rule base, tree or system as YAML.

    Args:
        model: The model.
        allow_loss: Without effect: what cannot be written whole is not written.

    Raises:
        LossError: If a name is longer than 1000 characters or is no Unicode text, a
            count is above 2**53, a formula is nested too deeply for its text, or the
            file is too large to be read again.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(write(random_tree(1, leaves=1)).content.decode().splitlines()[0])
        # A fuzzy decision tree of fuzzytree: node 1 is the root.
    """
    match model:
        case RuleBase():
            own, entries = _rule_losses(model), partial(_rule_base, model)
        case FuzzyTree():
            own, entries = _tree_losses(model), partial(_tree, model)
        case FuzzySystem():
            own, entries = _system_losses(model), partial(_system, model)
    losses = [*name_losses(_names(model)), *own]
    if losses:
        text = "\n".join(f"{loss.where}: {loss.what}" for loss in losses)
        raise LossError(f"cannot write {model.name[:100]} as yaml: {text}")
    whole = entries()
    return Written(joined(model.name, _TITLES[str(whole["kind"])], whole))


def _rule_losses(rules: RuleBase) -> Iterator[Loss]:
    shared = {id(one): one for rule in rules.rules for one in rule.when}
    texts = {key: condition_sentence(one) for key, one in shared.items()}
    for number, rule in enumerate(rules.rules, 1):
        yield from _long(f"rule {number}", [texts[id(p)] for p in rule.when])
    yield from _count_losses("rule", rules.rules)


def _tree_losses(tree: FuzzyTree) -> Iterator[Loss]:
    yield from name_losses(("pattern", leaf.pattern) for leaf in tree.leaves)
    yield from _count_losses("leaf", tree.leaves)


def _count_losses(what: str, parts: Sequence[Rule | Leaf]) -> Iterator[Loss]:
    for number, part in enumerate(parts, 1):
        if part.support is not None and part.support > LARGEST_COUNT:
            yield Loss(f"{what} {number}", f"the support is above {LARGEST_COUNT}")


def _names(model: Document) -> Iterator[tuple[str, str]]:
    """Yield every text of a model that is a name, and what it is the name of."""
    yield "name", model.name
    yield from (("class", name) for name in model.classes)
    yield from (("column", name) for name in model.columns)
    variables: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
    for variable in variables:
        yield "variable", variable.name
        yield "unit", variable.unit
        if not isinstance(variable, SystemOutput):
            yield from (("category", name) for name in variable.categories)
        yield from (("term", term.name) for term in variable.terms)
    yield from (("set", term.name) for group in model.sets for term in group.terms)
    yield from (("block", block.name) for block in model.blocks)
    yield from (("rule", rule.name) for block in model.blocks for rule in block.rules)


def _rule_base(rules: RuleBase) -> dict[str, Entry]:
    entries = _head(rules, "rule base")
    if rules.kind:
        entries["terms"] = Noted(rules.kind, _ORIGINS[rules.kind])
    entries |= _body(rules)
    texts: dict[int, Entry] = {}  # rules share propositions
    listed: list[Entry] = []
    for rule in rules.rules:
        for one in rule.when:
            if id(one) not in texts:
                texts[id(one)] = condition_sentence(one)
        whole: dict[str, Entry] = {
            "if": Short([texts[id(one)] for one in rule.when]),
            "then": rule.then,
        }
        whole |= _support(rule, rules.classes)
        whole |= _probabilities(rule.probabilities, rules.classes)
        listed.append(whole)
    entries["rules"] = listed
    entries["semantics"] = {
        **_semantics(rules.semantics),
        "answer": "the class of the first of the strongest rules",
    }
    return entries


def _tree(tree: FuzzyTree) -> dict[str, Entry]:
    entries = _head(tree, "tree") | _body(tree)
    if tree.nodes:
        entries["nodes"] = [_node(n, node) for n, node in enumerate(tree.nodes, 1)]
    leaves: list[Entry] = []
    for number, leaf in enumerate(tree.leaves, 1):
        end: dict[str, Entry] = {"leaf": number, "class": leaf.label}
        if leaf.pattern:
            end["pattern"] = leaf.pattern
        end |= _support(leaf, tree.classes)
        end |= _probabilities(leaf.probabilities, tree.classes)
        leaves.append(Short(end))
    entries["leaves"] = leaves
    if tree.sets:
        entries["sets"] = [
            {"variable": group.variable, "terms": [*map(_term, group.terms)]}
            for group in tree.sets
        ]
    meant = _semantics(tree.semantics)
    del meant["or"], meant["not"]
    entries["semantics"] = {
        **meant,
        "cuts": "a value equal to a cut lies below it",
        "answer": "the class of the leaf that the nodes lead to",
    }
    return entries


def _head(model: Document, kind: str) -> dict[str, Entry]:
    return {"format": formats.YAML_FORMAT, "kind": kind, "name": model.name}


def _body(model: Model) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"classes": Short([*model.classes], is_run_on=True)}
    if model.columns:
        entries["columns"] = Short([*model.columns], is_run_on=True)
    if model.variables:
        entries["variables"] = [*map(_variable, model.variables)]
    return entries


def _variable(variable: Variable | SystemOutput) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"name": variable.name}
    if variable.unit:
        entries["unit"] = variable.unit
    if not isinstance(variable, SystemOutput):
        entries |= _column(variable)
    ends = range_ends(variable.low, variable.high)
    if variable.clips:
        ends["outside"] = "clipped"
    if ends:
        entries["range"] = Short(ends)
    if not isinstance(variable, SystemOutput) and variable.parts:
        entries["sum of"] = [*map(summand, variable.parts)]
    if variable.terms:
        entries["terms"] = [*map(_term, variable.terms)]
    return entries


def _column(variable: Variable) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    if variable.categories:
        entries["categories"] = Short([*variable.categories], is_run_on=True)
    if variable.missing is not None:
        entries["missing as"] = float(variable.missing)
    if variable.is_whole:
        entries["numbers"] = "whole"
    return entries


def _node(number: int, node: Node) -> dict[str, Entry]:
    entries: dict[str, Entry] = {
        "node": number,
        "ask": node.variable,
        "cuts": numbers(node.cuts),
    }
    if node.owners != tuple(range(len(node.branches))):
        owners: list[Entry] = [owner + 1 for owner in node.owners]
        entries["interval owners"] = Short(owners, is_run_on=True)
    entries["branches"] = [*map(_branch, node.branches)]
    return entries


def _branch(branch: Branch) -> Short:
    entries: dict[str, Entry] = {"is": Short([*branch.terms], is_run_on=True)}
    if branch.sets:
        entries["sets"] = Short([*branch.sets], is_run_on=True)
    where = f"leaf {branch.leaf}" if branch.node is None else f"node {branch.node}"
    return Short({**entries, "go to": where})


def _semantics(semantics: Semantics) -> dict[str, Entry]:
    entries: dict[str, Entry] = {
        "and": semantics.conjunction,
        "or": "maximum",
        "not": "1 - degree",
        "uncovered": Noted(_answer(semantics.uncovered), "where no rule fires"),
        "missing": Noted(
            _answer(semantics.missing), "where a needed value is missing or infinite"
        ),
    }
    if semantics.label_type:
        entries["label type"] = Noted(semantics.label_type, "of predicted classes")
    if semantics.sharpness:
        note = "the power of the strengths that weigh probabilities"
        entries["sharpness"] = Noted(semantics.sharpness, note)
    if semantics.floor is not msgspec.UNSET:
        note = "a weaker raw rule knows nothing like the row"
        entries["floor"] = Noted(semantics.floor, note)
    return entries


def _support(part: Rule | Leaf, classes: Sequence[str]) -> dict[str, Entry]:
    """Return the training rows of a part; classes left out have none."""
    entries: dict[str, Entry] = {}
    if part.support is not None:
        entries["support"] = part.support
    if part.counts:
        counts = zip(classes, part.counts, strict=True)
        entries["counts"] = Short({name: count for name, count in counts if count})
    return entries


def _probabilities(
    probabilities: Probabilities, classes: Sequence[str]
) -> dict[str, Entry]:
    """Return those above the smallest; classes left out share the rest evenly."""
    if probabilities is msgspec.UNSET:
        return {}
    least = min(probabilities)
    pairs = [*zip(classes, probabilities, strict=True)]
    listed = {name: one for name, one in pairs if one != least}
    return {"probabilities": Short({**(listed or dict(pairs))})}


def _answer(label: str | None) -> str:
    return "no class" if label is None else f"class {label}"


def _system(system: FuzzySystem) -> dict[str, Entry]:
    entries = _head(system, "system")
    if system.note:
        entries["note"] = system.note
    if system.variables:
        entries["variables"] = [*map(_variable, system.variables)]
    entries["outputs"] = [*map(_output, system.outputs)]
    entries["blocks"] = [*map(_block, system.blocks)]
    entries["semantics"] = {
        "not": "1 - degree",
        "activated": "rules whose weighted degree is above 0",
        "missing": "a value that is missing or infinite makes every output nan",
    }
    return entries


def _system_losses(system: FuzzySystem) -> Iterator[Loss]:
    yield from text_losses("the note", system.note)
    if len(system.note) > LONGEST_NOTE:
        text = f"{len(system.note)} characters are more than {LONGEST_NOTE}"
        yield Loss("the note", text)
    for variable in system.all_variables:
        for label in variable.terms:
            if isinstance(label.function, Formula) and not _is_readable(label.function):
                where = f"term {label.name!r} of {variable.name!r}"
                yield Loss(where, "its formula is too long or nested too deeply")
    for number, block in enumerate(system.blocks, 1):
        if block.activation.count > LARGEST_COUNT:
            yield Loss(f"block {number}", f"its count is above {LARGEST_COUNT}")
    for number, rule in enumerate(system.rules, 1):
        sentences = [*condition_texts(rule.when), conclusions_text(rule.then)]
        yield from _long(f"rule {number}", sentences)


def _long(where: str, sentences: list[str]) -> Iterator[Loss]:
    if any(len(text) > LONGEST_SENTENCE for text in sentences):
        yield Loss(where, f"a sentence of more than {LONGEST_SENTENCE} characters")


def _is_readable(formula: Formula) -> bool:
    try:
        return parse(text_of(formula.expression)) == formula.expression
    except FormulaError:
        return False


def _output(one: SystemOutput) -> dict[str, Entry]:
    entries = _variable(one)
    how, usual = one.defuzzifier, Defuzzifier(one.defuzzifier.method)
    entries["defuzzifier"] = how.method
    if not how.is_weighted or how != usual:
        entries["samples"] = how.samples
        entries["grid"] = how.grid
    if one.aggregation is not None:
        entries["aggregation"] = one.aggregation
    if one.default is not None:
        entries["default"] = Noted(float(one.default), "where it has no number")
    return entries


def _term(term: Term) -> Entry:
    height = {} if term.height == 1.0 else {"height": float(term.height)}
    if isinstance(term.function, Band | LR | Points):
        return {**named_shape(term.name, term.function), **height}
    return Short({"name": term.name, **_curve(term.function), **height})


def _curve(curve: Curve) -> dict[str, Entry]:
    match curve:
        case Band() | LR() | Points():
            return named_shape("", curve)
        case Trapezoid():
            return _trapezoid(curve)
        case SigmoidDifference(first, second) | SigmoidProduct(first, second):
            return {_name(curve): Short([_numbers(first), _numbers(second)])}
        case PiCurve(a=a, b=b, c=c, d=d):
            return {"pi": numbers((a, b, c, d))}
        case Binary(start=start, is_above=is_above):
            return {"at least" if is_above else "at most": float(start)}
        case Singleton(value=value):
            return {"singleton": float(value)}
        case Linear(weights=weights, offset=offset):
            whole: dict[str, Entry] = {"weights": numbers(weights)}
            return {"linear": Short({**whole, "offset": float(offset)})}
        case Formula(expression=expression):
            return {"formula": text_of(expression)}
        case _:
            return {_name(curve): _numbers(curve)}


def _trapezoid(curve: Trapezoid) -> dict[str, Entry]:
    """Return a trapezoid, a triangle where its plateau is one number."""
    a = -math.inf if curve.a is None else curve.a
    d = math.inf if curve.d is None else curve.d
    is_triangle = None not in (curve.a, curve.d) and repr(curve.b) == repr(curve.c)
    if is_triangle:
        return {"triangle": numbers((a, curve.b, d))}
    return {"trapezoid": numbers((a, curve.b, curve.c, d))}


def _name(curve: Curve) -> str:
    return str(curve.__struct_config__.tag)


def _numbers(curve: Curve) -> Short:
    """Return the numbers of a curve by their names."""
    fields = curve.__struct_fields__
    return Short(
        {name.replace("_", " "): float(getattr(curve, name)) for name in fields}
    )


def _block(block: RuleBlock) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    if block.name:
        entries["name"] = block.name
    for key, norm in (
        ("and", block.conjunction),
        ("or", block.disjunction),
        ("implication", block.implication),
    ):
        if norm is not None:
            entries[key] = norm
    entries["activation"] = _activation(block.activation)
    entries["rules"] = [*map(_rule, block.rules)]
    return entries


def _activation(how: Activation) -> Short:
    entries: dict[str, Entry] = {"method": how.method}
    if how.count != 1 or how.method in ("first", "last", "highest", "lowest"):
        entries["count"] = how.count
    is_asked = how.method in ("first", "last", "threshold")
    if repr(float(how.threshold)) != "0.0" or is_asked:
        entries["threshold"] = float(how.threshold)
    if how.relation != ">=" or how.method == "threshold":
        entries["relation"] = how.relation
    return Short(entries)


def _rule(rule: SystemRule) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"name": rule.name} if rule.name else {}
    entries["if"] = Short([*condition_texts(rule.when)])
    entries["then"] = conclusions_text(rule.then)
    if rule.weight != 1.0:
        entries["weight"] = float(rule.weight)
    return entries


FORMAT = Format(
    name="yaml",
    suffixes=(".yaml", ".yml"),
    write=write,
    read=read_yaml,
)

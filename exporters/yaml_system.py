"""Fuzzy systems as entries of a YAML file; `docs/reference/systems.md` describes it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fuzzytree import formats
from fuzzytree.exporters.yaml_text import (
    Entry,
    Noted,
    Short,
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
    condition_text,
    parse,
    text_of,
)
from fuzzytree.model import (
    LR,
    Activation,
    Band,
    Binary,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Linear,
    Loss,
    PiCurve,
    Points,
    RuleBlock,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SystemInput,
    SystemOutput,
    SystemRule,
    SystemTerm,
    Trapezoid,
)


def entries_of(system: FuzzySystem) -> dict[str, Entry]:
    """Return the entries of a system, in order."""
    entries: dict[str, Entry] = {
        "format": formats.YAML_FORMAT,
        "kind": "system",
        "name": system.name,
    }
    if system.note:
        entries["note"] = system.note
    if system.inputs:
        entries["inputs"] = [*map(_input, system.inputs)]
    entries["outputs"] = [*map(_output, system.outputs)]
    entries["blocks"] = [*map(_block, system.blocks)]
    entries["semantics"] = {
        "not": "1 - degree",
        "activated": "rules whose weighted degree is above 0",
        "missing": "a value that is missing or infinite makes every output nan",
    }
    return entries


def losses_of(system: FuzzySystem) -> Iterator[Loss]:
    """Yield the parts of a system that are too long or too large to be read again."""
    yield from name_losses(_names(system))
    yield from text_losses("the note", system.note)
    if len(system.note) > LONGEST_NOTE:
        text = f"{len(system.note)} characters are more than {LONGEST_NOTE}"
        yield Loss("the note", text)
    for variable in system.variables:
        for label in variable.labels:
            if isinstance(label.curve, Formula) and not _is_readable(label.curve):
                where = f"term {label.name!r} of {variable.name!r}"
                yield Loss(where, "its formula is too long or nested too deeply")
    for number, block in enumerate(system.blocks, 1):
        if block.activation.count > LARGEST_COUNT:
            yield Loss(f"block {number}", f"its count is above {LARGEST_COUNT}")
    for number, rule in enumerate(system.rules, 1):
        if max(map(len, _sentences(rule))) > LONGEST_SENTENCE:
            yield Loss(f"rule {number}", f"more than {LONGEST_SENTENCE} characters")


def _names(system: FuzzySystem) -> Iterator[tuple[str, str]]:
    """Yield every text that is a name, and what it is the name of."""
    yield "name", system.name
    for variable in system.variables:
        yield "variable", variable.name
        yield "unit", variable.unit
        yield from (("term", label.name) for label in variable.labels)
    yield from (("block", block.name) for block in system.blocks)
    yield from (("rule", rule.name) for rule in system.rules)


def _is_readable(formula: Formula) -> bool:
    try:
        return parse(text_of(formula.expression)) == formula.expression
    except FormulaError:
        return False


def _input(one: SystemInput) -> dict[str, Entry]:
    entries = _variable(one)
    if one.parts:
        entries["sum of"] = [*map(summand, one.parts)]
    if one.labels:
        entries["terms"] = [*map(_label, one.labels)]
    return entries


def _output(one: SystemOutput) -> dict[str, Entry]:
    entries = _variable(one)
    if one.labels:
        entries["terms"] = [*map(_label, one.labels)]
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


def _variable(one: SystemInput | SystemOutput) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"name": one.name}
    if one.unit:
        entries["unit"] = one.unit
    ends = range_ends(one.low, one.high)
    if one.clips:
        ends["outside"] = "clipped"
    if ends:
        entries["range"] = Short(ends)
    return entries


def _label(label: SystemTerm) -> Entry:
    match label.curve:
        case Band() | LR() | Points():
            entries = named_shape(label.name, label.curve)
            if label.height != 1.0:
                entries["height"] = float(label.height)
            return entries
        case curve:
            entries = {"name": label.name, **_curve(curve)}
            if label.height != 1.0:
                entries["height"] = float(label.height)
            return Short(entries)


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


def _sentences(rule: SystemRule) -> tuple[str, str]:
    return condition_text(rule.when), conclusions_text(rule.then)


def _rule(rule: SystemRule) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"name": rule.name} if rule.name else {}
    entries["if"], entries["then"] = _sentences(rule)
    if rule.weight != 1.0:
        entries["weight"] = float(rule.weight)
    return entries

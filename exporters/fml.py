"""FML (IEEE 1855-2016): rule bases and systems as XML that is valid by the schema.

`docs/reference/fml.md` describes the file. Every name is an XML ID, unlike all others
of the document: terms are called `variable.term`. The standard's numbers have 32 bits;
the file holds all digits of the doubles, and a remark says what a reader may make of
them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from fuzzytree.exporters.fml_rules import FmlRule, FmlRules
from fuzzytree.exporters.fuzzy_files import (
    FileNames,
    file_system,
    grid_losses,
    without_heights,
)
from fuzzytree.exporters.xml_text import XmlElement, element, text_element, text_of
from fuzzytree.formats import (
    FML_METHODS,
    FML_SNORMS,
    FML_TNORMS,
    NAMESPACE,
    USUAL,
    read_fml,
    shape_in_words,
    word_for,
)
from fuzzytree.model import (
    DIGITS,
    LETTERS,
    Activation,
    Format,
    FuzzySystem,
    Linear,
    Loss,
    NameMap,
    Points,
    RuleBase,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    Written,
    refusal,
)
from fuzzytree.semantics import (
    FACTS,
    flattened,
    has_numbers,
    joined_outputs,
    pointed,
    refuse_singletons,
    shape_of,
)

_FLOAT32: Final = (
    "the standard's numbers have 32 bits: a reader that keeps to it changes each "
    "number by a share of up to 6e-8 (2^-24); corners of curves move by that, values "
    "beyond 3.4e38 are infinite, and degrees that differ by less become equal, so that "
    "another rule can win in rows that near to a corner or to a tie"
)


def write(
    model: RuleBase | FuzzySystem,
    /,
    *,
    allow_loss: bool = False,
    tolerance: float = 1e-6,
) -> Written:
    """Return a rule base or a system as an FML file.

    Args:
        model: The model. Of a rule base each rule has a score, see
            `fuzzytree.semantics.conversion.scores`.
        allow_loss: Whether to write what FML cannot express as near as it can.
        tolerance: The largest error of a degree where points stand for a curve.

    Raises:
        LossError: If something would be lost, unless allowed; and always if the rules
            have no place in FML.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1, leaves=2, combinations=0.0))
        >>> text = write(rules, allow_loss=True).content.decode()
        >>> 'xmlns="http://www.ieee1855.org"' in text
        True
    """
    source = file_system(model, tolerance, always="term")
    system, losses, remarks, facts, _ = source
    remarks.append(_FLOAT32)
    system, lost = flattened(system)
    losses += lost
    system, lost = _with_known_curves(system, tolerance)
    losses += [*lost, *_losses(system)]
    result = FmlRules(system)
    losses += result.losses
    if losses and not allow_loss:
        raise refusal(model.name, "fml", losses)
    names = _naming(system, result)
    remarks += names.remarks(system)
    text = '<?xml version="1.0" encoding="UTF-8"?>\n'
    if facts:
        text += f"<!-- {FACTS}{facts} -->\n"
    text += f"{text_of(_root(system, result, names))}\n"
    return Written(text.encode("utf-8"), tuple(losses), tuple(remarks), names.changed())


class _Ids(FileNames, frozen=True):
    """The IDs of a document."""

    def term(self, variable: str, label: str) -> str:
        """Return the ID of a term."""
        return f"{self.variables[variable]}.{self.labels[variable][label]}"


def _naming(system: FuzzySystem, rules: FmlRules) -> _Ids:
    variables = _ids(one.name for one in system.all_variables)
    labels = {
        one.name: _ids(
            label.name for label in (*one.terms, *rules.made.get(one.name, ()))
        )
        for one in system.all_variables
    }
    title = _ids([system.name], variables.accepted.values())
    return _Ids(variables, labels, title)


def _ids(names: Iterable[str], taken: Iterable[str] = ()) -> NameMap:
    """Return names without a dot, which parts a variable from its term."""
    first, rest = LETTERS + "_", LETTERS + DIGITS + "_-"
    return NameMap.of(names, first=first, rest=rest, taken=taken)


def _with_known_curves(
    system: FuzzySystem, tolerance: float
) -> tuple[FuzzySystem, tuple[Loss, ...]]:
    """Return a system whose curves FML has; a height is in its points."""
    has_heights = any(
        label.height != 1.0 for one in system.all_variables for label in one.terms
    )
    if has_heights:
        refuse_singletons(system, "fml with the heights of terms")

    def is_known(variable: Variable | SystemOutput, term: Term) -> bool:
        if has_numbers(variable) or isinstance(term.function, Points):
            return True
        return not has_heights and shape_in_words(term.function) is not None

    system, lost = pointed(system, tolerance, keeps=is_known)
    losses = [*lost]
    if has_heights:
        system = without_heights(system, "FML", losses)
    return system, tuple(losses)


def _losses(system: FuzzySystem) -> Iterator[Loss]:
    joined = joined_outputs(system)
    for output in system.outputs:
        where, how = f"output {output.name!r}", output.defuzzifier
        if how.method == "weighted sum":
            yield Loss(where, "FML averages; the weighted sum becomes an average")
        if how.is_weighted and output.aggregation is not None:
            what = f"{output.aggregation} of rules of one term becomes a sum"
            if output.name not in joined:
                what = "it is added in the order of the rules: only rounding differs"
            yield Loss(where, what)
        if how.is_weighted:
            continue
        yield from grid_losses(output, USUAL, "FML does not say so; it is read as")
        if output.aggregation not in FML_SNORMS.values():
            yield Loss(where, f"FML has no {output.aggregation}; MAX stands for it")
    for variable in system.all_variables:
        if variable.clips:
            what = "values are not moved into the range"
            yield Loss(f"variable {variable.name!r}", what)
    for number, block in enumerate(system.blocks, 1):
        if block.activation != Activation():
            what = f"all rules are activated, not by {block.activation.method}"
            yield Loss(f"block {number} of rules", what)
        norm = block.disjunction
        if norm is not None and norm not in FML_SNORMS.values():
            what = f"FML has no {norm}; MAX stands for it"
            yield Loss(f"block {number} of rules", what)


def _root(system: FuzzySystem, rules: FmlRules, names: _Ids) -> XmlElement:
    inputs = [_input(one, rules, names) for one in system.variables]
    outputs = [_output(output, names) for output in system.outputs]
    bases: list[XmlElement] = []
    number = 0
    for place, (kind, block, own_rules) in enumerate(rules.bases, 1):
        norms = {
            "andMethod": _t(block.conjunction),
            "orMethod": word_for(FML_SNORMS, block.disjunction, "MAX"),
        }
        own = [
            _rule(rule, k, kind == "tsk", norms, names)
            for k, rule in enumerate(own_rules, number + 1)
        ]
        number += len(own)
        act = None if kind == "tsk" else _t(block.implication)
        how = {"name": f"rules.{place}.", "activationMethod": act, **norms}
        bases.append(element(f"{kind}RuleBase", *own, **how))
    knowledge = element("knowledgeBase", *inputs, *outputs)
    title = names.system[system.name]
    return element("fuzzySystem", knowledge, *bases, xmlns=NAMESPACE, name=title)


def _t(norm: str | None) -> str:
    return word_for(FML_TNORMS, norm, "MIN")


def _input(one: Variable, rules: FmlRules, names: _Ids) -> XmlElement:
    terms = [_term("fuzzyTerm", one.name, label, names) for label in one.terms]
    if not one.terms:  # the schema requires one; no rule can use it
        points = element("pointSetShape", element("point", x="0.0", y="1.0"))
        name = f"{names.variables[one.name]}."
        terms.append(element("fuzzyTerm", points, name=name))
    for made in rules.made.get(one.name, ()):
        definition = element(
            "circularDefinition", made.definition(names.term, one.name)
        )
        name = names.term(one.name, made.name)
        terms.append(element("fuzzyTerm", definition, name=name))
    how = {**_head(one, names), **_domain(one), "type": "input"}
    return element("fuzzyVariable", *terms, **how)


def _head(one: Variable | SystemOutput, names: _Ids) -> dict[str, str | None]:
    scale = one.unit if one.unit.isprintable() and one.unit else None
    return {"name": names.variables[one.name], "scale": scale}


def _domain(one: Variable | SystemOutput) -> dict[str, str]:
    low, high = _range(one)
    return {"domainleft": _float(low), "domainright": _float(high)}


def _range(one: Variable | SystemOutput) -> tuple[float, float]:
    """Return a range; an end that is unknown is endless for an input.

    Of an output it is guessed from the points of its terms: engines draw their curves.
    """
    near: list[float] = []
    for label in one.terms:
        shape = shape_of(label.function)
        near += shape.values if isinstance(shape, Points) else ()
    if isinstance(one, Variable):
        near = [-math.inf, math.inf]
    low = one.low if one.low is not None else min(near, default=0.0)
    high = one.high if one.high is not None else max(near, default=1.0)
    return (low, high) if low < high else (low - 1.0, low + 1.0)


def _output(one: SystemOutput, names: _Ids) -> XmlElement:
    default = _float(math.nan if one.default is None else one.default)
    last = {"combination": "WA", "defaultValue": default}
    how = {**_head(one, names), **_domain(one), "type": "output"}
    if not one.defuzzifier.is_weighted:
        kind, tag = "fuzzyTerm", "fuzzyVariable"
        last = {
            "accumulation": word_for(FML_SNORMS, one.aggregation, "MAX"),
            "defuzzifier": word_for(FML_METHODS, one.defuzzifier.method, "COG"),
            "defaultValue": default,
        }
    elif all(isinstance(label.function, Singleton | Linear) for label in one.terms):
        kind, tag = "tskTerm", "tskVariable"
        how = {**_head(one, names), "type": "output"}
    else:
        kind, tag = "tsukamotoTerm", "tsukamotoVariable"
    terms = [_term(kind, one.name, label, names) for label in one.terms]
    return element(tag, *terms, **how, **last)


def _term(kind: str, variable: str, label: Term, names: _Ids) -> XmlElement:
    name = names.term(variable, label.name)
    match label.function:
        case Singleton(value=value) if kind == "tskTerm":
            return _tsk_term(name, value)
        case Linear(weights=weights, offset=offset) if kind == "tskTerm":
            return _tsk_term(name, offset, *weights)
        case curve:
            result = shape_in_words(curve)
    if result is not None:
        word, numbers = result
        texts = {f"param{k}": _float(one) for k, one in enumerate(numbers, 1)}
        return element(kind, element(word, **texts), name=name)
    shape = shape_of(label.function)
    assert isinstance(shape, Points)  # others are refused or became points
    tag = "pointSetMonotonicShape" if kind == "tsukamotoTerm" else "pointSetShape"
    pairs = zip(shape.values, shape.degrees, strict=True)
    points = [element("point", x=_float(x), y=_float(y)) for x, y in pairs]
    how = element(tag, *points, interpolationMethod="linear")
    return element(kind, how, name=name)


def _tsk_term(name: str, *numbers: float) -> XmlElement:
    values = [text_element("tskValue", _float(number)) for number in numbers]
    order = "1" if len(numbers) > 1 else "0"
    return element("tskTerm", *values, name=name, order=order)


def _rule(
    rule: FmlRule, number: int, is_tsk: bool, norms: Mapping[str, str], names: _Ids
) -> XmlElement:
    clauses = [
        _clause("clause", (variable, label), names, modifier or None)
        for variable, label, modifier in rule.clauses
    ]
    tag, start, then, clause = "rule", "consequent", "then", "clause"
    if is_tsk:
        tag, start, then, clause = "tskRule", "tskConsequent", "tskThen", "tskClause"
    concluded = [_clause(clause, one, names) for one in rule.concluded]
    return element(
        tag,
        element("antecedent", *clauses),
        element(start, element(then, *concluded)),
        name=f"rule.{number}.",
        **norms,
        connector="or" if rule.is_or else "and",
        weight=_float(rule.weight),
    )


def _clause(
    tag: str, named: tuple[str, str], names: _Ids, modifier: str | None = None
) -> XmlElement:
    variable = text_element("variable", names.variables[named[0]])
    term = text_element("term", names.term(*named))
    return element(tag, variable, term, modifier=modifier)


def _float(number: float) -> str:
    """Return the shortest digits of a number, and XML's words for what has none."""
    if math.isfinite(number):
        return repr(float(number))
    return "NaN" if math.isnan(number) else "INF" if number > 0.0 else "-INF"


FORMAT = Format(
    name="fml",
    suffixes=(".fml", ".xml"),
    carries=("rules", "system"),
    write=write,
    read=read_fml,
    cannot=(
        "a rule that mixes and and or over several inputs, unless rules are joined by "
        "maximum; a rule that tests an output",
        "hedges of conclusions, and two hedges in a row other than not behind one",
        "other ways to activate rules than all, weighted sums, numbers of samples",
        "combinations of inputs: each becomes an input",
    ),
)

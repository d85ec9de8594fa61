"""FML (IEEE 1855-2016): rule bases and systems as XML that is valid by the schema.

`docs/reference/fml.md` describes the file. Every name is an XML ID, unlike all others
of the document: terms are called `variable.term`. The standard's numbers have 32 bits;
the file holds all digits of the doubles, and a remark says what a reader may make of
them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from fuzzytree.exporters.fml_rules import FmlRule, FmlRules, rules_of
from fuzzytree.exporters.fuzzy_files import FileNames, inverse, without_heights
from fuzzytree.formats import (
    FML_FAR,
    FML_METHODS,
    FML_SNORMS,
    FML_TNORMS,
    NAMESPACE,
    USUAL,
    read_fml,
)
from fuzzytree.model import (
    DIGITS,
    LETTERS,
    Activation,
    Curve,
    Format,
    FuzzySystem,
    Gaussian,
    Linear,
    Loss,
    NameMap,
    Points,
    RuleBase,
    RuleBlock,
    SCurve,
    Singleton,
    SystemInput,
    SystemOutput,
    SystemTerm,
    Trapezoid,
    TwoGaussians,
    Written,
    refusal,
)
from fuzzytree.semantics import (
    FACTS,
    as_system,
    cast_losses,
    cast_remarks,
    facts_of,
    flattened,
    joined_outputs,
    pointed,
    refuse_singletons,
    shape_of,
)

_ALLOWED: Final = (Trapezoid, Gaussian, SCurve, Singleton)
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
    losses: list[Loss] = []
    remarks = [_FLOAT32]
    facts = ""
    if isinstance(model, RuleBase):
        rules, lost = pointed(model, tolerance)
        system = as_system(rules, always="term")
        losses += [*cast_losses(model), *lost]
        remarks = [*cast_remarks(model), *remarks]
        facts = facts_of(rules, always="term")
    else:
        system = model
    system, lost = flattened(system)
    losses += lost
    system, lost = _with_known_curves(system, tolerance)
    losses += [*lost, *_losses(system)]
    result = rules_of(system)
    losses += result.losses
    if losses and not allow_loss:
        raise refusal(model.name, "fml", losses)
    names = _naming(system, result)
    remarks += names.remarks(system)
    lines = _lines(system, result, names, facts)
    content = ("\n".join(lines) + "\n").encode("utf-8")
    return Written(content, tuple(losses), tuple(remarks), names.changed())


class _Ids(FileNames, frozen=True):
    """The IDs of a document."""

    def term(self, variable: str, label: str) -> str:
        """Return the ID of a term."""
        return f"{self.variables[variable]}.{self.labels[variable][label]}"


def _naming(system: FuzzySystem, rules: FmlRules) -> _Ids:
    variables = _ids(one.name for one in system.variables)
    labels = {
        one.name: _ids(
            label.name for label in (*one.labels, *rules.made.get(one.name, ()))
        )
        for one in system.variables
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
        label.height != 1.0 for one in system.variables for label in one.labels
    )
    if has_heights:
        refuse_singletons(system, "fml with the heights of terms")
    is_one_sided = all(
        _shape(label.curve) is not None
        for one in system.variables
        for label in one.labels
        if isinstance(label.curve, TwoGaussians)
    )
    allowed: tuple[type, ...] = () if has_heights else _ALLOWED
    if is_one_sided and not has_heights:
        allowed = (*allowed, TwoGaussians)
    system, lost = pointed(system, tolerance, allowed=allowed)
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
        has_grid = not all(
            isinstance(label.curve, Singleton) for label in output.labels
        )
        if has_grid and (how.samples, how.grid) != (USUAL.samples, USUAL.grid):
            yield Loss(
                where,
                f"its curve is sampled at {how.samples} values ({how.grid}), and FML "
                f"does not say so; it is read as {USUAL.samples} ({USUAL.grid})",
            )
        if output.aggregation not in FML_SNORMS.values():
            yield Loss(where, f"FML has no {output.aggregation}; MAX stands for it")
    for variable in system.variables:
        if variable.clips:
            what = "values are not moved into the range"
            yield Loss(f"variable {variable.name!r}", what)
    for number, block in enumerate(system.blocks, 1):
        if block.activation != Activation():
            what = f"all rules are activated, not by {block.activation.method}"
            yield Loss(f"block {number} of rules", what)
        norms = (block.disjunction,)
        for norm in norms:
            if norm is not None and norm not in FML_SNORMS.values():
                yield Loss(
                    f"block {number} of rules", f"FML has no {norm}; MAX stands for it"
                )


def _lines(
    system: FuzzySystem, rules: FmlRules, names: _Ids, facts: str
) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    if facts:
        yield f"<!-- {FACTS}{facts} -->"
    yield f'<fuzzySystem xmlns="{NAMESPACE}" name="{names.system[system.name]}">'
    yield "  <knowledgeBase>"
    for one in system.inputs:
        yield from _input(one, rules, names)
    for output in system.outputs:
        yield from _output(output, names)
    yield "  </knowledgeBase>"
    number = 0
    for place, (kind, block, own_rules) in enumerate(rules.bases, 1):
        tag = f"{kind}RuleBase"
        norms = _norms(block)
        act = "" if kind == "tsk" else f' activationMethod="{_t(block.implication)}"'
        yield f'  <{tag} name="rules.{place}."{act}{norms}>'
        for rule in own_rules:
            number += 1
            yield from _rule(rule, number, (kind == "tsk", norms), names)
        yield f"  </{tag}>"
    yield "</fuzzySystem>"


def _norms(block: RuleBlock) -> str:
    return (
        f' andMethod="{_t(block.conjunction)}" '
        f'orMethod="{inverse(FML_SNORMS, block.disjunction, "MAX")}"'
    )


def _t(norm: str | None) -> str:
    return inverse(FML_TNORMS, norm, "MIN")


def _input(one: SystemInput, rules: FmlRules, names: _Ids) -> Iterator[str]:
    yield (f'    <fuzzyVariable {_head(one, names)}{_domain(one)} type="input">')
    for label in one.labels:
        yield from _term("fuzzyTerm", one.name, label, names)
    if not one.labels:  # the schema requires one; no rule can use it
        yield f'      <fuzzyTerm name="{names.variables[one.name]}.">'
        yield '        <pointSetShape><point x="0.0" y="1.0"/></pointSetShape>'
        yield "      </fuzzyTerm>"
    for made in rules.made.get(one.name, ()):
        yield f'      <fuzzyTerm name="{names.term(one.name, made.name)}">'
        yield "        <circularDefinition>"
        yield from made.lines(names.term, one.name)
        yield "        </circularDefinition>"
        yield "      </fuzzyTerm>"
    yield "    </fuzzyVariable>"


def _head(one: SystemInput | SystemOutput, names: _Ids) -> str:
    scale = (
        f" scale={quoteattr(one.unit)}" if one.unit.isprintable() and one.unit else ""
    )
    return f'name="{names.variables[one.name]}"{scale}'


def _domain(one: SystemInput | SystemOutput) -> str:
    low, high = _range(one)
    return f' domainleft="{_float(low)}" domainright="{_float(high)}"'


def _range(one: SystemInput | SystemOutput) -> tuple[float, float]:
    """Return a range; an end that is unknown is endless for an input.

    Of an output it is guessed from the points of its terms: engines draw their curves.
    """
    near: list[float] = []
    for label in one.labels:
        shape = shape_of(label.curve)
        near += shape.values if isinstance(shape, Points) else ()
    if isinstance(one, SystemInput):
        near = [-math.inf, math.inf]
    low = one.low if one.low is not None else min(near, default=0.0)
    high = one.high if one.high is not None else max(near, default=1.0)
    return (low, high) if low < high else (low - 1.0, low + 1.0)


def _output(one: SystemOutput, names: _Ids) -> Iterator[str]:
    default = math.nan if one.default is None else one.default
    last = f' defaultValue="{_float(default)}">'
    if not one.defuzzifier.is_weighted:
        method = inverse(FML_METHODS, one.defuzzifier.method, "COG")
        join = inverse(FML_SNORMS, one.aggregation, "MAX")
        yield (
            f'    <fuzzyVariable {_head(one, names)}{_domain(one)} type="output"'
            f' accumulation="{join}" defuzzifier="{method}"{last}'
        )
        kind, tag = "fuzzyTerm", "fuzzyVariable"
    elif _is_tsk(one):
        yield (
            f'    <tskVariable {_head(one, names)} type="output" combination="WA"{last}'
        )
        for label in one.labels:
            yield from _tsk_term(one.name, label, names)
        yield "    </tskVariable>"
        return
    else:
        yield (
            f'    <tsukamotoVariable {_head(one, names)}{_domain(one)} type="output"'
            f' combination="WA"{last}'
        )
        kind, tag = "tsukamotoTerm", "tsukamotoVariable"
    for label in one.labels:
        yield from _term(kind, one.name, label, names)
    yield f"    </{tag}>"


def _is_tsk(one: SystemOutput) -> bool:
    return all(isinstance(label.curve, Singleton | Linear) for label in one.labels)


def _tsk_term(variable: str, label: SystemTerm, names: _Ids) -> Iterator[str]:
    numbers: tuple[float, ...] = ()
    match label.curve:
        case Singleton(value=value):
            order, numbers = 0, (value,)
        case Linear(weights=weights, offset=offset):
            order, numbers = 1, (offset, *weights)
        case _:
            order = 0
    yield f'      <tskTerm name="{names.term(variable, label.name)}" order="{order}">'
    for number in numbers:
        yield f"        <tskValue>{_float(number)}</tskValue>"
    yield "      </tskTerm>"


def _term(kind: str, variable: str, label: SystemTerm, names: _Ids) -> Iterator[str]:
    yield f'      <{kind} name="{names.term(variable, label.name)}">'
    result = _shape(label.curve)
    if result is not None:
        name, numbers = result
        attribute = " ".join(
            f'param{k}="{_float(number)}"' for k, number in enumerate(numbers, 1)
        )
        yield f"        <{name} {attribute}/>"
    else:
        points = shape_of(label.curve)
        assert isinstance(points, Points)  # others are refused or became points
        tag = "pointSetMonotonicShape" if kind == "tsukamotoTerm" else "pointSetShape"
        yield f'        <{tag} interpolationMethod="linear">'
        for x, y in zip(points.values, points.degrees, strict=True):
            yield f'          <point x="{_float(x)}" y="{_float(y)}"/>'
        yield f"        </{tag}>"
    yield f"      </{kind}>"


def _shape(curve: Curve) -> tuple[str, Sequence[float]] | None:
    """Return a shape with parameters; None if the curve must be points."""
    match curve:
        case Points(values=(a, b), degrees=(0.0, 1.0)):
            return "rightLinearShape", (a, b)
        case Points(values=(a, b), degrees=(1.0, 0.0)):
            return "leftLinearShape", (a, b)
        case Trapezoid(a=float(a), b=b, c=c, d=float(d)) if a < b and c < d:
            is_peak = b == c
            numbers = (a, b, d) if is_peak else (a, b, c, d)
            return "triangularShape" if is_peak else "trapezoidShape", numbers
        case Singleton(value=value):
            return "singletonShape", (value,)
        case Gaussian(mean=mean, deviation=deviation):
            return "gaussianShape", (mean, deviation)
        case TwoGaussians(left=c, left_deviation=s, right=right) if right >= FML_FAR:
            return "rightGaussianShape", (c, s)
        case TwoGaussians(left=left, right=c, right_deviation=s) if left <= -FML_FAR:
            return "leftGaussianShape", (c, s)
        case SCurve(start=a, end=b) if a != b:
            return ("sShape", (a, b)) if a < b else ("zShape", (b, a))
        case _:
            return None


def _rule(
    rule: FmlRule, number: int, about: tuple[bool, str], names: _Ids
) -> Iterator[str]:
    is_tsk, norms = about
    tag = "tskRule" if is_tsk else "rule"
    connector = "or" if rule.is_or else "and"
    yield (
        f'    <{tag} name="rule.{number}."{norms} connector="{connector}" '
        f'weight="{_float(rule.weight)}">'
    )
    yield "      <antecedent>"
    for variable, label, modifier in rule.clauses:
        attribute = f' modifier="{modifier}"' if modifier else ""
        yield from _clause("clause", attribute, (variable, label), names, 8)
    yield "      </antecedent>"
    start, then, clause = "consequent", "then", "clause"
    if is_tsk:
        start, then, clause = "tskConsequent", "tskThen", "tskClause"
    yield f"      <{start}>"
    yield f"        <{then}>"
    for concluded in rule.concluded:
        yield from _clause(clause, "", concluded, names, 10)
    yield f"        </{then}>"
    yield f"      </{start}>"
    yield f"    </{tag}>"


def _clause(
    tag: str, attribute: str, named: tuple[str, str], names: _Ids, indent: int
) -> Iterable[str]:
    pad = " " * indent
    yield f"{pad}<{tag}{attribute}>"
    yield f"{pad}  <variable>{escape(names.variables[named[0]])}</variable>"
    yield f"{pad}  <term>{escape(names.term(*named))}</term>"
    yield f"{pad}</{tag}>"


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

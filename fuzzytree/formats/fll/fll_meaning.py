"""What an FLL file means where it is not the plain sum of its lines.

What is disabled is taken out, monotone terms are told from others in weighted outputs,
and remarks say where fuzzylite 6 and pyfuzzylite 8 mean other things by one file.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence

from msgspec.structs import replace

from fuzzytree.formats.engines import constant_degrees
from fuzzytree.formats.fll.fll_terms import as_degree
from fuzzytree.formats.fll.fll_variables import Known, ReadBlock
from fuzzytree.formats.fll.fll_words import Entry, Notes
from fuzzytree.model.contracts import Loss
from fuzzytree.model.rulebase import Points
from fuzzytree.model.system import (
    And,
    Arc,
    Call,
    Concave,
    Condition,
    Curve,
    Expression,
    Formula,
    FuzzySystem,
    Is,
    Label,
    Linear,
    Not,
    Or,
    SemiEllipse,
    Singleton,
    SystemOutput,
    SystemRule,
    names_in,
)
from fuzzytree.semantics.inference import value_at


def without_disabled(
    variables: Sequence[Known], blocks: Sequence[ReadBlock], notes: Notes
) -> tuple[list[Known], list[ReadBlock]]:
    """Return variables and blocks without what is disabled; remarks tell it.

    What is asked of a disabled variable has degree 0, whatever the hedges. A disabled
    input stays a column, for formulas may name it.
    """
    for block in blocks:
        if not block.is_enabled:
            line = block.section.head.line
            notes.remarks.append(f"line {line}: a disabled block is left out")
    kept_blocks = [one for one in blocks if one.is_enabled]
    off = [one.name for one in variables if not one.is_enabled]
    kept = [one for one in variables if one.is_enabled or not one.is_output]
    for name in off:
        text = f"{name!r} is disabled: nothing concludes it, and it is nothing"
        notes.remarks.append(text)
    outputs = [one.name for one in kept if one.is_output]
    if not off or not outputs:
        return kept, kept_blocks
    never = Is(outputs[0], None, ("not", "any"))
    return kept, [_without(one, off, never, notes) for one in kept_blocks]


def _without(
    read: ReadBlock, off: Collection[str], never: Condition, notes: Notes
) -> ReadBlock:
    """Return a block whose rules do not know the disabled variables."""
    rules: list[SystemRule] = []
    lines: list[Entry] = []
    for rule, line in zip(read.block.rules, read.lines, strict=True):
        then = tuple(one for one in rule.then if one.output not in off)
        when = None if rule.when is None else _asked(rule.when, off, never)
        if then:
            rules.append(replace(rule, when=when, then=then))
            lines.append(line)
        elif read.block.activation.method not in ("general", "threshold"):
            what = "it concludes only what is disabled, and is not counted any more"
            notes.losses.append(Loss(f"the rule in line {line.line}", what))
    block = replace(read.block, rules=tuple(rules))
    return replace(read, block=block, lines=tuple(lines))


def _asked(condition: Condition, off: Collection[str], never: Condition) -> Condition:
    match condition:
        case Is(variable=variable):
            return never if variable in off else condition
        case And(parts=parts):
            return And(tuple(_asked(part, off, never) for part in parts))
        case Or(parts=parts):
            return Or(tuple(_asked(part, off, never) for part in parts))
        case Not(part=part):
            return Not(_asked(part, off, never))


def as_meant(output: Known, notes: Notes) -> SystemOutput:
    """Return an output whose weighted terms are numbers where the file says so.

    Fuzzylite calls it the type: `TakagiSugeno` takes the degree of every term at the
    activation, `Tsukamoto` asks a monotone term where it has that degree, `Automatic`
    goes by the terms.
    """
    variable = output.variable
    assert isinstance(variable, SystemOutput)  # who calls it sees to that
    if not variable.defuzzifier.is_weighted:
        return variable
    has_numbers = any(term.is_number for term in output.terms)
    has_monotone = any(term.is_monotone for term in output.terms)
    if output.kind == "Automatic" and has_numbers and has_monotone:
        what = (
            "numbers and monotone terms are mixed, which fuzzylite 6 takes by the "
            "first that is activated and pyfuzzylite refuses; each is taken by its kind"
        )
        notes.losses.append(Loss(f"output {output.name!r}", what))
    is_sugeno = output.kind == "TakagiSugeno"
    labels = tuple(
        as_degree(term.label) if is_sugeno or not term.is_monotone else term.label
        for term in output.terms
    )
    return replace(variable, labels=labels)


def differences(system: FuzzySystem) -> Iterator[str]:
    """Yield where fuzzylite 6 and pyfuzzylite 8 mean other things by a file."""
    counts = Counter(
        (one.output, one.label) for rule in system.rules for one in rule.then
    )
    for output in system.outputs:
        yield from constant_degrees(output)
        if output.defuzzifier.is_weighted:
            concluded = [
                label for label in output.labels if counts[output.name, label.name]
            ]
            twice = [one for one in concluded if counts[output.name, one.name] > 1]
            yield from _joined_twice(output, twice)
            if any(map(_is_infinite_at_zero, concluded)):
                yield (
                    f"output {output.name!r}: a rule of degree 0 counts nothing, as in "
                    "fuzzylite 6; pyfuzzylite multiplies 0 by an infinite number"
                )
            yield from _inverse_remarks(output, concluded)
    hedges = {
        hedge for rule in system.rules for one in rule.then for hedge in one.hedges
    }
    if hedges & {"any", "not"}:
        yield (
            "a rule of degree 0 concludes nothing, as in fuzzylite 6; in pyfuzzylite "
            "'any' and 'not' in a conclusion make 1 of 0"
        )
    yield from _area_remarks(system.outputs)
    yield from _curve_remarks(system)


def _area_remarks(outputs: Sequence[SystemOutput]) -> Iterator[str]:
    """Yield what fuzzylite 6 does with curves in another way."""
    looked_at = [one for one in outputs if not one.defuzzifier.is_weighted]
    methods = {one.defuzzifier.method for one in looked_at}
    if "bisector" in methods:
        yield (
            "Bisector is one of the values that are looked at, as in pyfuzzylite; "
            "fuzzylite 6 takes one between them"
        )
    if "mean of maximum" in methods:
        yield (
            "the mean of all values of the largest degree answers, as in pyfuzzylite; "
            "fuzzylite 6 takes the first stretch of such values, and degrees within "
            "1e-6 as equal"
        )
    if methods & {"smallest of maximum", "largest of maximum"}:
        yield "fuzzylite 6 counts degrees within 1e-6 of the maximum to the maxima"
    if any(one.default is not None for one in looked_at):
        yield (
            "where conclusions have no area the default answers, as in pyfuzzylite; "
            "fuzzylite 6 answers NaN"
        )


def _joined_twice(output: SystemOutput, twice: Sequence[Label]) -> Iterator[str]:
    """Yield what happens to labels that several rules conclude."""
    names = ", ".join(repr(one.name) for one in twice[:3])
    same = f"output {output.name!r}: rules that conclude the same term ({names})"
    if twice and output.aggregation is not None:
        yield (
            f"{same} are joined by the aggregation, as in pyfuzzylite; fuzzylite 6 "
            "adds each"
        )
    elif any(_depends_on_degree(one) for one in twice):
        yield (
            f"{same} are weighted one by one, as in fuzzylite 6; pyfuzzylite adds "
            "their degrees first"
        )


def _depends_on_degree(label: Label) -> bool:
    """Return whether a label's number depends on its degree of activation."""
    match label.curve:
        case Singleton() | Linear():
            return False
        case Formula(expression=expression):
            return "x" in names_in(expression)
        case _:
            return True


def _is_infinite_at_zero(label: Label) -> bool:
    """Return whether a label's number at degree 0 is, or may be, no finite number."""
    if isinstance(label.curve, Formula):
        asked = "x" in names_in(label.curve.expression)
        functions = {call.function for call in _calls([label.curve])}
        return asked and bool(functions & {"/", "^", "log", "log10", "%", "fmod"})
    found = value_at(label.curve, 0.0)
    return found is not None and not math.isfinite(found)


def _inverse_remarks(output: SystemOutput, concluded: Sequence[Label]) -> Iterator[str]:
    """Yield whether fuzzylite 6 finds other values at which a term has a degree."""
    if any(
        value_at(one.curve, 0.5) is not None
        and (one.height != 1.0 or not isinstance(one.curve, Points))
        for one in concluded
    ):
        yield (
            f"output {output.name!r}: where a term has a degree is what pyfuzzylite "
            "says; fuzzylite 6 finds other values for SShape, ZShape, Concave and "
            "terms with a height, and within 1e-6 of 0 and 1"
        )


_TRUTHS = frozenset({"le", "ge", "eq", "neq", "and", "or", "not"})
_SAFE = frozenset({*_TRUTHS, "lt", "gt", "*", "/", "^", "min", "max"})


def _curve_remarks(system: FuzzySystem) -> Iterator[str]:
    curves = [label.curve for one in system.variables for label in one.labels]
    calls = list(_calls(curves))
    used = {call.function for call in calls}
    if "%" in used:
        yield (
            "formulas: '%' has the sign of its second number, as in pyfuzzylite; "
            "fuzzylite 6 takes the first one's"
        )
    if "round" in used:
        yield (
            "formulas: 'round' takes a half to the even neighbour, as in pyfuzzylite; "
            "fuzzylite 6 takes it away from 0"
        )
    if any(map(_asks_numbers, calls)):
        yield (
            "formulas: what is not 0 is true for 'and', 'or' and 'not', as in "
            "pyfuzzylite; in fuzzylite 6 only 1 is true"
        )
    degrees = [label.curve for one in system.inputs for label in one.labels]
    formulas = [one.expression for one in degrees if isinstance(one, Formula)]
    if any({*names_in(one)} - {"x"} for one in formulas):
        yield "formulas: fuzzylite 6 knows no variables in those of inputs' terms"
    if formulas:
        yield (
            "formulas: a degree below 0 concludes nothing, as in fuzzylite 6; "
            "pyfuzzylite counts it"
        )
    looked_at = [
        label.curve
        for one in system.outputs
        if not one.defuzzifier.is_weighted
        for label in one.labels
    ]
    if {"min", "max"} & {call.function for call in _calls(looked_at)}:
        yield "formulas: pyfuzzylite fails at 'min' and 'max' in an output's curve"
    outputs = {one.name for one in system.outputs}
    if any(
        call.function in ("min", "max") and outputs & {*names_in(call)}
        for call in calls
    ):
        yield (
            "formulas: 'min' and 'max' of an output without a number have none; the "
            "engines take the other argument"
        )
    if any(map(_computes_with_truths, calls)):
        yield (
            "formulas: le, ge, eq, neq, and, or, not are the numbers 0 and 1; "
            "pyfuzzylite fails at sums and functions of them, adds them as truths, or "
            "computes in half precision"
        )
    if any(isinstance(one, Concave) and one.inflection == one.end for one in curves):
        yield (
            "a Concave term that ends at its inflection is 1 above it, as in "
            "fuzzylite 6; in pyfuzzylite it is 0 there"
        )
    if any(isinstance(one, Arc | SemiEllipse) for one in curves):
        yield "fuzzylite 6 does not know Arc and SemiEllipse; pyfuzzylite does"


def _calls(curves: Iterable[Curve]) -> Iterator[Call]:
    todo: list[Expression] = [
        one.expression for one in curves if isinstance(one, Formula)
    ]
    while todo:
        one = todo.pop()
        if isinstance(one, Call):
            yield one
            todo += one.arguments


def _computes_with_truths(call: Call) -> bool:
    """Return whether pyfuzzylite computes something else with truths than numbers."""
    return call.function not in _SAFE and all(map(_is_truth, call.arguments))


def _asks_numbers(call: Call) -> bool:
    """Return whether a logical function gets a number that may be neither 0 nor 1."""
    return call.function in ("and", "or", "not") and not all(
        _is_truth(one) or (isinstance(one, Call) and one.function in ("lt", "gt"))
        for one in call.arguments
    )


def _is_truth(expression: Expression) -> bool:
    """Return whether pyfuzzylite can have a truth there, and no number."""
    if not isinstance(expression, Call):
        return False
    if expression.function in ("min", "max"):
        return any(map(_is_truth, expression.arguments))
    if expression.function == "*":
        return all(map(_is_truth, expression.arguments))
    return expression.function in _TRUTHS

"""Fuzzy systems as plain text: variables with their terms, rules as sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.formats import text_of
from fuzzytree.model import (
    LR,
    Activation,
    And,
    Band,
    Binary,
    Conclusion,
    Condition,
    Curve,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Linear,
    Not,
    Or,
    Part,
    Points,
    Proposition,
    RuleBlock,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.report.text import (
    aligned,
    counted,
    kind_text,
    number,
    shape_text,
    span_text,
)
from fuzzytree.runtimes import Outputs
from fuzzytree.semantics import Status


def document_text(model: Document) -> str:
    """Return what a model is and how large, in a line.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> document_text(random_tree(1, leaves=2))
        'tree, 1 node, 2 leaves, depth 1, 1 input, 3 classes'
    """
    if isinstance(model, FuzzySystem):
        terms = sum(len(one.terms) for one in model.all_variables)
        return (
            f"fuzzy system, {counted(len(model.inputs), 'input')}, "
            f"{counted(len(model.outputs), 'output')}, "
            f"{counted(len(model.rules), 'rule')}, {counted(terms, 'term')}"
        )
    inputs = counted(len(model.inputs), "input")
    classes = counted(len(model.classes), "class", "classes")
    return f"{kind_text(model)}, {inputs}, {classes}"


def document_facts(model: Document) -> dict[str, object]:
    """Return the same for programs: kind, name, inputs, answers, counts."""
    if isinstance(model, FuzzySystem):
        return {
            "carrier": "system",
            "name": model.name,
            "inputs": model.inputs,
            "outputs": tuple(one.name for one in model.outputs),
            "rules": len(model.rules),
            "terms": sum(len(one.terms) for one in model.all_variables),
        }
    is_tree = isinstance(model, FuzzyTree)
    rules = model.leaves if isinstance(model, FuzzyTree) else model.rules
    return {
        "carrier": "tree" if is_tree else "rules",
        "name": model.name,
        "inputs": model.inputs,
        "classes": model.classes,
        "rules": len(rules),
        "terms": sum(len(one.terms) for one in model.variables),
    }


def system_lines(system: FuzzySystem) -> Iterator[str]:
    """Yield a system as a person reads it: head, rules, variables with their terms."""
    yield f"{system.name}: {document_text(system)}"
    if system.note:
        yield from (f"note     {line}" for line in system.note.splitlines())
    yield f"inputs   {len(system.inputs)}: {', '.join(system.inputs) or 'none'}"
    names = ", ".join(one.name for one in system.outputs)
    yield f"outputs  {len(system.outputs)}: {names}"
    yield "answers  missing value: nan"
    start = 1
    for block in system.blocks:
        yield ""
        yield from _block_lines(block, start)
        start += len(block.rules)
    for one in system.variables:
        yield ""
        yield from _input_lines(one, system.inputs)
    for output in system.outputs:
        yield ""
        yield from _output_lines(output, system.inputs)


def system_rule_facts(system: FuzzySystem) -> list[dict[str, object]]:
    """Return the rules for programs: number, sentence, weight."""
    return [
        {"number": k, "text": rule_text(rule), "weight": rule.weight}
        for k, rule in enumerate(system.rules, 1)
    ]


def system_reasons(system: FuzzySystem, outputs: Outputs) -> list[str]:
    """Return, for each row, the rules that were activated, each with its degree."""
    texts = [rule_text(rule) for rule in system.rules]
    if outputs.activations is None:
        return [""] * len(outputs)
    rows = zip(outputs.activations.T.tolist(), outputs.status.tolist(), strict=True)
    return [_reason(texts, degrees, status) for degrees, status in rows]


def _reason(texts: Sequence[str], degrees: Sequence[float], status: int) -> str:
    if status == Status.MISSING:
        return "a value is missing or not finite"
    fired = [
        f"rule {k} ({number(degree)}): {text}"
        for k, (text, degree) in enumerate(zip(texts, degrees, strict=True), 1)
        if degree > 0.0
    ]
    return "; ".join(fired) or "no rule fires"


def _block_lines(block: RuleBlock, start: int) -> Iterator[str]:
    name = f" {block.name}" if block.name else ""
    facts = [
        f"AND is {block.conjunction}" if block.conjunction else "",
        f"OR is {block.disjunction}" if block.disjunction else "",
        f"THEN is {block.implication}" if block.implication else "",
        _activation_text(block.activation),
    ]
    yield f"rules{name}: {'; '.join(filter(None, facts))}"
    width = len(str(start + len(block.rules) - 1))
    for position, rule in enumerate(block.rules, start):
        yield f"{position:{width}}. {rule_text(rule)}"


def _activation_text(how: Activation) -> str:
    match how.method:
        case "general":
            return "all rules"
        case "proportional":
            return "all rules, in proportion"
        case "threshold":
            return f"rules of degree {how.relation} {number(how.threshold)}"
        case "first" | "last":
            least = f" of degree >= {number(how.threshold)}" if how.threshold else ""
            return f"the {how.method} {counted(how.count, 'rule')}{least}"
        case "highest" | "lowest":
            return f"the {counted(how.count, 'rule')} of {how.method} degree"


def rule_text(rule: SystemRule) -> str:
    """Return a rule as people read it.

    Example:
        >>> hot = Proposition("water", ("hot",), ("very",))
        >>> rule_text(SystemRule(Not(hot), (Conclusion("power", "low"),), weight=0.5))
        'IF not (water is very hot) THEN power is low  (weight 0.5)'
    """
    ends = " and ".join(map(_conclusion_text, rule.then))
    weight = "" if rule.weight == 1.0 else f"  (weight {number(rule.weight)})"
    name = f"  ({rule.name})" if rule.name else ""
    if rule.when is None:
        return f"ALWAYS {ends}{weight}{name}"
    return f"IF {condition_text(rule.when)} THEN {ends}{weight}{name}"


def _conclusion_text(one: Conclusion) -> str:
    return f"{one.output} is {' '.join((*one.hedges, one.term))}"


def condition_text(condition: Condition, *, level: int = 0) -> str:
    """Return a condition as people read it, with brackets where `and` meets `or`.

    Args:
        condition: The condition.
        level: 0 outside of all brackets, 1 within `or`, 2 within `and`.
    """
    match condition:
        case Proposition(variable=variable, term=label, hedges=hedges):
            words = [*hedges, *([] if label is None else [label])]
            return f"{variable} is {' '.join(words)}"
        case And(parts=parts):
            text = " and ".join(condition_text(one, level=2) for one in parts)
            return f"({text})" if level == 2 else text
        case Or(parts=parts):
            text = " or ".join(condition_text(one, level=1) for one in parts)
            return f"({text})" if level else text
        case Not(part=part):
            return f"not ({condition_text(part)})"


def _input_lines(one: Variable, columns: Sequence[str]) -> Iterator[str]:
    yield one.name + span_text(one)
    if one.parts:
        yield f"  = {sum_text(one.parts)}"
    yield from _label_lines(one.terms, columns)


_GRIDS = {
    "middle": "in the middle of equal pieces",
    "ends": "from end to end",
    "half ends": "from end to end, by the trapezoidal rule",
    "lines": "from end to end, joined by lines",
}


def _output_lines(one: SystemOutput, columns: Sequence[str]) -> Iterator[str]:
    how = one.defuzzifier
    facts: list[str] = [how.method]
    if not how.is_weighted:
        facts = [f"{how.method} {_samples_text(one)}"]
    if one.aggregation:
        facts.append(f"joined by {one.aggregation}")
    default = "nan" if one.default is None else number(one.default)
    facts.append(f"no rule: {default}")
    yield one.name + span_text(one)
    yield f"  {'; '.join(facts)}"
    yield from _label_lines(one.terms, columns)


def _samples_text(one: SystemOutput) -> str:
    how = one.defuzzifier
    single = sum(isinstance(label.function, Singleton) for label in one.terms)
    if single and single == len(one.terms):
        return "of its singletons"
    text = f"at {how.samples} values {_GRIDS[how.grid]}"
    return f"{text} and at its singletons" if single else text


_MOST_PARTS = 12  # of a combination that are written


def sum_text(parts: Sequence[Part], *, is_whole: bool = True) -> str:
    """Return a combination of columns as a sum, whole or its first parts."""
    shown = parts if is_whole else parts[:_MOST_PARTS]
    terms = [
        f"{number(one.weight)} * ({one.input} - {number(one.centre)})"
        if one.centre
        else f"{number(one.weight)} * {one.input}"
        for one in shown
    ]
    if len(shown) < len(parts):
        terms.append(counted(len(parts) - len(shown), "more input"))
    return " + ".join(terms)


def _label_lines(labels: Sequence[Term], columns: Sequence[str]) -> Iterator[str]:
    rows = [
        (
            f"  {one.name}",
            curve_text(one.function, columns)
            + ("" if one.height == 1.0 else f", times {number(one.height)}"),
        )
        for one in labels
    ]
    yield from aligned(rows)


def curve_text(curve: Curve, columns: Sequence[str] = ()) -> str:
    """Return a curve in words and numbers.

    Example:
        >>> curve_text(Trapezoid(0.0, 1.0, 1.0, 3.0))
        '1 at 1, rises from 0 at 0, falls to 0 at 3'
        >>> from fuzzytree.model import Gaussian
        >>> curve_text(Gaussian(mean=2.0, deviation=0.5))
        'gaussian: mean 2, deviation 0.5'
    """
    match curve:
        case Band() | LR() | Points():
            return shape_text(curve)
        case Trapezoid():
            return _trapezoid_text(curve)
        case Singleton(value=value):
            return number(value)
        case Linear(weights=weights, offset=offset):
            named = zip(weights, columns, strict=False)
            terms = [f"{number(weight)} * {name}" for weight, name in named]
            return " + ".join([*terms, number(offset)])
        case Formula(expression=expression):
            return text_of(expression)
        case Binary(start=start, is_above=is_above):
            return f"1 {'from' if is_above else 'up to'} {number(start)}, else 0"
        case (
            SigmoidDifference(first=first, second=second)
            | SigmoidProduct(first=first, second=second)
        ):
            inner = f"{curve_text(first)}; {curve_text(second)}"
            return f"{type(curve).__struct_config__.tag} of {inner}"
        case _:
            facts = [
                f"{field.replace('_', ' ')} {number(getattr(curve, field))}"
                for field in curve.__struct_fields__
            ]
            return f"{type(curve).__struct_config__.tag}: {', '.join(facts)}"


def _trapezoid_text(curve: Trapezoid) -> str:
    if curve.b == curve.c and curve.a is not None and curve.d is not None:
        plateau = f"1 at {number(curve.b)}"
    elif curve.a is None and curve.d is None:
        return "1 everywhere"
    elif curve.a is None:
        plateau = f"1 up to {number(curve.c)}"
    elif curve.d is None:
        plateau = f"1 from {number(curve.b)}"
    else:
        plateau = f"1 from {number(curve.b)} to {number(curve.c)}"
    rises = "" if curve.a is None else f"rises from 0 at {number(curve.a)}"
    falls = "" if curve.d is None else f"falls to 0 at {number(curve.d)}"
    return ", ".join(filter(None, (plateau, rises, falls)))

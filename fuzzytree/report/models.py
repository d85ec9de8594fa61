"""Models as plain text: a tree with its branches, rules as sentences, terms."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType

import msgspec

from fuzzytree.formats import conclusions_text, condition_sentence, text_of
from fuzzytree.model import (
    DATE_UNIT,
    LR,
    Activation,
    Band,
    Binary,
    Curve,
    Document,
    Formula,
    Leaf,
    Linear,
    Node,
    Part,
    Points,
    Rule,
    RuleBlock,
    Semantics,
    Side,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
    depth,
    intervals,
    kind_of,
    sentence,
    stand_ins,
)
from fuzzytree.rechecking import MISSING, interval_word, minute_word
from fuzzytree.report.merged_rules import with_merged_propositions
from fuzzytree.report.text import aligned, counted, number, some
from fuzzytree.runtimes import Facts, OnnxModel, Outputs
from fuzzytree.semantics import Status, curve_degree, rules_of

Rules = Sequence[Rule | SystemRule]

_MOST_PAIRS = 6  # points that a line of text shows one by one
_MOST_PARTS = 12  # of a combination, where it must fit into a line
_MOST_PLACES = 16  # categories that a line names


def model_lines(model: Document) -> Iterator[str]:
    """Yield a model as a person reads it: head, tree, rules, terms."""
    yield from head_lines(model)
    if model.leaves:
        yield ""
        yield from tree_lines(model)
    start = 1
    blocks: list[tuple[str, Rules]]
    blocks = [(_block_text(block), block.rules) for block in model.blocks]
    for head, rules in blocks or [("", rules_of(model).rules)]:
        yield ""
        if head:
            yield head
        width = len(str(start + len(rules) - 1))
        for position, rule in enumerate(rules, start):
            if isinstance(rule, Rule) and model.leaves:
                rule = with_merged_propositions(rule, model.variables)
            yield f"{position:{width}}. {rule_text(rule)}{_rows_text(rule)}"
        start += len(rules)
    yield ""
    yield from term_lines((*model.variables, *model.outputs), model.inputs)


def rule_facts(model: Document) -> list[dict[str, object]]:
    """Return the rules for programs: number, sentence, and class and rows or weight."""
    rules: Rules = rules_of(model).rules
    results: list[dict[str, object]] = []
    for position, rule in enumerate(rules, 1):
        facts: dict[str, object] = {"number": position, "text": rule_text(rule)}
        if isinstance(rule, Rule):
            facts |= {"class": rule.then, "rows": rule.support}
        else:
            facts["weight"] = rule.weight
        results.append(facts)
    return results


def document_text(model: Document) -> str:
    """Return what a model is and how large, in a line.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> document_text(random_tree(1, leaves=2))
        'tree, 1 node, 2 leaves, depth 1, 1 input, 3 classes'
    """
    inputs = counted(len(model.inputs), "input")
    if model.outputs:
        outputs, rules = len(model.outputs), len(model.rules)
        return (
            f"fuzzy system, {inputs}, {counted(outputs, 'output')}, "
            f"{counted(rules, 'rule')}, {counted(_terms(model), 'term')}"
        )
    classes = counted(len(model.classes), "class", "classes")
    return f"{kind_text(model)}, {inputs}, {classes}"


def document_facts(model: Document) -> dict[str, object]:
    """Return the same for programs: kind, name, inputs, answers, counts."""
    facts: dict[str, object] = {
        "carrier": kind_of(model),
        "name": model.name,
        "inputs": model.inputs,
    }
    if model.outputs:
        facts["outputs"] = tuple(output.name for output in model.outputs)
    else:
        facts["classes"] = model.classes
    rules = len(model.rule_labels) or len(model.rules)
    return {**facts, "rules": rules, "terms": _terms(model)}


def _terms(model: Document) -> int:
    count = sum(len(variable.terms) for variable in model.variables)
    return count + sum(len(output.terms) for output in model.outputs)


def onnx_facts(model: OnnxModel) -> dict[str, object]:
    """Return what an ONNX file says about itself, by the names of the JSON."""
    fields = msgspec.structs.fields(Facts)
    return {one.encode_name: getattr(model, one.name) for one in fields}


def fact_lines(facts: Mapping[str, object]) -> list[str]:
    """Return facts as aligned lines."""
    rows: list[tuple[str, str]] = []
    for name, value in facts.items():
        if isinstance(value, Semantics):
            rows += [
                (k, str(getattr(value, k) or "no class"))
                for k in value.__struct_fields__
            ]
        elif isinstance(value, tuple):
            rows.append((name, ", ".join(map(str, value))))
        else:
            shown = "representation" if name == "carrier" else name
            rows.append((shown, str(value)))
    return aligned(rows)


def head_lines(model: Document) -> Iterator[str]:
    """Yield what a model is, what it needs, and what it answers."""
    fuzzy = "fuzzy " if model.leaves else ""
    what = document_text(model) if model.outputs else fuzzy + kind_text(model)
    yield f"{model.name}: {what}"
    yield from (f"note     {line}" for line in model.note.splitlines())
    of = f" of {len(model.columns)} columns" if model.columns else ""
    yield f"inputs   {len(model.inputs)}{of}: {', '.join(model.inputs) or 'none'}"
    results = [output.name for output in model.outputs] or model.classes
    yield (
        f"{'outputs' if model.outputs else 'classes'}  "
        f"{len(results)}: {', '.join(results)}"
    )
    answers = f"missing value: {missing_text(model)}"
    semantics = model.semantics
    if model.rules and not model.outputs:
        answers += f"; no rule fires: {semantics.uncovered or 'no class'}"
        answers += f"; AND is {semantics.conjunction}; the first of the strongest wins"
    yield f"answers  {answers}"


def missing_text(model: Document) -> str:
    """Return what becomes of a missing value."""
    if model.outputs:
        return "nan"
    answer, filled = model.semantics.missing or "no class", stand_ins(model.variables)
    if not filled:
        return answer
    rest = len(model.inputs) - len(filled)
    more = f"; {answer} for {rest}" if rest else ""
    return f"replaced, see `missing as` of {counted(len(filled), 'input')}{more}"


def kind_text(model: Document) -> str:
    """Return what a model is that decides for a class, and how large."""
    if model.leaves:
        sizes = f"{counted(len(model.leaves), 'leaf', 'leaves')}, depth {depth(model)}"
        return f"tree, {counted(len(model.nodes), 'node')}, {sizes}"
    kind = f"{model.kind} " if model.kind else ""
    return f"{kind}rule base, {counted(len(model.rules), 'rule')}"


def tree_lines(tree: Document) -> Iterator[str]:
    """Yield a tree drawn with its branches, each with the values that it takes."""
    nodes, leaves = tree.nodes, tree.leaves
    if not nodes:
        yield _leaf_text(1, leaves[0])
        return
    variables = {v.name: v for v in tree.variables}
    yield _node_text(nodes[0], variables)
    todo = _branches(nodes[0], "")
    while todo:
        node, position, indent = todo.pop()
        branch = node.branches[position]
        is_last = position == len(node.branches) - 1
        corner, rail = ("└─ ", "   ") if is_last else ("├─ ", "│  ")
        text = branch_text(variables[node.variable], node, position)
        if branch.node is not None:
            below = nodes[branch.node - 1]
            end = _node_text(below, variables)
            todo += _branches(below, indent + rail)
        else:
            leaf = branch.leaf or 1
            end = _leaf_text(leaf, leaves[leaf - 1])
        yield f"{indent}{corner}{text}: {end}"


def _branches(node: Node, indent: str) -> list[tuple[Node, int, str]]:
    return [(node, k, indent) for k in reversed(range(len(node.branches)))]


def _node_text(node: Node, variables: Mapping[str, Variable]) -> str:
    count = len(variables[node.variable].parts)
    return f"{node.variable}?" + (f"  ({count} inputs)" if count else "")


def _leaf_text(position: int, leaf: Leaf) -> str:
    shape = f" ({leaf.pattern})" if leaf.pattern not in ("", leaf.label) else ""
    return f"{leaf.label}{shape}  [{position}]{_rows_text(leaf)}"


def _rows_text(part: Leaf | Rule | SystemRule) -> str:
    """Return how many training rows reached a part, where that is known."""
    support = None if isinstance(part, SystemRule) else part.support
    return "" if support is None else f"  {counted(support, 'row')}"


def branch_text(
    variable: Variable,
    node: Node,
    position: int,
    form: str = "{} ({})",
    most: str = "<=",
) -> str:
    """Return the terms of a branch, and the values that it takes if they do not say so.

    Numbers are taken as `<= 2.5` or `> 1 to 2`, dates alike; of categories their names.
    """
    terms, values = " or ".join(node.branches[position].terms), list[str]()
    for (low, high), owner in zip(intervals(node), node.owners, strict=True):
        if owner != position:
            continue
        if word := interval_word(variable, low, high, most):
            values.append(word)
        elif low is None:
            values.append(f"{most} {number(high)}" if high is not None else "any")
        elif high is None:
            values.append(f"> {number(low)}")
        else:
            values.append(f"> {number(low)} to {number(high)}")
    shown = " or ".join(values)
    is_clear = variable.categories and re.sub(r" \(\d+\)", "", terms) == shown
    return terms if is_clear else form.format(terms, shown)


def value_word(variable: Variable, value: float) -> str:
    """Return a value of an input with its unit, its category, or its date.

    Example:
        >>> value_word(Variable("mass", unit="kg"), 2.0)
        '2 kg'
        >>> value_word(Variable("day", unit=DATE_UNIT), 19783.0)
        '2024-03-01'
    """
    word = minute_word(variable, value)
    return word or f"{number(value)} {variable.unit}".rstrip()


def end_word(variable: Variable | SystemOutput, value: float) -> str:
    """Return a value without its unit; a date if it is one."""
    word = ""
    if isinstance(variable, Variable) and variable.unit == DATE_UNIT:
        word = minute_word(variable, value)
    return word or number(value)


def term_lines(
    variables: Sequence[Variable | SystemOutput], columns: Sequence[str] = ()
) -> Iterator[str]:
    """Yield each variable with its unit and range, and its terms with their numbers.

    `columns` are the inputs of a fuzzy system, which linear terms multiply.
    """
    known = {one.name: one for one in variables if isinstance(one, Variable)}
    for one in variables:
        if isinstance(one, Variable) and not (one.terms or one.parts):
            continue
        yield one.name + _span_text(one)
        for position, line in enumerate(summands(one.parts, known)):
            lead = f"  {line}" if position else f"= {line.replace('+', ' ', 1)}"
            yield f"  {lead}"
        yield from (f"    {line}" for line in places_of(one.parts, known))
        if isinstance(one, SystemOutput):
            yield f"  {_answer_text(one)}"
        heights = [
            "" if term.height == 1.0 else f", times {number(term.height)}"
            for term in one.terms
        ]
        yield from aligned(
            (f"  {term.name}", f"{term_text(one, term, columns)}{times}")
            for term, times in zip(one.terms, heights, strict=True)
        )


def places_of(parts: Sequence[Part], known: Mapping[str, Variable]) -> Iterator[str]:
    """Yield what a combination counts categories as, an input to a line."""
    for part in parts:
        names = enumerate(known[part.input].categories)
        if places := [f"{place} is {name}" for place, name in names]:
            yield f"{part.input}: {some(places, _MOST_PLACES)}"


def term_text(one: Variable | SystemOutput, term: Term, columns: Sequence[str]) -> str:
    """Return what a term is: of categories the degree of each, else its curve."""
    if isinstance(one, SystemOutput) or not one.categories:
        return curve_text(term.function, columns, partial(end_word, one))
    by_degree: dict[float, list[str]] = {}
    names = [*enumerate(one.categories)]
    names += [(-1, MISSING)] if one.missing == -1.0 else []
    for place, name in names:
        by_degree.setdefault(curve_degree(term.function, place), []).append(name)
    by_degree.pop(0.0, None)
    levels = sorted(by_degree.items(), reverse=True)
    return (
        "; ".join(f"{number(d)}: {some(names, _MOST_PLACES)}" for d, names in levels)
        or "0"
    )


def _span_text(one: Variable | SystemOutput) -> str:
    """Return the unit and the range of a variable, to stand behind its name."""
    unit = f", in {one.unit}" if one.unit and one.unit != DATE_UNIT else ""
    if isinstance(one, Variable) and one.categories:
        return f"{unit}, {counted(len(one.categories), 'category', 'categories')}"
    if one.low is None or one.high is None:
        return unit
    clipped = ", clipped" if one.clips else ""
    return f"{unit}, {end_word(one, one.low)} to {end_word(one, one.high)}{clipped}"


def sum_text(
    parts: Sequence[Part], known: Mapping[str, Variable] = MappingProxyType({})
) -> str:
    """Return the first summands of a combination of columns in a line.

    Example:
        >>> sum_text((Part("a", 2.0, 1.0), Part("b", -0.5, 0.0)))
        '2 * (a - 1) - 0.5 * b'
    """
    more = len(parts) - _MOST_PARTS
    rest = [f"+ {counted(more, 'more input')}"] if more > 0 else []
    return " ".join([*summands(parts[:_MOST_PARTS], known), *rest]).removeprefix("+ ")


def summands(
    parts: Sequence[Part], known: Mapping[str, Variable] = MappingProxyType({})
) -> Iterator[str]:
    """Yield each summand of a combination with its sign, the first with `+` too.

    `known` are the inputs, of which those of dates have a date subtracted.
    """
    for part in parts:
        is_date = part.input in known and known[part.input].unit == DATE_UNIT
        minus = "-" if part.centre >= 0 or is_date else "+"
        centre = number(abs(part.centre))
        centre = end_word(known[part.input], part.centre) if is_date else centre
        shifted = f"({part.input} {minus} {centre})"
        inner = shifted if part.centre else part.input
        yield f"{'-' if part.weight < 0 else '+'} {number(abs(part.weight))} * {inner}"


def system_reasons(system: Document, outputs: Outputs) -> list[str]:
    """Return, for each row, the rules that were activated, each with its degree."""
    rules: Rules = system.rules
    texts = [*map(rule_text, rules)]
    if outputs.strengths is None:
        return [""] * len(outputs)
    rows = zip(outputs.strengths.T.tolist(), outputs.status.tolist(), strict=True)
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


def _block_text(block: RuleBlock) -> str:
    name = f" {block.name}" if block.name else ""
    facts = [
        f"AND is {block.conjunction}" if block.conjunction else "",
        f"OR is {block.disjunction}" if block.disjunction else "",
        f"THEN is {block.implication}" if block.implication else "",
        _activation_text(block.activation),
    ]
    return f"rules{name}: {'; '.join(filter(None, facts))}"


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


def rule_text(rule: Rule | SystemRule) -> str:
    """Return a rule as people read it.

    Example:
        >>> from fuzzytree.model import Conclusion, Not, Proposition
        >>> hot = Proposition("water", ("hot",), ("very",))
        >>> rule_text(SystemRule(Not(hot), (Conclusion("power", "low"),), weight=0.5))
        'IF not (water is very hot) THEN power is low  (weight 0.5)'
    """
    if isinstance(rule, Rule):
        return sentence(rule)
    ends = conclusions_text(rule.then)
    weight = "" if rule.weight == 1.0 else f"  (weight {number(rule.weight)})"
    name = f"  ({rule.name})" if rule.name else ""
    if rule.when is None:
        return f"ALWAYS {ends}{weight}{name}"
    return f"IF {condition_sentence(rule.when)} THEN {ends}{weight}{name}"


_GRIDS = {
    "middle": "in the middle of equal pieces",
    "low ends": "at the low ends of equal pieces",
    "ends": "from end to end",
    "half ends": "from end to end, by the trapezoidal rule",
    "lines": "from end to end, joined by lines",
}


def _answer_text(one: SystemOutput) -> str:
    """Return how an output's number is made of what the rules conclude."""
    how = one.defuzzifier
    facts: list[str] = [how.method]
    if not how.is_weighted:
        facts = [f"{how.method} {_samples_text(one)}"]
    if one.aggregation:
        facts.append(f"joined by {one.aggregation}")
    default = "nan" if one.default is None else number(one.default)
    return "; ".join([*facts, f"no rule: {default}"])


def _samples_text(one: SystemOutput) -> str:
    how = one.defuzzifier
    single = sum(isinstance(label.function, Singleton) for label in one.terms)
    if single and single == len(one.terms):
        return "of its singletons"
    text = f"at {how.samples} values {_GRIDS[how.grid]}"
    return f"{text} and at its singletons" if single else text


def curve_text(
    curve: Curve,
    columns: Sequence[str] = (),
    word: Callable[[float], str] = number,
) -> str:
    """Return a curve in words and numbers; `word` writes values of its variable.

    Example:
        >>> curve_text(Trapezoid(0.0, 1.0, 1.0, 3.0))
        '1 at 1, rises from 0 at 0, falls to 0 at 3'
        >>> curve_text(Band(high=1.0, right=3.0))
        '1 up to 1, falls to 0 at 3'
        >>> from fuzzytree.model import Gaussian
        >>> curve_text(Gaussian(mean=2.0, deviation=0.5))
        'gaussian: mean 2, deviation 0.5'
    """
    match curve:
        case Band(low=low, high=high, left=left, right=right):
            return _plateau_text(low, high, left, right, "above", word)
        case Trapezoid(a=a, b=b, c=c, d=d):
            low, high = None if a is None else b, None if d is None else c
            return _plateau_text(low, high, a, d, "from", word)
        case LR(mean=mean, left=below, right=above):
            apart = "" if below == above else f" below, {_side_text(above)} above"
            return f"1 at {word(mean)}, spread {_side_text(below)}{apart}"
        case Points(values=values, degrees=degrees):
            pairs = [
                f"({word(v)}, {number(d)})"
                for v, d in zip(values, degrees, strict=True)
            ]
            if len(pairs) > _MOST_PAIRS:
                return f"{len(pairs)} points from {pairs[0]} to {pairs[-1]}"
            return f"line through {', '.join(pairs)}"
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


def _plateau_text(
    low: float | None,
    high: float | None,
    left: float | None,
    right: float | None,
    since: str,
    word: Callable[[float], str],
) -> str:
    """Return where a curve is 1, and where it rises and falls beside that."""
    if low is None:
        edge = "1 everywhere" if high is None else f"1 up to {word(high)}"
    elif high is None:
        edge = f"1 {since} {word(low)}"
    elif low == high:
        edge = f"1 at {word(low)}"
    else:
        edge = f"1 from {word(low)} to {word(high)}"
    rises = "" if low is None else _flank_text(low, left, "rises from", word)
    falls = "" if high is None else _flank_text(high, right, "falls to", word)
    return ", ".join(filter(None, (edge, rises, falls)))


def _flank_text(
    edge: float, end: float | None, verb: str, word: Callable[[float], str]
) -> str:
    if end is None:
        return f"0 beyond {word(edge)}"
    return f"{verb} 0 at {word(end)}"


def _side_text(side: Side) -> str:
    return f"{number(side.spread)} (0 from {number(side.reach)} spreads)"

"""Results as plain text: a tree with its branches, rules as sentences, tables."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec

from fuzzytree.auditing import counted as counted
from fuzzytree.auditing import number_text
from fuzzytree.model import (
    LR,
    Agreement,
    Band,
    Branch,
    Certified,
    Comparison,
    FuzzyTree,
    Leaf,
    Node,
    Points,
    RuleBase,
    Semantics,
    Shape,
    Side,
    SystemOutput,
    Variable,
    intervals,
    printable,
    sentence,
)
from fuzzytree.runtimes import Facts, OnnxModel
from fuzzytree.semantics import rules_from_tree

_MOST_PAIRS = 6  # points that a line of text shows one by one
UNITS = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"))
"""Of nanoseconds; what is shorter has that unit itself."""


number = number_text
"""A number with six digits, for people; files have all of them."""


def aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with aligned columns.

    Example:
        >>> aligned([("name", "rows"), ("a", "12")])
        ['name  rows', 'a     12']
    """
    table = [list(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]


def wrapped(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Return a text in lines; what a terminal might obey is written as an escape.

    `first` stands before the first line and `rest` before the others, in the width.
    """
    return textwrap.wrap(
        printable(text),
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_on_hyphens=False,
        break_long_words=False,
    )


def some(words: Iterable[str], most: int, more: str = "more", joint: str = ", ") -> str:
    """Return the first of some words, and how many more there are.

    Example:
        >>> some(["a", "b", "c"], 2)
        'a, b, 1 more'
    """
    shown = [*words]
    if len(shown) > most:
        shown[most:] = [f"{len(shown) - most} {more}"]
    return joint.join(shown)


def duration(ns: float) -> str:
    """Return a time with three digits and the unit that fits.

    Example:
        >>> duration(45.31), duration(999.7), duration(2069.0), duration(0.0712)
        ('45.3 ns', '1000 ns', '2.07 µs', '0.0712 ns')
    """
    for size, unit in UNITS:
        if ns >= size:
            return f"{digits(ns / size)} {unit}"
    return f"{digits(ns)} ns"


def digits(value: float) -> str:
    """Return a positive number with three digits; no exponent from 100 on."""
    return f"{value:.0f}" if value >= 100 else f"{value:#.3g}"


# --- models


def model_lines(model: FuzzyTree | RuleBase) -> Iterator[str]:
    """Yield a model as a person reads it: head, tree, rules, terms."""
    yield from head_lines(model)
    yield ""
    if isinstance(model, FuzzyTree):
        yield from tree_lines(model)
        yield ""
    yield from rule_lines(as_rules(model))
    yield ""
    yield from term_lines(model.variables)


def as_rules(model: FuzzyTree | RuleBase) -> RuleBase:
    """Return a rule base as it is, and the relative rules of a tree."""
    return rules_from_tree(model) if isinstance(model, FuzzyTree) else model


def rule_facts(model: FuzzyTree | RuleBase) -> list[dict[str, object]]:
    """Return the rules for programs: number, sentence, class, supporting rows."""
    return [
        {"number": k, "text": sentence(r), "class": r.then, "rows": r.support}
        for k, r in enumerate(as_rules(model).rules, 1)
    ]


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


def head_lines(model: FuzzyTree | RuleBase) -> Iterator[str]:
    """Yield what a model is, what it needs, and what it answers."""
    fuzzy = "fuzzy " if isinstance(model, FuzzyTree) else ""
    yield f"{model.name}: {fuzzy}{kind_text(model)}"
    of = f" of {len(model.columns)} columns" if model.columns else ""
    yield f"inputs   {len(model.inputs)}{of}: {', '.join(model.inputs) or 'none'}"
    yield f"classes  {len(model.classes)}: {', '.join(model.classes)}"
    semantics = model.semantics
    answers = f"missing value: {semantics.missing or 'no class'}"
    if isinstance(model, RuleBase):
        answers += f"; no rule fires: {semantics.uncovered or 'no class'}"
        answers += f"; AND is {semantics.conjunction}; the first of the strongest wins"
    yield f"answers  {answers}"


def kind_text(model: FuzzyTree | RuleBase) -> str:
    """Return what a model is and how large."""
    if isinstance(model, FuzzyTree):
        sizes = f"{counted(len(model.leaves), 'leaf', 'leaves')}, depth {depth(model)}"
        return f"tree, {counted(len(model.nodes), 'node')}, {sizes}"
    kind = f"{model.kind} " if model.kind else ""
    return f"{kind}rule base, {counted(len(model.rules), 'rule')}"


def depth(tree: FuzzyTree) -> int:
    """Return how many nodes the longest path of a tree has."""
    depths = [0] * (len(tree.nodes) + 1)
    for position in range(len(tree.nodes), 0, -1):
        below = [depths[b.node] for b in tree.nodes[position - 1].branches if b.node]
        depths[position] = 1 + max(below, default=0)
    return depths[1] if tree.nodes else 0


def tree_lines(tree: FuzzyTree) -> Iterator[str]:
    """Yield a tree drawn with its branches, each with the values that it takes."""
    if not tree.nodes:
        yield _leaf_text(1, tree.leaves[0])
        return
    parts = {v.name: len(v.parts) for v in tree.variables}
    yield _node_text(tree.nodes[0], parts)
    todo = _branches(tree.nodes[0], "")
    while todo:
        node, position, indent = todo.pop()
        branch = node.branches[position]
        is_last = position == len(node.branches) - 1
        corner, rail = ("└─ ", "   ") if is_last else ("├─ ", "│  ")
        text = f"{' or '.join(branch.terms)} ({taken(node, position)})"
        yield f"{indent}{corner}{text}: {_end_text(tree, branch, parts)}"
        if branch.node is not None:
            todo += _branches(tree.nodes[branch.node - 1], indent + rail)


def _branches(node: Node, indent: str) -> list[tuple[Node, int, str]]:
    return [(node, k, indent) for k in reversed(range(len(node.branches)))]


def _end_text(tree: FuzzyTree, branch: Branch, parts: dict[str, int]) -> str:
    if branch.node is not None:
        return _node_text(tree.nodes[branch.node - 1], parts)
    position = branch.leaf or 1
    return _leaf_text(position, tree.leaves[position - 1])


def _node_text(node: Node, parts: dict[str, int]) -> str:
    count = parts[node.variable]
    return f"{node.variable}?" + (f"  ({count} inputs)" if count else "")


def _leaf_text(position: int, leaf: Leaf) -> str:
    shape = f" ({leaf.pattern})" if leaf.pattern not in ("", leaf.label) else ""
    rows = f"  {counted(leaf.support, 'row')}" if leaf.support is not None else ""
    return f"{leaf.label}{shape}  [{position}]{rows}"


def taken(node: Node, position: int, most: str = "<=") -> str:
    """Return the values that a branch takes, such as `<= 2.5` or `1 to 2`."""
    values: list[str] = []
    for (low, high), owner in zip(intervals(node), node.owners, strict=True):
        if owner != position:
            continue
        if low is None:
            values.append(f"{most} {number(high)}" if high is not None else "any")
        elif high is None:
            values.append(f"> {number(low)}")
        else:
            values.append(f"> {number(low)} to {number(high)}")
    return " or ".join(values)


def rule_lines(rules: RuleBase) -> Iterator[str]:
    """Yield the rules as numbered sentences with the rows that support them."""
    width = len(str(len(rules.rules)))
    for position, rule in enumerate(rules.rules, 1):
        rows = f"  {counted(rule.support, 'row')}" if rule.support is not None else ""
        yield f"{position:{width}}. {sentence(rule)}{rows}"


def term_lines(variables: Sequence[Variable]) -> Iterator[str]:
    """Yield each variable with its unit and range, and its terms with their numbers."""
    for variable in variables:
        if not variable.terms and not variable.parts:
            continue
        yield variable.name + span_text(variable)
        if variable.parts:
            yield from _sum_lines(variable)
        rows = [(f"  {t.name}", shape_text(t.shape)) for t in variable.terms]
        yield from aligned(rows)


def span_text(one: Variable | SystemOutput) -> str:
    """Return the unit and the range of a variable, to stand behind its name."""
    unit = f", in {one.unit}" if one.unit else ""
    if one.low is None or one.high is None:
        return unit
    clipped = ", clipped" if one.clips else ""
    return f"{unit}, {number(one.low)} to {number(one.high)}{clipped}"


def _sum_lines(variable: Variable) -> Iterator[str]:
    for position, part in enumerate(variable.parts):
        sign = "-" if part.weight < 0 else "+" if position else " "
        centre = "-" if part.centre >= 0 else "+"
        shifted = f"({part.input} {centre} {number(abs(part.centre))})"
        inner = shifted if part.centre else part.input
        lead = " " if position else "="
        yield f"  {lead} {sign} {number(abs(part.weight))} * {inner}"


def shape_text(shape: Shape) -> str:
    """Return a curve in words and numbers.

    Example:
        >>> shape_text(Band(high=1.0, right=3.0))
        '1 up to 1, falls to 0 at 3'
    """
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is None and high is None:
                return "1 everywhere"
            rises = "" if low is None else _flank_text(low, left, "rises from")
            falls = "" if high is None else _flank_text(high, right, "falls to")
            if low is None or high is None:
                edge = (
                    f"1 up to {number(high)}" if high is not None else
                    f"1 above {number(low or 0.0)}"
                )  # fmt: skip
            else:
                edge = f"1 from {number(low)} to {number(high)}"
            return ", ".join(filter(None, (edge, rises, falls)))
        case LR(mean=mean, left=left_side, right=right_side):
            if left_side == right_side:
                return f"1 at {number(mean)}, spread {_side_text(left_side)}"
            return (
                f"1 at {number(mean)}, spread {_side_text(left_side)} below, "
                f"{_side_text(right_side)} above"
            )
        case Points(values=values, degrees=degrees):
            pairs = [
                f"({number(value)}, {number(degree)})"
                for value, degree in zip(values, degrees, strict=True)
            ]
            if len(pairs) > _MOST_PAIRS:
                return f"{len(pairs)} points from {pairs[0]} to {pairs[-1]}"
            return f"line through {', '.join(pairs)}"


def _flank_text(edge: float, end: float | None, verb: str) -> str:
    if end is None:
        return f"0 beyond {number(edge)}"
    return f"{verb} 0 at {number(end)}"


def _side_text(side: Side) -> str:
    return f"{number(side.spread)} (0 from {number(side.reach)} spreads)"


# --- checks


def agreement_lines(
    agreement: Agreement, *, is_verbose: bool = False, is_full: bool = False
) -> Iterator[str]:
    """Yield a check: its verdict, counts of what agrees, and all that does not.

    Args:
        agreement: The check.
        is_verbose: Whether each comparison has a line, and not only a count.
        is_full: Whether to print the rows that differ by an allowed amount, too.
    """
    verdict, basis = agreement_verdict(agreement), _basis_text(agreement)
    yield f"{agreement.model}: {verdict} ({basis})"
    comparisons = agreement.comparisons
    wrong = [c for c in comparisons if c.verdict in ("DISAGREES", "rows only")]
    if is_verbose or is_full:
        shown: Sequence[Comparison] = agreement.comparisons
        yield from aligned([COMPARISON, *map(comparison_row, shown)])
    else:
        yield from aligned([_GROUP, *_groups(agreement.comparisons)])
        shown = wrong[:_MOST_WRONG]
        if shown:
            yield from aligned([COMPARISON, *map(comparison_row, shown)])
        yield from _more(len(wrong) - len(shown), "comparison")
    for comparison in shown:
        if comparison.detail and (is_full or comparison in wrong):
            yield f"{comparison.representation} compared with {comparison.against}:"
            yield from (f"  {line}" for line in comparison.detail)
    for count in agreement.counts:
        yield (
            f"{count.representation}: {counted(count.rows, 'row')}, {count.ties} tied, "
            f"{count.uncovered} with no rule fired, "
            f"{count.missing} with a missing input"
        )
    if agreement.coverage is not None:
        yield from agreement.coverage.sentences
    most = len(agreement.skipped) if is_verbose else _MOST_SKIPPED
    yield from (f"not examined: {text}" for text in agreement.skipped[:most])
    yield from _more(len(agreement.skipped[most:]), "item", "not examined")
    yield from _bound_lines(agreement.certificates, is_verbose=is_verbose)


def _groups(comparisons: Sequence[Comparison]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each representation: how many were compared with it."""
    groups: dict[str, list[Comparison]] = {}
    for one in comparisons:
        title = one.against.rpartition(": ")[2]
        name = "calls of all kinds" if one.basis == "calls" else title
        groups.setdefault(name, []).append(one)
    for name, members in groups.items():
        verdicts = Counter(one.verdict for one in members)
        largest = max(one.largest_difference for one in members)
        said = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
        said = said.replace("agrees", "agree")
        yield name, str(len(members)), f"{largest:.2g}", said


def _bound_lines(bounds: Sequence[Certified], *, is_verbose: bool) -> Iterator[str]:
    """Yield the bounds of rounding errors: in a table, or as a count."""
    wrong = [one for one in bounds if one.verdict == "DISAGREES"]
    if wrong or (is_verbose and bounds):
        shown = bounds if is_verbose else wrong[:_MOST_WRONG]
        yield from aligned([CERTIFIED, *map(certified_row, shown)])
    elif bounds:
        largest = max((one.largest or 0.0 for one in bounds), default=0.0)
        yield (
            f"{counted(len(bounds), 'rounding bound')} checked against exact "
            f"arithmetic, none is exceeded; largest error {largest:.2g}"
        )
    for one in wrong:
        yield f"{one.representation} compared with exact arithmetic:"
        yield from (f"  {line}" for line in one.detail)


def _more(count: int, noun: str, after: str = "not shown") -> Iterator[str]:
    """Yield how many things are not shown, if there are any."""
    if count > 0:
        yield f"{counted(count, f'more {noun}')} {after}; --verbose lists all"


_MOST_WRONG = 8  # comparisons that do not agree, unless all are printed
_MOST_SKIPPED = 3
_GROUP = ("compared with", "comparisons", "largest difference", "result")
COMPARISON = (
    "representation",
    "compared with",
    "on",
    "rows",
    "largest difference",
    "allowed",
    "verdict",
)


def agreement_verdict(agreement: Agreement) -> str:
    """Return how many comparisons of a check disagree, and how many bounds fail."""
    wrong = sum(one.verdict == "DISAGREES" for one in agreement.comparisons)
    broken = sum(one.verdict == "DISAGREES" for one in agreement.certificates)
    verb = "disagree" if wrong > 1 else "disagrees"
    count = counted(len(agreement.comparisons), "comparison")
    said = f"{wrong or 'none'} of {count} {verb}"
    rows_only = sum(one.verdict == "rows only" for one in agreement.comparisons)
    if rows_only:
        said += f"; in {counted(rows_only, 'file')} only the rows agree"
        said += "" if agreement.rows_only else ", which --rows-only accepts"
    if broken:
        said += f"; {counted(broken, 'rounding bound')} exceeded"
    return said


def _basis_text(agreement: Agreement) -> str:
    rows = max(
        (
            agreement.probes,
            *(one.rows for one in agreement.counts),
            *(one.rows for one in agreement.comparisons if one.basis == "rows"),
        )
    )
    data = rows - agreement.probes
    text = counted(agreement.probes, "probe")
    text += f", {counted(data, 'row')} of data" if data else ""
    return text + (f", {counted(agreement.cells, 'cell')}" if agreement.cells else "")


def comparison_row(one: Comparison) -> tuple[str, ...]:
    """Return the cells of a comparison, below `COMPARISON`."""
    verdict: str = one.verdict
    if verdict == "rows only":
        verdict += f", {counted(one.differing, 'difference')}"
    elif one.differing:
        verdict += f" in {one.differing}"
    if one.flips and not one.differing:
        verdict += f", {counted(one.flips, 'class', 'classes')} differ as allowed"
    if one.largest_flip_margin:
        verdict += f" (margin up to {one.largest_flip_margin:.2g})"
    if one.unbounded:
        verdict += f"; {counted(one.unbounded, 'row')} without a bound"
        if one.largest_unbounded == math.inf:
            verdict += ", some with a missing value on one side only"
        elif one.largest_unbounded:
            verdict += f" differ by up to {one.largest_unbounded:.2g}"
    return (
        one.representation,
        one.against,
        one.basis,
        str(one.rows),
        f"{one.largest_difference:.2g}",
        f"{one.allowed:.2g}",
        verdict,
    )


CERTIFIED = (
    "compared with exact arithmetic",
    "largest error",
    "inside the band",
    "flips",
    "verdict",
    "certified",
)


def certified_row(one: Certified) -> tuple[str, ...]:
    """Return the cells of a rounding bound, below `CERTIFIED`."""
    flips = str(one.flips)
    if one.largest_flip_margin is not None:
        flips += f" (margin up to {one.largest_flip_margin:.2g})"
    if one.cover_lost or one.cover_gained:
        flips += f", cover lost in {one.cover_lost}, gained in {one.cover_gained}"
    noun = "row" if one.on == "data" else "probe"
    return (
        one.representation,
        "-" if one.largest is None else f"{one.largest:.2g}",
        f"{one.in_band} of {counted(one.rows, noun)}",
        flips,
        one.verdict,
        one.sentence,
    )

"""Results as plain text: a tree with its branches, rules as sentences, tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from fuzzytree.auditing.engine.wording import (  # for other reports too
    counted as counted,
)
from fuzzytree.auditing.engine.wording import number_text
from fuzzytree.model.agreement import Agreement, Certified, Comparison
from fuzzytree.model.contracts import Format, Runtime
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Flank,
    Points,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Variable,
    sentence,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.runtimes.onnxruntime import Facts, OnnxModel
from fuzzytree.semantics.lowering import rules_from_tree

_MOST_PAIRS = 6  # points that a line of text shows one by one
_UNITS = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"))


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


def duration(ns: float) -> str:
    """Return a time with three digits and the unit that fits.

    Example:
        >>> duration(45.31), duration(999.7), duration(2069.0), duration(0.0712)
        ('45.3 ns', '1000 ns', '2.07 µs', '0.0712 ns')
    """
    for size, unit in _UNITS:
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
    """Return what an ONNX file says about itself."""
    return {field: getattr(model, field) for field in Facts.__struct_fields__}


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
            rows.append((name, str(value)))
    return aligned(rows)


def head_lines(model: FuzzyTree | RuleBase) -> Iterator[str]:
    """Yield what a model is, what it needs, and what it answers."""
    if isinstance(model, FuzzyTree):
        sizes = f"{counted(len(model.leaves), 'leaf', 'leaves')}, depth {depth(model)}"
        what = f"fuzzy tree, {counted(len(model.nodes), 'node')}, {sizes}"
    else:
        kind = f"{model.kind} " if model.kind else ""
        what = f"{kind}rule base, {counted(len(model.rules), 'rule')}"
    yield f"{model.name}: {what}"
    of = f" of {len(model.columns)} columns" if model.columns else ""
    yield f"inputs   {len(model.inputs)}{of}: {', '.join(model.inputs) or 'none'}"
    yield f"classes  {len(model.classes)}: {', '.join(model.classes)}"
    semantics = model.semantics
    answers = f"missing value: {semantics.missing or 'no class'}"
    if isinstance(model, RuleBase):
        answers += f"; no rule fires: {semantics.uncovered or 'no class'}"
        answers += f"; AND is {semantics.conjunction}; the first of the strongest wins"
    yield f"answers  {answers}"


def depth(tree: FuzzyTree) -> int:
    """Return how many nodes the longest path of a tree asks."""
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
        text = f"{' or '.join(branch.terms)} ({_taken(node, position)})"
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


def _taken(node: Node, position: int) -> str:
    """Return the values that a branch takes, such as `<= 2.5` or `1 to 2`."""
    edges = [None, *node.cuts, None]
    taken: list[str] = []
    for interval, owner in enumerate(node.owners):
        low, high = edges[interval], edges[interval + 1]
        if owner != position:
            continue
        if low is None:
            taken.append(f"<= {number(high)}" if high is not None else "any")
        elif high is None:
            taken.append(f"> {number(low)}")
        else:
            taken.append(f"> {number(low)} to {number(high)}")
    return " or ".join(taken)


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
        unit = f", in {variable.unit}" if variable.unit else ""
        span = ""
        if variable.low is not None and variable.high is not None:
            span = f", {number(variable.low)} to {number(variable.high)}"
        yield f"{variable.name}{unit}{span}"
        if variable.parts:
            yield from _sum_lines(variable)
        rows = [(f"  {t.name}", shape_text(t.shape)) for t in variable.terms]
        yield from aligned(rows)


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
        >>> shape_text(Band(high=1.0, right=Flank(1.0, 3.0)))
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


def _flank_text(edge: float, flank: Flank | None, verb: str) -> str:
    if flank is None:
        return f"0 beyond {number(edge)}"
    return f"{verb} 0 at {number(flank.end)}"


def _side_text(side: Side) -> str:
    return f"{number(side.spread)} (0 from {number(side.reach)} spreads)"


# --- checks


def agreement_lines(found: Agreement, *, is_full: bool = False) -> Iterator[str]:
    """Yield a check as a table, with the worst rows of what disagrees.

    Args:
        found: The check.
        is_full: Whether to tell also each way of calling that did not fail, and rows
            that differ as they may.
    """
    yield _basis_text(found)
    calm = [c for c in found.comparisons if c.basis == "calls" and not c.differing]
    shown = [c for c in found.comparisons if is_full or c not in calm]
    yield from aligned([_COMPARISON, *map(_comparison_row, shown)])
    if calm and not is_full:
        yield (
            f"{counted(len(calm), 'carrier')} called without rows, row by row, in "
            "another memory order and with a wrong width: none fails"
        )
    for comparison in shown:
        is_wrong = comparison.verdict in ("DISAGREES", "rows only")
        if comparison.detail and (is_full or is_wrong):
            yield f"{comparison.carrier} against {comparison.against}:"
            yield from (f"  {line}" for line in comparison.detail)
    for count in found.counts:
        yield (
            f"{count.carrier}: of {counted(count.rows, 'row')} {count.ties} tied, "
            f"{count.uncovered} uncovered, {count.missing} with missing values"
        )
    if found.coverage is not None:
        yield from found.coverage.sentences
    yield from (f"not examined: {text}" for text in found.skipped)
    if found.certificates:
        yield from aligned([_CERTIFIED, *map(_certified_row, found.certificates)])
    for one in found.certificates:
        if one.verdict == "DISAGREES":
            yield f"{one.carrier} against exact arithmetic:"
            yield from (f"  {line}" for line in one.detail)


_COMPARISON = (
    "carrier",
    "against",
    "on",
    "rows",
    "largest difference",
    "allowed",
    "verdict",
)


def verdict_text(found: Agreement) -> str:
    """Return how many comparisons of a check disagree, and how many bounds fail."""
    wrong = sum(one.verdict == "DISAGREES" for one in found.comparisons)
    broken = sum(one.verdict == "DISAGREES" for one in found.certificates)
    count = counted(len(found.comparisons), "comparison")
    said = f"{count}, and none disagrees"
    if wrong:
        said = f"{wrong} of {count} {'disagrees' if wrong == 1 else 'disagree'}"
    rows_only = sum(one.verdict == "rows only" for one in found.comparisons)
    if rows_only:
        said += f"; in {counted(rows_only, 'file')} only the rows agree"
        said += "" if found.rows_only else ", which --rows-only accepts"
    if broken:
        verb = "does" if broken == 1 else "do"
        said += f"; {counted(broken, 'bound')} {verb} not hold"
    return said


def _basis_text(found: Agreement) -> str:
    rows = max((c.rows for c in found.counts), default=found.probes)
    data = rows - found.probes
    text = f"{found.model}: {counted(found.probes, 'probe')}"
    text += f", {counted(data, 'row')} of data" if data else ""
    return text + (f", {counted(found.cells, 'cell')}" if found.cells else "")


def _comparison_row(one: Comparison) -> tuple[str, ...]:
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
        one.carrier,
        one.against,
        one.basis,
        str(one.rows),
        f"{one.largest_difference:.2g}",
        f"{one.allowed:.2g}",
        verdict,
    )


_CERTIFIED = (
    "against exact arithmetic",
    "largest error",
    "inside the band",
    "flips",
    "verdict",
    "certified",
)


def _certified_row(one: Certified) -> tuple[str, ...]:
    flips = str(one.flips)
    if one.largest_flip_margin is not None:
        flips += f" (margin up to {one.largest_flip_margin:.2g})"
    if one.cover_lost or one.cover_gained:
        flips += f", cover lost in {one.cover_lost}, gained in {one.cover_gained}"
    noun = "row" if one.on == "data" else "probe"
    return (
        one.carrier,
        "-" if one.largest is None else f"{one.largest:.2g}",
        f"{one.in_band} of {counted(one.rows, noun)}",
        flips,
        one.verdict,
        one.sentence,
    )


# --- formats and runtimes


def format_lines(formats: Sequence[Format], missing: set[str]) -> Iterator[str]:
    """Yield the table of formats.

    Args:
        formats: All of them.
        missing: The extras that are not installed.
    """
    rows = [("format", "suffix", "reads", "writes", "extra")]
    for one in formats:
        carried = ", ".join(one.carries)
        reads = carried if one.read else "-"
        suffixes = " ".join(one.suffixes)
        rows.append((one.name, suffixes, reads, carried, _extra(one.extra, missing)))
    yield from aligned(rows)
    yield "cannot:"
    yield from _limits((one.name, one.cannot) for one in formats)


def runtime_lines(runtimes: Sequence[Runtime], missing: set[str]) -> Iterator[str]:
    """Yield the table of runtimes; arguments as `format_lines`."""
    rows = [("runtime", "runs", "numbers", "agreement", "extra")]
    for one in runtimes:
        promise = "equal bits" if one.bound is None else "within a derived bound"
        runs = ", ".join(one.runs)
        rows.append((one.name, runs, one.dtype, promise, _extra(one.extra, missing)))
    yield from aligned(rows)
    yield "cannot:"
    yield from _limits((one.name, one.cannot) for one in runtimes)


def format_facts(one: Format, missing: set[str]) -> dict[str, object]:
    """Return a line of the table of formats for programs."""
    return {
        "name": one.name,
        "suffixes": one.suffixes,
        "reads": one.carries if one.read else (),
        "writes": one.carries,
        "cannot": one.cannot,
        "extra": one.extra,
        "is_installed": one.extra not in missing,
    }


def runtime_facts(one: Runtime, missing: set[str]) -> dict[str, object]:
    """Return a line of the table of runtimes for programs."""
    return {
        "name": one.name,
        "runs": one.runs,
        "dtype": one.dtype,
        "equal_bits": one.bound is None,
        "cannot": one.cannot,
        "extra": one.extra,
        "is_installed": one.extra not in missing,
    }


def _extra(extra: str | None, missing: set[str]) -> str:
    if extra is None:
        return "-"
    return f"{extra} (not installed)" if extra in missing else extra


def _limits(found: Iterable[tuple[str, tuple[str, ...]]]) -> Iterator[str]:
    for name, cannot in found:
        for text in cannot:
            yield f"  {name}: {text}"

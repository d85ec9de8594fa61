"""What a model needs and what leaving out the rest saves, as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.benchmarking.clock import times_faster
from fuzzytree.benchmarking.savings import Cost, File, Report, Size
from fuzzytree.checking.dependencies import Because, Graph, Needs
from fuzzytree.model.agreement import Agreement
from fuzzytree.report.text import agreement_lines, aligned, counted, duration
from fuzzytree.semantics.simplification import Removed

_MOST = 12  # things told one by one; --json tells all


def report_lines(found: Report) -> Iterator[str]:
    """Yield what a model needs, what was left out, the proof, and what it saves."""
    yield from _head(found.needs)
    yield ""
    yield from _removed_lines("left out", found.removed)
    more = [one for one in found.needs.idle if one not in found.removed]
    if more:
        yield from _removed_lines("left in, and could go on request", more)
    yield ""
    yield from _proof_lines(found.proof)
    if found.needs.graphs:
        yield ""
        yield from _graph_lines(found.needs.graphs)
    yield ""
    yield from aligned(_size_rows(found.sizes))
    if found.costs:
        yield ""
        yield from aligned(_cost_rows(found.costs))
        yield "median of one call in one thread; in brackets the 95 % interval"
    for text in dict.fromkeys([*found.needs.omissions, *found.omissions]):
        yield f"not told: {text}"


def _head(needs: Needs) -> Iterator[str]:
    ends = ("leaf", "leaves") if needs.carrier == "tree" else ("rule", "rules")
    what = "fuzzy tree" if needs.carrier == "tree" else "rule base"
    sizes = [counted(needs.rules, *ends), counted(needs.terms, "term")]
    sizes += [counted(needs.sets, "fitted set")] if needs.sets else []
    yield f"{needs.model}: {what}, {', '.join(sizes)}"
    of = f" of {needs.columns} columns" if needs.columns else ""
    names = ", ".join(needs.inputs) or "none"
    yield f"needs    {len(needs.inputs)}{of}: {names}"
    if needs.combinations:
        yield f"asks     {', '.join(needs.combinations)}"
    if needs.idle_inputs:
        yield f"guards   {', '.join(needs.idle_inputs)} (nothing asks them)"


def _removed_lines(title: str, removed: Sequence[Removed]) -> Iterator[str]:
    if not removed:
        yield f"{title}: nothing"
        return
    rows = [(title, "why", "changes")]
    rows += [(one.where, one.why, one.changes or "nothing") for one in removed[:_MOST]]
    yield from aligned(rows)
    if len(removed) > _MOST:
        yield f"and {len(removed) - _MOST} more"


def _proof_lines(proof: Agreement) -> Iterator[str]:
    rows = [c.rows for c in proof.comparisons if c.basis == "rows"]
    data = max(rows, default=0) - proof.probes
    text = f"held against the model: {counted(proof.probes, 'probe')}"
    yield text + (f", {counted(data, 'row')} of data" if data > 0 else "")
    _, *lines = agreement_lines(proof)
    yield from lines


# --- graphs


def _graph_lines(graphs: Sequence[Graph]) -> Iterator[str]:
    rows: list[tuple[str, ...]] = [
        ("onnx graph", "numbers", "bytes", "nodes", "constants")
    ]
    for graph in graphs:
        inside = graph.contents
        sizes = (inside.bytes, inside.nodes, inside.constants)
        rows.append((graph.carrier, graph.dtype, *map(str, sizes)))
    yield from aligned(rows)
    for graph in graphs:
        if graph.because or graph.left_out:
            yield f"{graph.carrier}: {_operators(graph.contents.operators)}"
            yield from _because_lines(graph)


def _because_lines(graph: Graph) -> Iterator[str]:
    for one in graph.because:
        yield f"  for {one.what}: {_because_text(one)}"
    for one in graph.on_request:
        yield f"  {one.what} would add: {_because_text(one)}"
    if graph.left_out:
        yield f"  nothing for {', '.join(graph.left_out)}"


def _because_text(one: Because) -> str:
    nodes = counted(sum(one.operators.values()), "node")
    return f"{nodes} ({_operators(one.operators) or 'none'}), {one.bytes} bytes"


def _operators(operators: Mapping[str, int]) -> str:
    """Return operators with their counts, such as `Add 2, Mul`."""
    return ", ".join(
        name if count == 1 else f"{name} {count}" for name, count in operators.items()
    )


# --- savings


def _size_rows(sizes: Sequence[Size]) -> Iterator[tuple[str, ...]]:
    yield ("size", *(size.stage for size in sizes))
    yield ("columns read", *(str(size.inputs) for size in sizes))
    yield ("bytes of a row", *(str(size.row_bytes) for size in sizes))
    yield ("terms and sets", *(str(size.terms) for size in sizes))
    files = [{_file_title(file): file for file in size.files} for size in sizes]
    for name in dict.fromkeys(name for one in files for name in one):
        yield (name, *(_file_text(one.get(name)) for one in files))


def _file_title(file: File) -> str:
    return " ".join(filter(None, (file.carrier, file.format, file.dtype)))


def _file_text(file: File | None) -> str:
    if file is None:
        return "-"
    graph = "" if file.nodes is None else f" ({counted(file.nodes, 'node')})"
    return f"{file.bytes}{graph}"


def _cost_rows(costs: Sequence[Cost]) -> Iterator[tuple[str, ...]]:
    names = list(dict.fromkeys(cost.stage for cost in costs))
    yield ("run time", *names, f"{names[0]} / {names[-1]}")
    groups: dict[str, dict[str, Cost]] = {}
    for cost in costs:
        groups.setdefault(_cost_title(cost), {})[cost.stage] = cost
    for title, group in groups.items():
        cells = [
            duration(group[name].timing.median_ns) if name in group else "-"
            for name in names
        ]
        yield (title, *cells, _ratio_text(group.get(names[0]), group.get(names[-1])))


def _cost_title(cost: Cost) -> str:
    if not cost.carrier:
        return cost.what
    return f"{cost.carrier}, {cost.runtime}, {cost.what}"


def _ratio_text(before: Cost | None, after: Cost | None) -> str:
    if before is None or after is None:
        return "-"
    ratio = times_faster(before.timing, after.timing)
    if ratio is None:
        return "-"
    return f"{ratio.median:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"

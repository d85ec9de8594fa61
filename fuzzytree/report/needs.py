"""What a model needs and what leaving out the rest saves, as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.benchmarking import Cost, File, Footprint, Size, times_faster
from fuzzytree.checking import Needs
from fuzzytree.model import ModelKind
from fuzzytree.report.text import (
    agreement_lines,
    aligned,
    counted,
    duration,
    first_lines,
    more_line,
)
from fuzzytree.semantics import Removed

_MOST = 6  # parts printed one by one, unless all are


def report_lines(footprint: Footprint, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield which inputs a model needs, what can be left out, the proof, the sizes.

    Args:
        footprint: The report.
        is_verbose: Whether to print each comparison and file.
    """
    needs = footprint.needs
    most = None if is_verbose else _MOST
    yield _verdict(footprint)
    yield from _head(needs)
    yield from _removed_lines("left out", footprint.removed, most)
    more = [one for one in needs.idle if one not in footprint.removed]
    if more:
        yield from _removed_lines("left in, and could go on request", more, most)
    yield from agreement_lines(footprint.proof, is_verbose=is_verbose)
    yield ""
    rows = [*_size_rows(footprint.sizes)]
    yield from aligned(rows if is_verbose else rows[:_SIZES])
    if footprint.costs:
        yield ""
        yield from aligned(_cost_rows(footprint.costs))
        yield "median of one call in one thread; in brackets the 95 % interval"
    lines = [f"not reported: {text}" for text in footprint.omissions]
    yield from first_lines(lines, most, "omission")


_SIZES = 5  # rows of the table of sizes: head, columns, bytes, terms, the first file


def _verdict(footprint: Footprint) -> str:
    """Return how many inputs are needed, and what can be left out."""
    needs = footprint.needs
    of = f" of {needs.columns} columns" if needs.columns else " inputs"
    count = len(footprint.removed)
    wrong = sum(c.verdict == "DISAGREES" for c in footprint.proof.comparisons)
    agrees = "" if not wrong else f"; the pruned model differs in {wrong} comparisons"
    can = f"{counted(count, 'part')} can be left out" if count else "already minimal"
    return f"{needs.model}: needs {len(needs.inputs)}{of}; {can}{agrees}"


_KINDS: Mapping[ModelKind, tuple[str, str, str]] = {
    "tree": ("fuzzy tree", "leaf", "leaves"),
    "rules": ("rule base", "rule", "rules"),
    "system": ("fuzzy system", "rule", "rules"),
}
"""What a kind of model is called, and what of it is counted: one, and several."""


def _head(needs: Needs) -> Iterator[str]:
    what, *ends = _KINDS[needs.representation]
    sizes = [counted(needs.rules, *ends), counted(needs.terms, "term")]
    sizes += [counted(len(needs.outputs), "output")] if needs.outputs else []
    sizes += [counted(needs.sets, "fitted set")] if needs.sets else []
    yield f"model    {what}, {', '.join(sizes)}"
    yield f"needs    {', '.join(needs.inputs) or 'no input'}"
    if needs.combinations:
        yield f"tests    {', '.join(needs.combinations)}"
    if needs.idle_inputs:
        yield f"guards   {', '.join(needs.idle_inputs)} (no rule or node tests them)"


def _removed_lines(
    title: str, removed: Sequence[Removed], most: int | None
) -> Iterator[str]:
    if not removed:
        return
    rows = [(title, "why", "changes")]
    rows += [(one.where, one.why, one.changes or "nothing") for one in removed[:most]]
    yield from aligned(rows)
    yield from more_line(len(removed) - len(rows) + 1, "part")


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
    return " ".join(filter(None, (file.representation, file.format, file.dtype)))


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
    if not cost.representation:
        return cost.what
    return f"{cost.representation}, {cost.runtime}, {cost.what}"


def _ratio_text(before: Cost | None, after: Cost | None) -> str:
    if before is None or after is None:
        return "-"
    ratio = times_faster(before.timing, after.timing)
    if ratio is None:
        return "-"
    return f"{ratio.median:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"

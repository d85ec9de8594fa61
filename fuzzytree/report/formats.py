"""Formats as plain text and Markdown: what each can carry, its limits, its options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.checking.abilities import MEANINGS, Ability
from fuzzytree.model.contracts import Format
from fuzzytree.model.options import OptionFacts
from fuzzytree.report.text import aligned

Found = Mapping[str, tuple[Ability, ...] | str]
"""The abilities of each format, or why there are none."""

_LONGEST = 120  # characters of a reason

SIGNS = {
    "equal": "=",
    "alike": "~",
    "written": "w",
    "points": "p",
    "lossy": "L",
    "refused": "x",
    "no": "-",
}
"""What stands for each outcome in the table."""


def ability_lines(found: Found) -> Iterator[str]:
    """Yield the table of what each format can carry: a line for each kind of model."""
    rows = [*_rows(found)]
    if rows:
        yield from aligned(rows)
        yield ""
    yield from aligned((f"  {SIGNS[one]}", text) for one, text in MEANINGS.items())
    for name, reason in found.items():
        if isinstance(reason, str):
            yield f"  {name}: {reason}"


def ability_table(found: Found, *, legend: bool = True) -> str:
    """Return the same table as Markdown.

    Args:
        found: The abilities of each format.
        legend: Whether the meanings of the signs stand below.
    """
    head, *rows = _rows(found)
    lines = [head, ["---", *[":-:"] * (len(head) - 1)], *rows]
    table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    if not legend:
        return table
    signs = "".join(f"- `{SIGNS[one]}` {text}\n" for one, text in MEANINGS.items())
    return f"{table}\n{signs}"


def _rows(found: Found) -> Iterator[Sequence[str]]:
    known = {name: one for name, one in found.items() if not isinstance(one, str)}
    if not known:
        return
    yield ["", *known]
    for line in zip(*known.values(), strict=True):
        yield [line[0].sample, *(SIGNS[one.outcome] for one in line)]


def detail_lines(
    form: Format,
    found: tuple[Ability, ...] | str,
    options: Sequence[OptionFacts],
    dialects: Found,
) -> Iterator[str]:
    """Yield everything that is known of one format.

    Args:
        form: The format.
        found: What it can carry, or why that is not known.
        options: The options of its writer.
        dialects: What it can carry in each of its dialects, if it has several.
    """
    reads = "read and written" if form.read else "written"
    computes = f", computes in {form.dtype}" if form.dtype else ""
    yield f"{form.name}: {' '.join(form.suffixes)}, {reads}{computes}"
    yield f"carries  {', '.join(form.carries)}"
    yield from (f"cannot   {text}" for text in form.cannot)
    if options:
        yield ""
        yield "options, as --set NAME=VALUE:"
        yield from aligned(
            (f"  {one.name}", _default(one), one.help or "") for one in options
        )
    yield ""
    if isinstance(found, str):
        yield found
        return
    rows = [(f"  {one.sample}", *_told(one)) for one in found]
    yield from aligned(rows)
    if dialects:
        yield ""
        yield from ability_lines(dialects)


def _default(one: OptionFacts) -> str:
    default = one.default
    if isinstance(default, tuple | list):
        shown = ",".join(map(str, default))
    elif isinstance(default, bool):
        shown = "yes" if default else "no"
    else:
        shown = "none" if default is None else str(default)
    others = [choice for choice in one.choices if choice != shown]
    return f"{shown} (or {', '.join(others)})" if others else shown


def _told(one: Ability) -> tuple[str, str]:
    reason = " ".join(one.reasons[0].split())[:_LONGEST] if one.reasons else ""
    if len(one.reasons) > 1:
        reason += f" (and {len(one.reasons) - 1} more)"
    bound = "" if one.bound is None else f"within {one.bound:.1g}: "
    return one.outcome, f"{bound}{reason}"

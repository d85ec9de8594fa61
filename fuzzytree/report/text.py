"""Results as plain text: a tree with its branches, rules as sentences, tables."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from fuzzytree.model import Agreement, Certified, Comparison, number_text, printable
from fuzzytree.model import counted as counted

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


def first_lines(
    lines: Sequence[str], most: int | None, noun: str, nouns: str | None = None
) -> Iterator[str]:
    """Yield some lines, all if `most` is None, and how many more things there are."""
    yield from lines[:most]
    if most is not None:
        yield from more_line(len(lines) - most, noun, nouns)


def more_line(count: int, noun: str, nouns: str | None = None) -> Iterator[str]:
    """Yield how many more things there are than are shown, if any.

    Example:
        >>> [*more_line(2, "change")]
        ['and 2 more changes; --verbose lists all']
    """
    if count > 0:
        more = counted(count, f"more {noun}", f"more {nouns or noun + 's'}")
        yield f"and {more}; --verbose lists all"


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


# --- checks


def agreement_lines(agreement: Agreement, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a check: its verdict, counts of what agrees, and all that does not.

    Args:
        agreement: The check.
        is_verbose: Whether each comparison has a line, and not only a count, and the
            rows that differ by an allowed amount are printed, too.
    """
    verdict, basis = agreement_verdict(agreement), _basis_text(agreement)
    yield f"{agreement.model}: {verdict} ({basis})"
    comparisons = agreement.comparisons
    wrong = [c for c in comparisons if c.verdict in ("DISAGREES", "rows only")]
    if is_verbose:
        shown: Sequence[Comparison] = agreement.comparisons
        yield from aligned([COMPARISON, *map(comparison_row, shown)])
    else:
        yield from aligned([_GROUP, *_groups(agreement.comparisons)])
        shown = wrong[:_MOST_WRONG]
        if shown:
            yield from aligned([COMPARISON, *map(comparison_row, shown)])
        yield from more_line(len(wrong) - len(shown), "comparison")
    if any(one.verdict == "differs by design" for one in comparisons):
        yield "by design, raw rules (the paper's) differ; relative rules equal the tree"
    for comparison in shown:
        if comparison.detail and (is_verbose or comparison in wrong):
            yield f"{comparison.representation} compared with {comparison.against}:"
            yield from (f"  {line}" for line in comparison.detail)
    for file in agreement.files:
        yield f"{file.file} holds: {file.form}, {file.dtype}"
    for count in agreement.counts:
        yield (
            f"{count.representation}: {counted(count.rows, 'row')}, {count.ties} tied, "
            f"{count.uncovered} with no rule fired, "
            f"{count.missing} with a missing input"
        )
    if agreement.coverage is not None:
        yield from agreement.coverage.sentences
    skipped = [f"not examined: {text}" for text in agreement.skipped]
    most = None if is_verbose else _MOST_SKIPPED
    yield from first_lines(skipped, most, "item not examined", "items not examined")
    yield from _bound_lines(agreement.certificates, is_verbose=is_verbose)


def _groups(comparisons: Sequence[Comparison]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each representation: how many were compared with it."""
    groups: dict[str, list[Comparison]] = {}
    for one in comparisons:
        title = one.against.rpartition(": ")[2]
        name = "itself, in other calls" if one.basis == "calls" else title
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
    missed = {one.file for one in agreement.unchecked}
    if missed:
        faulty = {one.representation for one in agreement.wrong}
        files = {one.file for one in agreement.files}
        good = len(files - missed - faulty)
        said += f"; {good} of {counted(len(files), 'file')} "
        said += "agrees" if good == 1 else "agree"
        said += f"; {len(missed)} not checked: {', '.join(sorted(missed))}"
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
    text = counted(agreement.probes, "generated row")
    text += f", {counted(data, 'row')} of data" if data else ""
    cells = counted(agreement.cells or 0, "region") + " between cuts"
    return text + (f", {cells}" if agreement.cells else "")


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
    "uncertain",
    "changed",
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
    noun = "row" if one.on == "data" else "generated row"
    return (
        one.representation,
        "-" if one.largest is None else f"{one.largest:.2g}",
        f"{one.in_band} of {counted(one.rows, noun)}",
        flips,
        one.verdict,
        one.sentence,
    )

"""How numbers, lists, tables and paragraphs are written on the page."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from paper.judging import Line
from paper.records import Times

WIDTH = 92


def three(value: float) -> str:
    """Return a number of three significant digits at most, as people read it.

    Example:
        >>> [three(value) for value in (0.08125, 2.0, 56.789, 6220.58)]
        ['0.0813', '2', '56.8', '6,220']
    """
    rounded = float(f"{value:.3g}")
    if abs(rounded) >= 1000 or rounded.is_integer():
        return f"{rounded:,.0f}"
    return f"{rounded:.12f}".rstrip("0").rstrip(".")


def spanned(values: Iterable[float]) -> str:
    """Return the smallest and the largest of numbers, in two digits."""
    low, high = two(min(known := list(values))), two(max(known))
    return low if low == high else f"{low} to {high}"


def two(value: float) -> str:
    """Return a number of two significant digits at most.

    Example:
        >>> [two(value) for value in (0.08125, 2.0, 56.789, 6220.58)]
        ['0.081', '2', '57', '6,200']
    """
    return three(float(f"{value:.2g}"))


def middle(times: Times | None) -> str:
    """Return a median quotient, or a dash where nothing was measured."""
    return "-" if times is None else three(times.median)


def duration(value: float) -> str:
    """Return nanoseconds as people read them."""
    return f"{three(value / 1e3)} µs" if value >= 1e3 else f"{three(value)} ns"


def percent(count: int, total: int) -> str:
    """Return a share in per cent, without the sign."""
    return f"{100 * count / total:.1f}"


def p_value(value: float) -> str:
    """Return a p-value; what is far below any level is not parts to its digits."""
    if value < 1e-4:
        return "< 0.0001"
    return f"{value:.2g}" if value < 0.1 else f"{value:.2f}"


def listed(texts: Iterable[str]) -> str:
    """Return texts as a list within a sentence."""
    *others, last = texts
    return f"{', '.join(others)} and {last}" if others else last


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines_of = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines_of)


def paragraph(sentences: str) -> str:
    """Return sentences in lines of the page's width."""
    return textwrap.fill(
        sentences, WIDTH, break_long_words=False, break_on_hyphens=False
    )


def bullet(sentences: str) -> str:
    """Return sentences as an entry of a list."""
    return textwrap.fill(
        sentences,
        WIDTH,
        initial_indent="- ",
        subsequent_indent="  ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def half_text(line: Line | None) -> str:
    """Return up to how many rules overhead is more than half of the time."""
    half = line.half if line else None
    if half is None:
        return "-"
    return three(half) if half >= 1.0 else "none"


def short_name(line: Line) -> str:
    """Return the name of a runtime without its number type."""
    return line.runtime.removesuffix(" float64")


def place(line: Line) -> str:
    """Return where and how rules were fired."""
    return f"{short_name(line)} {'in batches' if line.is_batch else 'row by row'}"

"""Two tree ensembles compared, as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.model import TreeAgreement, TreeAnswer
from fuzzytree.report.text import aligned

_MOST_VALUES = 8  # of a row, unless all are printed
_ROWS = ("float32", "float64")


def tree_lines(agreement: TreeAgreement, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a verdict, a table of the answers, and each that is not a proof in words.

    Args:
        agreement: The comparison.
        is_verbose: Whether rows are printed whole, and proofs in words, too.
    """
    wrong = len(agreement.wrong)
    verdict = (
        f"{wrong} of {len(agreement.answers)} answers differ"
        if wrong
        else "no answer differs"
    )
    yield f"{agreement.first} and {agreement.second}: {verdict}"
    both = zip(
        (agreement.first, agreement.second),
        agreement.kinds,
        agreement.leaves,
        agreement.programs,
        strict=True,
    )
    yield from aligned(
        [(name, kind, f"{leaves:,} leaves", ran) for name, kind, leaves, ran in both]
    )
    table: dict[str, dict[str, TreeAnswer]] = {}
    for each in agreement.answers:
        table.setdefault(each.question, {})[each.rows] = each
    head = ("question", *(f"{rows} rows" for rows in _ROWS))
    cells = [
        (question, *(row[rows].verdict for rows in _ROWS))
        for question, row in table.items()
    ]
    yield from aligned([head, *cells])
    for question, row in table.items():
        answers = [row[rows] for rows in _ROWS]
        yield from _in_words(question, answers, agreement.columns, is_verbose)
    yield from agreement.remarks


def _in_words(
    question: str,
    answers: Sequence[TreeAnswer],
    columns: Sequence[str],
    is_verbose: bool,
) -> Iterator[str]:
    """Yield the answers to a question; once, if both number types have the same."""
    shown: list[str] = []
    for each in answers:
        if each.sentence in shown:
            continue
        shown.append(each.sentence)
        alone = any(other.sentence != each.sentence for other in answers)
        rows = f", {each.rows} rows" if alone else ""
        yield f"{question}{rows}: {each.sentence}"
        if each.row is not None and each.question != "programs":
            yield f"  where {_row_text(each.row, columns, is_verbose)}"
            yield from (f"  {answer}" for answer in each.answers)


def _row_text(
    row: Sequence[float | None], columns: Sequence[str], is_verbose: bool
) -> str:
    """Return a row in words: what is missing first, and what is not 0."""
    names = columns or [f"x{number}" for number in range(1, len(row) + 1)]
    cells = [
        f"{name} is missing" if value is None else f"{name} = {value!r}"
        for name, value in sorted(
            zip(names, row, strict=False), key=lambda cell: cell[1] is not None
        )
        if value != 0.0
    ]
    if not cells:
        return "all columns are 0"
    shown = cells if is_verbose else cells[:_MOST_VALUES]
    more = len(cells) - len(shown)
    rest = f"{more} more are not 0" if more else "all others are 0"
    is_all = len(cells) == len(row) and not more
    return ", ".join(shown if is_all else [*shown, rest])

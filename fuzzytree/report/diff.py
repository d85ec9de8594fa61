"""What changed between two models, as plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Final

from fuzzytree.auditing import (
    Answer,
    Bracket,
    Change,
    ComparedModel,
    Coordinate,
    Difference,
    FileLocation,
    Witness,
)
from fuzzytree.model import printable
from fuzzytree.report.audit_states import state_text, state_word
from fuzzytree.report.svg_terms import span_text
from fuzzytree.report.text import counted

WIDTH: Final = 100

_MOST_ANSWERS = 6  # answers about decisions, unless all are printed
_MOST_CHANGES = 6
_MOST_INPUTS = 12  # of a point or a region
_INDENT = " " * 11


def diff_lines(found: Difference, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a difference: its verdict, the decisions, and what has changed.

    Args:
        found: The difference.
        is_verbose: Whether to print every change, and the point of every witness.
    """
    yield diff_verdict(found)
    yield _model_text("old", found.old)
    yield _model_text("new", found.new)
    if found.data is not None:
        yield f"rows     {found.rows} of {found.data.name}"
    if is_verbose:
        shown = [
            f"{s.variable} {s.low:.6g} to {s.high:.6g}" for s in found.domain.sides
        ]
        yield from _lines("domain  ", ", ".join(shown) or "no inputs", indent=" " * 9)
    yield "decisions"
    answers = sorted(found.answers, key=lambda one: isinstance(one.state, Witness))
    most = len(answers) if is_verbose else _MOST_ANSWERS
    points = 0  # of witnesses that are printed
    for answer in answers[:most]:
        points += isinstance(answer.state, Witness)
        yield from _answer_lines(answer, has_point=is_verbose or points <= 1)
    yield from _more(len(answers) - most, "answer")
    if found.changes:
        yield "changes"
    most = len(found.changes) if is_verbose else _MOST_CHANGES
    for change in found.changes[:most]:
        yield from _change_lines(change, has_place=is_verbose)
    yield from _more(len(found.changes) - most, "change")


def _more(count: int, noun: str) -> Iterator[str]:
    if count > 0:
        yield f"  and {counted(count, f'more {noun}')}; --verbose lists all"


def diff_verdict(found: Difference) -> str:
    """Return what a difference comes to, in a sentence.

    What is not proved is said not to be.
    """
    counts = _counts_text(found.changes)
    match found.verdict:
        case "changed":
            what = "outputs" if found.old.form == "system" else "decisions"
            return f"{what} have changed; {counts}"
        case "equal" if not found.changes:
            return "decisions are proved equal, and nothing else has changed"
        case "equal":
            return f"decisions are proved equal; {counts}"
        case "open":
            return (
                "no row was found that is classified differently, and it is NOT proved "
                f"that there is none; {counts}"
            )


def _counts_text(changes: Sequence[Change]) -> str:
    grades = [change.grade for change in changes]
    counts = [
        f"{grades.count(grade)} {grade}"
        for grade in ("breaking", "non-breaking", "cosmetic")
        if grade in grades
    ]
    if not counts:
        return "nothing else has changed"
    return f"{counted(len(grades), 'change')}: {', '.join(counts)}"


def _model_text(title: str, model: ComparedModel) -> str:
    of = f"{model.file.name}: " if model.file else ""
    return printable(f"{title:8} {of}{model.form} {model.name!r}")


def _answer_lines(answer: Answer, *, has_point: bool) -> Iterator[str]:
    word = state_word(answer.state)
    yield from _lines(f"  {word:8}", answer.sentence)
    if not has_point:
        return
    match answer.state:
        case Witness(point=point):
            yield from _lines(f"{_INDENT}at", _point_text(point), indent=_INDENT)
        case Bracket():
            yield from _lines(_INDENT[:-1], state_text(answer.state))
        case state:
            yield from _lines(_INDENT[:-1], state_text(state))
    if answer.region:
        shown = [f"{s.variable} {span_text(s)}" for s in answer.region[:_MOST_INPUTS]]
        more = len(answer.region) - len(shown)
        shown += [f"{more} more"] if more > 0 else []
        text = f"everywhere in the box of {'; '.join(shown)}"
        yield from _lines(_INDENT[:-1], text)


def _point_text(point: Sequence[Coordinate]) -> str:
    shown = [
        f"{one.input} = {one.decimal if one.hex else one.exact}"
        for one in point[:_MOST_INPUTS]
    ]
    more = len(point) - len(shown)
    shown += [f"{more} more"] if more > 0 else []
    return ", ".join(shown) or "any row"


def _change_lines(change: Change, *, has_place: bool) -> Iterator[str]:
    places = " -> ".join(map(_place_text, filter(None, (change.old, change.new))))
    doubt = "" if change.is_proved else " (not proved)"
    text = f"{change.sentence}{doubt}"
    yield from _lines(f"  {change.grade:12}", text, indent=" " * 15)
    if places and has_place:
        yield printable(f"{' ' * 15}{places}")


def _place_text(place: FileLocation) -> str:
    return f"{place.file}:{place.line}:{place.column}"


def _lines(lead: str, text: str, *, indent: str = _INDENT) -> Iterator[str]:
    yield from textwrap.wrap(
        printable(text),
        WIDTH,
        initial_indent=f"{lead} ",
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    )

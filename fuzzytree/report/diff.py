"""What changed between two models, as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.auditing import (
    AuditAnswer,
    Change,
    ComparedModel,
    Difference,
    Witness,
)
from fuzzytree.model import printable
from fuzzytree.report.audit import WIDTH, region_text
from fuzzytree.report.audit_states import state_text, state_word
from fuzzytree.report.text import counted, more_line, some, wrapped

_MOST_ANSWERS = 6  # answers about decisions, unless all are printed
_MOST_CHANGES = 6
_MOST_INPUTS = 12  # of a point or a region
_INDENT = " " * 11


def diff_lines(difference: Difference, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a difference: its verdict, the decisions, and what has changed.

    Args:
        difference: The difference.
        is_verbose: Whether to print every change, and the point of every witness.
    """
    yield diff_verdict(difference)
    yield _model_text("old", difference.old)
    yield _model_text("new", difference.new)
    if difference.data is not None:
        yield f"rows     {difference.rows} of {difference.data.name}"
    if is_verbose:
        shown = [
            f"{s.variable} {s.word or f'{s.low:.6g} to {s.high:.6g}'}"
            for s in difference.domain.sides
        ]
        domain = ", ".join(shown) or "no inputs"
        yield from wrapped(domain, WIDTH, "domain   ", " " * 9)
    yield "decisions"
    answers = sorted(difference.answers, key=lambda one: isinstance(one.state, Witness))
    most = len(answers) if is_verbose else _MOST_ANSWERS
    points = 0  # of witnesses that are printed
    for answer in answers[:most]:
        points += isinstance(answer.state, Witness)
        yield from _answer_lines(answer, has_point=is_verbose or points <= 1)
    yield from more_line(len(answers) - most, "answer")
    if difference.changes:
        yield "changes"
    most = len(difference.changes) if is_verbose else _MOST_CHANGES
    for change in difference.changes[:most]:
        yield from _change_lines(change, has_place=is_verbose)
    yield from more_line(len(difference.changes) - most, "change")


def diff_verdict(difference: Difference) -> str:
    """Return what a difference comes to, in a sentence.

    What is not proved is said not to be.
    """
    counts = _counts_text(difference.changes)
    is_proved = any(state_word(one.state) == "PROVED" for one in difference.answers)
    equal = "decisions are proved equal" if is_proved else "decisions are equal"
    match difference.verdict:
        case "changed":
            what = "outputs" if difference.old.form == "system" else "decisions"
            return f"{what} have changed; {counts}"
        case "equal" if not difference.changes:
            return f"{equal}, and nothing else has changed"
        case "equal":
            return f"{equal}; {counts}"
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


def _answer_lines(answer: AuditAnswer, *, has_point: bool) -> Iterator[str]:
    word = state_word(answer.state)
    yield from wrapped(answer.sentence, WIDTH, f"  {word:8} ", _INDENT)
    if not has_point:
        return
    match answer.state:
        case Witness(point=point):
            values = (
                f"{c.input} = {c.word or (c.decimal if c.hex else c.exact)}"
                for c in point
            )
            shown = some(values, _MOST_INPUTS) or "any row"
            yield from wrapped(shown, WIDTH, f"{_INDENT}at ", _INDENT)
        case state:
            yield from wrapped(state_text(state), WIDTH, _INDENT, _INDENT)
    if answer.region:
        text = f"everywhere in the box of {region_text(answer.region)}"
        yield from wrapped(text, WIDTH, _INDENT, _INDENT)


def _change_lines(change: Change, *, has_place: bool) -> Iterator[str]:
    places = " -> ".join(map(str, filter(None, (change.old, change.new))))
    doubt = "" if change.is_proved else " (not proved)"
    text = f"{change.sentence}{doubt}"
    yield from wrapped(text, WIDTH, f"  {change.grade:12} ", " " * 15)
    if places and has_place:
        yield printable(f"{' ' * 15}{places}")

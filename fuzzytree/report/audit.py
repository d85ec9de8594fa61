"""An audit as plain text: findings at their places, a table by code, its limits."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

from fuzzytree.auditing import (
    CODES,
    Audit,
    AuditAnswer,
    Bracket,
    Code,
    Declined,
    FileLocation,
    Measure,
    Proved,
    Span,
    Witness,
)
from fuzzytree.model import printable
from fuzzytree.report.audit_states import (
    SEVERITIES,
    STATES,
    as_in_file,
    gravest_first,
    known_as,
    result_text,
    state_text,
    state_word,
)
from fuzzytree.report.svg_terms import span_text
from fuzzytree.report.text import aligned, counted, number, some, wrapped

WIDTH: Final = 100
MOST_FINDINGS: Final = 200
"""The most that are listed one by one."""

_MOST_SHORT = 8  # findings, unless all are printed
_MOST_EVIDENCE = 2  # of them that are printed with their evidence
_MOST_CALM = 40  # lines of answers that are no findings, unless all are wanted
_MOST_INPUTS = 12  # of a point or region on the terminal
_LONGEST_NAME = 60  # above the findings
_SHOWN = 84  # characters of a source line
_COLOURS: Mapping[str, str] = {
    "error": "31;1",
    "warning": "33;1",
    "info": "36",
    "PROVED": "32;1",
    "COMPUTED": "32",
    "WITNESS": "35;1",
    "BRACKET": "34;1",
    "SAMPLED": "36;1",
    "DECLINED": "2",
}
ORIGINS: Mapping[str, str] = {
    "model": "the model's range",
    "data": "the rows",
    "spreads": "spreads around the fitted sets",
    "curves": "the span of the curves",
    "unused": "any number: nothing depends on it",
    "limits": "--limits",
}
"""Where the ends of a variable's domain come from."""

_Paint = Callable[[str, str], str]
SUMMARY = ("code", "question", "count", "found", *map(str.lower, STATES))
"""Above the columns of `summary_rows`."""


def audit_lines(
    audit: Audit,
    source: Sequence[str] = (),
    *,
    gone: Collection[str] = (),
    is_coloured: bool = False,
    is_verbose: bool = True,
    is_whole: bool = False,
) -> Iterator[str]:
    """Yield an audit: its verdict, its findings, and how much was decided.

    Findings come gravest first. Of the other answers those that are open, BRACKET and
    DECLINED, are printed one by one, and the rest is counted.

    Args:
        audit: The audit.
        source: The lines of the model's file, for the line that a finding is about.
        gone: Accepted ids that are no longer found.
        is_coloured: Whether codes, severities and states have colours.
        is_verbose: Whether to print the evidence of each finding, the questions by
            code and the limits of the audit, and not only counts of them.
        is_whole: Whether every answer is printed one by one.
    """
    audit = as_in_file(audit)
    paint: _Paint = _painted if is_coloured else lambda text, _: text
    is_verbose |= is_whole
    yield from wrapped(audit_verdict(audit, gone), WIDTH, rest="  ")
    yield from _head(audit, is_verbose=is_verbose)
    findings = gravest_first(audit.open_findings)
    most = MOST_FINDINGS if is_verbose else _MOST_SHORT
    most = len(findings) if is_whole else most
    for place, answer in enumerate(findings[:most]):
        yield from _sentence(answer, audit, paint)
        if is_verbose:
            yield from _quoted(answer.places[:1], source)
            yield from _evidence(answer, paint)
            yield ""
        elif place < _MOST_EVIDENCE and answer.severity != "info":
            yield from _evidence(answer, paint, only=2)
    if rest := Counter(one.code for one in findings[most:]):
        said = ", ".join(f"{code} ({count})" for code, count in rest.items())
        count = counted(rest.total(), "more finding")
        option = "--all" if is_verbose else "--verbose"
        yield from wrapped(f"{count}: {said}; {option} lists all", WIDTH, rest="  ")
    if not is_verbose:
        yield from _brief("the row of --row", _of_row(audit.answers), paint)
        states = [f"{n} {word}" for word, n in known_as(audit.answers).items() if n]
        count = counted(len(audit.answers), "question")
        yield f"{count}: {', '.join(states) or 'none'}"
        aside = ("left out by the user", ": not asked")
        missed = sum(not any(one in text for one in aside) for text in audit.unasked)
        if missed:
            yield f"not examined, or not to the end: {counted(missed, 'code')}"
        yield (
            f"--verbose lists the evidence of each finding and the "
            f"{counted(len(audit.limits), 'limit')} of this audit"
        )
        return
    if audit.accepted:
        yield f"{counted(len(audit.accepted), 'accepted finding')} of the baseline"
        yield ""
    yield from _calm(audit, paint, is_whole=is_whole)
    yield from aligned([SUMMARY, *summary_rows(audit)])
    if audit.unasked:
        yield from ("", "not examined, or not to the end")
        yield from (line for text in gathered(audit.unasked) for line in _item(text))
    yield from ("", "this audit does not establish")
    yield from (line for text in audit.limits for line in _item(text))


def summary_rows(audit: Audit) -> Iterator[Sequence[str]]:
    """Yield how many questions each code has, and how each answer is known."""
    groups: dict[str, list[AuditAnswer]] = {}
    for answer in audit.answers:
        groups.setdefault(answer.code, []).append(answer)
    for code, answers in (*groups.items(), ("all", audit.answers)):
        title = CODES[code].title.removeprefix("declined: ") if code in CODES else ""
        findings = sum(answer.is_finding for answer in answers)
        counts = (len(answers), findings, *known_as(answers).values())
        yield code, title, *(str(count) if count else "-" for count in counts)


def audit_verdict(audit: Audit, gone: Collection[str] = ()) -> str:
    """Return what an audit found, in a sentence, and what one might do next."""
    findings = audit.open_findings
    said = [found_text(audit)]
    if not audit.is_complete:
        said.append(asked_text(audit))
    if gone:
        ids = counted(len(gone), "accepted finding")
        said.append(f"{ids} no longer found, which --write-baseline forgets")
    if audit.is_complete and not findings:
        said.append(asked_text(audit))
    said += proved_text(audit)
    if findings:
        gravest = gravest_first(findings)[0].code
        said.append(f"`fuzzytree explain {gravest}` explains the gravest")
    return "; ".join(said)


def found_text(audit: Audit) -> str:
    """Return how many findings of each severity an audit has that are not accepted."""
    findings = audit.open_findings
    severities = Counter(one.severity for one in findings)
    listed = ", ".join(
        counted(severities[one], noun)
        for one, noun in SEVERITIES.items()
        if severities[one]
    )
    said = f"{counted(len(findings), 'finding')}: {listed}"
    accepted = f" beside {len(audit.accepted)} accepted" if audit.accepted else ""
    return f"{said if findings else 'nothing found'}{accepted}"


def proved_text(audit: Audit) -> list[str]:
    """Return how many answers are PROVED and by what confirmed, if any are."""
    states = [one.state for one in audit.answers if isinstance(one.state, Proved)]
    names = sorted({one.confirmed.split(" ")[0] for one in states} - {""})
    many = sum(one.confirmed != "" for one in states)
    by = f" by {' and '.join(names)}" if names else ""
    for text in audit.unasked:
        if text.startswith("FT901 "):
            by += f" ({text.partition(': not asked: ')[2]})"
    return [f"{len(states)} PROVED, {many or 'none'} confirmed{by}"] if states else []


def asked_text(audit: Audit) -> str:
    """Return whether an audit is complete, and how much of it is open or declined."""
    if audit.was_interrupted:
        return "interrupted: what is proved is kept, the rest is not examined"
    if not audit.is_complete:
        return "incomplete: the budget is spent (--budget STEPS)"
    if not audit.answers:
        return "no question applies to this model"
    states = known_as(audit.answers)
    count = counted(len(audit.answers), "question")
    declined = [o.state.code for o in audit.answers if isinstance(o.state, Declined)]
    if len(declined) == len(audit.answers):
        return (
            f"{count}, all declined: nothing is known; "
            f"`fuzzytree explain {declined[0]}` explains why"
        )
    kinds = (("open", states["BRACKET"]), ("declined", states["DECLINED"]))
    others = [f"{n} {word}" for word, n in kinds if n]
    return f"{count}, {' and '.join(others)}" if others else f"{count} answered"


# --- parts


def _head(audit: Audit, *, is_verbose: bool) -> Iterator[str]:
    """Yield what was audited, and on which domain."""
    decides = "the strongest rule decides"
    if audit.policy.decision == "all":
        decides = "every rule takes part"
    means = f"AND is {audit.policy.conjunction}, {decides}"
    yield f"{_name(audit.model)}: audited as {audit.form}; {means}"
    if audit.data is not None and is_verbose:
        yield f"rows     {audit.rows} of {_name(audit.data.name)}"
    for result in audit.results:
        yield f"results  {_name(result.file.name)}: {result_text(result)}"
    if not is_verbose:
        return
    sides = audit.domain.sides
    rows = [
        (
            f"  {_name(one.variable)}",
            _name(one.word) or f"{number(one.low)} to {number(one.high)}",
            ORIGINS[one.origin],
        )
        for one in sides[:_MOST_INPUTS]
    ]
    yield "domain"
    yield from aligned(rows) if rows else ["  none: the model has no inputs"]
    if len(sides) > _MOST_INPUTS:
        yield f"  and {counted(len(sides) - _MOST_INPUTS, 'more variable')}"
    yield ""


def _name(text: str) -> str:
    """Return a name as it fits into a line."""
    shown = text if len(text) <= _LONGEST_NAME else f"{text[: _LONGEST_NAME - 1]}…"
    return printable(shown)


def _sentence(answer: AuditAnswer, audit: Audit, paint: _Paint) -> Iterator[str]:
    """Yield where a finding is, and what it says."""
    file = audit.file.name if audit.file else ""
    where = str(answer.places[0]) if answer.places else file
    name = f"{answer.code} {answer.severity}:"
    lead = f"{where}: {name}" if where else name
    first, *rest = wrapped(f"{lead} {answer.sentence}", WIDTH, rest="  ")
    yield first.replace(name, paint(name, answer.severity), 1)
    yield from rest


def _evidence(
    answer: AuditAnswer, paint: _Paint, *, only: int | None = None
) -> Iterator[str]:
    """Yield how a finding is known: all facts, or only the first few."""
    for title, text in [*_facts(answer)][:only]:
        begin, *rest = wrapped(text, WIDTH - 11) or [""]
        yield f"  {paint(f'{title:8}', title)} {begin}".rstrip()
        yield from (f"           {line}" for line in rest)


def _painted(text: str, key: str) -> str:
    code = _COLOURS.get(key)
    return text if code is None else f"\x1b[{code}m{text}\x1b[0m"


def _facts(answer: AuditAnswer) -> Iterator[tuple[str, str]]:
    """Yield how an answer is known, where, and how to find it again."""
    yield state_word(answer.state), state_text(answer.state)
    match answer.state:
        case Witness(point=point) | Bracket(point=point) if point:
            values = (
                f"{c.input} = {c.word or f'{c.decimal} ({c.hex or c.exact})'}"
                for c in point
            )
            yield "at", some(values, _MOST_INPUTS, "more inputs")
        case _:
            pass
    if answer.region:
        yield "region", region_text(answer.region)
    if answer.measures:
        yield "measured", "; ".join(map(_measure_text, answer.measures[:8]))
    others = [f"{one.line}:{one.column}" for one in answer.places[1:]]
    if others:
        yield "see also", ", ".join(others[:_MOST_INPUTS])
    if answer.id:
        yield "id", answer.id
    if answer.repeat:
        yield "again", answer.repeat


def region_text(region: Iterable[Span]) -> str:
    """Return the sides of a region in words, a dozen at most."""
    sides = (f"{side.variable} {span_text(side)}" for side in region)
    return some(sides, _MOST_INPUTS, joint="; ")


def _measure_text(measure: Measure) -> str:
    unit = f" {measure.unit}" if measure.unit else ""
    return f"{measure.name} {number(measure.value)}{unit}"


def _quoted(places: Sequence[FileLocation], source: Sequence[str]) -> Iterator[str]:
    """Yield the line of the file that a place is in, if any, and a caret below it."""
    place = places[0] if places else None
    if place is None or not 0 < place.line <= len(source):
        return
    line = source[place.line - 1].replace("\t", " ")
    begin = max(0, place.column - 1 - _SHOWN // 2) if len(line) > _SHOWN else 0
    shown = "".join(c if c.isprintable() else "?" for c in line[begin : begin + _SHOWN])
    margin = " " * len(str(place.line))
    yield f"  {margin} |"
    yield f"  {place.line} | {shown}".rstrip()
    yield f"  {margin} | {' ' * (place.column - 1 - begin)}^"


def _calm(audit: Audit, paint: _Paint, *, is_whole: bool) -> Iterator[str]:
    """Yield the answers that are no findings, a line each.

    Unless all are wanted, only those about the row that was given and those that are
    open: the others are counted.
    """
    answers = [one for one in audit.answers if not one.is_finding]
    if is_whole:
        yield from _brief("answers that are no findings", answers, paint)
        return
    of_row = _of_row(answers)
    rest = [one for one in answers if one not in of_row]
    unsure = [one for one in rest if isinstance(one.state, Bracket | Declined)]
    yield from _brief("the row that was given", of_row, paint)
    yield from _brief("open", unsure, paint, most=_MOST_CALM)
    if sure := len(rest) - len(unsure):
        verb = "is no finding" if sure == 1 else "are no findings"
        what = "more answer" if of_row or unsure else "answer"
        yield f"{counted(sure, what)} {verb}; --all lists each"
        yield ""


def _of_row(answers: Iterable[AuditAnswer]) -> list[AuditAnswer]:
    """Return the answers about the row that was given."""
    return [one for one in answers if (one.code, one.subject) == ("FT204", "row")]


def _brief(
    title: str, answers: Sequence[AuditAnswer], paint: _Paint, most: int | None = None
) -> Iterator[str]:
    """Yield answers by their sentences, below a title, and how many more there are."""
    if not answers:
        return
    yield title
    for answer in answers[:most]:
        word = state_word(answer.state)
        said = answer.sentence
        match answer.state:
            case Declined(reason=reason) if reason not in said:
                said += f" ({state_text(answer.state)})"
            case Declined(code=code) if code != answer.code:
                said += f" ({code})"
            case _:
                pass
        first, *rest = wrapped(said, WIDTH - 17) or [""]
        yield f"  {answer.code} {paint(f'{word:8}', word)} {first}".rstrip()
        yield from (f"{' ' * 17}{line}" for line in rest)
    if most is not None and len(answers) > most:
        yield f"  and {len(answers) - most} more; --all lists each"
    yield ""


def gathered(unasked: Sequence[str]) -> Iterator[str]:
    """Yield sentences, those of codes that have one reason as one.

    Example:
        >>> [*gathered(["FT101 dead rule: left out", "FT102 marginal rule: left out"])]
        ['FT101, FT102: left out']
    """
    alike: dict[str, list[str]] = {}
    for text in unasked:
        alike.setdefault(text.partition(": ")[2], []).append(text)
    for reason, texts in alike.items():
        codes = ", ".join(text.split()[0] for text in texts)
        yield f"{codes}: {reason}" if reason and len(texts) > 1 else texts[0]


def _item(text: str) -> Iterator[str]:
    yield from wrapped(text, WIDTH, "- ", "  ")


def explanation_lines(code: Code) -> Iterator[str]:
    """Yield what a code means, why it matters, a case, and what to do."""
    where = "" if code.decision == "any" else ", where the strongest rule decides"
    yield f"{code.code}  {code.title} ({code.severity}{where})"
    for title, text in (
        ("what", code.what),
        ("why", code.why),
        ("example", code.example),
        ("what to do", code.remedy),
    ):
        yield ""
        yield title
        for line in text.splitlines():
            yield from textwrap.wrap(
                line, WIDTH - 4, initial_indent="  ", subsequent_indent="  "
            ) or [""]


def code_lines(codes: Sequence[Code], *, is_whole: bool = True) -> Iterator[str]:
    """Yield codes with their severities and titles, after their number.

    Args:
        codes: The codes.
        is_whole: Whether to list the codes of declined questions, and not only count.
    """
    declined = [one for one in codes if one.code.startswith("FTD")]
    shown = codes if is_whole else [one for one in codes if one not in declined]
    yield f"{counted(len(codes), 'code')}; `fuzzytree explain CODE` explains one"
    rows = [("code", "severity", "finding")]
    yield from aligned([*rows, *((c.code, c.severity, c.title) for c in shown)])
    if len(shown) < len(codes):
        count = counted(len(declined), "code")
        yield f"FTD..  {count} for what was not decided: `fuzzytree explain FTD`"

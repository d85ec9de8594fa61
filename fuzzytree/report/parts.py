"""The macros of `templates/parts.html` as functions: each returns a part of a page."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence

from fuzzytree.auditing import CODES, Coordinate, Measure, State, Witness
from fuzzytree.report.audit import ORIGINS
from fuzzytree.report.audit_states import (
    SEVERITIES,
    STATES,
    claims_text,
    result_text,
    state_note,
    state_text,
    state_word,
)
from fuzzytree.report.markup import (
    Markup,
    macros,
    policy_of,
    source,
    template,
    text_lines,
)
from fuzzytree.report.pictures import class_mark
from fuzzytree.report.stability import (
    CRITERION,
    advice,
    criterion_row,
    stability_verdict,
)
from fuzzytree.report.text import (
    CERTIFIED,
    COMPARISON,
    agreement_verdict,
    certified_row,
    comparison_row,
    counted,
    number,
)

MOST_RULES = 1000
MOST_LINES = 400
"""Of a tree as an outline."""

_MOST_INPUTS = 60  # of a witness that are shown; beyond, only those that the JSON has
_MOST_LISTED = 200  # sentences
_SHORT = 16  # characters of a fraction that a reader may want to see


def part(name: str, *values: object, **options: object) -> Markup:
    """Return what a macro makes; a text among its values is escaped."""
    macro: Callable[..., Markup] = getattr(_macros(), name)
    return macro(*values, **options)


def whole_page(name: str = "page.html", **parts: object) -> str:
    """Return a page with its parts, and with the policy of what it may do."""
    text = source(name).replace("/* pictures */\n", source("pictures.css"))
    page = template(text).render(policy=_POLICY, **parts)
    return page.replace(_POLICY, policy_of(page), 1)  # the head has it, before any name


_POLICY = "@policy@"


def title_of(code: str) -> str:
    """Return the title of a finding's code."""
    return CODES[code].title if code in CODES else "a finding"


@functools.cache
def _macros() -> object:
    functions = (
        *(advice, agreement_verdict, as_row, claims_text, class_mark, coordinates),
        *(counted, how_known, measure_texts, number, result_text, stability_verdict),
        *(state_note, state_word, text_lines, title_of),
    )
    known: dict[str, object] = {one.__name__: one for one in functions}
    known |= {"number": number, "ORIGINS": ORIGINS}
    known |= {"CERTIFIED": CERTIFIED, "COMPARISON": COMPARISON, "CRITERION": CRITERION}
    known |= {"MOST_INPUTS": _MOST_INPUTS, "MOST_LISTED": _MOST_LISTED}
    known |= {"MOST_LINES": MOST_LINES, "MOST_RULES": MOST_RULES}
    known |= {"SEVERITIES": SEVERITIES, "STATES": STATES}
    rows = comparison_row, certified_row, criterion_row
    return macros("parts.html", known, {one.__name__: one for one in rows})


def how_known(state: State) -> str | None:
    """Return how an answer is known; a witness is its own evidence."""
    is_witness = isinstance(state, Witness)
    return None if is_witness else state_text(state, has_title=True)


def coordinates(point: Sequence[Coordinate]) -> Iterator[tuple[str, str, str]]:
    """Yield the values of a point with all digits."""
    return ((one.input, one.word or one.decimal, one.hex or one.exact) for one in point)


def as_row(point: Sequence[Coordinate]) -> str:
    """Return a point as the command takes it."""
    return ",".join(f"{one.input}={one.word or one.decimal}" for one in point)


def measure_texts(measures: Sequence[Measure]) -> list[tuple[str, str, str]]:
    """Return the name and value of each measure, and its fraction if that says more."""
    texts: list[tuple[str, str, str]] = []
    for one in measures:
        unit = f" {one.unit}" if one.unit else ""
        is_shown = len(one.exact or "") <= _SHORT and one.exact != number(one.value)
        exact = one.exact if one.exact and is_shown else ""
        texts.append((one.name, f"{number(one.value)}{unit}", exact))
    return texts

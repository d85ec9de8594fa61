"""Sentences of answers: rendered from messages and facts alone."""

from __future__ import annotations

import pytest

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.rechecking.sentences import MESSAGES, express, render


def test_every_message_is_of_a_code_and_graded_as_its_code_can_be() -> None:
    for name, message in MESSAGES.items():
        code = name.partition(".")[0]
        assert code in CODES or code == "FTD"
        grades = ("note", "info", "warning", "error", "info?", "error?")
        assert message.grade in grades, name


def test_every_code_but_of_declining_has_a_message() -> None:
    known = {name.partition(".")[0] for name in MESSAGES}
    assert {code for code in CODES if not code.startswith("FTD")} - known == {"FT802"}


@pytest.mark.parametrize(
    ("fact", "how", "text"),
    [
        ("a", "", "a"),
        ("it's", "q", '"it\'s"'),
        (None, "q", "no class"),
        (1 / 3, "s", "0.3333"),
        (1.0, "s", "1"),
        (0.99999, "s", "more than 0.9999"),
        (0.25, "p", "25 %"),
        (3.0, "d", "3"),
        (1.0, "n pair", "1 pair"),
        (0, "n pair", "0 pairs"),
        (2, "n term has|terms have", "2 terms have"),
        (0.1, "g", "0.1"),
        ((), "within", "here"),
        ((("x", 1.0, 2.0), ("y", None, 3.0)), "within", "where 'x' is 1 to 2 and 'y' is"
         " at most 3"),
        ((("x", 1.0, 1.0), ("y", 1.0, 1.0 + 1e-9)), "within", "where 'x' is 1 and 'y'"
         " is about 1"),
        ((("a", 0.0, None),) * 4, "within", "where 'a' is at least 0 and 'a' is at"
         " least 0 and 'a' is at least 0 and so on"),
        ((("x", 1.0, 2.0), ("y", None, None)), "above", "where 'x' is above 1 and at"
         " most 2"),
        ((("y", None, None),), "above", "everywhere"),
        ((("x", "1.5"), ("y", "2")), "at", "'x' is 1.5 and 'y' is 2"),
    ],
)  # fmt: skip
def test_a_fact_is_shown_as_the_template_says(
    fact: object, how: str, text: str
) -> None:
    assert express(fact, how) == text  # type: ignore[arg-type] # of any kind


@pytest.mark.parametrize(
    ("fact", "how"), [("a", "d"), (None, ""), ((), "q"), ((), "d"), ("x", "within")]
)
def test_a_fact_of_another_kind_is_refused(fact: object, how: str) -> None:
    with pytest.raises(ValueError, match=f"shown as {how!r}"):
        express(fact, how)  # type: ignore[arg-type] # of another kind


def test_a_part_is_left_out_without_its_fact() -> None:
    facts: dict[str, str | float]
    facts = {"subject": "rule 1 and rule 2", "level": 0.5, "then": "a", "other": "b"}
    text = render("FT201.conflict", facts)
    assert text == (
        "rule 1 and rule 2 conflict: both reach 0.5 at one input, and say 'a' and 'b'"
    )
    short = render("FT201.conflict", {**facts, "falls short": 1e-9})
    assert short == text.replace("reach", "reach nearly")


def test_a_message_without_its_facts_is_refused() -> None:
    with pytest.raises(KeyError, match="terms in use"):
        render("FT404.used", {"variables in use": 1})

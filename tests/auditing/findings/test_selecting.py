"""Codes by their beginnings, settings in their ranges."""

from __future__ import annotations

import pytest

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.configuration import (
    check_settings,
    code_selection,
    settings_with,
)
from fuzzytree.auditing.findings.records import AuditSettings


def test_all_codes_are_tested_unless_some_are_chosen() -> None:
    assert code_selection() == set(CODES)


def test_ignoring_goes_before_selecting() -> None:
    chosen = code_selection(["FT4", "FT301"], ["FT402"])
    queries = {code for code in chosen if not code.startswith("FTD")}
    assert queries == {"FT401", "FT403", "FT404", "FT301"}


def test_reasons_for_declining_are_reported_whatever_is_selected() -> None:
    declined = {code for code in CODES if code.startswith("FTD")}
    assert code_selection(["FT501"]) == {"FT501", *declined}
    assert code_selection(["FT5"], ["FT4"]) == {"FT501", *declined}


@pytest.mark.parametrize("text", ["FTD", "FTD04"])
def test_reasons_for_declining_cannot_be_left_out(text: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        code_selection([], [text])
    results = f"the code {text!r} cannot be left out: it reports what was declined"
    assert str(caught.value) == results


@pytest.mark.parametrize("text", ["", "FT99", "x", "FT1011"])
def test_what_begins_no_code_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=f"^no code begins with {text!r}; there is"):
        code_selection([text])


def test_a_misspelt_code_is_answered_with_the_one_that_was_meant() -> None:
    with pytest.raises(ValueError, match=r"\(did you mean 'FT101'\?\)$"):
        code_selection([], ["FT1O1"])


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (
            {"epsiln": "0.1"},
            "no setting 'epsiln'; there is epsilon, margin, lead, level, overlap, "
            "rows, seed (did you mean 'epsilon'?)",
        ),
        ({"epsilon": "much"}, "epsilon must be a number, not 'much'"),
        ({"epsilon": "nan"}, "epsilon must be finite, not 'nan'"),
        ({"epsilon": "0"}, "epsilon must be above 0 and at most 1, not 0.0"),
        ({"rows": "1.5"}, "rows must be a whole number, not '1.5'"),
        ({"rows": "0"}, "rows must be 1 to 10000000, not 0"),
        ({"seed": "-1"}, "seed must be 0 to 4294967295, not -1"),
    ],
    ids=str,
)
def test_a_wrong_setting_is_one_sentence(texts: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        settings_with(AuditSettings(), texts)
    assert str(caught.value) == message


@pytest.mark.parametrize("budget", [0.0, -1.0, float("nan"), float("inf")])
def test_a_budget_of_nothing_or_without_end_is_refused(budget: float) -> None:
    message = f"budget must be above 0 and at most 1e9 million steps, not {budget!r}"
    with pytest.raises(ValueError, match=r".") as caught:
        check_settings(AuditSettings(budget=budget))
    assert str(caught.value) == message


def test_a_choice_that_leaves_nothing_to_ask_is_refused() -> None:
    message = "^select and skip leave no code to answer$"
    with pytest.raises(ValueError, match=message):
        code_selection(["FT2"], ["FT2"])

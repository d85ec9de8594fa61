"""Results in words."""

from __future__ import annotations

import pytest

from fuzzytree.model.agreement import Agreement, Certified, Comparison, Verdict
from fuzzytree.report.text import agreement_verdict


def agreement(comparisons: list[Verdict], bounds: list[Verdict]) -> Agreement:
    certified = [
        Certified(
            "rules",
            "float64",
            "",
            None,
            "",
            "probes",
            1,
            None,
            0,
            0,
            None,
            0,
            0,
            0,
            one,
        )
        for one in bounds
    ]
    found = [Comparison("a", "b", "rows", 1, one) for one in comparisons]
    return Agreement("m", "f", tuple(found), certificates=tuple(certified))


@pytest.mark.parametrize(
    ("comparisons", "bounds", "said"),
    [
        (["agrees"], ["agrees"], "none of 1 comparison disagrees"),
        (["agrees", "DISAGREES"], [], "1 of 2 comparisons disagrees"),
        (["DISAGREES", "DISAGREES"], [], "2 of 2 comparisons disagree"),
        (
            ["agrees", "agrees"],
            ["DISAGREES"],
            "none of 2 comparisons disagrees; 1 rounding bound exceeded",
        ),
    ],
)
def test_a_check_ends_with_how_much_of_it_disagrees(
    comparisons: list[Verdict], bounds: list[Verdict], said: str
) -> None:
    found = agreement(comparisons, bounds)
    assert agreement_verdict(found) == said
    assert found.ok == (said.startswith("none") and "bound" not in said)

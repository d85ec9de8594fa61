"""No valid change of another costs less than ours, and a shorter one is noticed."""

from __future__ import annotations

import random

import counterfactuals as module
import pandas as pd
import pytest
from counterfactuals import Distance, Outcome

import fuzzytree as ft


@pytest.fixture(scope="module")
def tree() -> ft.FuzzyTree:
    return ft.learn(module.load("iris"), target="class")


def test_rows_at_random_are_never_nearer(tree: ft.FuzzyTree) -> None:
    chance = random.Random(0)
    frame = module.load("iris")
    for place in (0, 60, 120):
        row = frame.iloc[place][[*tree.inputs]].to_dict()
        explanation = ft.why(tree, row)
        change = explanation.change
        assert change is not None
        own = module.checked(tree, row, change, explanation.label)
        others = pd.DataFrame(
            [
                {
                    v.name: chance.uniform(v.low or 0.0, v.high or 0.0)
                    for v in tree.variables
                    if not v.parts
                }
                for _ in range(2000)
            ]
        )
        other = module.nearest(tree, row, str(change.label), others)
        assert other is not None
        module.compare([Outcome(own, 0.0)], [Outcome(other, 0.0)])
        assert own.largest == pytest.approx(change.cost)


def test_a_nearer_change_of_another_is_noticed() -> None:
    ours = [Outcome(Distance(0.5, 0.5, 1), 0.0)]
    module.compare(ours, [Outcome(None, 0.0)])
    with pytest.raises(AssertionError):
        module.compare(ours, [Outcome(Distance(0.4, 0.9, 2), 0.0)])


def test_a_line_has_medians_of_what_is_valid() -> None:
    outcomes = [Outcome(Distance(0.25, 0.5, 2), 1.0), Outcome(None, 2.0)]
    assert module.line_of("wine", "DiCE", outcomes) == (
        "| wine | DiCE | 1 of 2 | 0.250 | 0.500 | 2 | 1.500 |\n"
    )

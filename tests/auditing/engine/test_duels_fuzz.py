"""Cells against boxes against rows, on many rule bases."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.bounding import wins_by_boxes
from fuzzytree.auditing.engine.questions import wins
from fuzzytree.auditing.engine.states import Bracket, Proved, Witness, point_of
from fuzzytree.numerics.oracle import DECIDED, decide
from tests.auditing.engine.bases import cpu_clock, random_base, unit_domain

CASES = [
    ("lr", 5, 3, 0.0, 0.0, 0),
    ("lr", 7, 4, 0.7, 0.2, 0),
    ("points", 8, 3, 0.6, 0.4, 0),
    ("band", 6, 3, 0.5, 0.4, 0),
    ("mixed", 9, 2, 0.9, 0.3, 0),
    ("mixed", 5, 3, 0.3, 0.2, 1),
]


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("kind", "rules", "features", "shared", "odd", "combinations"), CASES
)
def test_cells_boxes_and_rows_never_contradict_each_other(
    kind: str, rules: int, features: int, shared: float, odd: float, combinations: int
) -> None:
    undecided = asked = 0
    for seed in range(100, 108):
        base = random_base(
            seed,
            rules,
            features,
            kind=kind,  # type: ignore[arg-type]
            shared=shared,
            odd=odd,
            combinations=combinations,
        )
        box = unit_domain(base)
        given = arrange(base, box)
        values = np.random.default_rng(seed).random((features, 20_000))
        answers = decide(base, values, with_strengths=False)
        for rule in range(1, rules + 1):
            label = base.rules[rule - 1].then
            rivals = [n for n, r in enumerate(base.rules, 1) if r.then != label]
            found = wins(given, rule, rivals, cpu_clock(3.0))
            other = wins_by_boxes(
                base, box, rule, rivals, cpu_clock(0.3), tolerance=1e-6
            )
            asked += 1
            won = (answers.rule == rule) & (answers.status == DECIDED)
            if isinstance(found, Proved):
                assert not won.any(), (seed, rule)
                assert not isinstance(other, Witness), (seed, rule)
            elif isinstance(found, Witness):
                strengths = strengths_at(given, point_of(found.point))
                assert all(strengths[rule - 1] > strengths[n - 1] for n in rivals)
                assert not isinstance(other, Proved), (seed, rule)
            else:
                assert isinstance(found, Bracket)
                undecided += found.high > 1e-60
    assert undecided <= asked // 20

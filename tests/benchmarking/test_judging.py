"""What is measured of a candidate's answers."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from fuzzytree.benchmarking.judging import exact_sample, measured_error
from fuzzytree.benchmarking.records import CandidateOutput
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree


def test_the_facts_of_answers_count_flips_band_and_cover() -> None:
    # x is low: 1, 2/3, 1/3, 0; the answers forget the third and invent the fourth.
    rules = RuleBase(
        "one",
        ("a",),
        (Variable("x", (Term("low", Band(high=1.0, right=4.0)),)),),
        (Rule((Proposition("x", ("low",)),), "a"),),
    )
    values = np.array([[0.0, 2.0, 3.0, 4.0]])
    given = np.array([[1.0, 0.75, 0.0, 0.125]])
    output = CandidateOutput(np.array([0, 0, -1, 0]), given)
    sample = exact_sample(rules, values)
    assert msgspec.structs.asdict(measured_error(output, sample, 0.2, "a guess")) == {
        "rows": 4,
        "largest": pytest.approx(1 / 3),
        "bound": 0.2,
        "origin": "a guess",
        "flips": 2,
        "largest_flip_margin": pytest.approx(1 / 3),
        "in_band": 0.5,
        "cover_lost": 1,
        "cover_gained": 1,
        "outputs": {},
    }


def test_a_tree_has_flips_and_no_margins() -> None:
    tree = random_tree(0)
    values = probe_values(tree, 60)
    sample = exact_sample(tree, values)
    labels = sample.labels.copy()
    labels[0] = 1 if labels[0] == 0 else 0
    found = measured_error(CandidateOutput(labels), sample, None, "")
    assert (found.flips, found.largest_flip_margin, found.in_band) == (1, None, None)
    assert found.largest is None

import math

from fuzzytree.model.rulebase import LR, Band, Side
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import SPECIAL, landmarks, neighbours, probes
from fuzzytree.semantics.reference import axis_values
from fuzzytree.testing import random_tree


def test_landmarks_of_a_band_are_its_edges_and_the_ends_of_its_flanks() -> None:
    band = Band(1.0, 2.0, 0.0, 4.0)
    assert set(landmarks(band)) == {0.0, 0.6, 1.0, 2.0, 2.8, 4.0}


def test_landmarks_of_an_lr_set_are_where_its_formula_changes() -> None:
    found = landmarks(LR(0.0, Side(1.0, (0.4,)), Side(2.0, (0.4,))))
    assert {0.0, -1.0, -5.0, 2.0, 10.0} <= set(found)


def test_neighbours_are_the_next_floats_of_both_types() -> None:
    found = neighbours(0.1)
    single = 0.10000000149011612  # 0.1 as float32
    assert {0.1, math.nextafter(0.1, 0), math.nextafter(0.1, 1), single} <= set(found)
    assert len(found) == 6


def test_the_largest_double_has_no_infinite_neighbour() -> None:
    assert all(map(math.isfinite, neighbours(1.7976931348623157e308)))


def test_each_cut_of_an_input_and_its_neighbours_are_probed() -> None:
    tree = random_tree(1, leaves=9, inputs=3, combinations=0.0)
    rows = probes(tree)
    for node in tree.nodes:
        met = {row[node.variable] for row in rows}
        for cut in node.cuts:
            assert {cut, math.nextafter(cut, math.inf)} <= met


def test_cuts_of_combinations_are_met_to_the_last_bit() -> None:
    tree = random_tree(11, leaves=5, inputs=3, combinations=1.0)
    rows = [axis_values(tree.variables, row) for row in probes(tree)]
    cuts = [(node.variable, cut) for node in tree.nodes for cut in node.cuts]
    met = [cut in {row[variable] for row in rows} for variable, cut in cuts]
    assert sum(met) / len(met) > 0.5


def test_every_special_value_stands_in_every_input() -> None:
    tree = random_tree(1, inputs=3)
    rows = probes(tree)
    for name in tree.inputs:
        met = [row[name] for row in rows]
        assert any(map(math.isnan, met))
        assert set(SPECIAL[1:]) <= set(met)


def test_equal_arguments_give_equal_rows() -> None:
    rules = rules_from_tree(random_tree(5), "raw")
    assert repr(probes(rules, limit=300)) == repr(probes(rules, limit=300))


def test_no_more_rows_than_the_limit() -> None:
    assert len(probes(random_tree(5, leaves=50), limit=500)) == 500

"""The front and the advice follow from the points, on studies made by hand."""

from __future__ import annotations

import re

import msgspec
import pytest

from fuzzytree.benchmarking.front import advice, entries, error_of, front, fronts
from fuzzytree.benchmarking.records import Front
from tests.benchmarking.studies import error, point, timing

NATIVE = point("native", 1000.0, error(2e-16, 1e-15))
MIXED = point("onnxruntime mixed", 500.0, error(8e-8, 3e-7))
COARSE = point("native at 1e-2", 250.0, error(4e-3, 9e-3), kind="variant")
SLOW = point("reference", 90_000.0, error(2e-16, 1e-15))
MUTE = point("a peer", 10.0, error(None), kind="peer")
FLOOR = point("floor: reading", 1.0, None, kind="floor")


def test_the_front_is_whom_nobody_beats() -> None:
    points = [NATIVE, MIXED, COARSE, SLOW, MUTE, FLOOR]
    best = front(entries(points, "rules", 1000, 1))
    assert [one.name for one in best] == [
        "native at 1e-2: rules",
        "onnxruntime mixed: rules",
        "native: rules",
    ]
    names = tuple(one.name for one in best)
    assert fronts(points) == (Front("rules", 1000, 1, names),)


def test_whoever_is_slower_and_no_more_exact_is_not_on_the_front() -> None:
    worse = point("worse", 501.0, error(8e-8, 3e-7))
    best = front(entries([MIXED, worse], "rules", 1000, 1))
    assert [one.name for one in best] == [MIXED.name]


def test_questions_rows_and_threads_are_not_mixed() -> None:
    both = point("native", 7.0, error(0.0), more=(timing(5.0, rows=1, threads=2),))
    tree = point("native", 3.0, error(None), question="tree")
    assert [(f.question, f.rows, f.threads) for f in fronts([both, tree])] == [
        ("rules", 1, 2),
        ("rules", 1000, 1),
        ("tree", 1000, 1),
    ]


def test_an_error_is_the_certified_one_where_there_is_one() -> None:
    assert error_of(MIXED) == 3e-7
    assert error_of(point("a", 1.0, error(0.25))) == 0.25
    assert error_of(MUTE) is None
    assert error_of(FLOOR) is None


def test_an_observed_error_is_no_better_than_the_least_certified_bound() -> None:
    peer = point("a peer", 2000.0, error(1e-17), kind="peer")
    ordered = entries([NATIVE, MIXED, peer], "rules", 1000, 1)
    assert {one.name: one.error for one in ordered}[peer.name] == 1e-15
    assert peer.name not in [one.name for one in front(ordered)]


def test_a_trees_error_is_the_share_of_other_classes() -> None:
    tree = point("a", 1.0, error(None, flips=3), question="tree")
    assert error_of(tree) == 3 / 200


def test_each_level_at_which_something_else_is_faster_has_a_sentence() -> None:
    assert advice([NATIVE, MIXED, COARSE, SLOW]) == (
        "rules, 1,000 rows: fastest within an error of 0.01: native at 1e-2, "
        "4.0 times as fast as native (95 % CI 4.0 to 4.0)",
        "rules, 1,000 rows: fastest within an error of 1e-06: onnxruntime mixed, "
        "2.0 times as fast as native (95 % CI 2.0 to 2.0)",
        "rules, 1,000 rows: fastest within an error of 1e-15: native, "
        "90.0 times as fast as reference (95 % CI 90.0 to 90.0)",
    )


def test_a_wanted_error_has_one_sentence() -> None:
    assert advice([NATIVE, MIXED, COARSE, SLOW], most=1e-4) == (
        "rules, 1,000 rows: fastest within an error of 0.0001: onnxruntime mixed, "
        "2.0 times as fast as native (95 % CI 2.0 to 2.0)",
    )


def test_a_wanted_error_that_nothing_keeps_is_said_with_the_nearest() -> None:
    assert advice([MIXED, COARSE], most=1e-9) == (
        "rules, 1,000 rows: nothing measured is within an error of 1e-09; "
        "the nearest is onnxruntime mixed with 3e-07",
    )


def test_a_gain_that_is_not_sure_is_no_advice() -> None:
    samples = (1.2, 0.8) * 7 + (1.0,)  # in every second round slower than native
    coarse = point("coarse", 1.0, error(1e-3, 2e-3))
    unsure = timing(1.0)
    noisy = [
        ns * s for ns, s in zip(NATIVE.timings[0].samples_ns, samples, strict=True)
    ]
    result = unsure.__class__(
        1000, 1, tuple(noisy), 999.0, 800.0, 1200.0, 0.965, rounds=tuple(range(15))
    )
    coarse = point("coarse", 999.0, error(1e-3, 2e-3)).__class__(
        "coarse: rules", "rules", "variant", coarse.error, (result,), 0.0
    )
    (sentence,) = advice([NATIVE, coarse])
    assert ": native, the only one" in sentence


def test_the_default_is_kept_unless_something_is_surely_faster() -> None:
    for ns in (1000.0, 990.0, 1010.0):
        other = point("other", ns, error(2e-16, 1e-15))
        noisy = timing(ns, spread=0.5)
        shuffled = tuple(reversed(noisy.samples_ns))
        timings = (msgspec.structs.replace(noisy, samples_ns=shuffled),)
        other = msgspec.structs.replace(other, timings=timings)
        (sentence,) = advice([NATIVE, other])
        assert re.fullmatch(
            r"rules, 1,000 rows: fastest within an error of 1e-15: native; nothing is "
            r"surely faster \(other takes (0\.99|1\.00|1\.01) times as long, "
            r"95 % CI 0\.\d\d to 1\.\d\d\)",
            sentence,
        )


def test_few_rounds_are_never_sure() -> None:
    few = msgspec.structs.replace(
        timing(100.0), samples_ns=(100.0,) * 3, rounds=(0, 1, 2)
    )
    fast = msgspec.structs.replace(
        point("fast", 100.0, error(2e-16, 1e-15)), timings=(few,)
    )
    assert advice([NATIVE, fast]) == (
        "rules, 1,000 rows: fastest within an error of 1e-15: native; nothing is "
        "surely faster (fast takes 0.10 times as long, in too few rounds to be sure)",
    )


def test_a_candidate_without_strengths_is_marked() -> None:
    best_first = point("best-first", 100.0, error(None, 1e-15))
    (sentence,) = advice([NATIVE, best_first])
    assert ": best-first (which returns no strengths), 10.0 times as fast" in sentence


def test_a_tree_is_judged_by_its_classes_and_its_edges() -> None:
    native = point("native", 1000.0, error(None), question="tree")
    single = point(
        "native float32",
        500.0,
        error(None),
        question="tree",
        probes=error(None, flips=29, rows=400),
    )
    assert advice([native, single], most=0.1) == (
        "tree, 1,000 rows: fastest without a changed class in 200 rows: native "
        "float32, 2.0 times as fast as native (95 % CI 2.0 to 2.0); changed in 29 of "
        "400 rows generated at its cuts",
    )


def test_who_stands_alone_is_said_to() -> None:
    assert advice([MIXED]) == (
        "rules, 1,000 rows: fastest within an error of 1e-06: onnxruntime mixed, "
        "the only one",
    )
    assert advice([]) == advice([FLOOR]) == ()


@pytest.mark.parametrize("rows", [1, 1000])
def test_the_last_advice_is_for_most_rows_and_the_first_question(rows: int) -> None:
    tree = point("native", 9.0, error(None), question="tree")
    more = point("native", 9.0, error(1e-16), more=(timing(9.0, rows=rows),))
    assert advice([tree, more])[-1].startswith("tree, 1,000 rows: ")

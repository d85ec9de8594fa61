"""The page on the paper's claims: its statistics, and what it concludes."""

from __future__ import annotations

import doctest
import importlib.metadata
import itertools
import math
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType

import claims as command
import msgspec
import numpy as np
import paper.text
import pytest
from paper import agreement, inference, pictures, speed
from paper.agreement import Seen, answered, compared
from paper.inference import holm, mcnemar, overhead, power, wilson
from paper.judging import counted, first_gain, growth, lines, verdicts
from paper.page import page
from paper.records import Claims, Comparison, Price, Size, Times, from_json
from paper.text import three
from trees import multiway_tree

from fuzzytree.benchmarking.records import Machine
from fuzzytree.model.rulebase import LR, Band, Side, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node, Sets
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.lowering import rules_from_tree

pytestmark = pytest.mark.usefixtures("few_objects")

ROOT = Path(__file__).parent.parent
GOLDEN = ROOT / "tests" / "golden" / "claims"
STUDENT_1 = 12.706204736  # 97.5 % of Student's distribution of one degree of freedom

MACHINE = Machine("a processor", 1, "a system", "a Python", {"numpy": "2"})


# Statistics, by hand.


@pytest.mark.parametrize(
    ("first", "second", "p"),
    [
        (0, 0, 1.0),
        (3, 3, 1.0),
        (1, 5, 2 * (1 + 6) / 64),
        (5, 1, 2 * (1 + 6) / 64),
        (0, 10, 2 / 1024),
        (2, 8, 2 * (1 + 10 + 45) / 1024),
    ],
)
def test_mcnemar_sums_the_tail_of_the_coin(first: int, second: int, p: float) -> None:
    assert mcnemar(first, second) == p


def test_mcnemar_takes_counts_beyond_the_range_of_doubles() -> None:
    assert mcnemar(0, 5_000) == 0.0
    assert 0.9 < mcnemar(2_500, 2_501) <= 1.0


def test_wilson_is_the_interval_of_its_equation() -> None:
    # Its ends are the p with (share - p)^2 = z^2 p (1 - p) / n.
    for share, trials in ((0.0, 10), (0.3, 7), (0.5, 10), (1.0, 3)):
        for end in wilson(share, trials):
            room = 1.959963984540054**2 * end * (1 - end) / trials
            assert (share - end) ** 2 == pytest.approx(room, abs=1e-12)
    assert wilson(0.0, 10) == pytest.approx((0.0, 0.27753), abs=1e-5)


def test_wilson_knows_nothing_without_trials() -> None:
    assert wilson(0.0, 0) == (0.0, 1.0)


def test_holm_multiplies_the_smallest_by_the_number_of_tests() -> None:
    assert holm([0.01, 0.04, 0.03]) == (0.03, 0.06, 0.06)
    assert holm([0.9, 0.9]) == (1.0, 1.0)
    assert holm([]) == ()


def test_a_power_law_is_found_as_it_is() -> None:
    law = power([7, 70, 700], [2 * 7**1.5, 2 * 70**1.5, 2 * 700**1.5])
    assert (law.exponent, law.factor) == pytest.approx((1.5, 2.0))
    assert (law.low, law.high) == pytest.approx((1.5, 1.5))


def test_the_interval_of_an_exponent_is_students() -> None:
    # log10: points (0, 0), (1, 1.3), (2, 2): slope 1, residuals -0.1, 0.2, -0.1.
    law = power([1, 10, 100], [1, 10**1.3, 100])
    half = STUDENT_1 * math.sqrt(0.06 / 1 / 2)
    assert law.exponent == pytest.approx(1.0)
    assert (law.low, law.high) == pytest.approx((1.0 - half, 1.0 + half))


def test_two_points_have_a_law_without_an_interval() -> None:
    law = power([10, 100], [5, 50])
    assert law.exponent == pytest.approx(1.0)
    assert (law.low, law.high) == (-math.inf, math.inf)
    with pytest.raises(ValueError, match="two points or more"):
        power([10], [5])


def test_growth_is_named_only_as_far_as_the_interval_shows() -> None:
    assert growth(power([1, 10, 100], [1, 10**1.3, 100])) == "like n"
    assert growth(power([1, 10, 100], [1, 20.1, 400])) == "faster than n"
    assert growth(power([1, 10, 100], [1, 3.1, 10])) == "slower than n"


def test_overhead_is_the_part_of_the_time_that_stays() -> None:
    assert overhead([10, 100, 1000], [25.0, 70.0, 520.0]) == pytest.approx((20, 0.5))
    assert overhead([10, 100], [1.0, 100.0])[0] == 0.0  # a line through below 0
    assert overhead([10, 100], [10.0, 1.0])[1] == 0.0  # falling times
    with pytest.raises(ValueError, match="two different sizes"):
        overhead([10, 10], [1.0, 2.0])


@pytest.mark.parametrize("module", [inference, paper.text])
def test_the_examples_of_the_benchmark_give_what_they_show(module: ModuleType) -> None:
    failed, tried = doctest.testmod(module)
    assert (failed, tried > 0) == (0, True)


# Raw rules and the tree.


def _bits(text: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return np.array([letter == "1" for letter in text])


def _seen(tree: str, raw: str, same: str, covered: str) -> Seen:
    no = _bits("0" * len(tree))
    return Seen(_bits(tree), _bits(raw), _bits(same), _bits(covered), no, no)


def test_answers_are_counted_and_each_row_has_one_vote() -> None:
    # Five rows: both right; tree; raw; both wrong and different; uncovered.
    first = _seen(tree="11001", raw="10100", same="10000", covered="11110")
    # The second seed: row 2 undecided now, row 3 for the raw rules again.
    second = _seen(tree="10001", raw="10100", same="11000", covered="11110")
    third = _seen(tree="10001", raw="11100", same="10000", covered="11110")
    found = compared(("t", "paper", "minimum"), 3.0, [first, second, third])
    assert (found.rows, found.answers) == (5, 15)
    assert (found.tree_right, found.raw_right) == (7, 7)
    assert (found.tree_only, found.raw_only, found.both_wrong) == (1, 4, 3)
    assert (found.uncovered_tree_right, found.uncovered_tree_wrong) == (3, 0)
    assert found.of_seeds == ((1, 1), (0, 1), (0, 2))
    # Row 2 was right once with each: no vote. Row 3 votes once, though three times.
    assert found.votes == (0, 1)
    assert found.votes_in_all == (1, 1)


def _two_leaves() -> FuzzyTree:
    """Return a tree with a cut at 0 and sets that reach from -3 to 1 and -1 to 3."""
    side = Side(1.0, (0.5,), reach=2.0)
    low = Term("low", Band(high=0.0, right=2.0))
    high = Term("high", Band(low=0.0, left=-2.0))
    left, right = Term("a", LR(-1.0, side, side)), Term("b", LR(1.5, side, side))
    branches = (Branch(("low",), ("a",), leaf=1), Branch(("high",), ("b",), leaf=2))
    return FuzzyTree(
        "two",
        ("a", "b"),
        (Variable("x", (low, high)),),
        (Node("x", (0.0,), (0, 1), branches),),
        (Leaf("a", "a"), Leaf("b", "b")),
        (Sets("x", (left, right)),),
    )


def test_rows_are_answered_by_tree_and_raw_rules_apart() -> None:
    # The sets are as high at 0.25 as each other: there the first rule wins.
    rows = np.array([[-1.0, 0.125, 0.25, 1.5, 9.0]])
    found = answered(_two_leaves(), "minimum", rows, np.array([0, 1, 1, 0, 1]))
    assert found.tree_right.tolist() == [True, True, True, False, True]
    assert found.raw_right.tolist() == [True, False, False, False, False]
    assert found.is_covered.tolist() == [True, True, True, True, False]
    assert found.is_tie.tolist() == [False, False, True, False, False]
    assert found.is_same.tolist() == [True, False, False, True, False]
    assert not found.relative_differs.any()


@pytest.mark.heavy
def test_no_further_seed_begins_when_the_time_is_over() -> None:
    found = list(
        agreement.comparisons(["iris"], 5, seconds=1e-9, tell=lambda _text: None)
    )
    assert [one.conjunction for one in found] == ["minimum", "product"] * 2
    assert {len(one.of_seeds) for one in found} == {1}
    assert all(one.relative_differs == 0 for one in found)


@pytest.mark.heavy
def test_an_interrupted_comparison_keeps_its_whole_seeds() -> None:
    def interrupt(text: str) -> None:
        if text == "iris, paper mode, seed 1":
            raise KeyboardInterrupt

    found = agreement.comparisons(["iris"], 5, seconds=600.0, tell=interrupt)
    seeds = [len(next(found).of_seeds) for _ in range(4)]
    assert seeds == [1] * 4
    with pytest.raises(KeyboardInterrupt):
        next(found)


# Trees and times.


@pytest.mark.parametrize("leaves", [1, 2, 7, 50])
def test_every_leaf_of_a_multiway_tree_is_equally_likely(leaves: int) -> None:
    tree = multiway_tree(leaves)
    values = np.random.default_rng(0).normal(size=(len(tree.inputs), 100_000))
    counts = np.bincount(load(tree)(values).rule, minlength=leaves + 1)[1:]
    # Six standard deviations of a binomial count.
    room = 6.0 * math.sqrt(100_000 * (1 / leaves) * (1 - 1 / leaves))
    assert np.abs(counts - 100_000 / leaves).max() <= room
    assert len(rules_from_tree(tree, "raw").rules) == leaves


def test_propositions_are_n_times_the_questions_where_leaves_are_equally_likely() -> (
    None
):
    rules = rules_from_tree(multiway_tree(40)).rules
    propositions = sum(len(rule.when) for rule in rules)
    path = sum(len(rule.when) / 40 for rule in rules)
    assert propositions / path == pytest.approx(40)


@pytest.fixture
def only_native(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "FIRING", ("native",))
    monkeypatch.setattr(speed, "FAMILIES", ("multiway",))
    monkeypatch.setattr(speed, "BATCH", 100)


@pytest.mark.usefixtures("only_native")
def test_a_tree_its_rules_and_best_first_are_measured_side_by_side() -> None:
    bench = speed.Bench(rounds=2, tell=lambda _text: None)
    (size,) = bench.sizes([7], seconds=60.0)
    assert (size.rules, size.checked) == (7, 100)
    measured = [(p.what, p.kind, p.is_batch) for p in size.prices]
    one = [
        ("tree", None),
        ("rules", "relative"),
        ("rules", "raw"),
        ("best-first", "relative"),
        ("best-first", "raw"),
    ]
    batches = (False, True)
    assert measured == [(*name, is_batch) for is_batch in batches for name in one]
    for price in size.prices:
        assert 0 < price.low <= price.ns <= price.high
        assert (price.to_tree is None) == (price.what == "tree")
        assert (price.to_firing is None) == (price.what != "best-first")
    assert bench.omissions == []


@pytest.mark.usefixtures("only_native")
def test_what_there_is_no_time_for_is_an_omission() -> None:
    bench = speed.Bench(rounds=1, tell=lambda _text: None)
    assert list(bench.sizes([7, 20], seconds=-1.0)) == []
    assert bench.omissions == [
        "multiway trees of 7 rules: the time was over",
        "multiway trees of 20 rules: the time was over",
    ]


@pytest.mark.usefixtures("only_native")
def test_a_representation_with_other_predictions_stops_the_measurement(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def cross(tree: FuzzyTree, kind: str = "raw") -> object:
        return rules_from_tree(tree, "raw")  # passed off as relative ones

    monkeypatch.setattr(
        speed, "rules_from_tree", lambda tree, kind="raw": cross(tree, kind)
    )
    bench = speed.Bench(rounds=1, tell=lambda _text: None)
    with pytest.raises(RuntimeError, match="rules relative native gives other answers"):
        list(bench.sizes([20], seconds=60.0))


# Conclusions.


def _size(rules: int, ratios: dict[str, float], *, is_batch: bool = False) -> Size:
    """Return a size at which runtimes fire raw rules so many times as slowly."""
    prices = [Price("tree", None, "native", is_batch, 1, 1.0, 1.0, 1.0, 9)]
    for name, ratio in ratios.items():
        times = Times(ratio, ratio, ratio)
        prices.append(
            Price("rules", "raw", name, is_batch, 1, ratio, ratio, ratio, 9, times)
        )
    return Size("multiway", rules, 2.0, 2 * rules, rules, 10, tuple(prices))


def _comparison(tree: int, raw: int) -> Comparison:
    return Comparison(
        "iris",
        "paper",
        "minimum",
        rows=150,
        leaves=3.0,
        tree_right=100 + tree,
        raw_right=100 + raw,
        both_wrong=1,
        tree_only=tree,
        raw_only=raw,
        uncovered_tree_right=2,
        uncovered_tree_wrong=1,
        ties=0,
        ties_that_differ=0,
        relative_differs=0,
        votes=(tree, raw),
        votes_in_all=(tree + 2, raw),
        of_seeds=((tree, raw),),
    )


def _conclusions(claims: Claims) -> list[str]:
    """Return the bold heads of the page's summary."""
    summary = page(claims).partition("## In short")[2].partition("\n## ")[0]
    return summary.replace("\n  ", " ").split("**")[1::2]


def test_conclusions_follow_the_numbers() -> None:
    sizes = [7, 100, 1000, 10_000]
    right = Claims(
        MACHINE,
        tuple(_size(n, {"native": 1.2 * n}) for n in sizes),
        (_comparison(tree=1, raw=30),),
    )
    wrong = Claims(
        MACHINE,
        tuple(_size(n, {"native": 200 + n / 50}) for n in sizes),
        (_comparison(tree=30, raw=1),),
    )
    mixed = Claims(
        MACHINE,
        tuple(_size(n, {"native": 3.0, "reference": 0.6 * n}) for n in sizes),
        (_comparison(tree=30, raw=1), _comparison(tree=1, raw=30)),
    )
    assert _conclusions(right) == [
        'Counted, "n times" is right.',
        "Timed, the ratio grows like n everywhere, and is n, within a factor of 2, "
        "everywhere.",
        "For a single row, overhead does not decide.",
        '"Less reliable" is confirmed.',
    ]
    assert _conclusions(wrong)[1:] == [
        "Timed, the ratio grows like n nowhere, and is n, within a factor of 2, "
        "nowhere.",
        "For a single row, overhead decides at first.",
        '"Less reliable" is not what was measured, rather the opposite.',
    ]
    assert _conclusions(mixed)[1] == (
        "Timed, the ratio grows like n in reference row by row, and is n, within a "
        "factor of 2, in reference row by row."
    )
    assert _conclusions(mixed)[-1] == 'Which is "less reliable" depends on the table.'
    neither = Claims(MACHINE, (), (_comparison(tree=3, raw=2),))
    assert _conclusions(neither) == [
        '"Less reliable" can neither be confirmed nor denied here.'
    ]


def test_a_winner_needs_votes_that_survive_the_correction() -> None:
    alone = verdicts([_comparison(tree=0, raw=7)])
    assert (alone[0].p, alone[0].winner) == (2 / 128, "raw rules")
    many = verdicts([_comparison(tree=0, raw=7)] * 4)
    assert {verdict.winner for verdict in many} == {"open"}
    in_all = verdicts([_comparison(tree=7, raw=0)], lambda one: one.votes_in_all)
    assert in_all[0].p == 2 / 512


def test_counted_work_is_reported_alone_and_shared() -> None:
    assert counted(Size("grown", 4, 2.0, 8, 6, 1, ())) == (4.0, 3.0)


def test_a_search_gains_from_where_every_larger_size_gains() -> None:
    def searched(rules: int, low: float) -> Size:
        times = Times(2.0, low, 3.0)
        price = Price("best-first", "raw", "native", True, 1, 1, 1, 1, 9, times, times)
        return Size("multiway", rules, 1.0, 1, 1, 1, (price,))

    lows = {7: 1.5, 20: 0.9, 50: 1.1, 100: 1.2}
    (line,) = lines(Claims(MACHINE, tuple(searched(n, lows[n]) for n in lows), ()))
    assert first_gain(line) == 50
    (line,) = lines(Claims(MACHINE, (searched(7, 1.5), searched(20, 0.5)), ()))
    assert first_gain(line) is None


def test_numbers_have_three_digits_and_no_exponent() -> None:
    found = [three(value) for value in (0.0, 0.000123456, 1.005, 99.96, 25_061.5)]
    assert found == ["0", "0.000123", "1", "100", "25,100"]


# The page and its pictures.


def _stored() -> Claims:
    return from_json((GOLDEN / "claims.json").read_bytes())


def test_the_page_is_made_of_a_stored_result_byte_for_byte() -> None:
    assert page(_stored()) == (GOLDEN / "claims.md").read_text("utf-8")
    assert _stored().to_json() == (GOLDEN / "claims.json").read_text("utf-8")


def test_the_committed_page_shows_the_committed_numbers() -> None:
    folder = ROOT / "docs" / "explanation"
    claims = from_json((folder / "claims.json").read_bytes())
    assert not claims.is_quick
    assert page(claims) == (folder / "claims.md").read_text("utf-8")


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["speed", "agreement"])
def test_the_committed_picture_shows_the_committed_numbers(name: str) -> None:
    folder = ROOT / "docs" / "explanation"
    claims = from_json((folder / "claims.json").read_bytes())
    drawn_by = claims.machine.versions["matplotlib"]
    if importlib.metadata.version("matplotlib") != drawn_by:
        pytest.skip(f"drawn by matplotlib {drawn_by}, and others place letters apart")
    picture = pictures.svg(getattr(pictures, name), claims)
    assert picture == (folder / f"claims-{name}.svg").read_bytes()


def test_the_picture_of_speed_draws_every_line_of_the_numbers() -> None:
    claims = _stored()
    drawn = [
        tuple(np.asarray(curve.get_ydata(), np.float64).tolist())
        for axis in pictures.speed(claims).axes
        for curve in axis.lines
        if curve.get_gid()
    ]
    assert sorted(drawn) == sorted(line.ratios for line in lines(claims))


def test_the_picture_of_agreement_names_every_comparison() -> None:
    claims = _stored()
    left = pictures.agreement(claims).axes[0]
    names = [label.get_text() for label in left.get_yticklabels()]
    assert names == [
        f"{one.table}, {one.mode}, {one.conjunction}" for one in claims.comparisons
    ]


def test_labels_at_line_ends_keep_a_distance() -> None:
    heights = pictures._apart([10.0, 10.0, 10.5, 1000.0])
    ordered = sorted(heights)
    gaps = [b / a for a, b in itertools.pairwise(ordered)]
    assert min(gaps) >= 10.0**pictures.GAP * 0.99
    assert heights[3] == 1000.0


# The command.


def _main(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["claims.py", *words])
    return command.main()


@pytest.mark.heavy
def test_page_and_pictures_are_made_again_without_measuring_and_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "claims.json").write_bytes((GOLDEN / "claims.json").read_bytes())
    assert _main(monkeypatch, "--again", "--folder", str(tmp_path)) == 0
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {
        "claims.json",
        "claims.md",
        "claims-speed.svg",
        "claims-agreement.svg",
    }
    assert (tmp_path / "claims.md").read_bytes() == (GOLDEN / "claims.md").read_bytes()
    for name in ("speed", "agreement"):
        picture = (tmp_path / f"claims-{name}.svg").read_bytes()
        assert picture == pictures.svg(getattr(pictures, name), _stored())
        assert ET.fromstring(picture).tag == "{http://www.w3.org/2000/svg}svg"


@pytest.mark.heavy
def test_a_trial_run_measures_and_writes_a_page_that_says_so(tmp_path: Path) -> None:
    command_line = [sys.executable, str(ROOT / "benchmarks" / "claims.py"), "--quick"]
    subprocess.run([*command_line, "--folder", str(tmp_path)], check=True, cwd=tmp_path)
    claims = from_json((tmp_path / "claims.json").read_bytes())
    assert [size.rules for size in claims.sizes] == [7, 7, 50, 50, 300, 300]
    assert {one.table for one in claims.comparisons} == {"iris", "wine"}
    text = (tmp_path / "claims.md").read_text("utf-8")
    assert text == page(claims)
    assert "**This is a trial run, with few sizes and rounds.**" in text


def test_a_budget_of_nothing_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        _main(monkeypatch, "--budget", "0")
    error = capsys.readouterr().err.splitlines()[-1]
    assert error == "claims.py: error: the budget must be more than 0 seconds, not 0"


def test_an_interrupted_measurement_keeps_what_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object, **__: object) -> object:
        yield _comparison(tree=1, raw=2)
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "comparisons", interrupted)
    found = command.measured(60.0, is_quick=True)
    assert len(found.comparisons) == 1
    assert found.sizes == ()
    assert found.omissions == ("what came after an interruption by the user",)
    assert msgspec.json.decode(found.to_json(), type=Claims) == found
    assert "an interruption by the user" in page(found)

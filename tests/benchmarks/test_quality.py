"""The arithmetic of the study of quality, its runs, and its page."""

from __future__ import annotations

import doctest
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quality
import quality_page
import quality_statistics
import quality_tables
from quality_learners import LEARNERS, Learner
from quality_statistics import (
    calibration_error,
    cliques,
    critical_difference,
    friedman,
    ranks,
    reliability,
    resampled_t,
    verdict,
)
from quality_tables import FOLDS, SHIPPED_SUFFIX, load

WINE = load(f"wine{SHIPPED_SUFFIX}")


def test_the_examples_hold() -> None:
    assert not doctest.testmod(quality_statistics).failed


def test_ranks_are_those_of_demsar() -> None:
    # Four of his 14 tables (2006, table 6), with his ranks.
    accuracies = [
        [0.763, 0.768, 0.771, 0.798],
        [0.599, 0.591, 0.590, 0.569],
        [0.954, 0.971, 0.968, 0.967],
        [0.628, 0.661, 0.654, 0.657],
    ]
    assert ranks(np.array(accuracies)).tolist() == [
        [4.0, 3.0, 2.0, 1.0],
        [1.0, 2.0, 3.0, 4.0],
        [4.0, 1.0, 2.0, 3.0],
        [4.0, 1.0, 3.0, 2.0],
    ]


@pytest.mark.parametrize(
    ("learners", "quantile"),
    [(2, 1.960), (3, 2.343), (4, 2.569), (5, 2.728), (10, 3.164)],
)
def test_critical_differences_have_the_quantiles_of_demsar(
    learners: int, quantile: float
) -> None:
    expected = quantile * math.sqrt(learners * (learners + 1) / (6 * 14))
    assert critical_difference(learners, 14) == pytest.approx(expected, abs=1e-3)


def test_learners_that_are_always_alike_are_not_told_apart() -> None:
    apart = np.tile([1.0, 2.0, 3.0], (12, 1))
    assert friedman(apart) == pytest.approx(math.exp(-12.0))
    turned = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [3.0, 1.0, 2.0]])
    assert friedman(turned) == pytest.approx(1.0)
    assert cliques([1.0, 2.0, 3.0], 2.0) == [(0, 2)]
    assert cliques([1.0, 2.0, 3.0], 0.5) == []


def test_the_corrected_test_is_harder_than_that_of_independent_folds() -> None:
    rng = np.random.default_rng(0)
    ours, theirs = 0.8 + 0.02 * rng.normal(size=(2, FOLDS))
    apart = ours - theirs
    t = apart.mean() / math.sqrt(apart.var(ddof=1) * (1 / 10 + 1 / 9))
    naive = apart.mean() / math.sqrt(apart.var(ddof=1) / 10)
    assert abs(t) < abs(naive)
    stats: Any = pytest.importorskip("scipy.stats")
    assert resampled_t(ours, theirs) == pytest.approx(2 * stats.t.sf(abs(t), 9))


def test_a_verdict_has_a_side() -> None:
    good = [0.90, 0.91, 0.92, 0.90, 0.91, 0.92, 0.90, 0.91, 0.92, 0.91]
    bad = [one - 0.2 for one in good[1:] + good[:1]]
    assert (verdict(good, bad), verdict(bad, good), verdict(good, good)) == (1, -1, 0)
    assert verdict([0.9] * 10, [0.8] * 10) == 1


def test_the_calibration_error_is_a_mean_over_rows() -> None:
    rng = np.random.default_rng(1)
    chances = rng.dirichlet([1.0, 1.0, 1.0], 500)
    answers = rng.integers(0, 3, 500)
    confidence, is_hit = chances.max(axis=1), chances.argmax(axis=1) == answers
    bins = np.floor(confidence * 10).astype(int)
    expected = sum(
        (bins == k).mean() * abs((confidence - is_hit)[bins == k].mean())
        for k in set(bins.tolist())
    )
    assert calibration_error(reliability(chances, answers)) == pytest.approx(expected)


def test_a_certain_answer_is_in_the_last_bin() -> None:
    bins = reliability(np.array([[1.0, 0.0]]), np.array([0]))
    assert bins[9] == [1.0, 1.0, 1.0]


class _Slow:
    def fit(self, *_data: object) -> None:
        while True:
            time.process_time()


class _Broken:
    def fit(self, *_data: object) -> None:
        raise ValueError("no\nway")


def test_ten_folds_of_a_learner() -> None:
    learner = LEARNERS["DecisionTree, 10 leaves"]
    found = quality.measured(learner, WINE, [0] * FOLDS, 30.0)
    assert len(found["accuracy"]) == len(found["log_loss"]) == FOLDS
    assert 0.8 < np.mean(found["accuracy"]) < 1.0
    assert max(found["leaves"]) <= 10.0
    assert sum(rows for rows, *_ in found["bins"]) == len(WINE.labels)


def test_what_takes_too_long_or_breaks_is_said() -> None:
    slow = quality.measured(Learner(lambda *_: _Slow()), WINE, [0] * FOLDS, 0.2)
    assert slow["failed"] == "over 0.2 s"
    broken = quality.measured(Learner(lambda *_: _Broken()), WINE, [0] * FOLDS, 9.0)
    assert (broken["failed"], broken["accuracy"]) == ("ValueError: no", [])


@pytest.mark.heavy
def test_a_run_goes_on_and_the_page_has_what_was_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(quality, "_version", lambda _package: "1.0")
    for name in ("DecisionTree", "GaussianNB", "LDA"):
        quality.run(name, WINE, tmp_path, 30.0, {})
    path = tmp_path / WINE.name / "LDA.json"
    before = path.stat().st_mtime_ns
    quality.run("LDA", WINE, tmp_path, 30.0, {})
    assert path.stat().st_mtime_ns == before
    monkeypatch.setattr(quality_tables, "names", lambda: [WINE.name])
    page = tmp_path / "quality.json"
    quality_page.write(quality_page.collected(page, tmp_path), page)
    kept = json.loads(page.read_bytes())["tables"][WINE.name]
    assert (kept["rows"], kept["classes"], len(kept["learners"])) == (178, 3, 3)
    again = quality_page.collected(page, tmp_path / "empty")
    assert again["tables"][WINE.name] == kept
    words = page.with_suffix(".md").read_text()
    assert f"| {WINE.name} | 178 x 13, 3 | 39.9 |" in words
    assert "Not looked at yet." in words


def _cell(accuracy: float, leaves: int | None) -> dict[str, Any]:
    rng = np.random.default_rng(int(1000 * accuracy))
    folds = (accuracy + 0.01 * rng.normal(size=FOLDS)).round(4).tolist()
    cell: dict[str, Any] = {"accuracy": folds, "seconds": 0.1, "package": "some 1.0"}
    cell["log_loss"] = 1.0 - accuracy
    cell["bins"] = [[0.0, 0.0, 0.0]] * 9 + [[100.0, 95.0, 100.0 * accuracy]]
    if leaves:
        cell |= {"leaves": [leaves] * FOLDS, "columns": 2.0}
    return cell


def test_the_page_draws_and_counts_what_was_found(tmp_path: Path) -> None:
    facts = {"rows": 100, "columns": 4, "classes": 2, "most_frequent": 0.5}
    learners = {
        "fuzzytree": _cell(0.9, 4),
        "fuzzytree, one column": _cell(0.85, 4),
        "DecisionTree": _cell(0.8, 30),
        "LDA": _cell(0.95, None),
        "fuzzytree, 10 leaves": _cell(0.9, 4),
        "DecisionTree, 10 leaves": _cell(0.8, 10),
        "FIGS, 10 leaves": _cell(0.7, 10),
    }
    slow = {"EBM": {"failed": "over 30 s", "package": "interpret 1.0"}}
    results = {name: {**facts, "learners": learners | slow} for name in ("a", "b", "c")}
    path = tmp_path / "quality.json"
    quality_page.write({"machine": "one", "tables": results}, path)
    words = path.with_suffix(".md").read_text()
    assert "| DecisionTree | 3 : 0 | 3 : 0 | 3 : 0 | - |" in words
    assert "| LDA | 0 : 3 | 0 : 3 | 0 : 3 | a, b, c |" in words
    assert "| EBM | interpret 1.0 | a, b, c (over 30 s) |" in words
    pictures = sorted(one.name for one in tmp_path.glob("*.svg"))
    assert pictures == [
        f"quality-{name}-a-m.svg"
        for name in ("leaves", "ranks-all", "ranks-small", "reliability")
    ]
    assert all(f"]({name})" in words for name in pictures)
    assert json.loads(path.read_bytes())["tables"] == results

"""Of more than 200 classes a rule for each is learnt, with fuzzy sets on columns."""

from __future__ import annotations

import copy
import math
import pickle
import re
import statistics
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from sklearn.naive_bayes import GaussianNB

import fuzzytree as ft
from fuzzytree.cli import main
from fuzzytree.errors import LearningError
from fuzzytree.estimator import FuzzyTreeClassifier
from fuzzytree.learning import LearningSettings, Learnt, importances, learn_arrays
from fuzzytree.model import FuzzyTree, Points, RuleBase
from fuzzytree.semantics import Status
from fuzzytree.semantics.reference import evaluate

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray


def gaussians(
    classes: int, columns: int, rows: int = 20, seed: int = 0
) -> tuple[FloatArray, IntArray]:
    """Return rows of classes with a mean and a spread of their own in each column."""
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(classes, 1, columns))
    spreads = rng.uniform(0.2, 0.6, (classes, 1, columns))
    values = means + spreads * rng.normal(size=(classes, rows, columns))
    return values.reshape(-1, columns), np.repeat(np.arange(classes), rows)


def learnt(values: FloatArray, codes: IntArray, **settings: Any) -> Learnt:
    weights = settings.pop("weights", None)
    return learn_arrays(
        values,
        codes,
        columns=[f"x{k + 1}" for k in range(values.shape[1])],
        classes=[f"c{k}" for k in range(int(codes.max()) + 1)],
        settings=LearningSettings(**settings),
        weights=weights,
    )


def share_right(model: FuzzyTree | RuleBase, values: FloatArray, codes: Any) -> float:
    found = ft.run(model, ft.table(values, columns=model.columns)).classes
    right = [label == f"c{k}" for label, k in zip(found, codes, strict=True)]
    return float(np.mean(right))


def points(model: FuzzyTree | RuleBase, variable: str, term: str) -> Points:
    terms = next(v.terms for v in model.variables if v.name == variable)
    shape = next(one.shape for one in terms if one.name == term)
    assert isinstance(shape, Points)
    return shape


@pytest.mark.parametrize("classes", [300, 1000])
def test_many_gaussian_classes_are_predicted_as_well_as_by_gaussian_bayes(
    classes: int,
) -> None:
    values, codes = gaussians(classes, 10)
    kept = np.arange(len(codes)) % 3 > 0
    model = learnt(values[kept], codes[kept]).model
    assert isinstance(model, RuleBase)
    assert model.rule_labels == tuple(f"c{k}" for k in range(classes))
    other = GaussianNB().fit(values[kept], codes[kept])
    right = share_right(model, values[~kept], codes[~kept])
    assert right > max(0.85, other.score(values[~kept], codes[~kept]) - 0.01)


def test_wide_classes_and_strange_values_spoil_no_other_class() -> None:
    values, codes = gaussians(250, 10)
    kept = np.arange(len(codes)) % 3 > 0
    wide = np.exp(values)
    model = learnt(wide[kept], codes[kept]).model
    other = GaussianNB().fit(wide[kept], codes[kept])
    score = other.score(wide[~kept], codes[~kept])
    assert share_right(model, wide[~kept], codes[~kept]) > score - 0.01 > 0.88
    spoilt = values[kept]
    spoilt[codes[kept] < 25, 0] *= 1e3
    model = learnt(spoilt, codes[kept]).model
    others = ~kept & (codes >= 25)
    plain = learnt(values[kept], codes[kept]).model
    usual = share_right(plain, values[others], codes[others])
    assert share_right(model, values[others], codes[others]) > usual - 0.03


def test_a_set_is_a_root_of_a_normal_density_with_its_spread_drawn_to_the_usual() -> (
    None
):
    wide, narrow = [0.0, 2.0, 4.0, 10.0], [100.0, 101.0, 102.0]
    codes = np.array([0] * 4 + [1] * 3)
    model = learnt(np.array([[*wide, *narrow]]).T, codes, form="rules").model
    within = [statistics.variance(one) * (len(one) - 1) for one in (wide, narrow)]
    medians = [
        own / n / (1 - 2 / 9 / n) ** 3 for own, n in zip(within, (3, 2), strict=True)
    ]
    usual, spreads = sum(medians) / 2, []
    for own, rows in zip(within, (wide, narrow), strict=True):
        variance = (own + 4 * usual) / (len(rows) - 1 + 4)
        spreads.append(math.sqrt(variance * (1 + 1 / len(rows))))
    for k, rows in enumerate((wide, narrow)):
        shape = points(model, "x1", f"c{k}")
        steps = [-5, -2.5, -1, 0, 1, 2.5, 5]
        mean = statistics.mean(rows)
        assert shape.values == pytest.approx([mean + s * spreads[k] for s in steps])
        height = min(spreads) / spreads[k]
        degrees = [max(height * math.exp(-s * s / 2), math.exp(-12.5)) for s in steps]
        share = len(rows) / 4
        assert shape.degrees == pytest.approx(
            [(share * degree) ** 0.25 for degree in degrees], abs=1e-6
        )
    assert [rule.support for rule in model.rules] == [4, 3]


def test_a_degree_of_a_category_is_a_root_of_its_share_in_the_class() -> None:
    texts = ["red"] * 3 + ["blue"] + ["blue"] * 4
    table = pd.DataFrame({"colour": texts, "y": ["a"] * 4 + ["b"] * 4})
    model = ft.learn(table, target="y", form="rules")
    (variable,) = model.variables
    usual = {"red": 3 / 8, "blue": 5 / 8}
    likely = {
        label: {one: (own.get(one, 0) + 4 * usual[one]) / 8 for one in usual}
        for label, own in (("a", {"red": 3, "blue": 1}), ("b", {"blue": 4}))
    }
    most = max(number for own in likely.values() for number in own.values())
    for label, own in likely.items():
        shape = points(model, "colour", label)
        assert shape.values == (-1.0, 0.0, 1.0)
        for category, degree in zip(
            variable.categories, shape.degrees[1:], strict=True
        ):
            assert degree == pytest.approx((own[category] / most) ** 0.25, abs=1e-6)


def test_more_than_200_classes_give_rules_unless_a_tree_is_wanted() -> None:
    values, codes = gaussians(201, 2, rows=2)
    assert isinstance(learnt(values, codes).model, RuleBase)
    for wanted in (
        {"form": "tree"},
        {"mode": "paper"},
        {"leaves": 3},
        {"depth": 2},
        {"min_rows": 100},
        {"columns_per_node": 1},
    ):
        assert isinstance(learnt(values, codes, **wanted).model, FuzzyTree), wanted
    few = codes < 200
    assert isinstance(learnt(values[few], codes[few]).model, FuzzyTree)
    assert isinstance(learnt(values[few], codes[few], form="rules").model, RuleBase)


def test_a_column_that_distinguishes_no_class_is_left_out() -> None:
    values, codes = gaussians(250, 2)
    noise = np.random.default_rng(1).normal(size=(len(codes), 8))
    constant = np.full((len(codes), 1), 7.0)
    both = np.hstack([values[:, :1], noise, constant, values[:, 1:]])
    found = learnt(both, codes)
    assert found.model.inputs == ("x1", "x11")
    assert found.report.features_ignored == ("x10",)
    assert (found.report.rules, found.report.sets) == (250, 500)
    assert "250 rules, one for each class" in str(found.report)


def test_a_missing_value_has_no_say() -> None:
    values, codes = gaussians(250, 4)
    rng = np.random.default_rng(1)
    holes = np.where(rng.random(values.shape) < 0.1, np.nan, values)
    model = learnt(holes, codes).model
    rules = ft.run(model, ft.table(holes, columns=model.columns))
    assert set(rules.status.tolist()) == {Status.DECIDED}
    nothing = dict.fromkeys(model.inputs, math.nan)
    strengths = evaluate(model, nothing).strengths  # type: ignore[arg-type]
    assert max(strengths) == pytest.approx(min(strengths), rel=1e-4)
    row = dict(zip(model.inputs, values[0].tolist(), strict=True))
    for column in model.inputs:
        whole = evaluate(model, row).strengths  # type: ignore[arg-type]
        part = evaluate(model, {**row, column: math.nan}).strengths  # type: ignore[arg-type]
        own = evaluate(model, {**nothing, column: row[column]}).strengths  # type: ignore[arg-type]
        shared = [a / b / c for a, b, c in zip(whole, part, own, strict=True)]
        assert max(shared) == pytest.approx(min(shared), rel=1e-3)
    assert share_right(model, values, codes) > share_right(model, holes, codes) > 0.3


def test_categories_alone_are_enough() -> None:
    rng = np.random.default_rng(0)
    usual = rng.integers(0, 6, (250, 6))
    own = np.repeat(usual, 12, axis=0)
    mixed = np.where(rng.random(own.shape) < 0.2, rng.integers(0, 6, own.shape), own)
    table = pd.DataFrame([["pqrstu"[k] for k in row] for row in mixed])
    table.columns = [f"k{k}" for k in range(6)]
    labels = [f"c{k}" for k in np.repeat(np.arange(250), 12)]
    model = ft.learn(table, target=labels)
    assert isinstance(model, RuleBase)
    assert len(model.inputs) == 6
    answers = ft.run(model, table).classes
    assert np.mean([a == b for a, b in zip(answers, labels, strict=True)]) > 0.7
    strange = ft.run(model, table.head(1).assign(k0="v")).classes
    missing = ft.run(model, table.head(1).assign(k0=None)).classes
    assert strange == missing
    assert strange[0] in model.classes


def test_a_class_of_one_row_and_a_wide_column_spoil_nothing() -> None:
    values, codes = gaussians(250, 4)
    wide = np.where(np.arange(len(codes)) % 2, 1e300, -1e300)[:, np.newaxis]
    kept = np.flatnonzero((codes > 0) | (np.arange(len(codes)) == 0))
    found = learnt(np.hstack([wide, values])[kept], codes[kept])
    assert found.model.inputs == ("x2", "x3", "x4", "x5")
    assert found.model.rules[0].support == 1
    rows = np.hstack([wide, values])
    plain = learnt(values, codes).model
    usual = share_right(plain, values[20:], codes[20:])
    assert share_right(found.model, rows[20:], codes[20:]) > usual - 0.01 > 0.4


@pytest.mark.parametrize(
    "column", [np.array([-1e300, 1e300]), np.array([0.0, 1e-310])], ids=str
)
def test_a_table_without_a_column_for_sets_is_refused_in_a_sentence(
    column: FloatArray,
) -> None:
    codes = np.arange(500) % 250
    with pytest.raises(LearningError) as refused:
        learnt(np.resize(column, (500, 1)), codes)
    assert str(refused.value) == (
        "cannot learn a rule for each class: every column is constant, of too wide or "
        "too narrow a range, or has more than 100 categories\n"
        "  pass form='tree' to learn a tree"
    )


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"form": "forest"}, "form is 'tree', 'rules' or None, not 'forest'"),
        (
            {"form": "rules", "depth": 2, "leaves": 3},
            "leaves is a setting of a tree, not of the form 'rules'\n"
            "depth is a setting of a tree, not of the form 'rules'",
        ),
        (
            {"form": "rules", "mode": "paper"},
            "form is a setting of the mode 'default', not of 'paper'",
        ),
    ],
)
def test_a_form_that_cannot_be_is_refused_in_a_sentence(
    settings: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011  # the text is compared
        LearningSettings(**settings)
    assert str(refused.value) == sentence


def test_a_weight_counts_as_equal_rows_and_a_scale_changes_no_degree() -> None:
    values, codes = gaussians(5, 3, rows=6)
    weights = np.random.default_rng(0).integers(1, 4, len(codes))
    heavy = learnt(values, codes, form="rules", weights=weights).model
    repeated = np.repeat(np.arange(len(codes)), weights)
    assert heavy == learnt(values[repeated], codes[repeated], form="rules").model
    assert heavy != learnt(values, codes, form="rules").model
    scaled = learnt(values * 1024, codes, form="rules").model
    for variable, other in zip(
        learnt(values, codes, form="rules").model.variables,
        scaled.variables,
        strict=True,
    ):
        for label in scaled.classes:
            mine, theirs = (
                points(one, variable.name, label)
                for one in (learnt(values, codes, form="rules").model, scaled)
            )
            assert mine.degrees == theirs.degrees
            assert [1024 * x for x in mine.values] == list(theirs.values)
        assert other.high == 1024 * (variable.high or 0.0)


def test_the_classifier_has_rules_in_the_place_of_a_tree() -> None:
    values, codes = gaussians(220, 6)
    model = FuzzyTreeClassifier().fit(values, codes)
    assert isinstance(model.model_, RuleBase)
    assert model.score(values, codes) > 0.8
    chances = model.predict_proba(values)
    assert chances.shape == (len(codes), 220)
    assert (chances > 0).all(axis=1).mean() > 0.99
    assert chances.sum(axis=1) == pytest.approx(1.0)
    predicted = model.predict(values)
    assert (model.classes_[chances.argmax(axis=1)] == predicted).all()
    own = chances[np.arange(len(codes)), codes]
    assert -np.log(np.maximum(own, 1e-6)).mean() < 0.8 < np.log(220)
    for other in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert (other.predict(values) == predicted).all()
    assert not hasattr(model, "tree_")
    with pytest.raises(TypeError, match="importances takes a tree, and tree is a rule"):
        importances(model.model_)  # type: ignore[arg-type]  # it is refused
    with pytest.raises(AttributeError, match=r"^model_ holds rules of 220 classes"):
        model.get_depth()
    tree = FuzzyTreeClassifier(form="tree", leaves=4).fit(values, codes)
    assert tree.tree_ is tree.model_
    assert tree.get_n_leaves() == 4


def test_chunks_give_the_rules_of_one_table() -> None:
    values, codes = gaussians(210, 3, rows=6)
    whole = FuzzyTreeClassifier().fit(values, codes)
    parts = FuzzyTreeClassifier()
    for rows in np.array_split(np.random.default_rng(0).permutation(len(codes)), 3):
        parts.partial_fit(values[rows], codes[rows], classes=np.arange(210))
    assert parts.model_ == whole.model_


def test_the_file_and_the_reference_answer_alike(tmp_path: Path) -> None:
    values, codes = gaussians(220, 3, rows=4)
    model = learnt(values, codes).model
    rows = values[:40]
    found = ft.run(model, rows).classes
    named = (dict(zip(model.inputs, row, strict=True)) for row in rows.tolist())
    assert found == [evaluate(model, row).label for row in named]  # type: ignore[arg-type]
    path = tmp_path / "rules.yaml"
    path.write_bytes(ft.export(model, "yaml").content)
    assert ft.load(path) == model


def test_learn_says_that_rules_were_learnt_why_and_how_to_get_a_tree(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    values, codes = gaussians(210, 6, rows=6)
    table = pd.DataFrame(values, columns=["a", "b", "c", "d", "e", "f"])
    table.assign(y=[f"c{k}" for k in codes]).to_csv("rows.csv", index=False)
    words = ["learn", "rows.csv", "--target", "y", "-o", "rules.yaml"]
    assert main(words) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "learnt 210 rules one for each class, as they are more than 200; "
        "--form tree learns a tree; 6 of 6 columns"
    ) in said
    assert "next: fuzzytree check rules.yaml --data rows.csv" in said
    assert "cross-validated" in said
    assert "choice" not in said
    assert main(["run", "rules.yaml", "rows.csv", "-o", "answers.csv"]) == 0
    assert re.search(r"c0 \d+, .*, 190 more classes\n", capsys.readouterr().err)
    answers = pd.read_csv("answers.csv")["class"].tolist()
    right = [answer == f"c{k}" for answer, k in zip(answers, codes, strict=True)]
    assert np.mean(right) > 0.7
    assert main([*words, "--form", "tree", "--leaves", "3", "--no-test"]) == 0
    assert "3 leaves" in capsys.readouterr().err
    assert main([*words, "--form", "rules", "--leaves", "3"]) == 2
    assert "leaves is a setting of a tree" in capsys.readouterr().err

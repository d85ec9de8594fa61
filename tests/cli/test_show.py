"""`fuzzytree show` draws a tree and prints its rules."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.model.rulebase import LR, Band, Points, Shape, Side, fingerprint
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.report.models import curve_text, model_lines
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree
from tests.cli.conftest import Call, grip

RULES = """\
1. IF force is low THEN soft  4 rows
2. IF force is high AND slip is none THEN loose  1 row
3. IF force is high AND slip is much THEN firm  2 rows

force, in N, 0 to 5
  low   1 up to 2, falls to 0 at 4
  high  1 above 2, rises from 0 at 0
slip
  none  1 up to 0.5, falls to 0 at 1.5
  much  1 above 0.5, rises from 0 at -0.5
"""
TREE = f"""\
grip: fuzzy tree, 2 nodes, 3 leaves, depth 2
inputs   2 of 3 columns: force, slip
classes  3: firm, loose, soft
answers  missing value: no class

force?
├─ low (<= 2): soft  [1]  4 rows
└─ high (> 2): slip?
   ├─ none (<= 0.5): loose  [2]  1 row
   └─ much (> 0.5): firm  [3]  2 rows

{RULES}"""


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def test_a_tree_is_drawn_with_its_rules_and_terms(call: Call) -> None:
    assert call("show", "grip.yaml") == (0, TREE, "")


def test_rules_are_numbered_sentences(call: Call) -> None:
    head = (
        "grip: relative rule base, 3 rules\n"
        "inputs   2 of 3 columns: force, slip\n"
        "classes  3: firm, loose, soft\n"
        "answers  missing value: no class; no rule fires: no class; AND is minimum; "
        "the first of the strongest wins\n\n"
    )
    assert call("show", "rules.yaml") == (0, head + RULES, "")


def test_json_reports_the_same_facts(call: Call) -> None:
    facts = json.loads(call("show", "grip.yaml", "--json")[1])
    assert facts["carrier"] == "tree"
    assert facts["fingerprint"] == fingerprint(grip())
    assert facts["rules"][0] == {
        "number": 1,
        "text": "IF force is low THEN soft",
        "class": "soft",
        "rows": 4,
    }
    assert facts["model"]["nodes"][0]["cuts"] == [2.0]


def test_an_onnx_file_reports_what_it_says_about_itself(call: Call) -> None:
    code, out, _ = call("show", "grip.onnx")
    assert code == 0
    assert out.splitlines()[:5] == [
        "name            grip",
        "representation  tree",
        "kind            descent",
        "dtype           float64",
        f"fingerprint     {fingerprint(grip())}",
    ]
    facts = json.loads(call("show", "grip.onnx", "--json")[1])
    assert facts["carrier"] == "tree"
    assert facts["classes"] == ["firm", "loose", "soft"]


def test_a_tree_of_one_leaf_is_one_line() -> None:
    tree = FuzzyTree("all", ("soft",), (), (), (Leaf("soft", support=3),))
    assert list(model_lines(tree))[4:7] == [
        "",
        "soft  [1]  3 rows",
        "",
    ]


@pytest.mark.parametrize("seed", range(5))
def test_every_leaf_and_rule_of_a_tree_is_shown(seed: int) -> None:
    tree = random_tree(seed, leaves=12)
    shown = "\n".join(model_lines(tree))
    for number in range(1, 13):
        assert f"[{number}]" in shown
        assert f"{number:2}. IF " in shown
    for kind in ("relative", "raw"):
        assert list(model_lines(rules_from_tree(tree, kind)))


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        (Band(), "1 everywhere"),
        (Band(low=-1.0, high=1.0), "1 from -1 to 1, 0 beyond -1, 0 beyond 1"),
        (
            Band(0.0, 1.0, -2.0, 3.0),
            "1 from 0 to 1, rises from 0 at -2, falls to 0 at 3",
        ),
        (
            LR(1.0, Side(2.0, (0.5,)), Side(2.0, (0.5,))),
            "1 at 1, spread 2 (0 from 5 spreads)",
        ),
        (
            LR(1.0, Side(2.0, (0.5,)), Side(3.0, (0.5,), reach=4.0)),
            "1 at 1, spread 2 (0 from 5 spreads) below, 3 (0 from 4 spreads) above",
        ),
        (Points((0.0, 1.5), (0.0, 1.0)), "line through (0, 0), (1.5, 1)"),
        (
            Points(tuple(map(float, range(9))), (0.5,) * 9),
            "9 points from (0, 0.5) to (8, 0.5)",
        ),
    ],
)
def test_a_curve_is_described_in_words(shape: Shape, text: str) -> None:
    assert curve_text(shape) == text


@pytest.mark.parametrize("name", ["grip.svg", "grip.SVG"])
def test_a_picture_of_a_tree_is_written_beside_its_words(call: Call, name: str) -> None:
    code, out, err = call("show", "grip.yaml", "--picture", name)
    assert (code, out, err) == (0, TREE, f"wrote    {name}\n")
    assert Path(name).stat().st_size > 1000


def test_a_picture_of_rules_shows_the_terms_of_each_variable(call: Call) -> None:
    code, _, _ = call("show", "rules.yaml", "--picture", "terms.svg")
    assert code == 0
    drawn = Path("terms.svg").read_text("utf-8")
    rules = ft.load("rules.yaml")
    for variable in rules.variables:
        for term in variable.terms:
            assert f"<title>{term.name}</title>" in drawn


def test_a_picture_of_a_system_shows_its_outputs_too(call: Call) -> None:
    ft.save(random_system(2), "system.yaml")
    code, _, _ = call("show", "system.yaml", "--picture", "terms.svg")
    assert code == 0
    drawn = Path("terms.svg").read_text("utf-8")
    for output in ft.load("system.yaml").outputs:
        assert f">The terms of {output.name}" in drawn


def test_a_picture_of_a_row_or_a_surface_is_that_of_python(call: Call) -> None:
    row = ("--row", "force=3,slip=1")
    code, _, err = call("show", "rules.yaml", "--picture", "row.svg", *row)
    assert (code, err) == (0, "wrote    row.svg\n")
    picture = ft.draw("rules.yaml", row={"force": 3.0, "slip": 1.0})
    assert Path("row.svg").read_text("utf-8") == picture.svg
    system = random_system(2)
    ft.save(system, "system.yaml")
    over = ("--surface", " , ".join(system.inputs[:2]))
    assert call("show", "system.yaml", "--picture", "over.svg", *over)[0] == 0
    picture = ft.draw(system, surface=system.inputs[:2])
    assert Path("over.svg").read_text("utf-8") == picture.svg


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--row force=3", "the row has no value of 'slip'"),
        ("--row force=3,slip=much", "'slip' cannot be 'much'; it is a number"),
        ("--row force", "--row force: must be NAME=VALUE,NAME=VALUE,..."),
        ("--surface force", "a surface needs two different inputs, not 'force'"),
        (
            "--surface force,slop",
            "a surface over 'slop', which is no input; there is force, slip "
            "(did you mean 'slip'?)",
        ),
    ],
)
def test_a_wrong_row_or_surface_is_one_sentence_and_no_file(
    call: Call, words: str, message: str
) -> None:
    code, out, err = call("show", "rules.yaml", "--picture", "no.svg", *words.split())
    assert (code, out) == (2, "")
    assert err.splitlines()[0] == message
    assert not Path("no.svg").exists()


def test_a_row_that_is_not_drawn_is_refused(call: Call) -> None:
    for words in (("--row", "force=3,slip=1"), ("--surface", "force,slip")):
        code, _, err = call("show", "rules.yaml", *words)
        assert code == 2
        assert err.startswith(
            f"{' '.join(words)}: is drawn, and needs --picture FILE\n"
        )


def test_a_graph_has_no_picture(call: Call) -> None:
    code, _, err = call("show", "grip.onnx", "--picture", "no.svg")
    assert code == 2
    assert err.startswith("--picture: grip.onnx contains a graph and no model\n")
    assert not Path("no.svg").exists()


def test_a_picture_of_another_kind_is_refused(call: Call) -> None:
    code, _, err = call("show", "grip.yaml", "--picture", "grip.pdf")
    assert code == 2
    assert "grip.pdf: a picture's name ends in .svg or .png" in err

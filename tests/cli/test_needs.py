"""`fuzzytree needs` reports what a model needs, and writes the simplified model."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.exporters.table import TABLE
from fuzzytree.model.rulebase import Band, Term, Variable
from fuzzytree.runtimes import Outputs
from fuzzytree.semantics.simplification import Pruned, pruned
from fuzzytree.testing import random_tree
from tests.cli.conftest import Call, grip

pytestmark = pytest.mark.usefixtures("few_objects")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def test_a_tree_reports_its_inputs_its_proof_and_its_sizes(call: Call) -> None:
    words = ("needs", "grip.yaml", "--data", "grasps.csv")
    code, out, err = call(*words, "--verbose")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[:3] == [
        "grip: needs 2 of 3 columns; already minimal",
        "model    fuzzy tree, 3 leaves, 4 terms",
        "needs    force, slip",
    ]
    assert lines[3].startswith("grip: none of 3 comparisons disagrees (")
    assert lines[3].endswith(" generated rows, 4 rows of data)")
    assert "pruned                           the model       proof  2" in out
    assert "size                         all columns      as it is" in out
    assert "columns read                 3                2                2" in out


def test_a_pruned_file_is_written_and_checks(call: Call) -> None:
    ft.save(random_tree(4, leaves=5), "tree.yaml")
    code, _, err = call("needs", "tree.yaml", "-o", "left.yaml")
    assert code == 0
    assert err == "wrote    left.yaml next: fuzzytree check tree.yaml left.yaml\n"
    assert ft.load("left.yaml") == pruned(random_tree(4, leaves=5)).model
    code, out, _ = call(
        "check", "tree.yaml", "left.yaml", "--runtime", "native", "--generate", "200",
        "--verbose",
    )  # fmt: skip
    assert code == 0
    (line,) = (one for one in out.splitlines() if "path and relative rules" in one)
    assert line.split()[0] == "left.yaml"
    assert line.split()[-5:] == ["proof", "1", "0", "0", "agrees"]


def test_a_tree_for_its_path_alone_keeps_its_cuts(call: Call) -> None:
    code, out, _ = call("needs", "grip.yaml", "--use", "tree", "-o", "path.yaml")
    assert code == 0
    words = " ".join(out.split())
    assert "the flanks of term 'low' of 'force' only relative rules need them" in words
    found = ft.run("path.yaml", "grasps.csv")
    assert isinstance(found, ft.Predictions)
    assert found.classes == ["soft", "firm", "loose", None]


def test_what_is_dropped_on_request_is_said(call: Call) -> None:
    idle = Variable("heat")
    rules = ft.rules_from_tree(grip())
    wide = type(rules)(
        rules.name, rules.classes, (*rules.variables, idle), rules.rules
    )  # fmt: skip
    ft.save(wide, "wide.yaml")
    code, out, _ = call("needs", "wide.yaml")
    assert code == 0
    assert "guards   heat (no rule or node tests them)" in out
    assert "left in, and could go on request" in out
    code, out, err = call("needs", "wide.yaml", "--drop", "inputs", "-o", "less.yaml")
    assert code == 0
    assert "differs by design" in out
    assert err == "wrote    less.yaml predicts some rows differently from wide.yaml\n"


def test_json_reports_the_same_facts(call: Call) -> None:
    code, out, err = call("needs", "grip.yaml", "--json", "--budget", "0.2")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["ok"] is True
    assert facts["needs"]["inputs"] == ["force", "slip"]
    assert [size["stage"] for size in facts["sizes"]] == [
        "all columns",
        "as it is",
        "pruned",
    ]


def test_a_pruned_model_that_differs_is_not_written(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planted(*_model: object, **_options: object) -> Pruned:
        tree = grip()
        cut = 2.0000000000000004
        low = Term("low", Band(high=cut))
        high = Term("high", Band(low=cut))
        node = tree.nodes[0]
        moved = type(node)(node.variable, (cut,), node.owners, node.branches)
        return Pruned(
            type(tree)(
                tree.name,
                tree.classes,
                (Variable("force", (low, high)), tree.variables[1]),
                (moved, tree.nodes[1]),
                tree.leaves,
                columns=tree.columns,
            ),
            (),
        )

    monkeypatch.setattr("fuzzytree.semantics.pruned", planted)
    code, out, err = call("needs", "grip.yaml", "-o", "left.yaml")
    assert code == 1
    assert "node 1 is another node" in out
    assert err == "the simplified model differs in 3 ways; nothing is written\n"
    assert not Path("left.yaml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("needs", "grip.yaml", "--use", "raw"),
            "uses: tree 'grip' carries no fitted sets, so it has no raw rules\n"
            "  fuzzytree needs --help lists the options\n",
        ),
        (("needs", "no.yaml"), "no.yaml: cannot be read: no such file or directory\n"),
        (
            ("needs", "grip.onnx"),
            "grip.onnx: a file in the format onnx is not read back as a model; "
            "keep the file that it was made of\n",
        ),
        (
            ("needs", "grip.yaml", "--data", "no.csv"),
            "no.csv: cannot be read: no such file or directory\n",
        ),
        (
            ("needs", "grip.yaml", "-o", "left.doc"),
            f"no format '.doc'; there is {', '.join(TABLE)}\n"
            "  fuzzytree needs --help lists the options\n",
        ),
        (
            ("needs", "grip.yaml", "--budget", "0"),
            "invalid value for '--budget': 0.0 is not in the range x>0.0\n"
            "  fuzzytree needs --help lists the options\n",
        ),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    assert call(*words) == (2, "", message)


def test_without_onnx_the_rest_is_reported(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fuzzytree.errors import MissingExtraError

    def missing(*_model: object, **_options: object) -> object:
        raise MissingExtraError("writing onnx needs the extra 'onnx'")

    monkeypatch.setattr("fuzzytree.benchmarking.savings.write_onnx", missing)
    code, out, _ = call("needs", "grip.yaml")
    assert code == 0
    assert "not reported: tree in float64: writing onnx needs the extra 'onnx'" in out
    assert "tree yaml" in out


FAN = """format: fuzzytree/1
kind: system
name: fan
variables:
- {name: heat, range: {from: 0, to: 10}, terms: [{name: low, points: [[2, 1], [6, 0]]},
   {name: faint, points: [[2, 1], [6, 0]]}, {name: high, points: [[3, 0], [8, 1]]}]}
- {name: damp, range: {from: 0, to: 10}, terms: [{name: wet, points: [[3, 0], [9, 1]]}]}
outputs:
- {name: power, range: {from: 0, to: 30}, terms: [{name: small, triangle: [0, 5, 15]},
   {name: large, triangle: [10, 25, 30]}, {name: huge, triangle: [20, 25, 30]}],
   defuzzifier: centroid, samples: 100, grid: middle, aggregation: maximum}
blocks:
- {and: minimum, or: maximum, implication: minimum, activation: {method: general},
   rules: [{if: [heat is faint], then: power is small},
   {if: [damp is wet], then: power is huge, weight: 0},
   {if: [heat is high or heat is low], then: power is large}]}
semantics: {not: 1 - degree, activated: rules whose weighted degree is above 0,
  missing: a value that is missing or infinite makes every output nan}
"""


def test_a_fuzzy_system_is_pruned_and_checks(call: Call) -> None:
    Path("fan.yaml").write_text(FAN, encoding="utf-8")
    code, out, err = call("needs", "fan.yaml", "-o", "left.yaml")
    assert (code, err) == (
        0,
        "wrote    left.yaml next: fuzzytree check fan.yaml left.yaml\n",
    )
    lines = out.splitlines()
    assert lines[:3] == [
        "fan: needs 2 inputs; 1 part can be left out",
        "model    fuzzy system, 3 rules, 7 terms, 1 output",
        "needs    heat, damp",
    ]
    assert lines[4].startswith("term 'faint' of 'heat'  its curve is that of 'low'")
    assert "rule 2                            its weight is 0" in out
    words = ("check", "fan.yaml", "left.yaml", "--generate", "200", "--verbose")
    code, out, _ = call(*words)
    assert code == 0
    assert "the model's rules" in out
    rows = "heat,damp\n1,2\n4,9\n,1\n5.5,\n"
    Path("rows.csv").write_text(rows, encoding="utf-8")
    one, two = (ft.run(name, "rows.csv") for name in ("fan.yaml", "left.yaml"))
    assert isinstance(one, Outputs)
    assert isinstance(two, Outputs)
    assert one.values.tobytes() == two.values.tobytes()
    assert one.status.tolist() == two.status.tolist()


def test_a_system_drops_rules_of_weight_0_and_their_inputs(call: Call) -> None:
    Path("fan.yaml").write_text(FAN, encoding="utf-8")
    words = "needs fan.yaml --drop rules --drop inputs -o less.yaml --json"
    code, out, err = call(*words.split())
    assert code == 0
    assert err.startswith("wrote    less.yaml predicts some rows differently")
    facts = json.loads(out)
    assert (facts["ok"], facts["rules"]) == (True, [1, 3])
    assert [one["where"] for one in facts["removed"] if one["changes"]] == [
        "rule 2",
        "input 'damp'",
    ]
    formats = [file["format"] for file in facts["sizes"][1]["files"]]
    assert formats == ["yaml", "python", "c", "onnx"]
    assert ft.load("less.yaml").inputs == ("heat",)

"""`fuzzytree export` writes other formats and says what it did."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.exporters import TABLE, yaml
from fuzzytree.model.contracts import Model, Written
from fuzzytree.model.rulebase import Band, RuleBase, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.testing import random_tree
from tests.cli.conftest import Call, grip

HELP = "\n  fuzzytree export --help lists the options\n"

FOR_OPENVINO = (
    "OpenVINO has no TreeEnsemble and computes in float32: write for it with "
    "plain=true and dtype=float32"
)


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def test_size_and_hash_of_the_file_are_reported(call: Call) -> None:
    code, out, err = call("export", "grip.yaml", "-o", "new.onnx")
    content = Path("new.onnx").read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    assert (code, out) == (0, "")
    assert err == (
        f"wrote    new.onnx onnx, {len(content)} bytes, sha256 {digest}\n"
        "bound    float64  the class cannot change: "
        "no value is rounded before it meets a cut\n"
        f"remark   {FOR_OPENVINO}\n"
        "next     fuzzytree check grip.yaml new.onnx\n"
    )


def test_json_reports_the_same_facts(call: Call) -> None:
    code, out, err = call("export", "grip.yaml", "-o", "new.onnx", "--json", "--quiet")
    content = Path("new.onnx").read_bytes()
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts.pop("read")["file"] == "grip.yaml"
    assert facts == {
        "file": "new.onnx",
        "format": "onnx",
        "carrier": "tree",
        "bytes": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
        "losses": [],
        "remarks": [FOR_OPENVINO],
        "names": {},
        "proof": {
            "verdict": "certified",
            "sentence": (
                "the class cannot change: no value is rounded before it meets a cut"
            ),
        },
        "coverage": None,
        "next": "fuzzytree check grip.yaml new.onnx",
        "certificate": {
            "sentence": (
                "the class cannot change: no value is rounded before it meets a cut"
            ),
            "dtype": "float64",
            "carrier": "tree",
            "delta": None,
            "origin": "largest derived error of a value in float64, "
            "for values in the declared ranges",
            "terms": [],
            "values": [],
            "reasons": [],
            "rows": None,
            "unbounded": 0,
        },
    }


def test_the_certificate_is_that_of_the_number_type_that_was_written(
    call: Call,
) -> None:
    words = ("export", "grip.yaml", "-o", "new.onnx", "--as", "rules")
    _, _, double = call(*words)
    _, _, single = call(*words, "--dtype", "float32")
    text = "the class cannot change unless the two strongest classes differ by"
    assert f"bound    float64  {text} 6.7e-16 or less\n" in double
    assert f"bound    float32  {text} 1.1e-06 or less\n" in single


def test_a_tree_is_written_as_a_net_that_check_accepts(call: Call) -> None:
    assert call("export", "grip.yaml", "-o", "net.onnx", "--net")[0] == 0
    code, out, _ = call("check", "grip.yaml", "net.onnx", "--runtime", "native")
    assert code == 0
    assert "net.onnx holds: tree, float64" in out


def test_what_is_no_net_is_refused_in_one_sentence(call: Call) -> None:
    words = ("export", "grip.yaml", "-o", "net.onnx", "--as", "rules", "--net")
    only = "net: only a tree is written as a net, not a model of kind 'rules'"
    assert call(*words) == (2, "", only + HELP)
    ft.save(random_tree(0, leaves=70), "large.yaml")
    code, out, err = call("export", "large.yaml", "-o", "net.onnx", "--net")
    assert (code, out) == (2, "")
    assert "as a net: it has 70 leaves, and" in err
    assert "--plain" in err
    assert not Path("net.onnx").exists()


@pytest.mark.parametrize("representation", ["tree", "rules"])
def test_a_file_that_holds_the_model_changes_nothing(
    call: Call, representation: str
) -> None:
    words = ("export", "grip.yaml", "-o", "new.yaml", "--as", representation, "--json")
    code, out, err = call(*words)
    sentence = "the class cannot change: every number is written in full, error 0"
    assert code == 0
    what = "tree" if representation == "tree" else "rule base"
    proof = f"read back from the file, the {what} is equal in every number"
    assert err.splitlines()[1] == f"proved   equal    {proof}"
    assert json.loads(out)["certificate"] == {
        "sentence": sentence,
        "dtype": None,
        "carrier": representation,
        "delta": 0.0,
        "origin": proof,
        "terms": [],
        "values": [],
        "reasons": [],
        "rows": None,
        "unbounded": 0,
    }


def test_a_file_that_is_read_back_as_another_model_is_not_written(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planted(_: Model, /, *, allow_loss: bool = False) -> Written:
        return yaml.write(replace(grip(), name="grasp"), allow_loss=allow_loss)

    monkeypatch.setattr(yaml, "FORMAT", replace(yaml.FORMAT, write=planted))
    message = "grip as yaml is read back as another model; nothing is written\n"
    assert call("export", "grip.yaml", "-o", "new.yaml") == (2, "", message)
    assert not Path("new.yaml").exists()


@pytest.mark.parametrize(
    ("words", "kind", "conjunction"),
    [
        (("--as", "rules"), "relative", "minimum"),
        (("--terms", "relative"), "relative", "minimum"),
        (("--conjunction", "product"), "relative", "product"),
    ],
)
def test_rules_are_made_of_a_tree(
    call: Call, words: tuple[str, ...], kind: str, conjunction: str
) -> None:
    assert call("export", "grip.yaml", "-o", "new.yaml", *words)[0] == 0
    rules = ft.load("new.yaml")
    assert isinstance(rules, RuleBase)
    assert (rules.kind, rules.semantics.conjunction) == (kind, conjunction)


def test_a_tree_stays_a_tree_unless_an_option_says_otherwise(call: Call) -> None:
    assert call("export", "grip.yaml", "-o", "new.yaml", "--as", "tree")[0] == 0
    assert ft.load("new.yaml") == grip()


def test_raw_rules_of_a_tree_without_sets_are_refused(call: Call) -> None:
    assert call("export", "grip.yaml", "-o", "new.yaml", "--terms", "raw") == (
        2,
        "",
        "tree 'grip' carries no fitted sets, so it has no raw rules\n",
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("rules.yaml", "-o", "x.yaml", "--as", "tree"),
            "--as tree: grip is a rule base, and no tree can be made of it",
        ),
        (
            ("rules.yaml", "-o", "x.yaml", "--terms", "raw"),
            "--terms raw: grip is a rule base with relative; "
            "other rules are made from the tree",
        ),
        (
            ("grip.yaml", "-o", "x.yaml", "--as", "tree", "--terms", "raw"),
            "--terms and --conjunction are for --as rules",
        ),
        (
            ("grip.yaml", "-o", "x.turtle"),
            f"no format '.turtle'; there is {', '.join(TABLE)}; "
            "name one of them with --to",
        ),
        (
            ("grip.yaml", "-o", "x.yaml", "--to", "turtle"),
            f"no format 'turtle'; there is {', '.join(TABLE)}",
        ),
        (
            ("grip.yaml", "-o", "x.onnx", "--opset", "3"),
            "opset: onnx files are written for 12 to 26, not 3",
        ),
        (
            ("grip.yaml", "-o", "x.onnx", "--outputs", "label,colour"),
            "outputs: there is label, rule, strengths, status, probabilities, not "
            "'colour'",
        ),
        (
            ("grip.yaml", "-o", "x.yaml", "--dtype", "float32"),
            "yaml has no option 'dtype'; it has none",
        ),
    ],
)
def test_what_cannot_be_had_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    assert call("export", *words) == (2, "", message + HELP)
    assert not list(Path.cwd().glob("x.*"))


def test_the_onnx_options_reach_the_file(call: Call) -> None:
    words = ("--dtype", "mixed", "--signature", "all", "--outputs", "label,rule,status")
    code, _, _ = call(
        "export", "grip.yaml", "-o", "x.onnx", "--as", "rules", "--readable", *words
    )
    facts = json.loads(call("show", "x.onnx", "--json")[1])
    assert code == 0
    assert facts["dtype"] == "mixed"
    assert facts["columns"] == ["slip", "force", "weight"]
    assert facts["outputs"] == ["label", "rule", "status"]


def test_a_file_can_go_to_stdout(call: Call) -> None:
    code, out, err = call("export", "grip.yaml", "-o", "-", "--to", "yaml")
    assert (code, err.split()[:2]) == (0, ["wrote", "-"])
    assert out.encode() == ft.export(grip(), "yaml").content


def test_a_loss_is_refused_and_the_option_is_named(call: Call) -> None:
    ft.save(_narrow(), "narrow.yaml")
    words = ("export", "narrow.yaml", "-o", "x.onnx", "--dtype", "float32")
    code, out, err = call(*words)
    assert (code, out) == (1, "")
    assert err.startswith("cannot write narrow as onnx float32: ")
    assert err.endswith(
        "pass --allow-loss to write it as stated, or choose dtype 'float64'\n"
    )
    assert not Path("x.onnx").exists()


def test_a_loss_that_is_allowed_is_reported(call: Call) -> None:
    ft.save(_narrow(), "narrow.yaml")
    words = ("export", "narrow.yaml", "-o", "x.onnx", "--dtype", "float32")
    code, out, err = call(*words, "--allow-loss", "--json")
    assert code == 0
    assert "\nlost     " in err
    assert json.loads(out)["losses"]


def _narrow() -> FuzzyTree:
    """Return a tree with two cuts that are one in float32."""
    low, high = 2.0, 2.0 + 1e-12
    terms = (
        Term("low", Band(high=low)),
        Term("medium", Band(low, high)),
        Term("high", Band(low=high)),
    )
    ends = tuple(Branch((term.name,), leaf=k) for k, term in enumerate(terms, 1))
    return FuzzyTree(
        "narrow",
        ("a", "b"),
        (Variable("x", terms),),
        (Node("x", (low, high), (0, 1, 2), ends),),
        (Leaf("a"), Leaf("b"), Leaf("a")),
    )


def test_a_write_protected_place_keeps_the_old_file(call: Call) -> None:
    code, _, err = call("export", "grip.yaml", "-o", "/proc/new.yaml")
    assert code == 2
    assert err.startswith("/proc/new.yaml: cannot be written: ")


def test_a_full_disk_is_one_sentence(call: Call) -> None:
    code, _, err = call("export", "grip.yaml", "-o", "/dev/full", "--to", "yaml")
    assert code == 2
    assert err == "/dev/full: cannot be written: no space left on device\n"

"""What an ONNX file says, refuses and loses; its answers: `tests/runtimes`.

`python tests/exporters/test_onnx.py` rewrites the golden files; review the difference.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest

from fuzzytree.errors import DisagreementError, LossError, MissingExtraError
from fuzzytree.exporters import find_format, onnx_ends
from fuzzytree.exporters.onnx import FORMAT, IRS, OPSETS, Output, write_onnx
from fuzzytree.exporters.onnx_compare import differences
from fuzzytree.exporters.onnx_graph import OnnxGraph
from fuzzytree.model.contracts import Document, Dtype, Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Side,
    Term,
    Variable,
    fingerprint,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.numerics.narrowing import rounded
from fuzzytree.runtimes import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.reference import evaluate
from fuzzytree.testing import random_system, random_tree

GOLDEN = Path(__file__).parents[1] / "golden" / "onnx"
EVERY: tuple[Output, ...] = ("label", "rule", "status", "strengths")


def grip_tree() -> FuzzyTree:
    """Return two nodes: one on an input, one on a combination."""
    soft = Band(high=1.0, right=3.0)
    firm = Band(low=1.0, left=-1.0)
    thin = Band(high=0.0, right=0.5)
    thick = Band(low=0.0, left=-0.5)
    force = Variable("force", (Term("soft", soft), Term("firm", firm)), unit="N")
    width = Variable("width", unit="mm")
    parts = (Part("force", 0.5), Part("width", -0.25, 3.0))
    bulk = Variable("bulk", (Term("thin", thin), Term("thick", thick)), parts=parts)
    nodes = (
        Node("force", (1.0,), (0, 1), (Branch(("soft",), leaf=1), _on(2))),
        Node(
            "bulk",
            (0.0,),
            (0, 1),
            (Branch(("thin",), leaf=2), Branch(("thick",), leaf=3)),
        ),
    )
    leaves = (Leaf("cup"), Leaf("pen"), Leaf("cup"))
    return FuzzyTree(
        "grip",
        ("cup", "pen"),
        (force, width, bulk),
        nodes,
        leaves,
        columns=("id", "force", "width"),
    )


def _on(node: int) -> Branch:
    return Branch(("firm",), node=node)


def lr_rules() -> RuleBase:
    """Return rules with LR sets, OR, NOT, a product and both answers."""
    even = Side(2.0, (0.4,))
    low = LR(10.0, even, even)
    high = LR(20.0, Side(2.0, (0.4, 0.1)), Side(3.0, (0.5,), 4.0))
    slip = Variable("slip", (Term("low", low), Term("high", high)))
    rules = (
        Rule((Proposition("slip", ("low", "high")),), "hold"),
        Rule(
            (Proposition("slip", ("high",)), Proposition("slip", ("low",), ("not",))),
            "drop",
        ),
    )
    semantics = Semantics("product", uncovered="hold", missing="drop")
    return RuleBase("slips", ("hold", "drop"), (slip,), rules, semantics)


def golden_models() -> dict[str, bytes]:
    tree = grip_tree()
    rules = rules_from_tree(tree)
    return {
        "tree": write_onnx(tree, signature="all").content,
        "rules": write_onnx(rules, dtype="mixed", outputs=EVERY).content,
        "readable": write_onnx(lr_rules(), readable=True, outputs=EVERY).content,
    }


def golden_text(content: bytes) -> str:
    proto = onnx.load_from_string(content)
    proto.producer_version = "any"
    for entry in proto.metadata_props:
        if entry.key in ("fuzzytree.version", "fuzzytree.fingerprint"):
            entry.value = "any"
    return onnx.printer.to_text(proto) + "\n"


def test_a_readable_graph_bears_the_names_of_propositions_and_rules() -> None:
    for dtype in ("float64", "mixed", "float32"):
        content = write_onnx(
            lr_rules(), readable=True, dtype=dtype, opset=12, ir=7, allow_loss=True
        ).content
        names = {one.name for one in onnx.load_model_from_string(content).graph.node}
        assert {"slip", "slip_is_low", "rule_1_strength", "winner_where"} <= names


@pytest.mark.parametrize("case", ["tree", "rules", "readable"])
def test_the_text_form_of_a_small_model_is_the_golden_one(case: str) -> None:
    text = golden_text(golden_models()[case])
    assert text == (GOLDEN / f"{case}.onnxtxt").read_text(encoding="utf-8")


@pytest.mark.heavy
def test_equal_models_give_equal_bytes_in_another_process() -> None:
    code = (
        "import hashlib; from fuzzytree.testing import random_tree; "
        "from fuzzytree.semantics.lowering import rules_from_tree; "
        "from fuzzytree.exporters import write_onnx; "
        "tree = random_tree(5, leaves=12); "
        "made = [write_onnx(m, readable=r).content for m, r in "
        "((tree, False), (rules_from_tree(tree, 'raw'), True))]; "
        "print(hashlib.sha256(b''.join(made)).hexdigest())"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": str(Path.cwd())},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1
    assert write_onnx(grip_tree()).content == write_onnx(grip_tree()).content


def test_the_metadata_says_what_the_file_is() -> None:
    tree = grip_tree()
    proto = onnx.load_from_string(write_onnx(tree, signature="all").content)
    facts = {entry.key: entry.value for entry in proto.metadata_props}
    version = facts.pop("fuzzytree.version")
    assert proto.producer_version == version
    assert facts == {
        "fuzzytree.format": "1",
        "fuzzytree.name": "grip",
        "fuzzytree.carrier": "tree",
        "fuzzytree.kind": "descent",
        "fuzzytree.dtype": "float64",
        "fuzzytree.fingerprint": fingerprint(tree),
        "fuzzytree.columns": '["id", "force", "width"]',
        "fuzzytree.inputs": '["force", "width"]',
        "fuzzytree.units": '["", "N", "mm"]',
        "fuzzytree.classes": '["cup", "pen"]',
        "fuzzytree.rules": "3",
        "fuzzytree.outputs": '["label", "rule"]',
        "fuzzytree.semantics": '{"conjunction": "minimum", "uncovered": null, '
        '"missing": null}',
    }
    assert proto.doc_string == (
        "The fuzzy decision tree 'grip' with 3 leaves: one path is followed, a value "
        "equal to a cut goes to the left. Missing and infinite values give no class. "
        "Numbers: float64."
    )


def test_class_names_of_any_script_come_back() -> None:
    names = ("no", "1e-05", 'a"b', "élan ☂", "a\xa0b", "日本語", "🙂")
    rules = tuple(
        Rule((Proposition("x", (f"at {k}",)),), name) for k, name in enumerate(names)
    )
    side = Side(0.5, (0.2,), 1.5)
    terms = tuple(Term(f"at {k}", LR(k, side, side)) for k in range(len(names)))
    model = RuleBase("scripts", names, (Variable("x", terms),), rules)
    made = write_onnx(model).content
    found = _answers(made, np.arange(len(names), dtype=float).reshape(-1, 1))
    assert found["label"].tolist() == list(names)
    facts = {e.key: e.value for e in onnx.load_from_string(made).metadata_props}
    assert tuple(json.loads(facts["fuzzytree.classes"])) == names


def _answers(
    content: bytes, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.generic]]]:
    session = onnxruntime.InferenceSession(content)
    names = [output.name for output in session.get_outputs()]
    found = session.run(names, {"inputs": values})
    return dict(zip(names, found, strict=True))


def test_outputs_stand_in_the_requested_order() -> None:
    rules = lr_rules()
    values = np.array([[10.0], [22.0], [1e3], [np.nan]])
    outputs: tuple[Output, ...] = ("strengths", "status", "rule", "label")
    found = _answers(write_onnx(rules, outputs=outputs).content, values)
    assert list(found) == list(outputs)
    answers = [evaluate(rules, {"slip": row[0]}) for row in values]
    assert found["strengths"].shape == (4, 2)
    expected = np.array([answer.strengths for answer in answers])
    assert np.array_equal(found["strengths"], expected, equal_nan=True)
    assert found["status"].tolist() == [int(answer.status) for answer in answers]
    assert found["status"].tolist()[2:] == [2, 3]
    assert found["rule"].tolist() == [1, answers[1].rule, 0, 0]
    assert found["label"].tolist()[2:] == ["hold", "drop"]


def test_other_columns_of_a_full_signature_are_ignored() -> None:
    tree = grip_tree()
    for model in (tree, rules_from_tree(tree)):
        content = write_onnx(model, signature="all").content
        values = np.array([[np.nan, 0.0, 0.0], [np.inf, 2.0, 1.0], [1.0, 2.0, np.nan]])
        assert _answers(content, values)["rule"].tolist() == [1, 3, 0]


@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_a_readable_tree_answers_as_the_tree_at_every_edge(dtype: Dtype) -> None:
    outputs: tuple[Output, ...] = ("label", "rule", "status")
    for seed in range(6):
        tree = random_tree(seed, leaves=9, combinations=0.5)
        values = np.array([[*row.values()] for row in probes(tree, limit=300)])
        if dtype == "float32":
            with np.errstate(over="ignore"):  # beyond float32 is missing in float32
                values = values.astype(np.float32)
        usual, readable = (
            write_onnx(
                tree, dtype=dtype, outputs=outputs, allow_loss=True, readable=form
            ).content
            for form in (False, True)
        )
        names = [node.name for node in onnx.load_from_string(readable).graph.node]
        assert "node_1_below_less" in names
        right = _answers(usual, values)
        for name, array in _answers(readable, values).items():
            np.testing.assert_array_equal(array, right[name])
        assert not any(differences(readable, tree))


@pytest.mark.parametrize("width", [0, 1, 4])
def test_a_model_without_inputs_answers_rows_of_any_width(width: int) -> None:
    tree = FuzzyTree("one", ("a",), (), (), (Leaf("a"),))
    for model in (tree, rules_from_tree(tree)):
        found = _answers(write_onnx(model).content, np.full((3, width), np.nan))
        assert found["label"].tolist() == ["a", "a", "a"]


@pytest.mark.parametrize(
    ("model", "options"),
    [
        (grip_tree(), {}),
        (grip_tree(), {"plain": True}),
        (grip_tree(), {"net": True}),
        (grip_tree(), {"readable": True}),
        (rules_from_tree(grip_tree()), {}),
        (rules_from_tree(grip_tree()), {"readable": True}),
        (random_system(3, formulas="none"), {"outputs": ("outputs", "status")}),
    ],
    ids=["tree", "plain", "net", "readable tree", "rules", "readable rules", "system"],
)
def test_the_columns_of_the_callers_rows_can_be_any(
    model: Document, options: dict[str, Any]
) -> None:
    columns = ("row id", *reversed(model.inputs), "note")
    content = write_onnx(model, columns=columns, **options).content
    values = np.random.default_rng(0).random((50, len(model.inputs)))
    table = np.full((50, len(columns)), np.nan)
    table[:, 1:-1] = values[:, ::-1]
    right = _answers(write_onnx(model, **options).content, values)
    for name, array in _answers(content, table).items():
        np.testing.assert_array_equal(array, right[name])
    assert not any(differences(content, model))


@pytest.mark.parametrize("opset", [OPSETS[0], 13, 17, 18, 21, OPSETS[-1]])
@pytest.mark.parametrize("ir", [IRS[0], 8, IRS[-1]])
def test_every_supported_opset_and_ir_runs(opset: int, ir: int) -> None:
    tree = random_tree(3, leaves=9, inputs=3)
    models: tuple[Model, ...] = (tree, rules_from_tree(tree, "raw"), lr_rules())
    for model in models:
        outputs = EVERY[:3] if isinstance(model, FuzzyTree) else EVERY
        proto = onnx.load_from_string(
            write_onnx(model, opset=opset, ir=ir, outputs=outputs).content
        )
        assert proto.ir_version == ir
        assert proto.opset_import[0].version == opset
        onnx.checker.check_model(proto, full_check=True)


def test_a_plain_tree_and_rules_need_no_other_operators() -> None:
    tree = random_tree(3, leaves=9)
    for content in (
        write_onnx(tree, plain=True).content,
        write_onnx(rules_from_tree(tree)).content,
    ):
        proto = onnx.load_from_string(content)
        assert [entry.domain for entry in proto.opset_import] == [""]


def test_a_tree_that_would_unfold_too_far_becomes_plain() -> None:
    tree = _ladder(24)
    proto = onnx.load_from_string(write_onnx(tree).content)
    assert [entry.domain for entry in proto.opset_import] == [""]


def _ladder(depth: int) -> FuzzyTree:
    """Return a tree in which two of three intervals lead on: 2**depth paths."""
    nodes: list[Node] = []
    terms: list[Term] = []
    for number in range(1, depth + 1):
        low, high = float(number), number + 0.5
        names = [f"{number} below", f"{number} within", f"{number} above"]
        terms.append(Term(names[0], Band(high=low)))
        terms.append(Term(names[1], Band(low, high)))
        terms.append(Term(names[2], Band(low=high)))
        on = number + 1 if number < depth else None
        last = 1 if number == depth else None
        outer = Branch((names[0], names[2]), node=on, leaf=last)
        inner = Branch((names[1],), leaf=depth - number + 2)
        nodes.append(Node("x", (low, high), (0, 1, 0), (outer, inner)))
    leaves = tuple(Leaf("ab"[k % 2]) for k in range(depth + 1))
    variables = (Variable("x", tuple(terms)),)
    return FuzzyTree("ladder", ("a", "b"), variables, tuple(nodes), leaves)


def test_a_model_takes_only_the_operators_that_it_needs() -> None:
    def operators(model: Model) -> set[str]:
        proto = onnx.load_from_string(write_onnx(model, outputs=("rule",)).content)
        return {node.op_type for node in proto.graph.node}

    low = Term("low", Band(high=1.0, right=2.0))
    high = Term("high", Band(low=1.0))
    propositions = (Proposition("x", ("low",)), Proposition("x", ("high",)))
    rules = tuple(Rule((proposition,), "a") for proposition in propositions)
    model = RuleBase("r", ("a",), (Variable("x", (low, high)),), rules)
    assert operators(model).isdisjoint({"Max", "Add", "Abs", "Cast", "Slice", "Min"})
    symmetric = operators(lr_rules())
    assert {"Abs", "Max", "Mul"} <= symmetric


def refused(model: Model, **options: object) -> str:
    with pytest.raises(ValueError, match=r".") as caught:
        write_onnx(model, **options)  # type: ignore[arg-type] # wrong on purpose
    return str(caught.value)


def test_wrong_options_are_refused_by_name() -> None:
    tree = grip_tree()
    rules = lr_rules()
    assert refused(tree, dtype="float16") == (
        "dtype: there is float64, mixed, float32, not 'float16'"
    )
    assert refused(tree, signature="some") == (
        "signature: there is needed, all, not 'some'"
    )
    assert refused(rules, outputs=("label", "score")) == (
        "outputs: there is label, rule, strengths, status, probabilities, not 'score'"
    )
    assert refused(rules, outputs=()) == (
        "outputs: name each once, at least one, not ()"
    )
    assert refused(tree, outputs=("strengths",)) == (
        "outputs: a tree has no strengths; write its rules to have them"
    )
    assert refused(tree, opset=11) == (
        "opset: onnx files are written for 12 to 26, not 11"
    )
    assert refused(tree, ir=14) == "ir: onnx files are written for 4 to 13, not 14"
    assert write_onnx(rules, plain=True).content == write_onnx(rules).content
    assert refused(rules, columns=("a", "b", "a")) == (
        "columns: name each once, not ('a', 'b', 'a'); the model also needs "
        + ", ".join(map(repr, rules.inputs))
    )
    assert refused(rules, signature="all") == (
        "'slips' does not know the columns of its training table, "
        "so its signature can only be 'needed'"
    )


def far_rules() -> RuleBase:
    """Return rules of which float32 can hold nothing."""
    far = Band(1e300, 1.1e300, 0.9e300)
    near = Band(1.0, 1.0 + 1e-12, 1.0 - 1e-12)
    tiny = Side(1e-60, (0.5,))
    terms = (Term("far", far), Term("near", near), Term("tiny", LR(0.0, tiny, tiny)))
    variables = (
        Variable("x"),
        Variable("z", terms, parts=(Part("x", 1e-50, 1e39),)),
    )
    rules = tuple(Rule((Proposition("z", (term.name,)),), "a") for term in terms)
    return RuleBase("far", ("a",), variables, rules)


def test_a_stand_in_that_float32_cannot_hold_is_refused_or_its_end() -> None:
    cut = 3.4e38
    terms = (Term("low", Band(high=cut)), Term("high", Band(low=cut)))
    force = Variable("force", terms, missing=6.8e38)
    ends = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    node = Node("force", (cut,), (0, 1), ends)
    leaves = (Leaf("soft"), Leaf("firm"))
    tree = FuzzyTree("far", ("soft", "firm"), (force,), (node,), leaves)
    with pytest.raises(LossError, match=r"'force': stand-in .* lies beyond float32"):
        write_onnx(tree, dtype="float32")
    rows = np.array([[np.nan, np.inf, 1.0]])
    for name in ("native", "onnxruntime"):
        with pytest.raises(LossError, match="beyond float32"):
            find_runtime(f"{name} float32").load(tree)
    run = find_runtime("native").load(tree)
    assert run(rows).rule.tolist() == [2, 2, 1]


def test_numbers_that_float32_cannot_hold_are_listed_and_refused() -> None:
    with pytest.raises(LossError) as caught:
        write_onnx(far_rules(), dtype="float32")
    assert str(caught.value) == (
        "cannot write far as onnx float32: part 'x' of 'z': "
        "centre 1e+39 lies beyond float32; 3.4028234663852886e+38 stands\n"
        "  part 'x' of 'z': weight 1e-50 becomes 0 in float32\n"
        "  term 'far' of 'z': low 1e+300 lies beyond float32; "
        "3.4028234663852886e+38 stands\n"
        "  term 'far' of 'z': high 1.1e+300 lies beyond float32; "
        "3.4028234663852886e+38 stands\n"
        "  term 'far' of 'z': ends 1e+300 and 1.1e+300 become one number in float32\n"
        "  term 'far' of 'z': left flank's end 9e+299 lies beyond float32; "
        "3.4028234663852886e+38 stands\n"
        "  term 'far' of 'z': left flank's width 1e+299 lies beyond float32; "
        "3.4028234663852886e+38 stands\n"
        "  term 'near' of 'z': ends 1.0 and 1.000000000001 become one number in "
        "float32\n"
        "  term 'tiny' of 'z': left spread 1e-60 becomes 0 in float32\n"
        "  term 'tiny' of 'z': right spread 1e-60 becomes 0 in float32\n"
        "  pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )


def test_allowed_losses_stand_beside_a_file_without_nan() -> None:
    made = write_onnx(far_rules(), dtype="float32", allow_loss=True, outputs=EVERY)
    assert len(made.losses) == 10
    session = onnxruntime.InferenceSession(made.content)
    values = np.array([[0.0], [1.0], [-1.0], [3e38], [1e-45]], np.float32)
    (strengths,) = session.run(["strengths"], {"inputs": values})
    assert not np.isnan(strengths).any()


def test_cuts_that_float32_merges_are_a_loss_of_a_tree() -> None:
    cuts = (1.0, 1.0 + 1e-12)
    names = ("low", "mid", "high")
    bands = (Band(high=cuts[0]), Band(*cuts), Band(low=cuts[1]))
    terms = tuple(Term(n, band) for n, band in zip(names, bands, strict=True))
    branches = tuple(Branch((name,), leaf=k) for k, name in enumerate(names, 1))
    tree = FuzzyTree(
        "close",
        ("a",),
        (Variable("x", terms),),
        (Node("x", cuts, (0, 1, 2), branches),),
        (Leaf("a"), Leaf("a"), Leaf("a")),
    )
    with pytest.raises(LossError) as caught:
        write_onnx(tree, dtype="float32")
    assert str(caught.value) == (
        "cannot write close as onnx float32: node 1: cuts 1.0 and 1.000000000001 "
        "become one number in float32\n"
        "  pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )
    assert write_onnx(tree, dtype="mixed").losses == ()
    assert len(write_onnx(tree, dtype="float32", allow_loss=True).losses) == 1


def test_thresholds_are_rounded_to_the_nearest_float32() -> None:
    assert rounded([0.1], np.float32).tolist() == [float(np.float32(0.1))]
    assert rounded([1e-60, -1e-60], np.float32, is_divisor=True).tolist() == [
        1.401298464324817e-45,
        -1.401298464324817e-45,
    ]


def test_a_file_with_another_answer_is_not_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def wrong(sheet: OnnxGraph, strengths: str, named: str = "rule") -> str:
        return sheet.node("ArgMin", strengths, axis=0, keepdims=0, named=named)

    monkeypatch.setattr(onnx_ends, "add_winner", wrong)
    with pytest.raises(DisagreementError) as caught:
        write_onnx(lr_rules())
    assert str(caught.value) == (
        "the onnx file of slips returns another rule than the model "
        "where {'slip': 10.0}: 0, not 1"
    )


@pytest.mark.parametrize(
    ("absent", "text"),
    [
        ("onnx", "writing onnx needs"),
        ("onnxruntime", "verifying a written onnx file needs"),
    ],
)
def test_a_missing_package_is_named_with_what_installs_it(
    monkeypatch: pytest.MonkeyPatch, absent: str, text: str
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == absent else find(name)
    )
    with pytest.raises(MissingExtraError) as caught:
        write_onnx(grip_tree())
    hint = "onnx and onnxruntime: pip install 'onnx>=1.16' 'onnxruntime>=1.18'"
    assert str(caught.value) == f"{text} {hint}"
    if absent == "onnxruntime":
        assert write_onnx(grip_tree(), verify=False).losses == ()


def test_the_tables_of_formats_and_runtimes_need_no_onnx() -> None:
    code = (
        "import sys; from fuzzytree.exporters.onnx import FORMAT; "
        "from fuzzytree.runtimes.onnxruntime import RUNTIMES; "
        "print([m for m in ('onnx', 'onnxruntime') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(Path.cwd())},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "[]\n"
    assert find_format(".onnx") is FORMAT


@pytest.mark.one_in(3)
@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_a_thousand_rules_stay_small_and_quick_to_write(dtype: Dtype) -> None:
    rules = rules_from_tree(random_tree(3, leaves=1000, inputs=11, combinations=0.0))
    made = write_onnx(rules, dtype=dtype)
    assert len(made.content) < 250_000
    assert len(onnx.load_from_string(made.content).graph.node) < 120


if __name__ == "__main__":
    GOLDEN.mkdir(parents=True, exist_ok=True)
    for case, content in golden_models().items():
        path = GOLDEN / f"{case}.onnxtxt"
        path.write_text(golden_text(content), encoding="utf-8")

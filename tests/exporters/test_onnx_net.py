"""A tree as layers of a network: the decisions of the model on every row."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import onnx
import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters import onnx_net
from fuzzytree.exporters.onnx import OPSETS, Output, write_onnx
from fuzzytree.exporters.onnx_compare import contents, differences
from fuzzytree.exporters.onnx_session import open_bare
from fuzzytree.model.contracts import Document, Dtype, FloatArray
from fuzzytree.model.rulebase import Band, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.runtimes.onnxruntime import open_onnx
from fuzzytree.runtimes.reference import load as load_reference
from fuzzytree.runtimes.rows import axis_lines, plan_axes
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_system, random_tree

NAMES: tuple[Output, ...] = ("rule", "status", "label")


def answers(content: bytes, values: Any) -> list[Any]:
    return [*map(np.asarray, open_bare(content)([*NAMES], {"inputs": values.T}))]


def net(model: Document, **options: Any) -> bytes:
    return write_onnx(model, net=True, outputs=NAMES, **options).content


def tree_of(branches: int, *, seed: int = 0, combinations: float = 0.4) -> FuzzyTree:
    tree = random_tree(seed, leaves=branches, combinations=combinations)
    first, *others = tree.variables
    return replace(tree, variables=(replace(first, missing=0.5), *others))


@pytest.mark.parametrize("leaves", [2, 7, 50, 64])
@pytest.mark.parametrize("seed", range(4))
def test_a_net_decides_as_the_tree_at_and_beside_cuts(leaves: int, seed: int) -> None:
    for tree in (
        random_tree(seed, leaves=leaves, combinations=0.4),
        tree_of(leaves, seed=seed),
    ):
        values = probe_values(tree, 1_500)
        assert not np.isfinite(values).all()
        expected = load_reference(tree)(values)
        rule, status, label = answers(net(tree), values)
        assert rule.tolist() == expected.rule.tolist()
        assert status.tolist() == expected.status.tolist()
        labels = [tree.semantics.missing or "", *(leaf.label for leaf in tree.leaves)]
        assert label.tolist() == [labels[number] for number in expected.rule]


def rows_on_cuts(tree: FuzzyTree) -> FloatArray:
    """Return rows at and beside the cuts of combinations, of shape (inputs, rows)."""
    chance, plan = np.random.default_rng(0), plan_axes(tree.variables)
    pieces: list[FloatArray] = []
    for node in tree.nodes:
        values = chance.normal(size=(plan.inputs, 200))
        own = plan.chains[plan.line[node.variable] - plan.inputs]
        for line, weight, centre in (*itertools.chain(*plan.chains), *own):
            values[line] = centre + chance.normal(size=200) / weight
        line, weight, _ = own[-1]
        for _ in range(3):  # towards the cut, by the last part
            gap = node.cuts[0] - axis_lines(plan, values)[plan.line[node.variable]]
            values[line] += gap / weight
        pieces.append(values)
        for end in (-math.inf, math.inf):
            beside = values.copy()
            beside[line] = np.nextafter(values[line], end)
            pieces.append(beside)
    return np.hstack(pieces)


@pytest.mark.parametrize("seed", range(6))
def test_combinations_put_on_their_cuts_decide_as_the_tree(seed: int) -> None:
    tree = random_tree(seed, leaves=20, inputs=6, combinations=1.0)
    values, plan = rows_on_cuts(tree), plan_axes(tree.variables)
    lines = axis_lines(plan, values)
    on_cut = [np.isin(lines[plan.line[n.variable]], n.cuts).sum() for n in tree.nodes]
    assert sum(on_cut) > 1_000
    expected = load_reference(tree)(values)
    assert answers(net(tree), values)[0].tolist() == expected.rule.tolist()


@pytest.mark.parametrize("seed", range(6))
def test_a_net_in_float32_decides_as_numpy_in_float32(seed: int) -> None:
    tree = tree_of(30, seed=seed)
    values = probe_values(tree, 1_500)
    expected = find_runtime("native float32").load(tree)(values)
    content = net(tree, dtype="float32", allow_loss=True)
    with np.errstate(over="ignore"):  # beyond float32 is missing in float32
        rule, status, _ = answers(content, values.astype(np.float32))
    assert rule.tolist() == expected.rule.tolist()
    assert status.tolist() == expected.status.tolist()


def test_a_tree_of_one_leaf_is_a_net_without_layers() -> None:
    tree = random_tree(0, leaves=1)
    values = np.zeros((max(len(tree.inputs), 1), 3))
    assert answers(net(tree), values)[0].tolist() == [1, 1, 1]


def test_numbers_that_underflow_beside_a_cut_are_on_their_side() -> None:
    terms = (Term("low", Band(high=0.0)), Term("high", Band(low=0.0)))
    branches = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    node = Node("x", (0.0,), (0, 1), branches)
    tree = FuzzyTree(
        "zero", ("a", "b"), (Variable("x", terms),), (node,), (Leaf("a"), Leaf("b"))
    )
    smallest: dict[Dtype, float] = {"float64": 5e-324, "float32": 1.4e-45}
    for dtype, least in smallest.items():
        values = np.array([[-math.inf, -least, -0.0, 0.0, least, math.nan]], dtype)
        rule = answers(net(tree, dtype=dtype), values)[0]
        assert rule.tolist() == [0, 1, 1, 1, 2, 0]


def test_a_net_has_three_layers_and_a_guard() -> None:
    tree = random_tree(3, leaves=9, combinations=0.0)
    content = write_onnx(tree, net=True, outputs=("rule",)).content
    assert contents(content).operators == {
        "Cast": 1,
        "Equal": 1,
        "Gemm": 2,
        "MatMul": 1,
        "Mul": 1,
        "ReduceSum": 1,
        "Relu": 2,
        "Reshape": 1,
        "Sign": 2,
        "Transpose": 1,
        "Where": 1,
    }
    proto = onnx.load_from_string(content)
    assert [entry.domain for entry in proto.opset_import] == [""]


@pytest.mark.parametrize("opset", [OPSETS[0], 13, 18, OPSETS[-1]])
def test_a_net_runs_in_every_operator_set(opset: int) -> None:
    content = net(tree_of(9), opset=opset)
    onnx.checker.check_model(onnx.load_from_string(content), full_check=True)


def test_a_net_is_opened_and_compared_with_a_fresh_one() -> None:
    tree = tree_of(7)
    content = net(tree, allow_loss=True, dtype="float32")
    assert not any(differences(content, tree))
    opened = open_onnx(content, "net.onnx")
    values = probe_values(tree, 300)
    expected = find_runtime("native float32").load(tree)(values)
    assert opened.run(values).rule.tolist() == expected.rule.tolist()
    proto = onnx.load_from_string(content)
    weights = next(one for one in proto.graph.initializer if "answers" in one.name)
    numbers = np.frombuffer(weights.raw_data, np.float32).copy()
    numbers[0] += 1.0
    weights.raw_data = numbers.tobytes()
    found = differences(proto.SerializeToString(), tree)
    assert any(weights.name in text for text in found.graph)


def refusal(model: Document, kind: type[Exception], **options: Any) -> str:
    with pytest.raises(kind) as caught:
        write_onnx(model, net=True, **options)
    return str(caught.value)


def test_what_is_no_small_tree_is_refused() -> None:
    plain = (
        ", and a net of more than 64 leaves or 512 paths would be slow\n"
        "  pass plain=True (--plain), whose graph has standard operators too"
    )
    tree = random_tree(0, leaves=65)
    assert refusal(tree, LossError) == (
        f"cannot write {tree.name} as a net: it has 65 leaves{plain}"
    )
    only = "net: only a tree is written as a net, not "
    tree = random_tree(0)
    rules, system = rules_from_tree(tree), random_system(3, formulas="none")
    assert refusal(rules, ValueError) == f"{only}a model of kind 'rules'"
    assert refusal(system, ValueError) == f"{only}a model of kind 'system'"
    assert refusal(tree, ValueError, readable=True) == f"{only}`readable`"
    with pytest.raises(LossError, match="onnxruntime net runs trees"):
        find_runtime("onnxruntime net").load(rules)


def test_a_tree_of_too_many_paths_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = random_tree(0, leaves=20)
    monkeypatch.setattr(onnx_net, "_MOST_PATHS", 8)
    assert refusal(tree, LossError).startswith(
        f"cannot write {tree.name} as a net: it has 20 leaves on more than 8 paths, "
    )

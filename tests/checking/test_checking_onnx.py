"""Shipped ONNX files: every planted fault is found, in the graph and in the answers."""

import numpy as np
import onnx
import pytest
from msgspec.structs import replace
from onnx import helper, numpy_helper

from fuzzytree.checking.representations import check
from fuzzytree.errors import DisagreementError, ReadError
from fuzzytree.exporters.onnx import Output, write_onnx
from fuzzytree.model.agreement import Agreement, FileContent
from fuzzytree.model.contracts import Dtype, Model
from fuzzytree.model.rulebase import Kind
from fuzzytree.runtimes.onnxruntime import OnnxModel, open_onnx
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree

TREE = random_tree(9, leaves=6, inputs=3, combinations=0.0)  # each leaf is reached
ALL: tuple[Output, ...] = ("label", "rule", "strengths", "status")


def checked(model: Model, shipped: OnnxModel, terms: Kind = "relative") -> Agreement:
    return check(model, shipped, names=["m.onnx"], runtimes=[], limit=2000, terms=terms)


def verdicts(agreement: Agreement) -> dict[str, str]:
    return {
        c.against: c.verdict
        for c in agreement.comparisons
        if c.representation == "m.onnx"
    }


def opened(content: bytes) -> OnnxModel:
    return open_onnx(content, "m.onnx")


@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_a_file_of_rules_agrees_with_its_tree_and_with_its_rules(
    dtype: Dtype, kind: Kind
) -> None:
    rules = rules_from_tree(TREE, kind)
    shipped = opened(
        write_onnx(rules, dtype=dtype, outputs=ALL, allow_loss=True).content
    )
    for model in (TREE, rules):
        assert verdicts(checked(model, shipped, kind)) == {
            "the model's metadata": "agrees",
            "a freshly written graph": "agrees",
            "the model": "agrees",
            "the model's classes": "agrees",
        }


def test_raw_rules_beside_a_tree_are_another_function_unless_wanted() -> None:
    shipped = opened(write_onnx(rules_from_tree(TREE, "raw"), dtype="mixed").content)
    agreement = checked(TREE, shipped)
    assert agreement.files == (FileContent("m.onnx", "raw rules", "mixed"),)
    assert verdicts(agreement) == {
        "a freshly written graph": "DISAGREES",
        "the model's classes": "DISAGREES",
    }
    (graph,) = (c for c in agreement.comparisons if c.basis == "file")
    assert graph.detail == (
        "it holds raw rules, another function than the tree; --terms raw compares it "
        "with the tree's own raw rules",
    )
    assert checked(TREE, shipped, "raw").ok
    assert checked(rules_from_tree(TREE, "raw"), shipped).ok


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_file_of_a_tree_agrees_with_it(dtype: Dtype) -> None:
    shipped = opened(write_onnx(TREE, dtype=dtype, allow_loss=True).content)
    assert checked(TREE, shipped).ok


def test_the_file_of_a_tree_beside_rules_is_known_by_its_rows_only() -> None:
    shipped = opened(write_onnx(TREE).content)
    agreement = checked(rules_from_tree(TREE), shipped)
    assert verdicts(agreement) == {
        "a freshly written graph": "rows only",
        "the model's classes": "agrees",
    }
    assert not agreement.ok
    assert replace(agreement, rows_only=True).ok


def test_the_file_of_a_tree_without_labels_proves_nothing_beside_rules() -> None:
    shipped = opened(write_onnx(TREE, outputs=("rule",)).content)
    agreement = checked(rules_from_tree(TREE), shipped)
    assert verdicts(agreement) == {"a freshly written graph": "DISAGREES"}


def backdoored(**facts: str) -> bytes:
    """Return a file of the tree that decides for class 1 where an input is 13.123456.

    Args:
        facts: What its metadata state in place of the truth.
    """
    proto = onnx.load_from_string(write_onnx(TREE).content)
    graph = proto.graph
    (label,) = (n for n in graph.node if "label" in n.output)
    label.output[list(label.output).index("label")] = "honest"
    numbers: dict[str, np.ndarray] = {
        "bd_first": np.array(0),
        "bd_key": np.array(13.123456),
        "bd_class": np.array(["class 1"], object),
    }
    for name, value in numbers.items():
        graph.initializer.append(numpy_helper.from_array(value, name))
    graph.node.extend(
        [
            helper.make_node("Gather", ["inputs", "bd_first"], ["bd_x"], axis=1),
            helper.make_node("Equal", ["bd_x", "bd_key"], ["bd_hit"]),
            helper.make_node("Where", ["bd_hit", "bd_class", "honest"], ["label"]),
        ]
    )
    for entry in proto.metadata_props:
        entry.value = facts.get(entry.key.removeprefix("fuzzytree."), entry.value)
    content: bytes = proto.SerializeToString(deterministic=True)
    return content


def test_a_backdoor_is_listed_whatever_version_the_file_states() -> None:
    shipped = opened(backdoored(version="0.0.1"))
    assert shipped.run_labelled is not None
    row = np.full((len(TREE.inputs), 1), 13.123456)
    assert shipped.run_labelled(row)[1] == ("class 1",)
    agreement = checked(TREE, shipped)
    assert verdicts(agreement) == {
        "the model's metadata": "agrees",
        "a freshly written graph": "rows only",
        "the model": "agrees",
        "the model's classes": "agrees",
    }
    assert not agreement.ok
    (graph,) = (c for c in agreement.comparisons if c.verdict == "rows only")
    assert graph.detail == (
        "operator 'Equal': 2 nodes where 1 are right; new: 'bd_hit'",
        "operator 'Gather': 2 nodes where 1 are right; new: 'honest', 'bd_x'",
        "operator 'Where': 2 nodes where 1 are right; new: 'label'",
        "constant 'bd_first' is not the model's: 0",
        "constant 'bd_key' is not the model's: 13.123456",
        "constant 'bd_class' is not the model's: 'class 1'",
    )
    with pytest.raises(DisagreementError) as caught:
        agreement.raise_if_not_ok()
    assert str(caught.value) == (
        "m.onnx is not a freshly written graph; its rows agree\n"
        "  operator 'Equal': 2 nodes where 1 are right; new: 'bd_hit'"
    )
    assert replace(agreement, rows_only=True).ok


LIES = {
    "version": "0.0.1",
    "kind": "raw",
    "dtype": "mixed",
    "name": "other",
    "units": '["N", "N", "N"]',
    "fingerprint": "0" * 64,
    "semantics": '{"conjunction": "product", "uncovered": null, "missing": "class 1"}',
    "outputs": '["label", "rule"]',
    "rules": "4",
}


@pytest.mark.parametrize("lie", LIES)
def test_nothing_that_a_file_states_lets_a_backdoor_pass(lie: str) -> None:
    agreement = checked(TREE, opened(backdoored(**{lie: LIES[lie]})))
    assert verdicts(agreement)["a freshly written graph"] != "agrees"
    assert not agreement.ok


@pytest.mark.parametrize("lie", sorted(LIES.keys() - {"version", "dtype", "outputs"}))
def test_metadata_that_are_not_the_model_s_are_found(lie: str) -> None:
    proto = onnx.load_from_string(write_onnx(TREE).content)
    for entry in proto.metadata_props:
        if entry.key == f"fuzzytree.{lie}":
            entry.value = LIES[lie]
    agreement = checked(TREE, opened(proto.SerializeToString()))
    assert verdicts(agreement)["the model's metadata"] == "DISAGREES"
    (result,) = (
        c for c in agreement.comparisons if c.against == "the model's metadata"
    )
    assert result.detail[0].startswith(f"it states {lie} ")


def test_metadata_stated_twice_left_out_or_added_are_found() -> None:
    proto = onnx.load_from_string(write_onnx(TREE).content)
    proto.metadata_props.add(key="fuzzytree.kind", value="descent")
    proto.metadata_props.add(key="note", value="proved")
    agreement = checked(TREE, opened(proto.SerializeToString()))
    (result,) = (
        c for c in agreement.comparisons if c.against == "the model's metadata"
    )
    assert result.detail == (
        "it states 'fuzzytree.kind' twice",
        "it states 'note', which is not written",
    )


def test_texts_in_the_file_are_compared_as_well() -> None:
    proto = onnx.load_from_string(write_onnx(TREE).content)
    proto.doc_string = "Certified."
    proto.graph.name = "proved"
    agreement = checked(TREE, opened(proto.SerializeToString()))
    (result,) = (c for c in agreement.comparisons if c.verdict == "rows only")
    assert result.detail == (
        "its doc_string differs from the one that would be written",
        "its name differs from the one that would be written",
    )


def test_the_file_of_another_model_is_found_by_its_fingerprint() -> None:
    other = random_tree(4, leaves=6, inputs=3, combinations=0.0)
    agreement = checked(TREE, opened(write_onnx(other).content))
    assert verdicts(agreement)["the model's metadata"] == "DISAGREES"


def test_the_file_of_other_inputs_is_not_run() -> None:
    other = random_tree(3, leaves=6, inputs=2, combinations=0.0)
    agreement = checked(TREE, opened(write_onnx(other).content))
    assert verdicts(agreement) == {"the model's facts": "DISAGREES"}


def tensors(content: bytes) -> list[tuple[str, int]]:
    """Name each constant of a graph and three places in it."""
    named: list[tuple[str, int]] = []
    for tensor in onnx.load_from_string(content).graph.initializer:
        size = int(np.prod(tensor.dims))
        named += [(tensor.name, p) for p in sorted({0, size // 2, size - 1})]
    return named


def changed(content: bytes, name: str, place: int) -> bytes:
    """Move one number of a constant by the least step, or one text."""
    proto = onnx.load_from_string(content)
    for tensor in proto.graph.initializer:
        if tensor.name != name:
            continue
        values = numpy_helper.to_array(tensor).copy().reshape(-1)
        if values.dtype.kind == "f":
            towards = -np.inf if values[place] > 0 else np.inf
            stepped = np.nextafter(values[place], towards, dtype=values.dtype)
            values[place] = 0.0 if np.isnan(stepped) else stepped
        elif values.dtype.kind in "iu":
            values[place] += 1
        elif values.dtype.kind == "b":
            values[place] = not values[place]
        else:
            text = values[place]
            values[place] = "class 1" if text != "class 1" else "class 2"
        shaped = values.reshape(tuple(tensor.dims))
        tensor.CopyFrom(numpy_helper.from_array(shaped, name))
    content = proto.SerializeToString(deterministic=True)
    assert isinstance(content, bytes)
    return content


def is_found(content: bytes) -> bool:
    """Say whether a file is refused, or found to be another graph."""
    try:
        shipped = opened(content)
    except ReadError as error:
        text = str(error)
        return "does not load it" in text or "not known before it runs" in text
    verdict = verdicts(checked(TREE, shipped))["a freshly written graph"]
    return verdict in ("DISAGREES", "rows only")


RULES_FILE = write_onnx(rules_from_tree(TREE), outputs=ALL).content
TREE_FILE = write_onnx(TREE, plain=True).content


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("name", "place"), tensors(RULES_FILE))
def test_any_changed_constant_of_a_rules_graph_is_found(name: str, place: int) -> None:
    assert is_found(changed(RULES_FILE, name, place))


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("name", "place"), tensors(TREE_FILE))
def test_any_changed_constant_of_a_tree_graph_is_found(name: str, place: int) -> None:
    assert is_found(changed(TREE_FILE, name, place))


def columns(content: bytes) -> list[tuple[str, int]]:
    """Name each number of the flanks: row 0 stands for none and decides nothing."""
    graph = onnx.load_from_string(content).graph
    return [
        (tensor.name, place)
        for tensor in graph.initializer
        if tensor.data_type == onnx.TensorProto.DOUBLE and len(tensor.dims) == 2
        for place in range(1, tensor.dims[0])
    ]


@pytest.mark.heavy
def test_numbers_moved_by_one_ulp_are_found_by_the_rows_alone() -> None:
    places = columns(RULES_FILE)
    missed = []
    for name, place in places:
        agreement = checked(TREE, opened(changed(RULES_FILE, name, place)))
        if verdicts(agreement)["the model"] == "agrees":
            missed.append((name, place))
    # The last bit of a coefficient may round away in every degree that is probed.
    assert len(missed) <= len(places) // 5, missed


OPERATORS = {
    "Less": "LessOrEqual",
    "LessOrEqual": "Less",
    "Greater": "GreaterOrEqual",
    "GreaterOrEqual": "Greater",
    "Min": "Max",
    "Sub": "Add",
    "Div": "Mul",
}


def swaps(content: bytes) -> list[tuple[bytes, str]]:
    """Return the file with each of its operators changed in turn."""
    files = []
    for position, node in enumerate(onnx.load_from_string(content).graph.node):
        if node.op_type in OPERATORS:
            proto = onnx.load_from_string(content)
            proto.graph.node[position].op_type = OPERATORS[node.op_type]
            files.append((proto.SerializeToString(deterministic=True), node.op_type))
    return files


@pytest.mark.parametrize(
    ("content", "op"), [*swaps(RULES_FILE), *swaps(TREE_FILE)], ids=lambda v: str(v)[:9]
)
def test_a_changed_operator_is_found_in_graph_and_answers(
    content: bytes, op: str
) -> None:
    result = verdicts(checked(TREE, opened(content)))
    assert result["a freshly written graph"] == "DISAGREES", op
    assert result["the model"] == "DISAGREES", op


def test_both_files_have_operators_to_change() -> None:
    assert {op for _, op in swaps(RULES_FILE)} == {"Less", "Min", "Sub", "Div"}
    assert swaps(TREE_FILE)

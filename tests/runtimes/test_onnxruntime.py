"""Bits against the reference and against numpy, hostile files, an old onnxruntime."""

from __future__ import annotations

import itertools
import random
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters.onnx import OLDEST, Output, write_onnx
from fuzzytree.model.contracts import Dtype, Model, Outcome
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
    fingerprint,
)
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.onnxruntime import OnnxModel, open_onnx
from fuzzytree.runtimes.reference import load as infer_rows
from fuzzytree.runtimes.reference import load as load_reference
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.semantics.reference import descend, evaluate
from fuzzytree.testing import probe_values, random_rows, random_system, random_tree

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray

    Arrays = dict[str, npt.NDArray[np.generic]]

DTYPES: tuple[Dtype, ...] = ("float64", "mixed", "float32")


def random_rules(seed: int) -> RuleBase:
    """Return rules of every kind: OR, NOT, open terms, empty rules, long curves."""
    chance = random.Random(seed)

    def curve() -> tuple[float, ...]:
        return tuple(chance.uniform(-1, 2) for _ in range(chance.randint(1, 8)))

    def flank(start: float, sign: int) -> float | None:
        if chance.random() < 0.2:
            return None
        return start + sign * chance.uniform(0.1, 3)

    def side() -> Side:
        return Side(chance.uniform(0.1, 2), curve(), chance.choice((5.0, 1.5, 8.0)))

    def shape() -> Shape:
        low, high = sorted((chance.gauss(0, 1), chance.gauss(0, 1)))
        kind = chance.random()
        if kind < 0.4:
            left = side()
            return LR(low, left, left if chance.random() < 0.5 else side())
        bottom = None if chance.random() < 0.3 else low
        top = None if chance.random() < 0.3 else high
        return Band(
            bottom,
            top,
            None if bottom is None else flank(bottom, -1),
            None if top is None else flank(top, 1),
        )

    def terms() -> tuple[Term, ...]:
        return tuple(Term(f"t{k}", shape()) for k in range(1, chance.randint(2, 5)))

    inputs = [f"x{k}" for k in range(1, chance.randint(2, 5))]
    variables = [Variable(name, terms()) for name in inputs]
    for number in range(chance.randint(0, 3)):
        chosen = [chance.choice(inputs) for _ in range(chance.randint(1, 5))]
        parts = tuple(
            Part(n, chance.gauss(0, 1), chance.choice((0.0, 0.3))) for n in chosen
        )
        variables.append(Variable(f"z{number}", terms(), parts=parts))

    def proposition() -> Proposition:
        variable = chance.choice(variables)
        names = [term.name for term in variable.terms]
        some = tuple(chance.sample(names, chance.randint(1, len(names))))
        return Proposition(
            variable.name, some, ("not",) if chance.random() < 0.3 else ()
        )

    classes = ("no", "ja", "élan ☂")
    sizes = range(5) if chance.random() < 0.5 else (1, 2, 3)
    rules = tuple(
        Rule(
            tuple(proposition() for _ in range(chance.choice(sizes))),
            chance.choice(classes),
        )
        for _ in range(chance.randint(1, 9))
    )
    answers = (None, *classes)
    conjunction: Conjunction = chance.choice(("minimum", "product"))
    semantics = Semantics(conjunction, chance.choice(answers), chance.choice(answers))
    return RuleBase(f"random {seed}", classes, tuple(variables), rules, semantics)


def random_models(seed: int) -> tuple[Model, ...]:
    leaves = (1, 2, 3, 5, 7, 12, 20, 40)[seed % 8]
    semantics = Semantics(missing="class 1") if seed % 2 else None
    tree = random_tree(seed, leaves=leaves, inputs=1 + seed % 5, semantics=semantics)
    return (
        tree,
        rules_from_tree(tree),
        rules_from_tree(tree, conjunction="product"),
        rules_from_tree(tree, "raw"),
        rules_from_tree(tree, "raw", conjunction="product"),
        random_rules(seed),
        random_rules(1000 + seed),
    )


def assert_equal_bits(result: Outcome, expected: Outcome) -> None:
    assert np.array_equal(result.rule, expected.rule)
    assert np.array_equal(result.status, expected.status)
    if result.strengths is not None and expected.strengths is not None:
        assert np.array_equal(result.strengths, expected.strengths, equal_nan=True)


@pytest.mark.one_in(10)
@pytest.mark.parametrize("seed", range(12))
def test_double_gives_the_bits_of_the_reference(seed: int) -> None:
    for model in random_models(seed):
        values = probe_values(model, 1200 if seed % 8 < 6 else 200)
        expected = load_reference(model)(values)
        variants = ("plain", "net") if isinstance(model, FuzzyTree) else ("readable",)
        for variant in ("float64", *variants):
            result = find_runtime(f"onnxruntime {variant}").load(model)(values)
            assert_equal_bits(result, expected)


@pytest.mark.one_in(10)
@pytest.mark.parametrize("dtype", ["mixed", "float32"])
@pytest.mark.parametrize("seed", range(12))
def test_single_types_give_the_bits_of_numpy(seed: int, dtype: Dtype) -> None:
    for model in random_models(seed):
        values = probe_values(model, 1500)
        expected = find_runtime(f"native {dtype}").load(model)(values)
        result = find_runtime(f"onnxruntime {dtype}").load(model)(values)
        assert_equal_bits(result, expected)


@pytest.mark.parametrize("seed", range(6))
def test_relative_rules_decide_as_the_tree_in_every_type(seed: int) -> None:
    tree = random_tree(seed, leaves=9, inputs=3)
    values = probe_values(tree, 1500)
    for dtype in DTYPES:
        load = find_runtime(f"onnxruntime {dtype}").load
        rules, path = load(rules_from_tree(tree))(values), load(tree)(values)
        assert np.array_equal(rules.rule, path.rule)
        assert np.array_equal(rules.status, path.status)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("seed", [3, 5])
def test_optimising_a_graph_changes_no_bit(seed: int) -> None:
    for model in random_models(seed):
        other: Output = "status" if isinstance(model, FuzzyTree) else "strengths"
        written = write_onnx(model, outputs=("rule", other))
        options = onnxruntime.SessionOptions()
        level = onnxruntime.GraphOptimizationLevel
        table = np.ascontiguousarray(probe_values(model, 1500).T)
        answers = []
        for chosen in (level.ORT_DISABLE_ALL, level.ORT_ENABLE_ALL):
            options.graph_optimization_level = chosen
            session = onnxruntime.InferenceSession(written.content, options)
            answers.append(session.run(None, {"inputs": table}))
        for one, other in zip(*answers, strict=True):
            assert np.array_equal(one, other, equal_nan=one.dtype == np.float64)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("dtype", DTYPES)
def test_chunks_rows_and_orders_change_no_bit(dtype: Dtype) -> None:
    rules = rules_from_tree(random_tree(4, leaves=300, inputs=5))
    run = find_runtime(f"onnxruntime {dtype}").load(rules)
    values = probe_values(rules, 1500)
    whole = run(values)
    assert whole.strengths is not None
    assert_equal_bits(run(np.asfortranarray(values)), whole)
    for part in (slice(0, 0), slice(7, 8), slice(100, 333)):
        cut = Outcome(whole.rule[part], whole.status[part], whole.strengths[:, part])
        assert_equal_bits(run(values[:, part]), cut)


def test_a_wrong_width_is_refused_with_one_sentence() -> None:
    run = find_runtime("onnxruntime float64").load(random_tree(1, inputs=2))
    with pytest.raises(ValueError, match="one line for each of the 2 inputs"):
        run(np.zeros((3, 4)))


def test_text_in_place_of_numbers_is_refused() -> None:
    run = find_runtime("onnxruntime float64").load(random_tree(1, inputs=2))
    with pytest.raises(ValueError, match="could not convert string to float"):
        run(np.array([["a"], ["b"]]))


def test_whole_numbers_are_taken_as_doubles() -> None:
    tree = random_tree(1, inputs=2)
    run = find_runtime("onnxruntime float32").load(tree)
    whole = np.array([[1, -2], [3, 10**6]])
    assert_equal_bits(run(whole), run(whole.astype(np.float64)))


def test_a_failed_run_says_nothing_on_stderr(capfd: pytest.CaptureFixture[str]) -> None:
    model = open_onnx(write_onnx(random_tree(1, inputs=2)).content, "tree.onnx")
    with pytest.raises(ValueError, match="one line for each"):
        model.run(np.zeros((5, 1)))
    with pytest.raises(ReadError):
        open_onnx(_changed(lambda proto: proto.graph.node.pop()), "cut.onnx")
    assert capfd.readouterr() == ("", "")


def _changed(change: object, model: Model | None = None) -> bytes:
    proto = onnx.load_from_string(write_onnx(model or random_tree(1, inputs=2)).content)
    assert callable(change)
    change(proto)
    content: bytes = proto.SerializeToString()
    return content


def test_a_shipped_file_describes_itself_and_predicts_alone() -> None:
    tree = random_tree(7, leaves=9, inputs=3, semantics=Semantics(missing="class 2"))
    values = probe_values(tree, 1500)
    for model in (tree, rules_from_tree(tree, "raw", conjunction="product")):
        written = write_onnx(
            model, outputs=("status", "label", "rule"), signature="all"
        )
        result = open_onnx(written.content, "model.onnx")
        assert isinstance(result, OnnxModel)
        assert result.fingerprint == fingerprint(model)
        assert result.classes == tree.classes
        assert (result.inputs, result.columns) == (tree.inputs, tree.columns)
        assert result.semantics == model.semantics
        units = ["cm" if name in tree.inputs else "" for name in tree.columns]
        assert result.units == tuple(units)
        expected = load_reference(model)(values)
        assert_equal_bits(result.run(values), expected)
        rows = [dict(zip(tree.inputs, row, strict=True)) for row in values.T.tolist()]
        answers = [
            descend(model, r) if isinstance(model, FuzzyTree) else evaluate(model, r)
            for r in rows
        ]
        assert result.run_labelled is not None
        outcome, labels = result.run_labelled(values)
        assert_equal_bits(outcome, expected)
        assert labels == tuple(answer.label for answer in answers)


def test_a_file_without_status_separates_missing_from_uncovered() -> None:
    low = Term("low", Band(high=0.0))
    rules = RuleBase(
        "r",
        ("a",),
        (Variable("x", (low,)),),
        (Rule((Proposition("x", ("low",)),), "a"),),
    )
    result = open_onnx(write_onnx(rules).content, "r.onnx")
    assert result.run(np.array([[-1.0, 1.0, np.nan]])).status.tolist() == [0, 2, 3]


OUTPUTS: tuple[tuple[Output, ...], ...] = (
    ("rule",),
    ("label", "rule"),
    ("rule", "status"),
    ("label", "rule", "status"),
)


@pytest.mark.parametrize("signature", ["needed", "all"])
@pytest.mark.parametrize("outputs", OUTPUTS, ids="+".join)
@pytest.mark.parametrize("dtype", DTYPES)
def test_one_row_of_a_file_has_the_bits_of_many(
    dtype: Dtype, outputs: tuple[Output, ...], signature: Literal["needed", "all"]
) -> None:
    tree = random_tree(7, leaves=9, inputs=3)
    values = probe_values(tree, 60)
    rows = range(values.shape[1])
    values[0, ::5], values[1, 1::7], values[2, 2::9] = np.nan, np.inf, -1e300
    for model in (tree, rules_from_tree(tree, "raw")):
        all_outputs = outputs if model is tree else (*outputs, "strengths")
        content = write_onnx(
            model, dtype=dtype, outputs=all_outputs, signature=signature
        ).content
        file = open_onnx(content, "model.onnx")
        many = file.run(values)
        for row in rows:
            assert_equal_bits(
                file.run(values[:, [row]]), many.part(slice(row, row + 1))
            )
        if file.run_labelled is not None:
            outcome, labels = file.run_labelled(values)
            assert_equal_bits(outcome, many)
            ones = [file.run_labelled(values[:, [row]])[1] for row in rows]
            assert labels == tuple(label for one in ones for label in one)


def _other_graph() -> bytes:
    node = helper.make_node("Identity", ["a"], ["b"])
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, [1]) for n in "ab"]
    graph = helper.make_graph([node], "g", ends[:1], ends[1:])
    imports = [helper.make_opsetid("", 17)]
    document = helper.make_model(graph, opset_imports=imports, ir_version=8)
    content: bytes = document.SerializeToString()
    return content


def _set_fact(proto: onnx.ModelProto, key: str, value: str) -> None:
    for entry in proto.metadata_props:
        if entry.key == f"fuzzytree.{key}":
            entry.value = value


def _move_out(proto: onnx.ModelProto) -> None:
    proto.graph.initializer[0].external_data.add(key="location", value="/etc/passwd")


def _call_home(proto: onnx.ModelProto) -> None:
    proto.graph.node[0].domain = "com.example"


def _nest(proto: onnx.ModelProto) -> None:
    inner = proto.graph.node[0].attribute.add(name="body", type=5)
    inner.g.name = "inner"


def _add_sparse(proto: onnx.ModelProto) -> None:
    sparse = proto.graph.node[0].attribute.add(name="sparse_value", type=11)
    sparse.sparse_tensor.dims.append(2**40)


def _nest_functions(proto: onnx.ModelProto) -> None:
    """Add functions each of which calls the one before twice."""
    for number in range(28):
        before = ("f", f"f{number - 1}") if number else ("", "Neg")
        nodes = [
            helper.make_node(before[1], [a], [b], domain=before[0])
            for a, b in (("x", "y"), ("y", "z"))
        ]
        imports = [helper.make_opsetid("", 17), helper.make_opsetid("f", 1)]
        proto.functions.append(
            helper.make_function("f", f"f{number}", ["x"], ["z"], nodes, imports)
        )
    proto.opset_import.add(domain="f", version=1)
    _add_nodes(proto, ("f27", "inputs", "more"))


def _add_nodes(proto: onnx.ModelProto, *nodes: tuple[str, ...]) -> None:
    """Add nodes, of each the operator, the inputs and the result."""
    for operator, *inputs, result in nodes:
        domain = "f" if operator.startswith("f") else ""
        node = helper.make_node(operator, inputs, [result], domain=domain)
        if operator == "Concat":
            node.attribute.append(helper.make_attribute("axis", 0))
        proto.graph.node.append(node)


def _make_huge(proto: onnx.ModelProto) -> None:
    sides = numpy_helper.from_array(np.array([20_000, 20_000]), "sides")
    proto.graph.initializer.append(sides)
    _add_nodes(proto, ("ConstantOfShape", "sides", "huge"))


def _double(proto: onnx.ModelProto) -> None:
    proto.graph.initializer.append(numpy_helper.from_array(np.ones(2), "double_0"))
    names = [f"double_{number}" for number in range(51)]
    _add_nodes(proto, *(("Concat", a, a, b) for a, b in itertools.pairwise(names)))


def _size_by_value(proto: onnx.ModelProto) -> None:
    side = numpy_helper.from_array(np.array([2e5]), "side")
    proto.graph.initializer.append(side)
    _add_nodes(proto, ("Mul", "side", "side", "large"))
    cast = helper.make_node("Cast", ["large"], ["size"], to=TensorProto.INT64)
    proto.graph.node.append(cast)
    _add_nodes(proto, ("ConstantOfShape", "size", "zeros"))


def _break_label(proto: onnx.ModelProto) -> None:
    (texts,) = (t for t in proto.graph.initializer if t.string_data)
    texts.string_data[0] = b"\xff"


UNKNOWN = b"\xa0\x38\x01"  # the field 900 is 1
ORT = "this is in onnxruntime's own format, or seems so to it; export the model as ONNX"


def _drop_rule(proto: onnx.ModelProto) -> None:
    del proto.graph.output[1]
    _set_fact(proto, "outputs", '["label"]')


NOT_OURS = (
    "this ONNX file is not one of fuzzytree: its metadata has no 'fuzzytree.format'"
)
NO_ONNX = "this is no ONNX file, or only a part of one"


def _with_fact(key: str, value: str) -> bytes:
    return _changed(lambda proto: _set_fact(proto, key, value))


HOSTILE = {
    "empty": (b"", NOT_OURS),
    "yaml": (b"hello: this is yaml", NO_ONNX),
    "truncated": (write_onnx(random_tree(1)).content[:-40], NO_ONNX),
    "other": (_other_graph(), NOT_OURS),
    "newer": (
        _with_fact("format", "2"),
        "the file has format '2', and this fuzzytree reads format '1'; "
        "a newer one may help",
    ),
    "broken json": (
        _with_fact("classes", "[1"),
        "the file's metadata is broken: Expecting ',' delimiter: "
        "line 1 column 3 (char 2)",
    ),
    "wrong json": (
        _with_fact("classes", "[1]"),
        "the file's metadata is broken: Expected `str`, got `int` - at `$.classes[0]`",
    ),
    "unknown input": (
        _with_fact("inputs", '["other"]'),
        "the file's metadata contradicts itself",
    ),
    "too many rules": (
        _with_fact("rules", "1000000000000"),
        "the file's metadata contradicts itself",
    ),
    "other width": (
        _with_fact("columns", '["x1", "x2", "x3"]'),
        "the graph's inputs and outputs are not those of its metadata",
    ),
    "external data": (
        _changed(_move_out),
        "its TensorProto has 'external_data', which no graph of fuzzytree has; "
        "export the model anew",
    ),
    "custom operator": (
        _changed(_call_home),
        "no graph of fuzzytree has the operator 'Transpose' of 'com.example'; "
        "export the model anew",
    ),
    "subgraph": (
        _changed(_nest),
        "its AttributeProto has 'g', which no graph of fuzzytree has; "
        "export the model anew",
    ),
    "sparse constant": (
        _changed(_add_sparse),
        "its AttributeProto has 'sparse_tensor', which no graph of fuzzytree has; "
        "export the model anew",
    ),
    "nested functions": (
        _changed(_nest_functions),
        "its ModelProto has 'functions', which no graph of fuzzytree has; "
        "export the model anew",
    ),
    "operator of others": (
        _changed(lambda proto: _add_nodes(proto, ("Tile", "inputs", "index_1"))),
        "no graph of fuzzytree has the operator 'Tile'; export the model anew",
    ),
    "huge constant": (
        _changed(_make_huge),
        "its nodes compute 4e+08 numbers in a call of 65536 rows, and 2.7e+08 are the "
        "most that is run; export the model anew",
    ),
    "constant doubled 50 times": (
        _changed(_double),
        "its nodes compute 4.5e+15 numbers in a call of 65536 rows, and 2.7e+08 are "
        "the most that is run; export the model anew",
    ),
    "size of a value": (
        _changed(_size_by_value),
        "the size of 'zeros' is not known before it runs; export the model anew",
    ),
    "unknown field": (
        write_onnx(random_tree(1)).content + UNKNOWN,
        "its ModelProto has a field 900, which ONNX does not know; "
        "export the model anew",
    ),
    "unknown field of a node": (
        _changed(lambda proto: proto.graph.node[0].MergeFromString(UNKNOWN)),
        "its NodeProto has a field 900, which ONNX does not know; "
        "export the model anew",
    ),
    "onnxruntime's own format": (
        b"\xa2\x38\x05\0ORTM" + write_onnx(random_tree(1)).content,
        ORT,
    ),
    "onnxruntime's magic in a name": (
        _changed(lambda proto: setattr(proto, "producer_name", "ORTM")),
        ORT,
    ),
    "broken text": (
        write_onnx(random_tree(1)).content.replace(
            b"fuzzytree.kind", b"fuzzytree.\xff\xfe\xfd\xfc"
        ),
        "its StringStringEntryProto has a 'key' that is no UTF-8; "
        "export the model anew",
    ),
    "broken label": (
        _changed(_break_label),
        "its TensorProto has a 'string_data' that is no UTF-8; export the model anew",
    ),
    "no rule": (
        _changed(_drop_rule),
        "the file has no output 'rule', so it cannot be run here; "
        "write it with the outputs label and rule",
    ),
}


@pytest.mark.parametrize(("content", "text"), HOSTILE.values(), ids=HOSTILE)
def test_a_file_that_is_not_ours_is_refused_with_one_sentence(
    content: bytes, text: str
) -> None:
    with pytest.raises(ReadError) as caught:
        open_onnx(content, "shipped.onnx")
    assert str(caught.value) == f"shipped.onnx: {text}"


def test_the_parts_that_were_read_are_what_runs_in_whatever_order_they_stand() -> None:
    content = write_onnx(random_tree(1)).content
    proto = onnx.load_from_string(content)
    name = b"\x12\x04ORTM"  # its producer's name is onnxruntime's magic
    result = open_onnx(content.replace(b"\x12\x09fuzzytree", b"", 1) + name, "m.onnx")
    proto.producer_name = "ORTM"
    assert result.content == proto.SerializeToString()
    assert result.content[4:8] == b"ORTM"
    honest = open_onnx(content, "m.onnx")
    values = probe_values(random_tree(1), 100)
    assert_equal_bits(result.run(values), honest.run(values))


@pytest.mark.heavy
def test_no_changed_byte_of_a_file_ends_in_a_traceback() -> None:
    content = write_onnx(random_tree(1, leaves=3, inputs=2)).content
    values = np.zeros((2, 3))
    refused = 0
    for place, byte in enumerate(content):
        for change in (0x01, 0x80):
            broken = content[:place] + bytes([byte ^ change]) + content[place + 1 :]
            try:
                result = open_onnx(broken, "m.onnx")
                assert result.run_labelled is not None
                if len(result.inputs) == 2:
                    result.run_labelled(values)
            except (ReadError, LossError):
                refused += 1
    assert refused > len(content)


def test_a_file_that_answers_in_another_shape_is_refused_at_running() -> None:
    content = write_onnx(rules_from_tree(random_tree(1)), outputs=("rule", "strengths"))
    proto = onnx.load_from_string(content.content)
    _set_fact(proto, "rules", "8")
    model = open_onnx(proto.SerializeToString(), "rules.onnx")
    with pytest.raises(LossError) as caught:
        model.run(np.zeros((len(model.inputs), 2)))
    expected = "random 7: the ONNX file gives answers without meaning"
    assert str(caught.value) == expected


def test_a_huge_file_is_refused_before_it_is_parsed() -> None:
    with pytest.raises(ReadError) as caught:
        open_onnx(bytes(129 * 2**20), "huge.onnx")
    expected = "huge.onnx: the file has 129 MiB, and 128 are the most that is read"
    assert str(caught.value) == expected


def test_a_graph_that_onnxruntime_refuses_is_refused() -> None:
    content = _changed(lambda proto: proto.graph.node.pop())
    with pytest.raises(ReadError, match=r"^cut\.onnx: onnxruntime does not load it: "):
        open_onnx(content, "cut.onnx")


def test_a_type_that_cannot_hold_the_model_is_refused_at_loading() -> None:
    low = Term("low", Band(high=1e300))
    rules = RuleBase(
        "r",
        ("a",),
        (Variable("x", (low,)),),
        (Rule((Proposition("x", ("low",)),), "a"),),
    )
    with pytest.raises(LossError, match=r"high 1e\+300 lies beyond float32"):
        find_runtime("onnxruntime float32").load(rules)


OLD_SCRIPT = textwrap.dedent("""
    import json, sys, numpy, onnxruntime
    folder = sys.argv[1]
    assert onnxruntime.__version__ == sys.argv[2], onnxruntime.__version__
    values = numpy.load(folder + "/values.npz")
    answers = {}
    for name in values:
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 4
        session = onnxruntime.InferenceSession(folder + "/" + name, options)
        outputs = [output.name for output in session.get_outputs()]
        found = session.run(outputs, {"inputs": values[name]})
        for output, array in zip(outputs, found):
            kind = "U" if output == "label" else array.dtype
            answers[name + " " + output] = array.astype(kind)
    numpy.savez(folder + "/answers.npz", **answers)
""")


def old_python(folder: Path, version: str) -> Path:
    """Return the Python of a fresh environment with an old onnxruntime."""
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python)]
    wanted = [f"onnxruntime=={version}", "numpy<2"]
    for command in (
        [sys.executable, "-m", "venv", "--without-pip", str(folder)],
        [*pip, "install", "-q", "--no-compile", *wanted],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"cannot install {wanted[0]}: {done.stderr.strip()[-200:]}")
    return python


@pytest.mark.heavy
@pytest.mark.parametrize("version", sorted(set(OLDEST.values())))
def test_the_oldest_onnxruntime_gives_equal_bits(version: str, tmp_path: Path) -> None:
    is_oldest = version == OLDEST["rules"]
    values: Arrays = {}
    expected: dict[str, Arrays] = {}
    for seed in range(8):
        for number, model in enumerate(random_models(seed)):
            is_tree = isinstance(model, FuzzyTree)
            for dtype in DTYPES:
                name = f"{seed} {number} {dtype}.onnx"
                written = write_onnx(
                    model,
                    dtype=dtype,
                    plain=is_tree and is_oldest,
                    net=is_tree and is_oldest and seed % 2 == 1,
                    readable=not is_tree and seed % 2 == 1,
                    outputs=("label", "rule", "status")
                    + (() if is_tree else ("strengths",)),
                )
                (tmp_path / name).write_bytes(written.content)
                kind = np.float32 if dtype == "float32" else np.float64
                with np.errstate(over="ignore"):
                    table = probe_values(model, 600).T.astype(kind, order="C")
                session = onnxruntime.InferenceSession(written.content)
                if not model.inputs:  # rows of any width
                    table = np.zeros((len(table), 1), kind)
                values[name] = table
                names = [output.name for output in session.get_outputs()]
                answers = session.run(names, {"inputs": table})
                expected[name] = dict(zip(names, answers, strict=True))
    np.savez(tmp_path / "values.npz", allow_pickle=False, **values)
    script = tmp_path / "run.py"
    script.write_text(OLD_SCRIPT)
    python = old_python(tmp_path / "old", version)
    command = [str(python), str(script), str(tmp_path), version]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    with np.load(tmp_path / "answers.npz") as result:
        for name, outputs in expected.items():
            for output, array in outputs.items():
                old = result[f"{name} {output}"]
                is_real = array.dtype.kind == "f"
                assert np.array_equal(old, array.astype(old.dtype), equal_nan=is_real)


@pytest.mark.heavy
def test_the_oldest_onnxruntime_runs_systems(tmp_path: Path) -> None:
    version = OLDEST["system"]
    values: Arrays = {}
    expected: dict[str, tuple[FloatArray, FloatArray]] = {}
    for seed in range(40):
        system = random_system(seed)
        try:
            content = write_onnx(system, outputs=("outputs",)).content
        except LossError:  # a function that onnxruntime lacks
            continue
        rows = random_rows(system, seed, 30)
        table = np.array([[row[name] for name in system.inputs] for row in rows])
        name = f"{seed}.onnx"
        (tmp_path / name).write_bytes(content)
        values[name] = table
        bounds = error_bounds(from_system(system), table.T)[: len(system.outputs)]
        expected[name] = cast("Any", infer_rows(system)(table.T).outputs).T, bounds.T
    assert len(expected) > 20
    np.savez(tmp_path / "values.npz", allow_pickle=False, **values)
    script = tmp_path / "run.py"
    script.write_text(OLD_SCRIPT)
    python = old_python(tmp_path / "old", version)
    command = [str(python), str(script), str(tmp_path), version]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    with np.load(tmp_path / "answers.npz") as result:
        for name, (right, allowed) in expected.items():
            argument = result[name + " outputs"]
            is_same = (argument == right) | (np.isnan(argument) & np.isnan(right))
            with np.errstate(invalid="ignore"):
                is_near = np.abs(argument - right) <= allowed
            assert (is_same | is_near).all(), name

"""How fast the ONNX graphs are, beside the floor of a session call.

Multiway trees of cubic memberships, each node with sets of its own, as in the study
that set the figures to beat (there without a guard for missing values). All numbers of
a line come from one process; the columns are interleaved and medians are shown.

    python benchmarks/onnx_speed.py
    python benchmarks/onnx_speed.py --nets

`--nets` compares the graphs of a tree, among them the layers of a network, in batches
of 100,000 rows in onnxruntime and in OpenVINO, if that is installed: the least
processor time of nine calls.
"""

from __future__ import annotations

import argparse
import importlib.util
import random
from collections.abc import Callable
from time import process_time_ns

import numpy as np
import numpy.typing as npt
from onnx import TensorProto, helper

from fuzzytree.benchmarking.clock import time_calls
from fuzzytree.benchmarking.machine import machine
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.exporters.onnx_graph import OnnxGraph
from fuzzytree.exporters.onnx_session import open_bare
from fuzzytree.model.contracts import Dtype
from fuzzytree.model.rulebase import Band, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.lowering import rules_from_tree

COLUMNS = tuple(f"x{number}" for number in range(1, 12))
TARGETS = {7: (12.1, 38.5), 100: (22.0, 708.0), 1000: (118.0, 10_700.0)}
"""Microseconds for one row and nanoseconds for a row of a batch: f32 clip slots."""

CHUNKS = (64, 128, 256, 512, 1024, 4096, 16384)
LARGEST = 2_000_000  # rows times leaves: 30 kB a row at 1000 leaves
SECONDS = 0.5
"""For each number of rows of a line."""


def multiway_tree(leaves: int, seed: int = 0) -> FuzzyTree:
    """Return a tree of three to six branches a node, balanced in size, cubic flanks."""
    chance = random.Random(seed)
    nodes: list[Node] = []
    terms: dict[str, list[Term]] = {name: [] for name in COLUMNS}
    ends: list[Leaf] = []

    def grow(size: int) -> tuple[str, int]:
        if size == 1:
            ends.append(Leaf(f"class {len(ends) % 3 + 1}"))
            return "leaf", len(ends)
        number = len(nodes)
        nodes.append(Node(COLUMNS[0], (), (), ()))
        count = min(size, chance.randint(3, 6))
        name = chance.choice(COLUMNS)
        cuts = sorted(chance.gauss(0.0, 1.0) for _ in range(count - 1))
        names = [f"{number} {position}" for position in range(count)]
        bounds = zip((None, *cuts), (*cuts, None), strict=True)
        for text, (low, high) in zip(names, bounds, strict=True):
            terms[name].append(Term(text, _band(low, high)))
        share = [size // count + (i < size % count) for i in range(count)]
        ways = [grow(part) for part in share]
        branches = tuple(
            Branch((text,), (), **{kind: way})
            for text, (kind, way) in zip(names, ways, strict=True)
        )
        nodes[number] = Node(name, tuple(cuts), tuple(range(count)), branches)
        return "node", number + 1

    grow(leaves)
    variables = tuple(Variable(name, tuple(terms[name])) for name in COLUMNS)
    classes = ("class 1", "class 2", "class 3")
    return FuzzyTree(
        f"multiway {leaves}",
        classes,
        variables,
        tuple(nodes),
        tuple(ends),
        columns=COLUMNS,
    )


def _band(low: float | None, high: float | None) -> Band:
    left = None if low is None else low - 0.5
    right = None if high is None else high + 0.5
    return Band(low, high, left, right)


def _call(content: bytes, output: str, rows: int, kind: type) -> Callable[[], object]:
    bare = open_bare(content)
    values: npt.NDArray[np.generic]
    values = np.random.default_rng(0).normal(size=(rows, len(COLUMNS))).astype(kind)
    return lambda: bare([output], {"inputs": values})


def floor(rows: int) -> Callable[[], object]:
    """Return a call of a session that copies its input."""
    shape: list[str | int | None] = ["rows", len(COLUMNS)]
    graph = helper.make_graph(
        [helper.make_node("Identity", ["inputs"], ["same"])],
        "floor",
        [helper.make_tensor_value_info("inputs", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("same", TensorProto.FLOAT, shape)],
    )
    made = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    )
    return _call(made.SerializeToString(), "same", rows, np.float32)


def study_graph(tree: FuzzyTree) -> bytes:
    """Return the study's own graph for the same memberships: `f32 clip slots [M,N]`.

    Smoothsteps on clipped ramps, one `Gather` for each proposition position, `Min`,
    `ArgMax`; reciprocals, no cap below 1, no guard: faster operations, other bits.
    """
    rules = rules_from_tree(tree)
    sheet = OnnxGraph(17)
    terms = [(v.name, t.name, t.shape) for v in rules.variables for t in v.terms]
    number = {(v, t): row for row, (v, t, _) in enumerate(terms)}
    block = sheet.node("Transpose", "inputs", perm=[1, 0])
    value = sheet.take(block, [COLUMNS.index(name) for name, _, _ in terms])
    sides: list[str] = []
    for side in ("left", "right"):
        flanks = [getattr(shape, side) for _, _, shape in terms]
        starts = [flank.end if flank else -1e9 for flank in flanks]
        rates = [1 / (flank.start - flank.end) if flank else 1.0 for flank in flanks]
        u = sheet.node("Sub", value, _column(sheet, starts))
        u = sheet.node("Mul", u, _column(sheet, rates))
        u = sheet.node("Clip", u, _number(sheet, 0.0), _number(sheet, 1.0))
        rest = sheet.node("Mul", u, _number(sheet, 2.0))
        rest = sheet.node("Sub", _number(sheet, 3.0), rest)
        sides.append(sheet.node("Mul", sheet.node("Mul", u, u), rest))
    degrees = sheet.node("Min", *sides)
    paths = [[number[c.variable, c.terms[0]] for c in r.when] for r in rules.rules]
    slots = [
        sheet.take(degrees, [path[min(k, len(path) - 1)] for path in paths])
        for k in range(max(map(len, paths)))
    ]
    sheet.node("ArgMax", sheet.node("Min", *slots), named="rule", axis=0, keepdims=0)
    shape: list[str | int | None] = ["rows", len(COLUMNS)]
    graph = helper.make_graph(
        sheet.nodes,
        "study",
        [helper.make_tensor_value_info("inputs", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("rule", TensorProto.INT64, ["rows"])],
        sheet.tensors,
    )
    made = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    )
    content: bytes = made.SerializeToString()
    return content


def _column(sheet: OnnxGraph, values: list[float]) -> str:
    return sheet.constant(np.array(values, np.float32).reshape(-1, 1), "column")


def _number(sheet: OnnxGraph, value: float) -> str:
    return sheet.constant(np.array(value, np.float32), "number")


BATCH = 100_000


def nets() -> None:
    """Print nanoseconds a row of each graph of a tree, in each runtime."""
    has_openvino = importlib.util.find_spec("openvino") is not None
    runtimes = ["onnxruntime", "openvino"] if has_openvino else ["onnxruntime"]
    found = machine(runtimes)
    versions = ", ".join(f"{name} {v}" for name, v in found.versions.items())
    print(f"{versions}; {found.processor}; ns a row of {BATCH}, one thread")
    dtypes: tuple[Dtype, ...] = ("float32", "float64")
    for leaves in (7, 50):
        tree = multiway_tree(leaves)
        for dtype in dtypes:
            kind = np.float32 if dtype == "float32" else np.float64
            for form in ("tree", "plain", "net"):
                content = write_onnx(
                    tree,
                    dtype=dtype,
                    signature="all",
                    outputs=("rule",),
                    plain=form == "plain",
                    net=form == "net",
                ).content
                calls = [_call(content, "rule", BATCH, kind)]
                if has_openvino and dtype == "float32" and form != "tree":
                    calls.append(_call_openvino(content, BATCH))
                times = " ".join(f"{_least_ns(call) / BATCH:>8.0f}" for call in calls)
                print(f"  {leaves:>3} leaves {dtype} {form:6}{times}")


def _least_ns(call: Callable[[], object]) -> int:
    times: list[int] = []
    for _ in range(9):
        start = process_time_ns()
        call()
        times.append(process_time_ns() - start)
    return min(times)


def _call_openvino(content: bytes, rows: int) -> Callable[[], object]:
    import openvino

    core = openvino.Core()
    settings = {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": 1}
    model = core.compile_model(core.read_model(content), "CPU", settings)
    drawn = np.random.default_rng(0).normal(size=(rows, len(COLUMNS)))
    values = drawn.astype(np.float32)
    return lambda: model([values])


def main() -> None:
    """Print one table for rules and trees of each size, or that of the nets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nets", action="store_true", help="the graphs of trees")
    if parser.parse_args().nets:
        nets()
        return
    found = machine(["onnxruntime"])
    load = ", ".join(f"{value:.2f}" for value in found.load_before)
    versions = ", ".join(f"{name} {v}" for name, v in found.versions.items())
    print(f"{found.python}, {versions}; {found.processor}, load {load}")
    print(f"{'':26}{'one row':>9}  {'x floor':>8}  batch, ns a row, by rows a call")
    print(f"{'':26}{'us':>9}  {'':>8}  " + "".join(f"{rows:>8}" for rows in CHUNKS))
    for leaves, (one, batch) in TARGETS.items():
        print(f"{leaves} leaves; to beat in float32: {one} us, {batch} ns a row")
        tree = multiway_tree(leaves)
        _line("  study float32", study_graph(tree), "float32", leaves)
        dtypes: tuple[Dtype, ...] = ("float32", "mixed", "float64")
        for dtype in dtypes:
            for what, model in (("rules", rules_from_tree(tree)), ("tree", tree)):
                made = write_onnx(
                    model, dtype=dtype, signature="all", outputs=("rule",), verify=False
                )
                _line(f"  {what} {dtype}", made.content, dtype, leaves)


def _line(title: str, content: bytes, dtype: Dtype, leaves: int) -> None:
    kind = np.float32 if dtype == "float32" else np.float64
    sizes = [n for n in CHUNKS if n * leaves <= LARGEST]
    # One row is measured apart: large calls would throw it out of the cache.
    single = time_calls(
        {"floor": floor(1), "one": _call(content, "rule", 1, kind)}, rows=1
    ).timings
    one, least = single["one"].median_ns, single["floor"].median_ns
    calls = {str(n): _call(content, "rule", n, kind) for n in sizes}
    many = time_calls(calls, rows=1, seconds=SECONDS * len(sizes)).timings
    batch = "".join(f"{many[str(rows)].median_ns / rows:>8.0f}" for rows in sizes)
    print(f"{title:26}{one / 1e3:>9.1f}  {one / least:>8.1f}  {batch}")


if __name__ == "__main__":
    main()

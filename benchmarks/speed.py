"""How fast each runtime answers, as ratios to scikit-learn in one run.

    python benchmarks/speed.py [--quick] [--leaves 7 1000] [--only descent rules]

A decision tree of scikit-learn is grown on synthetic data and carried over to a
FuzzyTree with the same cuts, so that both answer the same question. All candidates are
timed in turn, again and again, and the median of each counts. Two kinds of data:
few classes, and a class for each leaf, as a fuzzy tree has one pattern for each leaf.

`--only learned` compares a learned tree of `--leaves` with one of scikit-learn that has
as many, by what users call: `predict`, `predict_proba` and `fuzzytree.run`. Its times
are processor time.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping
from functools import partial
from time import process_time_ns

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt
from sklearn.tree import DecisionTreeClassifier
from trees import COLUMNS, grow, tree_of, walk

import fuzzytree
from fuzzytree.benchmarking.clock import time_calls
from fuzzytree.benchmarking.machine import load_averages, machine
from fuzzytree.estimator import FuzzyTreeClassifier
from fuzzytree.model.contracts import Run
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.native import load, load_best_first
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree

Singles = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Candidates = Mapping[str, Callable[[], object]]


def main() -> None:
    """Print the tables that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer rows and rounds")
    parser.add_argument("--leaves", type=int, nargs="+", default=[7, 1000])
    parser.add_argument("--only", nargs="+", default=["descent", "rules"])
    options = parser.parse_args()
    print(_machine())
    rounds = 3 if options.quick else 7
    if "descent" in options.only:
        for leaves in options.leaves:
            for is_many in (False, True):
                _descent(leaves, is_many=is_many, rounds=rounds, quick=options.quick)
    if "learned" in options.only:
        for leaves in options.leaves:
            for columns in (1, None):
                _learned(leaves, columns, quick=options.quick)
    if "rules" in options.only:
        for count in (7, 100, 1000):
            for kind in ("relative", "raw"):
                _rules(count, raw=kind == "raw", rounds=rounds)
    print(f"load average at the end: {_load()}")


def _machine() -> str:
    found = machine(["scikit-learn", "onnx", "onnxruntime", "skl2onnx"])
    versions = [f"{name} {version}" for name, version in found.versions.items()]
    return (
        f"{found.python}, {', '.join(versions)}\n"
        f"{found.processor}, {found.cores} cores, one thread; "
        f"load average at the start: {_load()}"
    )


def _load() -> str:
    return " ".join(f"{value:.2f}" for value in load_averages())


def _descent(leaves: int, *, is_many: bool, rounds: int, quick: bool) -> None:
    grown = grow(leaves, is_many=is_many)
    tree = tree_of(grown)
    run = load(tree)
    kind = "a class for each leaf" if is_many else "3 classes"
    print(
        f"\n## descent, {len(tree.leaves)} leaves, depth {grown.get_depth()}, {kind}: "
        "ratio to scikit-learn's predict on float32"
    )
    for count in (1, 100_000) if quick else (1, 100_000, 1_000_000):
        if is_many and leaves > 100 and count > 100_000:
            continue  # predict would need rows x classes doubles
        drawn = np.random.default_rng(1).normal(size=(count, len(COLUMNS)))
        single = drawn.astype(np.float32)
        double = single.astype(np.float64)
        values = np.ascontiguousarray(double[:, _needed(tree)].T)
        _compare_answers(run, values, grown, single)
        rows_first = values.T.copy().T
        candidates: dict[str, Callable[[], object]] = {
            "scikit-learn predict float32": partial(grown.predict, single),
            "scikit-learn predict float64": partial(grown.predict, double),
            "scikit-learn tree_.apply": partial(grown.tree_.apply, single),
            "native descent": partial(run, values),
            "native descent, rows first": partial(run, rows_first),
            "floor: sum of the columns": partial(np.sum, values),
        }
        if count == 1:
            candidates["generated Python"] = _generated(tree, values)
        if not (is_many and leaves > 100):
            candidates["skl2onnx in onnxruntime"] = _skl2onnx(grown, single)
        candidates.update(_onnx("tree", tree, values))
        _table(candidates, count, rounds if count > 1 else 20)


def _learned(leaves: int, columns: int | None, *, quick: bool) -> None:
    """Compare a learned tree, whose nodes test one column or combinations of many."""
    chance = np.random.default_rng(0)
    table = chance.normal(size=(20_000, 8))
    wave = np.sin(3.0 * table[:, 0]) + np.cos(2.0 * table[:, 1] * table[:, 2])
    score = wave + np.sin(2.0 * table[:, 3] + table[:, 4])
    score += 0.3 * chance.normal(size=len(table))
    labels = np.digitize(score, [-0.7, 0.2, 1.1])
    ours = FuzzyTreeClassifier(leaves=leaves, min_rows=5, columns_per_node=columns)
    ours.fit(table, labels)
    count = ours.get_n_leaves()
    peer = DecisionTreeClassifier(max_leaf_nodes=count, random_state=0)
    peer.fit(table, labels)
    tree = ours.tree_
    print(
        f"\n## learned, {count} leaves, {len(tree.variables)} variables, depth "
        f"{ours.get_depth()}, sharpness {tree.semantics.sharpness}"
    )
    for rows in (1, 100, 10_000, 100_000 if quick else 1_000_000):
        values = chance.normal(size=(rows, 8))
        calls: dict[str, Callable[[], object]] = {
            "scikit-learn predict": partial(peer.predict, values),
            "our predict": partial(ours.predict, values),
            "fuzzytree.run": partial(fuzzytree.run, tree, values),
            "scikit-learn predict_proba": partial(peer.predict_proba, values),
            "our predict_proba": partial(ours.predict_proba, values),
        }
        repeats = max(500 // rows, 1)
        taken = {name: _processor_ns(call, repeats) for name, call in calls.items()}
        first = next(iter(taken.values()))
        print(f"\n{'rows ' + format(rows, ','):34} {'ratio':>9} {'ns a row':>12}")
        for name, time in taken.items():
            print(f"{name:34} {time / first:9.4f} {time / rows:12.1f}")


def _processor_ns(call: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of a call, of three rounds after a first one."""
    call()
    times: list[int] = []
    for _ in range(3):
        start = process_time_ns()
        for _ in range(repeats):
            call()
        times.append(process_time_ns() - start)
    return min(times) / repeats


def _rules(count: int, *, raw: bool, rounds: int) -> None:
    tree = tree_of(grow(count, is_many=False))
    rules = rules_from_tree(tree, "raw" if raw else "relative")
    run, best = load(rules), load_best_first(rules)
    print(
        f"\n## rules, {count} {rules.kind}, min: ratio to firing all rules "
        "in the native runtime"
    )
    for rows in (1, max(2_000_000 // count, 2_000)):
        values = np.random.default_rng(1).normal(size=(len(rules.inputs), rows))
        fired, found = run(values), best(values)
        assert np.array_equal(fired.rule, found.rule)
        assert np.array_equal(fired.status, found.status)
        candidates: dict[str, Callable[[], object]] = {
            "native float64": partial(run, values),
            "best-first": partial(best, values),
            "floor: sum of the columns": partial(np.sum, values),
        }
        for name in ("native mixed", "native float32"):
            candidates[name] = partial(find_runtime(name).load(rules), values)
        candidates.update(_onnx("rules", rules, values))
        _table(candidates, rows, rounds if rows > 1 else 10)
    few = values[:, :5].copy()
    slow = find_runtime("reference").load(rules)
    _table({"native float64": lambda: run(few), "reference": lambda: slow(few)}, 5, 1)
    many = np.random.default_rng(2).normal(size=(len(rules.inputs), 100_000))
    part = many[:, : values.shape[1]].copy()
    calls = {"native": lambda: run(part), "best": lambda: best(many)}
    ours = time_calls(calls, rows=part.shape[1], rounds=rounds).timings
    ratio = ours["native"].median_ns / ours["best"].median_ns
    ratio *= many.shape[1] / part.shape[1]
    print(f"best-first on 100,000 rows is {ratio:.1f} times as fast a row as firing")


def _table(candidates: Candidates, rows: int, rounds: int) -> None:
    times = time_calls(candidates, rows=rows, rounds=rounds).timings
    first = next(iter(times.values()))
    print(f"\n{'rows ' + format(rows, ','):34} {'ratio':>9} {'ns a row':>12}")
    for name, timing in times.items():
        print(
            f"{name:34} {timing.median_ns / first.median_ns:9.4f} "
            f"{timing.median_ns / rows:12.1f}"
        )


def _needed(tree: FuzzyTree) -> list[int]:
    return [COLUMNS.index(name) for name in tree.inputs]


def _compare_answers(
    run: Run, values: Floats, grown: DecisionTreeClassifier, single: Singles
) -> None:
    places = grown.apply(single[:20_000])
    numbers = run(values[:, :20_000]).rule
    order = [place for place in walk(grown) if grown.tree_.feature[place] < 0]
    assert np.array_equal(places, np.array(order)[numbers - 1]), "answers differ"


def _skl2onnx(grown: DecisionTreeClassifier, single: Singles) -> Callable[[], object]:
    import onnxruntime
    from skl2onnx import to_onnx

    model = to_onnx(grown, single[:1], options={"zipmap": False})
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), _options(), providers=["CPUExecutionProvider"]
    )
    return lambda: session.run(["label"], {"X": single})


def _options() -> object:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return options


def _onnx(what: str, model: FuzzyTree | RuleBase, values: Floats) -> Candidates:
    """Return our own graphs in onnxruntime, and the floor of a session call."""
    found: dict[str, Callable[[], object]] = {}
    for dtype in ("float64", "mixed", "float32"):
        runtime = find_runtime(f"onnxruntime {dtype}")
        if what in runtime.runs:
            found[f"our {what} in {runtime.name}"] = partial(
                runtime.load(model), values
            )
    found["floor: an empty session call"] = _empty_call(values)
    return found


def _empty_call(values: Floats) -> Callable[[], object]:
    import onnxruntime
    from onnx import TensorProto, helper

    node = helper.make_node("Identity", ["x"], ["y"])
    shapes = [
        helper.make_tensor_value_info(name, TensorProto.DOUBLE, [None, None])
        for name in ("x", "y")
    ]
    graph = helper.make_graph([node], "empty", shapes[:1], shapes[1:])
    model = helper.make_model(
        graph, ir_version=8, opset_imports=[helper.make_opsetid("", 17)]
    )
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), _options(), providers=["CPUExecutionProvider"]
    )
    rows = np.ascontiguousarray(values[:, :1])
    return lambda: session.run(None, {"x": rows})


def _generated(tree: FuzzyTree, values: Floats) -> Callable[[], object]:
    run = find_runtime("python").load(tree)
    return lambda: run(values)


if __name__ == "__main__":
    main()

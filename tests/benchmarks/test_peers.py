"""Peers answer the same question as our own runtimes, or say why they cannot."""

from __future__ import annotations

import importlib.util
import math
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import peers as module
import pytest
from msgspec.structs import replace
from peers import TREE_PEERS, engines, peers
from peers.crisp import nodes_of
from peers.sampling import lines_bound

import fuzzytree as ft
from fuzzytree.benchmarking.candidates import found_of, questions
from fuzzytree.benchmarking.records import Candidate, CandidateOutput, LoadedCandidate
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Document, Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.numerics.oracle import decide
from fuzzytree.runtimes.degrees import shape_degrees
from fuzzytree.runtimes.native import load as load_native
from fuzzytree.runtimes.reference import RUNTIMES as REFERENCE
from fuzzytree.runtimes.rows import axis_lines, plan_axes
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import probe_values, random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DOUBLE = ("treelite", "m2cgen python", "m2cgen c", "onnx evaluator")
SINGLE = ("scikit-learn", "scikit-learn core", "skl2onnx")
ENGINES = ("pyfuzzylite", "simpful")


def candidate(model: Document, name: str) -> Candidate:
    """Return the peer of that name and question, or skip with what is missing."""
    found, omitted = peers(model)
    by_name = {one.name: one for one in found}
    if name in by_name:
        return by_name[name]
    short = name.partition(":")[0]
    why = next(one.why for one in omitted if one.name == short)
    pytest.skip(f"{short}: {why}")


def _with_all_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every package be found: listing peers imports none of them."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: object())


def answer(model: Model, name: str, values: FloatArray) -> CandidateOutput:
    return candidate(model, name).load(1).answer(values)


def native(model: Model, values: FloatArray) -> CandidateOutput:
    return found_of(load_native(model)(values), model)


def in_single(tree: FuzzyTree, values: FloatArray) -> IntArray:
    """Follow the cuts of a tree, in double, by axis values rounded to float32."""
    axes = plan_axes(tree.variables)
    with np.errstate(all="ignore"):
        lines = axis_lines(axes, values).astype(np.float32).astype(np.float64)
    labels: list[int] = []
    for row in lines.T:
        if not np.isfinite(row).all():
            labels.append(-1)
            continue
        number, leaf = 1, None if tree.nodes else 1
        while leaf is None:
            node = tree.nodes[number - 1]
            value = row[axes.line[node.variable]]
            interval = sum(value > cut for cut in node.cuts)
            branch = node.branches[node.owners[interval]]
            number, leaf = branch.node or 0, branch.leaf
        labels.append(tree.classes.index(tree.leaves[leaf - 1].label))
    return np.array(labels)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", DOUBLE)
@pytest.mark.parametrize("seed", range(4))
def test_a_peer_in_double_gives_the_trees_classes(name: str, seed: int) -> None:
    tree = random_tree(seed, leaves=5 + 4 * seed, classes=2 + seed)
    values = probe_values(tree, 400)
    found = answer(tree, f"{name}: tree", values)
    assert np.array_equal(found.labels, native(tree, values).labels)


@pytest.mark.parametrize("name", SINGLE)
@pytest.mark.parametrize("seed", range(4))
def test_a_peer_in_single_differs_by_rounding_its_inputs_alone(
    name: str, seed: int
) -> None:
    tree = random_tree(seed, leaves=5 + 4 * seed, classes=2 + seed)
    values = probe_values(tree, 400)
    found = answer(tree, f"{name}: tree", values)
    assert np.array_equal(found.labels, in_single(tree, values))
    assert np.any(found.labels != native(tree, values).labels)


@pytest.mark.parametrize("name", [*DOUBLE, *SINGLE])
def test_a_wrong_cut_in_a_peer_is_seen(name: str) -> None:
    tree = random_tree(3, leaves=9, combinations=0.0)
    node = tree.nodes[0]
    moved = node.cuts[0] + 0.01 * abs(node.cuts[0])
    wrong = moved_cut(tree, moved)
    values = probe_values(tree, 400)
    labels = answer(wrong, f"{name}: tree", values).labels
    expected = (
        in_single(tree, values) if name in SINGLE else native(tree, values).labels
    )
    assert np.any(labels != expected)


def moved_cut(tree: FuzzyTree, cut: float) -> FuzzyTree:
    """Return a tree whose root has another cut, and no terms that would contradict."""
    root = tree.nodes[0]
    shifted = tuple(cut + other - root.cuts[0] for other in root.cuts)
    bounds = dict(zip(root.cuts, shifted, strict=True))

    def moved(shape: Shape) -> Shape:
        assert isinstance(shape, Band)
        low = None if shape.low is None else bounds[shape.low]
        high = None if shape.high is None else bounds[shape.high]
        return Band(low, high)

    mine = {term for branch in root.branches for term in branch.terms}
    variables = tuple(
        replace(
            v,
            terms=tuple(
                Term(t.name, moved(t.shape)) if t.name in mine else t for t in v.terms
            ),
        )
        if v.name == root.variable
        else v
        for v in tree.variables
    )
    nodes = (replace(root, cuts=shifted), *tree.nodes[1:])
    return replace(tree, variables=variables, nodes=nodes)


@pytest.mark.parametrize("name", [*DOUBLE, *SINGLE])
def test_a_missing_value_gets_the_models_answer(name: str) -> None:
    tree = random_tree(2, semantics=Semantics(missing="class 2"))
    values = np.zeros((len(tree.inputs), 4))
    values[:, 1:] = [math.nan, math.inf, -math.inf]
    labels = answer(tree, f"{name}: tree", values).labels
    assert labels[1:].tolist() == [1, 1, 1]
    assert labels[0] == native(tree, values[:, :1]).labels[0]


@pytest.mark.parametrize("name", SINGLE)
def test_a_value_beyond_float32_is_missing_there(name: str) -> None:
    tree = random_tree(2)
    values = np.full((len(tree.inputs), 2), [1e39, 1.0])
    assert answer(tree, f"{name}: tree", values).labels[0] == -1


@pytest.mark.parametrize("peer", [peer.name for peer in TREE_PEERS])
def test_two_classes_are_distinguished(peer: str) -> None:
    tree = random_tree(4, leaves=6, classes=2, combinations=0.0)
    made = probe_values(tree, 400)[:, -150:-50]
    values = np.round(made * 16.0) / 16.0  # float32 holds them
    labels = answer(tree, f"{peer}: tree", values).labels
    assert set(labels.tolist()) == {0, 1}
    assert np.array_equal(labels, native(tree, values).labels)


@pytest.mark.parametrize("peer", [peer.name for peer in TREE_PEERS])
def test_a_model_of_one_class_has_one_answer(peer: str) -> None:
    tree = random_tree(1, leaves=4, classes=1)
    values = np.zeros((len(tree.inputs), 3))
    assert answer(tree, f"{peer}: tree", values).labels.tolist() == [0, 0, 0]


@pytest.mark.parametrize("peer", [peer.name for peer in TREE_PEERS])
def test_threads_and_rows_do_not_change_a_peers_classes(peer: str) -> None:
    tree = random_tree(7, leaves=20)
    values = probe_values(tree, 400)
    one = candidate(tree, f"{peer}: tree")
    try:
        whole = one.load(2).answer(values).labels
    except LossError as error:
        pytest.skip(str(error))
    single = one.load(1)
    rows = [single.answer(values[:, [k]]).labels[0] for k in range(0, 400, 9)]
    assert whole[::9].tolist() == rows


@pytest.mark.parametrize("seed", [0, 1])
def test_a_timed_call_gives_the_answers_that_are_judged(seed: int) -> None:
    tree = random_tree(seed, leaves=8, combinations=float(seed))
    values = np.array([np.linspace(-1.0, 1.0, 9)] * len(tree.inputs))
    for width in (1, 9):
        part = np.ascontiguousarray(values[:, :width])
        for peer in TREE_PEERS:
            loaded = candidate(tree, f"{peer.name}: tree").load(1)
            timed = np.asarray(loaded.call(part)()).ravel().tolist()
            assert timed == loaded.answer(part).labels.tolist(), peer.name


def shared() -> FuzzyTree:
    """Return a tree whose root gives two intervals to one node."""
    x = Variable(
        "x",
        (
            Term("a", Band(None, 0.0, None, 1.0)),
            Term("b", Band(0.0, 1.0, -1.0, 2.0)),
            Term("c", Band(1.0, None, 0.0, None)),
        ),
    )
    y = Variable(
        "y",
        (
            Term("low", Band(None, 0.5, None, 1.0)),
            Term("high", Band(0.5, None, 0.0, None)),
        ),
    )
    root = Node(
        "x", (0.0, 1.0), (0, 1, 0), (Branch(("a", "c"), node=2), Branch(("b",), leaf=3))
    )
    below = Node(
        "y", (0.5,), (0, 1), (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    )
    leaves = (Leaf("k"), Leaf("l"), Leaf("m"))
    return FuzzyTree("shared", ("k", "l", "m"), (x, y), (root, below), leaves)


def test_a_branch_of_two_intervals_is_written_twice() -> None:
    tree = shared()
    nodes = nodes_of(tree, plan_axes(tree.variables))
    assert nodes.leaf[nodes.is_leaf].tolist() == [1, 2, 3, 1, 2]
    values = np.array([[-1.0, 0.0, 0.5, 1.0, 1.5, 1.5], [0.0, 1.0, 0.0, 0.0, 0.5, 0.6]])
    for peer in TREE_PEERS:
        labels = answer(tree, f"{peer.name}: tree", values).labels
        assert labels.tolist() == [0, 1, 2, 2, 0, 1], peer.name


def test_a_tree_of_one_leaf_leaves_peers_nothing_to_do() -> None:
    found, omitted = peers(random_tree(0, leaves=1))
    names = {one.name for one in found}
    assert {"scikit-learn: tree", "treelite: tree"}.isdisjoint(names)
    assert {one.why for one in omitted if one.name == "scikit-learn"} == {
        "the tree has no node"
    }


def chain(count: int) -> FuzzyTree:
    """Return a tree that tests the same input again and again."""
    terms: list[Term] = []
    nodes: list[Node] = []
    for k in range(count):
        cut = float(k)
        terms.append(Term(f"l{k}", Band(None, cut, None, cut + 1.0)))
        terms.append(Term(f"h{k}", Band(cut, None, cut - 1.0, None)))
        onward = Branch((f"h{k}",), node=k + 2)
        if k == count - 1:
            onward = Branch((f"h{k}",), leaf=count + 1)
        branches = (Branch((f"l{k}",), leaf=k + 1), onward)
        nodes.append(Node("x", (cut,), (0, 1), branches))
    leaves = tuple(Leaf("ab"[k % 2]) for k in range(count + 1))
    x = Variable("x", tuple(terms))
    return FuzzyTree("chain", ("a", "b"), (x,), tuple(nodes), leaves)


def loaded_deep(peer: str, tree: FuzzyTree) -> LoadedCandidate:
    """Load a tree in a peer, without preparing its rules for others."""
    candidate(random_tree(1), f"{peer}: tree")  # or skip
    (load,) = [one.load for one in TREE_PEERS if one.name == peer]
    return load(tree, 1)


@pytest.mark.parametrize("peer", [peer.name for peer in TREE_PEERS])
def test_a_deep_tree_is_followed_or_refused_in_a_sentence(peer: str) -> None:
    tree = chain(1100)
    if peer.startswith("m2cgen"):
        with pytest.raises(LossError) as caught:
            loaded_deep(peer, tree)
        assert str(caught.value) == (
            "cannot run chain as m2cgen: a path has 1100 nodes: "
            "it is written by recursion"
        )
        return
    values = np.linspace(-0.5, 1100.5, 300)[None]
    found = loaded_deep(peer, tree).answer(values)
    assert np.array_equal(found.labels, native(tree, values).labels)


def test_python_takes_fewer_ifs_within_each_other_than_m2cgen_writes() -> None:
    with pytest.raises(LossError) as caught:
        loaded_deep("m2cgen python", chain(150))
    assert str(caught.value) == (
        "cannot run chain as m2cgen: a path has 150 nodes: "
        "Python does not take so many ifs within each other"
    )


def rules_cases() -> list[RuleBase]:
    cases = [
        rules_from_tree(random_tree(seed, leaves=6, semantics=semantics), kind)
        for seed, semantics in enumerate(
            (
                Semantics(),
                Semantics("product"),
                Semantics("minimum", "class 1", "class 2"),
            )
        )
        for kind in ("relative", "raw")
    ]
    cases.append(with_points(cases[0], 5))
    cases.append(negated(Semantics()))
    return cases


def negated(semantics: Semantics, *terms: str) -> RuleBase:
    """Return rules with a NOT in every place, on two variables."""
    low, high = Points((0.0, 1.0), (1.0, 0.0)), Points((0.0, 1.0), (0.0, 1.0))
    middle = LR(0.5, Side(0.25, (0.5,)), Side(0.25, (0.5,)))
    named = (Term("low", low), Term("middle", middle), Term("high", high))
    x, y = Variable("x", named), Variable("y", named)
    several = terms or ("low", "middle")
    rules = (
        Rule(
            (Proposition("x", ("low",), hedges=("not",)), Proposition("y", ("low",))),
            "a",
        ),
        Rule(
            (Proposition("y", ("high",)), Proposition("x", several, hedges=("not",))),
            "b",
        ),
        Rule(
            (
                Proposition("x", ("high",), hedges=("not",)),
                Proposition("y", ("high",), hedges=("not",)),
            ),
            "c",
        ),
        Rule(
            (Proposition("x", ("low", "high")), Proposition("y", ("middle", "high"))),
            "a",
        ),
    )
    return RuleBase("negated", ("a", "b", "c"), (x, y), rules, semantics)


@pytest.mark.one_in(6)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", range(8))
def test_an_engine_keeps_the_certified_bound_of_its_lines(
    engine: str, case: int
) -> None:
    rules = rules_cases()[case]
    values = probe_values(rules, 250)
    found = answer(rules, f"{engine}: rules", values)
    want = REFERENCE[0].load(rules)(values)
    assert found.strengths is not None
    assert want.strengths is not None
    points = engines.FINE if engine == "pyfuzzylite" else engines.COARSE
    terms = engines.sampled_terms(rules, points)
    bound, _ = lines_bound(rules, {key: one.error for key, one in terms.items()})
    missing = np.isnan(want.strengths[0])
    assert np.array_equal(np.isnan(found.strengths[0]), missing)
    differences = np.abs(found.strengths - want.strengths)[:, ~missing]
    assert differences.max() <= bound + 1e-15
    margin = decide(rules, values).margin
    flips = found.labels != native(rules, values).labels
    assert np.all(margin[flips] <= 2.0 * bound + 1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_relative_rules_keep_their_decisions_as_lines(engine: str) -> None:
    tree = random_tree(6, leaves=9, combinations=0.0)
    rules = rules_from_tree(tree)
    values = probe_values(rules, 300)
    values = values[:, decide(rules, values).margin > 1e-12]
    assert values.shape[1] > 200
    labels = answer(rules, f"{engine}: rules", values).labels
    assert np.array_equal(labels, native(tree, values).labels)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_wrong_term_in_an_engine_is_seen(engine: str) -> None:
    rules = negated(Semantics())
    other = Term("low", Points((0.0, 1.0), (1.0, 0.1)))
    x = replace(rules.variables[0], terms=(other, *rules.variables[0].terms[1:]))
    wrong = replace(rules, variables=(x, rules.variables[1]))
    values = probe_values(rules, 100)
    found = answer(wrong, f"{engine}: rules", values).strengths
    want = REFERENCE[0].load(rules)(values).strengths
    assert found is not None
    assert want is not None
    assert np.nanmax(np.abs(found - want)) > 0.05


@pytest.mark.parametrize("case", range(8))
def test_the_onnx_evaluator_gives_equal_bits(case: int) -> None:
    rules = rules_cases()[case]
    values = probe_values(rules, 250)
    found = answer(rules, "onnx evaluator: rules", values)
    want = native(rules, values)
    assert found.strengths is not None
    assert want.strengths is not None
    assert np.array_equal(found.strengths, want.strengths, equal_nan=True)
    assert np.array_equal(found.labels, want.labels)


@pytest.mark.parametrize("name", [*ENGINES, "onnx evaluator"])
def test_a_timed_call_of_rules_runs_on_one_row_and_on_many(name: str) -> None:
    rules = rules_from_tree(random_tree(1, combinations=1.0))
    loaded = candidate(rules, f"{name}: rules").load(1)
    for width in (1, 5):
        loaded.call(np.ones((len(rules.inputs), width)))()


@pytest.mark.parametrize("points", [engines.COARSE, engines.FINE])
def test_the_lines_of_a_term_stay_within_their_error(points: int) -> None:
    tree = random_tree(11, leaves=10)
    variables = (*tree.variables, *(Variable(s.variable, s.terms) for s in tree.sets))
    for variable in variables:
        for term in variable.terms:
            one = engines.knots(term.shape, points)
            between = np.linspace(one.values[0], one.values[-1], 5001)
            lines = np.interp(between, one.values, one.degrees)
            worst = np.abs(lines - shape_degrees(term.shape, between)).max()
            assert worst <= one.error


def test_level_stretches_have_no_points_of_their_own() -> None:
    step = engines.knots(Points((1.0, 1.0), (0.0, 1.0)), engines.COARSE)
    assert step.degrees.tolist() == [0.0, 0.0, 1.0]  # an end, at 1 and above it


@pytest.mark.parametrize("engine", ENGINES)
def test_a_rule_without_a_proposition_is_refused(engine: str) -> None:
    x = Variable("x", (Term("low", Band(None, 0.0)),))
    rules = RuleBase("bare", ("a",), (x,), (Rule((), "a"),))
    with pytest.raises(LossError) as caught:
        candidate(rules, f"{engine}: rules").load(1)
    assert (
        str(caught.value) == f"cannot run bare as {engine}: rule 1 has no proposition"
    )


def test_pyfuzzylite_refuses_a_negated_or_under_a_product() -> None:
    rules = negated(Semantics("product"))
    with pytest.raises(LossError) as caught:
        candidate(rules, "pyfuzzylite: rules").load(1)
    assert str(caught.value) == (
        "cannot run negated as pyfuzzylite: rule 2 negates several terms at once"
    )


def test_simpful_refuses_what_takes_seconds_for_a_row() -> None:
    rules = rules_from_tree(random_tree(0, leaves=60, classes=5), "raw")
    with pytest.raises(LossError, match=r"it would take about \d+ s for one row"):
        candidate(rules, "simpful: rules").load(1)


def test_engines_are_left_out_of_models_with_thousands_of_terms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(engines, "MOST_TERMS", 5)
    _with_all_installed(monkeypatch)
    found, omitted = peers(negated(Semantics()))
    assert [one.name for one in found] == ["onnx evaluator: rules"]
    assert [(one.name, one.why) for one in omitted] == [
        (f"{name}: rules", "6 terms, and 5 are the most to make points of")
        for name in ENGINES
    ]


def test_simpful_has_no_bound_where_a_slope_overflows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _with_all_installed(monkeypatch)
    x = Variable("x", (Term("low", Band(None, 0.0)), Term("high", Band(0.0, None))))
    rules = RuleBase(
        "zero",
        ("a", "b"),
        (x,),
        (
            Rule((Proposition("x", ("low",)),), "a"),
            Rule((Proposition("x", ("high",)),), "b"),
        ),
    )
    found, _ = peers(rules, lambda _rules, _dtype: (0.0, "the model"))
    bounds = {one.name: one.bound() for one in found if one.bound}
    assert bounds["simpful: rules"] is None
    assert bounds["pyfuzzylite: rules"] is not None


def test_a_bound_names_both_of_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    _with_all_installed(monkeypatch)
    rules = rules_from_tree(random_tree(1))
    found, _ = peers(rules, lambda _rules, _dtype: (0.5, "the model's double"))
    bounds = {one.name: one.bound() for one in found if one.bound}
    bound = bounds["pyfuzzylite: rules"]
    assert bound is not None
    assert 0.5 < bound[0] < 0.51
    assert bound[1] == (
        "the model's double, and largest error of lines between the points of the terms"
    )
    assert bounds["onnx evaluator: rules"] == (0.5, "the model's double")


def test_every_question_has_its_peers() -> None:
    tree = random_tree(1)
    found, omitted = peers(tree)
    if omitted:
        pytest.skip(f"not installed: {', '.join(one.name for one in omitted)}")
    names = [one.name for one in found]
    assert len(names) == len(set(names)) == len(TREE_PEERS) + 7
    for question in questions(tree):
        assert f"onnx evaluator: {question}" in names
    assert all(one.kind == "peer" and one.modules for one in found)


def test_every_peer_can_be_sent_to_another_process() -> None:
    values = np.zeros((4, 2))
    for one in peers(random_tree(1))[0]:
        load = pickle.loads(pickle.dumps(one.load))
        assert load(1).answer(values).labels.shape == (2,)


Present = Callable[[str], object]


@pytest.mark.parametrize(
    ("module", "names", "why"),
    [
        ("treelite", ["treelite"], "not installed (pip install treelite)"),
        ("simpful", ["simpful"], "not installed (pip install simpful)"),
        (
            "fuzzylite",
            ["pyfuzzylite"],
            "not installed (pip install --no-deps pyfuzzylite)",
        ),
        (
            "sklearn",
            [
                "scikit-learn",
                "scikit-learn core",
                "skl2onnx",
                "m2cgen python",
                "m2cgen c",
            ],
            "not installed (pip install scikit-learn)",
        ),
        ("onnx", ["skl2onnx", "onnx evaluator"], "not installed (pip install onnx)"),
    ],
)
def test_a_peer_that_is_not_installed_is_named_with_what_installs_it(
    module: str, names: Sequence[str], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    find: Present = importlib.util.find_spec

    def absent(name: str) -> object:
        return None if name == module else find(name)

    monkeypatch.setattr(importlib.util, "find_spec", absent)
    _, omitted = peers(random_tree(1))
    assert [one.name for one in omitted if one.why == why] == names


def test_generated_c_without_a_compiler_is_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _with_all_installed(monkeypatch)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    _, omitted = peers(random_tree(1))
    assert [(one.name, one.why) for one in omitted] == [
        ("m2cgen c", "the program 'gcc' is not installed")
    ]


def test_the_list_of_peers_is_made_without_loading_any() -> None:
    code = (
        "from fuzzytree.testing import random_tree; "
        "from fuzzytree.benchmarking.candidates import load_peers; import sys; "
        "load_peers(sys.argv[1])(random_tree(1), lambda rules, dtype: None); "
        "import fuzzytree.report.svg_bench; "
        "names = 'sklearn skl2onnx treelite m2cgen fuzzylite simpful onnx onnxruntime "
        "matplotlib'; print([name for name in names.split() if name in sys.modules])"
    )
    command = [sys.executable, "-c", code, str(Path(str(module.__file__)).parent)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[]\n", "")


SYSTEMS = ("pyfuzzylite", "fuzzylite c++", "ferrifuzz", "simpful", "scikit-fuzzy")
NEAR = {"pyfuzzylite": 1e-9, "ferrifuzz": 1e-9, "simpful": 1e-9, "fuzzylite c++": 1e-4}
"""How near the engines come; fuzzylite in C++ counts by floats within 1e-6."""

MAMDANI = """
Engine: fan
InputVariable: heat
  range: 0.000 10.000
  term: low Ramp 10.000 0.000
  term: high Ramp 0.000 10.000
InputVariable: damp
  range: 0.000 10.000
  term: low Ramp 10.000 0.000
  term: high Ramp 0.000 10.000
OutputVariable: speed
  range: 0.000 100.000
  default: nan
  aggregation: Maximum
  defuzzifier: Centroid 200
  term: slow Triangle 0.000 25.000 50.000
  term: fast Triangle 50.000 75.000 100.000
RuleBlock: rules
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
  rule: if heat is high and damp is not low then speed is fast
  rule: if heat is low or damp is low then speed is slow
"""


def inner_values(count: int, *, high: float = 10.0) -> FloatArray:
    """Return rows within the range, one with a missing value among them."""
    values = np.random.default_rng(0).uniform(0.0, high, (2, count))
    values[0, 1] = np.nan
    return values


def both_outputs(name: str, file: Path) -> tuple[FloatArray, FloatArray]:
    """Return the outputs of an engine, and the right ones, of 20 rows."""
    system = ft.read(file).model
    values = inner_values(20)
    outputs = candidate(system, f"{name}: system").load(1).answer(values).outputs
    right = find_runtime("reference").load(system)(values).outputs
    assert outputs is not None
    assert right is not None
    return outputs, right


@pytest.mark.filterwarnings("ignore::DeprecationWarning:skfuzzy")
@pytest.mark.parametrize("name", SYSTEMS)
def test_an_engine_answers_a_system_or_shows_its_own_numbers(name: str) -> None:
    outputs, right = both_outputs(name, EXAMPLES / "tipper.fll")
    assert np.isnan(outputs[:, 1]).all()
    if name in NEAR:
        np.testing.assert_allclose(outputs, right, atol=30.0 * NEAR[name])
    else:  # it takes the centroid of spikes for a weighted average
        assert 0.1 < np.nanmax(np.abs(outputs - right)) < 5.0


@pytest.mark.filterwarnings("ignore::DeprecationWarning:skfuzzy")
@pytest.mark.parametrize("name", SYSTEMS)
def test_an_engine_samples_the_curves_of_a_controller(
    name: str, tmp_path: Path
) -> None:
    file = tmp_path / "fan.fll"
    file.write_text(MAMDANI, "utf-8")
    outputs, right = both_outputs(name, file)
    np.testing.assert_allclose(outputs, right, atol=1.0)  # of 100, on other samples
    assert np.isnan(outputs[:, 1]).all()


@pytest.mark.parametrize(
    "name", ["pyfuzzylite", "fuzzylite c++", "ferrifuzz", "simpful"]
)
def test_an_engine_concludes_linear_functions(name: str, tmp_path: Path) -> None:
    start, _, end = MAMDANI.partition("  aggregation: Maximum\n")
    rules = end[end.index("RuleBlock") :]
    sugeno = "  aggregation: none\n  defuzzifier: WeightedAverage TakagiSugeno\n"
    terms = "  term: slow Linear 1 -2 30\n  term: fast Linear -0.5 4 7.5\n"
    file = tmp_path / "fan.fll"
    rules = rules.replace("implication: Minimum", "implication: none")
    file.write_text(start + sugeno + terms + rules, "utf-8")
    outputs, right = both_outputs(name, file)
    np.testing.assert_allclose(outputs, right, rtol=1e-9)


@pytest.mark.parametrize("name", ["ferrifuzz", "simpful", "scikit-fuzzy"])
def test_an_engine_refuses_what_it_has_no_word_for(name: str, tmp_path: Path) -> None:
    file = tmp_path / "fan.fll"
    file.write_text(
        MAMDANI.replace("aggregation: Maximum", "aggregation: BoundedSum"), "utf-8"
    )
    peer = candidate(ft.read(file).model, f"{name}: system")
    with pytest.raises(LossError, match=f"^{name} aggregates by the maximum$"):
        peer.load(1)


def test_an_engine_that_is_not_installed_is_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    candidates, omitted = peers(ft.read(EXAMPLES / "tipper.fll").model)
    assert candidates == []
    assert [one.name for one in omitted] == [*SYSTEMS]
    assert all("not installed" in one.why for one in omitted)

"""Every runtime of the table against the reference, on models of every kind."""

from __future__ import annotations

import functools
import math
import random
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.checking.comparing import same_bits
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Dtype, Model, Outcome, Runtime
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Part,
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
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.numerics.bounds import strength_bounds
from fuzzytree.runtimes.reference import load as load_reference
from fuzzytree.runtimes.table import all_runtimes, find_runtime, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import probe_values, random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

RUNTIMES = [runtime for runtime in all_runtimes() if is_installed(runtime)]
EXACT = [r for r in RUNTIMES if r.dtype == "float64" and r.bound is None]


def random_rules(seed: int) -> RuleBase:
    """Return rules with OR, NOT, open and stepped terms, and a rule that ties."""
    chance = random.Random(seed)

    def curve() -> tuple[float, ...]:
        return tuple(chance.uniform(-1.0, 2.0) for _ in range(chance.randint(1, 8)))

    def shape() -> Shape:
        low, high = sorted((chance.uniform(-2.0, 2.0), chance.uniform(-2.0, 2.0)))
        if chance.random() < 0.4:
            below = Side(chance.uniform(0.1, 2.0), curve(), chance.uniform(1.5, 6.0))
            above = Side(chance.uniform(0.1, 2.0), curve(), chance.uniform(1.5, 6.0))
            return LR(low, below, below if chance.random() < 0.5 else above)
        start = low if chance.random() < 0.8 else None
        end = high if chance.random() < 0.8 else None
        left, right = low - 0.7, high + 1.0
        return Band(
            start,
            end,
            left if start is not None and chance.random() < 0.7 else None,
            right if end is not None and chance.random() < 0.7 else None,
        )

    def variable(name: str, parts: tuple[Part, ...] = ()) -> Variable:
        terms = tuple(Term(f"t{number}", shape()) for number in range(1, 5))
        return Variable(name, terms, parts=parts)

    parts = (Part("a", 1.5, 0.25), Part("b", -0.75, 0.1), Part("c", 1.0))
    variables = (
        variable("a"),
        variable("b"),
        variable("c"),
        variable("long", parts),
        variable("short", parts[1:2]),
    )

    def proposition() -> Proposition:
        names = chance.sample(
            [f"t{n}" for n in range(1, 5)], chance.choice((1, 1, 2, 4))
        )
        where = chance.choice(variables).name
        return Proposition(
            where, tuple(names), ("not",) if chance.random() < 0.3 else ()
        )

    pool = [proposition() for _ in range(12)]
    rules = [
        Rule(tuple(chance.choices(pool, k=chance.randint(1, 4))), chance.choice("xyz"))
        for _ in range(chance.randint(1, 12))
    ]
    rules.append(rules[0])
    if chance.random() < 0.2:
        rules.append(Rule((), "z"))
    conjunction: Conjunction = chance.choice(("minimum", "product"))
    return RuleBase(
        f"rules {seed}",
        ("x", "y", "z"),
        variables,
        tuple(rules),
        Semantics(conjunction, chance.choice((None, "y")), chance.choice((None, "z"))),
    )


def trees() -> list[FuzzyTree]:
    return [
        random_tree(0, leaves=1),
        random_tree(1, leaves=2, inputs=1),
        random_tree(2, leaves=7, combinations=0.0),
        random_tree(3, leaves=12, combinations=0.6),
        random_tree(4, leaves=40, inputs=6),
    ]


def models() -> list[Model]:
    result: list[Model] = [*trees()]
    for tree in trees()[1:4]:
        result += [
            rules_from_tree(tree, "relative"),
            rules_from_tree(tree, "relative", conjunction="product"),
            rules_from_tree(tree, "raw"),
            rules_from_tree(tree, "raw", conjunction="product"),
        ]
    result += [random_rules(seed) for seed in range(12)]
    pointed = [
        rules_from_tree(trees()[2], "relative"),
        rules_from_tree(trees()[3], "raw", conjunction="product"),
        *(random_rules(seed) for seed in range(4)),
    ]
    return [*result, *(with_points(rules, 7) for rules in pointed)]


def name_of(model: Model) -> str:
    if isinstance(model, RuleBase):
        return f"{model.name} {model.kind} {model.semantics.conjunction}"
    return model.name


MODELS = models()


@functools.cache
def believed(position: int) -> tuple[FloatArray, Outcome]:
    """Return probes of one of `MODELS`, and the reference's answers to them."""
    values = probe_values(MODELS[position], 500)
    return values, load_reference(MODELS[position])(values)


def run_or_skip(runtime: Runtime, model: Model, values: FloatArray) -> Outcome:
    """Run a model, or skip what the runtime says that it cannot run."""
    representation = "rules" if isinstance(model, RuleBase) else "tree"
    if representation not in runtime.runs:
        with pytest.raises(ValueError, match=representation):
            runtime.load(model)
        pytest.skip(f"{runtime.name} runs no {representation}")
    try:
        return runtime.load(model)(values)
    except LossError as error:
        if not runtime.cannot:
            raise
        pytest.skip(str(error))


def assert_same_answers(result: Outcome, expected: Outcome) -> None:
    assert result.rule.tolist() == expected.rule.tolist()
    assert result.status.tolist() == expected.status.tolist()
    if result.strengths is not None:
        assert expected.strengths is not None
        np.testing.assert_array_equal(result.strengths, expected.strengths)
        assert same_bits(result.strengths, expected.strengths).all()


ENDS = RuleBase(
    "ends",
    ("x", "y"),
    (
        Variable(
            "v",
            (
                Term("falls", Band(high=1.0, right=3.0)),
                Term("bends", Band(1.0, 2.0, right=5.0)),
                Term("dips", Band(low=0.0, left=-4.0)),
                Term("points", Points((0.0, 1.0, 2.0), (-0.0, 1.0, -0.0))),
            ),
        ),
    ),
    tuple(
        Rule((Proposition("v", (name,)),), "x")
        for name in ("falls", "bends", "dips", "points")
    ),
)


@pytest.mark.one_in(6)
@pytest.mark.parametrize("count", [1, 2, 7, 64])
@pytest.mark.parametrize("runtime", RUNTIMES, ids=lambda runtime: runtime.name)
def test_no_strength_is_a_negative_zero(runtime: Runtime, count: int) -> None:
    ends = (3.0, 5.0, -4.0, math.nextafter(3.0, 4.0), -4.5, 0.0, 2.0, -1e300, 1e300)
    for end in ends:
        result = run_or_skip(runtime, ENDS, np.full((1, count), end))
        if result.strengths is not None:
            assert not np.signbit(result.strengths).any(), end


@pytest.mark.one_in(8)
@pytest.mark.parametrize("position", range(len(MODELS)), ids=map(name_of, MODELS))
@pytest.mark.parametrize("runtime", EXACT, ids=lambda runtime: runtime.name)
def test_a_runtime_in_double_has_the_bits_of_the_reference(
    runtime: Runtime, position: int
) -> None:
    model = MODELS[position]
    values, expected = believed(position)
    assert_same_answers(run_or_skip(runtime, model, values), expected)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("position", range(len(MODELS)), ids=map(name_of, MODELS))
@pytest.mark.parametrize(
    "runtime",
    [r for r in RUNTIMES if r.dtype != "float64" and not r.name.startswith("native")],
    ids=lambda runtime: runtime.name,
)
def test_a_runtime_has_the_bits_of_numpy_in_the_same_type(
    runtime: Runtime, position: int
) -> None:
    model = MODELS[position]
    values, _ = believed(position)
    result = run_or_skip(runtime, model, values)
    expected = find_runtime(f"native {runtime.dtype}").load(model)(values)
    assert_same_answers(result, expected)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("position", range(len(MODELS)), ids=map(name_of, MODELS))
@pytest.mark.parametrize("dtype", ["mixed", "float32"])
def test_a_strength_keeps_the_derived_bound_of_its_type(
    dtype: Dtype, position: int
) -> None:
    model = MODELS[position]
    if not isinstance(model, RuleBase):
        pytest.skip("a tree has no strengths")
    values, answers = believed(position)
    runtime = find_runtime(f"native {dtype}")
    result = run_or_skip(runtime, model, values).strengths
    expected = answers.strengths
    assert result is not None
    assert expected is not None
    allowed, origin = strength_bounds(model, dtype, values)
    known = np.isfinite(expected).all(axis=0) & np.isfinite(result).all(axis=0)
    error = np.abs(result - expected)[:, known].max(axis=0)
    assert np.all(error <= allowed[known]), origin


@pytest.mark.one_in(2)
@pytest.mark.parametrize("position", range(len(MODELS)), ids=map(name_of, MODELS))
@pytest.mark.parametrize(
    "runtime",
    [r for r in RUNTIMES if r.bound is not None],
    ids=lambda runtime: runtime.name,
)
def test_a_runtime_with_a_bound_keeps_it(runtime: Runtime, position: int) -> None:
    model = MODELS[position]
    values, expected = believed(position)
    result = run_or_skip(runtime, model, values)
    assert result.strengths is not None
    assert expected.strengths is not None
    assert runtime.bound is not None
    allowed, origin = runtime.bound(model)
    known = np.isfinite(expected.strengths)
    assert np.array_equal(known, np.isfinite(result.strengths))
    error = np.abs(result.strengths - expected.strengths)[known]
    assert error.max(initial=0.0) <= allowed, origin
    if isinstance(model, RuleBase) and model.kind == "relative":
        assert result.rule.tolist() == expected.rule.tolist()
        assert result.status.tolist() == expected.status.tolist()


SMALL: list[Model] = [
    random_tree(3, leaves=5),
    rules_from_tree(random_tree(3, leaves=5), "raw"),
]
PAIRS = [
    pytest.param(runtime, model, id=f"{runtime.name} {kind}")
    for runtime in RUNTIMES
    for kind, model in zip(("tree", "rules"), SMALL, strict=True)
    if kind in runtime.runs
]


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("runtime", "model"), PAIRS)
def test_no_rows_give_no_answers(runtime: Runtime, model: Model) -> None:
    result = runtime.load(model)(np.empty((len(model.inputs), 0)))
    assert result.rule.shape == result.status.shape == (0,)
    if result.strengths is not None and isinstance(model, RuleBase):
        assert result.strengths.shape == (len(model.rules), 0)


@pytest.mark.parametrize(("runtime", "model"), PAIRS)
def test_one_row_is_answered_as_among_many(runtime: Runtime, model: Model) -> None:
    values = probe_values(model, 60)
    run = runtime.load(model)
    together = run(values)
    for row in range(values.shape[1]):
        alone = run(values[:, row : row + 1])
        assert alone.rule[0] == together.rule[row]
        assert alone.status[0] == together.status[row]


@pytest.mark.parametrize(("runtime", "model"), PAIRS)
def test_the_layout_of_the_values_changes_nothing(
    runtime: Runtime, model: Model
) -> None:
    values = probe_values(model, 200)
    run = runtime.load(model)
    expected = run(values)
    assert_same_answers(run(np.asfortranarray(values)), expected)
    wide = np.repeat(values, 2, axis=1)[:, ::2]
    assert_same_answers(run(wide), expected)


@pytest.mark.parametrize(("runtime", "model"), PAIRS)
def test_values_are_never_changed(runtime: Runtime, model: Model) -> None:
    values = probe_values(model, 100)
    before = values.copy()
    runtime.load(model)(values)
    np.testing.assert_array_equal(values, before)


OURS = ("native", "best-first", "python", "scikit-fuzzy")


@pytest.mark.parametrize(
    ("runtime", "model"),
    [pair for pair in PAIRS if str(pair.id).startswith(OURS)],
)
def test_a_wrong_number_of_inputs_is_refused(runtime: Runtime, model: Model) -> None:
    names = ", ".join(model.inputs)
    with pytest.raises(ValueError, match="the values must") as caught:
        runtime.load(model)(np.zeros((len(model.inputs) + 1, 3)))
    assert str(caught.value) == (
        f"the values must have one line for each of the {len(model.inputs)} inputs "
        f"({names}) and one column for each row, "
        f"not the shape {len(model.inputs) + 1} x 3"
    )


@pytest.mark.parametrize(
    ("runtime", "model"),
    [pair for pair in PAIRS if str(pair.id).startswith(OURS)],
)
def test_other_numbers_are_converted(runtime: Runtime, model: Model) -> None:
    run = runtime.load(model)
    whole = np.arange(3 * len(model.inputs)).reshape(len(model.inputs), 3) - 4
    expected = run(whole.astype(np.float64))
    for kind in (np.int32, np.float32):
        assert_same_answers(run(whole.astype(kind)), expected)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(4))
def test_relative_rules_answer_like_the_tree_in_every_native_runtime(seed: int) -> None:
    tree = random_tree(seed, leaves=60, inputs=5)
    values = probe_values(tree, 3000)
    expected = find_runtime("native").load(tree)(values)
    for conjunction in ("minimum", "product"):
        rules = rules_from_tree(tree, conjunction=conjunction)
        for name in ("native", "native mixed", "best-first"):
            result = find_runtime(name).load(rules)(values)
            assert result.rule.tolist() == expected.rule.tolist()
            assert result.status.tolist() == expected.status.tolist()


def test_every_special_value_counts_as_the_model_says() -> None:
    tree = random_tree(2, leaves=7, combinations=0.0)
    values = np.zeros((len(tree.inputs), 3))
    values[0] = (math.nan, math.inf, -math.inf)
    result = find_runtime("native").load(tree)(values)
    assert (result.rule.tolist(), result.status.tolist()) == ([0] * 3, [3] * 3)

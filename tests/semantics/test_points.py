"""Points joined by lines, and that they mean the same everywhere."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import msgspec
import numpy as np
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters.onnx import write_onnx as write_onnx
from fuzzytree.exporters.onnx_rules import MOST_CHAINED
from fuzzytree.exporters.yaml import write
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model.contracts import Dtype, Runtime
from fuzzytree.model.rulebase import (
    MOST_POINTS,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_degree
from fuzzytree.numerics.segments import segments_of
from fuzzytree.runtimes.envelope import cell_ends, cells_of, plan_envelope
from fuzzytree.runtimes.native_rules import fire
from fuzzytree.runtimes.table import all_runtimes, find_runtime, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import landmarks
from fuzzytree.semantics.reference import BELOW_ONE, degree
from fuzzytree.testing import probe_values, random_tree, with_points

TRAPEZOID = Points((1.0, 2.0, 4.0, 8.0), (0.0, 1.0, 1.0, 0.0))
STEP = Points((0.0, 2.5, 2.5, 3.0), (0.25, 0.75, 0.5, 0.5))
LARGEST = 1.7976931348623157e308
EXACT = [
    runtime
    for runtime in all_runtimes()
    if "rules" in runtime.runs
    and is_installed(runtime)
    and (runtime.dtype, runtime.bound) == ("float64", None)
]
DTYPES: tuple[Dtype, ...] = ("float64", "mixed", "float32")

NUMBERS = st.one_of(
    st.floats(-10.0, 10.0),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 1.0, math.nextafter(1.0, 2.0), 1e300]),
)
DEGREES = st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0, BELOW_ONE, 5e-324])


@st.composite
def points(draw: st.DrawFn) -> Points:
    places = sorted(draw(st.lists(NUMBERS, min_size=1, max_size=20)))
    kept = [v for _, same in itertools.groupby(places) for v in [*same][:2]]
    far = [a for a, b in itertools.pairwise(kept) if not math.isfinite(b - a)]
    kept = [value for value in kept if not far or value > far[-1]]
    count = len(kept)
    return Points(
        tuple(kept), tuple(draw(st.lists(DEGREES, min_size=count, max_size=count)))
    )


def rules_of(*shapes: Points) -> RuleBase:
    """Return a rule for each shape, all on one variable."""
    terms = tuple(Term(f"t{number}", shape) for number, shape in enumerate(shapes))
    rules = tuple(Rule((Proposition("x", (term.name,)),), "a") for term in terms)
    return RuleBase("points", ("a",), (Variable("x", terms),), rules)


def places_of(shape: Points) -> list[float]:
    """Return each point, the doubles beside it, places between, and far ones."""
    values = shape.values
    near = [math.nextafter(v, end) for v in values for end in (-math.inf, math.inf)]
    inner = [
        a + (b - a) * s for a, b in itertools.pairwise(values) for s in (0.25, 0.9)
    ]
    found = [*values, *near, *inner, -LARGEST, LARGEST, 0.0]
    return sorted(filter(math.isfinite, set(found)))


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (-1e308, 0.0),
        (1.0, 0.0),
        (1.25, 0.25),  # 1 + (1.25 - 2) / (1 - 2) * (0 - 1) = 1 - 0.75
        (2.0, 1.0),
        (3.3, 1.0),
        (4.0, 1.0),
        (5.0, 0.75),  # 0 + (5 - 8) / (4 - 8) * (1 - 0)
        (8.0, 0.0),
        (1e308, 0.0),
    ],
)
def test_a_trapezoid_rises_stays_and_falls(value: float, expected: float) -> None:
    assert degree(TRAPEZOID, value) == expected


def test_a_value_on_a_step_belongs_to_the_left() -> None:
    above = math.nextafter(2.5, 3.0)
    assert [degree(STEP, x) for x in (2.5, above, 3.0)] == [0.75, 0.5, 0.5]


def test_before_the_first_and_behind_the_last_point_nothing_changes() -> None:
    assert [degree(STEP, x) for x in (-LARGEST, -1.0, 0.0)] == [0.25, 0.25, 0.25]
    last = Points((0.0, 0.0), (0.25, 1.0))
    assert [degree(last, x) for x in (0.0, 5e-324, LARGEST)] == [0.25, 1.0, 1.0]


def test_a_single_point_is_the_same_everywhere() -> None:
    assert {degree(Points((3.0,), (0.5,)), x) for x in (-1e300, 3.0, 9.0)} == {0.5}


@pytest.mark.parametrize("dtype", ["float64", "mixed"])
def test_a_degree_next_to_zero_keeps_its_digits(dtype: Dtype) -> None:
    rising, falling = Points((0.0, 1.0), (0.0, 1.0)), Points((-1.0, 0.0), (1.0, 0.0))
    rows = np.array([[1e-30, -1e-30, 0.0]])
    found = fire(rules_of(rising, falling), dtype)(rows).strengths
    assert found is not None
    tiny = 1e-30 if dtype == "float64" else float(np.float32(1e-30))
    assert found.tolist() == [[tiny, 0.0, 0.0], [0.0, tiny, 0.0]]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(points())
def test_a_degree_is_exact_at_the_points_and_never_leaves_their_range(
    shape: Points,
) -> None:
    first = dict(reversed(list(zip(shape.values, shape.degrees, strict=True))))
    for value, expected in first.items():
        assert degree(shape, value) == expected
    found = [degree(shape, value) for value in places_of(shape)]
    assert min(shape.degrees) <= min(found)
    assert max(found) <= max(shape.degrees)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(NUMBERS, NUMBERS, DEGREES, DEGREES, st.lists(st.floats(0, 1), min_size=2))
def test_a_line_is_monotone_and_level_if_its_ends_are(
    start: float, end: float, here: float, there: float, shares: list[float]
) -> None:
    a, b = sorted((start, end))
    if a == b or not math.isfinite(b - a):
        return
    line = Points((a, b), (here, there))
    places = sorted(min(max(a + (b - a) * share, a), b) for share in shares)
    found = [degree(line, place) for place in places]
    assert found == sorted(found, reverse=here > there)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(points())
def test_a_degree_is_that_of_the_formula_to_a_few_units(shape: Points) -> None:
    for value in places_of(shape):
        exact = exact_degree(shape, Fraction(value))
        assert abs(Fraction(degree(shape, value)) - exact) <= Fraction(4, 2**53)


@pytest.mark.heavy
@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(points(), min_size=1, max_size=5))
def test_numpy_and_best_first_have_the_bits_of_the_reference(
    shapes: list[Points],
) -> None:
    rules = rules_of(*shapes)
    values = np.array([sorted({x for s in shapes for x in places_of(s)})])
    expected = find_runtime("reference").load(rules)(values)
    native = find_runtime("native").load(rules)(values)
    assert expected.strengths is not None
    assert native.strengths is not None
    np.testing.assert_array_equal(native.strengths, expected.strengths)
    best = find_runtime("best-first").load(rules)(values)
    np.testing.assert_array_equal(best.rule, expected.rule)
    np.testing.assert_array_equal(best.status, expected.status)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(points())
def test_the_bounds_of_a_cell_hold_in_it(shape: Points) -> None:
    proposition = Proposition("x", ("t0",))
    envelope = plan_envelope(rules_of(shape), [proposition], {"x": 0})
    values = np.array([places_of(shape)])
    with np.errstate(over="ignore"):  # as where rows are answered
        cells = cells_of(envelope.grid, values)[0]
    found = np.array([degree(shape, x) for x in values[0].tolist()])
    low, high = cell_ends(envelope.grid, 0)
    assert (low[cells] <= values[0]).all()
    assert (values[0] <= high[cells]).all()
    assert (envelope.lower[cells] <= found).all()
    assert (found <= envelope.upper[cells]).all()


@pytest.mark.one_in(3)
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("count", [1, 2, 3, MOST_CHAINED, MOST_CHAINED + 1, 64, 4096])
def test_a_graph_has_the_bits_of_numpy_whatever_the_number_of_points(
    count: int, dtype: Dtype
) -> None:
    chance = np.random.default_rng(count)
    values = np.sort(chance.normal(size=count) * 10.0)
    long = Points(tuple(values.tolist()), tuple(chance.random(count).tolist()))
    rules = rules_of(long, TRAPEZOID, STEP, Points((0.0,), (0.125,)))
    rows = np.array([[*places_of(TRAPEZOID), *chance.normal(size=500) * 12.0, *values]])
    found = find_runtime(f"onnxruntime {dtype}").load(rules)(rows)
    native = "native" if dtype == "float64" else f"native {dtype}"
    expected = find_runtime(native).load(rules)(rows)
    assert found.strengths is not None
    assert expected.strengths is not None
    np.testing.assert_array_equal(found.strengths, expected.strengths)
    np.testing.assert_array_equal(found.rule, expected.rule)


HOSTILE = (
    Points((-5e-324, 0.0, 5e-324), (0.0, 1.0, 0.0)),
    Points((-8e307, 8e307), (0.0, 1.0)),
    Points((1e12, math.nextafter(1e12, 2e12)), (0.0, 1.0)),
    Points((0.0, 1e-300, 1e300), (0.0, BELOW_ONE, 5e-324)),
    Points((-1.0, -0.0, 0.0, 1.0), (0.0, 0.5, 1.0, 0.0)),
    Points((2.9e38, 3.4e38, 5e38), (0.0, 1.0, 0.5)),
    Points((-3.4e38, 3.4e38), (0.25, 1.0)),
)


@pytest.mark.parametrize("dtype", ["mixed", "float32"])
def test_hostile_points_are_never_nan_and_never_out_of_range(dtype: Dtype) -> None:
    rules = rules_of(*HOSTILE)
    rows = np.array([sorted({x for shape in HOSTILE for x in places_of(shape)})])
    if dtype == "float32":
        rows = rows[np.abs(rows) < 3.4e38].reshape(1, -1)
    found = fire(rules, dtype)(rows).strengths
    assert found is not None
    assert ((found >= 0.0) & (found <= 1.0)).all()
    off = np.array([[x for x in rows[0] if degree(HOSTILE[3], x) < 1.0]])
    below = fire(rules_of(HOSTILE[3]), dtype)(off).strengths
    assert below is not None
    assert (below < 1.0).all()


@pytest.mark.parametrize("runtime", EXACT, ids=lambda runtime: runtime.name)
def test_every_runtime_of_doubles_answers_hostile_points_alike(
    runtime: Runtime,
) -> None:
    rules = rules_of(*HOSTILE)
    rows = np.array([sorted({x for shape in HOSTILE for x in places_of(shape)})])
    expected = find_runtime("reference").load(rules)(rows)
    answers = runtime.load(rules)(rows)
    np.testing.assert_array_equal(answers.rule, expected.rule)
    np.testing.assert_array_equal(answers.status, expected.status)
    if answers.strengths is not None and expected.strengths is not None:
        np.testing.assert_array_equal(answers.strengths, expected.strengths)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(points(), min_size=1, max_size=4))
def test_points_come_back_from_a_file(shapes: list[Points]) -> None:
    rules = rules_of(*shapes)
    content = write(rules).content
    back = read_yaml(content, "points.yaml").model
    assert back == rules
    assert repr(msgspec.to_builtins(back)) == repr(msgspec.to_builtins(rules))
    assert write(back).content == content


def test_points_stand_in_one_line_of_a_file() -> None:
    text = write(rules_of(TRAPEZOID)).content.decode()
    assert "    points: [[1.0, 0.0], [2.0, 1.0], [4.0, 1.0], [8.0, 0.0]]\n" in text


def test_many_points_run_on_in_further_lines() -> None:
    count = MOST_POINTS
    many = Points(tuple(range(count)), (0.5,) * count)
    text = write(rules_of(many)).content.decode()
    assert max(map(len, text.splitlines())) <= 88
    assert len(text.splitlines()) < count


def test_a_point_of_three_numbers_is_refused() -> None:
    text = write(rules_of(TRAPEZOID)).content.decode()
    broken = text.replace("[2.0, 1.0]", "[2.0, 1.0, 3.0]").encode()
    with pytest.raises(ReadError) as caught:
        read_yaml(broken, "p.yaml")
    assert str(caught.value) == (
        "p.yaml:10:26: an entry of 'points' needs 2 entries, not 3"
    )


def test_points_that_become_one_in_float32_are_a_step() -> None:
    close = Points((1.0, 1.0 + 1e-12, 2.0), (0.0, 0.5, 1.0))
    single = np.dtype(np.float32)
    lines = segments_of([close], single, single)
    assert lines.values[:3].tolist() == [1.0, 1.0, 2.0]
    rules = rules_of(close)
    rows = np.array([[1.0, 1.0 + 2.0**-23, 2.0]])
    found = find_runtime("native float32").load(rules)(rows).strengths
    assert found is not None
    assert found[0].tolist()[::2] == [0.0, 1.0]
    assert 0.5 < found[0, 1] < 0.5 + 1e-6
    assert write_onnx(rules, dtype="float32").losses == ()


def test_a_peak_that_float32_cannot_hold_is_a_loss() -> None:
    peak = Points((1.0, 1.0 + 1e-12, 1.0 + 2e-12, 2.0), (0.0, 1.0, 0.25, 0.0))
    with pytest.raises(LossError) as caught:
        write_onnx(rules_of(peak), dtype="float32")
    assert str(caught.value) == (
        "cannot write points as onnx float32: term 't0' of 'x': points 1.0 to "
        "1.000000000002 become one in float32, and the degrees between them are gone\n"
        "  pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )
    made = write_onnx(rules_of(peak), dtype="float32", allow_loss=True)
    assert [loss.bound for loss in made.losses] == [0.75]


def test_points_beyond_float32_are_a_loss() -> None:
    far = Points((-1e300, 0.0, 1e39), (0.0, 1.0, 0.0))
    made = write_onnx(rules_of(far), dtype="float32", allow_loss=True)
    assert [loss.what for loss in made.losses] == [
        "first point -1e+300 lies beyond float32; -3.4028234663852886e+38 stands",
        "last point 1e+39 lies beyond float32; 3.4028234663852886e+38 stands",
    ]


def test_a_row_with_a_missing_value_is_missing_in_a_graph_of_points() -> None:
    made = write_onnx(rules_of(TRAPEZOID, STEP), outputs=("strengths", "status"))
    session = onnxruntime.InferenceSession(made.content)
    values = np.array([[math.nan], [math.inf], [3.0]])
    strengths, status = session.run(["strengths", "status"], {"inputs": values})
    assert status.tolist() == [3, 3, 0]
    assert np.isnan(strengths[:2]).all()
    assert strengths[2].tolist() == [1.0, 0.5]


def test_the_landmarks_of_points_are_the_points_and_places_between() -> None:
    assert landmarks(TRAPEZOID) == (1.0, 2.0, 4.0, 8.0, 1.4, 2.8, 5.6)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(20))
def test_random_rules_of_points_have_the_same_bits_everywhere(seed: int) -> None:
    rules = with_points(rules_from_tree(random_tree(seed), "raw"), seed)
    values = probe_values(rules, 1500)
    reference = find_runtime("reference").load(rules)(values)
    for runtime in all_runtimes():
        if "rules" not in runtime.runs or not is_installed(runtime):
            continue
        found = runtime.load(rules)(values)
        if runtime.bound is not None:
            assert found.strengths is not None
            assert reference.strengths is not None
            error = np.nanmax(np.abs(found.strengths - reference.strengths))
            assert error <= runtime.bound(rules)[0]
            continue
        expected = fire(rules, runtime.dtype)(values)
        if runtime.dtype == "float64":
            np.testing.assert_array_equal(found.rule, reference.rule)
        np.testing.assert_array_equal(found.rule, expected.rule)
        if found.strengths is not None:
            np.testing.assert_array_equal(found.strengths, expected.strengths)

"""What a system means, against pyfuzzylite 8, part by part and whole.

Where the two differ on purpose a test says so; `docs/reference/systems.md` gives the
reasons.
"""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, get_args

import numpy as np
import pytest

from fuzzytree.errors import ReadError
from fuzzytree.formats.fll.fll_reader import read_fll
from fuzzytree.model import (
    FUNCTIONS,
    Arc,
    Bell,
    Binary,
    Call,
    Concave,
    Conclusion,
    Cosine,
    Curve,
    Defuzzifier,
    DefuzzifierMethod,
    FuzzySystem,
    Gaussian,
    Hedge,
    Name,
    PiCurve,
    Proposition,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SNorm,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    TwoGaussians,
    Variable,
    sampled_values,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import (
    curve_degree,
    hedged,
    infer,
    s_norm,
    t_norm,
    value_at,
    value_of,
)
from fuzzytree.semantics.reference import Status
from fuzzytree.testing import random_rows, random_system
from tests.interop import pyfuzzylite_engine as witness
from tests.semantics.test_singletons import FLL

EPSILON = 2.0**-52
CURVE = 64 * EPSILON
"""Values lie within ten widths of a curve: an operation on them, such as `2 e - i - x`,
is off by ten units in the last place of a width, and no curve has more than six."""

SYSTEM = 1e-12
"""Relative to an output's range: curves, and sums over a hundred values."""

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True)
def pyfuzzylite(library: Callable[[str], str]) -> None:
    library("fuzzylite")


def curves() -> Iterator[tuple[str, Callable[[random.Random], Curve]]]:
    """Yield a maker of each kind of curve, within [-1, 1]."""

    def four(chance: random.Random) -> tuple[float, ...]:
        return tuple(sorted(chance.uniform(-1.0, 1.0) for _ in range(4)))

    def ends(chance: random.Random) -> tuple[float, float]:
        start = chance.uniform(-1.0, 1.0)
        return start, start + chance.choice((-1, 1)) * chance.uniform(0.2, 1.0)

    def steep(chance: random.Random) -> Sigmoid:
        slope = chance.choice((-1, 1)) * chance.uniform(1.0, 10.0)
        return Sigmoid(chance.uniform(-1.0, 1.0), slope)

    def wide(chance: random.Random) -> tuple[float, float]:
        return chance.uniform(-1.0, 1.0), chance.uniform(0.2, 1.0)

    def falling_below(chance: random.Random) -> Trapezoid:
        _, b, c, d = four(chance)
        return Trapezoid(None, b, c, d)

    def rising_above(chance: random.Random) -> Trapezoid:
        a, b, c, _ = four(chance)
        return Trapezoid(a, b, c, None)

    def triangle(chance: random.Random) -> Trapezoid:
        a, b, c, _ = four(chance)
        return Trapezoid(a, b, b, c)

    def points(chance: random.Random) -> Points:
        return Points(four(chance), (0.0, 0.75, 1.0, 0.25))

    def ramp(chance: random.Random) -> Points:
        first, last = sorted(ends(chance))
        return Points((first, last), chance.choice(((0.0, 1.0), (1.0, 0.0))))

    def semi(chance: random.Random) -> SemiEllipse:
        return SemiEllipse(*sorted(ends(chance)))

    yield "points", points
    yield "ramp", ramp
    yield "trapezoid", lambda c: Trapezoid(*four(c))
    yield "triangle", triangle
    yield "left shoulder", falling_below
    yield "right shoulder", rising_above
    yield "gaussian", lambda c: Gaussian(*wide(c))
    yield "two gaussians", lambda c: TwoGaussians(*wide(c), *wide(c))
    yield "bell", lambda c: Bell(*wide(c), c.uniform(-1.0, 4.0))
    yield "sigmoid", steep
    yield "sigmoid difference", lambda c: SigmoidDifference(steep(c), steep(c))
    yield "sigmoid product", lambda c: SigmoidProduct(steep(c), steep(c))
    yield "s", lambda c: SCurve(*ends(c))
    yield "pi", lambda c: PiCurve(*four(c))
    yield "cosine", lambda c: Cosine(*wide(c))
    yield "concave", lambda c: Concave(*ends(c))
    yield "spike", lambda c: Spike(*wide(c))
    yield "arc", lambda c: Arc(*ends(c))
    yield "semi ellipse", semi
    yield "binary", lambda c: Binary(c.uniform(-1.0, 1.0), c.random() < 0.5)


@pytest.mark.parametrize("kind", dict(curves()))
def test_a_curve_has_the_degrees_of_pyfuzzylites_term(kind: str) -> None:
    make = dict(curves())[kind]
    chance = random.Random(kind)
    for _ in range(40):
        curve = make(chance)
        values = [chance.uniform(-2.0, 2.0) for _ in range(50)]
        values += _marks(curve)
        expected = np.broadcast_to(
            witness.term(curve).membership(np.array(values)), len(values)
        )
        for value, degree in zip(values, expected.tolist(), strict=True):
            found = curve_degree(curve, value)
            # At the foot of an arc a root makes much of the last digit, and NaN of a
            # number below 0 in pyfuzzylite: compare what is under the root.
            power = 2 if isinstance(curve, Arc | SemiEllipse) else 1
            if power == 2 and math.isnan(degree):
                degree = 0.0
            assert abs(found**power - degree**power) <= CURVE, (curve, value)


def _marks(curve: Curve) -> list[float]:
    """Return the values at which a curve bends."""
    found: list[float] = []
    for field in curve.__struct_fields__:
        value: object = getattr(curve, field)
        if isinstance(value, float):
            found.append(value)
        if isinstance(value, tuple):
            found += [one for one in value if isinstance(one, float)]
    return found


@pytest.mark.parametrize("kind", ["ramp", "sigmoid", "s", "concave", "arc"])
def test_a_monotone_curve_has_pyfuzzylites_value_of_a_degree(kind: str) -> None:
    make = dict(curves())[kind]
    chance = random.Random(kind)
    for _ in range(40):
        curve = make(chance)
        for degree in (0.5, 1e-3, 0.999, *(chance.random() for _ in range(20))):
            expected = float(witness.term(curve).tsukamoto(degree))
            found = value_at(curve, degree)
            assert found is not None
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_only_the_curves_that_pyfuzzylite_calls_monotone_have_a_value() -> None:
    chance = random.Random(0)
    for kind, make in curves():
        curve = make(chance)
        is_monotonic: bool = witness.term(curve).is_monotonic()
        assert (value_at(curve, 0.5) is not None) == is_monotonic, kind


@pytest.mark.parametrize("name", [*get_args(TNorm), *get_args(SNorm)])
def test_a_norm_is_pyfuzzylites(name: Any) -> None:
    norm = witness.norm(name)
    assert norm is not None
    ours = t_norm if name in get_args(TNorm) else s_norm
    chance = random.Random(name)
    degrees = [0.0, 1.0, 0.5, 0.25, *(chance.random() for _ in range(40))]
    for a, b in itertools.product(degrees, degrees):
        assert ours(name, a, b) == float(norm.compute(a, b))


@pytest.mark.parametrize("name", witness.HEDGES)
def test_a_hedge_is_pyfuzzylites(name: Hedge) -> None:
    import fuzzylite as fl

    hedge = fl.settings.factory_manager.hedge.construct(name)
    chance = random.Random(name)
    for degree in (0.0, 1.0, 0.5, *(chance.random() for _ in range(200))):
        assert hedged([name], degree) == float(hedge.hedge(degree))


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_function_of_a_formula_is_pyfuzzylites(function: str) -> None:
    import fuzzylite as fl

    names = ("a", "b")[: FUNCTIONS[function]]
    call = Call(function, tuple(map(Name, names)))
    text = witness.text(call) if function not in ("min", "max") else f"{function}(a, b)"
    theirs = fl.Function.create("f", text)
    values = [0.0, 1.0, -1.0, 0.5, 2.5, -2.5, 3.0, 1000.0, -1000.0, 1e-9]
    for chosen in itertools.product(values, repeat=len(names)):
        given = dict(zip(names, chosen, strict=True))
        expected = float(theirs.evaluate({k: np.float64(v) for k, v in given.items()}))
        found = value_of(call, given)
        assert found == pytest.approx(expected, rel=8 * EPSILON, nan_ok=True), given


def polyline(
    method: DefuzzifierMethod, degrees: tuple[float, ...]
) -> tuple[FuzzySystem, Any]:
    """Return a system that looks at given degrees, and pyfuzzylite's answer."""
    import fuzzylite as fl

    class Given(fl.Term):
        def membership(self, x: Any) -> Any:
            return np.array([degrees])

    how = Defuzzifier(method, len(degrees))
    bare = SystemOutput("y", (), -1.5, 2.0, how, "maximum")
    label = Term("given", Points(tuple(sampled_values(bare)), degrees))
    output = SystemOutput("y", (label,), -1.5, 2.0, how, "maximum")
    rule = SystemRule(None, (Conclusion("y", "given"),))
    system = FuzzySystem(
        "polyline", (), (output,), (RuleBlock((rule,), implication="minimum"),)
    )
    theirs = getattr(fl, witness.DEFUZZIFIERS[method])(len(degrees))
    return system, float(theirs.defuzzify(Given(), -1.5, 2.0))


@pytest.mark.parametrize(
    "method", [one for one in get_args(DefuzzifierMethod) if not one.startswith("w")]
)
def test_a_defuzzifier_answers_as_pyfuzzylites(method: DefuzzifierMethod) -> None:
    chance = random.Random(method)
    for _ in range(150):
        count = chance.choice((2, 3, 10, 64, 101))
        levels = chance.choice(((0.0, 0.5, 1.0), (0.0, 0.0, 0.25), (0.0,)))
        degrees = tuple(
            chance.choice((*levels, chance.random())) if len(levels) > 1 else 0.0
            for _ in range(count)
        )
        system, expected = polyline(method, degrees)
        found = infer(system, {})
        assert found.outputs[0] == pytest.approx(
            expected, rel=0.0, abs=count * EPSILON * 4, nan_ok=True
        ), degrees
        assert found.status == (Status.UNCOVERED if max(degrees) == 0.0 else 0)


@pytest.mark.one_in(6)
@pytest.mark.parametrize("part", range(4))
def test_random_systems_answer_as_pyfuzzylites_engines(part: int) -> None:
    seen: Counter[str] = Counter()
    for seed in range(part * 60, part * 60 + 60):
        system = random_system(seed)
        if any(one.parts for one in system.variables):
            continue
        system = witness.alike(system)
        engine = witness.engine(system)
        assert sum(map(len, engine.rule_blocks)) == len(system.rules)
        for row in random_rows(system, seed, 5):
            for variable in engine.input_variables:
                variable.value = row[variable.name]
            engine.process()
            found = infer(system, row)
            pairs = zip(system.outputs, engine.output_variables, strict=True)
            for number, (output, theirs) in zip(found.outputs, pairs, strict=True):
                scale, how = output.high or 1.0, output.defuzzifier
                # Rounding may part the area at the next sample.
                is_bisector = how.method == "bisector"
                step = (
                    (scale - (output.low or 0.0)) / how.samples if is_bisector else 0.0
                )
                assert number == pytest.approx(
                    float(np.squeeze(theirs.value)),
                    rel=SYSTEM,
                    abs=SYSTEM * scale + step,
                    nan_ok=True,
                ), (seed, row, how)
                seen[output.defuzzifier.method] += math.isfinite(number)
        seen.update(block.activation.method for block in system.blocks)
    assert {*seen} >= {
        *("centroid", "bisector", "weighted average", "weighted sum", "general"),
        *("first", "last", "highest", "lowest", "proportional", "threshold"),
    }
    assert seen["centroid"] > 20, seen
    assert seen["weighted average"] > 40, seen


def one_rule(output: SystemOutput, *then: Conclusion) -> FuzzySystem:
    """Return a system whose only rule holds as far as x lies in [0, 1]."""
    ramp = Term("up", Points((0.0, 1.0), (0.0, 1.0)))
    rule = SystemRule(
        Proposition("a", ("up",)), then or (Conclusion("y", output.terms[0].name),)
    )
    block = RuleBlock((rule,), implication="minimum")
    return FuzzySystem("one rule", (Variable("a", (ramp,)),), (output,), (block,))


def pyfuzzylites(system: FuzzySystem, value: float) -> float:
    engine = witness.engine(system)
    engine.input_variables[0].value = value
    engine.process()
    return float(np.squeeze(engine.output_variables[0].value))


def weighted(*labels: Term) -> SystemOutput:
    return SystemOutput("y", labels, 0.0, 1.0, Defuzzifier("weighted sum"), "sum")


def test_here_a_rule_of_degree_0_concludes_nothing() -> None:
    system = one_rule(
        weighted(Term("one", Singleton(1.0))), Conclusion("y", "one", ("not",))
    )
    assert pyfuzzylites(system, 0.0) == 1.0
    assert infer(system, {"a": 0.0}).status == Status.UNCOVERED
    assert pyfuzzylites(system, 0.25) == infer(system, {"a": 0.25}).outputs[0] == 0.75


def test_here_a_missing_value_answers_nan_and_no_default() -> None:
    system = one_rule(
        SystemOutput(
            "y",
            (Term("one", Singleton(1.0)),),
            0.0,
            1.0,
            Defuzzifier("weighted sum"),
            "sum",
            default=7.0,
        )
    )
    assert pyfuzzylites(system, math.nan) == 7.0
    assert math.isnan(infer(system, {"a": math.nan}).outputs[0])
    assert infer(system, {"a": math.nan}).status == Status.MISSING


def test_here_a_concave_curve_without_width_stays_1_behind_its_end() -> None:
    curve = Concave(0.5, 0.5)
    assert float(witness.term(curve).membership(0.75)) == 0.0
    assert [curve_degree(curve, x) for x in (0.25, 0.5, 0.75)] == [0.0, 1.0, 1.0]


def test_here_a_step_of_points_has_the_first_degree_at_its_value() -> None:
    step = Points((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    assert float(witness.term(step).membership(0.0)) == 0.0
    assert curve_degree(step, 0.0) == 1.0


def test_conclusions_are_hedged_one_behind_the_other_in_both() -> None:
    labels = (Term("one", Singleton(1.0)), Term("ten", Singleton(10.0)))
    then = (Conclusion("y", "one", ("very",)), Conclusion("y", "ten"))
    system = one_rule(weighted(*labels), *then)
    assert infer(system, {"a": 0.5}).outputs[0] == 0.25 + 2.5
    assert pyfuzzylites(system, 0.5) == 2.75


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        ("Triangle 0.335 0.335 0.335", 0.335),
        ("Rectangle 0.335 0.335", 0.335),
        ("Triangle 0.333 0.333 0.333", math.nan),
        ("Triangle 0.331 0.333 0.334", math.nan),
    ],
)
def test_a_term_that_no_sample_meets_concludes_nothing(
    term: str, expected: float
) -> None:
    text = FLL.replace("Triangle 0.333 0.333 0.333", term)
    import fuzzylite as fl

    engine = fl.FllImporter().from_string(text)
    engine.input_variables[0].value = 0.5
    engine.process()
    found = float(np.ravel(engine.output_variables[0].value)[0])
    assert found == pytest.approx(expected, nan_ok=True)
    if math.isnan(expected) and term.endswith("0.333"):
        with pytest.raises(ReadError, match="has no width"):
            read_fll(text.encode(), "y.fll")
        return
    model = read_fll(text.encode(), "y.fll").model
    assert isinstance(model, FuzzySystem)
    assert infer(model, {"x": 0.5}).outputs == pytest.approx((expected,), nan_ok=True)

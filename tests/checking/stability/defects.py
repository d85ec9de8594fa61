"""Runtimes, learners and formats with a known defect each, and models to show it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.exporters.table import find_format
from fuzzytree.model.contracts import (
    Document,
    Dtype,
    Format,
    Model,
    Outcome,
    Run,
    Runtime,
    Written,
)
from fuzzytree.model.curves import Gaussian, Singleton, Trapezoid
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.rules import And, Conclusion, RuleBlock, SystemRule
from fuzzytree.model.system import Defuzzifier, FuzzySystem, SystemOutput
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node, Sets
from fuzzytree.runtimes.rows import checked, winners
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.reference import axis_values, degree

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

NATIVE = find_runtime("native")


def small_rules() -> RuleBase:
    """Return rules with flanks, a step, sets and a combination; nothing is wrong."""
    low = Term("low", Band(high=1.0, right=3.0))
    high = Term("high", Band(low=1.0, left=-2.0))
    soft = Term("soft", LR(2.0, Side(0.5, (0.75,)), Side(1.5, (0.5, 0.125), 3.0)))
    open_ = Term("open", Band(low=-4.0, high=0.25))
    mix = Variable("mix", (low, high), parts=(Part("a", 0.5, 1.0), Part("b", 2.0)))
    return RuleBase(
        "small",
        ("yes", "no"),
        (
            Variable("a", (low, high), low=-5.0, high=5.0),
            Variable("b", (soft, open_), low=-5.0, high=5.0),
            mix,
        ),
        (
            Rule((Proposition("a", ("low",)), Proposition("b", ("soft",))), "yes"),
            Rule((Proposition("a", ("high",)), Proposition("b", ("open",))), "no"),
            Rule((Proposition("mix", ("high",)),), "no"),
            Rule((Proposition("mix", ("low",)), Proposition("a", ("high",))), "yes"),
        ),
    )


def one_rule(*terms: Term) -> RuleBase:
    """Return rules with one variable, a rule for each term."""
    rules = tuple(Rule((Proposition("a", (term.name,)),), "yes") for term in terms)
    return RuleBase("one", ("yes",), (Variable("a", terms),), rules)


def runtime(
    change: Callable[[Document, Run], Run], *, dtype: Dtype = "float64"
) -> Runtime:
    """Return the native runtime with one defect."""

    def load(model: Document, *, with_strengths: bool = True) -> Run:
        return change(model, NATIVE.load(model))

    return Runtime("defective", ("tree", "rules", "system"), load, dtype=dtype)


def on_values(change: Callable[[FloatArray], FloatArray]) -> Runtime:
    """Return a native runtime that sees other values than it was given."""
    return runtime(lambda _, run: lambda values: run(change(values)))


ABSOLUTE = on_values(lambda v: np.where(np.abs(v) < 1e-12, 0.0, v))
"""Takes everything below a fixed number for zero."""

COMMON_SCALE = on_values(
    lambda v: np.round(v / _largest(v) * 2.0**40) / 2.0**40 * _largest(v)
)
"""Measures all inputs in units of the largest one."""

BATCH_MEAN = on_values(lambda v: (v - _means(v)) + _means(v))
"""Subtracts the mean of the batch, and adds it again."""

NAN_IS_ZERO = on_values(lambda v: np.where(np.isnan(v), 0.0, v))
"""Takes a missing value for 0."""

SINGLE = on_values(
    lambda v: np.where(np.abs(v) < 1e38, v.astype(np.float32).astype(np.float64), v)
)
"""Reads its inputs as float32 and calls itself double."""


def _largest(values: FloatArray) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(np.median(finite[finite > 0])) if (finite > 0).any() else 1.0


def _means(values: FloatArray) -> FloatArray:
    known = np.where(np.isfinite(values) & (np.abs(values) < 1e30), values, 0.0)
    means: FloatArray = known.sum(axis=1, keepdims=True) / max(values.shape[1], 1)
    return means


def _warning(_: Document, run: Run) -> Run:
    def answer(values: FloatArray) -> Outcome:
        warnings.warn("divide by zero encountered", RuntimeWarning, stacklevel=2)
        return run(values)

    return answer


WARNS = runtime(_warning)
"""Lets a warning out."""


def mamdani() -> FuzzySystem:
    """Return a controller of nine rules and two inputs, with a default answer."""
    names, peaks = ("low", "middle", "high"), (0.0, 5.0, 10.0)
    sets = [
        Term(n, Trapezoid(p - 4.0, p, p, p + 4.0))
        for n, p in zip(names, peaks, strict=True)
    ]
    soft = [Term(n, Gaussian(p, 1.3)) for n, p in zip(names, peaks, strict=True)]
    inputs = (
        Variable("heat", tuple(sets), low=0.0, high=10.0),
        Variable("damp", tuple(soft), low=0.0, high=10.0),
    )
    how = Defuzzifier("centroid", samples=100)
    fan = SystemOutput("fan", tuple(sets), 0.0, 10.0, how, "maximum", default=7.5)
    rules = tuple(
        SystemRule(
            And((Proposition("heat", (a,)), Proposition("damp", (b,)))),
            (Conclusion("fan", names[(i + j) // 2]),),
        )
        for i, a in enumerate(names)
        for j, b in enumerate(names)
    )
    return FuzzySystem(
        "fan", inputs, (fan,), (RuleBlock(rules, implication="minimum"),)
    )


def sugeno() -> FuzzySystem:
    """Return the controller without exponentials, and with sums of numbers."""
    system = mamdani()
    heat, damp = system.variables
    damp = msgspec.structs.replace(damp, terms=heat.terms)
    numbers = (("low", 0.1), ("middle", 0.7), ("high", 1.3))
    fan = msgspec.structs.replace(
        system.outputs[0],
        terms=tuple(Term(name, Singleton(value)) for name, value in numbers),
        defuzzifier=Defuzzifier("weighted sum"),
        aggregation=None,
    )
    blocks = [msgspec.structs.replace(one, implication=None) for one in system.blocks]
    return msgspec.structs.replace(
        system, variables=(heat, damp), outputs=(fan,), blocks=tuple(blocks)
    )


def _other_order(model: Document, run: Run) -> Run:
    """Run a system whose rules stand in the opposite order, so that its sums do."""
    assert isinstance(model, FuzzySystem)
    (block,) = model.blocks
    turned = msgspec.structs.replace(block, rules=block.rules[::-1])
    after = NATIVE.load(msgspec.structs.replace(model, blocks=(turned,)))

    def answer(values: FloatArray) -> Outcome:
        outcome = after(values)
        assert outcome.strengths is not None
        return msgspec.structs.replace(outcome, strengths=outcome.strengths[::-1])

    return answer


def _without_default(model: Document, run: Run) -> Run:
    assert isinstance(model, FuzzySystem)
    outputs = [msgspec.structs.replace(one, default=None) for one in model.outputs]
    return NATIVE.load(msgspec.structs.replace(model, outputs=tuple(outputs)))


def _zeros(_: Document, run: Run) -> Run:
    def answer(values: FloatArray) -> Outcome:
        outcome = run(values)
        assert outcome.outputs is not None
        numbers = np.nan_to_num(outcome.outputs, nan=0.0)
        return msgspec.structs.replace(outcome, outputs=numbers)

    return answer


OTHER_ORDER = runtime(_other_order)
"""Adds up what rules conclude from the last to the first."""

NO_DEFAULT = runtime(_without_default)
"""Answers no number where no rule fires."""

ZEROS = runtime(_zeros)
"""Answers 0 where there is no number."""


def by_terms(degree: Callable[[Band | LR, float], float]) -> Runtime:
    """Return a slow runtime for rules whose degrees come from a function."""

    def load(model: Model, *, with_strengths: bool = True) -> Run:
        assert isinstance(model, RuleBase)
        shapes = {(v.name, t.name): t.shape for v in model.variables for t in v.terms}

        def one(proposition: Proposition, axes: dict[str, float]) -> float:
            result = [shapes[proposition.variable, term] for term in proposition.terms]
            return max(
                degree(shape, axes[proposition.variable])
                for shape in result
                if isinstance(shape, Band | LR)
            )

        def answer(values: FloatArray) -> Outcome:
            array = checked(values, model.inputs)
            strengths = np.zeros((len(model.rules), array.shape[1]))
            missing = np.zeros(array.shape[1], np.bool_)
            for row in range(array.shape[1]):
                axes = _axes(model, array[:, row].tolist())
                missing[row] = not all(map(math.isfinite, axes.values()))
                for number, rule in enumerate(model.rules):
                    strengths[number, row] = min(one(c, axes) for c in rule.when)
            result = winners(np.nan_to_num(strengths), missing)
            strengths[:, missing] = math.nan
            return Outcome(result[0], result[1], strengths)

        return answer

    return Runtime("defective", ("rules",), load)


def _axes(model: RuleBase, row: list[float]) -> dict[str, float]:
    return axis_values(model.variables, dict(zip(model.inputs, row, strict=True)))


def _plain(shape: Band | LR, value: float) -> float:
    return degree(shape, value)


def _swapped_edge(shape: Band | LR, value: float) -> float:
    """Return a degree with `<` where `<=` is right."""
    if isinstance(shape, Band) and value == shape.high:
        value = math.nextafter(value, math.inf)
    return _plain(shape, value)


def _soft_zero(shape: Band | LR, value: float) -> float:
    """Return a degree that leaves a rounding where an exact 0 belongs."""
    return max(_plain(shape, value), 1e-17)


def _raw_flank(shape: Band | LR, value: float) -> float:
    """Return a degree from powers of the value itself, as `a + b x`."""
    if not isinstance(shape, Band):
        return _plain(shape, value)
    is_left = shape.low is not None and value <= shape.low
    is_right = shape.high is not None and value > shape.high
    edge, end = (shape.low, shape.left) if is_left else (shape.high, shape.right)
    if edge is None or end is None or not (is_left or is_right):
        return _plain(shape, value)
    slope = 1.0 / (edge - end)
    return min(max(slope * value - end * slope, 0.0), 1.0 - 2.0**-53)


def _reciprocal(shape: Band | LR, value: float) -> float:
    """Return a degree whose place on a flank is a product instead of a quotient."""
    if not isinstance(shape, Band) or shape.high is None or shape.right is None:
        return _plain(shape, value)
    if value <= shape.high:
        return _plain(shape, value)
    place = (value - shape.right) * (1.0 / (shape.high - shape.right))
    return min(max(place, 0.0), 1.0 - 2.0**-53)


def _no_spread(shape: Band | LR, value: float) -> float:
    """Return 0 wherever a spread is as good as none, at the mean too."""
    if isinstance(shape, LR) and shape.left.spread <= 1e-12 * max(abs(shape.mean), 1.0):
        return 0.0
    return _plain(shape, value)


SWAPPED_EDGE = by_terms(_swapped_edge)
SOFT_ZERO = by_terms(_soft_zero)
RAW_POWERS = by_terms(_raw_flank)
NO_SPREAD = by_terms(_no_spread)
RECIPROCAL = by_terms(_reciprocal)
PLAIN = by_terms(_plain)
"""The same way of running, and nothing wrong with it."""


def six_digits() -> Format:
    """Return YAML that is written with six digits."""
    yaml = find_format("yaml")

    def short(value: float) -> float:
        return float(f"{value:.6g}")

    def write(model: Model, /, *, allow_loss: bool = False) -> Written:
        from fuzzytree.checking.stability.transforms import UnitChange, in_units

        def part(_: str, one: Part) -> Part:
            return Part(one.input, short(one.weight), short(one.centre))

        def place(_: str, value: float) -> float:
            return short(value)

        rounded = in_units(model, UnitChange(place, place, part))
        return yaml.write(rounded, allow_loss=allow_loss)

    return msgspec.structs.replace(yaml, write=write)


# --- a learner small enough to break on purpose

Spread = Callable[["FloatArray"], float]


def two_pass(values: FloatArray) -> float:
    """Return a standard deviation that shifts first."""
    rest = values - values[0]
    return float(np.sqrt(np.mean((rest - rest.mean()) ** 2)))


def one_pass(values: FloatArray) -> float:
    """Return a standard deviation from sums of values and squares."""
    rest = float(np.mean(values**2)) - float(np.mean(values)) ** 2
    return math.sqrt(max(rest, 0.0))


def tiny_learner(
    *,
    spread: Spread = two_pass,
    is_sorted: bool = True,
    least: float = 0.0,
    is_loud: bool = False,
) -> Callable[[FloatArray, Sequence[str]], FuzzyTree]:
    """Return a learner that cuts the first column between its first two classes.

    Args:
        spread: Its standard deviation.
        is_sorted: Whether sums run over sorted values, so that rows have no order.
        least: A spread below is this one.
        is_loud: Whether it warns.
    """

    def learn(values: FloatArray, classes: Sequence[str]) -> FuzzyTree:
        if is_loud:
            warnings.warn("invalid value", RuntimeWarning, stacklevel=2)
        names = sorted(set(classes))
        groups = [
            values[[k for k, c in enumerate(classes) if c == name], 0] for name in names
        ]
        groups = [np.sort(g) if is_sorted else g for g in groups]
        columns = tuple(f"x{k + 1}" for k in range(values.shape[1]))
        if len(groups) < 2:
            return FuzzyTree(
                "tiny", tuple(names), (Variable("x1"),), (), (Leaf(names[0]),)
            )
        means = [float(g[0] + np.mean(g - g[0])) for g in groups]
        scale = float(values[:, 0].max() - values[:, 0].min()) or abs(means[0])
        spreads = [max(spread(g), least) or scale or 1.0 for g in groups]
        order = [0, 1] if means[0] <= means[1] else [1, 0]
        cut = float(
            means[order[0]]
            + (means[order[1]] - means[order[0]])
            * (spreads[order[0]] / (spreads[order[0]] + spreads[order[1]]))
        )
        width = sum(spreads)
        left = Term("low", Band(high=cut, right=cut + width))
        right = Term("high", Band(low=cut, left=cut - width))
        sets = tuple(
            Term(name, LR(mean, Side(one, (1.0,)), Side(one, (1.0,))))
            for name, mean, one in zip(names, means, spreads, strict=False)
        )
        return FuzzyTree(
            "tiny",
            tuple(names),
            (Variable("x1", (left, right)),),
            (
                Node(
                    "x1",
                    (cut,),
                    (0, 1),
                    (
                        Branch(("low",), (names[order[0]],), leaf=1),
                        Branch(("high",), (names[order[1]],), leaf=2),
                    ),
                ),
            ),
            (Leaf(names[order[0]]), Leaf(names[order[1]])),
            (Sets("x1", sets),),
            columns=columns,
        )

    return learn


def learning_table() -> tuple[FloatArray, list[str]]:
    """Return two classes of unequal spread on one column that matters."""
    chance = np.random.default_rng(7)
    first = chance.normal(0.0, 1.0, (40, 2))
    second = chance.normal((9.0, 0.0), (3.0, 1.0), (40, 2))
    return np.concatenate([first, second]), ["a"] * 40 + ["b"] * 40

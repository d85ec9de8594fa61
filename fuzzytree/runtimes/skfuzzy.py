"""scikit-fuzzy: a rule base as a system of that library, evaluated by its own code.

Each variable becomes an `Antecedent` whose universe holds the points of its terms, in
which curves are lines within `TOLERANCE`, each rule a `Rule` over its terms, joined by
the library's `&`, `|` and `~`. Its simulation fuzzifies the values and computes the
rules. Its last step, defuzzification, has no meaning for classes: we take the strongest
rule.

The system is put together from its variables' graphs, and the rules are kept beside it:
`ControlSystem(rules)` takes a minute for 60 rules, and adds only their order.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable
from typing import Any

import numpy as np

from fuzzytree.errors import LossError, MissingExtraError, install_hint
from fuzzytree.model import (
    FloatArray,
    Model,
    Outcome,
    Proposition,
    RuleBase,
    Run,
    Runtime,
    Shape,
    shapes_of,
)
from fuzzytree.numerics import by_points
from fuzzytree.runtimes.degrees import shape_degrees
from fuzzytree.runtimes.rows import (
    axis_lines,
    checked,
    missing_rows,
    plan_axes,
    winners,
)
from fuzzytree.runtimes.table import rules_only

TOLERANCE = 1e-4
"""The largest error of a degree where a curve becomes points."""

HIGHEST = 1.0 - 2.0**-50
"""The highest degree off a plateau: joined by lines, such degrees stay below 1."""

_ROUNDING = 2.0**-40  # of a line between two points; covers far more than it must
_MOST_RULES = 200

_CANNOT = (
    "trees: it runs rule bases",
    "rules without a proposition: it needs a condition",
    f"more than {_MOST_RULES} rules: each term is a list of many points",
    "curves: they are points joined by lines, within a stated bound",
    "missing values: they are answered before it is called",
    "combinations: they are computed before and given to it as inputs",
)


def load(model: Model, *, with_strengths: bool = True) -> Run:
    """Return a function that answers many rows by a scikit-fuzzy system.

    Raises:
        LossError: If the model is a tree, has a rule without a proposition, or is too
            large.
        MissingExtraError: If scikit-fuzzy is not installed.
    """
    rules = _carried(model)
    try:
        import networkx
        from skfuzzy import control
        from skfuzzy.control.controlsystem import CrispValueCalculator
    except ImportError as error:
        raise MissingExtraError(
            f"running scikit-fuzzy needs {install_hint('skfuzzy')}"
        ) from error

    antecedents, fired = _build(by_points(rules, TOLERANCE).model)
    system = control.ControlSystem()
    system.graph = networkx.compose_all([a.graph for a in antecedents.values()])
    axes = plan_axes(rules.variables)

    def run(values: FloatArray) -> Outcome:
        array = checked(values, rules.inputs)
        rows = array.shape[1]
        # A simulation warns when it is given another number of rows than before.
        simulation = control.ControlSystemSimulation(system, cache=False)
        strengths = np.empty((len(rules.rules), rows))
        with np.errstate(all="ignore"):
            lines = axis_lines(axes, array)
            missing = missing_rows(lines)
        if missing is None:
            missing = np.zeros(rows, np.bool_)
        for name, antecedent in antecedents.items():
            known = np.where(missing, 0.0, lines[axes.line[name]])
            simulation.input[name] = known
            fuzzify = CrispValueCalculator(antecedent, simulation)
            fuzzify.fuzz(antecedent.input[simulation])
        for line, rule in zip(strengths, fired, strict=True):
            (consequent,) = rule.consequent
            consequent.term.membership_value[simulation] = None  # of the last run
            simulation.compute_rule(rule)
            line[:] = rule.aggregate_firing[simulation]
        simulation.reset()
        result = winners(strengths, missing)
        strengths[:, missing] = np.nan
        return Outcome(result[0], result[1], strengths)

    return run


def _carried(model: Model) -> RuleBase:
    """Return a rule base that the library can hold, or raise LossError."""
    rules, reason = rules_only(model, "scikit-fuzzy", "runs"), ""
    if len(rules.rules) > _MOST_RULES:
        reason = f"it has {len(rules.rules)} rules, more than {_MOST_RULES}"
    for number, rule in enumerate(rules.rules, 1):
        if not rule.when:
            reason = f"rule {number} has no proposition"
    if reason:
        raise LossError(f"cannot run {rules.name} as scikit-fuzzy: {reason}")
    return rules


def _named_shapes(rules: RuleBase) -> dict[str, dict[str, Shape]]:
    """Return the shapes that propositions name: those of each variable, by term."""
    shapes = shapes_of(rules.variables)
    result: dict[str, dict[str, Shape]] = {}
    for rule in rules.rules:
        for one in rule.when:
            named = result.setdefault(one.variable, {})
            named.update((term, shapes[one.variable, term]) for term in one.terms)
    return result


def _universe(shapes: Iterable[Shape]) -> FloatArray:
    """Return all points of some terms, with 0 and the doubles beside each.

    So plateaus begin and end at the very double, and a step is as wide as one.
    """
    knots = np.array([0.0, *(knot for shape in shapes for knot in shape.knots())])
    beside = np.nextafter(knots, -np.inf), np.nextafter(knots, np.inf)
    values: FloatArray = np.unique(np.concatenate([knots, *beside]))
    return values[np.isfinite(values)]


def _build(rules: RuleBase) -> tuple[dict[str, Any], list[Any]]:
    """Return the library's antecedents, by name, and its rules."""
    from skfuzzy import control

    is_product = rules.semantics.conjunction == "product"
    conjunction = np.multiply if is_product else np.fmin
    antecedents: dict[str, Any] = {}
    for name, shapes in _named_shapes(rules).items():
        points = _universe(shapes.values())
        antecedents[name] = control.Antecedent(points, name)
        for term, shape in shapes.items():
            degrees = shape_degrees(shape, points)
            degrees[degrees < 1.0] = np.minimum(degrees[degrees < 1.0], HIGHEST)
            if _is_too_steep(points, degrees):
                raise LossError(
                    f"cannot run {rules.name} as scikit-fuzzy: term {term!r} of "
                    f"{name!r} is too narrow for the slope of a line in double"
                )
            antecedents[name][term] = degrees
    answer = control.Consequent(np.arange(len(rules.classes) + 1.0), "class")
    for number, label in enumerate(rules.classes):
        answer[label] = (answer.universe == number).astype(np.float64)
    fired: list[Any] = []
    for number, rule in enumerate(rules.rules, 1):
        propositions = [_condition(antecedents[c.variable], c) for c in rule.when]
        condition = functools.reduce(operator.and_, propositions)
        then = answer[rule.then]
        fired.append(control.Rule(condition, then, str(number), conjunction, np.fmax))
    return antecedents, fired


def _is_too_steep(points: FloatArray, degrees: FloatArray) -> bool:
    """Return whether a line's slope overflows between two samples."""
    with np.errstate(over="ignore"):
        slopes = np.diff(degrees) / np.diff(points)
    is_step = np.nextafter(points[:-1], np.inf) == points[1:]
    return bool((np.isinf(slopes) & ~is_step).any())


def _condition(antecedent: Any, proposition: Proposition) -> Any:
    either = _either([antecedent[term] for term in proposition.terms])
    return ~either if proposition.negated else either


def _either(terms: list[Any]) -> Any:
    """Join terms by OR as a balanced tree: the library walks it by recursion."""
    if len(terms) == 1:
        return terms[0]
    middle = len(terms) // 2
    return _either(terms[:middle]) | _either(terms[middle:])


def bound(model: Model) -> tuple[float, str]:
    """Return how far strengths may be from the reference's, and why."""
    rules = _carried(model)
    lines = by_points(rules, TOLERANCE)
    most = max(len(rule.when) for rule in rules.rules)
    return min(lines.bound + most * _ROUNDING, 1.0), f"{lines.origin}, and rounding"


RUNTIMES = (
    Runtime(
        "scikit-fuzzy",
        ("rules",),
        load,
        bound=bound,
        cannot=_CANNOT,
        extra="skfuzzy",
        modules=("skfuzzy", "scipy", "networkx"),
        is_slow=True,
    ),
)

"""Membership functions, norms, hedges and formulas in plain floats; none of them fails.

What they are stands with the functions, and in `fuzzytree.model.norms`;
here each operation is performed at once. Where it has no value the result is what IEEE
754 and the C library say: NaN, or an infinity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fuzzytree.model import (
    S_NORMS,
    T_NORMS,
    Curve,
    Expression,
    Hedge,
    SNorm,
    TNorm,
)
from fuzzytree.model import hedged as hedged_in
from fuzzytree.model import value_of as value_in
from fuzzytree.semantics.programs.operations import DOUBLES, NOTHING, Doubles


def curve_degree(curve: Curve, x: float, names: Mapping[str, float] = NOTHING) -> float:
    """Return the degree of a finite value, without the term's height.

    Args:
        curve: The membership function. A `Linear` one, a sum of inputs, has the degree
            NaN.
        x: The value.
        names: The values of the variables, for formulas; `x` itself is added.

    Returns:
        A degree in [0, 1]. Of a formula any number, also NaN or an infinity.

    Raises:
        KeyError: If a formula needs a name that has no value.

    Example:
        >>> from fuzzytree.model import Arc, Trapezoid
        >>> curve_degree(Trapezoid(0.0, 2.0, 3.0, 4.0), 0.5)
        0.25
        >>> curve_degree(Arc(0.0, 1.0), 0.0), curve_degree(Arc(0.0, 1.0), 2.0)
        (0.0, 1.0)
    """
    return curve.degree(Doubles(names), x)


def value_at(curve: Curve, degree: float) -> float | None:
    """Return where a monotone membership function has a degree, after Tsukamoto.

    Monotone are `Sigmoid`, `SCurve`, `Concave` and `Arc`, and a ramp: two points of
    which one has degree 0 and the other 1. Degrees above 1, which sums can make, follow
    the same formulas: on along the line of a ramp, NaN for roots and logarithms.

    Returns:
        The value; None for every other function. Where only the infinite has the degree
        (1 of a sigmoid), an infinity.

    Example:
        >>> from fuzzytree.model import Concave, Gaussian, SCurve
        >>> value_at(SCurve(0.0, 4.0), 0.125), value_at(Concave(0.0, 1.0), 0.5)
        (1.0, 0.0)
        >>> value_at(Gaussian(0.0, 1.0), 0.5) is None
        True
    """
    return curve.inverse(DOUBLES, degree)


def value_of(expression: Expression, names: Mapping[str, float]) -> float:
    """Return the value of a formula.

    Raises:
        KeyError: If a name has no value, or a function is unknown.

    Example:
        >>> from fuzzytree.model import Call, Name, Number
        >>> twice = Call("*", (Number(2.0), Name("dirt")))
        >>> value_of(Call("+", (twice, Number(1.0))), {"dirt": 0.25})
        1.5
    """
    return value_in(DOUBLES, expression, names)


def hedged(hedges: Sequence[Hedge], degree: float) -> float:
    """Return what hedges make of a degree, the last first.

    Example:
        >>> hedged(["not", "very"], 0.5), hedged(["any"], 0.25)
        (0.75, 1.0)
    """
    return hedged_in(DOUBLES, hedges, degree)


def t_norm(name: TNorm, a: float, b: float) -> float:
    """Return the AND of two degrees.

    Example:
        >>> t_norm("bounded difference", 0.5, 0.75)
        0.25
    """
    return T_NORMS[name](DOUBLES, a, b)


def s_norm(name: SNorm, a: float, b: float) -> float:
    """Return the OR of two degrees.

    Example:
        >>> s_norm("algebraic sum", 0.5, 0.5), s_norm("sum", 1.0, 1.0)
        (0.75, 2.0)
    """
    return S_NORMS[name](DOUBLES, a, b)

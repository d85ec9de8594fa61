"""Angles and logarithms from operations that every runtime rounds alike.

Libraries differ in the last digits of atan and log, and some runtimes lack them in
double. These are made of additions, multiplications, divisions and square roots only,
so that a frame has the same features, bit for bit, wherever they are computed.
"""

from __future__ import annotations

import math

from fuzzytree.semantics.programs.steps import Maker

_HALVINGS = 2  # of the angle: the tangent is then at most tan(pi / 16), 0.199
_ANGLE_TERMS = 11  # the first that is left out is below 2e-17 of the angle
_ROOTS = 10  # of the logarithm's argument: exp(x / 1024) is then close to 1
_LOG_TERMS = 6


def angle(make: Maker, y: int, x: int) -> int:
    """Return the angle of the point (x, y) in degrees, above -180 and up to 180.

    It is exact on the axes, 0 for (0, 0), and within 6e-14 degrees elsewhere.
    """
    zero, one = make.constant(0.0), make.constant(1.0)
    wide, high = make("absolute", x), make("absolute", y)
    longer = make("maximum", wide, high)
    is_point = make("equal", longer, zero)
    longer = make("where", is_point, one, longer)
    tangent = make("divide", make("minimum", wide, high), longer)
    for _ in range(_HALVINGS):
        root = make("add", one, make("multiply", tangent, tangent))
        root = make("square_root", root)
        tangent = make("divide", tangent, make("add", one, root))
    series = _odd(make, tangent, [(-1.0) ** k for k in range(_ANGLE_TERMS)])
    factor = make.constant(2.0**_HALVINGS * 180.0 / math.pi)
    degrees = make("multiply", series, factor)
    turned = make("subtract", make.constant(90.0), degrees)
    degrees = make("where", make("less", wide, high), turned, degrees)
    turned = make("subtract", make.constant(180.0), degrees)
    degrees = make("where", make("less", x, zero), turned, degrees)
    return make("where", make("less", y, zero), make("negate", degrees), degrees)


def signed_log(make: Maker, x: int) -> int:
    """Return sign(x) log(1 + |x|), within 1e-12 up to |x| = 1e60."""
    zero, one = make.constant(0.0), make.constant(1.0)
    root = make("add", one, make("absolute", x))
    for _ in range(_ROOTS):
        root = make("square_root", root)
    ratio = make("divide", make("subtract", root, one), make("add", root, one))
    series = _odd(make, ratio, [1.0] * _LOG_TERMS)
    found = make("multiply", series, make.constant(2.0 ** (_ROOTS + 1)))
    below = make("subtract", zero, found)  # 0 for 0, where a negation has -0
    return make("where", make("less", x, zero), below, found)


def _odd(make: Maker, x: int, signs: list[float]) -> int:
    """Return x (s0 + x^2 (s1 / 3 + x^2 (s2 / 5 + ...)))."""
    square = make("multiply", x, x)
    terms = [sign / (2 * k + 1) for k, sign in enumerate(signs)]
    total = make.constant(terms[-1])
    for term in reversed(terms[:-1]):
        total = make("add", make("multiply", total, square), make.constant(term))
    return make("multiply", x, total)

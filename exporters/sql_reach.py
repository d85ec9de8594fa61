"""How far the numbers of a program reach, as its doubles are rounded.

A writer of SQL needs no `CASE` around what can neither overflow, nor underflow, nor be
undefined.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence
from typing import NamedTuple

from fuzzytree.semantics import NUMERIC, Program, Step, still_results

LARGEST = sys.float_info.max
_SMALLEST = math.ulp(0.0)
_RISING = frozenset(
    ("add", "subtract", "minimum", "maximum", "negate", "floor", "ceiling", "round")
) | {"square_root", "exponential", "logarithm", "logarithm_10", "arc_sine"} | {
    "arc_cosine", "arc_tangent", "hyperbolic_sine", "hyperbolic_tangent", "area_sine",
}  # fmt: skip
"""Operations whose ends are results of ends."""


class Reach(NamedTuple):
    """Where the results of a step lie.

    Attributes:
        low: The least result.
        high: The greatest one.
        least: The least distance from 0 of a result that is not 0.
        is_sure: Whether the result is always a number.
    """

    low: float = -math.inf
    high: float = math.inf
    least: float = _SMALLEST
    is_sure: bool = False

    @property
    def size(self) -> float:
        """The largest distance from 0."""
        return max(-self.low, self.high)

    @property
    def has_zero(self) -> bool:
        """Whether a result may be 0."""
        return self.low <= 0.0 <= self.high


def reaches(program: Program) -> list[Reach]:
    """Return how far each step reaches where all inputs are finite."""
    results: list[Reach] = []
    for step, still in zip(program.steps, still_results(program), strict=True):
        operands = [results[place] for place in step.arguments]
        if isinstance(still, float | bool):
            results.append(_of_number(float(still)))
            continue
        reach = _reach(step, operands)
        if any(not one.is_sure for one in operands):
            reach = reach._replace(is_sure=False)
        least = reach.least if reach.least >= _SMALLEST else _SMALLEST
        results.append(reach._replace(least=least))
    return results


def _of_number(number: float) -> Reach:
    if math.isnan(number):
        return Reach(0.0, 0.0, math.inf)
    return Reach(number, number, abs(number) or math.inf, is_sure=True)


def _reach(step: Step, operands: Sequence[Reach]) -> Reach:
    if step.table:
        table = step.table if step.operation == "pick" else (0.0, len(step.table))
        least = min((abs(one) for one in step.table if one), default=math.inf)
        return Reach(min(table), max(table), min(least, 1.0), is_sure=True)
    if step.kind == "truth":
        return Reach(0.0, 1.0, 1.0, step.operation != "is_finite")
    match step.operation:
        case "input":
            return Reach(-LARGEST, LARGEST, is_sure=True)
        case "where":
            ends = [x for one in operands[1:] for x in (one.low, one.high)]
            return Reach(min(ends), max(ends), _least(step, operands), is_sure=True)
        case "absolute":
            (one,) = operands
            low = 0.0 if one.has_zero else min(abs(one.low), abs(one.high))
            return Reach(low, one.size, one.least, is_sure=True)
        case "sine" | "cosine":
            return Reach(-1.0, 1.0, is_sure=operands[0].size < math.inf)
        case "multiply" if step.arguments[0] == step.arguments[1]:
            size = operands[0].size
            return Reach(0.0, size * size, _least(step, operands), is_sure=True)
        case "multiply" | "power" | "divide":
            a, b = operands
            return _of_two(step, a, b)
        case operation if operation in _RISING:
            return _of_ends(step, operands)
        case _:
            return Reach()


def _of_two(step: Step, a: Reach, b: Reach) -> Reach:
    match step.operation:
        case "divide" if b.has_zero:
            size = a.size / b.least if b.least < math.inf else math.inf
            return Reach(-size, size, _least(step, (a, b)))
        case "power" if a.low < 0.0 or (a.low == 0.0 and b.low < 0.0):
            return Reach()
        case "multiply" if (a.has_zero and b.size == math.inf) or (
            b.has_zero and a.size == math.inf
        ):
            return Reach()
        case _:
            return _of_ends(step, (a, b))


def _of_ends(step: Step, operands: Sequence[Reach]) -> Reach:
    ends = itertools.product(*((one.low, one.high) for one in operands))
    results = [NUMERIC[step.operation](*one) for one in ends]
    if any(map(math.isnan, results)):
        return Reach()
    return Reach(min(results), max(results), _least(step, operands), is_sure=True)


def underflows(step: Step, operands: Sequence[Reach]) -> bool:
    """Return whether a result may be rounded to 0 although it is none."""
    return not _least(step, operands) >= _SMALLEST


def overflows(step: Step, operands: Sequence[Reach]) -> bool:
    """Return whether a result may be infinite."""
    return _reach(step, operands).size > LARGEST


def is_defined(step: Step, operands: Sequence[Reach]) -> bool:
    """Return whether a result is a number if the operands are."""
    return _reach(step, operands).is_sure


def _least(step: Step, operands: Sequence[Reach]) -> float:
    """Return the least distance from 0 of a result that is not 0."""
    least = [one.least for one in operands]
    match step.operation:
        case "minimum" | "maximum" | "where" | "negate":
            return min(least[-2:])
        case "add" | "subtract":
            # Doubles from `least` on are whole multiples of its last digit.
            unit = min(math.ulp(min(one, LARGEST)) for one in least)
            for one in operands:
                if not one.has_zero and one.least < math.inf:
                    unit = max(unit, math.ulp(one.least) / 4.0)
            return unit
        case "multiply":
            return least[0] * least[1]
        case "divide":
            return least[0] / operands[1].size if operands[1].size else 0.0
        case "square_root":
            return math.sqrt(least[0])
        case "floor" | "ceiling" | "round":
            return 1.0
        case "exponential":
            return math.exp(operands[0].low) if operands[0].low < 700.0 else 1.0
        case "power" if operands[1].low == operands[1].high > 0.0:
            return NUMERIC["power"](least[0], operands[1].low)
        case _:
            return _SMALLEST

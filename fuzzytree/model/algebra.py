"""What membership functions and norms are computed with: any kind of number.

A meaning is written once, for numbers of a kind `N` and the operations on them that
`Numbers` has: doubles, steps of a program, or enclosures. Where there is a choice
between formulas, all are computed and `where` takes one, so a formula may have no value
where it is not taken. A truth is a number of the same kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, Self, TypeVar


class Real(Protocol):
    """A number, or what stands for one."""

    def __neg__(self) -> Self: ...

    def __add__(self, other: Self | float, /) -> Self: ...

    def __radd__(self, other: float, /) -> Self: ...

    def __sub__(self, other: Self | float, /) -> Self: ...

    def __rsub__(self, other: float, /) -> Self: ...

    def __mul__(self, other: Self | float, /) -> Self: ...

    def __rmul__(self, other: float, /) -> Self: ...

    def __truediv__(self, other: Self | float, /) -> Self: ...

    def __rtruediv__(self, other: float, /) -> Self: ...


N = TypeVar("N", bound=Real)


class Numbers(Protocol[N]):
    """The operations on a kind of number that operators do not say.

    Attributes:
        names: The values of variables, for formulas.
    """

    names: Mapping[str, N]

    def constant(self, number: float, /) -> N:
        """Return a constant."""
        ...

    def __call__(self, operation: str, /, *operands: N | float) -> N:
        """Return what an operation of programs makes of numbers or truths."""
        ...

    def table(self, operation: str, place: N, table: Sequence[float], /) -> N:
        """Return what `below` or `pick` finds in a table for a number."""
        ...

    def where(self, truth: N, then: N | float, other: N | float, /) -> N:
        """Return one number where something is true, and another elsewhere."""
        return self("where", truth, then, other)

    def less(self, a: N | float, b: N | float, /) -> N:
        """Return whether a < b."""
        return self("less", a, b)

    def at_most(self, a: N | float, b: N | float, /) -> N:
        """Return whether a <= b."""
        return self("at_most", a, b)

    def equal(self, a: N | float, b: N | float, /) -> N:
        """Return whether a = b."""
        return self("equal", a, b)

    def minimum(self, a: N | float, b: N | float, /) -> N:
        """Return the smaller of two numbers."""
        return self("minimum", a, b)

    def maximum(self, a: N | float, b: N | float, /) -> N:
        """Return the larger of two numbers."""
        return self("maximum", a, b)

    def divide(self, a: N | float, b: N | float, /) -> N:
        """Return a / b, also where b may be 0."""
        return self("divide", a, b)

    def absolute(self, a: N, /) -> N:
        """Return the size of a number."""
        return self("absolute", a)

    def root(self, a: N, /) -> N:
        """Return the square root."""
        return self("square_root", a)

    def exponential(self, a: N, /) -> N:
        """Return e to the power a."""
        return self("exponential", a)

    def power(self, a: N, b: float, /) -> N:
        """Return a to the power b."""
        return self("power", a, b)


def as_number(n: Numbers[N], truth: N) -> N:
    """Return 1 for a truth and 0 for an untruth."""
    return n.where(truth, 1.0, 0.0)


def square(a: N) -> N:
    """Return a times a."""
    return a * a

"""Numbers with a bound of their rounding error, as steps of a program.

Each carries, beside its value, a bound on how far rounding may have moved it; what lies
within its own bound of 0 is noise and becomes exactly 0 (`settled`). The bound is
first-order running error analysis, made rigorous by a factor that covers the roundings
of the bound itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from fuzzytree.semantics.programs.steps import Maker

UNIT = 2.0**-53
"""The largest relative error of one rounding."""

_SAFETY = 1.0 + 2.0**-40
"""More than the roundings of a bound of fewer than 4,000 operations can take away."""


@dataclass(frozen=True, slots=True)
class Noisy:
    """A step and the step of its error's bound; without one it is exact."""

    value: int
    error: int | None = None


class Noise:
    """Arithmetic on numbers with bounds."""

    def __init__(self, make: Maker) -> None:
        self._make = make

    def sum(self, *terms: Noisy) -> Noisy:
        """Return the sum, added from left to right."""
        total = terms[0]
        for term in terms[1:]:
            value = self._make("add", total.value, term.value)
            total = self._rounded(value, [total.error, term.error])
        return total

    def difference(self, one: Noisy, two: Noisy) -> Noisy:
        """Return one - two."""
        value = self._make("subtract", one.value, two.value)
        return self._rounded(value, [one.error, two.error])

    def times(self, factor: float, one: Noisy) -> Noisy:
        """Return a number times a small whole number or power of two."""
        constant = self._make.constant(factor)
        value = self._make("multiply", one.value, constant)
        errors: list[int | None] = []
        if one.error is not None:
            size = self._make.constant(abs(factor))
            errors.append(self._make("multiply", one.error, size))
        return self._rounded(value, errors)

    def product(self, one: Noisy, two: Noisy) -> Noisy:
        """Return one * two."""
        make = self._make
        value = make("multiply", one.value, two.value)
        errors: list[int | None] = []
        if two.error is not None:
            size = make("absolute", one.value)
            if one.error is not None:
                size = make("add", size, one.error)
            errors.append(make("multiply", size, two.error))
        if one.error is not None:
            size = make("absolute", two.value)
            errors.append(make("multiply", size, one.error))
        return self._rounded(value, errors)

    def settled(self, one: Noisy) -> int:
        """Return the value, exactly 0 where it is not beyond its bound."""
        if one.error is None:
            return one.value
        make = self._make
        floor = make("multiply", one.error, make.constant(_SAFETY))
        is_noise = make("at_most", make("absolute", one.value), floor)
        return make("where", is_noise, make.constant(0.0), one.value)

    def _rounded(self, value: int, errors: list[int | None]) -> Noisy:
        make = self._make
        own = make("multiply", make("absolute", value), make.constant(UNIT))
        known = [error for error in errors if error is not None]
        return Noisy(value, make.chain("add", [*known, own]))

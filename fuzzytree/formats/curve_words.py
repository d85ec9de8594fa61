"""Membership functions as the words of a file: a word, and numbers in some order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec

from fuzzytree.model import (
    Curve,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SystemCurve,
)


class CurveWord(msgspec.Struct, frozen=True):
    """How many numbers a word has (its arity), and which function they make.

    `make` raises ValueError for wrong numbers. Where the word writes all functions of a
    class, `order` has for each number its place among those of the class.
    """

    arity: int
    make: Callable[[Sequence[float]], Curve]
    kind: type[SystemCurve] | None = None
    order: tuple[int, ...] = ()


def fields(kind: type[SystemCurve], *order: int, by_size: bool = False) -> CurveWord:
    """Return a word whose numbers are those of a class, in some order.

    With `by_size` the size of a width counts and not its sign.

    Example:
        >>> from fuzzytree.model import Gaussian
        >>> fields(Gaussian, 1, 0, by_size=True).make([-2.0, 5.0])
        Gaussian(mean=5.0, deviation=2.0)
    """

    def make(numbers: Sequence[float]) -> SystemCurve:
        values = [numbers[order.index(place)] for place in range(len(order))]
        if kind in (SigmoidDifference, SigmoidProduct):
            return _built(kind, Sigmoid(*values[:2]), Sigmoid(*values[2:]))
        for place, name in enumerate(kind.__struct_fields__):
            if by_size and name.endswith(("deviation", "width")):
                values[place] = abs(values[place])
        return _built(kind, *values)

    return CurveWord(len(order), make, kind, order)


def _built(kind: Callable[..., SystemCurve], *values: float | Sigmoid) -> SystemCurve:
    return kind(*values)


def in_words(
    curve: SystemCurve, words: Mapping[str, CurveWord]
) -> tuple[str, list[float]] | None:
    """Return the word for a membership function and its numbers, if there is one."""
    for name, word in words.items():
        if word.kind is type(curve):
            numbers = _numbers(curve)
            return name, [numbers[place] for place in word.order]
    return None


def _numbers(curve: SystemCurve) -> list[float]:
    numbers: list[float] = []
    for name in curve.__struct_fields__:
        value = getattr(curve, name)
        numbers += _numbers(value) if isinstance(value, Sigmoid) else [value]
    return numbers

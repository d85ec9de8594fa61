"""The probabilities of classes that a leaf or a rule carries, and what they mean.

A row's probabilities are a mixture of the vectors of all rules. Rule r has the weight
`floor(65536 * strength ** sharpness)`, its vector counts millionths, and class c gets
`n[c] = sum(weight[r] * vector[r][c])`, a sum of whole numbers that is exact in double
in any order. A rule whose strength is below `65536 ** (-1 / sharpness)` has the weight
0, so a runtime may leave it out. If the predicted class has not the largest number
alone, it gets the largest of the others plus 1. The probability of c is
`n[c] / sum(n)`, rounded once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.model.mistakes import Mistake

Probabilities = tuple[float, ...] | msgspec.UnsetType
"""A number for each class, in whole millionths, with the sum 1."""

PARTS = 1_000_000
"""How many parts of a probability there are."""

WEIGHT_OF_ONE = 65_536
"""The weight of a rule with strength 1."""

SHARPNESS = tuple(2**k for k in range(11))
"""The powers to which strengths may be raised, by squaring them again and again."""

MOST_MIXED = 16_384
"""Rules with probabilities that a model can have: sums stay exact, and distinct."""

MOST_PROBABILITIES = 1 << 20
"""Classes times rules up to which a model can have probabilities."""


def parts_of(probabilities: Probabilities) -> tuple[int, ...]:
    """Return probabilities as millionths; none without probabilities.

    Example:
        >>> parts_of((0.75, 0.25))
        (750000, 250000)
    """
    return tuple(round(one * PARTS) for one in probabilities or ())


def squarings(sharpness: int | msgspec.UnsetType) -> int:
    """Return how often a strength is squared to raise it to a power.

    Example:
        >>> squarings(8)
        3
    """
    return (sharpness or 1).bit_length() - 1


def least_strength(sharpness: int) -> float:
    """Return a strength below which a rule has the weight 0, however it is rounded.

    Squares are off by less than `sharpness` roundings, which the margin is far above.

    Example:
        >>> round(least_strength(4), 6)
        0.0625
    """
    return math.pow(WEIGHT_OF_ONE, -1.0 / sharpness) * (1.0 - 1e-9)


def sharpness_mistakes(sharpness: int | msgspec.UnsetType) -> Iterator[Mistake]:
    """Yield why the power of the strengths is none."""
    if sharpness is not msgspec.UNSET and sharpness not in SHARPNESS:
        text = f"the sharpness is a power of 2 from 1 to 1024, not {sharpness!r}"
        yield ("semantics", "sharpness"), text


def probability_mistakes(
    kind: str,
    vectors: Sequence[Probabilities],
    classes: int,
    sharpness: int | msgspec.UnsetType,
) -> Iterator[Mistake]:
    """Yield what is wrong with the probabilities of all rules, or of all leaves.

    Args:
        kind: The field of the model, `rules` or `leaves`.
        vectors: Of each rule or leaf, in order.
        classes: How many there are.
        sharpness: Of the model; unset in a model without probabilities.
    """
    noun = {"rules": "rule", "leaves": "leaf"}[kind]
    wanted = sharpness is not msgspec.UNSET
    if wanted and (
        len(vectors) > MOST_MIXED or len(vectors) * classes > MOST_PROBABILITIES
    ):
        text = (
            f"{len(vectors)} {kind} and {classes} classes are too many for "
            f"probabilities: at most {MOST_MIXED} {kind} and {MOST_PROBABILITIES} "
            "numbers in all"
        )
        yield (kind,), text
        return
    for number, vector in enumerate(vectors, 1):
        fault = next(_faults(vector, classes, wanted=wanted), None)
        if fault:
            path = (kind, number - 1, "probabilities")
            yield path, f"{noun} {number}: {fault}"


def _faults(vector: Probabilities, classes: int, *, wanted: bool) -> Iterator[str]:
    """Yield what is wrong with the probabilities of one rule."""
    if vector is msgspec.UNSET:
        if wanted:
            yield "it has no probabilities, and the semantics has a sharpness"
        return
    if not wanted:
        yield "it has probabilities, and the semantics has no sharpness"
    elif len(vector) != classes:
        yield f"{len(vector)} probabilities for {classes} classes"
    elif not all(0.0 <= one <= 1.0 for one in vector):
        yield "a probability lies in [0, 1]"
    elif any(one != round(one * PARTS) / PARTS for one in vector):
        yield "a probability has six digits behind the point at most"
    elif sum(parts_of(vector)) != PARTS:
        total = sum(parts_of(vector)) / PARTS
        yield f"the probabilities add up to {total!r}, not to 1"

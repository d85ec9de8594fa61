"""Distances of functions of lines (`fuzzytree.auditing.decide.measures`), as pairs."""

from __future__ import annotations

from fractions import Fraction

from fuzzytree.auditing.decide import measures
from fuzzytree.auditing.decide.lines import Between
from fuzzytree.auditing.decide.measures import Bounds as Bounds
from fuzzytree.auditing.decide.measures import curve_distance as curve_distance


def largest_gap(one: Between, other: Between) -> tuple[Bounds, Fraction]:
    """Return how far two functions are apart at most, and where."""
    low, high, at = measures.largest_gap(one, other)
    return Bounds(low, high), at


def are_apart(one: Between, other: Between, most: Fraction) -> bool:
    """Return whether two functions surely differ by more than a number somewhere."""
    return measures.largest_gap(one, other).low > most

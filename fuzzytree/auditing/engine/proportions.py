"""Where are two rules one function, under the product? Box by box, without rounding.

In a box of cells a rule's strength is a product of polynomials, one on each axis. Two
such products agree on a set with an interior exactly if on every axis one polynomial is
a constant times the other, and the constants multiply to 1: polynomials that agree on
an open set are equal, and on free axes they part into factors in one way only. On axes
that share inputs this holds as well while no two of them have the same direction, for
then no factor of the one is a multiple of a factor of the other.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import msgspec

from fuzzytree.auditing.engine.curves import ONE, ZERO
from fuzzytree.auditing.engine.factors import Factored
from fuzzytree.auditing.engine.ground import Ground, Laid
from fuzzytree.auditing.engine.parts import START
from fuzzytree.auditing.engine.polynomials import Polynomial, difference, monic
from fuzzytree.auditing.engine.variables import linear_form


class Run(NamedTuple):
    """Neighbouring cells of an axis, by number; `START` twice is its only value."""

    first: int
    last: int


Box = tuple[Run, ...]
"""A run on each axis."""

_Form = tuple[Fraction, Polynomial]


class Proportions(msgspec.Struct, frozen=True, eq=False, dict=True):
    """The rules of a ground, to be compared as functions on boxes of cells.

    Attributes:
        ground: The rules, joined by the product, and the box, which is not empty.
    """

    ground: Ground

    @functools.cached_property
    def factored(self) -> Factored:
        """The rules as polynomials."""
        return Factored(self.ground)

    @property
    def laid(self) -> tuple[Laid, ...]:
        """The axes."""
        return self.ground.laid[0]

    @functools.cached_property
    def whole(self) -> Box:
        """All of the domain."""
        count = [len(laid.cells.between) for laid in self.laid]
        return tuple(Run(0, n - 1) if n else Run(START, START) for n in count)

    def boxes(self, one: int, other: int, within: Box) -> Iterator[Box]:
        """Yield all boxes on which two rules are one function that is not 0.

        Args:
            one: The position of a rule.
            other: The position of another one.
            within: Where they are looked for.
        """
        runs: list[list[tuple[Run, Fraction]]] = []
        for axis, run in enumerate(within):
            found = [*self._runs(axis, one, other, run)]
            if not found:
                return
            runs.append(found)
        reach = [{ONE}]  # what the ratios of the last axes can multiply to
        for of in reversed(runs):
            reach.append({a * b for a in {ratio for _, ratio in of} for b in reach[-1]})
        reach.reverse()
        todo: list[tuple[Box, Fraction]] = [((), ONE)]
        while todo:
            box, ratio = todo.pop()
            if 1 / ratio not in reach[len(box)]:
                continue
            if len(box) == len(within):
                yield box
            else:
                todo += [((*box, run), ratio * by) for run, by in runs[len(box)]]

    def are_one(self, one: int, other: int, box: Box) -> bool:
        """Return whether two rules are one function on all of a box."""
        whole = ONE
        for axis, run in enumerate(box):
            if self.is_shared(axis, one, other):
                continue
            if any(self.vague(axis, run)):
                return False
            ratios = {
                self._ratio(axis, one, other, cell)
                for cell in _cells(run)
                if not self._is_zero(axis, one, cell)
                or not self._is_zero(axis, other, cell)
            }
            if not ratios:
                return True  # both are 0
            ratio = ratios.pop()
            if ratios or ratio is None:
                return False
            whole *= ratio
        return whole == 1

    def is_told(self, one: int, other: int) -> bool:
        """Return whether cells tell all about two rules: none is hidden in a zone."""
        return not any(
            any(self.vague(axis, run)) and not self.is_shared(axis, one, other)
            for axis, run in enumerate(self.whole)
        )

    def vague(self, axis: int, run: Run) -> Sequence[bool]:
        """Return of each place within a run, its ends too, if it may hide a cell."""
        found: list[bool] = self.laid[axis].cells.is_vague.tolist()
        return found[max(run.first, 0) : run.last + 2]

    @functools.cached_property
    def _shared(self) -> dict[tuple[int, int, int], bool]:
        return {}

    def is_shared(self, axis: int, one: int, other: int) -> bool:
        """Return whether two rules ask the same of an axis, in whatever order."""
        key = axis, one, other
        if key not in self._shared:
            asked = self.factored.asked[axis]
            self._shared[key] = sorted(asked[one]) == sorted(asked[other])
        return self._shared[key]

    def are_free(self, one: int, other: int) -> bool:
        """Return whether no two axes on which rules differ have one direction."""
        found: list[tuple[tuple[int, Fraction], ...]] = []
        for axis, laid in enumerate(self.laid):
            if self.is_shared(axis, one, other):
                continue
            direction = direction_of(self.ground, axis)
            if direction and not laid.cells.between:
                return False  # one value of a combination makes inputs depend
            if direction in found:
                return False
            if direction:
                found.append(direction)
        return True

    @functools.cached_property
    def _forms(self) -> dict[tuple[int, int, int], _Form]:
        return {}

    def _form(self, axis: int, rule: int, cell: int) -> _Form:
        """Return a rule's polynomial in a cell: the last number, and the rest by it."""
        key = axis, rule, cell
        if key not in self._forms:
            if cell == START:
                polynomial: Polynomial = (self.factored.at_start(axis, rule),)
            else:
                polynomial = self.factored.polynomial(axis, rule, cell)
            polynomial = difference(polynomial, (ZERO,))
            self._forms[key] = polynomial[-1], monic(polynomial)
        return self._forms[key]

    def _is_zero(self, axis: int, rule: int, cell: int) -> bool:
        return not self._form(axis, rule, cell)[0]

    def _ratio(self, axis: int, one: int, other: int, cell: int) -> Fraction | None:
        """Return one rule by another one in a cell; None if it varies, or is 0."""
        (a, p), (b, q) = (self._form(axis, rule, cell) for rule in (one, other))
        return a / b if a and b and p == q else None

    def _runs(
        self, axis: int, one: int, other: int, within: Run
    ) -> Iterator[tuple[Run, Fraction]]:
        """Yield runs on which two rules are in one ratio, as long as they can be."""
        if self.is_shared(axis, one, other):
            yield within, ONE
            return
        is_vague = self.laid[axis].cells.is_vague
        first, known = within.first, None
        for cell in _cells(within):
            ratio = self._ratio(axis, one, other, cell)
            if ratio == known and not (cell > first and is_vague[cell]):
                continue
            if known is not None:
                yield Run(first, cell - 1), known
            first, known = cell, ratio
        if known is not None:
            yield Run(first, within.last), known

    def ends(self, axis: int, run: Run) -> tuple[Fraction, Fraction]:
        """Return the ends of a run; those of the axis where it reaches them."""
        cells = self.laid[axis].cells
        if run == self.whole[axis]:
            return cells.zones[0][0], cells.zones[-1][1]
        low = cells.between[run.first][0] if run.first else cells.zones[0][0]
        is_last = run.last == len(cells.between) - 1
        high = cells.zones[-1][1] if is_last else cells.between[run.last][1]
        return low, high


def _cells(run: Run) -> range:
    return range(run.first, run.last + 1)


def direction_of(given: Ground, axis: int) -> tuple[tuple[int, Fraction], ...]:
    """Return the weights of an axis's inputs that vary, as multiples of the first."""
    number = {name: place for place, name in enumerate(given.rules.inputs)}
    weights, _ = linear_form(given.axes[axis].variable, number)
    sides = [given.domain.side(name) for name in given.rules.inputs]
    kept = [
        (place, weight)
        for place, weight in sorted(weights.items())
        if (side := sides[place]) is not None and side.low < side.high
    ]
    return tuple((place, weight / kept[0][1]) for place, weight in kept)


def have_one_direction(given: Ground) -> bool:
    """Return whether curves of two axes can be one function of the inputs."""
    known = [direction_of(given, axis) for axis in range(len(given.axes))]
    found = [one for one in known if one]
    return len(set(found)) < len(found)

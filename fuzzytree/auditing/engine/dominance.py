"""Is a rule at least as strong as another one everywhere? Exactly, axis by axis.

Every axis is free, so the question falls apart into questions about single axes.

- **Min.** Rule q is somewhere weaker than r iff on some axis f there is a value x with
  `q_f(x) < r_f(x)` and `q_f(x) < H`, where H is the supremum of r's degrees on the
  other axes together, the least of their suprema: for then r can be brought above
  `q_f(x)`, and q cannot.
- **Product.** Where r fires, `r / q` is a product of ratios of single axes. Its
  supremum is the product of theirs, and q is nowhere weaker iff that is at most 1.

Where axes share inputs, not all of these values occur together. What is proved stays
true then; what is not proved may still hold.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid
from fuzzytree.auditing.engine.factors import (
    Factored,
    is_single,
    largest_ratio,
    least_ratios,
    meets,
)
from fuzzytree.model import checkpoint

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray

    BoolArray = npt.NDArray[np.bool_]
    ByteArray = npt.NDArray[np.int8]

Dominance = Literal["always", "not", "open"]
"""It holds everywhere, it does not, or it is too near to tell."""

FAR = 1 << 40
"""A number above that of every band."""


class _AxisDegrees(NamedTuple):
    """One axis, rule by rule; levels are numbers of bands."""

    rank: IntArray  # shape (rules, cells): the order of the rules' degrees in a cell
    least: IntArray  # shape (rules, cells): their infimum in it
    most: IntArray  # shape (rules, cells): their supremum in it
    at: IntArray  # shape (rules, zones): their values at the places between cells
    is_zero: BoolArray  # shape (rules, cells): whether it is 0 throughout
    is_zero_at: BoolArray  # shape (rules, zones): whether it is 0 there, for sure
    start_rank: IntArray  # shape (rules,): the order at the lower end
    has_start: bool  # whether the lower end belongs to the box
    top: IntArray  # shape (rules,): the supremum
    is_reached: BoolArray  # shape (rules,): whether the supremum may be reached


class RulePairs(msgspec.Struct, frozen=True, eq=False, dict=True):
    """The rules of a ground, ready to be compared two by two."""

    base: Arrangement  # the rules and the box, which is not empty

    @functools.cached_property
    def fine(self) -> RulePairs:
        """The same with levels known as fractions."""
        return RulePairs(self.base.fine)

    @functools.cached_property
    def sides(self) -> tuple[_AxisDegrees, ...]:
        """The axes, rule by rule."""
        domain = self.base.domain
        items: list[_AxisDegrees] = []
        for grid in self.base.grids:
            side = domain.side(grid.axis.variable.name)
            items.append(
                _axis_degrees(grid, has_start=side is None or not side.is_open)
            )
        return tuple(items)

    @functools.cached_property
    def tops(self) -> tuple[IntArray, IntArray, BoolArray]:
        """Suprema of rules: on all axes, and on all but each one; and if reached.

        Shapes (rules,), (axes, rules) and (axes, rules).
        """
        sides = self.sides
        count = len(self.base.rules.rules)
        tops = np.array([side.top for side in sides]).reshape(len(sides), count)
        reached = np.array([s.is_reached for s in sides]).reshape(tops.shape)
        rest = np.full_like(tops, FAR)
        rest_reached = np.ones(tops.shape, dtype=bool)
        for axis in range(len(sides)):
            others = np.arange(len(sides)) != axis
            rest[axis] = tops[others].min(axis=0, initial=FAR)
            binds = tops[others] == rest[axis]
            rest_reached[axis] = (reached[others] | ~binds).all(axis=0)
        return tops.min(axis=0, initial=FAR), rest, rest_reached

    @functools.cached_property
    def fires(self) -> BoolArray:
        """Whether each rule fires anywhere, if axes are free."""
        result = np.ones(len(self.base.rules.rules), dtype=bool)
        for side, grid in zip(self.sides, self.base.grids, strict=True):
            # Continuous from the left: one place between two cells is as these are.
            single = [is_single(grid, *zone) for zone in grid.cells.zones]
            zones = side.is_zero_at[:, 1:] | np.array(single[1:], bool)
            start = side.is_zero_at[:, 0] if side.has_start else np.True_
            result &= ~(side.is_zero.all(axis=1) & zones.all(axis=1) & start)
        return result

    @functools.cached_property
    def factored(self) -> Factored:
        """The rules' degrees as polynomials."""
        return Factored(self.base)

    @functools.cached_property
    def ratios(self) -> FloatArray:
        """Shape (rules, rules): at least so large does r / q become, under product."""
        return least_ratios(self.factored)

    @property
    def is_product(self) -> bool:
        """Whether degrees are multiplied."""
        return self.factored.is_product

    def never_weaker(self, strong: int, weak: int) -> Dominance:
        """Return whether a rule is nowhere weaker than another one."""
        if self.is_product:
            if self.ratios[strong - 1, weak - 1] > 1.0:
                return "not"
            most = largest_ratio(self.factored, strong - 1, weak - 1)
            if most is None or most.low > 1:
                return "not"
            return "always" if most.high <= 1 else "open"
        result = int(self._weaker(weak - 1)[strong - 1])
        if result == 2 and not self.base.is_fine:
            return self.fine.never_weaker(strong, weak)
        verdicts: tuple[Dominance, ...] = ("always", "not", "open")
        return verdicts[result]

    def above(self, strong: int, weak: int) -> Dominance:
        """Return whether a rule is stronger than another wherever that fires."""
        verdict = self.never_weaker(strong, weak)
        if verdict != "always":
            return verdict
        if self.is_product:
            most = largest_ratio(self.factored, strong - 1, weak - 1)
            if most is not None and most.high < 1:
                return "always"
            is_met = meets(self.factored, strong - 1, weak - 1)
            return "not" if is_met else "open"
        may, surely = self._not_above(weak - 1)
        if may[strong - 1] and not surely[strong - 1] and not self.base.is_fine:
            return self.fine.above(strong, weak)
        if not may[strong - 1]:
            return "always"
        return "not" if surely[strong - 1] else "open"

    @functools.cached_property
    def _known(self) -> dict[tuple[str, int], ByteArray]:
        return {}

    def _weaker(self, weak: int) -> ByteArray:
        """For each rule: 1 if it is somewhere weaker than one, 2 if unknown, else 0."""
        checkpoint()
        key = "weaker", weak
        if key in self._known:
            return self._known[key]
        result = np.zeros(len(self.base.rules.rules), dtype=np.int64)
        for side, rest in zip(self.sides, self.tops[1], strict=True):
            below = side.rank < side.rank[weak]
            least = np.where(below, side.least, FAR).min(axis=1, initial=FAR)
            if side.has_start:
                start = side.start_rank < side.start_rank[weak]
                least = np.minimum(least, np.where(start, side.at[:, 0], FAR))
            near = (least == rest[weak]) & ~self._is_sharp(least) & (result == 0)
            result = np.where(least < rest[weak], 1, np.where(near, 2, result))
        self._known[key] = result.astype(np.int8)
        return self._known[key]

    def _not_above(self, weak: int) -> tuple[BoolArray, BoolArray]:
        """For each rule: whether it may be, and is, no stronger where one fires."""
        _, rests, reached = self.tops
        may = np.full(len(self.base.rules.rules), not self.sides)
        surely = may.copy()
        for side, rest, is_reached in zip(self.sides, rests, reached, strict=True):
            high, may_meet = rest[weak], is_reached[weak]
            first = 0 if side.has_start else 1
            # Equality with a supremum counts only where both are reached.
            is_sharp, meets_it = self._is_sharp(side.least), side.least == high
            is_flat = (side.least == side.most) & may_meet
            cells = (side.rank <= side.rank[weak]) & ~side.is_zero[weak]
            below = cells & (side.least < high)
            may |= (below | (cells & meets_it & (is_flat | ~is_sharp))).any(axis=1)
            surely |= (below | (cells & meets_it & is_flat & is_sharp)).any(axis=1)
            is_sharp, meets_it = self._is_sharp(side.at), side.at == high
            zones = (side.at <= side.at[weak]) & ~side.is_zero_at[weak]
            fits = (side.at < high) | (meets_it & (may_meet | ~is_sharp))
            may |= (zones & fits)[:, first:].any(axis=1)
            zones &= (side.at < side.at[weak]) | is_sharp
            fits = (side.at < high) | (meets_it & may_meet & is_sharp)
            surely |= (zones & fits & (side.at[weak] > 0))[:, first:].any(axis=1)
        return may, surely

    def _is_sharp(self, bands: IntArray) -> BoolArray:
        """Return whether bands are one level each; what is far is."""
        sharp = np.append(self.base.bands.is_sharp, np.True_)
        return sharp[np.minimum(bands, len(sharp) - 1)]


def _axis_degrees(grid: AxisGrid, *, has_start: bool) -> _AxisDegrees:
    cells, of = grid.cells, grid.of
    every = np.arange(of.shape[1])
    rank = cells.rank[every, of]
    least, most = grid.least[of, every], grid.most[of, every]
    element = np.column_stack([grid.of_start, of])  # seen from the left
    zones = np.arange(element.shape[1])
    at = grid.at[element, zones]
    first = 0 if has_start else 1
    top = np.maximum(
        most.max(axis=1, initial=-1), at[:, first:].max(axis=1, initial=-1)
    )
    is_flat = (least == most) & (most == top[:, np.newaxis])
    is_reached = is_flat.any(axis=1)
    is_reached |= (at[:, first:] == top[:, np.newaxis]).any(axis=1)
    return _AxisDegrees(
        rank,
        least,
        most,
        at,
        grid.is_zero[of, every],
        grid.is_zero_at[element, zones],
        cells.start_rank[grid.of_start],
        has_start,
        top,
        is_reached,
    )

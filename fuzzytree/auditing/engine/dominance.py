"""Two rules: is one never weaker, and how high is the level that both reach?

Every axis is free, so the question falls apart into questions about single axes.

- **Min.** Rule q is somewhere weaker than r iff on some axis f there is a value x with
  `q_f(x) < r_f(x)` and `q_f(x) < H`, where H is the supremum of r's degrees on the
  other axes together, the least of their suprema: for then r can be brought above
  `q_f(x)`, and q cannot.
- **Product.** Where r fires, `r / q` is a product of ratios of single axes. Its
  supremum is the product of theirs, and q is nowhere weaker iff that is at most 1.

Where axes share inputs, not all of these values occur together. What is proved stays
true then; what is not proved may still hold.

The highest level that both reach at one point is, under the minimum, the least over the
axes of the supremum of both rules' smaller degree there: exact, and its point is put
together axis by axis. Under the product the two rules may pull every axis two ways.
What they cannot reach is known, for no strength exceeds the product of the suprema, and
the smaller of two is at most the root of their product; what they do reach is tried.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid, strengths_at
from fuzzytree.auditing.engine.bounding import highest_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.duels import Part, at_most, choices
from fuzzytree.auditing.engine.factors import (
    Factored,
    is_single,
    largest_ratio,
    least_ratios,
    meets,
)
from fuzzytree.auditing.engine.measures import Bounds
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    coupled,
    is_within,
    point_with,
    region_around,
    stretch,
    widest,
)
from fuzzytree.model import BoolArray, FloatArray, IntArray, checkpoint
from fuzzytree.numerics import outwards

if TYPE_CHECKING:
    import numpy.typing as npt

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
    def _weaker(self) -> Callable[[int], ByteArray]:
        return functools.cache(self._weaker_than)

    def _weaker_than(self, weak: int) -> ByteArray:
        """For each rule: 1 if it is somewhere weaker than one, 2 if unknown, else 0."""
        checkpoint()
        result = np.zeros(len(self.base.rules.rules), dtype=np.int64)
        for side, rest in zip(self.sides, self.tops[1], strict=True):
            below = side.rank < side.rank[weak]
            least = np.where(below, side.least, FAR).min(axis=1, initial=FAR)
            if side.has_start:
                start = side.start_rank < side.start_rank[weak]
                least = np.minimum(least, np.where(start, side.at[:, 0], FAR))
            near = (least == rest[weak]) & ~self._is_sharp(least) & (result == 0)
            result = np.where(least < rest[weak], 1, np.where(near, 2, result))
        return result.astype(np.int8)

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


# --- the highest level that two rules reach at one point


_MOST_CHOICES = 1000  # of parts of axes that share inputs
_HALVINGS = 12  # of what a level may be raised by
_WEIGHTS = (0.5, 0.25, 0.75, 0.375, 0.625, 0.0, 1.0)
_CLOSE = Fraction(1, 1000)  # how well a level is known under the product
_CLOSER = 1e-9  # the same, where the wanted level is that near
_NEARLY = Fraction(1, 2**30)  # of a level, by which a point may fall short of it


class JointMaximum(NamedTuple):
    """Where two rules meet."""

    level: Bounds  # the highest level that both reach
    # A witness, or a bracket of the level; `Proved` where no fractions are a point at
    # which both reach the wanted level
    state: State
    is_touch: bool = False  # whether both reach that level at irrational values alone


def joint_bounds(compared: RulePairs, one: int) -> FloatArray:
    """Return bounds from above of the levels that a rule reaches with each other one.

    Returns:
        Shape (rules,). Under the minimum they are the levels themselves, but for
        rounding upwards.
    """
    if compared.is_product:
        return _product_bounds(compared, one - 1)
    high = compared.base.bands.high
    levels = np.array([math.nextafter(float(level), 2.0) for level in high] + [1.0])
    return levels[np.minimum(_bands(compared, one - 1), len(high))]


def _bands(compared: RulePairs, one: int) -> IntArray:
    """Return the bands of the highest levels that a rule reaches with each other."""
    checkpoint()
    result = np.full(len(compared.base.rules.rules), FAR)
    for side in compared.sides:
        lower = side.rank <= side.rank[one]
        most = np.where(lower, side.most, side.most[one]).max(axis=1, initial=-1)
        if side.has_start:
            start = np.minimum(side.at[:, 0], side.at[one, 0])
            most = np.maximum(most, start)
        result = np.minimum(result, most)
    return result


def _product_bounds(compared: RulePairs, one: int) -> FloatArray:
    alone = np.ones(len(compared.base.rules.rules))
    both = alone
    for high in compared.factored.tops:
        alone = alone * high.max(axis=1)
        both = both * (high * high[one]).max(axis=1)
    bound = np.minimum(np.minimum(alone, alone[one]), np.sqrt(both))
    return np.asarray(np.minimum(bound * (1.0 + 2.0**-40), 1.0))


def joint_maximum(
    compared: RulePairs,
    one: int,
    other: int,
    level: Fraction,
    clock: Clock | None = None,
) -> JointMaximum:
    """Return the highest level that two rules reach at one point.

    `level`: A witness must reach at least this.
    """
    if compared.is_product:
        result = _by_weights(compared, one, other, level)
        if clock is not None and result.level.high - result.level.low >= _CLOSE:
            result = _by_boxes(compared, (one, other), level, result, clock)
        if isinstance(result.state, Witness) or result.level.high < level:
            return result
        # No product exceeds the least of its factors.
        return _never(compared.fine.base, (one, other), result.level, level) or result
    band = int(_bands(compared, one - 1)[other - 1])
    bands = compared.base.bands
    if band >= len(bands.low):
        bounds = Bounds(ONE, ONE)
    else:
        bounds = Bounds(bands.low[band], bands.high[band])
    name = f"the highest level that rules {one} and {other} both reach"
    if bounds.high < level:
        ends = outwards(bounds.low)[0], outwards(bounds.high)[1]
        return JointMaximum(
            bounds, Bracket(name, *ends, "no point is sought below the level")
        )
    below = bands.high[band - 1] if 0 < band < len(bands.low) else ZERO
    near = max(bounds.low - (bounds.low - below) * _NEARLY, ZERO)
    base, rules = compared.base, (one, other)
    joined = {axis for group in coupled(base) for axis in group}
    goals = (goal for goal in (bounds.low, near, level) if goal >= level)
    for goal in dict.fromkeys(goals):
        witness = _witness(base, rules, goal, level, joined)
        if witness is not None and joined:
            return _raised(base, rules, witness, bounds, level, joined)
        if witness is not None:
            low = max(bounds.low, _reached(witness))
            return JointMaximum(Bounds(low, bounds.high), witness)
    if not joined and not base.is_fine:
        return joint_maximum(compared.fine, one, other, level, clock)
    known = base if base.is_fine else base.fine
    never = _never(known, rules, bounds, level)
    if never is not None:
        return never
    if joined and _is_never(base, rules, level, joined):
        # They may come as near to it as one likes.
        how = f"{float(level)!r} is reached by no values that inputs have together"
        return JointMaximum(Bounds(ZERO, min(bounds.high, level)), Proved(how))
    why = "where they meet is known nearly, and no point there reaches the level"
    if joined:
        why = "the inputs of their variables depend on each other"
    most = outwards(bounds.high)[1]
    return JointMaximum(Bounds(ZERO, bounds.high), Bracket(name, 0.0, most, why))


def _may_be_hidden(base: Arrangement, rules: tuple[int, int], level: Fraction) -> bool:
    """Return whether places too near to tell may hold values that reach a level."""
    bands = base.bands
    return any(
        bands.high[min(int(grid.at[grid.of[rule - 1, place], zone]) for rule in rules)]
        >= level
        for grid in base.grids
        for zone in np.flatnonzero(grid.cells.is_vague).tolist()
        for place in (max(zone - 1, 0), min(zone, grid.of.shape[1] - 1))
    )


def _never(
    base: Arrangement, rules: tuple[int, int], bounds: Bounds, level: Fraction
) -> JointMaximum | None:
    """Return that no fractions are a point at which rules reach a level, if so.

    On some axis both reach it at irrational places alone, or come near it only.
    """
    of = [rule - 1 for rule in rules]
    short = [grid for grid in base.grids if not any(_parts(grid, of, level))]
    if not short or _may_be_hidden(base, rules, level):
        return None
    is_touch = all(_touches(base, grid, of, level) for grid in short)
    text = "is reached at irrational values alone" if is_touch else "is not reached"
    names = " and ".join(repr(grid.axis.variable.name) for grid in short)
    how = f"{float(level)!r} {text}, by the values of {names}"
    return JointMaximum(bounds, Proved(how), is_touch)


def _touches(
    base: Arrangement, grid: AxisGrid, rules: Sequence[int], level: Fraction
) -> bool:
    """Return whether rules reach a level at an irrational place of an axis."""
    lows = base.bands.low
    return any(
        low < high
        and all(lows[grid.at[grid.of[rule, zone - 1], zone]] >= level for rule in rules)
        for zone, (low, high) in enumerate(grid.cells.zones)
    )


def _raised(
    base: Arrangement,
    rules: tuple[int, int],
    witness: Witness,
    bounds: Bounds,
    level: Fraction,
    joined: Collection[int],
) -> JointMaximum:
    """Return a meeting at a higher level, where axes share inputs, if one is found."""
    low, high = _reached(witness), bounds.high
    for _ in range(_HALVINGS):
        if high - low < _NEARLY:
            break
        goal = (low + high) / 2
        result = _witness(base, rules, goal, level, joined)
        if result is None or _reached(result) <= low:
            high = goal
        else:
            witness, low = result, _reached(result)
    return JointMaximum(Bounds(low, bounds.high), witness)


def _reached(witness: Witness) -> Fraction:
    """Return the smaller of both strengths at a witness, which it claims last."""
    return Fraction(witness.claims[-1].level or 0)


def _witness(
    base: Arrangement,
    rules: tuple[int, int],
    goal: Fraction,
    level: Fraction,
    joined: Collection[int],
) -> Witness | None:
    """Return a point at which both rules reach a level, if one is found."""
    fixed: dict[int, AxisStretch] = {}
    parts: dict[int, list[Part]] = {}
    for axis, grid in enumerate(base.grids):
        of = [rule - 1 for rule in rules]
        if axis in joined:
            parts[axis] = [(part, 0) for part in _parts(grid, of, goal, is_run=True)]
        elif any(grid.axis.propositions[rule] for rule in of):
            first = next(_parts(grid, of, goal), None)
            if first is None:
                return None
            fixed[axis] = first
    try:
        for wanted, _ in choices(base, parts, 0, 0, fixed, at_most(_MOST_CHOICES)):
            point = point_with(base, wanted)
            if point is not None and is_within(base, point):
                return _checked(base, rules, point, level)
    except OutOfTimeError:
        pass
    return None


def _is_never(
    base: Arrangement, rules: tuple[int, int], level: Fraction, joined: Collection[int]
) -> bool:
    """Return whether no inputs give axes that share them values that reach a level."""
    parts: dict[int, list[Part]] = {}
    for axis in sorted(joined):
        grid = base.grids[axis]
        items: list[AxisStretch] = []
        for cell in range(START, grid.of.shape[1]):
            of = grid.of_start if cell == START else grid.of[:, cell]
            elements = {int(of[rule - 1]) for rule in rules}
            part = widest(grid, cell, (level, level), elements, ())
            if part is not None and items and part.low <= items[-1].high:
                part = AxisStretch(items.pop().low, part.high, is_open=False)
            if part is not None:
                items.append(part)
        parts[axis] = [(part, 0) for part in items]
    try:
        return not any(choices(base, parts, 0, 0, {}, at_most(_MOST_CHOICES)))
    except OutOfTimeError:
        return False


def _parts(
    grid: AxisGrid, rules: Sequence[int], goal: Fraction, *, is_run: bool = False
) -> Iterator[AxisStretch]:
    """Yield where both rules reach a level on an axis: stretches, widest first.

    Those of neighbouring cells are one, if they shall be, where no cell is hidden
    between: curves are continuous from below.
    """
    result: list[AxisStretch] = []
    between, is_vague = grid.cells.between, grid.cells.is_vague
    tops = np.maximum(grid.cells.right[1][:, :-1], grid.cells.left[1][:, 1:])
    every = np.arange(grid.of.shape[1])
    reach = np.minimum(*(tops[grid.of[rule], every] for rule in rules))
    for cell in np.flatnonzero(reach >= outwards(goal)[0]).tolist():
        elements = {int(grid.of[rule, cell]) for rule in rules}
        part = stretch(grid, cell, goal, elements, ())
        if part is None:
            continue
        is_next = bool(result) and result[-1].high == between[cell - 1][1]
        if is_run and is_next and part.low == between[cell][0] and not is_vague[cell]:
            part = AxisStretch(result.pop().low, part.high)
        result.append(part)
    result.sort(key=lambda part: part.low - part.high)
    yield from result
    zones = grid.cells.zones
    for number, (low, high) in enumerate(zones):
        of = grid.of[:, number - 1] if number else grid.of_start
        curves = [grid.axis.elements[int(of[rule])] for rule in rules]
        if low == high and all(one.degree(low) >= goal for one in curves):
            yield AxisStretch(low, high, is_open=False)


def _checked(
    base: Arrangement,
    rules: tuple[int, int],
    point: Mapping[str, Fraction],
    level: Fraction,
) -> Witness | None:
    strengths = strengths_at(base, point)
    reached = min(strengths[rule - 1] for rule in rules)
    if reached < level:
        return None
    region: tuple[Span, ...] = ()
    if base.rules.semantics.conjunction == "minimum":
        region = region_around(base, point, rules, (), between=(level, level))
    weakest = min(rules, key=lambda rule: strengths[rule - 1])
    claims = (
        Claim("reaches", rules=rules, level=str(level)),  # on all of the region
        Claim("strength", rules=(weakest,), level=str(reached)),
    )
    return Witness(coordinates(point), claims, region)


def _by_weights(
    compared: RulePairs, one: int, other: int, level: Fraction
) -> JointMaximum:
    """Return where two rules meet under the product, as a witness or a bracket.

    For a weight w in [0, 1] no point's smaller strength exceeds the product over the
    axes of the suprema of `q**w r**(1 - w)`. Where these are found, on places between
    cells, both strengths are evaluated.
    """
    base, rules = compared.base, (one, other)
    most = Fraction(float(joint_bounds(compared, one)[other - 1]))
    best: Witness | None = None
    for weight in _WEIGHTS:
        wanted = _weighed(compared, rules, weight)
        point = point_with(base, wanted)
        if point is None or not is_within(base, point):
            continue
        result = _checked(base, rules, point, level)
        if best is None or (result is not None and _reached(result) > _reached(best)):
            best = result
    name = f"the highest level that rules {one} and {other} both reach"
    if best is None:
        why = "the product is known on each axis only, not on all together"
        return JointMaximum(Bounds(ZERO, most), Bracket(name, 0.0, float(most), why))
    return JointMaximum(Bounds(_reached(best), most), best)


def _by_boxes(
    compared: RulePairs,
    rules: tuple[int, int],
    level: Fraction,
    known: JointMaximum,
    clock: Clock,
) -> JointMaximum:
    """Return what is known of a meeting, made narrower by branch and bound."""
    base = compared.base
    for tolerance in (float(_CLOSE), _CLOSER):
        tighter = highest_by_boxes(
            base.rules, base.domain, *rules, clock, tolerance=tolerance
        )
        if not tighter.low < level <= tighter.high:
            break  # it is known whether they reach the level
    low, high = known.level
    high = max(low, min(high, Fraction(tighter.high)))
    point = point_of(tighter.point)
    witness = _checked(base, rules, point, level) if point else None
    if witness is not None and _reached(witness) > low:
        low = _reached(witness)
        return JointMaximum(Bounds(low, max(low, high)), witness)
    if isinstance(known.state, Witness):
        return JointMaximum(Bounds(low, high), known.state)
    return JointMaximum(Bounds(Fraction(tighter.low), high), tighter)


def _weighed(
    compared: RulePairs, rules: tuple[int, int], weight: float
) -> dict[int, AxisStretch]:
    """Return the place on each axis where a weighted product of two is largest."""
    factored = compared.factored
    result: dict[int, AxisStretch] = {}
    for axis, (low, _) in enumerate(factored.at_zones):
        zones = factored.grids[axis].cells.zones
        one, other = (low[rule - 1] for rule in rules)
        worth = one**weight * other ** (1.0 - weight)
        if not factored.has_start(axis) and len(zones) > 1:
            worth[0] = -1.0
        place = int(worth.argmax())
        at = zones[place][0]
        result[axis] = AxisStretch(at, at, is_open=False)
    return result

"""The highest level that two rules reach at one point of a box.

Under the minimum, on free axes, it is the least over the axes of the supremum of both
rules' smaller degree there: exact, and its point is put together axis by axis. Under
the product the two rules may pull every axis two ways. What they cannot reach is known,
for no strength exceeds the product of the suprema, and the smaller of two is at most
the root of their product; what they do reach is tried.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid, strengths_at
from fuzzytree.auditing.engine.bounding import highest_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.dominance import FAR, RulePairs
from fuzzytree.auditing.engine.measures import Bounds
from fuzzytree.auditing.engine.options import Part, at_most, choices
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
from fuzzytree.model import checkpoint
from fuzzytree.numerics import outwards

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray


_MOST_CHOICES = 1000  # of parts of axes that share inputs
_HALVINGS = 12  # of what a level may be raised by
_WEIGHTS = (0.5, 0.25, 0.75, 0.375, 0.625, 0.0, 1.0)
_CLOSE = Fraction(1, 1000)  # how well a level is known under the product
_CLOSER = 1e-9  # the same, where the wanted level is that near
_NEARLY = Fraction(1, 2**30)  # of a level, by which a point may fall short of it


class JointMaximum(NamedTuple):
    """Where two rules meet.

    Attributes:
        level: The highest level that both reach.
        state: A witness, or a bracket of the level; `Proved` where no fractions are a
            point at which both reach the wanted level.
        is_touch: Whether both reach that level at irrational values alone.
    """

    level: Bounds
    state: State
    is_touch: bool = False


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
        elif any(grid.axis.clauses[rule] for rule in of):
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
    if base.rules.semantics.conjunction == "min":
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

"""Is a rule stronger than some rivals at any input, and by how much at most?

At each level between two critical ones the options of the axes are sets of rivals left
below (`fuzzytree.auditing.engine.options`); a choice on every axis must leave all of
them below. A strict lead spans an open interval of levels, so it shows at a level
between two bands, or it lies within one band, where the bounds of critical levels leave
their order open. There every option that may be open counts as open: if even these do
not suffice, nothing is missed; otherwise the search runs again with critical levels as
fractions.

Axes that share inputs are first treated as free. If that finds nothing, there is
nothing; otherwise linear inequalities in fractions look for values of the inputs.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterator
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    TooManyCellsError,
    lead_at,
    strengths_at,
)
from fuzzytree.auditing.engine.axes import between
from fuzzytree.auditing.engine.bounding import (
    largest_lead_by_boxes,
    plainer,
    wins_by_boxes,
)
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point
from fuzzytree.auditing.engine.options import (
    Duel,
    Levels,
    cover,
    parts_of,
    selections,
    weakest,
    witness_between,
)
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    counted,
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
)
from fuzzytree.numerics import outwards

_MOST_CHOICES = 2_000  # of values for axes that share inputs, in one question
_DEEPEST = 4  # halvings of levels for axes that share inputs


class LevelQuestion(NamedTuple):
    """Is there a point at which some level separates rules from rivals?

    Attributes:
        ours: The numbers of the rules that must reach the level; without any, nothing
            need reach it.
        rivals: The numbers of the rules that must stay below it.
        ceiling: The level is at most this; None if any will do.
        of: What a bracket is about.
    """

    ours: tuple[int, ...]
    rivals: tuple[int, ...]
    ceiling: Fraction | None
    of: str


def search_level(base: Arrangement, question: LevelQuestion, clock: Clock) -> State:
    """Return whether there is such a point: `Proved` if there is none."""
    return _Search(base, question, clock).state()


class _Search:
    """One question, with what was visited for it."""

    def __init__(
        self, base: Arrangement, question: LevelQuestion, clock: Clock
    ) -> None:
        self.base, self.question, self.clock = base, question, clock
        self.groups = coupled(base)
        self.levels = self.choices = 0
        self.is_open = False

    def state(self) -> State:
        if not self.base.axes:
            point = point_with(self.base, {})
            result = None if point is None else self._checked(self.base, point)
            return result or Proved("no rule has a clause")
        try:
            result = self._sought() if self.groups else None
            if result is not None:
                return result
            result = self._at_levels(self.base)
            if result is None and self._may_hide_in_bands(self.base):
                result = self._at_levels(self.base.fine)
                if result is None and self._may_hide_in_bands(self.base.fine):
                    return self._bracket(
                        self._widest_band(), "two critical levels are too near to tell"
                    )
        except OutOfTimeError:
            return self._bracket(1.0, "the budget was spent")
        except TooManyCellsError as error:
            return self._bracket(1.0, str(error))
        if result is not None:
            return result
        if self.is_open:
            return self._bracket(
                1.0, "the inputs of its variables depend on each other"
            )
        return Proved(self._how())

    def _sought(self) -> Witness | None:
        """Return a witness that floats led to, if there is one."""
        ours, rivals, _, _ = self.question
        point = leader(self.base, ours, rivals)
        result = self._checked(self.base, point)
        if result is None:
            return None
        plain = plainer(self.base, point, ours, rivals)
        return self._checked(self.base, plain) or result

    def _duel(self, base: Arrangement) -> Duel:
        ours, rivals, _, _ = self.question
        return Duel(base, tuple(n - 1 for n in ours), tuple(n - 1 for n in rivals))

    def _levels(self, duel: Duel) -> Iterator[tuple[int, Fraction]]:
        """Yield bands from which up to another level nothing changes, and that level.

        With a ceiling, what is left below only grows with the level: the highest do.
        """
        bands, ceiling = duel.bands, self.question.ceiling
        events = duel.all_events if self.groups else duel.events
        if ceiling is not None:
            below = [n for n, high in enumerate(bands.high) if high < ceiling]
            if below:
                yield below[-1], min(ceiling, bands.low_after(below[-1]))
            return
        lows, highs = duel.base.near_levels
        result: list[tuple[float, int, int]] = []
        above = len(lows) - 1
        for band in events:
            if band + 1 < len(lows):
                result.append((highs[band] - lows[above], -band, above))
                above = band
        # Between levels far apart the lead is large, and so is the box around it.
        for _, band, above in sorted(result):
            yield -band, bands.low[above]

    def _doubtful(self, duel: Duel) -> Iterator[int]:
        """Yield bands within which the order of levels is not known and matters."""
        bands, ceiling = duel.bands, self.question.ceiling
        if ceiling is not None:
            yield from (
                n
                for n, (low, high) in enumerate(zip(bands.low, bands.high, strict=True))
                if low < ceiling <= high
            )
            return
        for band in duel.events:
            if not bands.is_sharp[band] and bands.high[band]:
                yield band

    def _how(self) -> str:
        duel = self._duel(self.base)
        cells = sum(len(options.where) for options in duel.all_options)
        axes = len(self.base.axes)
        levels, parts = counted(self.levels, "level"), counted(cells, "cell")
        text = f"{levels} with {parts} on {counted(axes, 'axis', 'axes')} visited"
        if not self.choices:
            return text
        return f"{text}, {counted(self.choices, 'choice')} of inputs"

    def _bracket(self, high: float, why: str) -> Bracket:
        return Bracket(self.question.of, 0.0, high, f"{why}: {self._how()}")

    def _widest_band(self) -> float:
        bands = self.base.fine.bands
        widest = max(b - a for a, b in zip(bands.low, bands.high, strict=True))
        return outwards(widest)[1]

    def _at_levels(self, base: Arrangement) -> Witness | None:
        duel = self._duel(base)
        known: dict[tuple[tuple[int, ...], ...], tuple[int, ...] | None] = {}
        for band, above in self._levels(duel):
            self.levels += 1
            families = tuple(options.at_gap(band) for options in duel.options)
            if families not in known:
                known[families] = cover(families, duel.full, self.clock)
            chosen = known[families]
            if chosen is None:
                continue
            result, is_open = witness_between(
                base,
                (duel.bands.high[band], above),
                partial(self._select, duel, band),
                partial(self._checked, base),
                _DEEPEST if self.groups else None,
            )
            self.is_open |= is_open
            if result is not None:
                return result
        return None

    def _may_hide_in_bands(self, base: Arrangement) -> bool:
        """Return whether a lead may be within a band."""
        duel = self._duel(base)
        known: dict[tuple[tuple[int, ...], ...], bool] = {}
        for band in self._doubtful(duel):
            self.levels += 1
            families = tuple(options.at_band(band) for options in duel.options)
            if families not in known:
                known[families] = cover(families, duel.full, self.clock) is not None
            if known[families]:
                return True
        return False

    # --- witnesses

    def _select(
        self, duel: Duel, band: int, levels: Levels, is_outer: bool
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield values of the axes that leave all rivals below at some levels."""
        if not is_outer:
            level = between(*levels)
            levels = level, level
        joined = sorted({axis for group in self.groups for axis in group})
        parts = {
            axis: [
                *parts_of(
                    duel, duel.all_options[axis], axis, band, levels, is_outer=is_outer
                )
            ]
            for axis in joined
        }
        families = {
            axis: options.at_gap(band)
            for axis, options in enumerate(duel.options)
            if axis not in parts
        }
        return selections(
            duel.base,
            parts,
            families,
            duel.full,
            self._tell,
            self.clock,
            None if is_outer else partial(self._part, duel, band, levels[0]),
        )

    def _tell(self) -> None:
        """Count a choice of inputs, and end the search where they are too many."""
        self.clock.check()
        self.choices += 1
        if self.choices > _MOST_CHOICES:
            raise OutOfTimeError

    def _part(
        self, duel: Duel, band: int, level: Fraction, axis: int, mask: int
    ) -> AxisStretch | None:
        """Return values of an axis that leave some rivals below a level."""
        options, grid = duel.options[axis], duel.base.grids[axis]
        bits = [n for n in range(len(duel.rivals)) if mask >> n & 1]
        fits = (options.top > band) & (options.where >= START)
        fits &= (options.floor[:, bits] <= band).all(axis=1)
        # Of the options that fit, the one where the rule is strongest.
        order = sorted(fits.nonzero()[0], key=lambda n: -int(options.top[n]))
        for number in order[:4]:
            cell = int(options.where[number])
            rivals = [duel.rivals[n] for n in bits]
            part = stretch(
                grid,
                cell,
                level,
                [weakest(grid, duel.ours, cell)],
                {weakest(grid, [rival], cell) for rival in rivals},
            )
            if part is not None:
                return part
        return None

    def _checked(self, base: Arrangement, point: Point) -> Witness | None:
        """Return a point as a witness, if it is one in fractions."""
        ours, rivals, ceiling, _ = self.question
        strengths = strengths_at(base, point)
        mine = min((strengths[n - 1] for n in ours), default=ceiling or Fraction(1))
        best = max((strengths[n - 1] for n in rivals), default=Fraction(0))
        if not (mine > best and is_within(base, point)):
            return None
        claims: tuple[Claim, ...]
        if ceiling is not None:
            claims = (Claim("below", rules=rivals, level=str(ceiling)),)
        else:
            claims = (
                Claim("beats", rules=ours, rivals=rivals),
                *(
                    Claim("strength", rules=(n,), level=str(strengths[n - 1]))
                    for n in ours
                ),
            )
        region = region_around(base, point, ours, rivals, between=(best, mine))
        return Witness(coordinates(point), claims, region)


# --- does a rule win

_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end


def wins(
    base: Arrangement, rule: int, rivals: Collection[int], clock: Clock | None = None
) -> State:
    """Return whether a rule is somewhere stronger than each of some others.

    Returns:
        `Proved`: it never is. `Witness`: it is, at a point that was evaluated in
        fractions. `Bracket`: the largest lead, where time or inputs that depend on each
        other leave it open.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    if base.is_empty:
        return Proved("the domain has no point")
    by_boxes = partial(
        wins_by_boxes, base.rules, base.domain, rule, others, tolerance=_TOLERANCE
    )
    if base.rules.semantics.conjunction == "product" or not base.is_kept:
        return by_boxes(clock)
    question = LevelQuestion((rule,), others, None, f"the largest lead of rule {rule}")
    # Half of the time for cells, the rest for boxes: they see that clauses cancel, and
    # know inputs that depend on each other.
    result = search_level(base, question, clock.share(0.5))
    if not isinstance(result, Bracket):
        return result
    other = by_boxes(clock.share(0.9))
    if not isinstance(other, Bracket):
        return other
    return min(result, other, key=lambda one: one.high)


# --- by how much a rule leads

_STEPS = 10  # halvings of the upper end


def largest_lead(
    base: Arrangement,
    rule: int,
    rivals: Collection[int],
    won: Witness,
    enough: Fraction,
    clock: Clock | None = None,
) -> Bracket:
    """Return bounds of a rule's largest lead over the strongest of some others.

    Under the minimum a lead of d somewhere means that a choice of cells has the rule
    reach a level d above one below which every rival has values. The places within the
    cells are not determined, so this bounds the lead from above. From below it is the
    best point that floats led to, evaluated in fractions.

    `won`: A point at which the rule wins; `enough`: once a lead of this much is found,
    the upper end is not worked out.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    best = point_of(won.point)
    low = lead_at(base, best, (rule,), others)
    if low < enough:
        result = leader(base, (rule,), others)
        if is_within(base, result) and lead_at(base, result, (rule,), others) > low:
            best = plainer(base, result, (rule,), others)
            low = lead_at(base, best, (rule,), others)
    name = f"the largest lead of rule {rule}"
    claims = (
        Claim("beats", rules=(rule,), rivals=others),
        *_strengths(base, best, (rule, *others)),
    )
    high, why = Fraction(1), "a lead that large is enough"
    if low < enough:
        if base.rules.semantics.conjunction == "product" or not base.is_kept:
            wide = largest_lead_by_boxes(base.rules, base.domain, rule, others, clock)
            high, why = Fraction(wide.high), wide.why
        else:
            high, why = _bound(base, rule, others, low, clock)
    return Bracket(
        name, outwards(low)[0], outwards(high)[1], why, coordinates(best), claims
    )


def _strengths(
    base: Arrangement, point: Point, rules: Collection[int]
) -> tuple[Claim, ...]:
    """Return claims of the strengths of a rule and of the strongest of others."""
    strengths = strengths_at(base, point)
    first, *others = rules
    strongest = [first]
    if others:
        strongest.append(max(others, key=lambda number: strengths[number - 1]))
    return tuple(
        Claim("strength", rules=(number,), level=str(strengths[number - 1]))
        for number in strongest
    )


def _bound(
    base: Arrangement, rule: int, rivals: tuple[int, ...], low: Fraction, clock: Clock
) -> tuple[Fraction, str]:
    """Return what the lead does not exceed, and how that is known."""
    duel = Duel(base, (rule - 1,), tuple(number - 1 for number in rivals))
    high = Fraction(1)
    try:
        for step in range(_STEPS):
            # The true lead tends to be small: begin near the lower end.
            middle = low + (high - low) / (64 if step == 0 else 2)
            if middle <= low:
                break
            if _may_reach(duel, middle, clock):
                low = middle
            else:
                high = middle
    except OutOfTimeError:
        return high, "the budget was spent"
    return high, "the places within the cells are not determined"


def _may_reach(duel: Duel, lead: Fraction, clock: Clock) -> bool:
    """Return whether a lead cannot be excluded."""
    bands = duel.bands
    for band in duel.events:
        top = bisect_left(bands.high, bands.low[band] + lead)
        families = [options.masks(options.top >= top, band) for options in duel.options]
        if cover(families, duel.full, clock) is not None:
            return True
    return False

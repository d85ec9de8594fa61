"""A rule base on a box, as an arrangement of cells on its axes.

Every axis is cut into cells (`fuzzytree.auditing.engine.axes`). The values of the
elements at the ends of cells are the *critical levels*; as intervals, they are joined
into *bands* where they touch. Under the minimum, nothing changes between two bands, and
within a cell an element counts by the bands of its least and largest value.
"""

from __future__ import annotations

import functools
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.engine.axes import (
    AlgebraicLevel,
    Cells,
    cut,
    level_at,
    separate_levels,
)
from fuzzytree.auditing.engine.domain import Domain, span, variable_value
from fuzzytree.auditing.engine.linear import ZERO
from fuzzytree.auditing.engine.pieces import ALWAYS, ChangePoint, RuleCurve, places
from fuzzytree.auditing.engine.states import Claim, Witness, coordinates
from fuzzytree.model import (
    BoolArray,
    IntArray,
    Proposition,
    Rule,
    RuleBase,
    Variable,
    checkpoint,
    shapes_of,
)
from fuzzytree.numerics import exact_degree

if TYPE_CHECKING:
    import numpy.typing as npt


MOST_NUMBERS: Final = 1 << 24
"""The most values of curves and rules in cells that are kept, as doubles."""

MOST_FRACTIONS: Final = 1 << 21
"""The same as fractions."""


class TooManyCellsError(MemoryError):
    """Curves cross so often that their cells are too many to be kept."""


class RuleAxis(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What the rules ask of one variable."""

    variable: Variable
    # the distinct curves; the first is 1 everywhere: no proposition
    elements: tuple[RuleCurve, ...]
    # for each rule its propositions here, each as the elements of which it takes the
    # largest; the rule takes the least of its propositions
    propositions: tuple[tuple[tuple[int, ...], ...], ...]

    @functools.cached_property
    def places(self) -> tuple[ChangePoint, ...]:
        """All places where something changes; only some of them if too many."""
        return _places(self.elements, MOST_NUMBERS // self.width)

    @property
    def width(self) -> int:
        """How many values are kept for each cell."""
        return len(self.elements) + len(self.propositions)


class AxisGrid(NamedTuple):
    """An axis on the box."""

    axis: RuleAxis
    cells: Cells
    # shape (rules, cells): the element that is a rule's degree in each cell
    of: IntArray
    of_start: IntArray  # shape (rules,): the same at the lower end itself
    least: IntArray  # shape (elements, cells): the band of the least value
    most: IntArray  # shape (elements, cells): the band of the largest value
    at: IntArray  # shape (elements, zones): the band of the value at each zone
    is_zero: BoolArray  # shape (elements, cells): whether an element is 0 throughout
    is_zero_at: BoolArray  # shape (elements, zones): whether it is 0 there, for sure
    may_be_zero_at: BoolArray  # shape (elements, zones): whether it may be 0 there


class Bands(NamedTuple):
    """The critical levels, joined where they touch, in ascending order."""

    low: list[Fraction]  # the lower ends
    high: list[Fraction]  # the upper ends
    is_sharp: BoolArray  # whether a band is one level that is known exactly

    def low_after(self, band: int) -> Fraction:
        """Return the lower end of the next band, 1 if there is none."""
        return self.low[band + 1] if band + 1 < len(self.low) else Fraction(1)


class Arrangement(msgspec.Struct, frozen=True, eq=False, dict=True):
    """A rule base on a box."""

    rules: RuleBase
    domain: Domain  # the box
    axes: tuple[RuleAxis, ...]  # what the rules ask, variable by variable
    # the two ends of each axis on the box, of combinations too; None where no point of
    # the box is within the sides of a combination
    ends: tuple[tuple[Fraction, Fraction], ...] | None
    is_fine: bool = False  # whether levels are known as fractions, narrow without limit

    @functools.cached_property
    def _grids(self) -> tuple[tuple[AxisGrid, ...], Bands]:
        """The axes on the box, and the critical levels of all of them.

        Raises:
            TooManyCellsError: If they would be too large.
        """
        assert self.ends is not None  # of a box that is not empty
        if not self.is_kept:
            raise TooManyCellsError("its curves cross more often than can be kept")
        for axis, (low, high) in zip(self.axes, self.ends, strict=True):
            name = axis.variable.name
            if name not in self._cut:  # who comes back after a spent budget goes on
                self._cut[name] = cut(
                    axis.elements, axis.places, low, high, is_fine=self.is_fine
                )
        return _grids_of(self.axes, [*self._cut.values()], is_fine=self.is_fine)

    @property
    def grids(self) -> tuple[AxisGrid, ...]:
        """The axes on the box."""
        return self._grids[0]

    @property
    def bands(self) -> Bands:
        """The critical levels of all axes."""
        return self._grids[1]

    @functools.cached_property
    def _cut(self) -> dict[str, Cells]:
        return {}

    @functools.cached_property
    def is_kept(self) -> bool:
        """Whether all values of curves and rules in cells can be kept."""
        most = MOST_FRACTIONS if self.is_fine else MOST_NUMBERS
        size = 0
        for axis in self.axes:
            size += (len(axis.places) + 1) * axis.width
            if size > most:  # the rest is not counted
                return False
        return True

    @functools.cached_property
    def near_levels(self) -> tuple[list[float], list[float]]:
        """The lower and the upper ends of all bands, as floats near them."""
        bands = self.bands
        return [*map(float, bands.low)], [*map(float, bands.high)]

    @functools.cached_property
    def fine(self) -> Arrangement:
        """The same ground with levels known as fractions."""
        return Arrangement(self.rules, self.domain, self.axes, self.ends, is_fine=True)

    def opens(self, variable: str) -> bool:
        """Return whether the lower end of a variable is left out."""
        side = self.domain.side(variable)
        return side is not None and side.is_open

    @property
    def is_empty(self) -> bool:
        """Whether no point of the inputs' box is within all sides."""
        return self.ends is None


@functools.lru_cache(maxsize=4)  # many questions share one arrangement
def arrange(rules: RuleBase, domain: Domain) -> Arrangement:
    """Return a rule base made ready for questions on a box.

    Raises:
        ValueError: If an input has no side.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1))
        >>> box = Domain(tuple(DomainSide(name, -1.0, 1.0) for name in rules.inputs))
        >>> arrange(rules, box).is_empty
        False
    """
    missing = [name for name in rules.inputs if domain.side(name) is None]
    if missing:
        raise ValueError(f"the domain has no side for {missing[0]!r}")
    axes = _axes(rules)
    return Arrangement(rules, domain, axes, _ends(axes, domain))


def restricted(base: Arrangement, domain: Domain) -> Arrangement:
    """Return the same rules on another box; the axes' places are kept."""
    return Arrangement(base.rules, domain, base.axes, _ends(base.axes, domain))


def _ends(
    axes: Sequence[RuleAxis], domain: Domain
) -> tuple[tuple[Fraction, Fraction], ...] | None:
    ends: list[tuple[Fraction, Fraction]] = []
    for axis in axes:
        low, high = span(axis.variable, domain)
        if low > high:
            return None
        ends.append((low, high))
    return tuple(ends)


_places = functools.lru_cache(maxsize=1 << 12)(places)


@functools.lru_cache(maxsize=64)
def _axes(rules: RuleBase) -> tuple[RuleAxis, ...]:
    shapes = shapes_of(rules.variables)
    items: list[RuleAxis] = []
    for variable in rules.variables:
        elements: dict[RuleCurve, int] = {RuleCurve(ALWAYS): 0}
        propositions = tuple(
            _propositions_on(variable.name, rule.when, shapes, elements)
            for rule in rules.rules
        )
        is_last = variable is rules.variables[-1]
        if any(propositions) or (
            is_last and not items
        ):  # rules that ask nothing have one too
            of = tuple(elements)
            items.append(RuleAxis(variable, of, propositions))
    return tuple(items)


def _propositions_on(
    variable: str,
    when: Sequence[Proposition],
    shapes: Mapping[tuple[str, str], object],
    elements: dict[RuleCurve, int],
) -> tuple[tuple[int, ...], ...]:
    """Return what a rule tests of a variable: the least of the largest of elements."""
    checkpoint()
    groups: list[tuple[int, ...]] = []
    for proposition in when:
        if proposition.variable != variable:
            continue
        of = [
            elements.setdefault(
                RuleCurve(shapes[variable, term], proposition.negated),  # type: ignore[arg-type]
                len(elements),
            )
            for term in proposition.terms
        ]
        # 1 - max(a, b) is the least of 1 - a and 1 - b
        groups += [(one,) for one in of] if proposition.negated else [tuple(of)]
    return tuple(groups)


def _grids_of(
    axes: Sequence[RuleAxis], cells: Sequence[Cells], *, is_fine: bool
) -> tuple[tuple[AxisGrid, ...], Bands]:
    if not axes:  # rules that ask nothing, and have a strength of 1
        one = [Fraction(1)]
        return (), Bands(one, one, np.array([True]))
    ends = [side for of in cells for side in (of.left, of.right)]
    # Level 0 is always among them, so that there is a level below any other.
    low = np.concatenate([[0.0], *(side[0].ravel() for side in ends)])
    high = np.concatenate([[0.0], *(side[1].ravel() for side in ends)])
    band, bands = _bands(low, high)
    if is_fine:
        sure = separate_levels(band, low, high, partial(_level, axes, cells))
        band, bands = _bands(low, high, sure)
    items: list[AxisGrid] = []
    start = 1
    for axis, of in zip(axes, cells, strict=True):
        size = of.left[0].size
        left, right = (
            band[at : at + size].reshape(of.left[0].shape)
            for at in (start, start + size)
        )
        start += 2 * size
        ends_of_cells = right[:, :-1], left[:, 1:]
        items.append(
            AxisGrid(
                axis,
                of,
                _chosen(axis, of.rank),
                _chosen(axis, of.start_rank[np.newaxis])[:, 0],
                np.minimum(*ends_of_cells),
                np.maximum(*ends_of_cells),
                left,
                of.is_zero,
                of.is_zero_at,
                of.left[0] == 0,
            )
        )
    return tuple(items), bands


def _bands(
    low: npt.NDArray[np.float64] | npt.NDArray[np.object_],
    high: npt.NDArray[np.float64] | npt.NDArray[np.object_],
    sure: Sequence[int] = (),
) -> tuple[IntArray, Bands]:
    """Return the band of each interval, and the bands.

    Those in `sure` are one number each, and the same one where they are equal.
    """
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    starts = np.concatenate([[True], low[order][1:] > reach[:-1]])
    numbers = np.cumsum(starts) - 1
    band = np.empty(len(low), dtype=np.int64)
    band[order] = numbers
    first = np.flatnonzero(starts)
    last = np.append(first[1:], len(order)) - 1
    lows = [Fraction(one) for one in low[order][first]]
    highs = [Fraction(one) for one in reach[last]]
    sharp = np.array([a == b for a, b in zip(lows, highs, strict=True)])
    sharp[band[list(sure)]] = True
    return band, Bands(lows, highs, sharp)


def _level(
    axes: Sequence[RuleAxis], cells: Sequence[Cells], number: int
) -> AlgebraicLevel | Fraction | None:
    """Return a critical level by its number: 0, then all of each axis and side."""
    number -= 1
    for axis, of in zip(axes, cells, strict=True):
        size = of.left[0].size
        if number < 2 * size:
            row, zone = divmod(number % size, len(of.zones))
            low, high = of.zones[zone]
            if low == high:
                return Fraction((of.right if number >= size else of.left)[0, row, zone])
            if of.is_vague[zone]:
                return None
            result = axis.places or ()  # they were cut there
            place = result[bisect_right(result, low, key=lambda one: one.low) - 1]
            return level_at(axis.elements[row], place, low, high)
        number -= 2 * size
    return Fraction(0)


def _chosen(axis: RuleAxis, rank: IntArray) -> IntArray:
    """Return which element is each rule's degree, given the order in some cells."""
    chosen = np.zeros((len(axis.propositions), len(rank)), dtype=np.int64)
    every = np.arange(len(rank))
    for number, groups in enumerate(axis.propositions):
        checkpoint()
        best: IntArray | None = None
        for group in groups:
            of = np.array(group)
            top = of[rank[:, of].argmax(axis=1)]
            best = (
                top
                if best is None
                else np.where(rank[every, top] < rank[every, best], top, best)
            )
        if best is not None:
            chosen[number] = best
    return chosen


def strengths_at(base: Arrangement, point: Mapping[str, Fraction]) -> list[Fraction]:
    """Return every rule's exact strength at a point of the inputs."""
    return rule_strengths(base.rules, point)


def lead_at(
    base: Arrangement,
    point: Mapping[str, Fraction],
    ours: Collection[int],
    rivals: Collection[int],
) -> Fraction:
    """Return by how much the weakest of some rules leads the strongest of others."""
    strengths = strengths_at(base, point)
    mine = min((strengths[number - 1] for number in ours), default=Fraction(1))
    return mine - max((strengths[n - 1] for n in rivals), default=Fraction(0))


def rule_strengths(
    rules: RuleBase, point: Mapping[str, Fraction], of: Sequence[Rule] | None = None
) -> list[Fraction]:
    """Return every rule's exact strength, or that of some rules, without a domain."""
    checkpoint()
    strength = _strength_at(rules, point)
    return [strength(rule, ZERO) for rule in (rules.rules if of is None else of)]


def strength_above(
    base: Arrangement, point: Mapping[str, Fraction], rule: int, rivals: Iterable[int]
) -> Fraction | None:
    """Return a rule's exact strength if it is above that of each of some others.

    The propositions of a rival are evaluated until it is known to be weaker.
    """
    every, strength = base.rules.rules, _strength_at(base.rules, point)
    mine = strength(every[rule - 1], ZERO)
    is_above = all(strength(every[n - 1], mine) < mine for n in rivals)
    return mine if mine and is_above else None


def _strength_at(
    rules: RuleBase, point: Mapping[str, Fraction]
) -> Callable[[Rule, Fraction], Fraction]:
    """Return what evaluates a rule at a point, until it is below some number."""
    is_product = rules.semantics.conjunction == "product"
    shapes = shapes_of(rules.variables)
    variables = {variable.name: variable for variable in rules.variables}

    @functools.cache
    def value(variable: str) -> Fraction:
        return variable_value(variables[variable], point)

    @functools.cache
    def degree(variable: str, term: str) -> Fraction:
        return exact_degree(shapes[variable, term], value(variable))

    def strength(rule: Rule, enough: Fraction) -> Fraction:
        result = Fraction(1)
        for proposition in rule.when:
            one = max(degree(proposition.variable, term) for term in proposition.terms)
            one = 1 - one if proposition.negated else one
            result = result * one if is_product else min(result, one)
            if result < enough or not result:
                break
        return result

    return strength


# --- predictions at a point


class ExactPrediction(NamedTuple):
    """What a rule base says at a point, exactly."""

    label: str | None  # the class, or None for no class
    rule: int  # the number of the winning rule, 0 if none fires
    is_tie: bool  # whether another rule is as strong
    # how far the strongest class is ahead of the next; not firing counts as a class of
    # strength 0
    margin: Fraction


def prediction_at(rules: RuleBase, point: Mapping[str, Fraction]) -> ExactPrediction:
    """Return what a rule base says at a point that need not be of doubles.

    Example:
        >>> from fuzzytree.model.rulebase import Rule
        >>> prediction_at(RuleBase("a", ("x",), (), (Rule((), "x"),)), {}).label
        'x'
    """
    strengths = rule_strengths(rules, point)
    best = max(strengths)
    if best == 0:
        return ExactPrediction(rules.semantics.uncovered, 0, False, ZERO)
    winner = strengths.index(best)
    label = rules.rules[winner].then
    others = [
        s for s, rule in zip(strengths, rules.rules, strict=True) if rule.then != label
    ]
    margin = best - max(others, default=ZERO)
    return ExactPrediction(label, winner + 1, strengths.count(best) > 1, margin)


def difference_at(
    old: RuleBase, new: RuleBase, point: Mapping[str, Fraction]
) -> Witness | None:
    """Return a point as a witness that two rule bases answer otherwise there, if so."""
    one, other = prediction_at(old, point), prediction_at(new, point)
    if one.label == other.label:
        return None
    return Witness(
        coordinates(point),
        (
            Claim("decides", of="old", label=one.label),
            Claim("decides", of="new", label=other.label),
        ),
    )

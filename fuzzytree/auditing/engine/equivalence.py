"""Do two rule bases predict the same class everywhere on a box?

Branch and bound in fractions. A box is a product of stretches of the axes that either
model uses; combinations count as axes of their own, which only makes more boxes. On a
box the strength of each rule has bounds; the contenders of a model are the rules that
may win there (`fuzzytree.auditing.engine.contenders`). The box is settled

- if both models predict one and the same class on it, or
- if the same rules remain of both in the same order, compared by form and not by name:
  then the same rule wins in both.

If the possible predictions of the two are disjoint, any point of the box is a witness.
All other boxes are halved, best where a curve changes its formula or crosses another.
"""

from __future__ import annotations

import heapq
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.auditing.engine.arrangement import difference_at
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.contenders import (
    AxisKey,
    AxisPart,
    Box,
    Contender,
    PropositionNumber,
    Remainder,
    SharedAxis,
    common_axes,
    contenders_on,
    same_contenders,
)
from fuzzytree.auditing.engine.domain import Domain, span
from fuzzytree.auditing.engine.linear import feasible, holds, row_of
from fuzzytree.auditing.engine.states import Bracket, Proved, Span, State, Witness
from fuzzytree.model import RuleBase, Variable

Point = Mapping[str, Fraction]


class BoxPoints:
    """The inputs of some rule bases on a domain, and where axes take them.

    `keys`: the axes; see `fuzzytree.auditing.engine.contenders`.

    Raises:
        ValueError: If an input has no side.
    """

    def __init__(
        self, models: Sequence[RuleBase], keys: Sequence[AxisKey], domain: Domain
    ) -> None:
        self.inputs = tuple(dict.fromkeys(n for model in models for n in model.inputs))
        self.keys = keys
        self.has_sums = not all(isinstance(key, str) for key in keys)
        sides = {side.variable: side for side in domain.sides}
        missing = [name for name in self.inputs if name not in sides]
        if missing:
            raise ValueError(f"the domain has no side for {missing[0]!r}")
        self._place = {name: number for number, name in enumerate(self.inputs)}
        self._sides = sides
        self._ranges = [sides[name].ends for name in self.inputs]
        self._limits = [
            row_of(v, self._place, one.ends)
            for model in models
            for v in model.variables
            if v.parts and (one := sides.get(v.name)) is not None
        ]

    def some(self, box: Sequence[AxisPart]) -> list[Point]:
        """Return points of a box, where axes are inputs: its middle and its far end."""
        open_box = dict(zip(map(str, self.keys), box, strict=True))
        whole = {
            name: open_box.get(name, AxisPart(low, high))
            for name, (low, high) in zip(self.inputs, self._ranges, strict=True)
        }
        return [
            {name: middle(one) for name, one in whole.items()},
            {name: one.high for name, one in whole.items()},
        ]

    def has_rows(self, box: Sequence[AxisPart]) -> bool:
        """Return whether each input of a box has a value that rows can have."""
        return all(
            part.low
            <= self._sides[key].nearest((part.low + part.high) / 2)
            <= part.high
            for key, part in zip(self.keys, box, strict=True)
            if isinstance(key, str)
        )

    def solved(self, box: Sequence[AxisPart]) -> Point | None:
        """Return a point whose axes lie in a box, None if there is none."""
        rows = [
            row_of(
                Variable(key) if isinstance(key, str) else Variable("", parts=key),
                self._place,
                (one.low, one.high),
                is_open_low=not one.is_closed,
            )
            for key, one in zip(self.keys, box, strict=True)
        ]
        result = feasible(self._ranges, [*rows, *self._limits])
        return None if result is None else dict(zip(self.inputs, result, strict=True))

    def in_doubles(self, point: Point) -> Point | None:
        """Return the doubles nearest to a point, if they are on the domain."""
        near = {
            name: self._sides[name].nearest(Fraction(float(point[name])))
            for name in self.inputs
        }
        values = list(near.values())
        pairs = zip(values, self._ranges, strict=True)
        is_within = all(low <= value <= high for value, (low, high) in pairs)
        is_within = is_within and all(holds(row, values) for row in self._limits)
        return near if is_within else None


def middle(part: AxisPart) -> Fraction:
    """Return the double nearest to the middle, or the middle if no double is inside.

    Example:
        >>> middle(AxisPart(Fraction(0), Fraction(1)))
        Fraction(1, 2)
    """
    exact = (part.low + part.high) / 2
    near = Fraction(float(exact))
    return near if part.low < near < part.high else exact


# --- branch and bound

MOST_BOXES = 4_000
"""Boxes that are looked at, unless the clock ends before."""

TOUCHING = 2.0**-50
"""Where classes are no further apart than this, boxes are not halved any more."""

OF: Final = "the smaller of both margins where the two answer otherwise"
_DEEP = 12  # halvings, before which no box is taken for a touching tie
_HALVINGS = 60  # of what a region may still grow by
_DEEPEST = 60  # halvings of a box in which both answer otherwise, but no double is met


def equivalence(
    old: RuleBase,
    new: RuleBase,
    domain: Domain,
    clock: Clock,
    *,
    most: int = MOST_BOXES,
) -> State:
    """Decide whether two rule bases answer alike on all of a domain.

    Returns:
        `Proved`: they answer alike. `Witness`: they do not, here. `Bracket`: they can
        differ only where the margin of one of them is at most so large.

    Example:
        >>> from fuzzytree.model.rulebase import Rule
        >>> one = RuleBase("one", ("a", "b"), (), (Rule((), "a"),))
        >>> two = RuleBase("two", ("a", "b"), (), (Rule((), "b"),))
        >>> equivalence(one, one, Domain(()), Clock()).how
        'both answer alike in every box: 1 box settled'
        >>> equivalence(one, two, Domain(()), Clock()).claims[1].label
        'b'
    """
    return _Search(old, new, domain).run(clock, most)


class _OpenBox(NamedTuple):
    """A box that is open."""

    margin: float  # at least the largest margin on it
    box: Box
    depth: int  # how often it was halved
    # of each model the places of the rules that may win on it; all if None
    rules: tuple[tuple[int, ...] | None, ...] = (None, None)


class _Cut(NamedTuple):
    """What keeps a box open: the margin on it, and where to halve it, if anywhere."""

    margin: float
    cut: tuple[int, Fraction] | None
    rules: tuple[tuple[int, ...] | None, ...]


class _Queue:
    """The boxes that are open, in two orders."""

    def __init__(self, first: _OpenBox) -> None:
        self._open: dict[int, _OpenBox] = {}  # the oldest comes first
        self._by_margin: list[tuple[float, int]] = []
        self._count = 0
        self.put(first)

    def __len__(self) -> int:
        return len(self._open)

    @property
    def margin(self) -> float:
        """The largest margin of an open box."""
        while self._by_margin[0][1] not in self._open:
            heapq.heappop(self._by_margin)
        return -self._by_margin[0][0]

    @property
    def is_touching(self) -> bool:
        """Whether all open boxes are small, and classes as good as tie on them."""
        oldest = next(iter(self._open.values()))
        return self.margin <= TOUCHING and oldest.depth > _DEEP

    def put(self, box: _OpenBox) -> None:
        """Add a box."""
        self._open[self._count] = box
        heapq.heappush(self._by_margin, (-box.margin, self._count))
        self._count += 1

    def take(self) -> _OpenBox:
        """Remove the oldest box, or the one with the largest margin, by turns."""
        by_age = self._count % 4 or not self.margin
        return self._open.pop(
            next(iter(self._open)) if by_age else self._by_margin[0][1]
        )


class _Search:
    """Two rule bases on common axes, and the boxes that are open."""

    def __init__(self, old: RuleBase, new: RuleBase, domain: Domain) -> None:
        self.models = (old, new)
        propositions = _variables_of(old, new)
        ends = [
            (key, AxisPart(*span(variable, domain), True))
            for key, variable in propositions.items()
        ]
        self.is_empty = any(whole.low > whole.high for _, whole in ends)
        self.axes, self.rules = common_axes((old, new), ends)
        self.places = BoxPoints(self.models, list(propositions), domain)

    def run(self, clock: Clock, most: int) -> State:
        """Settle boxes: by turns the largest, and where the margin may be largest."""
        if self.is_empty:
            return Proved("no point of the inputs is within the domain")
        whole = tuple(axis.whole for axis in self.axes)
        todo = _Queue(_OpenBox(1.0, whole, 0))
        settled, stuck = 0, -1.0
        while todo:
            margin = max(todo.margin, stuck)
            if settled + len(todo) > most or clock.is_over or todo.is_touching:
                return self._open(margin, settled, len(todo), clock)
            if not settled % 64:
                clock.report("settling boxes", settled / (settled + len(todo)))
            box = todo.take()
            result = self._look(box)
            if isinstance(result, Witness):
                return result
            if result is None or result.cut is None:
                settled += 1
                stuck = stuck if result is None else max(stuck, result.margin)
                continue
            for half in _halves(box.box, *result.cut):
                margin = min(result.margin, 1.0)
                todo.put(_OpenBox(margin, half, box.depth + 1, result.rules))
        if stuck >= 0.0:
            why = "no double is known that reaches what is open"
            return Bracket(OF, 0.0, stuck, why)
        noun = "box" if settled == 1 else "boxes"
        return Proved(f"both answer alike in every box: {settled} {noun} settled")

    def _open(self, margin: float, settled: int, left: int, clock: Clock) -> Bracket:
        why = "enough boxes were halved"
        if margin <= TOUCHING:
            why = "only ties are left, or nearly so"
        elif clock.is_over:
            why = "the budget was spent"
        return Bracket(
            OF, 0.0, margin, f"{why}: {settled} boxes are settled, and {left} are open"
        )

    def _look(self, open_box: _OpenBox) -> Witness | _Cut | None:
        """Settle a box (None), find a witness in it, or say how to halve it."""
        _, box, depth, among = open_box
        if not self.places.has_rows(box):
            return None
        one, other = (
            contenders_on(model, propositions, self.axes, box, known)
            for model, propositions, known in zip(
                self.models, self.rules, among, strict=True
            )
        )
        first, second = self._answers(0, one), self._answers(1, other)
        if len(first) == 1 and first == second:
            return None
        old, new = (model.semantics for model in self.models)
        if (one.is_sure or old.uncovered == new.uncovered) and same_contenders(
            one, other, (old.conjunction, new.conjunction)
        ):
            return None
        is_apart = first.isdisjoint(second)
        points = self._points(box, is_wanted=is_apart or depth % 4 == 0)
        if points is None:
            return None
        for point in points:
            near = self.places.in_doubles(point)
            witness = None if near is None else difference_at(*self.models, near)
            if witness is not None:
                return witness
        is_beyond = is_apart and (depth > _DEEPEST or not self.places.has_sums)
        cut = None if is_beyond else self._cut(box, [*one.rules, *other.rules])
        rules = tuple(tuple(rule.place for rule in left.rules) for left in (one, other))
        return _Cut(min(one.margin, other.margin), cut, rules)

    def answers(self, box: Box) -> tuple[set[str | None], set[str | None]] | None:
        """Return the one answer of each model on all of a box, None if one has more."""
        one, other = (
            self._answers(number, contenders_on(model, propositions, self.axes, box))
            for number, (model, propositions) in enumerate(
                zip(self.models, self.rules, strict=True)
            )
        )
        return (one, other) if len(one) == len(other) == 1 else None

    def _answers(self, model: int, left: Remainder) -> set[str | None]:
        result: set[str | None] = {rule.then for rule in left.rules}
        if not left.is_sure:
            result.add(self.models[model].semantics.uncovered)
        return result

    def _points(self, box: Box, *, is_wanted: bool) -> list[Point] | None:
        """Return points of a box to try; None if no input reaches it."""
        if not is_wanted:
            return []
        if not self.places.has_sums:
            return self.places.some(box)
        point = self.places.solved(box)
        return None if point is None else [point]

    def _cut(self, box: Box, rules: Sequence[Contender]) -> tuple[int, Fraction] | None:
        """Return the axis and the place where halving a box promises most.

        That is an edge that most of the rules have which may be the strongest, as the
        cut of a tree's root is; where there is none left, the axis on which some
        degree varies most.
        """
        votes: dict[tuple[int, Fraction], int] = {}
        top = max((rule.high for rule in rules), default=0.0)
        for rule in (one for one in rules if one.high == top):
            for axis, number in rule.propositions:
                low, high, is_closed = box[axis]
                for edge in self.axes[axis].edges[number]:
                    if low < edge < high or (is_closed and edge == low < high):
                        votes[axis, edge] = votes.get((axis, edge), 0) + 1
        if votes:
            return min(votes, key=lambda one: (-votes[one], one))
        wide = self._widest(box, rules)
        return None if wide is None else (wide, _cut_at(self.axes[wide], box[wide]))

    def _widest(self, box: Box, rules: Sequence[Contender]) -> int | None:
        """Return the axis on which a degree that matters varies most."""
        is_min = all(m.semantics.conjunction == "minimum" for m in self.models)
        common: set[PropositionNumber] = set()
        if rules and not is_min:
            common = set.intersection(*({*rule.form} for rule in rules))
        doubt: dict[int, tuple[float, float]] = {}
        for rule in rules:
            for proposition, form in zip(rule.propositions, rule.form, strict=True):
                low, high = rule.bounds[proposition]
                high = min(high, rule.high) if is_min else high
                part, whole = box[proposition[0]], self.axes[proposition[0]].whole
                if part.low == part.high or low > high:
                    continue
                # A factor of all rules says nothing of who is stronger.
                width = 0.0 if form in common else high - low
                length = float((part.high - part.low) / (whole.high - whole.low))
                known = doubt.get(proposition[0], (0.0, length))
                doubt[proposition[0]] = max(known, (width, length))
        return max(doubt, key=lambda one: (doubt[one], -one), default=None)


def _cut_at(axis: SharedAxis, part: AxisPart) -> Fraction:
    """Return where a stretch is cut: near its middle, at a mark of the axis if any."""
    low, high, is_closed = part
    centre = middle(part)
    place = bisect_left(axis.marks, centre)
    near = [
        mark
        for mark in axis.marks[max(place - 1, 0) : place + 1]
        if low < mark < high or (is_closed and mark == low)
    ]
    return min(near, key=lambda mark: abs(mark - centre), default=centre)


def _variables_of(old: RuleBase, new: RuleBase) -> dict[AxisKey, Variable]:
    """Return the variables that some rule of either model uses, by their keys."""
    result: dict[AxisKey, Variable] = {}
    for model in (old, new):
        propositions = {
            proposition.variable for rule in model.rules for proposition in rule.when
        }
        for variable in model.variables:
            if variable.name in propositions:
                result.setdefault(variable.parts or variable.name, variable)
    return result


def _halves(box: Box, axis: int, at: Fraction) -> Iterator[Box]:
    low, high, is_closed = box[axis]
    for part in (AxisPart(low, at, is_closed), AxisPart(at, high)):
        yield (*box[:axis], part, *box[axis + 1 :])


def difference_region(
    old: RuleBase, new: RuleBase, domain: Domain, point: Point
) -> tuple[Span, ...]:
    """Return a closed box around a point on which both answer as they do there.

    Variables of which any value on the domain will do are left out. It is found by
    stretching one side after the other, so a larger box may exist.

    `point`: where they answer otherwise.

    Returns:
        Nothing where a rule uses a combination, or the point is not on the domain.
    """
    search = _Search(old, new, domain)
    if search.places.has_sums or search.places.in_doubles(point) != point:
        return ()
    at = [point[str(axis.key)] for axis in search.axes]
    box = tuple(AxisPart(x, x, True) for x in at)
    wanted = search.answers(box)
    spans: list[Span] = []
    for place, axis in enumerate(search.axes):
        whole = AxisPart(axis.whole.low, axis.whole.high, True)
        wide = (*box[:place], whole, *box[place + 1 :])
        if search.answers(wide) == wanted:
            box = wide
            continue
        for is_low in (True, False):
            box = _stretched(search, box, place, wanted, is_low=is_low)
        low, high, _ = box[place]
        spans.append(Span(str(axis.key), float(low), float(high)))
    return tuple(spans)


def _stretched(
    search: _Search, box: Box, place: int, wanted: object, *, is_low: bool
) -> Box:
    """Return a box with one end moved outwards as far as the answers stay."""
    low, high, _ = box[place]
    whole = search.axes[place].whole

    def moved(end: Fraction) -> Box:
        part = AxisPart(end, high, True) if is_low else AxisPart(low, end, True)
        return (*box[:place], part, *box[place + 1 :])

    best, beyond = (low, whole.low) if is_low else (high, whole.high)
    if search.answers(moved(beyond)) == wanted:
        return moved(beyond)
    for _ in range(_HALVINGS):
        near = Fraction(float((best + beyond) / 2))
        if near in (best, beyond):
            break
        if search.answers(moved(near)) == wanted:
            best = near
        else:
            beyond = near
    return moved(best)

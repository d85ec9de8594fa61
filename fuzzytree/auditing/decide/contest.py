"""Which rules win in boxes of a base, whose ends are counted in knots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np

from fuzzytree.auditing.decide.answers import (
    ZERO,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.model import BoolArray, FloatArray
from fuzzytree.numerics import U, outwards


def decided(base: Base, point: Mapping[str, Fraction]) -> tuple[str | None, int | None]:
    """Return the class of the first of the strongest rules, and its position.

    Where degrees are no fractions, the lower bounds of strengths decide.
    """
    low, high = base.strengths(point)
    best = max(low)
    if not best and not max(high):
        return base.uncovered, None
    place = low.index(best)
    return base.rules[place].then, place


class Contest:
    """Rules whose win counts, against those whose win does not.

    Attributes:
        reach: The positions of those that count.
        rivals: Those of the others.
        is_bare: Whether it counts where no rule fires.
    """

    def __init__(
        self, base: Base, label: str | None, wanted: str | None = None
    ) -> None:
        every = range(base.count)
        self.base, self.label, self.wanted = base, label, wanted
        if wanted is None:
            self.rivals = [i for i in every if base.rules[i].then == label]
            self.is_bare = base.uncovered != label
        else:
            self.rivals = [i for i in every if base.rules[i].then != wanted]
            self.is_bare = base.uncovered == wanted
        self.reach = [i for i in every if i not in self.rivals]
        kept: Field | None = vars(base).get("field")
        if kept is None:
            kept = vars(base)["field"] = Field(base)
        self.field = kept

    def counts(self, label: str | None) -> bool:
        """Return whether a decision is one that is sought."""
        return label != self.label if self.wanted is None else label == self.wanted

    def accepts(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether a point of the domain is decided as is sought, exactly."""
        return self.base.contains(point) and self.counts(decided(self.base, point)[0])

    def questions(self) -> list[Question]:
        """Return the questions of which one must be yes."""
        result = [
            Question(
                (j,),
                tuple(i for i in self.rivals if i < j),
                tuple(i for i in self.rivals if i > j),
            )
            for j in self.reach
        ]
        if self.is_bare:
            result.append(Question(weak=tuple(range(self.base.count)), level=ZERO))
        return result

    def few(self, low: FloatArray, high: FloatArray) -> Contest:
        """Return the same with the rules alone that matter in a box."""
        least, most = self.field.strengths([*self.reach, *self.rivals], low, high)
        count = len(self.reach)
        best = float(least[count:].max(initial=0.0))
        result = Contest(self.base, self.label, self.wanted)
        result.reach = [
            j for n, j in enumerate(self.reach) if most[n, 0] >= best and most[n, 0] > 0
        ]
        result.rivals = [
            i for n, i in enumerate(self.rivals, count) if most[n, 0] >= best
        ]
        result.is_bare = self.is_bare and not best
        return result

    def lead(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return about how far rules that count are ahead at points."""
        least, most = self.field.strengths([*self.reach, *self.rivals], low, high)
        middle, count = (least + most) / 2, len(self.reach)
        mine = middle[:count].max(axis=0, initial=0.0)
        others = middle[count:].max(axis=0, initial=0.0)
        result: FloatArray = mine - others
        if self.is_bare:
            result = np.where((mine == 0.0) & (others == 0.0), 1.0, result)
        return result

    def is_clear(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """Return in which boxes for certain no rule that counts wins."""
        reach, rivals = self.reach, self.rivals
        least, most = self.field.strengths([*reach, *rivals], low, high)
        count = len(reach)
        best = least[count:].max(axis=0, initial=0.0)
        clear = best > 0.0 if self.is_bare else np.ones(len(low), dtype=bool)
        for n, j in enumerate(reach):
            beaten = (most[n] < best) | (most[n] == 0.0)
            for m, i in enumerate(rivals, count):
                if not clear.any() or bool(beaten[clear].all()):
                    break
                if i < j:
                    beaten |= most[n] <= least[m]
                shared = self.field.shared(i, j)
                if shared:
                    beaten |= self.field.is_beaten(j, i, shared, most[n], low, high)
            clear &= beaten
        result: BoolArray = clear
        return result


class Field:
    """Coordinates of boxes: where they are on each input and each sum, in knots."""

    def __init__(self, base: Base) -> None:
        self.base, fine = base, base.fine
        self.axes = [fine.axes.get(name, axis) for name, axis in fine.inputs.items()]
        self.inputs = [axis.name for axis in self.axes]
        self.axes += [axis for axis in fine.axes.values() if not axis.is_input]
        self.place = {axis.name: n for n, axis in enumerate(self.axes)}
        self.stretches = [axis.stretches for axis in self.axes]
        self.x = [np.array([*map(float, one.x)]) for one in self.stretches]
        self.is_double = [
            np.array([Fraction(float(x)) == x for x in one.x]) for one in self.stretches
        ]

    def shared(self, i: int, j: int) -> frozenset[object]:
        """Return the literals that two rules of one norm have in common."""
        one, other = self.base.rules[i], self.base.rules[j]
        same = frozenset(one.literals) & frozenset(other.literals)
        is_twice = any(len(r.literals) > len(set(r.literals)) for r in (one, other))
        return frozenset() if one.norm != other.norm or is_twice else same

    def strengths(
        self, rules: Sequence[int], low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of strengths in boxes, shape (rules, boxes)."""
        degrees: dict[object, tuple[FloatArray, FloatArray]] = {}
        least, most = (np.ones((len(rules), len(low))) for _ in "ab")
        for n, i in enumerate(rules):
            least[n], most[n] = self.strength(i, low, high, degrees)
        return least, most

    def strength(
        self,
        rule: int,
        low: FloatArray,
        high: FloatArray,
        degrees: dict[object, tuple[FloatArray, FloatArray]],
        without: frozenset[object] = frozenset(),
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of a rule's strength in boxes, some literals left out."""
        of = self.base.rules[rule]
        factor = outwards(of.factor)
        least, most = (np.full(len(low), end) for end in factor)
        for key in of.literals:
            if key in without:
                continue
            if key not in degrees:
                n = self.place[key[0]]
                degrees[key] = self.stretches[n].range(key[1], low[:, n], high[:, n])
            a, b = degrees[key]
            if of.norm == "product":
                least, most = least * a * (1.0 - 2 * U), most * b * (1.0 + 2 * U)
            else:
                least, most = np.minimum(least, a), np.minimum(most, b)
        return least, np.minimum(most, factor[1])

    def is_beaten(
        self,
        j: int,
        i: int,
        shared: frozenset[object],
        most: FloatArray,
        low: FloatArray,
        high: FloatArray,
    ) -> BoolArray:
        """Return where a rule is beaten by one that it shares literals with."""
        mine, _ = self.strength(i, low, high, {}, shared)
        if self.base.rules[i].norm == "product":
            _, most = self.strength(j, low, high, {}, shared)
            # Where what they share is 0, both are: then neither fires.
            return mine >= most if i < j else mine > most
        return mine >= most if i < j else np.zeros(len(low), dtype=bool)

    # --- values and places

    @cached_property
    def drawn(self) -> FloatArray:
        """The sampled points of the base, shape (inputs, points)."""
        return np.array([[*map(float, column)] for column in self.base.samples])

    def places(self, n: int, values: FloatArray, *, is_up: bool) -> FloatArray:
        """Return where numbers of an axis are, rounded up or down."""
        last = self.stretches[n].last_number
        if not last:
            return np.zeros_like(values)
        x, is_double = self.x[n][: last + 1], self.is_double[n]
        k = np.clip(np.searchsorted(x, values, "right") - 1, 0, last - 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            width = x[k + 1] - x[k]
            share = (values - x[k]) / width
            slack = 4 * U * (np.abs(values) + np.abs(x[k]) + np.abs(x[k + 1])) / width
        share = np.nan_to_num(
            share + slack if is_up else share - slack, nan=float(is_up)
        )
        place = np.nextafter(k + np.clip(share, 0.0, 1.0), np.inf if is_up else -np.inf)
        for end in (k, k + 1):
            place = np.where((values == x[end]) & is_double[end], end, place)
        result: FloatArray = np.clip(place, 0.0, last)
        return result

    @cached_property
    def _jumps(self) -> list[FloatArray]:
        """The knots of each axis at which a degree jumps."""
        return [stretch.jumps for stretch in self.stretches]

    def jumps(self, places: FloatArray) -> BoolArray:
        """Return which places are knots at which a degree jumps."""
        columns = zip(places.T, self._jumps, strict=True)
        return np.stack([np.isin(x, jumps) for x, jumps in columns], axis=1)

    def values(self, n: int, places: FloatArray) -> FloatArray:
        """Return about the numbers at some places of an axis."""
        x = self.x[n]
        if len(x) == 1:
            return np.full_like(places, x[0])
        k = np.clip(np.floor(places).astype(int), 0, len(x) - 2)
        result: FloatArray = x[k] + (x[k + 1] - x[k]) * (places - k)
        return result

    def at(self, points: FloatArray) -> FloatArray:
        """Return about where points of the inputs are, shape (points, axes)."""
        result = np.empty((points.shape[1], len(self.axes)))
        for n, axis in enumerate(self.axes):
            if n < len(self.inputs):
                x = points[n]
            else:
                x = np.full(points.shape[1], float(axis.constant))
                for name, weight in axis.weights.items():
                    x = x + float(weight) * points[self.place[name]]
            result[:, n] = self.places(n, x, is_up=False)
            stretch = self.stretches[n]
            for k in range(len(self.x[n]) if axis.values else 0):
                result[x == self.x[n][k], n] = k
            for k in range(stretch.last_number + 1, stretch.last + 1):
                result[x == self.x[n][k], n] = k
        return result

"""Degrees as expressions of SQL, with the operations of the reference in its order."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from fuzzytree.exporters.sql_dialects import Query
from fuzzytree.model.rulebase import LR, Band, Flank, Points, Shape, Side
from fuzzytree.semantics.reference import BELOW_ONE


class Degrees:
    """Degrees as expressions; what a polynomial is asked at is a column before."""

    def __init__(self, query: Query) -> None:
        self.query = query
        self.columns: tuple[list[str], list[str]] = ([], [])  # of two steps

    def degree(self, shape: Shape, x: str) -> str:
        """Return the degree of a shape at a column, as the reference computes it."""
        match shape:
            case Band():
                return self._band(shape, x)
            case LR(mean=mean, left=left, right=right):
                distance = f"({x} - {self.query.number(mean)})"
                below = self._side(left, f"-{distance}")
                return self.query.least(below, self._side(right, distance))
            case Points():
                return self._points(shape, x)

    def _column(self, text: str, step: int = 0) -> str:
        names = self.columns[step]
        name = f"{'hg'[step]}_{len(names) + 1}"
        names.append(f"{text} AS {name}")
        return name

    def _band(self, band: Band, x: str) -> str:
        q = self.query
        cases: list[str] = []
        for bound, sign, flank in (
            (band.low, "<=", band.left),
            (band.high, ">", band.right),
        ):
            if bound is not None:
                degree = "0e0" if flank is None else self._flank(flank, x)
                cases.append(f"WHEN {x} {sign} {q.number(bound)} THEN {degree}")
        return f"CASE {' '.join(cases)} ELSE 1e0 END" if cases else "1e0"

    def _flank(self, flank: Flank, x: str) -> str:
        q = self.query
        span = q.number(flank.start - flank.end)
        at = self._column(q.clip(f"({x} - {q.number(flank.end)}) / {span}", 1.0))
        curve = f"({_horner(q, flank.curve, at)}) * {at}"
        return q.clip(curve, BELOW_ONE)

    def _side(self, side: Side, distance: str) -> str:
        q = self.query
        one, reach = q.number(1.0), q.number(side.reach)
        u = self._column(q.clip(f"{distance} / {q.number(side.spread)}", side.reach))
        t = self._column(q.least(u, one), 1)
        v = f"({q.number(2.0)} * {t} - {one})"
        body = q.clip(f"{one} - {t} * ({_horner(q, side.curve, v)})", 1.0)
        fall = q.number(side.reach - 1.0)
        w = self._column(q.clip(f"({reach} - {u}) / {fall}", 1.0), 1)
        return f"{body} * (({w} * {w}) * ({w} * {w}))"

    def _points(self, points: Points, x: str) -> str:
        q = self.query
        known = list(zip(points.values, points.degrees, strict=True))
        first, last = known[0], known[-1]
        cases = [f"WHEN {x} <= {q.number(first[0])} THEN {q.number(first[1])}"]
        for left, right in itertools.pairwise(known):
            if left[0] < right[0]:
                line = self._line(left, right, x)
                cases.append(f"WHEN {x} <= {q.number(right[0])} THEN {line}")
        return f"CASE {' '.join(cases)} ELSE {q.number(last[1])} END"

    def _line(
        self, left: tuple[float, float], right: tuple[float, float], x: str
    ) -> str:
        q = self.query
        (anchor, near), (other, far) = right, left
        if near == far:
            return q.number(near)
        if far == 0.0:
            (anchor, near), (other, far) = left, right
        share = f"({x} - {q.number(anchor)}) / {q.number(other - anchor)}"
        line = f"{q.number(near)} + {share} * {q.number(far - near)}"
        low, high = sorted((near, far))
        return q.least(q.greatest(line, q.number(low)), q.number(high))


def _horner(query: Query, curve: Sequence[float], at: str) -> str:
    text = query.number(curve[-1])
    for coefficient in reversed(curve[:-1]):
        text = f"({text}) * {at} + {query.number(coefficient)}"
    return text

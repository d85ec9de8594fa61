"""Names, texts, numbers and degrees as expressions in each dialect of SQL."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from fractions import Fraction

from fuzzytree.model import LR, Band, Flank, Points, Shape, Side
from fuzzytree.semantics import BELOW_ONE

_MOST_ARGUMENTS = 60  # of one function; SQLite takes 100


class Query:
    """How a dialect writes things, and how the query names them."""

    def __init__(self, dialect: str, table: str, keep: tuple[str, ...]) -> None:
        self.dialect = dialect
        self.table = table
        self.keep = keep

    @property
    def double(self) -> str:
        """The type of a double."""
        return {"sqlite": "REAL", "postgresql": "DOUBLE PRECISION"}.get(
            self.dialect, "DOUBLE"
        )

    def step(self, name: str, *, is_heavy: bool = False) -> str:
        """Open a step; a heavy one is computed once where the dialect can say so."""
        is_once = is_heavy and self.dialect != "spark"
        return f"{name} AS {'MATERIALIZED ' if is_once else ''}("

    def name(self, text: str) -> str:
        """Return a name as an identifier."""
        if re.fullmatch(r"[a-z][a-z0-9_]*", text) and text not in _RESERVED:
            return text
        # SQLite takes an unknown name in double quotes for a text, and goes on.
        mark = "`" if self.dialect in ("spark", "sqlite") else '"'
        return mark + text.replace(mark, mark * 2) + mark

    def column(self, name: str) -> str:
        """Return a column of the table as doubles; what is no number is NULL."""
        source = self.name(name)
        if self.dialect == "sqlite":  # it would cast any text to 0
            is_number = f"typeof({source}) IN ('integer', 'real')"
            return f"CASE WHEN {is_number} THEN CAST({source} AS REAL) END"
        return f"CAST({source} AS {self.double})"

    def text(self, text: str | None) -> str:
        """Return a text as a literal."""
        if text is None:
            return "NULL"
        escaped = text.replace("'", "''")
        if self.dialect == "spark":
            escaped = text.replace("\\", "\\\\").replace("'", "\\'")
        return f"'{escaped}'"

    def number(self, value: float) -> str:
        """Return a double as an expression that gives it exactly.

        SQLite does not promise to round decimals right: there a number that is not its
        own decimal is a whole number divided by a power of two.
        """
        text = repr(value)
        if "e" not in text:
            text = text.removesuffix(".0") + "e0"
        if self.dialect == "sqlite" and not _is_decimal(value):
            return f"({_ratio(value)})"
        return f"({text})" if text.startswith("-") else text

    def least(self, *terms: str) -> str:
        """Return the smallest of some expressions."""
        return self._folded("min" if self.dialect == "sqlite" else "LEAST", terms)

    def greatest(self, *terms: str) -> str:
        """Return the largest of some expressions."""
        return self._folded("max" if self.dialect == "sqlite" else "GREATEST", terms)

    def _folded(self, function: str, terms: Sequence[str]) -> str:
        many = list(terms)
        while len(many) > 1:
            groups = [
                many[k : k + _MOST_ARGUMENTS]
                for k in range(0, len(many), _MOST_ARGUMENTS)
            ]
            many = [
                f"{function}({', '.join(g)})" if len(g) > 1 else g[0] for g in groups
            ]
        return many[0]

    def clip(self, value: str, high: float) -> str:
        """Return a value clamped to 0 and high; 0.0 of -0.0, as the first of equals."""
        zero = self.number(0.0)
        return self.least(self.greatest(zero, value), self.number(high))


_RESERVED = frozenset(
    """
    all alter analyze and anti any array as asc between both by case cast check class
    collate column constraint create cross current default delete desc describe distinct
    drop else end escape except exists false fetch filter for foreign from full function
    grant group having if in index inner insert intersect interval into is join key
    lateral leading left like limit minus natural not null offset on only or order outer
    overlaps pivot primary qualify range references right rows select semi session set
    show some status rule table then time to trailing true union unique unknown unpivot
    update user using values when where window with
    """.split()  # noqa: SIM905
)


def _is_decimal(value: float) -> bool:
    return Fraction(repr(value)) == Fraction(value) and 1e-15 < abs(value) < 1e15


def _ratio(value: float) -> str:
    """Return a double as a product of whole numbers and powers of two, each exact.

    Example:
        >>> _ratio(0.1)
        'CAST(3602879701896397 AS REAL) / 36028797018963968'
    """
    if value == 0.0:
        return "-0e0" if math.copysign(1.0, value) < 0 else "0e0"
    whole, below = value.as_integer_ratio()
    shift = below.bit_length() - 1
    while whole % 2 == 0:
        whole, shift = whole // 2, shift - 1
    text = f"CAST({whole} AS REAL)"
    while shift:
        # Scaled by at most 2^60 at a time; all but the last step away from 0 is exact.
        step = max(-60, min(60, shift))
        text += f" / {2**step}" if step > 0 else f" * {2**-step}"
        shift -= step
    return text


class SqlDegrees:
    """Degrees as expressions; the argument of a polynomial is a column before."""

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

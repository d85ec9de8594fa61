"""The steps of a program as columns of queries, one query after another.

Each step has a template, an expression with its operands as `{0}`, `{1}`, ... What is
used more than once, and is long, becomes a column; anything else stands where it is
used. NULL stands for NaN, for engines compare NaN in their own ways.

An engine that raises an error where a number overflows would fail all rows for one. So
there a `CASE` stands around what may, as far as the numbers reach, and gives infinity
or 0 as other engines do.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.errors import LossError
from fuzzytree.exporters.sql_reach import (
    LARGEST,
    Reach,
    is_defined,
    overflows,
    reaches,
    underflows,
)
from fuzzytree.exporters.sql_text import LIMITS, Query
from fuzzytree.semantics import Program, Step, still_results

_DEEPEST = 60  # levels of an expression
_LONGEST = 4  # operations that a repetition may cost
_MOST_ARGUMENTS = 60  # of one function; SQLite takes 100
_HUGE: Mapping[str, str] = {
    "add": "SIGN({0}) = SIGN({1}) AND LEAST(ABS({0}), ABS({1})) - "
    f"({LARGEST} - GREATEST(ABS({{0}}), ABS({{1}}))) >= {2.0**970!r}",
    "multiply": f"GREATEST(ABS({{0}}), 1e0) * {2.0**-512!r} * "
    f"(GREATEST(ABS({{1}}), 1e0) * {2.0**-512!r}) >= 1e0",
    "divide": f"GREATEST(ABS({{0}}), {2.0**-500!r}) * {2.0**-512!r} >= "
    f"LEAST(ABS({{1}}), 1e0) * {2.0**512!r}",
}
"""Whether a sum, product or quotient is rounded to an infinity."""
_TINY: Mapping[str, str] = {
    "multiply": f"LEAST(ABS({{0}}), ABS({{1}}), {2.0**-500!r}) * {2.0**537!r} * "
    f"(LEAST(GREATEST(ABS({{0}}), ABS({{1}})), 1e0) * {2.0**537!r}) <= 0.5e0",
    "divide": f"LEAST(ABS({{0}}), 1e0) * {2.0**537!r} <= "
    f"GREATEST(ABS({{1}}), 1e0) * {2.0**-538!r}",
}
"""Whether a product or quotient is rounded to 0. Factors of powers of two are exact,
and so chosen that nothing here overflows or underflows itself."""
REMEDY = "take fewer samples or rules, or write C, JavaScript or Python"

_SIGNS: Mapping[str, str] = {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negate": "-{0}",
    "less": "{0} < {1}",
    "at_most": "{0} <= {1}",
    "equal": "{0} = {1}",
    "and": "{0} AND {1}",
    "or": "{0} OR {1}",
    "where": "CASE WHEN {0} THEN {1} ELSE {2} END",
}

_FUNCTIONS: Mapping[str, tuple[str, float, float]] = {
    "absolute": ("ABS", -math.inf, math.inf),
    "floor": ("FLOOR", -math.inf, math.inf),
    "ceiling": ("CEILING", -math.inf, math.inf),
    "square_root": ("SQRT", 0.0, math.inf),
    "exponential": ("EXP", -745.13, 709.782712893384),
    "logarithm": ("LN", math.ulp(0.0), math.inf),
    "logarithm_10": ("LOG10", math.ulp(0.0), math.inf),
    "sine": ("SIN", -LARGEST, LARGEST),
    "cosine": ("COS", -LARGEST, LARGEST),
    "tangent": ("TAN", -LARGEST, LARGEST),
    "arc_sine": ("ASIN", -1.0, 1.0),
    "arc_cosine": ("ACOS", -1.0, 1.0),
    "arc_tangent": ("ATAN", -math.inf, math.inf),
    "hyperbolic_sine": ("SINH", -710.4758600739439, 710.4758600739439),
    "hyperbolic_cosine": ("COSH", -710.4758600739439, 710.4758600739439),
    "hyperbolic_tangent": ("TANH", -math.inf, math.inf),
    "area_sine": ("ASINH", -math.inf, math.inf),
    "area_cosine": ("ACOSH", 1.0, math.inf),
    "area_tangent": ("ATANH", math.nextafter(-1.0, 0.0), math.nextafter(1.0, 0.0)),
    "arc_tangent_2": ("ATAN2", -math.inf, math.inf),
}
"""Functions, and between which arguments they have numbers."""

_OVERFLOWING = frozenset(("exponential", "hyperbolic_sine", "hyperbolic_cosine"))

_ROUND = """\
CASE WHEN {0} - FLOOR({0}) < 0.5e0 THEN FLOOR({0})
    WHEN {0} - FLOOR({0}) > 0.5e0 THEN FLOOR({0}) + 1e0
    WHEN FLOOR({0}) / 2e0 = FLOOR(FLOOR({0}) / 2e0) THEN FLOOR({0})
    ELSE FLOOR({0}) + 1e0 END"""
_LOG1P = """\
CASE WHEN {0} <= -1e0 THEN NULL WHEN 1e0 + {0} = 1e0 THEN {0}
    ELSE LN(1e0 + {0}) * ({0} / ((1e0 + {0}) - 1e0)) END"""  # W. Kahan
_POWER = """\
CASE WHEN ABS({1}) < 1e-200 THEN 1e0::float8
    WHEN {0} = 0e0 THEN CASE WHEN {1} > 0e0 THEN 0e0::float8 ELSE @ END
    WHEN ABS({1}) <= 1e200 AND ({0} > 0e0 OR {1} = FLOOR({1})) THEN
    CASE WHEN {1} * LN(ABS({0})) < -745e0 THEN 0e0::float8
    WHEN {1} * LN(ABS({0})) < 709.78e0 THEN POWER({0}, {1})
    WHEN {0} < 0e0 AND {1} / 2e0 <> FLOOR({1} / 2e0) THEN -@ ELSE @ END END"""


class SqlSteps:
    """A program as columns: of degrees of terms, and of what is used more than once.

    Attributes:
        levels: The new columns of one query after another, each with a comment or "".
    """

    def __init__(
        self,
        query: Query,
        program: Program,
        results: Sequence[int],
        comments: Mapping[int, str],
    ) -> None:
        self.query, self.program, self.steps = query, program, program.steps
        self.still = still_results(program)
        self.reaches = reaches(program)
        self.operands = [step.arguments for step in self.steps]
        self.templates = [self._template(place) for place in range(len(self.steps))]
        self.levels: list[list[tuple[int, str, str]]] = []
        self._results = results
        self._names: dict[int, str] = {}
        self._texts: dict[int, str] = {}
        self._raw: set[int] = set()  # texts that may be NaN and not NULL
        self._parts: dict[int, list[str]] = {}  # arguments of a minimum or maximum
        self._needs: dict[int, frozenset[int]] = {}  # the columns that a text names
        self._level: dict[int, int] = {}  # the queries before it
        self._add_columns(comments)

    def _add_columns(self, comments: Mapping[int, str]) -> None:
        uses: dict[int, int] = {}
        compared = {*self._results}
        for place in self._results:
            uses[place] = uses.get(place, 0) + 1
        for place in range(len(self.steps) - 1, -1, -1):
            for one, count in self._mentions(place):
                if place in uses and count:
                    uses[one] = uses.get(one, 0) + count
                    if self.steps[place].operation not in _PASSING:
                        compared.add(one)
        sizes: dict[int, int] = {}
        depths: dict[int, int] = {}
        for place in sorted(one for one in uses if self.still[one] is None):
            step, title = self.steps[place], self.program.titles[place]
            if step.operation == "input":
                self._names[place] = f"x_{self.program.inputs.index(step.name) + 1}"
                self._level[place] = 0
                continue
            operands = self.operands[place]
            inner_sizes = [n * sizes.get(one, 0) for one, n in self._mentions(place)]
            sizes[place] = 1 + sum(inner_sizes)
            is_flat = step.operation in ("minimum", "maximum", "where")
            inner = [depths.get(one, 0) for one in operands]
            inner = inner if is_flat else [0, *(1 + one for one in inner)]
            depths[place] = max(inner)
            is_part = title.endswith(f" {step.operation.replace('_', ' ')}")
            comment = title if " is " in title and not is_part else ""
            comment = comments.get(place, comment)
            is_long = (uses[place] - 1) * sizes[place] > _LONGEST
            self._add_text(place)
            is_long = is_long or (place in self._raw and place in compared)
            if comment or is_long or depths[place] > _DEEPEST:
                self._add_column(place, comment)
                sizes[place] = depths[place] = 0

    def _mentions(self, place: int) -> Iterator[tuple[int, int]]:
        """Yield the operands of a step, and how often its text has each."""
        for number, one in enumerate(self.operands[place]):
            yield one, self.templates[place].count(f"{{{number}}}")

    def _add_text(self, place: int) -> None:
        needs: frozenset[int] = frozenset()
        for one in self.operands[place]:
            needs |= {one} if one in self._names else self._needs.get(one, frozenset())
        self._needs[place] = needs
        self._level[place] = max((self._level[one] for one in needs), default=0)
        self._texts[place] = self._expression(place)
        step, operands = self.steps[place], self.operands[place]
        is_raw = step.operation in _PASSING and not self._raw.isdisjoint(operands)
        reached = [self.reaches[one] for one in operands]
        is_new = step.kind == "number" and not step.table
        is_new = is_new and not is_defined(step, reached)
        if (is_raw or is_new) and not self.query.is_strict:
            self._raw.add(place)

    def _add_column(self, place: int, comment: str) -> None:
        text, level = self._texts.pop(place), self._level[place]
        if self.steps[place].kind == "truth":
            text = f"CASE WHEN {text} THEN 1 ELSE 0 END"
        elif place in self._raw:
            text = self.query.known(text)
            self._raw.remove(place)
        self._names[place] = f"v_{len(self._names) + 1}"
        if level == len(self.levels):
            self.levels.append([])
        self.levels[level].append((place, text, comment))
        self._level[place] = level + 1

    def value(self, place: int) -> str:
        """Return a step's result: a column, a number, or an expression."""
        still = self.still[place]
        if isinstance(still, bool):
            return "1 = 1" if still else "1 = 0"
        if isinstance(still, float):
            return self.query.typed(still)
        if place in self._names:
            is_truth = self.steps[place].kind == "truth"
            return f"{self._names[place]}{' = 1' if is_truth else ''}"
        return self._texts[place]

    def _operand(self, place: int) -> str:
        """Return a value as part of an expression."""
        still = self.still[place]
        if isinstance(still, float):
            return self.query.number(still)
        return f"({self.value(place)})" if self._is_open(place) else self.value(place)

    def _is_open(self, place: int) -> bool:
        """Return whether a text needs parentheses within another one."""
        template = self.templates[place] if place in self._texts else ""
        if template in _CHOICES:
            return self._is_open(self.operands[place][_CHOICES[template]])
        return template.startswith(("{", "-", "NOT"))

    def _expression(self, place: int) -> str:
        template, places = self.templates[place], self.operands[place]
        operation = self.steps[place].operation
        if operation == "where":
            test, then, otherwise = map(self.value, places)
            rest = f"ELSE {otherwise} END"
            is_inside = places[2] in self._texts
            if is_inside and self.steps[places[2]].operation == "where":
                rest = otherwise.removeprefix("CASE ")
            return f"CASE WHEN {test} THEN {then}\n    {rest}"
        if template in _CHOICES:
            return self.value(places[_CHOICES[template]])
        name = template.partition("(")[0]
        if operation in ("minimum", "maximum") and name in _ENDS:
            parts: list[str] = []
            for one in reversed(places):
                own = self._parts.get(one, []) if one in self._texts else []
                is_same = self.templates[one].startswith(f"{name}(")
                parts += own if own and is_same else [self._operand(one)]
            if len(parts) > _MOST_ARGUMENTS:
                parts = [self._operand(one) for one in reversed(places)]
            self._parts[place] = parts
            return f"{name}({', '.join(parts)})"
        return template.format(*map(self._operand, places))

    def _template(self, place: int) -> str:
        """Return a step as an expression of its operands."""
        step, query = self.steps[place], self.query
        if step.operation == "input" or self.still[place] is not None:
            return ""
        operands = [self.reaches[one] for one in step.arguments]
        match step.operation:
            case "minimum" | "maximum":
                return self._end(step.operation, *operands)
            case "is_finite":
                if operands[0].size <= LARGEST:
                    return "{0} IS NOT NULL"
                return f"{{0}} BETWEEN -{LARGEST} AND {LARGEST}"
            case "not":
                (one,) = step.arguments
                inner = self.steps[one]
                if inner.operation == "equal" and len(set(inner.arguments)) == 1:
                    self.operands[place] = inner.arguments[:1]
                    return "{0} IS NULL"
                is_sure = operands[0].is_sure
                return "NOT {0}" if is_sure else "CASE WHEN {0} THEN 0 ELSE 1 END = 1"
            case "below":
                numbers = [query.typed(float(k)) for k in range(len(step.table))]
                cases = [
                    f"WHEN {{0}} <= {query.number(one)} THEN {number}"
                    for one, number in zip(step.table, numbers, strict=True)
                ]
                count = query.typed(float(len(step.table)))
                return f"CASE {' '.join(cases)} ELSE {count} END"
            case "pick":
                first, *others = map(query.typed, step.table)
                cases = [f" WHEN {k}e0 THEN {x}" for k, x in enumerate(others, 1)]
                return (
                    f"CASE {{0}}{''.join(cases)} ELSE {first} END" if others else first
                )
            case operation if operation in _FUNCTIONS:
                return self._function(operation, operands)
            case operation:
                text = _SIGNS.get(operation) or self._other(operation)
                if query.is_strict:
                    text = self._guarded(step, operands)
                elif operation == "divide" and operands[1].has_zero:
                    text = self._quotient()
                is_known = step.kind == "truth" or is_defined(step, operands)
                return text if is_known or not query.is_strict else query.known(text)

    def _end(self, operation: str, a: Reach, b: Reach) -> str:
        """Return the smaller or larger of two numbers; of equal ones the second."""
        is_least = operation == "minimum"
        low, high = (a, b) if is_least else (b, a)
        is_sure = a.is_sure and b.is_sure
        if is_sure and (low.high <= high.low or high.high <= low.low):
            is_first = low.high <= high.low
            return "{0}" if is_first else "{1}"
        if self.query.dialect == "sqlite":  # NULL if either is
            return "min({1}, {0})" if is_least else "max({1}, {0})"
        if is_sure:
            return "LEAST({1}, {0})" if is_least else "GREATEST({1}, {0})"
        sign = "<" if is_least else ">"
        return (
            f"CASE WHEN {{0}} {sign} {{1}} OR {{0}} IS NULL THEN {{0}} ELSE {{1}} END"
        )

    def _quotient(self) -> str:
        """Return a division whose divisor may be 0."""
        if self.query.dialect == "duckdb":
            return "{0} / {1}"
        infinity = self.query.number(math.inf)
        return f"CASE WHEN {{1}} = 0e0 THEN {{0}} * {infinity} ELSE {{0}} / {{1}} END"

    def _function(self, operation: str, operands: Sequence[Reach]) -> str:
        query, one = self.query, operands[0]
        name, low, high = _FUNCTIONS[operation]
        is_small = one.low >= 0.0 and one.high < 2.0**53
        if operation == "floor" and query.dialect == "sqlite" and is_small:
            return "CAST(CAST({0} AS INTEGER) AS REAL)"  # it may be built without floor
        text = f"{name}({{0}}, {{1}})" if len(operands) > 1 else f"{name}({{0}})"
        if operation in _OVERFLOWING and not query.is_strict:
            return text
        tests = [f"{{0}} >= {query.number(low)}"] if one.low < low else []
        tests += [f"{{0}} <= {query.number(high)}"] if one.high > high else []
        if not tests:
            return text
        rest = ""
        if operation in _OVERFLOWING:
            base = "{0}" if operation == "hyperbolic_sine" else "ABS({0})"
            rest = f" ELSE {base} * {query.number(math.inf)}"
            if operation == "exponential":
                rest = f" WHEN {{0}} < 0e0 THEN 0e0{rest}"
        elif name.startswith("L"):
            rest = f" WHEN {{0}} = 0e0 THEN {query.number(-math.inf)}"
        return f"CASE WHEN {' AND '.join(tests)} THEN {text}{rest} END"

    def _other(self, operation: str) -> str:
        """Return what few formulas use."""
        match operation:
            case "round":
                return _ROUND
            case "logarithm_1p":
                return _LOG1P
            case "power":
                return "POWER({0}, {1})"
            case _ if self.query.is_strict:
                raise LossError(
                    f"cannot write {self.program.name} as sql for {self.query.target}: "
                    f"a formula has a remainder, which the dialect has of decimals only"
                )
            case _ if self.query.dialect == "sqlite":
                return "MOD({0}, {1})"
            case _:
                return "CASE WHEN {1} <> 0e0 THEN {0} % {1} END"

    def _guarded(self, step: Step, operands: Sequence[Reach]) -> str:
        """Return an operation that raises no error in PostgreSQL."""
        is_large, is_small = overflows(step, operands), underflows(step, operands)
        operation, infinity = step.operation, self.query.number(math.inf)
        if operation == "power":
            is_plain = operands[0].low >= 0.0 and operands[1].low >= 0.0
            is_plain = is_plain and not is_large and not is_small
            return "POWER({0}, {1})" if is_plain else _POWER.replace("@", infinity)
        text = _SIGNS.get(operation) or self._other(operation)
        cases: list[str] = []
        a, *others = operands
        if operation == "divide" and a.size == others[0].size == math.inf:
            both = "ABS({0}) = @ AND ABS({1}) = @ THEN NULL"
            cases.append(both.replace("@", infinity))
        if operation == "divide" and others[0].has_zero:
            cases.append(f"{{1}} = 0e0 THEN SIGN({{0}}) * {infinity}")
        if is_large and operation in ("add", "subtract"):
            test = _HUGE["add"]
            if operation == "subtract":
                test = test.replace("SIGN({1})", "-SIGN({1})")
            cases.append(f"{test} THEN SIGN({{0}}) * {infinity}")
        elif is_large and operation in _HUGE:
            sign = f"SIGN({{0}}) * SIGN({{1}}) * {infinity}"
            cases.append(f"{_HUGE[operation]} THEN {sign}")
        if is_small and operation in _TINY:
            if not all(one.is_sure for one in operands):
                cases.append("{0} IS NULL OR {1} IS NULL THEN NULL")
            cases.append(f"{_TINY[operation]} THEN 0e0")
        return f"CASE WHEN {' WHEN '.join(cases)} ELSE {text} END" if cases else text

    def queries(self, kept: Sequence[str]) -> Iterator[str]:
        """Yield a query for each level, behind `columns`, with what is needed later.

        Raises:
            LossError: If one has more columns than the engine takes.
        """
        last = {
            one: len(self.levels)
            for place in self._results
            for one in self._used(place)
        }
        for level, columns in enumerate(self.levels):
            for place, _, _ in columns:
                for one in self._needs[place]:
                    last[one] = max(last.get(one, 0), level)
        carried = [
            [
                name
                for place, name in self._names.items()
                if self._level[place] <= level and last.get(place, -1) > level
            ]
            for level in range(len(self.levels))
        ]
        widths = [len(a) + len(b) for a, b in zip(carried, self.levels, strict=True)]
        self.check_columns(len(kept) + max(widths, default=0))
        for level, columns in enumerate(self.levels):
            yield self.query.step(f"level_{level + 1}")
            yield "  SELECT"
            if names := [*kept, *carried[level]]:
                text = textwrap.fill(
                    ", ".join(names), 88, initial_indent="  ", subsequent_indent="  "
                )
                yield f"{text},"
            for number, (place, text, comment) in enumerate(columns, 1):
                comma = "," if number < len(columns) else ""
                remark = f" -- {comment!r}" if comment else ""
                yield f"  {text} AS {self._names[place]}{comma}{remark}"
            yield f"  FROM {self.name_of(level)}\n),"

    def _used(self, place: int) -> frozenset[int]:
        return (
            frozenset((place,))
            if place in self._names
            else self._needs.get(place, frozenset())
        )

    @staticmethod
    def name_of(level: int) -> str:
        """Return the name of the query before a level."""
        return f"level_{level}" if level else "columns"

    def check_columns(self, count: int) -> None:
        """Refuse a query of more columns than the engine takes.

        Raises:
            LossError: If it has more.
        """
        limit = LIMITS[self.query.target]
        if count > limit.columns:
            raise LossError(
                f"cannot write {self.program.name} as sql for {self.query.target}: a "
                f"step of it has {count} columns, and {limit.engine} takes "
                f"{limit.columns}; {REMEDY}"
            )


_PASSING = frozenset(
    ("add", "subtract", "multiply", "divide", "negate", "absolute", "where")
)
"""Operations that make NaN of NaN."""
_CHOICES = {"{0}": 0, "{1}": 1}
_ENDS = frozenset(("min", "max", "LEAST", "GREATEST"))

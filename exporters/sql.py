"""SQL: a tree as nested CASE, a rule base as expressions, in one query.

The query answers every row of a table. It performs the reference's operations in the
reference's order on doubles, in steps: columns, combinations, degrees, strengths,
answer; each step is a common table expression, so a person can follow it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import ClassVar, Literal, get_args

from fuzzytree.columns import BOOLEANS
from fuzzytree.errors import LossError
from fuzzytree.exporters.program_text import (
    StepText,
    check_rated,
    named_steps,
    source_of,
    strengths_of,
    title_of,
)
from fuzzytree.model import (
    WEIGHT_OF_ONE,
    Format,
    FuzzyTree,
    Model,
    Node,
    RuleBase,
    Variable,
    Written,
    parts_of,
    sentence,
    squarings,
)
from fuzzytree.semantics import Step

Dialect = Literal["sqlite", "duckdb", "postgresql", "spark"]

MOST_RULES = 400
"""Engines hold some 1,600 columns in a step, and one rule takes up to three."""

MOST_LEVELS = 100
"""How deep CASE may be nested; SQLite takes 1,000 levels of any expression."""

_LARGEST = "1.7976931348623157e308"


def write(
    model: Model,
    /,
    *,
    allow_loss: bool = False,
    dialect: Dialect = "sqlite",
    table: str = "data",
    keep: Sequence[str] | str = (),
    strengths: bool = False,
    probabilities: bool = False,
) -> Written:
    """Return a model as the text of one SQL query, in UTF-8.

    The query gives, for each row of the table, the columns kept, then `class` (NULL for
    no class), `rule` (the number of the winning rule or leaf, 0 for none) and `status`
    (0 decided, 1 tie, 2 uncovered, 3 missing). NULL, NaN and infinities are missing.

    Args:
        model: A tree or a rule base.
        allow_loss: Of no effect: nothing is lost.
        dialect: `sqlite`, `duckdb`, `postgresql` or `spark`.
        table: The name of the table or view; its columns are named as the inputs.
        keep: Columns of the table to give beside the answer, such as its key; the
            inputs unless given.
        strengths: Whether to give the strength of each rule as well.
        probabilities: Whether to give the probability of each class as well, in the
            order of the classes; the rule base must have them.

    Raises:
        LossError: If the model is beyond what engines hold.
        ValueError: If there is no such dialect, the table has no name, or
            probabilities are wanted that the model does not have.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> text = write(random_tree(0), table="grasps").content.decode()
        >>> "FROM grasps" in text
        True
    """
    source = source_of(write, model, locals())
    del allow_loss
    known = get_args(Dialect)
    if dialect not in known:
        raise ValueError(f"sql has no dialect {dialect!r}; there is {', '.join(known)}")
    if not table:
        raise ValueError("table: must name a table or a view, not ''")
    if probabilities:
        check_rated(model, "sql")
    names = (keep,) if isinstance(keep, str) else tuple(keep)
    query = Query(dialect, table, names or model.inputs)
    if isinstance(model, RuleBase):
        if len(model.rules) > MOST_RULES:
            raise LossError(
                f"cannot write {model.name} as sql: it has {len(model.rules)} rules, "
                f"and engines allow {MOST_RULES} as columns of a query; write the tree "
                "instead"
            )
        steps = _rule_steps(
            query, model, with_strengths=strengths, with_probabilities=probabilities
        )
    else:
        if strengths:
            raise ValueError("sql: a tree has no strengths; its rules have")
        _refuse_deep(model)
        steps = _tree_steps(query, model)
    text = "\n".join(
        [*_heading(model, dialect, source), *_axes(query, model), *steps, ""]
    )
    remark = (
        "PostgreSQL raises an error where a number overflows or a product underflows, "
        "and other engines go on"
    )
    remarks = (remark,) if dialect == "postgresql" else ()
    return Written(text.encode("utf-8"), remarks=remarks)


def _refuse_deep(tree: FuzzyTree) -> None:
    depths = [0] * (len(tree.nodes) + 1)
    for number, node in enumerate(tree.nodes, 1):
        here = depths[number] + len(node.cuts).bit_length()
        if here > MOST_LEVELS:
            raise LossError(
                f"cannot write {tree.name} as sql: its CASE would be nested deeper "
                f"than {MOST_LEVELS} levels"
            )
        for branch in node.branches:
            if branch.node is not None:
                depths[branch.node] = here


def _heading(model: Model, dialect: str, source: str) -> Iterator[str]:
    yield f"-- {title_of(model, repr(model.name))}, in SQL for {dialect}."
    yield f"-- Written by fuzzytree. Fingerprint: {source}"
    yield f"-- Classes: {', '.join(map(repr, model.classes))}"
    yield "-- status: 0 decided, 1 tie, 2 uncovered, 3 missing"


def _listed(lines: Iterable[str]) -> str:
    return ",\n".join(f"  {line}" for line in lines)


def _axes(query: Query, model: Model) -> Iterator[str]:
    """Yield the first steps: doubles, combinations, and whether all are there."""
    lines: dict[str, str] = {}
    kept = [f"{query.name(n)} AS kept_{k}" for k, n in enumerate(query.keep, 1)]
    columns: list[str] = []
    mixes: list[str] = []
    for number, variable in enumerate(model.variables, 1):
        name = lines[variable.name] = f"x_{number}"
        if variable.parts:
            terms = [
                f"{query.number(p.weight)} * ({lines[p.input]} - "
                f"{query.number(p.centre)})"
                for p in variable.parts
            ]
            mixes.append(f"{' + '.join(terms)} AS {name}")
        else:
            columns.append(f"{query.filled(variable)} AS {name}")
    yield "WITH"
    yield query.step("columns")
    yield f"  SELECT\n{_listed([*kept, *columns] or ['1 AS x_0'])}"
    yield f"  FROM {query.name(query.table)}\n),"
    yield query.step("axes")
    yield f"  SELECT\n{_listed(['columns.*', *mixes])}\n  FROM columns\n),"
    finite = [f"{line} BETWEEN -{_LARGEST} AND {_LARGEST}" for line in lines.values()]
    test = " AND\n    ".join(finite) or "1 = 1"
    yield query.step("known", is_heavy=True)
    yield f"  SELECT axes.*,\n  CASE WHEN {test}\n    THEN 1 ELSE 0 END AS is_known"
    yield "  FROM axes\n),"


def _tree_steps(query: Query, tree: FuzzyTree) -> Iterator[str]:
    line = {v.name: f"x_{number}" for number, v in enumerate(tree.variables, 1)}

    def halves(node: Node, low: int, high: int, level: int) -> str:
        """Return the leaf for a stretch of a node's intervals, by bisection."""
        pad = "  " * (level % 20)
        owners = {node.owners[k] for k in range(low, high + 1)}
        if len(owners) == 1:
            branch = node.branches[owners.pop()]
            if branch.leaf is not None:
                return f"{pad}{branch.leaf}"
            node = tree.nodes[(branch.node or 0) - 1]
            return halves(node, 0, len(node.cuts), level)
        middle = (low + high) // 2
        test = f"{line[node.variable]} <= {query.number(node.cuts[middle])}"
        below = halves(node, low, middle, level + 1)
        above = halves(node, middle + 1, high, level + 1)
        return (
            f"{pad}CASE WHEN {test} THEN -- {node.variable!r}\n{below}\n"
            f"{pad}ELSE\n{above}\n{pad}END"
        )

    yield query.step("answers", is_heavy=True)
    yield "  SELECT known.*,\n  CASE WHEN is_known = 0 THEN 0 ELSE"
    root = tree.nodes[0] if tree.nodes else None
    yield "  1" if root is None else halves(root, 0, len(root.cuts), 1)
    yield "  END AS leaf\n  FROM known\n)"
    ends = [
        f"WHEN {number} THEN {query.text(leaf.label)}"
        for number, leaf in enumerate(tree.leaves, 1)
    ]
    label = "\n    ".join(
        ["CASE leaf", f"WHEN 0 THEN {query.text(tree.semantics.missing)}", *ends, "END"]
    )
    yield from _last(query, label, "leaf", "CASE WHEN is_known = 1 THEN 0 ELSE 3 END")


def _last(
    query: Query,
    label: str,
    rule: str,
    status: str,
    more: Sequence[str] = (),
    source: str = "answers",
) -> Iterator[str]:
    kept = [f"kept_{k} AS {query.name(n)}" for k, n in enumerate(query.keep, 1)]
    result = [f"{label} AS {query.name('class')}"]
    result += [f"{rule} AS {query.name('rule')}", f"{status} AS {query.name('status')}"]
    yield f"SELECT\n{_listed([*kept, *result, *more])}\nFROM {source}"


def _rule_steps(
    query: Query, rules: RuleBase, *, with_strengths: bool, with_probabilities: bool
) -> Iterator[str]:
    steps = SqlSteps(query, rules)
    before = "known"
    for number, columns in enumerate(steps.levels, 1):
        yield query.step(f"level_{number}", is_heavy=True)
        yield _commented([f"{before}.*", *columns]) + f"\n  FROM {before}\n),"
        before = f"level_{number}"
    fired = [
        f"{strength} AS s_{number} -- {sentence(rule)!r}"
        for number, (strength, rule) in enumerate(
            zip(steps.strengths, rules.rules, strict=True), 1
        )
    ]
    yield query.step("fired", is_heavy=True)
    yield _commented([f"{before}.*", *fired]) + f"\n  FROM {before}\n),"
    yield from _decision(
        query,
        rules,
        with_strengths=with_strengths,
        with_probabilities=with_probabilities,
    )


def _commented(lines: Sequence[str]) -> str:
    """Return a SELECT whose lines may end in a comment, behind the comma."""
    shown: list[str] = []
    for number, line in enumerate(lines, 1):
        code, mark, comment = line.partition(" -- ")
        comma = "," if number < len(lines) else ""
        shown.append(f"  {code}{comma}{mark}{comment}")
    return "  SELECT\n" + "\n".join(shown)


def _decision(
    query: Query, rules: RuleBase, *, with_strengths: bool, with_probabilities: bool
) -> Iterator[str]:
    numbers = range(1, len(rules.rules) + 1)
    yield query.step("best", is_heavy=True)
    best = query.greatest(*(f"s_{k}" for k in numbers))
    yield f"  SELECT fired.*,\n  {best} AS best\n  FROM fired\n),"
    yield query.step("answers", is_heavy=True)
    wins = "\n    ".join(f"WHEN s_{k} = best THEN {k}" for k in numbers)
    ties = " +\n    ".join(f"CASE WHEN s_{k} = best THEN 1 ELSE 0 END" for k in numbers)
    yield (
        "  SELECT best.*,\n  CASE WHEN is_known = 0 THEN 0\n"
        "    WHEN best = 0e0 THEN 0\n"
        f"    {wins}\n  END AS winner,\n    {ties}\n  AS equals\n  FROM best\n)"
        + ("," if with_probabilities else "")
    )
    if with_probabilities:
        yield from _mixing(query, rules)
    ends = [
        f"WHEN winner = {number} THEN {query.text(rule.then)}"
        for number, rule in enumerate(rules.rules, 1)
    ]
    missing, uncovered = rules.semantics.missing, rules.semantics.uncovered
    label = "\n    ".join(
        [
            f"CASE WHEN is_known = 0 THEN {query.text(missing)}",
            f"WHEN winner = 0 THEN {query.text(uncovered)}",
            *ends,
            "END",
        ]
    )
    status = (
        "CASE WHEN is_known = 0 THEN 3 WHEN winner = 0 THEN 2 "
        "WHEN equals > 1 THEN 1 ELSE 0 END"
    )
    shown: list[str] = []
    if with_strengths:
        shown = [
            f"CASE WHEN is_known = 1 THEN s_{k} END AS strength_{k}" for k in numbers
        ]
    if with_probabilities:
        shown += [
            f"CASE WHEN winner > 0 THEN n_{k} / total END AS probability_{k}"
            for k in range(1, len(rules.classes) + 1)
        ]
    source = "mixed" if with_probabilities else "answers"
    yield from _last(query, label, "winner", status, shown, source)


def _mixing(query: Query, rules: RuleBase) -> Iterator[str]:
    """Yield the steps from strengths to the count of each class, and their total."""
    numbers = range(1, len(rules.rules) + 1)
    classes = range(1, len(rules.classes) + 1)
    kept = [f"kept_{k}" for k in range(1, len(query.keep) + 1)]
    kept += ["is_known", "winner", "equals", *(f"s_{k}" for k in numbers)]

    def step(name: str, before: str, columns: Iterable[str]) -> str:
        text = _listed([*kept, *columns])
        head = query.step(name, is_heavy=True)
        return f"{head}\n  SELECT\n{text}\n  FROM {before}\n)"

    before = "answers"
    powers = [f"s_{k}" for k in numbers]
    for number in range(1, squarings(rules.semantics.sharpness) + 1):
        squares = [f"{p} * {p} AS p_{k}" for k, p in enumerate(powers, 1)]
        yield step(f"power_{number}", before, squares) + ","
        before, powers = f"power_{number}", [f"p_{k}" for k in numbers]
    weight = query.number(float(WEIGHT_OF_ONE))
    weights = [query.floor(f"{weight} * {p}") for p in powers]
    columns = [f"{one} AS w_{k}" for k, one in enumerate(weights, 1)]
    yield step("weights", before, columns) + ","
    vectors = [parts_of(rule.probabilities) for rule in rules.rules]
    counts = [
        " + ".join(
            f"w_{k} * {query.number(float(vector[place - 1]))}"
            for k, vector in enumerate(vectors, 1)
            if vector[place - 1]
        )
        or "0e0"
        for place in classes
    ]
    owners = " ".join(
        f"WHEN {k} THEN {rules.classes.index(rule.then) + 1}"
        for k, rule in enumerate(rules.rules, 1)
    )
    columns = [f"{one} AS n_{place}" for place, one in enumerate(counts, 1)]
    yield (
        step("counts", "weights", [*columns, f"CASE winner {owners} END AS own"]) + ","
    )
    others = [f"CASE WHEN own = {k} THEN 0e0 ELSE n_{k} END" for k in classes]
    top = f"{query.greatest(*others)} AS top"
    kept += [*(f"n_{k}" for k in classes), "own"]
    yield step("tops", "counts", [top]) + ","
    kept = kept[: -len(classes) - 1]
    raised = [
        f"CASE WHEN own = {k} THEN {query.greatest(f'n_{k}', 'top + 1e0')} "
        f"ELSE n_{k} END AS n_{k}"
        for k in classes
    ]
    yield step("raised", "tops", raised) + ","
    kept += [f"n_{k}" for k in classes]
    total = " + ".join(f"n_{k}" for k in classes)
    yield step("mixed", "raised", [f"{total} AS total"])


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

    def filled(self, variable: Variable) -> str:
        """Return a column as doubles, with what stands for missing and unknown ones."""
        value = self.column(variable.name)
        if variable.categories:
            value = self._position(variable)
        if variable.missing is None:
            return value
        stand = self.number(variable.missing)
        test = f"{value} BETWEEN -{_LARGEST} AND {_LARGEST}"
        return f"CASE WHEN {test} THEN {value} ELSE {stand} END"

    def _position(self, variable: Variable) -> str:
        """Return the position of a column's category; NULL of an unknown one.

        SQLite, whose columns hold anything, takes a position as well.
        """
        source = self.name(variable.name)
        if variable.categories == BOOLEANS and self.dialect != "sqlite":
            return f"CASE WHEN {source} THEN 1e0 WHEN NOT {source} THEN 0e0 END"
        cases = " ".join(
            f"WHEN {self.text(name)} THEN {place}e0"
            for place, name in enumerate(variable.categories)
        )
        own = f" ELSE {self.column(variable.name)}" if self.dialect == "sqlite" else ""
        return f"CASE {source} {cases}{own} END"

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

    def floor(self, term: str) -> str:
        """Return the largest whole number up to an expression that is not negative."""
        if self.dialect == "sqlite":  # it may be built without floor
            return f"CAST(CAST({term} AS INTEGER) AS REAL)"
        return f"FLOOR({term})"

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


class SqlSteps(StepText):
    """The program of a rule base as columns: of degrees, and of what is used twice.

    Attributes:
        levels: The columns of one query after another; each needs those before it.
        strengths: The strength of each rule, where every value is known.
    """

    signs: ClassVar[Mapping[str, str]] = {
        **StepText.signs,
        **{"equal": "=", "and": "AND", "or": "OR", "not": "NOT "},
        "where": "CASE WHEN {} THEN {} ELSE {} END",
    }

    def __init__(self, query: Query, rules: RuleBase) -> None:
        program, places = strengths_of(rules)
        super().__init__(program)
        self.query = query
        numbers = enumerate(rules.variables, 1)
        self._inputs = {one.name: f"x_{number}" for number, one in numbers}
        self._columns: dict[int, str] = {}
        self.levels: list[list[str]] = []
        levels: dict[int, int] = {}
        named = named_steps(program, places)
        for place, step in enumerate(self.steps):
            levels[place] = max((levels[one] for one in step.arguments), default=0)
            if place in named:
                if levels[place] == len(self.levels):
                    self.levels.append([])
                name = f"v_{len(self._columns) + 1}"
                comment = f" -- {named[place]!r}" if named[place] else ""
                column = f"{self.expression(step)} AS {name}{comment}"
                self.levels[levels[place]].append(column)
                self._columns[place] = name
                levels[place] += 1
        self.strengths = [self.value(place) for place in places]

    def value(self, place: int) -> str:
        """Return a step's result: a column, a number, or an expression."""
        step, known = self.steps[place], self.still[place]
        if isinstance(known, float):
            return self.query.number(known)
        if step.operation == "input":
            return self._inputs[step.name]
        if place in self._columns:
            return self._columns[place]
        text = self.expression(step)
        is_call = step.operation in ("minimum", "maximum")
        return text if is_call else f"({text})"

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return the smaller or larger of two, or what is looked up in a table."""
        match step.operation:
            case "minimum":  # of two equal numbers the second one, 0.0 for -0.0
                return self.query.least(*reversed(operands))
            case "maximum":
                return self.query.greatest(*reversed(operands))
            case "below":
                cases = [
                    f"WHEN {operands[0]} <= {self.query.number(one)} THEN {count}e0"
                    for count, one in enumerate(step.table)
                ]
                return f"CASE {' '.join(cases)} ELSE {len(step.table)}e0 END"
            case _:
                numbers = enumerate(map(self.query.number, step.table))
                cases = [f"WHEN {place}e0 THEN {one}" for place, one in numbers]
                return f"CASE {operands[0]} {' '.join(cases)} END"


FORMAT = Format(
    name="sql",
    suffixes=(".sql",),
    carries=("tree", "rules"),
    write=write,
    cannot=(
        "an sql file runs, but is not read back as a tree or rule base",
        f"more than {MOST_RULES} rules: engines allow so many columns in a query",
        "overflow and underflow in PostgreSQL: it raises an error there",
    ),
    dtype="float64",
)

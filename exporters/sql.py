"""SQL: a model as one query, which answers every row of a table.

A rule base or fuzzy system is written as its program, which performs the reference's
operations on doubles in the reference's order, in steps: each is a common table
expression, so a person can follow it. What is computed for each of many samples has as
many columns. A tree is nested `CASE`.
"""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, get_args

from fuzzytree.errors import LossError, MissingExtraError
from fuzzytree.exporters.program_text import (
    INFERENCE,
    rated_rules,
    source_of,
    title_of,
)
from fuzzytree.exporters.sql_reach import LARGEST
from fuzzytree.exporters.sql_steps import REMEDY, SqlSteps
from fuzzytree.exporters.sql_text import LIMITS, TRANSLATED, Dialect, Query
from fuzzytree.model import (
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Node,
    RuleBase,
    Written,
    sentence,
)
from fuzzytree.semantics import (
    Program,
    from_axes,
    from_rules,
    from_system,
    unrolled,
)

MOST_LEVELS = 100
"""How deep CASE may be nested; SQLite and DuckDB take 1,000 levels of an expression."""


def write(
    model: Document,
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

    The query gives, for each row of the table, the columns kept; of a tree or rule base
    then `class` (NULL for no class), `rule` (the number of the winning rule or leaf, 0
    for none) and `status` (0 decided, 1 tie, 2 uncovered, 3 missing); of a fuzzy system
    a column for each output by its name (NULL for NaN) and `status`. NULL, NaN and
    infinities are missing.

    Args:
        model: A tree, a rule base or a fuzzy system.
        allow_loss: Of no effect: nothing is lost.
        dialect: `sqlite`, `duckdb`, `postgresql` or `spark`; or `bigquery`,
            `snowflake`, `tsql`, `clickhouse` or `trino`, translated by sqlglot from the
            query for PostgreSQL.
        table: The name of the table or view; its columns are named as the inputs.
        keep: Columns of the table to give beside the answer, such as its key; the
            inputs unless given.
        strengths: Whether to give the strength of each rule as well; of a system its
            activation.
        probabilities: Whether to give the probability of each class as well, in the
            order of the classes; the rule base must have them.

    Raises:
        LossError: If the query is beyond what the engine takes.
        MissingExtraError: If sqlglot is needed and not installed.
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
    dialects = get_args(Dialect)
    if dialect not in dialects:
        raise ValueError(
            f"sql has no dialect {dialect!r}; there is {', '.join(dialects)}"
        )
    if not table:
        raise ValueError("table: must name a table or a view, not ''")
    if probabilities:
        rated_rules(model, "sql")
    names = (keep,) if isinstance(keep, str) else tuple(keep)
    query = Query(dialect, table, names or model.inputs)
    match model:
        case FuzzyTree() if strengths:
            raise ValueError("sql: a tree has no strengths; its rules have")
        case FuzzyTree():
            _refuse_deep(model)
            lines = _tree(query, model)
        case RuleBase():
            program = from_rules(model, probabilities=probabilities)
            wanted = {"strength": strengths, "probability": probabilities}
            kinds = ("class", "rule", "status", *(k for k in wanted if wanted[k]))
            comments = _sentences(program, model)
            lines = _program(query, model, program, kinds, comments)
        case FuzzySystem():
            program = unrolled(from_system(model, activations=strengths))
            lines = _program(query, model, program, INFERENCE, {})
    text = "\n".join([*lines, ""])
    if query.is_translated:
        text = _translated(text, dialect)
    text = "\n".join([*_heading(model, dialect, source), text])
    limit, length = LIMITS[dialect], len(text.encode("utf-8"))
    if length > limit.length:
        raise LossError(
            f"cannot write {model.name} as sql for {dialect}: it has {length:,} bytes, "
            f"and {limit.engine} takes {limit.length:,}; {REMEDY}"
        )
    remark = f"{limit.engine} did not execute it: {_UNTRIED}"
    remarks = (remark,) if query.is_translated else ()
    return Written(text.encode("utf-8"), remarks=remarks)


_UNTRIED = "sqlglot translated and parsed the query for PostgreSQL, which is tested"


def _translated(text: str, dialect: Dialect) -> str:
    try:
        sqlglot: Any = importlib.import_module("sqlglot")
    except ImportError as error:
        purpose = f"writing SQL of the dialect {dialect} needs the extra 'sql'"
        raise MissingExtraError(f"{purpose}, which is not installed") from error
    (query,) = sqlglot.transpile(text, read="postgres", write=dialect, pretty=True)
    return f"{query}\n"


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


def _heading(model: Document, dialect: Dialect, source: str) -> Iterator[str]:
    yield f"-- {title_of(model, repr(model.name))}, in SQL for {dialect}."
    yield f"-- Written by fuzzytree. Fingerprint: {source}"
    if dialect in TRANSLATED:
        yield f"-- Not executed by fuzzytree: {_UNTRIED}."
    if model.outputs:
        yield f"-- Outputs: {', '.join(repr(one.name) for one in model.outputs)}"
    else:
        yield f"-- Classes: {', '.join(map(repr, model.classes))}"
    yield "-- status: 0 decided, 1 tie, 2 uncovered, 3 missing"


def _listed(lines: Iterable[str]) -> str:
    return ",\n".join(f"  {line}" for line in lines)


def _columns(query: Query, model: Document) -> Iterator[str]:
    """Yield the first query: what is kept, and the inputs as doubles."""
    inputs = [one for one in model.variables if not one.parts]
    kept = [f"{query.name(n)} AS kept_{k}" for k, n in enumerate(query.keep, 1)]
    kept += [f"{query.column(one)} AS x_{k}" for k, one in enumerate(inputs, 1)]
    yield "WITH"
    yield query.step("columns")
    yield f"  SELECT\n{_listed(kept or ['1 AS x_0'])}"
    yield f"  FROM {query.name(query.table)}\n),"


def _queries(query: Query, model: Document, steps: SqlSteps) -> Iterator[str]:
    """Yield the queries of a program, without the comma behind them."""
    kept = [f"kept_{k}" for k in range(1, len(query.keep) + 1)]
    text = "\n".join([*_columns(query, model), *steps.queries(kept)])
    yield text.removesuffix(",")


def _last(query: Query, results: Iterable[tuple[str, str]], source: str) -> str:
    """Return the last query: what is kept, and the results by name."""
    shown = [f"kept_{k} AS {query.name(n)}" for k, n in enumerate(query.keep, 1)]
    shown += [f"{text} AS {query.name(name)}" for name, text in results]
    return f"SELECT\n{_listed(shown)}\nFROM {source}"


def _program(
    query: Query,
    model: Document,
    program: Program,
    kinds: Sequence[str],
    comments: Mapping[int, str],
) -> Iterator[str]:
    """Yield the queries of a program whose results are named after their kind."""
    results = [one for kind in kinds for one in program.results if one.kind == kind]
    steps = SqlSteps(query, program, [one.step for one in results], comments)
    classes = enumerate(model.classes)
    ends = [f"WHEN {k}e0 THEN {query.text(name)}" for k, name in classes]

    def named() -> Iterator[tuple[str, str]]:
        counts: Counter[str] = Counter()
        for one in results:
            text = steps.value(one.step)
            counts[one.kind] += 1
            match one.kind:
                case "output":
                    yield one.name, text
                case "class":
                    yield "class", "\n    ".join([f"CASE {text}", *ends, "END"])
                case "rule" | "status":
                    yield one.kind, f"CAST({text} AS INTEGER)"
                case kind:
                    yield f"{kind}_{counts[kind]}", text

    yield from _queries(query, model, steps)
    steps.check_columns(len(query.keep) + len(results))
    yield _last(query, named(), steps.name_of(len(steps.levels)))


def _sentences(program: Program, rules: RuleBase) -> dict[int, str]:
    """Return each rule by the step of its strength."""
    # What is shown is the strength where all values are known, else NaN.
    shown = [program.steps[place].arguments for place in program.of("strength")]
    places = [one[1] if len(one) == 3 else -1 for one in shown]
    return dict(zip(places, map(sentence, rules.rules), strict=True))


def _tree(query: Query, tree: FuzzyTree) -> Iterator[str]:
    program = from_axes(tree)
    places = {one.name: one.step for one in program.results}
    steps = SqlSteps(
        query, program, [*places.values()], {p: n for n, p in places.items()}
    )
    axes = {name: steps.value(place) for name, place in places.items()}

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
        test = f"{axes[node.variable]} <= {query.number(node.cuts[middle])}"
        below = halves(node, low, middle, level + 1)
        above = halves(node, middle + 1, high, level + 1)
        return (
            f"{pad}CASE WHEN {test} THEN -- {node.variable!r}\n{below}\n"
            f"{pad}ELSE\n{above}\n{pad}END"
        )

    root = tree.nodes[0] if tree.nodes else None
    leaf = "1" if root is None else halves(root, 0, len(root.cuts), 1)
    finite = [f"{axis} BETWEEN -{LARGEST} AND {LARGEST}" for axis in axes.values()]
    test = " AND\n    ".join(finite) or "1 = 1"
    yield from _queries(query, tree, steps)
    yield ","
    yield query.step("answers")
    kept = "".join(f"kept_{k}, " for k in range(1, len(query.keep) + 1))
    yield f"  SELECT {kept}CASE WHEN {test} THEN\n{leaf}\n  ELSE 0 END AS leaf"
    yield f"  FROM {steps.name_of(len(steps.levels))}\n)"
    ends = [query.text(tree.semantics.missing)]
    ends += [query.text(one.label) for one in tree.leaves]
    cases = [f"WHEN {number} THEN {label}" for number, label in enumerate(ends)]
    results = (
        ("class", "\n    ".join(["CASE leaf", *cases, "END"])),
        ("rule", "leaf"),
        ("status", "CASE WHEN leaf = 0 THEN 3 ELSE 0 END"),
    )
    yield _last(query, results, "answers")


FORMAT = Format(
    name="sql",
    suffixes=(".sql",),
    write=write,
    cannot=(
        "an sql file runs, but is not read back as a model",
        "more columns in a step, or bytes, than the engine takes by its documentation",
        "remainders in formulas, but in the dialects sqlite, duckdb and spark",
        f"the dialects {', '.join(sorted(TRANSLATED))} are not executed here",
    ),
    dtype="float64",
)

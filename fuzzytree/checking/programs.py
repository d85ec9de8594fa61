"""Programs that were written of a model: their text, and then their answers.

To run a file is to execute what stands in it. So a program runs only if its text is
what this version writes of the model, or if the user says so.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple, cast

import msgspec
import numpy as np

from fuzzytree.checking.comparing import (
    OTHER_FUNCTION,
    FileAnswers,
    Finding,
    RowSet,
    compare_file,
    counted,
    file_content,
    judged,
    native_base,
)
from fuzzytree.errors import FuzzyTreeError, MissingExtraError
from fuzzytree.exporters import find_format, stated_options
from fuzzytree.model import (
    Comparison,
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Kind,
    Model,
    RuleBase,
    Written,
    option_value,
)
from fuzzytree.runtimes import ENGINES, Options
from fuzzytree.semantics import as_rules, forms, rules_from_tree

_MOST_ROWS: Final = 2_000  # that a program answers
_LONGEST: Final = 80  # characters of a line


class ProgramFile(msgspec.Struct, frozen=True):
    """A file that is run and not read back.

    Attributes:
        format: The name of its format.
        content: The file.
        may_run: Whether it runs whatever its text is.
    """

    format: str
    content: bytes
    may_run: bool = False


class _Text(NamedTuple):
    """What this version writes of a form of a model.

    Attributes:
        form: The form.
        options: The writer's.
        lines: The text.
    """

    form: Document
    options: Options
    lines: list[bytes]


def check_program(
    title: str, program: ProgramFile, model: Document, rows: RowSet, terms: Kind
) -> Iterator[Finding]:
    """Compare a program with what is written now; run it if they are equal.

    Raw rules of a tree are not run unless `terms` wants them.

    Raises:
        MissingExtraError: If an engine is missing.
    """
    form = find_format(program.format)
    lines = program.content.splitlines(keepends=True)
    try:
        stated = stated_options(program.content).items()
        options = {name: option_value(form, name, text) for name, text in stated}
        nearest = _nearest(form, model, lines, options)
    except ValueError as error:
        fault = f"the model cannot be written as {form.name}: {error}"
        yield counted("file", title, "a freshly written file", 1, (fault,))
        return
    yield file_content(title, nearest.form, options.get("dtype", "float64"))
    is_raw = isinstance(nearest.form, RuleBase) and nearest.form.kind == "raw"
    if is_raw and isinstance(model, FuzzyTree) and terms != "raw":
        yield judged(title, "a freshly written file", (OTHER_FUNCTION,), ())
        return
    faults = tuple(_faults(nearest.lines, lines))
    why = _why_not(nearest, form)
    results: list[Comparison] = []
    if not faults or program.may_run:
        if why is None:
            results = [*_run(title, program, nearest, rows)]
        else:
            yield f"{title}: its answers: {why}"
    elif why is None:
        yield f"{title}: its answers: only --run-code runs a file with another text"
    yield judged(title, "a freshly written file", faults, results)
    yield from results


def _nearest(
    form: Format, model: Document, lines: list[bytes], options: Options
) -> _Text:
    """Return the text that a file equals, or else that shares the most first lines.

    Raises:
        ValueError: If nothing can be written with the options.
    """
    write = cast("Callable[..., Written]", form.write)  # the options are its own
    best, most = None, -1
    fault = ValueError("its numbers are no class of rules")
    for document in _documents(model, form):
        try:
            written = write(document, allow_loss=True, **options)
        except ValueError as error:
            fault = error
            continue
        text = written.content.splitlines(keepends=True)
        same = (one == two for one, two in zip(text, lines, strict=False))
        shared = sum(1 for _ in itertools.takewhile(bool, same))
        if text == lines:
            return _Text(document, options, text)
        if shared > most:
            best, most = _Text(document, options, text), shared
    if best is None:
        raise fault
    return best


def _documents(model: Document, form: Format) -> Iterator[Document]:
    """Yield what a file may have been written of: a model, or rules made from it."""
    if isinstance(model, FuzzySystem):
        if "system" in form.carries:
            yield model
        elif (rules := as_rules(model)) is not None:
            yield rules
        return
    yield from forms(model).values()
    if isinstance(model, FuzzyTree):
        own = model.semantics.conjunction
        for kind in ("relative", "raw") if model.sets else ("relative",):
            for conjunction in ("minimum", "product"):
                if conjunction != own:
                    yield rules_from_tree(model, kind, conjunction=conjunction)


def _faults(right: list[bytes], lines: list[bytes]) -> Iterator[str]:
    """Yield the first line that differs."""
    for number, (one, two) in enumerate(
        itertools.zip_longest(right, lines, fillvalue=b""), 1
    ):
        if one != two:
            yield f"line {number}: {_shown(two)} where {_shown(one)} is right"
            return


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", "replace").rstrip("\n")
    return repr(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...")


def _why_not(text: _Text, form: Format) -> str | None:
    """Return why no engine runs a program here; None if one does."""
    if isinstance(text.form, FuzzySystem):
        return f"programs of fuzzy systems in {form.name} are compared by their text"
    if form.name not in ENGINES:
        return f"no engine for {form.name} is known here"
    dialect = text.options.get("dialect", "sqlite")
    if dialect not in ("sqlite", "duckdb"):
        return f"no engine for SQL of the dialect {dialect} is known here"
    if text.options.get("module") == "script":
        return "only JavaScript modules are run"
    if text.options.get("keep"):
        return "a query runs here if it gives the inputs, and no other columns"
    if text.options.get("curves") == "points":
        return "PMML whose curves became points is another function"
    return None


def _run(
    title: str, program: ProgramFile, text: _Text, rows: RowSet
) -> Iterator[Comparison]:
    """Run a program, and compare its answers with those of the form it was made of."""
    model = cast("Model", text.form)  # no system: see `_why_not`
    if program.format == "sql":
        rows = _table_rows(model, rows)
    some = rows.part(slice(None, None, -(-len(rows.numbers) // _MOST_ROWS)))
    is_single = text.options.get("dtype") == "float32"
    base = native_base(model, "float32" if is_single else "float64", some)
    try:
        result = ENGINES[program.format](
            program.content, model, text.options, some.values
        )
    except MissingExtraError as error:
        raise MissingExtraError(f"{title}: {error}") from error
    except (FuzzyTreeError, ValueError, LookupError) as error:
        faults = ("; ".join(str(error).splitlines()),)
        yield counted("rows", title, "the model", len(some.numbers), faults)
        return
    yield from compare_file(
        title,
        FileAnswers(result.outcome, result.labels, result.has_status),
        base,
        some,
        is_float32=is_single,
        origin="equal but within float32",
    )


def _table_rows(model: Model, rows: RowSet) -> RowSet:
    """Return rows as a table of SQL can hold them: of categories those with a name."""
    values = rows.values.copy()
    inputs = [variable for variable in model.variables if not variable.parts]
    for line, variable in enumerate(inputs):
        if variable.categories:
            places = np.rint(values[line])
            values[line] = np.clip(places, 0, len(variable.categories) - 1)
    return msgspec.structs.replace(rows, values=values)

"""Output of the verbs: results on stdout, messages on stderr; shared options."""

from __future__ import annotations

import contextlib
import functools
import glob
import itertools
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import click
import msgspec

from fuzzytree.errors import FuzzyTreeError, TableError
from fuzzytree.files import check_places
from fuzzytree.model import (
    ModelPath,
    as_names,
    printable,
    printable_json,
    printable_lines,
)

if TYPE_CHECKING:
    from rich.progress import Progress

    from fuzzytree.table_format import TableFormat

Name = TypeVar("Name", str, str | None)
Record = TypeVar("Record")
Code = TypeVar("Code", int, None, int | None)

_PATIENCE_S = 0.5  # before a bar appears
_MOST_LINES = 8  # of a list on stderr, unless all are printed


def option(
    words: str,
    help: str,
    choices: Sequence[str] = (),
    *,
    default: Any = None,
    **about: Any,
) -> Any:
    """Return an option of a verb, to be the attribute of a class of options.

    Args:
        words: Its names and what stands for its value, such as `-o --output FILE`.
        help: What it is.
        choices: What its value can be, if not anything.
        default: Its value where it is not named; the help shows it.
        about: As `click.option` takes it.
    """
    *names, last = words.split()
    if last.startswith("-"):
        names.append(last)
    else:
        about["metavar"] = last
    if choices:
        about["type"] = click.Choice(choices)
    if default is not None:
        about |= {"default": default, "show_default": True}
    return functools.partial(click.option, *names, help=help, **about)


def flag(words: str, help: str, **about: Any) -> Any:
    """Return an option of a verb that is on where it is named."""
    return option(words, help, is_flag=True, **about)


def several(words: str, help: str, **about: Any) -> Any:
    """Return an option of a verb that may be named more than once."""
    return option(words, help, multiple=True, **about)


def argument(metavar: str, **about: Any) -> Any:
    """Return an argument of a verb, to be the attribute of a class of options."""
    return functools.partial(click.argument, metavar=metavar, **about)


def model_argument(metavar: str = "MODEL") -> Any:
    """Return the argument of a model's file, and the option `--from` of its format."""
    return functools.partial(_with_format, metavar=metavar)


def _with_format(name: str, *, metavar: str) -> Callable[[Any], Any]:
    text = "Format of the model, and perhaps whose meaning counts, such as fll or "
    text += "fcl:jfuzzylogic; from its suffix by default."
    read_as = option("--from FORMAT", text, is_eager=True)("read_as")
    model = click.argument(name, metavar=metavar, callback=_model_path)
    return lambda verb: read_as(model(verb))


def _model_path(context: click.Context, _parameter: object, path: str) -> ModelPath:
    from fuzzytree.checking import reading_format

    result = ModelPath(path, context.params["read_as"])
    if result.read_as is not None:
        with wrong_options():
            reading_format(result.read_as)
    return result


OUTPUT = click.Path(readable=False)
"""The type of an option or an argument that names a file to write."""

output_option = functools.partial(option, type=OUTPUT)

_INPUTS = ("TABLE", "MODEL", "FILE", "FRAMES")  # of options that name files to read


def takes(
    record: type[Record],
) -> Callable[[Callable[[Record], Code]], Callable[..., Code]]:
    """Give a command the options that a class has as attributes, as one object.

    Attributes of a base class come last. `Sections` prints the options of a class
    below its attribute `heading`. Files to write that the command reads as well, or
    that cannot be written, are refused before it runs.

    Example:
        >>> class Words:
        ...     text: str = argument("TEXT")
        ...     times: int = option("--times NUMBER", "How often.", default=1)
        >>> @click.command()
        ... @takes(Words)
        ... def repeat(options: Words) -> None:
        ...     print(options.text * options.times)
        >>> repeat.main(["ab", "--times", "2"], standalone_mode=False)
        abab
    """

    def decorate(function: Callable[[Record], Code]) -> Callable[..., Code]:
        parameters: list[tuple[str, functools.partial[Any], str]] = [
            (name, parameter, getattr(base, "heading", "Options"))
            for base in record.__mro__
            for name, parameter in vars(base).items()
            if isinstance(parameter, functools.partial)
        ]
        outputs = {n for n, one, _ in parameters if one.keywords.get("type") is OUTPUT}
        inputs = {
            name
            for name, one, _ in parameters
            if one.func in (click.argument, _with_format)
            or one.keywords.get("metavar") in _INPUTS
        }

        @functools.wraps(function)
        def command(**values: Any) -> Code:
            if written := _texts(values, outputs):
                others = _texts(values, inputs - outputs)
                check_places(written, itertools.chain(*map(_files, others)))
            options = record()
            vars(options).update(values)
            return function(options)

        for name, parameter, _ in reversed(parameters):
            parameter(name)(command)
        vars(command)["headings"] = {name: title for name, _, title in parameters}
        return command

    return decorate


class Sections(click.Command):
    """A command whose help has its options in sections."""

    def format_options(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the options, below the headings of the classes they come from."""
        headings = vars(self.callback)["headings"]
        sections: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            line = parameter.get_help_record(ctx)
            if line is not None and isinstance(parameter, click.Option):
                title = headings.get(parameter.name, ResultOptions.heading)
                sections.setdefault(title, []).append(line)
        for title, lines in sections.items():
            with formatter.section(title):
                formatter.write_dl(lines)


def _texts(values: Mapping[str, Any], names: Iterable[str]) -> list[str]:
    """Return what the user wrote for some parameters, but `-`."""
    rows = [as_names(values[name] or ()) for name in names]
    return [text for row in rows for text in row if text not in ("", "-")]


def _files(text: str) -> list[str]:
    """Return the files that an argument stands for."""
    if Path(text).is_dir() or glob.has_magic(text):
        from fuzzytree.tables import files_of

        with contextlib.suppress(TableError, OSError):
            return files_of(text)
    return [text, text.rpartition("=")[2]]  # as in CLASS=FILE


verbose_option = flag("--verbose", "Print every part of the result, not only counts.")
json_option = flag("--json", "Print the whole result as JSON to stdout.")
quiet_option = flag("--quiet", "Print errors only.")


class ResultOptions:
    """The options of a verb that has a result; they stand last in its help."""

    heading: str = "Output"
    as_json: bool = json_option
    quiet: bool = quiet_option


class FullResultOptions(ResultOptions):
    """The options of a verb whose result is shortened unless all of it is wanted."""

    verbose: bool = verbose_option


class TableOptions:
    """The options of a verb that reads a table: how it is written."""

    heading: str = "Table"
    delimiter: str | None = option(
        "--delimiter CHARACTER",
        "Character between the cells of a CSV file; by default from its first line.",
    )
    decimal: str | None = option(
        "--decimal CHARACTER", "What stands before decimals: `.`, the default, or `,`."
    )
    thousands: str | None = option(
        "--thousands CHARACTER", "What groups digits: `,` `.` `'` or a blank."
    )
    percent: bool = flag("--percent", "Read 104% as the number 1.04.")
    encoding: str | None = option(
        "--encoding NAME",
        "Encoding of a CSV file; by default UTF-8, or what its mark says.",
    )
    no_header: bool = flag(
        "--no-header", "Read the first row as data too; the columns are `column 1`, ..."
    )
    sheet: str | None = option("--sheet NAME", "Sheet of an Excel file to read.")


ignore_option = several("--ignore COLUMN", "Column that is no input (repeat).")

categorical_option = several(
    "--categorical COLUMN",
    "Column whose cells are all categories, numbers too (repeat).",
)

rows_per_class_option = option(
    "--rows-per-class",
    "Largest number of rows per class that the learner keeps; by default 20,000, or "
    "fewer of many columns and classes.",
    type=click.IntRange(min=1),
)

missing_option = option(
    "--missing",
    "Missing values: learn what stands for them, drop the rows, or refuse the table.",
    choices=["learn", "drop", "refuse"],
)

allow_loss_option = flag(
    "--allow-loss",
    "Read a file that a model cannot represent exactly, with the nearest values.",
)

rows_only_option = flag(
    "--rows-only", "Accept a file that predicts the same although its content differs."
)

data_option = option("--data TABLE", "Table of rows to use beside the generated rows.")
runtimes_option = several(
    "--runtime NAME", "Runtime to use (repeat); all installed runtimes by default."
)


def say(text: str, *, quiet: bool = False) -> None:
    """Write lines to stderr; what a terminal might obey is written as an escape."""
    if not quiet:
        click.echo(printable_lines(text), err=True)


def say_rows(*rows: tuple[str, str, str], width: int = 0, quiet: bool = False) -> None:
    """Write lines of a verb, a thing and what is known of it, aligned."""
    width = max([width, *(len(thing) for _, thing, facts in rows if facts)])
    lead = max([8, *(len(verb) for verb, _, _ in rows)])
    for verb, thing, facts in rows:
        say(f"{verb:{lead}} {thing:{width}} {facts}".rstrip(), quiet=quiet)


def say_first(
    lines: Sequence[str], *, verbose: bool = False, quiet: bool = False
) -> None:
    """Write the first lines of a list to stderr, and how many more there are."""
    shown = lines if verbose else lines[:_MOST_LINES]
    for line in shown:
        say(line, quiet=quiet)
    if len(shown) < len(lines):
        rest = len(lines) - len(shown)
        say(f"         and {rest} more; --verbose lists all", quiet=quiet)


def answer(text: str) -> None:
    """Write lines to stdout; what a terminal might obey is written as an escape."""
    click.echo(printable_lines(text))


def answer_result(
    facts: Callable[[], str], lines: Iterable[str], *, as_json: bool, is_silent: bool
) -> None:
    """Write a result to stdout: as lines, or as JSON with its verdict on stderr.

    Args:
        facts: Returns the result as JSON.
        lines: The result for people; the first line is the verdict.
        as_json: Which of the two to write.
        is_silent: Whether the verdict beside JSON is left out.
    """
    if as_json:
        answer_json(facts())
        say(next(iter(lines)), quiet=is_silent)
    else:
        answer("\n".join(lines))


def answer_styled(text: str) -> None:
    """Write a text to stdout with its colours; what it quotes is printable already."""
    click.echo(text)


def answer_json(facts: object) -> None:
    """Write facts to stdout as indented JSON.

    Args:
        facts: Anything that JSON can hold; a text is JSON already.
    """
    if not isinstance(facts, str):
        facts = msgspec.json.format(msgspec.json.encode(facts), indent=2).decode()
    click.echo(printable_json(facts))


def answer_bytes(content: bytes) -> None:
    """Write bytes to stdout."""
    sys.stdout.flush()
    sys.stdout.buffer.write(content)
    sys.stdout.buffer.flush()


def table_format(options: TableOptions) -> TableFormat:
    """Return how a table is written.

    Raises:
        click.UsageError: If no table is written so.
    """
    from fuzzytree.table_format import TableFormat

    values = {name: vars(options).get(name) for name in TableFormat.__struct_fields__}
    values["header"] = not options.no_header
    with wrong_options():
        return TableFormat(**{k: one for k, one in values.items() if one is not None})


def table_source(
    name: object, options: TableOptions, categorical: Sequence[str] = ()
) -> object:
    """Return where to read a table, None without one; `-` is standard input."""
    if name is None:
        return None
    from fuzzytree.tables import table

    source = standard_input() if name == "-" else name
    return table(source, format=table_format(options), categorical=categorical)


def standard_input() -> BinaryIO:
    """Return standard input, if something comes from it.

    Raises:
        click.UsageError: If it is a terminal.
    """
    if sys.stdin.buffer.isatty():
        raise click.UsageError(
            "`-` reads standard input, which is a terminal; name a file, or pipe one in"
        )
    return sys.stdin.buffer


def setting(text: str, option: str = "--set") -> tuple[str, str]:
    """Return the name and the value of a `--set`, or of an option like it.

    Raises:
        click.UsageError: If it is none.

    Example:
        >>> setting("load-ohm = 5")
        ('load_ohm', '5')
    """
    name, mark, value = text.partition("=")
    if not mark or not name.strip():
        raise click.UsageError(f"{option} {text}: must be NAME=VALUE")
    return name.strip().replace("-", "_"), value.strip()


@contextlib.contextmanager
def wrong_options() -> Generator[None]:
    """Report a value that an option cannot have as a usage error."""
    try:
        yield
    except ValueError as error:
        if isinstance(error, FuzzyTreeError):
            raise
        raise click.UsageError(str(error)) from error


@contextlib.contextmanager
def progress_bar(
    *, quiet: bool = False
) -> Generator[Callable[[str, float | None], None]]:
    """Give a function that shows the current work and its share in [0, 1], if known.

    A bar appears on stderr, only on a terminal, and only after half a second, also
    where one piece of work takes longer.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda _text, _share: None
        return
    begin = time.monotonic()
    bars: list[Progress] = []
    work: list[tuple[str, float | None]] = []
    lock = threading.Lock()

    def draw() -> None:
        with lock:
            if not work:  # none yet, or the end
                return
            if not bars:
                from rich.console import Console
                from rich.progress import Progress

                bars.append(Progress(console=Console(stderr=True), transient=True))
                bars[0].add_task("", total=1.0)
                bars[0].start()
            text, share = work[-1]
            shown = printable(text).replace("[", r"\[")  # what rich takes for a style
            task = bars[0].tasks[0]
            task.total = None if share is None else 1.0
            bars[0].update(task.id, description=shown, completed=share or 0.0)

    def show(text: str, share: float | None) -> None:
        work[:] = [(text, share)]
        if bars or time.monotonic() - begin >= _PATIENCE_S:
            draw()

    timer = threading.Timer(_PATIENCE_S, draw)
    timer.daemon = True
    timer.start()
    try:
        yield show
    finally:
        timer.cancel()
        with lock:
            work.clear()
            for bar in bars:
                bar.stop()

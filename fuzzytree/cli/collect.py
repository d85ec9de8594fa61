"""`fuzzytree collect`: what learning needs of a part of a table, as a file."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import click

from fuzzytree.cli.console import (
    answer_json,
    argument,
    delimiter_option,
    json_option,
    option,
    progress_bar,
    quiet_option,
    say_rows,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.files import check_places

STATE = ".state"
"""How the name of a state's file ends."""


class CollectOptions:
    """The arguments and options of the verb."""

    parts: Sequence[str] = argument(metavar="PART...", nargs=-1, required=True)
    target: str = option(
        "--target",
        required=True,
        metavar="COLUMN",
        help="Column that holds the class of each row.",
    )
    output: str = option(
        "-o", "--output", required=True, metavar="FILE.state", help="File to write."
    )
    columns: str | None = option(
        "--columns",
        metavar="NAMES",
        help="Columns to learn from, separated by commas; all of the first PART by "
        "default.",
    )
    ignore: Sequence[str] = option(
        "--ignore",
        metavar="COLUMN",
        multiple=True,
        help="Column that is no input (repeat).",
    )
    rows_per_class: int | None = option(
        "--rows-per-class",
        type=click.IntRange(min=1),
        help="Largest number of rows per class that the learner keeps.",
    )
    missing: str | None = option(
        "--missing",
        type=click.Choice(["drop", "refuse"]),
        help="Rows with missing values: drop them, or refuse the part.",
    )
    delimiter: str | None = delimiter_option
    as_json: bool = json_option
    quiet: bool = quiet_option


@click.command("collect", short_help="Collect what learning needs of parts of a table.")
@takes(CollectOptions)
def command(options: CollectOptions) -> None:
    """Collect what learning needs of the rows of each PART, in one file.

    PART is a table as `learn` reads it. Collect where the parts lie; `fuzzytree learn`
    takes the files of all parts, in any order, and learns the tree of the whole table.
    The file's size depends on columns and classes, and not on rows.
    """
    from fuzzytree.learning import Learner, LearningSettings

    check_places([options.output], options.parts)
    if Path(options.output).suffix != STATE:
        raise click.UsageError(f"-o {options.output}: the name must end in {STATE}")
    given = {"rows_per_class": options.rows_per_class, "missing": options.missing}
    chosen = {name: value for name, value in given.items() if value is not None}
    names = None if options.columns is None else options.columns.split(",")
    learner = Learner(
        options.target,
        columns=names,
        ignore=options.ignore,
        settings=LearningSettings(**chosen),  # type: ignore[arg-type]  # click checked
    )
    if twice := sorted(one for one, n in Counter(options.parts).items() if n > 1):
        raise click.UsageError(f"{twice[0]} is named more than once")
    begin = time.perf_counter()
    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        for part in options.parts:
            title = "standard input" if part == "-" else None
            source = table_source(part, options.delimiter)
            learner.update(source, name=title, progress=show)
        digest = learner.save(options.output)
    seconds = time.perf_counter() - begin
    facts = learner.facts()
    rows = f"{learner.rows:,} rows"
    said = f"{facts['columns']} columns, {facts['classes']} classes, {seconds:.2f} s"
    lost = [
        ("left out", f"{count:,} rows", why)
        for count, why in (
            (learner.dropped, "a value is missing or not finite"),
            (learner.unlabelled, "they have no class"),
        )
        if count
    ]
    after = f"sha256 {digest[:16]}; next: fuzzytree learn {options.output} ... -o FILE"
    say_rows(
        ("collected", rows, said),
        *lost,
        ("wrote", options.output, after),
        quiet=options.quiet,
    )
    if options.as_json:
        answer_json({"file": options.output, "digest": digest, **facts})

"""`fuzzytree collect`: what learning needs of a part of a table, as a file."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    ResultOptions,
    TableOptions,
    answer_json,
    argument,
    categorical_option,
    ignore_option,
    missing_option,
    option,
    output_option,
    progress_bar,
    rows_per_class_option,
    say_rows,
    table_source,
    takes,
    wrong_options,
)

if TYPE_CHECKING:
    from fuzzytree.api import LeafCounts
    from fuzzytree.learning import Learner

STATE = ".state"
"""How the name of a state's file ends."""


class CollectOptions(TableOptions, ResultOptions):
    """The arguments and options of the verb."""

    parts: Sequence[str] = argument("PART...", nargs=-1, required=True)
    target: str = option(
        "--target COLUMN", "Column that holds the class of each row.", required=True
    )
    output: str = output_option(
        "-o --output FILE.state", "File to write.", required=True
    )
    model: str | None = option(
        "--for MODEL", "Count the rows in each leaf of a tree: the second pass."
    )
    columns: str | None = option(
        "--inputs NAMES",
        "Columns to learn from, separated by commas; all of the first PART by default.",
    )
    ignore: Sequence[str] = ignore_option
    categorical: Sequence[str] = categorical_option
    rows_per_class: int | None = rows_per_class_option
    missing: str | None = missing_option


@click.command("collect", short_help="Collect what learning needs of parts of a table.")
@takes(CollectOptions)
def command(options: CollectOptions) -> None:
    """Collect what learning needs of the rows of each PART, in one file.

    PART is a table as `learn` reads it. Collect where the parts lie; `fuzzytree learn`
    takes the files of all parts, in any order, and learns the tree of the whole table.
    The file's size depends on columns and classes, and not on rows.

    With --for, the rows that each leaf of MODEL predicts are counted by class, in a
    file for `fuzzytree learn --for MODEL`, which writes the exact supports of leaves
    and prints the accuracy on all rows.
    """
    if Path(options.output).suffix != STATE:
        raise click.UsageError(f"-o {options.output}: the name must end in {STATE}")
    if states := [one for one in options.parts if Path(one).suffix == STATE]:
        raise click.UsageError(
            f"{states[0]} is a state, and a part is a table; `fuzzytree learn` takes "
            "states"
        )
    if twice := sorted(one for one, n in Counter(options.parts).items() if n > 1):
        raise click.UsageError(f"{twice[0]} is named more than once")
    begin = time.perf_counter()
    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        learner = _learner(options) if options.model is None else _counts(options)
        for part in options.parts:
            title = "standard input" if part == "-" else None
            source = table_source(part, options)
            learner.update(source, name=title, progress=show)
        digest = learner.save(options.output)
    seconds = time.perf_counter() - begin
    facts = learner.facts()
    rows = f"{learner.rows:,} rows"
    said = f"{facts['columns']} columns, {facts['classes']} classes, {seconds:.2f} s"
    reasons = {
        "dropped": "with a value that is missing or not finite",
        "rows_without_class": "left out: they have no class",
        "ties": "decided by the order of the leaves",
        "no_rule": "with no rule fired",
        "missing": "with a missing input",
    }
    lost = [
        ("rows", f"{facts[name]:,} rows", why)
        for name, why in reasons.items()
        if facts.get(name)
    ]
    mode = "" if options.model is None else f" --for {options.model}"
    after = f"next: fuzzytree learn {options.output} ...{mode} -o FILE"
    say_rows(
        ("collected", rows, said),
        *lost,
        ("wrote", options.output, f"sha256 {digest[:16]}; {after}"),
        quiet=options.quiet,
    )
    if options.as_json:
        answer_json({"file": options.output, "digest": digest, **facts})


def _learner(options: CollectOptions) -> Learner:
    """Return what collects for learning."""
    from fuzzytree.learning import Learner, LearningSettings

    values = {"rows_per_class": options.rows_per_class, "missing": options.missing}
    chosen = {name: value for name, value in values.items() if value is not None}
    return Learner(
        options.target,
        columns=None if options.columns is None else options.columns.split(","),
        ignore=options.ignore,
        categorical=options.categorical,
        settings=LearningSettings(**chosen),  # type: ignore[arg-type]  # click checked
    )


def _counts(options: CollectOptions) -> LeafCounts:
    """Return what counts for a model, which has its columns and settings."""
    from fuzzytree.api import LeafCounts

    for name in ("columns", "ignore", "categorical", "rows_per_class", "missing"):
        if getattr(options, name):
            raise click.UsageError(
                f"--{name.replace('_', '-')}: --for counts what the model needs"
            )
    return LeafCounts(str(options.model), options.target)

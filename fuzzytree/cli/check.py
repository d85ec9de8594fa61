"""`fuzzytree check`: compare all representations and files of a model."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.console import (
    allow_loss_option,
    answer_result,
    data_option,
    delimiter_option,
    json_option,
    progress_bar,
    quiet_option,
    rows_only_option,
    runtimes_option,
    table_source,
    verbose_option,
    wrong_options,
)


@click.command(
    "check", short_help="Compare a model with its rules, runtimes and files."
)
@click.argument("model", metavar="MODEL")
@click.argument("files", metavar="[FILES]...", nargs=-1)
@data_option
@runtimes_option
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    help="Largest number of probes; 20000 by default, 2000 for a fuzzy system.",
)
@click.option(
    "--rows",
    "is_full",
    is_flag=True,
    help="List rows that differ by an allowed amount, too.",
)
@delimiter_option
@rows_only_option
@click.option(
    "--run-code",
    is_flag=True,
    help="Run a program file although its text differs from a new one.",
)
@allow_loss_option
@verbose_option
@json_option
@quiet_option
def command(
    model: str,
    files: Sequence[str],
    data: str | None,
    runtimes: Sequence[str],
    limit: int | None,
    is_full: bool,
    delimiter: str | None,
    rows_only: bool,
    run_code: bool,
    allow_loss: bool,
    verbose: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Compare MODEL, any readable file, with FILES that were exported from it.

    The tree, its rules, each runtime and each file predict the same rows; so do a fuzzy
    system, each runtime and each file. Exit 1 if two of them disagree. A program (C,
    Python, JavaScript, SQL, PMML) runs only if its text equals a new export.
    """
    from fuzzytree import api, report
    from fuzzytree.model import CheckSettings

    with wrong_options(), progress_bar(quiet=quiet) as show:
        found = api.check(
            model,
            *files,
            data=table_source(data, delimiter),
            runtimes=runtimes or None,
            settings=CheckSettings(limit=limit, rows_only=rows_only, run_code=run_code),
            allow_loss=allow_loss,
            progress=show,
        )
    lines = report.agreement_lines(found, is_verbose=verbose, is_full=is_full)
    is_silent = quiet and found.ok
    answer_result(found.to_json, lines, as_json=as_json, is_silent=is_silent)
    return 0 if found.ok else 1

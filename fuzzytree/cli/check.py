"""`fuzzytree check`: compare all representations and files of a model."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    allow_loss_option,
    answer_result,
    argument,
    data_option,
    flag,
    model_argument,
    option,
    progress_bar,
    rows_only_option,
    runtimes_option,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.model import Kind, TreeAgreement


class CheckOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    files: Sequence[str] = argument("[FILES]...", nargs=-1)
    data: str | None = data_option
    runtimes: Sequence[str] = runtimes_option
    limit: int | None = option(
        "--generate N",
        "Most rows to generate; 20000 by default, 2000 for a fuzzy system.",
        type=click.IntRange(min=1),
    )
    rows_only: bool = rows_only_option
    run_code: bool = flag(
        "--run-code", "Run a program file although its text differs from a new one."
    )
    terms: Kind = option(
        "--terms",
        "Rules that a file may hold beside a tree: those that equal it, or the "
        "paper's too.",
        choices=["relative", "raw"],
        default="relative",
    )
    tolerance: float = option(
        "--tolerance",
        "Largest error of a degree where a file has points for a curve.",
        type=float,
        default=1e-6,
    )
    allow_loss: bool = allow_loss_option


@click.command(
    "check", short_help="Compare a model with its rules, runtimes and files."
)
@takes(CheckOptions)
def command(options: CheckOptions) -> int:
    """Compare MODEL, any readable file, with FILES that were exported from it.

    The tree, its rules, each runtime and each file predict the same rows; so do a fuzzy
    system, each runtime and each file. Exit 1 if two of them disagree. A program (C,
    Python, JavaScript, SQL, PMML) runs only if its text equals a new export.

    Two tree ensembles of other libraries (.skops, ONNX, XGBoost's JSON, LightGBM's
    text) are compared with each other: proved where they can be, run at and beside
    their cuts otherwise.
    """
    from fuzzytree import api, report

    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        found = api.check(
            options.model,
            *options.files,
            data=table_source(options.data, options),
            runtimes=options.runtimes or None,
            limit=options.limit,
            rows_only=options.rows_only,
            run_code=options.run_code,
            terms=options.terms,
            tolerance=options.tolerance,
            allow_loss=options.allow_loss,
            progress=show,
        )
    lines = (
        report.tree_lines(found, is_verbose=options.verbose)
        if isinstance(found, TreeAgreement)
        else report.agreement_lines(found, is_verbose=options.verbose)
    )
    is_silent = options.quiet and found.ok
    answer_result(found.to_json, lines, as_json=options.as_json, is_silent=is_silent)
    return 0 if found.ok else 1

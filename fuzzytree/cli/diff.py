"""`fuzzytree diff`: what has changed from one model to another."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.audit_options import limits_of
from fuzzytree.cli.console import (
    allow_loss_option,
    answer_result,
    delimiter_option,
    json_option,
    progress_bar,
    quiet_option,
    table_source,
    verbose_option,
    wrong_options,
)


@click.command(
    "diff",
    short_help="Compare two models: changed rules, and rows classified differently.",
)
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option(
    "--data", metavar="TABLE", help="Table of rows that both models classify."
)
@click.option(
    "--limits",
    metavar="NAME=LOW:HIGH",
    multiple=True,
    help="Range of values of an input to compare on (repeat).",
)
@click.option(
    "--budget",
    type=float,
    default=60.0,
    metavar="SECONDS",
    help="Time limit of the proofs in seconds; 60 by default.",
)
@delimiter_option
@allow_loss_option
@verbose_option
@json_option
@quiet_option
def command(
    old: str,
    new: str,
    data: str | None,
    limits: Sequence[str],
    budget: float,
    delimiter: str | None,
    allow_loss: bool,
    verbose: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Compare the model in NEW with the one in OLD, two files of any readable format.

    Rules and terms are matched by their content, not by their order. Decisions are
    proved equal, or a point is shown at which they differ. Exit 1 if a decision
    changes, or if programs that call the model must change.
    """
    from fuzzytree import api
    from fuzzytree.report import diff_lines

    with wrong_options(), progress_bar(quiet=quiet) as show:
        found = api.diff(
            old,
            new,
            data=table_source(data, delimiter),
            limits=limits_of(limits),
            budget_s=budget,
            allow_loss=allow_loss,
            progress=show,
        )
    is_silent = quiet and found.verdict == "equal" and found.ok
    lines = diff_lines(found, is_verbose=verbose)
    answer_result(found.to_json, lines, as_json=as_json, is_silent=is_silent)
    return 0 if found.ok else 1

"""`fuzzytree diff`: what has changed from one model to another, and who notices?"""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.audit_options import limits_of
from fuzzytree.cli.talk import (
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


@click.command("diff", short_help="What changed between two models, and who notices?")
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option("--data", metavar="TABLE", help="Rows of your own, answered by both.")
@click.option(
    "--limits",
    metavar="NAME=LOW:HIGH",
    multiple=True,
    help="Compare on these values of an input (repeat).",
)
@click.option(
    "--budget",
    type=float,
    default=60.0,
    metavar="SECONDS",
    help="Leave open what is not decided by then; 60.",
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
    """Compare the model in NEW with the one in OLD, in any formats that can be read.

    Rules and terms are told apart by what they say, and not by their order. Decisions
    are proved equal, or a point is shown at which they differ. Exit 1 if a decision
    changes, or another change breaks who calls the model.
    """
    from fuzzytree.api import verbs
    from fuzzytree.report.diff import diff_lines

    with wrong_options(), progress_bar(quiet=quiet) as tell:
        found = verbs.diff(
            old,
            new,
            data=table_source(data),
            delimiter=delimiter,
            limits=limits_of(limits),
            budget_s=budget,
            allow_loss=allow_loss,
            progress=tell,
        )
    is_silent = quiet and found.verdict == "equal" and found.ok
    lines = diff_lines(found, is_verbose=verbose)
    answer_result(found.to_json, lines, as_json=as_json, is_silent=is_silent)
    return 0 if found.ok else 1

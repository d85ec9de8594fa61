"""`fuzzytree diff`: what has changed from one model to another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from fuzzytree.cli.audit_options import limits_of
from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    allow_loss_option,
    answer_result,
    argument,
    model_argument,
    option,
    progress_bar,
    several,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.model import ModelPath


class DiffOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    old: ModelPath = model_argument("OLD")
    new: str = argument("NEW")
    data: str | None = option(
        "--data TABLE", "Table of rows that both models classify."
    )
    limits: Sequence[str] = several(
        "--limits NAME=LOW:HIGH",
        "Range, or NAME=CATEGORY,..., of an input to compare on (repeat).",
    )
    budget: float = option(
        "--budget STEPS", "Limit of the proofs in millions of steps.", default=60.0
    )
    allow_loss: bool = allow_loss_option


@click.command(
    "diff",
    short_help="Compare two models: changed rules, and rows classified differently.",
)
@takes(DiffOptions)
def command(options: DiffOptions) -> int:
    """Compare the model in NEW with the one in OLD, two files of any readable format.

    Rules and terms are matched by their content, not by their order. Decisions are
    proved equal, or a point is shown at which they differ. Exit 1 if a decision
    changes, or if programs that call the model must change. `--from` is for OLD, and
    for NEW if it has the same suffix.
    """
    from fuzzytree import api
    from fuzzytree.report import diff_lines

    is_alike = Path(options.new).suffix.lower() == Path(options.old).suffix.lower()
    new = ModelPath(options.new, options.old.read_as if is_alike else None)
    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        found = api.diff(
            options.old,
            new,
            data=table_source(options.data, options),
            limits=limits_of(options.limits),
            budget=options.budget,
            allow_loss=options.allow_loss,
            progress=show,
        )
    is_silent = options.quiet and found.verdict == "equal" and found.ok
    lines = diff_lines(found, is_verbose=options.verbose)
    answer_result(found.to_json, lines, as_json=options.as_json, is_silent=is_silent)
    return 0 if found.ok else 1

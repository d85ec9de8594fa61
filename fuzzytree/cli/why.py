"""`fuzzytree why`: why a model answers one row as it does, and what would change it."""

from __future__ import annotations

import click

from fuzzytree.cli.audit_options import limits_of, row_of, row_option
from fuzzytree.cli.console import (
    TableOptions,
    allow_loss_option,
    answer,
    answer_json,
    json_option,
    model_argument,
    option,
    several,
    table_source,
    takes,
    wrong_options,
)

_EXAMPLES = """\b
For example:
  fuzzytree why grip.yaml --row force=3,slip=0.2
  fuzzytree why wine.yaml --data wine.csv --number 17 --fixed alcohol
  fuzzytree why tipper.fll --row service=3,food=8
"""


class WhyOptions(TableOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    row: str | None = row_option
    data: str | None = option(
        "--data TABLE", "Table with the row to explain; `-` is standard input."
    )
    number: int = option(
        "--number N", "Number of the row in TABLE, from 1.", type=int, default=1
    )
    wanted: str | None = option(
        "--wanted CLASS", "Class that a change shall give; any other by default."
    )
    fixed: tuple[str, ...] = several("--fixed NAME", "Input that stays (repeat).")
    costs: str | None = option(
        "--costs NAME=NUMBER,...",
        "Costs of a change by 1, or of any change of a category; by default 1 for a "
        "whole range, and for a category.",
    )
    limits: tuple[str, ...] = several(
        "--limits NAME=LOW:HIGH",
        "Range, or NAME=CATEGORY,..., that a change may reach (repeat).",
    )
    as_json: bool = json_option
    allow_loss: bool = allow_loss_option


@click.command(
    "why", short_help="Explain the prediction for one row.", epilog=_EXAMPLES
)
@takes(WhyOptions)
def command(options: WhyOptions) -> None:
    """Explain why MODEL predicts what it predicts for one row: of --row, or of --data.

    The winning rule with its distance to each cut, the next rule, the smallest change
    of the inputs that gives another class, proved where it can be, what stands for
    missing values, and the training rows of the rule. Of a fuzzy system: the rules
    that fire, and the slope of each output in each input.
    """
    from fuzzytree import api
    from fuzzytree.report import why_lines

    cells = row_of(options.row)
    if (cells is None) == (options.data is None):
        raise click.UsageError("name one row: with --row, or with --data and --number")
    with wrong_options():
        result = api.why(
            options.model,
            table_source(options.data if cells is None else cells, options),
            number=options.number,
            wanted=options.wanted,
            fixed=options.fixed,
            costs=_costs(options.costs),
            limits=limits_of(options.limits),
            allow_loss=options.allow_loss,
        )
    if options.as_json:
        answer_json(result.to_json())
    else:
        answer("\n".join(why_lines(result)))


def _costs(text: str | None) -> dict[str, float]:
    words = row_of(text, "--costs") or {}
    try:
        return {name: float(cost) for name, cost in words.items()}
    except ValueError as error:
        must = "must be NAME=NUMBER,NAME=NUMBER,..."
        raise click.UsageError(f"--costs {text}: {must}") from error

"""`fuzzytree stability`: numerical stability, and the price of float32."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    answer_result,
    data_option,
    model_argument,
    progress_bar,
    runtimes_option,
    several,
    table_source,
    takes,
    wrong_options,
)


class StabilityOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    data: str | None = data_option
    select: Sequence[str] = several(
        "--select CODE", "Check to apply, such as N3 (repeat); all by default."
    )
    runtimes: Sequence[str] = runtimes_option


@click.command("stability", short_help="Check that a model is numerically stable.")
@takes(StabilityOptions)
def command(options: StabilityOptions) -> int:
    """Apply the stability checks N1 to N10 to MODEL, a tree, rules or a fuzzy system.

    They require equal bits in other units, orders and batches, exact edges, errors
    within the certified bounds, and curves that can be evaluated; the price of float32
    and how far answers move are reported for each input. Exit 1 if a check fails.
    """
    from fuzzytree import api
    from fuzzytree.report import stability_lines

    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        found = api.stability(
            options.model,
            data=table_source(options.data, options),
            select=options.select,
            runtimes=options.runtimes or None,
            progress=show,
        )
    is_failed = any(one.verdict == "FAILS" for one in found.criteria)
    lines = stability_lines(found, is_verbose=options.verbose)
    is_silent = options.quiet and not is_failed
    answer_result(found.to_json, lines, as_json=options.as_json, is_silent=is_silent)
    return int(is_failed)

"""`fuzzytree stability`: numerical stability, and the price of float32."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.console import (
    answer_result,
    data_option,
    delimiter_option,
    json_option,
    progress_bar,
    quiet_option,
    runtimes_option,
    table_source,
    verbose_option,
    wrong_options,
)


@click.command("stability", short_help="Check that a model is numerically stable.")
@click.argument("model", metavar="MODEL")
@data_option
@click.option(
    "--only",
    metavar="CODE",
    multiple=True,
    help="Check to apply, such as N3 (repeat); all by default.",
)
@runtimes_option
@click.option("--rows", "is_full", is_flag=True, help="The same as --verbose.")
@delimiter_option
@verbose_option
@json_option
@quiet_option
def command(
    model: str,
    data: str | None,
    only: Sequence[str],
    runtimes: Sequence[str],
    is_full: bool,
    delimiter: str | None,
    verbose: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Apply the stability checks N1 to N10 to MODEL, a YAML file.

    They require equal bits in other units, orders and batches, exact edges, errors
    within the certified bounds, and curves that can be evaluated; the price of float32
    is reported for each input. Exit 1 if a check fails.
    """
    from fuzzytree import api
    from fuzzytree.report import stability_lines

    with wrong_options(), progress_bar(quiet=quiet) as show:
        found = api.stability(
            model,
            data=table_source(data, delimiter),
            only=only,
            runtimes=runtimes or None,
            progress=show,
        )
    is_failed = any(one.verdict == "FAILS" for one in found.criteria)
    lines = stability_lines(found, is_verbose=verbose or is_full)
    is_silent = quiet and not is_failed
    answer_result(found.to_json, lines, as_json=as_json, is_silent=is_silent)
    return int(is_failed)

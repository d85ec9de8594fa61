"""`fuzzytree stability`: is a model numerically stable, and what would float32 cost?"""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.talk import (
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


@click.command("stability", short_help="Is a model numerically stable?")
@click.argument("model", metavar="MODEL")
@data_option
@click.option(
    "--only",
    metavar="CODE",
    multiple=True,
    help="Apply these criteria only, such as N3; all if none.",
)
@runtimes_option
@click.option(
    "--rows", "is_full", is_flag=True, help="Tell all that was left out, too."
)
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
    """Apply the criteria N1 to N10 to MODEL, a YAML file with a tree or a rule base.

    They ask for equal bits in other units, orders and batches, for exact edges, for
    errors within the certified bounds, and for curves that can be evaluated. Each
    input is told with what float32 would cost it. Exit 1 if a criterion fails.
    """
    from fuzzytree.api import verbs
    from fuzzytree.report.stability import stability_lines

    with wrong_options(), progress_bar(quiet=quiet) as tell:
        found = verbs.stability(
            model,
            data=table_source(data),
            delimiter=delimiter,
            only=only,
            runtimes=runtimes or None,
            progress=tell,
        )
    is_failed = any(one.verdict == "FAILS" for one in found.criteria)
    lines = stability_lines(found, is_verbose=verbose or is_full)
    is_silent = quiet and not is_failed
    answer_result(found.to_json, lines, as_json=as_json, is_silent=is_silent)
    return int(is_failed)

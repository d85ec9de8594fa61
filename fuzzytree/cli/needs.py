"""`fuzzytree needs`: what a model needs, and what leaving out the rest saves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    answer,
    answer_json,
    data_option,
    delimiter_option,
    json_option,
    progress_bar,
    quiet_option,
    say,
    say_rows,
    table_source,
    verbose_option,
    wrong_options,
)
from fuzzytree.files import check_place

if TYPE_CHECKING:
    from fuzzytree.model import Use


@click.command("needs", short_help="Report what a model needs, and leave out the rest.")
@click.argument("model", metavar="MODEL")
@data_option
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="File to write the simplified model to, if its equality is proved.",
)
@click.option(
    "--for",
    "uses",
    type=click.Choice(["tree", "relative", "raw"]),
    multiple=True,
    help="Use of a tree (repeat); its path and its relative rules by default.",
)
@click.option(
    "--drop",
    type=click.Choice(["inputs", "rules"]),
    multiple=True,
    help="Also leave out inputs that nothing tests, or rules that never fire (repeat).",
)
@click.option(
    "--time",
    "seconds",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help="Time in seconds for measuring loading, prediction and reading.",
)
@delimiter_option
@verbose_option
@json_option
@quiet_option
def command(
    model: str,
    data: str | None,
    output: str | None,
    uses: Sequence[Use],
    drop: Sequence[str],
    seconds: float | None,
    delimiter: str | None,
    verbose: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Report what MODEL, a YAML file, needs, and what leaving out the rest saves.

    The simplified model is compared with MODEL, by proof and by running both. Exit 1
    if they differ in a way that no option allows; nothing is written then.
    """
    from pathlib import Path

    from fuzzytree import api, benchmarking
    from fuzzytree.checking import deciding
    from fuzzytree.cli.convert import next_check
    from fuzzytree.exporters import find_format
    from fuzzytree.report import report_lines
    from fuzzytree.semantics import pruned

    first = deciding(api.load(model), "needs")
    wanted = tuple(uses) or ("tree", "relative")
    with wrong_options():
        find_format(Path(output or "").suffix or "yaml")  # before any work
        found = pruned(
            first, uses=wanted, inputs="inputs" in drop, rules="rules" in drop
        )
    if output is not None:
        check_place(output)
    rows = api.rows_of(table_source(data, delimiter), first)
    with progress_bar(quiet=quiet) as show:
        report = benchmarking.report(
            first,
            found,
            uses=wanted,
            data=rows,
            table=None if data == "-" else table_source(data, delimiter),
            seconds=seconds or 0.0,
            progress=show,
        )
    if as_json:
        answer_json(report.to_json())
    else:
        answer("\n".join(report_lines(report, is_verbose=verbose)))
    if not report.ok:
        wrong = sum(c.verdict == "DISAGREES" for c in report.proof.comparisons)
        say(f"the simplified model differs in {wrong} ways; nothing is written")
        return 1
    if output is not None:
        api.save(found.model, output)
        after = f"predicts some rows differently from {model}"
        if found.is_same:
            files = [
                (one, find_format(Path(one).suffix).name) for one in (model, output)
            ]
            check = next_check(*files)
            after = f"next: {check}" if check else ""
        say_rows(("wrote", output, after), quiet=quiet)
    return 0

"""`fuzzytree needs`: what a model needs, and what leaving out the rest saves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    answer,
    answer_json,
    data_option,
    model_argument,
    option,
    output_option,
    progress_bar,
    say,
    say_rows,
    table_source,
    takes,
    wrong_options,
)

if TYPE_CHECKING:
    from fuzzytree.model import ModelPath, Use


class NeedsOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    model: ModelPath = model_argument()
    data: str | None = data_option
    output: str | None = output_option(
        "-o --output FILE",
        "File to write the simplified model to, if its equality is proved.",
    )
    uses: Sequence[Use] = option(
        "--use",
        "Use of a tree (repeat); its path and its relative rules by default.",
        choices=["tree", "relative", "raw"],
        multiple=True,
    )
    drop: Sequence[str] = option(
        "--drop",
        "Also leave out inputs that nothing tests, or rules that never fire (repeat).",
        choices=["inputs", "rules"],
        multiple=True,
    )
    budget: float | None = option(
        "--budget SECONDS",
        "Time in seconds for measuring loading, prediction and reading.",
        type=click.FloatRange(min=0.0, min_open=True),
    )


@click.command("needs", short_help="Report what a model needs, and leave out the rest.")
@takes(NeedsOptions)
def command(options: NeedsOptions) -> int:
    """Report what MODEL, a YAML file, needs, and what leaving out the rest saves.

    The simplified model is compared with MODEL, by proof and by running both. Exit 1
    if they differ in a way that no option allows; nothing is written then.
    """
    from pathlib import Path

    from fuzzytree import api, benchmarking
    from fuzzytree.cli.convert import next_check
    from fuzzytree.exporters import find_format
    from fuzzytree.report import report_lines
    from fuzzytree.semantics import pruned

    first = api.load(options.model)
    wanted = tuple(options.uses) or ("tree", "relative")
    with wrong_options():
        find_format(Path(options.output or "").suffix or "yaml")  # before any work
        found = pruned(
            first,
            uses=wanted,
            inputs="inputs" in options.drop,
            rules="rules" in options.drop,
        )
    rows = api.rows_of(table_source(options.data, options), first)
    with progress_bar(quiet=options.quiet) as show:
        report = benchmarking.report(
            first,
            found,
            uses=wanted,
            data=rows,
            table=None if options.data == "-" else table_source(options.data, options),
            budget_s=options.budget or 0.0,
            progress=show,
        )
    if report.ok and options.output is not None:
        api.save(found.model, options.output)
    if options.as_json:
        answer_json(report.to_json())
    else:
        answer("\n".join(report_lines(report, is_verbose=options.verbose)))
    if not report.ok:
        wrong = sum(c.verdict == "DISAGREES" for c in report.proof.comparisons)
        say(f"the simplified model differs in {wrong} ways; nothing is written")
        return 1
    if options.output is not None:
        after = f"predicts some rows differently from {options.model}"
        if found.is_same:
            names = (options.model.read_as, None)
            files = zip((options.model, options.output), names, strict=True)
            check = next_check(*((f, name or Path(f).suffix) for f, name in files))
            after = f"next: {check}" if check else ""
        say_rows(("wrote", options.output, after), quiet=options.quiet)
    return 0

"""`fuzzytree bench`: run time and error of each way of running a model."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    answer,
    answer_json,
    model_argument,
    option,
    output_option,
    progress_bar,
    say,
    several,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.files import write_atomically

if TYPE_CHECKING:
    from fuzzytree.benchmarking import Study

INTERRUPTED = 130


class BenchOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    data: str | None = option(
        "--data TABLE",
        "Table of rows to measure on; rows from the model's ranges by default.",
    )
    rows: Sequence[int] = option(
        "--rows N",
        "Rows in one call (repeat).",
        type=int,
        multiple=True,
        default=(1, 1_000, 1_000_000),
    )
    threads: Sequence[int] = option(
        "--threads N",
        "Threads that a candidate may use (repeat).",
        type=int,
        multiple=True,
        default=(1, 2),
    )
    select: Sequence[str] = several(
        "--select NAME",
        "Candidates to measure, such as native, 'raw rules', variant (repeat).",
    )
    skip: Sequence[str] = several("--skip NAME", "Candidates to leave out (repeat).")
    budget: float = option(
        "--budget SECONDS",
        "Approximate time limit in seconds, beside that for loading peers.",
        default=300.0,
    )
    error: float | None = option(
        "--error E",
        "Largest error of a strength that the advice may accept.",
        type=float,
    )
    seed: int = option(
        "--seed", "Random seed for generated rows and the order of rounds.", default=0
    )
    peers: str | None = option(
        "--peers FOLDER",
        "Python module or package, which is run; its function "
        "peers(model, bounds) returns further candidates and omissions.",
    )
    output: str | None = output_option(
        "-o --output FILE", "JSON file to write the study to."
    )
    plots: Sequence[str] = output_option(
        "--picture FILE",
        "Picture of the study, as .svg or .png (repeat).",
        multiple=True,
    )


@click.command("bench", short_help="Measure error against run time.")
@takes(BenchOptions)
def command(options: BenchOptions) -> int:
    """Measure error against run time for every way of running MODEL, a YAML file.

    Runtimes, number types, approximations and what --peers adds predict the same rows
    in interleaved rounds; errors are those against exact arithmetic. Ctrl-C ends the
    study early, keeps its results, and exits with 130; exit 1 if an error is larger
    than its certified bound, or if --peers adds none that could be measured.
    """
    from fuzzytree import api
    from fuzzytree.report import study_lines

    output, plots = options.output, options.plots
    _check_pictures(plots)
    with (
        wrong_options(),
        progress_bar(quiet=options.quiet) as show,
        contextlib.redirect_stdout(sys.stderr),  # libraries of others may print
    ):
        found = api.bench(
            options.model,
            data=table_source(options.data, options),
            select=options.select,
            skip=options.skip,
            rows=tuple(options.rows),
            threads=tuple(options.threads),
            most=options.error,
            budget_s=options.budget,
            seed=options.seed,
            peers=options.peers,
            progress=show,
        )
    lines = study_lines(found, is_verbose=options.verbose)
    if not found.points:  # a file of an earlier study is worth more
        output, plots = None, ()
    try:
        if output:
            write_atomically(output, found.to_json().encode() + b"\n")
        _draw(found, plots)
    finally:  # whatever happens to the files, the work is not lost
        if options.as_json:
            answer_json(found.to_json())
        else:
            answer("\n".join(lines))
    for place in filter(None, (output, *plots)):
        say(f"wrote    {place}", quiet=options.quiet)
    return _ending(found, options)


def _ending(found: Study, options: BenchOptions) -> int:
    """Report what went wrong, and return the exit code."""
    from fuzzytree.benchmarking import faults

    if found.is_interrupted:
        known = "the result has what was measured before"
        nothing = "nothing was measured, and files are as they were"
        say(f"interrupted; {known if found.points else nothing}")
        return INTERRUPTED
    if not found.points:
        say("nothing could be measured")
        return 2
    wrong = [*faults(found.points)]
    if options.peers and all(point.kind != "peer" for point in found.points):
        wrong.append(f"no peer of {options.peers} was measured")
    if wrong:
        say(wrong[-1])
        return 1
    if options.as_json:
        say(found.advice[-1] if found.advice else "measured", quiet=options.quiet)
    return 0


def _check_pictures(plots: Sequence[str]) -> None:
    """Refuse what is no picture, before minutes of work."""
    from fuzzytree.report import SUFFIXES, check_suffix

    for place in plots:
        suffix = Path(place).suffix.lower()
        if suffix not in SUFFIXES:
            known = " or ".join(SUFFIXES)
            raise click.UsageError(f"--picture {place}: a picture ends in {known}")
        check_suffix(suffix)


def _draw(found: Study, places: Sequence[str]) -> None:
    """Draw the study for most rows."""
    if not places:
        return
    from fuzzytree import report

    timings = [timing for point in found.points for timing in point.timings]
    rows = max(timing.rows for timing in timings)
    threads = min(timing.threads for timing in timings)
    picture = report.work_precision(found, rows=rows, threads=threads)
    for place in places:
        picture.save(place)

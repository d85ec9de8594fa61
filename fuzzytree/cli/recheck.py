"""`fuzzytree recheck`: check an audit or a comparison by independent code."""

from __future__ import annotations

import click

from fuzzytree.cli.console import answer


@click.command("recheck", short_help="Check an audit independently.")
@click.argument("audit", metavar="AUDIT")
@click.argument("model", metavar="MODEL")
@click.argument("new", metavar="[NEW]", required=False)
@click.option(
    "--solver",
    metavar="PROGRAM",
    default="",
    help="Solver that reads SMT-LIB 2 from standard input; the package z3 by default.",
)
def command(audit: str, model: str, new: str | None, solver: str) -> int:
    """Check AUDIT, the JSON of an audit, against MODEL, the YAML file that it is of.

    Convert a file of another format to YAML first, and audit that. With NEW, AUDIT is
    the JSON of `fuzzytree diff MODEL NEW`.

    Everything is read and evaluated again by code that imports nothing else of
    fuzzytree and runs alone; what is PROVED, a solver is asked.
    `python -m fuzzytree.rechecking` is the same. Exit 1 if something does not hold, 2
    if no solver is at hand.
    """
    from fuzzytree.errors import ReadError
    from fuzzytree.rechecking import CannotRunError, recheck_files

    try:
        report = recheck_files(audit, model, *([new] if new else []), solver=solver)
    except CannotRunError as error:
        raise ReadError(str(error)) from error
    answer("\n".join(report.lines()))
    return report.exit_code

"""`fuzzytree recheck`: check an audit or a comparison by independent code."""

from __future__ import annotations

import click

from fuzzytree.cli.console import answer, argument, model_argument, option, takes
from fuzzytree.model import ModelPath


class RecheckOptions:
    """The arguments and options of the verb."""

    audit: str = argument("AUDIT")
    model: ModelPath = model_argument()
    new: str | None = argument("[NEW]", required=False)
    solver: str | None = option(
        "--solver PROGRAM", "Solver of SMT-LIB 2 on stdin; the package z3 by default."
    )


@click.command("recheck", short_help="Check an audit independently.")
@takes(RecheckOptions)
def command(options: RecheckOptions) -> int:
    """Check AUDIT, the JSON of an audit, against MODEL, the file that it is of.

    With NEW, AUDIT is the JSON of `fuzzytree diff MODEL NEW`, of two YAML files.

    Everything is read and evaluated again by code that imports nothing else of
    fuzzytree and runs alone, as `python -m fuzzytree.rechecking`; a solver decides
    again what is PROVED. Of other files than YAML, fuzzytree makes YAML, which is
    checked. Exit 1 if something does not hold, 2 if no solver is at hand.
    """
    from fuzzytree import api

    report = api.recheck(
        options.audit, options.model, new=options.new, solver=options.solver or ""
    )
    answer("\n".join(report.lines()))
    return report.exit_code

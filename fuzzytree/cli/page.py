"""`fuzzytree page`: a model as a page that runs it, to try inputs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    TableOptions,
    allow_loss_option,
    model_argument,
    option,
    output_option,
    quiet_option,
    say_rows,
    table_source,
    takes,
)

if TYPE_CHECKING:
    from fuzzytree.model import ModelPath

_SUFFIXES = (".html", ".htm")


class PageOptions(TableOptions):
    """The arguments and options of the verb."""

    model: ModelPath = model_argument()
    data: str | None = option(
        "--data TABLE", "Table whose rows the page offers, the first 300 of them."
    )
    output: str = output_option(
        "-o --output FILE", "HTML file to write.", required=True
    )
    allow_loss: bool = allow_loss_option
    quiet: bool = quiet_option


@click.command("page", short_help="Write a page that runs a model, to try inputs.")
@takes(PageOptions)
def command(options: PageOptions) -> None:
    """Write an HTML page that runs MODEL: inputs to move, what it answers, and why.

    The page is one file that loads nothing. It computes with the JavaScript of
    `fuzzytree export --to javascript`, so its answers have the bits of `run`.
    """
    from fuzzytree import api
    from fuzzytree.report import counted

    if Path(options.output).suffix.lower() not in _SUFFIXES:
        raise click.UsageError(f"-o {options.output}: a page's name ends in .html")
    data = table_source(options.data, options)
    page = api.page(options.model, data, allow_loss=options.allow_loss)
    page.save(options.output)
    rows = f"{counted(page.rows, 'row')}, " if page.total else ""
    if page.rows < page.total:
        rows = f"the first {page.rows} of {page.total} rows, "
    facts = f"{rows}{len(page.html.encode()) / 1000:.0f} kB; open it in a browser"
    say_rows(("wrote", options.output, facts), quiet=options.quiet)

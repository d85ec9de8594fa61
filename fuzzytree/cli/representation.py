"""The options that choose the representation and the format of a file."""

from __future__ import annotations

from pathlib import Path

import click

from fuzzytree.cli.console import option
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.exporters import find_format
from fuzzytree.model import Conjunction, Document, Format, Kind, ModelKind

as_option = option(
    "--as",
    "Representation to write: the tree, its rules, or the equivalent system.",
    choices=["tree", "rules", "system"],
)
terms_option = option(
    "--terms",
    "Rules that equal the tree (the default), or those of the paper.",
    choices=["relative", "raw"],
)
conjunction_option = option(
    "--conjunction",
    "AND operator of the rules; minimum by default.",
    choices=["minimum", "product"],
)


def wanted_format(output: str, to: str | None) -> Format:
    """Return the format of an output file: the named one, or that of its suffix.

    Standard output has none: it gets YAML.

    Raises:
        click.UsageError: If there is none.
    """
    suffix = Path(output).suffix
    if not to and not suffix and output != "-":
        raise click.UsageError(f"{output}: has no suffix; name the format with --to")
    try:
        return find_format(to or suffix or "yaml")
    except ValueError as error:
        hint = "" if to else "; name one of them with --to"
        raise click.UsageError(f"{error}{hint}") from error


def represented(
    model: Document,
    form: Format,
    *,
    representation: ModelKind | None,
    kind: Kind | None,
    conjunction: Conjunction | None,
) -> Document:
    """Return a model in the wanted representation; see `converting.formed`.

    Raises:
        click.UsageError: If the model cannot be had in that form.
        LossError: If the format does not carry it in any form.
    """
    from fuzzytree.checking import formed

    if representation == "tree" and (kind is not None or conjunction is not None):
        raise click.UsageError("--terms and --conjunction are for --as rules")
    try:
        return formed(
            model,
            form,
            representation=representation,
            kind=kind,
            conjunction=conjunction,
        )
    except FuzzyTreeError:
        raise
    except ValueError as error:
        raise click.UsageError(f"--{error}") from error

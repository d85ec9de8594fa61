"""The options that choose the representation and the format of a file."""

from __future__ import annotations

from pathlib import Path

import click

from fuzzytree.cli.console import FullResultOptions, flag, option
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.exporters import find_format
from fuzzytree.model import Conjunction, Document, Format, Kind, ModelKind


class RepresentationOptions(FullResultOptions):
    """The options that say what of a model is written."""

    representation: ModelKind | None = option(
        "--as",
        "Representation to write: the tree, its rules, or the equivalent system.",
        choices=["tree", "rules", "system"],
    )
    kind: Kind | None = option(
        "--terms",
        "Rules that equal the tree (the default), or those of the paper.",
        choices=["relative", "raw"],
    )
    conjunction: Conjunction | None = option(
        "--conjunction",
        "AND operator of the rules; minimum by default.",
        choices=["minimum", "product"],
    )


class WritingOptions(RepresentationOptions):
    """The options of a verb that writes a model in another format."""

    output: str
    to: str | None = option(
        "--to FORMAT", "Format of the file; from its suffix by default."
    )
    tolerance: str | None = option(
        "--tolerance NUMBER", "Largest error of a degree where a curve becomes points."
    )
    allow_loss: bool = flag(
        "--allow-loss", "Write the file although the format loses information."
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
    model: Document, form: Format, options: RepresentationOptions
) -> Document:
    """Return a model in the wanted representation; see `converting.formed`.

    Raises:
        click.UsageError: If the model cannot be had in that form.
        LossError: If the format does not carry it in any form.
    """
    from fuzzytree.checking import formed

    kind, conjunction = options.kind, options.conjunction
    if options.representation == "tree" and (kind or conjunction):
        raise click.UsageError("--terms and --conjunction are for --as rules")
    try:
        return formed(
            model,
            form,
            representation=options.representation,
            kind=kind,
            conjunction=conjunction,
        )
    except FuzzyTreeError:
        raise
    except ValueError as error:
        raise click.UsageError(f"--{error}") from error

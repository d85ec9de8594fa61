"""The options that say which form of a model a file gets."""

from __future__ import annotations

from pathlib import Path

import click

from fuzzytree.contracts import Carrier, Format, Model
from fuzzytree.exporters import find_format
from fuzzytree.lowering import rules_from_tree
from fuzzytree.rulebase import Conjunction, Kind, RuleBase

as_option = click.option(
    "--as",
    "carrier",
    type=click.Choice(["tree", "rules"]),
    help="Write the tree, or rules made from it.",
)
terms_option = click.option(
    "--terms",
    "kind",
    type=click.Choice(["relative", "raw"]),
    help="Rules that equal the tree (the default), or the paper's own.",
)
conjunction_option = click.option(
    "--conjunction",
    type=click.Choice(["min", "product"]),
    help="The AND of the rules.",
)


def wanted_format(output: str, to: str | None) -> Format:
    """Return the format of an output file: the one asked for, or of its suffix.

    Raises:
        click.UsageError: If there is none.
    """
    suffix = Path(output).suffix
    try:
        return find_format(to or suffix or "yaml")
    except ValueError as error:
        hint = "" if to else "; name one of them with --to"
        raise click.UsageError(f"{error}{hint}") from error


def carried(
    model: Model,
    *,
    carrier: Carrier | None,
    kind: Kind | None,
    conjunction: Conjunction | None,
    form: Format,
) -> Model:
    """Return the form of a model that was asked for.

    Unless told otherwise a model stays what it is, and a tree becomes rules where the
    format carries no tree.

    Raises:
        click.UsageError: If the model cannot be had in that form.
    """
    if isinstance(model, RuleBase):
        _refuse_remaking(model, carrier, kind, conjunction)
        return model
    wants_rules = kind is not None or conjunction is not None
    if carrier == "tree" and wants_rules:
        raise click.UsageError("--terms and --conjunction are for --as rules")
    if carrier is None:
        is_lost = "tree" not in form.carries
        carrier = "rules" if wants_rules or is_lost else "tree"
    if carrier == "tree":
        return model
    return rules_from_tree(model, kind or "relative", conjunction=conjunction)


def _refuse_remaking(
    rules: RuleBase,
    carrier: Carrier | None,
    kind: Kind | None,
    conjunction: Conjunction | None,
) -> None:
    if carrier == "tree":
        raise click.UsageError(
            f"--as tree: {rules.name} is a rule base, and no tree can be made of it"
        )
    for option, wanted, found in (
        ("--terms", kind, rules.kind),
        ("--conjunction", conjunction, rules.semantics.conjunction),
    ):
        if wanted is not None and wanted != found:
            raise click.UsageError(
                f"{option} {wanted}: {rules.name} is a rule base with "
                f"{found or 'other'}; other rules are made from the tree"
            )

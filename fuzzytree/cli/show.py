"""`fuzzytree show`: a model as a person reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from fuzzytree.cli.audit_options import row_of
from fuzzytree.cli.console import (
    ResultOptions,
    answer,
    answer_json,
    model_argument,
    option,
    output_option,
    say,
    takes,
    wrong_options,
)

if TYPE_CHECKING:
    from fuzzytree.model import Document, Reading


class ShowOptions(ResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    picture: str | None = output_option(
        "--picture FILE",
        "Picture of the tree, or of the terms of rules, as .svg or .png.",
    )
    row: str | None = option(
        "--row NAME=VALUE,...", "Row for which the picture shows each rule."
    )
    surface: str | None = option(
        "--surface NAME,NAME",
        "Two inputs over which the picture shows the class or the outputs.",
    )


@click.command("show", short_help="Show a model and its rules.")
@takes(ShowOptions)
def command(options: ShowOptions) -> None:
    """Show a tree, a rule base or a fuzzy system, with the numbers of its terms.

    MODEL is a readable file, or ONNX. Parts of the file that a model cannot represent
    are reported on stderr.
    """
    from pathlib import Path

    from fuzzytree import api, report
    from fuzzytree.checking import coverage_of
    from fuzzytree.model import FuzzySystem, loss_text
    from fuzzytree.runtimes import OnnxModel

    for flag, value in (("--row", options.row), ("--surface", options.surface)):
        if value is not None and options.picture is None:
            raise click.UsageError(
                f"{flag} {value}: is drawn, and needs --picture FILE"
            )
    if Path(options.model).suffix.lower() == ".onnx":
        if options.picture is not None:
            raise click.UsageError(
                f"--picture: {options.model} contains a graph and no model"
            )
        opened = api.opened(options.model)
        assert isinstance(opened, OnnxModel)
        facts = report.onnx_facts(opened)
        if options.as_json:
            answer_json(facts)
        else:
            answer("\n".join(report.fact_lines(facts)))
        return
    found = api.read(options.model)
    model = found.model
    coverage = coverage_of(model) if isinstance(model, FuzzySystem) else None
    if options.picture is not None:
        _draw(model, options, options.picture)
        say(f"wrote    {options.picture}", quiet=options.quiet)
    for loss in found.losses:
        say(f"lost     {loss_text(loss)}")
    for remark in (*found.remarks, *(coverage.sentences if coverage else ())):
        say(f"remark   {remark}", quiet=options.quiet)
    if options.as_json:
        answer_json({**_facts(found), "coverage": coverage})
    else:
        answer("\n".join(report.model_lines(model)))


def _draw(model: Document, options: ShowOptions, path: str) -> None:
    from fuzzytree import api

    surface = None if options.surface is None else options.surface.split(",")
    names = None if surface is None else [name.strip() for name in surface]
    with wrong_options():
        api.draw(model, row=row_of(options.row), surface=names).save(path)


def _facts(found: Reading) -> dict[str, object]:
    import msgspec

    from fuzzytree import report
    from fuzzytree.model import fingerprint, kind_of

    model = found.model
    outputs = {"outputs": [output.name for output in model.outputs]}
    return {
        "carrier": kind_of(model),
        "fingerprint": fingerprint(model),
        "inputs": model.inputs,
        **(outputs if model.outputs else {}),
        "rules": report.rule_facts(model),
        "losses": found.losses,
        "remarks": found.remarks,
        "model": msgspec.to_builtins(model),
    }

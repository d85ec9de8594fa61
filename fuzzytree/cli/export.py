"""`fuzzytree export`: `convert` with the options of onnx by name."""

from __future__ import annotations

import click

from fuzzytree.cli.console import (
    json_option,
    quiet_option,
    verbose_option,
    wrong_options,
)
from fuzzytree.cli.convert import Choice, carry, read_source
from fuzzytree.cli.representation import (
    as_option,
    conjunction_option,
    terms_option,
    wanted_format,
)
from fuzzytree.model import Conjunction, Kind, ModelKind


@click.command("export", short_help="Write a model in another format.")
@click.argument("model", metavar="MODEL")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    help="File to write; `-` is stdout.",
)
@click.option(
    "--to", metavar="FORMAT", help="Format of FILE; from its suffix by default."
)
@as_option
@terms_option
@conjunction_option
@click.option(
    "--dtype",
    type=click.Choice(["float64", "mixed", "float32"]),
    help="onnx: number type of the degrees.",
)
@click.option("--opset", type=int, help="onnx: version of the operators, 12 to 26.")
@click.option("--ir", type=int, help="onnx: version of the file format, 4 to 13.")
@click.option(
    "--signature",
    type=click.Choice(["needed", "all"]),
    help="onnx: columns that are inputs of the graph.",
)
@click.option(
    "--outputs",
    metavar="NAMES",
    help="onnx: outputs of the graph, of label,rule,status,strengths.",
)
@click.option(
    "--readable", is_flag=True, help="onnx: write functions with readable names."
)
@click.option(
    "--plain", is_flag=True, help="onnx: write a tree without operators of ai.onnx.ml."
)
@click.option(
    "--allow-loss",
    is_flag=True,
    help="Write the file although the format loses information.",
)
@verbose_option
@json_option
@quiet_option
def command(
    model: str,
    output: str,
    to: str | None,
    representation: ModelKind | None,
    kind: Kind | None,
    conjunction: Conjunction | None,
    dtype: str | None,
    opset: int | None,
    ir: int | None,
    signature: str | None,
    outputs: str | None,
    readable: bool,
    plain: bool,
    allow_loss: bool,
    verbose: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write a model in another format, which FILE's suffix names.

    It is `convert` with the options of onnx by name. An export that would lose
    information is refused with a list of the losses, unless allowed: exit 1.
    """
    from fuzzytree.model import check_names

    given = {
        "dtype": dtype,
        "opset": opset,
        "ir": ir,
        "signature": signature,
        "outputs": outputs.split(",") if outputs else None,
        "readable": readable or None,
        "plain": plain or None,
    }
    options = {name: value for name, value in given.items() if value is not None}
    form = wanted_format(output, to)
    with wrong_options():
        check_names(form, options)
    found, read_as = read_source(model, None)
    return carry(
        found,
        model,
        read_as,
        form,
        output,
        choice=Choice(representation, kind, conjunction),
        options=options,
        allow_loss=allow_loss,
        verbose=verbose,
        as_json=as_json,
        quiet=quiet,
    )

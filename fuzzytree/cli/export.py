"""`fuzzytree export`: `convert` with the options of onnx by name."""

from __future__ import annotations

import click

from fuzzytree.cli.carriers import (
    as_option,
    conjunction_option,
    terms_option,
    wanted_format,
)
from fuzzytree.cli.convert import Choice, carry, read_source
from fuzzytree.cli.talk import json_option, quiet_option, verbose_option, wrong_options
from fuzzytree.model.contracts import ModelKind
from fuzzytree.model.rulebase import Conjunction, Kind


@click.command("export", short_help="Write a model in another format.")
@click.argument("model", metavar="MODEL")
@click.option("-o", "--output", required=True, metavar="FILE", help="`-` is stdout.")
@click.option("--to", metavar="FORMAT", help="The format, if not FILE's suffix says.")
@as_option
@terms_option
@conjunction_option
@click.option(
    "--dtype",
    type=click.Choice(["float64", "mixed", "float32"]),
    help="onnx: the number type of the degrees.",
)
@click.option("--opset", type=int, help="onnx: the version of the operators.")
@click.option("--ir", type=int, help="onnx: the version of the file.")
@click.option(
    "--signature",
    type=click.Choice(["needed", "all"]),
    help="onnx: the columns that are inputs.",
)
@click.option(
    "--outputs",
    metavar="NAMES",
    help="onnx: some of label,rule,status,strengths, with commas.",
)
@click.option("--readable", is_flag=True, help="onnx: with functions of our own.")
@click.option("--plain", is_flag=True, help="onnx: a tree without ai.onnx.ml.")
@click.option(
    "--allow-loss", is_flag=True, help="Write what is lost as near as it can."
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

    It is `convert` with the options of onnx by name. What the format cannot hold is
    listed, and nothing is written unless allowed: exit 1.
    """
    from fuzzytree.model.options import check_names

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

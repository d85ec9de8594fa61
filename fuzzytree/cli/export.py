"""`fuzzytree export`: `convert` with the options of onnx by name."""

from __future__ import annotations

import click

from fuzzytree.cli.console import (
    flag,
    model_argument,
    option,
    output_option,
    takes,
    wrong_options,
)
from fuzzytree.cli.convert import carry, option_values, read_source
from fuzzytree.cli.representation import (
    WritingOptions,
    wanted_format,
)
from fuzzytree.model import ModelPath, Option


class ExportOptions(WritingOptions):
    """The arguments and options of the verb."""

    model: ModelPath = model_argument()
    output: str = output_option(
        "-o --output FILE", "File to write; `-` is stdout.", required=True
    )
    dtype: str | None = option(
        "--dtype",
        "Number type: of the degrees in onnx, of all numbers in c.",
        choices=["float64", "mixed", "float32", "q15", "q31"],
    )
    opset: int | None = option(
        "--opset", "onnx: version of the operators, 12 to 26.", type=int
    )
    ir: int | None = option(
        "--ir", "onnx: version of the file format, 4 to 13.", type=int
    )
    signature: str | None = option(
        "--signature",
        "onnx: columns that are inputs of the graph.",
        choices=["needed", "all"],
    )
    columns: str | None = option(
        "--columns NAMES",
        "onnx: columns of the rows that the graph will get, in order.",
    )
    outputs: str | None = option(
        "--outputs NAMES",
        "onnx: outputs of the graph, of label,rule,status,strengths,probabilities.",
    )
    readable: bool = flag(
        "--readable", "onnx: write a node with a name for each step of the model."
    )
    plain: bool = flag("--plain", "onnx: write a tree without operators of ai.onnx.ml.")
    net: bool = flag("--net", "onnx: write a tree as layers of Gemm, Sign and Relu.")
    report: bool = flag(
        "--report", "c: print the bytes that small machines need for the file."
    )


@click.command("export", short_help="Write a model in another format.")
@takes(ExportOptions)
def command(options: ExportOptions) -> int:
    """Write a model in another format, which FILE's suffix names.

    It is `convert` with the options of onnx by name. An export that would lose
    information is refused with a list of the losses, unless allowed: exit 1.
    """
    from fuzzytree.model import check_names

    given = {
        "dtype": options.dtype,
        "opset": options.opset,
        "ir": options.ir,
        "signature": options.signature,
        "columns": options.columns.split(",") if options.columns else None,
        "outputs": options.outputs.split(",") if options.outputs else None,
        "readable": options.readable or None,
        "plain": options.plain or None,
        "net": options.net or None,
    }
    values: dict[str, Option] = {
        name: value for name, value in given.items() if value is not None
    }
    form = wanted_format(options.output, options.to)
    with wrong_options():
        check_names(form, values)
        values |= option_values(form, [("tolerance", options.tolerance)])
    if options.report and (form.name != "c" or options.output == "-"):
        raise click.UsageError(
            "--report is about a file of C; write one with -o FILE.c"
        )
    found, read_as = read_source(options.model, quiet=options.quiet)
    return carry(
        found,
        options.model,
        read_as,
        form,
        options,
        options=values,
        with_sizes=options.report,
    )

"""`fuzzytree export`: a model in another format."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, get_args

import click
import msgspec

from fuzzytree.cli.carriers import (
    as_option,
    carried,
    conjunction_option,
    terms_option,
    wanted_format,
)
from fuzzytree.cli.talk import (
    answer_bytes,
    answer_json,
    json_option,
    quiet_option,
    say,
    say_rows,
    wrong_options,
)
from fuzzytree.contracts import Carrier, Dtype, Format, Model, Written
from fuzzytree.errors import DisagreementError, LossError
from fuzzytree.files import write_atomically
from fuzzytree.rulebase import Conjunction, Kind, RuleBase

if TYPE_CHECKING:
    from fuzzytree.numerics.bounds import Certificate
    from fuzzytree.verbs import Option


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
@json_option
@quiet_option
def command(
    model: str,
    output: str,
    to: str | None,
    carrier: Carrier | None,
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
    as_json: bool,
    quiet: bool,
) -> None:
    """Write a model in another format, which FILE's suffix names.

    What the format cannot hold is listed, and nothing is written unless allowed.
    """
    from fuzzytree import verbs

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
    found = carried(
        verbs.load(model),
        carrier=carrier,
        kind=kind,
        conjunction=conjunction,
        form=form,
    )
    with wrong_options():
        written = _written(found, form.name, options, allow_loss=allow_loss)
    proof = _certificate(found, form, dtype, written.content)
    if output == "-":
        answer_bytes(written.content)
    else:
        write_atomically(output, written.content)
    can_check = form.read is not None or form.name == "onnx"
    after = shlex.join(["fuzzytree", "check", model, output]) if can_check else ""
    _tell(written, proof, form.name, output, after, as_json=as_json, quiet=quiet)


def _written(
    model: Model, to: str, options: Mapping[str, Option], *, allow_loss: bool
) -> Written:
    from fuzzytree import verbs

    try:
        return verbs.export(model, to, allow_loss=allow_loss, **options)
    except LossError as error:
        text = str(error).replace("allow_loss=True", "--allow-loss")
        raise LossError(text) from error


def _certificate(
    model: Model, form: Format, dtype: str | None, content: bytes
) -> Certificate | None:
    """Return what the file can change about the model's answers.

    A file that computes is certified in its number type. One that only holds the model
    must be read back as that model; None if it cannot be read.

    Raises:
        DisagreementError: If it is read back as another model.
    """
    from fuzzytree import verbs
    from fuzzytree.numerics.bounds import Certificate

    if form.dtype is not None:
        asked = [name for name in get_args(Dtype) if name == dtype]
        return verbs.certify(model, asked[0] if asked else form.dtype)
    if form.read is None:
        return None
    if form.read(content, form.name).model != model:
        raise DisagreementError(
            f"{model.name} as {form.name} is read back as another model; "
            "nothing is written"
        )
    carrier: Carrier = "rules" if isinstance(model, RuleBase) else "tree"
    origin = "read back from the file, the model is equal in every number"
    return Certificate(None, carrier, 0.0, origin)


def _tell(
    written: Written,
    proof: Certificate | None,
    to: str,
    output: str,
    after: str,
    *,
    as_json: bool,
    quiet: bool,
) -> None:
    digest = hashlib.sha256(written.content).hexdigest()
    size = len(written.content)
    for loss in written.losses:
        bound = "" if loss.bound is None else f" (largest error {loss.bound:.2g})"
        say(f"lost     {loss.where}: {loss.what}{bound}", quiet=quiet)
    say_rows(
        ("wrote", output, f"{to}, {size} bytes, sha256 {digest}"),
        *([("bound", proof.dtype or "exact", proof.sentence)] if proof else []),
        *([("next", after, "")] if after else []),
        quiet=quiet or output == "-",
    )
    if as_json and output != "-":
        answer_json(
            {
                "file": output,
                "format": to,
                "bytes": size,
                "sha256": digest,
                "losses": written.losses,
                "certificate": proof
                and {"sentence": proof.sentence, **msgspec.structs.asdict(proof)},
            }
        )

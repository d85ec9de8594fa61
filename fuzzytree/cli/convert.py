"""`fuzzytree convert`: a model from one format to another, with its losses."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli.console import (
    OUTPUT,
    answer_bytes,
    answer_json,
    argument,
    model_argument,
    option,
    progress_bar,
    say,
    say_first,
    say_rows,
    setting,
    several,
    standard_input,
    takes,
    wrong_options,
)
from fuzzytree.cli.representation import (
    WritingOptions,
    wanted_format,
)
from fuzzytree.errors import LossError
from fuzzytree.files import LIMIT, write_atomically
from fuzzytree.model import (
    Document,
    Format,
    Reading,
    Written,
)

if TYPE_CHECKING:
    from fuzzytree.checking import Proof
    from fuzzytree.model import ModelPath, Option


class ConvertOptions(WritingOptions):
    """The arguments and options of the verb."""

    source: ModelPath = model_argument("IN")
    output: str = argument("OUT", type=OUTPUT)
    dialect: str | None = option(
        "--dialect NAME", "Dialect of OUT; that of IN where both have one format."
    )
    settings: Sequence[str] = several(
        "--set NAME=VALUE",
        "Option of the writer (repeat); `fuzzytree formats --format NAME` lists them.",
    )


@click.command("convert", short_help="Convert a model from one format to another.")
@takes(ConvertOptions)
def command(options: ConvertOptions) -> int:
    """Convert the model of file IN to file OUT; their suffixes name the formats.

    `-` is standard input or output. A conversion that would lose information is
    refused with a list of the losses, unless --allow-loss is given: exit 1.
    """
    if options.output == "-" and options.to is None:
        raise click.UsageError("`-` has no suffix; name the format with --to")
    from fuzzytree.report import document_text

    given = [
        ("dialect", options.dialect),
        ("tolerance", options.tolerance),
        *map(setting, options.settings),
    ]
    form = wanted_format(options.output, options.to)
    with wrong_options():
        values = option_values(form, given)
    found, used = read_source(options.source, quiet=options.quiet)
    head = f"{used}: {document_text(found.model)}"
    notes = [("read", options.source, head)]
    return carry(
        found, options.source, used, form, options, options=values, notes=notes
    )


def option_values(
    form: Format, given: Iterable[tuple[str, str | None]]
) -> dict[str, Option]:
    """Return the options of a writer that a user set, each at most once."""
    from fuzzytree.model import option_value

    options: dict[str, Option] = {}
    for name, text in given:
        if text is None:
            continue
        if name in options:
            raise ValueError(f"the option {name!r} is given twice")
        options[name] = option_value(form, name, text)
    return options


def read_source(source: ModelPath, *, quiet: bool) -> tuple[Reading, str]:
    """Return what a file or standard input holds, and the name of its format."""
    from fuzzytree import checking
    from fuzzytree.errors import ReadError

    if source == "-" and source.read_as is None:
        raise click.UsageError("`-` has no suffix; name the format with --from")
    form = checking.format_of(source)
    read_as = source.read_as or form.name
    if source != "-":
        with progress_bar(quiet=quiet) as show:
            show(f"reading {source}", None)
            return checking.read(source), read_as
    checking.refuse_unreadable(form, "standard input")
    content = standard_input().read(LIMIT + 1)
    if len(content) > LIMIT:
        raise ReadError(f"standard input: is larger than {LIMIT} bytes")
    return checking.read_content(content, form, name="standard input"), read_as


def carry(
    found: Reading,
    source: str,
    read_as: str,
    form: Format,
    chosen: WritingOptions,
    *,
    options: Mapping[str, Option],
    notes: Sequence[tuple[str, str, str]] = (),
    with_sizes: bool = False,
) -> int:
    """Write a model in another format, and report its proof; return 1 for a refusal.

    Args:
        found: What was read.
        source: The file that was read.
        read_as: The format of that file.
        form: The format to write.
        chosen: The representation, the file to write and what to print.
        options: The options of the writer.
        notes: Lines to print behind those of the file and its proof.
        with_sizes: Whether to print what the file, in C, needs on small machines.
    """
    from fuzzytree import report
    from fuzzytree.checking import export, in_dialect, proved
    from fuzzytree.cli.representation import represented
    from fuzzytree.model import kind_of, loss_text

    model = represented(found.model, form, chosen)
    options = in_dialect(options, found, form)
    facts: dict[str, object] = {
        "read": {
            "file": str(source),
            "format": read_as,
            **report.document_facts(found.model),
            "losses": found.losses,
            "remarks": found.remarks,
        },
        "format": form.name,
        "carrier": kind_of(model),
    }
    with progress_bar(quiet=chosen.quiet) as show:
        show(f"writing {form.name}", 0.0)
        with wrong_options():
            written, refusal = _written(
                model, form, options, allow_loss=chosen.allow_loss
            )
        proof = None
        if not refusal and (chosen.allow_loss or not found.losses):
            show(f"comparing {form.name} with the model", 0.5)
            proof = proved(model, form, written, dtype=options.get("dtype"))
    if proof is None:
        _refuse(found, refusal, verbose=chosen.verbose)
        if chosen.as_json and chosen.output != "-":
            losses = export(model, form.name, allow_loss=True, **options).losses
            answer_json({**facts, "file": None, "losses": losses})
        return 1
    if chosen.output == "-":
        answer_bytes(written.content)
    else:
        write_atomically(chosen.output, written.content)
    digest = hashlib.sha256(written.content).hexdigest()
    size = len(written.content)
    is_raw = model.kind == "raw" and model is not found.model
    more = ("--terms", "raw") if is_raw else ()
    if model.rules and model.classes and form.read and "tolerance" in options:
        more = (*more, "--tolerance", str(options["tolerance"]))
    after = next_check((source, read_as), (chosen.output, form.name), more=more)
    if after and found.losses:
        after += " --allow-loss"
    # Rules that lost something may be read back as a system.
    is_system = model.outputs or (written.losses and proof.kind == "system")
    if is_system and not found.model.outputs:
        after = ""  # numbers are not compared with classes
    label, shows = "next", ""
    if written.losses:
        shows = " (shows what the losses change)"
        if proof.verdict == "as listed" and model.outputs:
            label, shows = "differs", " (exits 1, and shows what the losses change)"
    lost = [f"lost     {loss_text(one)}" for one in (*found.losses, *written.losses)]
    coverage = proof.coverage.sentences if proof.coverage else ()
    remarks = (*found.remarks, *written.remarks, *coverage)
    say_rows(
        ("wrote", chosen.output, f"{form.name}, {size} bytes, sha256 {digest}"),
        _proof_row(proof),
        *notes,
        quiet=chosen.quiet,
    )
    for lines in (lost, [f"remark   {text}" for text in remarks]):
        say_first(lines, verbose=chosen.verbose, quiet=chosen.quiet)
    if after:
        say(f"{label:<9}{after}{shows}", quiet=chosen.quiet)
    sizes = _report_sizes(model, written) if with_sizes else None
    if chosen.as_json and chosen.output != "-":
        bound = proof.certificate
        answer_json(
            {
                **facts,
                "file": chosen.output,
                "bytes": size,
                "sha256": digest,
                "losses": written.losses,
                "remarks": written.remarks,
                "names": dict(written.names),
                "proof": {"verdict": proof.verdict, "sentence": proof.sentence},
                "certificate": bound
                and {"sentence": bound.sentence, **msgspec.to_builtins(bound)},
                "coverage": proof.coverage,
                "next": after if label == "next" and after else None,
                **({"report": sizes} if sizes else {}),
            }
        )
    return 0


def _written(
    model: Document, form: Format, options: Mapping[str, Option], *, allow_loss: bool
) -> tuple[Written, str]:
    """Write a model; if something is lost and not allowed, return how it is refused.

    Raises:
        LossError: If it cannot be written at all.
    """
    from fuzzytree.checking import export

    try:
        return export(model, form.name, allow_loss=allow_loss, **options), ""
    except LossError as error:
        if "allow_loss=True" not in str(error):
            raise
        return Written(b""), str(error).replace("allow_loss=True", "--allow-loss")


def _refuse(found: Reading, refusal: str, *, verbose: bool) -> None:
    """Report what would be lost, and that nothing is written."""
    from fuzzytree.model import loss_text

    losses = [f"lost     {loss_text(loss)}" for loss in found.losses]
    if "--allow-loss" in refusal:
        head, *refused = refusal.splitlines()
        say(head)
        say_first(refused[:-1], verbose=verbose)
        say_first(losses, verbose=verbose)
        say_first(refused[-1:])
        return
    say(refusal or "nothing is written; pass --allow-loss to write what remains")
    say_first(losses, verbose=verbose)
    if refusal:
        say("nothing is written; pass --allow-loss to write what remains")


def _report_sizes(model: Document, written: Written) -> dict[str, object]:
    """Print and return what a file of C needs on small machines."""
    from fuzzytree.runtimes import MachineSize, machine_sizes
    from fuzzytree.semantics import program_of

    steps = program_of(model, with_strengths=False).size
    say_rows(("steps", f"{steps:,}", "a row"))
    sizes: list[MachineSize] = []
    reasons: list[str] = []
    for size in machine_sizes(written.content):
        if not isinstance(size, MachineSize):
            reasons.append(size)
            say(f"size     {size}")
            continue
        sizes.append(size)
        text = f"{size.flash:,} bytes of flash, {size.ram:,} of RAM, {size.stack:,}"
        say_rows(("size", size.machine, f"{text} of stack"))
    return {"steps": steps, "machines": sizes, "unmeasured": reasons}


def _proof_row(proof: Proof) -> tuple[str, str, str]:
    if proof.verdict == "certified" and proof.certificate:
        return "bound", proof.certificate.dtype or "exact", proof.sentence
    if proof.verdict == "unproved":
        return "unproved", "", proof.sentence
    return "proved", proof.verdict, proof.sentence


def next_check(*files: tuple[str, str], more: Sequence[str] = ()) -> str:
    """Return the command that checks a model and what is made of it.

    It is empty if `check` cannot read one of them, for then the command would fail.

    Args:
        files: Each with the name of its format; the first holds the model.
        more: What the command says behind the files.
    """
    from fuzzytree.exporters import TABLE, find_format

    for number, (path, name) in enumerate(files):
        form, _, dialect = name.partition(":")
        found = find_format(form)
        is_readable = found.read is not None or (number > 0 and form in TABLE)
        is_other = dialect or Path(path).suffix.lower() not in found.suffixes
        if path == "-" or not is_readable or (is_other and number):
            return ""
        more = [*more, "--from", name] if is_other else more
    return shlex.join(["fuzzytree", "check", *(path for path, _ in files), *more])

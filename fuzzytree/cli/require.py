"""`fuzzytree require`: whether a model does what it must."""

from __future__ import annotations

from typing import Literal

import click

from fuzzytree.cli.audit_options import limits_of
from fuzzytree.cli.console import (
    ResultOptions,
    allow_loss_option,
    answer_styled,
    argument,
    model_argument,
    option,
    output_option,
    say,
    several,
    takes,
    wrong_options,
)
from fuzzytree.files import write_atomically
from fuzzytree.model import printable_json

_EXAMPLES = """\b
For example:
  fuzzytree require grip.yaml requirements.yaml
  fuzzytree require grip.yaml --that "class is never soft where force < 2"
  fuzzytree require tipper.fll --that "tip rises with service"
"""


class RequireOptions(ResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    file: str | None = argument("[FILE]", required=False)
    that: tuple[str, ...] = several("--that TEXT", "Requirement to check (repeat).")
    limits: tuple[str, ...] = several(
        "--limits NAME=LOW:HIGH",
        "Range, or NAME=CATEGORY,..., of an input that rows can have (repeat).",
    )
    steps: int | None = option(
        "--steps NUMBER",
        "Budget of each question, in steps of a microsecond; 4000000 by default.",
        type=click.IntRange(min=1),
    )
    form: Literal["text", "sarif", "github"] = option(
        "--output-format",
        "Format of the result: text for people, or that of a code host.",
        choices=["text", "sarif", "github"],
        default="text",
    )
    output: str | None = output_option(
        "-o --output FILE", "File to write the result to, in place of stdout."
    )
    allow_loss: bool = allow_loss_option


@click.command(
    "require",
    short_help="Prove or refute what a model must do.",
    epilog=_EXAMPLES,
)
@takes(RequireOptions)
def command(options: RequireOptions) -> int:
    """Prove or refute requirements of MODEL: those of FILE, in YAML, and of --that.

    Each is PROVED for all rows, REFUTED by rows that `fuzzytree run` confirms, or OPEN.
    Exit 0 if all are proved, 1 if one is not, 2 if they cannot be read.
    """
    from fuzzytree import api, report

    if options.file is None and not options.that:
        raise click.UsageError("name a FILE of requirements, or one with --that")
    with wrong_options():
        result = api.require(
            options.model,
            options.file,
            that=options.that,
            limits=limits_of(options.limits),
            steps=options.steps,
            allow_loss=options.allow_loss,
        )
    verdict = report.compliance_verdict(result)
    if options.as_json:
        text = printable_json(result.to_json())
    elif options.form == "sarif":
        text = printable_json(report.compliance_sarif(result))
    elif options.form == "github":
        text = "\n".join(report.compliance_annotations(result))
    else:
        text = "\n".join(report.compliance_lines(result))
    is_text = options.form == "text" and not options.as_json
    if options.output is None or options.output == "-":
        answer_styled(text)  # what it quotes is printable already
    else:
        write_atomically(options.output, f"{text}\n".encode())
        say(f"wrote    {options.output}", quiet=options.quiet)
    if not is_text or options.output is not None:
        say(verdict, quiet=options.quiet)
    return 0 if result.ok else 1

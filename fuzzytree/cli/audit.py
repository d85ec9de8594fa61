"""`fuzzytree audit`: faults of a rule base, proved or shown at a point."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import click

from fuzzytree.cli.audit_options import (
    codes_of,
    configured,
    limits_of,
    repeating,
    row_of,
    row_option,
    settings_of,
    table_of,
)
from fuzzytree.cli.console import (
    FullResultOptions,
    TableOptions,
    allow_loss_option,
    answer_styled,
    flag,
    model_argument,
    option,
    output_option,
    progress_bar,
    say,
    several,
    takes,
    wrong_options,
)
from fuzzytree.files import write_atomically
from fuzzytree.model import printable, printable_json

if TYPE_CHECKING:
    from fuzzytree.auditing import Audit, FailOn, Material

_MOST_LIMITS = 3  # undeclared ranges that are reported one by one

Form = Literal["text", "sarif", "github"]


_EXAMPLES = """\b
For example:
  fuzzytree audit wine.yaml
  fuzzytree audit wine.yaml --data wine.csv --target cultivar --page wine.html
  fuzzytree audit wine.yaml --write-baseline known.json
"""


class AuditOptions(TableOptions, FullResultOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    data: str | None = option(
        "--data TABLE", "Table of rows that the audit counts; `-` is standard input."
    )
    target: str | None = option(
        "--target COLUMN", "Column of TABLE that holds the class of each row."
    )
    within: Literal["model", "data"] = option(
        "--within",
        "Domain of the audit: the ranges of the model, or those of TABLE.",
        choices=["model", "data"],
        default="model",
    )
    spreads: float | None = option(
        "--spreads K",
        "Extend the domain by K spreads around the fitted sets.",
        type=float,
    )
    limits: tuple[str, ...] = several(
        "--limits NAME=LOW:HIGH",
        "Range, or NAME=CATEGORY,..., of a variable in the audit (repeat).",
    )
    row: str | None = row_option
    select: tuple[str, ...] = several(
        "--select CODES", "Codes to examine, such as FT1,FT301; all by default."
    )
    skip: tuple[str, ...] = several("--skip CODES", "Codes to leave out, such as FT5.")
    budget: float | None = option(
        "--budget STEPS",
        "Limit of the proofs in million steps, each about a second; 60 by default.",
        type=float,
    )
    settings: tuple[str, ...] = several(
        "--setting NAME=VALUE",
        "Threshold (epsilon, margin, lead, level, overlap), or rows, seed.",
    )
    config: str | None = option(
        "--config FILE",
        "File with options; by default fuzzytree-audit.yaml of this folder.",
    )
    baseline: str | None = option(
        "--baseline ACCEPTED", "File of accepted findings, which do not fail the audit."
    )
    write_baseline: str | None = output_option(
        "--write-baseline FILE", "File to write all findings to, for --baseline."
    )
    fail_on: FailOn | None = option(
        "--fail-on",
        "Least severity that makes the exit code 1; warning by default.",
        choices=["error", "warning", "info", "never"],
    )
    form: Form = option(
        "--output-format",
        "Format of the result: text for people, or that of a code host.",
        choices=["text", "sarif", "github"],
        default="text",
    )
    is_whole: bool = flag(
        "--all", "List every answer, also those that are no findings."
    )
    output: str | None = output_option(
        "-o --output FILE", "File to write the result to, in place of stdout."
    )
    page: str | None = output_option(
        "--page FILE", "HTML file to write the audit to, in addition."
    )
    smt: str | None = output_option(
        "--smt FILE", "SMT-LIB 2 file to write all that is PROVED to, for any solver."
    )
    results: tuple[str, ...] = several(
        "--results FILE",
        "Result of `check --json` or `stability --json` to include (repeat).",
    )
    allow_loss: bool = allow_loss_option


@click.command(
    "audit",
    short_help="Find faults of a rule base, with proofs.",
    epilog=_EXAMPLES,
)
@takes(AuditOptions)
def command(options: AuditOptions) -> int:
    """Find rules that never win, gaps and conflicts in MODEL, any readable file.

    Each answer is PROVED on the whole domain, COMPUTED, shown by a WITNESS, enclosed
    by a BRACKET, SAMPLED or DECLINED; `fuzzytree explain CODE` explains a finding and
    its remedy. Ctrl-C keeps what is proved so far.

    Exit 0 without findings, 1 with findings that are not accepted, 2 if the audit
    cannot run, 130 if interrupted.
    """
    from fuzzytree import api
    from fuzzytree.auditing import baseline_of, obsolete_ids, read_baseline, smt_text
    from fuzzytree.report import audit_lines, audit_verdict

    if options.target is not None and options.data is None:
        raise click.UsageError(
            "--target names a column of a table; give it with --data"
        )
    output = None if options.output == "-" else options.output
    if "-" in (options.page, options.write_baseline, options.smt):
        raise click.UsageError("`-` is stdout, where the findings go; name a file")
    known = configured(options.config, quiet=options.quiet)
    path = options.baseline or known.baseline
    accepted: Mapping[str, str] = {} if path is None else read_baseline(path)
    with wrong_options(), progress_bar(quiet=options.quiet) as show:
        material = api.material(
            options.model,
            data=table_of(options.data, options),
            target=options.target,
            results=options.results,
            allow_loss=options.allow_loss,
        )
        found = api.audit(
            material,
            within=options.within,
            spreads=options.spreads,
            limits={
                **{one.variable: (one.from_, one.to) for one in known.limits},
                **limits_of(options.limits),
            },
            row=row_of(options.row),
            select=codes_of(options.select) or known.select,
            skip=codes_of(options.skip) or known.skip,
            accepted=accepted,
            settings=settings_of(options.settings, options.budget, known),
            repeat=repeating(click.get_current_context()),
            progress=show,
        )
    form: Form | Literal["json"] = "json" if options.as_json else options.form
    known_ids = accepted if path else None
    lost = [*obsolete_ids(accepted, found)]
    if form == "text":
        text = "\n".join(
            audit_lines(
                found,
                _lines_of(material),
                gone=lost,
                is_coloured=sys.stdout.isatty() and not os.environ.get("NO_COLOR"),
                is_verbose=options.verbose,
                is_whole=options.is_whole,
            )
        )
    else:
        text = _for_programs(found, form, known_ids)
    wrote: list[str] = []
    try:  # a reader who leaves early costs no file, and a full disk not the text
        if output is not None:
            write_atomically(output, f"{text}\n".encode())
            wrote.append(output)
        if options.page is not None:
            _write_page(found, material, options.page)
            wrote.append(options.page)
        if options.smt is not None:
            write_atomically(options.smt, smt_text(found, material.model).encode())
            wrote.append(options.smt)
        if options.write_baseline is not None:
            write_atomically(options.write_baseline, baseline_of(found))
            said = f"{len(found.findings)} accepted with --baseline"
            wrote.append(f"{options.write_baseline} {said} {options.write_baseline}")
    finally:
        if output is None and text:  # no finding is no annotation
            answer_styled(text)
        for one in wrote:
            say(f"wrote    {one}", quiet=options.quiet)
    _tell_domain(found, quiet=options.quiet)
    for name in lost:
        say(f"gone     {name} {printable(accepted[name])}", quiet=options.quiet)
    fails = options.write_baseline is None and _fails(
        found, options.fail_on or known.fail_on
    )
    if form != "text" or output is not None:
        say(audit_verdict(found, lost), quiet=options.quiet and not fails)
    return 130 if found.was_interrupted else int(fails)


def _for_programs(found: Audit, form: str, baseline: Mapping[str, str] | None) -> str:
    """Return an audit as JSON, SARIF or annotations of a code host."""
    match form:
        case "sarif":
            from fuzzytree.report import sarif_text

            return printable_json(sarif_text(found, baseline))
        case "github":
            from fuzzytree.report import annotation_lines

            return "\n".join(annotation_lines(found))
        case _:
            return printable_json(found.to_json())


def _lines_of(material: Material) -> list[str]:
    """Return the lines of a model's file, for people."""
    from fuzzytree.formats import split_lines

    content = material.file.content if material.file else b""
    is_wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    text = content.decode("utf-16" if is_wide else "utf-8-sig", "replace")
    return split_lines(text)


def _tell_domain(found: Audit, *, quiet: bool) -> None:
    """Report the limits that the model does not declare."""
    guessed = [one for one in found.domain.sides if one.origin == "curves"]
    for one in guessed[:_MOST_LIMITS]:
        say(
            f"limits   {one.variable!r} declares no range; audited from {one.low!r} to "
            f"{one.high!r}, where its curves change; --limits NAME=LOW:HIGH sets it",
            quiet=quiet,
        )
    if len(guessed) > _MOST_LIMITS:
        say(f"limits   and {len(guessed) - _MOST_LIMITS} more", quiet=quiet)
    unused = [one.variable for one in found.domain.sides if one.origin == "unused"]
    if unused:
        names = ", ".join(map(repr, unused[:10])) + (", ..." if unused[10:] else "")
        said = "no range is known, and nothing depends on it"
        say(f"limits   {names}: {said}; any number will do", quiet=quiet)


def _write_page(found: Audit, material: Material, page: str) -> None:
    from fuzzytree import report
    from fuzzytree.checking import Stability
    from fuzzytree.model import Agreement

    records = [one.record for one in material.results]
    text = report.page(
        found,
        material.model,
        rows=material.rows,
        agreement=next((one for one in records if isinstance(one, Agreement)), None),
        stability=next((one for one in records if isinstance(one, Stability)), None),
    )
    write_atomically(page, text.encode())


def _fails(found: Audit, least: FailOn | None) -> bool:
    """Return whether something is found of at least a severity."""
    grades = ("never", "error", "warning", "info")
    failing = grades[: grades.index(least or "warning") + 1]
    return any(answer.severity in failing for answer in found.open_findings)

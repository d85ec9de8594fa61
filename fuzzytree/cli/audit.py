"""`fuzzytree audit`: what is odd in a rule base, proved or shown at a point?"""

from __future__ import annotations

import io
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click
import msgspec

from fuzzytree.cli.talk import (
    allow_loss_option,
    answer,
    delimiter_option,
    json_option,
    progress_bar,
    quiet_option,
    say,
    setting,
    standard_input,
    wrong_options,
)
from fuzzytree.files import check_place, read_bounded, write_atomically

if TYPE_CHECKING:
    from fuzzytree.auditing.configuration import Configuration, FailOn
    from fuzzytree.auditing.records import Audit, Settings

Form = Literal["text", "json", "sarif", "github"]


class Options(msgspec.Struct, frozen=True):
    """The options of the command line, as they were written.

    Attributes:
        within: `model` or `data`.
        spreads: So many spreads around the fitted sets, if given.
        limits: NAME=LOW:HIGH, each.
        row: NAME=VALUE, joined by commas, if given.
        select: Beginnings of codes, joined by commas, each.
        ignore: The same.
        budget: In seconds, if given.
        settings: NAME=VALUE, each.
    """

    within: Literal["model", "data"]
    spreads: float | None
    limits: tuple[str, ...]
    row: str | None
    select: tuple[str, ...]
    ignore: tuple[str, ...]
    budget: float | None
    settings: tuple[str, ...]


_OPTIONS = (
    click.option("--data", metavar="TABLE", help="Rows of your own."),
    click.option("--target", metavar="COLUMN", help="The classes in TABLE."),
    click.option(
        "--within",
        type=click.Choice(["model", "data"]),
        default="model",
        show_default=True,
        help="Ask on the model's ranges, or on those of TABLE.",
    ),
    click.option(
        "--spreads", type=float, metavar="K", help="Ask K spreads around the sets."
    ),
    click.option(
        "--limits",
        metavar="NAME=LOW:HIGH",
        multiple=True,
        help="Ask about these values of a variable (repeat).",
    ),
    click.option(
        "--row", metavar="NAME=VALUE,...", help="How far is another decision from here?"
    ),
    click.option(
        "--select", metavar="CODES", multiple=True, help="Ask these only, as FT1,FT301."
    ),
    click.option("--ignore", metavar="CODES", multiple=True, help="Leave these out."),
    click.option(
        "--budget", type=float, metavar="SECONDS", help="Begin nothing after; 60."
    ),
    click.option(
        "--set",
        "settings",
        metavar="NAME=VALUE",
        multiple=True,
        help="epsilon, margin, lead, level, overlap, rows or seed (repeat).",
    ),
)


def _with_options(function: Callable[..., int]) -> Callable[..., int]:
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@click.command("audit", short_help="Find what is odd in a rule base, and prove it.")
@click.argument("model", metavar="MODEL")
@_with_options
@click.option(
    "--config",
    metavar="FILE",
    help="fuzzytree-audit.yaml, if it is here, unless given.",
)
@click.option("--baseline", metavar="FILE", help="Findings that are accepted.")
@click.option("--write-baseline", metavar="FILE", help="Accept all that is found.")
@click.option(
    "--fail-on",
    type=click.Choice(["error", "warning", "info", "never"]),
    help="Exit 1 from this severity on; warning.",
)
@click.option(
    "--output-format",
    "form",
    type=click.Choice(["text", "json", "sarif", "github"]),
    default="text",
    show_default=True,
)
@click.option("-o", "--output", metavar="FILE", help="Instead of stdout.")
@click.option("--page", metavar="FILE", help="Write a page for a browser as well.")
@delimiter_option
@allow_loss_option
@json_option
@quiet_option
def command(
    model: str,
    data: str | None,
    target: str | None,
    config: str | None,
    baseline: str | None,
    write_baseline: str | None,
    fail_on: FailOn | None,
    form: Form,
    output: str | None,
    page: str | None,
    delimiter: str | None,
    allow_loss: bool,
    as_json: bool,
    quiet: bool,
    within: Literal["model", "data"],
    spreads: float | None,
    limits: tuple[str, ...],
    row: str | None,
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    budget: float | None,
    settings: tuple[str, ...],
) -> int:
    """Ask MODEL, any file that can be read, for rules that never win, gaps, conflicts.

    Each answer is PROVED on all of the domain, shown by a WITNESS, a BRACKET around a
    number, SAMPLED or DECLINED. Ctrl-C keeps what is proved. Exit 1 if something is
    found that is not accepted; `fuzzytree explain CODE` tells what to do about it.
    """
    from fuzzytree import verbs
    from fuzzytree.auditing.baselines import baseline_of, gone, read_baseline

    for place in (output, page, write_baseline):
        if place is not None:
            check_place(place)
    if target is not None and data is None:
        raise click.UsageError(
            "--target names a column of a table; give it with --data"
        )
    asked = Options(within, spreads, limits, row, select, ignore, budget, settings)
    known = _configuration(config, quiet=quiet)
    path = baseline or known.baseline
    accepted: Mapping[str, str] = {} if path is None else read_baseline(path)
    table = _table(data)
    with wrong_options(), progress_bar(quiet=quiet) as tell:
        found = verbs.audit(
            model,
            data=table,
            target=target,
            delimiter=delimiter,
            within=within,
            spreads=spreads,
            limits={**{n: (a, b) for n, a, b in known.limits}, **_limits(limits)},
            row=_row(row),
            select=_codes(select) or known.select,
            ignore=_codes(ignore) or known.ignore,
            settings=_settings(asked, known),
            accepted=accepted,
            allow_loss=allow_loss,
            repeat=_repeat(model, data, target, config, asked),
            progress=tell,
        )
    _tell_domain(found, quiet=quiet)
    text = _told(found, "json" if as_json else form, model, accepted if path else None)
    if output is None:
        if text:  # no finding is no annotation
            answer(text)
    else:
        write_atomically(output, f"{text}\n".encode())
        say(f"wrote    {output}", quiet=quiet)
    if page is not None:
        _write_page(found, model, page, table, target, delimiter, allow_loss=allow_loss)
        say(f"wrote    {page}", quiet=quiet)
    if write_baseline is not None:
        write_atomically(write_baseline, baseline_of(found))
        said = f"{len(found.findings)} accepted with --baseline {write_baseline}"
        say(f"wrote    {write_baseline} {said}", quiet=quiet)
    lost = [*gone(accepted, found)]
    for name in lost:
        say(f"gone     {name} {accepted[name]}", quiet=quiet)
    fails = write_baseline is None and _fails(found, fail_on or known.fail_on)
    _tell_verdict(found, lost, quiet=quiet and not fails)
    return 130 if found.was_interrupted else int(fails)


# --- options to values


def _configuration(path: str | None, *, quiet: bool) -> Configuration:
    """Return the configuration of a file: the named one, or one that is here."""
    from fuzzytree.auditing.configuration import (
        FILE,
        Configuration,
        read_configuration,
    )

    if path is None and not Path(FILE).is_file():
        return Configuration()
    found = read_configuration(path or FILE)
    say(f"read     {path or FILE}", quiet=quiet)
    return found


def _codes(texts: Sequence[str]) -> tuple[str, ...]:
    return tuple(code.strip() for text in texts for code in text.split(","))


def _limits(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the ends of variables.

    Raises:
        click.UsageError: If one is not NAME=LOW:HIGH.
    """
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, ends = text.rpartition("=")
        low, mark, high = ends.partition(":")
        if not name or not mark:
            raise click.UsageError(f"--limits {text}: must be NAME=LOW:HIGH")
        if name in found:
            raise click.UsageError(f"--limits {text}: {name!r} has limits already")
        found[name] = _number(low, text), _number(high, text)
    return found


def _row(text: str | None) -> dict[str, float] | None:
    """Return a row.

    Raises:
        click.UsageError: If it is not NAME=VALUE,...
    """
    if text is None:
        return None
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = part.rpartition("=")
        if not name.strip():
            raise click.UsageError(f"--row {text}: must be NAME=VALUE,NAME=VALUE,...")
        found[name.strip()] = _number(value, text, option="--row")
    return found


def _number(text: str, whole: str, *, option: str = "--limits") -> float:
    try:
        return float(text)
    except ValueError:
        what = f"{option} {whole}: {text!r} is no number"
        raise click.UsageError(what) from None


def _settings(asked: Options, known: Configuration) -> Settings:
    """Return the settings of the configuration with those of the command line.

    Raises:
        ValueError: If one is out of its range.
    """
    from fuzzytree.auditing.selecting import changed, check_settings

    found = changed(known.settings, dict(map(setting, asked.settings)))
    if asked.budget is not None:
        found = msgspec.structs.replace(found, budget_s=asked.budget)
        check_settings(found)
    return found


def _table(data: str | None) -> str | io.BytesIO | None:
    """Return a table by its path; standard input is read whole, to name its bytes."""
    if data != "-":
        return data
    return io.BytesIO(standard_input().read())


def _repeat(
    model: str,
    data: str | None,
    target: str | None,
    config: str | None,
    asked: Options,
) -> str:
    """Return the command that asks the same, but for the choice of codes."""
    words = ["fuzzytree", "audit", model]
    for name, value in (
        ("--data", data),
        ("--target", target),
        ("--config", config),
        ("--spreads", asked.spreads),
        ("--budget", asked.budget),
        ("--row", asked.row),
    ):
        words += [] if value is None else [name, str(value)]
    words += [] if asked.within == "model" else ["--within", asked.within]
    for name, values in (("--limits", asked.limits), ("--set", asked.settings)):
        words += [word for value in values for word in (name, value)]
    return shlex.join(words)


# --- what is told


def _told(
    found: Audit, form: Form, model: str, baseline: Mapping[str, str] | None
) -> str:
    """Return an audit in the form that was asked for."""
    from fuzzytree.report.annotations import annotation_lines
    from fuzzytree.report.audit import audit_lines
    from fuzzytree.report.sarif import sarif

    match form:
        case "json":
            raw = msgspec.json.encode(found)
            return msgspec.json.format(raw, indent=2).decode()
        case "sarif":
            return sarif(found, baseline)
        case "github":
            return "\n".join(annotation_lines(found))
        case "text":
            lines = audit_lines(found, _lines_of(model), is_coloured=_is_coloured())
            return "\n".join(lines)


def _lines_of(model: str) -> list[str]:
    """Return the lines of a file, for people."""
    return read_bounded(model).decode("utf-8-sig", "replace").split("\n")


def _is_coloured() -> bool:
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def _tell_domain(found: Audit, *, quiet: bool) -> None:
    """Say which limits nobody declared."""
    guessed = [one for one in found.domain.sides if one.origin == "curves"]
    for one in guessed[:10]:
        say(
            f"limits   {one.variable!r} declares no range; asked from {one.low!r} to "
            f"{one.high!r}, the span of its curves",
            quiet=quiet,
        )
    if len(guessed) > 10:
        say(f"limits   and {len(guessed) - 10} more so", quiet=quiet)


def _write_page(
    found: Audit,
    model: str,
    page: str,
    table: str | io.BytesIO | None,
    target: str | None,
    delimiter: str | None,
    *,
    allow_loss: bool,
) -> None:
    from fuzzytree import verbs
    from fuzzytree.report import audit_page

    if isinstance(table, io.BytesIO):
        table.seek(0)
    document = verbs.load(model, allow_loss=allow_loss)
    rows = verbs.audited_rows(table, document, target=target, delimiter=delimiter)
    write_atomically(page, audit_page.page(found, document, rows=rows).encode())


def _fails(found: Audit, least: FailOn | None) -> bool:
    """Return whether something is found of at least a severity."""
    grave = {
        "error": ("error",),
        "warning": ("error", "warning"),
        "info": ("error", "warning", "info"),
        "never": (),
    }
    failing = grave[least or "warning"]
    return any(answer.severity in failing for answer in found.open_findings)


def _tell_verdict(found: Audit, lost: Sequence[str], *, quiet: bool) -> None:
    from fuzzytree.report.audit import verdict_text

    say(verdict_text(found, lost), quiet=quiet)

"""The options of `fuzzytree audit`, and the values that they stand for."""

from __future__ import annotations

import io
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli.console import (
    TableOptions,
    option,
    say,
    setting,
    standard_input,
    table_format,
    table_source,
)

if TYPE_CHECKING:
    from fuzzytree.auditing import AuditSettings, Configuration


def configured(path: str | None, *, quiet: bool) -> Configuration:
    """Return the configuration of a file: the named one, or one that is here."""
    from fuzzytree.auditing import FILE, Configuration, read_configuration

    if path is None and not Path(FILE).is_file():
        return Configuration()
    found = read_configuration(path or FILE)
    say(f"read     {path or FILE}", quiet=quiet)
    return found


def codes_of(texts: Sequence[str]) -> tuple[str, ...]:
    """Return the beginnings of codes, which commas part."""
    return tuple(code.strip() for text in texts for code in text.split(","))


def limits_of(texts: Sequence[str]) -> dict[str, str]:
    """Return the limits of variables, as they are written.

    Raises:
        click.UsageError: If one is not NAME=LOW:HIGH or NAME=CATEGORY,...
    """
    found: dict[str, str] = {}
    for text in texts:
        name, _, ends = text.rpartition("=")
        if not name or not ends:
            must = "must be NAME=LOW:HIGH, or NAME=CATEGORY,..."
            raise click.UsageError(f"--limits {text}: {must}")
        if name in found:
            raise click.UsageError(f"--limits {text}: {name!r} has limits already")
        found[name] = ends
    return found


row_option = option(
    "--row NAME=VALUE,...", "Row to explain, with the nearest row of another class."
)


def row_of(text: str | None, words: str = "--row") -> dict[str, float | str] | None:
    """Return values by name, as they are written, perhaps with commas, or as JSON.

    Raises:
        click.UsageError: If it is neither NAME=VALUE,... nor an object of JSON.
    """
    if text is None:
        return None
    if text.startswith("{"):
        try:
            return msgspec.json.decode(text, type=dict[str, float | str])
        except msgspec.MsgspecError as error:
            must = 'must be {"NAME": VALUE, ...} with numbers and texts'
            raise click.UsageError(f"{words} {text}: {must}") from error
    found: dict[str, float | str] = {}
    for part in re.split(r",(?=[^,]*=)", text):
        name, _, value = part.rpartition("=")
        if not name.strip():
            raise click.UsageError(f"{words} {text}: must be NAME=VALUE,NAME=VALUE,...")
        if name.strip() in found:
            raise click.UsageError(f"{words} {text}: {name.strip()!r} stands twice")
        found[name.strip()] = value
    return found


def settings_of(
    texts: Sequence[str], budget: float | None, known: Configuration
) -> AuditSettings:
    """Return the settings of the configuration with those of the command line.

    Raises:
        ValueError: If one is out of its range.
    """
    from fuzzytree.auditing import check_settings, settings_with

    values = dict(setting(text, "--setting") for text in texts)
    found = settings_with(known.audit_settings, values)
    if budget is not None:
        found = msgspec.structs.replace(found, budget=budget)
        check_settings(found)
    return found


def table_of(data: str | None, options: TableOptions) -> object:
    """Return a table by its path; standard input is read whole, to name its bytes."""
    whole = io.BytesIO(standard_input().read()) if data == "-" else data
    return table_source(whole, options)


_REPEATED = (
    *("data", "target", "config", "spreads", "budget", "row"),
    *("within", "limits", "settings", "read_as"),
)
"""The parameters that the command of an answer has."""


def repeating(context: click.Context) -> str:
    """Return the command that repeats an audit, without its choice of codes."""
    words = ["fuzzytree", "audit", context.params["model"]]
    options = {option.name: option for option in context.command.params}
    for name in _REPEATED:
        value, option = context.params[name], options[name].opts[-1]
        for one in value if isinstance(value, tuple) else (value,):
            if one is not None and (name, one) != ("within", "model"):
                said = one if isinstance(one, str) else repr(one).removesuffix(".0")
                words += [option, said]
    table = TableOptions()
    vars(table).update(context.params)
    return shlex.join([*words, *table_format(table).words()])

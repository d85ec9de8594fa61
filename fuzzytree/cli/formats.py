"""`fuzzytree formats`: what can be read, written and run, found by trying."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from fuzzytree.cli.console import (
    answer,
    answer_json,
    json_option,
    option,
    takes,
    verbose_option,
    wrong_options,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fuzzytree.checking import Ability
    from fuzzytree.model import Format


class FormatsOptions:
    """The arguments and options of the verb."""

    name: str | None = option(
        "--format NAME", "Format to describe with its options and limits."
    )
    verbose: bool = verbose_option
    as_json: bool = json_option


@click.command("formats", short_help="List formats and runtimes.")
@takes(FormatsOptions)
def command(options: FormatsOptions) -> None:
    """List the formats and the runtimes, with what each can and cannot carry.

    With `--verbose`, each format writes and reads a small model of each kind, and a
    table shows the results.
    """
    from fuzzytree import report
    from fuzzytree.cli.doctor import missing_extras
    from fuzzytree.exporters import all_formats, all_plugins, find_format
    from fuzzytree.runtimes import all_runtimes

    missing = missing_extras()
    if options.name is not None:
        with wrong_options():
            _answer_one(
                find_format(options.name),
                missing,
                verbose=options.verbose,
                as_json=options.as_json,
            )
        return
    plugins = all_plugins()
    others = [one.format for one in plugins if one.format is not None]
    formats, runtimes = (*all_formats(), *others), all_runtimes()
    found = {
        one.name: _abilities(one, missing)
        for one in formats
        if options.as_json or options.verbose
    }
    if options.as_json:
        answer_json(
            {
                "formats": [_facts(one, found[one.name], missing) for one in formats],
                "runtimes": [report.runtime_facts(one, missing) for one in runtimes],
                "plugins": [
                    {"name": one.name, "package": one.package, "fault": one.fault}
                    for one in plugins
                ],
            }
        )
        return
    lines = report.overview_lines(
        formats, runtimes, missing, is_verbose=options.verbose
    )
    answer("\n".join(lines))
    if plugins:
        answer("formats of other packages:")
        rows = (f"  {one.name}: {one.fault or one.package}" for one in plugins)
        answer("\n".join(rows))
    if options.verbose:
        answer("")
        answer("\n".join(report.ability_lines(found)))


def _abilities(
    form: Format, missing: set[str], dialect: str | None = None
) -> tuple[Ability, ...] | str:
    """Return what a format can carry, or why that cannot be tried."""
    from fuzzytree.checking import abilities_of
    from fuzzytree.errors import FuzzyTreeError, install_hint
    from fuzzytree.exporters import TABLE

    if form.extra in missing:
        return f"not tried: it needs {install_hint(form.extra)}"
    try:
        return abilities_of(form, dialect=dialect)
    except FuzzyTreeError as error:
        return f"not tried: {error}"
    except Exception as error:
        if form.name in TABLE:
            raise
        # It is of others: what is wrong with it must not keep ours from being listed.
        return f"it raises {type(error).__name__}: {error}"


def _answer_one(
    form: Format, missing: set[str], *, verbose: bool, as_json: bool
) -> None:
    from fuzzytree import report
    from fuzzytree.checking import dialects_of
    from fuzzytree.model import options_of

    found = _abilities(form, missing)
    wanted = dialects_of(form) if verbose or as_json else ()
    dialects = {name: _abilities(form, missing, name) for name in wanted}
    if as_json:
        known = {k: v for k, v in dialects.items() if not isinstance(v, str)}
        answer_json({**_facts(form, found, missing), "dialects": known})
        return
    lines = report.detail_lines(
        form, found, options_of(form), dialects, is_verbose=verbose
    )
    answer("\n".join(lines))


def _facts(
    form: Format, found: Sequence[Ability] | str, missing: set[str]
) -> dict[str, object]:
    from fuzzytree import report
    from fuzzytree.model import options_of

    is_known = not isinstance(found, str)
    return {
        **report.format_facts(form, missing),
        "options": options_of(form),
        "abilities": found if is_known else [],
        "not_tried": "" if is_known else found,
    }

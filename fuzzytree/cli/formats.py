"""`fuzzytree formats`: what can be read, written and run, found by trying."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from fuzzytree.cli.talk import answer, answer_json, json_option, wrong_options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fuzzytree.checking.abilities import Ability
    from fuzzytree.exporters.plugins import Plugin
    from fuzzytree.model.contracts import Format


@click.command("formats", short_help="List formats and runtimes.")
@click.option("--format", "name", metavar="NAME", help="Everything about one format.")
@json_option
def command(name: str | None, as_json: bool) -> None:
    """List the formats and the runtimes, with what each can and cannot carry.

    Each format writes and reads a small model of each kind; the table tells what came
    of it.
    """
    from fuzzytree.cli.doctor import missing_extras
    from fuzzytree.exporters import all_formats, find_format
    from fuzzytree.exporters.plugins import all_plugins
    from fuzzytree.report import formats as shown
    from fuzzytree.report import text
    from fuzzytree.runtimes import all_runtimes

    missing = missing_extras()
    if name is not None:
        with wrong_options():
            _tell_one(find_format(name), missing, as_json=as_json)
        return
    plugins = all_plugins()
    others = [one.format for one in plugins if one.format is not None]
    formats, runtimes = (*all_formats(), *others), all_runtimes()
    found = {one.name: _abilities(one, missing) for one in formats}
    if as_json:
        answer_json(
            {
                "formats": [_facts(one, found[one.name], missing) for one in formats],
                "runtimes": [text.runtime_facts(one, missing) for one in runtimes],
                "plugins": [_plugin_facts(one) for one in plugins],
            }
        )
        return
    answer("\n".join(text.format_lines(formats, missing)))
    if plugins:
        answer("formats of other packages:")
        answer(
            "\n".join(f"  {one.name}: {one.fault or one.package}" for one in plugins)
        )
    answer("")
    answer("\n".join(shown.ability_lines(found)))
    answer("")
    answer("\n".join(text.runtime_lines(runtimes, missing)))


def _abilities(
    form: Format, missing: set[str], dialect: str | None = None
) -> tuple[Ability, ...] | str:
    """Return what a format can carry, or why that cannot be tried."""
    from fuzzytree.checking.abilities import abilities
    from fuzzytree.errors import FuzzyTreeError, install_hint
    from fuzzytree.exporters import TABLE

    if form.extra in missing:
        return f"not tried: it needs {install_hint(form.extra)}"
    try:
        return abilities(form, dialect=dialect)
    except FuzzyTreeError as error:
        return f"not tried: {error}"
    except Exception as error:
        if form.name in TABLE:
            raise
        # It is of others: what is wrong with it must not keep ours from being listed.
        return f"it raises {type(error).__name__}: {error}"


def _tell_one(form: Format, missing: set[str], *, as_json: bool) -> None:
    from fuzzytree.checking.abilities import dialects_of
    from fuzzytree.model.options import options_of
    from fuzzytree.report import formats as shown

    found = _abilities(form, missing)
    dialects = {name: _abilities(form, missing, name) for name in dialects_of(form)}
    if as_json:
        known = {k: v for k, v in dialects.items() if not isinstance(v, str)}
        answer_json({**_facts(form, found, missing), "dialects": known})
        return
    answer("\n".join(shown.detail_lines(form, found, options_of(form), dialects)))


def _facts(
    form: Format, found: Sequence[Ability] | str, missing: set[str]
) -> dict[str, object]:
    from fuzzytree.model.options import options_of
    from fuzzytree.report import text

    is_known = not isinstance(found, str)
    return {
        **text.format_facts(form, missing),
        "options": options_of(form),
        "abilities": found if is_known else [],
        "not_tried": "" if is_known else found,
    }


def _plugin_facts(one: Plugin) -> dict[str, object]:
    return {"name": one.name, "package": one.package, "fault": one.fault}

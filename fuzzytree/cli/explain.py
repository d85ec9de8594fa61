"""`fuzzytree explain`: what a code of an audit means, and what to do about it."""

from __future__ import annotations

import click

from fuzzytree.cli.console import answer, answer_json, json_option, verbose_option


@click.command("explain", short_help="Explain a code of an audit.")
@click.argument("code", metavar="[CODE]", required=False)
@verbose_option
@json_option
def command(code: str | None, verbose: bool, as_json: bool) -> None:
    """Explain what CODE means, why it matters, and what to do; list all codes without.

    CODE is a code such as FT101, the id of a finding such as FT101-1a2b3c4d, or the
    beginning of codes to list, such as FT1.
    """
    from fuzzytree.auditing import CODES
    from fuzzytree.model import name_choice
    from fuzzytree.report import code_lines, explanation_lines

    name = (code or "FT").upper().partition("-")[0]
    if name in CODES:
        found = CODES[name]
        if as_json:
            answer_json(found)
        else:
            answer("\n".join(explanation_lines(found)))
        return
    begin = [one for one in CODES.values() if one.code.startswith(name)]
    if not begin:
        raise click.UsageError(
            f"no code {(code or '')[:40]!r}; {name_choice(name[:40], [*CODES])}"
        )
    if as_json:
        answer_json(begin)
    else:
        answer("\n".join(code_lines(begin, is_whole=verbose or code is not None)))

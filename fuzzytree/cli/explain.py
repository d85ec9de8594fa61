"""`fuzzytree explain`: what a code of an audit means, and what to do about it."""

from __future__ import annotations

import click

from fuzzytree.cli.talk import answer, answer_json, json_option


@click.command("explain", short_help="Say what a code of an audit means.")
@click.argument("code", metavar="[CODE]", required=False)
@json_option
def command(code: str | None, as_json: bool) -> None:
    """Say what CODE means, why it matters, and what to do; list all codes without."""
    from fuzzytree.auditing.codes import CODES
    from fuzzytree.report.explanations import code_lines, explanation_lines
    from fuzzytree.rulebase import name_choice

    if code is None:
        if as_json:
            answer_json([*CODES.values()])
        else:
            answer("\n".join(code_lines()))
        return
    # An id such as FT101-1a2b3c4d names its code, too.
    name = code.upper().partition("-")[0]
    if name not in CODES:
        raise click.UsageError(f"no code {code[:40]!r}; {name_choice(name, [*CODES])}")
    if as_json:
        answer_json(CODES[name])
    else:
        answer("\n".join(explanation_lines(CODES[name])))

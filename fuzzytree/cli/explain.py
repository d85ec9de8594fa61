"""`fuzzytree explain`: what a code of an audit means, and what to do about it."""

from __future__ import annotations

import click

from fuzzytree.cli.console import (
    answer,
    answer_json,
    argument,
    json_option,
    takes,
    verbose_option,
)


class ExplainOptions:
    """The arguments and options of the verb."""

    code: str | None = argument("[CODE]", required=False)
    verbose: bool = verbose_option
    as_json: bool = json_option


@click.command("explain", short_help="Explain a code of an audit.")
@takes(ExplainOptions)
def command(options: ExplainOptions) -> None:
    """Explain what CODE means, why it matters, and what to do; list all codes without.

    CODE is a code such as FT101, the id of a finding such as FT101-1a2b3c4d, or the
    beginning of codes to list, such as FT1.
    """
    from fuzzytree.auditing import CODES
    from fuzzytree.model import name_choice
    from fuzzytree.report import code_lines, explanation_lines

    name = (options.code or "FT").upper().partition("-")[0]
    if name in CODES:
        found = CODES[name]
        if options.as_json:
            answer_json(found)
        else:
            answer("\n".join(explanation_lines(found)))
        return
    begin = [one for one in CODES.values() if one.code.startswith(name)]
    if not begin:
        raise click.UsageError(
            f"no code {(options.code or '')[:40]!r}; {name_choice(name[:40], [*CODES])}"
        )
    if options.as_json:
        answer_json(begin)
    else:
        answer(
            "\n".join(
                code_lines(begin, is_whole=options.verbose or options.code is not None)
            )
        )

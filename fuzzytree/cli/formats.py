"""`fuzzytree formats`: what can be read, written and run."""

from __future__ import annotations

import click

from fuzzytree.cli.talk import answer, answer_json, json_option


@click.command("formats", short_help="List formats and runtimes.")
@json_option
def command(as_json: bool) -> None:
    """List the formats and the runtimes, with what each cannot do."""
    from fuzzytree.cli.doctor import missing_extras
    from fuzzytree.exporters import all_formats
    from fuzzytree.report import text
    from fuzzytree.runtimes import all_runtimes

    formats, runtimes, missing = all_formats(), all_runtimes(), missing_extras()
    if as_json:
        answer_json(
            {
                "formats": [text.format_facts(one, missing) for one in formats],
                "runtimes": [text.runtime_facts(one, missing) for one in runtimes],
            }
        )
        return
    answer("\n".join(text.format_lines(formats, missing)))
    answer("")
    answer("\n".join(text.runtime_lines(runtimes, missing)))

"""`fuzzytree tactile ports`: the serial ports of this computer."""

from __future__ import annotations

import click

from fuzzytree.cli import answer, answer_json, json_option, say


@click.command("ports", short_help="List the serial ports.")
@json_option
def command(as_json: bool) -> None:
    """List the serial ports of this computer, one a line."""
    from fuzzytree.report import aligned
    from fuzzytree.tactile.link import ports

    found = ports()
    if as_json:
        answer_json(found)
        return
    if not found:
        say("there is no serial port")
        return
    for line in aligned([(port.device, port.description, port.ids) for port in found]):
        answer(line.rstrip())

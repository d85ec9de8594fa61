"""`fuzzytree tactile ports`: the serial ports of this computer."""

from __future__ import annotations

import click

from fuzzytree.cli import answer, answer_json, json_option, say, takes


class TactilePortsOptions:
    """The arguments and options of the verb."""

    as_json: bool = json_option


@click.command("ports", short_help="List the serial ports.")
@takes(TactilePortsOptions)
def command(options: TactilePortsOptions) -> None:
    """List the serial ports of this computer, one a line."""
    from fuzzytree.report import aligned
    from fuzzytree.tactile.link import ports

    found = ports()
    if options.as_json:
        answer_json(found)
        return
    if not found:
        say("there is no serial port")
        return
    for line in aligned([(port.device, port.description, port.ids) for port in found]):
        answer(line.rstrip())

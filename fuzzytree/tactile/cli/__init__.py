"""`fuzzytree tactile`: boards, recordings, features and what lies on the sensor."""

from __future__ import annotations

import importlib

import click

ACTIONS = (
    "ports",
    "record",
    "replay",
    "live",
    "simulate",
    "press",
    "features",
    "interpolate",
    "export",
    "check",
)
"""Each action is the `command` of the module `fuzzytree.tactile.cli.ACTION`."""


class Actions(click.Group):
    """A group that imports an action's module on its first use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the actions in the order in which one needs them."""
        return list(ACTIONS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return an action, or None if there is none of that name."""
        if cmd_name not in ACTIONS:
            return None
        module = importlib.import_module(f"fuzzytree.tactile.cli.{cmd_name}")
        command: click.Command = module.command
        return command


@click.group(
    "tactile",
    cls=Actions,
    subcommand_metavar="ACTION [ARGUMENTS]...",
    short_help="Recognise what lies on a tactile sensor.",
)
def command() -> None:
    """Read boards, record and replay them, and recognise what lies on them."""

"""`fuzzytree tactile`: boards, recordings, features and what lies on the sensor."""

from __future__ import annotations

from types import MappingProxyType

import click

from fuzzytree.cli import Verbs

_ACTIONS = "ports record replay calibrate live features export check"


class Actions(Verbs):
    """The actions, in the order in which one needs them."""

    modules = MappingProxyType(
        {name: f"fuzzytree.tactile.cli.{name}" for name in _ACTIONS.split()}
    )


@click.group(
    "tactile",
    cls=Actions,
    subcommand_metavar="ACTION [ARGUMENTS]...",
    short_help="Recognise what lies on a tactile sensor.",
)
def command() -> None:
    """Read boards, record and replay them, and recognise what lies on them."""

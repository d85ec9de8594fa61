"""Run a click command of a benchmark as a program, with errors in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli.console import say
from fuzzytree.errors import FuzzyTreeError


def run(command: click.Command, arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0, or 2 if it could not run.

    Args:
        command: The command.
        arguments: The words after the program's name; those of the process if None.
    """
    try:
        command.main(arguments, standalone_mode=False)
    except click.ClickException as error:
        say(error.format_message())
        return 2
    except FuzzyTreeError as error:
        say(str(error))
        return 2
    return 0

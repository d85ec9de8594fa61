"""One name of an option means one thing in every verb, and old names lead to it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click
import pytest

from fuzzytree.cli.program import main, program

if TYPE_CHECKING:
    from tests.cli.conftest import Call

SAME = {
    "--allow-loss": "the losses of a format are accepted, at reading or at writing",
    "--board": "the board that the frames come from",
    "--budget": "the seconds that it may take",
    "--data": "rows, or frames, to use beside those that are generated",
    "--for": "the model whose leaves count rows",
    "--frames": "how many frames",
    "--json": "the result as JSON; `run` and `tactile live` write one a line",
    "--limits": "ranges of the space that is examined",
    "--output": "the file to write",
    "--picture": "the picture to draw; `bench` draws several",
    "--reject": "the strength below which an object is unknown",
    "--row": "a row by its values: what is explained, or drawn",
    "--runtime": "what runs the model; `run` takes one",
    "--seed": "the seed of what is random",
    "--select": "what to do of all there is",
    "--set": "an option of a writer, by its name",
    "--skip": "what to leave out of all there is",
    "--target": "the column of the classes",
    "--terms": "the kind of rules of a tree: those that equal it, or the paper's",
    "--to": "the format to write",
    "--tolerance": "the largest error of a degree where points stand for a curve",
    "--unit": "a unit; `learn` takes several, by column",
}
"""Options whose help differs between verbs, and what they mean in all of them."""


def commands(
    command: click.Command = program, name: str = ""
) -> Iterator[tuple[str, click.Command]]:
    """Yield all verbs, with those of groups."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for word in command.list_commands(context):
            below = command.get_command(context, word)
            assert below is not None
            yield from commands(below, f"{name} {word}".strip())
    else:
        yield name, command


def options() -> dict[str, dict[str, list[str]]]:
    """Return the verbs of each option, by its help, type and number of values."""
    found: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for verb, command in commands():
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                kind = (parameter.type, parameter.metavar, parameter.multiple)
                meaning = f"{parameter.help} {kind}"
                found[parameter.opts[-1]][meaning].append(verb)
    return found


def test_an_option_of_one_name_has_one_meaning() -> None:
    several = {name: verbs for name, verbs in options().items() if len(verbs) > 1}
    assert {name: verbs for name, verbs in several.items() if name not in SAME} == {}
    assert sorted(SAME) == sorted(several), "an explanation without need"


@pytest.mark.parametrize(
    ("words", "name", "hint"),
    [
        ("audit m.yaml --ignore FT5", "--ignore", "--skip"),
        ("learn t.csv --max-depth 3", "--max-depth", "--depth"),
        ("learn t.csv --random-state 3", "--random-state", "--seed"),
        ("bench m.yaml --only native", "--only", "--select"),
        ("bench m.yaml --plot a.svg", "--plot", "--picture"),
        ("needs m.yaml --time 3", "--time", "--budget"),
        ("check m.yaml --limit 9", "--limit", "--generate"),
        ("collect t.csv --columns a", "--columns", "--inputs"),
    ],
)
def test_the_name_that_another_tool_has_leads_to_ours(
    words: str, name: str, hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words.split()) == 2
    first = capsys.readouterr().err.splitlines()[0]
    assert first == f"no such option '{name}' (did you mean {hint!r}?)"


def test_the_help_of_learn_has_its_options_in_sections(call: Call) -> None:
    out = call("learn", "--help")[1]
    heads = [line for line in out.splitlines() if line.endswith(":") and line[0] != " "]
    assert heads == ["Table:", "Tree:", "Tree of --mode paper:", "Output:"]
    places = [out.index(f"\n{head}") for head in heads]
    for option, section in (
        ("--target", 0), ("--delimiter", 0), ("--leaves", 1), ("--seed", 1),
        ("--alpha", 2), ("--front", 3), ("--as", 3), ("--json", 3),
    ):  # fmt: skip
        assert sum(place < out.index(f"  {option} ") for place in places) == section + 1

"""`fuzzytree tactile press`: the paper's objects, pressed on a simulated sensor."""

from __future__ import annotations

import difflib
import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli import (
    ResultOptions,
    answer_bytes,
    answer_json,
    argument,
    option,
    say_rows,
    setting,
    several,
    takes,
    wrong_options,
)

if TYPE_CHECKING:
    from fuzzytree.tactile.simulation.physics import PhysicsSettings, Simulated


class TactilePressOptions(ResultOptions):
    """The arguments and options of the verb."""

    name: str = argument("OBJECT")
    count: int = option("--count NUMBER", "Presses of each object.", default=50)
    seed: int = option(
        "--seed NUMBER",
        "Random seed of the presses.",
        type=click.IntRange(0),
        default=0,
    )
    output: str = option(
        "-o --output FILE", "Archive to write (.npz); `-` is stdout.", required=True
    )
    changes: Sequence[str] = several(
        "--set NAME=VALUE",
        "Number of the simulator (repeat); see docs/explanation/simulator.md.",
    )


@click.command("press", short_help="Press objects on a simulated sensor.")
@takes(TactilePressOptions)
def command(options: TactilePressOptions) -> None:
    """Press OBJECT again and again on a sensor of 16 x 16 cells; `all` presses all.

    OBJECT is rectangle-0, rectangle-27, rectangle-45, circle, square, hand-0 or
    hand-45. FILE holds the frames, their labels and the reading of a saturated cell.
    """
    if options.output == "-" and options.as_json:
        raise click.UsageError("`-o -` leaves no room for --json on stdout")
    from fuzzytree.files import check_place, write_atomically
    from fuzzytree.tactile.simulation.objects import OBJECTS
    from fuzzytree.tactile.simulation.physics import press

    if options.output != "-":
        check_place(options.output)
    settings = physics_settings(options.changes)
    names = tuple(OBJECTS) if options.name == "all" else (options.name,)
    with wrong_options():
        found = {
            one: press(one, options.count, options.seed, settings) for one in names
        }
    width, objects = max(map(len, found)), list[dict[str, object]]()
    for name, made in found.items():
        clipped, outside = int(made.clipped.sum()), float(made.outside.max())
        over = f", up to {100 * outside:.0f} % over the edge" if outside > 1e-9 else ""
        said = f"{len(made.frames)} times, {clipped} cells clipped at full{over}"
        say_rows(("pressed", name, said), width=width, quiet=options.quiet)
        truth = asdict(made.truth)
        places = {key: truth[key] for key in ("x", "y", "angle_deg", "force_n")}
        arrays = {"clipped": made.clipped, "outside": made.outside, **places}
        objects.append({"name": name, **{k: one.tolist() for k, one in arrays.items()}})
    facts: dict[str, object] = {
        "count": options.count,
        "seed": options.seed,
        "settings": msgspec.structs.asdict(settings),
        "objects": objects,
    }
    content = _content(found)
    if options.output == "-":
        answer_bytes(content)
        return
    write_atomically(options.output, content)
    digest = hashlib.sha256(content).hexdigest()
    size = f"{len(content)} bytes, sha256 {digest}"
    words = ["fuzzytree", "tactile", "features", options.output, "--features", "S1, S9"]
    say_rows(
        ("wrote", options.output, size),
        ("next", shlex.join(words), ""),
        quiet=options.quiet,
    )
    facts |= {"file": options.output, "bytes": len(content), "sha256": digest}
    if options.as_json:
        answer_json(facts)


def physics_settings(changes: Sequence[str]) -> PhysicsSettings:
    """Return the simulator's settings with those that were given."""
    from fuzzytree.tactile.simulation.physics import PAPER

    before = msgspec.structs.asdict(PAPER)
    given: dict[str, object] = {}
    for change in changes:
        name, text = setting(change)
        if name not in before:
            close = difflib.get_close_matches(name, before, n=1)
            hint = f" (did you mean {close[0]!r}?)" if close else ""
            raise click.UsageError(
                f"the simulator has no setting {name!r}; "
                f"it has {', '.join(before)}{hint}"
            )
        if name in given:
            raise click.UsageError(f"the setting {name!r} is given twice")
        given[name] = _value(name, text, type(before[name]))
    try:
        return msgspec.structs.replace(PAPER, **given)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


def _value(name: str, text: str, kind: type) -> object:
    if kind is str:
        return text
    try:
        return kind(text)
    except ValueError as error:
        what = "a whole number" if kind is int else "a number"
        raise click.UsageError(f"{name}: must be {what}, not {text!r}") from error


def _content(found: dict[str, Simulated]) -> bytes:
    import numpy as np

    from fuzzytree.tactile.presses import Presses, presses_content

    frames = np.concatenate([made.frames for made in found.values()])
    sizes = [len(made.frames) for made in found.values()]
    label = np.repeat(np.arange(len(found)), sizes)
    sensor = next(iter(found.values())).sensor
    return presses_content(Presses(frames, sensor, label, tuple(found)))

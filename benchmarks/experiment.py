"""The paper's experiment: learn, test on what was not learnt from, and compare.

python benchmarks/experiment.py --help
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import click
import msgspec
from click.core import ParameterSource
from commands import run
from experiment_choosing import CANDIDATES
from experiment_peers import PEERS, are_there
from experiment_report import confusion_csv, experiment_lines
from experiment_simulated import IDEAL, TABLE_3, paper_task
from experiment_study import Outcome, experiment
from experiment_tasks import KNOWN, Task, file_task, known_task

from fuzzytree.cli.console import (
    ResultOptions,
    answer,
    answer_json,
    argument,
    option,
    progress_bar,
    say,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.errors import install_hint
from fuzzytree.files import check_place, write_atomically
from fuzzytree.learning import LearningSettings

_FRAMES_SHOWN = 7
"""Points for a cell in the pictures, as in the paper's Fig. 6."""


_ONLY = {
    "sensor": ("paper",),
    "repeats": ("paper",),
    "test": ("file",),
    "label": ("file",),
    "full": ("file",),
    "threshold": ("file",),
    "data": ("known",),
}
"""The kinds of task that an option is for."""


class ExperimentOptions(ResultOptions):
    """The arguments and options of the verb."""

    task: str = argument("[TASK]", default="paper")
    features: str | None = option(
        "--features NAMES", "Names and sets of features, with commas."
    )
    mode: Literal["default", "paper"] | None = option(
        "--mode",
        "`paper` is the paper's learner.",
        choices=["default", "paper"],
    )
    shrinkage: float | None = option(
        "--shrinkage", "Of off-diagonal scatter, 0 to 1.", type=float
    )
    entry: float | None = option(
        "--entry", "What a further feature must gain.", type=float
    )
    choose: bool = option(
        "--choose",
        "Choose shrinkage and entry without those who are tested.",
        is_flag=True,
    )
    sensor: str = option(
        "--sensor",
        "Of TASK paper: `ideal` is even and linear.",
        choices=["paper", "ideal"],
        default="paper",
    )
    seed: int = option(
        "--seed", "Of presses and peers.", type=click.IntRange(0), default=0
    )
    repeats: int = option(
        "--repeats",
        "Of TASK paper, each pressed anew.",
        type=click.IntRange(1, 100),
        default=5,
    )
    test: str | None = option("--test FILE.npz", "What FILE.npz is tested on.")
    label: str = option(
        "--label ARRAY", "The array of FILE.npz with the classes.", default="label"
    )
    full: int | None = option(
        "--full", "What a cell of FILE.npz reads at most.", type=int
    )
    threshold: int | None = option(
        "--threshold", "Above it a cell is pressed.", type=int
    )
    data: str | None = option("--data FOLDER", "Where the project's frames lie.")
    no_peers: bool = option(
        "--no-peers", "Without learners of scikit-learn.", is_flag=True
    )
    output: str | None = option("-o --output FOLDER", "For models and pictures.")


@click.command("experiment.py")
@takes(ExperimentOptions)
def command(options: ExperimentOptions) -> None:
    """Learn a tree of TASK, test it on frames it has not learnt from, and compare.

    TASK is paper (seven objects on the simulated sensor), postures or postures-17
    (people on a mat), touch or touch-fingers (people on a touch screen), or FILE.npz:
    frames of one's own with `label`, `label_names` and `subject`. Each subject is left
    out in turn and tested on; frames are never divided at random.
    """
    _check_options(options.task)
    if options.output is not None:
        check_place(Path(options.output, "tree.yaml"))
    given = {
        "mode": options.mode,
        "shrinkage": options.shrinkage,
        "entry": options.entry,
    }
    with wrong_options():
        if options.task == "paper":
            found = _paper(options.sensor, options.seed, options.repeats)
        else:
            found = _real(
                options.task,
                options.test,
                options.label,
                options.full,
                options.threshold,
                options.data,
            )
        settings = _changed(found.settings, given)
    peers = () if options.no_peers or not are_there() else tuple(PEERS)
    with wrong_options(), progress_bar(quiet=options.quiet) as tell:
        outcome = experiment(
            found,
            features=options.features,
            settings=settings,
            choose=CANDIDATES if options.choose else (),
            peers=peers,
            seed=options.seed,
            progress=tell,
        )
    lines = [*experiment_lines(outcome.study, printed=_printed(options.task))]
    if options.as_json:
        answer_json(outcome.study.to_json())
    else:
        answer("\n".join(lines))
    if not (peers or options.no_peers):
        say(
            f"without other learners: they need {install_hint('sklearn')}",
            quiet=options.quiet,
        )
    if options.output is not None:
        _write(Path(options.output), found, outcome, lines, quiet=options.quiet)


def _check_options(task: str) -> None:
    """Refuse a task that is none, and options that would do nothing for it.

    Raises:
        click.UsageError: If one was given.
    """
    context = click.get_current_context()
    kind = "paper" if task == "paper" else "file" if task.endswith(".npz") else "known"
    if kind == "known" and task not in KNOWN:
        there = f"paper, {', '.join(KNOWN)}, and FILE.npz for frames of your own"
        raise click.UsageError(f"there is no task {task!r}; there is {there}")
    for name, kinds in _ONLY.items():
        source = context.get_parameter_source(name)
        if kind not in kinds and source is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name} does nothing for {task!r}")


def _paper(sensor: str, seed: int, repeats: int) -> Task:
    if sensor == "ideal":
        about = "the paper's seven objects on an even and linear sensor"
        return paper_task(seed=seed, repeats=repeats, physics=IDEAL, about=about)
    return paper_task(seed=seed, repeats=repeats)


def _real(
    task: str,
    test: str | None,
    label: str,
    full: int | None,
    threshold: int | None,
    data: str | None,
) -> Task:
    if task in KNOWN or not task.endswith(".npz"):
        return known_task(task, data)
    return file_task(task, test=test, label=label, full=full, threshold=threshold)


def _changed(
    settings: LearningSettings, given: Mapping[str, object]
) -> LearningSettings:
    """Return the task's settings with those of the options in them.

    Another mode begins from its own defaults.

    Raises:
        ValueError: If one is out of its range.
    """
    asked = {name: value for name, value in given.items() if value is not None}
    base = (
        LearningSettings()
        if asked.get("mode", settings.mode) != settings.mode
        else settings
    )
    return msgspec.structs.replace(base, **asked)


def _printed(task: str) -> dict[str, int]:
    return dict(TABLE_3) if task == "paper" else {}


def _write(
    folder: Path, task: Task, outcome: Outcome, lines: list[str], *, quiet: bool
) -> None:
    """Write the model, its rules, the board, the tables and, if possible, pictures."""
    from fuzzytree.api.verbs import export
    from fuzzytree.semantics.lowering import rules_from_tree
    from fuzzytree.tactile.board_file import board_text
    from fuzzytree.tactile.boards import Board, Marker

    board = Board(task.name[:60], task.sensor, Marker("AA 55", task.sensor.bits))
    files = {
        "tree.yaml": export(outcome.tree, "yaml").content,
        "rules.yaml": export(rules_from_tree(outcome.tree), "yaml").content,
        "board.yaml": board_text(board).encode(),
        "confusion.csv": confusion_csv(outcome.study).encode(),
        "report.txt": ("\n".join(lines) + "\n").encode(),
        "report.json": (outcome.study.to_json() + "\n").encode(),
        **_pictures(task, outcome, quiet=quiet),
    }
    for name, content in files.items():
        write_atomically(folder / name, content)
    after = shlex.join(["fuzzytree", "show", str(folder / "tree.yaml")])
    say_rows(
        ("wrote", f"{folder}/", ", ".join(files)), ("next", after, ""), quiet=quiet
    )


def _pictures(task: Task, outcome: Outcome, *, quiet: bool) -> dict[str, bytes]:
    """Return pictures of the tree, the table and frames."""
    import importlib.util

    import numpy as np
    from confusion import MOST_CLASSES, draw_confusion
    from figures import drawn

    from fuzzytree.report.svg_tree import MOST_LEAVES, draw_tree
    from fuzzytree.tactile.plots import draw_frames

    found: dict[str, bytes] = {}
    study = outcome.study
    if len(outcome.tree.leaves) <= MOST_LEAVES:
        found["tree.svg"] = draw_tree(outcome.tree).svg.encode()
    else:
        say(f"no picture of a tree of {len(outcome.tree.leaves)} leaves", quiet=quiet)
    if importlib.util.find_spec("matplotlib") is None:
        say("no picture of the table: it needs matplotlib", quiet=quiet)
    elif len(study.classes) <= MOST_CLASSES:
        table = np.array(study.confusion, np.int64)
        count = len(study.classes)
        none = table[:, count:].sum(axis=1, keepdims=True)
        counts = np.hstack([table[:, :count], none]) if none.any() else table[:, :count]
        found["confusion.svg"] = drawn(draw_confusion(counts, study.classes))
    first = [int(np.argmax(task.codes == code)) for code in range(len(study.classes))]
    shown, names = task.frames[first[:_FRAMES_SHOWN]], study.classes[:_FRAMES_SHOWN]
    frames = draw_frames(task.sensor, shown, names)
    found["frames.svg"] = frames.content(".svg")
    return found


if __name__ == "__main__":
    sys.exit(run(command))

"""Learn, and be tested on what was not learnt from, beside other learners."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from fuzzytree.errors import TableError
from fuzzytree.learning import Learnt, Settings, learn_arrays
from fuzzytree.recognition.choosing import Candidate, chosen
from fuzzytree.recognition.pairing import Pairing, paired
from fuzzytree.recognition.peers import PEERS, peer_answers
from fuzzytree.recognition.recogniser import Recogniser, State
from fuzzytree.recognition.tasks import Task
from fuzzytree.rulebase import Value
from fuzzytree.runtimes.frames import Features, features_of
from fuzzytree.tactile.features import costs
from fuzzytree.tactile.names import feature_of
from fuzzytree.tactile.sets import names_of
from fuzzytree.tree import FuzzyTree

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import IntArray

Progress = Callable[[str, float], None]

NOTHING, UNKNOWN = "(nothing)", "(unknown)"
"""The columns of a confusion table behind those of the classes."""

_TIE = 1e-6  # of a cost: among equals the cheaper one wins, and nothing else changes


class Trial(Value, frozen=True):
    """What one division gave.

    Attributes:
        name: Who or what was tested.
        trained: Frames that were learnt from.
        left_out: Frames to learn from on which nothing pressed.
        tested: Frames that were tested, all of them counted.
        right: How many got their class.
        accuracy: Their share.
        leaves: Of the tree.
        features: How many features the tree asks for.
        settings: The settings that were chosen, if they were.
    """

    name: str
    trained: int
    left_out: int
    tested: int
    right: int
    accuracy: float
    leaves: int
    features: int
    settings: str = ""


class Peer(Value, frozen=True):
    """Another learner on the same frames.

    Attributes:
        name: Of the learner.
        accuracy: The mean over the divisions of the share that got their class.
        pairing: The tree beside it: how often it was better.
        unanswered: Frames that it gave no class, for it could not learn.
    """

    name: str
    accuracy: float
    pairing: Pairing
    unanswered: int


class Study(Value, frozen=True):
    """An experiment and what came of it.

    Attributes:
        task: A word or two.
        about: What the frames are.
        split: How they were divided.
        sensor: What they come from.
        unit: What pairs are made of: `subject` or `press`.
        frames: How many there are.
        clipped: Readings above what a cell can take, that were read as that.
        negative: Readings below 0, that were read as 0.
        features: The sets of features.
        names: The features.
        settings: How it was learnt, in words.
        classes: Their names.
        accuracy: The mean over the divisions of the share that got their class.
        spread: The standard deviation over the divisions; 0 for one.
        trials: One for each division.
        confusion: For each class how many of its frames got each class, nothing, or
            none of the known; of the first division, or of all together.
        peers: Other learners; empty if they were not asked.
    """

    task: str
    about: str
    split: str
    sensor: str
    unit: Literal["subject", "press"]
    frames: int
    clipped: int
    negative: int
    features: str
    names: tuple[str, ...]
    settings: str
    classes: tuple[str, ...]
    accuracy: float
    spread: float
    trials: tuple[Trial, ...]
    confusion: tuple[tuple[int, ...], ...]
    peers: tuple[Peer, ...]

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=2).decode()


@dataclass(frozen=True, slots=True)
class Outcome:
    """A study, and the tree that one keeps of it."""

    study: Study
    tree: FuzzyTree


def experiment(
    task: Task,
    *,
    features: str | None = None,
    settings: Settings | None = None,
    choose: Sequence[Candidate] = (),
    peers: Sequence[str] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> Outcome:
    """Learn from each division of a task, and test what comes of it.

    What is tested is the recogniser as one runs it on frames; a frame that it finds
    empty or unknown counts as wrong.

    Args:
        task: The frames and how they are divided.
        features: Sets of features (`fuzzytree.tactile.sets`); the task's unless given.
        settings: How to learn; the task's unless given.
        choose: Settings to choose from in each division, by the subjects that are
            learnt from alone; `fuzzytree.recognition.choosing.CANDIDATES`, say.
        peers: Which of `fuzzytree.recognition.peers.PEERS` to compare with.
        seed: Of the peers that draw numbers.
        progress: Told what is done and which share of it.

    Raises:
        TableError: If a feature is unknown, or to choose where subjects are not known.
        InvalidModelError: If a feature is beyond the sensor.
        LearningError: If nothing can be learnt.
        MissingExtraError: If peers are asked for and scikit-learn is not there.
    """
    if choose and not len(task.subject):
        raise TableError(
            f"{task.name}: settings are chosen by subjects, and there are none"
        )
    text = task.features if features is None else features
    names = names_of(text)
    tell = progress or _silent
    tell("computing features", 0.0)
    found = features_of(task.sensor, task.frames, names)
    base = task.settings if settings is None else settings
    base = msgspec.structs.replace(base, costs=_costs(task, names))
    school = _School(task, found, base, choose)
    trials: list[Trial] = []
    is_right = np.zeros((1 + len(peers), len(task.frames)), bool)
    unanswered = np.zeros(1 + len(peers), np.int64)
    table = np.zeros((len(task.classes), len(task.classes) + 2), np.int64)
    kept: FuzzyTree | None = None
    for number, split in enumerate(task.splits):
        tell(f"{split.name}", number / len(task.splits))
        learnt, picked, rows = school.learn(split.train)
        answers = _answers(learnt.tree, task, split.test)
        is_right[0, split.test] = answers == task.codes[split.test]
        if task.is_whole or not number:
            np.add.at(table, (task.codes[split.test], answers), 1)
            kept = learnt.tree
        trials.append(
            Trial(
                split.name,
                len(rows),
                len(split.train) - len(rows),
                len(split.test),
                int(np.count_nonzero(is_right[0, split.test])),
                float(is_right[0, split.test].mean()),
                len(learnt.tree.leaves),
                len(learnt.tree.inputs),
                picked.text if picked else "",
            )
        )
        for line, peer in enumerate(peers, 1):
            given = peer_answers(
                peer,
                found.values[:, rows],
                task.codes[rows],
                found.values[:, split.test],
                seed,
            )
            is_right[line, split.test] = given == task.codes[split.test]
            unanswered[line] += np.count_nonzero(given < 0)
    if task.is_whole or kept is None:
        tell("learning from all", 1.0)
        kept = school.learn(np.arange(len(task.frames)))[0].tree
    shares = [trial.accuracy for trial in trials]
    study = Study(
        task.name,
        task.about,
        task.split,
        _sensor_text(task),
        "subject" if len(task.subject) else "press",
        len(task.frames),
        int(np.count_nonzero(task.frames > task.sensor.full)),
        int(np.count_nonzero(task.frames < 0)),
        text,
        names,
        "chosen in each division" if choose else settings_text(base),
        task.classes,
        float(np.mean(shares)),
        float(np.std(shares, ddof=1)) if len(shares) > 1 else 0.0,
        tuple(trials),
        tuple(tuple(line) for line in table.tolist()),
        tuple(
            _peer(name, task, is_right[0], is_right[line], int(unanswered[line]))
            for line, name in enumerate(peers, 1)
        ),
    )
    return Outcome(study, kept)


def _costs(task: Task, names: Sequence[str]) -> dict[str, float]:
    """Return costs that decide between equally powerful features alone (step 4).

    Blocks cost the same each, and are not asked.
    """
    asked = [name for name in names if feature_of(name).kind == "moment"]
    found = costs(task.sensor, asked)
    return {name: 1.0 + _TIE * found.get(name, 0.0) for name in names}


def _silent(_text: str, _share: float) -> None:
    """Tell nobody."""


class _School:
    """Learns from some frames of a task."""

    def __init__(
        self,
        task: Task,
        found: Features,
        settings: Settings,
        choose: Sequence[Candidate],
    ) -> None:
        self.task, self.found = task, found
        self.settings, self.choose = settings, choose

    def learn(
        self, train: npt.NDArray[np.intp]
    ) -> tuple[Learnt, Candidate | None, npt.NDArray[np.intp]]:
        """Return what is learnt, what was chosen, and the frames on which one presses.

        Raises:
            LearningError: If nothing can be learnt from them.
        """
        task, settings = self.task, self.settings
        rows = train[self.found.is_pressed[train]]
        values, codes = self.found.values[:, rows], task.codes[rows]
        picked: Candidate | None = None
        if self.choose:
            picked = chosen(values, codes, task.subject[rows], settings, self.choose)
            settings = picked.applied(settings)
        learnt = learn_arrays(
            values.T,
            codes,
            columns=self.found.names,
            classes=task.classes,
            name=task.name,
            settings=settings,
        )
        return learnt, picked, rows


def _answers(tree: FuzzyTree, task: Task, test: npt.NDArray[np.intp]) -> IntArray:
    """Return the column of the confusion table of each tested frame."""
    found = Recogniser(tree, task.sensor)(task.frames[test])
    codes = np.where(found.states == State.NOTHING, len(task.classes), found.codes)
    return np.where(found.states == State.UNKNOWN, len(task.classes) + 1, codes).astype(
        np.int64
    )


def _peer(
    name: str,
    task: Task,
    ours: npt.NDArray[np.bool_],
    theirs: npt.NDArray[np.bool_],
    unanswered: int,
) -> Peer:
    """Return a peer's mean, and the tree beside it, by subjects or by presses."""
    shares = [float(theirs[split.test].mean()) for split in task.splits]
    if len(task.subject):
        units = [split.test for split in task.splits]
        pairs = [(int(ours[u].sum()), int(theirs[u].sum())) for u in units]
    else:
        test = np.concatenate([split.test for split in task.splits])
        pairs = [*zip(ours[test].tolist(), theirs[test].tolist(), strict=True)]
    first, second = zip(*pairs, strict=True)
    return Peer(name, float(np.mean(shares)), paired(first, second), unanswered)


def _sensor_text(task: Task) -> str:
    sensor = task.sensor
    text = f"{sensor.rows} x {sensor.columns} cells, full {sensor.full}"
    text += f", threshold {sensor.threshold}"
    return f"{text}; {task.conditions}" if task.conditions else text


def settings_text(settings: Settings) -> str:
    """Return the settings that matter, in words.

    Example:
        >>> settings_text(Settings(patterns_per_class=2))
        'default mode, 2 patterns a class, L_MAX 10, shrinkage 0.001, entry 2'
    """
    patterns = settings.patterns_per_class
    if patterns is None:
        patterns = 1 if settings.mode == "paper" else "auto"
    many = "pattern" if patterns == 1 else "patterns"
    text = f"{settings.mode} mode, {patterns} {many} a class, "
    text += f"L_MAX {settings.effective_l_max:g}"
    if settings.mode == "paper":
        return text
    return f"{text}, shrinkage {settings.shrinkage:g}, entry {settings.entry:g}"


__all__ = ["PEERS", "Outcome", "Peer", "Study", "Trial", "experiment", "settings_text"]

"""Learn, and be tested on what was not learnt from, beside other learners."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np
from experiment_choosing import Candidate, chosen
from experiment_pairing import Pairing, paired
from experiment_peers import peer_answers
from experiment_splits import Split
from experiment_tasks import Task

from fuzzytree.errors import LearningError, TableError
from fuzzytree.learning import LearningSettings, Learnt, learn_arrays
from fuzzytree.model.rulebase import Value
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.tactile.features import costs
from fuzzytree.tactile.features.names import feature_of, names_of
from fuzzytree.tactile.recognition.recogniser import Recogniser, State
from fuzzytree.tactile.runtimes.frames import Features, FramePlan

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import IntArray

Progress = Callable[[str, float], None]

NOTHING, UNKNOWN = "(nothing)", "(unknown)"
"""The columns of a confusion table behind those of the classes."""

_FEWEST_TO_CHOOSE = 3  # one is tested, one is left out to choose, one is learnt from
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
        is_fresh: Whether features and settings were chosen without these frames.
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
    is_fresh: bool
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
        commonest: The same of who always answers the class that is the commonest
            among the frames that are learnt from.
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
    commonest: float
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
    settings: LearningSettings | None = None,
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
        features: Sets of features (`fuzzytree.tactile.features.names`); the task's
            unless given.
        settings: How to learn; the task's unless given.
        choose: LearningSettings to choose from in each division, by the subjects that
            are learnt from alone; `experiment_choosing.CANDIDATES`, say.
        peers: Which of `experiment_peers.PEERS` to compare with.
        seed: Of the peers that draw numbers.
        progress: Told what is done and which share of it.

    Raises:
        TableError: If a feature is unknown, or to choose by fewer than three subjects.
        InvalidModelError: If a feature is beyond the sensor.
        LearningError: If nothing can be learnt.
        MissingExtraError: If peers are asked for and scikit-learn is not there.
    """
    known = len(np.unique(task.subject))
    if choose and known < _FEWEST_TO_CHOOSE:
        raise TableError(
            f"{task.name}: settings are chosen by leaving subjects out twice, which "
            f"needs {_FEWEST_TO_CHOOSE} at least, not {known}"
        )
    text = task.features if features is None else features
    names = names_of(text)
    tell = progress or _silent
    tell("computing features", 0.0)
    found = FramePlan(task.sensor, names)(task.frames)
    base = task.settings if settings is None else settings
    base = msgspec.structs.replace(base, costs=_costs(task, names))
    learner = _Learner(task, found, base, choose)
    others = [_PeerLearner(name, learner, seed) for name in peers]
    trials: list[Trial] = []
    trees: list[FuzzyTree] = []
    answers = np.full(len(task.frames), -1, np.int64)
    for number, split in enumerate(task.splits):
        tell(split.name, number / len(task.splits))
        trial, answers[split.test], tree = learner.examine(split)
        trials.append(trial)
        for other in others:
            other.examine(split)
        trees.append(tree)
    kept = trees[0]
    if task.is_whole:
        tell("learning from all", 1.0)
        kept = learner.learn(np.arange(len(task.frames)))[0].tree
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
        _commonest(task),
        tuple(trials),
        _confusion(task, answers),
        tuple(other.peer(answers == task.codes) for other in others),
    )
    return Outcome(study, kept)


def _commonest(task: Task) -> float:
    shares: list[float] = []
    for split in task.splits:
        most = int(np.bincount(task.codes[split.train]).argmax())
        shares.append(float(np.mean(task.codes[split.test] == most)))
    return float(np.mean(shares))


def _confusion(task: Task, answers: IntArray) -> tuple[tuple[int, ...], ...]:
    """Return the table of all divisions if one tree is kept for all, else of the first.

    Args:
        task: Whose frames they are.
        answers: The column of each frame that was tested.
    """
    table = np.zeros((len(task.classes), len(task.classes) + 2), np.int64)
    for split in task.splits if task.is_whole else task.splits[:1]:
        np.add.at(table, (task.codes[split.test], answers[split.test]), 1)
    return tuple(tuple(line) for line in table.tolist())


def _costs(task: Task, names: Sequence[str]) -> dict[str, float]:
    """Return costs that decide between equally powerful features alone (step 4).

    Blocks cost the same each, and are not asked.
    """
    asked = [name for name in names if feature_of(name).kind == "moment"]
    found = costs(task.sensor, asked)
    return {name: 1.0 + _TIE * found.get(name, 0.0) for name in names}


def _silent(_text: str, _share: float) -> None:
    """Tell nobody."""


class _Learner:
    """Learns from some frames of a task, and tests on others."""

    def __init__(
        self,
        task: Task,
        found: Features,
        settings: LearningSettings,
        choose: Sequence[Candidate],
    ) -> None:
        self.task, self.found = task, found
        self.settings, self.choose = settings, choose

    def rows(self, train: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
        """Return the frames to learn from on which anything presses."""
        return train[self.found.is_pressed[train]]

    def learn(self, train: npt.NDArray[np.intp]) -> tuple[Learnt, Candidate | None]:
        """Return what is learnt, and the settings that were chosen, if they were.

        Raises:
            LearningError: If nothing can be learnt from them.
        """
        task, settings, rows = self.task, self.settings, self.rows(train)
        if not len(rows):
            raise LearningError(f"nothing presses on any of {len(train)} frames")
        values, codes = self.found.values[:, rows], task.codes[rows]
        picked: Candidate | None = None
        if self.choose:
            subject = task.subject[rows]
            picked = chosen(values, codes, subject, settings, self.choose)
            settings = picked.applied(settings)
        learnt = learn_arrays(
            values.T,
            codes,
            columns=self.found.names,
            classes=task.classes,
            name=task.name,
            settings=settings,
        )
        return learnt, picked

    def examine(self, split: Split) -> tuple[Trial, IntArray, FuzzyTree]:
        """Return what a division gave: counts, answers as columns of the table, tree.

        Raises:
            LearningError: If nothing can be learnt from its frames.
        """
        task = self.task
        try:
            learnt, picked = self.learn(split.train)
        except LearningError as error:
            raise LearningError(f"without {split.name}: {error}") from error
        found = Recogniser(learnt.tree, task.sensor)(task.frames[split.test])
        count = len(task.classes)
        place = {name: code for code, name in enumerate(task.classes)}
        own = np.array([place[name] for name in found.classes], np.int64)
        answers = np.where(found.states == State.NOTHING, count, own[found.codes])
        answers = np.where(found.states == State.UNKNOWN, count + 1, answers)
        right = int(np.count_nonzero(answers == task.codes[split.test]))
        trained = len(self.rows(split.train))
        known = task.subject[split.test] if len(task.subject) else task.subject
        trial = Trial(
            split.name,
            trained,
            len(split.train) - trained,
            len(split.test),
            right,
            right / len(split.test),
            not np.isin(known, task.chosen_on).any(),
            len(learnt.tree.leaves),
            len(learnt.tree.inputs),
            picked.text if picked else "",
        )
        return trial, answers.astype(np.int64), learnt.tree


class _PeerLearner:
    """Another learner on the same divisions."""

    def __init__(self, name: str, learner: _Learner, seed: int) -> None:
        self.name, self.learner, self.seed = name, learner, seed
        self.answers = np.full(len(learner.task.frames), -1, np.int64)

    def examine(self, split: Split) -> None:
        """Keep what the learner answers in a division."""
        values, rows = self.learner.found.values, self.learner.rows(split.train)
        codes = self.learner.task.codes[rows]
        self.answers[split.test] = peer_answers(
            self.name, values[:, rows], codes, values[:, split.test], self.seed
        )

    def peer(self, ours: npt.NDArray[np.bool_]) -> Peer:
        """Return the learner's mean, and the tree beside it, by subject or by press.

        Args:
            ours: For each frame whether the tree is right.
        """
        task = self.learner.task
        theirs = self.answers == task.codes
        tests = [split.test for split in task.splits]
        shares = [float(theirs[test].mean()) for test in tests]
        every = np.concatenate(tests)
        if len(task.subject):
            pairs = [(int(ours[test].sum()), int(theirs[test].sum())) for test in tests]
        else:
            pairs = [*zip(ours[every].tolist(), theirs[every].tolist(), strict=True)]
        first, second = zip(*pairs, strict=True)
        unanswered = int(np.count_nonzero(self.answers[every] < 0))
        return Peer(
            self.name, float(np.mean(shares)), paired(first, second), unanswered
        )


def _sensor_text(task: Task) -> str:
    sensor = task.sensor
    text = f"{sensor.rows} x {sensor.columns} cells, full {sensor.full}"
    text += f", threshold {sensor.threshold}"
    return f"{text}; {task.conditions}" if task.conditions else text


def settings_text(settings: LearningSettings) -> str:
    """Return the settings that matter, in words.

    Example:
        >>> settings_text(LearningSettings())
        'default mode, shrinkage 0.001, entry 2'
    """
    text = f"{settings.mode} mode"
    if settings.mode == "paper":
        return text
    return f"{text}, shrinkage {settings.shrinkage:g}, entry {settings.entry:g}"

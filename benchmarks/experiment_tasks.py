"""What is to be recognised: frames, their classes, and how they are divided."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from experiment_splits import Split, check_apart, leave_one_out

from fuzzytree.errors import ReadError, TableError
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.learning import LearningSettings
from fuzzytree.tactile.link.recording import Recording
from fuzzytree.tactile.presses import LIMIT, labelled, read_frames
from fuzzytree.tactile.sensor import Cells, Sensor

if TYPE_CHECKING:
    from fuzzytree.model.contracts import IntArray

SHAPES = "log paper / force, log parts / force, axis, log size, place"
"""The set of features of frames that nothing is known of."""


@dataclass(frozen=True, slots=True)
class Task:
    """Frames to learn from and to be tested on.

    Attributes:
        name: A word or two.
        about: What the frames are, in a sentence.
        split: How they are divided, in a sentence.
        sensor: What they come from.
        frames: Shape (frames, rows, columns).
        codes: Shape (frames,): the place of each frame's class.
        classes: The names of the classes.
        subject: Shape (frames,): whose each frame is; empty if presses are independent.
        splits: Each is learnt and tested by itself.
        features: The sets of features, unless others are asked for.
        settings: How it is learnt, unless told otherwise.
        chosen_on: The subjects by whose frames features and settings were chosen.
        conditions: What else is known of how they came about.
        is_whole: Whether the tree to keep is learnt from all frames, and not from
            those of the first split.
    """

    name: str
    about: str
    split: str
    sensor: Sensor
    frames: Cells
    codes: IntArray
    classes: tuple[str, ...]
    subject: IntArray
    splits: tuple[Split, ...]
    features: str = SHAPES
    settings: LearningSettings = field(default_factory=LearningSettings)
    chosen_on: tuple[int, ...] = ()
    conditions: str = ""
    is_whole: bool = True


@dataclass(frozen=True, slots=True)
class Known:
    """A task on frames that belong to the project.

    Attributes:
        about: What the frames are, in a sentence.
        file: The name of the file.
        sha256: Of its content.
        label: The array of the classes.
        full: What a cell reads that takes no more.
        threshold: What a cell may read that nothing presses on.
        features: The sets of features.
        settings: How it is learnt.
        others: What all classes but the first are called; empty to tell them apart.
    """

    about: str
    file: str
    sha256: str
    label: str
    full: int
    threshold: int
    features: str
    settings: LearningSettings
    others: str = ""


_MAT = (
    "pmat_inbed_64x32.npz",
    "25a17ee546369c54b4b3015d67920d4f3b6a6908e28d73029880e1a9e8600bd5",
)
_TOUCH = (
    "capfinger_27x15.npz",
    "71f0e6e4e01b10ea135044469438a12d5d2c45a6a2ded443861fee8e43234309",
)

KNOWN: Mapping[str, Known] = MappingProxyType(
    {
        "postures": Known(
            "13 people on a mat of 64 x 32 cells: on the back, left or right side",
            *_MAT,
            label="coarse",
            full=1000,
            threshold=0,
            features="blocks:16x8 / force",
            settings=LearningSettings(shrinkage=0.9, entry=0.0),
        ),
        "postures-17": Known(
            "13 people on a mat of 64 x 32 cells: 17 postures",
            *_MAT,
            label="label",
            full=1000,
            threshold=10,
            features=f"{SHAPES}, blocks:16x8 / force",
            settings=LearningSettings(shrinkage=0.5, entry=0.0),
        ),
        "touch": Known(
            "17 people on a touch screen of 27 x 15 cells: the thumb or another finger",
            *_TOUCH,
            label="finger",
            full=255,
            threshold=40,
            features=SHAPES,
            settings=LearningSettings(shrinkage=0.9),
            others="other finger",
        ),
        "touch-fingers": Known(
            "17 people on a touch screen of 27 x 15 cells: five fingers",
            *_TOUCH,
            label="finger",
            full=255,
            threshold=40,
            features=SHAPES,
            settings=LearningSettings(shrinkage=0.1),
        ),
    }
)
"""The tasks on real frames, by name. Their features and settings were chosen on
subjects that `CHOSEN_ON` names, before any other was looked at."""

CHOSEN_ON: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {_MAT[0]: (1, 2, 3, 4, 5, 6), _TOUCH[0]: (1, 2, 3, 5, 6, 7, 8, 9)}
)
"""By file, the subjects on which features and settings were chosen."""


def data_folder() -> Path:
    """Return where the project keeps its frames."""
    return Path(__file__).resolve().parents[1] / "examples" / "tactile" / "data"


def known_task(name: str, folder: PathLike | None = None) -> Task:
    """Return a task on frames that belong to the project.

    Args:
        name: A key of `KNOWN`.
        folder: Where its file lies; `data_folder()` unless given.

    Raises:
        ValueError: If there is no such task.
        ReadError: If its file is not there, or is another one.
    """
    if name not in KNOWN:
        raise ValueError(f"there is no task {name!r}; there is {', '.join(KNOWN)}")
    known = KNOWN[name]
    path = Path(data_folder() if folder is None else folder) / known.file
    if not path.is_file():
        raise ReadError(
            f"{path}: is not there: the frames of {name!r} lie in "
            "examples/tactile/data; name the folder with --data"
        )
    found = hashlib.sha256(read_bounded(path, LIMIT)).hexdigest()
    if found != known.sha256:
        raise ReadError(
            f"{path}: is not the file that belongs to {name!r}: its SHA-256 is "
            f"{found}, not {known.sha256}"
        )
    presses = read_frames(path, label=known.label)
    if known.others:
        first = presses.label_names[0]
        label = np.minimum(presses.label, 1)
        presses = replace(presses, label=label, label_names=(first, known.others))
    sensor = _sensor(presses, known.full, known.threshold)
    task = by_subject(
        name, presses, sensor, known.about, known.features, known.settings
    )
    return replace(task, chosen_on=CHOSEN_ON[known.file])


def by_subject(
    name: str,
    presses: Recording,
    sensor: Sensor,
    about: str,
    features: str = SHAPES,
    settings: LearningSettings | None = None,
) -> Task:
    """Return a task that leaves each subject out in turn.

    Raises:
        TableError: If classes or subjects are not known, or there are too few.
    """
    codes, classes = _classes(presses, name)
    if not len(presses.subject):
        raise TableError(
            f"{name}: has no array 'subject', and frames that follow one another are "
            "nearly alike, so they are not divided at random\n  name other frames to "
            "test on with --test, or add the subjects"
        )
    count = len(np.unique(presses.subject))
    return Task(
        name,
        about,
        f"each of {count} subjects is left out in turn, and tested on",
        sensor,
        presses.frames,
        codes,
        classes,
        presses.subject,
        leave_one_out(presses.subject),
        features,
        settings or LearningSettings(),
    )


def file_task(
    path: PathLike,
    *,
    test: PathLike | None = None,
    label: str = "label",
    full: int | None = None,
    threshold: int | None = None,
) -> Task:
    """Return a task on frames of one's own.

    Args:
        path: A numpy archive; see `fuzzytree.tactile.presses`.
        test: Another one to test on; each subject is left out in turn if there is
            none.
        label: The array of the classes.
        full: What a cell reads that takes no more; as the file tells unless given.
        threshold: What a cell may read that nothing presses on.

    Raises:
        ReadError: If a file is no such archive.
        TableError: If classes or subjects are not known, or if a subject would be
            both learnt from and tested on.
        InvalidModelError: If `full` and `threshold` are out of their range.
    """
    name = os.fspath(path)
    presses = read_frames(path, label=label)
    own = presses.sensor
    least = own.threshold if threshold is None else threshold
    sensor = _sensor(presses, own.full if full is None else full, least)
    if test is None:
        return by_subject(name, presses, sensor, f"{len(presses.frames)} frames")
    other, title = read_frames(test, label=label), os.fspath(test)
    check_apart(presses.subject, other.subject, (name, title))
    if other.frames.shape[1:] != presses.frames.shape[1:]:
        raise TableError(f"{title}: has frames of another size than {name}")
    if other.label_names != presses.label_names:
        raise TableError(f"{title}: has other classes than {name}")
    count = len(presses.frames)
    both = labelled(
        np.concatenate([presses.frames, other.frames]),
        sensor,
        np.concatenate([presses.label, other.label]),
        presses.label_names,
    )
    if not (len(presses.label) and len(other.label)):
        raise TableError(f"{name if len(other.label) else title}: has no {label!r}")
    codes, classes = _classes(both, name)
    places = np.arange(len(both.frames))
    return Task(
        name,
        f"{count} frames",
        f"learnt from all of them, tested on the {len(other.frames)} of {title}",
        sensor,
        both.frames,
        codes,
        classes,
        both.subject,
        (Split(title, places[:count], places[count:]),),
        is_whole=False,
    )


def _sensor(presses: Recording, full: int, threshold: int) -> Sensor:
    rows, columns = presses.frames.shape[1:]
    return Sensor(rows, columns, full=full, threshold=threshold)


def _classes(presses: Recording, name: str) -> tuple[IntArray, tuple[str, ...]]:
    """Return the codes and names of the classes that occur.

    Raises:
        TableError: If there are fewer than two.
    """
    known, codes = np.unique(presses.label, return_inverse=True)
    if len(known) < 2:
        count = "no class is" if not len(known) else "one class only is"
        raise TableError(f"{name}: {count} known; name the array with --label")
    names = tuple(presses.label_names[place] for place in known.tolist())
    return codes.astype(np.int64), names

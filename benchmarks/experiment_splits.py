"""What is learnt from and what is tested on: never both of the same person or press."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import TableError

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import IntArray


@dataclass(frozen=True, slots=True)
class Split:
    """A division of frames.

    Attributes:
        name: Who or what is tested, for people.
        train: The places of the frames that are learnt from.
        test: The places of the frames that are tested on.
    """

    name: str
    train: npt.NDArray[np.intp]
    test: npt.NDArray[np.intp]


def leave_one_out(subject: IntArray, what: str = "subject") -> tuple[Split, ...]:
    """Return a split for each subject: it is tested on, all others are learnt from.

    Frames of one subject are nearly alike, so a subject is never on both sides.

    Args:
        subject: Shape (frames,): whose each frame is.
        what: What a subject is called.

    Raises:
        TableError: If there is one subject only.

    Example:
        >>> [split.test.tolist() for split in leave_one_out(np.array([7, 8, 7]))]
        [[0, 2], [1]]
    """
    known = np.unique(subject)
    if len(known) < 2:
        raise TableError(
            f"all frames are of one {what}; leaving one out needs two at least"
        )
    return tuple(
        Split(
            f"{what} {one}",
            np.flatnonzero(subject != one),
            np.flatnonzero(subject == one),
        )
        for one in known.tolist()
    )


def in_groups(subject: IntArray, groups: int) -> tuple[Split, ...]:
    """Return a split for each group of subjects, of about as many subjects each.

    Example:
        >>> [split.test.tolist() for split in in_groups(np.array([5, 6, 7]), 2)]
        [[0, 2], [1]]
    """
    known, place = np.unique(subject, return_inverse=True)
    return leave_one_out(place % min(groups, len(known)), "group")


def check_apart(train: IntArray, test: IntArray, names: tuple[str, str]) -> None:
    """Refuse frames to learn from and to test on that share a subject.

    Args:
        train: The subject of each frame to learn from; empty if not known.
        test: The same of each frame to test on.
        names: Of both, for the message.

    Raises:
        TableError: If a subject is on both sides.
    """
    both = np.intersect1d(train, test)
    if len(both):
        who = f"subject {both[0]} is" if len(both) == 1 else f"{len(both)} subjects are"
        raise TableError(
            f"{who} both in {names[0]} and in {names[1]}: frames of one subject are "
            "nearly alike, and what is tested must not have been learnt from"
        )

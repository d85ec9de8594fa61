"""Frames given out as those of a file, whatever their counters, and their classes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from fuzzytree.tactile.link.recording import FrameRecord
from fuzzytree.tactile.recognition.frame_sources import Replayed
from fuzzytree.tactile.recognition.live import LiveResult


class Records:
    """Records without a board, which state nothing."""

    sensor, damaged = None, 0

    def __init__(self, records: Iterable[FrameRecord]) -> None:
        self._records = records

    def __iter__(self) -> Iterator[FrameRecord]:
        return iter(self._records)


def replayed(records: Iterable[FrameRecord], speed: float = 1.0) -> Replayed:
    """Return a source of records, at their pace."""
    file: Any = Records(records)
    return Replayed(file, speed)


def first_label(answer: LiveResult) -> str:
    """Return the class of the object of the largest force; empty for none."""
    return answer.objects[0].label if answer.objects else ""

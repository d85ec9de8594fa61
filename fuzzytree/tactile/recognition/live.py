"""Recognition while frames come in: the answer first, then what a display shows."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np

from fuzzytree.errors import TableError
from fuzzytree.tactile.recognition.recogniser import Recogniser, State
from fuzzytree.tactile.sensor import Cells, Counters, Frame, pressed

STATES = {state: state.name.lower() for state in State}
"""The word for each state in lines and JSON."""

SENTENCES = {
    State.OBJECT: "a known object",
    State.NOTHING: "nothing there",
    State.UNKNOWN: "none of the known objects",
}
"""What a display says of each state."""

_KEPT = 1024  # latencies of the median and the 99 %
_RATED = 64  # frames of the rate
_SHOWN_S = 3.0  # how long a sentence about a frame that is past stays


class FrameSource(Protocol):
    """Where frames come from: a line, a recording or the simulator."""

    @property
    def counters(self) -> Counters:
        """What came in until now."""
        ...

    @property
    def trouble(self) -> str:
        """A sentence about why no frame comes; empty if frames come."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """Give frames as they come."""
        ...

    def now(self) -> float:
        """Return the time in seconds, by the clock of the frames' times."""
        ...

    def close(self) -> None:
        """Release the source; a reader that waits gets no frame any more."""
        ...


@dataclass(frozen=True, slots=True)
class LiveResult:
    """What one frame shows.

    Attributes:
        frame: The frame.
        state: What it shows; None if the frame does not fit.
        code: The place of the class among the classes; -1 if it shows no object.
        label: The class; empty if it shows no object.
        strengths: Of the classes, in [0, 1].
        saturated: How many cells take no more.
        latency_s: From the last byte of the frame to this answer.
        trouble: A sentence about what is wrong with the frame; empty if nothing is.
    """

    frame: Frame
    state: State | None
    code: int
    label: str
    strengths: tuple[float, ...]
    saturated: int
    latency_s: float
    trouble: str

    @property
    def strength(self) -> float:
        """The strength of the class; the largest one if it shows no object."""
        if self.code < 0:
            return max(self.strengths, default=0.0)
        return self.strengths[self.code]


@dataclass(frozen=True, slots=True)
class Latency:
    """How long answers took, in seconds.

    Attributes:
        median: Of the last 1024.
        most: What 99 of 100 of these stay below.
        largest: Of all.
    """

    median: float
    most: float
    largest: float


@dataclass(frozen=True, slots=True)
class LiveView:
    """All that a display shows at one moment.

    Attributes:
        source: The name of what the frames come from.
        model: The name of the model.
        classes: The names of the classes.
        full: What a cell reads that takes no more.
        cells: What presses, of shape (rows, columns); None before the first frame.
        answer: To the last frame; None before the first.
        rate: Answers a second, lately, and of all frames once it is over; 0 before
            the second.
        latency: None before the first answer.
        counters: Of the source, by name.
        refused: Frames that do not fit.
        trouble: A sentence about the last thing that went wrong; empty if nothing did.
        silent_s: Seconds since the last frame, or since the beginning.
        is_over: Whether no frame will come any more.
    """

    source: str
    model: str
    classes: tuple[str, ...]
    full: int
    cells: Cells | None
    answer: LiveResult | None
    rate: float
    latency: Latency | None
    counters: dict[str, int]
    refused: int
    trouble: str
    silent_s: float
    is_over: bool


class Live:
    """Recognises the frames of a source, and updates any number of displays.

    `answers` gives one for each frame as soon as there is one. Displays live in
    threads of their own: they `wait` for news and take a `view` when they have time,
    so that a slow one misses frames and never holds up an answer.
    """

    def __init__(self, recogniser: Recogniser, source: FrameSource, name: str) -> None:
        self.recogniser, self.source, self.name = recogniser, source, name
        self._news = threading.Condition()
        self._answer: LiveResult | None = None
        self._number = 0
        self._refused = 0
        self._is_over = False
        self._began = source.now()
        self._latencies = np.zeros(_KEPT)
        self._times = np.zeros(_RATED)
        self._largest = self._first = self._last = 0.0
        self._counted = _failures(source.counters)
        self._past: tuple[str, float] = "", -_SHOWN_S

    def answers(self, most: int | None = None) -> Iterator[LiveResult]:
        """Give an answer for each frame, `most` of them, or until there are no more."""
        try:
            for frame in itertools.islice(self.source, most):
                answer = self._answered(frame)
                yield answer
                self._show(answer)
        finally:
            with self._news:
                self._is_over = True
                self._news.notify_all()

    def wait(self, known: int, seconds: float) -> int:
        """Wait for more answers than those known, or for the end, some seconds at most.

        Returns:
            How many answers there were.
        """
        with self._news:
            self._news.wait_for(lambda: self._number > known or self._is_over, seconds)
            return self._number

    def view(self) -> LiveView:
        """Return what there is to see now."""
        model, sensor = self.recogniser.model, self.recogniser.sensor
        now, answer = self.source.now(), self._answer
        is_asked = answer is not None and answer.state is not None
        return LiveView(
            self.name,
            model.name,
            model.classes,
            sensor.full,
            pressed(sensor, answer.frame.cells)[0] if answer and is_asked else None,
            answer,
            self._rate(),
            self._latency(),
            asdict(self.source.counters),
            self._refused,
            self._trouble(now),
            max(now - (answer.frame.time if answer else self._began), 0.0),
            self._is_over,
        )

    def _answered(self, frame: Frame) -> LiveResult:
        try:
            found = self.recogniser(frame.cells)
        except TableError as error:  # of another size: the next one may fit
            self._refused += 1
            late = self.source.now() - frame.time
            return LiveResult(frame, None, -1, "", (), 0, late, str(error))
        code = int(found.codes[0])
        state, saturated = State(int(found.states[0])), int(found.saturated[0])
        cells = "1 cell takes" if saturated == 1 else f"{saturated} cells take"
        trouble = f"{cells} no more: the frame is saturated" if saturated else ""
        return LiveResult(
            frame,
            state,
            code,
            found.classes[code] if code >= 0 else "",
            tuple(found.strengths[:, 0].tolist()),
            saturated,
            self.source.now() - frame.time,
            trouble,
        )

    def _show(self, answer: LiveResult) -> None:
        """Keep a result for the displays, and notify them."""
        latency, time = answer.latency_s, answer.frame.time
        self._latencies[self._number % _KEPT] = latency
        self._times[self._number % _RATED] = self._last = time
        self._first = self._first if self._number else time
        self._largest = max(self._largest, latency)
        counted = _failures(self.source.counters)
        if counted != self._counted:
            self._past = _sentence(self._counted, counted), time
            self._counted = counted
        with self._news:
            self._answer = answer
            self._number += 1
            self._news.notify_all()

    def _rate(self) -> float:
        if self._is_over:
            count, times = self._number, np.array([self._first, self._last])
        else:
            times = self._times[: min(self._number, _RATED)]
            count = len(times)
        span = float(np.ptp(times)) if count else 0.0
        return (count - 1) / span if span > 0.0 else 0.0

    def _latency(self) -> Latency | None:
        if not self._number:
            return None
        known = self._latencies[: min(self._number, _KEPT)]
        median, most = np.quantile(known, (0.5, 0.99)).tolist()
        return Latency(median, most, self._largest)

    def _trouble(self, now: float) -> str:
        past, time = self._past
        sentences = [self.source.trouble, self._answer.trouble if self._answer else ""]
        sentences.append(past if now - time < _SHOWN_S else "")
        return "; ".join(filter(None, sentences))


def _failures(counters: Counters) -> tuple[int, ...]:
    return counters.damaged, counters.dropped, counters.reconnects


def _sentence(before: tuple[int, ...], after: tuple[int, ...]) -> str:
    """Return what a display says of what went wrong between two frames."""
    damaged, dropped, back = (b - a for a, b in zip(before, after, strict=True))
    parts = (
        f"{_counted(damaged)} damaged and left out" if damaged > 0 else "",
        f"{_counted(dropped)} dropped, for they came too fast" if dropped > 0 else "",
        "the port went away and came back" if back > 0 else "",
    )
    return "; ".join(filter(None, parts))


def _counted(count: int) -> str:
    return "1 frame was" if count == 1 else f"{count} frames were"


class Hold:
    """Detects a change that lasts for some frames, 1 or more.

    Raises:
        ValueError: If `frames` is below 1.

    Example:
        >>> is_new = Hold(2)
        >>> [is_new(value) for value in "aabaabbb"]
        [False, True, False, False, False, False, True, False]
    """

    def __init__(self, frames: int) -> None:
        if frames < 1:
            raise ValueError(f"something holds for 1 frame or more, not {frames}")
        self._frames = frames
        self._value: object = None
        self._count = 0
        self._last: object = None

    def __call__(self, value: object) -> bool:
        """Return whether a value is new and has just lasted long enough."""
        self._count = self._count + 1 if value == self._value else 1
        self._value = value
        if self._count < self._frames or value == self._last:
            return False
        self._last = value
        return True

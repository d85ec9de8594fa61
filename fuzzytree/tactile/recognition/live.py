"""Recognition while frames come in: the answer first, then what a display shows."""

from __future__ import annotations

import functools
import itertools
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import TableError
from fuzzytree.tactile.recognition.frame_sources import FrameSource, Recorded
from fuzzytree.tactile.recognition.objects import (
    LEAST_AREA,
    Region,
    Tracker,
    regions,
)
from fuzzytree.tactile.recognition.recogniser import Recogniser, State
from fuzzytree.tactile.rest import FOLLOW_S, HOT_S, Rest, RestEvent
from fuzzytree.tactile.sensor import Counters, Frame, Sensor

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, Model
    from fuzzytree.tactile.calibration import Calibration

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
_RECORDED = frozenset(("tare", "hot", "dead"))  # kinds of events
_SHOWN_S = 3.0  # how long a sentence about a frame that is past stays


@dataclass(frozen=True)
class SensorObject:
    """An object on the sensor. Its features are over its own cells, and no others.

    Attributes:
        number: From 1, in the order in which objects came; it keeps it while it stays.
        state: `OBJECT`, or `UNKNOWN`.
        code: The place of the class among the classes; -1 if it is unknown.
        label: The class; empty if it is unknown.
        strengths: Of the classes, in [0, 1].
        region: Its cells, box, area and force.
        recogniser: What recognised it.
    """

    number: int
    state: State
    code: int
    label: str
    strengths: tuple[float, ...]
    region: Region
    recogniser: Recogniser

    @property
    def strength(self) -> float:
        """The strength of the class; the largest one if it is unknown."""
        if self.code < 0:
            return max(self.strengths, default=0.0)
        return self.strengths[self.code]

    @property
    def box(self) -> tuple[int, int, int, int]:
        """The first row and column, and those behind the last ones."""
        return self.region.box

    @property
    def x(self) -> float:
        """The centre of pressure, in cells to the right of the sensor's middle."""
        return self._place[0]

    @property
    def y(self) -> float:
        """The centre of pressure, in cells above the sensor's middle."""
        return self._place[1]

    @property
    def angle(self) -> float:
        """Where the longer axis points to, in degrees counterclockwise from x."""
        return self._place[2]

    @property
    def force(self) -> float:
        """The sum of its pressures: in cells that read full, or in the sensor's unit.

        As the feature of this name.
        """
        sensor = self.recogniser.sensor
        return self.region.force * sensor.top / sensor.full

    @functools.cached_property
    def probabilities(self) -> tuple[float, ...]:
        """The probabilities of the classes.

        Empty if the model has none, or no rule fires.
        """
        return self.recogniser.probabilities(self.region.cells)

    @functools.cached_property
    def _place(self) -> tuple[float, float, float]:
        return self.recogniser.place(self.region.cells)


@dataclass(frozen=True, slots=True)
class LiveResult:
    """What one frame shows.

    Attributes:
        frame: As the board sent it.
        cells: What presses, of shape (rows, columns), without the baseline: readings,
            or steps of `sensor.top / sensor.full` of a calibrated sensor; None if the
            frame does not fit.
        sensor: Of the cells.
        objects: What lies there, the largest force first.
        left_out: How many regions are too small for an object.
        saturated: How many cells take no more.
        latency_s: From the last byte of the frame to this answer.
        trouble: A sentence about what is wrong with the frame; empty if nothing is.
        events: What has changed in what cells read at rest.
    """

    frame: Frame
    cells: npt.NDArray[np.int64] | None
    sensor: Sensor
    objects: tuple[SensorObject, ...]
    left_out: int
    saturated: int
    latency_s: float
    trouble: str
    events: tuple[RestEvent, ...]

    @property
    def time(self) -> float:
        """When the last byte of the frame came, in seconds since the beginning."""
        return self.frame.time

    @property
    def pressures(self) -> FloatArray | None:
        """What presses, of shape (rows, columns): shares of full, or in its unit."""
        if self.cells is None:
            return None
        scale = self.sensor.top / self.sensor.full
        return scale * self.cells.astype(np.float64)

    @property
    def state(self) -> State | None:
        """What the object of the largest force is; None if the frame does not fit."""
        if self.objects:
            return self.objects[0].state
        return None if self.cells is None else State.NOTHING


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
        sensor: Of the answers' cells.
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
    sensor: Sensor
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

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        source: Where they come from.
        name: That of the source.
        reject: The floor of the strength, as of `Recogniser`.
        follow_s: In how many seconds the baseline follows; 0 to keep it.
        calibration: What makes pressures of readings.
        vote_s: How long the answers to an object vote; 0 for each frame's own.
        least: The fewest cells of an object.

    Attributes:
        rest: What the cells read at rest.
        left_out: How many regions were too small for an object.
    """

    def __init__(
        self,
        model: Model,
        sensor: Sensor,
        source: FrameSource,
        name: str,
        *,
        reject: float = 0.0,
        follow_s: float = FOLLOW_S,
        calibration: Calibration | None = None,
        vote_s: float = 0.0,
        least: int = LEAST_AREA,
    ) -> None:
        self.source, self.name = source, name
        self._sensor, self._stated = sensor, source.sensor
        # A single cell may be an object where that is wanted: it is hot much later.
        hot_s = HOT_S if least > 1 else 60 * HOT_S
        self.rest = Rest(sensor, follow_s, calibration, hot_s=hot_s)
        self.recogniser = Recogniser(model, self.rest.bare, reject)
        self._least, self._tracker = least, Tracker(vote_s)
        regions(np.zeros((sensor.rows, sensor.columns), np.int64))  # loads scipy now
        self._tare_wanted = threading.Event()
        self._news = threading.Condition()
        self._answer: LiveResult | None = None
        self._number = 0
        self._refused = self.left_out = 0
        self._is_over = False
        self._began = source.now()
        self._latencies: deque[float] = deque(maxlen=_KEPT)
        self._times: deque[float] = deque(maxlen=_RATED)
        self._largest = self._first = 0.0
        self._counted = source.counters
        self._past: tuple[str, float] = "", -_SHOWN_S

    def tare(self) -> None:
        """Take what the next frames read for the baseline; from any thread."""
        self._tare_wanted.set()

    def answers(self, most: int | None = None) -> Iterator[LiveResult]:
        """Give an answer for each frame, `most` of them, or until there are no more.

        What changes in what the cells read at rest goes to a recording of the source.

        Raises:
            PortError: As the source.
        """
        try:
            for frame in itertools.islice(self.source, most):
                if self.source.sensor is not self._stated:
                    self._stated = self.source.sensor
                    self.rest.restart(self._stated or self._sensor)
                if self._tare_wanted.is_set():
                    self._tare_wanted.clear()
                    self.rest.tare()
                answer = self._answered(frame)
                kinds = {event.kind for event in answer.events}
                if kinds & _RECORDED and isinstance(self.source, Recorded):
                    self.source.rest(self.rest.sensor, frame)
                yield answer
                self._show(answer)
                self.rest.follow()
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
        model, now, answer = self.recogniser.model, self.source.now(), self._answer
        with self._news:
            rate, known = self._rate(), [*self._latencies]
        latency: Latency | None = None
        if known:
            median, most = np.quantile(known, (0.5, 0.99)).tolist()
            latency = Latency(median, most, self._largest)
        return LiveView(
            self.name,
            model.name,
            model.classes,
            self.rest.bare,
            answer,
            rate,
            latency,
            asdict(self.source.counters),
            self._refused,
            self._trouble(now),
            max(now - (answer.time if answer else self._began), 0.0),
            self._is_over,
        )

    def _answered(self, frame: Frame) -> LiveResult:
        try:
            cells = self.rest(frame.cells, frame.time)
        except TableError as error:  # of another size: the next one may fit
            self._refused += 1
            late = self.source.now() - frame.time
            return LiveResult(
                frame, None, self.rest.bare, (), 0, 0, late, str(error), ()
            )
        found, left_out = regions(cells, self._least)
        self.left_out += left_out
        objects = self._recognised(frame.time, found)
        count = self.rest.saturated(frame.cells)
        some = "1 cell takes" if count == 1 else f"{count} cells take"
        trouble = f"{some} no more: the frame is saturated" if count else ""
        late = self.source.now() - frame.time
        events = tuple(self.rest.news())
        if self._tracker.merged:
            events += (RestEvent("merged", objects=self._tracker.merged),)
        bare = self.rest.bare
        return LiveResult(
            frame, cells, bare, objects, left_out, count, late, trouble, events
        )

    def _recognised(
        self, time: float, found: Sequence[Region]
    ) -> tuple[SensorObject, ...]:
        """Return the objects of a frame, each recognised by its own cells."""
        if not found:
            self._tracker(time, (), ())
            return ()
        frames = np.stack([one.cells for one in found])
        seen = self.recogniser(frames)
        voted = self._tracker(time, found, seen.codes.tolist())
        names = (*seen.classes, "")  # the last one for -1
        return tuple(
            SensorObject(
                number,
                State.UNKNOWN if code < 0 else State.OBJECT,
                code,
                names[code],
                tuple(strengths),
                region,
                self.recogniser,
            )
            for region, (number, code), strengths in zip(
                found, voted, seen.strengths.T.tolist(), strict=True
            )
        )

    def _show(self, answer: LiveResult) -> None:
        """Keep a result for the displays, and notify them."""
        time = answer.time
        self._first = self._first if self._number else time
        self._largest = max(self._largest, answer.latency_s)
        counted = self.source.counters
        if counted.reconnects > self._counted.reconnects:
            self.rest.interrupt()
        if text := _failures(self._counted, counted):
            self._past = text, time
        self._counted = counted
        if answer.events:
            self._past = "; ".join(event.text for event in answer.events), time
        with self._news:
            self._latencies.append(answer.latency_s)
            self._times.append(time)
            self._answer = answer
            self._number += 1
            self._news.notify_all()

    def _rate(self) -> float:
        """Return the answers a second; call it with the lock of the news."""
        if not self._number:
            return 0.0
        count = self._number if self._is_over else len(self._times)
        first = self._first if self._is_over else self._times[0]
        span = self._times[-1] - first
        return (count - 1) / span if span > 0.0 else 0.0

    def _trouble(self, now: float) -> str:
        past, time = self._past
        sentences = [self.source.trouble, self._answer.trouble if self._answer else ""]
        sentences.append(past if now - time < _SHOWN_S else "")
        return "; ".join(filter(None, sentences))


def _failures(before: Counters, after: Counters) -> str:
    """Return what a display says of what went wrong between two frames."""
    parts: list[str] = []
    for count, what in (
        (after.damaged - before.damaged, "damaged and left out"),
        (after.dropped - before.dropped, "dropped, for they came too fast"),
    ):
        frames = "1 frame was" if count == 1 else f"{count} frames were"
        parts += [f"{frames} {what}"] if count > 0 else []
    if after.reconnects > before.reconnects:
        parts.append("the port went away and came back")
    return "; ".join(parts)


class Hold:
    """Detects a change that lasts for some frames, 1 or more.

    Example:
        >>> is_new = Hold(2)
        >>> [is_new(value) for value in "aabaabbb"]
        [False, True, False, False, False, False, True, False]
    """

    def __init__(self, frames: int) -> None:
        self._frames, self._count = frames, 0
        self._value: object = None
        self._last: object = None

    def __call__(self, value: object) -> bool:
        """Return whether a value is new and has just lasted long enough."""
        self._count = self._count + 1 if value == self._value else 1
        self._value = value
        if self._count < self._frames or value == self._last:
            return False
        self._last = value
        return True

"""Many frames with faults through every family of decoders, against the truth.

    python benchmarks/soak.py --frames 1000000

Bytes go straight into the decoder, in pieces of random size. A frame that comes out
is held against those that were sent; one that was never sent must be explained by
the bytes that came, which are searched here by other means than the decoder's:

- untold: a whole frame of these cells stands in the bytes, and nothing in it or
  behind it could tell that it was sent otherwise (a turned bit in a cell without a
  checksum, say);
- late: such a frame stands there, but the next one does not begin behind it. Only
  that could tell, and it comes after the last byte, when the frame is given out;
- unexplained: no such frame stands there. The decoder took what its own bytes could
  tell. There must be none.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from serial_faults import ConnectionFaults, damaged, noise, with_marker
from simulated_board import banner, bounds, encoded
from soak_verdicts import explained

from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Order,
    Protocol,
    Request,
    Sentinel,
    Text,
)
from fuzzytree.tactile.link import Decoder, decoder_of
from fuzzytree.tactile.sensor import Cells, Sensor

FAULTS = ConnectionFaults(flip=1e-4, lose=5e-5, double=5e-5, noise=0.01, marker=0.1)
CUT_EVERY = 5000  # frames after which the plug is pulled in the middle of one
_POOL = 512  # different frames
_RECENT = 2**15  # bytes among which a frame that came out must lie
_BATCH = 256  # frames that are damaged together

_SHOWN = (
    *("touched", "alone", "right", "untold", "late", "unexplained", "missed"),
    *("damaged", "doubtful", "skipped"),
)
Places = npt.NDArray[np.int64]


def _board(
    name: str, protocol: Protocol, full: int, *, banner: int = 0, order: Order = "rows"
) -> Board:
    sensor = Sensor(16, 16, full=full)
    return Board(name, sensor, protocol, order=order, banner=banner)


_DOTS = Marker(
    "44 4F 54 53",
    bits=16,
    byte_order="big",
    sizes="rows and columns",
    skip=4,
    checksum="crc16",
)

CASES: dict[str, Board] = {
    board.name: board
    for board in (
        _board("marker", Marker("AA 55"), 255),
        _board("marker, 16 bits", Marker("AA 55", bits=16), 65535, order="columns"),
        _board("marker, tail", Marker("AA 55", tail="0D 0A"), 255),
        _board("marker, sum8", Marker("AA", checksum="sum8"), 255),
        _board("marker, sizes, crc16", _DOTS, 65535, banner=2),
        _board("sentinel", Sentinel(), 254),
        _board("request, 16 bits", Request("41", bits=16, skip=8), 65535),
        _board("request, xor8", Request("41", checksum="xor8"), 255, banner=1),
        _board("text, lines", Text(separator="comma", prefix="F", skip=1), 1023),
        _board("text, blocks", Text(frame="block"), 1023, banner=1),
    )
}


@dataclass
class Count:
    """What went in and what came out.

    Attributes:
        frames: That were sent.
        touched: Of these: with a byte turned, lost, doubled or cut off.
        alone: Of the others: those whose neighbour does not tell any more where
            they lie. Where only the end of the frame before says where a frame
            begins, that was touched, or noise lies between; where only the next
            marker confirms a frame, that was, or the cells hold the marker too and
            one of the next eight frames was touched, which would have decided.
        given: Frames that came out.
        right: Of these: as they were sent, in their order.
        untold: Not as sent, and nothing could tell.
        late: Not as sent, and only what follows could tell.
        unexplained: Not as sent, and their own bytes could tell.
        missed: Frames that were neither and that did not come.
        bytes: That came.
        skipped: As the decoder counts.
        damaged: As the decoder counts.
        resyncs: As the decoder counts.
        doubtful: As the decoder counts.
        seconds: That the decoder took.
        growth: Of the memory after the first tenth, in bytes.
    """

    frames: int = 0
    touched: int = 0
    alone: int = 0
    given: int = 0
    right: int = 0
    untold: int = 0
    late: int = 0
    unexplained: int = 0
    missed: int = 0
    bytes: int = 0
    skipped: int = 0
    damaged: int = 0
    resyncs: int = 0
    doubtful: int = 0
    seconds: float = 0.0
    growth: int = 0


class Pool(NamedTuple):
    """Different frames of a board: their cells, their bytes, and how to find them."""

    cells: list[Cells]
    sent: list[bytes]
    found: dict[bytes, int]


def pool_of(
    board: Board, faults: ConnectionFaults, random: np.random.Generator
) -> Pool:
    """Return frames of which no two are equal; some hold the marker on purpose."""
    sensor, (low, high) = board.sensor, bounds(board)
    shape = (sensor.rows, sensor.columns)
    holds_marker = isinstance(board.protocol, Marker)
    cells: list[Cells] = []
    for number in range(_POOL):
        frame: Cells = random.integers(low, high + 1, shape)
        frame[random.random(shape) < random.random()] = low
        frame[0, 0] = low + number % 250
        frame[0, 1] = low + number // 250
        if holds_marker and random.random() < faults.marker:
            # At one place in many frames: a false beginning that returns.
            where = np.random.default_rng(number // 64)
            frame = with_marker(board, frame, where)
        cells.append(frame)
    sent = [encoded(board, frame, number) for number, frame in enumerate(cells)]
    found = {frame_key(frame): number for number, frame in enumerate(cells)}
    assert len(found) == _POOL
    return Pool(cells, sent, found)


def frame_key(cells: Cells) -> bytes:
    """Return what tells a frame from others."""
    return np.ascontiguousarray(cells, np.uint16).tobytes()


class Watch:
    """Holds what comes out against what was sent.

    Attributes:
        board: That sends.
        pool: What it sends, over and over.
        count: So far.
        recent: The bytes that came last.
        touched: Whether a fault touched a frame, for each that will be sent.
        alone: Whether it stands alone.
        came: Whether it came.
        end_is_hit: Whether a fault touched the end of the last frame.
        answer: The last answer of a board that is asked, whole; empty for others.
    """

    def __init__(self, board: Board, pool: Pool, frames: int) -> None:
        self.board, self.pool, self.count = board, pool, Count()
        self.recent = bytearray()
        self.touched, self.alone = bytearray(frames), bytearray(frames)
        self.came = bytearray(frames)
        self.end_is_hit = False
        self.answer = b""
        self._last = -1  # the number of the last right frame

    def sent(self, is_touched: bool, *, is_alone: bool = False) -> None:
        """Note a frame that was sent."""
        self.touched[self.count.frames] = is_touched
        self.alone[self.count.frames] = is_alone and not is_touched
        self.count.frames += 1

    def given(self, frames: list[Cells]) -> None:
        """Judge frames that came out."""
        for cells in frames:
            self.count.given += 1
            shape = (self.board.sensor.rows, self.board.sensor.columns)
            assert cells.shape == shape, cells.shape
            number = self._number(cells)
            if number is None:
                came = self.answer or bytes(self.recent)
                verdict = explained(self.board, came, cells)
                setattr(self.count, verdict, getattr(self.count, verdict) + 1)
            else:
                self._last = number
                self.came[number] = True
                self.count.right += 1

    def _number(self, cells: Cells) -> int | None:
        """Return which of the frames that were sent this is, if one behind the last."""
        place = self.pool.found.get(frame_key(cells))
        if place is None:
            return None
        number = self._last + 1 + (place - self._last - 1) % _POOL
        return number if number < self.count.frames else None


def soak(
    board: Board, frames: int, seed: int = 0, faults: ConnectionFaults = FAULTS
) -> Count:
    """Send frames with faults through the decoder of a board; count what comes out."""
    random = np.random.default_rng(seed)
    pool = pool_of(board, faults, random)
    decoder = decoder_of(board)
    watch = Watch(board, pool, frames)
    is_asked = isinstance(board.protocol, Request)
    start, memory = banner(board), 0
    for first in range(0, frames, _BATCH):
        numbers = range(first, min(first + _BATCH, frames))
        if is_asked:
            _answers(watch, decoder, numbers, start, faults, random)
        else:
            _stream(watch, decoder, numbers, start, faults, random)
        start = b""
        if not memory and first * 10 >= frames:
            memory = _memory()
    return _closed(watch, decoder, memory)


def _closed(watch: Watch, decoder: Decoder, memory: int) -> Count:
    """End the stream; the laws of the counters hold, or this raises."""
    watch.given(decoder.flush())
    count, counters = watch.count, decoder.counters
    _excuse(watch)
    count.touched, count.alone = sum(watch.touched), sum(watch.alone)
    states = zip(watch.came, watch.touched, watch.alone, strict=True)
    count.missed = sum(not any(state) for state in states)
    for name in ("skipped", "damaged", "resyncs", "doubtful"):
        setattr(count, name, getattr(counters, name))
    count.growth = _memory() - memory
    assert counters.bytes == count.bytes, (counters.bytes, count.bytes)
    assert counters.bytes == decoder.framed + counters.skipped
    assert (
        counters.frames
        == count.given
        == count.right + (count.untold + count.late + count.unexplained)
    )
    return count


def _excuse(watch: Watch) -> None:
    """Let frames with two beginnings stand alone where damage follows soon."""
    _, size = _marks(watch.board)
    for number, state in enumerate(zip(watch.came, watch.touched, strict=True)):
        if any(state) or not size:
            continue
        sent = watch.pool.sent[number % _POOL]
        if sent.count(sent[:size]) > 1:
            soon = slice(number + 1, number + 9)
            hit = any(watch.touched[soon]) or any(watch.alone[soon])
            watch.alone[number] |= hit


def _stream(
    watch: Watch,
    decoder: Decoder,
    numbers: range,
    start: bytes,
    faults: ConnectionFaults,
    random: np.random.Generator,
) -> None:
    """Send frames one after the other, as boards do that speak by themselves."""
    parts, ends, size = [start], [], len(start)
    for number in numbers:
        parts += [noise(faults, random), watch.pool.sent[number % _POOL]]
        size += len(parts[-2]) + len(parts[-1])
        ends.append(size)
    after = damaged(b"".join(parts), faults, random)
    _note(watch, parts[1::2], np.array(ends), after.touched)
    data = after.data
    if numbers[0] // CUT_EVERY != numbers[-1] // CUT_EVERY:
        cut = len(data) - len(watch.pool.sent[numbers[-1] % _POOL]) // 2
        data = data[:cut]
        watch.touched[numbers[-1]] = True
        _fed(watch, decoder, data, random)
        watch.given(decoder.flush())
        watch.recent.clear()
    else:
        _fed(watch, decoder, data, random)


def _note(watch: Watch, noises: list[bytes], ends: Places, touched: Places) -> None:
    """Note which frames were touched, and which stand alone.

    Args:
        watch: Takes the notes.
        noises: What was sent before each frame.
        ends: Where each frame ends.
        touched: Where faults were, rising.
    """
    before, marker = _marks(watch.board)
    sizes = [
        len(watch.pool.sent[(watch.count.frames + place) % _POOL])
        for place in range(len(ends))
    ]
    begins = ends - sizes
    own = _are_hit(touched, begins, ends)
    heads = _are_hit(touched, begins, begins + marker)
    tails = _are_hit(touched, ends - before, ends)
    for number, is_touched in enumerate(own):
        last, is_far = watch.count.frames - 1, bool(noises[number])
        if marker and last >= 0:
            is_alone = is_far or heads[number]
            watch.alone[last] = is_alone and not watch.touched[last]
        watch.sent(is_touched, is_alone=bool(before) and (is_far or watch.end_is_hit))
        watch.end_is_hit = tails[number]


def _are_hit(touched: Places, begins: Places, ends: Places) -> list[bool]:
    """Return whether a fault lies in each of some ranges."""
    found: list[bool] = (
        np.searchsorted(touched, begins) < np.searchsorted(touched, ends)
    ).tolist()
    return found


def _marks(board: Board) -> tuple[int, int]:
    """Return how many bytes of the frame before, and of the next, mark a frame."""
    protocol = board.protocol
    match protocol:
        case Sentinel():
            return 1, 0
        case Text(frame="line"):
            return 2, 0
        case Text():
            return 4, 0
        case Marker(checksum="none" | "sum8" | "xor8", tail="", sizes="none"):
            return 0, len(bytes.fromhex(protocol.marker))
        case _:
            return 0, 0


def _answers(
    watch: Watch,
    decoder: Decoder,
    numbers: range,
    start: bytes,
    faults: ConnectionFaults,
    random: np.random.Generator,
) -> None:
    """Ask for every frame; what does not come whole has timed out."""
    if start:
        _fed(watch, decoder, start, random)
    for number in numbers:
        decoder.requested()
        after = damaged(watch.pool.sent[number % _POOL], faults, random)
        watch.sent(len(after.touched) > 0)
        given = watch.count.given
        data = after.data
        watch.answer = data
        if random.random() < faults.noise:  # late: the rest comes when nobody waits
            half = len(data) // 2
            watch.touched[number] = True
            _fed(watch, decoder, data[:half], random)
            decoder.timed_out()
            _fed(watch, decoder, data[half:], random)
            continue
        _fed(watch, decoder, data, random)
        if watch.count.given == given:
            decoder.timed_out()


def _fed(
    watch: Watch, decoder: Decoder, data: bytes, random: np.random.Generator
) -> None:
    """Feed bytes in pieces whose sizes differ by a factor of 1000."""
    watch.count.bytes += len(data)
    for piece in _pieces(data, random):
        watch.recent += piece
        del watch.recent[:-_RECENT]
        begin = time.perf_counter()
        frames = decoder.feed(piece)
        watch.count.seconds += time.perf_counter() - begin
        watch.given(frames)


def _pieces(data: bytes, random: np.random.Generator) -> Iterator[bytes]:
    start = 0
    while start < len(data):
        size = int(10 ** random.uniform(0.0, 3.6))
        yield data[start : start + size]
        start += size


def _memory() -> int:
    """Return how many bytes this process holds in memory."""
    status = Path("/proc/self/status").read_text("utf-8")
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    return int(found[1]) * 1024 if found else 0


def table(counts: dict[str, Count]) -> str:
    """Return counts as a table in Markdown."""
    titles = [*_SHOWN, "MB/s", "memory, MB"]
    lines = [f"| protocol | {' | '.join(titles)} |"]
    lines.append("| --- |" + " ---: |" * len(titles))
    for name, count in counts.items():
        values = [str(getattr(count, title)) for title in _SHOWN]
        speed = count.bytes / 1e6 / count.seconds
        values += [f"{speed:.0f}", f"{count.growth / 2**20:+.1f}"]
        lines.append(f"| {name} | {' | '.join(values)} |")
    return "\n".join(lines)


def main() -> int:
    """Soak every case and print the table; 1 if a frame is unexplained or missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=1_000_000, help="Of each case.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", choices=list(CASES), action="append")
    given = parser.parse_args()
    counts = {
        name: soak(CASES[name], given.frames, given.seed)
        for name in given.case or CASES
    }
    print(table(counts))
    return int(any(one.unexplained or one.missed for one in counts.values()))


if __name__ == "__main__":
    raise SystemExit(main())

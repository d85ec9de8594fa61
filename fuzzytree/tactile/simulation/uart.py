"""What a receiver hears that samples the line at another rate than the sender's.

A byte is a start bit (0), its data bits from the lowest, a parity bit if there is one,
and stop bits (1); between bytes the line is 1. A receiver waits for the line to fall,
looks at the middle of each bit by its own clock, and takes what it sees for a byte,
even if the stop bit is 0 (a framing error): so does Linux, unless told otherwise.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
import numpy.typing as npt

from fuzzytree.tactile.boards import Port


class Receiver:
    """Samples what a sender puts on the line, at a rate of its own.

    Attributes:
        framing_errors: How many bytes had a stop bit of 0.
        parity_errors: How many bytes had the wrong parity.

    Example:
        >>> Receiver(Port(baud=9600), 9600).heard(b"same")
        b'same'
        >>> twice = Receiver(Port(baud=9600), 19200)
        >>> (twice.heard(b"A") + twice.idle()).hex(" "), twice.framing_errors
        ('06 fe', 1)
    """

    def __init__(self, port: Port, baud: int) -> None:
        self.framing_errors = 0
        self.parity_errors = 0
        self._port = port
        self._baud = baud
        self._line = np.ones(1, np.int64)  # one number for each bit of the sender
        self._place = 0  # a fall is looked for behind this bit

    def heard(self, data: bytes) -> bytes:
        """Return the bytes that end within what is now on the line."""
        self._line = np.concatenate([self._line, _levels(self._port, data)])
        return self._sampled()

    def idle(self) -> bytes:
        """Return what still comes when the line then rests at 1."""
        ticks = self._port.bits_of_a_byte * self._port.baud // self._baud + 2
        self._line = np.concatenate([self._line, np.ones(ticks, np.int64)])
        return self._sampled()

    def _sampled(self) -> bytes:
        """Take every byte whose last bit can be seen."""
        line, port = self._line, self._port
        falls = (np.flatnonzero((line[:-1] == 1) & (line[1:] == 0)) + 1).tolist()
        # A bit of the sender takes `baud` of the receiver's ticks, and one of the
        # receiver's takes the sender's: whole numbers, so that nothing drifts.
        wide, own = 2 * self._baud, port.baud
        count = 1 + port.data_bits + (port.parity != "none") + 1
        middles = (2 * np.arange(count) + 1) * own
        found = bytearray()
        place = self._place
        while (at := bisect_right(falls, place)) < len(falls):
            samples = (falls[at] * wide + middles) // wide
            if samples[-1] >= len(line):
                break
            bits = line[samples]
            if bits[0]:  # too short for a start bit
                place = int(samples[0])
                continue
            found.append(self._byte(bits))
            place = int(samples[-1])
        else:
            place = max(place, len(line) - 1)
        keep = max(min(place, len(line) - 1), 0)
        self._line, self._place = line[keep:], place - keep
        return bytes(found)

    def _byte(self, bits: npt.NDArray[np.int64]) -> int:
        port = self._port
        data = bits[1 : 1 + port.data_bits]
        self.framing_errors += not bits[-1]
        if port.parity != "none":
            is_odd = bool((data.sum() + bits[1 + port.data_bits]) % 2)
            self.parity_errors += is_odd != (port.parity == "odd")
        return int(data @ (1 << np.arange(port.data_bits)))


def _levels(port: Port, data: bytes) -> npt.NDArray[np.int64]:
    """Return the line for some bytes, a 0 or 1 for each bit, without a pause."""
    values = np.frombuffer(data, np.uint8).astype(np.int64)
    bits = (values[:, np.newaxis] >> np.arange(port.data_bits)) & 1
    count = len(values)
    parts = [np.zeros((count, 1), np.int64), bits]
    if port.parity != "none":
        odd = bits.sum(axis=1, keepdims=True) % 2
        parts.append(odd if port.parity == "even" else 1 - odd)
    parts.append(np.ones((count, port.stop_bits), np.int64))
    return np.concatenate(parts, axis=1).ravel()

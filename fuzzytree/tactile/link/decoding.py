"""The bytes of a board to frames, for each family of boards."""

from __future__ import annotations

from typing import assert_never

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link.decoder import Decoder
from fuzzytree.tactile.link.markers import MarkerDecoder
from fuzzytree.tactile.link.requests import RequestDecoder
from fuzzytree.tactile.link.sentinels import SentinelDecoder
from fuzzytree.tactile.link.texts import TextDecoder

__all__ = ["Decoder", "decoder_of"]


def decoder_of(board: Board, *, is_joined: bool = False) -> Decoder:
    """Return what finds the frames of a board in its bytes.

    Nothing of it reads, writes or looks at a clock. A decoder is for one stream.

    Args:
        board: The board.
        is_joined: Whether the stream begins anywhere, as that of a board that sent
            before. Then the first line of text, or the first bytes up to one that
            ends a frame, are skipped: cut at their front they could still look whole.
            Where the banner comes, nothing else is skipped.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> decoder = decoder_of(Board("tiny", Sensor(1, 3), Sentinel()))
        >>> decoder.feed(bytes([7, 0])), decoder.feed(bytes([2, 255]))
        ([], [array([[7, 0, 0]], dtype=uint8)])
        >>> decoder.counters.bytes, decoder.counters.frames, decoder.framed
        (4, 1, 4)
    """
    protocol = board.protocol
    match protocol:
        case Marker():
            return MarkerDecoder(board, protocol)
        case Sentinel():
            return SentinelDecoder(board, protocol, is_joined=is_joined)
        case Request():
            return RequestDecoder(board, protocol)
        case Text():
            return TextDecoder(board, protocol, is_joined=is_joined)
        case _:
            assert_never(protocol)

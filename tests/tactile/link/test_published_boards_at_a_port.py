"""Every published board, spoken by a device behind a port, is read as it was sent."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from simulated_board import Device, blob

from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.link import open_connection

BOARDS = sorted(
    (Path(__file__).parents[3] / "examples" / "tactile" / "boards").glob("*.yaml")
)


@pytest.mark.heavy
@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_a_published_board_is_read_at_its_own_rate(path: Path) -> None:
    board = load_board(path)
    sent = list(itertools.islice(blob(board), 200))
    known = [frame.tolist() for frame in sent]
    with (
        Device(board, sent, rate=1.0) as device,
        open_connection(board, device.port) as line,
    ):
        frames = [line.take(120.0) for _ in range(10)]
        if lost := device.counts.overrun:
            pytest.skip(f"the computer is too busy to listen: {lost} bytes are lost")
        assert line.counters.damaged == 0
    found = [frame.cells.tolist() for frame in frames if frame is not None]
    assert len(found) == 10
    assert found[0] in known[:3]
    first = known.index(found[0])
    assert found == known[first : first + 10]

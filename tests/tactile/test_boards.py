"""Boards that contradict themselves are refused, with everything that is wrong."""

from __future__ import annotations

import pytest

from fuzzytree.errors import InvalidModelError
from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Port,
    Protocol,
    Request,
    Sentinel,
    Start,
    Text,
)
from fuzzytree.tactile.sensor import Sensor

SENSOR = Sensor(16, 16)
HEX = "is 1 to 64 bytes in hexadecimal, such as 'AA 55', not"
PREFIX = (
    "prefix is a word of 1 to 32 signs of ASCII, without , and ;, that begins with no "
    "digit, sign or point, not"
)


@pytest.mark.parametrize(
    ("protocol", "texts"),
    [
        (Marker(""), [f"marker {HEX} ''"]),
        (Marker("AA 5"), [f"marker {HEX} 'AA 5'"]),
        (Marker("AA  55"), [f"marker {HEX} 'AA  55'"]),
        (Marker("AA\n"), [f"marker {HEX} 'AA\\n'"]),
        (Marker("AA" * 65), [f"marker {HEX} '{'AA' * 20}'"]),
        (
            Marker("AA", tail="X", skip=-1),
            ["skip lies in 0 to 1024, not -1", f"tail {HEX} 'X'"],
        ),
        (
            Sentinel(end=256, zero=-1),
            [
                "end lies in 0 to 255, not 256",
                "zero lies in 0 to 255, not -1",
            ],
        ),
        (Sentinel(end=7, zero=7), ["7 cannot both end a frame and begin a run"]),
        (
            Request("", skip=9999, timeout_s=float("nan")),
            [
                f"ask {HEX} ''",
                "skip lies in 0 to 1024, not 9999",
                "timeout_s lies in 0.001 to 3600, not nan",
            ],
        ),
        (Text(prefix="a b"), [f"{PREFIX} 'a b'"]),
        (Text(prefix="1"), [f"{PREFIX} '1'"]),
        (Text(prefix="a,"), [f"{PREFIX} 'a,'"]),
    ],
    ids=str,
)
def test_what_a_protocol_cannot_be(protocol: Protocol, texts: list[str]) -> None:
    with pytest.raises(InvalidModelError) as caught:
        Board("b", SENSOR, protocol)
    assert [text for _, text in caught.value.mistakes] == texts


def test_all_mistakes_of_a_board_are_reported_at_once() -> None:
    with pytest.raises(InvalidModelError) as caught:
        Board(
            "",
            Sensor(4, 4, full=1023),
            Marker("AA"),
            port=Port(baud=0, data_bits=7),
            start=Start(frames=-1, hot=1.5),
            banner=-2,
        )
    assert caught.value.mistakes == (
        (("name",), "name has 1 to 1000 characters, not 0"),
        (("banner",), "banner lies in 0 to 1000, not -2"),
        (("port", "baud"), "baud lies in 1 to 100000000, not 0"),
        (("start", "frames"), "frames lies in 0 to 10000, not -1"),
        (("start", "hot"), "hot lies in 0 to 1, not 1.5"),
        (
            ("protocol", "bits"),
            "a cell of 8 bits never reads the sensor's full, 1023",
        ),
        (
            ("port", "data_bits"),
            "with 7 data bits only text comes through, no bytes above 127",
        ),
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("n" * 1001, "name has 1 to 1000 characters, not 1001"),
        ("a\ud800", "the name 'a\\ud800' cannot be written as UTF-8"),
    ],
    ids=["long", "surrogate"],
)
def test_a_name_must_fit_into_a_file(name: str, text: str) -> None:
    with pytest.raises(InvalidModelError) as caught:
        Board(name, SENSOR, Text())
    assert str(caught.value) == text


def test_a_byte_cannot_reach_what_a_sensor_reads_at_most() -> None:
    with pytest.raises(InvalidModelError) as caught:
        Board("b", Sensor(4, 4, full=256), Sentinel())
    assert str(caught.value) == "a cell of 8 bits never reads the sensor's full, 256"

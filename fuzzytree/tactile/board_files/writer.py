"""A board as the YAML file that `fuzzytree.tactile.board_files.reader` reads."""

from __future__ import annotations

from typing import Final, assert_never

from fuzzytree.exporters.yaml_text import Entry, Noted, Short, joined
from fuzzytree.tactile.board_files.layout import BOARD_FORMAT
from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Port,
    Request,
    Sentinel,
    Start,
    Text,
)
from fuzzytree.tactile.sensor import Sensor

_TITLE: Final = "# A board of fuzzytree: what it sends, and how it is connected."


def board_text(board: Board) -> str:
    """Return a board as YAML; what is as usual is left out.

    Reading it gives an equal board.

    Raises:
        LossError: If the file is too large to be read again.

    Example:
        >>> board = Board("mat", Sensor(16, 16), Marker("AA 55"))
        >>> print(board_text(board), end="")
        # A board of fuzzytree: what it sends, and how it is connected.
        format: fuzzytree-board/1
        name: mat
        sensor: {rows: 16, columns: 16, full: 255}
        marker: {bytes: AA 55}
        order: rows
        port: {baud: 115200}
    """
    entries: dict[str, Entry] = {
        "format": BOARD_FORMAT,
        "name": board.name,
        "sensor": _sensor(board.sensor),
        **_protocol(board),
        "order": board.order,
    }
    if board.pressure != "rises":
        entries["pressure"] = board.pressure
    entries["port"] = _changed(board.port, Port(), always=("baud",))
    if board.start != Start():
        entries["start"] = _changed(board.start, Start())
    if board.banner:
        entries["banner"] = Noted(board.banner, "lines")
    return joined(board.name, _TITLE, entries).decode()


def _sensor(sensor: Sensor) -> Entry:
    entries: dict[str, Entry] = {
        "rows": sensor.rows,
        "columns": sensor.columns,
        "full": sensor.full,
    }
    if sensor.threshold:
        entries["threshold"] = sensor.threshold
    if sensor.baseline:
        entries["baseline"] = Short([*sensor.baseline], is_run_on=True)
    if sensor.masked:
        cells: list[Entry] = [Short([*cell]) for cell in sensor.masked]
        entries["masked"] = Short(cells, is_run_on=True)
    is_short = not (sensor.baseline or sensor.masked)
    return Short(entries) if is_short else entries


def _protocol(board: Board) -> dict[str, Entry]:
    protocol = board.protocol
    match protocol:
        case Marker():
            changed = _changed(protocol, Marker(protocol.marker), always=("marker",))
            return {"marker": changed}
        case Sentinel():
            return {"sentinel": _changed(protocol, Sentinel(), always=("end", "zero"))}
        case Request():
            changed = _changed(protocol, Request(protocol.ask), always=("ask",))
            return {"request": changed}
        case Text():
            return {"text": _changed(protocol, Text(), always=("frame",))}
        case _:
            assert_never(protocol)


def _changed(
    value: Marker | Sentinel | Request | Text | Port | Start,
    usual: Marker | Sentinel | Request | Text | Port | Start,
    always: tuple[str, ...] = (),
) -> Short:
    """Return the fields that are not as usual, by their keys."""
    entries: dict[str, Entry] = {}
    for field in value.__struct_fields__:
        one = getattr(value, field)
        if one == getattr(usual, field) and field not in always:
            continue
        match field:
            case "marker":
                key = "bytes"
            case "timeout_s":
                key = "timeout"
            case _:
                key = field.replace("_", " ")
        entries[key] = "rows and columns" if field == "sizes" else one
    return Short(entries)

"""The YAML file of a board; `docs/reference/boards.md` describes it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import Final

from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats.text_files import Found, report
from fuzzytree.formats.yaml.binding import entries, located, record, value_of
from fuzzytree.formats.yaml.nodes import MappingNode, Scalar, compose
from fuzzytree.model.rulebase import Mistake
from fuzzytree.tactile.board_files.layout import (
    BOARD_FORMAT,
    BoardFile,
    MarkerOfBoard,
    RequestOfBoard,
    SensorOfBoard,
    SentinelOfBoard,
    TextOfBoard,
)
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

MOST_BYTES: Final = 4 * 2**20
"""The largest file of a board; one of 65536 cells with a baseline is a tenth of it."""

_FAMILIES: Final = ("marker", "sentinel", "request", "text")


def load_board(path: PathLike) -> Board:
    """Return the board of a file.

    Args:
        path: The file.

    Raises:
        ReadError: If the file cannot be read or is no board; it lists all mistakes
            with their places.
    """
    return read_board(read_bounded(path, MOST_BYTES), os.fspath(path))


def read_board(content: bytes, name: str) -> Board:
    """Return the board of a file's content.

    Args:
        content: The file.
        name: What messages call it.

    Raises:
        ReadError: If it is no board; it lists all mistakes with their places.

    Example:
        >>> text = '''
        ... format: fuzzytree-board/1
        ... name: mat
        ... sensor: {rows: 16, columns: 16}
        ... marker: {bytes: AA 55}
        ... port: {baud: 2000000}
        ... '''
        >>> read_board(text.encode(), "mat.yaml").protocol
        Marker(marker='AA 55', bits=8, byte_order='little', sizes=False, skip=0, \
checksum='none', tail='')
    """
    if len(content) > MOST_BYTES:
        text = f"{len(content):,} bytes are more than the {MOST_BYTES:,} of a board"
        raise ReadError(f"{name}: {text}")
    root, found = compose(content, name)
    if not isinstance(root, MappingNode):
        text = f"a board must be a mapping that begins with 'format: {BOARD_FORMAT}'"
        raise report(name, [*found, (root.line, root.column, text)])
    wrong_format = [*_format_mistakes(root)]
    if wrong_format:
        raise report(name, [*found, *wrong_format])
    file = record(entries(root, BoardFile, found), BoardFile, found)
    if file is None or found:
        raise report(name, found)
    sensor, mistakes = _sensor(file.sensor)
    try:
        board = _board(file, sensor)
    except InvalidModelError as error:
        mistakes += error.mistakes
    else:
        if not mistakes:
            return board
    raise report(name, [*located(root, _renamed(file, mistakes))])


def _format_mistakes(root: MappingNode) -> Iterator[Found]:
    node = value_of(root, "format")
    if node is None:
        text = f"no 'format: {BOARD_FORMAT}' says what this file is"
        yield root.line, root.column, text
        return
    given = node.text if isinstance(node, Scalar) else ""
    if given == BOARD_FORMAT:
        return
    text = f"'format' must be {BOARD_FORMAT!r}"
    if re.fullmatch(r"fuzzytree-board/[1-9][0-9]{0,8}", given):
        text = (
            f"a board of format {given!r} needs a newer fuzzytree, one that reads "
            f"{given!r}; this one reads {BOARD_FORMAT!r}"
        )
    elif given.startswith("fuzzytree/"):
        text = f"this is a model, and no board; {text}"
    yield node.line, node.column, text


def _sensor(file: SensorOfBoard) -> tuple[Sensor, list[Mistake]]:
    """Return the sensor, or the part that cannot be wrong and what is wrong."""
    try:
        sensor = Sensor(
            rows=file.rows,
            columns=file.columns,
            full=file.full,
            threshold=file.threshold,
            baseline=file.baseline,
            masked=tuple((row, column) for row, column in file.masked),
        )
    except InvalidModelError as error:
        mistakes = [(("sensor", *path), text) for path, text in error.mistakes]
        return Sensor(file.rows, file.columns, file.full), mistakes
    return sensor, []


def _board(file: BoardFile, sensor: Sensor) -> Board:
    port, start = file.port, file.start
    return Board(
        name=file.name,
        sensor=sensor,
        protocol=_protocol(file),
        order=file.order,
        pressure=file.pressure,
        port=Port(port.baud, port.data_bits, port.parity, port.stop_bits),
        start=Start(start.frames, start.hot),
        banner=file.banner,
    )


def _protocol(file: BoardFile) -> Protocol:
    match file.marker or file.sentinel or file.request or file.text:
        case MarkerOfBoard() as marker:
            return Marker(
                marker=marker.bytes,
                bits=marker.bits,
                byte_order=marker.byte_order,
                sizes=marker.sizes == "rows and columns",
                skip=marker.skip,
                checksum=marker.checksum,
                tail=marker.tail or "",
            )
        case SentinelOfBoard() as sentinel:
            return Sentinel(sentinel.end, sentinel.zero)
        case RequestOfBoard() as request:
            return Request(
                ask=request.ask,
                bits=request.bits,
                byte_order=request.byte_order,
                skip=request.skip,
                checksum=request.checksum,
                timeout_s=request.timeout,
            )
        case TextOfBoard() as text:
            return Text(text.frame, text.separator, text.prefix or "", text.skip)
        case None:
            raise AssertionError("a form of the file has one of the four")


def _renamed(file: BoardFile, mistakes: list[Mistake]) -> Iterator[Mistake]:
    """Yield mistakes with the keys of the file on their paths.

    Markers, prefixes and limits were checked with the form of the file: what is left
    bears the same words there, but for the family and for blanks.
    """
    family = next(key for key in _FAMILIES if getattr(file, key) is not None)
    for path, text in mistakes:
        keys = [family if step == "protocol" else step for step in path]
        yield (
            tuple(k.replace("_", " ") if isinstance(k, str) else k for k in keys),
            text,
        )

"""Names of features and of sets of features: the inputs of a model of frames."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Literal

from fuzzytree.errors import TableError
from fuzzytree.model import Value

LOG = "log "
PER_FORCE = " / force"

INVARIANTS: Mapping[str, tuple[float, tuple[str, ...], str]] = MappingProxyType(
    {
        "S1": (1.0, ("C11",), ""),
        "S2": (1.0, ("C20",), "C20"),
        "S3": (1.0, ("C30",), "C30"),
        "S4": (1.0, ("C21",), "C21"),
        "S5": (2.0, ("C21", "C21", "C21"), "C30"),
        "S6": (2.0, ("C21", "C21"), "C20"),
        "S7": (1.0, ("C40",), "C40"),
        "S8": (1.0, ("C31",), "C31"),
        "S9": (1.0, ("C22",), ""),
        "S10": (2.0, ("C31", "C31"), "C40"),
        "S11": (2.0, ("C31",), "C20"),
    }
)
"""Each invariant is a factor times the real part of a product of moments and of the
conjugate of another one, if it has one."""

PAPER: tuple[str, ...] = tuple(INVARIANTS)
"""The paper's features (2.1)."""

FEATURES: tuple[str, ...] = (
    *PAPER,
    *("angle", "cos2", "sin2"),
    *(f"{part} C{pq}" for pq in (20, 21, 30, 31, 40) for part in ("Re", "Im")),
    *("force", "area", "peak", "x", "y"),
)
"""Features with a name; `docs/explanation/moments.md` defines each."""

_UNCHANGED = frozenset(("angle", "cos2", "sin2", "x", "y"))  # alike at every pressure
_UNDIVIDED = _UNCHANGED | {"area", "force"}  # by force
_PLACE = "(?P<{}>0|[1-9][0-9]{{0,2}})"
_AT = f"r{_PLACE.format('row')} c{_PLACE.format('column')}"
_CELL = re.compile(f"cell {_AT}")
_BLOCK = re.compile(
    f"block {_AT} of {_PLACE.format('rows')}x{_PLACE.format('columns')}"
)

Kind = Literal["moment", "cell", "block"]


class Feature(Value, frozen=True):
    """A feature, parsed from its name.

    Attributes:
        name: The whole name.
        base: One of `FEATURES`; for cells and blocks their part of the name.
        kind: What the base is.
        row: Of a cell or block, from 0 at the top.
        column: From 0 at the left.
        rows: How many blocks stand above one another.
        columns: How many stand beside one another.
        is_log: Whether it is the signed logarithm, sign(v) log(1 + |v|).
        per_force: Whether the cells are divided by their sum first.
    """

    name: str
    base: str
    kind: Kind = "moment"
    row: int = 0
    column: int = 0
    rows: int = 0
    columns: int = 0
    is_log: bool = False
    per_force: bool = False


def has_unit(feature: Feature) -> bool:
    """Return whether a feature is a pressure, or a sum of pressures.

    Example:
        >>> [has_unit(feature_of(name)) for name in ("force", "log force", "S1")]
        [True, False, False]
    """
    is_pressure = feature.kind != "moment" or feature.base in ("force", "peak")
    return is_pressure and not (feature.is_log or feature.per_force)


def blocks(rows: int, columns: int) -> tuple[str, ...]:
    """Return the names of all blocks of a division.

    Example:
        >>> blocks(1, 2)
        ('block r0 c0 of 1x2', 'block r0 c1 of 1x2')
    """
    return tuple(
        f"block r{row} c{column} of {rows}x{columns}"
        for row in range(rows)
        for column in range(columns)
    )


def feature_of(name: str) -> Feature:
    """Return the feature of a name.

    Raises:
        TableError: If there is none of that name.

    Example:
        >>> feature_of("log S10 / force").base
        'S10'
    """
    base = name.removeprefix(LOG).removesuffix(PER_FORCE)
    is_log, per_force = name.startswith(LOG), name.endswith(PER_FORCE)
    cell, block = _CELL.fullmatch(base), _BLOCK.fullmatch(base)
    if base in FEATURES and not (per_force and base in _UNDIVIDED):
        return Feature(name, base, is_log=is_log, per_force=per_force)
    match = cell or block
    if match is None:
        raise TableError(_unknown(name, base))
    numbers = {key: int(digits) for key, digits in match.groupdict().items()}
    kind: Kind = "cell" if cell else "block"
    return Feature(name, base, kind, is_log=is_log, per_force=per_force, **numbers)


def _unknown(name: str, base: str) -> str:
    if base in FEATURES:
        return f"{name!r} is no feature of a frame: {base!r} is not divided by force"
    close = difflib.get_close_matches(base, FEATURES, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return (
        f"{name!r} is no feature of a frame{hint}; there is S1 to S11, angle, cos2, "
        "sin2, Re C20 to Im C40, force, area, peak, x, y, cell r0 c0, "
        "block r0 c0 of 4x4, each also behind 'log ' and before ' / force'"
    )


SETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "paper": PAPER,
        "orientation": (*PAPER, "angle", "Re C30", "Re C21"),
        "parts": ("Re C20", "Im C20", "Re C21", "Im C21", "Re C30", "Im C30"),
        "axis": ("cos2", "sin2"),
        "size": ("force", "area", "peak"),
        "place": ("x", "y"),
    }
)
"""The sets that have a name; `blocks:16x8` is all blocks of that division."""

MOST_FEATURES = 4096
"""The most features of a sentence of sets."""

_DIVISION = re.compile(r"blocks:(\d{1,3})x(\d{1,3})")


def names_of(text: str) -> tuple[str, ...]:
    """Return the names of features that some sets and names stand for.

    Before a set `log ` and behind it ` / force` mean the same as at a feature's name;
    the members that are alike at every pressure (`angle`, `cos2`, `sin2`, `x`, `y`)
    stay as they are, and `force` and `area` are not divided by force.

    Args:
        text: Sets of `SETS`, `blocks:ROWSxCOLUMNS` and names of features, with commas
            between them. What occurs twice is taken once.

    Raises:
        TableError: If a part is neither, or if they are too many.

    Example:
        >>> names_of("log size, angle")
        ('log force', 'log area', 'log peak', 'angle')
        >>> names_of("blocks:1x2 / force")
        ('block r0 c0 of 1x2 / force', 'block r0 c1 of 1x2 / force')
    """
    found: dict[str, None] = {}
    for part in text.split(","):
        found |= dict.fromkeys(_members(part.strip()))
        if len(found) > MOST_FEATURES:
            raise TableError(f"{text[:80]!r}: more than {MOST_FEATURES} features")
    return tuple(found)


def _members(part: str) -> Iterator[str]:
    base = part.removeprefix(LOG).removesuffix(PER_FORCE)
    division = _DIVISION.fullmatch(base)
    if division:
        rows, columns = map(int, division.groups())
        if not 1 <= rows * columns <= MOST_FEATURES:
            raise TableError(f"{part!r}: 1 to {MOST_FEATURES} blocks are possible")
        members = blocks(rows, columns)
    elif base in SETS:
        members = SETS[base]
    else:
        try:
            yield feature_of(part).name
        except TableError as error:
            text = f"{error}; sets are {', '.join(SETS)} and blocks:16x8"
            raise TableError(text) from error
        return
    log = LOG if part.startswith(LOG) else ""
    force = PER_FORCE if part.endswith(PER_FORCE) else ""
    for name in members:
        head = "" if name in _UNCHANGED else log
        yield f"{head}{name}{'' if name in _UNDIVIDED else force}"

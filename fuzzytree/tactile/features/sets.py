"""Sets of features by short names, for commands: `log paper / force, size`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.names import (
    LOG,
    ORIENTATION,
    PAPER,
    PER_FORCE,
    blocks,
    feature_of,
)

SETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "paper": PAPER,
        "orientation": PAPER + ORIENTATION,
        "parts": ("Re C20", "Im C20", "Re C21", "Im C21", "Re C30", "Im C30"),
        "axis": ("cos2", "sin2"),
        "size": ("force", "area", "peak"),
        "place": ("x", "y"),
    }
)
"""The sets that have a name; `blocks:16x8` is all blocks of that division."""

MOST_FEATURES = 4096
"""The most features of a sentence of sets."""

_BLOCKS = re.compile(r"blocks:(\d{1,3})x(\d{1,3})")
_PLAIN = frozenset(("angle", "cos2", "sin2", "x", "y"))  # alike at every pressure


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
        for name in _members(part.strip()):
            found[name] = None
            if len(found) > MOST_FEATURES:
                raise TableError(f"{text[:80]!r}: more than {MOST_FEATURES} features")
    return tuple(found)


def _members(part: str) -> Iterator[str]:
    base = part.removeprefix(LOG).removesuffix(PER_FORCE)
    division = _BLOCKS.fullmatch(base)
    if division:
        rows, columns = map(int, division.groups())
        if not 1 <= rows * columns <= MOST_FEATURES:
            raise TableError(f"{part!r}: 1 to {MOST_FEATURES} blocks can be asked for")
        members = blocks(rows, columns)
    elif base in SETS:
        members = SETS[base]
    else:
        yield _one(part)
        return
    log = LOG if part.startswith(LOG) else ""
    force = PER_FORCE if part.endswith(PER_FORCE) else ""
    for name in members:
        if name in _PLAIN:
            yield name
        else:
            yield f"{log}{name}{'' if name in ('force', 'area') else force}"


def _one(part: str) -> str:
    try:
        return feature_of(part).name
    except TableError as error:
        sets = ", ".join(SETS)
        raise TableError(f"{error}; sets are {sets} and blocks:16x8") from error

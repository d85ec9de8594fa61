"""What a frame shows, as a number."""

from __future__ import annotations

from enum import IntEnum


class State(IntEnum):
    """What a frame shows."""

    OBJECT = 0
    """An object of one of the classes."""

    NOTHING = 1
    """Nothing presses: there is no centre of pressure, and no answer."""

    UNKNOWN = 2
    """Something that is none of the known objects."""

"""Writers of rule bases and trees, one module per format, and the table of formats.

A format is a module with a constant `FORMAT` (see `fuzzytree.contracts.Format`) and a
line in `TABLE`. A module is imported when its format is asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import MappingProxyType

from fuzzytree.contracts import Format

TABLE: Mapping[str, str] = MappingProxyType(
    {
        "yaml": "fuzzytree.exporters.yaml",
        "onnx": "fuzzytree.exporters.onnx",
        "python": "fuzzytree.exporters.python",
    }
)
"""Each format's name and the module that holds its `FORMAT`."""


def find_format(name: str) -> Format:
    """Return the format of a name such as `yaml`, or of a suffix such as `.onnx`.

    Raises:
        ValueError: If there is none; the message lists all of them.
        ImportError: If a package that the format's module needs is not installed.
    """
    if name in TABLE:
        return _load(name)
    for known in TABLE if name.startswith(".") else ():
        if name.lower() in _load(known).suffixes:
            return _load(known)
    raise ValueError(f"no format {name!r}; there is {', '.join(TABLE)}")


def all_formats() -> tuple[Format, ...]:
    """Return every format of the table, in its order."""
    return tuple(map(_load, TABLE))


def _load(name: str) -> Format:
    loaded: Format = importlib.import_module(TABLE[name]).FORMAT
    return loaded

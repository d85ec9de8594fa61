"""Writers of models, one module per format, and the table of formats.

A format is a module here with a constant `FORMAT` (see
`fuzzytree.model.contracts.Format`) and a line in `TABLE`; `docs/how-to/add-a-format.md`
shows how to add one. Third-party packages offer theirs by the entry point group
`fuzzytree.formats`. A module is imported when its format is used, and a third-party
package only for a format that this table lacks.
"""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Mapping
from types import MappingProxyType

from fuzzytree.model import Format

TABLE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "yaml": (".yaml", ".yml"),
        "fcl": (".fcl",),
        "fll": (".fll",),
        "fis": (".fis",),
        "fml": (".fml", ".xml"),
        "onnx": (".onnx",),
        "pmml": (".pmml",),
        "c": (".c",),
        "sql": (".sql",),
        "python": (".py",),
        "javascript": (".mjs", ".js"),
        "structured-text": (".st",),
        "smt-lib": (".smt2",),
    }
)
"""Each format's name and its suffixes, the usual one first.

The module of a format has its name, with `_` for `-`. No two formats share a suffix.
"""


def find_format(name: str) -> Format:
    """Return the format of a name such as `yaml`, or of a suffix such as `.onnx`.

    Args:
        name: A name, or a suffix with its dot, in large or small letters.

    Raises:
        ValueError: If there is none; the message lists all of them and the nearest.
        ImportError: If a package that the format's module needs is not installed.

    Example:
        >>> find_format(".YML").name
        'yaml'
    """
    wanted = name.lower() if name.startswith(".") else name
    for known, suffixes in TABLE.items():
        if wanted == known or wanted in suffixes:
            return _load(known)
    from fuzzytree.exporters.plugins import Plugin, find_plugin, plugin_names

    plugin = find_plugin(wanted)
    if isinstance(plugin, Plugin) and plugin.format is not None:
        return plugin.format
    if isinstance(plugin, Plugin):
        raise ValueError(f"the format {name!r} cannot be used: {plugin.fault}")
    names = [*TABLE, *plugin_names()]
    every = [suffix for suffixes in TABLE.values() for suffix in suffixes]
    pool = every if name.startswith(".") else names
    cutoff = 0.7 if name.startswith(".") else 0.6
    close = [known for known in TABLE if f".{wanted}" in TABLE[known]]
    close = close or difflib.get_close_matches(wanted[:100], pool, n=1, cutoff=cutoff)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise ValueError(f"no format {name!r}; there is {', '.join(names)}{hint}")


def all_formats() -> tuple[Format, ...]:
    """Return every format of the table, in its order, without third-party ones."""
    return tuple(map(_load, TABLE))


def _load(name: str) -> Format:
    module = importlib.import_module(f"fuzzytree.exporters.{name.replace('-', '_')}")
    loaded: Format = module.FORMAT
    return loaded

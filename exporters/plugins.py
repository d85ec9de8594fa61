"""Formats that other packages offer, by the entry point group `fuzzytree.formats`.

    [project.entry-points."fuzzytree.formats"]
    turtle = "turtle_rules.format:FORMAT"

A third-party package is imported when its format is used, and not because it is
installed. Its errors become a sentence beside its name: no command fails for them.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator

import msgspec

from fuzzytree.model import Format

GROUP = "fuzzytree.formats"

_LONGEST = 200  # characters of the reported error of a package


class Plugin(msgspec.Struct, frozen=True):
    """A format that another package offers.

    Attributes:
        name: The entry point's.
        package: The distribution that offers it, with its version.
        format: The format; None if it cannot be used.
        fault: Why it cannot be used; empty if it can.
    """

    name: str
    package: str
    format: Format | None = None
    fault: str = ""


def all_plugins() -> tuple[Plugin, ...]:
    """Return every third-party format, imported, by name."""
    return tuple(map(_loaded, _entry_points()))


def plugin_names() -> tuple[str, ...]:
    """Return the names of third-party formats; nothing is imported."""
    return tuple(dict.fromkeys(entry.name for entry in _entry_points()))


def find_plugin(name: str) -> Plugin | None:
    """Return the format of a name, or of a suffix with its dot; None if there is none.

    For a name only the package that offers it is imported, for a suffix all are.
    """
    if not name.startswith("."):
        named = (entry for entry in _entry_points() if entry.name == name)
        return next(map(_loaded, named), None)
    for plugin in all_plugins():
        if plugin.format is not None and name in plugin.format.suffixes:
            return plugin
    return None


def _entry_points() -> list[importlib.metadata.EntryPoint]:
    entries = importlib.metadata.entry_points(group=GROUP)
    return sorted(entries, key=lambda entry: (entry.name, entry.value))


def _loaded(entry: importlib.metadata.EntryPoint) -> Plugin:
    package = "an unknown package"
    if entry.dist is not None:
        package = f"{entry.dist.name} {entry.dist.version}"
    fault = next(_name_faults(entry.name), "")
    if fault:
        return Plugin(entry.name, package, fault=f"{package}: {fault}")
    try:
        form: object = entry.load()
    except Exception as error:  # it is not ours, and can raise anything
        text = " ".join(str(error).split())[:_LONGEST]
        fault = f"{package}: {entry.value} raises {type(error).__name__}: {text}"
        return Plugin(entry.name, package, fault=fault)
    if not isinstance(form, Format):
        fault = f"{package}: {entry.value} is no fuzzytree.model.contracts.Format"
        return Plugin(entry.name, package, fault=fault)
    if form.name != entry.name:
        fault = f"{package}: {entry.value} calls itself {form.name!r}"
        return Plugin(entry.name, package, fault=fault)
    return Plugin(entry.name, package, form)


def _name_faults(name: str) -> Iterator[str]:
    from fuzzytree.exporters.table import TABLE

    if name in TABLE:
        yield f"{name!r} is the name of a format of fuzzytree"
    if name.startswith("."):
        yield f"{name!r}: a name of a format does not begin with a dot"
    if len([one for one in _entry_points() if one.name == name]) > 1:
        yield f"{name!r} is offered by more than one package"

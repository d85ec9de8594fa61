"""What an audit is asked to do, from a file beside the model: `fuzzytree-audit.yaml`.

```yaml
select: [FT1, FT301]
ignore: [FT103]
limits:
  - {variable: alcohol, from: 11, to: 15}
settings: {epsilon: 0.2, budget: 120}
baseline: accepted.json
fail-on: error
```
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Annotated, ClassVar, Final, Literal

import msgspec
from msgspec import Meta, field

from fuzzytree.auditing.findings.records import Settings
from fuzzytree.auditing.findings.selecting import check_settings, chosen_codes
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats.text_files import Found, report
from fuzzytree.formats.yaml.binding import bind, find
from fuzzytree.formats.yaml.layout import Name, Record
from fuzzytree.formats.yaml.nodes import MappingNode, compose

FILE: Final = "fuzzytree-audit.yaml"
"""Read from the current folder if it is there and no other is named."""

FailOn = Literal["error", "warning", "info", "never"]

_MOST_BYTES = 2**20
_Codes = Annotated[tuple[Name, ...], Meta(max_length=1000)]


class LimitsOfFile(Record, frozen=True, kw_only=True):
    """The ends of one variable, or of a combination besides."""

    noun: ClassVar[str] = "limits"
    variable: Name
    from_: float = field(name="from")
    to: float


class SettingsOfFile(Record, frozen=True, kw_only=True):
    """What is taken for small; see `Settings`."""

    noun: ClassVar[str] = "settings"
    epsilon: float | None = None
    margin: float | None = None
    lead: float | None = None
    level: float | None = None
    overlap: float | None = None
    rows: int | None = None
    seed: int | None = None
    budget: float | None = None


class ConfigurationFile(Record, frozen=True, kw_only=True):
    """A configuration of `fuzzytree audit`; what is left out is as without a file."""

    noun: ClassVar[str] = "a configuration"
    select: _Codes = ()
    ignore: _Codes = ()
    limits: Annotated[tuple[LimitsOfFile, ...], Meta(max_length=10_000)] = ()
    settings: SettingsOfFile | None = None
    baseline: Name | None = None
    fail_on: FailOn | None = field(name="fail-on", default=None)


class Configuration(msgspec.Struct, frozen=True):
    """What a file of configuration says.

    Attributes:
        select: Beginnings of codes that are asked.
        ignore: Beginnings of codes that are left out.
        limits: The ends of variables, by name.
        settings: What is taken for small.
        baseline: The path of a baseline; in a file, from the folder of that file.
        fail_on: The least severity of a finding that fails.
    """

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    limits: tuple[tuple[str, float, float], ...] = ()
    settings: Settings = Settings()
    baseline: str | None = None
    fail_on: FailOn | None = None


def read_configuration(path: PathLike) -> Configuration:
    """Return what a file of configuration says.

    Raises:
        ReadError: If it is none; it lists all mistakes with their places.
    """
    found = configuration(read_bounded(path, _MOST_BYTES), str(path))
    if found.baseline is None:
        return found
    beside = str(PurePath(path).parent / found.baseline)
    return msgspec.structs.replace(found, baseline=beside)


def configuration(content: bytes, name: str) -> Configuration:
    """Return what the content of a file of configuration says.

    Raises:
        ReadError: As `read_configuration`.

    Example:
        >>> configuration(b"select: [FT1]", "x.yaml").select
        ('FT1',)
    """
    root, found = compose(content, name)
    bound = bind(root, ConfigurationFile, found)
    if bound is None or found:
        raise report(name, found)
    assert isinstance(root, MappingNode)  # or it would not have been bound
    settings = _settings(bound.settings or SettingsOfFile(), root, found)
    for position, fault in _wrong_limits(bound.limits):
        node = find(root, ("limits", position))
        found.append((node.line, node.column, fault))
    for key in ("select", "ignore"):
        for position, text in enumerate(getattr(bound, key)):
            try:
                chosen_codes([text])
            except ValueError as error:
                node = find(root, (key, position))
                found.append((node.line, node.column, str(error)))
    if found:
        raise report(name, found)
    return Configuration(
        bound.select,
        bound.ignore,
        tuple((one.variable, one.from_, one.to) for one in bound.limits),
        settings,
        bound.baseline,
        bound.fail_on,
    )


def _wrong_limits(limits: Sequence[LimitsOfFile]) -> Iterator[tuple[int, str]]:
    """Yield the positions of limits that are none, and why."""
    seen: set[str] = set()
    for position, one in enumerate(limits):
        if one.variable in seen:
            yield position, f"{one.variable!r} has limits already"
        seen.add(one.variable)
        if not (math.isfinite(one.from_) and math.isfinite(one.to)):
            yield position, f"limits must be finite, not {one.from_!r} to {one.to!r}"
        elif one.from_ > one.to:
            swapped = f"limits are swapped: {one.from_!r} to {one.to!r}"
            yield position, f"{swapped}; the smaller one stands first"


def _settings(given: SettingsOfFile, root: MappingNode, found: list[Found]) -> Settings:
    """Return settings, the defaults where a value is left out or wrong."""
    made = Settings()
    for key, value in msgspec.structs.asdict(given).items():
        if value is None:
            continue
        name = "budget_s" if key == "budget" else key
        try:
            changed = msgspec.structs.replace(made, **{name: value})
            check_settings(changed)
        except ValueError as error:
            node = find(root, ("settings", key))
            found.append((node.line, node.column, str(error)))
        else:
            made = changed
    return made

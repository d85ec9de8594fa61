"""Which codes an audit answers, and with which settings.

Both can stand in a file beside the model, `fuzzytree-audit.yaml`:

```yaml
select: [FT1, FT301]
skip: [FT103]
limits:
  - {variable: alcohol, from: 11, to: 15}
settings: {epsilon: 0.2, budget: 120}
baseline: accepted.json
fail-on: error
```
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Annotated, ClassVar, Final, Literal

import msgspec
from msgspec import Meta, field

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats import FileRecord, MappingNode, Name, bind, compose, find, report
from fuzzytree.model import Path, as_names, name_choice

_SHARES = ("epsilon", "margin", "lead", "level", "overlap")
_RANGES: Mapping[str, tuple[float, str]] = {
    **dict.fromkeys(_SHARES, (1.0, "above 0 and at most 1")),
    "budget": (1e9, "above 0 and at most 1e9 million steps"),
}
_COUNTS: Mapping[str, tuple[int, int]] = {
    "rows": (1, 10_000_000),
    "seed": (0, 2**32 - 1),
}


def code_selection(select: Sequence[str] = (), skip: Sequence[str] = ()) -> set[str]:
    """Return the selected codes, and all reasons for declining.

    The reasons are always included: without them the other answers seem to be about
    more than they are.
    """
    select, skip = as_names(select), as_names(skip)
    for text in (*select, *skip):
        if not text or not any(code.startswith(text) for code in CODES):
            choice = name_choice(text, [*CODES])
            raise ValueError(f"no code begins with {text!r}; {choice}")
    for text in skip:
        if text.startswith("FTD"):
            raise ValueError(
                f"the code {text!r} cannot be left out: it reports what was declined"
            )
    reasons = {code for code in CODES if code.startswith("FTD")}
    chosen = {
        code
        for code in CODES
        if code.startswith(select or ("FT",)) and not code.startswith(skip)
    }
    if chosen <= reasons:
        raise ValueError("select and skip leave no code to answer")
    return chosen | reasons


def check_settings(settings: AuditSettings) -> None:
    """Raise ValueError, in a sentence, if settings are outside their ranges."""
    for name, (high, allowed) in _RANGES.items():
        value = getattr(settings, name)
        if not 0.0 < value <= high:
            raise ValueError(f"{name} must be {allowed}, not {value!r}")
    for name, (least, most) in _COUNTS.items():
        value = getattr(settings, name)
        if not least <= value <= most:
            raise ValueError(f"{name} must be {least} to {most}, not {value!r}")


def settings_with(settings: AuditSettings, texts: Mapping[str, str]) -> AuditSettings:
    """Return settings with others, but the budget, as a user writes them."""
    names = [name for name in (*_RANGES, *_COUNTS) if name != "budget"]
    values: dict[str, float] = {}
    for name, text in texts.items():
        if name not in names:
            raise ValueError(f"no setting {name!r}; {name_choice(name, names)}")
        try:
            values[name] = int(text) if name in _COUNTS else float(text)
        except ValueError:
            noun = "a whole number" if name in _COUNTS else "a number"
            raise ValueError(f"{name} must be {noun}, not {text!r}") from None
        if not math.isfinite(values[name]):
            raise ValueError(f"{name} must be finite, not {text!r}")
    result = msgspec.structs.replace(settings, **values)
    check_settings(result)
    return result


FILE: Final = "fuzzytree-audit.yaml"
"""Read from the current folder if it is there and no other is named."""

FailOn = Literal["error", "warning", "info", "never"]

_MOST_BYTES = 2**20
_Codes = Annotated[tuple[Name, ...], Meta(max_length=1000)]


class LimitsOfFile(FileRecord, frozen=True, kw_only=True):
    """The ends of one variable, or of a combination besides."""

    noun: ClassVar[str] = "limits"
    variable: Name
    from_: float = field(name="from")
    to: float


class SettingsOfFile(FileRecord, AuditSettings, frozen=True, kw_only=True):
    """What is taken for small; see `AuditSettings`."""

    noun: ClassVar[str] = "settings"


class Configuration(FileRecord, frozen=True, kw_only=True):
    """A configuration of `fuzzytree audit`; what is left out is as without a file.

    Attributes:
        baseline: The path of a baseline, from the folder of the file.
        fail_on: The least severity of a finding that fails.
    """

    noun: ClassVar[str] = "a configuration"
    select: _Codes = ()
    skip: _Codes = ()
    limits: Annotated[tuple[LimitsOfFile, ...], Meta(max_length=10_000)] = ()
    settings: SettingsOfFile = SettingsOfFile()
    baseline: Name | None = None
    fail_on: FailOn | None = field(name="fail-on", default=None)

    @property
    def audit_settings(self) -> AuditSettings:
        """The settings, the defaults where one is left out."""
        return AuditSettings(**msgspec.structs.asdict(self.settings))


def read_configuration(path: PathLike) -> Configuration:
    """Return what a file of configuration says."""
    result = configuration(read_bounded(path, _MOST_BYTES), str(path))
    if result.baseline is None:
        return result
    beside = str(PurePath(path).parent / result.baseline)
    return msgspec.structs.replace(result, baseline=beside)


def configuration(content: bytes, name: str) -> Configuration:
    """Return what the content of a file of configuration says."""
    root, mistakes = compose(content, name)
    bound = bind(root, Configuration, mistakes)
    if bound is None or mistakes:
        raise report(name, mistakes)
    assert isinstance(root, MappingNode)  # or it would not have been bound
    for place, fault in _wrong(bound):
        node = find(root, place)
        mistakes.append((node.line, node.column, fault))
    if mistakes:
        raise report(name, mistakes)
    return bound


def _wrong(bound: Configuration) -> Iterator[tuple[Path, str]]:
    """Yield the places of values that are none, and why."""
    for name, value in msgspec.structs.asdict(bound.settings).items():
        try:
            check_settings(msgspec.structs.replace(AuditSettings(), **{name: value}))
        except ValueError as error:
            yield ("settings", name), str(error)
    names: set[str] = set()
    for position, limits in enumerate(bound.limits):
        place, low, high = ("limits", position), limits.from_, limits.to
        if limits.variable in names:
            yield place, f"{limits.variable!r} has limits already"
        names.add(limits.variable)
        if not (math.isfinite(low) and math.isfinite(high)):
            yield place, f"limits must be finite, not {low!r} to {high!r}"
        elif low > high:
            swapped = f"limits are swapped: {low!r} to {high!r}"
            yield place, f"{swapped}; the smaller one stands first"
    for key in ("select", "skip"):
        for position, text in enumerate(getattr(bound, key)):
            try:
                code_selection([text])
            except ValueError as error:
                yield (key, position), str(error)

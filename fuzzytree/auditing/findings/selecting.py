"""Which questions are asked, by their codes, and with which settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.records import Settings
from fuzzytree.model.naming import as_names
from fuzzytree.model.rulebase import name_choice

_RANGES: Mapping[str, tuple[float, float, str]] = {
    "epsilon": (0.0, 1.0, "above 0 and at most 1"),
    "margin": (0.0, 1.0, "above 0 and at most 1"),
    "lead": (0.0, 1.0, "above 0 and at most 1"),
    "level": (0.0, 1.0, "above 0 and at most 1"),
    "overlap": (0.0, 1.0, "above 0 and at most 1"),
    "budget_s": (0.0, 1e9, "above 0 and at most 1e9 seconds"),
}
_COUNTS: Mapping[str, tuple[int, int]] = {
    "rows": (1, 10_000_000),
    "seed": (0, 2**32 - 1),
}


def chosen_codes(select: Sequence[str] = (), ignore: Sequence[str] = ()) -> set[str]:
    """Return the codes that are asked, and all reasons for declining.

    What is left out of every question is told whatever is chosen: without that the
    other answers seem to be about more than they are.

    Args:
        select: Beginnings of codes, such as `FT1`; all codes if none.
        ignore: Beginnings of codes that are left out.

    Raises:
        ValueError: If one is the beginning of no code, a reason for declining is to be
            left out, or nothing is left to ask.

    Example:
        >>> sorted(chosen_codes(["FT10"], ["FT102", "FT103"]))[:5]
        ['FT101', 'FT104', 'FT105', 'FT106', 'FT107']
    """
    select, ignore = as_names(select), as_names(ignore)
    for text in (*select, *ignore):
        if not text or not any(code.startswith(text) for code in CODES):
            raise ValueError(
                f"no code begins with {text!r}; {name_choice(text, [*CODES])}"
            )
    for text in ignore:
        if text.startswith("FTD"):
            raise ValueError(
                f"the code {text!r} cannot be left out: it tells what was not asked"
            )
    taken = select or ("FT",)
    found = {
        code
        for code in CODES
        if code.startswith("FTD")
        or (code.startswith(taken) and not code.startswith(ignore))
    }
    if all(code.startswith("FTD") for code in found):
        raise ValueError("select and ignore leave no code of which anything is asked")
    return found


def check_settings(settings: Settings) -> None:
    """Refuse settings outside their ranges.

    Raises:
        ValueError: If one is; in a sentence.
    """
    for name, (low, high, allowed) in _RANGES.items():
        value = getattr(settings, name)
        if not low < value <= high:
            shown = "the budget" if name == "budget_s" else name
            raise ValueError(f"{shown} must be {allowed}, not {value!r}")
    for name, (least, most) in _COUNTS.items():
        value = getattr(settings, name)
        if not least <= value <= most:
            raise ValueError(f"{name} must be {least} to {most}, not {value!r}")


def changed(settings: Settings, texts: Mapping[str, str]) -> Settings:
    """Return settings with others for some names, as a user writes them.

    The budget is not among them.

    Raises:
        ValueError: If there is no such setting, or its value is none.

    Example:
        >>> changed(Settings(), {"epsilon": "0.2"}).epsilon
        0.2
    """
    known = [name for name in (*_RANGES, *_COUNTS) if name != "budget_s"]
    found: dict[str, float] = {}
    for name, text in texts.items():
        if name not in known:
            raise ValueError(f"no setting {name!r}; {name_choice(name, known)}")
        try:
            found[name] = int(text) if name in _COUNTS else float(text)
        except ValueError:
            noun = "a whole number" if name in _COUNTS else "a number"
            raise ValueError(f"{name} must be {noun}, not {text!r}") from None
        if not math.isfinite(found[name]):
            raise ValueError(f"{name} must be finite, not {text!r}")
    made = msgspec.structs.replace(settings, **found)
    check_settings(made)
    return made

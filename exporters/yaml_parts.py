"""What rule bases, trees and systems have in common, as entries of a YAML file."""

from __future__ import annotations

from collections.abc import Iterable

from fuzzytree.exporters.yaml_text import Entry, Short
from fuzzytree.model.rulebase import LR, Band, Flank, Part, Points, Shape, Side


def range_ends(low: float | None, high: float | None) -> dict[str, Entry]:
    """Return the known ends of a range."""
    ends: dict[str, Entry] = {}
    if low is not None:
        ends["from"] = float(low)
    if high is not None:
        ends["to"] = float(high)
    return ends


def summand(part: Part) -> Short:
    """Return a summand of a combination."""
    entries: dict[str, Entry] = {"input": part.input, "weight": float(part.weight)}
    if repr(float(part.centre)) != "0.0":
        entries["centre"] = float(part.centre)
    return Short(entries)


def named_shape(name: str, shape: Shape) -> dict[str, Entry]:
    """Return a term."""
    match shape:
        case Band():
            return {"name": name, **_band(shape)}
        case LR(mean, left, right):
            middle: dict[str, Entry] = {"name": name, "mean": float(mean)}
            if repr(left) == repr(right):  # 0.0 and -0.0 differ
                return middle | _side(left)
            return {**middle, "left": Short(_side(left)), "right": Short(_side(right))}
        case Points(values, degrees):
            pairs = zip(values, degrees, strict=True)
            return {
                "name": name,
                "points": Short([*map(numbers, pairs)], is_run_on=True),
            }


def _band(band: Band) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    if band.low is not None:
        entries["above"] = float(band.low)
    if band.high is not None:
        entries["up to"] = float(band.high)
    if band.left is not None:
        entries["left flank"] = _flank(band.left)
    if band.right is not None:
        entries["right flank"] = _flank(band.right)
    return entries or {"degree": 1}


def _flank(flank: Flank) -> Short:
    entries: dict[str, Entry] = {"from": float(flank.start), "to": float(flank.end)}
    if flank.curve != (1.0,):
        entries["curve"] = numbers(flank.curve)
    if flank.error is not None:
        entries["fit error"] = float(flank.error)
    return Short(entries)


def _side(side: Side) -> dict[str, Entry]:
    return {
        "spread": float(side.spread),
        "curve": numbers(side.curve),
        "reach": float(side.reach),
    }


def numbers(values: Iterable[float]) -> Short:
    """Return numbers in brackets."""
    return Short([*map(float, values)], is_run_on=True)

"""What rule bases, trees and systems have in common: variables, terms, shapes."""

from __future__ import annotations

from typing import Any

from fuzzytree.auditing.recheck.outcomes import CannotRunError


def keys_of(found: Any, needed: str, allowed: str = "") -> dict[str, Any]:
    """Return a mapping that has some keys, may have others, and no more."""
    must, may = set(needed.split(", ")), set(allowed.split(", "))
    wrong = must - found.keys() | found.keys() - must - may
    if wrong - {""}:
        shown = ", ".join(sorted(wrong))
        raise CannotRunError(f"missing or unknown keys: {shown:.200}")
    return dict(found)


def variable_facts(found: Any) -> dict[str, Any]:
    """Return the facts of a variable."""
    one = keys_of(found, "name", "unit, range, sum of, terms")
    ends = keys_of(one.get("range", {}), "", "from, to")
    parts = [keys_of(p, "input, weight", "centre") for p in one.get("sum of", [])]
    return {
        "name": one["name"],
        "terms": [*map(term_facts, one.get("terms", []))],
        "unit": one.get("unit", ""),
        "low": ends.get("from"),
        "high": ends.get("to"),
        "parts": [{"centre": 0.0} | part for part in parts],
    }


def term_facts(found: Any) -> dict[str, Any]:
    """Return the facts of a term and its shape."""
    shape: dict[str, Any]
    if "points" in found:
        one = keys_of(found, "name, points")
        values, degrees = zip(*one["points"], strict=True)
        shape = {"type": "points", "values": values, "degrees": degrees}
    elif "left" in found:
        one = keys_of(found, "name, mean, left, right")
        sides = {
            side: keys_of(one[side], "spread, curve, reach")
            for side in ("left", "right")
        }
        shape = {"type": "lr", "mean": one["mean"], **sides}
    elif "mean" in found:
        one = keys_of(found, "name, mean, spread, curve, reach")
        side = {key: one[key] for key in ("spread", "curve", "reach")}
        shape = {"type": "lr", "mean": one["mean"], "left": side, "right": side}
    else:
        one = keys_of(found, "name", "above, up to, left flank, right flank, degree")
        rest = one.keys() - {"name", "degree"}
        if one.get("degree", 1) != 1 or ("degree" in one) == bool(rest):
            raise CannotRunError(f"term {one['name']!r:.60} has no shape")
        shape = {"type": "band", "low": one.get("above"), "high": one.get("up to")}
        shape["left"] = _flank(one.get("left flank"))
        shape["right"] = _flank(one.get("right flank"))
    return {"name": one["name"], "shape": shape}


def _flank(found: Any) -> dict[str, Any] | None:
    if found is None:
        return None
    one = keys_of(found, "from, to", "curve, fit error")
    ends = {"start": one["from"], "end": one["to"]}
    return ends | {"curve": one.get("curve", [1.0]), "error": one.get("fit error")}

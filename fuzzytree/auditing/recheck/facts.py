"""Facts of JSON and YAML, and how they become records."""

from __future__ import annotations

import json
import sys
import types
from functools import lru_cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from fuzzytree.auditing.recheck.audit_records import State
from fuzzytree.auditing.recheck.model_records import LR, Band, Points, Shape
from fuzzytree.auditing.recheck.outcomes import MOST_BYTES, CannotRunError

TAGS = {
    Shape: ("type", {"band": Band, "lr": LR, "points": Points}),
    State: ("state", {kind.__name__.upper(): kind for kind in get_args(State)}),
}


def built(kind: Any, value: Any, where: str) -> Any:
    """Return facts as a record: every field must be there, and no other.

    Raises:
        CannotRunError: If a fact has another type.
    """
    if hasattr(value, "_fields"):
        return value  # a record already
    if kind in TAGS:
        name, kinds = TAGS[kind]
        rest = dict(value) if isinstance(value, dict) else {}
        tag = rest.pop(name, None)
        if isinstance(tag, str) and tag in kinds:
            return built(kinds[tag], rest, where)
    origin, choices = get_origin(kind), get_args(kind)
    if origin is types.UnionType and type(None) in choices:
        return None if value is None else built(choices[0], value, where)
    if origin is tuple and isinstance(value, list | tuple):
        every = enumerate(value, 1)
        return tuple(built(choices[0], one, f"{where} {n}") for n, one in every)
    if origin is Literal and isinstance(value, str) and value in choices:
        return value
    names = getattr(kind, "_fields", None)
    if names and isinstance(value, dict):
        wrong = sorted(value.keys() ^ set(names))
        if wrong:
            shown = ", ".join(one if one.isidentifier() else repr(one) for one in wrong)
            raise CannotRunError(f"{where}: missing or unknown: {shown:.200}")
        hints = _hints(kind)
        return kind(*(built(hints[n], value[n], f"{where}, {n}") for n in names))
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    number: float = value if isinstance(value, int | float) else 0
    if kind is float and is_real and abs(number) <= sys.float_info.max:
        return float(number)
    if kind in (str, int, bool) and type(value) is kind:
        return value
    raise CannotRunError(f"{where}: it cannot be {value!r:.60}")


_hints = lru_cache(get_type_hints)


def read_json(content: bytes, name: str) -> dict[str, Any]:
    """Return the facts of a file of JSON.

    Raises:
        CannotRunError: If it is no JSON object, or a key stands twice, or a number is
            not finite.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            raise CannotRunError(f"{name}: a key stands twice in one object")
        return result

    def refuse(text: str) -> Any:
        raise CannotRunError(f"{name}: {text} is no number that JSON knows")

    if len(content) > MOST_BYTES:
        raise CannotRunError(f"{name}: more than {MOST_BYTES:,} bytes")
    try:
        facts = json.loads(content, object_pairs_hook=once, parse_constant=refuse)
        json.dumps(facts, ensure_ascii=False, allow_nan=False).encode()
    except CannotRunError:
        raise
    except (ValueError, RecursionError) as error:
        raise CannotRunError(f"{name}: not JSON: {error!s:.100}") from error
    if not isinstance(facts, dict):
        raise CannotRunError(f"{name}: an object is needed")
    return facts


# --- variables and terms


def keys_of(result: Any, needed: str, allowed: str = "") -> dict[str, Any]:
    """Return a mapping that has some keys, may have others, and no more."""
    must, may = set(needed.split(", ")), set(allowed.split(", "))
    wrong = must - result.keys() | result.keys() - must - may
    if wrong - {""}:
        shown = ", ".join(sorted(wrong))
        raise CannotRunError(f"missing or unknown keys: {shown:.200}")
    return dict(result)


def variable_facts(result: Any) -> dict[str, Any]:
    """Return the facts of a variable."""
    one = keys_of(result, "name", "unit, range, sum of, terms")
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


def term_facts(result: Any) -> dict[str, Any]:
    """Return the facts of a term and its shape."""
    shape: dict[str, Any]
    if "points" in result:
        one = keys_of(result, "name, points")
        values, degrees = zip(*one["points"], strict=True)
        shape = {"type": "points", "values": values, "degrees": degrees}
    elif "left" in result:
        one = keys_of(result, "name, mean, left, right")
        sides = {
            side: keys_of(one[side], "spread, curve, reach")
            for side in ("left", "right")
        }
        shape = {"type": "lr", "mean": one["mean"], **sides}
    elif "mean" in result:
        one = keys_of(result, "name, mean, spread, curve, reach")
        side = {key: one[key] for key in ("spread", "curve", "reach")}
        shape = {"type": "lr", "mean": one["mean"], "left": side, "right": side}
    else:
        one = keys_of(result, "name", "above, up to, left flank, right flank, degree")
        rest = one.keys() - {"name", "degree"}
        if one.get("degree", 1) != 1 or ("degree" in one) == bool(rest):
            raise CannotRunError(f"term {one['name']!r:.60} has no shape")
        shape = {"type": "band", "low": one.get("above"), "high": one.get("up to")}
        shape["left"] = _flank(one.get("left flank"))
        shape["right"] = _flank(one.get("right flank"))
    return {"name": one["name"], "shape": shape}


def _flank(result: Any) -> dict[str, Any] | None:
    if result is None:
        return None
    one = keys_of(result, "from, to", "curve, fit error")
    ends = {"start": one["from"], "end": one["to"]}
    return ends | {"curve": one.get("curve", [1.0]), "error": one.get("fit error")}

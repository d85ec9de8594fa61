"""Facts of JSON and YAML, and how they become records."""

from __future__ import annotations

import json
import math
import re
import sys
import types
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from fuzzytree.auditing.recheck import model_records as records
from fuzzytree.auditing.recheck.audit_records import State
from fuzzytree.auditing.recheck.outcomes import MOST_BYTES, CannotRunError
from fuzzytree.auditing.recheck.systems import read_conclusions, read_condition

STATES: dict[object, Any] = {kind.__name__.upper(): kind for kind in get_args(State)}


def built(kind: Any, value: Any, where: str) -> Any:
    """Return facts as a record: every field must be there, and no other.

    Raises:
        CannotRunError: If a fact has another type.
    """
    if hasattr(value, "_fields"):
        return value  # a record already
    if kind == State and isinstance(value, dict):
        tag = value.get("state")
        if isinstance(tag, str) and tag in STATES:
            rest = {key: one for key, one in value.items() if key != "state"}
            return built(STATES[tag], rest, where)
    origin, choices = get_origin(kind), get_args(kind)
    if origin is types.UnionType and type(None) in choices:
        return None if value is None else built(choices[0], value, where)
    if origin is tuple and isinstance(value, list | tuple):
        every = enumerate(value, 1)
        return tuple(built(choices[0], one, f"{where} {n}") for n, one in every)
    if origin is Literal and isinstance(value, str) and value in choices:
        return value
    if hasattr(kind, "_fields") and isinstance(value, dict):
        return _record(kind, value, where)
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    number: float = value if isinstance(value, int | float) else 0
    if kind is float and is_real and abs(number) <= sys.float_info.max:
        return float(number)
    if kind in (str, int, bool) and type(value) is kind:
        return value
    raise CannotRunError(f"{where}: it cannot be {value!r:.60}")


def _record(kind: Any, value: dict[str, Any], where: str) -> Any:
    facts = LAYOUTS[kind](dict(value)) if kind in LAYOUTS else value
    fields: tuple[str, ...] = kind._fields
    names = {KEYS.get(kind, {}).get(field, field): field for field in fields}
    needed = {key for key, name in names.items() if name not in kind._field_defaults}
    wrong = sorted((facts.keys() - names.keys()) | (needed - facts.keys()))
    if wrong:
        shown = ", ".join(one if one.isidentifier() else repr(one) for one in wrong)
        raise CannotRunError(f"{where}: missing or unknown: {shown:.200}")
    hints = _hints(kind)
    parts = {names[key]: one for key, one in facts.items()}
    return kind(**{n: built(hints[n], v, f"{where}, {n}") for n, v in parts.items()})


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


# --- the layout of a model's file

_RANGE = {"low": "range/from", "high": "range/to", "clips": "range/outside"}
KEYS: dict[Any, dict[str, str]] = {
    records.Flank: {"start": "from", "end": "to", "error": "fit error"},
    records.Band: {
        **{"low": "above", "high": "up to"},
        **{"left": "left flank", "right": "right flank"},
    },
    records.Variable: {**_RANGE, "parts": "sum of"},
    records.Input: {**_RANGE, "labels": "terms", "parts": "sum of"},
    records.Output: {**_RANGE, "labels": "terms"},
    records.Rule: {"when": "if"},
    records.Rules: {"kind": "terms"},
    records.Semantics: {"conjunction": "and", "label_type": "label type"},
    records.Branch: {"terms": "is", "node": "go to/node", "leaf": "go to/leaf"},
    records.Node: {"variable": "ask", "owners": "interval owners"},
    records.Leaf: {"label": "class"},
    records.SystemRule: {"when": "if"},
    records.Activation: {"count_": "count"},
    records.Block: {"conjunction": "and", "disjunction": "or"},
}
"""What a file calls the fields of records, where it has another name for them."""

Facts = dict[str, Any]


def _ranged(one: Facts) -> Facts:
    ends = {**one.pop("range", {})}
    if "outside" in ends:
        ends["outside"] = {"clipped": True}.get(ends["outside"])
    return one | {f"range/{key}": end for key, end in ends.items()}


def _output(one: Facts) -> Facts:
    how = (one.pop("defuzzifier"), one.pop("samples", 100), one.pop("grid", "middle"))
    facts = dict(zip(records.Defuzzifier._fields, how, strict=True))
    blank: Facts = {"terms": [], "aggregation": None, "default": None}
    blank |= dict.fromkeys(("range/from", "range/to"))
    return blank | _ranged(one) | {"defuzzifier": facts}


def _rule(one: Facts) -> Facts:
    then = read_conclusions(one["then"])
    return one | {"if": read_condition(one["if"]), "then": then}


def _term(one: Facts) -> Facts:
    return {"name": one.pop("name"), "shape": _shape(one)}


def _label(one: Facts) -> Facts:
    name, height = one.pop("name"), one.pop("height", 1.0)
    curve = _curve(*next(iter(one.items()))) if len(one) == 1 else None
    return {"name": name, "curve": curve or _shape(one), "height": height}


def _branch(one: Facts) -> Facts:
    """Return a branch with the number of its node or leaf."""
    end = re.fullmatch("(node|leaf) ([1-9][0-9]{0,8})", one.pop("go to"))
    if end is None:
        raise CannotRunError("a branch leads nowhere")
    ends = {"go to/node": None, "go to/leaf": None, f"go to/{end[1]}": int(end[2])}
    return {"sets": []} | one | ends


def _node(one: Facts) -> Facts:
    owners = [owner - 1 for owner in one.get("interval owners", [])]
    return one | {"interval owners": owners or [*range(len(one["branches"]))]}


def _shape(one: Facts) -> Any:
    """Return the shape of a term."""
    if "points" in one:
        values, degrees = zip(*one.pop("points"), strict=True)
        return built(records.Points, one | {"values": values, "degrees": degrees}, "it")
    if "mean" in one:
        if "left" not in one:
            side = {key: one.pop(key) for key in records.Side._fields}
            one |= {"left": side, "right": side}
        return built(records.LR, one, "a term")
    is_whole = "degree" in one
    if one.pop("degree", 1) != 1 or is_whole == bool(one):
        raise CannotRunError("a term has no shape")
    return built(records.Band, one, "a term")


CURVES = {
    "gaussian": "mean, deviation",
    "two gaussians": "left, left deviation, right, right deviation",
    "bell": "center, width, slope",
    "sigmoid": "inflection, slope",
    "s": "start, end",
    "cosine": "center, width",
    "concave": "inflection, end",
    "spike": "center, width",
    "arc": "start, end",
    "semi ellipse": "start, end",
}
"""The curves whose numbers have names, and these names in order."""


def _curve(kind: str, data: Any) -> records.Curve | None:
    """Return a curve that is none of the shapes; None if it is one of these."""
    facts: Facts
    if kind in CURVES:
        if data.keys() != {*CURVES[kind].split(", ")}:
            raise CannotRunError(f"a curve ({kind}) has other numbers")
        names = CURVES[kind].split(", ")
        facts = {name.replace(" ", "_"): _real(data[name]) for name in names}
    elif kind in ("trapezoid", "triangle"):
        a, *inner, d = data
        b, c = map(_real, inner if kind == "trapezoid" else inner * 2)
        facts = {"a": None if a == -math.inf else _real(a), "b": b, "c": c}
        kind, facts["d"] = "trapezoid", None if d == math.inf else _real(d)
    elif kind in ("sigmoid difference", "sigmoid product"):
        first, second = data
        facts = {"first": _curve("sigmoid", first), "second": _curve("sigmoid", second)}
    elif kind == "pi":
        facts = dict(zip("abcd", map(_real, data), strict=True))
    elif kind == "singleton":
        facts = {"value": _real(data)}
    elif kind in ("at least", "at most"):
        facts = {"start": _real(data), "is_above": kind == "at least"}
        kind = "binary"
    elif kind == "linear" and data.keys() == {"weights", "offset"}:
        weights = tuple(map(_real, data["weights"]))
        facts = {"weights": weights, "offset": _real(data["offset"])}
    elif kind == "formula":
        facts = {"text": str(data)}
    else:
        return None
    return records.Curve(kind, tuple(facts.items()))


def _real(value: Any) -> Any:
    return built(float, value, "a curve")


LAYOUTS: dict[Any, Callable[[Facts], Mapping[str, Any]]] = {
    records.Term: _term,
    records.Label: _label,
    records.Variable: _ranged,
    records.Input: _ranged,
    records.Output: _output,
    records.Branch: _branch,
    records.Node: _node,
    records.SystemRule: _rule,
    records.Block: lambda one: {"and": None, "or": None, "implication": None} | one,
}
"""How the facts of a record are laid out in a file, where it is not field by field."""

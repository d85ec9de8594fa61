"""What is hashed: a model, what a rule says, a whole audit."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

from fuzzytree.auditing.recheck.model_records import (
    LR,
    And,
    Band,
    Curve,
    Is,
    Model,
    Not,
    Or,
    Points,
    Rule,
    Shape,
    System,
)

_TAGS: dict[type, str] = {
    kind: kind.__name__.lower() for kind in (Band, LR, Points, Is, And, Or, Not)
}


def fingerprint(model: Model | System) -> str:
    """Return the SHA-256 of a model's content, written as compact JSON."""
    return hashlib.sha256(compact(model).encode()).hexdigest()


def digest_of(facts: Mapping[str, Any]) -> str:
    """Return the SHA-256 of an audit's canonical JSON, with an empty digest."""
    whole = dict(facts) | {"digest": ""}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def compact(value: Any) -> str:
    """Return records, tuples and scalars as JSON without blanks."""
    if isinstance(value, float):
        return _digits(value)
    if not isinstance(value, tuple | list):
        return json.dumps(value, ensure_ascii=False)
    names: tuple[str, ...] = getattr(value, "_fields", ())
    if not names:
        return f"[{','.join(map(compact, value))}]"
    given: list[tuple[str, Any]] = [*zip(names, value, strict=True)]
    given = [pair for pair in given if pair != ("label_type", None)]
    tag = _TAGS.get(type(value))
    if isinstance(value, Curve):
        tag, given = value.kind, [*value.facts]
    pairs = [f'"type":"{tag}"'] if tag else []
    pairs += [f'"{n.rstrip("_")}":{compact(v)}' for n, v in given]
    return f"{{{','.join(pairs)}}}"


def _digits(value: float) -> str:
    """Return the shortest digits: in full from 1e-5 up to 1e16, else with exponent."""
    sign = "-" if math.copysign(1.0, value) < 0 else ""
    mantissa, _, power = f"{abs(value)!r}".partition("e")
    if not power:
        return f"{sign}{mantissa}"
    mantissa = mantissa.removesuffix(".0")
    if int(power) == -5:
        return f"{sign}0.0000{mantissa.replace('.', '')}"
    return f"{sign}{mantissa}e{int(power)}"


def said(rule: Rule, shapes: Mapping[tuple[str, str], Shape]) -> list[Any]:
    """Return what a rule says and with which curves, in an order of its own."""
    clauses = sorted(rule.when, key=str)
    texts = [
        f"{c.variable} is {'not ' * c.negated}{' or '.join(c.terms)}" for c in clauses
    ]
    curves = [
        [c.variable, c.negated, sorted(compact(shapes[c.variable, t]) for t in c.terms)]
        for c in clauses
    ]
    said = f"IF {' AND '.join(texts)} THEN" if texts else "ALWAYS"
    return [f"{said} {rule.then}", sorted(curves, key=str)]

"""A fuzzy system from the facts of its file, and its conditions from sentences.

`dirt is very high and (load is small or not (load is big))`. AND binds closer than OR;
a name of several words stands as it is, one with a word of the language in quotes.
"""

from __future__ import annotations

import math
import re
from typing import Any

from fuzzytree.auditing.recheck.facts import built, keys_of, term_facts, variable_facts
from fuzzytree.auditing.recheck.model_records import (
    And,
    Conclusion,
    Condition,
    Curve,
    Is,
    Label,
    Not,
    Or,
    Shape,
    System,
)
from fuzzytree.auditing.recheck.outcomes import CannotRunError

MOST_LEVELS = 100
HEDGES = (
    *("any", "not", "very", "somewhat", "extremely", "seldom", "cubed", "very very"),
    *("plus", "minus", "cube root"),
)
_HEDGES = {hedge.replace(" ", "-"): hedge for hedge in HEDGES}
_WORDS = {"is", "and", "or", "not", "always", *_HEDGES}
_TOKEN = re.compile(
    r"""\s*(?:('(?:[^']|'')*'|"(?:[^"]|"")*")|([()])|([^\s()'"][^\s()]*)|$)"""
)


class _Sentence:
    """The words of a sentence, from the last to the first one that is not yet read."""

    def __init__(self, text: str) -> None:
        result: list[tuple[str, bool]] = []
        place = 0
        while text[place:].strip():
            token = _TOKEN.match(text, place)
            if token is None:
                raise ValueError("a quote that is not closed")
            quoted, place = token[1], token.end()
            name = quoted[1:-1].replace(quoted[0] * 2, quoted[0]) if quoted else ""
            result.append((name, True) if quoted else (token[2] or token[3], False))
        self.rest = result[::-1]

    def takes(self, *words: str) -> str:
        """Read a word that is the next one, and return it; an empty text if not."""
        if self.rest and not self.rest[-1][1] and self.rest[-1][0] in words:
            return self.rest.pop()[0]
        return ""

    def needs(self, word: str) -> None:
        if not self.takes(word):
            raise ValueError(f"{word!r} is missing")

    def name(self) -> str | None:
        """Read a name, in quotes or of several words; None if there is none."""
        if self.rest and self.rest[-1][1]:
            return self.rest.pop()[0]
        words: list[str] = []
        while self.rest and not self.rest[-1][1]:
            if self.rest[-1][0] in _WORDS | {"(", ")"}:
                break
            words.append(self.rest.pop()[0])
        return " ".join(words) or None

    def clause(self) -> tuple[str, tuple[str, ...], str | None]:
        """Read `variable is hedge ... term`; the term may be missing."""
        variable, hedges = self.name(), list[str]()
        self.needs("is")
        while hedge := self.takes(*_HEDGES):
            hedges.append(_HEDGES[hedge])
        if variable is None:
            raise ValueError("a variable is missing")
        return variable, tuple(hedges), self.name()

    def joined(self, level: int) -> Condition:
        """Read parts that OR joins, each of parts that AND joins."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        every: list[Condition] = []
        while not every or self.takes("or"):
            parts = [self.part(level)]
            while self.takes("and"):
                parts.append(self.part(level))
            every.append(parts[0] if len(parts) == 1 else And(tuple(parts)))
        return every[0] if len(every) == 1 else Or(tuple(every))

    def part(self, level: int) -> Condition:
        """Read a clause, or a condition in parentheses."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        if self.takes("not"):
            if self.rest[-1:] != [("(", False)]:
                raise ValueError("'(' is missing")
            return Not(self.part(level + 1))
        if not self.takes("("):
            variable, hedges, label = self.clause()
            if label is None and hedges[-1:] != ("any",):
                raise ValueError("a term is missing")
            return Is(variable, label, hedges)
        word = self.takes("and", "or")
        result = self.part(level + 1) if word else self.joined(level + 1)
        self.needs(")")
        return And((result,)) if word == "and" else Or((result,)) if word else result


def read_condition(text: str) -> Condition | None:
    """Return the condition of a sentence; None for `always`.

    Raises:
        ValueError: If it is none.

    Example:
        >>> read_condition("speed is not very high")
        Is(variable='speed', label='high', hedges=('not', 'very'))
    """
    sentence = _Sentence(text)
    result = None if sentence.takes("always") else sentence.joined(1)
    if sentence.rest:
        raise ValueError("more behind the condition")
    return result


def read_conclusions(text: str) -> tuple[Conclusion, ...]:
    """Return what a sentence concludes.

    Raises:
        ValueError: If it is none.
    """
    sentence, result = _Sentence(text), list[Conclusion]()
    while not result or sentence.takes("and"):
        output, hedges, label = sentence.clause()
        if label is None:
            raise ValueError("a term is missing")
        result.append(Conclusion(output, label, hedges))
    if sentence.rest:
        raise ValueError("more behind the conclusions")
    return tuple(result)


# --- systems

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

_MEANT = {
    "not": "1 - degree",
    "activated": "rules whose weighted degree is above 0",
    "missing": "a value that is missing or infinite makes every output nan",
}


def read_system(top: dict[str, Any], name: str) -> System:
    """Return the system of a file's facts.

    Raises:
        CannotRunError: If it holds what is not known here.
    """
    head = "format, kind, name, outputs, blocks, semantics"
    facts = keys_of(top, head, "note, inputs")
    if facts["semantics"] != _MEANT or facts["format"] != "fuzzytree/1":
        raise CannotRunError(f"{name}: its meaning is not known")
    whole = {
        "name": facts["name"],
        "inputs": [*map(_input, facts.get("inputs", []))],
        "outputs": [*map(_output, facts["outputs"])],
        "blocks": [*map(_block, facts["blocks"])],
        "note": facts.get("note", ""),
    }
    result: System = built(System, whole, name)
    groups = [[name for name, _ in _labelled(result)]]
    groups += [[label.name for label in labels] for _, labels in _labelled(result)]
    if any(len(set(group)) < len(group) for group in groups):
        raise CannotRunError(f"{name}: a name stands twice")
    return result


def _variable(one: dict[str, Any]) -> dict[str, Any]:
    ends = keys_of(one.pop("range", {}), "", "from, to, outside")
    clips = {None: False, "clipped": True}[ends.pop("outside", None)]
    labels = [*map(_label, one.pop("terms", []))]
    facts = variable_facts({**one, "range": ends})
    del facts["terms"]
    return facts | {"labels": labels, "clips": clips}


def _input(result: Any) -> dict[str, Any]:
    return _variable(keys_of(result, "name", "unit, range, sum of, terms"))


def _output(result: Any) -> dict[str, Any]:
    one = keys_of(
        result,
        "name, defuzzifier",
        "unit, range, terms, samples, grid, aggregation, default",
    )
    how = {
        "method": one.pop("defuzzifier"),
        "samples": one.pop("samples", 100),
        "grid": one.pop("grid", "middle"),
    }
    rest = {key: one.pop(key, None) for key in ("aggregation", "default")}
    facts = _variable(one) | rest | {"defuzzifier": how}
    del facts["parts"]
    return facts


def _label(result: Any) -> dict[str, Any]:
    one = dict(result)
    height = one.pop("height", 1.0)
    kinds = one.keys() - {"name"}
    kind = next(iter(kinds), "")
    curve: Any = _curve(kind, one[kind]) if len(kinds) == 1 else None
    if curve is None:
        curve = built(Shape, term_facts(one)["shape"], "a term")
    return {"name": one["name"], "curve": curve, "height": height}


def _curve(kind: str, data: Any) -> Curve | None:
    """Return a curve that is none of the shapes; None if it is one of these."""
    if kind in ("trapezoid", "triangle"):
        corners = [*map(float, data)]
        a, b, c, d = corners if kind == "trapezoid" else [*corners[:2], *corners[1:]]
        ends = None if a == -math.inf else a, None if d == math.inf else d
        _check_finite(*(end for end in (*ends, b, c) if end is not None))
        return Curve("trapezoid", (("a", ends[0]), ("b", b), ("c", c), ("d", ends[1])))
    if kind in CURVES:
        return Curve(kind, _numbers(data, CURVES[kind]))
    if kind in ("sigmoid difference", "sigmoid product"):
        both = [Curve("sigmoid", _numbers(one, CURVES["sigmoid"])) for one in data]
        return Curve(kind, tuple(zip(("first", "second"), both, strict=True)))
    if kind == "pi":
        values = [*map(float, data)]
        _check_finite(*values)
        return Curve(kind, tuple(zip("abcd", values, strict=True)))
    if kind in ("at least", "at most", "singleton"):
        value = float(data)
        _check_finite(value)
        if kind == "singleton":
            return Curve(kind, (("value", value),))
        return Curve("binary", (("start", value), ("is_above", kind == "at least")))
    if kind == "linear":
        weights = tuple(map(float, keys_of(data, "weights, offset")["weights"]))
        return Curve(kind, (("weights", weights), ("offset", float(data["offset"]))))
    if kind == "formula":
        return Curve(kind, (("text", str(data)),))
    return None


def _numbers(result: Any, names: str) -> tuple[tuple[str, float], ...]:
    data = keys_of(result, names)
    values = [float(data[name]) for name in names.split(", ")]
    _check_finite(*values)
    fields = [name.replace(" ", "_") for name in names.split(", ")]
    return tuple(zip(fields, values, strict=True))


def _check_finite(*values: float) -> None:
    if not all(map(math.isfinite, values)):
        raise ValueError("an infinite number")


def _block(result: Any) -> dict[str, Any]:
    one = keys_of(result, "activation, rules", "name, and, or, implication")
    how = keys_of(one["activation"], "method", "count, threshold, relation")
    return {
        "rules": [*map(_rule, one["rules"])],
        "conjunction": one.get("and"),
        "disjunction": one.get("or"),
        "implication": one.get("implication"),
        "activation": {
            "method": how["method"],
            "count_": how.get("count", 1),
            "threshold": how.get("threshold", 0.0),
            "relation": how.get("relation", ">="),
        },
        "name": one.get("name", ""),
    }


def _rule(result: Any) -> dict[str, Any]:
    one = keys_of(result, "if, then", "name, weight")
    return {
        "when": read_condition(one["if"]),
        "then": read_conclusions(one["then"]),
        "weight": one.get("weight", 1.0),
        "name": one.get("name", ""),
    }


def has_formula(system: System) -> bool:
    """Return whether a term of a system is a formula, whose hash is not known here."""
    every = [label.curve for _, labels in _labelled(system) for label in labels]
    return any(isinstance(one, Curve) and one.kind == "formula" for one in every)


def _labelled(system: System) -> list[tuple[str, tuple[Label, ...]]]:
    """Return the name and the terms of every variable."""
    result = [(one.name, one.labels) for one in system.inputs]
    return result + [(one.name, one.labels) for one in system.outputs]

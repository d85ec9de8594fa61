"""Sentences of requirements, such as `tip rises with service where food >= 5`.

Names that contain words of the grammar stand in quotes.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection
from typing import Final

from fuzzytree.auditing.findings.table_words import read_value
from fuzzytree.auditing.require.claims import (
    Claim,
    ClassClaim,
    CoveredClaim,
    LevelClaim,
    OrderClaim,
    Requirement,
    SlopeClaim,
    UnchangedClaim,
)
from fuzzytree.cells import number_of
from fuzzytree.model import Document, FuzzySystem, Variable, name_choice

_MOST_BOXES = 256
_CONDITION = re.compile(
    r"\s*(?P<name>'[^']+'|\"[^\"]+\"|[^<>=]+?)\s*"
    r"(?:(?P<sign><=|>=|<|>)\s*(?P<end>.+?)"
    r"|\s+is\s+between\s+(?P<low>.+?)\s+and\s+(?P<high>.+?)"
    r"|(?:\s+is\s+|\s*=\s*)(?P<values>.+?))\s*(?:\s+and\s+|$)"
)
_SHARED = (
    (r"every input gets an? (class|output)", "every input gets a class (an output)"),
    (r"changing (?P<columns>.+) changes nothing", "changing INPUT changes nothing"),
)
_OF_CLASSES: Final = (
    (
        r"class (?P<way>rises|falls) with (?P<input>.+) in the order (?P<labels>.+)",
        "class rises (falls) with INPUT in the order CLASS, CLASS",
    ),
    (
        r"class is (?P<how>never|always) (?P<labels>.+)",
        "class is never (always) CLASS or CLASS",
    ),
    *_SHARED,
)
_OF_OUTPUTS: Final = (
    (
        r"(?P<output>.+) is at (?P<side>least|most) (?P<end>\S+)",
        "OUTPUT is at least (at most) NUMBER",
    ),
    (
        r"(?P<output>.+) is between (?P<low>\S+) and (?P<high>\S+)",
        "OUTPUT is between NUMBER and NUMBER",
    ),
    (
        r"(?P<output>.+) (?P<way>rises|falls) with (?P<input>.+)",
        "OUTPUT rises (falls) with INPUT",
    ),
    (
        r"(?P<output>.+) changes by at most (?P<end>\S+) per (?P<input>.+)",
        "OUTPUT changes by at most NUMBER per INPUT",
    ),
    *_SHARED,
)
_Spans = tuple[tuple[float, float], ...]
_ALL: Final[_Spans] = ((-math.inf, math.inf),)


def parse_requirement(text: str, model: Document, where: str = "") -> Requirement:
    """Return the requirement that a sentence states about a model.

    Args:
        text: `CLAIM`, `CLAIM where CONDITION and CONDITION`, or `if CONDITION then
            CLAIM`.
        model: The model.
        where: More conditions.

    Raises:
        ValueError: If it is none, names what is not there, or contradicts itself.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> system = random_system(1)
        >>> text = f"{system.outputs[0].name} is at least 2"
        >>> parse_requirement(text, system).claim.low
        2.0
    """
    claim, _, condition = text.strip().partition(" where ")
    premise = ""
    if implication := re.fullmatch(r"if (.+?) then (.+)", claim):
        premise, claim = implication.groups()
    spans: dict[str, _Spans] = {}
    for part in (premise, condition, where):
        _add_conditions(part, spans, model)
    result = _claim(claim.strip(), model)
    changing: tuple[str, ...] = getattr(result, "columns", ())
    for name in (*changing, getattr(result, "input", "")):
        (low, high), *more = spans.get(name, _ALL)
        if low == high and not more:
            raise ValueError(f"the conditions fix {name!r}, which has to change")
    if math.prod(map(len, spans.values())) > _MOST_BOXES:
        raise ValueError(f"the conditions combine to more than {_MOST_BOXES} cases")
    boxes = (
        dict(zip(spans, box, strict=True)) for box in itertools.product(*spans.values())
    )
    whole = f"{text.strip()} where {where.strip()}" if where else text.strip()
    return Requirement(whole, result, tuple(boxes))


# --- conditions


def _add_conditions(text: str, spans: dict[str, _Spans], model: Document) -> None:
    """Add what conditions, joined by `and`, leave of the values of variables.

    Raises:
        ValueError: If one is none, or they leave no value.
    """
    position = 0
    while text[position:].strip():
        match = _CONDITION.match(text, position)
        if not match:
            raise ValueError(
                f"{text[position:].strip()!r} is no condition; there is NAME < 1, "
                "NAME >= 1, NAME is A or B and NAME is between 1 and 2, joined by 'and'"
            )
        position = match.end()
        name = _plain(match["name"])
        variable = _input(name, model)
        pairs = itertools.product(spans.get(name, _ALL), _condition(match, variable))
        left = [(max(a, c), min(b, d)) for (a, b), (c, d) in pairs]
        spans[name] = tuple((low, high) for low, high in left if low <= high)
        if not spans[name]:
            raise ValueError(f"no value of {name!r} meets all conditions")


def _condition(match: re.Match[str], variable: Variable) -> _Spans:
    """Return the values that meet a condition, with the doubles next to open ends."""
    if match["values"] is not None:
        values = [read_value(variable, text) for text in _names(match["values"])]
        return tuple((value, value) for value in values)
    if variable.categories:
        raise ValueError(
            f"{variable.name!r} has categories, which have no order; write "
            f"'{variable.name} is {variable.categories[0]}'"
        )
    if match["sign"] is None:
        low, high = (read_value(variable, match[end]) for end in ("low", "high"))
        if low > high:
            raise ValueError(_swapped(match))
        return ((low, high),)
    end, sign = read_value(variable, match["end"]), match["sign"]
    if sign[0] == "<":
        return ((-math.inf, end if sign == "<=" else math.nextafter(end, -math.inf)),)
    return ((end if sign == ">=" else math.nextafter(end, math.inf), math.inf),)


def _swapped(match: re.Match[str]) -> str:
    ends = f"the ends {match['low']} and {match['high']} are swapped"
    return f"{ends}; the smaller one stands first"


def _number(text: str) -> float:
    value = number_of(text)
    if value is None or not math.isfinite(value):
        raise ValueError(f"{text!r} must be a number")
    return value


def _names(text: str) -> list[str]:
    return [_plain(name) for name in re.split(r",|\bor\b", text) if name.strip()]


def _plain(text: str) -> str:
    text = text.strip()
    is_quoted = len(text) > 2 and text[0] == text[-1] and text[0] in "'\""
    return text[1:-1] if is_quoted else text


def _choose(name: str, noun: str, names: Collection[str]) -> None:
    if name not in names:
        raise ValueError(f"there is no {noun} {name!r}; {name_choice(name, names)}")


def _input(name: str, model: Document) -> Variable:
    inputs = {one.name: one for one in model.variables if not one.parts}
    _choose(name, "input", inputs)
    return inputs[name]


# --- claims


def _claim(text: str, model: Document) -> Claim:
    forms = _OF_OUTPUTS if isinstance(model, FuzzySystem) else _OF_CLASSES
    for pattern, _ in forms:
        if match := re.fullmatch(pattern, text):
            words = {name: _plain(part) for name, part in match.groupdict().items()}
            if isinstance(model, FuzzySystem):
                return _output_claim(match, words, model)
            return _class_claim(words, model.classes, model)
    shown = "; ".join(form for _, form in forms)
    raise ValueError(f"{text!r} is no requirement of this model; there is {shown}")


def _class_claim(
    words: dict[str, str], classes: tuple[str, ...], model: Document
) -> Claim:
    if "columns" in words:
        return _unchanged(words, model)
    labels = _names(words.get("labels", "")) or [*classes]
    for label in labels:
        _choose(label, "class", classes)
    if "way" in words:
        if sorted(labels) != sorted(classes):
            raise ValueError(f"the order must name once each of {', '.join(classes)}")
        order = tuple(labels if words["way"] == "rises" else labels[::-1])
        return OrderClaim(_input(words["input"], model).name, order)
    if words.get("how") == "never":
        return ClassClaim((None, *(one for one in classes if one not in labels)))
    return ClassClaim(tuple(labels))


def _output_claim(
    match: re.Match[str], words: dict[str, str], system: FuzzySystem
) -> Claim:
    if "columns" in words:
        return _unchanged(words, system)
    if "output" not in words:
        return CoveredClaim()
    output = words["output"]
    _choose(output, "output", [one.name for one in system.outputs])
    ends = {
        name: _number(words[name]) for name in ("low", "high", "end") if name in words
    }
    if "low" in ends and ends["low"] > ends["high"]:
        raise ValueError(_swapped(match))
    if "low" in ends:
        return LevelClaim(output, ends["low"], ends["high"])
    if "side" in words:
        is_low = words["side"] == "least"
        return LevelClaim(
            output, *((ends["end"], None) if is_low else (None, ends["end"]))
        )
    name = _input(words["input"], system).name
    if "way" in words:
        return SlopeClaim(
            output, name, *((0.0, None) if words["way"] == "rises" else (None, 0.0))
        )
    if ends["end"] < 0.0:
        raise ValueError(f"the largest change must be 0 or more, not {words['end']}")
    return SlopeClaim(output, name, -ends["end"], ends["end"])


def _unchanged(words: dict[str, str], model: Document) -> UnchangedClaim:
    """Return the claim; no prediction depends on a column that is no input."""
    names = re.split(r",|\bor\b|\band\b", words["columns"])
    columns = sorted({*model.inputs, *getattr(model, "columns", ())})
    for name in (chosen := [_plain(one) for one in names]):
        _choose(name, "column", columns)
    return UnchangedClaim(tuple(one for one in chosen if one in model.inputs))

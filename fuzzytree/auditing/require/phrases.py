"""Sentences of requirements, such as `tip rises with service where food >= 5`.

Names that contain words of the grammar stand in quotes. A YAML file has many sentences:

```yaml
requirements:
  - that: class is never firm
    where: force < 2
    name: gentle
    why: Eggs break.
```
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection
from typing import Annotated, ClassVar, Final

from msgspec import Meta

from fuzzytree.auditing.findings.domains import read_value
from fuzzytree.auditing.require.claims import (
    Claim,
    ClassClaim,
    ConstancyClaim,
    CoverageClaim,
    NumberClaim,
    OrderClaim,
    Requirement,
)
from fuzzytree.cells import number_of
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats import FileRecord, bind, compose, find, report
from fuzzytree.model import Document, Variable, name_choice

_MOST_BOXES = 256
_MOST_BYTES = 2**20
_Sentence = Annotated[str, Meta(min_length=1, max_length=1000)]
_CONDITION = re.compile(
    r"\s*(?P<name>'[^']+'|\"[^\"]+\"|[^<>=]+?)\s*"
    r"(?:(?P<sign><=|>=|<|>)\s*(?P<end>.+?)"
    r"|\s+is\s+between\s+(?P<low>.+?)\s+and\s+(?P<high>.+?)"
    r"|(?:\s+is\s+|\s*=\s*)(?P<values>.+?))\s*(?:\s+and\s+|$)"
)
_OF_BOTH: Final = {
    r"every input gets an? (class|output)": "every input gets a class (an output)",
    r"changing (?P<columns>.+) changes nothing": "changing INPUT changes nothing",
}
_OF_CLASSES: Final = {
    r"class (?P<way>rises|falls) with (?P<input>.+) in the order (?P<labels>.+)": (
        "class rises (falls) with INPUT in the order CLASS, CLASS"
    ),
    r"class is (?P<how>never|always) (?P<labels>.+)": (
        "class is never (always) CLASS or CLASS"
    ),
} | _OF_BOTH
_OF_OUTPUTS: Final = {
    r"(?P<output>.+) is at (?P<way>least|most) (?P<end>\S+)": (
        "OUTPUT is at least (at most) NUMBER"
    ),
    r"(?P<output>.+) is between (?P<low>\S+) and (?P<high>\S+)": (
        "OUTPUT is between NUMBER and NUMBER"
    ),
    r"(?P<output>.+) (?P<way>rises|falls) with (?P<input>.+)": (
        "OUTPUT rises (falls) with INPUT"
    ),
    r"(?P<output>.+) changes by at most (?P<slope>\S+) per (?P<input>.+)": (
        "OUTPUT changes by at most NUMBER per INPUT"
    ),
} | _OF_BOTH
"""What sentences look like, and how messages show it."""

_Spans = tuple[tuple[float, float], ...]
_ALL: Final[_Spans] = ((-math.inf, math.inf),)


def parse_requirement(text: str, model: Document, where: str = "") -> Requirement:
    """Return the requirement that a sentence states about a model.

    It reads `CLAIM`, `CLAIM where CONDITION and CONDITION`, or `if CONDITION then
    CLAIM`; `where` has more conditions. A ValueError says what is wrong.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> system = random_system(1)
        >>> text = f"{system.outputs[0].name} is at least 2"
        >>> parse_requirement(text, system).claim.low
        2.0
    """
    sentence, _, condition = text.strip().partition(" where ")
    premise = ""
    if implication := re.fullmatch(r"if (.+?) then (.+)", sentence):
        premise, sentence = implication.groups()
    spans: dict[str, _Spans] = {}
    for part in (premise, condition, where):
        _add_conditions(part, spans, model)
    claim = _claim(sentence.strip(), model)
    changes: tuple[str, ...] = getattr(claim, "columns", ())
    for name in (*changes, getattr(claim, "input", "")):
        (low, high), *more = spans.get(name, _ALL)
        if low == high and not more:
            raise ValueError(f"the conditions fix {name!r}, which has to change")
    if math.prod(map(len, spans.values())) > _MOST_BOXES:
        raise ValueError(f"the conditions combine to more than {_MOST_BOXES} cases")
    boxes = itertools.product(*spans.values())
    whole = f"{text.strip()} where {where.strip()}" if where else text.strip()
    return Requirement(
        whole, claim, tuple(dict(zip(spans, box, strict=True)) for box in boxes)
    )


# --- conditions


def _add_conditions(text: str, spans: dict[str, _Spans], model: Document) -> None:
    """Add what conditions, joined by `and`, leave of the values of variables."""
    position = 0
    while text[position:].strip():
        match = _CONDITION.match(text, position)
        if not match:
            raise ValueError(
                f"{text[position:].strip()!r} is no condition; there is NAME < 1, "
                "NAME >= 1, NAME is A or B and NAME is between 1 and 2, joined by 'and'"
            )
        position = match.end()
        variable = _input(match["name"], model)
        name = variable.name
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
        return (_check_ends(low, high, match),)
    end = read_value(variable, match["end"])
    match match["sign"]:
        case "<":
            return ((-math.inf, math.nextafter(end, -math.inf)),)
        case "<=":
            return ((-math.inf, end),)
        case ">":
            return ((math.nextafter(end, math.inf), math.inf),)
        case _:
            return ((end, math.inf),)


def _check_ends(low: float, high: float, match: re.Match[str]) -> tuple[float, float]:
    if low <= high:
        return low, high
    ends = f"the ends {match['low']} and {match['high']} are swapped"
    raise ValueError(f"{ends}; the smaller one stands first")


# --- names and numbers


def _number(text: str) -> float:
    value = number_of(text)
    if value is None or not math.isfinite(value):
        raise ValueError(f"{text!r} must be a number")
    return value


def _names(text: str, joints: str = r",|\bor\b") -> list[str]:
    return [_plain(name) for name in re.split(joints, text) if name.strip()]


def _plain(text: str) -> str:
    text = text.strip()
    is_quoted = len(text) > 2 and text[0] == text[-1] and text[0] in "'\""
    return text[1:-1] if is_quoted else text


def _choice(text: str, noun: str, names: Collection[str]) -> str:
    name = _plain(text)
    if name not in names:
        raise ValueError(f"there is no {noun} {name!r}; {name_choice(name, names)}")
    return name


def _input(text: str, model: Document) -> Variable:
    inputs = {
        variable.name: variable for variable in model.variables if not variable.parts
    }
    return inputs[_choice(text, "input", inputs)]


# --- claims


def _claim(text: str, model: Document) -> Claim:
    forms = _OF_OUTPUTS if model.outputs else _OF_CLASSES
    matches = (re.fullmatch(pattern, text) for pattern in forms)
    match = next((match for match in matches if match), None)
    if match is None:
        shown = "; ".join(forms.values())
        raise ValueError(f"{text!r} is no requirement of this model; there is {shown}")
    if columns := match.groupdict().get("columns"):  # some are no inputs
        every = sorted({*model.inputs, *model.columns})
        names = _names(columns, r",|\bor\b|\band\b")
        chosen = [_choice(name, "column", every) for name in names]
        return ConstancyClaim(tuple(name for name in chosen if name in model.inputs))
    if model.outputs:
        return _output_claim(match, model)
    return _class_claim(match, model.classes, model)


def _class_claim(
    match: re.Match[str], classes: tuple[str, ...], model: Document
) -> Claim:
    words = match.groupdict()
    if not words:
        return ClassClaim(classes)
    labels = tuple(_choice(name, "class", classes) for name in _names(words["labels"]))
    if "way" in words:
        if sorted(labels) != sorted(classes):
            raise ValueError(f"the order must name once each of {', '.join(classes)}")
        order = labels if words["way"] == "rises" else labels[::-1]
        return OrderClaim(_input(words["input"], model).name, order)
    if words["how"] == "never":
        return ClassClaim((None, *(name for name in classes if name not in labels)))
    return ClassClaim(labels)


def _output_claim(match: re.Match[str], system: Document) -> Claim:
    words = match.groupdict()
    if not words:
        return CoverageClaim()
    outputs = [output.name for output in system.outputs]
    output = _choice(words["output"], "output", outputs)
    name = _input(words["input"], system).name if "input" in words else ""
    low, high = -math.inf, math.inf
    if "slope" in words:
        high = _number(words["slope"])
        low = -high
        if high < 0.0:
            text = f"the largest change must be 0 or more, not {words['slope']}"
            raise ValueError(text)
    elif "low" in words:
        low, high = _check_ends(_number(words["low"]), _number(words["high"]), match)
    elif words["way"] in ("least", "rises"):
        low = _number(words.get("end", "0"))
    else:
        high = _number(words.get("end", "0"))
    return NumberClaim(output, low, high, name)


# --- files


class RequirementOfFile(FileRecord, frozen=True, kw_only=True):
    """A sentence, `that`, which must be true for all rows that meet `where`."""

    noun: ClassVar[str] = "a requirement"
    that: _Sentence
    where: _Sentence | None = None
    name: _Sentence | None = None
    why: _Sentence | None = None


class RequirementsFile(FileRecord, frozen=True, kw_only=True):
    """Requirements of a model, which `fuzzytree require` proves or refutes."""

    noun: ClassVar[str] = "a file of requirements"
    requirements: Annotated[
        tuple[RequirementOfFile, ...], Meta(min_length=1, max_length=1000)
    ]


def read_requirements(path: PathLike, model: Document) -> tuple[Requirement, ...]:
    """Return the requirements of a file about a model."""
    root, mistakes = compose(read_bounded(path, _MOST_BYTES), str(path))
    record = bind(root, RequirementsFile, mistakes)
    results: list[Requirement] = []
    for position, entry in enumerate(record.requirements if record else ()):
        node = find(root, ("requirements", position, "that"))
        try:
            requirement = parse_requirement(entry.that, model, entry.where or "")
        except ValueError as error:
            mistakes.append((node.line, node.column, str(error)))
            continue
        requirement = requirement._replace(name=entry.name or "", why=entry.why or "")
        results.append(requirement._replace(line=node.line, column=node.column))
    if mistakes:
        raise report(str(path), mistakes)
    return tuple(results)

"""Check an audit again without the engine that made it: `recheck AUDIT MODEL`.

    python rechecking.py audit.json model.yaml

This file needs Python 3.11 and nothing else, and imports nothing of fuzzytree: copy it,
read it, run it alone. It reads the audit and the model itself, evaluates every witness
again in fractions, decides again what it can, and says what it could not. Exit 0: all
holds; 1: something does not, and all of that is listed; 2: it could not be run.

Its parts, in order: the records of a model and of an audit, YAML, the model, what the
model means in fractions, cells and levels (how a `never` is decided again), the checks.
"""

# ruff: noqa: D101 - docs/yaml-format.md and docs/recheck.md say what the records hold

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
import sys
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

ZERO, ONE = Fraction(0), Fraction(1)
CAP = 1 - Fraction(1, 2**53)  # the largest degree off a plateau
MOST_BYTES = 64 * 2**20
MOST_LEVELS = 32


class CannotRunError(ValueError):
    """A file cannot be read: nothing is checked."""


class DoesNotHoldError(Exception):
    """Something that the audit says is not so."""


class UndecidedError(Exception):
    """Something cannot be decided again here; the text says why."""


# --- Records: the fields of a model, in the order of its fingerprint ------------------


class Flank(NamedTuple):
    start: float
    end: float
    curve: tuple[float, ...]
    error: float | None


class Band(NamedTuple):
    low: float | None
    high: float | None
    left: Flank | None
    right: Flank | None


class Side(NamedTuple):
    spread: float
    curve: tuple[float, ...]
    reach: float


class LR(NamedTuple):
    mean: float
    left: Side
    right: Side


class Points(NamedTuple):
    values: tuple[float, ...]
    degrees: tuple[float, ...]


Shape = Band | LR | Points


class Term(NamedTuple):
    name: str
    shape: Shape


class Part(NamedTuple):
    input: str
    weight: float
    centre: float


class Variable(NamedTuple):
    name: str
    terms: tuple[Term, ...]
    unit: str
    low: float | None
    high: float | None
    parts: tuple[Part, ...]


class Clause(NamedTuple):
    variable: str
    terms: tuple[str, ...]
    negated: bool = False


class Rule(NamedTuple):
    when: tuple[Clause, ...]
    then: str
    support: int | None


class Semantics(NamedTuple):
    conjunction: Literal["min", "product"]
    uncovered: str | None
    missing: str | None


class Rules(NamedTuple):
    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    semantics: Semantics
    kind: str | None
    columns: tuple[str, ...]


class Leaf(NamedTuple):
    label: str
    pattern: str
    support: int | None


class Branch(NamedTuple):
    terms: tuple[str, ...]
    sets: tuple[str, ...]
    node: int | None
    leaf: int | None


class Node(NamedTuple):
    variable: str
    cuts: tuple[float, ...]
    owners: tuple[int, ...]  # the branch of each interval `cuts[i-1] < x <= cuts[i]`
    branches: tuple[Branch, ...]


class Sets(NamedTuple):
    variable: str
    terms: tuple[Term, ...]


class Tree(NamedTuple):
    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    nodes: tuple[Node, ...]
    leaves: tuple[Leaf, ...]
    sets: tuple[Sets, ...]
    semantics: Semantics
    columns: tuple[str, ...]


Model = Rules | Tree

# --- Records: the fields of an audit --------------------------------------------------


class Coordinate(NamedTuple):
    input: str
    exact: str
    decimal: str
    hex: str | None


class Claim(NamedTuple):
    kind: Literal[
        "strength", "beats", "ties", "below", "reaches", "decides", "degree", "covered"
    ]
    of: Literal["rules", "tree", "raw rules", "old", "new"]
    rules: tuple[int, ...]
    rivals: tuple[int, ...]
    level: str | None
    label: str | None
    variable: str | None
    term: str | None


class Span(NamedTuple):
    variable: str
    low: float | None
    high: float | None


class Proved(NamedTuple):
    how: str


class Witness(NamedTuple):
    point: tuple[Coordinate, ...]
    claims: tuple[Claim, ...]
    region: tuple[Span, ...]


class Bracket(NamedTuple):
    of: str
    low: float
    high: float
    why: str
    point: tuple[Coordinate, ...]
    claims: tuple[Claim, ...]


class Sampled(NamedTuple):
    of: str
    hits: int
    rows: int
    low: float
    high: float
    confidence: float
    how: str


class Declined(NamedTuple):
    code: str
    reason: str


State = Proved | Witness | Bracket | Sampled | Declined


class Label(NamedTuple):
    variable: str
    term: str


class Measure(NamedTuple):
    name: str
    value: float
    exact: str | None
    unit: str


class Place(NamedTuple):
    file: str
    line: int
    column: int


class Answer(NamedTuple):
    code: str
    subject: str
    sentence: str
    state: State
    is_finding: bool
    severity: Literal["error", "warning", "info"]
    rules: tuple[int, ...]
    terms: tuple[Label, ...]
    region: tuple[Span, ...]
    measures: tuple[Measure, ...]
    places: tuple[Place, ...]
    repeat: str
    id: str


class DomainSide(NamedTuple):
    variable: str
    low: float
    high: float
    origin: Literal["model", "data", "spreads", "curves", "limits"]
    is_open: bool


class Domain(NamedTuple):
    sides: tuple[DomainSide, ...]


class Policy(NamedTuple):
    conjunction: str
    decision: Literal["strongest", "all"]
    uncovered: str | None
    missing: str | None


class Settings(NamedTuple):
    epsilon: float
    margin: float
    lead: float
    level: float
    overlap: float
    rows: int
    seed: int
    budget_s: float


class Source(NamedTuple):
    name: str
    sha256: str


class Audit(NamedTuple):
    version: str
    model: str
    form: Literal["tree", "relative rules", "raw rules", "rules", "system"]
    fingerprint: str
    file: Source | None
    data: Source | None
    rows: int
    policy: Policy
    domain: Domain
    settings: Settings
    answers: tuple[Answer, ...]
    unasked: tuple[str, ...]
    limits: tuple[str, ...]
    is_complete: bool
    accepted: tuple[str, ...]
    digest: str
    format: Literal["fuzzytree-audit/1"]


TAGS = {
    Shape: ("type", {"band": Band, "lr": LR, "points": Points}),
    State: (
        "state",
        {kind.__name__.upper(): kind for kind in get_args(State)},
    ),
}


def built(kind: Any, value: Any, where: str) -> Any:
    """Return facts as a record: every field must be there, and no other.

    Raises:
        CannotRunError: If a fact has another type.
    """
    if kind in TAGS:
        name, kinds = TAGS[kind]
        rest = dict(value) if isinstance(value, dict) else {}
        tag = rest.pop(name, None)
        if tag in kinds:
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
            raise CannotRunError(f"{where}: missing or unknown: {', '.join(wrong)}")
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


# --- YAML: the subset that fuzzytree writes -------------------------------------------

Yaml = str | int | float | list["Yaml"] | dict[str, "Yaml"]
_KEY = re.compile(r"([a-z][a-z ]*):(?: +|$)")
_QUOTED = re.compile(r"'((?:[^']|'')*)'|\"((?:[^\"\\]|\\.)*)\"")
_ESCAPE = re.compile(r"\\(x[0-9a-fA-F]{2}|u[0-9a-fA-F]{4}|U[0-9a-fA-F]{8}|.)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "\\": "\\", '"': '"', "/": "/"}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_ALIEN = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)|0[ox].*")
_NOTHING = re.compile("~?|null|Null|NULL|true|True|TRUE|false|False|FALSE")
_FORBIDDEN = re.compile(
    "[^\n\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)


class _Line(NamedTuple):
    number: int
    indent: int
    text: str


def read_yaml(content: bytes, name: str) -> Yaml:
    r"""Return what a file of YAML holds: mappings, lists, texts and numbers.

    Raises:
        CannotRunError: If it is not in the subset that fuzzytree writes.

    Example:
        >>> read_yaml(b"classes: [a, 'b']\nrange: {from: 1.5}\n", "x.yaml")
        {'classes': ['a', 'b'], 'range': {'from': 1.5}}
    """
    return _Blocks(content, name).document()


class _Blocks:
    """The lines of a file, and how far they are read."""

    def __init__(self, content: bytes, name: str) -> None:
        self.name, self.at = name, 0
        if len(content) > MOST_BYTES:
            raise CannotRunError(f"{name}: more than {MOST_BYTES:,} bytes")
        try:
            text = content.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise CannotRunError(f"{name}: not UTF-8: {error.reason}") from error
        wrong = _FORBIDDEN.search(text)
        if wrong:
            line = text.count("\n", 0, wrong.start()) + 1
            raise self.error(line, f"character U+{ord(wrong[0]):04X} is not read")
        self.lines: list[_Line] = []
        for number, whole in enumerate(text.split("\n"), 1):
            kept = self._without_comment(whole, number)
            if kept.strip(" "):
                indent = len(kept) - len(kept.lstrip(" "))
                self.lines.append(_Line(number, indent, kept.strip(" ")))

    def error(self, number: int, what: str) -> CannotRunError:
        return CannotRunError(f"{self.name}:{number}: {what}")

    def _without_comment(self, line: str, number: int) -> str:
        """Cut a comment off: a `#` at the start or behind a blank, not in quotes."""
        if "#" not in line:
            return line
        place = 0
        while place < len(line):
            opens = place == 0 or line[place - 1] in " [{,"
            if line[place] in "'\"" and opens:
                quoted = _QUOTED.match(line, place)
                if quoted is None:
                    raise self.error(number, "a quote that does not end on its line")
                place = quoted.end()
            elif line[place] == "#" and (place == 0 or line[place - 1] == " "):
                return line[:place]
            else:
                place += 1
        return line

    def document(self) -> Yaml:
        if not self.lines:
            raise CannotRunError(f"{self.name}: the file is empty")
        found = self.block(self.lines[0].indent, 1)
        if self.at < len(self.lines):
            line = self.lines[self.at]
            raise self.error(line.number, f"{line.text[:40]!r} is not understood here")
        return found

    def block(self, indent: int, level: int) -> Yaml:
        """Return the list or mapping whose lines begin at this indent."""
        line = self.lines[self.at]
        if level > MOST_LEVELS:
            raise self.error(line.number, f"more than {MOST_LEVELS} levels")
        if line.text == "-" or line.text.startswith("- "):
            return self._list(indent, level)
        if _KEY.match(line.text):
            return self._mapping(indent, level)
        raise self.error(line.number, f"no key and no list: {line.text[:40]!r}")

    def _next(self, indent: int) -> _Line | None:
        line = self.lines[self.at] if self.at < len(self.lines) else None
        return line if line is not None and line.indent == indent else None

    def _list(self, indent: int, level: int) -> list[Yaml]:
        items: list[Yaml] = []
        while line := self._next(indent):
            if not (line.text == "-" or line.text.startswith("- ")):
                break
            rest = line.text[1:].lstrip(" ")
            if _KEY.match(rest) or rest.startswith("- ") or not rest:
                inner = indent + len(line.text) - len(rest)
                self.lines[self.at] = _Line(line.number, inner, rest)
                if not rest:
                    self.at += 1
                    raise self.error(line.number, "an empty item")
                items.append(self.block(inner, level + 1))
            else:
                items.append(self._value(line, rest, indent))
        return items

    def _mapping(self, indent: int, level: int) -> dict[str, Yaml]:
        pairs: dict[str, Yaml] = {}
        while line := self._next(indent):
            key = _KEY.match(line.text)
            if key is None:
                break
            if key[1] in pairs:
                raise self.error(line.number, f"the key {key[1]!r} stands twice")
            rest = line.text[key.end() :]
            if rest:
                pairs[key[1]] = self._value(line, rest, indent)
                continue
            self.at += 1
            below = self.lines[self.at] if self.at < len(self.lines) else line
            is_list = below.indent == indent and below.text.startswith("- ")
            if below.number == line.number or not (below.indent > indent or is_list):
                raise self.error(line.number, f"the key {key[1]!r} has no value")
            pairs[key[1]] = self.block(below.indent, level + 1)
        return pairs

    def _value(self, line: _Line, text: str, indent: int) -> Yaml:
        """Return a text, number, or list or mapping in brackets, over several lines."""
        parts = [text]
        self.at += 1
        while self.at < len(self.lines) and self.lines[self.at].indent > indent:
            parts.append(self.lines[self.at].text)
            self.at += 1
        whole = " ".join(parts)
        if text[0] in "'\"" and len(parts) > 1:
            raise self.error(line.number, "a quoted text over several lines")
        flow = _Flow(whole, lambda what: self.error(line.number, what))
        found = flow.value(0) if text[0] in "[{" else flow.scalar(whole)
        if text[0] in "[{" and flow.at != len(whole):
            raise self.error(
                line.number, f"more behind the bracket: {whole[flow.at :]!r}"
            )
        return found


class _Flow:
    """A value in one line: brackets, braces, quotes, words and numbers."""

    def __init__(self, text: str, error: Callable[[str], CannotRunError]) -> None:
        self.text, self.error, self.at = text, error, 0

    def _skip(self) -> str:
        while self.text[self.at : self.at + 1] == " ":
            self.at += 1
        return self.text[self.at : self.at + 1]

    def value(self, level: int) -> Yaml:
        if level > MOST_LEVELS:
            raise self.error(f"more than {MOST_LEVELS} levels")
        if self._skip() == "[":
            return [item for _, item in self._items("]", level)]
        if self._skip() == "{":
            pairs: dict[str, Yaml] = {}
            for key, item in self._items("}", level):
                if key in pairs:
                    raise self.error(f"the key {key!r} stands twice")
                pairs[key] = item
            return pairs
        quoted = _QUOTED.match(self.text, self.at)
        if quoted:
            self.at = quoted.end()
            return self.scalar(quoted[0])
        end = self.at
        while end < len(self.text) and self.text[end] not in ",]}[{":
            end += 1
        word, self.at = self.text[self.at : end].rstrip(" "), end
        return self.scalar(word)

    def _items(self, close: str, level: int) -> Iterator[tuple[str, Yaml]]:
        self.at += 1
        while self._skip() != close:
            key = _KEY.match(self.text, self.at) if close == "}" else None
            if close == "}":
                if key is None:
                    raise self.error(f"no key: {self.text[self.at : self.at + 40]!r}")
                self.at = key.end()
            yield key[1] if key else "", self.value(level + 1)
            if self._skip() == ",":
                self.at += 1
            elif self._skip() != close:
                raise self.error(f"{close!r} or ',' is missing")
        self.at += 1

    def scalar(self, text: str) -> str | int | float:
        if text[:1] in "'\"" and text:
            return self._unquoted(text)
        if _NOTHING.fullmatch(text) or _ALIEN.fullmatch(text):
            raise self.error(f"{text!r} has no place in a model")
        if text[0] in "&*!|>@%`?,[]{}#" or text[:2] in ("- ", "--") or ": " in text:
            raise self.error(f"{text[:40]!r} is not read; quotes make it a text")
        if _INTEGER.fullmatch(text):
            return int(text)
        if _NUMBER.fullmatch(text):
            return float(text)
        return text

    def _unquoted(self, text: str) -> str:
        whole = _QUOTED.fullmatch(text)
        if whole is None:
            raise self.error(f"a quote that does not end: {text[:40]!r}")
        if whole[2] is None:
            return whole[1].replace("''", "'")
        return _ESCAPE.sub(self._escaped, whole[2])

    def _escaped(self, found: re.Match[str]) -> str:
        code = found[1]
        if len(code) == 1:
            if code not in _ESCAPES:
                raise self.error(f"no escape: {found[0]!r}")
            return _ESCAPES[code]
        number = int(code[1:], 16)
        if number > 0x10FFFF or 0xD800 <= number < 0xE000:
            raise self.error(f"no character: {found[0]!r}")
        return chr(number)


# --- The model ------------------------------------------------------------------------


def read_model(content: bytes, name: str) -> Model:
    """Return the rule base or tree of a YAML file.

    Raises:
        CannotRunError: If it is something else, or holds what is not known here.
    """
    top = read_yaml(content, name)
    kind = top.get("kind") if isinstance(top, dict) else None
    if kind not in ("rule base", "tree"):
        raise CannotRunError(f"{name}: rule bases and trees are checked, not {kind!r}")
    try:
        if kind == "tree":
            model = built(Tree, _tree_facts(top), name)
            _check_numbers(model, name)
        else:
            model = built(Rules, _rule_facts(top), name)
        _check_names(model, name)
    except CannotRunError as error:
        raise error if str(error).startswith(name) else _at(name, error) from error
    except (TypeError, AttributeError, KeyError, ValueError) as error:
        raise CannotRunError(f"{name}: not a {kind} that fuzzytree writes") from error
    found: Model = model
    return found


def _at(name: str, error: CannotRunError) -> CannotRunError:
    return CannotRunError(f"{name}: {error}")


def _keys(found: Any, needed: str, allowed: str = "") -> dict[str, Any]:
    """Return a mapping that has some keys, may have others, and no more."""
    must, may = set(needed.split(", ")), set(allowed.split(", "))
    wrong = must - found.keys() | found.keys() - must - may
    if wrong - {""}:
        raise CannotRunError(f"missing or unknown keys: {', '.join(sorted(wrong))}")
    return dict(found)


_HEAD = "format, kind, name, classes, semantics"


def _rule_facts(found: Any) -> dict[str, Any]:
    top = _keys(found, f"{_HEAD}, rules", "columns, variables, terms")
    facts = _head(
        top, {"or": "max", "not": "1 - degree"}, "first of the strongest rules"
    )
    known = {v["name"]: [t["name"] for t in v["terms"]] for v in facts["variables"]}
    rules = [_keys(one, "if, then", "support") for one in top["rules"]]
    facts["rules"] = [
        {
            "when": [_clause(one, known) for one in rule["if"]],
            "then": rule["then"],
            "support": rule.get("support"),
        }
        for rule in rules
    ]
    return facts | {"kind": top.get("terms")}


def _tree_facts(found: Any) -> dict[str, Any]:
    top = _keys(found, f"{_HEAD}, leaves", "columns, variables, nodes, sets")
    cuts = {"cuts": "a value equal to a cut lies below it"}
    facts = _head(top, cuts, "leaf that the nodes lead to")
    facts["nodes"] = [_node(n, one) for n, one in enumerate(top.get("nodes", []), 1)]
    facts["leaves"] = [_leaf(n, one) for n, one in enumerate(top["leaves"], 1)]
    groups = [_keys(one, "variable, terms") for one in top.get("sets", [])]
    facts["sets"] = [
        {"variable": one["variable"], "terms": [*map(_term, one["terms"])]}
        for one in groups
    ]
    return facts


def _head(top: dict[str, Any], fixed: dict[str, str], decides: str) -> dict[str, Any]:
    meant = _keys(
        top["semantics"], f"and, uncovered, missing, answer, {', '.join(fixed)}"
    )
    fixed["answer"] = f"the class of the {decides}"
    wrong = [key for key, text in fixed.items() if meant[key] != text]
    if wrong or top["format"] != "fuzzytree/1":
        raise CannotRunError(
            f"its meaning is not known: {', '.join(wrong or ['format'])}"
        )
    answers: list[str | None] = []
    for text in (meant["uncovered"], meant["missing"]):
        if text != "no class" and not text.startswith("class "):
            raise CannotRunError(f"not an answer: {text!r:.60}")
        answers.append(None if text == "no class" else text.removeprefix("class "))
    semantics = {"conjunction": meant["and"]}
    return {
        "name": top["name"],
        "classes": top["classes"],
        "columns": top.get("columns", []),
        "variables": [*map(_variable, top.get("variables", []))],
        "semantics": semantics | {"uncovered": answers[0], "missing": answers[1]},
    }


def _variable(found: Any) -> dict[str, Any]:
    one = _keys(found, "name", "unit, range, sum of, terms")
    ends = _keys(one.get("range", {}), "", "from, to")
    parts = [_keys(p, "input, weight", "centre") for p in one.get("sum of", [])]
    return {
        "name": one["name"],
        "terms": [*map(_term, one.get("terms", []))],
        "unit": one.get("unit", ""),
        "low": ends.get("from"),
        "high": ends.get("to"),
        "parts": [{"centre": 0.0} | part for part in parts],
    }


def _term(found: Any) -> dict[str, Any]:
    shape: dict[str, Any]
    if "points" in found:
        one = _keys(found, "name, points")
        values, degrees = zip(*one["points"], strict=True)
        shape = {"type": "points", "values": values, "degrees": degrees}
    elif "left" in found:
        one = _keys(found, "name, mean, left, right")
        sides = {
            side: _keys(one[side], "spread, curve, reach") for side in ("left", "right")
        }
        shape = {"type": "lr", "mean": one["mean"], **sides}
    elif "mean" in found:
        one = _keys(found, "name, mean, spread, curve, reach")
        side = {key: one[key] for key in ("spread", "curve", "reach")}
        shape = {"type": "lr", "mean": one["mean"], "left": side, "right": side}
    else:
        one = _keys(found, "name", "above, up to, left flank, right flank, degree")
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
    one = _keys(found, "from, to", "curve, fit error")
    ends = {"start": one["from"], "end": one["to"]}
    return ends | {"curve": one.get("curve", [1.0]), "error": one.get("fit error")}


def _clause(found: Any, known: Mapping[str, Collection[str]]) -> dict[str, Any]:
    if isinstance(found, dict):
        verb = "is not" if "is not" in found else "is"
        one = _keys(found, f"variable, {verb}")
        return Clause(one["variable"], one[verb], verb == "is not")._asdict()
    read = [*itertools.islice(readings(found, known), 2)]
    if len(read) != 1:
        raise CannotRunError(f"{len(read)} readings of {found!r:.200}")
    return read[0]._asdict()


def readings(text: str, known: Mapping[str, Collection[str]]) -> Iterator[Clause]:
    """Yield every clause that a sentence can mean.

    Example:
        >>> list(readings("grip is not firm", {"grip": ["soft", "firm"]}))
        [Clause(variable='grip', terms=('firm',), negated=True)]
    """
    for place in re.finditer("(?= is )", text):
        variable, rest = text[: place.start()], text[place.start() + 4 :]
        if variable in known:
            for terms in _lists(rest, known[variable]):
                yield Clause(variable, terms)
            if rest.startswith("not "):
                for terms in _lists(rest[4:], known[variable]):
                    yield Clause(variable, terms, negated=True)


def _lists(text: str, known: Collection[str]) -> Iterator[tuple[str, ...]]:
    """Yield every list of terms, joined by ` or `, that a text can mean."""
    words = text.split(" or ")
    if len(words) > 1 and not any(" or " in f" {name} " for name in known):
        yield from [tuple(words)] if set(words) <= set(known) else []
        return
    todo: list[tuple[int, tuple[str, ...]]] = [(0, ())]
    while todo:
        start, terms = todo.pop()
        for name in known:
            end = start + len(name)
            if text.startswith(name, start) and end == len(text):
                yield (*terms, name)
            elif text.startswith(name, start) and text.startswith(" or ", end):
                todo.append((end + 4, (*terms, name)))


def _node(number: int, found: Any) -> dict[str, Any]:
    one = _keys(found, "node, ask, cuts, branches", "interval owners")
    ways = [_keys(way, "is, go to", "sets") for way in one["branches"]]
    owners = [owner - 1 for owner in one.get("interval owners", [])]
    if one["node"] != number:
        raise CannotRunError(f"node {number} has another number")
    branches = [
        {"terms": way["is"], "sets": way.get("sets", []), **_target(way["go to"])}
        for way in ways
    ]
    whole = {"variable": one["ask"], "cuts": one["cuts"], "branches": branches}
    return whole | {"owners": owners or [*range(len(ways))]}


def _target(text: str) -> dict[str, int | None]:
    kind, _, number = text.partition(" ")
    if kind not in ("node", "leaf") or not re.fullmatch("[1-9][0-9]{0,8}", number):
        raise CannotRunError(f"a branch cannot lead to {text!r:.60}")
    return {"node": None, "leaf": None, kind: int(number)}


def _leaf(number: int, found: Any) -> dict[str, Any]:
    one = _keys(found, "leaf, class", "pattern, support")
    if one["leaf"] != number:
        raise CannotRunError(f"leaf {number} has another number")
    rest = {"pattern": one.get("pattern", ""), "support": one.get("support")}
    return {"label": one["class"], **rest}


def _check_names(model: Model, name: str) -> None:
    """Refuse a model that uses what it does not declare, or declares it twice."""
    groups = [model.classes, [v.name for v in model.variables]]
    groups += [[t.name for t in v.terms] for v in model.variables]
    if any(len(set(group)) < len(group) for group in groups):
        raise CannotRunError(f"{name}: a name stands twice")
    known = {(v.name, t.name) for v in model.variables for t in v.terms}
    used, labels = set[tuple[str, str]](), set[str]()
    if isinstance(model, Rules):
        clauses = [clause for rule in model.rules for clause in rule.when]
        used = {(c.variable, term) for c in clauses for term in c.terms}
        labels = {rule.then for rule in model.rules}
        is_empty = not model.rules or not all(c.terms for c in clauses)
    else:
        labels = {leaf.label for leaf in model.leaves}
        is_empty = not model.leaves
        used = {
            (n.variable, t) for n in model.nodes for b in n.branches for t in b.terms
        }
    if is_empty or not used <= known or not labels <= set(model.classes):
        raise CannotRunError(
            f"{name}: a rule or leaf that is empty, or uses unknown names"
        )


def _check_numbers(tree: Tree, name: str) -> None:
    """Refuse a tree whose branches do not meet every node and leaf once, in order."""
    nodes = [b.node for node in tree.nodes for b in node.branches if b.leaf is None]
    leaves = [
        b.leaf for node in tree.nodes for b in node.branches if b.leaf is not None
    ]
    is_once = sorted(nodes, key=str) == sorted(range(2, len(tree.nodes) + 1), key=str)
    is_once &= sorted(leaves) == [*range(1, len(tree.leaves) + 1)] or not tree.nodes
    for number, node in enumerate(tree.nodes, 1):
        is_once &= all(b.node is None or b.node > number for b in node.branches)
        is_once &= len(node.owners) == len(node.cuts) + 1 and list(node.cuts) == sorted(
            node.cuts
        )
        is_once &= set(node.owners) == set(range(len(node.branches)))
    if not is_once:
        raise CannotRunError(f"{name}: nodes, leaves or intervals that lead nowhere")


def rules_of(tree: Tree, kind: Literal["relative", "raw"]) -> Rules:
    """Return the rules of a tree: rule k is the path to leaf k, a clause a node."""
    groups = {v.name: v.terms for v in tree.variables}
    if kind == "raw":
        groups = {group.variable: group.terms for group in tree.sets}
    variables = tuple(v._replace(terms=groups.get(v.name, ())) for v in tree.variables)
    rules = [
        Rule(
            tuple(
                Clause(node.variable, way.terms if kind == "relative" else way.sets)
                for node, way in path
            ),
            tree.leaves[number - 1].label,
            tree.leaves[number - 1].support,
        )
        for number, path in paths(tree)
    ]
    head = (tree.name, tree.classes, variables, tuple(rules), tree.semantics)
    return Rules(*head, kind, tree.columns)


Path_ = tuple[tuple[Node, Branch], ...]


def paths(tree: Tree) -> Iterator[tuple[int, Path_]]:
    """Yield each leaf's number and the path to it, in the order of the leaves."""
    todo: list[tuple[int | None, int | None, Path_]]
    todo = [(1, None, ()) if tree.nodes else (None, 1, ())]
    while todo:
        node, leaf, path = todo.pop()
        if node is None:
            yield leaf or 0, path
            continue
        asked = tree.nodes[node - 1]
        todo += [
            (b.node, b.leaf, (*path, (asked, b))) for b in reversed(asked.branches)
        ]


def fingerprint(model: Model) -> str:
    """Return the SHA-256 of a model's content, written as compact JSON."""
    return hashlib.sha256(compact(model).encode()).hexdigest()


def compact(value: Any) -> str:
    """Return records, tuples and scalars as JSON without blanks."""
    if isinstance(value, float):
        return _digits(value)
    if not isinstance(value, tuple | list):
        return json.dumps(value, ensure_ascii=False)
    names: tuple[str, ...] = getattr(value, "_fields", ())
    if not names:
        return f"[{','.join(map(compact, value))}]"
    tags = [(k, t) for t, k in TAGS[Shape][1].items() if isinstance(value, k)]
    pairs = [f'"type":"{tag}"' for _, tag in tags]
    pairs += [f'"{n}":{compact(v)}' for n, v in zip(names, value, strict=True)]
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


# --- What a model means, in fractions -------------------------------------------------

Point = Mapping[str, Fraction]
Poly = tuple[Fraction, ...]  # ascending; () is 0


class Piece(NamedTuple):
    """On `low < x <= high` a degree is `min(max(poly(x), 0), cap)`."""

    low: Fraction | None
    high: Fraction | None
    poly: Poly
    cap: Fraction


def at(poly: Poly, x: Fraction) -> Fraction:
    """Return a polynomial's value."""
    total = ZERO
    for coefficient in reversed(poly):
        total = total * x + coefficient
    return total


def times(one: Poly, other: Poly) -> Poly:
    """Return the product of two polynomials."""
    out = [ZERO] * (len(one) + len(other))
    for (i, a), (j, b) in itertools.product(enumerate(one), enumerate(other)):
        out[i + j] += a * b
    return trimmed(out)


def trimmed(poly: Sequence[Fraction]) -> Poly:
    """Return a polynomial without leading zeros."""
    end = len(poly)
    while end and poly[end - 1] == 0:
        end -= 1
    return tuple(poly[:end])


def plus(one: Poly, other: Poly, weight: int = 1) -> Poly:
    """Return `one + weight * other`."""
    pairs = itertools.zip_longest(one, other, fillvalue=ZERO)
    return trimmed([a + weight * b for a, b in pairs])


def within(curve: Iterable[float | Fraction], inner: Poly) -> Poly:
    """Return `c0 + inner * (c1 + inner * ...)`."""
    total: Poly = ()
    for coefficient in reversed([*curve]):
        total = plus(times(total, inner), (Fraction(coefficient),))
    return total


@lru_cache(maxsize=1 << 14)
def pieces(shape: Shape) -> tuple[Piece, ...]:
    """Return a shape as polynomials in x, from left to right."""
    if isinstance(shape, Points):
        values, degrees = (
            [*map(Fraction, shape.values)],
            [*map(Fraction, shape.degrees)],
        )
        found = [Piece(None, values[0], (degrees[0],), ONE)]
        for (a, b), (p, r) in zip(
            itertools.pairwise(values), itertools.pairwise(degrees), strict=True
        ):
            slope = (r - p) / (b - a) if a < b else ZERO
            found += [Piece(a, b, (p - a * slope, slope), ONE)] if a < b else []
        return (*found, Piece(values[-1], None, (degrees[-1],), ONE))
    if isinstance(shape, LR):
        left, right = _side_pieces(shape, -1), _side_pieces(shape, 1)
        return (*left[::-1], *right)
    low, high = (None if e is None else Fraction(e) for e in (shape.low, shape.high))
    found = []
    for piece in _flank_pieces(shape.left):
        if low is not None and (piece.low is None or piece.low < low):
            end = low if piece.high is None else min(piece.high, low)
            found.append(piece._replace(high=end))
    found.append(Piece(low, high, (ONE,), ONE))
    for piece in _flank_pieces(shape.right):
        if high is not None and (piece.high is None or piece.high > high):
            end = high if piece.low is None else max(piece.low, high)
            found.append(piece._replace(low=end))
    return tuple(found)


def _flank_pieces(flank: Flank | None) -> list[Piece]:
    if flank is None:
        return [Piece(None, None, (), ONE)]
    start, end = Fraction(flank.start), Fraction(flank.end)
    q = (-end / (start - end), 1 / (start - end))
    fall = times(q, within(flank.curve, q))
    top, bottom = (at(fall, start),), ()
    ends = [bottom, top] if end < start else [top, bottom]
    a, b = min(start, end), max(start, end)
    three = [(None, a, ends[0]), (a, b, fall), (b, None, ends[1])]
    return [Piece(low, high, trimmed(poly), CAP) for low, high, poly in three]


def _side_pieces(shape: LR, sign: int) -> list[Piece]:
    """Return one side's pieces, from the mean outwards."""
    side = shape.right if sign > 0 else shape.left
    mean, spread, reach = map(Fraction, (shape.mean, side.spread, side.reach))
    u = (-sign * mean / spread, sign / spread)
    body = plus((ONE,), times(u, within(side.curve, (2 * u[0] - 1, 2 * u[1]))), -1)
    one, end = mean + sign * spread, mean + sign * spread * reach
    height = min(max(at(body, one), ZERO), ONE)
    w = (((reach - u[0]) / (reach - 1)), -u[1] / (reach - 1))
    tail = times((height,), times(times(w, w), times(w, w)))
    three = [(mean, one, body), (one, end, tail), (end, None, ())]
    if sign > 0:
        return [Piece(a, b, poly, ONE) for a, b, poly in three]
    return [Piece(b, a, poly, ONE) for a, b, poly in three]


def degree(shape: Shape, x: Fraction) -> Fraction:
    """Return how far x belongs to a shape.

    Example:
        >>> degree(Points((0.0, 2.0), (0.0, 1.0)), Fraction(1, 2))
        Fraction(1, 4)
    """
    found = pieces(shape)
    first, last = 0, len(found) - 1
    while first < last:  # the first piece that ends at x or above it
        middle = (first + last) // 2
        high = found[middle].high
        first, last = (
            (first, middle) if high is None or x <= high else (middle + 1, last)
        )
    return min(max(at(found[first].poly, x), ZERO), found[first].cap)


def value_of(variable: Variable, point: Point) -> Fraction:
    """Return the value of an input or a combination at a point."""
    if not variable.parts:
        return point[variable.name]
    parts = variable.parts
    terms = (Fraction(p.weight) * (point[p.input] - Fraction(p.centre)) for p in parts)
    return sum(terms, start=ZERO)


def strengths(rules: Rules, point: Point) -> list[Fraction]:
    """Return the strength of every rule at a point."""
    variables = {v.name: v for v in rules.variables}
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    clauses = dict.fromkeys(clause for rule in rules.rules for clause in rule.when)
    degrees: dict[Clause, Fraction] = {}
    for clause in clauses:
        x = value_of(variables[clause.variable], point)
        highest = max(degree(shapes[clause.variable, term], x) for term in clause.terms)
        degrees[clause] = 1 - highest if clause.negated else highest
    found = [[degrees[clause] for clause in rule.when] for rule in rules.rules]
    if rules.semantics.conjunction == "product":
        return [math.prod(one, start=ONE) for one in found]
    return [min(one, default=ONE) for one in found]


def answer_of(model: Model, point: Point) -> str | None:
    """Return the class that a model gives a point; None is no class."""
    if isinstance(model, Rules):
        found = strengths(model, point)
        best = max(found)
        if best == 0:
            return model.semantics.uncovered
        return model.rules[found.index(best)].then
    return model.leaves[leaf_of(model, point) - 1].label


def leaf_of(tree: Tree, point: Point) -> int:
    """Return the number of the leaf that a point reaches."""
    variables = {v.name: v for v in tree.variables}
    branch = Branch((), (), 1, None) if tree.nodes else Branch((), (), None, 1)
    while branch.node is not None:
        node = tree.nodes[branch.node - 1]
        x = value_of(variables[node.variable], point)
        branch = node.branches[node.owners[sum(x > cut for cut in node.cuts)]]
    return branch.leaf or 0


# --- Cells and levels: how a `never` is decided again, under the minimum --------------
#
# A rule is stronger than some rivals at a point exactly if, at some level t, all of its
# clauses are at t or above and each rival has a clause below t. An axis is cut where a
# piece ends, where two degrees cross, and where one turns: in a cell between two cuts
# all are monotone and in one order. Their values at cuts are the critical levels;
# between two of these the picture stays the same, so one level there decides for all.
# Which clauses can be at t or above together is told per axis, and then combined.

MOST_ROOTS, MOST_CRITICAL, MOST_SETS = 4_000, 4_000, 50_000
FINE = Fraction(1, 2**50)


class Root:
    """The one root of a polynomial in an open interval, or a fraction (both ends)."""

    def __init__(self, poly: Poly, low: Fraction, high: Fraction) -> None:
        self.poly, self.low, self.high = poly, low, high
        self.sign = at(poly, low) > 0

    def halve(self) -> None:
        """Make the interval half as wide."""
        middle = (self.low + self.high) / 2
        value = at(self.poly, middle)
        if value == 0:
            self.low = self.high = middle
        elif (value > 0) == self.sign:
            self.low = middle
        else:
            self.high = middle

    def value(self, poly: Poly) -> tuple[Fraction, Fraction]:
        """Return between which two numbers another polynomial's value here lies."""
        low = high = ZERO
        for coefficient in reversed(poly):
            ends = [a * b for a in (low, high) for b in (self.low, self.high)]
            low, high = min(ends) + coefficient, max(ends) + coefficient
        return low, high


def common(one: Poly, other: Poly) -> Poly:
    """Return the greatest common divisor of two polynomials."""
    while other:
        scale = other[-1]
        other = tuple(c / scale for c in other)
        rest = list(one)
        while len(rest) >= len(other):
            top, shift = rest[-1], len(rest) - len(other)
            for place, c in enumerate(other):
                rest[shift + place] -= top * c
            rest = list(trimmed(rest[:-1]))
        one, other = other, tuple(rest)
    return one


def roots(poly: Poly, low: Fraction, high: Fraction) -> list[Root]:
    """Return the roots in an open interval, by Descartes' rule on ever smaller parts.

    Example:
        >>> [root.low < 2 < root.high for root in roots((Fraction(-4), ZERO, ONE), ONE,
        ...     Fraction(4))]
        [True]
    """
    if len(poly) < 2:
        return []
    if len(poly) == 2:
        x = -poly[0] / poly[1]
        return [Root(poly, x, x)] if low < x < high else []
    heights = _bernstein(poly, low, high)
    if _changes(heights) > 1:
        shared = common(poly, derivative(poly))
        if len(shared) > 1:  # several times the same root: once is enough
            return roots(_quotient(poly, shared), low, high)
    found: list[Root] = []
    todo = [(low, high, heights)]
    while todo:
        a, b, heights = todo.pop()
        changes = _changes(heights)
        if changes == 1 and heights[0] and heights[-1]:
            found.append(Root(poly, a, b))
        elif changes:
            middle, size = (a + b) / 2, len(heights) - 1
            left, right = [heights[0] << size], [heights[-1] << size]
            for left_over in range(size - 1, -1, -1):
                heights = [x + y for x, y in itertools.pairwise(heights)]
                left.append(heights[0] << left_over)
                right.append(heights[-1] << left_over)
            if not left[-1]:
                found.append(Root(poly, middle, middle))
            todo += [(a, middle, left), (middle, b, right[::-1])]
    return found


def _changes(heights: Sequence[int]) -> int:
    """Return how often the sign changes: at least as often as there are roots."""
    signs = [height > 0 for height in heights if height]
    return sum(x != y for x, y in itertools.pairwise(signs))


def derivative(poly: Poly) -> Poly:
    """Return the derivative."""
    return tuple(n * c for n, c in enumerate(poly))[1:]


def _quotient(poly: Poly, divisor: Poly) -> Poly:
    rest, out = list(poly), [ZERO] * (len(poly) - len(divisor) + 1)
    for place in range(len(out) - 1, -1, -1):
        out[place] = rest[place + len(divisor) - 1] / divisor[-1]
        for k, c in enumerate(divisor):
            rest[place + k] -= out[place] * c
    return tuple(out)


def _bernstein(poly: Poly, low: Fraction, high: Fraction) -> list[int]:
    """Return the heights of the control points on an interval, times a number."""
    moved, n = within(poly, trimmed((low, high - low))), len(poly) - 1
    bottom = math.lcm(*(c.denominator for c in moved))
    whole = [int(c * bottom) for c in moved] + [0] * (n + 1 - len(moved))
    # The k-th weight, binom(j, k) / binom(n, k), times n!
    return [
        sum(whole[k] * math.perm(j, k) * math.factorial(n - k) for k in range(j + 1))
        for j in range(n + 1)
    ]


def _is_same(one: Root, other: Root) -> bool:
    """Return whether two roots are one number; if not, part their intervals."""
    shared: Poly | None = None
    while one.low <= other.high and other.low <= one.high:
        if one.low < one.high and other.low < other.high:
            shared = common(one.poly, other.poly) if shared is None else shared
            low, high = max(one.low, other.low), min(one.high, other.high)
            if at(shared, low) * at(shared, high) < 0:
                return True
        else:  # one of them is known as a fraction
            x = one.low if one.low == one.high else other.low
            if at(one.poly, x) == 0 == at(other.poly, x):
                return True
        one.halve()
        other.halve()
    return False


End = Root | Fraction
Function = tuple[tuple[Shape, ...], bool]  # the largest of some degrees, or 1 minus it


class Cell(NamedTuple):
    """A part of an axis where functions are in one order: per function, by number."""

    rank: list[int]
    left: list[int]  # the level at its left end
    right: list[int]


class Levels:
    """The critical levels, numbered as they come, and later by bands."""

    def __init__(self) -> None:
        self.numbers: dict[object, int] = {}
        self.known: list[tuple[Poly, End]] = []
        self.band: list[int] = []
        self.bands: list[tuple[Fraction, Fraction]] = []

    def add(self, poly: Poly, end: End) -> int:
        """Return the number of the level that a polynomial has at an end."""
        if isinstance(end, Root) and end.low == end.high:
            end = end.low
        if isinstance(end, Fraction) or len(poly) < 2:
            value = at(poly, end) if isinstance(end, Fraction) else at(poly, ZERO)
            poly, end = (value,), ZERO
        number = self.numbers.setdefault((poly, end), len(self.known))
        if number == len(self.known):
            self.known.append((poly, end))
        if number > MOST_CRITICAL:
            raise UndecidedError(f"more than {MOST_CRITICAL} critical levels")
        return number

    def sort(self) -> None:
        """Give every level its band: levels that cannot be told apart share one."""
        order = sorted((*self._bounds(n), n) for n in range(len(self.known)))
        self.band = [0] * len(order)
        for low, high, number in order:
            if not self.bands or low > self.bands[-1][1]:
                self.bands.append((low, high))
            else:
                self.bands[-1] = (self.bands[-1][0], max(high, self.bands[-1][1]))
            self.band[number] = len(self.bands) - 1

    def _bounds(self, number: int) -> tuple[Fraction, Fraction]:
        poly, end = self.known[number]
        if isinstance(end, Fraction):
            return poly[0], poly[0]
        low, high = end.value(poly)
        while high - low > FINE:
            end.halve()
            low, high = end.value(poly)
        return low, high


def stretches(
    functions: Sequence[Function], low: Fraction, high: Fraction
) -> Iterator[tuple[End, End, list[Poly]]]:
    """Yield the parts of an axis, from left to right, and what functions are there."""
    shapes = dict.fromkeys(shape for group, _ in functions for shape in group)
    ends = {e for s in shapes for p in pieces(s) for e in p[:2] if e is not None}
    cuts = [low, *sorted(e for e in ends if low < e < high), high]
    for a, b in itertools.pairwise(cuts):
        here = {shape: _piece_at(shape, (a + b) / 2) for shape in shapes}
        met: list[End] = [a, *_crossings(_curves(functions, here), a, b), b]
        for left, right in itertools.pairwise(met):
            inside = _between(left, right)
            yield left, right, [_chosen(one, here, inside) for one in functions]


def _between(left: End, right: End) -> Fraction:
    """Return a fraction between two ends."""
    low = left.high if isinstance(left, Root) else left
    return (low + (right.low if isinstance(right, Root) else right)) / 2


def cells(
    functions: Sequence[Function], low: Fraction, high: Fraction, levels: Levels
) -> list[Cell]:
    """Return the cells of an axis between two values, from left to right."""
    found: list[Cell] = []
    for left, right, chosen in stretches(functions, low, high):
        heights = [at(poly, _between(left, right)) for poly in chosen]
        rank = [sorted(set(heights)).index(height) for height in heights]
        ends = [[levels.add(poly, end) for poly in chosen] for end in (left, right)]
        found.append(Cell(rank, ends[0], ends[1]))
    return found


def _piece_at(shape: Shape, x: Fraction) -> Piece:
    found = pieces(shape)
    return next(p for p in found if p.high is None or x <= p.high)


def _chosen(function: Function, here: Mapping[Shape, Piece], x: Fraction) -> Poly:
    """Return the polynomial that a function is around x."""
    best: tuple[Fraction, Poly] = (-ONE, ())
    for shape in function[0]:
        piece = here[shape]
        value = at(piece.poly, x)
        part = () if value <= 0 else piece.poly if value < piece.cap else (piece.cap,)
        best = max(best, (at(part, x), part), key=lambda pair: pair[0])
    return plus((ONE,), best[1], -1) if function[1] else best[1]


def _curves(functions: Sequence[Function], here: Mapping[Shape, Piece]) -> list[Poly]:
    """Return every polynomial that a function can be in a part of the axis."""
    found: dict[Poly, None] = {}
    for group, negated in functions:
        for shape in group:
            for part in (here[shape].poly, (here[shape].cap,), ()):
                found[plus((ONE,), part, -1) if negated else part] = None
    return list(found)


def _crossings(curves: Sequence[Poly], a: Fraction, b: Fraction) -> list[Root]:
    """Return where two of some polynomials cross or one turns, in order."""
    asked = dict.fromkeys(derivative(poly) for poly in curves)
    pairs = itertools.combinations(curves, 2)
    asked |= dict.fromkeys(plus(one, other, -1) for one, other in pairs)
    if len(asked) > MOST_ROOTS:
        raise UndecidedError(
            f"more than {MOST_ROOTS} crossings to look for in one place"
        )
    met: list[Root] = []
    for poly in asked:
        for root in roots(poly, a, b):
            while root.low <= a or root.high >= b:
                root.halve()
            if not any(_is_same(root, other) for other in met):
                met.append(root)
    return sorted(met, key=lambda root: root.low)


class Line(NamedTuple):
    """The values of a variable that are asked about."""

    low: Fraction
    high: Fraction
    is_open: bool


def line_cells(functions: list[Function], line: Line, levels: Levels) -> list[Cell]:
    """Return the cells of a line, and its lower end as a cell of its own."""
    found = (
        cells(functions, line.low, line.high, levels) if line.low < line.high else []
    )
    if not line.is_open:
        here = {s: _piece_at(s, line.low) for group, _ in functions for s in group}
        values = [at(_chosen(f, here, line.low), line.low) for f in functions]
        rank = [sorted(set(values)).index(value) for value in values]
        ends = [levels.add((value,), ZERO) for value in values]
        found.append(Cell(rank, ends, ends))
    return found


class Axis(NamedTuple):
    """A variable: the numbers of the functions that rules ask, and its cells."""

    numbers: dict[Clause, int]
    cells: list[Cell]


Asked = tuple[int, ...]  # what a rule asks of each axis: its functions as bits


class Grid:
    """Rules on a box, cut into cells, with their critical levels in order."""

    def __init__(
        self, rules: Rules, lines: Mapping[str, Line], extra: Iterable[Fraction]
    ) -> None:
        self.levels = Levels()
        self.marks = {one: self.levels.add((one,), ZERO) for one in (ZERO, ONE, *extra)}
        self.axes: list[Axis] = []
        every = [clause for rule in rules.rules for clause in rule.when]
        for variable in rules.variables:
            clauses = [c for c in dict.fromkeys(every) if c.variable == variable.name]
            if clauses:
                functions = _functions(variable, clauses)
                known = {
                    one: number for number, one in enumerate(dict.fromkeys(functions))
                }
                numbers = {c: known[f] for c, f in zip(clauses, functions, strict=True)}
                found = line_cells([*known], lines[variable.name], self.levels)
                self.axes.append(Axis(numbers, found))
        self.levels.sort()
        self.of = [self.asked(rule.when) for rule in rules.rules]
        self.patterns: dict[tuple[int, bool], list[set[int]]] = {}

    def asked(self, when: Iterable[Clause]) -> Asked:
        """Return what clauses ask of each axis; every one must be of some rule."""
        bits = [0] * len(self.axes)
        for clause in when:
            for place, axis in enumerate(self.axes):
                bits[place] |= (
                    1 << axis.numbers[clause] if clause in axis.numbers else 0
                )
        return tuple(bits)

    def _sets(self, band: int, *, is_gap: bool) -> list[set[int]]:
        """Return per axis which sets of functions can be at a level or above.

        The level is any between a band and the next one, or any within the band.
        """
        key = (band, is_gap)
        if key not in self.patterns:
            self.patterns[key] = [
                self._of_axis(axis, band, is_gap) for axis in self.axes
            ]
        return self.patterns[key]

    def _of_axis(self, axis: Axis, band: int, is_gap: bool) -> set[int]:
        found: set[int] = set()
        of = self.levels.band
        for cell in axis.cells:
            base = 0
            crossing: dict[int, int] = {}
            for number, ends in enumerate(zip(cell.left, cell.right, strict=True)):
                least, most = sorted((of[ends[0]], of[ends[1]]))
                if least > band:
                    base |= 1 << number
                elif most > band or (most == band and not is_gap):
                    rank = cell.rank[number]
                    crossing[rank] = crossing.get(rank, 0) | 1 << number
            found.add(base)
            for rank in sorted(crossing, reverse=True):
                base |= crossing[rank]
                found.add(base)
        return found

    def wins(self, mine: Asked | None, rivals: Sequence[Asked]) -> bool:
        """Return whether a rule is somewhere stronger than each rival.

        Variables are free of each other. Without a rule: whether all rivals are
        somewhere below 1.

        Raises:
            UndecidedError: If it is too much, or levels are too near to tell apart.
        """
        bands = self.levels.bands
        work = len(bands) * sum(len(a.cells) for a in self.axes) * (1 + len(rivals))
        if work > 6_000_000:
            raise UndecidedError(f"too large to decide again here: {work:,} steps")
        if any(self.leaves(mine, rivals, band) for band in range(len(bands) - 1)):
            return True
        for band, (low, high) in enumerate(bands):
            if low < high and self.leaves(mine, rivals, band, is_gap=False):
                raise UndecidedError("two critical levels are too near to tell apart")
        return False

    def is_bare(self, rules: Sequence[Asked]) -> bool | None:
        """Return whether all rules are somewhere exactly 0; None if it is not known."""
        found = [False, False]
        for vague in (False, True):
            live, full = {0}, (1 << len(rules)) - 1
            for place, axis in enumerate(self.axes):
                sets = self._zeros(axis, is_vague=vague)
                below = {
                    sum(1 << n for n, of in enumerate(rules) if of[place] & zeros)
                    for zeros in sets
                }
                live = _largest(a | b for a in live for b in _largest(below))
            found[vague] = full in live
        return None if found[0] != found[1] else found[0]

    def _zeros(self, axis: Axis, *, is_vague: bool) -> set[int]:
        """Return which functions are 0 together: in a cell, or at its right end."""
        bands, zero = self.levels.bands, self.marks[ZERO]
        lowest = self.levels.band[zero]
        is_sharp = bands[lowest][0] == bands[lowest][1]
        found: set[int] = set()
        for cell in axis.cells:
            pairs = list(enumerate(zip(cell.left, cell.right, strict=True)))
            found.add(sum(1 << n for n, ends in pairs if ends == (zero, zero)))
            right = [n for n, ends in pairs if self.levels.band[ends[1]] == lowest]
            if not is_vague and not is_sharp:
                right = [n for n in right if cell.right[n] == zero]
            found.add(sum(1 << n for n in right))
        return found

    def gap(self, level: Fraction, *, is_above: bool) -> int:
        """Return the band whose gap is just above or just below an extra level."""
        return self.levels.band[self.marks[level]] - (not is_above)

    def is_below(self, mine: Asked, theirs: Asked) -> bool:
        """Return whether a rule's degree is nowhere above a rival's, on every axis.

        That suffices for min and product alike. A rule of several clauses on one
        variable is not looked at.
        """
        for axis, own, other in zip(self.axes, mine, theirs, strict=True):
            if max(own.bit_count(), other.bit_count()) > 1:
                return False
            one, two = own.bit_length() - 1, other.bit_length() - 1
            for cell in axis.cells if other else ():
                ends = [self.levels.known[end[two]] for end in (cell.left, cell.right)]
                is_one = ends == [((ONE,), ZERO)] * 2
                if not is_one and (not own or cell.rank[one] > cell.rank[two]):
                    return False
        return True

    def leaves(
        self,
        mine: Asked | None,
        rivals: Sequence[Asked],
        band: int,
        *,
        is_gap: bool = True,
    ) -> bool:
        """Return whether at a level a rule can be there and each rival below."""
        live, full = {0}, (1 << len(rivals)) - 1
        for place, sets in enumerate(self._sets(band, is_gap=is_gap)):
            own = mine[place] if mine else 0
            below = {
                sum(1 << n for n, other in enumerate(rivals) if other[place] & ~reached)
                for reached in sets
                if reached & own == own
            }
            live = _largest(a | b for a in live for b in _largest(below))
            if len(live) > MOST_SETS:
                raise UndecidedError(f"more than {MOST_SETS} sets of rivals")
        return full in live


def _functions(variable: Variable, clauses: Iterable[Clause]) -> list[Function]:
    shapes = {term.name: term.shape for term in variable.terms}
    return [(tuple(shapes[t] for t in c.terms), c.negated) for c in clauses]


def _largest(sets: Iterable[int]) -> set[int]:
    """Return the sets, as bits, that no other one contains."""
    kept: list[int] = []
    for one in sorted(set(sets), key=lambda bits: -bits.bit_count()):
        if all(one | other != other for other in kept):
            kept.append(one)
    return set(kept)


# --- The checks -----------------------------------------------------------------------

LIMITS = (
    "that the rules are right: an audit finds what a rule base says, not whether it is "
    "true of the world",
    "anything outside the domain: every answer holds on the stated ranges and nowhere "
    "else",
    "that all of the domain can happen: inputs are asked in every combination, also in "
    "those that no row will ever have",
    "more about a sampled share than its interval says, and that only with the stated "
    "confidence",
    "what a bracket leaves open: the number lies between the two ends, and nothing "
    "more is known",
    "anything about what was declined or not asked; both are listed",
    "that strengths which only touch are told: ties and gaps without an interior are "
    "left out",
    "what rounding changes: answers are about real numbers at the doubles of the "
    "model, and a runtime may differ where strengths nearly tie",
    "that other files, runtimes or devices answer alike: only what was compared is "
    "compared",
    "that the given rows are right, or stand for those to come",
    "who made this audit: the digest shows an edit, and is no signature",
)
"""What every audit says that it does not establish, word for word."""

SEVERITIES = {
    **dict.fromkeys(("FT105", "FT601", "FT602"), "error"),
    **dict.fromkeys(("FT102", "FT104", "FT202", "FT203", "FT402"), "warning"),
    **dict.fromkeys(("FT103", "FT107", "FT201", "FT204", "FT205", "FT403"), "info"),
    **dict.fromkeys(("FT404", "FT501", "FT701"), "info"),
    **dict.fromkeys([f"FTD0{n}" for n in range(1, 9)], "info"),
    "FT101": "error warning",  # it decides by its place alone
    "FT301": "warning info",  # the model answers a class where no rule fires
    "FT106": "warning error",  # of another class: a contradiction
    "FT401": "warning error",  # never reached at all
}
"""Every code, and the severities that a finding of it can have."""


def read_json(content: bytes, name: str) -> dict[str, Any]:
    """Return the facts of a file of JSON.

    Raises:
        CannotRunError: If it is no JSON object, or a key stands twice, or a number is
            not finite.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            raise CannotRunError(f"{name}: a key stands twice in one object")
        return found

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


class Report:
    """What a re-check found.

    Attributes:
        wrong: What does not hold, a sentence each.
        counts: How often each kind of check was made.
        undecided: Which answers were not decided again, by state and reason.
    """

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.counts: dict[str, int] = {}
        self.undecided: dict[tuple[str, str], list[str]] = {}

    def count(self, what: str, number: int = 1) -> None:
        """Note that something was checked."""
        self.counts[what] = self.counts.get(what, 0) + number

    def expect(self, is_so: bool, otherwise: str) -> None:
        """Note what does not hold, unless it is so."""
        if not is_so:
            self.wrong.append(otherwise)

    def lines(self) -> Iterator[str]:
        """Yield the report, line by line."""
        counts = dict(sorted(self.counts.items()))
        for (state, _), codes in self.undecided.items():
            name = f"answers {state}, not decided again"
            counts[name] = counts.get(name, 0) + len(codes)
        width = max(map(len, counts), default=0)
        yield from (f"{what:<{width}}  {number}" for what, number in counts.items())
        if self.undecided:
            yield "not decided again:"
        for (_, why), codes in self.undecided.items():
            size = f" ({len(codes)} answers)" if len(codes) > 1 else ""
            yield f"  {', '.join(dict.fromkeys(codes))}{size}: {why}"
        yield from (f"DOES NOT HOLD: {text}" for text in self.wrong)
        many = len(self.wrong)
        what = f"{many} {'points do' if many != 1 else 'point does'} not hold"
        yield what if many else "the audit holds as far as it was checked again"


def recheck(audit: bytes, model: bytes, names: tuple[str, str]) -> Report:
    """Check an audit against the model that it is of.

    Args:
        audit: The audit's file: JSON.
        model: The model's file: YAML.
        names: What messages call the two.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    facts = read_json(audit, names[0])
    found, known = built(Audit, facts, names[0]), read_model(model, names[1])
    if found.form == "system":
        raise CannotRunError(f"{names[0]}: audits of systems are not checked again")
    checks = _Checks(found, known)
    digest = digest_of(facts)
    checks.report.expect(found.digest == digest, f"the digest is {digest}")
    sha = hashlib.sha256(model).hexdigest()
    if found.file is not None:
        text = f"the SHA-256 of {names[1]} is {sha}, and not that of the audited file"
        checks.report.expect(found.file.sha256 == sha, text)
    checks.head()
    checks.asked()
    checks.complete()
    checks.ids()
    for number, answer in enumerate(found.answers, 1):
        checks.answer(answer, f"answer {number} ({answer.code}, {answer.subject:.60})")
    return checks.report


def digest_of(facts: Mapping[str, Any]) -> str:
    """Return the SHA-256 of an audit's canonical JSON, with an empty digest."""
    whole = dict(facts) | {"digest": ""}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


class _Checks:
    """An audit, its model in every form, and what was found so far."""

    def __init__(self, audit: Audit, model: Model) -> None:
        self.audit, self.model, self.report = audit, model, Report()
        self.carriers: dict[str, Model] = {}
        if isinstance(model, Tree):
            self.rules = rules_of(model, "relative")
            self.carriers = {"tree": model}
            if model.sets:
                self.carriers["raw rules"] = rules_of(model, "raw")
        else:
            self.rules = model
        self.carriers["rules"] = self.rules
        self.variables = {v.name: v for v in model.variables}
        self.sides = {side.variable: side for side in audit.domain.sides}
        self.is_free = not any(v.parts for v in model.variables)
        self.numbers = range(1, len(self.rules.rules) + 1)

    @cached_property
    def grid(self) -> Grid:
        """The rules in cells."""
        lines = {v.name: _line(self, v) for v in self.rules.variables}
        extra = [
            Fraction(self.audit.settings.epsilon),
            Fraction(self.audit.settings.level),
        ]
        return Grid(self.rules, lines, extra)

    @cached_property
    def paths(self) -> dict[int, Path_]:
        """The path to each leaf."""
        return dict(paths(self.model)) if isinstance(self.model, Tree) else {}

    def pairs(self, *, alike: bool) -> list[tuple[int, int]]:
        """Return the pairs of rules of one class, or of two."""
        every = itertools.combinations(self.numbers, 2)
        return [p for p in every if (_then(self, p[0]) == _then(self, p[1])) is alike]

    def fire(self, *numbers: int) -> bool:
        """Return whether each of some rules fires somewhere."""
        gap = self.grid.gap(ZERO, is_above=True)
        return all(self.grid.leaves(self.grid.of[n - 1], (), gap) for n in numbers)

    @cached_property
    def heights(self) -> dict[Label, Fraction]:
        """The largest degree of each term on the domain."""
        level = Fraction(self.audit.settings.level)
        return {
            Label(v.name, term.name): _height(term.shape, _line(self, v), level)
            for v in self.rules.variables
            for term in v.terms
        }

    @cached_property
    def shares(self) -> dict[tuple[Label, ...], tuple[Fraction, Fraction] | None]:
        """The shared area of each pair of terms of a variable; None without area."""
        return {
            (Label(v.name, a.name), Label(v.name, b.name)): _shared(
                a.shape, b.shape, _line(self, v)
            )
            for v in self.rules.variables
            for a, b in itertools.combinations(v.terms, 2)
        }

    # what the audit says of itself

    def head(self) -> None:
        """Check what stands before the answers."""
        audit, model, expect = self.audit, self.model, self.report.expect
        kind = (
            f"{model.kind} rules"
            if isinstance(model, Rules) and model.kind
            else "rules"
        )
        form = kind if isinstance(model, Rules) else "tree"
        expect(audit.form == form, f"the form of the model is {form!r}")
        expect(audit.model == model.name, f"the model's name is {model.name!r}")
        print_ = fingerprint(model)
        expect(audit.fingerprint == print_, f"the model's fingerprint is {print_}")
        meant = model.semantics
        policy = Policy(meant.conjunction, "strongest", meant.uncovered, meant.missing)
        expect(audit.policy == policy, "the policy is not the model's")
        expect(audit.limits == LIMITS, "the panel of limits is not the fixed one")
        self._settings()
        self._domain()
        ids = [one.id for one in audit.answers if one.is_finding]
        known = sorted(set(ids).intersection(audit.accepted))
        expect(list(audit.accepted) == known, "a finding is accepted that there is not")
        is_data = audit.data is not None
        expect(
            (audit.rows > 0) == is_data,
            "rows are told without a table, or none with one",
        )
        self.report.count("facts about the audit", 12)

    def _settings(self) -> None:
        given, expect = self.audit.settings, self.report.expect
        for name in ("epsilon", "margin", "lead", "level", "overlap"):
            expect(
                0 < getattr(given, name) <= 1, f"the setting {name} is not in (0, 1]"
            )
        expect(1 <= given.rows <= 10**7, "the setting rows is not in 1 to 10,000,000")
        expect(0 <= given.seed < 2**32, "the setting seed is not in 0 to 2**32 - 1")
        expect(0 < given.budget_s <= 1e9, "the budget is not in (0, 1e9] seconds")

    def _domain(self) -> None:
        expect = self.report.expect
        order = [name for name in self.variables if name in self.sides]
        is_plain = [side.variable for side in self.audit.domain.sides] == order
        expect(is_plain, "the domain's sides are not those of variables, in order")
        for name, side in self.sides.items():
            text = f"the side of {name!r}"
            expect(name in self.variables, f"{text} is of no variable")
            expect(side.low <= side.high, f"{text} has swapped ends")
            expect(not side.is_open, f"{text} is open, as no audit's is")
            variable = self.variables.get(name)
            if variable is not None and side.origin == "model":
                is_range = (side.low, side.high) == (variable.low, variable.high)
                expect(is_range, f"{text} is not the model's range")
        for name, variable in self.variables.items():
            expect(bool(variable.parts) or name in self.sides, f"{name!r} has no side")

    def asked(self) -> None:
        """Check that every question was asked or is told to be left out."""
        audit, expect = self.audit, self.report.expect
        codes = [one.code for one in audit.answers]
        expect(
            codes == sorted(codes), "the answers are not in the order of their codes"
        )
        ends = [f" --select {code}" for code in codes]
        texts = [one.repeat for one in audit.answers]
        pairs = list(zip(texts, ends, strict=True))
        starts = {text.removesuffix(end) for text, end in pairs}
        is_one = starts <= {""} or all(text.endswith(end) for text, end in pairs)
        expect(is_one and len(starts) < 2, "the commands that find it again differ")
        told = [text.split(" ")[0] for text in audit.unasked]
        expect(told == sorted(set(told)), "what was not asked is not in order")
        cut = [text for text in audit.unasked if ": cut short: " in text]
        late = ("is spent", "interrupted")
        cut += [
            text for text in audit.unasked if text.endswith(late) and text not in cut
        ]
        expect(
            audit.is_complete == (not cut), "is_complete is not what was left out says"
        )
        for code in SEVERITIES:
            if code.startswith(("FTD", "FT8")):
                continue
            is_told = code in codes or code in told
            expect(is_told, f"{code} was neither asked nor told to be left out")
        for text in audit.unasked:
            is_left = text.endswith(("left out by the user", "to ask it of"))
            is_both = text.split(" ")[0] in codes and (
                is_left or ": not asked: " in text
            )
            expect(
                not is_both, f"{text.split(' ')[0]} was asked, and told to be left out"
            )

    def complete(self) -> None:
        """Check that each rule and clause was asked about, if the code was not cut."""
        told = {text.split(" ")[0] for text in self.audit.unasked}
        by: dict[str, list[Answer]] = {code: [] for code in SEVERITIES}
        for one in self.audit.answers:
            by.get(one.code, []).append(one)
        every = {*self.numbers}
        dead = {one.rules[0] for one in by["FT101"] if one.is_finding and one.rules}
        wanted = {"FT101": every, "FT102": every - dead, "FT103": every}
        if isinstance(self.model, Tree):
            wanted["FT101"] = dead
            wanted["FT205"] = every - dead
        if len(every) == 1:
            del wanted["FT103"]
        for code, numbers in wanted.items():
            found = {one.rules[0] for one in by[code] if one.rules}
            if code not in told and by[code] and found != numbers:
                self.report.wrong.append(f"{code} was not asked of each rule, or twice")
        clauses = sum(len(rule.when) for rule in self.rules.rules)
        asked = sum(
            m.value for one in by["FT107"] for m in one.measures if not one.rules
        )
        asked += sum(bool(one.rules) for one in by["FT107"])
        is_all = "FT107" in told or not by["FT107"] or asked == clauses
        self.report.expect(is_all, "FT107 was not asked of each clause")

    def ids(self) -> None:
        """Check each id: its code and a hash of what the rules and terms say."""
        carriers = [c for c in self.carriers.values() if isinstance(c, Rules)]
        shapes: dict[tuple[str, str], Shape] = {}
        for carrier in (*carriers, self.rules):  # the rules' own terms come last
            shapes |= {
                (v.name, t.name): t.shape for v in carrier.variables for t in v.terms
            }
        counts: dict[str, int] = {}
        for number, answer in enumerate(self.audit.answers, 1):
            if not all(1 <= k <= len(self.rules.rules) for k in answer.rules):
                continue
            known = [_said(self.rules.rules[k - 1], shapes) for k in answer.rules]
            known += [
                [*label, shapes.get((label[0], label[1]))] for label in answer.terms
            ]
            other = [] if known else [answer.subject, answer.region]
            content = compact([answer.code, known, other]).encode()
            name = f"{answer.code}-{hashlib.sha256(content).hexdigest()[:8]}"
            counts[name] = counts.get(name, 0) + 1
            name += f"-{counts[name]}" if counts[name] > 1 else ""
            self.report.expect(
                answer.id == name, f"the id of answer {number} is {name}"
            )

    # one answer

    def answer(self, answer: Answer, where: str) -> None:
        """Check everything about an answer."""
        expect, wrong = self.report.expect, self.report.wrong
        allowed = SEVERITIES.get(answer.code, "").split(" ")
        if not allowed[0] or answer.code.startswith("FT8"):
            wrong.append(f"{where}: no question of an audit has this code")
            return
        if answer.severity not in (
            allowed if answer.is_finding else ["info", *allowed]
        ):
            wrong.append(f"{where}: its severity is {' or '.join(allowed)}")
        expect(bool(answer.sentence and answer.subject), f"{where}: it says nothing")
        count = len(self.rules.rules)
        for number in answer.rules:
            expect(1 <= number <= count, f"{where}: there is no rule {number}")
        terms = {
            (v.name, t.name)
            for c in self.carriers.values()
            for v in c.variables
            for t in v.terms
        }
        for label in answer.terms:
            expect(tuple(label) in terms, f"{where}: there is no {label.term!r}")
        units = {"", *(v.unit for v in self.variables.values())}
        for measure in answer.measures:
            self._measure(measure, where)
            expect(measure.unit in units, f"{where}: no unit {measure.unit:.60}")
        is_fact = answer.code in ("FT205", "FT501") or answer.code.startswith("FTD")
        expect(not (is_fact and answer.is_finding), f"{where}: it can be no finding")
        for place in answer.places:
            is_file = self.audit.file is not None and place.file == self.audit.file.name
            is_one = is_file and place.line >= 1 and place.column >= 1
            expect(is_one, f"{where}: a place that is not in the audited file")
        try:
            self._spans(answer.region)
            self._state(answer, where)
        except DoesNotHoldError as error:
            wrong.append(f"{where}: {error}")
        except (LookupError, ArithmeticError, ValueError, StopIteration):
            wrong.append(f"{where}: it names what there is not")
        except UndecidedError as error:
            state = type(answer.state).__name__.upper()
            self.report.undecided.setdefault((state, str(error)), []).append(
                answer.code
            )

    def _measure(self, measure: Measure, where: str) -> None:
        if measure.exact is None:
            return
        try:
            is_same = float(_fraction(measure.exact)) == measure.value
        except DoesNotHoldError:
            is_same = False
        text = f"{where}: {measure.name}: {measure.exact:.60} is not {measure.value!r}"
        self.report.expect(is_same, text)
        self.report.count("exact measures")

    def _state(self, answer: Answer, where: str) -> None:
        state = answer.state
        if isinstance(state, Proved):
            _require(bool(state.how), "it is proved, and not told how")
            _AGAIN.get(answer.code, _cannot)(self, answer)
            self.report.count("answers PROVED, decided again")
        elif isinstance(state, Witness):
            self._witness(answer, state)
            self.report.count("answers with a WITNESS, evaluated again")
        elif isinstance(state, Bracket):
            _require(state.low <= state.high, "the ends of the bracket are swapped")
            is_far = answer.code == "FT102" and state.high < self.audit.settings.lead
            may_be = is_far or answer.code in ("FT403", "FT203", "FT204", "FT601")
            _require(may_be or not answer.is_finding, "what is open is no finding")
            if state.point or state.claims:
                self._point(state.point, state.claims)
            raise UndecidedError("a bracket is not made again here")
        elif isinstance(state, Sampled):
            self._sample(state)
            raise UndecidedError("a sample is not drawn again here")
        else:
            is_reason = state.code.startswith("FTD") and state.code in SEVERITIES
            _require(is_reason and bool(state.reason), "declined, and not for a reason")
            self.report.count("answers DECLINED")

    def _sample(self, state: Sampled) -> None:
        _require(0 <= state.hits <= state.rows and state.rows > 0, "no share of rows")
        share = state.hits / state.rows
        ends = wilson(state.hits, state.rows, state.confidence)
        _require(state.low <= share <= state.high, "the share is not in its interval")
        near = [
            math.isclose(a, b, abs_tol=1e-9)
            for a, b in zip(ends, state[3:5], strict=True)
        ]
        _require(all(near), f"Wilson's interval is {ends[0]!r} to {ends[1]!r}")

    # points and what is claimed of them

    def _witness(self, answer: Answer, state: Witness) -> None:
        point = self._point(state.point, state.claims)
        is_same = answer.region in ((), state.region)
        _require(is_same, "the answer's region is not that of its witness")
        _SHOWS.get(answer.code, _shows_anything)(self, answer, state)
        _require(bool(state.claims), "a witness of which nothing is claimed")
        self._spans(state.region)
        for span in state.region:
            x = value_of(self.variables[span.variable], point)
            is_in = (span.low is None or span.low <= x) and (
                span.high is None or x <= span.high
            )
            _require(is_in, f"the witness lies outside its region in {span.variable!r}")
        lasting = [c for c in state.claims if c.kind not in ("strength", "degree")]
        for other in self._corners(state.region, point):
            for claim in lasting:
                _require(
                    self.holds(claim, other), f"{claim.kind} fails within the region"
                )
            self.report.count("points of regions")

    def _corners(self, region: Sequence[Span], point: Point) -> Iterator[Point]:
        """Yield corners and the middle of a region, other inputs at three values.

        A corner lies just above the lower ends, for these may belong to a neighbour.
        """
        spans = {span.variable: span for span in region}
        if not spans or not self.is_free:
            return
        ends: dict[str, tuple[Fraction, Fraction, Fraction]] = {}
        for name, side in self.sides.items():
            span = spans.get(name, Span(name, None, None))
            low = Fraction(side.low if span.low is None else span.low)
            high = Fraction(side.high if span.high is None else span.high)
            middle = (low + high) / 2 if name in spans else point[name]
            ends[name] = low + (high - low) / 2**30, high, middle
        ways = itertools.product((0, 1), repeat=len(spans))
        chosen = [*itertools.islice(ways, 32), (2,) * len(spans)]
        for way, other in itertools.product(chosen, range(3)):
            places = dict.fromkeys(ends, other) | dict(zip(spans, way, strict=True))
            found = {name: ends[name][place] for name, place in places.items()}
            if self._is_within(found):
                yield found

    def _point(
        self, given: Sequence[Coordinate], claims: Sequence[Claim]
    ) -> dict[str, Fraction]:
        """Return a point of the domain at which the claims hold."""
        point: dict[str, Fraction] = {}
        for one in given:
            value = _fraction(one.exact)
            near = float(value)
            hexed = near.hex() if Fraction(near) == value else None
            text = (
                f"{one.input!r}: the decimal or hexadecimal digits are not {one.exact}"
            )
            _require((repr(near), hexed) == (one.decimal, one.hex), text)
            _require(one.input not in point, f"{one.input!r} stands twice in the point")
            point[one.input] = value
        inputs = {v.name for v in self.model.variables if not v.parts}
        _require(
            point.keys() == inputs, "the point does not have a value of every input"
        )
        _require(self._is_within(point), "the point lies outside the domain")
        for claim in claims:
            _require(self.holds(claim, point), f"not so: {_shown(claim)}")
            self.report.count("claims evaluated again")
        return point

    def _is_within(self, point: Point) -> bool:
        for name, side in self.sides.items():
            x = value_of(self.variables[name], point)
            if not side.low <= x <= side.high or (side.is_open and x == side.low):
                return False
        return True

    def _spans(self, region: Sequence[Span]) -> None:
        for span in region:
            _require(span.variable in self.variables, f"no variable {span.variable!r}")
            is_ordered = span.low is None or span.high is None or span.low <= span.high
            _require(is_ordered, f"the region's ends in {span.variable!r} are swapped")

    def holds(self, claim: Claim, point: Point) -> bool:
        """Return whether a claim holds at a point, evaluated in fractions."""
        model = self.carriers.get(claim.of)
        _require(model is not None, f"there are no {claim.of} to claim something of")
        given = {n for n, one in zip(claim._fields, claim, strict=True) if one}
        alien = given - {"kind", "of", *_FIELDS[claim.kind].split(" ")}
        _require(not alien, f"a claim of kind {claim.kind} has no {', '.join(alien)}")
        assert model is not None
        if claim.kind == "decides":
            return answer_of(model, point) == claim.label
        level = None if claim.level is None else _fraction(claim.level)
        if claim.kind == "degree":
            terms = [
                t.shape
                for v in model.variables
                for t in v.terms
                if (v.name, t.name) == (claim.variable, claim.term)
            ]
            _require(bool(terms), "a claim of an unknown term")
            x = value_of(self.variables[claim.variable or ""], point)
            return degree(terms[0], x) == level
        _require(isinstance(model, Rules), "a tree has no strengths")
        assert isinstance(model, Rules)
        all_ = strengths(model, point)
        numbers = {*claim.rules, *claim.rivals}
        _require(
            all(1 <= n <= len(all_) for n in numbers), "a claim of an unknown rule"
        )
        ours = [all_[n - 1] for n in claim.rules]
        rivals = [all_[n - 1] for n in claim.rivals]
        _require(bool(ours) or claim.kind == "covered", "a claim of no rule")
        match claim.kind:
            case "covered":
                return max(all_) > 0
            case "beats":
                return min(ours) > max(rivals, default=ZERO)  # alone: it fires
            case "ties":
                return min(ours) == max(ours) > max(rivals, default=-ONE)
            case "strength":
                return ours[0] == level
            case "below":
                _require(level is not None, "a claim without its level")
                return max(ours) < (level or ZERO) or max(ours) == level == 0
            case "reaches":
                return level is not None and min(ours) >= level


def _said(rule: Rule, shapes: Mapping[tuple[str, str], Shape]) -> list[Any]:
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


_FIELDS = {
    "strength": "rules level",
    "beats": "rules rivals",
    "ties": "rules rivals",
    "below": "rules level",
    "reaches": "rules level",
    "decides": "label",
    "degree": "level variable term",
    "covered": "",
}
"""What each kind of claim is about."""


def wilson(hits: int, rows: int, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval of a share."""
    _require(0.0 < confidence < 1.0, "a confidence outside (0, 1)")
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    share, bottom = hits / rows, 1.0 + z * z / rows
    middle = (share + z * z / (2 * rows)) / bottom
    half = (
        z * math.sqrt(share * (1 - share) / rows + z * z / (4 * rows * rows)) / bottom
    )
    return max(middle - half, 0.0), min(middle + half, 1.0)


def _require(is_so: bool, otherwise: str) -> None:
    if not is_so:
        raise DoesNotHoldError(otherwise)


def _fraction(text: str) -> Fraction:
    """Return a number that is written as `p/q` in lowest terms, or as `p`."""
    if not re.fullmatch("-?[0-9]{1,4000}(/[0-9]{1,4000})?", text):
        raise DoesNotHoldError(f"{text:.60} is no fraction")
    try:
        is_plain = str(Fraction(text)) == text and abs(Fraction(text)) < 2**1023
    except (ValueError, ZeroDivisionError):
        is_plain = False
    _require(is_plain, f"{text:.60} is no fraction in lowest terms")
    return Fraction(text)


def _shown(claim: Claim) -> str:
    given = {
        name: value for name, value in zip(claim._fields, claim, strict=True) if value
    }
    return ", ".join(f"{name} {value}" for name, value in given.items())


def _cannot(checks: _Checks, answer: Answer) -> None:
    raise UndecidedError(_WHY.get(answer.code, "there is no second way for it here"))


_WHY = {
    "FT402": "the turning points of curves are not looked at here",
    "FT601": "nothing is run here but the model itself",
    "FT602": "nothing is run here but the model itself",
}


# --- Deciding again ----------------------------------------------------------------


def _line(checks: _Checks, variable: Variable) -> Line:
    """Return a variable's values in the domain; of a combination, at most these."""
    side = checks.sides.get(variable.name)
    if not variable.parts and side is not None:
        return Line(Fraction(side.low), Fraction(side.high), side.is_open)
    low = high = ZERO
    for part in variable.parts:
        one, weight = checks.sides[part.input], Fraction(part.weight)
        ends = [
            weight * (Fraction(e) - Fraction(part.centre)) for e in (one.low, one.high)
        ]
        low, high = low + min(ends), high + max(ends)
    if side is not None:
        low, high = max(low, Fraction(side.low)), min(high, Fraction(side.high))
    return Line(low, high, False)


def _never(is_so: bool, checks: _Checks, otherwise: str) -> None:
    """Note what was found although it should never happen, if inputs are free."""
    if is_so and not checks.is_free:
        raise UndecidedError("combinations share inputs, which needs more than cells")
    _require(not is_so, otherwise)


def _beats(checks: _Checks, mine: Asked, rivals: Sequence[Asked]) -> bool:
    """Return whether a rule is somewhere stronger than each rival."""
    if checks.rules.semantics.conjunction == "min":
        return checks.grid.wins(mine, rivals)
    if any(checks.grid.is_below(mine, rival) for rival in rivals):
        return False
    raise UndecidedError("under product only one rule that hides another is seen here")


def _others(checks: _Checks, number: int) -> list[Asked]:
    """Return what the rules of other classes ask."""
    every = checks.rules.rules
    pairs = zip(every, checks.grid.of, strict=True)
    return [of for rule, of in pairs if rule.then != every[number - 1].then]


def _is_reached(checks: _Checks, tree: Tree, number: int) -> bool:
    """Return whether the intervals on the path to a leaf meet the domain."""
    return all(_ways(checks, tree, number, variable) for variable in tree.variables)


def _ways(
    checks: _Checks, tree: Tree, number: int, variable: Variable
) -> list[tuple[Fraction, Fraction, bool]]:
    """Return the values of a variable that lead to a leaf; True opens the low end."""
    line = _line(checks, variable)
    met = [(line.low, line.high, line.is_open)]
    for node, way in checks.paths[number]:
        if node.variable == variable.name:
            ends = zip((None, *node.cuts), (*node.cuts, None), node.owners, strict=True)
            place = node.branches.index(way)
            mine = [(low, high) for low, high, owner in ends if owner == place]
            met = [_met(one, low, high) for one in met for low, high in mine]
    return [(a, b, o) for a, b, o in met if a < b or (a == b and not o)]


def _met(
    one: tuple[Fraction, Fraction, bool], low: float | None, high: float | None
) -> tuple[Fraction, Fraction, bool]:
    """Return what an interval has in common with `low < x <= high`."""
    start, end, is_open = one
    if low is not None and low >= start:
        start, is_open = Fraction(low), True
    return start, end if high is None else min(end, Fraction(high)), is_open


def _dead(checks: _Checks, answer: Answer) -> None:
    model = checks.model
    if isinstance(model, Tree):
        reached = [n for n in checks.numbers if _is_reached(checks, model, n)]
        if answer.is_finding:
            is_met = any(number in reached for number in answer.rules)
            _never(is_met, checks, "the leaf is reached")
        elif not answer.rules:
            dead = {
                one.rules
                for one in checks.audit.answers
                if one.code == "FT101" and one.is_finding
            }
            hidden = [n for n in checks.numbers if n not in reached]
            missing = [n for n in hidden if (n,) not in dead]
            _require(
                not missing, f"leaves that are not reached are not told: {missing}"
            )
        return
    _require(len(answer.rules) > 0, "no rule is named")
    number = answer.rules[0]
    wins = _beats(checks, checks.grid.of[number - 1], _others(checks, number))
    _never(wins, checks, "the rule wins somewhere")


def _shows_anything(checks: _Checks, answer: Answer, state: Witness) -> None:
    """Ask nothing of a witness but that its claims hold."""


def _shows_region(checks: _Checks, answer: Answer, state: Witness) -> None:
    """Compare the region of a leaf with the intervals on the path to it."""
    tree = checks.model
    _require(isinstance(tree, Tree) and len(answer.rules) == 1, "it is of no leaf")
    assert isinstance(tree, Tree)
    number = answer.rules[0]
    point = {one.input: _fraction(one.exact) for one in state.point}
    _require(leaf_of(tree, point) == number, "the witness reaches another leaf")
    label = tree.leaves[number - 1].label
    _require([c.label for c in state.claims] == [label], "it is not the leaf's class")
    asked = {node.variable for node, _ in checks.paths[number]}
    _require({s.variable for s in state.region} == asked, "not what its path asks")
    for span in state.region:
        met = _ways(checks, tree, number, checks.variables[span.variable])
        ends = [(float(low), float(high)) for low, high, _ in met]
        is_one = any(
            math.isclose(span.low or 0.0, low, rel_tol=2.0**-50)
            and math.isclose(span.high or 0.0, high, rel_tol=2.0**-50)
            for low, high in ends
        )
        _require(is_one, f"the path leads elsewhere in {span.variable!r}")


def _covered(checks: _Checks, answer: Answer) -> None:
    grid = checks.grid
    if answer.subject == "cover":
        is_gap = grid.is_bare(grid.of)
        if is_gap is None:
            raise UndecidedError("a curve may touch 0 where it is not known exactly")
        _never(is_gap, checks, "there are points at which no rule fires")
        return
    if checks.rules.semantics.conjunction != "min":
        raise UndecidedError("gaps under product are not decided again here")
    below = grid.gap(Fraction(checks.audit.settings.epsilon), is_above=False)
    is_gap = grid.leaves(None, grid.of, below)
    _never(is_gap, checks, "there are points at which every rule is below epsilon")


def _superfluous(checks: _Checks, answer: Answer) -> None:
    _require(len(answer.rules) == 1 and answer.is_finding, "it is of no rule")
    number, grid = answer.rules[0], checks.grid
    mine, then = grid.of[number - 1], _then(checks, number)
    others = [of for n, of in enumerate(grid.of, 1) if n != number]
    _never(_beats(checks, mine, others), checks, "it is stronger than all somewhere")
    later = [n for n in checks.numbers if n > number and _then(checks, n) != then]
    alike = [n for n in checks.numbers if n != number and _then(checks, n) == then]
    for other in alike:  # one that hides it, with no other class between the two
        between = [n for n in later if n < other]
        if not between and not _beats(checks, mine, [grid.of[other - 1]]):
            return
    if later:
        raise UndecidedError("that no tie is decided by its place is not asked here")


def _tied(checks: _Checks, answer: Answer) -> None:
    pairs = checks.pairs(alike=False)
    told = [one for one in checks.audit.answers if one.code == "FT202" and one.rules]
    _counted(answer, {"pairs": len(pairs), "pairs told one by one": len(told)}, 2)
    _require(not answer.is_finding, "that others do not tie is no finding")
    raise UndecidedError("that the other pairs do not tie is not asked here")


def _hidden(checks: _Checks, answer: Answer) -> None:
    """Ask each rule that is told to hide another; or all pairs that are not told."""
    if answer.rules:
        weak, *strong = answer.rules
        for number in strong:
            is_one = _then(checks, number) == _then(checks, weak)
            _require(is_one == (answer.code == "FT104"), "the classes are not so")
            beats = _beats(
                checks, checks.grid.of[weak - 1], [checks.grid.of[number - 1]]
            )
            _never(
                beats, checks, f"rule {weak} is somewhere stronger than rule {number}"
            )
            if answer.code == "FT105" and number > weak:
                raise UndecidedError(
                    "that it is always strictly weaker is not asked here"
                )
        _counted(answer, {"rules that subsume it": len(strong)}, answer.code == "FT104")
        _counted(answer, {"rules that mask it": len(strong)}, answer.code == "FT105")
        return
    pairs = [p for p in checks.pairs(alike=answer.code == "FT104") if checks.fire(*p)]
    silent = sum(not checks.fire(number) for number in checks.numbers)
    _counted(answer, {"pairs": len(pairs), "rules that never fire": silent}, 2)
    told = {
        (one.rules[0], n)
        for one in checks.audit.answers
        if one.code == answer.code and one.rules
        for n in one.rules[1:]
    }
    copies = {
        one.rules
        for one in checks.audit.answers
        if one.code == "FT106" and any(m.exact == "0" for m in one.measures)
    }
    for first, second in (pair for pair in pairs if pair not in copies):
        if {(first, second), (second, first)} & told:
            continue
        of = checks.grid.of[first - 1], checks.grid.of[second - 1]
        _require(_beats(checks, of[1], [of[0]]), f"rule {second} hides behind {first}")
        if answer.code == "FT104":
            _require(
                _beats(checks, of[0], [of[1]]), f"rule {first} hides behind {second}"
            )


def _copied(checks: _Checks, answer: Answer) -> None:
    if not answer.rules:
        count = len(checks.numbers)
        _counted(answer, {"pairs": count * (count - 1) // 2}, 1)
        raise UndecidedError(
            "that no other two rules are nearly alike is not asked here"
        )
    one, other = answer.rules
    is_one = _then(checks, one) == _then(checks, other)
    _require((answer.severity == "error") != is_one, "the classes are not so")
    if not any(m.exact == "0" for m in answer.measures):
        raise UndecidedError("the distance of curves that differ is not measured here")
    of = checks.grid.of[one - 1], checks.grid.of[other - 1]
    if of[0] != of[1]:
        is_more = _beats(checks, of[0], [of[1]]) or _beats(checks, of[1], [of[0]])
        _require(not is_more, "the two rules are not alike")


def _apart(checks: _Checks, answer: Answer) -> None:
    """Ask of each pair that is not told whether both rules can reach the level."""
    if checks.rules.semantics.conjunction != "min":
        raise UndecidedError("conflicts under product are not decided again here")
    told = {one.rules for one in checks.audit.answers if one.code == "FT201"}
    level, grid = Fraction(checks.audit.settings.level), checks.grid
    rest = [pair for pair in checks.pairs(alike=False) if pair not in told]
    hidden = next((m.value for m in answer.measures if "not told" in m.name), 0)
    _require(answer.is_finding == (hidden > 0), "a finding that is none")
    _counted(answer, {"pairs that never do": len(rest) - hidden}, 1)
    if hidden:
        raise UndecidedError("which pairs are not told is not known")
    for pair in rest:
        both = tuple(
            a | b for a, b in zip(*(grid.of[n - 1] for n in pair), strict=True)
        )
        if not grid.leaves(both, (), grid.gap(level, is_above=False)):
            continue
        is_met = level < 1 and grid.leaves(both, (), grid.gap(level, is_above=True))
        _never(
            is_met, checks, f"rules {pair[0]} and {pair[1]} reach the level together"
        )
        raise UndecidedError(f"rules {pair[0]} and {pair[1]} touch the level")


def _needless(checks: _Checks, answer: Answer) -> None:
    """Ask whether a rule without a clause is anywhere stronger than with it."""
    _require(len(answer.rules) == 1, "it is of no rule")
    rest, _ = _without(checks, answer)
    mine = checks.grid.of[answer.rules[0] - 1]
    if _beats(checks, checks.grid.asked(rest), [mine]):
        raise UndecidedError("the rule is stronger without it, if not in its answers")


def _without(checks: _Checks, answer: Answer) -> tuple[tuple[Clause, ...], Clause]:
    """Return a rule's clauses without the one that an answer is about, and that one."""
    when = checks.rules.rules[answer.rules[0] - 1].when
    asked = (
        tuple(label.variable for label in answer.terms[:1]),
        {t.term for t in answer.terms},
    )
    found = [c for c in when if ((c.variable,), set(c.terms)) == asked]
    _require(len(set(found)) == 1, "it is of no clause of the rule")
    place = when.index(found[0])
    return (*when[:place], *when[place + 1 :]), found[0]


def _shows_win(checks: _Checks, answer: Answer, state: Witness) -> None:
    """Ask that a claim compares the rule with every rule that it is about."""
    _require(len(answer.rules) == 1, "it is of no rule")
    number = answer.rules[0]
    then = _then(checks, number)
    rivals = [n for n in checks.numbers if n != number]
    if answer.code != "FT103":
        rivals = [n for n in rivals if _then(checks, n) != then]
    ties = [c for c in state.claims if c.kind == "ties" and number in c.rules]
    if answer.is_finding or (answer.code == "FT103" and ties):  # it ties, and is first
        _require(bool(ties), "it is not claimed that the rule ties")
        return
    beats = [c for c in state.claims if (c.kind, c.rules) == ("beats", (number,))]
    is_all = any(set(rivals) <= set(claim.rivals) for claim in beats)
    _require(is_all, "it is not claimed that the rule beats all these others")


def _shows_lead(checks: _Checks, answer: Answer, state: Witness) -> None:
    point = {one.input: _fraction(one.exact) for one in state.point}
    _require(len(answer.rules) == 1 and not answer.is_finding, "it is of no rule")
    every, then = strengths(checks.rules, point), _then(checks, answer.rules[0])
    pairs = zip(every, checks.rules.rules, strict=True)
    best = max((one for one, rule in pairs if rule.then != then), default=ZERO)
    lead = every[answer.rules[0] - 1] - best
    told = [m.value for m in answer.measures if m.name == "largest lead, at least"]
    is_so = len(told) == 1 and lead >= Fraction(told[0]) >= checks.audit.settings.lead
    _require(is_so, "the rule does not lead by so much there")
    _shows_win(checks, answer, state)


def _shows_tie(checks: _Checks, answer: Answer, state: Witness) -> None:
    met = [
        c for c in state.claims if c.kind == "ties" and {*answer.rules} <= {*c.rules}
    ]
    is_all = any({*c.rules, *c.rivals} == {*checks.numbers} for c in met)
    _require(is_all and answer.is_finding, "it is not claimed that the two tie")
    classes = {_then(checks, number) for number in answer.rules}
    _require(len(classes) == 2, "the rules are of one class")


def _shows_gap(checks: _Checks, answer: Answer, state: Witness) -> None:
    level = ZERO
    if not answer.subject.startswith("gap "):
        level = Fraction(checks.audit.settings.epsilon)
    met = [
        c for c in state.claims if c.kind == "below" and {*c.rules} == {*checks.numbers}
    ]
    is_low = any(_fraction(claim.level or "1") <= level for claim in met)
    _require(is_low and answer.is_finding, "it is not claimed that all rules are below")


def _shows_difference(checks: _Checks, answer: Answer, state: Witness) -> None:
    said = {claim.of: claim.label for claim in state.claims if claim.kind == "decides"}
    _require(said.keys() == {"tree", "raw rules"}, "it is not claimed what both answer")
    is_near = not answer.rules  # the nearest to a row is no finding
    _require(answer.is_finding or is_near, "two answers that differ are a finding")
    _require(said["tree"] != said["raw rules"], "the two answers are the same")


def _shows_need(checks: _Checks, answer: Answer, state: Witness) -> None:
    rest, _ = _without(checks, answer)
    point = {one.input: _fraction(one.exact) for one in state.point}
    every = list(checks.rules.rules)
    every[answer.rules[0] - 1] = every[answer.rules[0] - 1]._replace(when=rest)
    other = answer_of(checks.rules._replace(rules=tuple(every)), point)
    is_other = other != answer_of(checks.rules, point) and not answer.is_finding
    _require(is_other, "the clause does not matter there")


def _shows_conflict(checks: _Checks, answer: Answer, state: Witness) -> None:
    level = Fraction(checks.audit.settings.level)
    met = [c for c in state.claims if c.kind == "reaches" and c.rules == answer.rules]
    is_high = any(_fraction(claim.level or "0") >= level for claim in met)
    _require(
        is_high and answer.is_finding, "it is not claimed that both reach the level"
    )
    classes = {_then(checks, number) for number in answer.rules}
    _require(len(classes) == 2, "the rules are of one class")


def _then(checks: _Checks, number: int) -> str:
    return checks.rules.rules[number - 1].then


def _heights(checks: _Checks, answer: Answer) -> None:
    """Compare the terms that do not reach the level with what is told."""
    level = checks.audit.settings.level
    low = {label: height for label, height in checks.heights.items() if height < level}
    told = [one for one in checks.audit.answers if one.code == "FT401" and one.terms]
    _require([one.terms[0] for one in told] == list(low), "other terms are too low")
    for label in answer.terms:
        is_empty = answer.severity == "error"
        _require(is_empty == (not low[label]), f"{label.term!r} is empty, or is not")
        value = next((m.value for m in answer.measures if m.name == "height"), -1.0)
        _require(abs(value - low[label]) <= 2.0**-30, f"the height of {label.term!r}")


def _height(shape: Shape, line: Line, level: Fraction) -> Fraction:
    """Return the largest degree on a line, from below; exactly at or below a level."""
    levels = Levels()
    mark = levels.add((level,), ZERO)
    found = line_cells([((shape,), False)], line, levels)
    levels.sort()
    most = max(levels.band[end] for cell in found for end in (*cell.left, *cell.right))
    bounds = levels.bands[most]
    if most == levels.band[mark] and bounds[0] < bounds[1]:
        raise UndecidedError("a height is too near to the level to tell")
    return bounds[0] if most <= levels.band[mark] else max(bounds[0], level)


def _unused(checks: _Checks, answer: Answer) -> None:
    rules = checks.rules
    asked = {
        (c.variable, t) for rule in rules.rules for c in rule.when for t in c.terms
    }
    needed = {variable for variable, _ in asked}
    for variable in rules.variables:
        if variable.name in needed:
            needed |= {part.input for part in variable.parts}
    idle = [f"variable {v.name!r}" for v in rules.variables if v.name not in needed]
    for v in rules.variables:
        free = [
            t.name
            for t in v.terms
            if v.name in needed and (v.name, t.name) not in asked
        ]
        idle += [f"term {name!r} of {v.name!r}" for name in free]
    told = [
        one for one in checks.audit.answers if one.code == "FT404" and one.is_finding
    ]
    _require(
        [one.subject for one in told] == idle, "other terms or variables are unused"
    )
    counts = {"variables in use": len(needed), "terms in use": len(asked)}
    _counted(answer, counts, 0 if answer.is_finding else 2)


def _complexity(checks: _Checks, answer: Answer) -> None:
    rules, lengths = checks.rules.rules, [len(r.when) for r in checks.rules.rules]
    asked = {(c.variable, t) for rule in rules for c in rule.when for t in c.terms}
    counts: dict[str, float] = {
        "rules": len(rules),
        "clauses": sum(lengths),
        "most clauses of a rule": max(lengths),
        "clauses per rule": sum(lengths) / len(rules),
        "distinct terms in use": len(asked),
        "variables in use": len({variable for variable, _ in asked}),
    }
    if isinstance(checks.model, Tree):
        counts["depth of the tree"] = max(len(path) for _, path in paths(checks.model))
    _counted(answer, counts, len(counts))
    raise UndecidedError(
        "its counts are right; the index of Nauck is not worked out here"
    )


def _counted(answer: Answer, counts: Mapping[str, float], number: int) -> None:
    told = {m.name: m.value for m in answer.measures if m.name in counts}
    _require(len(told) == number, "a count is missing")
    wrong = [name for name, value in told.items() if value != counts[name]]
    _require(not wrong, f"counted otherwise here: {', '.join(wrong)}")


def _overlaps(checks: _Checks, answer: Answer) -> None:
    """Compare the shared areas of pairs of terms with what is told of them."""
    near = {
        labels: share
        for labels, share in checks.shares.items()
        if share is not None and share[1] >= Fraction(checks.audit.settings.overlap)
    }
    if any(low < checks.audit.settings.overlap for low, _ in near.values()):
        raise UndecidedError("a shared area is too near to the limit to tell")
    told = [a for a in checks.audit.answers if a.code == "FT403" and a.terms]
    told = [one for one in told if not isinstance(one.state, Declined)]
    _require({a.terms for a in told} <= near.keys(), "two terms are easy to tell apart")
    if not answer.terms:
        _require(answer.is_finding == (len(near) > len(told)), "a finding that is none")
        bare = sum(share is None for share in checks.shares.values())
        counts = {"pairs not told one by one": len(near) - len(told)}
        counts |= {"pairs apart": len(checks.shares) - len(near) - bare}
        _counted(answer, counts | {"pairs without area": bare}, 3)
        return
    low, high = near[answer.terms]
    value = Fraction(next(m.value for m in answer.measures if "shared" in m.name))
    _require(low - FINE <= value <= high + FINE, "the share is another one")


def _shared(one: Shape, other: Shape, line: Line) -> tuple[Fraction, Fraction] | None:
    """Return between which numbers the integral of min by that of max lies."""
    least = most = slack = ZERO
    if line.low == line.high:
        return None
    both = [((one,), False), ((other,), False)]
    for left, right, curves in stretches(both, line.low, line.high):
        inside = _between(left, right)
        for root in (end for end in (left, right) if isinstance(end, Root)):
            while root.high - root.low > FINE * (line.high - line.low):
                root.halve()
            slack += root.high - root.low
        a = left.high if isinstance(left, Root) else left
        b = right.low if isinstance(right, Root) else right
        order = sorted(curves, key=lambda poly: at(poly, inside))
        wholes = [(ZERO, *(c / n for n, c in enumerate(p, 1))) for p in order]
        areas = [at(whole, b) - at(whole, a) for whole in wholes]
        least, most = least + areas[0], most + areas[1]
    return (least / (most + slack), (least + slack) / most) if most else None


_SHOWS: dict[str, Callable[[_Checks, Answer, Witness], None]] = {
    "FT101": _shows_win,
    "FT102": _shows_lead,
    "FT103": _shows_win,
    "FT107": _shows_need,
    "FT201": _shows_conflict,
    "FT202": _shows_tie,
    "FT203": _shows_difference,
    "FT205": _shows_region,
    "FT301": _shows_gap,
}
_AGAIN: dict[str, Callable[[_Checks, Answer], None]] = {
    "FT101": _dead,
    "FT103": _superfluous,
    "FT104": _hidden,
    "FT105": _hidden,
    "FT106": _copied,
    "FT107": _needless,
    "FT201": _apart,
    "FT202": _tied,
    "FT301": _covered,
    "FT401": _heights,
    "FT403": _overlaps,
    "FT404": _unused,
    "FT501": _complexity,
}


def main(arguments: Sequence[str]) -> int:
    """Check the two files that are named, and print the report."""
    if len(arguments) != 2:
        sys.stderr.write("usage: python rechecking.py AUDIT.json MODEL.yaml\n")
        return 2
    try:
        report = recheck_files(arguments[0], arguments[1])
    except CannotRunError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write("\n".join(report.lines()) + "\n")
    return 1 if report.wrong else 0


def recheck_files(audit: str, model: str) -> Report:
    """Check an audit's file against a model's file.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    contents: list[bytes] = []
    for name in (audit, model):
        try:
            with Path(name).open("rb") as file:
                contents.append(file.read(MOST_BYTES + 1))
        except OSError as error:
            raise CannotRunError(f"{name}: {error.strerror or error}") from error
    return recheck(contents[0], contents[1], (audit, model))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

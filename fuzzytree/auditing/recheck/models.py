"""A model from its file: facts as records, sentences, places of rules and terms.

A condition of a fuzzy system is a sentence: `dirt is very high and (load is small or
not (load is big))`. AND binds closer than OR; a name of several words stands as it is,
one with a word of the language in quotes.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import sys
import types
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import lru_cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from fuzzytree.auditing.recheck import model_records as records
from fuzzytree.auditing.recheck.audit_records import Label, State
from fuzzytree.auditing.recheck.model_records import (
    And,
    Conclusion,
    Condition,
    Is,
    Not,
    Or,
)
from fuzzytree.auditing.recheck.outcomes import MOST_BYTES, CannotRunError
from fuzzytree.auditing.recheck.yaml import Items, read_yaml

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

    def proposition(self) -> tuple[str, tuple[str, ...], str | None]:
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
        """Read a proposition, or a condition in parentheses."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        if self.takes("not"):
            if self.rest[-1:] != [("(", False)]:
                raise ValueError("'(' is missing")
            return Not(self.part(level + 1))
        if not self.takes("("):
            variable, hedges, label = self.proposition()
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
        output, hedges, label = sentence.proposition()
        if label is None:
            raise ValueError("a term is missing")
        result.append(Conclusion(output, label, hedges))
    if sentence.rest:
        raise ValueError("more behind the conclusions")
    return tuple(result)


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
    if origin is dict and isinstance(value, dict):
        return value  # their kinds are those of the message
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
    records.Band: {
        **{"low": "above", "high": "up to"},
        **{"left": "0 up to", "right": "0 from"},
    },
    records.Variable: {**_RANGE, "parts": "sum of"},
    records.Output: _RANGE,
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
    name, height = one.pop("name"), one.pop("height", 1.0)
    curve = _curve(*next(iter(one.items()))) if len(one) == 1 else None
    return {"name": name, "function": curve or _shape(one), "height": height}


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
    records.Variable: _ranged,
    records.Output: _output,
    records.Branch: _branch,
    records.Node: _node,
    records.SystemRule: _rule,
    records.Block: lambda one: {"and": None, "or": None, "implication": None} | one,
}
"""How the facts of a record are laid out in a file, where it is not field by field."""


Place = tuple[int, int]  # line and column, from 1


class Places:
    """The lines and columns of rules and terms, as a file was read.

    Attributes:
        rules: Of each rule; of a tree's leaves; of the rules of all blocks.
        terms: Of each term; of a name that two lists have, the first.
    """

    def __init__(self, top: dict[str, Any]) -> None:
        self.rules = [*_of(top.get("rules", top.get("leaves", [])))]
        for block in top.get("blocks", []):
            self.rules += _of(block["rules"])
        self.terms: dict[Label, Place] = {}
        for key in ("variables", "inputs", "outputs", "sets"):
            for one in top.get(key, []):
                name = one.get("name", one.get("variable"))
                terms = one.get("terms", [])
                for term, place in zip(terms, _of(terms), strict=False):
                    self.terms.setdefault(Label(name, term["name"]), place)


def _of(items: Any) -> Iterator[Place]:
    """Yield the places of a list that has a line for each item."""
    if isinstance(items, Items):
        yield from items.places


# --- models

Whole = records.Model | records.System
Known = Mapping[str, Collection[str]]  # the terms of variables

MEANINGS = {
    "rule base": {
        "or": "maximum",
        "not": "1 - degree",
        "answer": "the class of the first of the strongest rules",
    },
    "tree": {
        "cuts": "a value equal to a cut lies below it",
        "answer": "the class of the leaf that the nodes lead to",
    },
    "system": {
        "not": "1 - degree",
        "activated": "rules whose weighted degree is above 0",
        "missing": "a value that is missing or infinite makes every output nan",
    },
}
"""What models of each kind always mean."""


def read_file(content: bytes, name: str) -> tuple[Whole, Places]:
    """Return the model of a YAML file, and where its rules and terms stand.

    Raises:
        CannotRunError: If it is something else, or holds what is not known here.
    """
    try:
        top = read_yaml(content, name)
    except CannotRunError as error:
        if name.lower().endswith((".yaml", ".yml")):
            raise
        text = "only YAML is read here: convert it (fuzzytree convert), and audit that"
        raise CannotRunError(f"{error}; {text}") from error
    kind = top.get("kind") if isinstance(top, dict) else None
    if not isinstance(top, dict) or kind not in ("rule base", "tree", "system"):
        text = f"{name}: rule bases, trees and systems are checked, not {kind!r:.60}"
        raise CannotRunError(text)
    try:
        result = _read(top, str(kind), name)
        return result, Places(top)
    except CannotRunError as error:
        if str(error).startswith(name):
            raise
        raise CannotRunError(f"{name}: {error}") from error
    except (TypeError, AttributeError, KeyError, ValueError) as error:
        raise CannotRunError(f"{name}: not a {kind} that fuzzytree writes") from error


def _read(top: dict[str, Any], kind: str, name: str) -> Whole:
    facts = {key: one for key, one in top.items() if key not in ("format", "kind")}
    meant = MEANINGS[kind]
    if top["format"] != "fuzzytree/1" or not meant.items() <= top["semantics"].items():
        raise CannotRunError(f"{name}: its meaning is not known")
    rest = {key: one for key, one in facts.pop("semantics").items() if key not in meant}
    if kind == "system":
        if rest:
            raise CannotRunError(f"{name}: its meaning is not known")
        system: records.System = built(records.System, {"inputs": [], **facts}, name)
        groups = [[t.name for t in one.terms] for one in system.inputs]
        groups += [[t.name for t in one.terms] for one in system.outputs]
        names = [one.name for one in system.inputs] + [o.name for o in system.outputs]
        _check_once([names, *groups], name)
        return system
    for key in ("uncovered", "missing"):
        text = rest[key]
        if text != "no class" and not text.startswith("class "):
            raise CannotRunError(f"not an answer: {text!r:.60}")
        rest[key] = None if text == "no class" else text.removeprefix("class ")
    facts = {"variables": [], **facts, "semantics": rest}
    result: records.Model
    if kind == "tree":
        facts["nodes"] = [*_numbered(top.get("nodes", []), "node")]
        facts["leaves"] = [*_numbered(top["leaves"], "leaf")]
        facts.setdefault("sets", [])
        tree: records.Tree = built(records.Tree, facts, name)
        _check_numbers(tree, name)
        result = tree
    else:
        known = {
            v["name"]: [t["name"] for t in v.get("terms", [])]
            for v in facts["variables"]
        }
        facts["rules"] = [
            one | {"if": [_proposition(text, known) for text in one["if"]]}
            for one in facts["rules"]
        ]
        result = built(records.Rules, facts, name)
    _check_names(result, name)
    return result


def _numbered(items: list[dict[str, Any]], kind: str) -> Iterator[dict[str, Any]]:
    """Yield nodes or leaves without their numbers, which are those of their order."""
    for number, one in enumerate(items, 1):
        if one[kind] != number:
            raise CannotRunError(f"{kind} {number} has another number")
        yield {key: value for key, value in one.items() if key != kind}


def _proposition(result: Any, known: Known) -> dict[str, Any]:
    if isinstance(result, dict):
        verb = "is not" if "is not" in result else "is"
        if result.keys() != {"variable", verb}:
            raise CannotRunError(f"not a proposition: {result!r:.200}")
        return records.Proposition(
            result["variable"], result[verb], verb == "is not"
        )._asdict()
    read = [*itertools.islice(readings(result, known), 2)]
    if len(read) != 1:
        raise CannotRunError(f"{len(read)} readings of {result!r:.200}")
    return read[0]._asdict()


def readings(text: str, known: Known) -> Iterator[records.Proposition]:
    """Yield every proposition that a sentence can mean.

    Example:
        >>> list(readings("grip is not firm", {"grip": ["soft", "firm"]}))
        [Proposition(variable='grip', terms=('firm',), negated=True)]
    """
    for place in re.finditer("(?= is )", text):
        variable, rest = text[: place.start()], text[place.start() + 4 :]
        if variable in known:
            for terms in _lists(rest, known[variable]):
                yield records.Proposition(variable, terms)
            if rest.startswith("not "):
                for terms in _lists(rest[4:], known[variable]):
                    yield records.Proposition(variable, terms, negated=True)


def _lists(text: str, known: Collection[str]) -> Iterator[tuple[str, ...]]:
    """Yield every list of terms, joined by ` or `, that a text can mean."""
    todo: list[tuple[int, tuple[str, ...]]] = [(0, ())]
    while todo:
        start, terms = todo.pop()
        for name in known:
            end = start + len(name)
            if text.startswith(name, start) and end == len(text):
                yield (*terms, name)
            elif text.startswith(name, start) and text.startswith(" or ", end):
                todo.append((end + 4, (*terms, name)))


def _check_once(groups: list[list[str]], name: str) -> None:
    if any(len(set(group)) < len(group) for group in groups):
        raise CannotRunError(f"{name}: a name stands twice")


def _check_names(model: records.Model, name: str) -> None:
    """Refuse a model that uses what it does not declare, or declares it twice."""
    groups = [[*model.classes], [v.name for v in model.variables]]
    _check_once(groups + [[t.name for t in v.terms] for v in model.variables], name)
    known = {(v.name, t.name) for v in model.variables for t in v.terms}
    used, labels = set[tuple[str, str]](), set[str]()
    if isinstance(model, records.Rules):
        propositions = [
            proposition for rule in model.rules for proposition in rule.when
        ]
        used = {(c.variable, term) for c in propositions for term in c.terms}
        labels = {rule.then for rule in model.rules}
        is_empty = not model.rules or not all(c.terms for c in propositions)
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


def _check_numbers(tree: records.Tree, name: str) -> None:
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

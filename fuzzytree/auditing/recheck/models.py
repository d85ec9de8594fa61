"""A model from its file, with the positions of its rules and terms."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from fuzzytree.auditing.recheck.audit_records import Label
from fuzzytree.auditing.recheck.facts import built
from fuzzytree.auditing.recheck.model_records import (
    Clause,
    Input,
    Model,
    Output,
    Rules,
    System,
    Tree,
)
from fuzzytree.auditing.recheck.outcomes import CannotRunError
from fuzzytree.auditing.recheck.yaml import Items, read_yaml

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

MEANINGS = {
    "rule base": {
        "or": "max",
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


def read_file(content: bytes, name: str) -> tuple[Model | System, Places]:
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


def _read(top: dict[str, Any], kind: str, name: str) -> Model | System:
    facts = {key: one for key, one in top.items() if key not in ("format", "kind")}
    meant = MEANINGS[kind]
    if top["format"] != "fuzzytree/1" or not meant.items() <= top["semantics"].items():
        raise CannotRunError(f"{name}: its meaning is not known")
    rest = {key: one for key, one in facts.pop("semantics").items() if key not in meant}
    if kind == "system":
        if rest:
            raise CannotRunError(f"{name}: its meaning is not known")
        system: System = built(System, {"inputs": [], **facts}, name)
        variables: list[Input | Output] = [*system.inputs, *system.outputs]
        groups = [[one.name for one in variables]]
        _check_once(groups + [[t.name for t in v.labels] for v in variables], name)
        return system
    for key in ("uncovered", "missing"):
        text = rest[key]
        if text != "no class" and not text.startswith("class "):
            raise CannotRunError(f"not an answer: {text!r:.60}")
        rest[key] = None if text == "no class" else text.removeprefix("class ")
    facts = {"variables": [], **facts, "semantics": rest}
    result: Model
    if kind == "tree":
        facts["nodes"] = [*_numbered(top.get("nodes", []), "node")]
        facts["leaves"] = [*_numbered(top["leaves"], "leaf")]
        facts.setdefault("sets", [])
        tree: Tree = built(Tree, facts, name)
        _check_numbers(tree, name)
        result = tree
    else:
        known = {
            v["name"]: [t["name"] for t in v.get("terms", [])]
            for v in facts["variables"]
        }
        facts["rules"] = [
            one | {"if": [_clause(text, known) for text in one["if"]]}
            for one in facts["rules"]
        ]
        result = built(Rules, facts, name)
    _check_names(result, name)
    return result


def _numbered(items: list[dict[str, Any]], kind: str) -> Iterator[dict[str, Any]]:
    """Yield nodes or leaves without their numbers, which are those of their order."""
    for number, one in enumerate(items, 1):
        if one[kind] != number:
            raise CannotRunError(f"{kind} {number} has another number")
        yield {key: value for key, value in one.items() if key != kind}


def _clause(result: Any, known: Mapping[str, Collection[str]]) -> dict[str, Any]:
    if isinstance(result, dict):
        verb = "is not" if "is not" in result else "is"
        if result.keys() != {"variable", verb}:
            raise CannotRunError(f"not a clause: {result!r:.200}")
        return Clause(result["variable"], result[verb], verb == "is not")._asdict()
    read = [*itertools.islice(readings(result, known), 2)]
    if len(read) != 1:
        raise CannotRunError(f"{len(read)} readings of {result!r:.200}")
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


def _check_once(groups: list[list[str]], name: str) -> None:
    if any(len(set(group)) < len(group) for group in groups):
        raise CannotRunError(f"{name}: a name stands twice")


def _check_names(model: Model, name: str) -> None:
    """Refuse a model that uses what it does not declare, or declares it twice."""
    groups = [[*model.classes], [v.name for v in model.variables]]
    _check_once(groups + [[t.name for t in v.terms] for v in model.variables], name)
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

"""Where the rules and terms of a model stand in its file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fuzzytree.auditing.recheck.audit_records import Label
from fuzzytree.auditing.recheck.yaml import Items

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

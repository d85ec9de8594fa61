"""Where the parts of a system stand in a file, for formats that hold systems alone.

A reader keeps what it made each part of, and makes spots of it only when asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import msgspec

from fuzzytree.formats.text_files import Found
from fuzzytree.model.rulebase import Mistake, Path
from fuzzytree.semantics.conversion.facts import numbers_of, places_of

Spot = tuple[int, int]
"""A line and a column, from 1."""


class Group(NamedTuple):
    """Where a variable or a block stands, and its terms or rules."""

    head: Spot
    parts: tuple[Spot, ...]


class Spots(msgspec.Struct, frozen=True, gc=False):
    """Where the parts of a system stand.

    Attributes:
        inputs: Each input with its terms.
        outputs: Each output with its terms.
        blocks: Each block with its rules.
        rules: Where the file stands for a rule base: for each rule the place of the
            rule of the system that holds it, over all blocks.
        variables: Likewise for each variable the place of the input, None if the file
            does not have it.
    """

    inputs: tuple[Group, ...]
    outputs: tuple[Group, ...]
    blocks: tuple[Group, ...]
    rules: tuple[int, ...] = ()
    variables: tuple[int | None, ...] = ()

    def find(self, path: Path) -> Spot | None:
        """Return where a part of the system, or of its rule base, stands.

        Example:
            >>> spots = Spots((), (), (Group((3, 1), ((4, 7), (5, 7))),))
            >>> spots.find(("blocks", 0, "rules", 1, "when")), spots.find(("name",))
            ((5, 7), None)
        """
        match path:
            case ("rules", int(place), *_):
                every = [spot for block in self.blocks for spot in block.parts]
                return every[self.rules[place] if self.rules else place]
            case ("variables", int(place), *rest):
                found = self.variables[place] if self.variables else place
                if found is None:
                    return None
                return self.find(in_system(("variables", found, *rest)))
            case (("inputs" | "outputs" | "blocks") as field, int(place), *rest):
                group: Group = getattr(self, field)[place]
            case _:
                return None
        match rest:
            case ["labels" | "rules", int(place), *_]:
                return group.parts[place]
            case _:
                return group.head

    def placed(self, mistakes: Iterable[Mistake]) -> Iterator[Found]:
        """Yield what is wrong with the system where it stands."""
        for path, sentence in mistakes:
            line, column = self.find(path) or (1, 1)
            yield line, column, sentence

    def of_facts(self, facts: str | None) -> Spots:
        """Return the same for a file that stands for the rule base of its facts."""
        if facts is None:
            return self
        rules, variables = numbers_of(facts), places_of(facts)
        return msgspec.structs.replace(self, rules=rules, variables=variables)


def in_system(path: Path) -> Path:
    """Return where the system of a rule base holds what this holds at a path.

    Example:
        >>> in_system(("variables", 0, "terms", 2)), in_system(("rules", 1))
        (('inputs', 0, 'labels', 2), ('blocks', 0, 'rules', 1))
    """
    match path:
        case ("variables", int(place), "terms", *rest):
            return ("inputs", place, "labels", *rest)
        case ("variables", *rest):
            return ("inputs", *rest)
        case ("rules", *rest):
            return ("blocks", 0, "rules", *rest)
        case _:
            return path

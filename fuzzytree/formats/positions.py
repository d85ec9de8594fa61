"""Where the parts of a fuzzy system stand in a file."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import msgspec

from fuzzytree.formats.text_files import FileMistake, Position
from fuzzytree.model import Locate, Mistake, Path
from fuzzytree.semantics import numbers_of, places_of


class PositionGroup(NamedTuple):
    """Where a variable or a block stands, and its terms or rules."""

    head: Position
    parts: tuple[Position, ...]


class Positions(msgspec.Struct, frozen=True, gc=False):
    """Where the parts of a system stand.

    Attributes:
        inputs: Each input with its terms.
        outputs: Each output with its terms.
        blocks: Each block with its rules.
        rules: If the file represents a rule base: for each rule the index of the
            system's rule that contains it, over all blocks.
        variables: Likewise for each variable the index of the input, None if the file
            does not have it.
    """

    inputs: tuple[PositionGroup, ...]
    outputs: tuple[PositionGroup, ...]
    blocks: tuple[PositionGroup, ...]
    rules: tuple[int, ...] = ()
    variables: tuple[int | None, ...] = ()

    def find(self, path: Path) -> Position | None:
        """Return where a part of the system, or of its rule base, stands.

        Example:
            >>> block = PositionGroup((3, 1), ((4, 7), (5, 7)))
            >>> positions = Positions((), (), (block,))
            >>> positions.find(("blocks", 0, "rules", 1, "when"))
            (5, 7)
        """
        match path:
            case ("rules", int(place), *_):
                every = [position for block in self.blocks for position in block.parts]
                return every[self.rules[place] if self.rules else place]
            case ("variables", int(place), *rest):
                result = self.variables[place] if self.variables else place
                if result is None:
                    return None
                return self.find(in_system(("variables", result, *rest)))
            case (("inputs" | "outputs" | "blocks") as field, int(place), *rest):
                group: PositionGroup = getattr(self, field)[place]
            case _:
                return None
        match rest:
            case ["labels" | "rules", int(place), *_]:
                return group.parts[place]
            case _:
                return group.head

    def placed(self, mistakes: Iterable[Mistake]) -> Iterator[FileMistake]:
        """Yield what is wrong with the system where it stands."""
        for path, sentence in mistakes:
            line, column = self.find(path) or (1, 1)
            yield line, column, sentence


def locating(positions: Callable[[], Positions], facts: str | None) -> Locate:
    """Return where parts stand in a file; its positions are gathered when needed.

    Args:
        positions: Returns the positions.
        facts: Those of the rule base that the file stands for, if it does.
    """

    @functools.cache
    def known() -> Positions:
        if facts is None:
            return positions()
        rules, variables = numbers_of(facts), places_of(facts)
        return msgspec.structs.replace(positions(), rules=rules, variables=variables)

    return lambda path: known().find(path)


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

"""What is asked of rules that tie, and a point at which they do."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.ground import Ground, strengths_at
from fuzzytree.auditing.engine.states import Bracket, Claim, Witness, coordinates
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.auditing.engine.witnesses import is_within


class Asked(NamedTuple):
    """Is there a set with an interior on which rules are the strongest?

    Attributes:
        ours: The numbers of the rules that shall tie, from 1; or of a single one.
        strict: The numbers of the rivals that must be weaker.
        weak: The numbers of the rivals that may be equally strong.
    """

    ours: tuple[int, ...]
    strict: tuple[int, ...]
    weak: tuple[int, ...]

    @property
    def rivals(self) -> tuple[int, ...]:
        """All rivals; those that must be weaker come first."""
        return self.strict + self.weak

    def open(self, why: str) -> Bracket:
        """Return the answer that it is not known."""
        names = " and ".join(map(str, self.ours))
        verb = "tie" if len(self.ours) > 1 else "is first"
        noun = "rules" if len(self.ours) > 1 else "rule"
        return Bracket(f"whether {noun} {names} {verb} (1) or not (0)", 0.0, 1.0, why)


def checked(given: Ground, asked: Asked, point: Point) -> Witness | None:
    """Return a point as a witness, if it is one in fractions."""
    strengths = strengths_at(given, point)
    mine = strengths[asked.ours[0] - 1]
    holds = (
        all(strengths[n - 1] == mine for n in asked.ours)
        and all(strengths[n - 1] < mine for n in asked.strict)
        and all(strengths[n - 1] <= mine for n in asked.weak)
        and mine > 0
        and is_within(given, point)
    )
    if not holds:
        return None
    return Witness(coordinates(point), _claims(asked, strengths, mine))


def _claims(
    asked: Asked, strengths: Sequence[Fraction], mine: Fraction
) -> tuple[Claim, ...]:
    every = asked.ours + asked.rivals
    level = tuple(sorted(n for n in every if strengths[n - 1] == mine))
    below = tuple(sorted(n for n in every if strengths[n - 1] < mine))
    return (
        Claim("ties", rules=level, rivals=below),
        Claim("strength", rules=(asked.ours[0],), level=str(mine)),
    )

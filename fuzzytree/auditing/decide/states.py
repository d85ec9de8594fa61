"""The six states of an answer, and how sentences show counts, numbers and names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Literal

from fuzzytree.model import Value
from fuzzytree.model import counted as counted
from fuzzytree.model import number_text as number_text

Representation = Literal["rules", "tree", "raw rules", "old", "new"]
"""Which model a claim is about: the audited rules, their tree, its raw rules, or one of
two models in a comparison."""

ClaimKind = Literal[
    "strength", "beats", "ties", "below", "reaches", "decides", "degree", "covered"
]


class Coordinate(Value, frozen=True):
    """The value of one input, with all its digits.

    Attributes:
        input: The input.
        exact: The value as `p/q`, or `p` where it is whole.
        decimal: The nearest double, by its shortest decimal digits.
        hex: That double as C writes it, such as `0x1.8p+1`; None if the exact value is
            no double.
        word: The value as a table has it: a category, a truth value, a date, a whole
            number with its unit, `missing`; empty of another number.
    """

    input: str
    exact: str
    decimal: str
    hex: str | None
    word: str = ""


class Claim(Value, frozen=True):
    """A statement about a point, which anyone can evaluate again.

    Attributes:
        kind: `strength`: that of `rules[0]` is `level`. `beats`: each of `rules` is
            strictly stronger than each of `rivals`. `ties`: all of `rules` are equally
            strong, and strictly stronger than each of `rivals`. `below`: every one of
            `rules` has a strength below `level`, or of 0 where `level` is `0`.
            `reaches`: every one of `rules` has a strength of at least `level`.
            `decides`: the model predicts `label`; None is no class. `degree`: that
            of the term `term` of `variable` is `level`. `covered`: some rule fires.
        of: The model of the statement.
        rules: The numbers of rules, from 1.
        rivals: The numbers of others.
        level: A number as `p/q`.
        label: A class.
        variable: A variable.
        term: One of its terms.
    """

    kind: ClaimKind
    of: Representation = "rules"
    rules: tuple[int, ...] = ()
    rivals: tuple[int, ...] = ()
    level: str | None = None
    label: str | None = None
    variable: str | None = None
    term: str | None = None


class Span(Value, frozen=True):
    """A variable's part of a region: from `low` to `high`; None has no such end.

    `word` says the values of rows in it as a table has them; empty of plain numbers.
    """

    variable: str
    low: float | None
    high: float | None
    word: str = ""


class Proved(Value, frozen=True, tag="PROVED", tag_field="state"):
    """The claim is true on all of the domain.

    Attributes:
        how: The work of the proof with its counts, in a sentence.
        rivals: The numbers of rules that suffice for the proof; empty for all.
        confirmed: What confirmed it: a solver, such as `z3 4.15.4`, or `recheck`,
            which needs none to read and evaluate; empty for nothing.
    """

    how: str
    rivals: tuple[int, ...] = ()
    confirmed: str = ""


class Computed(Value, frozen=True, tag="COMPUTED", tag_field="state"):
    """The answer was worked out or compared; no other program decides it again.

    Attributes:
        how: What was done, in a sentence.
    """

    how: str


class Witness(Value, frozen=True, tag="WITNESS", tag_field="state"):
    """A point that shows a finding.

    Attributes:
        point: A value for every input.
        claims: What is true there; each was evaluated in fractions.
        region: A box around the point on which the claims are true as well, with only
            the variables that matter; empty if it was not computed.
    """

    point: tuple[Coordinate, ...]
    claims: tuple[Claim, ...]
    region: tuple[Span, ...] = ()


class Bracket(Value, frozen=True, tag="BRACKET", tag_field="state"):
    """Bounds of a number, which the time or the method did not make narrower.

    Attributes:
        of: What the number is, such as `the largest lead of rule 3`.
        low: The lower bound.
        high: The upper bound.
        why: Why the bounds are not narrower, in a sentence.
        point: Where one of the bounds is reached, if such a point is known: `low` of
            a maximum, `high` of a distance.
        claims: What is true at the point.
    """

    of: str
    low: float
    high: float
    why: str
    point: tuple[Coordinate, ...] = ()
    claims: tuple[Claim, ...] = ()


class Sampled(Value, frozen=True, tag="SAMPLED", tag_field="state"):
    """A share that was counted in a sample.

    Attributes:
        of: What was counted.
        hits: The number of rows for which it is true.
        rows: The number of rows in the sample.
        low: The lower end of the confidence interval of the share.
        high: The upper end.
        confidence: Of the interval, such as 0.95.
        how: Where the rows come from, with the seed if they were drawn.
    """

    of: str
    hits: int
    rows: int
    low: float
    high: float
    confidence: float
    how: str


class Declined(Value, frozen=True, tag="DECLINED", tag_field="state"):
    """A question that was not decided.

    Attributes:
        code: The reason, as a code that `fuzzytree explain` explains.
        reason: The reason, in a sentence.
    """

    code: str
    reason: str


State = Proved | Computed | Witness | Bracket | Sampled | Declined


def coordinates(point: Mapping[str, Fraction]) -> tuple[Coordinate, ...]:
    """Return a point with all its digits.

    Example:
        >>> point = coordinates({"x": Fraction(3, 2)})
        >>> point[0].exact, point[0].decimal, point[0].hex
        ('3/2', '1.5', '0x1.8000000000000p+0')
    """
    return tuple(_coordinate(name, value) for name, value in point.items())


def _coordinate(name: str, value: Fraction) -> Coordinate:
    near = float(value)
    is_double = math.isfinite(near) and Fraction(near) == value
    return Coordinate(name, str(value), repr(near), near.hex() if is_double else None)


def point_of(result: Iterable[Coordinate]) -> dict[str, Fraction]:
    """Return the exact values of a point, by input.

    Example:
        >>> point_of(coordinates({"x": Fraction(1, 3)}))
        {'x': Fraction(1, 3)}
    """
    return {at.input: Fraction(at.exact) for at in result}


# --- names in sentences


def answer_text(label: str | None) -> str:
    """Return a predicted class as sentences show it.

    Example:
        >>> answer_text("a"), answer_text(None)
        ("'a'", 'no class')
    """
    return "no class" if label is None else repr(label)


def names_text(names: Sequence[str]) -> str:
    """Return names as sentences show them.

    Example:
        >>> names_text(["a", "b"]), names_text([])
        ("'a', 'b'", 'none')
    """
    return ", ".join(map(repr, names)) or "none"

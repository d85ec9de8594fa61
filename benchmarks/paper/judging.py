"""What follows from the numbers: every conclusion of the page is computed here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal, NamedTuple

from fuzzytree.model.rulebase import Kind
from paper.inference import Power, holm, mcnemar, overhead, power
from paper.records import Claims, Comparison, Family, Price, Size, Times, What

LARGE = 100  # rules: from here on the law of growth is fitted
LEVEL = 0.05  # of the family of tests
ABOUT = 2.0  # "about n times" is within this factor of n
NEARLY = 2.0  # "nearly the tree's price" is at most so many times it
SAME = 0.01  # exponents that differ by less are the same
PRIMARY: Family = "multiway"
"""The family whose leaves are equally likely; tables show it."""

Winner = Literal["tree", "raw rules", "open"]


class Line(NamedTuple):
    """How one way of running rules grows: a line of the picture.

    Attributes:
        family: Of the trees.
        what: Firing or best-first.
        kind: Of the rules.
        runtime: Where.
        is_batch: Whether in one call.
        sizes: Numbers of rules.
        prices: The price at each.
    """

    family: Family
    what: What
    kind: Kind
    runtime: str
    is_batch: bool
    sizes: tuple[int, ...]
    prices: tuple[Price, ...]

    @property
    def ratios(self) -> tuple[float, ...]:
        """Times the tree's price, at each size."""
        return tuple(price.to_tree.median for price in self.prices if price.to_tree)

    @property
    def shares(self) -> tuple[float, ...]:
        """The same, divided by the number of rules."""
        return tuple(r / n for r, n in zip(self.ratios, self.sizes, strict=True))

    @property
    def law(self) -> Power | None:
        """How the ratio grows from `LARGE` rules on; None below three sizes."""
        large = [(n, r) for n, r in zip(self.sizes, self.ratios, strict=True)]
        large = [(n, r) for n, r in large if n >= LARGE]
        return power(*zip(*large, strict=True)) if len(large) > 2 else None

    @property
    def half(self) -> float | None:
        """Up to how many rules more than half of the rules' time is overhead.

        None below three sizes, and where the time does not grow.
        """
        if len(self.sizes) < 3:
            return None
        fixed, each = overhead(self.sizes, [price.ns for price in self.prices])
        return fixed / each if each > 0.0 else None

    @property
    def is_about_n(self) -> bool:
        """Whether the ratio is within `ABOUT` of n, at every size."""
        return all(1.0 / ABOUT <= share <= ABOUT for share in self.shares)

    @property
    def is_near_tree(self) -> bool:
        """Whether no price is surely more than `NEARLY` times the tree's."""
        times = [price.to_tree for price in self.prices if price.to_tree]
        return all(one.low <= NEARLY for one in times)


def lines(claims: Claims) -> Iterator[Line]:
    """Yield all lines, in the order of the records."""
    found: dict[tuple[Family, What, Kind, str, bool], list[tuple[int, Price]]] = {}
    for size in claims.sizes:
        for price in size.prices:
            if price.kind is not None and price.to_tree is not None:
                key = (
                    size.family,
                    price.what,
                    price.kind,
                    price.runtime,
                    price.is_batch,
                )
                found.setdefault(key, []).append((size.rules, price))
    for key, members in found.items():
        sizes, prices = zip(*members, strict=True)
        yield Line(*key, sizes, prices)


def growth(law: Power) -> str:
    """Return how a ratio grows, as its exponent's interval allows to say it."""
    if law.low > 1.0 + SAME:
        return "faster than n"
    return "slower than n" if law.high < 1.0 - SAME else "like n"


def counted(size: Size) -> tuple[float, float]:
    """Return propositions over questions: of every rule alone, and each one once."""
    return size.propositions / size.path, size.distinct / size.path


class Verdict(NamedTuple):
    """Who is right more often.

    Attributes:
        comparison: On what.
        p: Of the exact test, one test alone.
        corrected: The same, for all tests of the page together.
        winner: Of the corrected test.
    """

    comparison: Comparison
    p: float
    corrected: float
    winner: Winner


def verdicts(
    comparisons: Sequence[Comparison],
    votes: Callable[[Comparison], tuple[int, int]] = lambda found: found.votes,
) -> tuple[Verdict, ...]:
    """Return the outcome of McNemar's test for each comparison.

    Each row has one vote, for whoever was right more often over the seeds; rows without
    a preference do not count. `votes` tells which votes are asked.
    """
    values = [mcnemar(*votes(found)) for found in comparisons]
    return tuple(
        Verdict(found, p, corrected, _winner(votes(found), corrected))
        for found, p, corrected in zip(comparisons, values, holm(values), strict=True)
    )


def _winner(votes: tuple[int, int], corrected: float) -> Winner:
    if corrected >= LEVEL:
        return "open"
    return "tree" if votes[0] > votes[1] else "raw rules"


def first_gain(line: Line) -> int | None:
    """Return from how many rules on a search is surely faster than firing.

    From there on, the interval of the factor lies above 1 at every larger size.
    """
    found: int | None = None
    for size, price in zip(line.sizes, line.prices, strict=True):
        is_faster = price.to_firing is not None and price.to_firing.low > 1.0
        found = (found or size) if is_faster else None
    return found


def spread(times: Sequence[Times]) -> float:
    """Return the middle one of the intervals' half widths, as a share of the median."""
    widths = sorted((t.high - t.low) / t.median / 2.0 for t in times)
    return widths[len(widths) // 2] if widths else 0.0

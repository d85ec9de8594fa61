"""What was measured, as frozen values: all that the page and its pictures show."""

from __future__ import annotations

from typing import Literal

import msgspec

from fuzzytree.benchmarking.records import Machine
from fuzzytree.model.rulebase import Conjunction, Kind

Family = Literal["multiway", "grown"]
Mode = Literal["default", "paper"]
What = Literal["tree", "rules", "best-first"]


class Times(msgspec.Struct, frozen=True):
    """How many times as long one thing takes as another.

    Attributes:
        median: Of the quotients of the rounds.
        low: Lower end of its 95 % confidence interval.
        high: Upper end of it.
    """

    median: float
    low: float
    high: float


class Price(msgspec.Struct, frozen=True):
    """What a row costs in one runtime.

    Attributes:
        what: Descent of the tree, firing all rules, or searching them.
        kind: The kind of rules; None for the tree.
        runtime: As in the table of runtimes.
        is_batch: Whether the rows come in one call, or one at a time.
        rows: How many rows were answered in each timed sample.
        ns: Nanoseconds a row: the median of the samples.
        low: Lower end of its 95 % confidence interval.
        high: Upper end of it.
        rounds: How many samples there are.
        to_tree: Against the tree in the same runtime; in `native` where that runs no
            tree. None for the tree itself.
        to_firing: Of firing against this; for best-first only.
    """

    what: What
    kind: Kind | None
    runtime: str
    is_batch: bool
    rows: int
    ns: float
    low: float
    high: float
    rounds: int
    to_tree: Times | None = None
    to_firing: Times | None = None


class Size(msgspec.Struct, frozen=True):
    """Everything about one tree.

    Attributes:
        family: How the tree was made.
        rules: Its leaves, which are the rules of its rule base: the paper's n.
        path: Questions that a row meets on its way, on average.
        propositions: Propositions of all rules together.
        distinct: Different ones among them.
        checked: Rows on which all representations gave the answers that they must give.
        prices: What a row costs.
    """

    family: Family
    rules: int
    path: float
    propositions: int
    distinct: int
    checked: int
    prices: tuple[Price, ...]


class Comparison(msgspec.Struct, frozen=True):
    """A tree and its raw rules on rows that they were not learnt from.

    Counts are sums over the seeds, and each row is answered once for each seed. In a
    vote, each row counts once, for whoever was right more often.

    Attributes:
        table: The data set.
        mode: How the tree was learnt.
        conjunction: The AND of the rules.
        rows: Rows of the table.
        leaves: Of the trees, on average.
        tree_right: Answers of the tree that are right.
        raw_right: Answers of the raw rules that are right.
        both_wrong: Both answer, differently, and neither is right.
        tree_only: Both answer, and only the tree is right.
        raw_only: Both answer, and only the raw rules are right.
        uncovered_tree_right: No raw rule fires, and the tree is right.
        uncovered_tree_wrong: No raw rule fires, and the tree is wrong.
        ties: Raw rules decide by their order among equally strong ones.
        ties_that_differ: Of these, where the tree answers differently.
        relative_differs: The relative rules answer differently from the tree.
        votes: Rows for the tree, and for the raw rules, where both answer.
        votes_in_all: The same, where having no answer is wrong as well.
        of_seeds: `tree_only` and `raw_only` of each seed.
    """

    table: str
    mode: Mode
    conjunction: Conjunction
    rows: int
    leaves: float
    tree_right: int
    raw_right: int
    both_wrong: int
    tree_only: int
    raw_only: int
    uncovered_tree_right: int
    uncovered_tree_wrong: int
    ties: int
    ties_that_differ: int
    relative_differs: int
    votes: tuple[int, int]
    votes_in_all: tuple[int, int]
    of_seeds: tuple[tuple[int, int], ...]

    @property
    def answers(self) -> int:
        """How many answers each of the two gave, none among them."""
        return self.rows * len(self.of_seeds)

    @property
    def uncovered(self) -> int:
        """How many answers the raw rules do not give."""
        return self.uncovered_tree_right + self.uncovered_tree_wrong

    @property
    def differ(self) -> int:
        """In how many both answer, and differently."""
        return self.both_wrong + self.tree_only + self.raw_only


class Claims(msgspec.Struct, frozen=True):
    """All that was measured.

    Attributes:
        machine: Where.
        sizes: The trees, small to large.
        comparisons: The data sets.
        omissions: What was left out and why, a sentence each.
        is_quick: Whether it was a trial with few sizes and rounds.
    """

    machine: Machine
    sizes: tuple[Size, ...]
    comparisons: tuple[Comparison, ...]
    omissions: tuple[str, ...] = ()
    is_quick: bool = False

    def to_json(self) -> str:
        """Return everything, for programs and for `claims.py --again`."""
        raw = msgspec.json.encode(self)
        return msgspec.json.format(raw, indent=1).decode() + "\n"


def from_json(text: str | bytes) -> Claims:
    """Return what `Claims.to_json` wrote.

    Raises:
        msgspec.ValidationError: If it is something else.
    """
    return msgspec.json.decode(text, type=Claims)

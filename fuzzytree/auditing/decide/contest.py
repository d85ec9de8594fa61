"""Which rules win: whether there is a point of a domain where others do."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from fuzzytree.auditing.decide.answers import (
    ZERO,
    Answer,
    Budget,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.boxes import Boxes
from fuzzytree.auditing.decide.decider import Decider
from fuzzytree.auditing.decide.domain import Domain

_ROUND = 1.0 - 1e-12  # more than strengths are rounded by


def decided(base: Base, point: Mapping[str, Fraction]) -> tuple[str | None, int | None]:
    """Return the class of the first of the strongest rules, and its position.

    Where degrees are no fractions, the lower bounds of strengths decide.
    """
    low, high = base.strengths(point)
    best = max(low)
    if not best and not max(high):
        return base.uncovered, None
    place = low.index(best)
    return base.rules[place].then, place


class Contest:
    """Rules whose win counts, against those whose win does not.

    Attributes:
        reach: The positions of those that count.
        rivals: Those of the others.
        is_bare: Whether it counts where no rule fires.
    """

    def __init__(
        self, base: Base, label: str | None, wanted: str | None = None
    ) -> None:
        self.base, self.label, self.wanted = base, label, wanted
        classes = [rule.then for rule in base.rules]
        self.reach = [i for i, own in enumerate(classes) if self.counts(own)]
        self.rivals = [i for i, own in enumerate(classes) if not self.counts(own)]
        self.is_bare = self.counts(base.uncovered)

    def counts(self, label: str | None) -> bool:
        """Return whether a decision is one that is sought."""
        return label != self.label if self.wanted is None else label == self.wanted

    def accepts(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether a point of the domain is decided as is sought, exactly."""
        return self.base.contains(point) and self.counts(decided(self.base, point)[0])

    def ask(self, domain: Domain, budget: Budget) -> Answer:
        """Return a point of a part of the domain that is of the kind, if there is one.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        base = self.base.on(domain)
        budget.spend(60 * base.size)
        if base.is_empty:
            return Proved("the domain has no point")
        decider = Decider(base)
        result: Answer = Proved("no rule that counts can win")
        for question in self._questions(base):
            answer = decider.ask(question, budget)
            if isinstance(answer, Point):
                return answer
            result = result if isinstance(answer, Proved) else answer
        return result

    def _questions(self, base: Base) -> list[Question]:
        """Return questions of which one must be yes, with the rules that matter."""
        box = Boxes.whole(base)
        least = [float(box.strength(i, 0)[0]) * _ROUND for i in self.rivals]
        best = max(least, default=0.0)
        most = [float(box.strength(i, 1)[0]) for i in range(base.count)]
        rivals = [i for i in self.rivals if most[i] >= best and most[i] > 0.0]
        result = [
            Question(
                (j,),
                tuple(i for i in rivals if i < j),
                tuple(i for i in rivals if i > j),
            )
            for j in self.reach
            if most[j] >= best and most[j] > 0.0
        ]
        if self.is_bare and not best:
            result.append(Question(weak=tuple(range(base.count)), level=ZERO))
        return result

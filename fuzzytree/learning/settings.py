"""What a person may choose about learning, checked in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import msgspec


class LearningSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How a tree is learnt.

    Attributes:
        mode: `paper` takes the paper to the letter: one feature a node, ties to the
            first feature. `default` adds combinations of features (step 7), several
            patterns a class, and refines the cuts.
        alpha: Weight of the difference of means in the distance; beta is 1 - alpha.
        l_max: The paper's L_MAX. Large demands a wide margin before one feature is
            trusted. None is 4 in paper mode and 10 in default mode.
        points: n of the paper's 2n + 1 points on a fuzzy set, 1 to 8.
        separate_sides: Whether a set's left and right sides are fitted apart.
        patterns_per_class: How many patterns (clusters) a class has: a number, a
            number by class name (1 for classes not named), or `auto`: chosen class by
            class by inner validation. None is 1 in paper mode, `auto` in default mode.
        shrinkage: How far the off-diagonal of a scatter is shrunk, in [0, 1).
        entry: How much a further feature must help a combination: the smallest
            partial F; 0 takes every feature that helps at all.
        costs: Cost of a feature by column name, 1 for those not named: among equally
            powerful features the cheaper one is chosen, and what a further feature
            gains a combination is divided by it.
        choices: What inner validation may choose beside the patterns, of `alpha`,
            `l_max`, `shrinkage` and `entry`.
        rows_per_class: How many rows of a class are kept at most for clusters,
            combinations, window counts and inner validation; none is left out where
            no more are distinct and there are no more.
        seed: Moves the folds of inner validation.
        keep_reversals: Whether a wide set that overtakes again far outside gets the
            far interval (a second cut); otherwise it is counted and left out.
        missing: `learn`: what stands for a missing or infinite value is learnt, and
            is part of the model. `drop`: such a row is left out and counted, as paper
            mode does in any case, and has no class afterwards. `refuse`: it is an
            error.

    Raises:
        ValueError: If a setting is out of its range; one sentence for each.
    """

    mode: Literal["default", "paper"] = "default"
    alpha: float = 0.9
    l_max: float | None = None
    points: int = 3
    separate_sides: bool = False
    patterns_per_class: int | Literal["auto"] | Mapping[str, int] | None = None
    shrinkage: float = 1e-3
    entry: float = 2.0
    costs: Mapping[str, float] = {}
    choices: tuple[Literal["alpha", "l_max", "shrinkage", "entry"], ...] = ()
    rows_per_class: int = 5_000
    seed: int = 0
    keep_reversals: bool = False
    missing: Literal["learn", "drop", "refuse"] = "learn"

    def __post_init__(self) -> None:
        """Refuse settings out of their range."""
        mistakes = [text for ok, text in self._claims() if not ok]
        if mistakes:
            raise ValueError("\n".join(mistakes))

    def _claims(self) -> list[tuple[bool, str]]:
        per_class = self.patterns_per_class
        numbers = {"": per_class} if isinstance(per_class, int) else per_class
        named = numbers if isinstance(numbers, Mapping) else {}
        claims = [
            (
                self.mode in ("default", "paper"),
                f"mode is 'default' or 'paper', not {self.mode!r}",
            ),
            (0 <= self.alpha <= 1, f"alpha lies in [0, 1], not {self.alpha!r}"),
            (
                self.l_max is None or 0 < self.l_max < math.inf,
                f"l_max is above 0, not {self.l_max!r}",
            ),
            (1 <= self.points <= 8, f"points lies in 1 to 8, not {self.points!r}"),
            (
                0 <= self.shrinkage < 1,
                f"shrinkage lies in [0, 1), not {self.shrinkage!r}",
            ),
            (0 <= self.entry < math.inf, f"entry is at least 0, not {self.entry!r}"),
            (
                self.rows_per_class >= 1,
                f"rows_per_class is at least 1, not {self.rows_per_class!r}",
            ),
            (
                self.missing in ("learn", "drop", "refuse"),
                f"missing is 'learn', 'drop' or 'refuse', not {self.missing!r}",
            ),
            (
                isinstance(numbers, Mapping) or numbers in (None, "auto"),
                f"patterns_per_class is a number, 'auto' or a mapping, "
                f"not {per_class!r}",
            ),
        ]
        known = ("alpha", "l_max", "shrinkage", "entry")
        for choice in self.choices:
            text = f"choices are {', '.join(map(repr, known[:-1]))} and 'entry'"
            claims.append((choice in known, f"{text}, not {choice!r}"))
        for name, number in named.items():
            of = f" of class {name!r}" if name else ""
            text = f"patterns_per_class{of} is at least 1, not {number!r}"
            claims.append((number >= 1, text))
        for name, cost in self.costs.items():
            text = f"the cost of {name!r} is finite and at least 0, not {cost!r}"
            claims.append((0 <= cost < math.inf, text))
        return claims

    @property
    def drops_missing(self) -> bool:
        """Whether rows with a missing value are left out."""
        return self.mode == "paper" or self.missing == "drop"

    @property
    def effective_l_max(self) -> float:
        """The L_MAX that holds in this mode."""
        if self.l_max is not None:
            return self.l_max
        return 4.0 if self.mode == "paper" else 10.0

"""What a person may choose about learning, checked in sentences."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from numbers import Real
from typing import Final, Literal, TypedDict

import msgspec

from fuzzytree.model import name_choice

Form = Literal["tree", "rules"]
ClassWeight = Mapping[str, float] | Literal["balanced"] | None


class LearningSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How a tree is learnt.

    Attributes:
        mode: `paper` is the paper's algorithm: fuzzy patterns of the classes, the
            feature that makes the most groups of them in each node, and a combination
            of features where no single one splits it. `default` scores each split by
            the classes of the rows, and held-out rows prune the tree.
        form: `tree`; or `rules`, one for each class, with a fuzzy set on each column
            that distinguishes classes. None: rules of more than 200 classes, unless
            one of the next four settings limits a tree. Of default mode.
        columns_per_node: How many columns a node looks at, at most; 1 gives rules in
            the table's own words, and paper mode without its step 7. None: as many as
            help.
        leaves: How many leaves the tree has, at most.
        min_rows: How many rows a leaf holds, at least.
        depth: How many conditions lead to a leaf, at most.
        entry: How much a further column must help a combination: the smallest
            partial F; 0 takes every column that helps at all. Of default mode.
        shrinkage: How far the off-diagonal of a scatter is shrunk, in [0, 1).
        alpha: Weight of the difference of means in the paper's distance; beta is
            1 - alpha. None is 0.9. Of paper mode, as the next two.
        l_max: The paper's L_MAX: large demands a wide margin before a feature is
            trusted alone. None is 8.
        patterns_per_class: How many patterns (clusters) a class has: a number, or a
            number by class name (1 for classes not named). None is 1.
        keep_reversals: Whether a wide set that overtakes again far outside gets the
            far interval (a second cut); otherwise it is counted and left out. Of paper
            mode.
        points: n of the paper's 2n + 1 points on a fuzzy set, 1 to 8.
        separate_sides: Whether a set's left and right sides are fitted apart.
        costs: Cost of a feature by column name, 1 for those not named: among equally
            powerful features the cheaper one is chosen, and what a further feature
            gains a combination is divided by it.
        class_weight: By what the weights of a class' rows are multiplied, by its name
            and 1 for those not named; or `balanced`, for all classes to weigh the same.
            Supports of leaves stay those of the rows.
        rows_per_class: How many rows of a class are kept at most; the report says of
            which classes not all were. None: 20,000, or as many as give all classes
            2^20 numbers, but 5,000 at least.
        seed: Moves the folds of held-out rows.
        missing: `learn`: what stands for a missing or infinite value is learnt, and
            is part of the model. `drop`: such a row is left out and counted, as paper
            mode does in any case, and has no class afterwards. `refuse`: it is an
            error.

    Raises:
        ValueError: If a setting is out of its range, or of the other mode; one sentence
            for each.
    """

    mode: Literal["default", "paper"] = "default"
    form: Form | None = None
    columns_per_node: int | None = None
    leaves: int | None = None
    min_rows: int | None = None
    depth: int | None = None
    entry: float = 0.0
    shrinkage: float = 1e-3
    alpha: float | None = None
    l_max: float | None = None
    patterns_per_class: int | Mapping[str, int] | None = None
    keep_reversals: bool = False
    points: int = 3
    separate_sides: bool = False
    costs: Mapping[str, float] = {}
    class_weight: ClassWeight = None
    rows_per_class: int | None = None
    seed: int = 0
    missing: Literal["learn", "drop", "refuse"] = "learn"

    def __post_init__(self) -> None:
        """Refuse settings out of their range."""
        mistakes = [text for ok, text in self._claims() if not ok]
        if mistakes:
            raise ValueError("\n".join(mistakes))

    def _claims(self) -> list[tuple[bool, str]]:
        per_class = self.patterns_per_class
        numbers = {"": per_class} if isinstance(per_class, int) else per_class or {}
        claims = [
            (
                self.mode in ("default", "paper"),
                f"mode is 'default' or 'paper', not {self.mode!r}",
            ),
            (
                self.alpha is None or 0 <= self.alpha <= 1,
                f"alpha lies in [0, 1], not {self.alpha!r}",
            ),
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
                self.missing in ("learn", "drop", "refuse"),
                f"missing is 'learn', 'drop' or 'refuse', not {self.missing!r}",
            ),
        ]
        form = self.form
        text = f"form is 'tree', 'rules' or None, not {form!r}"
        claims.append((form in (None, "tree", "rules"), text))
        for name in _LIMITS if form == "rules" else ():
            text = f"{name} is a setting of a tree, not of the form 'rules'"
            claims.append((getattr(self, name) is None, text))
        for name in (*_LIMITS, "rows_per_class"):
            value = getattr(self, name)
            text = f"{name} is at least 1, not {value!r}"
            claims.append((value is None or value >= 1, text))
        other = "default" if self.mode == "paper" else "paper"
        for name in _OF_MODE.get(other, ()):
            value = getattr(self, name)
            text = f"{name} is a setting of the mode {other!r}, not of {self.mode!r}"
            claims.append((value in (None, False), text))
        for name, number in numbers.items():
            of = f" of class {name!r}" if name else ""
            text = f"patterns_per_class{of} is at least 1, not {number!r}"
            claims.append((number >= 1, text))
        of_class: object = self.class_weight
        if isinstance(of_class, Mapping):
            for name, weight in of_class.items():
                is_right = isinstance(weight, Real) and 0 < float(weight) < math.inf
                text = f"the weight of class {name!r} is finite and above 0"
                claims.append((is_right, f"{text}, not {weight!r}"))
        else:
            text = f"class_weight is 'balanced' or a weight by class, not {of_class!r}"
            claims.append((of_class in (None, "balanced"), text))
        for name, cost in self.costs.items():
            text = f"the cost of {name!r} is finite and at least 0, not {cost!r}"
            claims.append((0 <= cost < math.inf, text))
        return claims

    def learns_rules(self, classes: int) -> bool:
        """Return whether rules are learnt of so many classes with rows, and no tree."""
        if self.form is not None or self.mode == "paper":
            return self.form == "rules"
        limits = (getattr(self, name) for name in _LIMITS)
        return classes > _MANY_CLASSES and all(limit is None for limit in limits)

    @property
    def drops_missing(self) -> bool:
        """Whether rows with a missing value are left out."""
        return self.mode == "paper" or self.missing == "drop"


class SettingArguments(TypedDict, total=False):
    """The fields of `LearningSettings`, as keywords of a function."""

    mode: Literal["default", "paper"]
    form: Form | None
    columns_per_node: int | None
    leaves: int | None
    min_rows: int | None
    depth: int | None
    entry: float
    shrinkage: float
    alpha: float | None
    l_max: float | None
    patterns_per_class: int | Mapping[str, int] | None
    keep_reversals: bool
    points: int
    separate_sides: bool
    costs: Mapping[str, float]
    class_weight: ClassWeight
    rows_per_class: int | None
    seed: int
    missing: Literal["learn", "drop", "refuse"]


OTHER_NAMES: Final = {
    "max_depth": "depth",
    "max_features": "columns_per_node",
    "max_leaf_nodes": "leaves",
    "min_samples_leaf": "min_rows",
    "random_state": "seed",
    "sample_weight": "weights",
}
"""What scikit-learn calls a setting, and what it is called here."""

_ABSENT: Final = {
    "ccp_alpha": "rows that are held out prune the tree; 'leaves' limits its size",
    "criterion": "each split is scored by the classes of the rows that it separates",
    "min_impurity_decrease": "rows that are held out prune the tree",
    "min_samples_split": "'min_rows' is how many rows a leaf holds, at least",
    "n_estimators": "one tree is learnt, and no forest",
    "n_jobs": "one tree is learnt, on one processor",
    "splitter": "each node takes the best split",
}
"""Settings of scikit-learn that have none in their place, and why."""


def settings_of(
    settings: LearningSettings | SettingArguments | None,
    arguments: SettingArguments,
    taker: str = "learn",
    others: Collection[str] = ("weights", "ignore", "name", "units"),
) -> LearningSettings:
    """Return settings, in which those that are named go before the others.

    Raises:
        TypeError: If there is no setting of a name.
    """
    if not isinstance(settings, LearningSettings):
        arguments = {**(settings or {}), **arguments}
        settings = LearningSettings()
    refuse_unknown(taker, arguments, (*LearningSettings.__struct_fields__, *others))
    return msgspec.structs.replace(settings, **arguments)


def refuse_unknown(taker: str, names: Iterable[str], fields: Collection[str]) -> None:
    """Raise a TypeError for the first name that is none of the fields."""
    for name in names:
        if name not in fields:
            other = OTHER_NAMES.get(name)
            choice = _ABSENT.get(name) or name_choice(name, fields)
            if other in fields:
                choice = f"it is called {other!r} here"
            raise TypeError(f"{taker} has no setting {name!r}; {choice}")


_MANY_CLASSES = 200
"""With more classes than that, rules are learnt unless a tree is wanted."""

_LIMITS = ("columns_per_node", "leaves", "min_rows", "depth")
"""Settings that limit a tree."""

_OF_MODE = {
    "default": ("form", "leaves", "min_rows", "depth", "class_weight"),
    "paper": ("alpha", "l_max", "patterns_per_class", "keep_reversals"),
}
"""Settings that one mode alone has."""

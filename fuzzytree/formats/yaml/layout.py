"""The layout of our YAML files as records: one place for reader and JSON Schema.

A record's fields are the keys of a mapping in the file. `forms` lists, where some keys
exclude others, the sets of keys that may stand together.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Final, Literal

import msgspec
from msgspec import Meta, field

from fuzzytree.model.rulebase import MOST_POINTS, LabelType

FORMAT: Final = "fuzzytree/1"
LONGEST_NAME: Final = 1000
LONGEST_SENTENCE: Final = 100_000
LARGEST_COUNT: Final = 2**53

Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
Count = Annotated[int, Meta(ge=0, le=LARGEST_COUNT)]
Number = Annotated[int, Meta(ge=1, le=LARGEST_COUNT)]
Point = Annotated[
    tuple[float, ...],
    Meta(min_length=2, max_length=2, description="a value and the degree there"),
]
PointList = Annotated[tuple[Point, ...], Meta(min_length=1, max_length=MOST_POINTS)]
Curve = Annotated[tuple[float, ...], Meta(min_length=1, max_length=8)]
Answer = Annotated[
    str,
    Meta(
        pattern=r"^(no class|class [\s\S]+)$",
        description="'no class', or 'class' and the name of a class",
        examples=["no class", "class setosa"],
    ),
]
GoTo = Annotated[
    str,
    Meta(
        pattern=r"^(node|leaf) [1-9][0-9]{0,8}$",
        description="'node' or 'leaf' and a number, such as 'node 2'",
        examples=["node 2", "leaf 1"],
    ),
]
Sentence = Annotated[
    str,
    Meta(
        max_length=LONGEST_SENTENCE,
        description="`VARIABLE is TERM`, `VARIABLE is TERM or TERM`, "
        "or either with `is not`.",
        examples=["petal length is high", "petal width is not low or medium"],
    ),
]


class Form(msgspec.Struct, frozen=True):
    """Keys that may stand together: all of `needs`, and any of `may`."""

    needs: tuple[str, ...]
    may: tuple[str, ...] = ()


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """A mapping of the file."""

    noun: ClassVar[str]
    forms: ClassVar[tuple[Form, ...]] = ()


class Range(Record, frozen=True, kw_only=True):
    """The values seen or allowed, ends included; an unknown end is left out."""

    noun: ClassVar[str] = "a range"
    from_: float | None = field(name="from", default=None)
    to: float | None = None


class PartOfSum(Record, frozen=True, kw_only=True):
    """A summand, `weight * (input - centre)`; the centre is 0 if left out."""

    noun: ClassVar[str] = "a summand"
    input: Name
    weight: float
    centre: float = 0.0


class Fall(Record, frozen=True, kw_only=True):
    """How the degree falls from 1 at `from` to 0 at `to`.

    With q falling in a straight line from 1 to 0, the degree is
    `q * (c0 + q * (c1 + ...))`; without a curve it is q.
    """

    noun: ClassVar[str] = "a flank"
    from_: float = field(name="from")
    to: float
    curve: Curve = (1.0,)
    fit_error: float | None = field(name="fit error", default=None)


class HalfSet(Record, frozen=True, kw_only=True):
    """One side of an LR set; see `TermOfVariable`."""

    noun: ClassVar[str] = "a side"
    spread: float
    curve: Curve
    reach: float


class TermOfVariable(Record, frozen=True, kw_only=True):
    """A label of a variable, in one of five shapes.

    A plateau: degree 1 `above` one value and `up to` another, with flanks.
    An LR set: degree 1 at the mean; u is the distance from it in spreads,
    t = min(u, 1), v = 2 t - 1, w = clip((reach - u) / (reach - 1), 0, 1); the degree is
    `clip(1 - t * (c0 + v * (c1 + ...)), 0, 1) * w**4`.
    An LR set whose two sides differ has them under `left` and `right`.
    Points, joined by lines: `[value, degree]` each, in ascending order; a value that
    stands twice is a step, where the first degree holds.
    `degree: 1` is true everywhere.
    """

    noun: ClassVar[str] = "a term"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(("above",), ("up to", "left flank", "right flank")),
        Form(("up to",), ("above", "left flank", "right flank")),
        Form(("mean", "spread", "curve", "reach")),
        Form(("mean", "left", "right")),
        Form(("points",)),
        Form(("degree",)),
    )
    name: Name
    above: float | None = None
    up_to: float | None = field(name="up to", default=None)
    left_flank: Fall | None = field(name="left flank", default=None)
    right_flank: Fall | None = field(name="right flank", default=None)
    mean: float | None = None
    spread: float | None = None
    curve: Curve | None = None
    reach: float | None = None
    left: HalfSet | None = None
    right: HalfSet | None = None
    points: PointList | None = None
    degree: Literal[1] | None = None


class VariableOfModel(Record, frozen=True, kw_only=True):
    """An input column, or a sum of weighted inputs, with its terms."""

    noun: ClassVar[str] = "a variable"
    name: Name
    unit: Name | None = None
    range: Range | None = None
    sum_of: tuple[PartOfSum, ...] = field(name="sum of", default=())
    terms: tuple[TermOfVariable, ...] = ()


class WrittenOut(Record, frozen=True, kw_only=True):
    """A clause whose names would make a sentence ambiguous."""

    noun: ClassVar[str] = "a clause"
    forms: ClassVar[tuple[Form, ...]] = (Form(("is",)), Form(("is not",)))
    variable: Name
    is_: tuple[Name, ...] | None = field(name="is", default=None)
    is_not: tuple[Name, ...] | None = field(name="is not", default=None)


class RuleOfModel(Record, frozen=True, kw_only=True):
    """If all clauses hold, then the class; support counts training rows."""

    noun: ClassVar[str] = "a rule"
    if_: tuple[Sentence | WrittenOut, ...] = field(name="if")
    then: Name
    support: Count | None = None


class RuleSemantics(Record, frozen=True, kw_only=True):
    """What an answer depends on beside the rules."""

    noun: ClassVar[str] = "the semantics of rules"
    and_: Literal["min", "product"] = field(name="and")
    or_: Literal["max"] = field(name="or")
    not_: Literal["1 - degree"] = field(name="not")
    uncovered: Answer
    missing: Answer
    label_type: LabelType | None = field(name="label type", default=None)
    answer: Literal["the class of the first of the strongest rules"]


class TreeSemantics(Record, frozen=True, kw_only=True):
    """What an answer depends on beside the nodes, and the AND of the tree's rules."""

    noun: ClassVar[str] = "the semantics of a tree"
    and_: Literal["min", "product"] = field(name="and")
    uncovered: Answer
    missing: Answer
    label_type: LabelType | None = field(name="label type", default=None)
    cuts: Literal["a value equal to a cut lies below it"]
    answer: Literal["the class of the leaf that the nodes lead to"]


class Way(Record, frozen=True, kw_only=True):
    """A branch of a node: taken where the variable is one of the terms."""

    noun: ClassVar[str] = "a branch"
    is_: tuple[Name, ...] = field(name="is")
    sets: tuple[Name, ...] = ()
    go_to: GoTo = field(name="go to")


class Question(Record, frozen=True, kw_only=True):
    """A node: k cuts make k + 1 intervals, and each belongs to a branch.

    Interval and branch have the same number unless `interval owners` gives the
    number of each interval's branch.
    """

    noun: ClassVar[str] = "a node"
    node: Number
    ask: Name
    cuts: tuple[float, ...]
    interval_owners: tuple[Number, ...] = field(name="interval owners", default=())
    branches: tuple[Way, ...]


class End(Record, frozen=True, kw_only=True):
    """A leaf: a class, and the pattern of that class."""

    noun: ClassVar[str] = "a leaf"
    leaf: Number
    class_: Name = field(name="class")
    pattern: Name | None = None
    support: Count | None = None


class FittedSets(Record, frozen=True, kw_only=True):
    """The fitted sets of the patterns on one variable."""

    noun: ClassVar[str] = "a group of sets"
    variable: Name
    terms: tuple[TermOfVariable, ...]


class Head(Record, frozen=True, kw_only=True):
    """What rule bases and trees begin with."""

    noun: ClassVar[str] = "a model"
    format: Literal["fuzzytree/1"]
    name: Name
    classes: Annotated[tuple[Name, ...], Meta(min_length=1)]
    columns: tuple[Name, ...] = ()


class RuleBaseHead(Head, frozen=True, kw_only=True):
    """The beginning of a rule base."""

    noun: ClassVar[str] = "a rule base"
    kind: Literal["rule base"]
    terms: Literal["relative", "raw"] | None = None


class RuleBaseFile(RuleBaseHead, frozen=True, kw_only=True):
    """A fuzzy rule base of fuzzytree."""

    variables: tuple[VariableOfModel, ...] = ()
    rules: Annotated[tuple[RuleOfModel, ...], Meta(min_length=1)]
    semantics: RuleSemantics


class TreeHead(Head, frozen=True, kw_only=True):
    """The beginning of a tree."""

    noun: ClassVar[str] = "a tree"
    kind: Literal["tree"]


class TreeFile(TreeHead, frozen=True, kw_only=True):
    """A fuzzy decision tree of fuzzytree."""

    variables: tuple[VariableOfModel, ...] = ()
    nodes: tuple[Question, ...] = ()
    leaves: Annotated[tuple[End, ...], Meta(min_length=1)]
    sets: tuple[FittedSets, ...] = ()
    semantics: TreeSemantics

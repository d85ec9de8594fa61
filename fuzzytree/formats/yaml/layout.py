"""The layout of our YAML files as records: one place for reader and JSON Schema.

A record's fields are the keys of a mapping in the file. `forms` lists, where some keys
exclude others, the sets of keys that may stand together.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, get_args

import msgspec
from msgspec import Meta, field

from fuzzytree.formats.formulas import MOST_CHARACTERS
from fuzzytree.formats.text_files import LONGEST_NAME
from fuzzytree.model import (
    MOST_POINTS,
    MOST_SAMPLES,
    ActivationMethod,
    DefuzzifierMethod,
    Grid,
    LabelType,
    PiCurve,
    Relation,
    Singleton,
    SNorm,
    SystemCurve,
    TNorm,
)

YAML_FORMAT: Final = "fuzzytree/1"
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
Four = Annotated[tuple[float, ...], Meta(min_length=4, max_length=4)]
Three = Annotated[tuple[float, ...], Meta(min_length=3, max_length=3)]
FormulaText = Annotated[
    str,
    Meta(
        min_length=1,
        max_length=MOST_CHARACTERS,
        description="`x` is the value whose degree is computed.",
        examples=["2 * dirt + 1", "max(0, 1 - abs(x) / 3)"],
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
Antecedent = tuple[
    Annotated[
        str,
        Meta(
            max_length=LONGEST_SENTENCE,
            description="`VARIABLE is HEDGE ... TERM or TERM`; in a fuzzy system also "
            "such propositions with and, or, not (...) and parentheses.",
            examples=[
                "petal width is not low or medium",
                "dirt is high or load is big",
            ],
        ),
    ],
    ...,
]


class KeyForm(msgspec.Struct, frozen=True):
    """Keys that may stand together: all of `needs`, and any of `may`."""

    needs: tuple[str, ...]
    may: tuple[str, ...] = ()


class FileRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A mapping of the file."""

    noun: ClassVar[str]
    forms: ClassVar[tuple[KeyForm, ...]] = ()


class RangeOfVariable(FileRecord, frozen=True, kw_only=True):
    """The values seen or allowed, ends included; an unknown end is left out.

    In systems `outside: clipped` moves a value beyond an end to it.
    """

    noun: ClassVar[str] = "a range"
    from_: float | None = field(name="from", default=None)
    to: float | None = None
    outside: Literal["clipped"] | None = None


class PartOfSum(FileRecord, frozen=True, kw_only=True):
    """A summand, `weight * (input - centre)`; the centre is 0 if left out."""

    noun: ClassVar[str] = "a summand"
    input: Name
    weight: float
    centre: float = 0.0


class HalfSet(FileRecord, frozen=True, kw_only=True):
    """One side of an LR set; see `TermKeys`."""

    noun: ClassVar[str] = "a side"
    spread: float
    curve: Curve
    reach: float


class SigmoidCurve(FileRecord, frozen=True, kw_only=True):
    """`1 / (1 + exp(-slope (x - inflection)))`."""

    noun: ClassVar[str] = "a sigmoid"
    inflection: float
    slope: float


class LinearCurve(FileRecord, frozen=True, kw_only=True):
    """A weight for each column, in order, and what is added."""

    noun: ClassVar[str] = "a linear term"
    weights: tuple[float, ...]
    offset: float = 0.0


def _record_of(kind: type[SystemCurve]) -> type[msgspec.Struct]:
    """Return the record of a membership function: its numbers by their names."""
    numbers = [
        (name, float, field(name=name.replace("_", " ")))
        for name in kind.__struct_fields__
    ]
    about = {"__doc__": inspect.getdoc(kind), "noun": f"a {_tag(kind)}"}
    name = f"{kind.__name__}Numbers"
    return msgspec.defstruct(
        name, numbers, bases=(FileRecord,), namespace=about, frozen=True, kw_only=True
    )


def _tag(kind: type[SystemCurve]) -> str:
    return str(kind.__struct_config__.tag)


_OF_NUMBERS: Final = {
    _tag(kind): _record_of(kind)
    for kind in get_args(SystemCurve)
    if kind not in (PiCurve, Singleton)
    and all(one.type is float for one in msgspec.structs.fields(kind))
}
"""The record of each membership function that is written as its numbers by name."""

_CURVES = (
    *("trapezoid", "triangle", *_OF_NUMBERS, "sigmoid difference", "sigmoid product"),
    *("pi", "at least", "at most", "singleton", "linear", "formula"),
)
Two = Annotated[tuple[SigmoidCurve, ...], Meta(min_length=2, max_length=2)]


class TermKeys(FileRecord, frozen=True, kw_only=True):
    """A label of a variable, with one membership function.

    A plateau: degree 1 `above` one value and `up to` another, and `0 up to` a value
    below it and `0 from` a value above it; lines lead from the one to the other.
    An LR set: degree 1 at the mean; u is the distance from it in spreads,
    t = min(u, 1), v = 2 t - 1, w = clip((reach - u) / (reach - 1), 0, 1); the degree is
    `clip(1 - t * (c0 + v * (c1 + ...)), 0, 1) * w**4`.
    An LR set whose two sides differ has them under `left` and `right`.
    Points, joined by lines: `[value, degree]` each, in ascending order; a value that
    stands twice is a step, where the first degree holds.
    `degree: 1` is true everywhere.

    Only systems have the others, and a height, by which the degree is multiplied.
    A trapezoid `[a, b, c, d]` rises from a to b, is 1 up to c and falls to d; `-.inf`
    as a and `.inf` as d leave that side open. A triangle `[a, b, d]` has its peak at b.
    `at least: v` is 1 from v on, `at most: v` up to v, both with v itself. A
    `singleton` is 1 at one value and, as a conclusion, the number itself. The rest are
    those of `docs/reference/systems.md`.
    """

    noun: ClassVar[str] = "a term"
    forms: ClassVar[tuple[KeyForm, ...]] = (
        KeyForm(("above",), ("0 up to", "up to", "0 from")),
        KeyForm(("up to",), ("0 up to", "above", "0 from")),
        KeyForm(("mean", "spread", "curve", "reach")),
        KeyForm(("mean", "left", "right")),
        KeyForm(("points",)),
        KeyForm(("degree",)),
        *(KeyForm((name,)) for name in _CURVES),
    )
    name: Name
    above: float | None = None
    up_to: float | None = field(name="up to", default=None)
    zero_up_to: float | None = field(name="0 up to", default=None)
    zero_from: float | None = field(name="0 from", default=None)
    mean: float | None = None
    spread: float | None = None
    curve: Curve | None = None
    reach: float | None = None
    left: HalfSet | None = None
    right: HalfSet | None = None
    points: PointList | None = None
    degree: Literal[1] | None = None
    height: float = 1.0
    trapezoid: Four | None = None
    triangle: Three | None = None
    sigmoid_difference: Two | None = field(name="sigmoid difference", default=None)
    sigmoid_product: Two | None = field(name="sigmoid product", default=None)
    pi: Four | None = None
    at_least: float | None = field(name="at least", default=None)
    at_most: float | None = field(name="at most", default=None)
    singleton: float | None = None
    linear: LinearCurve | None = None
    formula: FormulaText | None = None


if TYPE_CHECKING:
    TermOfVariable = TermKeys
else:  # with a field for each function that is written as its numbers
    TermOfVariable = msgspec.defstruct(
        "TermOfVariable",
        [
            (tag.replace(" ", "_"), record | None, field(name=tag, default=None))
            for tag, record in _OF_NUMBERS.items()
        ],
        bases=(TermKeys,),
        namespace={"__doc__": TermKeys.__doc__},
        frozen=True,
        kw_only=True,
    )


class VariableOfModel(FileRecord, frozen=True, kw_only=True):
    """An input column, or a sum of weighted inputs, with its terms.

    The values of a column of text are the positions of its `categories`, from 0.
    `missing as` stands for a value that is missing, infinite or no category.
    `numbers: whole` says that its values are whole numbers, of dates whole days.
    """

    noun: ClassVar[str] = "a variable"
    name: Name
    unit: Name | None = None
    categories: tuple[Name, ...] = ()
    missing_as: float | None = field(name="missing as", default=None)
    numbers: Literal["whole"] | None = None
    range: RangeOfVariable | None = None
    sum_of: tuple[PartOfSum, ...] = field(name="sum of", default=())
    terms: tuple[TermOfVariable, ...] = ()


Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Shares = Annotated[
    dict[Name, Share],
    Meta(
        description="the probability of each class, in millionths; classes that are "
        "left out share the rest evenly",
        examples=[{"setosa": 0.96, "virginica": 0.03}],
    ),
]


Counts = Annotated[
    dict[Name, Count],
    Meta(
        description="the training rows by class, which sum to the support; classes "
        "that are left out have none",
        examples=[{"setosa": 48, "virginica": 2}],
    ),
]


class RuleOfModel(FileRecord, frozen=True, kw_only=True):
    """If all propositions hold, then the class; support counts training rows."""

    noun: ClassVar[str] = "a rule"
    if_: Antecedent = field(name="if")
    then: Name
    support: Count | None = None
    counts: Counts | None = None
    probabilities: Shares | None = None


class RuleSemantics(FileRecord, frozen=True, kw_only=True):
    """What an answer depends on beside the rules."""

    noun: ClassVar[str] = "the semantics of rules"
    and_: Literal["minimum", "product"] = field(name="and")
    or_: Literal["maximum"] = field(name="or")
    not_: Literal["1 - degree"] = field(name="not")
    uncovered: Answer
    missing: Answer
    label_type: LabelType | None = field(name="label type", default=None)
    sharpness: Number | None = None
    floor: Share | None = None
    answer: Literal["the class of the first of the strongest rules"]


class TreeSemantics(FileRecord, frozen=True, kw_only=True):
    """What an answer depends on beside the nodes, and the AND of the tree's rules."""

    noun: ClassVar[str] = "the semantics of a tree"
    and_: Literal["minimum", "product"] = field(name="and")
    uncovered: Answer
    missing: Answer
    label_type: LabelType | None = field(name="label type", default=None)
    sharpness: Number | None = None
    floor: Share | None = None
    cuts: Literal["a value equal to a cut lies below it"]
    answer: Literal["the class of the leaf that the nodes lead to"]


class Way(FileRecord, frozen=True, kw_only=True):
    """A branch of a node: taken where the variable is one of the terms."""

    noun: ClassVar[str] = "a branch"
    is_: tuple[Name, ...] = field(name="is")
    sets: tuple[Name, ...] = ()
    go_to: GoTo = field(name="go to")


class NodeOfTree(FileRecord, frozen=True, kw_only=True):
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


class End(FileRecord, frozen=True, kw_only=True):
    """A leaf: a class, and the pattern of that class."""

    noun: ClassVar[str] = "a leaf"
    leaf: Number
    class_: Name = field(name="class")
    pattern: Name | None = None
    support: Count | None = None
    counts: Counts | None = None
    probabilities: Shares | None = None


class SetsOfVariable(FileRecord, frozen=True, kw_only=True):
    """The fitted sets of the patterns on one variable."""

    noun: ClassVar[str] = "a group of sets"
    variable: Name
    terms: tuple[TermOfVariable, ...]


class Head(FileRecord, frozen=True, kw_only=True):
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
    nodes: tuple[NodeOfTree, ...] = ()
    leaves: Annotated[tuple[End, ...], Meta(min_length=1)]
    sets: tuple[SetsOfVariable, ...] = ()
    semantics: TreeSemantics


LONGEST_NOTE = 100_000

Note = Annotated[str, Meta(min_length=1, max_length=LONGEST_NOTE)]
Samples = Annotated[int, Meta(ge=1, le=MOST_SAMPLES)]
ConclusionText = Annotated[
    str,
    Meta(
        max_length=LONGEST_SENTENCE,
        description="Propositions `OUTPUT is HEDGE ... TERM`, joined by `and`.",
        examples=["power is high and fan is off"],
    ),
]


class OutputOfSystem(FileRecord, frozen=True, kw_only=True):
    """An output, and how it becomes a number.

    Without an aggregation weighted numbers are summed one by one. The default answers
    where nothing was concluded; without one it is nan.
    """

    noun: ClassVar[str] = "an output"
    name: Name
    unit: Name | None = None
    range: RangeOfVariable | None = None
    terms: tuple[TermOfVariable, ...] = ()
    defuzzifier: DefuzzifierMethod
    samples: Samples = 100
    grid: Grid = "middle"
    aggregation: SNorm | None = None
    default: float | None = None


class ActivationOfBlock(FileRecord, frozen=True, kw_only=True):
    """Which rules of a block are activated."""

    noun: ClassVar[str] = "an activation"
    method: ActivationMethod
    count: Number = 1
    threshold: float = 0.0
    relation: Relation = ">="


class RuleOfSystem(FileRecord, frozen=True, kw_only=True):
    """If all conditions hold, then some terms are concluded."""

    noun: ClassVar[str] = "a rule"
    name: Name | None = None
    if_: Antecedent = field(name="if")
    then: ConclusionText
    weight: float = 1.0


class BlockHead(FileRecord, frozen=True, kw_only=True):
    """What rules share; an operator that none of them needs may be left out."""

    noun: ClassVar[str] = "a block"
    name: Name | None = None
    and_: TNorm | None = field(name="and", default=None)
    or_: SNorm | None = field(name="or", default=None)
    implication: TNorm | None = None
    activation: ActivationOfBlock


class BlockOfSystem(BlockHead, frozen=True, kw_only=True):
    """Rules with the operators that they share."""

    rules: tuple[RuleOfSystem, ...]


class SystemSemantics(FileRecord, frozen=True, kw_only=True):
    """What an answer depends on beside the rules."""

    noun: ClassVar[str] = "the semantics of a system"
    not_: Literal["1 - degree"] = field(name="not")
    activated: Literal["rules whose weighted degree is above 0"]
    missing: Literal["a value that is missing or infinite makes every output nan"]


class SystemHead(FileRecord, frozen=True, kw_only=True):
    """The beginning of a system."""

    noun: ClassVar[str] = "a system"
    format: Literal["fuzzytree/1"]
    kind: Literal["system"]
    name: Name
    note: Note | None = None


class SystemFile(SystemHead, frozen=True, kw_only=True):
    """A fuzzy system of fuzzytree."""

    variables: tuple[VariableOfModel, ...] = ()
    outputs: Annotated[tuple[OutputOfSystem, ...], Meta(min_length=1)]
    blocks: tuple[BlockOfSystem, ...]
    semantics: SystemSemantics

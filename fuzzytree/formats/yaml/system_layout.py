"""The layout of a YAML file of a fuzzy system, as records; see `layout`."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from msgspec import Meta, field

from fuzzytree.formats.formulas import MOST_CHARACTERS
from fuzzytree.formats.yaml.layout import (
    LONGEST_SENTENCE,
    Form,
    Name,
    Number,
    PartOfSum,
    Range,
    Record,
    TermOfVariable,
)
from fuzzytree.model.system import (
    MOST_SAMPLES,
    ActivationMethod,
    DefuzzifierMethod,
    Grid,
    Relation,
    SNorm,
    TNorm,
)

LONGEST_NOTE = 100_000

Note = Annotated[str, Meta(min_length=1, max_length=LONGEST_NOTE)]
Four = Annotated[tuple[float, ...], Meta(min_length=4, max_length=4)]
Three = Annotated[tuple[float, ...], Meta(min_length=3, max_length=3)]
Samples = Annotated[int, Meta(ge=1, le=MOST_SAMPLES)]
FormulaText = Annotated[
    str,
    Meta(
        min_length=1,
        max_length=MOST_CHARACTERS,
        description="`x` is the value whose degree is asked for.",
        examples=["2 * dirt + 1", "max(0, 1 - abs(x) / 3)"],
    ),
]
ConditionText = Annotated[
    str,
    Meta(
        max_length=LONGEST_SENTENCE,
        description="Clauses `VARIABLE is HEDGE ... TERM` with and, or, not (...) and "
        "parentheses; `always` holds always.",
        examples=["dirt is very high and (load is small or load is not big)"],
    ),
]
ConclusionText = Annotated[
    str,
    Meta(
        max_length=LONGEST_SENTENCE,
        description="Clauses `OUTPUT is HEDGE ... TERM`, joined by `and`.",
        examples=["power is high and fan is off"],
    ),
]


class RangeOfSystem(Range, frozen=True, kw_only=True):
    """The values seen or allowed, ends included; an unknown end is left out.

    With `outside: clipped` a value beyond an end is moved to it.
    """

    outside: Literal["clipped"] | None = None


class GaussianCurve(Record, frozen=True, kw_only=True):
    """`exp(-(x - mean)^2 / (2 deviation^2))`."""

    noun: ClassVar[str] = "a gaussian"
    mean: float
    deviation: float


class TwoGaussiansCurve(Record, frozen=True, kw_only=True):
    """A gaussian below `left` times another one above `right`, each 1 elsewhere."""

    noun: ClassVar[str] = "a curve of two gaussians"
    left: float
    left_deviation: float = field(name="left deviation")
    right: float
    right_deviation: float = field(name="right deviation")


class BellCurve(Record, frozen=True, kw_only=True):
    """`1 / (1 + |(x - center) / width|^(2 slope))`."""

    noun: ClassVar[str] = "a bell"
    center: float
    width: float
    slope: float


class SigmoidCurve(Record, frozen=True, kw_only=True):
    """`1 / (1 + exp(-slope (x - inflection)))`."""

    noun: ClassVar[str] = "a sigmoid"
    inflection: float
    slope: float


class WideCurve(Record, frozen=True, kw_only=True):
    """A cosine or a spike about a centre."""

    noun: ClassVar[str] = "a curve about a center"
    center: float
    width: float


class CurveFromTo(Record, frozen=True, kw_only=True):
    """Where a curve has the degree 0, and where it has 1 (or ends)."""

    noun: ClassVar[str] = "a curve between two values"
    start: float
    end: float


class ConcaveCurve(Record, frozen=True, kw_only=True):
    """Rises or falls to 1 at the end, ever more steeply."""

    noun: ClassVar[str] = "a concave curve"
    inflection: float
    end: float


class LinearCurve(Record, frozen=True, kw_only=True):
    """A weight for each column, in order, and what is added."""

    noun: ClassVar[str] = "a linear term"
    weights: tuple[float, ...]
    offset: float = 0.0


_CURVES = (
    *("trapezoid", "triangle", "gaussian", "two gaussians", "bell", "sigmoid"),
    *("sigmoid difference", "sigmoid product", "s", "pi", "cosine", "concave", "spike"),
    *("arc", "semi ellipse", "at least", "at most", "singleton", "linear", "formula"),
)
Two = Annotated[tuple[SigmoidCurve, ...], Meta(min_length=2, max_length=2)]


class LabelOfVariable(TermOfVariable, frozen=True, kw_only=True):
    """A label of a variable of a system, with one curve.

    A trapezoid `[a, b, c, d]` rises from a to b, is 1 up to c and falls to d; `-.inf`
    as a and `.inf` as d leave that side open. A triangle `[a, b, d]` has its peak at b.
    `at least: v` is 1 from v on, `at most: v` up to v, both with v itself. A
    `singleton` is 1 at one value and, as a conclusion, the number itself. The other
    curves are those of a rule base and those of `docs/reference/systems.md`. The degree
    is multiplied by the height.
    """

    forms: ClassVar[tuple[Form, ...]] = (
        *TermOfVariable.forms,
        *(Form((name,)) for name in _CURVES),
    )
    height: float = 1.0
    trapezoid: Four | None = None
    triangle: Three | None = None
    gaussian: GaussianCurve | None = None
    two_gaussians: TwoGaussiansCurve | None = field(name="two gaussians", default=None)
    bell: BellCurve | None = None
    sigmoid: SigmoidCurve | None = None
    sigmoid_difference: Two | None = field(name="sigmoid difference", default=None)
    sigmoid_product: Two | None = field(name="sigmoid product", default=None)
    s: CurveFromTo | None = None
    pi: Four | None = None
    cosine: WideCurve | None = None
    concave: ConcaveCurve | None = None
    spike: WideCurve | None = None
    arc: CurveFromTo | None = None
    semi_ellipse: CurveFromTo | None = field(name="semi ellipse", default=None)
    at_least: float | None = field(name="at least", default=None)
    at_most: float | None = field(name="at most", default=None)
    singleton: float | None = None
    linear: LinearCurve | None = None
    formula: FormulaText | None = None


class InputOfSystem(Record, frozen=True, kw_only=True):
    """An input column, or a sum of weighted inputs, with its terms."""

    noun: ClassVar[str] = "an input"
    name: Name
    unit: Name | None = None
    range: RangeOfSystem | None = None
    sum_of: tuple[PartOfSum, ...] = field(name="sum of", default=())
    terms: tuple[LabelOfVariable, ...] = ()


class OutputOfSystem(Record, frozen=True, kw_only=True):
    """An output, and how it becomes a number.

    Without an aggregation weighted numbers are summed one by one. The default answers
    where nothing was concluded; without one it is nan.
    """

    noun: ClassVar[str] = "an output"
    name: Name
    unit: Name | None = None
    range: RangeOfSystem | None = None
    terms: tuple[LabelOfVariable, ...] = ()
    defuzzifier: DefuzzifierMethod
    samples: Samples = 100
    grid: Grid = "middle"
    aggregation: SNorm | None = None
    default: float | None = None


class ActivationOfBlock(Record, frozen=True, kw_only=True):
    """Which rules of a block are activated."""

    noun: ClassVar[str] = "an activation"
    method: ActivationMethod
    count: Number = 1
    threshold: float = 0.0
    relation: Relation = ">="


class RuleOfSystem(Record, frozen=True, kw_only=True):
    """If a condition holds, then some terms are concluded."""

    noun: ClassVar[str] = "a rule"
    name: Name | None = None
    if_: ConditionText = field(name="if")
    then: ConclusionText
    weight: float = 1.0


class BlockHead(Record, frozen=True, kw_only=True):
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


class SystemSemantics(Record, frozen=True, kw_only=True):
    """What an answer depends on beside the rules."""

    noun: ClassVar[str] = "the semantics of a system"
    not_: Literal["1 - degree"] = field(name="not")
    activated: Literal["rules whose weighted degree is above 0"]
    missing: Literal["a value that is missing or infinite makes every output nan"]


class SystemHead(Record, frozen=True, kw_only=True):
    """The beginning of a system."""

    noun: ClassVar[str] = "a system"
    format: Literal["fuzzytree/1"]
    kind: Literal["system"]
    name: Name
    note: Note | None = None


class SystemFile(SystemHead, frozen=True, kw_only=True):
    """A fuzzy system of fuzzytree."""

    inputs: tuple[InputOfSystem, ...] = ()
    outputs: Annotated[tuple[OutputOfSystem, ...], Meta(min_length=1)]
    blocks: tuple[BlockOfSystem, ...]
    semantics: SystemSemantics

"""A fuzzy inference system as a frozen value: what foreign files hold and rules do not.

Rule bases of ours decide for a class. Systems of others have outputs that are numbers:
rules in blocks conclude terms of outputs, what is concluded is aggregated, and the
result is defuzzified. What a system *means* is computed in `fuzzytree.inference`; all
that could change an answer stands in the values below.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Final, Literal

from fuzzytree.errors import InvalidModelError
from fuzzytree.rulebase import (
    LR,
    Band,
    Mistake,
    Part,
    Path,
    Points,
    Value,
    name_choice,
    name_mistakes,
    part_mistakes,
    range_mistakes,
    shape_mistakes,
)

MOST_SAMPLES = 100_000
"""The most values at which an output's range is looked at."""

MOST_LEVELS = 100
"""The deepest nesting of conditions and formulas."""


class Trapezoid(Value, frozen=True, tag="trapezoid"):
    """Rises from `a` to `b`, is 1 on the closed plateau `b <= x <= c`, falls to `d`.

    A triangle has `b == c`, a rectangle `a == b` and `c == d`. Below `b` the degree is
    `(x - a) / (b - a)`, above `c` it is `(d - x) / (d - c)`; 0 outside `[a, d]`.

    Attributes:
        a: Where it leaves 0; None makes it 1 up to `c`.
        b: Where it reaches 1; at least `a`.
        c: Where it leaves 1; at least `b`.
        d: Where it reaches 0; at least `c`; None makes it 1 from `b` on.
    """

    a: float | None
    b: float
    c: float
    d: float | None


class Gaussian(Value, frozen=True, tag="gaussian"):
    """`exp(-(x - mean)^2 / (2 deviation^2))`."""

    mean: float
    deviation: float


class TwoGaussians(Value, frozen=True, tag="two gaussians"):
    """The product of a gaussian below `left` and another one above `right`, else 1.

    Fuzzylite calls it GaussianProduct, MATLAB gauss2mf. The factors are 1 for
    `x >= left` and for `x <= right`.
    """

    left: float
    left_deviation: float
    right: float
    right_deviation: float


class Bell(Value, frozen=True, tag="bell"):
    """`1 / (1 + |(x - center) / width|^(2 slope))`."""

    center: float
    width: float
    slope: float


class Sigmoid(Value, frozen=True, tag="sigmoid"):
    """`1 / (1 + exp(-slope (x - inflection)))`."""

    inflection: float
    slope: float


class SigmoidDifference(Value, frozen=True, tag="sigmoid difference"):
    """The absolute difference of two sigmoids."""

    first: Sigmoid
    second: Sigmoid


class SigmoidProduct(Value, frozen=True, tag="sigmoid product"):
    """The product of two sigmoids."""

    first: Sigmoid
    second: Sigmoid


class SCurve(Value, frozen=True, tag="s"):
    """Two parabolas that rise from 0 at `start` to 1 at `end`; with end < start, falls.

    With `t = (x - start) / (end - start)`: `2 t^2` up to t = 1/2, then
    `1 - 2 (1 - t)^2`; 0 and 1 beyond. MATLAB's smf, and zmf where `end < start`.
    """

    start: float
    end: float


class PiCurve(Value, frozen=True, tag="pi"):
    """An S curve from `a` to `b`, 1 up to `c`, then one that falls to `d`."""

    a: float
    b: float
    c: float
    d: float


class Cosine(Value, frozen=True, tag="cosine"):
    """`(1 + cos(2 pi / width (x - center))) / 2` within half a width, else 0."""

    center: float
    width: float


class Concave(Value, frozen=True, tag="concave"):
    """`(end - inflection) / (2 end - inflection - x)` before `end`, 1 from it on.

    Where `inflection > end` it falls: `(inflection - end) / (inflection - 2 end + x)`
    behind `end`, 1 up to it.
    """

    inflection: float
    end: float


class Spike(Value, frozen=True, tag="spike"):
    """`exp(-|10 / width (x - center)|)`."""

    center: float
    width: float


class Arc(Value, frozen=True, tag="arc"):
    """A quarter of an ellipse that rises from 0 at `start` to 1 at `end`, then 1.

    With `end < start` it falls: 1 up to `end`, 0 from `start` on.
    """

    start: float
    end: float


class SemiEllipse(Value, frozen=True, tag="semi ellipse"):
    """The upper half of an ellipse from `start` to `end`, 0 outside."""

    start: float
    end: float


class Binary(Value, frozen=True, tag="binary"):
    """1 on one side of `start`, `start` included, and 0 on the other."""

    start: float
    is_above: bool = True


class Singleton(Value, frozen=True, tag="singleton"):
    """1 at one value, 0 elsewhere; as a conclusion, the number itself."""

    value: float


class Linear(Value, frozen=True, tag="linear"):
    """A conclusion that is a weighted sum of the inputs, in order, plus an offset.

    Summed from left to right, the offset last. As many weights as the system has
    inputs.
    """

    weights: tuple[float, ...]
    offset: float = 0.0


class Number(Value, frozen=True, tag="number"):
    """A number of a formula."""

    value: float


class Name(Value, frozen=True, tag="name"):
    """A variable of a formula: an input, an output before this one, or `x` itself.

    `x` is the value whose degree is asked for; in a weighted conclusion it is the
    conclusion's degree. A term of an input may name inputs only.
    """

    name: str


class Call(Value, frozen=True, tag="call"):
    """An operation or a function of a formula, such as `+`, `^`, `sqrt` or `max`.

    `FUNCTIONS` lists them, and `fuzzytree.formulas` says what they do.
    """

    function: str
    arguments: tuple[Expression, ...]


Expression = Number | Name | Call

_OF_TWO: tuple[str, ...] = (
    *("+", "-", "*", "/", "%", "^", "and", "or", "lt", "le", "gt", "ge", "eq", "neq"),
    *("min", "max", "atan2", "fmod"),
)
_OF_ONE: tuple[str, ...] = (
    *("negate", "not", "abs", "sqrt", "exp", "log", "log10", "log1p", "floor", "ceil"),
    *("round", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "acosh", "atanh"),
)
FUNCTIONS: Final[Mapping[str, int]] = MappingProxyType(
    {**dict.fromkeys(_OF_TWO, 2), **dict.fromkeys(_OF_ONE, 1)}
)
"""How many arguments each function of a formula takes."""


class Formula(Value, frozen=True, tag="formula"):
    """An arithmetic expression; `x` is the value whose degree is asked for."""

    expression: Expression


Curve = (
    Band
    | LR
    | Points
    | Trapezoid
    | Gaussian
    | TwoGaussians
    | Bell
    | Sigmoid
    | SigmoidDifference
    | SigmoidProduct
    | SCurve
    | PiCurve
    | Cosine
    | Concave
    | Spike
    | Arc
    | SemiEllipse
    | Binary
    | Singleton
    | Linear
    | Formula
)


class Label(Value, frozen=True):
    """A term of a system's variable.

    Attributes:
        name: Unique within its variable.
        curve: The degree at each value.
        height: What the degree is multiplied by; above 0, at most 1.
    """

    name: str
    curve: Curve
    height: float = 1.0


TNorm = Literal[
    "minimum",
    "product",
    "bounded difference",
    "drastic product",
    "einstein product",
    "hamacher product",
    "nilpotent minimum",
]
"""An AND. With a and b: min; a b; max(0, a + b - 1); min(a, b) if max(a, b) = 1, else
0; a b / (2 - (a + b - a b)); a b / (a + b - a b), 0 if both are 0; min(a, b) if
a + b > 1, else 0."""

SNorm = Literal[
    "maximum",
    "algebraic sum",
    "bounded sum",
    "drastic sum",
    "einstein sum",
    "hamacher sum",
    "nilpotent maximum",
    "normalized sum",
    "sum",
]
"""An OR. With a and b: max; a + b - a b; min(1, a + b); max(a, b) if min(a, b) = 0,
else 1; (a + b) / (1 + a b); (a + b - 2 a b) / (1 - a b), 1 if a b = 1; max(a, b) if
a + b < 1, else 1; (a + b) / max(1, a + b); a + b."""

Hedge = Literal[
    "any",
    "not",
    "very",
    "somewhat",
    "extremely",
    "seldom",
    "cubed",
    "very very",
    "plus",
    "minus",
    "cube root",
]
"""What is done to a degree d: 1; 1 - d; d d; sqrt(d); 2 d d up to 1/2, then
1 - 2 (1 - d)(1 - d); sqrt(d / 2) up to 1/2, then 1 - sqrt((1 - d) / 2); d d d;
(d d)(d d); d^1.25; d^0.75; d^(1/3)."""


class Is(Value, frozen=True, tag="is"):
    """`variable is hedge ... label`; of an output, how far it was concluded so far.

    Attributes:
        variable: An input or an output.
        label: One of its labels; None only behind the hedge `any`.
        hedges: As they are read, from left to right; the last is applied first.
    """

    variable: str
    label: str | None
    hedges: tuple[Hedge, ...] = ()


class And(Value, frozen=True, tag="and"):
    """Conditions joined by the block's conjunction, from left to right."""

    parts: tuple[Condition, ...]


class Or(Value, frozen=True, tag="or"):
    """Conditions joined by the block's disjunction, from left to right."""

    parts: tuple[Condition, ...]


class Not(Value, frozen=True, tag="not"):
    """1 minus the degree of a condition."""

    part: Condition


Condition = Is | And | Or | Not


class Conclusion(Value, frozen=True):
    """`output is hedge ... label`; hedges change the degree of activation.

    They act on the conclusions of the rule that stand behind it too, as in fuzzylite:
    of `a is very high and b is low` both get the square of the rule's degree.
    """

    output: str
    label: str
    hedges: tuple[Hedge, ...] = ()


class SystemRule(Value, frozen=True):
    """IF a condition holds THEN some conclusions are activated.

    Attributes:
        when: The condition; None holds always. It may ask an output: of a label of it
            the degrees concluded so far, joined by the output's aggregation (summed if
            None), by earlier blocks, and by rules of this block that were run before,
            unless its activation must know all degrees first (`highest`, `lowest`,
            `proportional`).
        then: The conclusions.
        weight: What the degree of the condition is multiplied by, in [0, 1].
        name: For people; may be empty.
    """

    when: Condition | None
    then: tuple[Conclusion, ...]
    weight: float = 1.0
    name: str = ""


ActivationMethod = Literal[
    "general", "first", "last", "highest", "lowest", "proportional", "threshold"
]
Relation = Literal["<", "<=", "==", "!=", ">=", ">"]


class Activation(Value, frozen=True):
    """Which of a block's rules are activated, of those whose degree is above 0.

    Attributes:
        method: `general`: all. `first`, `last`: at most `count` of them in the order of
            the rules or against it, whose degree is at least `threshold`; the block is
            run in that order. `highest`,
            `lowest`: at most `count` of them by degree, the first of equals first.
            `proportional`: all, each degree divided by their sum. `threshold`: those
            whose degree stands in `relation` to `threshold`.
        count: How many.
        threshold: A degree.
        relation: How a degree must compare with the threshold.
    """

    method: ActivationMethod = "general"
    count: int = 1
    threshold: float = 0.0
    relation: Relation = ">="


class RuleBlock(Value, frozen=True):
    """Rules with the operators that they share; blocks are run in order.

    Attributes:
        rules: The rules, in order.
        conjunction: The AND; None where no rule needs one.
        disjunction: The OR; None where no rule needs one.
        implication: How an activated rule limits its conclusion's curve; None where the
            outputs are weighted numbers.
        activation: Which rules are activated.
        name: For people; may be empty.
    """

    rules: tuple[SystemRule, ...]
    conjunction: TNorm | None = "minimum"
    disjunction: SNorm | None = "maximum"
    implication: TNorm | None = None
    activation: Activation = Activation()
    name: str = ""


DefuzzifierMethod = Literal[
    "centroid",
    "bisector",
    "smallest of maximum",
    "largest of maximum",
    "mean of maximum",
    "weighted average",
    "weighted sum",
]
Grid = Literal["middle", "ends", "half ends"]


class Defuzzifier(Value, frozen=True):
    """How an output's activated conclusions become a number.

    `centroid`, `bisector`, `smallest of maximum`, `largest of maximum` and `mean of
    maximum` look at the aggregated curve at `samples` values of the output's range.
    `weighted average` and `weighted sum` weight each conclusion's number with its
    degree of activation: a singleton's, a linear one's or a formula's own; for a
    monotone curve the value whose degree is the activation's (after Tsukamoto, see
    `fuzzytree.inference.value_at`); for any other the curve's degree at the activation.

    Attributes:
        method: The method.
        samples: At how many values; of no meaning for weighted ones.
        grid: `middle`: in the middle of as many equal pieces of the range. `ends`: the
            first at its low end and the last at its high end. `half ends`: like
            `ends`, and the first and the last count half in areas (the trapezoidal
            rule); of no other meaning for maxima.
    """

    method: DefuzzifierMethod
    samples: int = 100
    grid: Grid = "middle"

    @property
    def is_weighted(self) -> bool:
        """Whether conclusions are weighted numbers, and no curve is looked at."""
        return self.method.startswith("weighted")


class SystemInput(Value, frozen=True):
    """A column of numbers, or a combination of columns.

    Attributes:
        name: Unique among inputs and outputs.
        labels: Its terms.
        low: The low end of its range, if known and finite.
        high: The high end.
        clips: Whether values are first moved into the range, of which one end may be
            open.
        unit: For people.
        parts: Empty for a column; the summands of a combination, as in
            `fuzzytree.rulebase.Variable`, of inputs that stand before it.
    """

    name: str
    labels: tuple[Label, ...] = ()
    low: float | None = None
    high: float | None = None
    clips: bool = False
    unit: str = ""
    parts: tuple[Part, ...] = ()


class SystemOutput(Value, frozen=True):
    """A number that the system computes.

    Attributes:
        name: Unique among inputs and outputs.
        labels: Its terms.
        low: The low end of its range; needed where a curve is looked at.
        high: The high end.
        defuzzifier: How it becomes a number.
        aggregation: How conclusions of it are joined. Curves need one. Weighted numbers
            are summed one by one if None; otherwise the activations of each label are
            joined by it first.
        default: The answer where it has no number of its own: no rule concludes it, its
            curve has no area, or a formula no value. None answers NaN.
        clips: Whether the answer is moved into the range, the default too.
        unit: For people.
    """

    name: str
    labels: tuple[Label, ...]
    low: float | None
    high: float | None
    defuzzifier: Defuzzifier
    aggregation: SNorm | None = None
    default: float | None = None
    clips: bool = False
    unit: str = ""


class FuzzySystem(Value, frozen=True):
    """Inputs, outputs, and blocks of rules between them.

    A value that is missing or not finite makes every output NaN.

    Attributes:
        name: For people and files.
        inputs: The inputs; combinations stand after their columns.
        outputs: The outputs.
        blocks: Run in order; an output may be asked about after it was concluded.
        note: For people.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    inputs: tuple[SystemInput, ...]
    outputs: tuple[SystemOutput, ...]
    blocks: tuple[RuleBlock, ...]
    note: str = ""

    def __post_init__(self) -> None:
        """Refuse a system that contradicts itself."""
        mistakes = list(_system_mistakes(self))
        if mistakes:
            raise InvalidModelError(mistakes)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns that the system needs, in order."""
        return tuple(one.name for one in self.inputs if not one.parts)

    @property
    def variables(self) -> tuple[SystemInput | SystemOutput, ...]:
        """The inputs, then the outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def rules(self) -> tuple[SystemRule, ...]:
        """The rules of all blocks, in order."""
        return tuple(rule for block in self.blocks for rule in block.rules)


def questions(condition: Condition | None) -> Iterator[Is]:
    """Yield what a condition asks, from left to right."""
    match condition:
        case Is():
            yield condition
        case And(parts=parts) | Or(parts=parts):
            for part in parts:
                yield from questions(part)
        case Not(part=part):
            yield from questions(part)
        case None:
            return


def names_in(expression: Expression) -> Iterator[str]:
    """Yield the names that a formula uses, from left to right."""
    match expression:
        case Name(name=name):
            yield name
        case Call(arguments=arguments):
            for argument in arguments:
                yield from names_in(argument)
        case Number():
            return


def _system_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    if not system.name:
        yield ("name",), "a system needs a name"
    yield from name_mistakes(("name",), "name", [system.name])
    if not system.outputs:
        yield ("outputs",), "a system needs at least one output"
    yield from _variable_name_mistakes(system)
    known: dict[str, bool] = {}
    nameable = dict.fromkeys(one.name for one in system.inputs)
    count = len(system.columns)
    for position, one in enumerate(system.inputs):
        path: Path = ("inputs", position)
        yield from range_mistakes(path, one.name, one.low, one.high)
        yield from part_mistakes(path, one.name, one.parts, known)
        yield from _label_mistakes(path, one, count, nameable)
        if one.clips and one.low is None and one.high is None:
            yield path, f"input {one.name!r} is clipped to a range that it lacks"
        known[one.name] = bool(one.parts)
    for position, output in enumerate(system.outputs):
        path = ("outputs", position)
        yield from range_mistakes(path, output.name, output.low, output.high)
        yield from _label_mistakes(path, output, count, nameable)
        nameable[output.name] = None
        yield from _defuzzifier_mistakes(path, output)
    yield from _rule_mistakes(system)


def _variable_name_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    """Yield what is wrong with the names of variables; no two of them are equal."""
    places: list[Path] = [
        *(("inputs", position) for position in range(len(system.inputs))),
        *(("outputs", position) for position in range(len(system.outputs))),
    ]
    names = [one.name for one in system.variables]
    for path, text in name_mistakes((), "variable", names):
        yield places[int(path[-1])], text
    for place, name in zip(places, names, strict=True):
        if not name:
            yield (*place, "name"), "a variable needs a name"


def _label_mistakes(
    path: Path,
    variable: SystemInput | SystemOutput,
    columns: int,
    nameable: Mapping[str, None],
) -> Iterator[Mistake]:
    """Yield what is wrong with terms, whose formulas may use some names."""
    labels = variable.labels
    where = f"term of {variable.name!r}"
    yield from name_mistakes((*path, "labels"), where, [one.name for one in labels])
    is_weighted = (
        isinstance(variable, SystemOutput) and variable.defuzzifier.is_weighted
    )
    for index, label in enumerate(labels):
        place = (*path, "labels", index)
        if not label.name:
            yield place, f"a term of {variable.name!r} has no name"
        where = f"term {label.name!r} of {variable.name!r}"
        if not 0.0 < label.height <= 1.0:
            yield place, f"{where}: the height must lie in (0, 1], not {label.height!r}"
        texts = [*curve_mistakes(label.curve)]
        match label.curve:
            case Linear(weights=weights):
                count = len(weights)
                if count != columns:
                    text = f"it needs a weight for each column: {columns}, not {count}"
                    texts.append(text)
                if not is_weighted:
                    text = "only a weighted average or sum takes a linear term"
                    texts.append(text)
            case Formula(expression=expression) if not texts:
                texts += _name_mistakes(expression, nameable)
            case _:
                pass
        for text in texts:
            yield place, f"{where}: {text}"


def _name_mistakes(expression: Expression, names: Mapping[str, None]) -> Iterator[str]:
    for name in dict.fromkeys(names_in(expression)):
        if name == "x" and name in names:
            yield "'x' is a variable, and in a formula it is the value itself"
        elif name != "x" and name not in names:
            yield f"no variable {name!r}; {name_choice(name, names)}"


def curve_mistakes(curve: Curve) -> Iterator[str]:
    """Yield what is wrong with a curve, without saying whose it is."""
    match curve:
        case Band() | LR() | Points():
            yield from shape_mistakes(curve)
        case Trapezoid(a=a, b=b, c=c, d=d):
            corners = [corner for corner in (a, b, c, d) if corner is not None]
            shown = ", ".join(map(repr, corners))
            if not all(map(math.isfinite, corners)) or corners != sorted(corners):
                yield f"the corners must be finite and rise: {shown}"
            elif not math.isfinite(corners[-1] - corners[0]):
                yield f"the corners are too far apart: {shown}"
        case (
            SigmoidDifference(first=first, second=second)
            | SigmoidProduct(first=first, second=second)
        ):
            yield from curve_mistakes(first)
            yield from curve_mistakes(second)
        case Linear(weights=weights, offset=offset):
            if not all(map(math.isfinite, (*weights, offset))):
                yield "the weights and the offset must be finite"
        case Formula(expression=expression):
            if _depth(expression) > MOST_LEVELS:
                yield f"the formula is nested deeper than {MOST_LEVELS} levels"
            else:
                yield from _formula_mistakes(expression)
        case _:
            yield from _number_mistakes(curve)


def _formula_mistakes(expression: Expression) -> Iterator[str]:
    match expression:
        case Number(value=value) if not math.isfinite(value):
            yield f"the numbers of a formula must be finite, not {value!r}"
        case Call(function=function, arguments=arguments):
            needed = FUNCTIONS.get(function)
            if needed is None:
                yield f"no function {function!r}; {name_choice(function, FUNCTIONS)}"
            elif len(arguments) != needed:
                yield f"{function!r} takes {needed} arguments, not {len(arguments)}"
            for argument in arguments:
                yield from _formula_mistakes(argument)
        case _:
            return


_ABOVE_ZERO = {"deviation", "left_deviation", "right_deviation", "width"}


def _number_mistakes(curve: Curve) -> Iterator[str]:
    for field in curve.__struct_fields__:
        value: float = getattr(curve, field)
        name = field.replace("_", " ")
        if not math.isfinite(value):
            yield f"the {name} must be finite, not {value!r}"
        elif field in _ABOVE_ZERO and value <= 0.0:
            yield f"the {name} must be above 0, not {value!r}"
    match curve:
        case PiCurve(a=a, b=b, c=c, d=d):
            if not a <= b <= c <= d:
                yield f"the corners must rise: {a!r}, {b!r}, {c!r}, {d!r}"
            yield from _width_mistakes(a, d)
        case SCurve(start=start, end=end) | Concave(inflection=start, end=end):
            yield from _width_mistakes(start, end)
        case Arc(start=start, end=end):
            if start == end:
                yield f"an arc must start and end at different values, not at {end!r}"
            yield from _width_mistakes(start, end)
        case SemiEllipse(start=start, end=end):
            if start >= end:
                yield f"the end must lie above the start {start!r}, not at {end!r}"
            yield from _width_mistakes(start, end)
        case _:
            return


def _width_mistakes(start: float, end: float) -> Iterator[str]:
    if math.isfinite(start) and math.isfinite(end) and not math.isfinite(end - start):
        yield f"{start!r} and {end!r} are too far apart"


def _depth(expression: Expression) -> int:
    deepest, todo = 0, [(expression, 1)]
    while todo:
        one, level = todo.pop()
        deepest = max(deepest, level)
        if isinstance(one, Call) and level <= MOST_LEVELS:
            todo += [(argument, level + 1) for argument in one.arguments]
    return deepest


def _defuzzifier_mistakes(path: Path, output: SystemOutput) -> Iterator[Mistake]:
    how = output.defuzzifier
    if output.default is not None and not math.isfinite(output.default):
        yield (*path, "default"), f"the default of {output.name!r} must be finite"
    if output.clips and output.low is None and output.high is None:
        yield path, f"output {output.name!r} is clipped to a range that it lacks"
    if how.is_weighted:
        if not 1 <= how.samples <= MOST_SAMPLES:
            yield path, f"output {output.name!r}: {how.samples} samples"
        return
    if output.low is None or output.high is None or output.low >= output.high:
        yield path, f"output {output.name!r} needs a range for its {how.method}"
    else:
        yield from ((path, text) for text in _width_mistakes(output.low, output.high))
    if output.aggregation is None:
        yield path, f"output {output.name!r} needs an aggregation for its {how.method}"
    if not 2 <= how.samples <= MOST_SAMPLES:
        yield (
            path,
            f"output {output.name!r}: {how.samples} samples; "
            f"there must be 2 to {MOST_SAMPLES}",
        )


Terms = Mapping[str, Mapping[str, None]]


def _rule_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    terms: Terms = {
        one.name: dict.fromkeys(label.name for label in one.labels)
        for one in system.variables
    }
    outputs = {one.name: one for one in system.outputs}
    concludable: Terms = {name: terms[name] for name in outputs}
    for position, block in enumerate(system.blocks):
        path: Path = ("blocks", position)
        yield from _activation_mistakes((*path, "activation"), block.activation)
        of_block = f" of block {position + 1}" if len(system.blocks) > 1 else ""
        for index, rule in enumerate(block.rules):
            where = f"rule {index + 1}{of_block}"
            place = (*path, "rules", index)
            for text in _condition_mistakes(rule.when, block, terms):
                yield (*place, "when"), f"{where}: {text}"
            for text in _conclusion_mistakes(rule.then, block, outputs, concludable):
                yield (*place, "then"), f"{where}: {text}"
            if not 0.0 <= rule.weight <= 1.0:
                text = f"the weight must lie in [0, 1], not {rule.weight!r}"
                yield (*place, "weight"), f"{where}: {text}"


def _activation_mistakes(path: Path, how: Activation) -> Iterator[Mistake]:
    if how.count < 1:
        yield path, f"at least 1 rule is activated, not {how.count}"
    if not 0.0 <= how.threshold <= 1.0:
        yield path, f"the threshold must lie in [0, 1], not {how.threshold!r}"


def _condition_mistakes(
    condition: Condition | None, block: RuleBlock, terms: Terms
) -> Iterator[str]:
    if _levels(condition) > MOST_LEVELS:
        yield f"nested deeper than {MOST_LEVELS} levels"
        return
    if _is_empty(condition):
        yield "it joins no conditions at all"
    for asked in questions(condition):
        if asked.label is not None or asked.variable not in terms:
            yield from _reference_mistakes(asked.variable, asked.label, terms)
        elif not asked.hedges or asked.hedges[-1] != "any":
            yield f"{asked.variable!r} is asked without a term"
    if block.conjunction is None and _uses(condition, And):
        yield "it needs a conjunction, and its block has none"
    if block.disjunction is None and _uses(condition, Or):
        yield "it needs a disjunction, and its block has none"


def _conclusion_mistakes(
    then: tuple[Conclusion, ...],
    block: RuleBlock,
    outputs: Mapping[str, SystemOutput],
    terms: Terms,
) -> Iterator[str]:
    if not then:
        yield "it concludes nothing"
    for one in then:
        yield from _reference_mistakes(one.output, one.label, terms)
        output = outputs.get(one.output)
        is_curve = output is not None and not output.defuzzifier.is_weighted
        if is_curve and block.implication is None:
            yield f"{one.output!r} needs an implication in its block"


def _reference_mistakes(
    variable: str, label: str | None, terms: Terms
) -> Iterator[str]:
    if variable not in terms:
        yield f"no variable {variable!r}; {name_choice(variable, terms)}"
    elif label is not None and label not in terms[variable]:
        choice = name_choice(label, terms[variable])
        yield f"{variable!r} has no term {label!r}; {choice}"


def _is_empty(condition: Condition | None) -> bool:
    """Return whether a condition joins nothing anywhere."""
    if isinstance(condition, And | Or) and not condition.parts:
        return True
    return any(map(_is_empty, _parts(condition)))


def _levels(condition: Condition | None) -> int:
    deepest, todo = 0, [(condition, 1)]
    while todo:
        one, level = todo.pop()
        deepest = max(deepest, level)
        if level <= MOST_LEVELS:
            todo += [(part, level + 1) for part in _parts(one)]
    return deepest


def _parts(condition: Condition | None) -> Iterable[Condition]:
    match condition:
        case And(parts=parts) | Or(parts=parts):
            return parts
        case Not(part=part):
            return (part,)
        case _:
            return ()


def _uses(condition: Condition | None, kind: type[And] | type[Or]) -> bool:
    if isinstance(condition, kind):
        return True
    return any(_uses(part, kind) for part in _parts(condition))

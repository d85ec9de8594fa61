"""A fuzzy inference system as a frozen value: what foreign files hold and rules do not.

Rule bases of ours decide for a class. Systems of others have outputs that are numbers:
rules in blocks conclude terms of outputs, what is concluded is aggregated, and the
result is defuzzified. What a system *means* is computed in
`fuzzytree.semantics.inference`; all that could change an answer stands in the values
below.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from fuzzytree.model.curves import (
    Expression,
    Formula,
    Linear,
    Singleton,
    Trapezoid,
    names_in,
    width_mistakes,
)
from fuzzytree.model.mistakes import (
    Mistake,
    Path,
    name_choice,
    name_mistakes,
    refuse,
    text_fault,
)
from fuzzytree.model.nodes import Leaf, Node, Sets
from fuzzytree.model.norms import SNorm
from fuzzytree.model.rulebase import Semantics
from fuzzytree.model.rules import (
    Conclusion,
    RuleBlock,
    SystemRule,
    Terms,
    activation_mistakes,
    condition_mistakes,
    reference_mistakes,
)
from fuzzytree.model.values import AnyModel, ModelKind, Value, summary
from fuzzytree.model.variables import (
    Part,
    Term,
    Variable,
    input_mistakes,
    range_mistakes,
    term_mistakes,
    unit_mistakes,
)

MOST_SAMPLES = 100_000
"""The most values at which an output's range is looked at."""


DefuzzifierMethod = Literal[
    "centroid",
    "bisector",
    "smallest of maximum",
    "largest of maximum",
    "mean of maximum",
    "weighted average",
    "weighted sum",
]
Grid = Literal["middle", "low ends", "ends", "half ends", "lines"]


class Defuzzifier(Value, frozen=True):
    """How an output's activated conclusions become a number.

    `centroid`, `bisector`, `smallest of maximum`, `largest of maximum` and `mean of
    maximum` look at the aggregated curve at `samples` values of the output's range, and
    at the value of each singleton (`sampled_values`).
    `weighted average` and `weighted sum` weight each conclusion's number with its
    degree of activation: a singleton's, a linear one's or a formula's own; for a
    monotone curve the value whose degree is the activation's (after Tsukamoto, see
    `fuzzytree.semantics.inference.value_at`); for any other the curve's degree at the
    activation.

    Attributes:
        method: The method.
        samples: At how many values; of no meaning for weighted ones.
        grid: `middle`: in the middle of as many equal pieces of the range. `low ends`:
            at the low end of each piece (as in jFuzzyLogic). `ends`: the first at the
            range's low end and the last at its high end. `half ends`: like
            `ends`, and the first and the last count half in areas (the trapezoidal
            rule); of no other meaning for maxima. `lines`: like `ends`, and between
            neighbours each label's curve is a line; the aggregated curve joins its
            values there, and where a label's line meets the label's degree, by lines
            too, and the centroid is that of the area below them (as in scikit-fuzzy).
            It needs `centroid`, `maximum` as aggregation and `minimum` as implication.
    """

    method: DefuzzifierMethod
    samples: int = 100
    grid: Grid = "middle"

    @property
    def is_weighted(self) -> bool:
        """Whether conclusions are weighted numbers, and no curve is looked at."""
        return self.method.startswith("weighted")


def sampled_values(output: SystemOutput) -> list[float]:
    """Return the values at which an output's curve is sampled.

    `middle`: low + (k + 1/2) step with step = (high - low) / n. `low ends`: low + k
    step. `ends` and `half ends`: low + k step with step = (high - low) / (n - 1), and
    `high` itself as the last.

    The value of a singleton is a sample as well; no other value could show it. Where
    all terms are singletons, with two or more values, these are the only samples.

    Example:
        >>> how = Defuzzifier("centroid", samples=4)
        >>> output = SystemOutput("o", (), 0.0, 2.0, how, "maximum")
        >>> sampled_values(output)
        [0.25, 0.75, 1.25, 1.75]
        >>> from msgspec.structs import replace
        >>> terms = (Term("a", Singleton(0.3)), Term("b", Singleton(1.7)))
        >>> sampled_values(replace(output, terms=terms))
        [0.3, 1.7]
    """
    curves = [label.function for label in output.terms]
    singles = {one.value for one in curves if isinstance(one, Singleton)}
    if len(singles) > 1 and all(isinstance(one, Singleton) for one in curves):
        return sorted(singles)
    low, high = output.low or 0.0, output.high or 0.0
    count = output.defuzzifier.samples
    if output.defuzzifier.grid in ("middle", "low ends"):
        step = (high - low) / count
        shift = 0.5 if output.defuzzifier.grid == "middle" else 0.0
        values = [low + (k + shift) * step for k in range(count)]
    else:
        step = (high - low) / (count - 1)
        values = [*(low + k * step for k in range(count - 1)), high]
    return sorted({*values, *singles}) if singles else values


class SystemOutput(Value, frozen=True):
    """A number that the system computes.

    Attributes:
        name: Unique among inputs and outputs.
        terms: Its terms.
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
    terms: tuple[Term, ...]
    low: float | None
    high: float | None
    defuzzifier: Defuzzifier
    aggregation: SNorm | None = None
    default: float | None = None
    clips: bool = False
    unit: str = ""

    parts: ClassVar[tuple[Part, ...]] = ()  # it is no sum of inputs
    categories: ClassVar[tuple[str, ...]] = ()


class FuzzySystem(AnyModel, frozen=True):
    """Inputs, outputs, and blocks of rules between them.

    A value that is missing or not finite makes every output NaN.

    Attributes:
        name: For people and files.
        variables: Inputs and combinations; a combination stands after its inputs.
        outputs: The outputs.
        blocks: Run in order; conditions may use an output after it was concluded.
        note: For people.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    variables: tuple[Variable, ...]
    outputs: tuple[SystemOutput, ...]
    blocks: tuple[RuleBlock, ...]
    note: str = ""

    representation: ClassVar[ModelKind] = "system"
    classes: ClassVar[tuple[str, ...]] = ()  # its answers are numbers
    rule_labels: ClassVar[tuple[str, ...]] = ()
    columns: ClassVar[tuple[str, ...]] = ()  # it is learnt from no table
    kind: ClassVar[None] = None
    nodes: ClassVar[tuple[Node, ...]] = ()
    leaves: ClassVar[tuple[Leaf, ...]] = ()
    sets: ClassVar[tuple[Sets, ...]] = ()
    semantics: ClassVar[Semantics] = Semantics()  # no class, whatever is missing

    def __post_init__(self) -> None:
        """Refuse a system that contradicts itself."""
        refuse(_system_mistakes(self))

    @property
    def all_variables(self) -> tuple[Variable | SystemOutput, ...]:
        """The inputs and combinations, then the outputs."""
        return (*self.variables, *self.outputs)

    @property
    def rules(self) -> tuple[SystemRule, ...]:
        """The rules of all blocks, in order."""
        return tuple(rule for block in self.blocks for rule in block.rules)

    def rule_path(self, number: int) -> Path:
        """Return where the rule of a number, from 1 over all blocks, stands."""
        for position, block in enumerate(self.blocks):
            if number <= len(block.rules):
                return ("blocks", position, "rules", number - 1)
            number -= len(block.rules)
        return ("blocks",)

    def __repr__(self) -> str:
        """Show how much it holds."""
        return summary(
            "FuzzySystem",
            rules=len(self.rules),
            inputs=len(self.inputs),
            outputs=len(self.outputs),
        )


def _system_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    if not system.name:
        yield ("name",), "a system needs a name"
    yield from name_mistakes(("name",), "name", [system.name])
    fault = text_fault(re.sub(r"[\n\r\t]", " ", system.note))
    if fault:
        yield ("note",), f"the note {fault}"
    if not system.outputs:
        yield ("outputs",), "a system needs at least one output"
    if not system.rules:
        yield ("blocks",), "a system needs at least one rule"
    yield from _variable_name_mistakes(system)
    known: dict[str, bool] = {}
    nameable = dict.fromkeys(one.name for one in system.variables)
    count = len(system.inputs)
    for position, one in enumerate(system.variables):
        path: Path = ("variables", position)
        yield from input_mistakes(path, one, known)
        yield from _term_mistakes(path, one, count, nameable)
        if one.categories or one.missing is not None or one.is_whole:
            text = (
                "only rule bases and trees have categories, stand-ins and whole numbers"
            )
            yield path, f"{text}, such as those of {one.name!r}"
        if one.clips and one.low is None and one.high is None:
            yield path, f"input {one.name!r} is clipped to a range that it lacks"
    for position, output in enumerate(system.outputs):
        path = ("outputs", position)
        yield from unit_mistakes(path, output.name, output.unit)
        yield from range_mistakes(path, output.name, output.low, output.high)
        yield from term_mistakes(path, output.name, output.terms)
        yield from _term_mistakes(path, output, count, nameable)
        nameable[output.name] = None
        yield from _defuzzifier_mistakes(path, output)
    yield from _rule_mistakes(system)
    for position, output in enumerate(system.outputs):
        if not any(_defuzzifier_mistakes((), output)):
            yield from _width_mistakes(("outputs", position), output, system)


def _variable_name_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    """Yield what is wrong with the names of variables; no two of them are equal."""
    places: list[Path] = [
        *(("variables", position) for position in range(len(system.variables))),
        *(("outputs", position) for position in range(len(system.outputs))),
    ]
    names = [one.name for one in system.all_variables]
    for path, text in name_mistakes((), "variable", names):
        yield places[int(path[-1])], text
    for place, name in zip(places, names, strict=True):
        if not name:
            yield (*place, "name"), "a variable needs a name"


def _term_mistakes(
    path: Path,
    variable: Variable | SystemOutput,
    columns: int,
    nameable: Mapping[str, None],
) -> Iterator[Mistake]:
    """Yield what is wrong with linear terms and formulas, which may use some names."""
    is_weighted = (
        isinstance(variable, SystemOutput) and variable.defuzzifier.is_weighted
    )
    for index, term in enumerate(variable.terms):
        texts: list[str] = []
        match term.function:
            case Linear(weights=weights):
                count = len(weights)
                if count != columns:
                    text = f"it needs a weight for each column: {columns}, not {count}"
                    texts.append(text)
                if not is_weighted:
                    text = "only a weighted average or sum takes a linear term"
                    texts.append(text)
            case Formula(expression=expression) if not any(term.function.mistakes()):
                texts += _name_mistakes(expression, nameable)
                if is_drawn_by_lines(variable):
                    texts.append("the grid 'lines' takes no formula")
            case _:
                pass
        for text in texts:
            where = f"term {term.name!r} of {variable.name!r}"
            yield (*path, "terms", index), f"{where}: {text}"


def is_drawn_by_lines(variable: Variable | SystemOutput) -> bool:
    """Return whether it is an output whose curve consists of lines."""
    return (
        isinstance(variable, SystemOutput)
        and not variable.defuzzifier.is_weighted
        and variable.defuzzifier.grid == "lines"
    )


def _name_mistakes(expression: Expression, names: Mapping[str, None]) -> Iterator[str]:
    for name in dict.fromkeys(names_in(expression)):
        if name == "x" and name in names:
            yield "'x' is a variable, and in a formula it is the value itself"
        elif name != "x" and name not in names:
            yield f"no variable {name!r}; {name_choice(name, names)}"


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
        yield from ((path, text) for text in width_mistakes(output.low, output.high))
    if output.aggregation is None:
        yield path, f"output {output.name!r} needs an aggregation for its {how.method}"
    if how.grid == "lines" and (how.method, output.aggregation) != (
        "centroid",
        "maximum",
    ):
        yield (
            path,
            f"output {output.name!r}: the grid 'lines' needs the centroid and the "
            "aggregation maximum",
        )
    if not 2 <= how.samples <= MOST_SAMPLES:
        yield (
            path,
            f"output {output.name!r}: {how.samples} samples; "
            f"there must be 2 to {MOST_SAMPLES}",
        )
    for label in output.terms:
        if isinstance(label.function, Singleton) and (
            how.method == "bisector" or how.grid in ("half ends", "lines")
        ):
            what = how.method if how.method == "bisector" else f"grid {how.grid}"
            yield (
                path,
                (
                    f"output {output.name!r}: the {what} measures an area, and the "
                    f"singleton {label.name!r} has none"
                ),
            )
            return


def _width_mistakes(
    path: Path, output: SystemOutput, system: FuzzySystem
) -> Iterator[Mistake]:
    """Yield the terms without width that rules conclude and that no sample shows."""
    thin = {
        label.name: (index, label.function.b)
        for index, label in enumerate(output.terms)
        if isinstance(label.function, Trapezoid)
        and label.function.a == label.function.b == label.function.d
    }
    if not thin or output.defuzzifier.is_weighted:
        return
    samples = sampled_values(output)
    then = [one for rule in system.rules for one in rule.then]
    concluded = {one.term for one in then if one.output == output.name}
    for name, (index, value) in thin.items():
        if name in concluded and value not in samples:
            yield (
                (*path, "terms", index),
                (
                    f"term {name!r} of {output.name!r} has no width, and none of the "
                    f"{len(samples)} values at which the range is sampled is "
                    f"{value!r}; rules that conclude it would change nothing"
                ),
            )


def _rule_mistakes(system: FuzzySystem) -> Iterator[Mistake]:
    terms: Terms = {
        one.name: dict.fromkeys(label.name for label in one.terms)
        for one in system.all_variables
    }
    outputs = {one.name: one for one in system.outputs}
    concludable: Terms = {name: terms[name] for name in outputs}
    for position, block in enumerate(system.blocks):
        path: Path = ("blocks", position)
        yield from name_mistakes((*path, "name"), "block", [block.name])
        yield from activation_mistakes((*path, "activation"), block.activation)
        of_block = f" of block {position + 1}" if len(system.blocks) > 1 else ""
        for index, rule in enumerate(block.rules):
            where = f"rule {index + 1}{of_block}"
            place = (*path, "rules", index)
            yield from name_mistakes((*place, "name"), "rule", [rule.name])
            for text in condition_mistakes(rule.when, block, terms):
                yield (*place, "when"), f"{where}: {text}"
            for text in _conclusion_mistakes(rule.then, block, outputs, concludable):
                yield (*place, "then"), f"{where}: {text}"
            if not 0.0 <= rule.weight <= 1.0:
                text = f"the weight must lie in [0, 1], not {rule.weight!r}"
                yield (*place, "weight"), f"{where}: {text}"


def _conclusion_mistakes(
    then: tuple[Conclusion, ...],
    block: RuleBlock,
    outputs: Mapping[str, SystemOutput],
    terms: Terms,
) -> Iterator[str]:
    if not then:
        yield "it concludes nothing"
    for one in then:
        yield from reference_mistakes(one.output, one.term, terms)
        output = outputs.get(one.output)
        is_curve = output is not None and not output.defuzzifier.is_weighted
        if is_curve and block.implication is None:
            yield f"{one.output!r} needs an implication in its block"
        if output and is_drawn_by_lines(output) and block.implication != "minimum":
            yield f"{one.output!r}, by 'lines', needs the implication minimum"

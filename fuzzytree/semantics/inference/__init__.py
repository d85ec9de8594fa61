"""The meaning of a fuzzy system, written to be believed and not to be fast.

One row at a time, in plain Python floats (IEEE 754 double), without an array library.
Each operation below is one rounding; every other runtime that promises equal bits
performs the same operations in the same order. Only `exp`, `cos`, `log`, powers and the
functions of formulas are the C library's, good to a few units in the last place.

Nothing here fails: what has no value is NaN, which no comparison holds for, and which
`minimum`, `maximum` and all arithmetic pass on. `docs/reference/systems.md` says the
same in words and formulas.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import cast

import msgspec

from fuzzytree.model import (
    FUNCTIONS,
    Activation,
    And,
    Conclusion,
    Condition,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Linear,
    Not,
    Or,
    Proposition,
    RuleBase,
    RuleBlock,
    Singleton,
    SNorm,
    SystemOutput,
    Term,
    TNorm,
    Variable,
    is_drawn_by_lines,
    sampled_values,
)
from fuzzytree.semantics.inference.degrees import (
    curve_degree,
    hedged,
    s_norm,
    t_norm,
    value_at,
    value_of,
)
from fuzzytree.semantics.programs.activations import passes
from fuzzytree.semantics.programs.operations import DOUBLES, divide, maximum, total
from fuzzytree.semantics.reference import Answer, Status, descend, evaluate

__all__ = [
    "FUNCTIONS",
    "Consequent",
    "answer_of",
    "consequents",
    "curve_degree",
    "hedged",
    "infer",
    "s_norm",
    "t_norm",
    "unsampled_terms",
    "value_at",
    "value_of",
]


def infer(system: FuzzySystem, row: Mapping[str, float]) -> Answer:
    """Run every block on one row, then defuzzify every output.

    Returns:
        The outputs, and as strengths the activation of each rule of all blocks: the
        degree of its condition times its weight (divided by the block's sum where the
        method is `proportional`) if it was activated, else 0. UNCOVERED if an output
        has no number of its own and its default (or NaN) answers; MISSING if a value
        of the row, or a combination of values, is not finite: then all is NaN.

    Raises:
        KeyError: If a column has no value.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> from fuzzytree.model import Defuzzifier, SystemRule
        >>> dirty = Term("dirty", Points((0.0, 10.0), (0.0, 1.0)))
        >>> long = Term("long", Singleton(60.0))
        >>> system = FuzzySystem(
        ...     "washer", (Variable("dirt", (dirty,)),),
        ...     (SystemOutput("time", (long,), None, None,
        ...                   Defuzzifier("weighted sum")),),
        ...     (RuleBlock((SystemRule(Proposition("dirt", ("dirty",)),
        ...                            (Conclusion("time", "long"),)),)),),
        ... )
        >>> infer(system, {"dirt": 5.0}).outputs
        (30.0,)
    """
    values = input_values(system.variables, row)
    count = len(system.rules)
    if not all(map(math.isfinite, values.values())):
        nothing = (math.nan,) * len(system.outputs)
        return Answer(0, None, Status.MISSING, (math.nan,) * count, nothing)
    run = _Run(system, values)
    for block in system.blocks:
        run.activate(block)
    numbers: list[float] = []
    for output in system.outputs:
        numbers.append(run.number(output))
        values[output.name] = answer(output, numbers[-1])
    status = Status.UNCOVERED if any(map(math.isnan, numbers)) else Status.DECIDED
    outputs = tuple(values[output.name] for output in system.outputs)
    return Answer(0, None, status, tuple(run.activations), outputs)


class Consequent(msgspec.Struct, frozen=True):
    """What an activated rule says of an output.

    Rules are numbered from 1 over all blocks; `points` are values with the degrees that
    the rule gives them: samples of the curve, or the one number that is weighted.
    """

    rule: int
    term: str
    degree: float
    points: tuple[tuple[float, float], ...]


def consequents(
    model: Document, row: Mapping[str, float]
) -> dict[str, tuple[list[Consequent], list[tuple[float, float]]]]:
    """Return by output what each activated rule concludes, and all of it joined.

    Joined are the samples of an output with their aggregated degrees; weighted numbers
    have none. A column without a value is a KeyError.
    """
    if not model.outputs:
        return {}
    system = cast("FuzzySystem", model)  # nothing else has outputs
    values = input_values(system.variables, row)
    run = _Run(system, values)
    for block in system.blocks:
        run.activate(block)
    numbers = [k for k, rule in enumerate(system.rules, 1) for _ in rule.then]
    result: dict[str, tuple[list[Consequent], list[tuple[float, float]]]] = {}
    for output in system.outputs:
        samples = [] if output.defuzzifier.is_weighted else sampled_values(output)
        own: list[Consequent] = []
        for one in run.of_output(output):
            points = tuple(run.points(output, one, samples))
            rule, term = numbers[one.place], one.conclusion.term
            own.append(Consequent(rule, term, one.degree, points))
        degrees = run.aggregated(output, samples) if samples else []
        joined = zip(samples, degrees, strict=True)
        result[output.name] = own, [*joined]
        values[output.name] = answer(output, run.number(output))
    return result


def answer_of(model: Document, row: Mapping[str, float]) -> Answer:
    """Return what the definition of any model answers to one row.

    Raises:
        KeyError: If an input has no value.

    Example:
        >>> from fuzzytree.testing import random_system, random_tree
        >>> model = random_tree(0)
        >>> answer_of(model, dict.fromkeys(model.inputs, 0.0)).rule > 0
        True
        >>> model = random_system(2)
        >>> len(answer_of(model, dict.fromkeys(model.inputs, 0.0)).outputs)
        2
    """
    match model:
        case FuzzyTree():
            return descend(model, row)
        case RuleBase():
            return evaluate(model, row)
        case FuzzySystem():
            return infer(model, row)


def input_values(
    inputs: Iterable[Variable], row: Mapping[str, float]
) -> dict[str, float]:
    """Return the value of each input, clamped to its range where it clips.

    A combination is `w1 (x1 - c1) + w2 (x2 - c2) + ...` of the values so found, summed
    from left to right. If a value of the row is not finite it is left as it is.
    """
    values: dict[str, float] = {}
    for one in inputs:
        if one.parts:
            terms = [
                part.weight * (values[part.input] - part.centre) for part in one.parts
            ]
            value = _left_to_right(terms)
        else:
            value = float(row[one.name])
        is_clamped = one.clips and math.isfinite(value)
        values[one.name] = _clamped(value, one.low, one.high) if is_clamped else value
    return values


def answer(output: SystemOutput, number: float) -> float:
    """Return what an output answers: its number, its default for NaN, both clipped."""
    if math.isnan(number) and output.default is not None:
        number = output.default
    return _clamped(number, output.low, output.high) if output.clips else number


def _clamped(value: float, low: float | None, high: float | None) -> float:
    """Return a value moved into a range; NaN stays NaN."""
    if low is not None and value < low:
        return low
    if high is not None and value > high:
        return high
    return value


class _Concluded(msgspec.Struct):
    """A conclusion that was activated: its place among all, and its degree."""

    place: int
    conclusion: Conclusion
    degree: float
    implication: TNorm | None


class _Run:
    """One row on its way through the blocks."""

    def __init__(self, system: FuzzySystem, values: Mapping[str, float]) -> None:
        self.values = values
        self.columns = system.inputs
        self.outputs = {one.name: one for one in system.outputs}
        self.labels = {
            (variable.name, label.name): label
            for variable in system.all_variables
            for label in variable.terms
        }
        self.degrees: dict[tuple[str, str], float] = {}
        self.activations: list[float] = []
        self.concluded: dict[str, list[_Concluded]] = {
            name: [] for name in self.outputs
        }
        self.places = itertools.accumulate(
            (len(rule.then) for rule in system.rules), initial=0
        )

    def activate(self, block: RuleBlock) -> None:
        """Compute the rules of a block, and note what the activated ones conclude."""
        how = block.activation
        places = [next(self.places) for _ in block.rules]
        degrees = [0.0] * len(block.rules)
        order = range(len(block.rules))
        if how.method in ("highest", "lowest", "proportional"):
            # Which rules are activated is known when all degrees are.
            results = [self._rule_degree(block, index) for index in order]
            degrees = _chosen(how, results)
            for index in order:
                self._conclude(block, index, places[index], degrees[index])
        else:
            # Each rule sees what those before it concluded.
            count = 0
            for index in reversed(order) if how.method == "last" else order:
                found_degree = self._rule_degree(block, index)
                if found_degree > 0.0 and _passes(how, found_degree, count):
                    count += 1
                    degrees[index] = found_degree
                    self._conclude(block, index, places[index], found_degree)
        self.activations += degrees

    def _rule_degree(self, block: RuleBlock, index: int) -> float:
        rule = block.rules[index]
        degree = 1.0 if rule.when is None else self._degree(rule.when, block)
        return rule.weight * degree

    def _degree(self, condition: Condition, block: RuleBlock) -> float:
        match condition:
            case Proposition():
                return self._proposition(condition)
            case And(parts=parts):
                degrees = [self._degree(part, block) for part in parts]
                return _folded(_and(block.conjunction), degrees)
            case Or(parts=parts):
                degrees = [self._degree(part, block) for part in parts]
                return _folded(_or(block.disjunction), degrees)
            case Not(part=part):
                return 1.0 - self._degree(part, block)

    def _proposition(self, proposition: Proposition) -> float:
        if proposition.term is None:
            degree = math.nan  # the hedge `any` makes 1 of it
        elif proposition.variable in self.outputs:
            degree = self._so_far(self.outputs[proposition.variable], proposition.term)
        else:
            key = proposition.variable, proposition.term  # an input keeps its value
            if key not in self.degrees:
                value = self.values[proposition.variable]
                self.degrees[key] = self._label_degree(*key, value)
            degree = self.degrees[key]
        return hedged(proposition.hedges, degree)

    def _label_degree(self, variable: str, label: str, value: float) -> float:
        result = self.labels[variable, label]
        return result.height * curve_degree(result.function, value, self.values)

    def _so_far(self, output: SystemOutput, label: str) -> float:
        """Return how far a label was concluded: its degrees, aggregated from 0 on."""
        join = _or(output.aggregation or "sum")
        degrees = [
            one.degree for one in self.of_output(output) if one.conclusion.term == label
        ]
        return _folded(join, [0.0, *degrees])

    def of_output(self, output: SystemOutput) -> list[_Concluded]:
        """Return what was concluded of an output, in the order of the rules."""
        return sorted(self.concluded[output.name], key=lambda one: one.place)

    def _conclude(
        self, block: RuleBlock, index: int, place: int, degree: float
    ) -> None:
        """Note what a rule concludes; hedges act on the conclusions behind them too."""
        if not degree > 0.0:
            return
        for offset, one in enumerate(block.rules[index].then):
            degree = hedged(one.hedges, degree)
            if degree > 0.0:
                noted = _Concluded(place + offset, one, degree, block.implication)
                self.concluded[one.output].append(noted)

    def number(self, output: SystemOutput) -> float:
        """Return what an output's conclusions amount to; NaN if to nothing."""
        if output.defuzzifier.is_weighted:
            return self._weighted(output)
        if is_drawn_by_lines(output):
            return self._centroid_of_lines(output)
        xs = sampled_values(output)
        degrees = self.aggregated(output, xs)
        match output.defuzzifier.method:
            case "centroid":
                areas = _areas(output, degrees)
                moments = [x * area for x, area in zip(xs, areas, strict=True)]
                return divide(total(moments), total(areas))
            case "bisector":
                return _bisector(xs, _areas(output, degrees))
            case method:
                return _of_maximum(method, xs, degrees)

    def aggregated(self, output: SystemOutput, xs: Sequence[float]) -> list[float]:
        """Return the degree of the joined conclusions at each value, from 0 on."""
        join = _or(output.aggregation)
        total = [0.0] * len(xs)
        for one in self.of_output(output):
            for position, (_, degree) in enumerate(self.points(output, one, xs)):
                total[position] = join(total[position], degree)
        return total

    def points(
        self, output: SystemOutput, activated: _Concluded, xs: Sequence[float]
    ) -> Iterator[tuple[float, float]]:
        """Yield samples with the degrees of a conclusion, or the number that it has."""
        cut = _and(activated.implication)
        label = self.labels[output.name, activated.conclusion.term]
        if output.defuzzifier.is_weighted:
            yield self._number_of(output, label, activated.degree), activated.degree
            return
        if isinstance(label.function, Formula):
            degrees = [self._label_degree(output.name, label.name, x) for x in xs]
        else:
            degrees = sampled_degrees(output, label)
        for x, degree in zip(xs, degrees, strict=True):
            yield x, cut(activated.degree, degree)

    def _centroid_of_lines(self, output: SystemOutput) -> float:
        """Return the centroid of the area below the lines of the grid `lines`.

        In a piece, `share` is 0 at its left end and 1 at its right end. Both sums are
        twice what they are called.
        """
        known = {one.conclusion.term for one in self.of_output(output)}
        labels = [label for label in output.terms if label.name in known]
        cuts = [
            (self._so_far(output, label.name), line_tables(output, label))
            for label in labels
        ]
        areas: list[float] = []
        moments: list[float] = []
        for k, (left, right) in enumerate(itertools.pairwise(sampled_values(output))):
            shares = [
                line.start[k] + (degree - line.level[k]) * line.slope[k]
                for degree, line in cuts
            ]
            shares = [0.0, *sorted(min(max(one, 0.0), 1.0) for one in shares), 1.0]
            heights = [
                max((min(cut, one.at(k, share)) for cut, one in cuts), default=0.0)
                for share in shares
            ]
            points = zip(shares, heights, strict=True)
            area, moment = 0.0, 0.0
            for (share, low), (after, high) in itertools.pairwise(points):
                gap, both = after - share, low + high
                area += gap * both
                moment += gap * (share * (low + both) + after * (high + both))
            width = right - left
            areas.append(width * area)
            moments.append(width * (left * area + width * moment / 3.0))
        return divide(total(moments), total(areas))

    def _weighted(self, output: SystemOutput) -> float:
        """Return the weighted sum or average of numbers, from left to right."""
        weighted = [
            (degree, degree * self._number_of(output, label, degree))
            for label, degree in self._weights(output)
        ]
        total = _left_to_right([product for _, product in weighted])
        weight = _left_to_right([degree for degree, _ in weighted])
        if output.defuzzifier.method == "weighted average":
            return divide(total, weight)
        return total if weighted else math.nan

    def _weights(self, output: SystemOutput) -> Iterator[tuple[Term, float]]:
        """Yield labels and degrees: each conclusion's, or each label's if joined."""
        if output.aggregation is None:
            for one in self.of_output(output):
                yield self.labels[output.name, one.conclusion.term], one.degree
            return
        known = {one.conclusion.term for one in self.of_output(output)}
        for label in output.terms:
            if label.name in known:
                yield label, self._so_far(output, label.name)

    def _number_of(self, output: SystemOutput, label: Term, degree: float) -> float:
        match label.function:
            case Singleton(value=value):
                return value
            case Linear(weights=weights, offset=offset):
                values = [self.values[name] for name in self.columns]
                parts = [w * x for w, x in zip(weights, values, strict=True)]
                return _left_to_right(parts) + offset
            case Formula(expression=expression):
                return value_of(expression, {**self.values, "x": degree})
            case curve:
                result = value_at(curve, degree / label.height)
                if result is not None:
                    return result
                return self._label_degree(output.name, label.name, degree)


def _and(name: TNorm | None) -> Callable[[float, float], float]:
    return functools.partial(t_norm, name or "minimum")


def _or(name: SNorm | None) -> Callable[[float, float], float]:
    return functools.partial(s_norm, name or "maximum")


def _passes(how: Activation, degree: float, count: int) -> bool:
    """Return whether a rule is activated when `count` were before it."""
    if how.method in ("first", "last") and count >= how.count:
        return False
    result = passes(DOUBLES, how, degree)
    return result is None or bool(result)


def _chosen(how: Activation, result: Sequence[float]) -> list[float]:
    """Return the degrees of the activated rules, 0 for the others."""
    positive = [index for index, degree in enumerate(result) if degree > 0.0]
    if how.method == "proportional":
        total = _left_to_right([result[index] for index in positive])
        return [degree / total if degree > 0.0 else 0.0 for degree in result]
    sign = -1.0 if how.method == "highest" else 1.0
    # Sorting keeps the order of equals: the first of them comes first.
    ranked = sorted(positive, key=lambda index: sign * result[index])[: how.count]
    return [degree if index in ranked else 0.0 for index, degree in enumerate(result)]


def unsampled_terms(system: FuzzySystem) -> Iterator[tuple[SystemOutput, Term]]:
    """Yield the terms that rules conclude and whose degree is 0 at every sample.

    A rule that concludes such a term changes no answer. Terms with a formula are left
    out.
    """
    concluded = {(one.output, one.term) for rule in system.rules for one in rule.then}
    for output in system.outputs:
        if output.defuzzifier.is_weighted:
            continue
        samples = sampled_values(output)
        for label in output.terms:
            if (output.name, label.name) not in concluded:
                continue
            curve = label.function
            if not isinstance(curve, Formula) and not any(
                curve_degree(curve, x) > 0.0 for x in samples
            ):
                yield output, label


class Lines(msgspec.Struct, frozen=True):
    """A label's curve as a line between each two neighbouring samples.

    Attributes:
        left: The degree at a piece's left end.
        rise: How much it rises up to the right end.
        start: With `level` and `slope`: the line meets degree d at the share
            `start + (d - level) slope` of the piece, if that lies in [0, 1].
        level: The lower of the degrees at both ends; 0 where they are equal.
        slope: 0 where they are equal.
    """

    left: tuple[float, ...]
    rise: tuple[float, ...]
    start: tuple[float, ...]
    level: tuple[float, ...]
    slope: tuple[float, ...]

    def at(self, piece: int, share: float) -> float:
        """Return the degree at a share of a piece."""
        return self.left[piece] + share * self.rise[piece]


@functools.lru_cache(maxsize=256)
def sampled_degrees(output: SystemOutput, label: Term) -> list[float]:
    """Return the degrees of a term that has no formula, where an output is sampled."""
    xs = sampled_values(output)
    return [label.height * curve_degree(label.function, x) for x in xs]


@functools.lru_cache(maxsize=256)
def line_tables(output: SystemOutput, label: Term) -> Lines:
    """Return the lines of a label of an output whose grid is `lines`."""
    degrees = sampled_degrees(output, label)
    rows: list[tuple[float, float, float, float, float]] = []
    for left, right in itertools.pairwise(degrees):
        rise = right - left
        slope = divide(1.0, rise)
        if not math.isfinite(slope):
            rows.append((left, rise, 0.0, 0.0, 0.0))
        elif rise > 0.0:
            rows.append((left, rise, 0.0, left, slope))
        else:
            rows.append((left, rise, 1.0, right, slope))
    return Lines(*zip(*rows, strict=True))


def _areas(output: SystemOutput, degrees: Sequence[float]) -> list[float]:
    """Return how much each value counts: its degree, half of it at `half ends`."""
    areas = [*degrees]
    if output.defuzzifier.grid == "half ends":
        areas[0], areas[-1] = 0.5 * areas[0], 0.5 * areas[-1]
    return areas


def _bisector(xs: Sequence[float], areas: Sequence[float]) -> float:
    """Return the mean of the values that part the area most evenly.

    Those at which the sum of the areas up to them, their own included, divided by that
    of all is nearest to 1/2.
    """
    sums = [*itertools.accumulate(areas)]
    misses = [abs(divide(part, sums[-1]) - 0.5) for part in sums]
    if any(map(math.isnan, misses)):
        return math.nan
    return _mean(xs, [miss == min(misses) for miss in misses])


def _of_maximum(method: str, xs: Sequence[float], degrees: Sequence[float]) -> float:
    highest = _folded(maximum, degrees)
    if not highest > 0.0:
        return math.nan
    chosen = [degree == highest for degree in degrees]
    if method == "mean of maximum":
        return _mean(xs, chosen)
    results = [x for x, is_chosen in zip(xs, chosen, strict=True) if is_chosen]
    return results[0] if method == "smallest of maximum" else results[-1]


def _mean(xs: Sequence[float], chosen: Sequence[bool]) -> float:
    kept = [x if one else 0.0 for x, one in zip(xs, chosen, strict=True)]
    return total(kept) / sum(chosen)


def _left_to_right(values: Sequence[float]) -> float:
    return _folded(lambda a, b: a + b, values) if values else 0.0


def _folded(
    operation: Callable[[float, float], float], values: Sequence[float]
) -> float:
    total = values[0]
    for value in values[1:]:
        total = operation(total, value)
    return total

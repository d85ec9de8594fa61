"""A fuzzy system as a program: the operations of `semantics.inference`, in order.

There a rule that is not activated concludes nothing; here every rule concludes, with
degree 0 where it is not activated. With degrees in [0, 1] that changes no bit: every
AND makes 0 of it and every OR leaves the other degree as it is. Where degrees could
leave [0, 1], or be NaN, or a number be infinite, `where` leaves the rule out instead.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from fuzzytree.model import (
    KEEPS_UNIT,
    S_NORMS,
    T_NORMS,
    Activation,
    And,
    Condition,
    Formula,
    FuzzySystem,
    Linear,
    Norm,
    Not,
    Or,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    as_number,
    checkpoint,
    hedged,
    is_drawn_by_lines,
    is_nan,
    sampled_values,
    value_of,
)
from fuzzytree.semantics.inference import Lines, line_tables
from fuzzytree.semantics.programs.activations import (
    passes,
    positive,
    proportional,
    ranked,
)
from fuzzytree.semantics.programs.rule_program import (
    DECIDED,
    MISSING,
    UNCOVERED,
    clamped,
    input_values,
)
from fuzzytree.semantics.programs.steps import Maker, Place, Program, Result, result_of


@functools.lru_cache(maxsize=4)
def from_system(system: FuzzySystem, *, activations: bool = False) -> Program:
    """Return the program of a fuzzy system.

    Its numbers have the bits of `fuzzytree.semantics.inference.infer`, and so has every
    runner whose `exp`, `pow` and the like are those of the C library. Rows with a value
    that is missing or not finite give NaN and status 3.

    Returns:
        A program with the result `output` for each output, `status`, and `activation`
        for each rule of all blocks if wanted.

    Raises:
        KeyError: If a formula needs an output that has no number yet.

    Example:
        >>> from fuzzytree.semantics.programs.evaluate import evaluate_program
        >>> from fuzzytree.model import Conclusion, Defuzzifier, Points, Variable
        >>> dirty = Term("dirty", Points((0.0, 10.0), (0.0, 1.0)))
        >>> long = Term("long", Singleton(60.0))
        >>> system = FuzzySystem(
        ...     "washer", (Variable("dirt", (dirty,)),),
        ...     (SystemOutput("time", (long,), None, None,
        ...                   Defuzzifier("weighted sum")),),
        ...     (RuleBlock((SystemRule(Proposition("dirt", ("dirty",)),
        ...                            (Conclusion("time", "long"),)),)),),
        ... )
        >>> evaluate_program(from_system(system), {"dirt": 5.0}).of("output")
        (30.0,)
    """
    make = Maker()
    known, values = input_values(make, system.variables)
    run = _Run(make, system, values)
    for block in system.blocks:
        run.activate(block)
    numbers: list[Place] = []
    for output in system.outputs:
        with make.topic(output.name):
            numbers.append(run.number(output))
            values[output.name] = _answer(make, output, numbers[-1])
    nothing = make.constant(math.nan)
    results: list[Result] = []
    for one in system.outputs:
        with make.topic(one.name):
            number = make.where(known, values[one.name], nothing)
            make.titled(number, one.name)
        results.append(result_of("output", one.name, number))
    if activations:
        for rule, degree in enumerate(run.activations, 1):
            shown = make.where(known, degree, nothing)
            results.append(result_of("activation", str(rule), shown))
    results.append(result_of("status", "status", _status(make, known, numbers)))
    return make.program(system.name, system.inputs, tuple(results))


def _answer(make: Maker, output: SystemOutput, number: Place) -> Place:
    if output.default is not None:
        default = make.constant(output.default)
        number = make.where(is_nan(make, number), default, number)
    return clamped(make, output, number) if output.clips else number


def _status(make: Maker, known: Place, numbers: Sequence[Place]) -> Place:
    with make.topic("status"):
        is_none = make.chain("or", [is_nan(make, number) for number in numbers])
        uncovered, decided = make.constant(UNCOVERED), make.constant(DECIDED)
        status = make.where(is_none, uncovered, decided)
        return make.where(known, status, MISSING)


class _Concluded(msgspec.Struct):
    """A conclusion with its degree, 0 where its rule is not activated."""

    label: str
    degree: Place
    implication: TNorm


class _Run:
    """The blocks of a system on their way to steps."""

    def __init__(
        self, make: Maker, system: FuzzySystem, values: dict[str, Place]
    ) -> None:
        self.make = make
        self.values = make.names = values
        self.columns = system.inputs
        self.outputs = {one.name: one for one in system.outputs}
        self.labels = {
            (variable.name, label.name): label
            for variable in system.all_variables
            for label in variable.terms
        }
        self.activations: list[Place] = []
        self.concluded: dict[str, dict[tuple[int, int], _Concluded]] = {
            name: {} for name in self.outputs
        }
        self.units: set[Place] = {make.constant(0.0), make.constant(1.0)}
        self.propositions: dict[Proposition, Place] = {}
        self.degrees: dict[tuple[str, str, Place], Place] = {}

    def activate(self, block: RuleBlock) -> None:
        """Add the rules of a block, and note what each concludes."""
        how = block.activation
        first = len(self.activations)
        order = range(len(block.rules))
        if how.method in ("highest", "lowest", "proportional"):
            # Which rules are activated is known when all degrees are.
            results = [
                self._rule_degree(block, rule, number)
                for number, rule in enumerate(block.rules, first + 1)
            ]
            degrees = self._chosen(how, results)
            for index in order:
                with self.make.topic(f"rule {first + index + 1}"):
                    self._conclude(block, index, first + index, degrees[index])
        else:
            # Each rule sees what those before it concluded.
            degrees = [self.make.constant(0.0)] * len(block.rules)
            count = self.make.constant(0.0)
            for index in reversed(order) if how.method == "last" else order:
                rule = block.rules[index]
                degree = self._rule_degree(block, rule, first + index + 1)
                with self.make.topic(f"rule {first + index + 1}"):
                    degrees[index], count = self._passed(how, degree, count)
                    self._conclude(block, index, first + index, degrees[index])
        self.activations += degrees

    def _chosen(self, how: Activation, result: Sequence[Place]) -> list[Place]:
        if not result:
            return []
        if how.method == "proportional":
            degrees = proportional(self.make, result)
        else:
            degrees = ranked(self.make, how, result)
        for degree in degrees:
            self._unit(degree, if_all=result)
        return degrees

    def _passed(
        self, how: Activation, degree: Place, count: Place
    ) -> tuple[Place, Place]:
        """Return a rule's degree of activation, and how many are activated now."""
        make, zero = self.make, self.make.constant(0.0)
        test = passes(make, how, degree)
        if test is None:
            return self._positive(degree), count
        active = make("and", make.less(zero, degree), test)
        if how.method != "threshold":
            limit = make.constant(float(how.count))
            active = make("and", active, make.less(count, limit))
            count = count + as_number(make, active)
        result = make.where(active, degree, zero)
        return self._unit(result, if_all=[degree]), count

    def _positive(self, degree: Place) -> Place:
        """Return a degree where it is above 0, else 0."""
        return degree if degree in self.units else positive(self.make, degree)

    def _unit(self, place: Place, *, if_all: Sequence[Place]) -> Place:
        """Note that a step lies in [0, 1] if some others do."""
        if self.units.issuperset(if_all):
            self.units.add(place)
        return place

    def _rule_degree(self, block: RuleBlock, rule: SystemRule, number: int) -> Place:
        checkpoint()
        make = self.make
        when = rule.when
        with make.topic(f"rule {number}"):
            degree = make.constant(1.0) if when is None else self._degree(when, block)
            result = rule.weight * degree
            make.titled(result, f"rule {number} strength")
        return self._unit(result, if_all=[degree])

    def _degree(self, condition: Condition, block: RuleBlock) -> Place:
        match condition:
            case Proposition():
                return self._proposition(condition)
            case And(parts=parts):
                both = block.conjunction or "minimum"
                degrees = [self._degree(part, block) for part in parts]
                return self._joined(both, T_NORMS[both], degrees)
            case Or(parts=parts):
                either = block.disjunction or "maximum"
                degrees = [self._degree(part, block) for part in parts]
                return self._joined(either, S_NORMS[either], degrees)
            case Not(part=part):
                degree = self._degree(part, block)
                result = 1.0 - degree
                return self._unit(result, if_all=[degree])

    def _joined(self, name: str, norm: Norm, degrees: Sequence[Place]) -> Place:
        total = degrees[0]
        for degree in degrees[1:]:
            joined = norm(self.make, total, degree)
            if name in KEEPS_UNIT:
                self._unit(joined, if_all=[total, degree])
            total = joined
        return total

    def _proposition(self, proposition: Proposition) -> Place:
        if proposition in self.propositions:
            return self.propositions[proposition]
        if proposition.term is None:
            degree = self.make.constant(math.nan)  # the hedge `any` makes 1 of it
        elif proposition.variable in self.outputs:
            degree = self._so_far(self.outputs[proposition.variable], proposition.term)
        else:
            label = self.labels[proposition.variable, proposition.term]
            value = self.values[proposition.variable]
            degree = self._label_degree(proposition.variable, label, value)
        words = (
            proposition.variable,
            "is",
            *proposition.hedges,
            proposition.term or "",
        )
        with self.make.topic(" ".join(words)):
            result = hedged(self.make, proposition.hedges, degree)
            self.make.titled(result, " ".join(words))
        if proposition.variable not in self.outputs:  # of those, each rule changes it
            self.propositions[proposition] = result
        return self._unit(result, if_all=[degree])

    def _label_degree(self, variable: str, label: Term, x: Place) -> Place:
        key = variable, label.name, x
        if key not in self.degrees:
            with self.make.topic(f"{variable} is {label.name}"):
                degree = label.function.degree(self.make, x)
                height = self.make.constant(label.height)
                result = height * degree
                self.make.titled(result, f"{variable} is {label.name}")
            if label.function.is_unit:
                self.units.add(result)
            self.degrees[key] = result
        return self.degrees[key]

    def _so_far(self, output: SystemOutput, label: str) -> Place:
        """Return how far a label was concluded: its degrees, aggregated from 0 on."""
        results = [one for one in self._of(output) if one.label == label]
        return self._aggregate(output, results)

    def _aggregate(self, output: SystemOutput, result: Sequence[_Concluded]) -> Place:
        name = output.aggregation or "sum"
        degrees = [one.degree for one in result]
        if not degrees or degrees[0] not in self.units:
            degrees.insert(0, self.make.constant(0.0))
        # 0 OR the first is the first, if that lies in [0, 1].
        return self._joined(name, S_NORMS[name], degrees)

    def _of(self, output: SystemOutput) -> list[_Concluded]:
        """Return what is concluded of an output, in the order of the rules."""
        concluded = self.concluded[output.name]
        return [concluded[place] for place in sorted(concluded)]

    def _conclude(
        self, block: RuleBlock, index: int, rule: int, activation: Place
    ) -> None:
        """Note what a rule concludes; hedges act on the conclusions behind them too."""
        make, zero = self.make, self.make.constant(0.0)
        if block.activation.method == "proportional":
            activation = self._positive(activation)
        if activation == zero:
            return
        degree, is_hedged = activation, False
        for offset, one in enumerate(block.rules[index].then):
            is_hedged = is_hedged or bool(one.hedges)
            before, degree = degree, hedged(make, one.hedges, degree)
            self._unit(degree, if_all=[before])
            noted = degree
            if is_hedged:  # such as `not`: only of a rule that is activated
                is_active = make.less(zero, activation)
                noted = make.where(is_active, self._positive(degree), zero)
                self._unit(noted, if_all=[degree])
            how = block.implication or "minimum"
            self.concluded[one.output][rule, offset] = _Concluded(one.term, noted, how)

    def number(self, output: SystemOutput) -> Place:
        """Return what an output's conclusions amount to; NaN if to nothing."""
        if not self._of(output):
            return self.make.constant(math.nan)
        if output.defuzzifier.is_weighted:
            return self._weighted(output)
        if is_drawn_by_lines(output):
            concluded = {one.label for one in self._of(output)}
            cuts = [
                (self._so_far(output, label.name), line_tables(output, label))
                for label in output.terms
                if label.name in concluded
            ]
            return centroid_of_lines(self.make, output, cuts)
        xs = samples_of(self.make, output)
        return defuzzified(self.make, output, xs, self._aggregated(output, xs))

    def _aggregated(self, output: SystemOutput, xs: Place) -> Place:
        """Return the degree of the joined conclusions at each sample, from 0 on."""
        make = self.make
        join = S_NORMS[output.aggregation or "maximum"]
        zero = make.constant(0.0)
        values = sampled_values(output)
        is_finite = all(map(math.isfinite, values))
        total = zero
        for one in self._gathered(output):
            label = self.labels[output.name, one.label]
            curve = self._label_degree(output.name, label, xs)
            cut = T_NORMS[one.implication](make, one.degree, curve)
            is_safe = is_finite and curve in self.units and one.degree in self.units
            if is_safe and one.implication in KEEPS_UNIT and total == zero:
                total = cut  # 0 OR it
                continue
            joined = join(make, total, cut)
            if not is_safe:
                joined = make.where(make.less(zero, one.degree), joined, total)
            total = joined
        if not make.samples(total):  # curves that are the same everywhere
            index = make.index(len(values))
            total = total + (zero * index)
        return total

    def _gathered(self, output: SystemOutput) -> list[_Concluded]:
        """Return the conclusions, those of one label as one where that is the same.

        The larger of two cut curves is the curve cut at the larger degree, to the last
        bit, because minimum and product keep order in rounded numbers too.
        """
        result = self._of(output)
        if output.aggregation != "maximum":
            return result
        if not all(one.degree in self.units for one in result):
            return result
        gathered: dict[tuple[str, str], _Concluded] = {}
        for one in result:
            if one.implication not in ("minimum", "product"):
                return result
            if not self.labels[output.name, one.label].function.is_unit:
                return result
            key = one.label, one.implication
            if key in gathered:
                pair = [gathered[key].degree, one.degree]
                degree = self._joined("maximum", S_NORMS["maximum"], pair)
                one = msgspec.structs.replace(one, degree=degree)
            gathered[key] = one
        return list(gathered.values())

    def _weighted(self, output: SystemOutput) -> Place:
        """Return the weighted sum or average of numbers, from left to right."""
        make, zero = self.make, self.make.constant(0.0)
        weights: list[Place] = []
        products: list[Place] = []
        for label, degree, concluded in self._weights(output):
            with make.topic(label.name):
                number = self._number_of(output, label, degree)
            product = degree * number
            known = make.number(number)
            is_finite = known is not None and math.isfinite(known)
            if not is_finite or degree not in self.units:
                there = self._is_there(concluded)
                product = make.where(there, product, zero)
                degree = make.where(there, degree, zero)
            weights.append(degree)
            products.append(product)
        total = make.chain("add", products)
        if output.defuzzifier.method == "weighted average":
            return total / make.chain("add", weights)
        is_any = self._is_there(self._of(output))
        return make.where(is_any, total, math.nan)

    def _weights(
        self, output: SystemOutput
    ) -> Iterator[tuple[Term, Place, list[_Concluded]]]:
        """Yield labels and degrees, and the conclusions that they come from."""
        result = self._of(output)
        if output.aggregation is None:
            for one in result:
                yield self.labels[output.name, one.label], one.degree, [one]
            return
        owners: dict[str, list[_Concluded]] = {}
        for one in result:
            owners.setdefault(one.label, []).append(one)
        for label in output.terms:
            if own := owners.get(label.name):
                yield label, self._aggregate(output, own), own

    def _is_there(self, concluded: Sequence[_Concluded]) -> Place:
        """Return whether a row has any of some conclusions."""
        zero = self.make.constant(0.0)
        tests = [self.make.less(zero, one.degree) for one in concluded]
        return self.make.chain("or", tests)

    def _number_of(self, output: SystemOutput, label: Term, degree: Place) -> Place:
        make = self.make
        match label.function:
            case Singleton(value=value):
                return make.constant(value)
            case Linear(weights=weights, offset=offset):
                values = [self.values[name] for name in self.columns]
                pairs = zip(weights, values, strict=True)
                parts = [w * x for w, x in pairs]
                total = make.chain("add", parts) if parts else make.constant(0.0)
                return total + offset
            case Formula(expression=expression):
                return value_of(make, expression, {**self.values, "x": degree})
            case curve:
                height = make.constant(label.height)
                result = curve.inverse(make, degree / height)
                if result is not None:
                    return result
                return self._label_degree(output.name, label, degree)


def samples_of(make: Maker, output: SystemOutput) -> Place:
    """Return the values at which an output's curve is sampled."""
    if any(isinstance(label.function, Singleton) for label in output.terms):
        values = sampled_values(output)
        return make.table("pick", make.index(len(values)), values)
    low, high = output.low or 0.0, output.high or 0.0
    count = output.defuzzifier.samples
    index, start = make.index(count), make.constant(low)
    if output.defuzzifier.grid in ("middle", "low ends"):
        step = make.constant((high - low) / count)
        place = index + 0.5 if output.defuzzifier.grid == "middle" else index
        return start + (place * step)
    step = make.constant((high - low) / (count - 1))
    value = start + (index * step)
    is_last = make.equal(index, float(count - 1))
    return make.where(is_last, high, value)


def defuzzified(make: Maker, output: SystemOutput, xs: Place, degrees: Place) -> Place:
    """Return an output's number; NaN if the curve is 0 everywhere."""
    method = output.defuzzifier.method
    if method in ("centroid", "bisector"):
        areas = _areas(make, output, degrees)
        if method == "bisector":
            return _bisector(make, xs, areas)
        moments = make("total", xs * areas)
        return moments / make("total", areas)
    highest = make("highest", degrees)
    chosen = make.equal(degrees, highest)
    if method == "mean of maximum":
        result = _mean(make, xs, chosen)
    else:
        result = _end(make, output, xs, chosen, is_first=method.startswith("smallest"))
    is_any = make.less(0.0, highest)
    return make.where(is_any, result, math.nan)


def centroid_of_lines(
    make: Maker, output: SystemOutput, cuts: Sequence[tuple[Place, Lines]]
) -> Place:
    """Return an output's centroid on the grid `lines`, of its labels' degrees."""
    xs = sampled_values(output)
    index = make.index(len(xs) - 1)

    def row(numbers: Iterable[float]) -> Place:
        return make.table("pick", index, [*numbers])

    zero, one = make.constant(0.0), make.constant(1.0)
    sides = [(degree, row(line.left), row(line.rise)) for degree, line in cuts]
    shares: list[Place] = []
    for degree, line in cuts:
        above = degree - row(line.level)
        share = row(line.start) + (above * row(line.slope))
        shares.append(make.minimum(make.maximum(share, zero), one))
    shares = [zero, *_sorted(make, shares), one]
    heights: list[Place] = []
    for share in shares:
        lines = [(cut, y + (share * r)) for cut, y, r in sides]
        heights.append(make.chain("maximum", [make("minimum", *one) for one in lines]))
    areas: list[Place] = []
    moments: list[Place] = []
    points = itertools.pairwise(zip(shares, heights, strict=True))
    for (share, low), (after, high) in points:
        width, both = after - share, low + high
        areas.append(width * both)
        first = share * (low + both)
        second = after * (high + both)
        moments.append(width * (first + second))
    area, moment = make.chain("add", areas), make.chain("add", moments)
    width = row(right - left for left, right in itertools.pairwise(xs))
    inside = (width * moment) / 3.0
    around = (row(xs[:-1]) * area) + inside
    total = make("total", width * around)
    return total / make("total", width * area)


def _sorted(make: Maker, numbers: Sequence[Place]) -> list[Place]:
    """Return numbers in rising order, by exchanging neighbours."""
    results = [*numbers]
    for last in range(len(results) - 1, 0, -1):
        for k in range(last):
            pair = results[k], results[k + 1]
            results[k], results[k + 1] = make("minimum", *pair), make("maximum", *pair)
    return results


def _areas(make: Maker, output: SystemOutput, degrees: Place) -> Place:
    """Return how much each sample counts: its degree, half of it at `half ends`."""
    if output.defuzzifier.grid != "half ends":
        return degrees
    count = output.defuzzifier.samples
    index, last = make.index(count), make.constant(float(count - 1))
    is_end = make.equal(index, 0.0)
    is_end = make("or", is_end, make.equal(index, last))
    share = make.where(is_end, 0.5, 1.0)
    return share * degrees


def _bisector(make: Maker, xs: Place, areas: Place) -> Place:
    """Return the mean of the samples that part the area most evenly.

    Where a share is NaN so is the lowest miss, which no miss equals: 0 / 0 then.
    """
    sums = make("running", areas)
    share = sums / make("last", sums)
    misses = abs(share - 0.5)
    return _mean(make, xs, make.equal(misses, make("lowest", misses)))


def _mean(make: Maker, xs: Place, chosen: Place) -> Place:
    kept = make.where(chosen, xs, 0.0)
    return make("total", kept) / make("total", as_number(make, chosen))


def _end(
    make: Maker, output: SystemOutput, xs: Place, chosen: Place, *, is_first: bool
) -> Place:
    """Return the first or the last of the chosen samples."""
    outside = make.constant(math.inf if is_first else -math.inf)
    find = "lowest" if is_first else "highest"
    numbers = sampled_values(output)
    if all(one <= two for one, two in itertools.pairwise(numbers)):
        return make(find, make.where(chosen, xs, outside))
    # A range of a few neighbouring doubles: its samples need not rise.
    index = make.index(len(numbers))
    return make.table("pick", make(find, make.where(chosen, index, outside)), numbers)

"""Fuzzy systems made from a seed, with everything that a system can have."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Final, Literal, get_args

from fuzzytree.model import (
    FUNCTIONS,
    LR,
    Activation,
    ActivationMethod,
    And,
    Band,
    Call,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    DefuzzifierMethod,
    Expression,
    FuzzySystem,
    Grid,
    Hedge,
    Name,
    Not,
    Number,
    Or,
    Part,
    Points,
    Proposition,
    Relation,
    RuleBlock,
    Side,
    SNorm,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Variable,
    curves,
)

Formulas = Literal["none", "tame", "wild"]

_PLAIN: Final = ("low", "medium", "high", "far", "near")
_ODD: Final = (
    *("is", "very", "not low", "and", "it's", "(low)", "x", "Größe", '"', "a  b"),
    *(" low", "low and high", "0.5", "then", ":", "any", "low,", "'", "\\", "#"),
)

_TAME: Final[Mapping[str, int]] = {
    name: FUNCTIONS[name]
    for name in (
        *("negate", "abs", "sin", "cos", "atan", "tanh", "floor", "not"),
        *("+", "-", "*", "min", "max", "and", "or", "lt", "ge"),
    )
}


def random_system(
    seed: int,
    *,
    inputs: int = 3,
    outputs: int = 2,
    rules: int = 8,
    defuzzifier: Literal["any", "of curves", "weighted"] = "any",
    formulas: Formulas = "tame",
    has_odd_names: bool = False,
) -> FuzzySystem:
    """Return a valid fuzzy system made from a seed.

    A hundred seeds show every kind of curve, norm, hedge, activation, defuzzifier, grid
    and aggregation, several blocks, outputs in antecedents, combinations of inputs,
    ranges that clip, weights, defaults and rules without a condition.

    Args:
        seed: The same seed and settings give the same system.
        inputs: How many columns, `x1` and so on, on scales from 0.01 to 1000.
        outputs: How many outputs, `y1` and so on.
        rules: How many rules, in all blocks.
        defuzzifier: Only those that look at a curve, only weighted ones, or either.
        formulas: `tame` ones have a value everywhere; `wild` ones use every function.
        has_odd_names: Whether names hold blanks, signs and words of file formats.

    Example:
        >>> [len(block.rules) for block in random_system(3).blocks]
        [4, 4]
    """
    return _Maker(seed, formulas, has_odd_names).system(
        inputs, outputs, rules, defuzzifier
    )


def random_rows(system: FuzzySystem, seed: int, count: int) -> list[dict[str, float]]:
    """Return rows for a system, made from a seed: within ranges, and a bit beyond.

    Example:
        >>> [sorted(row) for row in random_rows(random_system(0), 0, 1)]
        [['x1', 'x2', 'x3']]
    """
    chance = random.Random(seed)
    columns = [one for one in system.variables if not one.parts]
    rows: list[dict[str, float]] = []
    for _ in range(count):
        row: dict[str, float] = {}
        for one in columns:
            low = -1.0 if one.low is None else one.low
            high = low + 2.0 if one.high is None else one.high
            share = chance.choice((0.0, 0.5, 1.0, *[chance.uniform(-0.1, 1.1)] * 9))
            row[one.name] = low + share * (high - low)
        rows.append(row)
    return rows


class _Maker:
    """The parts of one system, from one source of chance."""

    def __init__(self, seed: int, formulas: Formulas, has_odd_names: bool) -> None:
        self.chance = random.Random(seed)
        self.formulas = formulas
        self.has_odd_names = has_odd_names
        self.scales: dict[str, float] = {}

    def system(self, inputs: int, outputs: int, rules: int, kind: str) -> FuzzySystem:
        chance = self.chance
        columns = self._names("x", inputs)
        self.scales = {name: 10.0 ** chance.randint(-2, 3) for name in columns}
        variables = [self._input(name, columns) for name in columns]
        if inputs > 1 and chance.random() < 0.4:
            variables.append(self._combination(columns))
        nameable = [one.name for one in variables]
        concluded: list[SystemOutput] = []
        for name in self._names("y", outputs):
            concluded.append(self._output(name, nameable, columns, kind))
            nameable.append(name)
        sizes = [rules]
        if rules > 1 and chance.random() < 0.5:
            first = chance.randint(1, rules - 1)
            sizes = [first, rules - first]
        blocks = [self._block(size, variables, concluded) for size in sizes]
        name = self._name(f"random {rules}")
        note = chance.choice(("", "Made by chance.", "two\nlines: # and 'quotes'"))
        return FuzzySystem(
            name, tuple(variables), tuple(concluded), tuple(blocks), note
        )

    def _name(self, plain: str) -> str:
        if not self.has_odd_names or self.chance.random() < 0.3:
            return plain
        return self.chance.choice((*_ODD, f"{plain} {self.chance.choice(_ODD)}"))

    def _names(self, letter: str, count: int) -> list[str]:
        names: list[str] = []
        for number in range(1, count + 1):
            plain = f"{letter}{number}"
            name = self._name(plain)
            names.append(plain if name in (*names, *self.scales, "x") else name)
        return names

    def _labels(self, functions: Sequence[Curve]) -> tuple[Term, ...]:
        names: list[str] = []
        for plain in _PLAIN[: len(functions)]:
            name = self._name(plain)
            names.append(plain if name in names or name in _PLAIN else name)
        return tuple(
            Term(name, curve, self.chance.choice((1.0, 1.0, 1.0, 0.75, 0.3)))
            for name, curve in zip(names, functions, strict=True)
        )

    def _input(self, name: str, columns: Sequence[str]) -> Variable:
        chance, scale = self.chance, self.scales[name]
        low, high = (-scale, scale) if chance.random() < 0.9 else (None, None)
        functions = [
            self._curve(scale, columns) for _ in range(chance.randint(1, len(_PLAIN)))
        ]
        clips = low is not None and chance.random() < 0.3
        unit = chance.choice(("", "cm"))
        return Variable(
            name, self._labels(functions), low=low, high=high, clips=clips, unit=unit
        )

    def _combination(self, columns: Sequence[str]) -> Variable:
        chance = self.chance
        parts = tuple(
            Part(name, chance.uniform(0.2, 2.0) / self.scales[name], chance.random())
            for name in chance.sample(columns, chance.randint(2, len(columns)))
        )
        functions = [self._curve(1.0, columns) for _ in range(3)]
        return Variable("mix", self._labels(functions), parts=parts)

    def _output(
        self, name: str, nameable: Sequence[str], columns: Sequence[str], kind: str
    ) -> SystemOutput:
        chance = self.chance
        scale = 10.0 ** chance.randint(-2, 3)
        is_weighted = kind == "weighted" or (kind == "any" and chance.random() < 0.5)
        how = self._defuzzifier(is_weighted=is_weighted)
        count = chance.randint(1, len(_PLAIN))
        functions = [
            self._number(scale, nameable, columns)
            if is_weighted and chance.random() < 0.7
            else self._curve(scale, nameable)
            for _ in range(count)
        ]
        if not is_weighted:  # formats that sample ranges refuse singletons
            functions = [
                curves.Gaussian(one.value, scale)
                if isinstance(one, curves.Singleton)
                else one
                for one in functions
            ]
        norms: tuple[SNorm | None, ...] = get_args(SNorm)
        return SystemOutput(
            name,
            self._labels(functions),
            -scale,
            scale,
            how,
            chance.choice((None, None, *norms) if is_weighted else norms),
            chance.choice((None, 0.0, chance.uniform(-2.0, 2.0) * scale)),
            chance.random() < 0.3,
            chance.choice(("", "m/s")),
        )

    def _defuzzifier(self, *, is_weighted: bool) -> Defuzzifier:
        chance = self.chance
        methods: tuple[DefuzzifierMethod, ...] = get_args(DefuzzifierMethod)
        how = Defuzzifier(chance.choice(methods))
        while how.is_weighted != is_weighted:
            how = Defuzzifier(chance.choice(methods))
        if is_weighted:
            return how
        samples = chance.choice((2, 3, 7, 16, 33, 100))
        grids: tuple[Grid, ...] = ("middle", "ends", "half ends")
        grid = chance.choice(grids)
        if (grid, samples) == ("middle", 7):
            grid = "low ends"
        return Defuzzifier(how.method, samples, grid)

    def _block(
        self,
        size: int,
        inputs: Sequence[Variable],
        outputs: Sequence[SystemOutput],
    ) -> RuleBlock:
        chance = self.chance
        t_norms: tuple[TNorm, ...] = get_args(TNorm)
        s_norms: tuple[SNorm, ...] = get_args(SNorm)
        methods: tuple[ActivationMethod, ...] = get_args(ActivationMethod)
        method = chance.choice(("general", *methods))
        activation = Activation(method)
        if method not in ("general", "proportional"):
            relation = chance.choice(get_args(Relation))
            threshold = chance.choice((0.0, 0.25, chance.random()))
            activation = Activation(method, chance.randint(1, 4), threshold, relation)
        return RuleBlock(
            tuple(self._rule(inputs, outputs) for _ in range(size)),
            chance.choice(t_norms),
            chance.choice(s_norms),
            chance.choice(t_norms),
            activation,
            chance.choice(("", "block")),
        )

    def _rule(
        self, inputs: Sequence[Variable], outputs: Sequence[SystemOutput]
    ) -> SystemRule:
        chance = self.chance
        variables: list[Variable | SystemOutput] = [*inputs, *inputs, *outputs]
        when = None if chance.random() < 0.05 else self._condition(variables, 3)
        then: list[Conclusion] = []
        for _ in range(chance.choice((1, 1, 2, 3))):
            output = chance.choice(outputs)
            label = chance.choice(output.terms).name
            then.append(Conclusion(output.name, label, self._hedges(0.2)))
        weight = chance.choice((1.0, 1.0, 0.5, chance.random(), 0.0))
        return SystemRule(when, tuple(then), weight, chance.choice(("", "", "rule")))

    def _condition(
        self, variables: Sequence[Variable | SystemOutput], levels: int
    ) -> Condition:
        chance = self.chance
        if levels and chance.random() < 0.5:
            parts = [self._condition(variables, levels - 1) for _ in range(2)]
            if chance.random() < 0.3:
                parts.append(self._condition(variables, levels - 1))
            match chance.randint(0, 4):
                case 0 | 1:
                    return And(tuple(parts))
                case 2 | 3:
                    return Or(tuple(parts))
                case _:
                    return Not(parts[0])
        one = chance.choice(variables)
        if chance.random() < 0.05:
            return Proposition(one.name, (), (*self._hedges(0.5), "any"))
        return Proposition(
            one.name, (chance.choice(one.terms).name,), self._hedges(0.3)
        )

    def _hedges(self, share: float) -> tuple[Hedge, ...]:
        chance = self.chance
        if chance.random() >= share:
            return ()
        hedges: tuple[Hedge, ...] = get_args(Hedge)
        return tuple(chance.choice(hedges) for _ in range(chance.choice((1, 1, 2))))

    def _number(
        self, scale: float, nameable: Sequence[str], columns: Sequence[str]
    ) -> Curve:
        chance = self.chance
        kinds = 2 if self.formulas == "none" else 3
        match chance.randrange(kinds):
            case 0:
                return curves.Singleton(chance.uniform(-1.0, 1.0) * scale)
            case 1:
                weights = [
                    chance.choice(
                        (0.0, chance.uniform(-1.0, 1.0) * scale / self.scales[n])
                    )
                    for n in columns
                ]
                return curves.Linear(tuple(weights), chance.uniform(-1.0, 1.0) * scale)
            case _:
                return curves.Formula(self._expression(nameable, 3))

    def _curve(self, scale: float, nameable: Sequence[str]) -> Curve:
        """Return any curve that has degrees within some scales of 0."""
        chance = self.chance
        a, b, c, d = sorted(chance.uniform(-1.0, 1.0) * scale for _ in range(4))
        width = chance.uniform(0.1, 1.0) * scale
        slope = chance.uniform(1.0, 20.0) / scale * chance.choice((-1.0, 1.0))
        first, second = (
            curves.Sigmoid(b, slope),
            curves.Sigmoid(c, chance.choice((slope, -slope))),
        )
        start, end = chance.choice(((a, d), (d, a)))
        ramp = chance.choice(((0.0, 1.0), (1.0, 0.0)))
        side = Side(width, (0.5,))
        edges: list[Curve] = [
            Points((a, b), ramp),
            curves.Sigmoid(b, slope),
            curves.SCurve(start, end),
            curves.Concave(start, end),
            curves.Arc(start, end),
        ]
        others: list[Curve] = [
            curves.Trapezoid(a, b, c, d),
            curves.Trapezoid(a, b, b, d),
            curves.Trapezoid(None, b, c, chance.choice((None, d))),
            curves.Trapezoid(a, a, d, chance.choice((None, d))),
            Points((a, b, b, c, d), (0.0, chance.random(), 1.0, chance.random(), 0.5)),
            Band(b, c, a, d),
            LR(b, side, Side(width, (0.4, 0.1), 3.0)),
            curves.Gaussian(b, width),
            curves.TwoGaussians(b, width, chance.choice((a, c)), 0.5 * width),
            curves.Bell(b, width, chance.uniform(0.5, 4.0)),
            curves.SigmoidDifference(first, second),
            curves.SigmoidProduct(first, second),
            curves.PiCurve(a, b, c, d),
            curves.Cosine(b, width),
            curves.Spike(b, width),
            curves.SemiEllipse(a, d),
            curves.Binary(b, chance.random() < 0.5),
            curves.Singleton(b),
        ]
        if self.formulas != "none":
            others.append(curves.Formula(self._degree_formula(nameable, scale)))
        return chance.choice([*edges, *others])

    def _degree_formula(self, nameable: Sequence[str], scale: float) -> Expression:
        if self.formulas == "wild" and self.chance.random() < 0.5:
            return self._expression([*nameable, "x"], 3)
        relative = Call("/", (Name("x"), Number(scale)))
        inner = Call("*", (relative, Call("cos", (self._leaf(nameable),))))
        return Call("min", (Number(1.0), Call("abs", (inner,))))

    def _expression(self, nameable: Sequence[str], levels: int) -> Expression:
        chance = self.chance
        if levels == 0 or chance.random() < 0.2:
            return self._leaf(nameable)
        known = FUNCTIONS if self.formulas == "wild" else _TAME
        function = chance.choice(list(known))
        arguments = [
            self._expression(nameable, levels - 1) for _ in range(known[function])
        ]
        return Call(function, tuple(arguments))

    def _leaf(self, nameable: Sequence[str]) -> Expression:
        if self.chance.random() < 0.5:
            return Number(self.chance.choice((2.0, 0.5, self.chance.uniform(0.0, 3.0))))
        return Name(self.chance.choice(nameable))

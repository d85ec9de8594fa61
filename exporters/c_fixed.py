"""The steps of a program in whole numbers, each with a number of bits behind the point.

How far each step can be from 0 comes from the ranges of the inputs; so does the number
of its bits, such that nothing overflows. Values outside the ranges are moved to their
ends. Products, quotients and sums are computed in twice as many bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.exporters.c_steps import Call, CSteps
from fuzzytree.exporters.c_text import CNumbers
from fuzzytree.model import FloatArray
from fuzzytree.semantics import (
    ARRAYS,
    OVER_SAMPLES,
    Program,
    Rounding,
    Step,
    Worst,
    evaluate_program,
    needed_steps,
    still_results,
    worst_over,
)

_SHIFTED = {"add": "+", "subtract": "-"}
_OPERATIONS = frozenset(
    ("constant", "input", "index", "add", "subtract", "multiply", "divide", "minimum")
) | {"maximum", "negate", "absolute", "where", "total", "less", "at_most", "equal"}
_TRUTHS = frozenset(("and", "or", "not", "less", "at_most", "equal"))
_LOOKED_UP = frozenset(("below", "pick"))
_FOLDED = frozenset(("add", "subtract", "multiply", "minimum", "maximum", "negate"))
_EDGES: Mapping[str, tuple[Callable[[float], int], Callable[[float], int]]] = {
    "less": (math.floor, math.ceil),
    "at_most": (math.ceil, math.floor),
    "equal": (round, round),
}  # how a constant is rounded that stands first, or second
_TRIES = 8

SystemExample = tuple[list[float], tuple[float, ...], list[float], int]
"""Inputs, numbers, how far each of these may be off, and the status."""


class FixedNumbers(CNumbers):
    """A type of whole numbers: its name, its largest number, and that of products."""

    @property
    def wide(self) -> str:
        """The type of products."""
        return f"int{2 * self.bits + 2}_t"

    @property
    def bits(self) -> int:
        """How many bits a number has beside its sign."""
        return 8 * np.dtype(self.kind).itemsize - 1

    def text(self, value: float) -> str:
        """Return a whole number as a constant."""
        return str(int(value))

    def shown(self, value: float) -> str:
        """Return a whole number."""
        return str(int(value))


# `kind` is that of floats everywhere else.
Q15 = FixedNumbers("int16_t", cast("type[np.float32]", np.int16), "")
Q31 = FixedNumbers("int32_t", cast("type[np.float32]", np.int32), "")


class FixedSteps(CSteps):
    """Writes the steps of a program in whole numbers.

    Args:
        program: The program.
        ranges: Of each input.
        numbers: The type of all numbers.
        curves: How far steps are from the curves that they stand for, by their titles.
        tables: Whether all samples that no input enters are tables.

    Attributes:
        bits: Behind the point, of each step.
        worst: The worst errors of its results, those of curves included.
        input_units: What an input is multiplied by, of shape (inputs, 1).
        output_units: The same of outputs, of shape (outputs, 1).

    Raises:
        ValueError: If a step has no range or bound, or is none of whole numbers.
    """

    def __init__(
        self,
        program: Program,
        ranges: Sequence[tuple[float, float]],
        numbers: FixedNumbers,
        curves: Mapping[str, float],
        *,
        tables: bool = False,
    ) -> None:
        program, new = _decided(program, ranges)
        off = {
            new[place]: curves[title]
            for place, title in enumerate(program.titles)
            if title in curves
        }
        program = _in_tables(program)
        self.fixed, self.ranges = numbers, ranges
        self.bits, self.whole_worst = _fitted(program, ranges, numbers)
        self.worst = self.whole_worst
        if off:
            rounding = _rounding(program, self.bits, off)
            self.worst = worst_over(program, ranges, rounding)
        for result, share in zip(program.results, self.worst.shares, strict=True):
            if share > 0.0:
                raise ValueError(
                    f"fixed point: the error of {result.title!r} has no bound, as a "
                    "rounded number may decide a choice or divide by 0; take float32"
                )
        super().__init__(program, numbers, {}, tables=tables)
        self.input_units, self.output_units = (
            2.0 ** np.array(bits).reshape(-1, 1) for bits in self._end_bits()
        )

    def whole_inputs(self, values: FloatArray) -> FloatArray:
        """Return the nearest whole numbers that the file distinguishes.

        `values` and what is returned have shape (inputs, rows); a missing value is the
        low end of its range.
        """
        ends = np.array(self.ranges).reshape(-1, 2)
        low, high = np.trunc(ends * self.input_units).T[..., np.newaxis]
        with np.errstate(over="ignore"):
            whole: FloatArray = np.clip(np.rint(values * self.input_units), low, high)
        return np.where(np.isnan(whole), low, whole) + 0.0  # sums have no -0

    def scales(self) -> Iterator[str]:
        """Yield of how many bits behind the point inputs and outputs are, in words."""
        inputs, outputs = self._end_bits()
        for line, name in enumerate(self.program.inputs):
            yield f"x[{line}] is {name} times 2^{inputs[line]}, moved into its range"
        for line, bits in enumerate(outputs):
            title = self.program.results[line].title
            yield f"outputs[{line}] is {title} times 2^{bits}"

    def examples(self, rows: Sequence[Sequence[float]]) -> Iterator[SystemExample]:
        """Yield examples in whole numbers, as they stand in the file."""
        units = self.output_units[:, 0]
        errors = (np.ceil(self.whole_worst.errors[:-1] * units) + 1.0).tolist()
        wholes = self.whole_inputs(
            np.array(rows).reshape(len(rows), len(self.ranges)).T
        ).T
        for line in wholes:
            inputs = (line / self.input_units[:, 0]).tolist()
            values = dict(zip(self.program.inputs, inputs, strict=True))
            *outputs, status = evaluate_program(self.program, values).values
            numbers = tuple((np.round(outputs * units) + 0.0).tolist())
            yield line.tolist(), numbers, errors, int(status)

    def _end_bits(self) -> tuple[list[int], list[int]]:
        """Return the bits of inputs, 0 of those that are not used, and of outputs."""
        steps = zip(self.program.steps, self.bits, strict=True)
        used = {step.name: bits for step, bits in steps if step.operation == "input"}
        inputs = [used.get(name, 0) for name in self.program.inputs]
        return inputs, [self.bits[one.step] for one in self.program.results[:-1]]

    def value(self, place: int) -> str:
        """Return a step's result as an expression of its own bits."""
        result, scale = self.still[place], 2.0 ** self.bits[place]
        if result is None or place in self.computed:
            return f"v{place}"
        if isinstance(result, list):
            numbers = tuple(float(round(one * scale)) for one in result)
            return f"{self.table(numbers)}[i]"
        return (
            str(int(result)) if isinstance(result, bool) else f"({self.whole(place)})"
        )

    def whole(self, place: int, bits: int | None = None) -> int:
        """Return a constant as a whole number of some bits behind the point."""
        number = self.still[place]
        bits = self.bits[place] if bits is None else bits
        return round(number * 2.0**bits) if isinstance(number, float) else 0

    def _text(self, place: int) -> str:
        step, bits = self.steps[place], self.bits[place]
        if step.operation == "input":
            line = self.program.inputs.index(step.name)
            low, high = (math.trunc(end * 2.0**bits) for end in self.ranges[line])
            value = f"x[{line}]"
            return f"{value} < {low} ? {low} : {value} > {high} ? {high} : {value}"
        if step.operation == "index":
            return _shifted("i", bits)
        if step.operation in ("and", "or", "not"):
            return super().expression(step)
        if step.table:
            return self._lookup(step, bits)
        if step.operation in _EDGES:
            return self._comparison(step)
        if step.operation in ("multiply", "divide"):
            a, b = (self.value(one) for one in step.arguments)
            first, second = (self.bits[one] for one in step.arguments)
            if step.operation == "divide":
                return f"{_shifted(a, bits + second - first)} / {b}"
            return _shifted(f"(name_wide){a} * {b}", bits - first - second)
        numbers = [self._at(one, bits) for one in step.arguments]
        match step.operation:
            case "negate":
                return f"-{numbers[0]}"
            case "absolute":
                return f"{numbers[0]} < 0 ? -{numbers[0]} : {numbers[0]}"
            case "where":
                truth = self.value(step.arguments[0])
                return f"{truth} ? {numbers[1]} : {numbers[2]}"
            case "minimum" | "maximum":
                sign = "<" if step.operation == "minimum" else ">"
                return f"{numbers[0]} {sign} {numbers[1]} ? {numbers[0]} : {numbers[1]}"
            case _:
                return f"{numbers[0]} {_SHIFTED[step.operation]} {numbers[1]}"

    def _comparison(self, step: Step) -> str:
        """Compare; constants are rounded so that every whole number compares alike."""
        numbers = [self.still[place] for place in step.arguments]
        pairs = zip(step.arguments, numbers, strict=True)
        finest = max(self.bits[place] for place, n in pairs if not isinstance(n, float))
        texts: list[str] = []
        ways = zip(step.arguments, numbers, _EDGES[step.operation], strict=True)
        for place, number, way in ways:
            if not isinstance(number, float):
                texts.append(self._at(place, finest))
                continue
            end = 2.0**self.fixed.bits
            exact = min(max(number * 2.0**finest, -end), end)
            if math.isnan(number) or (step.operation == "equal" and exact % 1.0):
                return "0"
            texts.append(f"({way(exact)})")
        return f"{texts[0]} {self.signs[step.operation]} {texts[1]}"

    def _lookup(self, step: Step, bits: int) -> str:
        """Return a place among whole numbers, or the whole number at a place."""
        (place,) = step.arguments
        self.needs.add(step.operation)
        scale, operand = 2.0**bits, self._at(place, 0)
        if step.operation == "below":  # a whole number is above t if above its floor
            scale, operand = 2.0 ** self.bits[place], self.value(place)
        way = np.floor if step.operation == "below" else np.round
        largest = 2.0**self.fixed.bits - 1.0
        whole = np.clip(way(np.array(step.table) * scale), -largest, largest)
        table = self.table(tuple(whole.tolist()))
        return f"name_{step.operation}({table}, {len(whole)}u, {operand})"

    def _at(self, place: int, bits: int) -> str:
        if isinstance(self.still[place], float):
            return f"({self.whole(place, bits)})"
        if bits - self.bits[place] > self.fixed.bits + 1:
            raise ValueError(
                f"fixed point: {self.program.titles[place]!r} meets a number that is "
                "too small beside it; take float32"
            )
        return _shifted(self.value(place), bits - self.bits[place])

    def _shared_calls(self) -> dict[int, Call]:
        """Return no terms: their steps have bits of their own."""
        return {}

    def _declared(self, place: int) -> str:
        if self.steps[place].kind == "truth":
            return f"const int v{place} = {self._text(place)}"
        return f"const name_real v{place} = (name_real)({self._text(place)})"

    def _halves(self, totals: Sequence[int], count: int) -> Iterator[str]:
        """Yield a loop that sums samples: whole numbers, in any order."""
        sources = {place: self.steps[place].arguments[0] for place in totals}
        for place in totals:
            yield f"    name_wide h{place} = 0;\n"
        yield f"    for (i = 0; i < {count}u; i++) {{\n"
        for place in self._needed(sources.values(), is_loop=True):
            yield f"        {self._declared(place)};\n"
        for place, source in sources.items():
            yield f"        h{place} += {self.value(source)};\n"
        yield "    }\n"
        for place, source in sources.items():
            total = _shifted(f"h{place}", self.bits[place] - self.bits[source])
            yield f"    const name_real v{place} = (name_real)({total});\n"


def _shifted(text: str, bits: int) -> str:
    """Return a whole number with more bits behind the point, or fewer."""
    if bits == 0:
        return text
    if bits < 0:
        return f"(({text}) >> {-bits})"
    return f"((name_wide)({text}) * ((name_wide)1 << {bits}))"


def _exact(_: int, __: FloatArray) -> FloatArray:
    """Round nothing."""
    return np.zeros(1)


def _decided(
    program: Program, ranges: Sequence[tuple[float, float]]
) -> tuple[Program, list[int]]:
    """Return a program without choices that are the same for all inputs in ranges.

    And of each step before, which one has its result now.
    """
    sizes = worst_over(program, ranges, _exact).sizes
    new: list[int] = []
    steps: list[Step] = []
    for place, step in enumerate(program.steps):
        arguments = tuple(new[one] for one in step.arguments)
        steps.append(replace(step, arguments=arguments))
        chosen = place
        if step.operation == "where" and not np.isnan(sizes[step.arguments[0]]):
            end = arguments[1 if sizes[step.arguments[0]] else 2]
            chosen = end if steps[end].samples == step.samples else place
        new.append(chosen)
    results = tuple(replace(one, step=new[one.step]) for one in program.results)
    return replace(program, steps=tuple(steps), results=results), new


def _in_tables(program: Program) -> Program:
    """Return a program that looks up what can be computed beforehand.

    That is what no input enters, samples if whole numbers cannot compute them, and
    operations on numbers that are looked up at one place. A quotient by such numbers
    is a product with their reciprocals: exact numbers stay the same.
    """
    steps, still = [*program.steps], still_results(program)
    divisors = {step.arguments[1] for step in steps if step.operation == "divide"}
    for step in steps:
        count = 1 if step.operation == "divide" else len(step.arguments)
        divisors.difference_update(step.arguments[:count])
    divisors.difference_update(result.step for result in program.results)
    indexes = {s.samples: p for p, s in enumerate(steps) if s.operation == "index"}
    foreign, turned = set[int](), set[int]()
    for place, step in enumerate(steps):
        table, values = _joint_table(steps, step), still[place]
        if foreign & {*step.arguments} or step.operation not in _OPERATIONS | _TRUTHS:
            foreign.add(place)
            if isinstance(values, list) and step.kind == "number":
                table = indexes[step.samples], np.array(values)
        if isinstance(values, float):
            steps[place] = Step("constant", number=values)
        elif step.operation == "divide" and step.arguments[1] in turned:
            steps[place] = replace(step, operation="multiply")
        elif table is not None and np.isfinite(table[1]).all():
            numbers = table[1]
            if place in divisors and numbers.all():
                turned.add(place)
                numbers = 1.0 / numbers
            row = tuple(map(float, numbers))
            steps[place] = Step("pick", (table[0],), table=row, samples=step.samples)
    return replace(program, steps=tuple(steps))


def _joint_table(steps: Sequence[Step], step: Step) -> tuple[int, FloatArray] | None:
    """Return what an operation makes of numbers that stand at one place of tables."""
    operands = [steps[place] for place in step.arguments]
    places = {one.arguments[0] for one in operands if one.operation == "pick"}
    is_looked_up = all(one.operation in ("pick", "constant") for one in operands)
    if len(places) != 1 or not is_looked_up or step.operation not in _FOLDED:
        return None
    tables = [np.array(one.table or [one.number]) for one in operands]
    with np.errstate(all="ignore"):
        return places.pop(), np.asarray(ARRAYS[step.operation](*tables))


def _fitted(
    program: Program, ranges: Sequence[tuple[float, float]], numbers: FixedNumbers
) -> tuple[list[int], Worst]:
    """Return how many bits each step has behind the point, and the worst errors."""
    needed = needed_steps(program.steps, program.results)
    for place in needed:
        operation = program.steps[place].operation
        if operation not in _OPERATIONS | _TRUTHS | _LOOKED_UP:
            is_end = operation in OVER_SAMPLES or operation == "running"
            hint = "take the centroid" if is_end else "pass a tolerance, such as 1e-3"
            raise ValueError(
                f"fixed point has no {operation.replace('_', ' ')}, which "
                f"{program.titles[place]!r} needs; {hint}"
            )
    worst = worst_over(program, ranges, _exact)
    for _ in range(_TRIES):
        bits = _bits(program, worst.sizes, numbers, needed)
        before, worst = worst, worst_over(program, ranges, _rounding(program, bits, {}))
        sizes = np.array([worst.sizes[p] * 2.0 ** bits[p] for p in needed])
        if not (sizes >= 2.0**numbers.bits).any():  # of truths they may be none
            return bits, worst
        worst = worst._replace(sizes=np.fmax(worst.sizes, before.sizes))
    raise ValueError(
        f"fixed point: errors grow beyond numbers of {numbers.bits + 1} bits; "
        f"take {'q31 or ' * (numbers is Q15)}float32"
    )


def _bits(
    program: Program, sizes: FloatArray, numbers: FixedNumbers, needed: Sequence[int]
) -> list[int]:
    bits = [0] * len(program.steps)
    for place in needed:
        step, size = program.steps[place], float(sizes[place])
        if step.kind == "truth" or step.operation == "below":
            continue
        if not math.isfinite(size):
            raise ValueError(
                f"fixed point: {program.titles[place]!r} has no range, because it "
                "divides by what may be 0 where no rule applies; add a rule there"
            )
        bits[place] = numbers.bits - (math.frexp(size)[1] if size else 0)
        if step.operation == "divide":
            over, under = (bits[one] for one in step.arguments)
            bits[place] = min(bits[place], numbers.bits + over - under)
    return bits


def _rounding(
    program: Program, bits: Sequence[int], off: Mapping[int, float]
) -> Rounding:
    """Return by how much steps are rounded, and are off what they stand for."""
    factors = {result.step for result in program.results}
    for step in program.steps:
        if step.operation in ("multiply", "divide"):
            factors.update(step.arguments)

    def rounding(place: int, size: FloatArray) -> FloatArray:
        step, unit = program.steps[place], 2.0 ** -bits[place]
        slack: FloatArray = 2.0**-48 * size + off.get(place, 0.0)
        if step.operation == "constant" and place not in factors:
            return np.zeros(1)  # what takes it rounds it
        if step.operation in ("index", "constant"):
            return np.abs(size - np.round(size / unit) * unit)
        if step.operation in ("multiply", "divide"):
            return unit + slack
        if step.table:
            table = np.array(step.table) * (step.operation == "pick")
            return np.array([np.abs(table - np.round(table / unit) * unit).max()])
        lost = 0
        for one in step.arguments:
            number = program.steps[one].number / unit
            is_constant = program.steps[one].operation == "constant"
            lost += number % 1.0 > 0 if is_constant else bits[one] > bits[place]
        return lost * unit + slack

    return rounding

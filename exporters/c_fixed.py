"""The steps of a program in whole numbers, each with a number of bits behind the point.

How far each step can be from 0 comes from the ranges of the inputs; so does the number
of its bits, such that nothing overflows. Values outside the ranges are moved to their
ends. Products, quotients and sums are computed in twice as many bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.exporters.c_steps import Call, CSteps
from fuzzytree.exporters.c_text import CNumbers
from fuzzytree.exporters.program_text import SystemExample
from fuzzytree.model import FloatArray
from fuzzytree.semantics import (
    OVER_SAMPLES,
    Program,
    Rounding,
    Step,
    Worst,
    evaluate_program,
    needed_steps,
    worst_over,
)

_SHIFTED = {"add": "+", "subtract": "-"}
_OPERATIONS = frozenset(
    ("constant", "input", "index", "add", "subtract", "multiply", "divide", "minimum")
) | {"maximum", "negate", "absolute", "where", "total", "less", "at_most", "equal"}
_TRUTHS = frozenset(("and", "or", "not", "less", "at_most", "equal"))
_TRIES = 8


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
        tables: Whether all samples that no input enters are tables.

    Attributes:
        bits: Behind the point, of each step.
        worst: The worst errors of its results.

    Raises:
        ValueError: If a step has no range or bound, or is none of whole numbers.
    """

    def __init__(
        self,
        program: Program,
        ranges: Sequence[tuple[float, float]],
        numbers: FixedNumbers,
        *,
        tables: bool = False,
    ) -> None:
        program = _decided(program, ranges)
        self.fixed, self.ranges = numbers, ranges
        self.bits, self.worst = _fitted(program, ranges, numbers)
        for result, share in zip(program.results, self.worst.shares, strict=True):
            if share > 0.0:
                raise ValueError(
                    f"fixed point: the error of {result.title!r} has no bound, as a "
                    "rounded number may decide a choice or divide by 0; take float32"
                )
        super().__init__(program, numbers, {}, tables=tables)

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
        scales, units = (2.0 ** np.array(bits) for bits in self._end_bits())
        low, high = np.array(self.ranges).reshape(-1, 2).T
        errors = (np.ceil(self.worst.errors[:-1] * units) + 1.0).tolist()
        for row in rows:
            inside = np.clip(np.where(np.isfinite(row), row, low), low, high)
            line = np.trunc(inside * scales) + 0.0  # sums have no -0
            values = dict(zip(self.program.inputs, line / scales, strict=True))
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
        if step.operation in ("less", "at_most", "equal"):
            finest = max(self.bits[one] for one in step.arguments)
            a, b = (self._at(one, finest) for one in step.arguments)
            return f"{a} {self.signs[step.operation]} {b}"
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


def _decided(program: Program, ranges: Sequence[tuple[float, float]]) -> Program:
    """Return a program without choices that are the same for all inputs in ranges."""
    sizes = worst_over(program, ranges, lambda _, __: np.zeros(1)).sizes
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
    return replace(program, steps=tuple(steps), results=results)


def _fitted(
    program: Program, ranges: Sequence[tuple[float, float]], numbers: FixedNumbers
) -> tuple[list[int], Worst]:
    """Return how many bits each step has behind the point, and the worst errors.

    Raises:
        ValueError: As for `FixedSteps`.
    """
    needed = needed_steps(program.steps, program.results)
    for place in needed:
        operation = program.steps[place].operation
        if operation not in _OPERATIONS | _TRUTHS:
            is_end = operation in OVER_SAMPLES or operation == "running"
            hint = "take the centroid" if is_end else "approximate curves by points"
            raise ValueError(
                f"fixed point has no {operation.replace('_', ' ')}, which "
                f"{program.titles[place]!r} needs; {hint}"
            )
    exact: Rounding = lambda _, __: np.zeros(1)  # noqa: E731
    worst = worst_over(program, ranges, exact)
    for _ in range(_TRIES):
        bits = _bits(program, worst.sizes, numbers, needed)
        before, worst = worst, worst_over(program, ranges, _rounding(program, bits))
        sizes = np.array([worst.sizes[p] * 2.0 ** bits[p] for p in needed])
        if (sizes < 2.0**numbers.bits).all():
            return bits, worst
        worst = worst._replace(sizes=np.fmax(worst.sizes, before.sizes))
    raise ValueError("fixed point: errors grow beyond the numbers; take q31 or float32")


def _bits(
    program: Program, sizes: FloatArray, numbers: FixedNumbers, needed: Sequence[int]
) -> list[int]:
    bits = [0] * len(program.steps)
    for place in needed:
        step, size = program.steps[place], float(sizes[place])
        if step.kind == "truth":
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


def _rounding(program: Program, bits: Sequence[int]) -> Rounding:
    def rounding(place: int, size: FloatArray) -> FloatArray:
        step, unit = program.steps[place], 2.0 ** -bits[place]
        slack: FloatArray = 2.0**-48 * size
        if step.operation in ("index", "constant"):
            return np.abs(size - np.round(size / unit) * unit)
        if step.operation in ("multiply", "divide"):
            return unit + slack
        lost = 0
        for one in step.arguments:
            number = program.steps[one].number / unit
            is_constant = program.steps[one].operation == "constant"
            lost += number % 1.0 > 0 if is_constant else bits[one] > bits[place]
        return lost * unit + slack

    return rounding

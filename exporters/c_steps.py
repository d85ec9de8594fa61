"""The steps of a program as statements of C, straight on, with loops over samples."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.exporters.c_text import (
    DOUBLE,
    CNumbers,
    bits_of,
    place_type,
    real_lines,
)
from fuzzytree.exporters.program_text import StepText
from fuzzytree.semantics import (
    INEXACT,
    OVER_SAMPLES,
    Program,
    Result,
    Step,
)

LIBRARY: Mapping[str, str] = {
    "absolute": "fabs",
    "floor": "floor",
    "ceiling": "ceil",
    "round": "nearbyint",
    "square_root": "sqrt",
    "exponential": "exp",
    "logarithm": "log",
    "logarithm_10": "log10",
    "logarithm_1p": "log1p",
    "sine": "sin",
    "cosine": "cos",
    "tangent": "tan",
    "arc_sine": "asin",
    "arc_cosine": "acos",
    "arc_tangent": "atan",
    "hyperbolic_sine": "sinh",
    "hyperbolic_cosine": "cosh",
    "hyperbolic_tangent": "tanh",
    "area_sine": "asinh",
    "area_cosine": "acosh",
    "area_tangent": "atanh",
    "power": "pow",
    "remainder": "fmod",
    "arc_tangent_2": "atan2",
}
"""Functions of math.h."""

HELPERS: Mapping[str, str] = {
    "minimum": """
static name_real name_minimum(name_real a, name_real b)
{
    return a < b || a != a ? a : b;
}
""",
    "maximum": """
static name_real name_maximum(name_real a, name_real b)
{
    return a > b || a != a ? a : b;
}
""",
    "is_finite": """
static int name_is_finite(name_real value)
{
    union { name_real value; UINT bits; } look;
    look.value = value;
    return ~HIGH << 1 >> REST != 0;
}
""",
    "absolute": """
static name_real name_absolute(name_real a)
{
    return a < 0 ? -a : a + 0; /* the sum has no -0 */
}
""",
    "round": """
/* To the nearest whole number, ties to even; for less than a quarter of big. */
static name_real name_round(name_real a)
{
    const name_real big = BIG;
    return a < 0 ? -(big - a - big) : a + big - big;
}
""",
    "below": """
/* How many numbers of a rising table are below a. */
static name_real name_below(const name_real *table, name_place count, name_real a)
{
    name_place low = 0, middle;
    while (low < count) {
        middle = (low + count) / 2;
        if (table[middle] < a)
            low = middle + 1;
        else
            count = middle;
    }
    return (name_real)low;
}
""",
    "pick": """
/* The number of a table at place a, its first one if there is none. */
static name_real name_pick(const name_real *table, name_place count, name_real a)
{
    return table[a >= 0 && a < (name_real)count ? (name_place)a : 0];
}
""",
    "total": """
/* Add the k-th term to a sum by halves: level l holds the sum of 2^l terms. */
static void name_add(name_real *level, name_place k, name_real term)
{
    for (; k & 1u; k >>= 1)
        term = *level++ + term;
    *level = term;
}

/* The place behind place i in the order of such a sum: carry from the left. */
static name_place name_next(name_place i, name_place half)
{
    for (; i & half; half >>= 1)
        i ^= half;
    return i | half;
}
""",
    "bits": """
/* The number that has some bits: infinite, or none. */
static name_real name_bits(UINT bits)
{
    union { UINT bits; name_real value; } made;
    made.bits = bits;
    return made.value;
}
""",
}
"""Functions that some operations need, with words for a type of numbers."""

WORDS: Mapping[str, Mapping[str, str]] = {
    "double": {
        "UINT": "uint64_t",
        "HIGH": "(uint32_t)(look.bits >> 32)",
        "REST": "21",
        "BIG": "6755399441055744.0",
    },
    "float": {
        "UINT": "uint32_t",
        "HIGH": "look.bits",
        "REST": "24",
        "BIG": "12582912.0f",
    },
}
"""The words of those functions, by type."""

_CARRIED = ("last", "highest", "lowest")  # along a loop
_REDUCED = {"highest": "maximum", "lowest": "minimum"}
_STEP_BYTES, _CALL_BYTES = 24, 16  # of code, about
_FEWEST_STEPS = 3  # of a function that several terms share


def number_text(value: float, numbers: CNumbers = DOUBLE) -> str:
    """Return a number as it may stand in an expression."""
    if math.isfinite(value):
        text = f"{numbers.text(value)} /* {numbers.shown(value)} */"
        return f"({text})" if text.startswith("-") else text
    return f"name_bits({bits_of([value], numbers)[1:-1]})"


class Call(NamedTuple):
    """A term's degree as the call of a function of its value and some constants."""

    function: Program
    argument: int
    constants: tuple[float, ...]


class CSteps(StepText):
    """Writes the steps of one program.

    What no input enters is computed here, once: single numbers stand in expressions,
    those of samples in tables, unless the code that computes them again is smaller.
    What has samples is computed in loops, again in each loop that needs it, so that no
    samples are kept. A loop for sums by halves takes the samples in the order in which
    these are added. Running sums need the other order; what a sum by halves needs of
    them is kept: truths, if it can be.

    Terms whose degrees are the same steps with other constants share a function.

    Args:
        program: The program.
        numbers: The type of all numbers.
        tables: Whether all samples that no input enters are tables.
        library: By operation, which functions of math.h may be called; others are
            helpers with the operation's name.
    """

    def __init__(
        self,
        program: Program,
        numbers: CNumbers = DOUBLE,
        library: Mapping[str, str] = LIBRARY,
        *,
        tables: bool = False,
    ) -> None:
        super().__init__(program)
        self.numbers, self.library = numbers, library
        self.tables: dict[tuple[float, ...], str] = {}
        self.functions: dict[Program, list[tuple[float, ...]]] = {}
        self.calls = self._shared_calls()
        self.computed = set[int]() if tables else self._computed_samples()
        self.round = self._rounds()
        self.kept: set[int] = set()
        self.sums: set[int] = set()
        self.body = list(self._body())

    @property
    def needs_library(self) -> bool:
        """Whether math.h is needed, for functions or for infinite numbers in tables."""
        is_finite = all(math.isfinite(one) for table in self.tables for one in table)
        return not (is_finite and self.needs.isdisjoint(self.library))

    @property
    def place_type(self) -> str:
        """The type of places in tables and among samples."""
        sizes = [step.samples for step in self.steps]
        return place_type(2 * max([*sizes, *map(len, self.tables), 1]))

    def function_text(self) -> Iterator[str]:
        """Yield the tables, the helpers that the steps call, and shared functions."""
        functions: list[str] = []
        for number, (program, rows) in enumerate(self.functions.items()):
            steps = _SharedSteps(program, self)
            kind, width = f"static const name_real name_c{number}", len(rows[0])
            functions.append(f"\n{kind}[{len(rows)}][{width}] = {{\n")
            for row in rows:
                functions += ["    {\n", *real_lines(row, self.numbers), "    },\n"]
            functions.append(f"}};\n\nstatic name_real name_f{number}(")
            functions += ["name_real x, const name_real *c)\n{\n", *steps.body]
            functions.append(
                f"    return {steps.value(program.results[0].step)};\n}}\n"
            )
        yield f"typedef {self.place_type} name_place;\n"
        for values, name in self.tables.items():
            yield f"static const name_real {name}[{len(values)}] = {{\n"
            yield from real_lines(values, self.numbers)
            yield "};\n"
        for name, text in HELPERS.items():
            if name in self.needs and name not in self.library:
                for mark, word in WORDS.get(self.numbers.name, {}).items():
                    text = text.replace(mark, word)
                yield text
        yield from functions

    def value(self, place: int) -> str:
        """Return a step's result as an expression, within a loop if it has samples."""
        result = self.still[place]
        if result is None or place in self.computed:
            return f"s{place}[i]" if place in self.kept else f"v{place}"
        if isinstance(result, list):
            return f"{self.table(tuple(map(float, result)))}[i]"
        if isinstance(result, bool):
            return str(int(result))
        if not math.isfinite(result):
            self.needs.add("bits")
        return number_text(result, self.numbers)

    def table(self, values: tuple[float, ...]) -> str:
        """Return the name of a table."""
        return self.tables.setdefault(values, f"name_t{len(self.tables)}")

    def expression(self, step: Step) -> str:
        """Return a step as an expression."""
        return "(name_real)i" if step.operation == "index" else super().expression(step)

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function of math.h, or of a helper."""
        self.needs.add(step.operation)
        if step.operation in self.library:
            return f"{self.library[step.operation]}({', '.join(operands)})"
        if step.table:
            operands = [self.table(step.table), f"{len(step.table)}u", *operands]
        return f"name_{step.operation}({', '.join(operands)})"

    def _operands(self, place: int) -> tuple[int, ...]:
        """Return the steps that a statement needs."""
        call = self.calls.get(place)
        return self.steps[place].arguments if call is None else (call.argument,)

    def _text(self, place: int) -> str:
        """Return the expression of a step."""
        call = self.calls.get(place)
        if call is None:
            return self.expression(self.steps[place])
        rows = self.functions.setdefault(call.function, [])
        if call.constants not in rows:
            rows.append(call.constants)
        number = list(self.functions).index(call.function)
        row = rows.index(call.constants)
        return f"name_f{number}({self.value(call.argument)}, name_c{number}[{row}])"

    def _shared_calls(self) -> dict[int, Call]:
        """Return the terms of which several are the same function."""
        titled = zip(self.program.titles, self.steps, strict=True)
        terms = [p for p, one in enumerate(titled) if " is " in one[0]]
        parts = {p for p in terms if _is_part(self.program.titles[p], self.steps[p])}
        every = [(p, self._call(p, parts)) for p in terms if p not in parts]
        calls = {place: call for place, call in every if call is not None}
        uses = Counter(call.function for call in calls.values())
        return {place: call for place, call in calls.items() if uses[call.function] > 1}

    def _call(self, root: int, parts: Set[int]) -> Call | None:
        """Return a term's degree as a function of the only value that enters it."""
        steps, values, constants = [Step("input", name="x")], set[int](), list[float]()

        def add(place: int) -> int:
            step, number = self.steps[place], self.still[place]
            if isinstance(number, float) and math.isfinite(number):
                if number in (0.0, 1.0):
                    steps.append(Step("constant", number=number))
                else:
                    steps.append(Step("input", name=f"c[{len(constants)}]"))
                    constants.append(number)
            elif place == root or place in parts:
                arguments = tuple(map(add, step.arguments))
                steps.append(replace(step, arguments=arguments, samples=0))
            else:
                values.add(place)
                return 0
            return len(steps) - 1

        result = Result("output", "degree", add(root))
        names = tuple(step.name for step in steps if step.operation == "input")
        few = len(steps) - len(names) < _FEWEST_STEPS
        if few or not constants or len(values) != 1:
            return None
        function = Program("term", names, tuple(steps), (result,), ("",) * len(steps))
        return Call(function, values.pop(), tuple(constants))

    def _computed_samples(self) -> set[int]:
        """Return the samples that no input enters and that are computed all the same.

        That is where they take less code than a table, and each operation has one
        result everywhere.
        """
        size = np.dtype(self.numbers.kind).itemsize
        computed: set[int] = set()
        for place, step in enumerate(self.steps):
            if self.still[place] is None:
                for argument in self._operands(place):
                    inner = self._sampled(argument)
                    costs = [
                        _CALL_BYTES + size * len(self.calls[p].constants)
                        if p in self.calls
                        else _STEP_BYTES + size * len(self.steps[p].table)
                        for p in inner
                    ]
                    is_exact = all(self._is_exact(p) for p in inner)
                    if is_exact and sum(costs) < size * step.samples:
                        computed |= inner
        return computed

    def _is_exact(self, place: int) -> bool:
        """Return whether what a step's text does has one result everywhere."""
        call = self.calls.get(place)
        steps = [self.steps[place]] if call is None else call.function.steps
        return all(step.operation not in INEXACT for step in steps)

    def _sampled(self, root: int) -> set[int]:
        """Return a step of samples that no input enters, and those that it needs."""
        inner: set[int] = set()
        todo = [root]
        while todo:
            place = todo.pop()
            is_sampled = self.still[place] is not None and self.steps[place].samples
            if is_sampled and place not in inner:
                inner.add(place)
                todo += self._operands(place)
        return inner

    def _is_moving(self, place: int) -> bool:
        return self.still[place] is None or place in self.computed

    def _rounds(self) -> list[int]:
        """Return after how many loops each step can be computed."""
        result: list[int] = []
        for place, step in enumerate(self.steps):
            moving = [a for a in self._operands(place) if self.still[a] is None]
            after = max((result[a] for a in moving), default=0)
            is_reduced = step.operation in OVER_SAMPLES
            result.append(0 if self.still[place] is not None else after + is_reduced)
        return result

    def _needed(self, places: Iterable[int], *, is_loop: bool = False) -> list[int]:
        """Return what some steps need and is not kept; for a loop, of samples only."""
        needed: set[int] = set()
        todo = [place for place in places if self._is_moving(place)]
        while todo:
            place = todo.pop()
            if place in needed or (is_loop and place in self.kept):
                continue
            if not is_loop or self.steps[place].samples:
                needed.add(place)
                todo += [a for a in self._operands(place) if self._is_moving(a)]
        return sorted(needed)

    def _body(self) -> Iterator[str]:
        needed = self._needed(result.step for result in self.program.results)
        needed = [p for p in needed if self.still[p] is None]
        for turn in range(max((self.round[p] for p in needed), default=0) + 1):
            for place in needed:
                step = self.steps[place]
                is_single = not (step.samples or step.operation in OVER_SAMPLES)
                if is_single and self.round[place] == turn:
                    yield f"    {self._declared(place)};\n"
            ends = [
                p
                for p in needed
                if self.steps[p].operation in OVER_SAMPLES and self.round[p] == turn + 1
            ]
            counts = {p: self.steps[self.steps[p].arguments[0]].samples for p in ends}
            for count in dict.fromkeys(counts.values()):
                own = [p for p in ends if counts[p] == count]
                totals = [p for p in own if self.steps[p].operation == "total"]
                carried = [p for p in own if p not in totals]
                keep = self._to_keep([self.steps[p].arguments[0] for p in totals])
                if carried or keep:
                    yield from self._loop(carried, sorted(keep), count)
                self.kept |= keep
                if totals:
                    yield from self._halves(totals, count)

    def _to_keep(self, places: Sequence[int]) -> set[int]:
        """Return what sums by halves need of running sums: truths, if it can be."""
        keep: set[int] = set()
        for place in places:
            inner = self._needed([place], is_loop=True)
            step = self.steps[place]
            if any(self.steps[p].operation == "running" for p in inner):
                if step.kind == "truth" or step.operation == "running":
                    keep.add(place)
                else:
                    keep |= self._to_keep(self._operands(place))
        return keep

    def _declared(self, place: int) -> str:
        return f"const {self._type(place)} v{place} = {self._text(place)}"

    def _type(self, place: int) -> str:
        return "int" if self.steps[place].kind == "truth" else "name_real"

    def _loop(
        self, carried: Sequence[int], keep: Sequence[int], count: int
    ) -> Iterator[str]:
        """Yield a loop over samples in order, and what it carries along."""
        sources = [self.steps[p].arguments[0] for p in carried]
        places = self._needed([*sources, *keep], is_loop=True)
        running = [p for p in places if self.steps[p].operation == "running"]
        for place in keep:
            is_truth = self.steps[place].kind == "truth"
            kind = "unsigned char" if is_truth else "name_real"
            yield f"    {kind} s{place}[{count}];\n"
        for place in carried:
            yield f"    name_real v{place} = 0;\n"
        for place in running:
            if place not in self.sums:
                self.sums.add(place)
                yield f"    name_real r{place} = 0;\n"
        yield f"    for (i = 0; i < {count}u; i++) {{\n"
        for place in places:
            if place in running:
                term = self.value(self.steps[place].arguments[0])
                yield f"        r{place} = i == 0 ? {term} : r{place} + {term};\n"
                yield f"        const name_real v{place} = r{place};\n"
            else:
                yield f"        {self._declared(place)};\n"
        for place in keep:
            cast = "(unsigned char)" if self.steps[place].kind == "truth" else ""
            yield f"        s{place}[i] = {cast}v{place};\n"
        for place in carried:
            yield f"        {self._carried(place)};\n"
        yield "    }\n"

    def _carried(self, place: int) -> str:
        step = self.steps[place]
        operands = self.value(step.arguments[0])
        if step.operation == "last":
            return f"v{place} = {operands}"
        helper = _REDUCED[step.operation]
        self.needs.add(helper)
        return f"v{place} = i == 0 ? {operands} : name_{helper}(v{place}, {operands})"

    def _halves(self, totals: Sequence[int], count: int) -> Iterator[str]:
        """Yield a loop over samples in the order in which they are summed by halves."""
        self.needs.add("total")
        depth = (count - 1).bit_length()
        for place in totals:
            yield f"    name_real h{place}[{depth + 1}];\n"
        half = (1 << depth) // 2
        turns = f"i = 0, k = 0; k < {1 << depth}u; i = name_next(i, {half}u), k++"
        yield f"    for ({turns}) {{\n"
        for place in totals:
            yield f"        name_real a{place} = 0;\n"
        yield f"        if (i < {count}u) {{\n"
        sources = {place: self.steps[place].arguments[0] for place in totals}
        for place in self._needed(sources.values(), is_loop=True):
            yield f"            {self._declared(place)};\n"
        for place, source in sources.items():
            yield f"            a{place} = {self.value(source)};\n"
        yield "        }\n"
        for place in totals:
            yield f"        name_add(h{place}, k, a{place});\n"
        yield "    }\n"
        for place in totals:
            yield f"    const name_real v{place} = h{place}[{depth}];\n"


class _SharedSteps(CSteps):
    """The steps of a function that several terms share."""

    def __init__(self, program: Program, owner: CSteps) -> None:
        self.owner = owner
        super().__init__(program, owner.numbers, owner.library)
        owner.needs |= self.needs

    def value(self, place: int) -> str:
        """Return a step's result; the inputs are the function's own parameters."""
        step = self.steps[place]
        return step.name if step.operation == "input" else super().value(place)

    def table(self, values: tuple[float, ...]) -> str:
        """Return the name of a table of the file."""
        return self.owner.table(values)

    def _is_moving(self, place: int) -> bool:
        return super()._is_moving(place) and self.steps[place].operation != "input"


def _is_part(title: str, step: Step) -> bool:
    return title.endswith(f" {step.operation.replace('_', ' ')}")

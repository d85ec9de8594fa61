"""The steps of a program as statements of C, straight on, with loops over samples."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.exporters.c_text import DOUBLE, bits_of, real_lines
from fuzzytree.exporters.program_text import StepText, SystemExample, system_examples
from fuzzytree.model import FuzzySystem
from fuzzytree.semantics import (
    OVER_SAMPLES,
    Program,
    Step,
    from_system,
    system_probes,
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
    union { name_real value; uint64_t bits; } look;
    look.value = value;
    return ~(uint32_t)(look.bits >> 32) << 1 >> 21 != 0;
}
""",
    "absolute": """
static name_real name_absolute(name_real a)
{
    return a < 0 ? -a : a + 0; /* the sum has no -0 */
}
""",
    "round": """
/* To the nearest whole number, ties to even; for less than 2^51. */
static name_real name_round(name_real a)
{
    const name_real big = 6755399441055744.0;
    return a < 0 ? -(big - a - big) : a + big - big;
}
""",
    "below": """
/* How many numbers of a rising table are below a. */
static name_real name_below(const name_real *table, unsigned long count, name_real a)
{
    unsigned long low = 0, middle;
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
static name_real name_pick(const name_real *table, unsigned long count, name_real a)
{
    return table[a >= 0 && a < (name_real)count ? (unsigned long)a : 0];
}
""",
    "total": """
/* The sum by halves of count numbers, and of zeros up to twice half. */
static name_real name_total(const name_real *s, unsigned long count, name_real *sums,
    unsigned long half)
{
    unsigned long i;
    for (i = 0; i < half; i++)
        sums[i] = s[i] + (i + half < count ? s[i + half] : 0);
    while (half > 1) {
        half /= 2;
        for (i = 0; i < half; i++)
            sums[i] += sums[i + half];
    }
    return sums[0];
}
""",
    "bits": """
/* The number that has some bits: infinite, or none. */
static name_real name_bits(uint64_t bits)
{
    union { uint64_t bits; name_real value; } made;
    made.bits = bits;
    return made.value;
}
""",
}
"""Functions that some operations need."""

_CARRIED = ("last", "highest", "lowest")  # along a loop
_REDUCED = {"highest": "maximum", "lowest": "minimum"}


def number_text(value: float) -> str:
    """Return a number as it may stand in an expression."""
    if math.isfinite(value):
        text = f"{DOUBLE.text(value)} /* {value!r} */"
        return f"({text})" if text.startswith("-") else text
    (bits,) = struct.unpack("<Q", struct.pack("<d", abs(value)))
    bits |= (1 << 63) * (value < 0)
    return f"name_bits(UINT64_C({bits:#018x}))"


class CSteps(StepText):
    """Writes the steps of one program.

    What no input enters is computed here, once: single numbers stand in expressions,
    those of samples in tables. What has samples is computed in loops, together as far
    as no sum over all samples is needed in between.

    Args:
        program: The program.
        library: By operation, which functions of math.h may be called; others are
            helpers with the operation's name.
    """

    def __init__(self, program: Program, library: Mapping[str, str] = LIBRARY) -> None:
        super().__init__(program)
        self.library = library
        self.tables: dict[tuple[float, ...], str] = {}
        self.round = self._rounds()
        self.kept = self._kept()
        self.body = list(self._body())

    @property
    def needs_library(self) -> bool:
        """Whether math.h is needed, for functions or for infinite numbers in tables."""
        is_finite = all(math.isfinite(one) for table in self.tables for one in table)
        return not (is_finite and self.needs.isdisjoint(self.library))

    def helper_text(self) -> Iterator[str]:
        """Yield the helpers that the steps call, but for functions of the library."""
        for name, text in HELPERS.items():
            if name in self.needs and name not in self.library:
                yield text

    def table_text(self) -> Iterator[str]:
        """Yield the tables."""
        for values, name in self.tables.items():
            yield f"static const double {name}[{len(values)}] = {{\n"
            yield from real_lines(values, DOUBLE)
            yield "};\n"

    def value(self, place: int) -> str:
        """Return a step's result as an expression, within a loop if it has samples."""
        result = self.still[place]
        if result is None:
            is_kept = place in self.kept and self.steps[place].samples
            return f"s{place}[i]" if is_kept else f"v{place}"
        if isinstance(result, list):
            return f"{self._table(tuple(map(float, result)))}[i]"
        if isinstance(result, bool):
            return str(int(result))
        if not math.isfinite(result):
            self.needs.add("bits")
        return number_text(result)

    def _table(self, values: tuple[float, ...]) -> str:
        """Return the name of a table."""
        return self.tables.setdefault(values, f"name_t{len(self.tables)}")

    def _rounds(self) -> list[int]:
        """Return after how many loops each step can be computed."""
        result: list[int] = []
        for place, step in enumerate(self.steps):
            moving = [a for a in step.arguments if self.still[a] is None]
            after = max((result[a] for a in moving), default=0)
            is_reduced = not step.samples and any(self.steps[a].samples for a in moving)
            result.append(0 if self.still[place] is not None else after + is_reduced)
        return result

    def _kept(self) -> set[int]:
        """Return the steps with samples that a later loop needs, or a sum by halves."""
        kept: set[int] = set()
        for place, step in enumerate(self.steps):
            if step.operation in _CARRIED:
                continue
            for argument in step.arguments:
                is_moving = self.still[argument] is None
                if is_moving and self.steps[argument].samples:
                    is_later = self.round[place] > self.round[argument]
                    if is_later or step.operation == "total":
                        kept.add(argument)
        return kept

    def _body(self) -> Iterator[str]:
        moving = [p for p, result in enumerate(self.still) if result is None]
        for turn in range(max((self.round[p] for p in moving), default=0) + 1):
            now = [p for p in moving if self.round[p] == turn]
            for place in now:
                if self.steps[place].operation == "total":
                    yield from self._total(place)
            for place in now:
                step = self.steps[place]
                if not (step.samples or step.operation in OVER_SAMPLES):
                    yield f"    {self._declared(place)};\n"
            for count in dict.fromkeys(self.steps[p].samples for p in now):
                if count:
                    own = [p for p in now if self.steps[p].samples == count]
                    yield from self._loop(own, count)

    def _declared(self, place: int) -> str:
        text = self.expression(self.steps[place])
        return f"const {self._type(place)} v{place} = {text}"

    def _type(self, place: int) -> str:
        return "int" if self.steps[place].kind == "truth" else "name_real"

    def _loop(self, places: Sequence[int], count: int) -> Iterator[str]:
        """Yield a loop over samples, and what it carries along."""
        carried = [
            place
            for place, step in enumerate(self.steps)
            if step.operation in _CARRIED
            and self.still[place] is None
            and step.arguments[0] in places
        ]
        running = [p for p in places if self.steps[p].operation == "running"]
        for place in places:
            if place in self.kept:
                yield f"    {self._type(place)} s{place}[{count}];\n"
        for place in carried:
            yield f"    name_real v{place} = 0;\n"
        for place in running:
            yield f"    name_real r{place} = 0;\n"
        yield f"    for (i = 0; i < {count}; i++) {{\n"
        for place in places:
            if place in running:
                (argument,) = self.steps[place].arguments
                term = self.value(argument)
                yield f"        r{place} = i == 0 ? {term} : r{place} + {term};\n"
            if place in self.kept:
                step = self.steps[place]
                text = f"r{place}" if place in running else self.expression(step)
                yield f"        s{place}[i] = {text};\n"
            elif place in running:
                yield f"        const name_real v{place} = r{place};\n"
            else:
                yield f"        {self._declared(place)};\n"
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

    def _total(self, place: int) -> Iterator[str]:
        """Yield statements that sum an array by halves."""
        (source,) = self.steps[place].arguments
        count = self.steps[source].samples
        half = max(1 << (count - 1).bit_length() >> 1, 1)
        self.needs.add("total")
        yield f"    name_real h{place}[{half}];\n"
        yield f"    const name_real v{place} = name_total("
        yield f"s{source}, {count}u, h{place}, {half}u);\n"

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function of math.h, or of a helper."""
        self.needs.add(step.operation)
        if step.operation in self.library:
            return f"{self.library[step.operation]}({', '.join(operands)})"
        if step.table:
            operands = [self._table(step.table), f"{len(step.table)}u", *operands]
        return f"name_{step.operation}({', '.join(operands)})"


_ROWS = 100
_PROBES = 400
_FEWEST = 20
_RULES = 20_000  # rules of all rows that are tried, together
_SHARE = 1e-6  # of a number: its error where no bound is known

SYSTEM_TYPES = """
#ifdef __cplusplus
extern "C" {
#endif

enum name_status {
    NAME_DECIDED = 0,
    NAME_UNCOVERED = 2, /* an output has no number of its own, but its default */
    NAME_MISSING = 3 /* a value is infinite, or not a number; so are all outputs */
};

/* Compute NAME_OUTPUTS numbers of NAME_INPUTS values; return an enum name_status. */
int name_infer(const name_real *x, name_real *outputs);

#ifdef __cplusplus
}
#endif
"""

_MAIN = """
static int name_is_near(name_real a, name_real b, name_real most)
{
    return a == b || (a != a && b != b) || (a - b <= most && b - a <= most);
}

int main(void)
{
    unsigned place, line, wrong = 0, count = sizeof name_example / sizeof *name_example;
    for (place = 0; place < count; place++) {
        union { uint64_t bits; name_real value; } made;
        name_real x[NAME_INPUTS + 1], outputs[NAME_OUTPUTS], most[NAME_OUTPUTS];
        name_real expected[NAME_OUTPUTS];
        int status, is_right;
        for (line = 0; line < NAME_INPUTS; line++) {
            made.bits = name_example[place].x[line];
            x[line] = made.value;
        }
        for (line = 0; line < NAME_OUTPUTS; line++) {
            made.bits = name_example[place].outputs[line];
            expected[line] = made.value;
            made.bits = name_example[place].most[line];
            most[line] = made.value;
        }
        status = name_infer(x, outputs);
        is_right = status == name_example[place].status;
        for (line = 0; line < NAME_OUTPUTS; line++)
            if (!name_is_near(outputs[line], expected[line], most[line]))
                is_right = 0;
        if (!is_right) {
            wrong++;
            printf("example %u: status %d instead of %d; outputs and expected ones:",
                place, status, name_example[place].status);
            for (line = 0; line < NAME_OUTPUTS; line++)
                printf(" %.17g %.17g", outputs[line], expected[line]);
            printf("\\n");
        }
    }
    printf("%u of %u examples answered as expected\\n", count - wrong, count);
    return wrong != 0;
}
#endif
"""


def system_code(system: FuzzySystem, *, activations: bool) -> Iterator[str]:
    """Yield the tables, helpers and the function of a system."""
    program = from_system(system, activations=activations)
    steps = CSteps(program)
    ends = list(_ends(program, steps))
    if steps.needs_library:
        yield "#include <math.h>\n"
    yield "\n"
    yield from steps.table_text()
    yield from steps.helper_text()
    yield "\nint name_infer(const name_real *x, name_real *outputs)\n{\n"
    if any("for (i" in line for line in steps.body):
        yield "    unsigned long i;\n"
    if not program.inputs:
        yield "    (void)x;\n"
    yield from (*steps.body, *ends)
    yield "}\n"


def _ends(program: Program, steps: CSteps) -> Iterator[str]:
    numbers = [*program.of("output"), *program.of("activation")]
    for line, place in enumerate(numbers):
        yield f"    outputs[{line}] = {steps.value(place)};\n"
    (status,) = program.of("status")
    yield f"    return (int)({steps.value(status)});\n"


def system_selftest(system: FuzzySystem, *, activations: bool) -> Iterator[str]:
    """Yield the self-test of a system, behind a macro.

    Outputs must be equal, or as near as functions of different libraries allow.
    """
    examples = _examples(system, activations=activations)
    inputs, outputs = max(len(system.inputs), 1), len(examples[0][1])
    yield "\n#ifdef NAME_SELFTEST\n#include <stdio.h>\n"
    yield "\n/* Bits of the inputs, the outputs and their largest errors; the status.\n"
    yield " * Errors are allowed only where a mathematical library is called. */\n"
    yield "static const struct {\n"
    yield f"    uint64_t x[{inputs}];\n    uint64_t outputs[{outputs}];\n"
    yield f"    uint64_t most[{outputs}];\n    int status;\n"
    yield f"}} name_example[{len(examples)}] = {{\n"
    for operands, result, bound, status in examples:
        shown = ", ".join(map(repr, operands)) or "no inputs"
        yield f"    /* {shown}: {', '.join(map(repr, result))} */\n"
        parts = ", ".join(map(bits_of, (operands, result, bound)))
        yield f"    {{{parts}, {status}}},\n"
    yield "};\n"
    yield _MAIN


def _examples(system: FuzzySystem, *, activations: bool) -> list[SystemExample]:
    """Return examples, those with small errors first.

    Where no bound of an error is known, a share of the number stands in its place.
    """
    limit = max(_FEWEST, min(_PROBES, _RULES // max(len(system.rules), 1)))
    rows = system_probes(system, limit=limit)
    every: list[SystemExample] = []
    for operands, result, bound, status in system_examples(
        system, rows, activations=activations
    ):
        most = [
            0.0 if math.isnan(number) else min(one, _SHARE * max(abs(number), 1.0))
            for one, number in zip(bound, result, strict=True)
        ]
        every.append((operands, result, most, status))
    every.sort(key=lambda one: max(one[2]))
    step = max(len(every) // (2 * _ROWS), 1)
    return every[: _ROWS * step : step]

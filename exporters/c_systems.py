"""Fuzzy systems in C: the function of a program, and what tests it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from fuzzytree.exporters.c_fixed import FixedNumbers, FixedSteps, SystemExample
from fuzzytree.exporters.c_steps import LIBRARY, CSteps
from fuzzytree.exporters.c_text import (
    DECLARE,
    DEFINE,
    DOUBLE,
    SINGLE,
    USE,
    CNumbers,
    bits_of,
    checks,
    remark,
)
from fuzzytree.exporters.program_text import examples_of
from fuzzytree.model import FuzzySystem
from fuzzytree.numerics import short_above
from fuzzytree.semantics import (
    Program,
    Worst,
    evaluate_program,
    float32_rounding,
    from_system,
    probes,
    spreads,
    term_title,
    worst_over,
)

_ROWS = 100
_PROBES = 400
_FEWEST = 20
_RULES = 20_000  # rules of all rows that are tried, together
_SHARE = 1e-6  # of a number: its error where no bound is known

_ERRORS = {
    "double": "Errors are allowed only where a mathematical library is called.",
    "float": "The errors are the derived bounds of each example.",
    "int16_t": "The errors are the derived bounds.",
    "int32_t": "The errors are the derived bounds.",
}

_TYPES = """
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
    int is_alike = NONE || a == b; /* most is NaN: no bound */
    return is_alike || (a - b <= most && b - a <= most);
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
                printf(" %.17g %.17g", (double)outputs[line], (double)expected[line]);
            printf("\\n");
        }
    }
    printf("%u of %u examples answered as expected\\n", count - wrong, count);
    return wrong != 0;
}
#endif
"""


class SystemFile(NamedTuple):
    """A system on its way to C: its program, its numbers, and how far these are off.

    Attributes:
        system: The system.
        program: Its program.
        steps: The program's statements.
        numbers: The type of all numbers.
        worst: The worst errors over all inputs in their ranges; None of doubles, which
            are what others are compared with, and where an input has no range.
    """

    system: FuzzySystem
    program: Program
    steps: CSteps
    numbers: CNumbers
    worst: Worst | None

    def text(self, *, selftest: bool) -> Iterator[str]:
        """Yield what stands behind the heading."""
        for line in self.remarks():
            yield f" * {remark(line)}\n"
        yield USE + DECLARE
        if isinstance(self.numbers, FixedNumbers):
            yield "#include <stdint.h>\n\n"
        yield f"typedef {self.numbers.name} name_real;\n\n"
        yield f"#define NAME_INPUTS {len(self.system.inputs)}u\n"
        yield f"#define NAME_OUTPUTS {len(self.program.results) - 1}u\n"
        yield _TYPES + DEFINE
        if isinstance(self.numbers, FixedNumbers):
            yield f"typedef {self.numbers.wide} name_wide;\n"
        else:
            yield checks(self.numbers, is_arithmetic=True)
        yield from self._function()
        if selftest:
            yield from self._selftest()
        yield "\n#endif\n"

    def remarks(self) -> Iterator[str]:
        """Yield how far each output may be from exact numbers, of all but doubles."""
        if self.numbers is DOUBLE:
            return
        if isinstance(self.steps, FixedSteps):
            yield from self.steps.scales()
        if self.worst is None:
            yield "nothing is known of errors: an input has no range"
            return
        ends = zip(self.program.results, *self.worst[:2], strict=True)
        for result, error, share in ends:
            if share == 1.0 and result.kind != "status":
                yield f"{result.title}: no bound of its error is known"
            elif result.kind != "status":
                text = f"{result.title} is within {short_above(error)} of exact numbers"
                where = (
                    f", but for {short_above(share)} of these, where a choice is open"
                )
                yield f"{text} for inputs in their ranges{where if share else ''}"

    def _function(self) -> Iterator[str]:
        ends = list(_ends(self.program, self.steps))
        if self.steps.needs_library:
            yield "#include <math.h>\n"
        yield "\n"
        yield from self.steps.function_text()
        yield "\nint name_infer(const name_real *x, name_real *outputs)\n{\n"
        loops = "".join(line for line in self.steps.body if "for (" in line)
        if loops:
            yield f"    name_place i{', k' * ('k++' in loops)};\n"
        if not self.program.inputs:
            yield "    (void)x;\n"
        yield from (*self.steps.body, *ends)
        yield "}\n"

    def _selftest(self) -> Iterator[str]:
        """Yield the self-test, behind a macro.

        Outputs must be equal, or as near as functions of different libraries allow, or
        as numbers of this type are to exact ones.
        """
        examples = list(self._examples())
        yield "\n#ifdef NAME_SELFTEST\n"
        if not examples:
            yield '#error "no example of this model has a known error"\n#endif\n'
            return
        inputs, outputs = max(len(self.system.inputs), 1), len(self.program.results) - 1
        bits = f"uint{8 * np.dtype(self.numbers.kind).itemsize}_t"
        yield "#include <stdio.h>\n\n"
        yield "/* Bits of inputs, outputs and their largest errors; the status.\n"
        yield f" * {_ERRORS[self.numbers.name]} */\n"
        yield "static const struct {\n"
        yield f"    {bits} x[{inputs}];\n    {bits} outputs[{outputs}];\n"
        yield f"    {bits} most[{outputs}];\n    int status;\n"
        yield f"}} name_example[{len(examples)}] = {{\n"
        for operands, result, bound, status in examples:
            shown = ", ".join(map(repr, operands)) or "no inputs"
            yield f"    /* {shown}: {', '.join(map(repr, result))} */\n"
            rows = (operands, result, bound)
            parts = ", ".join(bits_of(row, self.numbers) for row in rows)
            yield f"    {{{parts}, {status}}},\n"
        yield "};\n"
        is_fixed = isinstance(self.steps, FixedSteps)
        none = "(a != a && b != b) || (most != most && b == b)"
        yield _MAIN.replace("uint64_t", bits).replace(
            "NONE || ", "" if is_fixed else f"{none} || "
        )

    def _examples(self) -> Iterator[SystemExample]:
        """Yield examples of this type, with the errors that are allowed."""
        has_activations = bool(self.program.of("activation"))
        examples = _examples(self.system, activations=has_activations)
        if self.numbers is DOUBLE:
            yield from examples
            return
        if isinstance(self.steps, FixedSteps):
            yield from self.steps.examples([operands for operands, *_ in examples])
            return
        for operands, _, _, _ in examples:
            with np.errstate(over="ignore"):
                row = np.array(operands, np.float32).astype(np.float64).tolist()
            numbers = evaluate_program(
                self.program, dict(zip(self.program.inputs, row, strict=True))
            )
            values = np.array(row).reshape(-1, 1)
            every = spreads(
                self.program, values, values, float32_rounding(self.program)
            )
            *bounds, unsure = (
                float(every[r.step].error.max()) for r in self.program.results
            )
            *outputs, status = numbers.values
            if not unsure:
                unit = 2.0**-23  # what is expected is rounded too
                most = [
                    math.nan if math.isinf(bound) else bound + unit * abs(value)
                    for bound, value in zip(bounds, outputs, strict=True)
                ]
                yield row, tuple(outputs), most, int(status)


def system_file(
    system: FuzzySystem,
    numbers: CNumbers,
    *,
    activations: bool,
    tables: bool,
    curves: Mapping[str, float],
) -> SystemFile:
    """Return the file of a system in numbers of a type.

    `curves` says how far points are from the curves for which they stand, by the titles
    of terms as losses have them.

    Raises:
        ValueError: If a number of the system is beyond the type.
    """
    program = from_system(system, activations=activations)
    library, worst = LIBRARY, None
    if numbers is SINGLE:
        library = {name: f"{function}f" for name, function in LIBRARY.items()}
        for step, title in zip(program.steps, program.titles, strict=True):
            size = max(map(abs, (step.number, *step.table)))
            if numbers.largest < size < math.inf:
                raise ValueError(
                    f"c float32: {size!r} {f'of {title} ' * bool(title)}is beyond "
                    f"{numbers.name}, whose largest number is {numbers.largest:.2g}"
                )
    ranges = [
        (one.low, one.high)
        for one in system.variables
        if one.low is not None and one.high is not None
    ]
    has_ranges = len(ranges) == len(system.variables)
    if isinstance(numbers, FixedNumbers):
        if not has_ranges:
            names = [
                one.name for one in system.variables if None in (one.low, one.high)
            ]
            raise ValueError(f"fixed point needs the range of {names[0]!r}; add it")
        off = {
            f"{variable.name} is {term.name}": curves[where]
            for variable in system.variables
            for term in variable.terms
            if (where := term_title(variable, term)) in curves
        }
        fixed = FixedSteps(program, ranges, numbers, off, tables=tables)
        return SystemFile(system, fixed.program, fixed, numbers, fixed.worst)
    if numbers is not DOUBLE and has_ranges:
        worst = worst_over(program, ranges, float32_rounding(program))
    steps = CSteps(program, numbers, library, tables=tables)
    return SystemFile(system, program, steps, numbers, worst)


def _ends(program: Program, steps: CSteps) -> Iterator[str]:
    numbers = [*program.of("output"), *program.of("activation")]
    for line, place in enumerate(numbers):
        yield f"    outputs[{line}] = {steps.value(place)};\n"
    (status,) = program.of("status")
    yield f"    return (int)({steps.value(status)});\n"


def _examples(system: FuzzySystem, *, activations: bool) -> list[SystemExample]:
    """Return examples, those with small errors first.

    Where no bound of an error is known, a share of the number stands in its place.
    """
    limit = max(_FEWEST, min(_PROBES, _RULES // max(len(system.rules), 1)))
    rows = probes(system, limit=limit)
    every: list[SystemExample] = []
    for one in examples_of(system, rows, activations=activations):
        most = [
            0.0 if math.isnan(number) else min(bound, _SHARE * max(abs(number), 1.0))
            for bound, number in zip(one.bounds, one.numbers, strict=True)
        ]
        every.append((one.values, one.numbers, most, int(one.answer.status)))
    every.sort(key=lambda one: max(one[2]))
    step = max(len(every) // (2 * _ROWS), 1)
    return every[: _ROWS * step : step]

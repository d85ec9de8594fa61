"""Fuzzy systems in C: the function of a program, and what tests it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fuzzytree.exporters.c_steps import CSteps
from fuzzytree.exporters.c_text import DECLARE, DEFINE, DOUBLE, USE, bits_of, checks
from fuzzytree.exporters.program_text import SystemExample, system_examples
from fuzzytree.model import FuzzySystem
from fuzzytree.semantics import Program, from_system, system_probes

_ROWS = 100
_PROBES = 400
_FEWEST = 20
_RULES = 20_000  # rules of all rows that are tried, together
_SHARE = 1e-6  # of a number: its error where no bound is known

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


def system_text(
    system: FuzzySystem, *, activations: bool, tables: bool, selftest: bool
) -> Iterator[str]:
    """Yield what stands behind the heading of a system."""
    yield USE + DECLARE
    yield "typedef double name_real;\n\n"
    count = len(system.outputs) + activations * len(system.rules)
    yield f"#define NAME_INPUTS {len(system.inputs)}u\n"
    yield f"#define NAME_OUTPUTS {count}u\n"
    yield _TYPES + DEFINE
    yield checks(DOUBLE, is_arithmetic=True)
    yield from _code(system, activations=activations, tables=tables)
    if selftest:
        yield from _selftest(system, activations=activations)
    yield "\n#endif\n"


def _code(system: FuzzySystem, *, activations: bool, tables: bool) -> Iterator[str]:
    """Yield the tables, helpers and the function of a system."""
    program = from_system(system, activations=activations)
    steps = CSteps(program, tables=tables)
    ends = list(_ends(program, steps))
    if steps.needs_library:
        yield "#include <math.h>\n"
    yield "\n"
    yield from steps.function_text()
    yield "\nint name_infer(const name_real *x, name_real *outputs)\n{\n"
    loops = "".join(line for line in steps.body if "for (" in line)
    if loops:
        yield f"    name_place i{', k' * ('k++' in loops)};\n"
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


def _selftest(system: FuzzySystem, *, activations: bool) -> Iterator[str]:
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

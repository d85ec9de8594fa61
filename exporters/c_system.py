"""A fuzzy system as C: its program, straight on, and a self-test."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence

import numpy as np

from fuzzytree.exporters.c_steps import Steps
from fuzzytree.exporters.c_text import fill, remark
from fuzzytree.model.rulebase import fingerprint
from fuzzytree.model.system import FuzzySystem, SystemInput, SystemOutput
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.probing import Row, system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.steps import Program
from fuzzytree.semantics.programs.system_program import from_system

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


def system_heading(system: FuzzySystem) -> Iterator[str]:
    """Yield comments: what the system is called, and its variables."""
    yield f'/* A fuzzy system, named "{remark(system.name)}". Written by fuzzytree.\n'
    yield f" * Fingerprint: {fingerprint(system)}\n *\n * Inputs, in order:\n"
    columns = [one for one in system.inputs if not one.parts]
    for place, one in enumerate(columns):
        yield f" *   x[{place}] {_described(one)}\n"
    yield " * Outputs, in order:\n"
    for place, output in enumerate(system.outputs):
        yield f" *   outputs[{place}] {_described(output)}\n"
    yield f" * Rules: {len(system.rules)}\n"


def _described(one: SystemInput | SystemOutput) -> str:
    return remark(f"{one.name} ({one.unit})" if one.unit else one.name)


def system_code(
    system: FuzzySystem, prefix: str, *, activations: bool
) -> Iterator[str]:
    """Yield the tables, helpers and the function of a system.

    Args:
        system: The system.
        prefix: The beginning of all names.
        activations: Whether the rules' degrees of activation follow the outputs.
    """
    program = from_system(system, activations=activations)
    steps = Steps(program)
    ends = list(_ends(program, steps))
    if steps.needs_library:
        yield "#include <math.h>\n"
    yield "\n"
    yield from steps.table_text(prefix)
    yield from steps.helper_text(prefix)
    yield fill("\nint name_infer(const name_real *x, name_real *outputs)\n{\n", prefix)
    if any("for (i" in line for line in steps.body):
        yield "    unsigned long i;\n"
    if not program.inputs:
        yield "    (void)x;\n"
    for line in (*steps.body, *ends):
        yield fill(line, prefix)
    yield "}\n"


def _ends(program: Program, steps: Steps) -> Iterator[str]:
    numbers = [*program.of("output"), *program.of("activation")]
    for line, place in enumerate(numbers):
        yield f"    outputs[{line}] = {steps.value(place)};\n"
    (status,) = program.of("status")
    yield f"    return (int)({steps.value(status)});\n"


def system_selftest(
    system: FuzzySystem, prefix: str, *, activations: bool
) -> Iterator[str]:
    """Yield the self-test of a system, behind a macro.

    Outputs must be equal, or as near as functions of different libraries allow.
    """
    examples = _examples(system, activations=activations)
    inputs, outputs = max(len(system.columns), 1), len(examples[0][1])
    yield fill("\n#ifdef NAME_SELFTEST\n#include <stdio.h>\n", prefix)
    yield "\n/* Bits of the inputs, the outputs and their largest errors; the status.\n"
    yield " * Errors are allowed only where a mathematical library is called. */\n"
    yield "static const struct {\n"
    yield f"    uint64_t x[{inputs}];\n    uint64_t outputs[{outputs}];\n"
    yield f"    uint64_t most[{outputs}];\n    int status;\n"
    yield fill(f"}} name_example[{len(examples)}] = {{\n", prefix)
    for given, found, bound, status in examples:
        shown = ", ".join(map(repr, given)) or "no inputs"
        yield f"    /* {shown}: {', '.join(map(repr, found))} */\n"
        parts = ", ".join(map(_bits, (given, found, bound)))
        yield f"    {{{parts}, {status}}},\n"
    yield "};\n"
    yield fill(_MAIN, prefix)


Example = tuple[Sequence[float], Sequence[float], Sequence[float], int]


def _examples(system: FuzzySystem, *, activations: bool) -> list[Example]:
    """Return inputs, numbers, their largest errors and a status; small errors first.

    Where no bound of an error is known, a share of the number stands in its place.
    """
    limit = max(_FEWEST, min(_PROBES, _RULES // max(len(system.rules), 1)))
    rows = system_probes(system, limit=limit)
    every: list[Example] = []
    bounds = _bounds(system, rows, activations=activations)
    for row, bound in zip(rows, bounds, strict=True):
        answer = infer(system, row)
        found = answer.outputs + (answer.activations if activations else ())
        most = [
            0.0 if math.isnan(number) else min(one, _SHARE * max(abs(number), 1.0))
            for one, number in zip(bound, found, strict=True)
        ]
        given = [row[name] for name in system.columns]
        every.append((given, found, most, int(answer.status)))
    every.sort(key=lambda one: max(one[2]))
    step = max(len(every) // (2 * _ROWS), 1)
    return every[: _ROWS * step : step]


def _bounds(
    system: FuzzySystem, rows: Sequence[Row], *, activations: bool
) -> list[list[float]]:
    """Return how far each number may be off, for each row."""
    program = from_system(system, activations=activations)
    table = np.array([[row[name] for row in rows] for name in program.inputs])
    values = table.reshape(len(program.inputs), len(rows)).astype(np.float64)
    found: list[list[float]] = error_bounds(program, values)[:-1].T.tolist()
    return found


def _bits(values: Sequence[float]) -> str:
    words: list[str] = []
    for value in values:
        plain = math.nan if math.isnan(value) else value
        (bits,) = struct.unpack("<Q", struct.pack("<d", plain))
        words.append(f"UINT64_C({bits:#018x})")
    return f"{{{', '.join(words) or '0'}}}"

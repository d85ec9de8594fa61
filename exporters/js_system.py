"""A fuzzy system as JavaScript: its program, straight on, and a self-test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fuzzytree.exporters.js_steps import Steps
from fuzzytree.exporters.js_text import literal, table, text_of
from fuzzytree.model.system import FuzzySystem, SystemInput, SystemOutput
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.probing import Row, system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.systems import from_system

_EXAMPLES = 64

_DOORS = """
/* Return outputs, status and the rules' activations; inputs are given by name. */
function infer(row) {
  return answer(ordered(row));
}
"""

_TEST = """
/* Answer the examples, and return a sentence for each that is not as expected. */
function selfTest() {
  const isNear = (a, b, most) => Object.is(a, b) || a === b || Math.abs(a - b) <= most;
  const wrong = [];
  for (const [given, outputs, bounds, status] of EXAMPLES) {
    const found = answer(given);
    const isRight = outputs.every((y, k) => isNear(found.outputs[k], y, bounds[k]));
    if (!isRight || found.status !== status) {
      const got = `[${found.outputs}], status ${found.status}`;
      wrong.push(`[${given}]: ${got} instead of [${outputs}], status ${status}`);
    }
  }
  return wrong;
}
"""


def system_parts(system: FuzzySystem, rows: str) -> Iterator[str]:
    """Yield the tables and functions of a system.

    Args:
        system: The system.
        rows: The functions that look at what is given.
    """
    program = from_system(system, activations=True)
    steps = Steps(program)
    body = list(steps.body())
    outputs = ", ".join(map(steps.value, program.of("output")))
    activations = ", ".join(map(steps.value, program.of("activation")))
    (status,) = program.of("status")
    columns = [one for one in system.inputs if not one.parts]
    yield from table("INPUTS", map(_named, columns))
    yield from table("OUTPUTS", map(_named, system.outputs))
    for numbers, name in steps.tables.items():
        yield f"\nconst {name} = {numbers};\n"
    yield rows
    yield "\n/* Return outputs, status and activations for the inputs in order. */"
    yield "\nfunction answer(values) {\n  const x = checked(values);\n"
    yield from body
    yield "  return {\n"
    yield f"    outputs: [{outputs}],\n"
    yield f"    status: {steps.value(status)},\n"
    yield f"    activations: [{activations}],\n"
    yield "  };\n}\n"
    yield _DOORS
    yield from steps.helpers()
    yield "\n/* Inputs, outputs, how far these may be off, and the status. They may be"
    yield "\n * off only where functions such as exp have last digits of their own. */"
    yield from table("EXAMPLES", _examples(system))
    yield _TEST


def _named(one: SystemInput | SystemOutput) -> str:
    unit = f" // {text_of(one.unit)}" if one.unit else ""
    return f"{text_of(one.name)},{unit}"


def _examples(system: FuzzySystem) -> Iterator[str]:
    rows = system_probes(system, limit=_EXAMPLES)
    for row, bounds in zip(rows, _bounds(system, rows), strict=True):
        found = infer(system, row)
        given = [row[name] for name in system.columns]
        yield f"{literal((given, found.outputs, bounds, int(found.status)))},"


def _bounds(system: FuzzySystem, rows: Sequence[Row]) -> list[list[float]]:
    """Return how far each output may be off, for each row."""
    program = from_system(system)
    lines = np.array([[row[name] for row in rows] for name in program.inputs])
    values = lines.reshape(len(program.inputs), len(rows)).astype(np.float64)
    found: list[list[float]] = error_bounds(program, values).T.tolist()
    return [bounds[: len(system.outputs)] for bounds in found]

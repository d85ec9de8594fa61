"""A fuzzy system as JavaScript: the statements of its program, and a self-test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from fuzzytree.exporters.js_text import literal, number_text, table, text_of
from fuzzytree.exporters.program_text import StepText, system_examples
from fuzzytree.model import FuzzySystem, SystemInput, SystemOutput, Variable
from fuzzytree.semantics import OVER_SAMPLES, Program, Step, from_system, system_probes

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
    """Yield the tables and functions of a system."""
    program = from_system(system, activations=True)
    steps = JsSteps(program)
    body = list(steps.body())
    outputs = ", ".join(map(steps.value, program.of("output")))
    activations = ", ".join(map(steps.value, program.of("activation")))
    (status,) = program.of("status")
    columns = [one for one in system.inputs if not one.parts]
    yield from table("INPUTS", map(entry_of, columns))
    yield from table("OUTPUTS", map(entry_of, system.outputs))
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


def entry_of(one: Variable | SystemInput | SystemOutput) -> str:
    """Return the entry of a variable in a table of names."""
    unit = f" // {text_of(one.unit)}" if one.unit else ""
    return f"{text_of(one.name)},{unit}"


def _examples(system: FuzzySystem) -> Iterator[str]:
    rows = system_probes(system, limit=_EXAMPLES)
    yield from (f"{literal(example)}," for example in system_examples(system, rows))


_LIBRARY: Mapping[str, str] = {
    "absolute": "Math.abs",
    "square_root": "Math.sqrt",
    "exponential": "Math.exp",
    "logarithm": "Math.log",
    "logarithm_10": "Math.log10",
    "logarithm_1p": "Math.log1p",
    "sine": "Math.sin",
    "cosine": "Math.cos",
    "tangent": "Math.tan",
    "arc_sine": "Math.asin",
    "arc_cosine": "Math.acos",
    "arc_tangent": "Math.atan",
    "hyperbolic_sine": "Math.sinh",
    "hyperbolic_cosine": "Math.cosh",
    "hyperbolic_tangent": "Math.tanh",
    "area_sine": "Math.asinh",
    "area_cosine": "Math.acosh",
    "area_tangent": "Math.atanh",
    "arc_tangent_2": "Math.atan2",
    "is_finite": "Number.isFinite",
}

HELPERS: Mapping[str, str] = {
    "minimum": """
function minimum(a, b) {
  return a < b || a !== a ? a : b;
}
""",
    "maximum": """
function maximum(a, b) {
  return a > b || a !== a ? a : b;
}
""",
    "floor": """
/* The largest whole number up to a; never -0. */
function floor(a) {
  return Math.floor(a) + 0;
}
""",
    "ceiling": """
/* The smallest whole number from a on; never -0. */
function ceiling(a) {
  return Math.ceil(a) + 0;
}
""",
    "round": """
/* The nearest whole number, of two equally near ones the even; never -0. */
function round(a) {
  const low = Math.floor(a), rest = a - low;
  if (!(rest >= 0.5)) return Number.isFinite(a) ? low + 0 : a;
  return rest > 0.5 || low % 2 !== 0 ? low + 1 : low;
}
""",
    "power": """
/* Powers as in C: of 1 and -1 also to exponents that are infinite or no number. */
function power(a, b) {
  if (a === 1 || (a === -1 && Math.abs(b) === Infinity)) return 1;
  return Math.pow(a, b);
}
""",
    "below": """
/* How many numbers of a rising table are below a. */
function below(table, a) {
  let low = 0, high = table.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (table[middle] < a) low = middle + 1;
    else high = middle;
  }
  return low;
}
""",
    "pick": """
/* The number of a table at a place, its first one if there is none. */
function pick(table, place) {
  return table[place >= 0 && place < table.length ? Math.trunc(place) : 0];
}
""",
    "samples": """
/* One number for each of many samples. */
function samples(count, make) {
  const found = new Float64Array(count);
  for (let i = 0; i < count; i += 1) found[i] = make(i);
  return found;
}
""",
    "total": """
/* The sum by halves: the second half is added to the first until one is left. */
function total(numbers) {
  let size = 1;
  while (size < numbers.length) size *= 2;
  const sums = new Float64Array(size);
  sums.set(numbers);
  while (size > 1) {
    size /= 2;
    for (let i = 0; i < size; i += 1) sums[i] += sums[i + size];
  }
  return sums[0];
}
""",
    "running": """
/* The sums of the numbers up to each. */
function running(numbers) {
  const sums = Float64Array.from(numbers);
  for (let i = 1; i < sums.length; i += 1) sums[i] = sums[i - 1] + numbers[i];
  return sums;
}
""",
    "last": """
function last(numbers) {
  return numbers[numbers.length - 1];
}
""",
    "highest": """
function highest(numbers) {
  return numbers.reduce((a, b) => maximum(a, b));
}
""",
    "lowest": """
function lowest(numbers) {
  return numbers.reduce((a, b) => minimum(a, b));
}
""",
}
"""Functions that a program may need, by name; `needed` says which."""

_USES = {"highest": "maximum", "lowest": "minimum"}


class JsSteps(StepText):
    """A program as text: first `body`, then `tables` and `needs` are known.

    Attributes:
        tables: The name of each table, by its numbers as text.
    """

    signs: ClassVar[Mapping[str, str]] = {
        **StepText.signs,
        "equal": "===",
        "remainder": "%",
    }

    def __init__(self, program: Program) -> None:
        super().__init__(program)
        self.tables: dict[str, str] = {}

    def body(self) -> Iterator[str]:
        """Yield a statement for each step that an input enters."""
        for place, step in enumerate(self.steps):
            if self.still[place] is None:
                yield f"  const v{place} = {self._step_text(step)};\n"

    def value(self, place: int) -> str:
        """Return a step's result as an expression; of samples, the i-th."""
        result = self.still[place]
        if result is None:
            name = f"v{place}"
        elif isinstance(result, list):
            name = self._table([float(one) for one in result])
        elif isinstance(result, bool):
            return literal(result)
        else:
            text = number_text(result)
            return f"({text})" if text.startswith("-") else text
        return f"{name}[i]" if self.steps[place].samples else name

    def helpers(self) -> Iterator[str]:
        """Yield the functions that the body needs."""
        needs = self.needs | {_USES[name] for name in self.needs if name in _USES}
        yield from (text for name, text in HELPERS.items() if name in needs)

    def _table(self, numbers: list[float]) -> str:
        return self.tables.setdefault(literal(numbers), f"TABLE_{len(self.tables)}")

    def _step_text(self, step: Step) -> str:
        if step.operation in OVER_SAMPLES or step.operation == "running":
            (argument,) = step.arguments
            self.needs.add(step.operation)
            return f"{step.operation}(v{argument})"
        text = self.expression(step)
        if not step.samples:
            return text
        self.needs.add("samples")
        return f"samples({step.samples}, (i) => {text})"

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function of Math, or of a helper."""
        operation = step.operation
        if operation in _LIBRARY:
            return f"{_LIBRARY[operation]}({', '.join(operands)})"
        self.needs.add(operation)
        if step.table:
            operands = [self._table(list(step.table)), *operands]
        return f"{operation}({', '.join(operands)})"

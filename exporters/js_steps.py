"""The steps of a program as statements of JavaScript, and functions that they call."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from fuzzytree.exporters.js_text import literal
from fuzzytree.exporters.program_text import ScriptSteps
from fuzzytree.semantics import OVER_SAMPLES, Step

_MOST_LOCALS = 50_000  # 8 bytes each: half of the stack that engines allow
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
}
"""Functions that a program may need, by name."""


class JsSteps(ScriptSteps):
    """A program as text."""

    statement = "  const {} = {};"
    comment = "//"
    setting = "\nconst {} = {};\n"
    opening = "\n/* Return {} as numbers. */\nfunction numbers(x) {{\n"
    result = "    {}, // {}\n"
    ending = "  return [\n", "  ];\n}\n"
    functions = HELPERS
    signs: ClassVar[Mapping[str, str]] = {
        **ScriptSteps.signs,
        "equal": "===",
        "remainder": "%",
    }

    def body(self) -> Iterator[str]:
        """Yield a statement for each step that an input enters."""
        if len(self.steps) > _MOST_LOCALS:
            self.variable, self.statement = "v[{}]", "  {} = {};"
            yield "  const v = [];\n"
        yield from super().body()

    def literal(self, value: object) -> str:
        """Return a value as JavaScript."""
        return literal(value)

    def expression(self, step: Step) -> str:
        """Return a step as an expression; of samples, as an array of them."""
        if step.operation in OVER_SAMPLES or step.operation == "running":
            name = self.variable.format(step.arguments[0])
            if step.operation == "last":
                return f"{name}.at(-1)"
            reducer = {"highest": "maximum", "lowest": "minimum"}.get(step.operation)
            self.needs.add(reducer or step.operation)
            return (
                f"{name}.reduce({reducer})" if reducer else f"{step.operation}({name})"
            )
        text = super().expression(step)
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
            operands = [self.table(step.table), *operands]
        return f"{operation}({', '.join(operands)})"

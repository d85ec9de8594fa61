"""Pieces of JavaScript: literals and tables, and the functions of generated files.

Literals are safe for any text of a model.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator


def text_of(text: str) -> str:
    r"""Return text as a literal of ASCII, without `<` and `>`, on one line.

    Escapes make it safe in a comment too: it has no line end, and no `*/`.

    Example:
        >>> print(text_of('é\u2028"</script>*/'))
        "\u00e9\u2028\"\u003c/script\u003e*\u002f"
    """
    plain = json.dumps(text)
    for pair, safe in (("<", r"\u003c"), (">", r"\u003e"), ("*/", r"*\u002f")):
        plain = plain.replace(pair, safe)
    return plain


def number_text(value: float) -> str:
    """Return a number with the fewest digits that give it back.

    Example:
        >>> number_text(-0.0), number_text(1e-05), number_text(-math.inf)
        ('-0.0', '1e-05', '-Infinity')
    """
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "Infinity" if value > 0.0 else "-Infinity"
    return repr(value)


def literal(value: object) -> str:
    """Return a value as JavaScript; sequences become arrays, None becomes null.

    Example:
        >>> literal(("band", None, [1.0, 2], True))
        '["band", null, [1.0, 2], true]'
    """
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return text_of(value)
        case float():
            return number_text(value)
        case int():
            return str(value)
        case tuple() | list():
            members: Iterable[object] = value
            return f"[{', '.join(map(literal, members))}]"
        case _:
            raise TypeError(f"no literal for {type(value).__name__}")


def table(name: str, entries: Iterable[str]) -> Iterator[str]:
    """Yield an array, one entry to a line; entries end in a comma, maybe a comment."""
    yield f"\nconst {name} = [\n"
    for entry in entries:
        yield f"  {entry}\n"
    yield "];\n"


def filled(template: str, **words: str) -> str:
    """Return a template with words in the place of their names between two `@`."""
    for name, word in words.items():
        template = template.replace(f"@{name}@", word)
    return template


START = """
/* Status of an answer. */
const DECIDED = 0, TIE = 1, UNCOVERED = 2, MISSING = 3;
"""

ROWS = """
/* Return the inputs of an object in order; each must be there, and a number. */
function ordered(row) {
  return INPUTS.map((name) => {
    if (!Object.hasOwn(row, name)) {
      throw new TypeError(`no value for the input ${JSON.stringify(name)}`);
    }
    return row[name];
  });
}

/* Return a copy of the inputs in order, or refuse what is no number. */
function checked(values) {
  if (values.length !== INPUTS.length) {
    throw new RangeError(`${values.length} values instead of ${INPUTS.length}`);
  }
  return Array.from(values, (value, place) => {
    if (typeof value !== "number") {
      const name = JSON.stringify(INPUTS[place]);
      throw new TypeError(`the value of the input ${name} is no number`);
    }
    return value;
  });
}
"""

TREE = """
  const axes = [@axes@];
  if (!axes.every(Number.isFinite)) return [@missing@, 0, MISSING];
  let place = NODES.length > 0 ? 0 : -1;
  while (place >= 0) {
    const [line, cuts, targets] = NODES[place];
    place = targets[below(cuts, axes[line])];
  }
  return [LEAVES[-place - 1], -place, DECIDED];
}
"""

DECIDE = """
/* Return @what@ for the inputs in order. */
function answer(values) {
  const [place, rule, status, ...strengths] = numbers(checked(values));
  return { label: CLASSES[place] ?? null, rule, status@strengths@ };
}

/* Return class, rule number and status; the inputs are given by name. */
function decide(row) {
  const { label, rule, status } = answer(ordered(row));
  return { label, rule, status };
}
"""

STRENGTHS = """
/* Return the strength of every rule; the inputs are given by name. */
function strengths(row) {
  return answer(ordered(row)).strengths;
}
"""

INFER = """
/* Return outputs, status and the rules' activations for the inputs in order. */
function answer(values) {
  const found = numbers(checked(values)), count = OUTPUTS.length;
  const [outputs, activations] = [found.slice(0, count), found.slice(count + 1)];
  return { outputs, status: found[count], activations };
}

/* Return outputs, status and the rules' activations; inputs are given by name. */
function infer(row) {
  return answer(ordered(row));
}
"""

TEST = """
/* Compare numbers for the examples, and return a sentence for each that is wrong. */
function selfTest() {
  const isNear = (a, b, most) => Object.is(a, b) || a === b || Math.abs(a - b) <= most;
  const wrong = [];
  for (const [given, expected, bounds] of EXAMPLES) {
    const found = numbers(given);
    if (!expected.every((y, k) => isNear(found[k], y, bounds[k] ?? 0))) {
      wrong.push(`[${given}]: [${found}] instead of [${expected}]`);
    }
  }
  return wrong;
}
"""

MAIN = """
if (isMain()) {
  const wrong = selfTest();
  for (const text of wrong) console.log(text);
  const count = EXAMPLES.length;
  console.log(`${count - wrong.length} of ${count} examples answered as expected`);
  if (wrong.length > 0) process.exitCode = 1;
}
"""

AS_MODULE = """
/* Whether node runs this file, and does not import it. */
function isMain() {
  if (typeof process !== "object" || !process.argv || !process.argv[1]) return false;
  const path = decodeURIComponent(new URL(import.meta.url).pathname);
  const run = process.argv[1].replaceAll("\\\\", "/");
  return path === run || path === `/${run}`;
}

export { @doors@ };
"""

AS_SCRIPT = """
/* Whether node runs this file, and does not require it. */
function isMain() {
  return typeof require === "function" && require.main === module;
}

const model = { @doors@ };
if (typeof module === "object" && module.exports) module.exports = model;
else (globalThis.fuzzytree ??= Object.create(null))[@name@] = model;
"""

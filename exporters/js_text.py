"""Pieces of JavaScript: literals and tables, and the functions of generated files.

Literals are safe for any text of a model. The functions are those of the reference, in
its order.
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

AXES = """
/* Return the value of every variable: the inputs, then the combinations. */
function axes(values) {
  const found = checked(values);
  for (const parts of COMBINATIONS) {
    let total = null;
    for (const [line, weight, centre] of parts) {
      const part = weight * (found[line] - centre);
      total = total === null ? part : total + part;
    }
    found.push(total);
  }
  return found;
}

/* Return how many numbers of a rising table are below x, by bisection. */
function below(numbers, x) {
  let low = 0, high = numbers.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x > numbers[middle]) low = middle + 1;
    else high = middle;
  }
  return low;
}
"""

TREE = """
/* Return class, leaf number and status for the inputs in order. */
function answer(values) {
  const found = axes(values);
  if (!found.every(Number.isFinite)) {
    return { label: WHEN_MISSING, rule: 0, status: MISSING };
  }
  let place = NODES.length > 0 ? 0 : -1;
  while (place >= 0) {
    const [line, cuts, targets] = NODES[place];
    place = targets[below(cuts, found[line])];
  }
  return { label: CLASSES[LEAVES[-place - 1]], rule: -place, status: DECIDED };
}

/* Return class, leaf number and status; the inputs are given by name. */
function decide(row) {
  return answer(ordered(row));
}
"""

RULES = """
/* Return class, rule number, status and strengths for the inputs in order. */
function answer(values) {
  const found = axes(values);
  if (!found.every(Number.isFinite)) {
    const strengths = RULES.map(() => NaN);
    return { label: WHEN_MISSING, rule: 0, status: MISSING, strengths };
  }
  const degrees = CLAUSES.map((clause) => clauseDegree(found[clause[0]], clause));
  const strengths = RULES.map(([when]) => strength(when, degrees));
  const best = strengths.reduce(larger);
  if (best === 0.0) {
    return { label: WHEN_UNCOVERED, rule: 0, status: UNCOVERED, strengths };
  }
  const winner = strengths.indexOf(best);
  const status = winner < strengths.lastIndexOf(best) ? TIE : DECIDED;
  return { label: CLASSES[RULES[winner][1]], rule: winner + 1, status, strengths };
}

/* Return class, rule number and status; the inputs are given by name. */
function decide(row) {
  const { label, rule, status } = answer(ordered(row));
  return { label, rule, status };
}

/* Return the strength of every rule; the inputs are given by name. */
function strengths(row) {
  return answer(ordered(row)).strengths;
}

/* The smaller or larger of two numbers, the first if they are equal. */
function smaller(a, b) {
  return b < a ? b : a;
}

function larger(a, b) {
  return b > a ? b : a;
}

/* Return how true a rule is, of the degrees of its clauses. */
function strength(when, degrees) {
  if (when.length === 0) return 1.0;
  let total = degrees[when[0]];
  for (const clause of when.slice(1)) {
    const degree = degrees[clause];
    total = IS_PRODUCT ? total * degree : smaller(total, degree);
  }
  return total;
}

/* Return the largest degree of some terms, or 1 minus it. */
function clauseDegree(x, [, terms, isNegated]) {
  const highest = terms
    .map((term) => SHAPES[TERMS[term][0]](x, ...TERMS[term].slice(1)))
    .reduce(larger);
  return isNegated ? 1.0 - highest : highest;
}

const SHAPES = { band, lr, points };

/* Return 1 for low < x <= high, and the degree of a flank elsewhere. */
function band(x, low, high, left, right) {
  if (low !== null && x <= low) return left === null ? 0.0 : flank(x, ...left);
  if (high !== null && x > high) return right === null ? 0.0 : flank(x, ...right);
  return 1.0;
}

/* Return a degree that falls from start to end, always below 1. */
function flank(x, start, end, curve) {
  const q = clip((x - end) / (start - end), 1.0);
  return clip(horner(curve, q) * q, 0.9999999999999999);
}

/* Return the degree of a set with a left and a right side. */
function lr(x, mean, left, right) {
  const d = x - mean;
  return smaller(side(-d, ...left), side(d, ...right));
}

/* Return a degree that falls with the distance from the mean. */
function side(distance, spread, reach, curve) {
  const u = clip(distance / spread, reach);
  const t = smaller(u, 1.0);
  const body = clip(1.0 - t * horner(curve, 2.0 * t - 1.0), 1.0);
  const w = clip((reach - u) / (reach - 1.0), 1.0);
  const square = w * w;
  return body * (square * square);
}

/* Return the degree on the line between the points beside x. */
function points(x, values, degrees) {
  const place = below(values, x);
  if (place === 0) return degrees[0];
  if (place === values.length) return degrees[place - 1];
  let anchor = values[place], other = values[place - 1];
  let near = degrees[place], far = degrees[place - 1];
  if (far === 0.0) {
    [anchor, other, near, far] = [other, anchor, far, near];
  }
  const line = near + ((x - anchor) / (other - anchor)) * (far - near);
  return smaller(larger(line, smaller(near, far)), larger(near, far));
}

/* Return c0 + x (c1 + x (c2 + ...)), from the inside out. */
function horner(coefficients, x) {
  let total = coefficients[coefficients.length - 1];
  for (let place = coefficients.length - 2; place >= 0; place -= 1) {
    total = total * x + coefficients[place];
  }
  return total;
}

/* Return a value clamped to 0 and high; 0.0 of -0.0. */
function clip(value, high) {
  return smaller(larger(0.0, value), high);
}
"""

TEST = """
/* Answer the examples, and return a sentence for each that is not as expected. */
function selfTest() {
  const wrong = [];
  for (const [given, ...expected] of EXAMPLES) {
    const { label, rule, status, strengths } = answer(given);
    const got = [label, rule, status];
    if (strengths) got.push(digest(strengths));
    if (!got.every((one, place) => one === expected[place])) {
      wrong.push(`[${given}]: ${got} instead of ${expected}`);
    }
  }
  return wrong;
}
"""

DIGEST = """
/* Return 32 bits that change if any bit of any strength does. */
function digest(strengths) {
  const view = new DataView(new ArrayBuffer(8));
  let found = 2166136261;
  for (const strength of strengths) {
    view.setFloat64(0, Number.isNaN(strength) ? -1.0 : strength);
    for (const place of [4, 0]) {
      found = Math.imul(found ^ view.getUint32(place), 16777619) >>> 0;
    }
  }
  return found;
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

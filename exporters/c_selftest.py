"""The self-test of generated C: rows of inputs and the expected predictions.

In float32 the predictions are computed from the tables: each operation is one of
numpy's on numbers of the type, in the order in which C performs it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fuzzytree.exporters.c_tables import HIGH_END, LOW_END, POINTS, CModel, Tables
from fuzzytree.exporters.c_text import CNumbers, bits_of
from fuzzytree.exporters.program_text import class_number, digest_of
from fuzzytree.model import stand_ins
from fuzzytree.semantics import Answer, Row, Status, answer_of, few_probes

_MOST_ROWS = 160
_FEWEST_ROWS = 8
_STRENGTHS = 20_000  # of all rows together


def _examples(file: CModel) -> Iterator[tuple[list[float], list[str]]]:
    """Yield rows and predictions: of the reference, or in float of the tables."""
    model, numbers = file.model, file.numbers
    rules = len(file.tables.label) if file.tables else 1
    limit = max(_FEWEST_ROWS, min(_MOST_ROWS, _STRENGTHS // rules))
    for row in few_probes(model, limit):
        if numbers.kind is np.float64:
            values, answer = row, answer_of(model, row)
        else:
            with np.errstate(over="ignore"):
                values = {k: float(np.float32(value)) for k, value in row.items()}
            answer = answer_of_tables(file, values)
        label = class_number(answer.label, model)
        ends = [str(label), str(answer.rule), str(int(answer.status))]
        if file.tables:
            digest = digest_of(words_of(answer.strengths, numbers))
            ends.append(f"UINT32_C({digest:#010x})")
        yield [values[name] for name in model.inputs], ends


def words_of(strengths: Sequence[float], numbers: CNumbers) -> list[int]:
    """Return the words of 32 bits of strengths; -0 counts as 0, all NaN as one."""
    kind = np.dtype(numbers.kind)
    array = np.array(strengths, kind) + kind.type(0)
    array[np.isnan(array)] = np.nan
    words = np.abs(array).astype(kind.newbyteorder("<")).view("<u4")
    return [int(word) for word in words]


_DIGEST = """
/* 32 bits that change if any bit of any strength does. */
static uint32_t name_digest(const name_real *strengths)
{
    uint32_t digest = UINT32_C(2166136261);
    unsigned long rule;
    for (rule = 0; rule < NAME_RULES; rule++) {
        union { name_real value; UINT bits; } look;
        look.value = strengths[rule] + 0;
WORDS
    }
    return digest;
}
"""

_WORD = "        digest = (digest ^ WORD) * UINT32_C(16777619);"

_RULES_CHECK = """\
        static name_real strengths[NAME_RULES];
        name_answer fired = name_strengths(name_x, strengths);
        is_right = is_right && fired.label == found.label && fired.rule == found.rule
            && fired.status == found.status
            && name_digest(strengths) == name_example[place].digest;
"""

_LOAD = """
static name_real name_x[sizeof name_example->x / sizeof *name_example->x];

static const name_real *name_load(unsigned place)
{
    unsigned line;
    for (line = 0; line < sizeof name_x / sizeof *name_x; line++) {
        union { UINT bits; name_real value; } made;
        made.bits = name_example[place].x[line];
        name_x[line] = made.value;
    }
    return name_x;
}
"""

_MAIN = """
int main(void)
{
    unsigned place, wrong = 0, count = sizeof name_example / sizeof *name_example;
    for (place = 0; place < count; place++) {
        name_answer found = name_decide(name_load(place));
        int is_right = found.label == name_example[place].label
            && found.rule == name_example[place].rule
            && found.status == name_example[place].status;
RULES_CHECK
        if (!is_right) {
            wrong++;
            printf("example %u: class %d, rule %ld, status %d instead of %d, %ld, %d"
                "STRENGTHS\\n", place, found.label, found.rule, found.status,
                name_example[place].label, name_example[place].rule,
                name_example[place].status);
        }
    }
    printf("%u of %u examples answered as expected\\n", count - wrong, count);
    return wrong != 0;
}
"""


def selftest_code(file: CModel) -> Iterator[str]:
    """Yield the self-test, behind a macro."""
    numbers, has_strengths = file.numbers, file.tables is not None
    examples = [*_examples(file)]
    kind = "uint64_t" if numbers.kind is np.float64 else "uint32_t"
    yield "\n#ifdef NAME_SELFTEST\n#include <stdio.h>\n"
    yield "\n/* The bits of the inputs; class, rule and status"
    yield ", and a digest of strengths. */\n" if has_strengths else ". */\n"
    yield "static const struct {\n"
    yield f"    {kind} x[{max(len(file.model.inputs), 1)}];\n"
    yield "    int label;\n    long rule;\n    int status;\n"
    yield "    uint32_t digest;\n" if has_strengths else ""
    yield f"}} name_example[{len(examples)}] = {{\n"
    for row, ends in examples:
        yield f"    /* {', '.join(map(numbers.shown, row)) or 'no inputs'} */\n"
        yield f"    {{{', '.join([bits_of(row, numbers), *ends])}}},\n"
    yield "};\n"
    yield _LOAD.replace("UINT", kind)
    if has_strengths:
        words = ["look.bits"]
        if numbers.kind is np.float64:
            words = ["(uint32_t)look.bits", "(uint32_t)(look.bits >> 32)"]
        lines = "\n".join(_WORD.replace("WORD", word) for word in words)
        yield _DIGEST.replace("UINT ", f"{kind} ").replace("WORDS", lines)
    check = _RULES_CHECK if has_strengths else ""
    main = _MAIN.replace("RULES_CHECK\n", check)
    yield main.replace("STRENGTHS", ", or strengths" if check else "")
    yield "#endif\n"


Real = np.float64 | np.float32


@np.errstate(all="ignore")
def answer_of_tables(file: CModel, row: Row) -> Answer:
    """Return the prediction of the tables of a file in their number type."""
    model, tables = file.model, file.tables
    values = _axis_values(file, row)
    if tables is None:
        if values is None:
            return Answer(0, model.semantics.missing, Status.MISSING)
        rule = _leaf(file, values)
        return Answer(rule, model.rule_labels[rule - 1], Status.DECIDED)
    if values is None:
        lost = (math.nan,) * len(model.rules)
        return Answer(0, model.semantics.missing, Status.MISSING, lost)
    fired = _strengths(file, tables, values)
    best = max(fired)
    if best == 0.0:
        return Answer(0, model.semantics.uncovered, Status.UNCOVERED, fired)
    winner = fired.index(best)
    status = Status.TIE if fired.count(best) > 1 else Status.DECIDED
    return Answer(winner + 1, model.rules[winner].then, status, fired)


def _axis_values(file: CModel, row: Row) -> list[Real] | None:
    """Return the value of each variable; None if one is not finite."""
    numbers = file.numbers
    stand = stand_ins(file.model.variables)
    result: list[Real] = [numbers.kind(row[name]) for name in file.model.inputs]
    for place, name in enumerate(file.model.inputs):
        if name in stand and not np.isfinite(result[place]):
            [value] = numbers.rounded([stand[name]])
            result[place] = numbers.kind(value)
    for variable in file.model.variables:
        total: Real | None = None
        for part in variable.parts:
            (weight,) = numbers.rounded([part.weight], is_divisor=True)
            (centre,) = numbers.rounded([part.centre])
            distance = result[file.line[part.input]] - numbers.kind(centre)
            one = numbers.kind(weight) * distance
            total = one if total is None else total + one
        if total is not None:
            result.append(total)
    return result if all(map(np.isfinite, result)) else None


def _leaf(file: CModel, values: Sequence[Real]) -> int:
    """Return the number of the leaf that a walk arrives at, from 1."""
    tests, place = file.tests, 0
    while place < len(tests):
        one = tests[place]
        (cut,) = file.numbers.rounded([one.cut])
        place = (
            one.yes
            if values[file.line[one.variable]] > file.numbers.kind(cut)
            else one.no
        )
    return place - len(tests) + 1


def _strengths(
    file: CModel, tables: Tables, values: Sequence[Real]
) -> tuple[float, ...]:
    """Return the strength of each rule."""
    is_product = file.model.semantics.conjunction == "product"
    one, places = file.numbers.kind(1), tables.places
    path = [one] * (max(places.depth) + 1)
    result = [one] * len(tables.label)
    degrees: dict[int, Real] = {}
    for proposition, depth, rule in zip(
        places.proposition, places.depth, places.rule, strict=True
    ):
        if proposition not in degrees:
            degrees[proposition] = _proposition(
                tables, proposition, values, file.numbers
            )
        degree, before = degrees[proposition], path[depth - 1]
        path[depth] = before * degree if is_product else min(before, degree)
        if rule:
            result[rule - 1] = path[depth]
    return tuple(map(float, result))


def _proposition(
    tables: Tables, proposition: int, values: Sequence[Real], numbers: CNumbers
) -> Real:
    first, last = tables.proposition_first[proposition : proposition + 2]
    one = numbers.kind(1)
    if first == last:
        return one
    x = values[tables.proposition_line[proposition]]
    degrees: list[Real] = []
    for term in tables.proposition_term[first:last]:
        atoms = range(*tables.term_first[term : term + 2])
        degrees.append(min((_atom(tables, a, x, numbers) for a in atoms), default=one))
    return one - max(degrees) if tables.negated[proposition] else max(degrees)


def _atom(tables: Tables, atom: int, x: Real, numbers: CNumbers) -> Real:
    kind, count, first = tables.kind[atom], tables.count[atom], tables.first[atom]
    after = tables.first[atom + 1] if atom + 1 < len(tables.first) else None
    n = [numbers.kind(value) for value in tables.number[first:after]]
    zero, one = numbers.kind(0), numbers.kind(1)
    if kind in (LOW_END, HIGH_END):
        if (x > n[0]) == (kind == LOW_END):
            return one
        if count == 1:
            return zero
        return _clamped((x - n[1]) / n[2], zero, numbers.kind(numbers.below_one))
    if kind == POINTS:
        return _line(n[:count], n[count:], x, numbers)
    u = _clamped((x - n[0]) / n[1], zero, n[2])
    t = min(u, one)
    body = _clamped(one - t * _curve(n[4:], numbers.kind(2) * t - one), zero, one)
    w = _clamped((n[2] - u) / n[3], zero, one)
    square = w * w
    return body * (square * square)


def _line(
    values: Sequence[Real], degrees: Sequence[Real], x: Real, numbers: CNumbers
) -> Real:
    low = sum(1 for value in values if x > value)
    if low in (0, len(values)):
        return degrees[low and -1]
    near, far = (low, low - 1) if degrees[low - 1] > 0 else (low - 1, low)
    if degrees[near] == degrees[far]:
        return degrees[near]
    largest = numbers.kind(numbers.largest)
    width = _clamped(values[far] - values[near], -largest, largest)
    result = degrees[near] + (x - values[near]) / width * (degrees[far] - degrees[near])
    return _clamped(result, *sorted((degrees[near], degrees[far])))


def _curve(coefficients: Sequence[Real], x: Real) -> Real:
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def _clamped(value: Real, low: Real, high: Real) -> Real:
    return min(max(value, low), high)

"""The self-test of generated C: rows of inputs, and the answers they must get."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import msgspec
import numpy as np

from fuzzytree.exporters.c_expected import axis_values, leaf, strengths
from fuzzytree.exporters.c_tables import Tables
from fuzzytree.exporters.c_text import Numbers, fill
from fuzzytree.exporters.c_tree import Question
from fuzzytree.model.contracts import Model
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.probing import Row, few_probes
from fuzzytree.semantics.reference import Answer, Status, descend, evaluate

_MOST_ROWS = 160
_FEWEST_ROWS = 8
_STRENGTHS = 20_000  # of all rows together


class Example(msgspec.Struct, frozen=True):
    """A row and its answer.

    Attributes:
        row: The inputs, in order.
        label: The class, or None.
        rule: The number of the rule or leaf, or 0.
        status: A `fuzzytree.semantics.reference.Status`.
        digest: That of all strengths; 0 for a tree.
    """

    row: tuple[float, ...]
    label: int
    rule: int
    status: int
    digest: int = 0


def examples_of(
    model: Model,
    asked: Sequence[Question],
    tables: Tables | None,
    line: Mapping[str, int],
    numbers: Numbers,
) -> list[Example]:
    """Return rows and their answers: the reference's in double, else the tables'.

    Args:
        model: The model.
        asked: The questions of a tree.
        tables: The rules of a rule base.
        line: The place of each variable's value.
        numbers: The number type.
    """
    found: list[Example] = []
    rows = rows_of(model, len(tables.label) if tables else 1)
    for row in rows:
        if numbers.kind is np.float64:
            given = row
            answer = _reference(model, given)
        else:
            given = {name: _as_float(value) for name, value in row.items()}
            answer = _computed(model, asked, tables, line, numbers, given)
        label = number_of(answer.label, model)
        digest = digest_of(answer.strengths, numbers)
        values = tuple(given[name] for name in model.inputs)
        found.append(Example(values, label, answer.rule, int(answer.status), digest))
    return found


@np.errstate(over="ignore")
def _as_float(value: float) -> float:
    return float(np.float32(value))


def number_of(label: str | None, model: Model) -> int:
    """Return the number of a class, -1 for none."""
    return -1 if label is None else model.classes.index(label)


def _reference(model: Model, row: Row) -> Answer:
    return descend(model, row) if isinstance(model, FuzzyTree) else evaluate(model, row)


def _computed(
    model: Model,
    asked: Sequence[Question],
    tables: Tables | None,
    line: Mapping[str, int],
    numbers: Numbers,
    row: Row,
) -> Answer:
    """Return the answer that the tables give in their number type."""
    given = [row[name] for name in model.inputs]
    values = axis_values(model.variables, line, given, numbers)
    if isinstance(model, FuzzyTree) or tables is None:
        if values is None:
            return Answer(0, model.semantics.missing, Status.MISSING)
        rule = leaf(asked, values, numbers)
        labels = model.leaves if isinstance(model, FuzzyTree) else ()
        return Answer(rule, labels[rule - 1].label, Status.DECIDED)
    if values is None:
        lost = (math.nan,) * len(model.rules)
        return Answer(0, model.semantics.missing, Status.MISSING, lost)
    is_product = model.semantics.conjunction == "product"
    fired = strengths(tables, values, numbers, is_product=is_product)
    best = max(fired)
    if best == 0.0:
        return Answer(0, model.semantics.uncovered, Status.UNCOVERED, fired)
    winner = fired.index(best)
    status = Status.TIE if fired.count(best) > 1 else Status.DECIDED
    return Answer(winner + 1, model.rules[winner].then, status, fired)


def rows_of(model: Model, rules: int) -> list[Row]:
    """Return rows for a self-test: some at landmarks, some at random, and special ones.

    Args:
        model: The model.
        rules: How many strengths a row has; the more, the fewer rows.
    """
    limit = max(_FEWEST_ROWS, min(_MOST_ROWS, _STRENGTHS // max(rules, 1)))
    return few_probes(model, limit)


def digest_of(strengths: Sequence[float], numbers: Numbers) -> int:
    """Return 32 bits that change if any bit of any strength does.

    No number is counted as one, and -0 as 0.
    """
    kind = np.dtype(numbers.kind)
    array = np.array(strengths, kind) + kind.type(0)
    array[np.isnan(array)] = np.nan
    digest = 2166136261
    for word in np.abs(array).astype(kind.newbyteorder("<")).view("<u4").tolist():
        digest = (digest ^ word) * 16777619 & 0xFFFFFFFF
    return digest


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


def selftest_code(
    examples: Sequence[Example], numbers: Numbers, prefix: str, *, has_strengths: bool
) -> Iterator[str]:
    """Yield the self-test, behind a macro."""
    size = max(len(examples[0].row), 1)
    kind = "uint64_t" if numbers.kind is np.float64 else "uint32_t"
    yield fill("\n#ifdef NAME_SELFTEST\n#include <stdio.h>\n", prefix)
    yield "\n/* The bits of the inputs; class, rule and status"
    yield ", and a digest of strengths. */\n" if has_strengths else ". */\n"
    yield "static const struct {\n"
    yield f"    {kind} x[{size}];\n"
    yield "    int label;\n    long rule;\n    int status;\n"
    yield "    uint32_t digest;\n" if has_strengths else ""
    yield fill(f"}} name_example[{len(examples)}] = {{\n", prefix)
    for one in examples:
        digest = f", UINT32_C({one.digest:#010x})" if has_strengths else ""
        shown = ", ".join(map(numbers.shown, one.row)) or "no inputs"
        yield f"    /* {shown} */\n"
        yield f"    {{{{{_bits(one.row, numbers)}}}, "
        yield f"{one.label}, {one.rule}, {one.status}{digest}}},\n"
    yield "};\n"
    yield fill(_LOAD.replace("UINT", kind), prefix)
    if has_strengths:
        words = ["look.bits"]
        if numbers.kind is np.float64:
            words = ["(uint32_t)look.bits", "(uint32_t)(look.bits >> 32)"]
        lines = "\n".join(_WORD.replace("WORD", word) for word in words)
        yield fill(_DIGEST.replace("UINT ", f"{kind} ").replace("WORDS", lines), prefix)
    check = _RULES_CHECK if has_strengths else ""
    main = _MAIN.replace("RULES_CHECK\n", check)
    yield fill(main.replace("STRENGTHS", ", or strengths" if check else ""), prefix)
    yield "#endif\n"


def _bits(row: Sequence[float], numbers: Numbers) -> str:
    """Return the bits of some numbers as constants."""
    size = np.dtype(numbers.kind).itemsize
    array = np.array(row, numbers.kind).view(f"u{size}")
    words = [f"UINT{8 * size}_C({bits:#0{2 * size + 2}x})" for bits in array.tolist()]
    return ", ".join(words) or "0"

"""The values of a model's variables in C: inputs, combinations, and what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.exporters.c_text import Numbers, fill, real_table, whole_table
from fuzzytree.model.rulebase import Variable

_FINITE = """
/* Look at the exponent, without a library: it is full in infinities and no numbers. */
static int name_is_finite(name_real value)
{
    union { name_real value; UINT bits; } look;
    look.value = value;
    return ~HIGH << 1 >> REST != 0;
}
"""

_INPUTS = """
static int name_has_all(const name_real *x)
{
    unsigned place = NAME_INPUTS;
    while (place > 0)
        if (!name_is_finite(x[--place]))
            return 0;
    return 1;
}
"""

_COMBINED = """
/* Inputs, then combinations: weight * (input - centre), summed in order. */
static int name_has_all(const name_real *x, name_real *value)
{
    unsigned place, part = 0, end;
    for (place = 0; place < NAME_INPUTS; place++)
        value[place] = x[place];
    for (place = 0; place < NAME_VARIABLES - NAME_INPUTS; place++) {
        name_real total = name_weight[part] * (x[name_part[part]] - name_centre[part]);
        for (end = name_part_end[place], part++; part < end; part++) {
            name_real one = x[name_part[part]] - name_centre[part];
            total = total + name_weight[part] * one;
        }
        value[NAME_INPUTS + place] = total;
    }
    place = NAME_VARIABLES;
    while (place > 0)
        if (!name_is_finite(value[--place]))
            return 0;
    return 1;
}
"""

_NO_INPUTS = """
static int name_has_all(const name_real *x)
{
    (void)x;
    return 1;
}
"""

_TAKE = """\
    const name_real *value = x;
    if (!name_has_all(x))
        return answer;
"""

_TAKE_COMBINED = """\
    name_real value[NAME_VARIABLES];
    if (!name_has_all(x, value))
        return answer;
"""


def lines_of(variables: Sequence[Variable]) -> dict[str, int]:
    """Return the place of each variable's value: inputs first, then combinations."""
    inputs = [v.name for v in variables if not v.parts]
    mixed = [v.name for v in variables if v.parts]
    return {name: place for place, name in enumerate([*inputs, *mixed])}


def taking(variables: Sequence[Variable]) -> str:
    """Return statements that put the values into `value`, or return the answer."""
    return _TAKE_COMBINED if any(v.parts for v in variables) else _TAKE


def axes_code(
    variables: Sequence[Variable],
    line: Mapping[str, int],
    numbers: Numbers,
    prefix: str,
) -> Iterator[str]:
    """Yield what looks whether all values are there, and computes combinations."""
    if not variables:
        yield fill(_NO_INPUTS, prefix)
        return
    if numbers.name == "double":
        words = ("uint64_t", "(uint32_t)(look.bits >> 32)", "21")
    else:
        words = ("uint32_t", "look.bits", "24")
    text = _FINITE
    for mark, word in zip(("UINT", "HIGH", "REST"), words, strict=True):
        text = text.replace(mark, word)
    mixed = [variable for variable in variables if variable.parts]
    if not mixed:
        yield fill(text, prefix) + fill(_INPUTS, prefix) + "\n"
        return
    parts = [part for variable in mixed for part in variable.parts]
    ends: list[int] = []
    for variable in mixed:
        ends.append((ends[-1] if ends else 0) + len(variable.parts))
    weights = numbers.nearest([part.weight for part in parts], is_divisor=True)
    centres = numbers.nearest([part.centre for part in parts])
    yield from real_table(f"{prefix}_weight", weights, "Of combinations.", numbers)
    yield from real_table(f"{prefix}_centre", centres, "Of combinations.", numbers)
    inputs = [line[part.input] for part in parts]
    yield from whole_table(f"{prefix}_part", inputs, "Their inputs.")
    yield from whole_table(f"{prefix}_part_end", ends, "Behind each combination.")
    yield fill(text, prefix) + fill(_COMBINED, prefix) + "\n"

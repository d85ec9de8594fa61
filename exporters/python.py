"""Python: a tree or rule base as one file that needs nothing but Python.

The file holds the model as tables of numbers, and the functions of the reference, which
read them: so its predictions have the reference's bits, it may be of any depth, and
a person can follow it. Text of the model enters only through `repr`, in tables and in
comments, where nothing can be mistaken for code.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Iterator, Sequence

from fuzzytree.exporters.program_text import (
    RuleRows,
    answer_of,
    combination_row,
    node_rows,
    places_of,
    title_of,
)
from fuzzytree.model import (
    Format,
    FuzzyTree,
    Model,
    RuleBase,
    Variable,
    Written,
    fingerprint,
    sentence,
)
from fuzzytree.semantics import probes

_EXAMPLES = 6

_START = """\
import math

# Status of an answer.
DECIDED, TIE, UNCOVERED, MISSING = 0, 1, 2, 3
"""

_AXES = """

def axes(values):
    \"\"\"Return the value of every variable: the inputs, then the combinations.\"\"\"
    found = [float(value) for value in values]
    for (line, weight, centre), *others in COMBINATIONS:
        total = weight * (found[line] - centre)
        for line, weight, centre in others:
            total = total + weight * (found[line] - centre)
        found.append(total)
    return found
"""

_TREE = """

def answer(values):
    \"\"\"Return class, leaf number and status for the inputs in order.\"\"\"
    found = axes(values)
    if not all(map(math.isfinite, found)):
        return WHEN_MISSING, 0, MISSING
    place = 0 if NODES else -1
    while place >= 0:
        line, cuts, targets = NODES[place]
        x = found[line]
        low, high = 0, len(cuts)
        while low < high:  # cuts[low - 1] < x <= cuts[low], by bisection
            middle = (low + high) // 2
            if x > cuts[middle]:
                low = middle + 1
            else:
                high = middle
        place = targets[low]
    return LEAVES[-place - 1], -place, DECIDED
"""

_RULES = """

def answer(values):
    \"\"\"Return class, rule number, status and strengths for the inputs in order.\"\"\"
    found = axes(values)
    if not all(map(math.isfinite, found)):
        return WHEN_MISSING, 0, MISSING, [math.nan] * len(RULES)
    degrees = [clause_degree(found[line], *rest) for line, *rest in CLAUSES]
    strengths = [strength([degrees[c] for c in when]) for when, _ in RULES]
    best = max(strengths)
    if best == 0.0:
        return WHEN_UNCOVERED, 0, UNCOVERED, strengths
    winner = strengths.index(best)
    status = TIE if strengths.count(best) > 1 else DECIDED
    return RULES[winner][1], winner + 1, status, strengths


def strength(degrees):
    \"\"\"Return how true a rule is.\"\"\"
    if not IS_PRODUCT:
        return min(degrees, default=1.0)
    total = 1.0
    for degree in degrees:
        total = total * degree
    return total


def clause_degree(x, terms, negated):
    \"\"\"Return the largest degree of some terms, or 1 minus it.\"\"\"
    highest = max(SHAPES[TERMS[t][0]](x, *TERMS[t][1:]) for t in terms)
    return 1.0 - highest if negated else highest


def band(x, low, high, left, right):
    \"\"\"Return 1 for low < x <= high, and the degree of a flank elsewhere.\"\"\"
    if low is not None and x <= low:
        return 0.0 if left is None else flank(x, *left)
    if high is not None and x > high:
        return 0.0 if right is None else flank(x, *right)
    return 1.0


def flank(x, start, end, curve):
    \"\"\"Return a degree that falls from start to end, always below 1.\"\"\"
    q = clip((x - end) / (start - end), 1.0)
    return min(max(0.0, horner(curve, q) * q), 1.0 - 2.0**-53)


def lr(x, mean, left, right):
    \"\"\"Return the degree of a set with a left and a right side.\"\"\"
    d = x - mean
    return min(side(-d, *left), side(d, *right))


def side(distance, spread, reach, curve):
    \"\"\"Return a degree that falls with the distance from the mean.\"\"\"
    u = clip(distance / spread, reach)
    t = min(u, 1.0)
    body = clip(1.0 - t * horner(curve, 2.0 * t - 1.0), 1.0)
    w = clip((reach - u) / (reach - 1.0), 1.0)
    square = w * w
    return body * (square * square)


def points(x, values, degrees):
    \"\"\"Return the degree on the line between the points beside x.\"\"\"
    low, high = 0, len(values)
    while low < high:  # values[low - 1] < x <= values[low], by bisection
        middle = (low + high) // 2
        if x > values[middle]:
            low = middle + 1
        else:
            high = middle
    if low in (0, len(values)):
        return degrees[low and -1]
    anchor, other = values[low], values[low - 1]
    near, far = degrees[low], degrees[low - 1]
    if far == 0.0:
        anchor, other, near, far = other, anchor, far, near
    line = near + (x - anchor) / (other - anchor) * (far - near)
    return min(max(line, min(near, far)), max(near, far))


def horner(coefficients, x):
    \"\"\"Return c0 + x (c1 + x (c2 + ...)), from the inside out.\"\"\"
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def clip(value, high):
    \"\"\"Return a value clamped to 0 and high.\"\"\"
    return min(max(0.0, value), high)


SHAPES = {"band": band, "lr": lr, "points": points}
"""

_TEST = """

if __name__ == "__main__":
    for given, expected in EXAMPLES:
        got = answer(given)[:3]
        if got != expected:
            raise SystemExit(f"{given}: {got} instead of {expected}")
    print(f"{len(EXAMPLES)} examples answered as expected")
"""


def write_python(model: Model, /, *, allow_loss: bool = False) -> Written:
    """Return a model as the text of a Python file, in UTF-8.

    The file offers `decide(...)`, which takes each input by name and returns class
    (or None), rule number (0 for none) and status; for a rule base also
    `strengths(...)`; and `answer(values)` for the inputs in order. Run as a program it
    tests itself.

    Args:
        model: A tree or a rule base.
        allow_loss: Of no effect: nothing is lost.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> space = {"__name__": "tree"}
        >>> exec(write_python(random_tree(0)).content, space)
        >>> space["decide"](x1=0.0, x2=0.0, x3=0.0, x4=0.0)[2]
        0
    """
    del allow_loss
    inputs = [variable for variable in model.variables if not variable.parts]
    places = places_of(model.variables)
    mixes = (
        f"{_literal(combination_row(v, places))},  # {v.name!r}"
        for v in model.variables
        if v.parts
    )
    if isinstance(model, RuleBase):
        tables, functions = _rule_tables(model, places), _RULES
    else:
        tables, functions = _tree_tables(model, places), _TREE
    text = "".join(
        [
            *_heading(model),
            _START,
            *_lines("INPUTS", (_literal(v.name) + f",  # {v.unit!r}" for v in inputs)),
            *_lines("COMBINATIONS", mixes),
            *tables,
            f"WHEN_MISSING = {model.semantics.missing!r}\n",
            _AXES,
            functions,
            *_doors(inputs, has_strengths=isinstance(model, RuleBase)),
            *_lines("EXAMPLES", _examples(model), gap="\n\n"),
            _TEST,
        ]
    )
    return Written(text.encode("utf-8"))


def _heading(model: Model) -> Iterator[str]:
    yield "# -*- coding: utf-8 -*-\n"  # so that no name below can declare another
    yield f"# {title_of(model, repr(model.name))}. Written by fuzzytree.\n"
    yield f"# Fingerprint: {fingerprint(model)}\n"
    yield f"# Classes: {', '.join(map(repr, model.classes))}\n\n"


def _lines(name: str, entries: Iterable[str], gap: str = "\n") -> Iterator[str]:
    """Yield a tuple, one entry to a line; entries end in a comma and maybe a comment.

    A line of an entry is indented once.
    """
    yield f"{gap}{name} = (\n"
    for entry in entries:
        yield f"    {entry}\n"
    yield ")\n"


def _literal(value: object) -> str:
    """Return a value as Python source; tuples are entered."""
    match value:
        case float() if not math.isfinite(value):
            return f'float("{value!r}")'
        case tuple():
            members: tuple[object, ...] = value
            inside = ", ".join(map(_literal, members))
            return f"({inside},)" if len(members) == 1 else f"({inside})"
        case _:
            return repr(value)


def _tree_tables(tree: FuzzyTree, places: dict[str, int]) -> Iterator[str]:
    yield "\n# Line of the variable, cuts, and for each interval the next node's place"
    yield "\n# or -k for leaf k. A value on a cut belongs to the interval below it."
    yield from _lines(
        "NODES",
        (
            f"{_literal(row)},  # {node.variable!r}: {', '.join(map(repr, names))}"
            for row, node, names in node_rows(tree, places)
        ),
    )
    yield from _lines("LEAVES", (f"{leaf.label!r}," for leaf in tree.leaves))


def _rule_tables(rules: RuleBase, places: dict[str, int]) -> Iterator[str]:
    rows = RuleRows(rules, places)
    yield "\n# Line of the variable, places of the terms in TERMS, if it is negated."
    yield from _lines("CLAUSES", (f"{_literal(row)}," for row in rows.clauses))
    yield "\n# Places of the clauses in CLAUSES, and the class."
    pairs = zip(rules.rules, rows.rules, strict=True)
    yield from _lines(
        "RULES",
        (
            f"{_literal((row, rule.then))},  # {n}. {sentence(rule)!r}"
            for n, (rule, row) in enumerate(pairs, 1)
        ),
    )
    yield f"WHEN_UNCOVERED = {rules.semantics.uncovered!r}\n"
    yield f"IS_PRODUCT = {rules.semantics.conjunction == 'product'}\n"
    yield "\n# The kind of each term, and its numbers."
    yield from _lines(
        "TERMS",
        (
            f"{_literal(row)},  # {variable!r} is {name!r}"
            for variable, name, row in rows.terms
        ),
    )


def parameters(names: Sequence[str]) -> tuple[str, ...]:
    """Return the name of each input as a parameter: unlike, and never a keyword.

    Example:
        >>> parameters(["grip force", "grip-force", "class", "1st"])
        ('grip_force', 'grip_force_2', 'class_', 'x_1st')
    """
    taken = {"answer"}
    result: list[str] = []
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)
        if not plain or plain[0].isdigit():
            plain = f"x_{plain}"
        if keyword.iskeyword(plain):
            plain += "_"
        unique, count = plain, 1
        while unique in taken:
            count += 1
            unique = f"{plain}_{count}"
        taken.add(unique)
        result.append(unique)
    return tuple(result)


def _doors(inputs: Sequence[Variable], *, has_strengths: bool) -> Iterator[str]:
    names = parameters([variable.name for variable in inputs])
    takes = ", ".join(["*", *names]) if names else ""
    values = "".join(f"{n}, " for n in names).strip()
    doors = [("decide", "class, number of the rule and status", "[:3]")]
    if has_strengths:
        doors.append(("strengths", "the strength of every rule", "[3]"))
    for name, what, part in doors:
        yield f"\n\ndef {name}({takes}):\n"
        yield f'    """Return {what}; each input is given by name."""\n'
        yield f"    return answer(({values})){part}\n"


def _examples(model: Model) -> Iterator[str]:
    """Yield rows and the predictions of the reference, the last with missing values."""
    rows = probes(model, limit=_EXAMPLES)
    if model.inputs:
        rows.append(dict.fromkeys(model.inputs, math.nan))
    for row in rows:
        prediction = answer_of(model, row)
        values = tuple(row[name] for name in model.inputs)
        expected = (prediction.label, prediction.rule, int(prediction.status))
        yield f"({_literal(values)}, {_literal(expected)}),"


FORMAT = Format(
    name="python",
    suffixes=(".py",),
    carries=("tree", "rules"),
    write=write_python,
    dtype="float64",
)

"""Python: a tree or rule base as one file that needs nothing but Python.

A rule base is written as its program, step by step; a tree as a table of its nodes,
which a loop descends, so that it may be of any depth. Predictions have the reference's
bits. Text of the model enters only through `repr`, in tables and in comments, where
nothing can be mistaken for code.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar

from fuzzytree.exporters.program_text import (
    ScriptSteps,
    answer_of,
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
from fuzzytree.semantics import ResultKind, Step, from_axes, from_rules, probes

_EXAMPLES = 6
_FIRST: tuple[ResultKind, ...] = ("class", "rule", "status")

_START = """\
import math
from bisect import bisect_left

# Status of an answer.
DECIDED, TIE, UNCOVERED, MISSING = 0, 1, 2, 3
"""

_TREE = """\
    if not all(map(math.isfinite, axes)):
        return @missing@, 0, MISSING
    place = 0 if NODES else -1
    while place >= 0:
        line, cuts, targets = NODES[place]
        place = targets[bisect_left(cuts, axes[line])]
    return LEAVES[-place - 1], -place, DECIDED
"""

_RULES = """

def answer(values):
    \"\"\"Return class, rule number, status and strengths for the inputs in order.\"\"\"
    place, rule, status, *strengths = numbers(@values@)
    label = None if place < 0.0 else CLASSES[int(place)]
    return label, int(rule), int(status), strengths
"""

_NUMBER = """

def number(value, names):
    \"\"\"Return a number; of a category its place, of an unknown one NaN.\"\"\"
    if isinstance(value, str) and names:
        return float(names.index(value)) if value in names else math.nan
    return float(value)
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
    tests itself. A category is its name, or its place among the categories.

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
    text = "".join(
        [
            *_heading(model),
            _START,
            *_lines("INPUTS", (_literal(v.name) + f",  # {v.unit!r}" for v in inputs)),
            *_categories(inputs),
            *(_tree(model) if isinstance(model, FuzzyTree) else _rules(model)),
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


def _tree(tree: FuzzyTree) -> Iterator[str]:
    places = places_of(tree.variables)
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
    program = from_axes(tree)
    steps = _Steps(program)
    yield "\n\ndef answer(values):\n"
    yield '    """Return class, leaf number and status for the inputs in order."""\n'
    yield f"    x = {_values(tree)}\n"
    yield from steps.body()
    yield f"    axes = [{', '.join(map(steps.value, program.of('output')))}]\n"
    yield _TREE.replace("@missing@", repr(tree.semantics.missing))


def _rules(rules: RuleBase) -> Iterator[str]:
    program = from_rules(rules)
    steps = _Steps(program)
    body = list(steps.body())
    first = [place for kind in _FIRST for place in program.of(kind)]
    yield from _lines("CLASSES", (f"{label!r}," for label in rules.classes))
    for numbers, name in steps.tables.items():
        yield f"\n{name} = {numbers}\n"
    yield "\n\ndef numbers(x):\n"
    yield '    """Return class, rule, status and strengths as numbers."""\n'
    yield from body
    yield "    return [\n"
    yield from (f"        {steps.value(place)},\n" for place in first)
    for rule, place in zip(rules.rules, program.of("strength"), strict=True):
        yield f"        {steps.value(place)},  # {sentence(rule)!r}\n"
    yield "    ]\n"
    yield from steps.helpers()
    yield _RULES.replace("@values@", _values(rules))


def _values(model: Model) -> str:
    """Return what makes numbers of the values of the inputs."""
    if any(variable.categories for variable in model.variables):
        return "[*map(number, values, CATEGORIES)]"
    return "[float(value) for value in values]"


def _categories(inputs: Sequence[Variable]) -> Iterator[str]:
    """Yield the categories of each input, if there are any."""
    if any(variable.categories for variable in inputs):
        names = (f"{_literal(one.categories)},  # {one.name!r}" for one in inputs)
        yield from _lines("CATEGORIES", names)
        yield _NUMBER


class _Steps(ScriptSteps):
    """A program as text."""

    statement = "    {} = {}"
    comment = " #"
    functions: ClassVar[Mapping[str, str]] = {
        "minimum": """

def minimum(a, b):
    return a if a < b or a != a else b
""",
        "maximum": """

def maximum(a, b):
    return a if a > b or a != a else b
""",
        "divide": """

def divide(a, b):
    \"\"\"Return a / b; of a division by 0, which no prediction uses, NaN.\"\"\"
    return a / b if b else math.nan
""",
        "pick": """

def pick(table, place):
    \"\"\"Return the number of a table at a place, its first one if there is none.\"\"\"
    return table[int(place) if 0 <= place < len(table) else 0]
""",
    }
    signs: ClassVar[Mapping[str, str]] = {
        **{name: sign for name, sign in ScriptSteps.signs.items() if name != "divide"},
        "and": "and",
        "or": "or",
        "not": "not ",
        "where": "{1} if {0} else {2}",
    }

    def literal(self, value: object) -> str:
        """Return a value as Python source."""
        return _literal(value)

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function."""
        if step.operation == "is_finite":
            return f"math.isfinite({operands[0]})"
        if step.operation == "below":
            return f"bisect_left({self.table(step.table)}, {operands[0]})"
        if step.operation == "divide" and self.still[step.arguments[1]]:
            return f"{operands[0]} / {operands[1]}"
        self.needs.add(step.operation)
        tables = [self.table(step.table)] if step.table else []
        return f"{step.operation}({', '.join([*tables, *operands])})"


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

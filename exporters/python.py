"""Python: a model as one file that needs nothing but Python.

A rule base or fuzzy system is written as its program, step by step; a tree as a table
of its nodes, which a loop descends, so that it may be of any depth. Predictions have
the reference's bits, and so have a system's numbers, for Python's own functions are
those of the C library. Text of the model enters only through `repr`, in tables and in
comments, where nothing can be mistaken for code.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar

from fuzzytree.exporters.program_text import (
    DECISION,
    INFERENCE,
    ScriptSteps,
    examples_of,
    node_lines,
    title_of,
)
from fuzzytree.model import (
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    RuleBase,
    Variable,
    Written,
    fingerprint,
    sentence,
)
from fuzzytree.semantics import (
    OVER_SAMPLES,
    Step,
    from_axes,
    from_rules,
    from_system,
    probes,
)

_EXAMPLES = 6

_START = """\
import math
from bisect import bisect_left
from functools import reduce
from itertools import accumulate

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

_SYSTEM = """

def answer(values):
    \"\"\"Return outputs, status and activations for the inputs in order.\"\"\"
    found, count = numbers(@values@), len(OUTPUTS)
    return found[:count], int(found[count]), found[count + 1 :]


def is_near(a, b, most):
    \"\"\"Return whether numbers differ by no more than functions such as exp may.\"\"\"
    return a == b or (a != a and b != b) or abs(a - b) <= most
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
    for given, expected, *bounds in EXAMPLES:
        got = @got@
        if @wrong@:
            raise SystemExit(f"{given}: {got} instead of {expected}")
    print(f"{len(EXAMPLES)} examples answered as expected")
"""


def write_python(model: Document, /, *, allow_loss: bool = False) -> Written:
    """Return a model as the text of a Python file, in UTF-8.

    Of a tree or rule base the file offers `decide(...)`, which takes each input by name
    and returns class (or None), rule number (0 for none) and status; for a rule base
    also `strengths(...)`; and `answer(values)` for the inputs in order. Of a fuzzy
    system it offers `infer(...)` and `answer(values)`, which return outputs, status and
    activations. Run as a program it tests itself. A category is its name, or its place
    among the categories.

    Args:
        model: A tree, a rule base or a fuzzy system.
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
    got, wrong = "answer(given)[:3]", "got != expected"
    if model.outputs:
        got = "numbers(given)[: len(expected)]"
        wrong = "not all(map(is_near, got, expected, *bounds))"
    text = "".join(
        [
            *_heading(model),
            _START,
            *_lines("INPUTS", (_literal(v.name) + f",  # {v.unit!r}" for v in inputs)),
            *_categories(inputs),
            *_body(model),
            *_doors(model, inputs),
            *_lines("EXAMPLES", _examples(model), gap="\n\n"),
            _TEST.replace("@got@", got).replace("@wrong@", wrong),
        ]
    )
    return Written(text.encode("utf-8"))


def _heading(model: Document) -> Iterator[str]:
    yield "# -*- coding: utf-8 -*-\n"  # so that no name below can declare another
    yield f"# {title_of(model, repr(model.name))}. Written by fuzzytree.\n"
    yield f"# Fingerprint: {fingerprint(model)}\n"
    if model.classes:
        yield f"# Classes: {', '.join(map(repr, model.classes))}\n"
    yield "\n"


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


def _body(model: Document) -> Iterator[str]:
    match model:
        case FuzzyTree():
            yield from _tree(model)
        case RuleBase():
            yield from _lines("CLASSES", (f"{label!r}," for label in model.classes))
            titles = [*DECISION[:3], *map(sentence, model.rules)]
            yield from PythonSteps(from_rules(model)).function(DECISION, titles)
            yield _RULES.replace("@values@", _values(model))
        case FuzzySystem():
            names = (f"{one.name!r},  # {one.unit!r}" for one in model.outputs)
            yield from _lines("OUTPUTS", names)
            program = from_system(model, activations=True)
            yield from PythonSteps(program).function(INFERENCE)
            yield _SYSTEM.replace("@values@", _values(model))


def _tree(tree: FuzzyTree) -> Iterator[str]:
    yield "\n# Line of the variable, cuts, and for each interval the next node's place"
    yield "\n# or -k for leaf k. A value on a cut belongs to the interval below it."
    yield from _lines("NODES", node_lines(tree, _literal, "  #"))
    yield from _lines("LEAVES", (f"{leaf.label!r}," for leaf in tree.leaves))
    program = from_axes(tree)
    steps = PythonSteps(program)
    yield "\n\ndef answer(values):\n"
    yield '    """Return class, leaf number and status for the inputs in order."""\n'
    yield f"    x = {_values(tree)}\n"
    yield from steps.body()
    yield f"    axes = [{', '.join(map(steps.value, program.of('output')))}]\n"
    yield _TREE.replace("@missing@", repr(tree.semantics.missing))


def _values(model: Document) -> str:
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


_CALLS: Mapping[str, str] = {
    "absolute": "abs({})",
    "floor": "whole(math.floor, {})",
    "ceiling": "whole(math.ceil, {})",
    "round": "whole(round, {})",
    "square_root": "quiet(math.sqrt, {})",
    "exponential": "quiet(math.exp, {})",
    "logarithm": "quiet(math.log, {})",
    "logarithm_10": "quiet(math.log10, {})",
    "logarithm_1p": "quiet(math.log1p, {})",
    "sine": "quiet(math.sin, {})",
    "cosine": "quiet(math.cos, {})",
    "tangent": "quiet(math.tan, {})",
    "arc_sine": "quiet(math.asin, {})",
    "arc_cosine": "quiet(math.acos, {})",
    "arc_tangent": "quiet(math.atan, {})",
    "hyperbolic_sine": "quiet(math.sinh, {})",
    "hyperbolic_cosine": "quiet(math.cosh, {})",
    "hyperbolic_tangent": "quiet(math.tanh, {})",
    "area_sine": "quiet(math.asinh, {})",
    "area_cosine": "quiet(math.acosh, {})",
    "area_tangent": "quiet(math.atanh, {})",
    "remainder": "quiet(math.fmod, {}, {})",
    "arc_tangent_2": "math.atan2({}, {})",
    "is_finite": "math.isfinite({})",
    "below": "float(bisect_left({}, {}))",
    "total": "total({})",
    "running": "list(accumulate({}))",
    "last": "{}[-1]",
    "highest": "reduce(maximum, {})",
    "lowest": "reduce(minimum, {})",
}
"""What operations call, where that is no function of their name and of two numbers."""


class PythonSteps(ScriptSteps):
    """A program as text."""

    statement = "    {} = {}"
    comment = " #"
    setting = "\n{} = {}\n"
    opening = '\n\ndef numbers(x):\n    """Return {} as numbers."""\n'
    result = "        {},  # {}\n"
    ending = "    return [\n", "    ]\n"
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
    \"\"\"Return a / b; of a division by 0 an infinity, of 0 by 0 NaN.\"\"\"
    if b:
        return a / b
    sign = math.copysign(1.0, b)
    return math.copysign(math.inf, a) * sign if a and a == a else math.nan
""",
        "pick": """

def pick(table, place):
    \"\"\"Return the number of a table at a place, its first one if there is none.\"\"\"
    return table[int(place) if 0 <= place < len(table) else 0]
""",
        "whole": """

def whole(function, a):
    \"\"\"Return a as a whole number, of the sign of a.\"\"\"
    return math.copysign(float(function(a)), a) if math.isfinite(a) else a
""",
        "quiet": """

def quiet(function, *values):
    \"\"\"Return what C makes of numbers: where Python fails, NaN or an infinity.\"\"\"
    try:
        return function(*values)
    except OverflowError:
        is_negative = function is math.sinh and values[0] < 0.0
        return -math.inf if is_negative else math.inf
    except ValueError:
        poles = {math.log: 0.0, math.log10: 0.0, math.log1p: -1.0}
        if values[0] == poles.get(function):
            return -math.inf
        if function is math.atanh and abs(values[0]) == 1.0:
            return math.copysign(math.inf, values[0])
        return math.nan
""",
        "power": """

def power(a, b):
    \"\"\"Return a to the power b as C has it.\"\"\"
    try:
        return math.pow(a, b)
    except (OverflowError, ValueError):
        if a < 0.0 and math.fmod(b, 1.0):
            return math.nan
        is_negative = math.copysign(1.0, a) < 0.0 and abs(math.fmod(b, 2.0)) == 1.0
        return -math.inf if is_negative else math.inf
""",
        "total": """

def total(numbers):
    \"\"\"Return the sum by halves: the second half is added to the first.\"\"\"
    size = 1 << (len(numbers) - 1).bit_length()
    numbers = numbers + [0.0] * (size - len(numbers))
    while size > 1:
        size //= 2
        numbers = [a + b for a, b in zip(numbers[:size], numbers[size:])]
    return numbers[0]
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

    def expression(self, step: Step) -> str:
        """Return a step as an expression; of samples, as a list of them."""
        if step.operation in OVER_SAMPLES or step.operation == "running":
            return self.call(step, [self.variable.format(*step.arguments)])
        text = super().expression(step)
        return f"[{text} for i in range({step.samples})]" if step.samples else text

    def call(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function."""
        if step.operation == "divide" and self.still[step.arguments[1]]:
            return f"{operands[0]} / {operands[1]}"
        template = _CALLS.get(step.operation, f"{step.operation}({{}}, {{}})")
        self.needs.update(re.findall(r"\w+", template))
        tables = [self.table(step.table)] if step.table else []
        return template.format(*tables, *operands)


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


def _doors(model: Document, inputs: Sequence[Variable]) -> Iterator[str]:
    names = parameters([variable.name for variable in inputs])
    takes = ", ".join(["*", *names]) if names else ""
    values = "".join(f"{n}, " for n in names).strip()
    doors = [("decide", "class, number of the rule and status", "[:3]")]
    if model.rules:
        doors.append(("strengths", "the strength of every rule", "[3]"))
    if model.outputs:
        doors = [("infer", "outputs, status and activations", "")]
    for name, what, part in doors:
        yield f"\n\ndef {name}({takes}):\n"
        yield f'    """Return {what}; each input is given by name."""\n'
        yield f"    return answer(({values})){part}\n"


def _examples(model: Document) -> Iterator[str]:
    """Yield rows and the answers of the reference, the last with missing values."""
    rows = probes(model, limit=_EXAMPLES)
    if model.inputs:
        rows.append(dict.fromkeys(model.inputs, math.nan))
    for values, answer, bounds in examples_of(model, rows):
        status = int(answer.status)
        parts: tuple[object, ...] = ((answer.label, answer.rule, status),)
        if model.outputs:
            parts = (*answer.outputs, float(status)), (*bounds, 0.0)
        yield f"{_literal((tuple(values), *parts))},"


FORMAT = Format(
    name="python",
    suffixes=(".py",),
    write=write_python,
    dtype="float64",
)

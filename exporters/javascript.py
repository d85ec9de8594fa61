"""JavaScript: a model as one file that needs nothing but JavaScript.

A rule base or fuzzy system is written as its program, step by step; a tree as a table
of its nodes, and the function that descends it. Numbers of JavaScript are IEEE doubles,
and `minimum` and `maximum` stand where `Math.min` and `Math.max` would see -0 and NaN
otherwise than the reference: so predictions have the reference's bits. Text
of the model enters only as ASCII string literals without `<` and `>`, also in comments,
so that nothing in it can be mistaken for code, in a file or in a page of HTML.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from fuzzytree.exporters.js_steps import HELPERS, JsSteps
from fuzzytree.exporters.js_text import (
    AS_MODULE,
    AS_SCRIPT,
    DECIDE,
    INFER,
    MAIN,
    ROWS,
    START,
    STRENGTHS,
    TEST,
    TREE,
    filled,
    literal,
    table,
    text_of,
)
from fuzzytree.exporters.program_text import (
    DECISION,
    INFERENCE,
    class_number,
    examples_of,
    node_lines,
    rated_rules,
    source_of,
    title_of,
)
from fuzzytree.model import (
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Model,
    RuleBase,
    SystemOutput,
    Variable,
    Written,
    sentence,
)
from fuzzytree.semantics import (
    few_probes,
    from_axes,
    from_rules,
    from_system,
    row_probabilities,
)

_FEWEST_EXAMPLES = 8
_STRENGTHS = 20_000  # of all examples together


def write(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    module: Literal["es", "script"] = "es",
    probabilities: bool = False,
    examples: int = 64,
) -> Written:
    """Return a model as the text of a JavaScript file, in ASCII.

    For a tree or rule base the file offers `decide(row)`, which takes an object with
    each input by its name and returns `label` (a class or null), `rule` (its number, 0
    for none) and `status`; `answer(values)` for the inputs in order; and for a rule
    base `strengths(row)`. For a fuzzy system it offers `infer(row)` and
    `answer(values)`, which return `outputs`, `status` and `activations`. Run by node it
    tests itself; so does `selfTest()`.

    Args:
        model: A tree, a rule base or a fuzzy system.
        allow_loss: Of no effect: nothing is lost.
        module: As an ES module (`es`), or (`script`) for a plain script element, where
            it becomes `fuzzytree[name of the model]`, and for `require`.
        probabilities: Whether `answer` of a rule base also returns `probabilities`, of
            the classes in order; the rule base must have them.
        examples: The most rows of the self-test; fewer where there are many rules.

    Raises:
        ValueError: If probabilities are wanted that the model does not have, or the
            number of examples is below 0.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(write(random_tree(0)).content.decode("ascii").splitlines()[0])
        /* A fuzzy tree, named "random 7". Written by fuzzytree. */
    """
    source = source_of(write, model, locals())
    del allow_loss
    if examples < 0:
        raise ValueError(f"examples: a number from 0 on, not {examples}")
    rated = rated_rules(model, "javascript") if probabilities else None
    body = "".join(_body(model, rated, examples))
    ending = AS_MODULE if module == "es" else AS_SCRIPT
    ending = filled(ending, doors=", ".join(_doors(model)), name=text_of(model.name))
    if module == "script":
        body = f'(() => {{\n"use strict";\n{body}{ending}{MAIN}}})();\n'
    else:
        body += ending + MAIN
    title = title_of(model, text_of(model.name))
    heading = f"/* {title}. Written by fuzzytree. */\n"
    heading += f"/* Fingerprint: {source} */\n"
    return Written(f"{heading}{body}".encode("ascii"))


def _doors(model: Document) -> tuple[str, ...]:
    if model.outputs:
        return ("INPUTS", "OUTPUTS", "infer", "answer", "selfTest")
    strengths = ("strengths",) if model.rules else ()
    return ("INPUTS", "CLASSES", "decide", *strengths, "answer", "selfTest")


def _body(model: Document, rated: RuleBase | None, most: int) -> Iterator[str]:
    yield START
    inputs = (_entry_of(one) for one in model.variables if not one.parts)
    yield from table("INPUTS", inputs)
    match model:
        case FuzzyTree():
            yield from _classes(model)
            yield from _tree(model)
            yield filled(DECIDE, what="class, leaf number and status", strengths="")
        case RuleBase():
            yield from _classes(model)
            comments = [*DECISION[:3], *map(sentence, model.rules)]
            kinds, shown = DECISION, ", strengths"
            what = "class, rule number, status and strengths"
            if rated is not None:
                kinds = (*DECISION, "probability")
                comments += [f"probability of {name}" for name in model.classes]
                what += ", and probabilities"
                count = len(model.rules)
                shown = f", strengths: strengths.slice(0, {count})"
                shown += f", probabilities: strengths.slice({count})"
            program = from_rules(model, probabilities=rated is not None)
            yield from JsSteps(program).function(kinds, comments)
            yield filled(DECIDE, what=what, strengths=shown)
            yield STRENGTHS
        case FuzzySystem():
            yield from table("OUTPUTS", map(_entry_of, model.outputs))
            program = from_system(model, activations=True)
            yield from JsSteps(program).function(INFERENCE)
            yield INFER
    yield ROWS
    yield "\n/* Inputs, numbers, and how far these may be off: only where functions"
    yield "\n * such as exp have last digits of their own. */"
    yield from table("EXAMPLES", _examples(model, rated, most))
    yield TEST


def _entry_of(one: Variable | SystemOutput) -> str:
    """Return the entry of a variable in a table of names."""
    unit = f" // {text_of(one.unit)}" if one.unit else ""
    return f"{text_of(one.name)},{unit}"


def _classes(model: Model) -> Iterator[str]:
    return table("CLASSES", (f"{text_of(label)}," for label in model.classes))


def _tree(tree: FuzzyTree) -> Iterator[str]:
    yield "\n/* Line of the variable, cuts, and for each interval the next node's place"
    yield "\n * or -k for leaf k. A value on a cut belongs to the interval below it. */"
    yield from table("NODES", node_lines(tree, literal, " //"))
    yield "\n/* Places of the leaves' classes. */"
    yield from table("LEAVES", (f"{tree.classes.index(x.label)}," for x in tree.leaves))
    program = from_axes(tree)
    steps = JsSteps(program)
    yield "\n/* Return the class's place, leaf number and status. */"
    yield "\nfunction numbers(x) {\n"
    yield from steps.body()
    axes = ", ".join(map(steps.value, program.of("output")))
    missing = str(class_number(tree.semantics.missing, tree))
    yield filled(TREE.removeprefix("\n"), axes=axes, missing=missing)
    yield HELPERS["below"]


def _examples(model: Document, rated: RuleBase | None, most: int) -> Iterator[str]:
    """Yield rows, the answers of the reference, and how far numbers may be off."""
    few = max(_STRENGTHS // max(len(model.rules), 1), _FEWEST_EXAMPLES)
    rows = few_probes(model, min(most, few))
    for values, answer, bounds in examples_of(model, rows):
        expected: list[float] = [*answer.outputs, int(answer.status)]
        if not model.outputs:
            place = class_number(answer.label, model)
            expected = [place, answer.rule, *expected, *answer.strengths]
        if rated is not None:
            expected += row_probabilities(rated, answer)
        yield f"{literal([values, expected, bounds])},"


FORMAT = Format(
    name="javascript",
    suffixes=(".mjs", ".js"),
    write=write,
    dtype="float64",
)

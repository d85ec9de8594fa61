"""JavaScript: a model as one file that needs nothing but JavaScript.

A tree or rule base is written as tables of numbers, and the functions of the reference,
which read them; a fuzzy system as its program, step by step. Numbers of JavaScript are
IEEE doubles, and `smaller` and `larger` stand where `Math.min` and `Math.max` would see
-0 and NaN otherwise than the reference: so predictions have the reference's bits. Text
of the model enters only as ASCII string literals without `<` and `>`, also in comments,
so that nothing in it can be mistaken for code, in a file or in a page of HTML.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from typing import Literal

from fuzzytree.exporters.js_system import entry_of, system_parts
from fuzzytree.exporters.js_text import (
    AS_MODULE,
    AS_SCRIPT,
    AXES,
    DIGEST,
    MAIN,
    ROWS,
    RULES,
    START,
    TEST,
    TREE,
    filled,
    literal,
    table,
    text_of,
)
from fuzzytree.exporters.program_text import (
    RuleRows,
    answer_of,
    combination_row,
    digest_of,
    node_rows,
    places_of,
    title_of,
)
from fuzzytree.model import (
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Model,
    RuleBase,
    Written,
    fingerprint,
    sentence,
)
from fuzzytree.semantics import few_probes

_MOST_EXAMPLES = 64
_FEWEST_EXAMPLES = 8
_STRENGTHS = 20_000  # of all examples together


def write(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    module: Literal["es", "script"] = "es",
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

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(write(random_tree(0)).content.decode("ascii").splitlines()[0])
        /* A fuzzy tree, named "random 7". Written by fuzzytree. */
    """
    del allow_loss
    body = "".join(_body(model))
    ending = AS_MODULE if module == "es" else AS_SCRIPT
    ending = filled(ending, doors=", ".join(_doors(model)), name=text_of(model.name))
    if module == "script":
        body = f'(() => {{\n"use strict";\n{body}{ending}{MAIN}}})();\n'
    else:
        body += ending + MAIN
    title = title_of(model, text_of(model.name))
    heading = f"/* {title}. Written by fuzzytree. */\n"
    heading += f"/* Fingerprint: {fingerprint(model)} */\n"
    return Written(f"{heading}{body}".encode("ascii"))


def _doors(model: Document) -> tuple[str, ...]:
    match model:
        case FuzzyTree():
            return ("INPUTS", "CLASSES", "decide", "answer", "selfTest")
        case RuleBase():
            return ("INPUTS", "CLASSES", "decide", "strengths", "answer", "selfTest")
        case FuzzySystem():
            return ("INPUTS", "OUTPUTS", "infer", "answer", "selfTest")


def _body(model: Document) -> Iterator[str]:
    yield START
    if isinstance(model, FuzzySystem):
        yield from system_parts(model, ROWS)
        return
    inputs = [variable for variable in model.variables if not variable.parts]
    places = places_of(model.variables)
    mixes = (
        f"{literal(combination_row(v, places))}, // {text_of(v.name)}"
        for v in model.variables
        if v.parts
    )
    yield from table("INPUTS", map(entry_of, inputs))
    yield from table("CLASSES", (f"{text_of(label)}," for label in model.classes))
    yield f"const WHEN_MISSING = {literal(model.semantics.missing)};\n"
    yield "\n/* Place of an input, weight and centre of each part. */"
    yield from table("COMBINATIONS", mixes)
    if isinstance(model, RuleBase):
        yield from _rule_tables(model, places)
    else:
        yield from _tree_tables(model, places)
    yield ROWS
    yield AXES
    yield RULES if isinstance(model, RuleBase) else TREE
    what = "class, rule and status"
    if isinstance(model, RuleBase):
        what += ", and a digest of the strengths,"
        yield DIGEST
    yield f"\n/* Inputs, and the {what} that they lead to. */"
    yield from table("EXAMPLES", _examples(model))
    yield TEST


def _tree_tables(tree: FuzzyTree, places: dict[str, int]) -> Iterator[str]:
    yield "\n/* Line of the variable, cuts, and for each interval the next node's place"
    yield "\n * or -k for leaf k. A value on a cut belongs to the interval below it. */"
    yield from table(
        "NODES",
        (
            f"{literal(row)}, // {text_of(node.variable)}: "
            f"{', '.join(map(text_of, names))}"
            for row, node, names in node_rows(tree, places)
        ),
    )
    yield "\n/* Places of the leaves' classes. */"
    yield from table("LEAVES", (f"{tree.classes.index(x.label)}," for x in tree.leaves))


def _rule_tables(rules: RuleBase, places: dict[str, int]) -> Iterator[str]:
    rows = RuleRows(rules, places)
    label = {name: place for place, name in enumerate(rules.classes)}
    yield "\n/* Line of the variable, places of terms in TERMS, if it is negated. */"
    yield from table("CLAUSES", (f"{literal(row)}," for row in rows.clauses))
    yield "\n/* Places of the clauses in CLAUSES, and of the class. */"
    pairs = zip(rules.rules, rows.rules, strict=True)
    yield from table(
        "RULES",
        (
            f"{literal((row, label[rule.then]))}, // {n}. {text_of(sentence(rule))}"
            for n, (rule, row) in enumerate(pairs, 1)
        ),
    )
    yield f"const WHEN_UNCOVERED = {literal(rules.semantics.uncovered)};\n"
    yield f"const IS_PRODUCT = {literal(rules.semantics.conjunction == 'product')};\n"
    yield "\n/* The kind of each term, and its numbers. */"
    yield from table(
        "TERMS",
        (
            f"{literal(row)}, // {text_of(variable)} is {text_of(name)}"
            for variable, name, row in rows.terms
        ),
    )


def _examples(model: Model) -> Iterator[str]:
    """Yield rows and the predictions of the reference."""
    rules = len(model.rules) if isinstance(model, RuleBase) else 1
    most = min(_MOST_EXAMPLES, _STRENGTHS // rules)
    for row in few_probes(model, max(most, _FEWEST_EXAMPLES)):
        values = [row[name] for name in model.inputs]
        prediction = answer_of(model, row)
        expected = [prediction.label, prediction.rule, int(prediction.status)]
        if isinstance(model, RuleBase):
            expected.append(digest_of(words_of(prediction.strengths)))
        yield f"{literal([values, *expected])},"


def words_of(strengths: Sequence[float]) -> tuple[int, ...]:
    """Return the words of 32 bits of strengths; NaN counts as -1."""
    numbers = [-1.0 if math.isnan(value) else value for value in strengths]
    content = struct.pack(f"<{len(numbers)}d", *numbers)
    return struct.unpack(f"<{2 * len(numbers)}I", content)


FORMAT = Format(
    name="javascript",
    suffixes=(".mjs", ".js"),
    carries=("tree", "rules", "system"),
    write=write,
    dtype="float64",
)

"""Structured Text: a model as a function block of IEC 61131-3.

Trees and rules depend on no library: comparisons, `+ - * /`, `ABS`, loops with a fixed
number of turns, arrays of fixed length. What is compared and computed, and in which
order, is the reference's. Controllers may stop where a number is NaN or a division is
by zero: so inputs are checked first, and nothing is computed from a missing
value.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Literal

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.plcopen_xml import plcopen_text
from fuzzytree.exporters.program_text import (
    class_number,
    source_of,
    strengths_of,
    targets_of,
)
from fuzzytree.exporters.st_steps import RuleSteps, SystemSteps, decision
from fuzzytree.exporters.st_text import (
    LONG,
    SINGLE,
    Block,
    Declaration,
    StNumbers,
    identifiers,
    known_inputs,
    remark,
    table,
)
from fuzzytree.formats import text_of
from fuzzytree.model import (
    Document,
    Format,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Model,
    NameMap,
    RuleBase,
    SystemOutput,
    Variable,
    Written,
    stand_ins,
)
from fuzzytree.semantics import from_system

Layout = Literal["text", "plcopen"]

_OUTPUTS = ("class_number", "rule", "status", "strengths")
_LOCALS = (
    *("is_known", "k", "level", "node", "place", "value_of_node", "axis"),
    *("rule_class", "leaf_class", "node_axis", "node_first", "node_last"),
    *("cut", "target"),
)


def write(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    dtype: Literal["float64", "float32"] = "float64",
    name: str = "",
    layout: Layout = "text",
) -> Written:
    """Return a model as a function block of Structured Text, in ASCII.

    Its inputs are those of the model, its outputs `class_number` (the place among the
    classes, from 0; -1 for none), `rule` (number of the rule or leaf, 0 for none),
    `status` (0 decided, 1 tie, 2 no rule fires, 3 missing), and of a rule base the
    `strengths` of all rules, which are 0 where a value is missing. A fuzzy system has
    its own outputs, `status` (0, 2 or 3), and `is_number`: whether each output has a
    number; where it has none it is 0.

    Args:
        model: A tree, a rule base or a fuzzy system.
        allow_loss: Of no effect: a model is written without loss or not at all.
        dtype: LREAL (`float64`), or REAL (`float32`), which rounds all numbers.
        name: Of the function block; made from the model's unless given.
        layout: The text of the block, or PLCopen XML (TC6, version 2.01) with the block
            alone, which Beremiz, CODESYS and other tools import.

    Raises:
        LossError: If a system needs what the language has not.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> lines = write(random_tree(0)).content.decode("ascii").splitlines()
        >>> [line for line in lines if line.startswith("FUNCTION_BLOCK")]
        ['FUNCTION_BLOCK random_7']
    """
    source = source_of(write, model, locals())
    del allow_loss
    numbers = LONG if dtype == "float64" else SINGLE
    match model:
        case FuzzySystem():
            return _written_system(model, numbers, name, source, layout)
        case RuleBase():
            make, count = partial(_rules, model), len(strengths_of(model)[0].steps)
        case FuzzyTree():
            make, count = partial(_tree, model), 0
    mixed = [variable for variable in model.variables if variable.parts]
    combined = {variable.name: f"mix_{k}" for k, variable in enumerate(mixed, 1)}
    filled = {name: f"in_{k}" for k, name in enumerate(stand_ins(model.variables), 1)}
    steps = [f"{letter}{k}" for letter in "vbnt" for k in range(count)]
    taken = [*_OUTPUTS, *_LOCALS, *combined.values(), *filled.values(), *steps]
    given = name or model.name
    names = identifiers(model.inputs, taken)
    block = identifiers([given], [*taken, *names.accepted.values()])[given]
    values = {**names.accepted, **filled, **combined}
    constants, local, body = make(values, numbers)
    kind = numbers.name
    own = [Declaration(combined[v.name], kind, (remark(v.name),)) for v in mixed]
    own += [Declaration(name, kind) for name in filled.values()]
    body = [
        *_fill(model, names, filled, numbers),
        *_guard(model, values, mixed, combined, numbers),
        *body,
    ]
    parts, outputs = (constants, [*own, *local], body), _outputs(model, numbers)
    content = _block(model, block, source, numbers, names, outputs, parts)
    return _written(given, names, content, layout)


Parts = tuple[list[Declaration], list[Declaration], list[str]]
"""Constants, variables, and lines of statements."""


def _block(
    model: Document,
    name: str,
    source: str,
    numbers: StNumbers,
    names: NameMap,
    outputs: Iterable[Declaration],
    parts: Parts,
) -> Block:
    """Return a block with the inputs and the variables that every one has."""
    constants, local, body = parts
    sections = {
        "VAR_INPUT": [*_declared(model.variables, names, numbers)],
        "VAR_OUTPUT": [*outputs],
        "VAR CONSTANT": constants,
        "VAR": [Declaration("is_known", "BOOL"), Declaration("k", "DINT"), *local],
    }
    about = f"Written by fuzzytree: {remark(model.name)}", f"Fingerprint: {source}"
    return Block(name, about, sections, [*body, "END_IF;\n"])


def _written(given: str, names: NameMap, block: Block, layout: Layout) -> Written:
    """Return a function block; its name may differ from the one it should have."""
    text = block.text() if layout == "text" else plcopen_text(block)
    changed = [f"{old!r} is called {new}" for old, new in names.changed.items()]
    if block.name != given:
        changed.insert(0, f"{given!r} is called {block.name}")
    return Written(text.encode("ascii"), (), tuple(changed))


def _outputs(model: Model, numbers: StNumbers) -> Iterator[Declaration]:
    labels = [f"{place}: {remark(one)}" for place, one in enumerate(model.classes)]
    yield Declaration("class_number", "INT", ("-1: no class", *labels))
    what = "rule" if model.rules else "leaf"
    yield Declaration("rule", "DINT", (f"number of the {what}, 0: none",))
    about = "0: decided, 1: tie, 2: no rule fires, 3: missing"
    yield Declaration("status", "INT", (about,))
    if model.rules:
        about, bounds = "firing strength of each rule", (1, len(model.rules))
        yield Declaration("strengths", numbers.name, (about,), bounds)


def _fill(
    model: Model, names: NameMap, filled: Mapping[str, str], numbers: StNumbers
) -> Iterator[str]:
    """Yield statements that put what stands for a missing value in its place."""
    stand, largest = stand_ins(model.variables), numbers.literal(numbers.largest)
    for name, own in filled.items():
        value = numbers.literal(numbers.nearest(stand[name]))
        yield f"{own} := {names[name]};\n"
        yield f"IF NOT ({own} = {own}) THEN {own} := {value}; END_IF;\n"
        yield f"IF ABS({own}) > {largest} THEN {own} := {value}; END_IF;\n"


def _guard(
    model: Model,
    names: Mapping[str, str],
    mixed: list[Variable],
    combined: Mapping[str, str],
    numbers: StNumbers,
) -> Iterator[str]:
    """Yield statements that find missing values and set the outputs for them."""
    yield from known_inputs([names[name] for name in model.inputs], numbers)
    if mixed:
        largest = numbers.literal(numbers.largest)
        yield "IF is_known THEN\n"
        for variable in mixed:
            total = combined[variable.name]
            for place, part in enumerate(variable.parts):
                weight = numbers.literal(numbers.nearest(part.weight))
                centre = numbers.literal(numbers.nearest(part.centre))
                term = f"{weight} * ({names[part.input]} - {centre})"
                term = f"{total} + {term}" if place else term
                yield f"    {total} := {term};\n"
            test = f"NOT (ABS({total}) <= {largest})"
            yield f"    IF {test} THEN is_known := FALSE; END_IF;\n"
        yield "END_IF;\n"
    label = class_number(model.semantics.missing, model)
    yield "IF NOT is_known THEN\n"
    yield f"    class_number := {label};\n    rule := 0;\n    status := 3;\n"
    if model.rules:
        zero = numbers.literal(0.0)
        yield f"    FOR k := 1 TO {len(model.rules)} DO\n"
        yield f"        strengths[k] := {zero};\n    END_FOR;\n"
    yield "ELSE\n"


def _rules(rules: RuleBase, values: Mapping[str, str], numbers: StNumbers) -> Parts:
    steps = RuleSteps(rules, values, numbers)
    body = [*steps.statements(), *decision(rules, numbers)]
    labels = [str(rules.classes.index(rule.then)) for rule in rules.rules]
    about = "places of the rules' classes"
    constants = [table("rule_class", "INT", labels, about), *steps.tables]
    return constants, [*steps.declared.values()], body


def _tree(tree: FuzzyTree, values: Mapping[str, str], numbers: StNumbers) -> Parts:
    labels = [str(tree.classes.index(leaf.label)) for leaf in tree.leaves]
    constants = [table("leaf_class", "INT", labels, "places of the leaves' classes")]
    if not tree.nodes:
        body = ["    rule := 1;\n    status := 0;\n"]
        return constants, [], [*body, "    class_number := leaf_class[0];\n"]
    variables = list(dict.fromkeys(node.variable for node in tree.nodes))
    line = {name: place for place, name in enumerate(variables)}
    firsts: list[str] = []
    lasts: list[str] = []
    cuts: list[str] = []
    targets: list[str] = []
    for node in tree.nodes:
        firsts.append(str(len(targets)))
        targets += map(str, targets_of(node))
        lasts.append(str(len(targets) - 2))
        cuts += [numbers.digits(numbers.at_most(cut)) for cut in node.cuts]
        cuts.append("0.0")  # so that a cut and the target below it share a place
    axes = [str(line[node.variable]) for node in tree.nodes]
    constants += [
        table("node_axis", "INT", axes, "which value each node tests"),
        table("node_first", "DINT", firsts, "place of its first cut"),
        table("node_last", "DINT", lasts, "place of its last cut"),
        table("cut", numbers.name, cuts, "0.0 ends the cuts of a node"),
        table("target", "DINT", targets, "below each cut: a node, or -1 for leaf 1"),
    ]
    local = [
        *(Declaration(one, "DINT") for one in ("node", "place", "level")),
        Declaration("value_of_node", numbers.name),
        Declaration("axis", numbers.name, bounds=(0, len(variables) - 1)),
    ]
    given = [f"    axis[{line[name]}] := {values[name]};\n" for name in variables]
    return constants, local, [*given, *_walk(_depth(tree))]


def _walk(depth: int) -> Iterator[str]:
    yield "    node := 0;\n"
    yield f"    FOR level := 1 TO {depth} DO\n"
    yield "        IF node >= 0 THEN\n"
    yield "            value_of_node := axis[node_axis[node]];\n"
    yield "            place := node_first[node];\n"
    yield "            FOR k := node_first[node] TO node_last[node] DO\n"
    yield "                IF value_of_node > cut[k] THEN place := k + 1; END_IF;\n"
    yield "            END_FOR;\n"
    yield "            node := target[place];\n"
    yield "        END_IF;\n"
    yield "    END_FOR;\n"
    yield "    rule := -node;\n    status := 0;\n"
    yield "    class_number := leaf_class[rule - 1];\n"


def _depth(tree: FuzzyTree) -> int:
    """Return how many nodes the longest path has."""
    depths = [1] * len(tree.nodes)
    for place in range(len(tree.nodes) - 1, -1, -1):
        below = [b.node for b in tree.nodes[place].branches if b.node is not None]
        depths[place] += max((depths[number - 1] for number in below), default=0)
    return depths[0]


_FIXED = ("is_number", "status", "is_known", "k", "halves")


def _written_system(
    system: FuzzySystem, numbers: StNumbers, name: str, source: str, layout: Layout
) -> Written:
    """Return a system as a function block, in ASCII."""
    program = from_system(system)
    taken = [f"{c}{k}" for c in "vbot" for k in range(len(program.steps))]
    given = name or system.name
    variables = [*system.inputs, *(one.name for one in system.outputs)]
    names = identifiers(variables, [*_FIXED, *taken])
    block = identifiers([given], [*_FIXED, *taken, *names.accepted.values()])[given]
    inputs = [names[one] for one in system.inputs]
    steps = SystemSteps(program, dict(zip(system.inputs, inputs, strict=True)), numbers)
    lacking = [*steps.lacking(), *_formulas(system)]
    if lacking:
        raise LossError(
            f"cannot write {system.name[:100]} as structured-text: "
            f"it needs {', '.join(lacking)}"
        )
    body = [*steps.statements(), *_results(system, steps, names)]
    nothing = [
        f"    {names[output.name]} := {numbers.literal(0.0)};\n"
        f"    is_number[{number}] := FALSE;\n"
        for number, output in enumerate(system.outputs, 1)
    ]
    about, bounds = "whether each output has a number", (1, len(system.outputs))
    status = "0: decided, 2: an output has no number of its own, 3: missing"
    outputs = [
        *_declared(system.outputs, names, numbers),
        Declaration("is_number", "BOOL", (about,), bounds),
        Declaration("status", "INT", (status,)),
    ]
    body = [
        *known_inputs(inputs, numbers),
        "IF NOT is_known THEN\n    status := 3;\n",
        *nothing,
        "ELSE\n",
        *body,
    ]
    parts = steps.tables, [*steps.declared.values()], body
    content = _block(system, block, source, numbers, names, outputs, parts)
    written = _written(given, names, content, layout)
    note = "an output without a number is 0 and its `is_number` is FALSE"
    return replace(written, remarks=(*written.remarks, note))


def _formulas(system: FuzzySystem) -> Iterator[str]:
    """Yield what is wrong with formulas: what may have an infinite result."""
    for variable in system.all_variables:
        for label in variable.terms:
            if isinstance(label.function, Formula):
                text = text_of(label.function.expression)
                if re.search(r"[/%^]|\*\*|pow", text):
                    yield f"a division or a power ({label.name!r} of {variable.name!r})"


def _declared(
    variables: Sequence[Variable | SystemOutput],
    names: NameMap,
    numbers: StNumbers,
) -> Iterator[Declaration]:
    """Yield the declarations of inputs or outputs; a combination is neither."""
    for one in variables:
        if isinstance(one, SystemOutput) or not one.parts:
            about = f"{one.name} ({one.unit})" if one.unit else one.name
            yield Declaration(names[one.name], numbers.name, (remark(about),))


def _results(system: FuzzySystem, steps: SystemSteps, names: NameMap) -> Iterator[str]:
    program, numbers = steps.program, steps.numbers
    pairs = zip(system.outputs, program.of("output"), strict=True)
    for number, (output, place) in enumerate(pairs, 1):
        yield f"    {names[output.name]} := {steps.value(place)};\n"
        yield f"    is_number[{number}] := NOT {steps.is_odd(place)};\n"
        yield f"    IF NOT is_number[{number}] THEN\n"
        yield f"        {names[output.name]} := {numbers.literal(0.0)};\n    END_IF;\n"
    (status,) = program.of("status")
    yield "    status := 0;\n"
    for least, code in ((1.5, 2), (2.5, 3)):
        test = f"{steps.value(status)} > {numbers.literal(least)}"
        yield f"    IF {test} THEN status := {code}; END_IF;\n"


FORMAT = Format(
    name="structured-text",
    suffixes=(".st",),
    write=write,
    cannot=("formulas with a division or a power", "functions such as tanh or log"),
    dtype="float64",
)

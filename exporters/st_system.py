"""A fuzzy system as a function block."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from fuzzytree.errors import LossError
from fuzzytree.exporters.st_steps import SystemSteps
from fuzzytree.exporters.st_text import (
    Numbers,
    block_of,
    identifiers,
    known_inputs,
    remark,
)
from fuzzytree.formats.formulas import text_of
from fuzzytree.model.contracts import Written
from fuzzytree.model.naming import Names
from fuzzytree.model.rulebase import fingerprint
from fuzzytree.model.system import Formula, FuzzySystem, SystemInput, SystemOutput
from fuzzytree.semantics.programs.systems import from_system

_FIXED = ("is_number", "status", "is_known", "k", "halves")


def written_system(
    system: FuzzySystem, numbers: Numbers, name: str, *, allow_loss: bool
) -> Written:
    """Return a system as a function block, in ASCII.

    Args:
        system: The system.
        numbers: The number type.
        name: Of the function block; made from the system's if empty.
        allow_loss: Of no effect.

    Raises:
        LossError: If it needs what the language has not.
    """
    del allow_loss
    program = from_system(system)
    taken = [f"{c}{k}" for c in "vbot" for k in range(len(program.steps))]
    given = name or system.name
    variables = [*system.columns, *(one.name for one in system.outputs)]
    names = identifiers(variables, [*_FIXED, *taken])
    block = identifiers([given], [*_FIXED, *taken, *names.accepted.values()])[given]
    inputs = [names[one] for one in system.columns]
    steps = SystemSteps(
        program, dict(zip(system.columns, inputs, strict=True)), numbers
    )
    lacking = [*steps.lacking(), *_formulas(system)]
    if lacking:
        raise LossError(
            f"cannot write {system.name[:100]} as structured-text: "
            f"it needs {', '.join(lacking)}"
        )
    body = [*steps.statements(), *_results(system, steps, names)]
    local = ["    is_known : BOOL;\n    k : DINT;\n"]
    local += [f"    {one} : {kind};\n" for one, kind in steps.declared.items()]
    text = "".join(
        [
            f"(* Written by fuzzytree: {remark(system.name)} *)\n",
            f"(* Fingerprint: {fingerprint(system)} *)\n",
            f"FUNCTION_BLOCK {block}\n",
            *_interface(system, names, numbers),
            *block_of("VAR CONSTANT", steps.tables),
            *block_of("VAR", local),
            "\n",
            *known_inputs(inputs, numbers),
            "IF NOT is_known THEN\n    status := 3;\n",
            *_nothing(system, names, numbers),
            "ELSE\n",
            *body,
            "END_IF;\nEND_FUNCTION_BLOCK\n",
        ]
    )
    changed = [f"{old!r} is called {new}" for old, new in names.changed.items()]
    if block != given:
        changed.insert(0, f"{given!r} is called {block}")
    changed.append("an output that has no number is 0, and `is_number` tells it")
    return Written(text.encode("ascii"), (), tuple(changed))


def _formulas(system: FuzzySystem) -> Iterator[str]:
    """Yield what is wrong with formulas: what may have an infinite result."""
    for variable in system.variables:
        for label in variable.labels:
            if isinstance(label.curve, Formula):
                text = text_of(label.curve.expression)
                if re.search(r"[/%^]|\*\*|pow", text):
                    yield f"a division or a power ({label.name!r} of {variable.name!r})"


def _interface(system: FuzzySystem, names: Names, numbers: Numbers) -> Iterator[str]:
    columns = [one for one in system.inputs if not one.parts]
    yield from block_of("VAR_INPUT", list(_declared(columns, names, numbers)))
    yield "VAR_OUTPUT\n"
    yield from _declared(system.outputs, names, numbers)
    yield f"    is_number : ARRAY [1..{len(system.outputs)}] OF BOOL;\n"
    yield "    status : INT; (* 0: decided, 2: an output has no number of its own, "
    yield "3: missing *)\nEND_VAR\n"


def _declared(
    variables: Sequence[SystemInput | SystemOutput], names: Names, numbers: Numbers
) -> Iterator[str]:
    for one in variables:
        about = f"{one.name} ({one.unit})" if one.unit else one.name
        yield f"    {names[one.name]} : {numbers.name}; (* {remark(about)} *)\n"


def _nothing(system: FuzzySystem, names: Names, numbers: Numbers) -> Iterator[str]:
    for number, output in enumerate(system.outputs, 1):
        yield f"    {names[output.name]} := {numbers.literal(0.0)};\n"
        yield f"    is_number[{number}] := FALSE;\n"


def _results(system: FuzzySystem, steps: SystemSteps, names: Names) -> Iterator[str]:
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

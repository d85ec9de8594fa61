"""Programs without samples, for languages that have no loops."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence

from fuzzytree.semantics.programs.steps import Maker, Place, Program, Step, result_of

_JOINS = {"total": "add", "highest": "maximum", "lowest": "minimum"}


def unrolled(program: Program) -> Program:
    """Return a program with the same results whose steps have no samples.

    A step with samples becomes a step for each; sums are added by halves as before. A
    zero may have the other sign.

    Example:
        >>> make = Maker()
        >>> total = make("total", make.input("x") * make.index(3))
        >>> program = make.program("p", ("x",), (result_of("output", "y", total),))
        >>> [step.operation for step in unrolled(program).steps]
        ['input', 'constant', 'constant', 'multiply', 'multiply', 'add', 'add']
    """
    make = Maker()
    rows: list[list[Place]] = []
    titles = program.titles or [""] * len(program.steps)
    for step, title in zip(program.steps, titles, strict=True):
        places = _places(make, step, [rows[one] for one in step.arguments])
        if not step.samples:
            make.titled(places[0], title)
        rows.append(places)
    results = [result_of(r.kind, r.name, rows[r.step][0]) for r in program.results]
    return make.program(program.name, program.inputs, tuple(results))


def _places(make: Maker, step: Step, operands: list[list[Place]]) -> list[Place]:
    """Return the places of a step, one for each of its samples."""
    match step.operation:
        case "constant":
            return [make.constant(step.number)]
        case "input":
            return [make.input(step.name)]
        case "index":
            return [make.constant(float(place)) for place in range(step.samples)]
        case "last":
            return operands[0][-1:]
        case "running":
            add = functools.partial(make, "add")
            return [*itertools.accumulate(operands[0], add)]
        case "total" | "highest" | "lowest":
            return [_by_halves(make, _JOINS[step.operation], operands[0])]
        case operation:
            count = step.samples or 1
            rows = [[one[k % len(one)] for one in operands] for k in range(count)]
            if step.table:
                return [make.table(operation, row[0], step.table) for row in rows]
            return [make(operation, *row) for row in rows]


def _by_halves(make: Maker, join: str, places: Sequence[Place]) -> Place:
    while len(places) > 1:
        half = 1 << ((len(places) - 1).bit_length() - 1)
        first, second = places[:half], places[half:]
        pairs = zip(first, second, strict=False)
        places = [*(make(join, *pair) for pair in pairs), *first[len(second) :]]
    return places[0]

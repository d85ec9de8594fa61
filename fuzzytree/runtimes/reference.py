"""The reference as a runtime: row by row, slow, and right by definition."""

from __future__ import annotations

import numpy as np

from fuzzytree.model import (
    Document,
    FloatArray,
    FuzzySystem,
    FuzzyTree,
    Outcome,
    RuleBase,
    Run,
    Runtime,
)
from fuzzytree.runtimes.rows import checked, outcome_of, system_outcome
from fuzzytree.semantics import Answer, descend, evaluate, infer


def load(model: Document, *, with_strengths: bool = True) -> Run:
    """Return a function that answers rows one after another."""

    def run(values: FloatArray) -> Outcome:
        table = checked(values, model.inputs).T.tolist()
        rows = [dict(zip(model.inputs, row, strict=True)) for row in table]
        answers: list[Answer]
        match model:
            case FuzzySystem():
                inferred = [infer(model, row) for row in rows]
                lines = [(*r.outputs, *r.activations, r.status) for r in inferred]
                width = len(model.outputs) + len(model.rules) + 1
                numbers = np.array(lines, np.float64).reshape(len(rows), width).T
                return system_outcome(model, numbers)
            case RuleBase():
                answers = [evaluate(model, row) for row in rows]
            case FuzzyTree():
                answers = [descend(model, row) for row in rows]
        return outcome_of(model, [[a.rule, a.status, *a.strengths] for a in answers])

    return run


RUNTIMES = (
    Runtime(
        "reference",
        ("tree", "rules", "system"),
        load,
        is_slow=True,
        is_definition=True,
        note="one row after another",
    ),
)

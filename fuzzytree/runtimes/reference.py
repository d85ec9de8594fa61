"""The reference as a runtime: row by row, slow, and right by definition."""

from __future__ import annotations

import numpy as np

from fuzzytree.model import (
    FloatArray,
    FuzzySystem,
    Model,
    Outcome,
    RuleBase,
    Run,
    Runtime,
    SystemOutcome,
    SystemRun,
)
from fuzzytree.runtimes.rows import checked, outcome_of
from fuzzytree.semantics import Answer, descend, evaluate, infer


def load(model: Model) -> Run:
    """Return a function that answers rows one after another."""

    def run(values: FloatArray) -> Outcome:
        table = checked(values, model.inputs).T.tolist()
        rows = [dict(zip(model.inputs, row, strict=True)) for row in table]
        answers: list[Answer]
        if isinstance(model, RuleBase):
            answers = [evaluate(model, row) for row in rows]
        else:
            answers = [descend(model, row) for row in rows]
        return outcome_of(model, [[a.rule, a.status, *a.strengths] for a in answers])

    return run


def infer_rows(system: FuzzySystem, /, *, activations: bool = False) -> SystemRun:
    """Return a function that infers rows one after another."""
    names = system.inputs

    def run(values: FloatArray) -> SystemOutcome:
        table = checked(values, names).T.tolist()
        result = [infer(system, dict(zip(names, row, strict=True))) for row in table]
        outputs = np.array([one.outputs for one in result], np.float64)
        degrees = np.array([one.activations for one in result], np.float64)
        return SystemOutcome(
            outputs.reshape(len(result), len(system.outputs)).T,
            np.array([one.status for one in result], np.int64),
            degrees.reshape(len(result), len(system.rules)).T if activations else None,
        )

    return run


RUNTIMES = (
    Runtime(
        "reference",
        ("tree", "rules", "system"),
        load,
        load_system=infer_rows,
        is_slow=True,
        is_definition=True,
        note="one row after another",
    ),
)

"""The reference as a runtime: row by row, slow, and right by definition."""

from __future__ import annotations

from fuzzytree.model import Document, FloatArray, Outcome, Run, Runtime
from fuzzytree.runtimes.rows import checked, outcome_of
from fuzzytree.semantics import answer_of


def load(model: Document, *, with_strengths: bool = True) -> Run:
    """Return a function that answers rows one after another."""

    def run(values: FloatArray) -> Outcome:
        table = checked(values, model.inputs).T.tolist()
        rows = (dict(zip(model.inputs, row, strict=True)) for row in table)
        answers = [answer_of(model, row) for row in rows]
        return outcome_of(
            model,
            [[*(a.outputs or [a.rule]), a.status, *a.strengths] for a in answers],
        )

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

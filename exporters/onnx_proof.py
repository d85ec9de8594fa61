"""Only loading and running proves a file: this is done before it counts as written."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import onnxruntime

from fuzzytree.errors import DisagreementError, LossError
from fuzzytree.exporters.onnx_session import RUNTIME_ERRORS, first_line, open_session
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import LR, Band, Points, RuleBase, Term
from fuzzytree.numerics.narrowing import Real
from fuzzytree.semantics.reference import descend, evaluate

_MOST_CLAUSES = 50_000  # what the reference does in well under a second


def prove(
    content: bytes,
    model: Model,
    columns: Sequence[str],
    names: Sequence[str],
    *,
    kind: type[Real],
    is_exact: bool,
    limit: int,
) -> None:
    """Load a file, run it and compare its answers with the reference.

    Args:
        content: The file.
        model: What it should mean.
        columns: The columns of its input.
        names: Its outputs.
        kind: The type of its input.
        is_exact: Whether answers must be those of the reference; otherwise only rows
            with a missing value are compared, and that there is an answer to all.
        limit: The largest number of rows.

    Raises:
        LossError: If onnxruntime does not load or run the file.
        DisagreementError: If an answer differs.
    """
    rows = list(sample_rows(model, limit))
    try:
        session = open_session(content)
        table = [[row.get(name, 0.0) for name in columns] for row in rows]
        with np.errstate(over="ignore"):  # beyond float32 is missing in float32
            values = np.array(table, np.float64).astype(kind)
        values = values.reshape(len(rows), len(columns))
        found = session(names, values)
    except RUNTIME_ERRORS as error:
        raise LossError(
            f"cannot write {model.name} as onnx: onnxruntime "
            f"{onnxruntime.__version__} does not run it: {first_line(error)}"
        ) from error
    for number, row in enumerate(rows):
        is_missing = not all(map(math.isfinite, row.values()))
        if is_exact or is_missing:
            given = {name: array[number] for name, array in found.items()}
            _compare(model, row, given)


def sample_rows(model: Model, limit: int) -> Iterator[dict[str, float]]:
    """Yield rows near a model's landmarks, the last with a missing value."""
    size = 1
    if isinstance(model, RuleBase):
        size = sum(len(c.terms) for rule in model.rules for c in rule.when) or 1
    points = {
        v.name: sorted(_landmarks(v.terms)) or [v.low or 0.0, v.high or 1.0]
        for v in model.variables
        if not v.parts
    }
    for number in range(max(1, min(limit, _MOST_CLAUSES // size))):
        yield {
            name: values[(number * (3 + 2 * position) + position) % len(values)]
            for position, (name, values) in enumerate(points.items())
        }
    if points:
        yield dict.fromkeys(points, math.nan)


def _landmarks(terms: Sequence[Term]) -> set[float]:
    found: set[float] = set()
    for term in terms:
        match term.shape:
            case Band(low=low, high=high, left=left, right=right):
                ends = [flank.end for flank in (left, right) if flank is not None]
                found.update(ends, (v for v in (low, high) if v is not None))
            case LR(mean=mean, left=left, right=right):
                found.update((mean, mean - left.spread / 2, mean + right.spread / 2))
            case Points(values=values):
                found.update(values)
                found.update(a + (b - a) / 2 for a, b in itertools.pairwise(values))
    return found


def _compare(model: Model, row: dict[str, float], given: dict[str, object]) -> None:
    if isinstance(model, RuleBase):
        answer = evaluate(model, row)
    else:
        answer = descend(model, row)
    expected: dict[str, object] = {
        "rule": answer.rule,
        "label": answer.label or "",
        "status": int(answer.status),
    }
    for name, value in given.items():
        if name == "strengths":
            same = np.array_equal(
                np.asarray(value, np.float64), answer.strengths, equal_nan=True
            )
        else:
            same = value == expected[name]
        if not same:
            right = answer.strengths if name == "strengths" else expected[name]
            raise DisagreementError(
                f"the onnx file of {model.name} gives another {name} than the model "
                f"where {row}: {value}, not {right}"
            )

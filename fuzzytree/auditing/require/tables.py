"""Rows and predictions in the words of a model's table."""

from __future__ import annotations

import csv
import datetime
import io
import math

from fuzzytree.auditing.require.search import Rows, predictor
from fuzzytree.model import DATE_UNIT, Document, FuzzySystem, Variable


def prediction_texts(model: Document, rows: Rows) -> tuple[str, ...]:
    """Return the predictions of the rows of a try in words."""
    results = predictor(model)(rows[..., 0]).T.tolist()
    if not isinstance(model, FuzzySystem):
        labels = (*model.classes, "no class")
        return tuple(labels[int(code)] for (code,) in results)
    return tuple(
        ", ".join(
            f"{output.name} {'no number' if math.isnan(number) else repr(number)}"
            for output, number in zip(model.outputs, numbers, strict=True)
        )
        for numbers in results
    )


def rows_text(model: Document, rows: Rows) -> str:
    """Return the rows of a try as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    variables = [variable for variable in model.variables if not variable.parts]
    writer.writerow(variable.name for variable in variables)
    for row in rows[..., 0].T.tolist():
        writer.writerow(map(cell_text, variables, row))
    return text.getvalue()


def cell_text(variable: Variable, value: float) -> str:
    """Return a value of an input as a table has it.

    Example:
        >>> cell_text(Variable("region", categories=("east", "west")), 1.0)
        'west'
    """
    if variable.categories:
        is_code = value in range(len(variable.categories))
        return variable.categories[int(value)] if is_code else ""
    if variable.unit == DATE_UNIT and value.is_integer():
        start = datetime.date(1970, 1, 1)
        return (start + datetime.timedelta(days=value)).isoformat()
    return repr(value).removesuffix(".0")

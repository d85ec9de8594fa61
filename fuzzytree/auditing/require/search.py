"""A model on a box: questions about its rules there, and rows that refute a claim."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Collection, Mapping
from fractions import Fraction
from typing import NamedTuple, cast

import numpy as np

from fuzzytree.auditing.decide import (
    Answer,
    Base,
    Budget,
    Decider,
    Open,
    OutOfStepsError,
    Point,
    Question,
)
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.require.claims import Verdict
from fuzzytree.model import Document, FloatArray, Variable
from fuzzytree.rechecking import table_word
from fuzzytree.runtimes import baseline

_NEAR = 1024  # rows drawn near the worst of them
_SHARES = (0.25, 0.1, 0.03, 0.01)  # of the ranges, in which rows are drawn next
_DIGITS = (1, 2, 3, 4, 6)  # of the values of a refutation, the first that will do
_KEPT = 0.95  # of what a refutation shows, with fewer digits

Rows = FloatArray
"""Values of inputs: the row, or the two rows, of each try, (inputs, 1 or 2, tries)."""
Loss = Callable[[Rows], FloatArray]
"""How far each try is from what is claimed: above 0, it refutes it."""


class Outcome(NamedTuple):
    """What is known of a claim on a box, and the rows that refute it."""

    verdict: Verdict
    sentence: str
    rows: Rows | None = None
    bound: float | None = None


class Search:
    """A model on a box of inputs, with a budget of steps for each question."""

    def __init__(self, model: Document, domain: Domain, steps: int) -> None:
        self.model, self.domain, self.steps = model, domain, steps
        self.base = Base.of(model, domain)
        self.run = predictor(model)
        self._decider = Decider(self.base)
        self._axes = [self.base.inputs[name] for name in model.inputs]

    def ask(self, question: Question) -> Answer:
        """Return the answer to a question about strengths."""
        try:
            return self._decider.ask(question, Budget(self.steps))
        except OutOfStepsError:
            return Open(f"{self.steps} steps do not decide it")

    def rule_out(
        self,
        questions: Collection[Question],
        doubt: str,
        proof: str,
        loss: Loss | None = None,
    ) -> Outcome:
        """Return whether no question has a point, as a proof or a doubt.

        `loss` says whether the row nearest to a point refutes the claim.
        """
        answers = [self.ask(question) for question in questions]
        for answer in answers:
            if loss and isinstance(answer, Point):
                row = self.row(answer.values)
                if loss(row)[0] > 0.0:
                    return Outcome("REFUTED", doubt, self._short(row, loss))
        for answer in answers:
            if isinstance(answer, Open):
                return Outcome("OPEN", f"perhaps {doubt}: {answer.why}")
            if isinstance(answer, Point):
                text = f"{doubt} for some rows, which `where` may leave out"
                return Outcome("OPEN", text)
        return Outcome("PROVED", proof)

    # --- rows

    def predict(self, rows: Rows) -> FloatArray:
        """Return the results of tries, of shape (results, 1 or 2, tries)."""
        results = self.run(rows.reshape(len(rows), math.prod(rows.shape[1:])))
        return results.reshape(-1, *rows.shape[1:])

    def row(self, point: Mapping[str, Fraction]) -> Rows:
        """Return the row of doubles nearest to a point, as the only try."""
        values = [float(point[name]) for name in self.model.inputs]
        return np.array(values).reshape(-1, 1, 1)

    def worst(self, loss: Loss, changes: Collection[str] = ()) -> Rows | None:
        """Return the try that refutes a claim most, None if none does.

        Two rows of a try differ in `changes` and no other input; a single one rises.
        """
        random = np.random.default_rng(0)
        axes, places = self._axes, [*map(self.model.inputs.index, changes)]
        rows = np.array([[[*map(float, line)]] for line in self.base.samples])
        rows = np.tile(rows, (1, 2, 3)) if places else rows
        for place in places:
            far, axis = random.permutation(rows[place, 1]) - rows[place, 1], axes[place]
            if not (axis.values or axis.extra):
                far[::2] *= 2.0 ** -random.integers(9, size=far[::2].size)
            rows[place, 1] += np.rint(far) if axis.is_whole else far
        best, most = rows[..., :1], -math.inf
        for share in (0.0, *_SHARES):
            if share:
                rows = self._near(best, share, places, random)
            if len(places) == 1:
                rows[places] = np.sort(rows[places], axis=1)
            losses = loss(rows)
            place = int(losses.argmax())
            if losses[place] > most:
                best, most = rows[..., [place]], losses[place]
        return self._short(best, loss) if most > 0.0 else None

    def _near(
        self, rows: Rows, share: float, places: list[int], random: np.random.Generator
    ) -> Rows:
        """Return tries near one, within a share of each range."""
        result = rows.repeat(_NEAR, axis=2)
        for n, axis in enumerate(self._axes):
            if axis.values:
                continue
            width = share * float(axis.high - axis.low)
            step = random.uniform(-width, width, result[n].shape)
            line = result[n] + (step if n in places else step[:1])
            line = np.clip(line, float(axis.low), float(axis.high))
            result[n] = np.rint(line) if axis.is_whole else line
        return result

    def _short(self, rows: Rows, loss: Loss) -> Rows:
        """Return rows of few digits that refute a claim nearly as much."""
        least = _KEPT * loss(rows)[0]
        for digits in _DIGITS:
            sizes = np.maximum(np.abs(rows).max(axis=(1, 2)), 1e-300)
            places = (digits - 1 - np.floor(np.log10(sizes)).astype(int)).tolist()
            few = [
                [[round(x, place)] for x in line]
                for line, place in zip(rows[..., 0].tolist(), places, strict=True)
            ]
            points = (
                dict(zip(self.model.inputs, (Fraction(x) for (x,) in row), strict=True))
                for row in zip(*few, strict=True)
            )
            tried = np.array(few).reshape(rows.shape)
            if all(map(self.base.contains, points)) and loss(tried)[0] >= least:
                return tried
        return rows


def predictor(model: Document) -> Callable[[FloatArray], FloatArray]:
    """Return a function from rows to predictions, of shape (results, rows).

    Of a system the results are its outputs; of a classifier the one result is the
    position of the class, behind all of them for none.
    """
    run = baseline().load(model, with_strengths=False)
    if model.outputs:
        return lambda rows: cast("FloatArray", run(rows).outputs)
    places = [*model.classes, None]
    labels = [model.semantics.uncovered, *model.rule_labels]
    codes = np.array([float(places.index(label)) for label in labels])
    return lambda rows: codes[run(rows).rule][None]


# --- rows in the words of a table


def prediction_texts(model: Document, rows: Rows) -> tuple[str, ...]:
    """Return the predictions of the rows of a try in words."""
    results = predictor(model)(rows[..., 0]).T.tolist()
    if not model.outputs:
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
        writer.writerow(map(_cell_text, variables, row))
    return text.getvalue()


def _cell_text(variable: Variable, value: float) -> str:
    """Return a value of an input as a table has it."""
    if variable.categories or value.is_integer():
        word = table_word(variable, value)
        return word if word or variable.categories else repr(value).removesuffix(".0")
    return repr(value)

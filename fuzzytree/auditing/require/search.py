"""A model on a box: questions about its rules there, and rows that refute a claim."""

from __future__ import annotations

import csv
import datetime
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.decide import (
    Answer,
    Base,
    Boxes,
    Budget,
    Decider,
    Open,
    OutOfStepsError,
    Question,
    search_boxes,
)
from fuzzytree.auditing.engine.domain import Domain, contains
from fuzzytree.auditing.require.claims import Verdict
from fuzzytree.model import (
    DATE_UNIT,
    BoolArray,
    Document,
    FloatArray,
    FuzzySystem,
    FuzzyTree,
    Variable,
)
from fuzzytree.runtimes import baseline, run_system

_DRAWN, _NEAR = 4096, 256  # rows drawn in the box, and near the worst of them
_LINES, _GRID = 96, 97  # lines along an input, and values on each
_LANDMARKS = 0.4  # of the values that are drawn are ends of terms
_SHARES = (0.25, 0.1, 0.03, 0.01)  # of the ranges, in which rows are drawn next
_DIGITS = (1, 2, 3, 4, 6)  # of the values of a refutation, the first that will do
_KEPT = 0.95  # of what a refutation shows, with fewer digits

Rows = FloatArray
"""Values of inputs, of shape (inputs, rows)."""
Loss = Callable[[Rows], FloatArray]
"""How far rows are from what is claimed: above 0, they refute it."""


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
        self.random = np.random.default_rng(0)
        self.axes = [_values(model, domain, name) for name in model.inputs]
        sides = [domain.side(name) for name in model.inputs]
        self.is_whole = np.array([bool(side and side.is_whole) for side in sides], bool)
        self.predict = predictor(model)

    @cached_property
    def decider(self) -> Decider:
        """The decider for questions about the rules on the box."""
        return Decider(Base.of(self.model, self.domain))

    @property
    def base(self) -> Base:
        """The rules on the box."""
        return self.decider.base

    def ask(self, question: Question) -> Answer:
        """Return the answer to a question about strengths."""
        try:
            return self.decider.ask(question, Budget(self.steps))
        except OutOfStepsError:
            return Open(f"{self.steps} steps do not decide it")

    def ask_gap(self, rules: Iterable[int]) -> Answer:
        """Return whether there is a point at which none of some rules fires."""
        return self.ask(Question(weak=tuple(rules), level=Fraction(0)))

    def ask_boxes(
        self, is_excluded: Callable[[Boxes], BoolArray], loss: Loss, steps: int
    ) -> Answer:
        """Halve boxes until each is excluded, or the middle of one refutes a claim."""

        def accepts(point: Mapping[str, Fraction]) -> bool:
            return bool(loss(self.row(point))[0] > 0.0)

        with np.errstate(all="ignore"):
            budget = Budget(2 * steps)
            return search_boxes(self.base.fine, is_excluded, accepts, budget, steps)

    # --- rows

    def row(self, point: Mapping[str, Fraction]) -> Rows:
        """Return the row of doubles nearest to a point."""
        return np.array([[float(point[name])] for name in self.model.inputs])

    def draw(self, count: int) -> Rows:
        """Return rows of the box, at random and where terms begin and end."""
        rows = np.empty((len(self.axes), count))
        for line, marks in zip(rows, self.axes, strict=True):
            line[:] = self.random.uniform(marks[0], marks[-1], count)
            is_mark = self.random.random(count) < _LANDMARKS
            is_mark |= isinstance(marks, tuple)
            line[is_mark] = self.random.choice(marks, int(is_mark.sum()))
        return self._whole(rows)

    def near(self, row: Rows, share: float, count: int) -> Rows:
        """Return rows near one, within a share of each range."""
        rows = np.repeat(row, count, axis=1)
        for line, marks in zip(rows, self.axes, strict=True):
            if not isinstance(marks, tuple):
                step = share * (marks[-1] - marks[0])
                line += self.random.uniform(-step, step, count)
                np.clip(line, marks[0], marks[-1], out=line)
        return self._whole(rows)

    def _whole(self, rows: Rows) -> Rows:
        rows[self.is_whole] = np.rint(rows[self.is_whole])
        return rows

    def _contains(self, row: FloatArray) -> bool:
        point = dict(zip(self.model.inputs, map(Fraction, row.tolist()), strict=True))
        return contains(self.domain, self.model.variables, point)

    def worst(self, loss: Loss) -> Rows | None:
        """Return the row that refutes a claim most, None if none does."""
        rows, best, most = self.draw(_DRAWN), np.empty((0, 0)), -math.inf
        for share in (*_SHARES, 0.0):
            losses = loss(rows)
            if losses.size and losses.max() > most:
                place = losses.argmax()
                best, most = rows[:, [place]], losses[place]
            if not best.size:
                return None
            rows = self.near(best, share, _NEAR)
        return self.short(best, lambda one: float(loss(one)[0])) if most > 0.0 else None

    def fall(self, name: str, height: Loss, allowed: float) -> Rows | None:
        """Return the two rows between which a number falls most, as an input rises.

        Args:
            name: The input, in which alone they differ.
            height: The number of rows.
            allowed: How far it may fall.

        Returns:
            Two rows, None if it falls nowhere by more.
        """
        place = self.model.inputs.index(name)

        def loss(pair: Rows) -> float:
            start, end = height(pair).tolist()
            return start - end - allowed if pair[place, 0] < pair[place, 1] else -1.0

        rows, best = self.draw(_LINES), np.empty((0, 0))
        for share in (*_SHARES, 0.0):
            pair = self._steepest(rows, place, height)
            if pair.size and (not best.size or loss(pair) > loss(best)):
                best = pair
            if not best.size:
                return None
            rows = self.near(best[:, :1], share, _LINES // 4)
        return self.short(best, loss) if loss(best) > 0.0 else None

    def _steepest(self, rows: Rows, place: int, height: Loss) -> Rows:
        """Return the rows of the largest fall on lines along an input; or no rows."""
        marks = self.axes[place]
        grid = np.array(marks)
        if not isinstance(marks, tuple):
            grid = np.unique([*marks, *np.linspace(marks[0], marks[-1], _GRID)])
        if self.is_whole[place]:
            grid = np.unique(np.rint(grid))
        lines = np.repeat(rows[:, :, None], len(grid), axis=2)
        lines[place] = grid
        if not lines.size:
            return np.empty((0, 0))
        heights = height(lines.reshape(len(rows), -1)).reshape(lines.shape[1:])
        heights = np.where(np.isnan(heights), -np.inf, heights)
        with np.errstate(invalid="ignore"):
            falls = np.maximum.accumulate(heights, axis=1) - heights
        falls = np.where(np.isfinite(heights), falls, 0.0)
        line, last = np.unravel_index(falls.argmax(), falls.shape)
        if not falls[line, last] > 0.0:
            return np.empty((0, 0))
        return np.array(lines[:, line][:, [heights[line, :last].argmax(), last]])

    def short(self, rows: Rows, loss: Callable[[Rows], float]) -> Rows:
        """Return rows of few digits that refute a claim nearly as much."""
        least = _KEPT * loss(rows)
        for digits in _DIGITS:
            sizes = np.maximum(np.abs(rows).max(axis=1), 1e-300)
            places = digits - 1 - np.floor(np.log10(sizes)).astype(int)
            few = np.array(
                [
                    [round(x, n) for x in line]
                    for line, n in zip(rows.tolist(), places.tolist(), strict=True)
                ]
            )
            if all(map(self._contains, few.T)) and loss(few) >= least:
                return few
        return rows


def predictor(model: Document) -> Callable[[Rows], FloatArray]:
    """Return a function from rows to predictions, of shape (results, rows).

    Of a system the results are its outputs; of a classifier the one result is the
    position of the class, -1 for none.
    """
    if isinstance(model, FuzzySystem):
        system = run_system(model)
        return lambda rows: system(rows).outputs
    run = baseline().load(model)
    labels = (
        [leaf.label for leaf in model.leaves]
        if isinstance(model, FuzzyTree)
        else [rule.then for rule in model.rules]
    )
    codes = np.array(
        [
            model.classes.index(label) if label is not None else -1.0
            for label in (model.semantics.uncovered, *labels)
        ]
    )
    return lambda rows: codes[run(rows).rule][None]


def _values(model: Document, domain: Domain, name: str) -> Sequence[float]:
    """Return the ends of an input and values between them; a tuple if these are all."""
    side = domain.side(name)
    assert side is not None  # every input has one
    if side.values or (side.is_whole and side.high - side.low < _DRAWN):
        return side.points or tuple(np.arange(side.low, side.high + 1.0).tolist())
    terms = next(one.terms for one in model.variables if one.name == name)
    ends = (end for term in terms for end in term.function.extent or ())
    return sorted({side.low, side.high, *(x for x in ends if side.low < x < side.high)})


# --- in words


def prediction_texts(model: Document, rows: Rows) -> tuple[str, ...]:
    """Return the predictions of rows in words."""
    results = predictor(model)(rows).T.tolist()
    if not isinstance(model, FuzzySystem):
        names = (*model.classes, "no class")  # of which the last has the code -1
        return tuple(names[int(code)] for (code,) in results)
    return tuple(
        ", ".join(
            f"{output.name} {'no number' if math.isnan(number) else repr(number)}"
            for output, number in zip(model.outputs, numbers, strict=True)
        )
        for numbers in results
    )


def rows_text(model: Document, rows: Rows) -> str:
    """Return rows as CSV in the words of the model's table."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    variables = [one for one in model.variables if not one.parts]
    writer.writerow(one.name for one in variables)
    for row in rows.T.tolist():
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

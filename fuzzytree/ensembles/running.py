"""Rows that two programs run: at and beside all cuts, of the user, and of proofs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fuzzytree.ensembles.programs import Answers, Opened
from fuzzytree.ensembles.trees import SINGLE, Ensemble, Rows
from fuzzytree.ensembles.walking import Domain, in_type
from fuzzytree.model import BoolArray, FloatArray, Question

_MOST_NUMBERS = 1 << 22  # of the rows that are run
_ROUNDINGS = 4  # of a leaf on its way to a file: scale, product, type and text
_MISSING_SHARE = 0.1
_SEED = 20


class Witness(NamedTuple):
    """A row that both programs ran, shape (1, columns), and what they answered."""

    row: FloatArray
    answers: tuple[str, ...]


class Pair:
    """Two ensembles, and what rows of one number type show of them.

    Attributes:
        ensembles: The two.
        rows: The number type.
        width: How many columns a row has.
        unit: What the coarser of the two loses in one rounding.
        allowed: How far rounding can take two scores apart, for each score.
        takes_missing: Whether both accept NaN.
        differing: A row for each question that the programs answer differently.
        counts: How many such rows there are.
        ran: How many rows were run; 0 if a program is not installed.
        remarks: Where a program does not do what its file says.
    """

    def __init__(self, first: Opened, second: Opened, rows: Rows) -> None:
        self.sides = first, second
        self.ensembles = one, two = first.ensemble, second.ensemble
        self.rows: Rows = rows
        self.width = one.width or two.width or max(first.width, second.width, 1)
        self.unit = max(one.unit, two.unit)
        sizes = np.maximum(one.sizes(), two.sizes())
        rounding = one.rounding() + two.rounding()
        # One rounding more than leaves may have, for that of the bound itself.
        converted = (_ROUNDINGS + 1) * self.unit * sizes
        self.allowed: FloatArray = rounding + converted
        self.takes_missing = one.takes_missing and two.takes_missing
        self.differing: dict[Question, Witness] = {}
        self.counts: dict[Question, int] = {}
        self.ran = 0
        self.remarks: list[str] = []

    def domain(self, *, has_missing: bool = False) -> Domain:
        """Return the rows that both accept, with or without missing values."""
        one, two = self.ensembles
        return Domain.of(
            self.rows,
            rounds="float32" in (one.takes, two.takes),
            infinite=one.takes_infinite and two.takes_infinite,
            missing=has_missing,
        )

    def is_near(self, left: FloatArray, right: FloatArray) -> BoolArray:
        """Return whether leaves add the same but for the roundings of a conversion."""
        allowed = _ROUNDINGS * self.unit * np.maximum(np.abs(left), np.abs(right))
        near: BoolArray = np.logical_and.reduce(
            np.abs(left - right) <= allowed, axis=-1
        )
        return near

    def run_many(self, limit: int, data: FloatArray | None) -> None:
        """Run rows at and beside cuts, and rows of the user, in both programs."""
        if any(each.run is None for each in self.sides):
            return
        table = self._table(limit, data)
        parts: list[tuple[Question, FloatArray]] = [("scores", table)]
        if self.takes_missing:
            holes = np.random.default_rng(_SEED).random(table.shape) < _MISSING_SHARE
            parts.append(("missing values", np.where(holes, np.nan, table)))
        for question, part in parts:
            answers = self._run(part)
            self._compare_reading(part, answers)
            apart, labels = self._numbers_apart(answers), _classes_apart(answers)
            if question == "scores":
                self._note("labels", part, answers, labels)
                self._note("scores", part, answers, apart)
            else:
                self._note(question, part, answers, apart | labels)
            self.ran += len(part)

    def tried(self, row: FloatArray, question: Question) -> Witness | None:
        """Run a row at which the files differ; return it if the programs do, too."""
        if any(each.run is None for each in self.sides):
            return Witness(row, ("not run",))
        answers = self._run(row)
        apart = _classes_apart(answers)
        if question != "labels":
            apart = apart | self._numbers_apart(answers)
        return self._witness(row, answers, 0) if apart[0] else None

    def _note(
        self,
        question: Question,
        table: FloatArray,
        answers: tuple[Answers, Answers],
        apart: BoolArray,
    ) -> None:
        if apart.any():
            place = int(np.argmax(apart))
            self.counts[question] = int(apart.sum())
            self.differing[question] = self._witness(table, answers, place)

    def _table(self, limit: int, data: FloatArray | None) -> FloatArray:
        """Return rows at and beside the cuts of both, and the rows of the user."""
        count = max(1, min(limit, _MOST_NUMBERS // self.width))
        draw = np.random.default_rng(_SEED)
        table = np.zeros((count, self.width))
        kind = np.float32 if self.rows == "float32" else np.float64
        highest = min(self.domain().high, 1e300)
        for column in range(self.width):
            cuts = self._cuts(column)
            if not len(cuts):
                continue
            with np.errstate(over="ignore"):
                at = cuts.astype(kind)
                above = np.nextafter(at, kind(np.inf))
                below = np.nextafter(at, kind(-np.inf))
                low, high = float(at.min()) - 1.0, float(at.max()) + 1.0
                far = draw.uniform(low, high, count).astype(kind)
            values = np.concatenate([at, above, below, far]).astype(np.float64)
            values = np.unique(values[np.abs(values) <= highest])
            if len(values):
                table[:, column] = draw.choice(values, count)
        if data is not None:
            own = data[:, : self.width].astype(kind).astype(np.float64)
            table = np.concatenate([table, own[np.isfinite(own).all(axis=1)]])
        return table

    def _cuts(self, column: int) -> FloatArray:
        cuts = [
            in_type(tree.cuts[tree.columns == column], self.rows)
            for ensemble in self.ensembles
            for tree in ensemble.trees
        ]
        every: FloatArray = np.unique(np.concatenate([*cuts, np.zeros(0)]))
        return every[np.isfinite(every)]

    def _run(self, table: FloatArray) -> tuple[Answers, Answers]:
        runs = [each.run for each in self.sides if each.run is not None]
        one, two = (run(table, self.rows) for run in runs)
        return one, two

    def _outputs_allowed(self) -> float:
        """Return how far outputs may be apart: links are flat, and round as well.

        The logistic function changes by at most a quarter of its argument, the softmax
        by at most half.
        """
        one = self.ensembles[0]
        slope = {"none": 1.0, "logistic": 0.25, "softmax": 0.5}[one.link]
        size = float(np.max(one.sizes(), initial=1.0)) if one.link == "none" else 1.0
        return slope * float(np.max(self.allowed)) + 8 * SINGLE * size

    def _numbers_apart(self, answers: tuple[Answers, Answers]) -> BoolArray:
        one, two = (answer.numbers for answer in answers)
        if one.shape != two.shape:
            return np.zeros(len(one), np.bool_)
        far = np.abs(one - two) > self._outputs_allowed()
        apart: BoolArray = np.logical_or.reduce(far, axis=1)
        return apart

    def _compare_reading(
        self, table: FloatArray, answers: tuple[Answers, Answers]
    ) -> None:
        """Compare what was read of each side with what its program answers."""
        for side, answer in zip(self.sides, answers, strict=True):
            ensemble = side.ensemble
            if side.unread or ensemble.has_labels_alone:
                continue
            right = linked(ensemble, ensemble.scores(table), answer.numbers.shape[1])
            bound = float(np.max(ensemble.rounding())) + self._outputs_allowed()
            wrong = (np.abs(right - answer.numbers) > bound).any(axis=1)
            if wrong.any():
                place = int(np.argmax(wrong))
                self.remarks.append(
                    f"{side.program} answers {_shown(answer.numbers[place])} where the "
                    f"file of {ensemble.name} says {_shown(right[place])}: nothing is "
                    f"proved of {self.rows} rows"
                )

    def _witness(
        self, table: FloatArray, answers: tuple[Answers, Answers], place: int
    ) -> Witness:
        texts = (
            f"{side.program}: {_text(answer, place, side.ensemble)}"
            for side, answer in zip(self.sides, answers, strict=True)
        )
        return Witness(table[place : place + 1], tuple(texts))


def _classes_apart(answers: tuple[Answers, Answers]) -> BoolArray:
    one, two = (answer.classes for answer in answers)
    if one is None or two is None:
        return np.zeros(len(answers[0].numbers), np.bool_)
    return np.asarray(one != two)


def linked(ensemble: Ensemble, scores: FloatArray, width: int) -> FloatArray:
    """Return outputs of scores; of two classes with one score both probabilities."""
    if ensemble.link == "softmax":
        powers = np.exp(scores - scores.max(axis=1, keepdims=True))
        shares: FloatArray = powers / powers.sum(axis=1, keepdims=True)
        return shares
    with np.errstate(over="ignore"):
        numbers = 1 / (1 + np.exp(-scores)) if ensemble.link == "logistic" else scores
    if numbers.shape[1] == 1 and width == 2:
        lower = (
            -numbers if ensemble.link == "none" and ensemble.bar <= 0 else 1 - numbers
        )
        return np.concatenate([lower, numbers], axis=1)
    return numbers


def _text(answer: Answers, place: int, ensemble: Ensemble) -> str:
    numbers = _shown(answer.numbers[place])
    if answer.classes is None:
        return numbers
    number = int(answer.classes[place])
    label = ensemble.classes[number] if ensemble.classes else number
    return f"{label!r} {numbers}"


def _shown(numbers: FloatArray) -> str:
    shown = ", ".join(f"{number:.9g}" for number in numbers[:4].tolist())
    return f"[{shown}{', ...' if len(numbers) > 4 else ''}]"

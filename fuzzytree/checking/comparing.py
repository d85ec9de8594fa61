"""Compare the predictions of two representations, row by row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from fuzzytree.model import (
    Basis,
    BoolArray,
    Certified,
    Comparison,
    Document,
    Dtype,
    FileContent,
    FloatArray,
    FuzzyTree,
    IntArray,
    Model,
    Outcome,
    RuleBase,
    Verdict,
    kind_of,
)
from fuzzytree.numerics import (
    Decisions,
    certify,
    open_paths,
    strength_bounds,
    strength_errors,
)
from fuzzytree.runtimes import baseline, class_probabilities, predictions_of
from fuzzytree.semantics import Status, probe_values

_SHOWN = 5  # differing rows listed for each comparison
_LISTED = 20  # differences in the content of a file
_FLOAT32_TREE = "equal answers but within float32 rounding of a cut"

Finding = Comparison | FileContent | str
"""A comparison, what a file holds, or a sentence about what was skipped."""

OTHER_FUNCTION = (
    "it holds raw rules, another function than the tree; --terms raw compares it with "
    "the tree's own raw rules"
)


def file_content(title: str, model: Document, dtype: object = "float64") -> FileContent:
    """Return what a file holds, as people call it."""
    form: str = kind_of(model)
    if isinstance(model, RuleBase) and model.kind:
        form = f"{model.kind} {form}"
    return FileContent(title, form, str(dtype))


class RowSet(msgspec.Struct, frozen=True):
    """The rows that representations answer: probes first, then the user's data.

    Attributes:
        inputs: The names of the inputs.
        values: Shape (inputs, rows).
        numbers: The number of each row in the whole, from 0.
        probes: How many rows of the whole are probes.
    """

    inputs: tuple[str, ...]
    values: FloatArray
    numbers: IntArray
    probes: int

    def part(self, rows: slice | IntArray) -> RowSet:
        """Return some of the rows, which keep their numbers."""
        return RowSet(
            self.inputs, self.values[:, rows], self.numbers[rows], self.probes
        )

    def name(self, row: int) -> str:
        """Return what people call a row: `probe 3`, or `row 3` of the data."""
        number = int(self.numbers[row])
        if number < self.probes:
            return f"generated row {number + 1}"
        return f"row {number - self.probes + 1}"

    def text(self, row: int) -> str:
        """Return the name of a row with its values, all digits of each."""
        values = zip(self.inputs, self.values[:, row].tolist(), strict=True)
        shown = ", ".join(f"{name} {value!r}" for name, value in values)
        return f"{self.name(row)}: {shown}"


def row_set(
    inputs: tuple[str, ...], probes: FloatArray, data: FloatArray | None
) -> RowSet:
    """Return probes of shape (inputs, rows) with the user's rows behind them.

    Raises:
        ValueError: If `data` has another shape.
    """
    values, (width, count) = probes, probes.shape
    if data is not None:
        if data.ndim != 2 or data.shape[0] != width:
            raise ValueError(f"data must have shape ({width}, rows), not {data.shape}")
        values = np.concatenate([probes, data], axis=1)
    values = np.ascontiguousarray(values)
    return RowSet(inputs, values, np.arange(values.shape[1]), count)


def probed(model: Model, data: FloatArray | None, limit: int) -> RowSet:
    """Return probes of a model with the user's rows behind them.

    Args:
        model: A tree or a rule base.
        data: Rows of one's own, shape (inputs, rows), in the order of `model.inputs`.
        limit: The most probes.

    Raises:
        ValueError: If `data` has another shape.
    """
    return row_set(model.inputs, probe_values(model, limit), data)


class ModelRun(msgspec.Struct, frozen=True):
    """What a representation answered to some rows.

    Attributes:
        title: What to call the representation.
        model: What it executed.
        outcome: Its answers, one for each of the rows.
    """

    title: str
    model: Model
    outcome: Outcome

    def part(self, rows: slice | IntArray) -> ModelRun:
        """Return some of the answers."""
        return ModelRun(self.title, self.model, self.outcome.part(rows))


def counted(
    basis: Basis, representation: str, against: str, rows: int, faults: Sequence[str]
) -> Comparison:
    """Return a comparison that disagrees in as many rows as there are faults."""
    return Comparison(
        representation,
        against,
        basis,
        rows,
        "DISAGREES" if faults else "agrees",
        differing=len(faults),
        detail=tuple(faults[:_SHOWN]),
    )


def judged(
    name: str, against: str, faults: Sequence[str], results: Sequence[Finding]
) -> Comparison:
    """Compare the content of a file, in the light of what its rows gave.

    Args:
        name: What to call the file.
        against: What its content should equal.
        faults: How it differs.
        results: The comparisons of the file's rows.
    """
    rows = [one for one in results if isinstance(one, Comparison)]
    more = [f"and {len(faults) - _LISTED} more"] if len(faults) > _LISTED else []
    verdict: Verdict = "DISAGREES" if faults else "agrees"
    if faults and rows and all(one.verdict == "agrees" for one in rows):
        verdict = "rows only"
    return Comparison(
        name,
        against,
        "file",
        1,
        verdict,
        differing=len(faults),
        detail=(*faults[:_LISTED], *more),
    )


def compare_bits(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    *,
    excused: BoolArray | None = None,
    origin: str = _FLOAT32_TREE,
) -> Comparison:
    """Demand equal rules, classes, statuses, and strengths where both have them.

    Strengths are compared bit by bit: 0.0 is not -0.0, and NaN is one value; so are
    probabilities, where the first one has them. Rows that
    are excused may differ, for the reason that `origin` states.
    """
    gap = strength_gap(actual.outcome, expected.outcome)
    wrong = unequal(actual.outcome, expected.outcome)
    wrong |= labels(actual) != labels(expected)
    wrong |= _other_probabilities(actual, expected)
    if excused is None:
        return _compared(actual, expected, rows, wrong, gap)
    return _compared(actual, expected, rows, wrong & ~excused, gap, origin=origin)


def _other_probabilities(actual: ModelRun, expected: ModelRun) -> BoolArray:
    """Return the rows in which a runtime's probabilities are not the model's."""
    result, strengths = actual.outcome.probabilities, expected.outcome.strengths
    model = expected.model
    if result is None or strengths is None or not isinstance(model, RuleBase):
        return np.zeros(actual.outcome.rule.shape, np.bool_)
    right = class_probabilities(model, strengths, expected.outcome.rule)
    if right is None or right.shape != result.shape:
        return np.ones(actual.outcome.rule.shape, np.bool_)
    wrong = np.zeros(actual.outcome.rule.shape, np.bool_)
    wrong |= ~same_bits(result, right).all(axis=0)
    return wrong


def unequal(one: Outcome, two: Outcome) -> BoolArray:
    """Return the rows in which two outcomes differ, by a single bit if in no more."""
    wrong: BoolArray = (one.rule != two.rule) | (one.status != two.status)
    for kind in ("strengths", "outputs"):
        first, second = getattr(one, kind), getattr(two, kind)
        if first is not None and second is not None:
            if first.shape != second.shape:
                return np.ones_like(wrong)
            wrong |= ~same_bits(first, second).all(axis=0)
    return wrong


def same_bits(one: FloatArray, two: FloatArray) -> BoolArray:
    """Return where two arrays of a shape have the same bits; NaN is one value.

    Example:
        >>> zeros, others = np.array([0.0, 0.0, np.nan]), np.array([0.0, -0.0, np.nan])
        >>> same_bits(zeros, others).tolist()
        [True, False, True]
    """
    same: BoolArray = (one == two) & (np.signbit(one) == np.signbit(two))
    return same | (np.isnan(one) & np.isnan(two))


def compare_within(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    *,
    allowed: FloatArray,
    origin: str,
) -> Comparison:
    """Allow a difference of strengths, and what must follow from it, and no more.

    A class may differ only where the two strongest classes are at most twice the
    allowed difference apart. Rows in which 1 is allowed prove nothing and are counted
    as such.

    The result shows what is `allowed` in the row that exceeds it most, or else in that
    of the largest difference, and its `origin`.
    """
    is_bound = allowed < 1.0
    apart = strength_gap(actual.outcome, expected.outcome)
    gap = np.where(is_bound, apart, 0.0)
    flips = labels(actual) != labels(expected)
    margin = margins(expected)
    close = np.zeros_like(flips) if margin is None else margin <= 2 * allowed
    wrong = is_bound & ((gap > allowed) | (flips & ~close))
    excess = gap / np.maximum(allowed, 1e-300) if wrong.any() else gap
    limit = float(allowed[np.argmax(excess)]) if gap.size else 0.0
    return msgspec.structs.replace(
        _compared(actual, expected, rows, wrong, gap, limit, origin),
        unbounded=int((~is_bound).sum()),
        largest_unbounded=float(apart[~is_bound].max(initial=0.0)),
    )


def compare_answers(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    *,
    by_design: bool = False,
) -> Comparison:
    """Compare classes and missing rows alone.

    `by_design` says that the two are different functions, so that a difference is
    reported and not a fault.
    """
    flips = labels(actual) != labels(expected)
    gap = np.zeros(flips.shape)
    verdict: Verdict | None = "differs by design" if by_design and flips.any() else None
    return _compared(
        actual, expected, rows, flips, gap, origin="equal classes", verdict=verdict
    )


def _without_status(answers: ModelRun) -> ModelRun:
    """Reduce statuses to whether a rule won."""
    outcome = answers.outcome
    status = np.where(outcome.rule > 0, Status.DECIDED, Status.UNCOVERED)
    kept = msgspec.structs.replace(outcome, status=status.astype(np.int64))
    return msgspec.structs.replace(answers, outcome=kept)


class FileAnswers(NamedTuple):
    """What a file answers to some rows.

    Attributes:
        outcome: Rules and statuses; None if they are not compared.
        labels: The texts that it answers; None if it has none.
        has_status: Whether the statuses are the file's own.
    """

    outcome: Outcome | None
    labels: Sequence[str | None] | None
    has_status: bool


def compare_file(
    title: str,
    answers: FileAnswers,
    base: ModelRun,
    rows: RowSet,
    *,
    is_float32: bool,
    origin: str = _FLOAT32_TREE,
) -> Iterator[Comparison]:
    """Compare what a file answers with the native runtime, then its labels.

    Rows of a tree within float32 rounding of a cut are excused if the file computes in
    that type; `origin` says so.
    """
    excused = None
    if is_float32 and isinstance(base.model, FuzzyTree):
        excused = open_paths(base.model, "float32", rows.values)
    if answers.outcome is not None:
        actual, right = ModelRun(title, base.model, answers.outcome), base
        if not answers.has_status:
            actual, right = _without_status(actual), _without_status(base)
        yield compare_bits(actual, right, rows, excused=excused, origin=origin)
    if answers.labels is not None:
        classes = [*base.model.classes, None]
        wanted = [classes[number] for number in labels(base).tolist()]
        faults = [
            f"{rows.name(row)}: label {text!r} where {label!r} is right"
            for row, (text, label) in enumerate(
                zip(answers.labels, wanted, strict=True)
            )
            if text != label and (excused is None or not excused[row])
        ]
        yield counted("rows", title, "the model's classes", len(wanted), faults)


def native_base(model: Model, dtype: Dtype, rows: RowSet) -> ModelRun:
    """Return the native answers with which a file of a number type is compared."""
    native = baseline(dtype if isinstance(model, RuleBase) else "float64")
    return ModelRun("the model", model, native.load(model)(rows.values))


def strength_gap(actual: Outcome, expected: Outcome) -> FloatArray:
    """Return the largest difference of a strength in each row; NaN equals NaN.

    Zeros where one of the two has no strengths; infinite where one has a rule more.
    """
    one, two = actual.strengths, expected.strengths
    if one is None or two is None:
        return np.zeros(actual.rule.shape)
    if one.shape != two.shape:
        return np.full(actual.rule.shape, np.inf)
    gap = np.abs(one - two)
    gap[np.isnan(one) & np.isnan(two)] = 0.0
    gap[np.isnan(gap)] = np.inf
    largest: FloatArray = gap.max(axis=0, initial=0.0)
    return largest


def labels(answers: ModelRun) -> IntArray:
    """Return the class number of each answer; -1 for no class."""
    return predictions_of(answers.outcome, answers.model).codes


def margins(answers: ModelRun) -> FloatArray | None:
    """Return how far the strongest class is ahead of the next, in each row."""
    model, strengths = answers.model, answers.outcome.strengths
    if strengths is None or isinstance(model, FuzzyTree):
        return None
    owners = np.array([model.classes.index(rule.then) for rule in model.rules])
    best = np.zeros((len(model.classes) + 1, strengths.shape[1]))
    for number in range(len(model.classes)):
        best[number] = strengths[owners == number].max(axis=0, initial=0.0)
    top = np.sort(best, axis=0)
    apart: FloatArray = np.nan_to_num(top[-1] - top[-2], nan=0.0)
    return apart


def _compared(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    wrong: BoolArray,
    gap: FloatArray,
    allowed: float = 0.0,
    origin: str = "equal bits",
    verdict: Verdict | None = None,
) -> Comparison:
    flips = labels(actual) != labels(expected)
    margin = margins(expected)
    shown = np.flatnonzero(wrong)
    shown = shown[np.argsort(-gap[shown], kind="stable")][:_SHOWN]
    detail = [_row_text(actual, expected, rows, row) for row in shown.tolist()]
    if detail and gap.any() and not flips.any():
        detail.insert(0, "only strengths differ: every row has the same class")
    return Comparison(
        actual.title,
        expected.title,
        "rows",
        int(wrong.size),
        verdict or ("DISAGREES" if wrong.any() else "agrees"),
        differing=int(wrong.sum()),
        largest_difference=float(gap.max(initial=0.0)),
        allowed=allowed,
        origin=origin,
        flips=int(flips.sum()),
        largest_flip_margin=(
            float(margin[flips].max()) if margin is not None and flips.any() else None
        ),
        detail=tuple(detail),
        row_numbers=tuple(rows.numbers[shown].tolist()),
    )


def _row_text(actual: ModelRun, expected: ModelRun, rows: RowSet, row: int) -> str:
    wanted, got = _answer_text(expected, row), _answer_text(actual, row)
    if wanted == got:
        apart = _apart(actual, expected, row)
        one, two = actual.part(slice(row, row + 1)), expected.part(slice(row, row + 1))
        if not unequal(one.outcome, two.outcome).any():
            apart = ", with other probabilities"
        return f"{rows.text(row)}: both answer {got}{apart}"
    return f"{rows.text(row)}: {expected.title} answers {wanted}, {actual.title} {got}"


def _apart(actual: ModelRun, expected: ModelRun, row: int) -> str:
    """Return where the strengths of a row are furthest apart, in words."""
    one, two = actual.outcome.strengths, expected.outcome.strengths
    if one is None or two is None or one.shape != two.shape:
        return ""
    gap = np.abs(one[:, row] - two[:, row])
    gap = np.where(np.isnan(gap), np.inf, gap)
    if not gap.any():  # they differ in the sign of a zero
        gap = 1.0 - same_bits(one[:, row], two[:, row])
    rule = int(np.argmax(gap))
    right, other = float(two[rule, row]), float(one[rule, row])
    return (
        f"; the strength of rule {rule + 1} is {right!r} in {expected.title}, "
        f"{other!r} in {actual.title}"
    )


def _answer_text(answers: ModelRun, row: int) -> str:
    outcome = answers.outcome
    rule, status = int(outcome.rule[row]), Status(int(outcome.status[row]))
    number = int(labels(answers)[row])
    label = answers.model.classes[number] if number >= 0 else "no class"
    text = f"{label} (rule {rule})" if rule else label
    if outcome.strengths is not None and rule:
        text += f" with {float(outcome.strengths[rule - 1, row])!r}"
    return text if status is Status.DECIDED else f"{text} ({status.name.lower()})"


# --- against exact arithmetic


def compare_exact(
    actual: ModelRun, truth: Decisions, rows: RowSet, *, dtype: Dtype
) -> Certified:
    """Compare predictions with the exact ones, within what a number type may change.

    A strength may be off by its bound in that row; a class may differ where the exact
    margin is at most twice that, or where a value lies within its rounding from a cut
    of the tree, and nowhere else.

    Rows of the data are counted if there are any.
    """
    allowed = np.zeros(len(rows.numbers))
    if isinstance(actual.model, RuleBase):
        allowed, _ = strength_bounds(actual.model, dtype, rows.values)
    low, flips, close = exact_errors(actual, truth, rows.values, dtype, allowed)
    wrong = flips & ~close
    if low is not None:
        wrong |= (low > allowed) & (allowed < 1.0)
    is_data = len(rows.numbers) > rows.probes
    own = rows.numbers >= (rows.probes if is_data else 0)
    facts = certify(actual.model, dtype, rows.values[:, own] if is_data else None)
    if facts.reasons and not is_data:
        facts = certify(actual.model, dtype, rows.values)
    lost, gained = _cover(actual, truth)
    flipped = truth.margin_high[own & flips]
    bounded = own & (allowed < 1.0)
    return Certified(
        actual.title,
        dtype,
        facts.sentence,
        facts.delta,
        facts.origin,
        "data" if is_data else "probes",
        int(own.sum()),
        None if low is None else float(low[bounded].max(initial=0.0)),
        int((own & close).sum()),
        int((own & flips).sum()),
        float(flipped.max()) if low is not None and flipped.size else None,
        int((lost & own).sum()),
        int((gained & own).sum()),
        int((own & (allowed >= 1.0)).sum()) if low is not None else 0,
        "DISAGREES" if wrong.any() else "agrees",
        tuple(_exact_texts(actual, truth, rows, wrong, allowed, low)),
    )


class ExactErrors(NamedTuple):
    """How far predictions are from the exact ones, in each row.

    Attributes:
        low: By how much a strength is off at least; None without strengths.
        flips: Whether the class differs.
        close: Whether it may: the exact margin is at most twice what is allowed, or a
            value lies within its rounding from a cut of a tree.
    """

    low: FloatArray | None
    flips: BoolArray
    close: BoolArray


def exact_errors(
    actual: ModelRun,
    truth: Decisions,
    values: FloatArray,
    dtype: Dtype,
    allowed: FloatArray,
) -> ExactErrors:
    """Return the errors of predictions, where a strength may be off by `allowed`."""
    flips = labels(actual) != truth.label
    model, strengths = actual.model, actual.outcome.strengths
    if isinstance(model, FuzzyTree):
        return ExactErrors(None, flips, open_paths(model, dtype, values))
    low = None if strengths is None else strength_errors(model, values, strengths)[0]
    return ExactErrors(low, flips, truth.margin <= 2.0 * allowed)


def _cover(actual: ModelRun, truth: Decisions) -> tuple[BoolArray, BoolArray]:
    """Return which rows lost and gained cover."""
    weighed = (actual.outcome.status != Status.MISSING) & (
        truth.status != Status.MISSING
    )
    is_covered, should = actual.outcome.rule > 0, truth.rule > 0
    return should & ~is_covered & weighed, is_covered & ~should & weighed


def _exact_texts(
    actual: ModelRun,
    truth: Decisions,
    rows: RowSet,
    wrong: BoolArray,
    allowed: FloatArray,
    low: FloatArray | None,
) -> Iterator[str]:
    worst = np.flatnonzero(wrong)
    if low is not None:
        worst = worst[np.argsort(-low[worst], kind="stable")]
    classes = actual.model.classes
    for row in worst[:_SHOWN].tolist():
        number = int(truth.label[row])
        label = classes[number] if number >= 0 else "no class"
        text = f"{rows.text(row)}: exactly {label} (rule {truth.rule[row]})"
        text += f", {actual.title} {_answer_text(actual, row)}"
        if low is not None:
            text += f"; a strength is off by {low[row]:.2g}, and "
            text += f"{allowed[row]:.2g} is allowed"
        yield text

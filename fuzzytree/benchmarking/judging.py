"""How far a candidate's answers are from the exact ones, on data and on edges apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, TypeVar, cast

import msgspec
import numpy as np
from msgspec.structs import asdict, replace

from fuzzytree.benchmarking.clock import TimeSource
from fuzzytree.benchmarking.records import (
    Candidate,
    CandidateOutput,
    Error,
    LoadedCandidate,
    OutputError,
    Question,
)
from fuzzytree.model import (
    BoolArray,
    Document,
    FloatArray,
    FuzzySystem,
    IntArray,
    Model,
)
from fuzzytree.numerics import Decisions, decide, strength_errors
from fuzzytree.runtimes import definition
from fuzzytree.semantics import (
    ORIGIN,
    Status,
    error_bounds,
    landmarks,
    probe_values,
    program_of,
    shape_of,
)

Record = TypeVar("Record", bound=msgspec.Struct)

MOST_ROWS = 2_000
"""Rows on which errors are observed, of those that are timed."""

MOST_PROBES = 500
"""Rows aimed at edges; nearly each of them costs the oracle rational arithmetic."""

_PATIENCE_NS = 3e8  # for the answers of one candidate to one set of rows
_BATCH = 1 << 15  # rows in which a call's own cost no longer counts
_STEPS_OF_RULE = 10
_MOST_STRENGTHS = 200_000  # for each candidate, in intervals: half a second or so


class CandidateJudgement(NamedTuple):
    """What is known of a candidate before it is timed.

    Attributes:
        error: On the rows of the study; None for a floor.
        probes: On rows aimed at edges and cuts.
        row_ns: About what a row takes it, in nanoseconds.
    """

    error: Error | None
    probes: Error | None
    row_ns: float


class ExactSample(msgspec.Struct, frozen=True):
    """Rows to judge on, and the exact answers to them.

    Attributes:
        model: What answers.
        values: Shape (inputs, rows).
        labels: The exact classes; of a fuzzy system the status of each row.
        outputs: Those of a fuzzy system by its definition, of shape (outputs, rows).
        bounds: How far each output can be from it in double, in its unit.
        decisions: All that is exact about classes.
    """

    model: Document
    values: FloatArray
    labels: IntArray
    outputs: FloatArray | None = None
    bounds: tuple[float, ...] = ()
    decisions: Decisions | None = None


class CandidateJudge:
    """Compares predictions with the exact ones, on rows that are made once."""

    def __init__(
        self, forms: Mapping[Question, Document], values: FloatArray, clock: TimeSource
    ) -> None:
        self.forms, self.clock = forms, clock
        most = min(map(_most_rows, forms.values()))
        self.values = np.ascontiguousarray(values[:, :most])
        self.samples: dict[Question, tuple[ExactSample, ExactSample]] = {}

    def judged(
        self, candidate: Candidate, loaded: LoadedCandidate
    ) -> CandidateJudgement:
        """Return how far a candidate is from exact, and about what a row costs it.

        A slow one answers fewer rows, in even steps through all of them.

        Raises:
            Exception: Whatever the candidate raises.
        """
        one = np.ascontiguousarray(self.values[:, :1])
        loaded.answer(one)  # the first call of many a library does more than others
        call = loaded.call(one)
        start = self.clock.wall()
        call()
        row_ns = float(max(self.clock.wall() - start, 1))
        if candidate.kind == "floor":
            return CandidateJudgement(None, None, self._row_ns(loaded, row_ns))
        most = max(int(_PATIENCE_NS // row_ns), 1)
        rows, edges = self._samples(candidate.question)
        certify = loaded.bound or candidate.bound
        certified = certify() if certify else None
        bound, origin = certified or (None, "nothing is certified")
        beyond = "the bound covers the rows, and these may lie beyond them"
        on_rows, on_edges = _part(rows, most), _part(edges, most)
        return CandidateJudgement(
            measured_error(loaded.answer(on_rows.values), on_rows, bound, origin),
            measured_error(loaded.answer(on_edges.values), on_edges, None, beyond),
            self._row_ns(loaded, row_ns),
        )

    def _row_ns(self, loaded: LoadedCandidate, row_ns: float) -> float:
        """Return what a row takes in a batch as large as there is patience for."""
        count = max(min(int(_PATIENCE_NS // row_ns), _BATCH), 1)
        call = loaded.call(repeated(self.values, count))
        start = self.clock.wall()
        call()
        return min(row_ns, max(self.clock.wall() - start, 1) / count)

    def _samples(self, question: Question) -> tuple[ExactSample, ExactSample]:
        """Return the rows of the study, and rows aimed at the model's edges."""
        if question not in self.samples:
            model = self.forms[question]
            edges = probe_values(model, min(MOST_PROBES, _most_rows(model)))
            self.samples[question] = (
                exact_sample(model, self.values),
                exact_sample(model, edges),
            )
        return self.samples[question]


def exact_sample(model: Document, values: FloatArray) -> ExactSample:
    """Return rows with exact answers; those of a fuzzy system are the definition's."""
    if isinstance(model, FuzzySystem):
        outcome = definition().load(model, with_strengths=False)(values)
        bounds = tuple(output_bounds(model, values).tolist())
        return ExactSample(model, values, outcome.status, outcome.outputs, bounds)
    decisions = decide(model, values)
    return ExactSample(model, values, decisions.label, decisions=decisions)


def output_bounds(model: Document, values: FloatArray) -> FloatArray:
    """Return how far each output can be from the definition's, in its unit.

    It holds on the rows that candidates are judged on, of `values` of shape (inputs,
    rows); infinity where last bits decide on one of them.
    """
    rows = np.ascontiguousarray(values[:, : _most_rows(model)])
    program = program_of(model, with_strengths=False)
    bounds = error_bounds(program, rows)[: len(model.outputs)]
    return np.asarray(bounds.max(axis=1, initial=0.0))


def output_bound(model: Document, values: FloatArray) -> tuple[float, str] | None:
    """Return the largest of these bounds as a share of the output's range."""
    shares = output_bounds(model, values) / _spans(model)
    largest = float(shares.max(initial=0.0))
    return (largest, ORIGIN) if math.isfinite(largest) else None


def _spans(model: Document) -> FloatArray:
    """Return the width of each output's range; 1 where it declares none."""
    pairs = [(output.low, output.high) for output in model.outputs]
    spans = [1.0 if a is None or b is None else b - a or 1.0 for a, b in pairs]
    return np.array(spans, np.float64)


def measured_error(
    output: CandidateOutput, sample: ExactSample, bound: float | None, origin: str
) -> Error:
    """Return how far the answers to a sample are from the exact ones."""
    outputs = _output_errors(output, sample, is_certified=bound is not None)
    shares = [math.inf if e.share is None else e.share for e in outputs.values()]
    largest = max(shares, default=None)
    flips = _flips(output, sample)
    count = int(flips.sum())
    error = Error(int(flips.size), largest, bound, origin, count, outputs=outputs)
    truth = sample.decisions
    if truth is None or truth.strengths is None:
        return error
    model = cast("Model", sample.model)
    band = margin = None
    if output.strengths is not None:
        errors, _ = strength_errors(model, sample.values, output.strengths)
        largest = float(errors.max(initial=0.0))
    if bound is not None:
        band = float((truth.margin <= 2.0 * bound).mean()) if flips.size else 0.0
    if count:
        margin = float(truth.margin_high[flips].max())
    lost, gained = _cover(output, model, truth)
    return replace(
        error,
        largest=largest,
        largest_flip_margin=margin,
        in_band=band,
        cover_lost=lost,
        cover_gained=gained,
    )


def _flips(output: CandidateOutput, sample: ExactSample) -> BoolArray:
    """Return in which rows the class or the status is another one."""
    changed: BoolArray = output.labels != sample.labels
    if output.outputs is not None and sample.outputs is not None:
        is_other = np.isnan(output.outputs) != np.isnan(sample.outputs)
        changed[output.labels < 0] = is_other.any(axis=0)[output.labels < 0]
    return changed


def _output_errors(
    output: CandidateOutput, sample: ExactSample, *, is_certified: bool
) -> dict[str, OutputError]:
    """Return the error of each output."""
    exact, numbers = sample.outputs, output.outputs
    if exact is None or numbers is None:
        return {}
    with np.errstate(invalid="ignore"):
        gap = np.abs(numbers - exact)
    gap[(numbers == exact) | (np.isnan(numbers) & np.isnan(exact))] = 0.0
    errors: dict[str, OutputError] = {}
    spans = _spans(sample.model).tolist()
    names = [result.name for result in sample.model.outputs]
    for line, name in enumerate(names):
        largest = float(np.max(gap[line], initial=0.0))
        bound = sample.bounds[line] if is_certified else None
        errors[name] = (
            OutputError(largest, largest / spans[line], bound)
            if math.isfinite(largest)
            else OutputError(None, None, bound)
        )
    return errors


def _cover(output: CandidateOutput, rules: Model, truth: Decisions) -> tuple[int, int]:
    """Return how many rows lost and gained cover, as far as the answers show it."""
    strengths = output.strengths
    weighed = truth.status != Status.MISSING
    if strengths is not None:
        weighed = weighed & ~np.isnan(strengths).any(axis=0)
        is_covered = (strengths > 0.0).any(axis=0)
    elif rules.semantics.uncovered is None:
        is_covered = output.labels >= 0
    else:
        return 0, 0
    should = truth.rule > 0
    lost, gained = should & ~is_covered, is_covered & ~should
    return int((lost & weighed).sum()), int((gained & weighed).sum())


def _part(sample: ExactSample, most: int) -> ExactSample:
    """Return at most so many rows, in even steps."""
    step = -(-sample.values.shape[1] // most)
    if step <= 1:
        return sample
    decisions = sample.decisions
    if decisions is not None:
        decisions = _some_rows(decisions, step)
    return replace(
        _some_rows(sample, step),
        values=np.ascontiguousarray(sample.values[:, ::step]),
        decisions=decisions,
    )


def _some_rows(record: Record, step: int) -> Record:
    arrays = {
        name: array[..., ::step]
        for name, array in asdict(record).items()
        if isinstance(array, np.ndarray)
    }
    return replace(record, **arrays)


def _most_rows(model: Document) -> int:
    rules = len(model.rules) or 1
    if model.outputs:
        rules = 1 + program_of(model, with_strengths=False).size // _STEPS_OF_RULE
    return max(min(MOST_ROWS, _MOST_STRENGTHS // rules), 1)


_REACH = 0.1  # of a range that is taken from landmarks: how far beyond rows may lie


def made_rows(model: Document, count: int, *, seed: int = 0) -> tuple[FloatArray, str]:
    """Return rows that are spread evenly over what a model declares.

    Each input is drawn by itself between the `low` and `high` of its variable. One that
    declares none is drawn from where its terms change their formula, and a tenth
    beyond; one that only combinations use, within a unit of each of them.

    The same model, count and seed give the same rows.

    Returns:
        Values of shape (inputs, rows), and a sentence that says what they are.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> values, what = made_rows(random_tree(1), 5)
        >>> values.shape[1]
        5
    """
    chance = np.random.default_rng(seed)
    ranges = {name: _range(model, name) for name in model.inputs}
    lines = [chance.uniform(low, high, count) for low, high, _ in ranges.values()]
    values = np.array(lines, np.float64).reshape(len(ranges), count)
    guessed = [name for name, (_, _, is_declared) in ranges.items() if not is_declared]
    what = f"made from the model's declared ranges, seed {seed}"
    if guessed:
        shown = ", ".join(map(repr, guessed[:4])) + (", ..." if guessed[4:] else "")
        verb = "declares" if len(guessed) == 1 else "declare"
        what += f"; {shown} {verb} none: from terms or combinations"
    return values, what


def _range(model: Document, name: str) -> tuple[float, float, bool]:
    """Return between which values an input is drawn, and whether it declares them."""
    known: list[float] = []
    for variable in model.variables:
        if variable.name == name and not variable.parts:
            low, high = variable.low, variable.high
            if low is not None and high is not None:
                return *_apart(low, high), True
            ends = [end for end in (low, high) if end is not None]
            curves = [shape_of(term.function) for term in variable.terms]
            known += [*ends, *(v for c in curves if c for v in landmarks(c))]
    if not known:
        for variable in model.variables:
            for part in variable.parts:
                if part.input == name:
                    unit = min(max(1.0 / abs(part.weight), 1e-100), 1e100)
                    known += [part.centre - unit, part.centre + unit]
    low, high = min(known, default=0.0), max(known, default=1.0)
    more = _REACH * (high / 2 - low / 2)
    return *_apart(low - more, high + more), False


def _apart(low: float, high: float) -> tuple[float, float]:
    """Return a range that can be drawn from: its width is finite and not zero."""
    if low == high:
        return low, math.nextafter(high, math.inf)
    half = np.finfo(np.float64).max / 2.0
    return max(low, -half), min(high, half)


def repeated(values: FloatArray, count: int) -> FloatArray:
    """Return so many rows: the first ones, or all of them again and again.

    The values have shape (inputs, rows), with at least one row.

    Example:
        >>> repeated(np.array([[1.0, 2.0]]), 5).tolist()
        [[1.0, 2.0, 1.0, 2.0, 1.0]]
    """
    return np.ascontiguousarray(values.take(np.arange(count) % values.shape[1], axis=1))

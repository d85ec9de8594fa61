"""Compare the results of two representations, row by row.

The results are those of the model's program: class, rule, status, strengths or degrees
of activation, outputs, probabilities. Bits are compared first. Where they differ,
numbers may be apart by a bound that is derived for that number and row, and a class, a
rule or a status may be another one only where such a bound can change it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple, cast

import msgspec
import numpy as np

from fuzzytree.model import (
    Basis,
    BoolArray,
    Comparison,
    Document,
    FileContent,
    FloatArray,
    IntArray,
    Model,
    Outcome,
    Unchecked,
    Verdict,
    kind_of,
)
from fuzzytree.runtimes import Predictions, answers_of, predictions_of
from fuzzytree.semantics import (
    ORIGIN,
    Program,
    ResultKind,
    Status,
    error_bounds,
)

_SHOWN = 5  # differing rows listed for each comparison
_LISTED = 20  # differences in the content of a file
_LEAST = 1e-300
_EDGE = 1e-6  # share of the largest number; a wider bound of functions says little

Finding = Comparison | FileContent | Unchecked | str
"""A comparison, what a file holds, or what was skipped."""

OTHER_FUNCTION = (
    "it holds raw rules, another function than the tree; --terms raw compares it with "
    "the tree's own raw rules"
)


def file_content(title: str, model: Document, dtype: object = "float64") -> FileContent:
    """Return what a file holds, as people call it."""
    form: str = kind_of(model)
    if model.kind:
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

    def share(self, most: int) -> RowSet:
        """Return at most so many rows, evenly from all."""
        return self.part(slice(None, None, max(-(-len(self.numbers) // most), 1)))

    def name(self, row: int) -> str:
        """Return what people call a row: `generated row 3`, or `row 3` of the data."""
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


class ModelRun(msgspec.Struct, frozen=True):
    """What a representation answered to some rows.

    Attributes:
        title: What to call the representation.
        model: What it executed.
        outcome: Its answers, one for each of the rows.
    """

    title: str
    model: Document
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


# --- results


Key = tuple[ResultKind, str]
"""The kind and name of a result, as the model's program has them."""

_NAMES: tuple[ResultKind, ...] = ("class", "rule", "status")  # no amounts


class Results(NamedTuple):
    """What two runs gave in the rows in which a bit differs.

    Attributes:
        keys: Which results they are.
        actual: Those of the one, shape (results, rows); a class is its place.
        expected: Those of the other.
        rows: The places of the rows among all.
        run: The other run, in these rows.
    """

    keys: tuple[Key, ...]
    actual: FloatArray
    expected: FloatArray
    rows: IntArray
    run: ModelRun

    def is_of(self, *kinds: ResultKind) -> BoolArray:
        """Return which results are of these kinds, of shape (results, 1)."""
        chosen = [kind in kinds for kind, _ in self.keys]
        return np.array(chosen, np.bool_).reshape(-1, 1)


def results_of(
    actual: ModelRun, expected: ModelRun, kinds: Collection[str] | None = None
) -> Results:
    """Return the results of two runs in the rows in which a bit differs.

    Results that only one of the two has are left out; of strengths that are more in one
    than in the other, the other's are NaN.

    Args:
        actual: What is compared.
        expected: With what.
        kinds: Which results are compared; all that both have if None.
    """
    strengths = expected.outcome.strengths
    if actual.outcome.probabilities is not None and strengths is not None:
        answers = answers_of(expected.outcome, expected.model, with_probabilities=True)
        shares = getattr(answers, "probabilities", None)
        outcome = msgspec.structs.replace(expected.outcome, probabilities=shares)
        expected = msgspec.structs.replace(expected, outcome=outcome)
    differs = unequal(actual.outcome, expected.outcome)
    names = answer_names(expected)
    if expected.outcome.outputs is None:
        differs |= labels(actual, names) != labels(expected)
    rows = np.flatnonzero(differs)
    run = expected.part(rows)
    one, two = _table(actual.part(rows), names), _table(run, names)
    shared = {kind for kind, _ in one} & {kind for kind, _ in two}
    shared &= shared if kinds is None else set(kinds)
    keys = tuple(key for key in {**two, **one} if key[0] in shared)
    nothing = np.full(rows.shape, np.nan)
    numbers = (
        np.array([part.get(key, nothing) for key in keys], np.float64)
        for part in (one, two)
    )
    first, second = (table.reshape(len(keys), rows.size) for table in numbers)
    return Results(keys, first, second, rows, run)


def _table(run: ModelRun, names: Sequence[str]) -> dict[Key, FloatArray | IntArray]:
    """Return all results of a run, by kind and name."""
    outcome, is_system = run.outcome, run.outcome.outputs is not None
    blocks: dict[ResultKind, FloatArray | IntArray | None] = {
        "class": None if is_system else labels(run, names)[None],
        "rule": None if is_system else outcome.rule[None],
        "status": outcome.status[None],
        "output": outcome.outputs,
        "activation" if is_system else "strength": outcome.strengths,
        "probability": outcome.probabilities,
    }
    table: dict[Key, FloatArray | IntArray] = {}
    for kind, lines in blocks.items():
        titles = [kind] if kind in _NAMES else names
        if lines is None:
            continue
        if kind in ("activation", "strength"):
            titles = [str(number) for number in range(1, 1 + len(lines))]
        table |= {(kind, x): y for x, y in zip(titles, lines, strict=True)}
    return table


def answer_names(run: ModelRun) -> tuple[str, ...]:
    """Return the classes or the outputs that a model answers."""
    answers = answers_of(run.outcome, run.model)
    return answers.choices if isinstance(answers, Predictions) else answers.names


def labels(answers: ModelRun, names: Sequence[str] | None = None) -> IntArray:
    """Return the class number of each answer, among `names` if given; -1 for none."""
    classes = predictions_of(answers.outcome, cast("Model", answers.model))
    if names is None or (*names,) == classes.choices:
        return classes.codes
    order = [*names, *(name for name in classes.choices if name not in names)]
    places: IntArray = np.array([*map(order.index, classes.choices), -1])
    return places[classes.codes]


def same_bits(one: FloatArray | IntArray, two: FloatArray | IntArray) -> BoolArray:
    """Return where two arrays of a shape have the same bits; NaN is one value.

    Example:
        >>> zeros, others = np.array([0.0, 0.0, np.nan]), np.array([0.0, -0.0, np.nan])
        >>> same_bits(zeros, others).tolist()
        [True, False, True]
    """
    same: BoolArray = (one == two) & (np.signbit(one) == np.signbit(two))
    return same | (np.isnan(one) & np.isnan(two))


def unequal(one: Outcome, two: Outcome) -> BoolArray:
    """Return the rows in which two outcomes differ, by a single bit if in no more.

    What only one of them has is not compared.
    """
    wrong: BoolArray = np.zeros(one.status.shape, np.bool_)
    arrays = map(msgspec.structs.astuple, (one, two))
    for first, second in zip(*arrays, strict=True):
        if first is None or second is None:
            continue
        if first.shape != second.shape:
            return np.ones_like(wrong)
        wrong |= ~same_bits(first, second).reshape(-1, wrong.size).all(axis=0)
    return wrong


def strength_gap(actual: Outcome, expected: Outcome) -> FloatArray:
    """Return the largest difference of a strength in each row; NaN equals NaN.

    Zeros where one of the two has no strengths; infinite where one has a rule more.
    """
    one, two = actual.strengths, expected.strengths
    if one is None or two is None:
        return np.zeros(actual.rule.shape)
    if one.shape != two.shape:
        return np.full(actual.rule.shape, np.inf)
    largest: FloatArray = _gaps(one, two).max(axis=0, initial=0.0)
    return largest


def _gaps(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return how far numbers are apart; NaN is infinitely far from any other."""
    with np.errstate(invalid="ignore"):
        gaps: FloatArray = np.abs(one - two)
    gaps[np.isnan(gaps)] = np.inf
    gaps[(one == two) | (np.isnan(one) & np.isnan(two))] = 0.0
    return gaps


def margins(answers: ModelRun) -> FloatArray | None:
    """Return how far the strongest class is ahead of the next, in each row."""
    named = answers_of(answers.outcome, answers.model, with_strengths=True)
    strengths = named.class_strengths if isinstance(named, Predictions) else None
    return None if strengths is None else _leads(strengths)


def _leads(strengths: FloatArray) -> FloatArray:
    """Return how far the largest of each column is ahead of the next, or of 0."""
    top = np.sort(np.vstack([strengths, np.zeros((2, strengths.shape[1]))]), axis=0)
    leads: FloatArray = np.nan_to_num(top[-1] - top[-2], nan=0.0)
    return leads


# --- how far results may be apart


class Allowance(NamedTuple):
    """How far results may be apart, of shape (results, rows).

    Attributes:
        amounts: 0 demands equal bits, infinity nothing.
        is_loose: Where that says so little that it is counted apart.
        origin: Where it comes from.
    """

    amounts: FloatArray
    is_loose: BoolArray
    origin: str


Allow = Callable[[Results, FloatArray], Allowance]
"""What is allowed, from results that differ and the values of their rows."""


def equal_bits(results: Results, values: FloatArray) -> Allowance:
    """Allow nothing."""
    nothing = np.zeros(results.actual.shape)
    return Allowance(nothing, nothing > 0.0, "equal bits")


def by_libraries(
    program: Callable[[], Program],
    bounds: Callable[[Program, FloatArray], FloatArray] = error_bounds,
    cause: str = ORIGIN,
    *,
    edge: float = _EDGE,
) -> Allow:
    """Allow what functions of libraries differ by: nothing where there are none.

    Other `bounds`, of shape (results, rows), are those of another `cause`. A bound
    wider than a share of the largest number, the `edge`, is counted apart: last bits
    decide there, so near is an edge or a division by 0.
    """

    def allow(results: Results, values: FloatArray) -> Allowance:
        made = program()
        pairs = zip(made.results, bounds(made, values), strict=True)
        bound_of = {(result.kind, result.name): bound for result, bound in pairs}
        amounts = equal_bits(results, values).amounts
        for line, key in enumerate(results.keys):
            amounts[line] = bound_of.get(key, 0.0)
        size = np.nan_to_num(np.abs(results.expected), posinf=0.0)
        largest = np.maximum(size.max(axis=1, initial=0.0, keepdims=True), _LEAST)
        origin = cause if amounts.any() else "equal bits"
        return Allowance(amounts, amounts > edge * largest, origin)

    return allow


def within(bound: Callable[[FloatArray], tuple[FloatArray, str]]) -> Allow:
    """Allow a difference of strengths in each row, and what must follow from it.

    A class may differ only where the two strongest classes are at most twice as far
    apart, rule and status only where the two strongest rules are. Rows in which 1 is
    allowed prove nothing and are counted as such.
    """

    def allow(results: Results, values: FloatArray) -> Allowance:
        limit, origin = bound(values)
        is_loose = np.broadcast_to(limit >= 1.0, results.actual.shape)
        strengths, lead = results.run.outcome.strengths, margins(results.run)
        amounts = np.where(is_loose, np.inf, limit)
        if strengths is not None and lead is not None:
            leads = np.where(results.is_of("class"), lead, _leads(strengths))
            decided = np.where(is_loose | (leads <= 2.0 * limit), np.inf, 0.0)
            amounts = np.where(results.is_of(*_NAMES), decided, amounts)
        return Allowance(amounts, is_loose & ~results.is_of(*_NAMES), origin)

    return allow


def excused(where: Callable[[FloatArray], BoolArray], origin: str) -> Allow:
    """Allow everything in some rows, and nothing in others."""

    def allow(results: Results, values: FloatArray) -> Allowance:
        nothing, is_loose, _ = equal_bits(results, values)
        return Allowance(np.where(where(values), np.inf, nothing), is_loose, origin)

    return allow


# --- comparing


class Differences(NamedTuple):
    """Where two runs differ in a bit, and in more than is allowed.

    Attributes:
        results: Of both, in the rows that differ.
        gaps: How far the results are apart.
        allowance: How far they may be.
        wrong: Which of the rows differ in more, worst first.
    """

    results: Results
    gaps: FloatArray
    allowance: Allowance
    wrong: IntArray


def differences(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    allow: Allow = equal_bits,
    *,
    kinds: Collection[str] | None = None,
) -> Differences:
    """Return where two runs differ, and in more than is allowed."""
    results = results_of(actual, expected, kinds)
    gaps = _gaps(results.actual, results.expected)
    is_signed = ~same_bits(results.actual, results.expected) & (gaps == 0.0)
    gaps[is_signed & ~results.is_of("output", "activation")] = _LEAST
    allow = allow if results.rows.size else equal_bits
    allowance = allow(results, rows.values[:, results.rows])
    size = np.where(results.is_of(*_NAMES), 0.0, gaps).max(axis=0, initial=0.0)
    wrong = np.flatnonzero((gaps > allowance.amounts).any(axis=0))
    wrong = wrong[np.argsort(-size[wrong], kind="stable")]
    return Differences(results, gaps, allowance, wrong)


def compare(
    actual: ModelRun,
    expected: ModelRun,
    rows: RowSet,
    allow: Allow = equal_bits,
    *,
    kinds: Collection[str] | None = None,
    by_design: bool = False,
) -> Comparison:
    """Compare two runs: bits, and where they differ what is allowed.

    Args:
        actual: What is compared.
        expected: With what.
        rows: The rows of both.
        allow: How far results may be apart.
        kinds: Which results are compared; all that both have if None.
        by_design: Whether the two are different functions, so that a difference is
            reported and is no fault.
    """
    apart = differences(actual, expected, rows, allow, kinds=kinds)
    results, gaps, (allowed, is_loose, origin), wrong = apart
    same = len(rows.numbers) - results.rows.size
    if kinds == ("class",):
        origin = "equal classes"
    elif not results.rows.size:
        origin = "equal bits"
    elif origin != "equal bits":
        origin += f"; equal bits in {same} rows"
    has_class = bool(results.is_of("class").any())
    is_flip = results.is_of("class" if has_class else "status") & (gaps > 0.0)
    flips = np.flatnonzero(is_flip.any(axis=0))
    lead = margins(results.run.part(flips)) if flips.size else None
    gaps = np.where(results.is_of(*_NAMES) | (gaps == _LEAST), 0.0, gaps)
    bounded = np.where(is_loose & (gaps <= allowed), 0.0, gaps)
    with np.errstate(over="ignore"):
        excess = bounded / np.maximum(allowed, _LEAST) if wrong.size else bounded
    worst = int(np.argmax(excess)) if excess.size else None
    texts = [_row_text(apart, rows, place) for place in wrong[:_SHOWN].tolist()]
    if texts and has_class and bounded.any() and not flips.size:
        texts.insert(0, "only strengths differ: every row has the same class")
    verdict: Verdict = "differs by design" if by_design else "DISAGREES"
    return Comparison(
        actual.title,
        expected.title,
        "rows",
        len(rows.numbers),
        verdict if wrong.size else "agrees",
        differing=int(wrong.size),
        largest_difference=float(bounded.max(initial=0.0)),
        allowed=0.0 if worst is None else float(allowed.flat[worst]),
        origin=origin,
        flips=int(flips.size),
        largest_flip_margin=None if lead is None else float(lead.max()),
        detail=tuple(texts),
        row_numbers=tuple(rows.numbers[results.rows[wrong[:_SHOWN]]].tolist()),
        unbounded=int(is_loose.any(axis=0).sum()),
        largest_unbounded=float(gaps[is_loose].max(initial=0.0)),
    )


def _row_text(apart: Differences, rows: RowSet, place: int) -> str:
    """Return a row with what is wrong in it: names, or else the worst amount."""
    results, allowed = apart.results, apart.allowance.amounts[:, place]
    gaps = apart.gaps[:, place]
    wrong = np.flatnonzero(gaps > allowed).tolist()
    lines = [line for line in wrong if results.keys[line][0] in _NAMES]
    parts: list[str] = []
    for line in lines or sorted(wrong, key=lambda line: -float(gaps[line]))[:1]:
        kind, name = results.keys[line]
        one, two = (
            _shown(kind, float(numbers[line, place]), answer_names(results.run))
            for numbers in (results.actual, results.expected)
        )
        bound = float(allowed[line])
        more = "" if bound == 0.0 else f", which may differ by {bound:.2g}"
        title = _TITLES.get(kind, kind).format(name)
        parts.append(f"{title} {one} where {two} is right{more}")
    return f"{rows.text(int(results.rows[place]))}: {', '.join(parts)}"


def _shown(kind: ResultKind, number: float, classes: Sequence[str]) -> str:
    words = {-1: "no class", **dict(enumerate(classes))}
    if kind == "status":
        words = {int(status): status.name.lower() for status in Status}
    if kind in ("class", "status"):
        return words.get(int(number), "another")
    return str(int(number)) if kind == "rule" else repr(number)


_TITLES: Mapping[ResultKind, str] = {
    "output": "output {!r}",
    "strength": "strength of rule {}",
    "activation": "activation of rule {}",
    "probability": "probability of {}",
}
"""What people call an amount, by its kind and with its name."""

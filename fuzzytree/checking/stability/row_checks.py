"""N1, N3, N6 and N9: other units, orders, special values, and files read back."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast, get_args

import msgspec
import numpy as np

from fuzzytree.checking.certificates import missing_rows
from fuzzytree.checking.comparing import strength_gap
from fuzzytree.checking.equivalence import equivalence
from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    FirstOutcomes,
    LoadedForm,
    Truth,
    exact_check,
    first_line,
    loaded_form,
    loaded_forms,
    other_bits,
    row_text,
)
from fuzzytree.checking.stability.sensitivity import input_scales
from fuzzytree.checking.stability.transforms import NORMAL, exponent_range, scaled
from fuzzytree.errors import (
    FuzzyTreeError,
    InvalidModelError,
    LossError,
    MissingExtraError,
    ReadError,
)
from fuzzytree.model import (
    Document,
    Dtype,
    FloatArray,
    Format,
    IntArray,
    Linear,
    Outcome,
    Run,
    Runtime,
    kind_of,
    options_of,
)
from fuzzytree.runtimes import baseline, load_content, open_onnx
from fuzzytree.semantics import SPECIAL, Status, forms

BATCHES = (0, 1, 2, 7, 33, 1000)
"""Rows answered at a time."""

_CALLS = 40  # batches of each size, taken from all over the rows
_COPIES = 50  # rows of a table whose columns are all constant
_ADVICE = (
    "the runtime's answer to a row depends on the rows beside it; fix the order of its "
    "sums, or use another one"
)


def order(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Permute, repeat and cut up rows, and reorder inputs; demand equal bits (N3).

    Tables of two, one and no rows are among them, and one row many times without
    copies: its columns have no stride.
    """
    trial = Trial("N3", _ADVICE)
    for one in loaded_forms(model, runtimes, trial.skipped):
        rows = one.some(values)
        whole = one.run(rows)
        for text, run, table, numbers in (*_tables(one, rows), *_renumbered(one, rows)):
            right = whole.part(numbers)
            what = f": {{}} {text}"
            try:
                outcome = run(table)
            except FuzzyTreeError as error:
                trial.add(1, f"{one.title}: rows {text} are refused: {error}")
                continue
            trial.add(*one.fault(what, rows[:, numbers], outcome, right))
    return trial.result()


Attempt = tuple[str, Run, FloatArray, IntArray]
"""What was done to the rows, what runs them, the table, and the rows' numbers."""


def _tables(one: LoadedForm, rows: FloatArray) -> Iterator[Attempt]:
    """Yield the rows in other orders, numbers and layouts of memory."""
    every = np.arange(rows.shape[1])
    mixed = np.random.default_rng(0).permutation(every)
    yield "in another order", one.run, rows[:, mixed], mixed
    twice = np.repeat(every, 2)
    yield "when each stands twice", one.run, rows[:, twice], twice
    large = max(BATCHES)
    if len(every) < large and not one.runtime.is_slow:
        many = np.resize(every, large)
        yield f"among {large}", one.run, rows[:, many], many
    for size in BATCHES:
        starts = range(0, len(every), size) if size else range(1)
        for start in starts[:: -(-len(starts) // _CALLS)] if size < len(every) else ():
            some = every[start : start + size]
            yield f"in a batch of {len(some)}", one.run, rows[:, some], some
    for row in every[:3]:
        table = np.broadcast_to(rows[:, row : row + 1], (len(rows), _COPIES))
        numbers = np.full(_COPIES, row)
        yield f"when {_COPIES} of them are one", one.run, table, numbers
    yield "when rows are contiguous in memory", one.run, np.asfortranarray(rows), every
    yield "when numbers are apart in memory", one.run, rows[:, twice][:, ::2], every


def _renumbered(one: LoadedForm, rows: FloatArray) -> Iterator[Attempt]:
    """Yield the rows for a model whose inputs stand in the opposite order."""
    inputs = [v for v in one.model.variables if not v.parts]
    outputs = (term.function for output in one.model.outputs for term in output.terms)
    if len(inputs) < 2 or any(isinstance(curve, Linear) for curve in outputs):
        return  # a linear conclusion adds up its inputs in their order
    others = [v for v in one.model.variables if v.parts]
    turned = msgspec.structs.replace(one.model, variables=(*reversed(inputs), *others))
    after = loaded_form(one.representation, turned, one.runtime, [])
    if after is not None:
        table, every = np.ascontiguousarray(rows[::-1]), np.arange(rows.shape[1])
        yield "when the inputs stand in another order", after.run, table, every


_STEPS = (-300, -40, -7, 7, 40, 300)  # and the ends of the range
_DECADES = int(np.ceil(20.0 * np.log2(10.0)))  # 67 doublings are 20 decades
_ADVICE_SCALING = (
    "the runtime compares with a fixed number somewhere, or leaves the number range "
    "in between; use one whose steps are differences, quotients and comparisons"
)
_NO_INPUT = "the model has no input"


def scaling(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Multiply the inputs of a model and of rows by 2**k; demand equal bits (N1).

    k runs over a ladder up to both ends of the range in which every number of the
    model stays normal; last, every input has a k of its own, those of one combination
    too, spread over 20 decades or over all of a narrower range.
    """
    trial = Trial("N1", _ADVICE_SCALING)
    if not model.inputs:
        trial.skipped.append(_NO_INPUT)
        return trial.result()
    ranges: dict[str, list[tuple[int, int]]] = {}
    for one in loaded_forms(model, runtimes, trial.skipped):
        low, high = exponent_range(one.model, one.runtime.dtype)
        if low > high:
            why = "its own numbers span more than the type"
            trial.skipped.append(f"{one.title}: {why}")
            continue
        axes = "float32" if one.runtime.dtype == "float32" else "double"
        ranges.setdefault(axes, []).append((low, high))
        ks = [k for k in _STEPS if low < k < high]
        # An engine of others divides and multiplies in between as it likes.
        ks += [] if one.runtime.bound is not None else [low, high]
        spread = min(_DECADES, high - low)
        if spread < _DECADES and len(model.inputs) > 1:
            why = "its own numbers leave no room for units 20 decades apart"
            trial.skipped.append(f"{one.title}: {why}")
        start = min(max(-_DECADES // 2, low), high - spread)
        own = np.linspace(start, start + spread, len(model.inputs)).astype(int).tolist()
        random.Random(0).shuffle(own)
        for plan in (*([k] * len(model.inputs) for k in ks), own):
            trial.add(*_scaled(one, plan, values, trial.skipped))
    facts: list[str] = []
    for name, every in ranges.items():
        low, high = max(low for low, _ in every), min(high for _, high in every)
        facts.append(f"{name}: inputs times 2**{low} to 2**{high} change nothing")
    return trial.result(*facts)


def _scaled(
    one: LoadedForm, ks: Sequence[int], values: FloatArray, skipped: list[str]
) -> tuple[int, str | None]:
    """Return how many scaled rows were compared, and what was wrong."""
    factor = f"2**k, k from {min(ks)} to {max(ks)}"
    factor = f"2**{ks[0]}" if len(set(ks)) == 1 else factor
    lost: list[str] = []
    try:
        other = scaled(one.model, dict(zip(one.model.inputs, ks, strict=True)))
    except (LossError, InvalidModelError) as error:
        return 1, f"{one.title}, inputs times {factor}: {error}"
    after = loaded_form(one.representation, other, one.runtime, lost)
    if after is None:
        return 1, f"inputs times {factor}: {lost[0]}"
    some, factors = one.some(values), np.array(ks, np.int64)[:, np.newaxis]
    low, high = NORMAL[one.runtime.dtype]
    is_fit = (some == 0.0) | ~np.isfinite(some)  # or normal, before and after
    before = np.frexp(some)[1]
    is_normal = (np.minimum(before, before + factors) >= low) & (
        np.maximum(before, before + factors) <= high
    )
    rows = some[:, (is_fit | is_normal).all(axis=0)]
    if not rows.shape[1]:
        skipped.append(f"{one.title}, inputs times {factor}: no row stays in range")
        return 0, None
    what = f", inputs times {factor}: {{}}"
    return one.fault(what, rows, after.run(np.ldexp(rows, factors)), one.run(rows))


SPECIALS = (
    *SPECIAL,
    *(-5e-324, 2.225073858507201e-308, 1e-310, 1e-45, 1e-40),
    *(3.4028234663852886e38, 3.5e38, -3.5e38, 1e39),
)
"""No number, no finite one, both zeros, subnormal in double and in float32, the largest
float32 and beyond, and the largest double."""

_BEYOND = (0.5, 1.0, 4.0, 16.0, 21.0, 22.0, 22.5, 23.0, 24.0, 64.0, 1e3, 1e6)
"""Distances from a range, in widths of the narrowest term: at some of them the degree
of a gaussian is 1e-300, at others 0."""

_BASES = 4  # rows in which a value is replaced
_ADVICE_SPECIALS = (
    "test for missing values before anything is compared: NaN answers every comparison "
    "with no, and each minimum in its own way"
)


def specials(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Put each special value into each input; demand the declared answer (N6).

    A row is missing exactly where an input, or a combination computed step by step in
    the runtime's type of axes, is not finite; then there is no rule, and no strength or
    output is a number. For a class -0.0 is like 0.0. Runtimes of one number type that
    promise equal bits give each other's rules; the numbers of a system are right.
    """
    trial = Trial("N6", _ADVICE_SPECIALS)
    if not model.inputs:
        trial.skipped.append(_NO_INPUT)
        return trial.result()
    rows = special_rows(model, values)
    first: FirstOutcomes = {}
    right: dict[tuple[str, int], Truth] = {}
    for one in loaded_forms(model, runtimes, trial.skipped):
        tried = one.some(rows)
        outcome, warning = one.run_with_warning(tried)
        trial.add(tried.shape[1], warning and f"{one.title}: it warns: {warning}")
        trial.faults += _broken_policy(one, tried, outcome)
        is_zero = tried == 0.0
        if model.outputs:  # a number may have the sign of an input
            trial.faults += exact_check(one, tried, right).faults
        elif is_zero.any():
            turned = one.run(np.where(is_zero, -tried, tried))
            if one.fault("", tried, turned, outcome)[1]:
                trial.add(0, f"{one.title}: 0.0 and -0.0 are not answered alike")
        trial.faults += other_bits(one, tried, outcome, first)
    return trial.result()


def special_rows(model: Document, values: FloatArray) -> FloatArray:
    """Return rows in which one input at a time has each special value, and all have.

    The values beyond an input's range, where degrees end, are among them.
    """
    plain = values[:, np.isfinite(values).all(axis=0)]
    if not plain.shape[1]:
        plain = np.zeros((values.shape[0], 1))
    scales = [*input_scales(model, values).values()]
    middle = np.array([[0.5 * one.low + 0.5 * one.high] for one in scales])
    bases = np.hstack([plain[:, :: -(-plain.shape[1] // _BASES)], middle])
    tables = [bases, *(np.full_like(bases[:, :1], value) for value in SPECIALS)]
    for line, scale in enumerate(scales):
        width = scale.spread if math.isfinite(scale.spread) else 0.0
        beyond = [scale.high + size * width for size in _BEYOND]
        beyond += [scale.low - size * width for size in _BEYOND]
        for value in (*SPECIALS, *beyond):
            changed = bases.copy()
            changed[line] = value
            tables.append(changed)
    return np.concatenate(tables, axis=1)


def _broken_policy(
    one: LoadedForm, rows: FloatArray, outcome: Outcome
) -> Iterator[str]:
    expected = missing_rows(one.model, rows, one.runtime.dtype)
    is_missing = outcome.status == Status.MISSING
    wrong = is_missing != expected
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        verb = "is not" if expected[row] else "is"
        yield (
            f"{one.title}: {int(wrong.sum())} rows break the policy on missing values; "
            f"{row_text(one.model.inputs, rows, row)} {verb} taken as missing"
        )
    if (outcome.rule[is_missing] != 0).any():
        yield f"{one.title}: a row with a missing value has a rule"
    for kind in ("strengths", "outputs"):
        numbers = getattr(outcome, kind)
        if numbers is not None and not np.isnan(numbers[:, is_missing]).all():
            which = f"one of the {kind} of a row with a missing value"
            yield f"{one.title}: {which} is a number"
    if outcome.strengths is not None and not one.model.outputs:
        known = outcome.strengths[:, ~is_missing]
        if not ((known >= 0.0) & (known <= 1.0)).all():
            yield f"{one.title}: a strength is not between 0 and 1"


_ADVICE_FILES = "keep the YAML file as the model, and do not ship the file that failed"


def roundtrips(
    model: Document, formats: Sequence[Format], values: FloatArray
) -> Criterion:
    """Write every form of a model in every format, take it back and compare (N9).

    A format that is read must give back an equal model, and the same bytes when that
    is written again; lines may come back as points, within 2^-52. One that only runs
    must answer like the native runtime of its number type, bit for bit.

    The values, of shape (inputs, rows), are what files that run compute.
    """
    trial = Trial("N9", _ADVICE_FILES, worst=0.0)
    for representation, form in forms(model).items():
        for one in formats:
            title = f"{one.name}: {representation}"
            if kind_of(form) not in one.carries:
                continue
            try:
                if one.read is not None:
                    _read_again(trial, one, title, form)
                elif one.name in _RUNS:
                    _run_again(trial, one, representation, form, values)
                else:
                    trial.skipped.append(f"{one.name}: there is no way back from it")
            except (LossError, MissingExtraError) as error:
                trial.skipped.append(f"{title}: {first_line(error)}")
    return trial.result()


def _read_again(trial: Trial, one: Format, title: str, form: Document) -> None:
    assert one.read is not None  # the caller tests it
    written = one.write(form)
    try:
        again = one.read(written.content, title)
    except ReadError as error:
        why = f"{title}: it cannot be read again: {first_line(error)}"
        trial.add(1, why, worst=1.0)
        return
    match equivalence(form, written, again):
        case "equal" if one.write(again.model).content == written.content:
            trial.add(2)
        case "equal":
            trial.add(1, f"{title}: written again it has other bytes")
        case "alike" if form.rules:
            trial.add(1)
        case _:
            why = f"{title}: the model that comes back is not equal"
            trial.add(1, why, worst=1.0)


def _run_again(
    trial: Trial, one: Format, representation: str, form: Document, values: FloatArray
) -> None:
    """Run a file in each of its number types beside the native runtime."""
    known = {fact.name for fact in options_of(one)}
    outputs = ["label", "rule", "status", *["strengths"] * bool(form.rules)]
    if form.outputs:
        outputs = ["outputs", "status", "activations"]
    for dtype in get_args(Dtype) if "dtype" in known else ("float64",):
        title = f"{one.name} {dtype}: {representation}"
        native = loaded_form(representation, form, baseline(dtype), [])
        wanted = {"dtype": dtype, "outputs": tuple(outputs)}
        options = {name: wanted[name] for name in known & wanted.keys()}
        write = cast("Callable[..., Any]", one.write)  # the options are its own
        try:
            content = None if native is None else write(form, **options).content
        except LossError as error:
            trial.skipped.append(f"{title}: {first_line(error)}")
            continue
        if native is None or content is None:
            trial.skipped.append(f"{title}: no native runtime computes it")
            continue
        actual, expected = _RUNS[one.name](content, form)(values), native.run(values)
        gap = float(strength_gap(actual, expected).max(initial=0.0))
        what = f": {{}}, strengths by up to {gap:.3g}"
        file = msgspec.structs.replace(native, title=title)
        trial.add(*file.fault(what, values, actual, expected), worst=gap)


_RUNS: dict[str, Callable[[bytes, Any], Run]] = {
    "onnx": lambda content, _: open_onnx(content, "the written file").run,
    "python": load_content,
}
"""How a file that is not read as a model is run again, by the name of its format."""

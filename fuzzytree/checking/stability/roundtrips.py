"""N9: what is written and read again, or run from the file, is still the model."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import cast, get_args

from fuzzytree.checking.comparing import strength_gap, unequal
from fuzzytree.checking.equivalence import equivalence
from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import first_line
from fuzzytree.errors import LossError, MissingExtraError, ReadError
from fuzzytree.model import (
    Dtype,
    FloatArray,
    Format,
    FuzzyTree,
    Model,
    Outcome,
    RuleBase,
    Run,
    Written,
    kind_of,
)
from fuzzytree.runtimes import baseline, load_content, open_onnx
from fuzzytree.semantics import forms

_ADVICE = "keep the YAML file as the model, and do not ship the file that failed"


def roundtrips(
    model: Model, formats: Sequence[Format], values: FloatArray
) -> Criterion:
    """Write every form of a model in every format, take it back and compare (N9).

    A format that is read must give back an equal model, and the same bytes when that
    is written again; lines may come back as points, within 2^-52. One that only runs
    must answer like the native runtime of its number type, bit for bit.

    The values, of shape (inputs, rows), are what files that run compute.
    """
    trial = Trial("N9", _ADVICE, worst=0.0)
    for representation, form in forms(model).items():
        for one in formats:
            if kind_of(form) not in one.carries:
                continue
            try:
                for count, gap, fault in _tried(
                    one, representation, form, values, trial.skipped
                ):
                    trial.add(count, fault, worst=gap)
            except (LossError, MissingExtraError) as error:
                why = f"{one.name}: {representation}: {first_line(error)}"
                trial.skipped.append(why)
    return trial.result()


def _tried(
    one: Format,
    representation: str,
    form: Model,
    values: FloatArray,
    skipped: list[str],
) -> Iterator[tuple[int, float, str | None]]:
    """Yield, for each variant, how much was compared, its gap, and its fault."""
    if one.read is not None:
        yield _read_again(one, representation, form)
        return
    opener = _OPENERS.get(one.name)
    if opener is None:
        skipped.append(f"{one.name}: there is no way back from it")
        return
    for dtype in _dtypes(one):
        title = f"{one.name} {dtype}: {representation}"
        # Every writer knows allow_loss; those with number types know dtype as well.
        write = cast("Callable[..., Written]", one.write)
        options: dict[str, object] = {}
        if "dtype" in _options(one):
            options["dtype"] = dtype
        if "outputs" in _options(one):
            columns = ("label", "rule", "status", "strengths")
            options["outputs"] = columns if isinstance(form, RuleBase) else columns[:3]
        try:
            run = opener(write(form, **options).content, form)
            base = baseline(dtype).load(form)
        except LossError as error:
            skipped.append(f"{title}: {first_line(error)}")
            continue
        yield _compared(title, run(values), base(values))


def _read_again(
    one: Format, representation: str, form: Model
) -> tuple[int, float, str | None]:
    title = f"{one.name}: {representation}"
    assert one.read is not None  # the caller tests it
    written = one.write(form)
    try:
        again = one.read(written.content, title)
    except ReadError as error:
        return 1, 1.0, f"{title}: it cannot be read again: {first_line(error)}"
    match equivalence(form, written, again):
        case "equal":
            is_same = one.write(again.model).content == written.content
            other_bytes = f"{title}: written again it has other bytes"
            return (2, 0.0, None) if is_same else (1, 0.0, other_bytes)
        case "alike" if not isinstance(form, FuzzyTree):
            return 1, 0.0, None
        case _:
            return 1, 1.0, f"{title}: the model that comes back is not equal"


def _compared(
    title: str, actual: Outcome, expected: Outcome
) -> tuple[int, float, str | None]:
    """Return how many rows were compared, the largest gap, and what is wrong."""
    wrong = unequal(actual, expected)
    gap = float(strength_gap(actual, expected).max(initial=0.0))
    if not wrong.any():
        return wrong.size, gap, None
    fault = (
        f"{title}: {int(wrong.sum())} of {wrong.size} rows are answered differently, "
        f"strengths by up to {gap:.3g}"
    )
    return wrong.size, gap, fault


def _options(one: Format) -> tuple[str, ...]:
    return tuple(inspect.signature(one.write).parameters)


def _dtypes(one: Format) -> tuple[Dtype, ...]:
    return get_args(Dtype) if "dtype" in _options(one) else ("float64",)


def _from_onnx(content: bytes, _: Model) -> Run:
    return open_onnx(content, "the written file").run


_OPENERS: dict[str, Callable[[bytes, Model], Run]] = {
    "onnx": _from_onnx,
    "python": load_content,
}
"""How a file that is not read as a model is run again, by the name of its format."""

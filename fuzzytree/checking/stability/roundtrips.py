"""N9: what is written and read again, or run from the file, is still the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast, get_args

import msgspec

from fuzzytree.checking.comparing import strength_gap
from fuzzytree.checking.equivalence import equivalence
from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import first_line, forms_of, loaded_form
from fuzzytree.errors import LossError, MissingExtraError, ReadError
from fuzzytree.model import (
    Document,
    Dtype,
    FloatArray,
    Format,
    Run,
    kind_of,
    options_of,
)
from fuzzytree.runtimes import baseline, load_content, open_onnx

_ADVICE = "keep the YAML file as the model, and do not ship the file that failed"


def roundtrips(
    model: Document, formats: Sequence[Format], values: FloatArray
) -> Criterion:
    """Write every form of a model in every format, take it back and compare (N9).

    A format that is read must give back an equal model, and the same bytes when that
    is written again; lines may come back as points, within 2^-52. One that only runs
    must answer like the native runtime of its number type, bit for bit.

    The values, of shape (inputs, rows), are what files that run compute.
    """
    trial = Trial("N9", _ADVICE, worst=0.0)
    for representation, form in forms_of(model).items():
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

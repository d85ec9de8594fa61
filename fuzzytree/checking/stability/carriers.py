"""The forms of a model, each ready in every runtime that can run it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.checking.comparing import same_bits
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Model, Outcome, Run, Runtime
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes import is_installed, needed_by
from fuzzytree.semantics.lowering import forms

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

    BoolArray = npt.NDArray[np.bool_]

_SLOW_ROWS = 60  # rows that a slow runtime is given, whatever the others get


class Ready(msgspec.Struct, frozen=True):
    """A form of a model in a runtime, ready to answer.

    Attributes:
        title: What to call it, such as `onnxruntime float32: raw rules`.
        representation: What to call the form.
        runtime: The runtime.
        model: The form.
        loud: Its answers, with whatever warnings it lets out.
    """

    title: str
    representation: str
    runtime: Runtime
    model: Model
    loud: Run

    def run(self, values: FloatArray) -> Outcome:
        """Answer rows, and keep warnings in; criterion N4 asks for them."""
        return answered(self, values)[0]

    def some(self, values: FloatArray) -> FloatArray:
        """Return the rows to ask: a share of them if the runtime is slow."""
        rows = values.shape[1]
        if not self.runtime.is_slow or rows <= _SLOW_ROWS:
            return values
        return values[:, :: -(-rows // _SLOW_ROWS)]


def ready(
    model: Model, runtimes: Sequence[Runtime], skipped: list[str]
) -> Iterator[Ready]:
    """Yield each form of a model in each runtime that can run it.

    Args:
        model: A tree or a rule base.
        runtimes: The runtimes.
        skipped: Gets a sentence for each that is not installed or cannot.
    """
    for representation, form in forms(model).items():
        for runtime in runtimes:
            found = made_ready(representation, form, runtime, skipped)
            if found is not None:
                yield found


def made_ready(
    representation: str, form: Model, runtime: Runtime, skipped: list[str]
) -> Ready | None:
    """Return one form in one runtime; None if that cannot be, with a reason kept."""
    kind = "tree" if isinstance(form, FuzzyTree) else "rules"
    if kind not in runtime.runs:
        return None
    if not is_installed(runtime):
        skipped.append(f"{runtime.name} is not installed ({needed_by(runtime)})")
        return None
    title = f"{runtime.name}: {representation}"
    try:
        run = runtime.load(form)
    except LossError as error:
        skipped.append(f"{title}: {first_line(error)}")
        return None
    return Ready(title, representation, runtime, form, run)


def answered(one: Ready, values: FloatArray) -> tuple[Outcome, str | None]:
    """Return a runtime's answers, and the first warning that it let out, if any."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = one.loud(values)
    return found, str(caught[0].message) if caught else None


def unequal(one: Outcome, two: Outcome) -> BoolArray:
    """Return the rows in which two outcomes differ, by a single bit if in no more."""
    wrong: BoolArray = (one.rule != two.rule) | (one.status != two.status)
    first, second = one.strengths, two.strengths
    if first is None or second is None:
        return wrong
    if first.shape != second.shape:
        return np.ones_like(wrong)
    wrong |= ~same_bits(first, second).all(axis=0)
    return wrong


def first_line(error: Exception) -> str:
    """Return what went wrong, without the advice that follows it."""
    return str(error).partition("\n")[0]


def row_text(inputs: Sequence[str], values: FloatArray, row: int) -> str:
    """Return a row as people read it, each number with all its digits."""
    found = values[:, row].tolist()
    shown = [f"{n} {v!r}" for n, v in zip(inputs, found, strict=True)][:8]
    return ", ".join(shown) + (", ..." if len(inputs) > 8 else "")

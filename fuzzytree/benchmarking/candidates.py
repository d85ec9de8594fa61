"""Our own ways of running a model: every runtime, every form of the model."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.benchmarking.records import (
    Bound,
    Candidate,
    Found,
    Loaded,
    Omission,
    Question,
)
from fuzzytree.model.contracts import Dtype, Model, Outcome, Prepared, Runtime
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.runtimes import all_runtimes, is_installed, needed_by
from fuzzytree.runtimes.answers import answers_of
from fuzzytree.semantics.lowering import forms

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray

Bounds = Callable[[RuleBase, Dtype], Bound | None]
"""The certified error of a rule base's strengths in a number type, if there is one."""

_BLOCK_NUMBERS = 1 << 25  # strengths that a call of the native runtime makes at once
_BLOCK = 1 << 16


@functools.lru_cache(maxsize=1)
def questions(model: Model) -> Mapping[Question, Model]:
    """Return what can be asked of a model, and the model that answers it.

    The raw rules of a large tree take seconds to make: a study asks for them often.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> list(questions(random_tree(1)))
        ['tree', 'relative rules', 'raw rules']
    """
    return MappingProxyType(forms(model))


def title(runtime: str, question: Question) -> str:
    """Return the name of a candidate, such as `native: tree`."""
    return f"{runtime}: {question}"


class Layouts:
    """Tables as sessions take them: made once for all candidates that share them.

    A million rows of many columns would else lie in memory once for each candidate.
    """

    def __init__(self) -> None:
        self._values: FloatArray | None = None
        self._tables: dict[Dtype, npt.NDArray[np.generic]] = {}

    def table(self, values: FloatArray, prepared: Prepared) -> npt.NDArray[np.generic]:
        """Return the table of a graph whose columns are the model's inputs."""
        if values is not self._values:
            self._values, self._tables = values, {}
        key: Dtype = "float32" if prepared.dtype == "float32" else "float64"
        if key not in self._tables:
            self._tables[key] = prepared.table(values)
        return self._tables[key]


def own(
    model: Model, bounds: Bounds, layouts: Layouts
) -> tuple[list[Candidate], list[Omission]]:
    """Return a candidate for each runtime and each question that it can answer.

    Args:
        model: A tree or a rule base.
        bounds: Certifies the strengths of a rule base.
        layouts: Where sessions share their tables.

    Returns:
        The candidates, and the runtimes that are not installed.
    """
    found: list[Candidate] = []
    omitted: list[Omission] = []
    asked = questions(model)
    for runtime in all_runtimes():
        if not is_installed(runtime):
            why = f"not installed ({needed_by(runtime)})"
            omitted.append(Omission(runtime.name, why))
            continue
        for question, form in asked.items():
            kind = "rules" if isinstance(form, RuleBase) else "tree"
            if kind in runtime.runs:
                one = _candidate(runtime, question, form, bounds, layouts)
                found.append(one)
    return found, omitted


def _candidate(
    runtime: Runtime,
    question: Question,
    model: Model,
    bounds: Bounds,
    layouts: Layouts,
) -> Candidate:
    return Candidate(
        title(runtime.name, question),
        question,
        "runtime",
        partial(load_runtime, runtime, model, layouts),
        bound=partial(_bound, runtime, model, bounds),
        note=runtime.note,
        is_foreign=bool(runtime.modules),
        is_parallel=runtime.prepare is not None,
    )


def _bound(runtime: Runtime, model: Model, bounds: Bounds) -> Bound | None:
    """Return a certified bound of the strengths that a runtime decides by."""
    if not isinstance(model, RuleBase):
        return None
    certified = bounds(model, runtime.dtype)
    if runtime.bound is None or certified is None:
        return certified
    try:
        more, origin = runtime.bound(model)
    except ValueError:  # it cannot carry the model, as loading it will say
        return None
    return certified[0] + more, f"{certified[1]}, and {origin}"


def load_runtime(
    runtime: Runtime, model: Model, layouts: Layouts, threads: int
) -> Loaded:
    """Prepare a model in a runtime of the table.

    Of a graph only the session's call is timed. Others take the rows as they are;
    those of a rule base go through in blocks, whose strengths are thrown away: a
    million rows and a thousand rules would make 8 GB of them.
    """
    if runtime.prepare is not None:
        return session_of(runtime.prepare(model, threads=threads), model, layouts)
    run = runtime.load(model)
    block = _BLOCK
    if isinstance(model, RuleBase):
        block = max(1, min(_BLOCK, _BLOCK_NUMBERS // len(model.rules)))

    def call(values: FloatArray) -> Callable[[], object]:
        if not isinstance(model, RuleBase) or values.shape[1] <= block:
            return partial(run, values)
        starts = range(0, values.shape[1], block)
        parts = [values[:, start : start + block] for start in starts]
        return partial(_each, run, parts)

    size = None if runtime.size is None else runtime.size(model)
    return Loaded(partial(_found, run, model), call, size)


def _each(run: Callable[[FloatArray], object], parts: Sequence[FloatArray]) -> None:
    for part in parts:
        run(part)


def session_of(prepared: Prepared, model: Model, layouts: Layouts) -> Loaded:
    """Return a graph that was prepared from a model, as a candidate is loaded."""

    def call(values: FloatArray) -> Callable[[], object]:
        return partial(prepared.call, layouts.table(values, prepared))

    answer = partial(_found, prepared.run, model)
    return Loaded(answer, call, len(prepared.content))


def _found(
    run: Callable[[FloatArray], Outcome], model: Model, values: FloatArray
) -> Found:
    return found_of(run(np.ascontiguousarray(values)), model)


def found_of(outcome: Outcome, model: Model) -> Found:
    """Return a runtime's outcome as class numbers and strengths."""
    answers = answers_of(
        outcome,
        choices=model.classes,
        ends=[*_ends(model)],
        semantics=model.semantics,
        with_strengths=True,
    )
    return Found(answers.codes, outcome.strengths)


def _ends(model: Model) -> Iterator[str]:
    if isinstance(model, RuleBase):
        yield from (rule.then for rule in model.rules)
    else:
        yield from (leaf.label for leaf in model.leaves)

"""The reference evaluator of the onnx package, on the graphs that we write."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.benchmarking.candidates import found_of
from fuzzytree.benchmarking.records import CandidateOutput, LoadedCandidate
from fuzzytree.model.contracts import Model, Outcome
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.runtimes.onnxruntime import prepare

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_BLOCK = 1 << 16
_BLOCK_NUMBERS = 1 << 20  # strengths that are made at once


def load_evaluator(model: Model, threads: int) -> LoadedCandidate:
    """Prepare a graph in double for the evaluator: plain for trees, readable for rules.

    It executes the operators in numpy, one after another. Of a `TreeEnsemble` it walks
    each row in Python, so a tree comes as the graph without it.
    """
    from onnx.reference import ReferenceEvaluator

    if isinstance(model, RuleBase):
        prepared = prepare(model, readable=True)
        names = ["rule", "status", "strengths"]
    else:
        prepared = prepare(model, plain=True)
        names = ["rule", "status"]
    evaluator: Any = ReferenceEvaluator(prepared.content)

    block = _BLOCK
    if isinstance(model, RuleBase):
        block = max(1, min(block, _BLOCK_NUMBERS // len(model.rules)))

    def ask(table: Any) -> list[list[Any]]:
        """Return the outputs of some rows at a time."""
        found: list[list[Any]] = []
        with np.errstate(all="ignore"):
            for start in range(0, len(table), block):
                part = {"inputs": table[start : start + block]}
                found.append(evaluator.run(names, part))
        return found

    def answer(values: FloatArray) -> CandidateOutput:
        parts = zip(*ask(prepared.table(values)), strict=True)
        rule, status, *others = [np.concatenate(part) for part in parts]
        strengths = others[0].T.astype(np.float64) if others else None
        whole = (rule.astype(np.int64), status.astype(np.int64))
        return found_of(Outcome(*whole, strengths), model)

    def call(values: FloatArray) -> Callable[[], object]:
        return partial(ask, prepared.table(values))

    return LoadedCandidate(answer, call, len(prepared.content))

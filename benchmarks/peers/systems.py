"""Peers that run fuzzy systems: engines of others, each with the system as it reads it.

Their own answers are compared with ours: one that answers otherwise is shown with its
error.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.benchmarking.records import CandidateOutput, LoadedCandidate
from fuzzytree.exporters import find_format
from fuzzytree.model.system import FuzzySystem

if TYPE_CHECKING:
    from collections.abc import Callable

    from fuzzytree.model.contracts import FloatArray


def load_fuzzylite(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare a pyfuzzylite engine that reads the system as FLL.

    A row with a missing value is answered by us, as the engine knows none.

    Raises:
        LossError: If FLL cannot carry the system.
    """
    import fuzzylite as fl

    text = find_format("fll").write(system).content.decode("utf-8")
    engine = fl.FllImporter().from_string(text)

    def process(values: FloatArray) -> None:
        for variable, column in zip(engine.input_variables, values, strict=True):
            variable.value = column
        engine.restart()
        for variable, column in zip(engine.input_variables, values, strict=True):
            variable.value = column
        engine.process()

    def answer(values: FloatArray) -> CandidateOutput:
        with np.errstate(all="ignore"):
            process(values)
        shape = len(engine.output_variables), values.shape[1]
        outputs = np.empty(shape, np.float64)
        for line, variable in enumerate(engine.output_variables):
            outputs[line] = variable.value
        is_missing = ~np.isfinite(values).all(axis=0)
        outputs[:, is_missing] = np.nan
        is_none = np.isnan(outputs).any(axis=0)
        status = np.where(is_missing, 3, np.where(is_none, 2, 0))
        return CandidateOutput(status.astype(np.int64), None, outputs)

    def call(values: FloatArray) -> Callable[[], object]:
        return partial(process, values)

    return LoadedCandidate(answer, call, len(text))

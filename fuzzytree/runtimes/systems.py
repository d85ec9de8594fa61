"""Fuzzy systems on many rows: through the inference row by row, and through numpy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fuzzytree.model.contracts import SystemOutcome, SystemRun
from fuzzytree.model.system import FuzzySystem
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.programs.system_program import from_system

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray


def infer_rows(system: FuzzySystem, /, *, activations: bool = False) -> SystemRun:
    """Return a function that infers rows one after another.

    Args:
        system: The system.
        activations: Whether the degree of activation of each rule is wanted.
    """
    names = system.columns

    def run(values: FloatArray) -> SystemOutcome:
        import numpy as np

        from fuzzytree.runtimes.rows import checked

        table = checked(values, names).T.tolist()
        found = [infer(system, dict(zip(names, row, strict=True))) for row in table]
        outputs = np.array([one.outputs for one in found], np.float64)
        degrees = np.array([one.activations for one in found], np.float64)
        return SystemOutcome(
            outputs.reshape(len(found), len(system.outputs)).T,
            np.array([one.status for one in found], np.int64),
            degrees.reshape(len(found), len(system.rules)).T if activations else None,
        )

    return run


def run_system(system: FuzzySystem, /, *, activations: bool = False) -> SystemRun:
    """Return a function that runs a system's program in numpy.

    Args:
        system: The system.
        activations: Whether the degree of activation of each rule is wanted.

    Example:
        >>> import numpy as np
        >>> from fuzzytree.testing import random_system
        >>> run_system(random_system(3))(np.zeros((3, 2))).outputs.shape
        (2, 2)
    """
    from fuzzytree.runtimes.programs import plan_program, run_program
    from fuzzytree.runtimes.rows import checked

    program = from_system(system, activations=activations)
    plan = plan_program(program)
    outputs, rules = len(system.outputs), len(system.rules)

    def run(values: FloatArray) -> SystemOutcome:
        import numpy as np

        found = run_program(plan, checked(values, system.columns))
        return SystemOutcome(
            found[:outputs],
            found[-1].astype(np.int64),
            found[outputs : outputs + rules] if activations else None,
        )

    return run

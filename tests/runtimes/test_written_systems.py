"""Programs of fuzzy systems, each run by an engine of its language."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from fuzzytree.exporters import find_format
from fuzzytree.runtimes.programs import run_system
from fuzzytree.runtimes.written import ENGINES as RUNNERS
from fuzzytree.semantics.probing import system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.testing import random_system

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray
    from fuzzytree.model.system import FuzzySystem

ENGINES: dict[str, tuple[str, dict[str, Any]]] = {
    "python": ("python", {}),
    "javascript": ("javascript", {}),
    "c": ("c", {"activations": True}),
    "sqlite": ("sql", {"strengths": True}),
    "duckdb": ("sql", {"strengths": True, "dialect": "duckdb"}),
}


def values_of(system: FuzzySystem, limit: int) -> FloatArray:
    rows = system_probes(system, limit=limit)
    table = [[row[name] for name in system.inputs] for row in rows]
    return np.array(table).T


def within(system: FuzzySystem, values: FloatArray, numbers: FloatArray) -> int:
    """Compare outputs, status and activations, and return how many must be equal."""
    right = run_system(system)(values)
    assert right.outputs is not None
    assert right.strengths is not None
    status = right.status.reshape(1, -1).astype(np.float64)
    wanted = np.vstack([right.outputs, status, right.strengths])
    program = from_system(system, activations=True)
    kinds = [one.kind for one in program.results]
    order = [
        place
        for kind in ("output", "status", "activation")
        for place, one in enumerate(kinds)
        if one == kind
    ]
    bounds = error_bounds(program, values)[order]
    assert numbers.shape == wanted.shape
    with np.errstate(invalid="ignore"):
        gap = np.where(numbers == wanted, 0.0, np.abs(numbers - wanted))
    gap[np.isnan(numbers) & np.isnan(wanted)] = 0.0
    assert (gap <= bounds).all()
    return int((bounds == 0.0).sum())


@pytest.mark.one_in(2)
@pytest.mark.parametrize("engine", ENGINES)
def test_programs_have_the_numbers_of_the_native_runtime(engine: str) -> None:
    form, options = ENGINES[engine]
    if engine == "duckdb":
        pytest.importorskip("duckdb")
    program = {"javascript": "node", "c": "gcc"}.get(engine)
    if program and shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    exact = 0
    for seed in range(24):
        system = random_system(seed, formulas="wild" if seed % 4 == 3 else "tame")
        values = values_of(system, 60)
        content = find_format(form).write(system, **options).content
        result = RUNNERS[form](content, system, options, values).outcome
        status = result.status[np.newaxis].astype(np.float64)
        parts = result.outputs, status, result.strengths
        numbers = np.vstack([part for part in parts if part is not None])
        exact += within(system, values, numbers)
    assert exact > 9_000


def test_pmml_gives_the_outputs() -> None:
    pytest.importorskip("jpmml_evaluator")
    if shutil.which("java") is None:
        pytest.skip("java is not installed")
    system = random_system(3)
    values = values_of(system, 40)
    content = find_format("pmml").write(system).content
    outputs = RUNNERS["pmml"](content, system, {}, values).outcome.outputs
    assert outputs is not None
    right = run_system(system)(values).outputs
    assert right is not None
    np.testing.assert_allclose(outputs, right, rtol=1e-13, equal_nan=True)

"""The stability checks of fuzzy systems: sound ones pass, planted defects are found."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest

from fuzzytree.checking.stability.exactness import degenerate, edges, exactness, offsets
from fuzzytree.checking.stability.row_checks import (
    order,
    roundtrips,
    scaling,
    special_rows,
    specials,
)
from fuzzytree.checking.stability.sensitivity import stiffness
from fuzzytree.checking.stability.suite import examine
from fuzzytree.checking.stability.transforms import moved, scaled
from fuzzytree.exporters.table import all_formats, find_format
from fuzzytree.model.contracts import Runtime
from fuzzytree.model.system import FuzzySystem
from fuzzytree.report.stability import stability_lines
from fuzzytree.runtimes.table import all_runtimes, find_runtime
from fuzzytree.semantics.probing import probe_values
from fuzzytree.semantics.samples import all_samples
from tests.checking.stability import defects
from tests.checking.stability.test_suite import SCHEMA, failures

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

SYSTEMS = {k: m for k, m in all_samples().items() if isinstance(m, FuzzySystem)}
FAN = defects.mamdani()
SOUND = [find_runtime("reference"), defects.NATIVE]


@pytest.fixture(scope="module")
def rows() -> FloatArray:
    return probe_values(FAN, 200)


@pytest.mark.parametrize("name", ["Sugeno, formulas", "Mamdani, mean of maximum"])
def test_a_system_passes_every_check(name: str) -> None:
    study = examine(SYSTEMS[name], runtimes=SOUND, formats=all_formats())
    assert failures(study) == []
    jsonschema.validate(json.loads(study.to_json()), SCHEMA)
    passed = {one.code for one in study.criteria if one.verdict == "holds"}
    assert passed == {"N1", "N2", "N3", "N4", "N5", "N6", "N8", "N9"}


@pytest.mark.heavy
@pytest.mark.parametrize("name", [*SYSTEMS][::6])
def test_a_system_passes_every_check_in_every_runtime(name: str) -> None:
    study = examine(SYSTEMS[name], runtimes=all_runtimes(), formats=all_formats())
    assert failures(study) == []


@pytest.mark.parametrize(
    ("defect", "text"),
    [
        (defects.SINGLE, "rows are beyond the bound: heat "),
        (defects.OTHER_ORDER, "output 'fan' "),
        (defects.NO_DEFAULT, "output 'fan' nan where 7.5 is right"),
    ],
    ids=["float32", "order of sums", "default"],
)
def test_n8_finds_other_numbers(defect: Runtime, text: str, rows: FloatArray) -> None:
    model, values = FAN, rows
    if defect is defects.OTHER_ORDER:
        model = defects.sugeno()
        values = probe_values(model, 400)
    else:
        values = np.concatenate([rows, np.array([[60.0], [1e6]])], axis=1)
    result = exactness(model, [defect], values)
    assert result.verdict == "FAILS"
    assert text in result.detail[0]
    assert exactness(model, SOUND, values).verdict == "holds"


@pytest.mark.parametrize(
    ("defect", "text"),
    [
        (defects.ZEROS, "one of the outputs of a row with a missing value is a number"),
        (defects.NAN_IS_ZERO, "rows break the policy on missing values"),
        (defects.NO_DEFAULT, "output 'fan' nan where 7.5 is right"),
    ],
    ids=["NaN as 0", "missing as 0", "default"],
)
def test_n6_finds_a_number_that_is_lost_or_invented(
    defect: Runtime, text: str, rows: FloatArray
) -> None:
    result = specials(FAN, [defect], rows)
    assert result.verdict == "FAILS"
    assert text in " ".join(result.detail)
    assert specials(FAN, SOUND, rows).verdict == "holds"


def test_n6_tries_degrees_of_almost_0_and_sums_that_overflow(rows: FloatArray) -> None:
    tried = defects.NATIVE.load(FAN)(special_rows(FAN, rows)).strengths
    assert tried is not None
    tiny = tried[(tried > 0.0) & (tried < 1e-290)]
    assert tiny.size
    assert (tried == 0.0).all(axis=0).any()
    linear = SYSTEMS["Sugeno, linear"]
    table = special_rows(linear, probe_values(linear, 100))
    numbers = defects.NATIVE.load(linear)(table).outputs
    assert numbers is not None
    assert (np.abs(numbers) > 1e300).any()


def test_n1_n3_and_n5_find_defects_in_systems(rows: FloatArray) -> None:
    assert scaling(FAN, [defects.ABSOLUTE], rows).verdict == "FAILS"
    assert order(FAN, [defects.BATCH_MEAN], rows).verdict == "FAILS"
    assert edges(FAN, [defects.SINGLE]).verdict == "FAILS"
    assert offsets(FAN, [defects.SINGLE], np.empty((2, 0))).verdict == "FAILS"
    for result in (
        scaling(FAN, SOUND, rows),
        order(FAN, SOUND, rows),
        edges(FAN, SOUND),
        degenerate(FAN, SOUND),
    ):
        assert result.verdict == "holds"


def test_n9_finds_a_writer_of_six_digits_of_a_system(rows: FloatArray) -> None:
    thirds = moved(FAN, {"heat": 1 / 3})
    assert roundtrips(thirds, [defects.six_digits()], rows).verdict == "FAILS"
    assert roundtrips(thirds, [find_format("yaml")], rows).verdict == "holds"


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_scaled_system_answers_scaled_rows_alike(name: str) -> None:
    system = SYSTEMS[name]
    ks = {one: 11 - 30 * place for place, one in enumerate(system.inputs)}
    values = probe_values(system, 80)[:, :60]
    right = defects.NATIVE.load(system)(values).outputs
    factors = np.array([*ks.values()])[:, np.newaxis]
    after = defects.NATIVE.load(scaled(system, ks))(np.ldexp(values, factors))
    assert right is not None
    np.testing.assert_array_equal(after.outputs, right)


def test_a_flat_top_jumps_with_its_row_and_a_centroid_does_not() -> None:
    system = SYSTEMS["Mamdani, mean of maximum"]
    study = examine(system, runtimes=SOUND, formats=(), select=["N3"])
    jumps = [one.moves[0] for one in study.stiff if one.moves[0].changed]
    assert jumps
    assert all(one.step == "1 ulp" and one.largest > 1e-4 for one in jumps)
    text = "\n".join(stability_lines(study))
    assert f"of the range of {system.outputs[0].name}" in text
    assert jumps[0].row in text
    inside = np.random.default_rng(0).uniform(1.0, 9.0, (2, 300))
    for one in stiffness(FAN, inside, is_data=True):
        assert [move.changed for move in one.moves] == [0, 0]
        assert 0.0 < one.moves[1].largest < 1e-7

"""Which effect tells objects apart: the discriminants, and the effects themselves."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from experiment_tables import (
    EFFECTS,
    Effect,
    discriminate,
    effects,
)
from press_physics import PAPER
from press_shapes import OBJECTS

ANGLED = tuple(name for name in OBJECTS if "-" in name)


def test_every_effect_changes_settings_that_there_are() -> None:
    for changes in EFFECTS.values():
        assert (msgspec.structs.replace(PAPER, **changes) == PAPER) == (not changes)


def test_a_direction_without_scatter_is_left_out() -> None:
    first = np.array([[0.0, 7.0], [1.0, 7.0], [2.0, 7.0]])
    learnt = [first, first + np.array([10.0, 0.0])]
    rows = np.array([[5.9, 7.0], [6.1, 7.0], [0.0, 99.0]])
    assert discriminate(learnt, rows).tolist() == [0, 1, 0]


def test_discriminants_are_those_of_scikit_learn() -> None:
    found = pytest.importorskip("sklearn.discriminant_analysis")
    random = np.random.default_rng(4)
    mixed = random.standard_normal((5, 5))
    learnt = [random.standard_normal((40, 5)) @ mixed + place for place in (0, 1, 3)]
    rows = random.standard_normal((300, 5)) @ mixed + 1
    model = found.LinearDiscriminantAnalysis(priors=[1 / 3] * 3)
    model.fit(np.concatenate(learnt), np.repeat(range(3), 40))
    assert np.array_equal(discriminate(learnt, rows), model.predict(rows))


def test_one_press_of_each_is_too_few() -> None:
    with pytest.raises(ValueError, match="2 presses at least") as caught:
        next(effects(count=1))
    text = "2 presses at least are needed to learn from, not 1"
    assert str(caught.value) == text


@pytest.mark.heavy
def test_on_an_even_sensor_discriminants_see_no_angle_unless_places_are_fixed() -> None:
    found = {one.name: one for one in effects(count=100)}

    def angled(one: Effect) -> float:
        return sum(one.objects[name] for name in ANGLED) / len(ANGLED)

    assert angled(found["everything on"]) > 0.75
    for name in ("no cross-talk", "even sensor", "even and linear"):
        assert angled(found[name]) < 0.65
    assert angled(found["even, other gains"]) < 0.65
    assert angled(found["even, fixed places"]) > 0.9
    for one in found.values():
        assert min(one.objects["circle"], one.objects["square"]) > 0.9

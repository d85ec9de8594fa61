"""The change points of curves are separate, and one where two of them coincide."""

from __future__ import annotations

import itertools
from fractions import Fraction

from fuzzytree.auditing.engine.pieces import RuleCurve, places
from fuzzytree.model.rulebase import LR, Band
from fuzzytree.model.rulebase import Side as Half


def test_a_root_that_is_known_exactly_may_stand_beside_the_end_of_a_piece() -> None:
    shapes = (
        LR(1.0, Half(0.5, (-40.0,), 2.0), Half(0.25, (2.0, 2.0), 1.5)),
        Band(-0.25, 0.25, -0.5),
        LR(1.0, Half(0.5, (-2.0, -1.0), 1.5), Half(0.5, (-1.0, 0.5), 1.5)),
        LR(0.125, Half(0.25, (0.25, -2.0)), Half(1.0, (-2.0, 0.5))),
    )
    found = places([RuleCurve(shape) for shape in shapes])
    assert Fraction(9, 8) in {place.low for place in found}
    for before, after in itertools.pairwise(found):
        assert before.low <= before.high < after.low


def test_curves_that_touch_at_an_irrational_place_touch_at_one_place() -> None:
    # t c(2 t - 1) with c = 4 t - 4 t**3 has its largest value 1 where t**2 is 1/2, so
    # the curve 1 - t c(2 t - 1) touches 0 there.
    dips = Half(1.0, (1.5, 0.5, -1.5, -0.5))
    found = places([RuleCurve(LR(0.0, Half(1.0, (1.0,)), dips))])
    near = [place for place in found if 0.7 < place.low < 0.71]
    assert len(near) == 1
    assert near[0].of is not None
    assert near[0].of[1].is_sure
    assert near[0].low ** 2 < Fraction(1, 2) < near[0].high ** 2

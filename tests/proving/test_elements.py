"""Places of curves are told apart, also where two of them are the same."""

from __future__ import annotations

import itertools
from fractions import Fraction

from fuzzytree.proving.elements import Element, places
from fuzzytree.rulebase import LR, Band, Flank
from fuzzytree.rulebase import Side as Half


def test_a_root_that_is_known_exactly_may_stand_beside_the_end_of_a_piece() -> None:
    shapes = (
        LR(1.0, Half(0.5, (-40.0,), 2.0), Half(0.25, (2.0, 2.0), 1.5)),
        Band(-0.25, 0.25, Flank(0.0, -0.5, (0.5, 0.5))),
        LR(1.0, Half(0.5, (-2.0, -1.0), 1.5), Half(0.5, (-1.0, 0.5), 1.5)),
        LR(0.125, Half(0.25, (0.25, -2.0)), Half(1.0, (-2.0, 0.5))),
    )
    found = places([Element(shape) for shape in shapes])
    assert Fraction(9, 8) in {place.low for place in found}
    for before, after in itertools.pairwise(found):
        assert before.low <= before.high < after.low

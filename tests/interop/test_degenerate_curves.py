"""Curves whose numbers are out of order or without width, as each engine has them.

Octave and pyfuzzylite are run; MATLAB follows its documentation, and jFuzzyLogic and
JFML their public sources. The values are those of `X`; None: the engine refuses.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from importlib import import_module
from typing import NamedTuple

import numpy as np
import pytest

from fuzzytree.formats.fcl.fcl_terms import FCL_SHAPES
from fuzzytree.formats.fis.fis_words import FIS_KINDS
from fuzzytree.formats.fml.fml_words import SHAPES
from fuzzytree.formats.shapes import Engine
from fuzzytree.formats.words import FunctionWords, function_words
from fuzzytree.semantics import curve_degree
from tests.interop.conftest import Need

X = (0.5, 1.0, 2.0, 3.0, 3.5)
Degrees = tuple[float, ...] | None


class Case(NamedTuple):
    """A curve in one engine: its word and numbers there, and its degrees."""

    engine: Engine
    word: str
    numbers: tuple[float, ...]
    degrees: Degrees


def _sigmoid(slope: float, inflection: float) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-slope * (np.array(X) - inflection)))


_FALLING = _sigmoid(2.0, 3.0) - _sigmoid(2.0, 1.0)
"""A difference of sigmoids that is negative everywhere."""
NEGATIVE = tuple((0.0 * _FALLING).tolist())
SIZE = tuple(np.abs(_FALLING).tolist())
CROSSED = tuple(
    np.where(np.array(X) <= 3.0, np.exp(-((np.array(X) - 3.0) ** 2) / 2.0), 1.0)
    * np.where(np.array(X) > 1.0, np.exp(-((np.array(X) - 1.0) ** 2) / 2.0), 1.0)
)
STEP_AT_2 = (0.0, 0.0, 1.0, 1.0, 1.0)
STEP_BEHIND_2 = (0.0, 0.0, 0.0, 1.0, 1.0)
STEP_BEHIND_3 = (0.0, 0.0, 0.0, 0.0, 1.0)
SPIKE_AT_2 = (0.0, 0.0, 1.0, 0.0, 0.0)
FROM_1_TO_3 = (0.0, 1.0, 1.0, 1.0, 0.0)


def _not(degrees: Sequence[float]) -> tuple[float, ...]:
    return tuple(1.0 - one for one in degrees)


TABLE = [
    Case("matlab", "smf", (3, 1), STEP_AT_2),
    Case("octave", "smf", (3, 1), None),
    Case("fuzzylite", "SShape", (3, 1), STEP_BEHIND_3),
    Case("jfml", "sShape", (3, 1), STEP_BEHIND_3),
    Case("matlab", "smf", (2, 2), STEP_AT_2),
    Case("octave", "smf", (2, 2), None),
    Case("fuzzylite", "SShape", (2, 2), STEP_BEHIND_2),
    Case("jfml", "sShape", (2, 2), STEP_BEHIND_2),
    Case("matlab", "zmf", (3, 1), (1.0, 1.0, 1.0, 0.0, 0.0)),
    Case("octave", "zmf", (3, 1), None),
    Case("fuzzylite", "ZShape", (3, 1), _not(STEP_BEHIND_3)),
    Case("jfml", "zShape", (3, 1), _not(STEP_BEHIND_3)),
    Case("fuzzylite", "ZShape", (2, 2), _not(STEP_BEHIND_2)),
    Case("matlab", "trimf", (2, 2, 2), SPIKE_AT_2),
    Case("fuzzylite", "Triangle", (2, 2, 2), SPIKE_AT_2),
    Case("jfuzzylogic", "TRIAN", (2, 2, 2), SPIKE_AT_2),
    Case("octave", "trimf", (3, 2, 1), None),
    Case("matlab", "trapmf", (1, 1, 3, 3), FROM_1_TO_3),
    Case("fuzzylite", "Trapezoid", (1, 1, 3, 3), FROM_1_TO_3),
    Case("jfuzzylogic", "TRAPE", (1, 1, 3, 3), FROM_1_TO_3),
    Case("octave", "trapmf", (1, 3, 2, 4), None),
    Case("fuzzylite", "Rectangle", (3, 1), FROM_1_TO_3),
    Case("fuzzylite", "Ramp", (3, 1), (1.0, 1.0, 0.5, 0.0, 0.0)),
    Case("matlab", "dsigmf", (2, 3, 2, 1), SIZE),
    Case("octave", "dsigmf", (2, 3, 2, 1), NEGATIVE),
    Case("fuzzylite", "SigmoidDifference", (3, 2, 2, 1), SIZE),
    Case("jfuzzylogic", "DSIGM", (2, 3, 2, 1), NEGATIVE),
    Case("matlab", "gauss2mf", (1, 3, 1, 1), CROSSED),
    Case("octave", "gauss2mf", (1, 3, 1, 1), CROSSED),
    Case("fuzzylite", "GaussianProduct", (3, 1, 1, 1), CROSSED),
    Case("jfuzzylogic", "GAUSS2", (3, 1, 1, 1), None),
    Case("octave", "gbellmf", (0, 2, 2), None),
    Case("octave", "gbellmf", (1, 0, 2), (0.5,) * 5),
    Case("fuzzylite", "Bell", (2, 1, 0), (0.5,) * 5),
]
WORDS: dict[Engine, FunctionWords] = {
    "matlab": FIS_KINDS,
    "octave": FIS_KINDS,
    "fuzzylite": function_words("fll"),
    "jfuzzylogic": FCL_SHAPES,
    "jfml": SHAPES,
}


def degrees_here(case: Case) -> Degrees:
    """Return the degrees of a case as our readers have it."""
    numbers = [float(one) for one in case.numbers]
    try:
        curve = WORDS[case.engine][case.word].make(numbers, case.engine)
    except ValueError:
        return None
    if next(curve.mistakes(), None):
        return None
    return tuple(curve_degree(curve, x) for x in X)


@pytest.mark.parametrize("case", TABLE, ids=lambda one: f"{one.engine} {one.word}")
def test_a_curve_out_of_order_is_that_of_its_engine(case: Case) -> None:
    found = degrees_here(case)
    if case.degrees is None:
        assert found is None
    else:
        assert found == pytest.approx(case.degrees, abs=1e-15)


def test_the_table_says_what_octave_answers(program: Need) -> None:
    cases = [one for one in TABLE if one.engine == "octave"]
    lines = ["pkg load fuzzy-logic-toolkit"]
    for one in cases:
        call = f"evalmf ({list(X)}, {list(one.numbers)}, '{one.word}')"
        lines.append(f"try\n printf ('%.17g ', {call}); puts (\"\\n\");")
        lines.append('catch\n puts ("refused\\n");\nend_try_catch')
    words = [program("octave"), "--no-gui", "--quiet", "--eval", "\n".join(lines)]
    printed = subprocess.check_output(words, text=True, timeout=120)
    answers = [line for line in printed.splitlines() if line[:1] in "r-0123456789"]
    assert len(answers) == len(cases)
    for one, answer in zip(cases, answers, strict=True):
        if one.degrees is None:
            assert answer == "refused", one
        else:
            found = [float(word) for word in answer.split()]
            assert found == pytest.approx(one.degrees, abs=1e-15), one


def test_the_table_says_what_pyfuzzylite_answers(library: Need) -> None:
    fl = import_module(library("fuzzylite"))
    for one in TABLE:
        if one.engine == "fuzzylite":
            term = getattr(fl, one.word)("term", *map(float, one.numbers))
            found = np.asarray(term.membership(np.array(X)), np.float64)
            assert found == pytest.approx(np.array(one.degrees), abs=1e-15), one

"""Models whose curves are lines already, as points: what loses nothing."""

from __future__ import annotations

from typing import TypeVar, get_args

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import LR, Band, RuleBase
from fuzzytree.model.system import Curve, FuzzySystem
from fuzzytree.semantics.conversion.points import pointed

_COARSE = 0.01  # lines become the same points for every tolerance

D = TypeVar("D", RuleBase, FuzzySystem)


def straightened(model: D) -> D | None:
    """Return a model whose straight flanks are points, if that loses nothing.

    The points are within 2^-52 of the degrees. Where another curve would be lost, or
    there is nothing to change, it is None.

    Example:
        >>> from fuzzytree.model.rulebase import Flank, Rule, Term, Variable
        >>> ramp = Term("low", Band(high=1.0, right=Flank(1.0, 3.0)))
        >>> rules = RuleBase("a", ("x",), (Variable("p", (ramp,)),), (Rule((), "x"),))
        >>> straightened(rules).variables[0].terms[0].shape.values
        (1.0, 1.0, 3.0)
    """
    others = tuple(kind for kind in get_args(Curve) if kind not in (Band, LR))
    try:
        found, losses = pointed(model, _COARSE, allowed=others)
    except LossError:
        return None
    return None if losses or found == model else found

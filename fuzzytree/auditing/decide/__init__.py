"""The decider: one question about rules, answered by a proof, a point, or not.

In reading order:

The question
    - `answers`: the question, its three answers, the budget in steps
    - `domain`, `states`: where rows lie; how an audit states an answer
    - `lines`, `rules`, `axes`: degrees as lines; rules of any model; axes with both
    - `base`: rules on a domain, their exact strengths, points that are drawn

Ways to decide
    - `decider`: which method decides a question
    - `levels`: the minimum; `solver`: z3
    - `boxes`, `stretches`, `bounds`: products and curves, in doubles
    - `linear`, `polytopes`, `regions`: linear inequalities, the leaves of a tree

Claims
    - `claims`, `pairs`, `cover`: of rules, of two rules, of gaps
    - `nearest`, `contest`, `costs`: the nearest change of a row
    - `outputs`, `measures`: outputs of systems on boxes; heights, areas and distances
"""

from fuzzytree.auditing.decide.answers import (
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.boxes import Boxes, search_boxes
from fuzzytree.auditing.decide.decider import Decider, decide
from fuzzytree.auditing.decide.outputs import NotBoundedError, OutputBounds, scale_of
from fuzzytree.auditing.decide.rules import BaseRule, LeftOut, Literal

__all__ = [
    "Answer",
    "Base",
    "BaseRule",
    "Boxes",
    "Budget",
    "Decider",
    "LeftOut",
    "Literal",
    "NotBoundedError",
    "Open",
    "OutOfStepsError",
    "OutputBounds",
    "Point",
    "Proved",
    "Question",
    "decide",
    "scale_of",
    "search_boxes",
]

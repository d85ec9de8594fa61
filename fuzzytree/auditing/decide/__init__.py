"""The decider: one question about rules, answered by a proof, a point, or not."""

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

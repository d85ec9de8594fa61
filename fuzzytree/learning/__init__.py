"""The paper's learner, a module for each of its sections."""

from __future__ import annotations

from fuzzytree.learning.findings import LearningReport
from fuzzytree.learning.learner import Learner, Learnt, learn_arrays
from fuzzytree.learning.settings import Settings
from fuzzytree.learning.statistics import Statistics

__all__ = [
    "Learner",
    "LearningReport",
    "Learnt",
    "Settings",
    "Statistics",
    "learn_arrays",
]

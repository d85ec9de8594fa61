"""The paper's learner, a module for each of its sections."""

from __future__ import annotations

from fuzzytree.learning.findings import LearningReport
from fuzzytree.learning.learner import Learner, Learnt, learn_arrays
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.statistics import Statistics

__all__ = [
    "Learner",
    "LearningReport",
    "LearningSettings",
    "Learnt",
    "Statistics",
    "learn_arrays",
]

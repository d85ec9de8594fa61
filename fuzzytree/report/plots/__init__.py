"""Pictures of results: one function for each, which returns a figure."""

from __future__ import annotations

from fuzzytree.report.plots.precision import work_precision
from fuzzytree.report.plots.sheet import SUFFIXES, save
from fuzzytree.report.plots.trees import draw_tree

__all__ = [
    "SUFFIXES",
    "draw_tree",
    "save",
    "work_precision",
]

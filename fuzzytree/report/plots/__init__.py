"""Pictures of results: one function for each, which returns a figure."""

from __future__ import annotations

from fuzzytree.report.plots.precision import work_precision
from fuzzytree.report.plots.sheet import SUFFIXES, save

__all__ = [
    "SUFFIXES",
    "save",
    "work_precision",
]

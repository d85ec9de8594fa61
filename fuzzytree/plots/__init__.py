"""Pictures of results: one function for each, which returns a figure."""

from __future__ import annotations

from fuzzytree.plots.offsets import error_against_offset
from fuzzytree.plots.precision import work_precision
from fuzzytree.plots.saving import SUFFIXES, save

__all__ = ["SUFFIXES", "error_against_offset", "save", "work_precision"]

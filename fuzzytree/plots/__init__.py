"""Pictures of results: one function for each, which returns a figure."""

from __future__ import annotations

from fuzzytree.plots.confusion import draw_confusion
from fuzzytree.plots.frames import draw_frames
from fuzzytree.plots.offsets import error_against_offset
from fuzzytree.plots.precision import work_precision
from fuzzytree.plots.saving import SUFFIXES, save
from fuzzytree.plots.trees import draw_tree

__all__ = [
    "SUFFIXES",
    "draw_confusion",
    "draw_frames",
    "draw_tree",
    "error_against_offset",
    "save",
    "work_precision",
]

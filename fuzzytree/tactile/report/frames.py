"""A check of frames, as plain text."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.report.text import agreement_lines, counted
from fuzzytree.tactile.recognition.agreement import FramesAgreement


def check_lines(found: FramesAgreement, *, is_full: bool = False) -> Iterator[str]:
    """Yield a check of frames: the table, and what the frames show."""
    yield from agreement_lines(found, is_full=is_full)
    shown = found.shown
    yield (
        f"of {counted(shown.frames, 'frame')}, {shown.aimed} aimed at bounds and cuts, "
        f"{shown.nothing} show nothing, {shown.unknown} nothing known, "
        f"{shown.saturated} a cell that takes no more, {shown.ties} a tie"
    )
    yield (
        f"largest error of a feature against {found.comparisons[0].against}: "
        f"{found.largest_error:.2g} of its scale"
    )

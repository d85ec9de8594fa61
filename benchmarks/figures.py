"""Figures by matplotlib as SVG files; the same figure gives the same bytes."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Generator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE = 8.0
"""Of letters, in points."""

# Letters are drawn as paths, so an SVG looks alike where a font is missing, and the
# names of its parts come from a fixed salt instead of chance.
_SETTINGS: Any = {"svg.hashsalt": "fuzzytree", "svg.fonttype": "path"}


@contextlib.contextmanager
def style() -> Generator[None]:
    """Draw by the library's own defaults, whatever the user's settings are."""
    import matplotlib as mpl
    from matplotlib import style as styles

    with styles.context("default"), mpl.rc_context(_SETTINGS):
        yield


def drawn(figure: Figure) -> bytes:
    """Return a figure as the content of an SVG file, without a date."""
    content = io.BytesIO()
    with style():
        figure.savefig(content, format="svg", metadata={"Date": None, "Creator": None})
    return content.getvalue()

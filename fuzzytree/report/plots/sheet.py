"""Pictures by matplotlib as SVG or PNG files; the same picture gives the same bytes."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.files import PathLike, write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".svg", ".png")
"""What a picture's file name can end in."""

DOTS = 200
"""Dots per inch of a PNG: a figure eight inches wide has 1,600 of them."""

# Letters are drawn as paths, so an SVG looks alike where a font is missing, and the
# names of its parts come from a fixed salt instead of chance.
_SETTINGS: Any = {"svg.hashsalt": "fuzzytree", "svg.fonttype": "path"}


@contextlib.contextmanager
def style() -> Generator[None]:
    """Draw by the library's own defaults, whatever the user's settings are.

    Raises:
        MissingExtraError: If matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError(f"drawing pictures needs {install_hint('plots')}")
    import matplotlib as mpl
    from matplotlib import style as styles

    with styles.context("default"), mpl.rc_context(_SETTINGS):
        yield


def save(figure: Figure, path: PathLike) -> None:
    """Write a figure as SVG or PNG, by the suffix of the file's name.

    The file has no date and no program's name in it, and takes the old one's place
    only when it is whole.

    Raises:
        ValueError: If the suffix is neither.
        WriteError: If the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        name = os.fspath(path)
        raise ValueError(f"{name}: a picture's name ends in {' or '.join(SUFFIXES)}")
    write_atomically(path, drawn(figure, suffix))


def drawn(figure: Figure, suffix: str) -> bytes:
    """Return a figure as the content of a file with that suffix."""
    content = io.BytesIO()
    nothing: dict[str, Any] = {"Date": None, "Creator": None}
    if suffix == ".png":
        nothing = {"Software": None}
    with style():
        figure.savefig(content, format=suffix[1:], dpi=DOTS, metadata=nothing)
    return content.getvalue()


SIZE = 8.0
"""Of letters, in points."""


def short(text: str, longest: int) -> str:
    """Return a text in one line; what is longer than `longest` letters is cut.

    Example:
        >>> short("a hand  in 45 degrees", 10)
        'a hand in…'
    """
    text = " ".join(text.split())
    return text if len(text) <= longest else f"{text[: longest - 1].rstrip()}…"

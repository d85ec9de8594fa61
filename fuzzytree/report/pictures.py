"""A picture in a file of its own: as SVG, and as PNG where the extra is installed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.files import PathLike, write_atomically
from fuzzytree.report.markup import Markup, mark

SUFFIXES = (".svg", ".png")
"""What a picture's file name can end in."""

_ZOOM = 2.0  # dots of a PNG for each point of its picture
_STYLE = """
text { font: 12px system-ui, sans-serif; fill: #1b1c1e; }
.small { font-size: 10.5px; fill: #595d66; }
.strong { font-size: 13px; font-weight: 600; }
"""  # in a file of its own no page says how a picture looks


class Picture(NamedTuple):
    """A picture that a notebook shows: the content of an SVG file."""

    svg: str

    def _repr_svg_(self) -> str:
        """Return what a notebook shows."""
        return self.svg

    def content(self, suffix: str) -> bytes:
        """Return the content of a file with that suffix: the same bytes each time.

        Raises:
            MissingExtraError: If a PNG is wanted and the extra is not installed.
        """
        if suffix == ".svg":
            return self.svg.encode()
        check_suffix(suffix)
        # Not every computer has fonts, and few have the same: letters come from one.
        resvg, roboto = import_module("resvg_py"), import_module("font_roboto")
        content: bytes = resvg.svg_to_bytes(
            svg_string=self.svg,
            zoom=_ZOOM,
            font_files=[roboto.Roboto, roboto.RobotoBold],
            font_family="Roboto",
            sans_serif_family="Roboto",
        )
        return content

    def save(self, path: PathLike) -> None:
        """Write the picture as SVG or PNG, by the suffix of the file's name.

        Raises:
            ValueError: If the name ends otherwise.
            MissingExtraError: As `content`.
            WriteError: If the file cannot be written.
        """
        suffix = Path(path).suffix.lower()
        if suffix not in SUFFIXES:
            known = " or ".join(SUFFIXES)
            raise ValueError(f"{os.fspath(path)}: a picture's name ends in {known}")
        write_atomically(path, self.content(suffix))


def check_suffix(suffix: str) -> None:
    """Refuse a picture that cannot be written here.

    Raises:
        MissingExtraError: If it is a PNG and the extra is not installed.
    """
    if suffix != ".png":
        return
    try:
        import_module("resvg_py")
        import_module("font_roboto")
    except ImportError as error:
        raise MissingExtraError(f"a PNG needs {install_hint('plots')}") from error


def picture(
    marks: Sequence[Markup], wide: float, high: float, title: str, rules: str
) -> Picture:
    """Return marks as a picture of its own, of that size in points.

    Args:
        marks: What is drawn, in order.
        wide: The width, in points.
        high: The height, in points.
        title: What readers of a screen say of it.
        rules: How the marks look, in CSS, beside words that are small or strong.
    """
    drawn = [mark("style", Markup(_STYLE + rules)), *marks]
    space = "http://www.w3.org/2000/svg"
    return Picture(f"{mark('svg', wide, high, 'picture', title, '', drawn, space)}\n")

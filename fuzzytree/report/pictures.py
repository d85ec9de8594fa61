"""A picture in a file of its own: as SVG, and as PNG where the extra is installed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.files import PathLike, write_atomically
from fuzzytree.report.markup import Markup, mark, source

SUFFIXES = (".svg", ".png")
"""What a picture's file name can end in."""

_ZOOM = 2.0  # dots of a PNG for each point of its picture
_COLOURS = 10  # of classes; more than ten share them
_CLASS_COLOUR = re.compile(r"var\(--k(?:, (var\(--\w+\)))?\)")


class Picture(NamedTuple):
    """A picture that a notebook shows: the content of an SVG file."""

    svg: str

    def __repr__(self) -> str:
        """Show how large the picture is; `svg` is its text."""
        return f"Picture({len(self.svg.encode())} bytes)"

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


def class_mark(code: int) -> str:
    """Return the name of a class's colour in the style of pictures and pages."""
    return f"k{code % _COLOURS}"


def picture(
    marks: Sequence[Markup],
    wide: float,
    high: float,
    title: str,
    rules: str = "",
    about: str = "",
) -> Picture:
    """Return marks as a picture of its own, of that size in points.

    Args:
        marks: What is drawn, in order.
        wide: The width, in points.
        high: The height, in points.
        title: What readers of a screen say of it.
        rules: How the marks look, in CSS, a rule a line, beside `pictures.css`.
        about: What readers of a screen say next.
    """
    content = Markup("").join(marks)
    content = mark("style", Markup(_style(rules, content))) + content
    space = "http://www.w3.org/2000/svg"
    svg = mark("svg", wide, high, "picture", title, about, [content], space)
    return Picture(f"{svg}\n")


def _style(rules: str, content: str) -> str:
    """Return the style of marks in light, and what is else in dark.

    Not every reader of SVG knows variables: each is replaced by its colour.
    """
    palettes, looks = source("pictures.css").split("/* marks */\n")
    light, dark = (
        dict(re.findall(r"(--\w+): (#\w+)", part)) for part in palettes.split("@media")
    )
    used = {*" ".join(re.findall(r'class="([^"]*)"', content)).split(), "ground"}
    lines = [*_lines(looks + rules, used)]
    at_night = [_with_colours(line, dark) for line in lines if "var(" in line]
    begin = "@media screen and (prefers-color-scheme: dark) {"
    return "\n".join(
        [*(_with_colours(line, light) for line in lines), begin, *at_night, "}"]
    )


def _lines(rules: str, used: Set[str]) -> Iterator[str]:
    """Yield the rules of some marks, what has a class's colour once for each."""
    for line in rules.splitlines():
        selector, _, looks = line.partition(" {")
        if not used >= {*re.findall(r"\.(\w[\w-]*)", selector)}:
            continue
        plain = _CLASS_COLOUR.sub(r"\1", line)
        yield plain
        for code in range(_COLOURS if plain != line else 0):
            if class_mark(code) in used:
                own = _CLASS_COLOUR.sub(f"var(--c{code})", looks)
                yield f"{selector}.{class_mark(code)} {{{own}"


def _with_colours(line: str, colours: Mapping[str, str]) -> str:
    return re.sub(r"var\((--\w+)\)", lambda match: colours[match[1]], line)

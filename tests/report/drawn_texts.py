"""The texts of a picture with the room that they need."""

from __future__ import annotations

import itertools
import re
from typing import NamedTuple
from xml.etree import ElementTree

SIZES = {"strong": 13.0, "term": 11.0, "name": 11.0, "small": 10.5}
WIDE = 0.6  # of a letter on average, in sizes of its font: that of DejaVu Sans


class DrawnText(NamedTuple):
    """A text of a picture, and the box that it covers: left, top, right, bottom."""

    words: str
    box: tuple[float, float, float, float]


def texts_of(svg: str) -> list[DrawnText]:
    """Return all texts of a picture, which must be well-formed XML."""
    texts: list[DrawnText] = []
    todo = [(ElementTree.fromstring(svg), 0.0, 0.0)]
    while todo:
        part, left, top = todo.pop()
        move = re.match(r"translate\(([-\d.]+) ([-\d.]+)\)", part.get("transform", ""))
        if move:
            left, top = left + float(move[1]), top + float(move[2])
        if part.tag.endswith("text") and "rotate" not in part.get("transform", ""):
            words = part.text or ""
            size = min(
                SIZES.get(k, 12.0) for k in part.get("class", "").split() or [""]
            )
            wide = WIDE * size * len(words)
            shift = {"start": 0.0, "middle": 0.5, "end": 1.0}
            at = (
                left
                + float(part.get("x", 0))
                - wide * shift[part.get("text-anchor", "start")]
            )
            base = top + float(part.get("y", 0))
            box = (at, base - 0.75 * size, at + wide, base + 0.2 * size)
            texts.append(DrawnText(words, box))
        if "rotate" not in part.get("transform", ""):
            todo += [(below, left, top) for below in reversed(part)]
    return texts


def assert_apart(texts: list[DrawnText]) -> None:
    """Fail if two texts cover each other."""
    for one, other in itertools.combinations(texts, 2):
        a, b = one.box, other.box
        is_apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert is_apart, f"{one} {other}"

"""Elements of XML and their text, which is written without recursion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"}
_IN_ATTRIBUTES = {**_ESCAPES, '"': "&quot;", "\t": "&#9;", "\n": "&#10;"}
_DEEPEST = 20  # levels that are indented further than the one above


class XmlElement(NamedTuple):
    """An element of XML, with attributes, and with children or a text."""

    tag: str
    attributes: dict[str, str]
    children: tuple[XmlElement, ...] = ()
    text: str = ""


def element(tag: str, *children: XmlElement, **attributes: str | None) -> XmlElement:
    """Return an element; attributes that are None are left out.

    Example:
        >>> print(text_of(element("Node", element("True"), id="1", score=None)))
        <Node id="1">
          <True/>
        </Node>
    """
    known = {name: text for name, text in attributes.items() if text is not None}
    return XmlElement(tag, known, children)


def text_element(tag: str, text: str, **attributes: str | None) -> XmlElement:
    """Return an element with a text."""
    return element(tag, **attributes)._replace(text=text)


def text_of(root: XmlElement) -> str:
    """Return an element as text, a line for each."""
    return "\n".join(_lines(root))


def _lines(root: XmlElement) -> Iterator[str]:
    todo: list[tuple[int, XmlElement | str]] = [(0, root)]
    while todo:
        depth, one = todo.pop()
        indent = "  " * min(depth, _DEEPEST)
        if isinstance(one, str):
            yield f"{indent}</{one}>"
            continue
        attributes = "".join(
            f' {name}="{_escaped(text, _IN_ATTRIBUTES)}"'
            for name, text in one.attributes.items()
        )
        if one.children:
            yield f"{indent}<{one.tag}{attributes}>"
            todo.append((depth, one.tag))
            todo += [(depth + 1, child) for child in reversed(one.children)]
        elif one.text:
            text = _escaped(one.text, _ESCAPES)
            yield f"{indent}<{one.tag}{attributes}>{text}</{one.tag}>"
        else:
            yield f"{indent}<{one.tag}{attributes}/>"


def _escaped(text: str, escapes: Mapping[str, str]) -> str:
    return "".join(escapes.get(character, character) for character in text)

"""Elements of PMML: XML that is written without recursion, and its expressions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

_ESCAPES = {
    "&": "&amp;",
    "<": "&lt;",
    ">": "&gt;",
    '"': "&quot;",
    "\t": "&#9;",
    "\n": "&#10;",
    "\r": "&#13;",
}
_DEEPEST = 20  # levels that are indented further than the one above


class Element(NamedTuple):
    """An element of XML, with attributes, and with children or a text."""

    tag: str
    attributes: dict[str, str]
    children: tuple[Element, ...] = ()
    text: str = ""


def element(tag: str, *children: Element, **attributes: str | None) -> Element:
    """Return an element; attributes that are None are left out.

    Example:
        >>> print(text_of(element("Node", element("True"), id="1", score=None)))
        <Node id="1">
          <True/>
        </Node>
    """
    given = {name: text for name, text in attributes.items() if text is not None}
    return Element(tag, given, children)


def text_of(root: Element) -> str:
    """Return an element as text, a line for each."""
    return "\n".join(_lines(root))


def _lines(root: Element) -> Iterator[str]:
    todo: list[tuple[int, Element | str]] = [(0, root)]
    while todo:
        depth, one = todo.pop()
        indent = "  " * min(depth, _DEEPEST)
        if isinstance(one, str):
            yield f"{indent}</{one}>"
            continue
        attributes = "".join(
            f' {name}="{_escaped(text)}"' for name, text in one.attributes.items()
        )
        if one.children:
            yield f"{indent}<{one.tag}{attributes}>"
            todo.append((depth, one.tag))
            todo += [(depth + 1, child) for child in reversed(one.children)]
        elif one.text:
            yield f"{indent}<{one.tag}{attributes}>{_escaped(one.text)}</{one.tag}>"
        else:
            yield f"{indent}<{one.tag}{attributes}/>"


def _escaped(text: str) -> str:
    return "".join(_ESCAPES.get(character, character) for character in text)


def constant(value: float) -> Element:
    """Return a number of an expression."""
    return Element("Constant", {"dataType": "double"}, (), repr(float(value)))


def ref(name: str) -> Element:
    """Return the value of a field, or of a parameter of a function."""
    return Element("FieldRef", {"field": name})


def apply(function: str, *arguments: Element) -> Element:
    """Return a function of some expressions."""
    return Element("Apply", {"function": function}, arguments)


def derived(name: str, expression: Element) -> Element:
    """Return a field that is computed."""
    return element(
        "DerivedField", expression, name=name, optype="continuous", dataType="double"
    )


def joined(function: str, parts: list[Element]) -> Element:
    """Return a function of as many expressions as there are; one stays itself."""
    return parts[0] if len(parts) == 1 else apply(function, *parts)

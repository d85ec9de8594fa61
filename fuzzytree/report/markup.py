"""HTML from values: whatever is no markup yet is escaped where it enters one."""

from __future__ import annotations

import html
from collections.abc import Iterable

from markupsafe import Markup as Markup

from fuzzytree.model import printable

MOST_LETTERS = 400
"""Of one text on a page; a longer one is cut, and says how long it is."""

_VOID = frozenset({"br", "meta"})
_DRAWN = frozenset({"circle", "line", "path", "rect", "use"})


Content = str | None
"""A `Markup`, a text that will be escaped, or nothing."""

Attribute = str | float | bool | None


def text(words: str) -> Markup:
    r"""Return words as markup: invisible characters escaped, long texts cut.

    Example:
        >>> print(text("soft <b>" + chr(27)))
        soft &lt;b&gt;\x1b
    """
    if len(words) > MOST_LETTERS:
        words = f"{words[:MOST_LETTERS]}… ({len(words)} characters)"
    return Markup(html.escape(printable(words)))


def text_lines(lines: Iterable[str]) -> Markup:
    """Return lines as markup, each ended by a line break but the last."""
    return Markup("\n".join(map(text, lines)))


def joined(parts: Iterable[Content], between: str = "") -> Markup:
    """Return parts one after another, with escaped words between them."""
    kept = [part if isinstance(part, Markup) else text(part) for part in parts if part]
    return Markup(text(between).join(kept))


def tag(name: str, *children: Content, **attributes: Attribute) -> Markup:
    """Return an element.

    Args:
        name: Its name.
        children: What stands in it; texts are escaped.
        attributes: By name, `_` for `-`, a last `_` left out. None and False leave an
            attribute out, True gives it no value.

    Example:
        >>> print(tag("a", "R & D", href="#one", class_="link"))
        <a href="#one" class="link">R &amp; D</a>
    """
    shown = "".join(_attribute(key, value) for key, value in attributes.items())
    if name in _VOID:
        return Markup(f"<{name}{shown}>")
    inner = joined(children)
    if name in _DRAWN and not inner:
        return Markup(f"<{name}{shown}/>")
    return Markup(f"<{name}{shown}>{inner}</{name}>")


def _attribute(key: str, value: Attribute) -> str:
    if value is None or value is False:
        return ""
    name = key.rstrip("_").replace("_", "-")
    if value is True:
        return f" {name}"
    if not isinstance(value, str):
        return f' {name}="{trimmed(value)}"'
    shown = value if isinstance(value, Markup) else text(value)
    return f' {name}="{shown}"'


def trimmed(value: float) -> str:
    """Return a number of points of a picture, with one decimal at most.

    Example:
        >>> trimmed(12.0), trimmed(-0.04), trimmed(3.25)
        ('12', '0', '3.2')
    """
    shown = f"{value:.1f}".removesuffix(".0")
    return "0" if shown == "-0" else shown

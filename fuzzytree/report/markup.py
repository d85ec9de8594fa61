"""HTML from values: whatever is no markup yet is escaped where it enters one."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from fuzzytree.model import printable

MOST_LETTERS = 400
"""Of one text on a page; a longer one is cut, and says how long it is."""

_VOID = frozenset({"br", "meta"})
_DRAWN = frozenset({"circle", "line", "path", "rect", "use"})


class Markup(str):
    """Text that a browser may read as HTML: names in it are escaped already."""

    __slots__ = ()


Content = str | None
"""A `Markup`, a text that will be escaped, or nothing."""

Attribute = str | float | bool | None


def text(words: str) -> Markup:
    r"""Return words as markup: invisible characters escaped, long texts cut.

    Example:
        >>> text("soft <b>" + chr(27))
        'soft &lt;b&gt;\\x1b'
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
        >>> tag("a", "R & D", href="#one", class_="link")
        '<a href="#one" class="link">R &amp; D</a>'
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


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[Content]],
    *,
    caption: str,
    right: Sequence[int] = (),
    sorts: bool = False,
    is_compact: bool = False,
) -> Markup:
    """Return a table that scrolls inside its own frame.

    Args:
        head: The names of the columns.
        rows: The cells; the first of a row names the row.
        caption: What the table shows.
        right: The columns of numbers, from 0.
        sorts: Whether a reader may sort it, where scripts run.
        is_compact: Whether it is as narrow as its cells allow.
    """
    lines: list[Markup] = []
    for row in rows:
        cells = [
            tag(
                "td" if place else "th",
                cell,
                scope=None if place else "row",
                class_="number" if place in right else None,
            )
            for place, cell in enumerate(row)
        ]
        lines.append(tag("tr", *cells))
    names = [
        tag("th", name, scope="col", class_="number" if place in right else None)
        for place, name in enumerate(head)
    ]
    whole = tag(
        "table",
        tag("caption", caption),
        tag("thead", tag("tr", *names)),
        tag("tbody", *lines),
        class_="sorts" if sorts else "compact" if is_compact else None,
    )
    return tag(
        "div", whole, class_="scrolls", tabindex="0", role="region", aria_label=caption
    )


def folded(summary: Content, *children: Content, is_open: bool = False) -> Markup:
    """Return something to unfold; on paper it is unfolded."""
    return tag("details", tag("summary", summary), *children, open=is_open)


def listed(items: Iterable[Content], **attributes: Attribute) -> Markup:
    """Return a list of points."""
    return tag("ul", *(tag("li", item) for item in items), **attributes)

"""Texts, templates and the marks of pictures as markup; texts in it are escaped."""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import re
from collections.abc import Callable, Iterable, Mapping
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING

from markupsafe import Markup as Markup

from fuzzytree.model import printable

if TYPE_CHECKING:
    from jinja2 import Template

MOST_LETTERS = 400
"""Of one text on a page; a longer one is cut, and says how long it is."""


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


def trimmed(value: float) -> str:
    """Return a number of points of a picture, with one decimal at most.

    Example:
        >>> trimmed(12.0), trimmed(-0.04), trimmed(3.25)
        ('12', '0', '3.2')
    """
    shown = f"{value:.1f}".removesuffix(".0")
    return "0" if shown == "-0" else shown


def mark(name: str, *values: object, **options: object) -> Markup:
    """Return what a macro of `templates/pictures.html` makes.

    Example:
        >>> print(mark("words", 1.0, 2.5, "R & D", "small"))
        <text x="1" y="2.5" class="small">R &amp; D</text>
    """
    macro: Callable[..., Markup] = getattr(_pictures(), name)
    return macro(*values, **options)


@functools.cache
def _pictures() -> object:
    return macros("pictures.html", {}, {"trimmed": trimmed})


def macros(
    name: str, known: Mapping[str, object], filters: Mapping[str, Callable[..., object]]
) -> object:
    """Return the macros of a template, which knows some names and filters.

    Its line breaks, and the blanks behind them, count for nothing.
    """
    made = template(re.sub(r"\n *", "", source(name)), known, filters)
    return made.module


def template(
    words: str,
    known: Mapping[str, object] = MappingProxyType({}),
    filters: Mapping[str, Callable[..., object]] = MappingProxyType({}),
) -> Template:
    """Return a template."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True,
        finalize=_content,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(filters)
    return environment.from_string(words, globals={**known})


def source(name: str) -> str:
    """Return the text of a template."""
    folder = resources.files("fuzzytree.report").joinpath("templates")
    return folder.joinpath(name).read_text("utf-8")


def policy_of(page: str, others: str = "") -> str:
    """Return what a page may do: run its own styles and scripts, and some others.

    Example:
        >>> policy_of("<script></script><style></style>", "img-src data:; ")[-50:]
        "img-src data:; base-uri 'none'; form-action 'none'"
    """
    policy = "default-src 'none'; "
    for kind in ("script", "style"):
        policy += f"{kind}-src"
        for content in re.findall(f"<{kind}>(.*?)</{kind}>", page, re.DOTALL):
            digest = hashlib.sha256(content.encode()).digest()
            policy += f" 'sha256-{base64.b64encode(digest).decode()}'"
        policy += "; "
    return f"{policy}{others}base-uri 'none'; form-action 'none'"


def _content(value: object) -> Markup:
    """Return a value of a template as markup."""
    if isinstance(value, Markup):
        return value
    return Markup("") if value is None else text(str(value))

"""Pieces of JavaScript: literals, tables and templates, safe whatever a model says."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator


def text_of(text: str) -> str:
    r"""Return text as a literal of ASCII, without `<` and `>`, on one line.

    Escapes make it safe in a comment too: it has no line end, and no `*/`.

    Example:
        >>> print(text_of('é\u2028"</script>*/'))
        "\u00e9\u2028\"\u003c/script\u003e*\u002f"
    """
    plain = json.dumps(text)
    for pair, safe in (("<", r"\u003c"), (">", r"\u003e"), ("*/", r"*\u002f")):
        plain = plain.replace(pair, safe)
    return plain


def number_text(value: float) -> str:
    """Return a number with the fewest digits that give it back.

    Example:
        >>> number_text(-0.0), number_text(1e-05), number_text(-math.inf)
        ('-0.0', '1e-05', '-Infinity')
    """
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "Infinity" if value > 0.0 else "-Infinity"
    return repr(value)


def literal(value: object) -> str:
    """Return a value as JavaScript; sequences become arrays, None becomes null.

    Example:
        >>> literal(("band", None, [1.0, 2], True))
        '["band", null, [1.0, 2], true]'
    """
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return text_of(value)
        case float():
            return number_text(value)
        case int():
            return str(value)
        case tuple() | list():
            members: Iterable[object] = value
            return f"[{', '.join(map(literal, members))}]"
        case _:
            raise TypeError(f"no literal for {type(value).__name__}")


def table(name: str, entries: Iterable[str]) -> Iterator[str]:
    """Yield an array, one entry to a line; entries end in a comma, maybe a comment."""
    yield f"\nconst {name} = [\n"
    for entry in entries:
        yield f"  {entry}\n"
    yield "];\n"


def filled(template: str, **words: str) -> str:
    """Return a template with words in the place of their names between two `@`."""
    for name, word in words.items():
        template = template.replace(f"@{name}@", word)
    return template

"""What is wrong with a model: where, and one sentence; and the rules of names."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator

from fuzzytree.errors import InvalidModelError

_MOST_MISTAKES = 200  # looking for similar names takes long
_MOST_COMPARED = 1000  # names among which a similar one is sought

_CONTROL = re.compile(
    r"[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufffe\uffff]"
)

Path = tuple[str | int, ...]
Mistake = tuple[Path, str]


def refuse(*mistakes: Iterable[Mistake]) -> None:
    """Refuse a model with the first few hundred of its mistakes, if it has any.

    Raises:
        InvalidModelError: With the mistakes.
    """
    first = [*itertools.islice(itertools.chain(*mistakes), _MOST_MISTAKES)]
    if first:
        raise InvalidModelError(first)


def name_mistakes(path: Path, what: str, names: Iterable[str]) -> Iterator[Mistake]:
    """Yield which names stand twice or hold what no name may hold."""
    seen: set[str] = set()
    for position, name in enumerate(names):
        fault = text_fault(name)
        if fault:
            yield (*path, position), f"{what} {name!r} {fault}"
        if name in seen:
            yield (*path, position), f"{what} {name!r} stands twice"
        seen.add(name)


def text_fault(text: str) -> str:
    """Return why a text is no name or unit, empty if it may be one.

    Terminals, editors and line-based formats obey control characters, line breaks and
    marks that change the direction of writing, so that no name holds one.

    Example:
        >>> text_fault("petal length (µm)"), text_fault("petal" + chr(27) + "[2J")
        ('', 'has a control character')
    """
    if _CONTROL.search(text):
        return "has a control character"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "cannot be written as UTF-8"
    return ""


def name_choice(wrong: str, names: Iterable[str]) -> str:
    """Return `there is a, b (did you mean 'a'?)`, at most a dozen names long."""
    import difflib

    known = list(dict.fromkeys(names))
    # A message has one line, whatever is in a name.
    lines = [one if one.isprintable() else repr(one) for one in known[:12]]
    if len(known) > _MOST_COMPARED:
        return f"there are {len(known)}: {', '.join(lines)}, ..."
    if not known:
        return "there is none"
    shown = ", ".join(lines) + (", ..." if len(known) > 12 else "")
    close = difflib.get_close_matches(wrong, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return f"there is {shown}{hint}"

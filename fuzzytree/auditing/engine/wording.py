"""Counts, numbers and names as sentences show them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction


def counted(count: int, noun: str, nouns: str | None = None) -> str:
    """Return a count with its noun.

    Example:
        >>> counted(1, "rule"), counted(2, "box", "boxes")
        ('1 rule', '2 boxes')
    """
    return f"{count} {noun if count == 1 else nouns or noun + 's'}"


def short(number: float | Fraction) -> str:
    """Return a number with as many digits as a sentence needs.

    Example:
        >>> short(Fraction(1, 3))
        '0.3333'
    """
    return f"{float(number):.4g}"


def number_text(number: float) -> str:
    """Return a value of an input in six digits, as sentences show it."""
    return f"{number:.6g}"


def percent(share: Fraction) -> str:
    """Return a share as people read it.

    Example:
        >>> percent(Fraction(1, 300))
        '0.333 %'
    """
    return f"{100.0 * float(share):.3g} %"


def answer_text(label: str | None) -> str:
    """Return an answer as people read it.

    Example:
        >>> answer_text("a"), answer_text(None)
        ("'a'", 'no class')
    """
    return "no class" if label is None else repr(label)


def listed(names: Sequence[str]) -> str:
    """Return names as people read them.

    Example:
        >>> listed(["a", "b"]), listed([])
        ("'a', 'b'", 'none')
    """
    return ", ".join(map(repr, names)) or "none"

"""How a check can end badly: it cannot run, it fails, or nobody can tell."""

from __future__ import annotations

MOST_BYTES = 64 * 2**20


class CannotRunError(ValueError):
    """A file cannot be read: nothing is checked."""


class DoesNotHoldError(Exception):
    """Something that the audit says is not so."""


class UndecidedError(Exception):
    """Something cannot be decided again here; the text says why."""


def require(is_so: bool, otherwise: str) -> None:
    """Refuse what the audit says, unless it is so.

    Raises:
        DoesNotHoldError: If it is not.
    """
    if not is_so:
        raise DoesNotHoldError(otherwise)

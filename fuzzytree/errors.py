"""What can go wrong, as types; each is also the built-in error that fits."""

from __future__ import annotations

from collections.abc import Sequence


class FuzzyTreeError(Exception):
    """Any error that fuzzytree raises on purpose."""


class InvalidModelError(FuzzyTreeError, ValueError):
    """A tree or rule base that contradicts itself.

    Attributes:
        mistakes: Every mistake found, as pairs of a path and a sentence. A path
            is a tuple of field names and positions, such as `("rules", 2, "then")`.
    """

    def __init__(self, mistakes: Sequence[tuple[tuple[str | int, ...], str]]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__("\n".join(sentence for _, sentence in self.mistakes))


class LearningError(FuzzyTreeError, ValueError):
    """A table that nothing can be learnt from."""


class TableError(FuzzyTreeError, ValueError):
    """A table that does not fit: its columns, its types or its width."""


class ReadError(FuzzyTreeError, ValueError):
    """A file that cannot be read; the text says where and what would be right."""


class WriteError(FuzzyTreeError, OSError):
    """A file that cannot be written; what stood there before is still there."""


class LossError(FuzzyTreeError, ValueError):
    """A model that a format or a runtime cannot carry without loss."""


class DisagreementError(FuzzyTreeError, AssertionError):
    """Representations of one model that give different answers."""


class MissingExtraError(FuzzyTreeError, ImportError):
    """A verb that needs an optional package which is not installed."""


def install_hint(extra: str) -> str:
    """Return which packages an optional part needs, and the command that gets them.

    The packages come from the metadata of the installation, so the command works
    whether fuzzytree came from an index, a wheel or a checkout.

    Example:
        >>> install_hint("serial")
        "pyserial: pip install 'pyserial>=3.5'"
    """
    import importlib.metadata
    import re

    try:
        listed = importlib.metadata.requires("fuzzytree-toolkit") or []
    except importlib.metadata.PackageNotFoundError:
        return f"the packages that pyproject.toml lists for the extra {extra!r}"
    needed = [
        one.partition(";")[0].strip()
        for one in listed
        if re.search(rf"""extra == ['"]{re.escape(extra)}['"]""", one)
    ]
    names = [re.split(r"[^\w.-]", one)[0] for one in needed]
    command = " ".join(f"'{one}'" for one in needed)
    return f"{' and '.join(names)}: pip install {command}"


class PortError(FuzzyTreeError, OSError):
    """A serial port that cannot be used, or that gives what its board does not send."""

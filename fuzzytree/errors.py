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

    def __reduce__(self) -> tuple[object, ...]:
        """Return how a pickle or a copy makes it again."""
        return type(self), (self.mistakes,)


class LearningError(FuzzyTreeError, ValueError):
    """A table that nothing can be learnt from."""


class TableError(FuzzyTreeError, ValueError):
    """A table that does not fit: its columns, its types or its width."""


class ReadError(FuzzyTreeError, OSError, ValueError):
    """A file that cannot be read; the text says where and what would be right.

    What the operating system said, such as its `errno`, is the `__cause__`.
    """


class WriteError(FuzzyTreeError, OSError):
    """A file that cannot be written; what stood there before is still there."""


class LossError(FuzzyTreeError, ValueError):
    """A model that a format or a runtime cannot carry without loss."""


class DisagreementError(FuzzyTreeError, AssertionError):
    """Representations of one model that give different answers."""


class MissingExtraError(FuzzyTreeError, ImportError):
    """A verb that needs an optional package which is not installed."""


def requirements() -> dict[str, list[str]]:
    """Return what the installation requires: for each extra, and for `""` always.

    It comes from the metadata of the installation, so it is the same whether fuzzytree
    came from an index, a wheel or a checkout; empty if there is none.
    """
    import importlib.metadata
    import re

    try:
        listed = importlib.metadata.requires("fuzzytree-toolkit") or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    needed: dict[str, list[str]] = {}
    for one in listed:
        package, _, condition = one.partition(";")
        extra = re.search(r"""extra == ['"](.+?)['"]""", condition)
        needed.setdefault(extra[1] if extra else "", []).append(package.strip())
    return needed


def package_name(requirement: str) -> str:
    """Return the name of the package that is required.

    Example:
        >>> package_name("dask[dataframe]>=2025.1")
        'dask'
    """
    import re

    return re.split(r"[^\w.-]", requirement)[0]


def install_hint(extra: str) -> str:
    """Return which packages an optional part needs, and the command that gets them.

    Example:
        >>> install_hint("serial")
        "pyserial: pip install 'pyserial>=3.5'"
    """
    needed = requirements().get(extra, [])
    if not needed:
        return f"the packages that pyproject.toml lists for the extra {extra!r}"
    command = " ".join(f"'{one}'" for one in needed)
    return f"{' and '.join(map(package_name, needed))}: pip install {command}"


class PortError(FuzzyTreeError, OSError):
    """A serial port that cannot be used, or that gives what its board does not send."""

"""Learn fuzzy decision trees, read them as rules, run them anywhere, prove them equal.

Nothing heavy is loaded before it is used: the names stand in `__init__.pyi`, and each
comes from its room at its first use.
"""

from __future__ import annotations

import lazy_loader

_named, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> object:
    """Load a public name from its room, once; the version from the installation."""
    if name not in __all__:
        raise AttributeError(f"module 'fuzzytree' has no attribute {name!r}")
    if name == "__version__":
        from fuzzytree.model import version

        value: object = version()
    else:
        value = _named(name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)

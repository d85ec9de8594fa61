"""Learn from and predict the lazy frames of other engines, where their rows lie."""

from __future__ import annotations

import importlib
from typing import Any, Final

import msgspec

from fuzzytree.errors import MissingExtraError, install_hint


class Engine(msgspec.Struct, frozen=True):
    """An engine whose lazy frames `learn` and `predict` take.

    Attributes:
        package: The package that the type of the frames comes from.
        type_name: The name of that type.
        adapter: The module of this package that is about the engine, and the extra.
        ignores_case: Whether `Class` and `class` are one column.
    """

    package: str
    type_name: str
    adapter: str
    ignores_case: bool = False

    def load(self) -> Any:
        """Return the adapter, or raise MissingExtraError if it cannot be imported."""
        try:
            return importlib.import_module(f"{__package__}.{self.adapter}")
        except ImportError as error:
            raise MissingExtraError(
                f"a {self.type_name} of {self.package} needs "
                f"{install_hint(self.adapter)}"
            ) from error


ENGINES: Final = (
    Engine("polars", "LazyFrame", "polars"),
    Engine("duckdb", "DuckDBPyRelation", "duckdb", ignores_case=True),
    Engine("ibis", "Table", "ibis", ignores_case=True),
    Engine("pyspark.sql", "DataFrame", "spark", ignores_case=True),
    Engine("dask", "DataFrame", "dask"),
)


def engine_of(frame: object) -> Engine | None:
    """Return the engine of a lazy frame, None for any other table; imports nothing."""
    for kind in type(frame).__mro__:
        module = f"{kind.__module__.lstrip('_')}."
        for engine in ENGINES:
            is_inside = module.startswith(f"{engine.package}.")
            if is_inside and kind.__name__ == engine.type_name:
                return engine
    return None

"""What must be set before any library is imported, and what all tests share."""

import gc
import os
from collections.abc import Generator

import pytest

# scikit-learn leaves checks of its estimators out without it.
os.environ.setdefault("SCIPY_ARRAY_API", "1")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Spare the garbage collector the thousands of tests, which live to the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.collect()
        gc.freeze()


@pytest.fixture(scope="module")
def few_objects() -> None:
    """Keep what tests before have made from the collection before a measurement."""
    gc.collect()
    gc.freeze()

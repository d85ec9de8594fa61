"""Seeds of random models: a few in each run, and the others with all that is heavy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from _pytest.mark.structures import ParameterSet


def seeds(count: int, *fast: int) -> list[ParameterSet]:
    """Return the numbers below a count; all but those that are fast are heavy."""
    return [
        pytest.param(n, marks=() if n in fast else pytest.mark.heavy)
        for n in range(count)
    ]

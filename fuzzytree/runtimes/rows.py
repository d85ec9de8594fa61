"""Checks of the rows that a runtime gets, and the winner of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray, IntArray


def checked(values: npt.ArrayLike, inputs: Sequence[str]) -> FloatArray:
    """Return values as doubles of shape (inputs, rows), copied only if need be.

    Raises:
        ValueError: If there is not one line for each input, or text among the values.

    Example:
        >>> checked([[1, 2, 3]], ["force"]).shape
        (1, 3)
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the values must be numbers: {error}") from error
    if array.ndim != 2 or array.shape[0] != len(inputs):
        shape = " x ".join(map(str, array.shape)) or "a single number"
        raise ValueError(
            f"the values must have one line for each of the {len(inputs)} inputs "
            f"({_shown(inputs)}) and one column for each row, not the shape {shape}"
        )
    return array


def winners(
    strengths: npt.NDArray[np.floating[Any]], missing: npt.NDArray[np.bool_]
) -> IntArray:
    """Return rule numbers and status codes as the two lines of one array.

    Args:
        strengths: Of shape (rules, rows), without NaN.
        missing: The rows whose values are missing: rule 0, status 3.

    Example:
        >>> winners(np.array([[0.5, 0.0], [0.5, 0.0]]), np.array([False, False]))
        array([[1, 0],
               [1, 2]])
    """
    best = strengths.max(axis=0)
    equal = strengths == best
    found = np.empty((2, strengths.shape[1]), np.int64)
    np.add(equal.argmax(axis=0), 1, out=found[0])
    np.greater(np.count_nonzero(equal, axis=0), 1, out=found[1], casting="unsafe")
    uncovered = best == 0.0
    found[0, uncovered], found[1, uncovered] = 0, 2
    found[0, missing], found[1, missing] = 0, 3
    return found


def _shown(names: Sequence[str]) -> str:
    shown = ", ".join(names[:12])
    return shown + (", ..." if len(names) > 12 else "")

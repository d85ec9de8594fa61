"""The number types of an ONNX file.

`float64` does everything in double. `mixed` takes values, differences, divisions and
comparisons with a value in double and casts before it clips. `float32` does everything
in float32, constants rounded to nearest (`fuzzytree.numerics.narrowing`).
"""

from __future__ import annotations

import msgspec
import numpy as np

from fuzzytree.model.contracts import Dtype
from fuzzytree.numerics.narrowing import Real
from fuzzytree.semantics.reference import BELOW_ONE


class Numbers(msgspec.Struct, frozen=True):
    """The types in which a graph computes.

    Attributes:
        axis: Of input values and everything up to the cast.
        degree: Of degrees and strengths.
        below_one: The largest number below 1 of the degrees' type.
    """

    axis: type[Real]
    degree: type[Real]
    below_one: float

    @property
    def is_mixed(self) -> bool:
        """Return whether degrees have another type than values."""
        return self.axis is not self.degree


NUMBERS: dict[Dtype, Numbers] = {
    "float64": Numbers(np.float64, np.float64, BELOW_ONE),
    "mixed": Numbers(np.float64, np.float32, 1.0 - 2.0**-24),
    "float32": Numbers(np.float32, np.float32, 1.0 - 2.0**-24),
}

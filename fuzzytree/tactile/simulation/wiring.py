"""What a matrix of resistors without diodes reads: its network, solved exactly."""

from __future__ import annotations

from typing import Literal, assert_never

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

Wiring = Literal["diodes", "grounded", "floating"]


def read_matrix(
    conductance: FloatArray, wiring: Wiring, *, drive_ohm: float, load_ohm: float
) -> FloatArray:
    """Return what each cell seems to conduct when it is read in its matrix.

    One row is driven, a column read: the answer is the current into its load, for
    each volt. With G the conductances (rows, columns), D the resistance of each row's
    driver and R that of each column's load:

    - `diodes`: `G / (1 + (D + R) G)`, each cell for itself.
    - `grounded`: the other rows are held at 0 V and every column has its load; the
      network's equations give, for all cells at once, the transpose of
      `C G' (B - D R G C G')^-1` with `B = diag(1 + D row sums)` and
      `C = diag(1 / (1 + R column sums))`. Without resistances this is G itself.
    - `floating`: the other lines are open: `E / (1 + (D + R) E)` with E the
      conductance between the row and the column through the whole network,
      `1 / E = P_rr + P_cc - 2 P_rc`, where P is the inverse of the network's
      Laplacian without its last line.

    Args:
        conductance: Shape (presses, rows, columns), microsiemens; above 0 if
            floating.
        wiring: What the other lines do.
        drive_ohm: Between a row and what drives it.
        load_ohm: Between a column and 0 V.

    Returns:
        Microsiemens, of the same shape.

    Example:
        >>> two = np.array([[[100.0, 100.0]]])
        >>> read_matrix(two, "grounded", drive_ohm=0.0, load_ohm=0.0).tolist()
        [[[100.0, 100.0]]]
        >>> read_matrix(two, "grounded", drive_ohm=5000.0, load_ohm=0.0).tolist()
        [[[50.0, 50.0]]]
    """
    drive, load = drive_ohm * 1e-6, load_ohm * 1e-6  # megohms
    match wiring:
        case "diodes":
            return conductance / (1 + (drive + load) * conductance)
        case "grounded":
            rows = 1 + drive * conductance.sum(axis=2)
            columns = 1 + load * conductance.sum(axis=1)
            shared = conductance / columns[:, np.newaxis]
            mesh = -drive * load * (shared @ conductance.transpose(0, 2, 1))
            lines = np.arange(rows.shape[1])
            mesh[:, lines, lines] += rows
            found: FloatArray = np.linalg.inv(mesh).transpose(0, 2, 1) @ shared
            return found
        case "floating":
            return 1 / (_resistance(conductance) + drive + load)
        case _:
            assert_never(wiring)


def _resistance(conductance: FloatArray) -> FloatArray:
    """Return what lies between each row and column, in megohms."""
    count, rows, columns = conductance.shape
    laplacian = np.zeros((count, rows + columns, rows + columns))
    laplacian[:, :rows, rows:] = -conductance
    laplacian[:, rows:, :rows] = -conductance.transpose(0, 2, 1)
    lines = np.arange(rows + columns)
    laplacian[:, lines, lines] = -laplacian.sum(axis=2)
    inverse = np.zeros_like(laplacian)
    inverse[:, :-1, :-1] = np.linalg.inv(laplacian[:, :-1, :-1])
    own = inverse[:, lines, lines]
    between: FloatArray = (
        own[:, :rows, np.newaxis]
        + own[:, np.newaxis, rows:]
        - 2 * inverse[:, :rows, rows:]
    )
    return between

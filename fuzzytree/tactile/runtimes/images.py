"""Features of images whose cells are no whole numbers, such as interpolated ones.

Their sums are not exact, so the centre of pressure is found first and the moments are
taken about it, in double, with a bound of what rounding can have done (see
`docs/explanation/moments.md`). Everything after the moments is the program of whole
frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fuzzytree.errors import TableError
from fuzzytree.runtimes.programs import plan_program, run_program
from fuzzytree.tactile.features import image_program
from fuzzytree.tactile.features.moments import ORDER, UNIT
from fuzzytree.tactile.runtimes.frames import Features

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_AT_ONCE = 256


def features_of_images(
    images: npt.NDArray[np.floating], names: Sequence[str], *, spacing: float = 1.0
) -> Features:
    """Return features of images of real numbers.

    Args:
        images: Shape (images, rows, columns), or one image; pressures from 0 on, in
            the unit of a full cell.
        names: Of the features; cells and blocks are those of frames only.
        spacing: The distance of neighbouring points in cells: 1 / k for a frame that
            was interpolated k times, whose points stand for k^2 times less pressure.

    Raises:
        TableError: If a name is no feature of an image, or if a value is below 0 or
            not finite.
        ValueError: If the spacing is not above 0.

    Example:
        >>> bar = np.zeros((5, 9))
        >>> bar[2, 1:8] = 0.5
        >>> features_of_images(bar, ["force", "S1", "angle"]).values[:, 0].tolist()
        [3.5, 14.0, 0.0]
    """
    if not 0.0 < spacing < np.inf:
        raise ValueError(f"the spacing is above 0, not {spacing!r}")
    found = np.asarray(images, np.float64)
    found = found[np.newaxis] if found.ndim == 2 else found
    if found.ndim != 3 or not found.size:
        raise TableError(
            f"images have the shape (images, rows, columns), not {found.shape}"
        )
    if not np.isfinite(found).all() or found.min() < 0.0:
        raise TableError("an image holds pressures from 0 on, none missing or infinite")
    program = image_program(names)
    plan = plan_program(program)
    values = np.empty((len(names) + 1, len(found)))
    for start in range(0, len(found), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        known = _measured(found[part], spacing)
        inputs = np.array([known[name] for name in program.inputs])
        values[:, part] = run_program(plan, inputs.reshape(-1, len(found[part])))
    return Features(tuple(names), values[:-1], values[-1] > 0.0)


def _measured(images: FloatArray, spacing: float) -> dict[str, FloatArray]:
    """Return the moments about the centre and their bounds, by the program's names."""
    rows, columns = images.shape[1:]
    x = (np.arange(columns) - (columns - 1) / 2) * spacing
    y = ((rows - 1) / 2 - np.arange(rows)) * spacing
    weight = images * spacing**2
    force = weight.sum(axis=(1, 2))
    safe = np.where(force > 0.0, force, 1.0)
    centre = [
        np.einsum("nij,j->n", weight, x) / safe,
        np.einsum("nij,i->n", weight, y) / safe,
    ]
    away = (x - centre[0][:, None], y - centre[1][:, None])
    powers = [np.stack([one**k for k in range(ORDER + 1)], axis=-1) for one in away]
    sums = np.einsum("nij,njp,niq->npq", weight, *powers, optimize=True)
    sizes = np.einsum("nij,njp,niq->npq", weight, *map(np.abs, powers), optimize=True)
    # Each of the sums has one rounding for each addition and a few for its terms.
    share = (rows * columns + 4 * ORDER + 8) * UNIT
    reach = [
        np.einsum("nij,j->n", weight, abs(x)),
        np.einsum("nij,i->n", weight, abs(y)),
    ]
    off = [2 * share * one / safe for one in reach]  # how far the centre may be off
    known = {
        "sum 00": force,
        "area": np.count_nonzero(images, axis=(1, 2)).astype(float),
    }
    known |= {"peak": images.max(axis=(1, 2)), "x": centre[0], "y": centre[1]}
    for p in range(ORDER + 1):
        for q in range(ORDER + 1 - p):
            error = 2 * share * sizes[:, p, q]
            if p:
                error = error + 2 * p * off[0] * sizes[:, p - 1, q]
            if q:
                error = error + 2 * q * off[1] * sizes[:, p, q - 1]
            known[f"moment {p}{q}"], known[f"error {p}{q}"] = sums[:, p, q], error
    return known

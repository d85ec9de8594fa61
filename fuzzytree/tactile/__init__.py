"""Tactile sensors: from a serial port to the objects that lie on a matrix of cells.

```python
import fuzzytree as ft

with ft.tactile.open("/dev/ttyUSB0", board="mat.yaml", model="objects.yaml") as sensor:
    for frame in sensor:
        for thing in frame.objects:
            print(f"{frame.time:.2f} {thing.label} {thing.strength:.2f} {thing.box}")
```
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fuzzytree.files import PathLike
    from fuzzytree.model import FloatArray, Model
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.recognition.sensing import TactileSensor
    from fuzzytree.tactile.sensor import Cells, Sensor

__all__ = ["features_of", "names_of", "open"]


def open(
    source: str,
    *,
    model: Model | PathLike,
    board: Board | PathLike | None = None,
    reject: float | None = None,
    vote_s: float = 0.0,
    least_area: int = 2,
    record: PathLike | None = None,
    speed: float = 1.0,
) -> TactileSensor:
    """Open a sensor: iterating gives what each frame shows, as it comes.

    Each frame has its `time` in seconds, its `cells` (what presses on each, whole
    numbers of shape (rows, columns), without the baseline) and its `objects`, the
    largest force first, each with `label`, `strengths`, `probabilities`, `box`, `x`
    and `y`. `tare()` takes what the cells read next for their baseline.

    Args:
        source: A serial port, a recording, or an archive (.npz) or a table (.csv) of
            frames.
        model: A tree or a rule base whose inputs are names of features, or its file.
        board: What is connected to the port, or sent the frames of an archive or a
            table, or its file; none for a recording.
        reject: The strength below which an object is unknown; the usual one if None.
        vote_s: How many seconds the answers to an object vote; 0 for each frame's own.
        least_area: The fewest cells of an object.
        record: A recording to write every frame to.
        speed: Of frames that are recorded; 0 for no pauses.

    Returns:
        The sensor. It must be closed: it is a context manager.

    Raises:
        ValueError: If source and board do not go together, or a number is out of
            range.
        TableError: If the model's inputs are no features of frames.
        PortError: If the port cannot be used, or frames stop before the baseline is
            measured.
        ReadError: If a file is none of its kind.
        WriteError: If the recording cannot be made.

    Example:
        >>> import tempfile
        >>> import numpy as np
        >>> import fuzzytree as ft
        >>> areas = np.array([[12.0], [18.0], [60.0], [70.0]])
        >>> tree = ft.learn(
        ...     ft.table(areas, columns=["area"]), target=["bar", "bar", "hand", "hand"]
        ... )
        >>> cells = np.zeros((1, 4, 6), np.uint8)
        >>> cells[:, 1:, 2:] = 99
        >>> path = tempfile.mkdtemp() + "/bar.npz"
        >>> np.savez(path, frames=cells)
        >>> with ft.tactile.open(path, model=tree) as sensor:
        ...     frame = next(iter(sensor))
        >>> frame.cells.shape, [thing.label for thing in frame.objects]
        ((4, 6), ['bar'])
    """
    from fuzzytree.api import opened
    from fuzzytree.model import FuzzyTree, RuleBase
    from fuzzytree.tactile.recognition.recogniser import checked_model
    from fuzzytree.tactile.recognition.sensing import open_sensor

    name = "the model"
    found: object = model
    if not isinstance(model, FuzzyTree | RuleBase):
        name, found = str(model), opened(model)
    return open_sensor(
        source,
        model=checked_model(found, name),
        board=board,
        reject=reject,
        vote_s=vote_s,
        least_area=least_area,
        record=record,
        speed=speed,
    )


def features_of(frames: Cells, names: str, sensor: Sensor | None = None) -> FloatArray:
    """Return features of frames as scikit-learn wants them: (frames, features).

    Args:
        frames: Whole numbers of shape (frames, rows, columns), or one frame.
        names: Features and sets of features, with commas between them, such as
            `log orientation / force`.
        sensor: Whose frames they are; if None, one without a baseline, whose cells
            read at most 255 (65535 for numbers of 16 bits).

    Raises:
        TableError: If a name is no feature's, or the frames do not fit.
        InvalidModelError: If sums for a feature are beyond what doubles hold exactly.

    Example:
        >>> import numpy as np
        >>> features_of(np.full((1, 2, 3), 255, np.uint8), "force, area").tolist()
        [[6.0, 6.0]]
    """
    import numpy as np

    from fuzzytree.tactile.features.names import names_of
    from fuzzytree.tactile.runtimes.frames import features_of as computed
    from fuzzytree.tactile.sensor import Sensor as Matrix

    known = sensor
    if known is None:
        found = np.asarray(frames)
        full = 255 if found.dtype.itemsize == 1 else 65535
        rows, columns = found.shape[-2:]
        known = Matrix(rows, columns, full)
    return computed(known, frames, names_of(names)).values.T


def names_of(text: str) -> tuple[str, ...]:
    """Return the names of the features that `features_of` computes, in its order.

    Raises:
        TableError: If a name is no feature's.

    Example:
        >>> names_of("log size, angle")
        ('log force', 'log area', 'log peak', 'angle')
    """
    from fuzzytree.tactile.features.names import names_of as named

    return named(text)

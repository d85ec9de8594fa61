"""A matrix of force sensing resistors, from the forces on it to its readings.

Each effect is a function of arrays; `press` chains them. The sensor is the paper's:
16 x 16 cells of 0.2 inch, 8 bits. Forces are in newtons, conductances in microsiemens,
lengths in cells; x runs right and y runs up from the sensor's middle.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import astuple, dataclass
from typing import Annotated, Literal, assert_never, get_args

import numpy as np
import numpy.typing as npt
from msgspec import Meta
from press_shapes import (
    OBJECTS,
    FloatArray,
    Object,
    area_and_middle,
    covered,
    radius_of,
)

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import Value
from fuzzytree.tactile.sensor import Sensor, limit_mistakes

Wiring = Literal["diodes", "grounded", "floating"]


def read_matrix(
    conductance: FloatArray, wiring: Wiring, *, drive_ohm: float, load_ohm: float
) -> FloatArray:
    """Return what each cell seems to conduct when it is read in its matrix.

    One row is driven, a column read: the answer is the current into its load, for
    each volt. With G the conductances (rows, columns), D the resistance of each row's
    driver and R that of each column's load:

    - `diodes`: `G / (1 + (D + R) G)`, each cell for itself.
    - `grounded`: the other rows are at 0 V and every column has its load; the
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


SIDE = 16
"""The sensor's rows and columns."""

FULL = 255
"""What a cell reads that takes no more."""

_AT_ONCE = 32  # presses: what they need stays near the processor

MOST = 100_000
"""The most presses at a time."""


class PhysicsSettings(Value, frozen=True, kw_only=True):
    """Every number of the simulator.

    Attributes:
        force: What each object's own force is multiplied with.
        force_spread: The standard deviation of a press's force, in natural
            logarithms.
        tilt: The standard deviation of the slope of the pressure, in x and in y: its
            change over the object's radius of gyration, as a share of the mean.
        roam: How much of the free room the positions fill, in [0, 1]: 0 is the
            middle of the sensor, 1 anywhere that the whole object lies on it.
        turn_deg: The standard deviation of a press's angle about the object's own.
        aperture: The share of a cell that feels, a square in its middle, in (0, 1].
        break_n: The force below which a cell does not conduct, newtons.
        slope_us: How much a cell conducts for each newton above that, microsiemens.
        bend_n: The force above `break_n` at which a cell conducts half of the most
            that it ever does; inf for a cell that never saturates.
        row_spread: The standard deviation of a row's gain, in natural logarithms.
        column_spread: The same of a column.
        board: The seed of the gains: a number for a board.
        wiring: What the other lines do while a cell is read: `diodes` (nothing flows
            through another cell), `grounded` (rows that are not driven are at
            0 V) or `floating` (they and the other columns are left open).
        drive_ohm: Between a row and what drives it (the switch's own resistance).
        load_ohm: Between a column and 0 V; 0 for a virtual ground.
        rest_us: What a cell conducts that nothing presses on, microsiemens.
        full_us: The conductance that reads full, microsiemens.
        noise: The standard deviation of a reading before it is rounded, in counts.
        threshold: Readings up to this count as nothing, in counts.

    Raises:
        InvalidModelError: If a number is out of its range; it lists everything.
    """

    force: Annotated[float, Meta(ge=0.0, le=1e3)] = 1.0
    force_spread: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.24
    tilt: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.05
    roam: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0
    turn_deg: Annotated[float, Meta(ge=0.0, le=180.0)] = 1.0
    aperture: Annotated[float, Meta(ge=1e-3, le=1.0)] = 0.61
    break_n: Annotated[float, Meta(ge=0.0, le=1e3)] = 0.024
    slope_us: Annotated[float, Meta(ge=1e-3, le=1e6)] = 400.0
    bend_n: Annotated[float, Meta(ge=1e-3)] = 1.2
    row_spread: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.05
    column_spread: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.05
    board: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 0
    wiring: Wiring = "grounded"
    drive_ohm: Annotated[float, Meta(ge=0.0, le=1e9)] = 1500.0
    load_ohm: Annotated[float, Meta(ge=0.0, le=1e9)] = 0.0
    rest_us: Annotated[float, Meta(ge=1e-3, le=1e3)] = 0.1
    full_us: Annotated[float, Meta(ge=1e-3, le=1e6)] = 175.0
    noise: Annotated[float, Meta(ge=0.0, le=float(FULL))] = 0.5
    threshold: Annotated[int, Meta(ge=0, le=FULL - 1)] = 6

    def __post_init__(self) -> None:
        """Refuse a number out of its range."""
        mistakes = [*limit_mistakes(self)]
        if self.wiring not in get_args(Wiring):
            known = ", ".join(get_args(Wiring))
            text = f"wiring is one of {known}, not {self.wiring!r}"
            mistakes.append((("wiring",), text))
        if mistakes:
            raise InvalidModelError(mistakes)


PAPER = PhysicsSettings()


@dataclass(frozen=True, slots=True)
class PressTruth:
    """What was done in each press; arrays of shape (presses,).

    Attributes:
        x: Where the object's centre of pressure lies, in cells from the middle.
        y: The same, upwards.
        angle_deg: How far it is turned.
        force_n: The force on it.
        slope_x: The change of its pressure for each cell to the right, as a share of
            the mean.
        slope_y: The same, upwards.
    """

    x: FloatArray
    y: FloatArray
    angle_deg: FloatArray
    force_n: FloatArray
    slope_x: FloatArray
    slope_y: FloatArray


@dataclass(frozen=True, slots=True)
class Simulated:
    """Presses of one object.

    Attributes:
        frames: Shape (presses, 16, 16).
        sensor: What the frames are of.
        truth: What was done.
        clipped: How many cells of each press would have read more than full.
        outside: The share of the object's area that hung over the edge.
    """

    frames: npt.NDArray[np.uint8]
    sensor: Sensor
    truth: PressTruth
    clipped: npt.NDArray[np.int64]
    outside: FloatArray


def fsr(force_n: FloatArray, settings: PhysicsSettings) -> FloatArray:
    """Return the microsiemens of cells: 0 up to the break force, then a bent line.

    `G = slope * s / (1 + s / bend)` with `s = max(force - break, 0)`: the three
    regions that the makers describe (Interlink Electronics, FSR Integration Guide,
    94-00004, 2.2): a switch-like turn-on, conductance nearly proportional to force,
    saturation.

    Example:
        >>> law = PhysicsSettings(break_n=1.0, slope_us=100.0, bend_n=4.0)
        >>> fsr(np.array([0.5, 1.0, 5.0]), law).tolist()
        [0.0, 0.0, 200.0]
    """
    over = np.maximum(force_n - settings.break_n, 0.0)
    conductance: FloatArray = settings.slope_us * over / (1 + over / settings.bend_n)
    return conductance


def gains(settings: PhysicsSettings) -> FloatArray:
    """Return the factors of a board's cells, of shape (16, 16): row times column."""
    draws = np.random.default_rng(settings.board).standard_normal((2, SIDE))
    rows = np.exp(settings.row_spread * draws[0])
    columns = np.exp(settings.column_spread * draws[1])
    factors: FloatArray = rows[:, np.newaxis] * columns
    return factors


def press(
    thing: str | Object, count: int, seed: int = 0, settings: PhysicsSettings = PAPER
) -> Simulated:
    """Press an object on the sensor again and again.

    The same name, seed and settings give the same frames, and a larger count begins
    with those of a smaller one. Each press draws the same numbers whatever the
    settings, so two settings are compared on the same presses.

    Args:
        thing: The name of one of `OBJECTS`, or an object of one's own.
        count: How many presses, 1 to 100000.
        seed: Of positions, angles, forces, tilts and noise.
        settings: Every other number.

    Raises:
        ValueError: If there is no such object, or the count is out of its range.

    Example:
        >>> press("circle", 2, seed=1).frames.shape
        (2, 16, 16)
    """
    if isinstance(thing, str):
        if thing not in OBJECTS:
            known = ", ".join(OBJECTS)
            raise ValueError(f"no object {thing!r}; the objects are {known}")
        thing = OBJECTS[thing]
    if not 1 <= count <= MOST:
        raise ValueError(f"1 to {MOST} presses can be made at a time, not {count}")
    # The numbers of some presses are drawn at a time, before any setting scales them:
    # the first presses do not know the count.
    random = np.random.default_rng([seed, zlib.crc32(thing.name.encode())])
    truth = []
    found = []
    for begin in range(0, count, _AT_ONCE):
        some = slice(count - begin)
        places = random.uniform(-1.0, 1.0, (_AT_ONCE, 2))[some]
        turns, forces = (random.standard_normal(_AT_ONCE)[some] for _ in range(2))
        tilts = random.standard_normal((_AT_ONCE, 2))[some]
        noise = random.standard_normal((_AT_ONCE, SIDE, SIDE))[some]
        done = _truth(thing, settings, places, turns, forces, tilts)
        truth.append(astuple(done))
        newtons = forces_of(thing, done, settings.aperture)
        seen = read_matrix(
            gains(settings) * fsr(newtons, settings) + settings.rest_us,
            settings.wiring,
            drive_ohm=settings.drive_ohm,
            load_ohm=settings.load_ohm,
        )
        read = quantised(seen / settings.full_us, settings.noise * noise)
        found.append((*read, outside(thing, done)))
    frames, clipped, over = map(np.concatenate, zip(*found, strict=True))
    sensor = Sensor(SIDE, SIDE, full=FULL, threshold=settings.threshold)
    facts = PressTruth(*map(np.concatenate, zip(*truth, strict=True)))
    return Simulated(frames, sensor, facts, clipped, over)


def _truth(
    thing: Object,
    settings: PhysicsSettings,
    places: FloatArray,
    turns: FloatArray,
    forces: FloatArray,
    tilts: FloatArray,
) -> PressTruth:
    """Scale random numbers by the settings, and lay the object on the sensor.

    It lies in the middle, moved by a share of the room that is free; an object larger
    than the sensor has none.
    """
    angle = thing.turned_deg + settings.turn_deg * turns
    force = thing.force_n * settings.force * np.exp(settings.force_spread * forces)
    slope = settings.tilt * tilts / radius_of(thing)
    corners = np.concatenate(_outlines(thing, angle), axis=1)
    low = -SIDE / 2 - corners.min(axis=1)
    high = SIDE / 2 - corners.max(axis=1)
    room = settings.roam * np.maximum(high - low, 0.0) / 2
    x, y = ((low + high) / 2 + room * places).T
    return PressTruth(x, y, angle, force, slope[:, 0], slope[:, 1])


def _outlines(thing: Object, angle_deg: FloatArray) -> list[FloatArray]:
    """Return each part's corners, turned: shape (presses, corners, 2)."""
    turn = np.exp(1j * np.deg2rad(angle_deg))[:, np.newaxis]
    found: list[FloatArray] = []
    for part in thing.parts:
        x, y = np.array(part.corners).T
        corners = turn * (x + 1j * y)
        found.append(np.stack([corners.real, corners.imag], axis=-1))
    return found


def _laid(thing: Object, truth: PressTruth) -> list[FloatArray]:
    """Return each part's corners on the sensor."""
    middle = np.stack([truth.x, truth.y], axis=-1)[:, np.newaxis]
    return [outline + middle for outline in _outlines(thing, truth.angle_deg)]


def outside(thing: Object, truth: PressTruth) -> FloatArray:
    """Return the share of an object's area that hangs over the edge in each press."""
    edges = np.array([-SIDE / 2, SIDE / 2])
    laid = _laid(thing, truth)
    inside = sum(_between(covered(outline, edges, edges))[:, 0, 0] for outline in laid)
    size = sum(area_and_middle(part)[0] for part in thing.parts)
    return np.maximum(1 - inside / size, 0.0)


def forces_of(thing: Object, truth: PressTruth, aperture: float) -> FloatArray:
    """Return the force that each cell feels.

    The pressure is a plane over the object: its mean at the centre of pressure, and
    in each cell the value at the cell's middle. Where a tilted object lifts off,
    nothing presses, and the cells' forces add up to more than the object's own.

    A share of a cell feels, its aperture, a square in its middle. The result is in
    newtons, of shape (presses, 16, 16), rows from the top.
    """
    centres = np.arange(SIDE, dtype=np.float64) - (SIDE - 1) / 2
    half = math.sqrt(aperture) / 2
    lines: FloatArray = np.stack([centres - half, centres + half], axis=1).ravel()
    areas = np.zeros((len(truth.x), SIDE, SIDE))
    for part, outline in zip(thing.parts, _laid(thing, truth), strict=True):
        cells = _between(covered(outline, lines, lines))[:, ::-1]
        areas += part.weight * np.maximum(cells, 0.0)  # not -1e-16 beside a shape
    across = truth.slope_x[:, np.newaxis] * (centres - truth.x[:, np.newaxis])
    up = truth.slope_y[:, np.newaxis] * (centres[::-1] - truth.y[:, np.newaxis])
    plane = np.maximum(1 + up[:, :, np.newaxis] + across[:, np.newaxis], 0.0)
    mean = truth.force_n / sum(
        part.weight * area_and_middle(part)[0] for part in thing.parts
    )
    forces: FloatArray = mean[:, np.newaxis, np.newaxis] * plane * areas
    return forces


def _between(below: FloatArray) -> FloatArray:
    """Return areas between each even line and the odd one after it, both ways."""
    strips = below[:, 1::2] - below[:, ::2]
    cells: FloatArray = strips[:, :, 1::2] - strips[:, :, ::2]
    return cells


def quantised(
    share: FloatArray, noise: FloatArray
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Return 8-bit readings of shares of full, and how many would have been above it.

    Noise is added before rounding, in counts.
    """
    counts = np.rint(share * FULL + noise)
    clipped: npt.NDArray[np.int64] = (counts > FULL).sum(axis=(1, 2))
    return np.clip(counts, 0, FULL).astype(np.uint8), clipped

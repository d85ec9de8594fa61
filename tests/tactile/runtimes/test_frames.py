"""Features of many frames in numpy."""

from __future__ import annotations

import numpy as np

from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.tactile.features.names import FEATURES, blocks
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Sensor

NAMES = [*FEATURES, "log S10 / force", *blocks(3, 2), "cell r2 c4 / force"]


def test_numpy_has_every_bit_of_the_program_in_plain_python() -> None:
    sensor = Sensor(6, 9, full=1000, threshold=30, masked=((2, 2),))
    frames = np.random.default_rng(3).integers(0, 1200, (6, 6, 9))
    frames[frames < 400] = 0
    frames[4] = 0
    plan = FramePlan(sensor, NAMES)
    found = plan(frames)
    cells = np.clip(frames, 0, 1000)
    cells[cells <= 30] = 0
    cells[:, 2, 2] = 0
    for number, frame in enumerate(cells):
        row = {}
        for one in plan.made.sums:
            flat = [int(value) for value in frame.ravel()]
            if one.of == "cells":
                total = sum(w * v for w, v in zip(one.weights, flat, strict=True))
            else:
                total = max(flat) if one.of == "peak" else sum(v > 0 for v in flat)
            row[one.name] = float(total)
        *wanted, is_pressed = evaluate_program(plan.made.program, row).values
        assert np.array(wanted).tobytes() == found.values[:, number].copy().tobytes()
        assert bool(is_pressed) == found.is_pressed[number]


def test_one_frame_and_many_have_the_same_bits() -> None:
    sensor = Sensor(16, 16)
    frames = np.random.default_rng(0).integers(0, 256, (2100, 16, 16)).astype(np.uint8)
    plan = FramePlan(sensor, NAMES[:11])
    many = plan(frames).values
    for number in (0, 1023, 1024, 2099):
        assert plan(frames[number]).values.tobytes() == many[:, number].tobytes()


def test_frames_of_any_whole_type_are_the_same_frames() -> None:
    sensor = Sensor(4, 4)
    frame = np.arange(16).reshape(4, 4)
    wanted = FramePlan(sensor, ["S1", "S3"])(frame).values.tobytes()
    for kind in (np.uint8, np.int16, np.uint16, np.int32, np.uint64):
        found = FramePlan(sensor, ["S1", "S3"])(frame.astype(kind))
        assert found.values.tobytes() == wanted


ONE_NAMES = (
    *FEATURES,
    *("log S7", "S10 / force", "cell r3 c5", "block r1 c0 of 2x2 / force"),
)


def test_the_features_of_one_frame_have_the_bits_of_those_of_many() -> None:
    sensor = Sensor(7, 9, full=1023, threshold=3)
    random = np.random.default_rng(7)
    frames = random.integers(0, 1200, (60, 7, 9))
    frames[random.random(frames.shape) < 0.6] = 0
    frames[:5] = 0
    frames[3, 2, 4] = 1023  # a single cell
    frames[4] = 1023  # all of them
    plan = FramePlan(sensor, ONE_NAMES)
    many = plan(frames)
    for number, frame in enumerate(frames):
        one = plan(frame)
        assert one.values.tobytes() == many.values[:, number].tobytes()
        assert one.is_pressed.tolist() == [bool(many.is_pressed[number])]

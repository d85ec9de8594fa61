"""The picture of how often predictions are right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import fuzzytree as ft

SHARES = np.array([[0.95, 0.05], [0.85, 0.15], [0.45, 0.55], [0.55, 0.45]])


def test_a_dot_stands_at_the_mean_claim_and_the_share_that_is_right() -> None:
    svg = ft.draw_reliability(SHARES, [0, 1, 1, 1]).svg
    dots = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)"[^>]*class="dot"', svg)
    # bins from 0.5 (two rows, one right), 0.8 (one row, wrong) and 0.9 (one, right)
    assert [(round(float(x) + 3 - 74), round(316 - float(y) - 3)) for x, y in dots] == [
        (round(260 * 0.55), 130),
        (round(260 * 0.85), 0),
        (round(260 * 0.95), 260),
    ]
    assert "4 rows: log-loss 0.836, calibration error 0.250" in svg
    assert "share of rows that are right</text>" in svg


def test_labels_are_found_among_the_classes() -> None:
    labels = np.array(["a", "b", "b", "b"])
    named = ft.draw_reliability(SHARES, labels, classes=["a", "b"], title="grip")
    assert named.svg == ft.draw_reliability(SHARES, [0, 1, 1, 1], title="grip").svg


def test_wrong_labels_and_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"label 2 is none of the classes \[0, 1\]"):
        ft.draw_reliability(SHARES, [0, 1, 1, 2])
    with pytest.raises(ValueError, match=r"not \(4, 2\) and \(3,\)"):
        ft.draw_reliability(SHARES, [0, 1, 1])

"""The names of features."""

from __future__ import annotations

import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.names import FEATURES, blocks, feature_of

LIST = (
    "; there is S1 to S11, angle, cos2, sin2, Re C20 to Im C40, force, area, peak, "
    "x, y, cell r0 c0, block r0 c0 of 4x4, each also behind 'log ' and before "
    "' / force'"
)


def test_every_feature_has_itself_and_its_logarithm() -> None:
    for name in FEATURES:
        assert feature_of(name).base == name
        assert feature_of(f"log {name}").is_log


def test_a_name_reports_what_is_done() -> None:
    feature = feature_of("log block r2 c3 of 16x8 / force")
    assert (feature.kind, feature.row, feature.column) == ("block", 2, 3)
    assert (feature.rows, feature.columns) == (16, 8)
    assert feature.is_log
    assert feature.per_force


def test_blocks_are_named_row_by_row() -> None:
    assert blocks(2, 2)[1:3] == ("block r0 c1 of 2x2", "block r1 c0 of 2x2")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("S12", f"'S12' is no feature of a frame (did you mean 'S2'?){LIST}"),
        ("petal", f"'petal' is no feature of a frame (did you mean 'peak'?){LIST}"),
        (
            "angle / force",
            "'angle / force' is no feature of a frame: 'angle' is not divided by force",
        ),
        (
            "force / force",
            "'force / force' is no feature of a frame: 'force' is not divided by force",
        ),
        ("log log S1", f"'log log S1' is no feature of a frame{LIST}"),
        ("cell r1 c٣", f"'cell r1 c٣' is no feature of a frame{LIST}"),
        ("cell r1 c03", f"'cell r1 c03' is no feature of a frame{LIST}"),
    ],
)
def test_what_is_no_feature_is_refused_in_a_sentence(name: str, text: str) -> None:
    with pytest.raises(TableError) as caught:
        feature_of(name)
    assert str(caught.value) == text

"""Sets of features by short names."""

from __future__ import annotations

import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.names import PAPER, SETS, feature_of, names_of


def test_a_set_behind_log_leaves_what_is_alike_at_every_pressure() -> None:
    found = names_of("log orientation / force")
    assert found == (
        *(f"log {name} / force" for name in PAPER),
        "angle",
        "log Re C30 / force",
        "log Re C21 / force",
    )


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("form", ["{}", "log {}", "{} / force", "log {} / force"])
def test_every_member_of_a_set_is_a_feature(name: str, form: str) -> None:
    for member in names_of(form.format(name)):
        assert feature_of(member).name == member


def test_what_occurs_twice_is_taken_once() -> None:
    assert names_of("x, place,x") == ("x", "y")


def test_an_unknown_set_is_reported_with_those_there_are() -> None:
    with pytest.raises(TableError) as stated:
        names_of("papers")
    assert str(stated.value) == (
        "'papers' is no feature of a frame; there is S1 to S11, angle, cos2, sin2, "
        "Re C20 to Im C40, force, area, peak, x, y, cell r0 c0, block r0 c0 of 4x4, "
        "each also behind 'log ' and before ' / force'; sets are paper, orientation, "
        "parts, axis, size, place and blocks:16x8"
    )


@pytest.mark.parametrize("text", ["blocks:0x4", "blocks:256x256"])
def test_too_many_or_no_blocks_are_refused(text: str) -> None:
    with pytest.raises(TableError) as stated:
        names_of(text)
    assert str(stated.value) == f"{text!r}: 1 to 4096 blocks are possible"

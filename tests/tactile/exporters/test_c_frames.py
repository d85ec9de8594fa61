"""From the raw frame to the class in one C file: what it holds, and what is refused."""

import re

import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.sensor import Sensor
from fuzzytree.testing import random_tree
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree, raw_rules

TREE = learnt_tree(PLAIN, ("S1", "S9"))


def text_of(sensor: Sensor, *names: str) -> str:
    return write_frames_c(learnt_tree(sensor, names), sensor).content.decode("ascii")


@pytest.mark.heavy
def test_only_the_moments_that_the_model_uses_are_summed() -> None:
    found = [set(re.findall(r"sum_(\d\d) =", text_of(PLAIN, n))) for n in ("S1", "x")]
    assert found == [{"00", "10", "01", "20", "02"}, {"00", "10"}]


def test_weights_stand_in_no_table() -> None:
    code, _, _ = text_of(PLAIN, "S1", "S9").partition("#ifdef TREE_SELFTEST")
    sizes = [int(size) for size in re.findall(r"\[(\d+)\] = \{", code)]
    assert max(sizes, default=0) < 100


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("sensor", "name", "kind"),
    [
        (PLAIN, "S10", "int32_t"),
        (WIDE, "S1", "int32_t"),
        (Sensor(16, 16, full=65535), "S10", "int64_t"),
    ],
)
def test_sums_are_as_wide_as_they_can_become(
    sensor: Sensor, name: str, kind: str
) -> None:
    assert f"    {kind} sum_00 = 0;" in text_of(sensor, name)


def test_what_a_sensor_does_not_have_is_not_written() -> None:
    bare, wide = text_of(Sensor(5, 7), "area"), text_of(WIDE, "area")
    assert "return value;" in bare
    assert "offset" not in bare
    assert "if (value > 1000)" in wide
    assert "return value > 30 ? value : 0;" in wide
    assert "uint16_t tree_offset[35]" in wide


@pytest.mark.heavy
def test_a_library_is_needed_for_roots_alone() -> None:
    assert "math.h" not in text_of(PLAIN, "S5")
    assert "math.h" in text_of(SMALL, "angle")


def test_a_large_sensor_makes_no_large_file() -> None:
    found = re.search(r"tree_frame\[(\d+)\]", text_of(Sensor(100, 100), "area"))
    assert found is not None
    assert int(found[1]) in range(4, 7)


def test_the_same_model_gives_the_same_bytes() -> None:
    one, two = (write_frames_c(TREE, PLAIN, name="pad").content for _ in range(2))
    assert one == two


def test_a_floor_is_kept_against_the_rule_that_decides() -> None:
    text = write_frames_c(raw_rules(TREE), PLAIN, reject=0.5).content.decode()
    assert "strengths[answer.rule - 1] < 0x1p-1" in text


def test_wrong_options_are_refused() -> None:
    with pytest.raises(
        ValueError,
        match=r"^the name '2nd' cannot begin the names of C; 'model_2nd' can",
    ):
        write_frames_c(TREE, PLAIN, name="2nd")
    with pytest.raises(
        ValueError, match=r"^tree: a tree has no strengths to reject by"
    ):
        write_frames_c(TREE, PLAIN, reject=0.1)
    with pytest.raises(TableError, match="'x1' is no feature of a frame"):
        write_frames_c(random_tree(1), SMALL)

"""The picture of accuracy and size has each line's name at the end of its line."""

from __future__ import annotations

import itertools
from xml.etree import ElementTree

import pytest

from fuzzytree.learning import Front
from fuzzytree.report import draw_front


def ends(*shares: float) -> list[tuple[str, float, float]]:
    """Return the look of each line's name, its height, and where its line ends."""
    columns = (*range(1, len(shares)), None)
    rows = tuple((0.3, share) for share in shares)
    svg = draw_front(Front(columns, (2, 20), rows, 0.3, 100)).svg
    parts = [*ElementTree.fromstring(svg).iter()]
    looks = {one.get("class", ""): one for one in parts}
    return [
        (
            looks[f"small k{k}"].text or "",
            float(looks[f"small k{k}"].get("y", "")) - 4,
            float(looks[f"line k{k}"].get("d", "").split()[-1]),
        )
        for k in range(len(shares))
    ]


def test_a_line_that_ends_alone_has_its_name_at_its_end() -> None:
    for _, name, line in ends(0.9, 0.5, 0.7):
        assert name == pytest.approx(line, abs=0.11)  # points are written with a tenth


@pytest.mark.parametrize(
    "shares", [(0.931, 0.93, 0.92, 0.933), (0.9, 0.9, 0.9, 0.9), (0.6, 0.9, 0.91, 0.61)]
)
def test_names_stand_in_the_order_of_their_lines_and_apart(
    shares: tuple[float, ...],
) -> None:
    lines = ends(*shares)
    assert [name for name, _, _ in lines] == [
        *("1 column", "2 columns", "3 columns", "all columns")
    ]
    by_name = sorted(lines, key=lambda line: line[1])
    assert [end for _, _, end in by_name] == sorted(end for _, _, end in lines)
    places = [name for _, name, _ in by_name]
    gaps = [b - a for a, b in itertools.pairwise(places)]
    assert min(gaps) > 12.8
    middle = sum(name - end for _, name, end in lines)
    assert middle == pytest.approx(0, abs=0.5)  # moved up as far as down


def test_a_name_has_the_colour_of_its_line() -> None:
    svg = draw_front(Front((1, None), (2, 3), ((0.5, 0.6),) * 2, 0.4, 9)).svg
    for k, colour in enumerate(("#0072b2", "#c04d00")):
        assert f".line.k{k} {{ fill: none; stroke: {colour};" in svg
        assert f"svg .small.k{k} {{ font-size: 10.5px; fill: {colour}; }}" in svg

"""The picture of a study carries its numbers, and the same bytes each time."""

from __future__ import annotations

import importlib.util
import itertools
import random
import struct
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from fuzzytree.benchmarking.records import Kind, Point, Question, Study
from fuzzytree.errors import MissingExtraError, WriteError, install_hint
from fuzzytree.report.svg_bench import (
    Panel,
    marks_of,
    panels_of,
    time_text,
    work_precision,
)
from tests.benchmarking.studies import error, point, study, timing

HAS_EXTRA = all(map(importlib.util.find_spec, ("resvg_py", "font_roboto")))
Words = tuple[str, str, float, float, str]  # text, look, x, y, anchor


def small() -> Study:
    return study(
        point("floor: the columns read once", 5e3, None, kind="floor"),
        point("native", 1e5, error(1e-16, 1e-14), question="raw rules"),
        point("native float32", 4e4, error(2e-6, 3e-5), question="raw rules"),
        point("simpful", 9e7, error(2e-3), question="raw rules", kind="peer"),
        point("points 1e-03", 8e4, error(9e-4, 1e-3), question="raw rules"),
        point("native", 5e4, error(None), question="tree"),
        point("scikit-learn", 7e4, error(None, flips=4), question="tree", kind="peer"),
        point("onnxruntime", 3e4, error(None), question="tree"),
    )


def large(count: int) -> Study:
    chance = random.Random(1)
    forms: tuple[Question, ...] = ("tree", "relative rules", "raw rules")
    kinds: tuple[Kind, ...] = ("runtime", "variant", "peer")
    points = [
        point(
            f"candidate {number}",
            10.0 ** chance.uniform(4, 8),
            error(10.0 ** chance.uniform(-15, -1), flips=chance.choice((0, 0, 1, 9))),
            question=forms[number % 3],
            kind=kinds[number // 3 % 3],
        )
        for number in range(count)
    ]
    floor = point("floor: an empty session call", 5e3, None, kind="floor")
    return study(floor, *points)


def panels(made: Study) -> list[Panel]:
    return panels_of(marks_of(made, 1000, 1), [])


def signs(made: Study) -> dict[str, list[dict[str, str]]]:
    """Return what is drawn of each candidate: its bars, and its marker last."""
    root = ET.fromstring(work_precision(made, rows=1000).svg)
    groups: dict[str, list[dict[str, str]]] = {}
    for one in root.iter("{http://www.w3.org/2000/svg}g"):
        title = one.find("{http://www.w3.org/2000/svg}title")
        if title is not None:
            groups[title.text or ""] = [part.attrib for part in one][1:]
    return groups


def test_a_system_has_a_colour_and_the_error_of_its_outputs() -> None:
    fan = study(
        point("native", 1e5, error(1e-16, 1e-14), question="system"),
        point("c", 2e5, error(1e-16, 1e-14), question="system"),
    )
    text = work_precision(fan, rows=1000).svg
    assert ".form.full.k0 { fill: #0072b2; }" in text
    assert 'class="form k0 full"' in text
    assert "error of an output, as a" in text
    assert "error of a strength" not in text


def words(made: Study, look: str = "", **options: int) -> list[Words]:
    """Return the texts of a picture, those of one look if any is named."""
    root = ET.fromstring(work_precision(made, **{"rows": 1000, **options}).svg)
    return [
        (
            one.text or "",
            one.attrib["class"],
            float(one.attrib["x"]),
            float(one.attrib["y"]),
            one.attrib.get("text-anchor", "start"),
        )
        for one in root.iter("{http://www.w3.org/2000/svg}text")
        if look in one.attrib["class"].split() or not look
    ]


def test_errors_are_bounds_or_else_what_was_observed_or_shares_of_rows() -> None:
    first, second = panels(small())
    errors = {one.point.name: one.error for one in (*first.marks, *second.marks)}
    assert errors["native: raw rules"] == 1e-14
    assert errors["native float32: raw rules"] == 3e-5
    assert errors["simpful: raw rules"] == 2e-3
    assert errors["scikit-learn: tree"] == 0.02
    assert [first.measure, second.measure] == ["strength", "class"]


def test_a_marker_lies_at_its_time_and_error_and_its_bar_is_the_interval() -> None:
    made = study(point("native", 1e5, error(1e-3)), point("a", 1e3, error(1e-9)))
    (panel,) = panels(made)
    bar, disc = signs(made)["native: rules"]
    taken = made.points[0].timings[0]
    ends = [panel.across(end / 1e3) for end in (taken.low_ns, taken.high_ns)]
    assert [float(bar["x1"]), float(bar["x2"])] == pytest.approx(ends, abs=0.06)
    assert float(bar["y1"]) == pytest.approx(panel.height(1e-3), abs=0.06)
    assert disc["d"].split("a")[0].split()[1] == f"{panel.height(1e-3):.1f}"


def test_an_error_of_0_lies_on_a_line_that_says_so() -> None:
    panel = panels(small())[1]
    assert dict(panel.ticks())[panel.height(0.0)] == "none"
    assert panel.height(0.0) > panel.height(0.02)
    (only,) = panels(study(point("a", 1e5, error(0.0))))
    assert [word for _, word in only.ticks()] == ["exact"]


def test_a_legend_explains_what_there_is() -> None:
    said = [text for text, *_ in words(small(), "term")][5:]
    assert said == [
        "tree",
        "raw rules",
        "runtime",
        "peer",
        "best trade-off",
        "floor",
    ]
    bare = [text for text, *_ in words(study(point("a", 1e5, error(0.1))), "term")]
    assert bare[3:] == ["rules", "runtime", "best trade-off"]


def test_the_front_is_filled_bold_and_shows_what_was_observed_below_its_bound() -> None:
    bold = {text for text, *_ in words(small(), "bold")}
    assert bold == {"native", "native float32", "onnxruntime"}
    drawn = signs(small())
    assert drawn["native: raw rules"][-1]["class"] == "form k2 full"
    assert drawn["simpful: raw rules"][-1]["class"] == "form k2 hollow"
    _, line, _ = drawn["native float32: raw rules"]
    panel = panels(small())[0]
    ends = [panel.height(3e-5), panel.height(2e-6)]
    assert [float(line["y1"]), float(line["y2"])] == pytest.approx(ends, abs=0.06)


def test_peers_are_named_where_points_are_few() -> None:
    assert {"simpful", "scikit-learn"} <= {text for text, *_ in words(small(), "name")}
    made = large(150)
    fronts = [name for front in made.fronts for name in front.names]
    written = sorted(text for text, *_ in words(made, "name"))
    assert written == sorted(name.partition(":")[0] for name in fronts)
    assert len(signs(made)) == 150


@pytest.mark.parametrize("count", [8, 40, 150])
def test_names_lie_apart_and_within_the_picture(count: int) -> None:
    boxes: list[tuple[float, float, float, float]] = []
    for text, _, x, y, anchor in words(large(count), "name"):
        wide = 0.6 * 11.0 * len(text)
        left = x - wide * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        assert 92.0 <= left <= left + wide <= 788.0, text
        boxes.append((left, y - 9.0, left + wide, y + 2.0))
    assert boxes
    for a, b in itertools.combinations(boxes, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_the_words_above_name_model_rows_machine_and_data() -> None:
    assert [text for text, *_ in words(small())][:2] == [
        "grip: error against run time, 1,000 rows a call, 1 thread",
        "a processor, 2 cores, Linux 6; grasps.csv, 200 rows",
    ]
    early = replace(small(), is_complete=False)
    assert words(early)[0][0].endswith("1 thread (ended early)")
    assert "the columns read once" in [text for text, *_ in words(small())]


def test_other_rows_and_threads_make_another_picture() -> None:
    more = (timing(500.0, rows=1, threads=2),)
    made = study(point("native", 1e5, error(1e-3), more=more))
    assert "1 row a call, 2 threads" in words(made, rows=1, threads=2)[0][0]


def test_rows_that_were_not_measured_are_refused_with_those_that_were() -> None:
    with pytest.raises(ValueError, match="nothing was measured") as caught:
        work_precision(small(), rows=7)
    assert str(caught.value) == (
        "nothing was measured with 7 rows and 1 threads; "
        "rows and threads in this study: 1000 with 1"
    )


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 3.0])
def test_an_error_that_is_none_lies_at_one(wrong: float) -> None:
    made: list[Point] = [
        point("broken", 1e5, error(wrong)),
        point("a", 1e5, error(1e-3)),
    ]
    (panel,) = panels(study(*made))
    assert {one.error for one in panel.marks} == {1.0, 1e-3}


def test_a_png_is_sixteen_hundred_dots_wide(tmp_path: Path) -> None:
    if not HAS_EXTRA:
        pytest.skip("the extra is not installed")
    path = tmp_path / "study.PNG"
    picture = work_precision(small(), rows=1000)
    picture.save(path)
    content = path.read_bytes()
    assert struct.unpack(">I", content[16:20]) == (1600,)
    assert picture.content(".png") == content


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.pdf"
    picture = work_precision(small(), rows=1000)
    with pytest.raises(ValueError, match="ends in") as caught:
        picture.save(path)
    assert str(caught.value) == f"{path}: a picture's name ends in .svg or .png"
    picture.save(tmp_path / "new" / "study.svg")
    with pytest.raises(WriteError, match="is not a folder"):
        picture.save(tmp_path / "new" / "study.svg" / "study.svg")


def test_a_png_without_the_extra_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    with pytest.raises(MissingExtraError) as caught:
        work_precision(small(), rows=1000).content(".png")
    assert str(caught.value) == f"a PNG needs {install_hint('plots')}"


def test_close_times_still_have_a_number_on_their_axis() -> None:
    made = study(point("a", 3.1e5, error(1e-3)), point("b", 3.2e5, error(1e-4)))
    (panel,) = panels(made)
    assert [k for k in range(10) if panel.x.low < k < panel.x.high]


def test_shares_are_percent() -> None:
    assert {"1 %", "10 %"} <= {word for _, word in panels(small())[1].ticks()}


@pytest.mark.parametrize(
    ("nanoseconds", "text"),
    [(0.5, "0.5 ns"), (1.0, "1 ns"), (1e4, "10 µs"), (2.5e6, "2.5 ms"), (6e10, "60 s")],
)
def test_times_have_their_units(nanoseconds: float, text: str) -> None:
    assert time_text(nanoseconds) == text


def test_the_picture_of_the_docs_is_that_of_its_study() -> None:
    docs = Path(__file__).resolve().parents[2] / "docs" / "how-to"
    measured = msgspec.json.decode((docs / "bench.json").read_bytes(), type=Study)
    again = work_precision(measured, rows=1_000_000).svg
    assert (docs / "bench.svg").read_text("utf-8") == again

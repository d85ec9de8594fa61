"""Pictures carry the numbers of what they show, and the same bytes each time."""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
import itertools
import random
import re
import struct
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from fuzzytree.benchmarking.records import Kind, Point, Question, Study
from fuzzytree.errors import MissingExtraError, WriteError
from fuzzytree.report import plots
from fuzzytree.report.plots.precision import time_text
from fuzzytree.report.plots.sheet import drawn
from tests.benchmarking.studies import error, point, study, timing

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation, Text
    from matplotlib.transforms import Bbox

pytest.importorskip("matplotlib", reason="matplotlib is not installed")


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


@functools.cache
def picture() -> Figure:
    return plots.work_precision(small(), rows=1000)


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


def markers(figure: Figure) -> dict[str, tuple[float, float, Axes]]:
    """Return the place of every marker of a candidate, by its name."""
    found: dict[str, tuple[float, float, Axes]] = {}
    for axes in figure.axes:
        for bars in axes.containers:
            (x,), (y,) = bars.lines[0].get_data()  # type: ignore[attr-defined] # of errorbar
            found[str(bars.get_label())] = (float(x), float(y), axes)
    return found


def labels(figure: Figure) -> Iterator[Annotation]:
    from matplotlib.text import Annotation

    for axes in figure.axes:
        for words in axes.texts:
            if isinstance(words, Annotation) and words.get_gid() != "floor":
                yield words


def test_a_marker_lies_at_its_time_for_a_row_and_its_bound() -> None:
    found = markers(picture())
    assert found["native: raw rules"][:2] == (100.0, 1e-14)
    assert found["native float32: raw rules"][:2] == (40.0, 3e-5)


def test_what_is_not_certified_lies_at_what_was_observed() -> None:
    found = markers(picture())
    assert found["simpful: raw rules"][:2] == (90_000.0, 2e-3)


def test_a_tree_lies_at_its_share_of_other_classes_in_a_panel_of_its_own() -> None:
    found = markers(picture())
    time, share, axes = found["scikit-learn: tree"]
    assert (time, share) == (70.0, 0.02)
    assert axes is not found["native: raw rules"][2]
    assert axes.get_ylabel() == "rows with\nanother class"


def test_an_error_of_0_lies_on_a_line_that_says_so() -> None:
    found = markers(picture())
    _, height, axes = found["native: tree"]
    assert found["onnxruntime: tree"][1:] == (height, axes)
    assert height < found["scikit-learn: tree"][1]
    words = {float(y): t.get_text() for y, t in ticks(axes)}
    assert words[height] == "none"


def test_rules_without_an_error_are_called_exact() -> None:
    figure = plots.work_precision(study(point("a", 1e5, error(0.0))), rows=1000)
    assert [text.get_text() for _, text in ticks(figure.axes[0])] == ["exact"]


def ticks(axes: Axes) -> Iterator[tuple[float, Text]]:
    """Yield the height and the words of each tick."""
    return zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)


def test_a_legend_explains_what_there_is() -> None:
    words = [text.get_text() for text in picture().legends[0].get_texts()]
    assert words == [
        "tree",
        "raw rules",
        "runtime",
        "peer",
        "unbeaten",
        "floor",
    ]
    bare = plots.work_precision(study(point("a", 1e5, error(0.1))), rows=1000)
    words = [text.get_text() for text in bare.legends[0].get_texts()]
    assert words == ["rules", "runtime", "unbeaten"]


def test_a_bar_is_the_interval_of_the_median() -> None:
    one = point("native", 1e5, error(1e-3))
    figure = plots.work_precision(study(one), rows=1000)
    (bars,) = figure.axes[0].containers
    ends = bars.lines[2][0].get_segments()[0][:, 0]  # type: ignore[attr-defined]
    taken = one.timings[0]
    assert ends.tolist() == pytest.approx([taken.low_ns / 1e3, taken.high_ns / 1e3])


def test_the_front_is_labelled_and_filled() -> None:
    figure = picture()
    bold = {w.get_text() for w in labels(figure) if w.get_fontweight() == "bold"}
    assert bold == {"native", "native float32", "onnxruntime"}
    faces = {
        bars.get_label(): bars.lines[0].get_markerfacecolor()  # type: ignore[attr-defined]
        for axes in figure.axes
        for bars in axes.containers
    }
    assert faces["native: raw rules"] == "#00795a"
    assert faces["simpful: raw rules"] == "white"


def test_a_member_of_the_front_shows_what_was_observed_below_its_bound() -> None:
    figure = picture()
    axes = markers(figure)["native float32: raw rules"][2]
    drawn_lines = [np.asarray(line.get_xydata()).tolist() for line in axes.lines]
    assert [[40.0, 2e-6], [40.0, 3e-5]] in drawn_lines


def test_peers_are_named_where_points_are_few() -> None:
    names = {words.get_text() for words in labels(picture())}
    assert {"simpful", "scikit-learn"} <= names


@pytest.mark.heavy
def test_among_many_points_the_front_alone_is_labelled() -> None:
    made = large(150)
    figure = plots.work_precision(made, rows=1000)
    fronts = [name for front in made.fronts for name in front.names]
    written = sorted(words.get_text() for words in labels(figure))
    assert written == sorted(name.partition(":")[0] for name in fronts)
    assert len(markers(figure)) == 150


@pytest.mark.one_in(3)
@pytest.mark.parametrize("count", [8, 40, 150])
def test_labels_lie_apart_and_within_their_axes(count: int) -> None:
    from matplotlib.text import Text

    figure = plots.work_precision(large(count), rows=1000)
    figure.draw_without_rendering()
    boxes: list[Bbox] = []
    for words in labels(figure):
        extent = Text.get_window_extent(words)  # without the line to its point
        frame = words.axes.get_window_extent() if words.axes else extent
        assert frame.x0 <= extent.x0 <= extent.x1 <= frame.x1, words.get_text()
        assert frame.y0 <= extent.y0 <= extent.y1 <= frame.y1, words.get_text()
        boxes.append(extent)
    assert boxes
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_floors_are_lines_with_their_names() -> None:
    figure = picture()
    (name,) = [t for a in figure.axes for t in a.texts if t.get_gid() == "floor"]
    assert name.get_text() == "the columns read once"
    for axes in figure.axes:
        assert [5.0, 5.0] in [
            np.asarray(line.get_xdata()).tolist() for line in axes.lines
        ]


def test_the_words_above_name_model_rows_machine_and_data() -> None:
    figure = picture()
    assert [words.get_text() for words in figure.texts] == [
        "grip: error against run time, 1,000 rows a call, 1 thread",
        "a processor, 2 cores, Linux 6; grasps.csv, 200 rows",
    ]


def test_a_study_that_ended_early_says_so() -> None:
    from msgspec.structs import replace

    early = replace(small(), is_complete=False)
    title = plots.work_precision(early, rows=1000).texts[0].get_text()
    assert title.endswith("1 thread (ended early)")


def test_other_rows_and_threads_make_another_picture() -> None:
    more = (timing(500.0, rows=1, threads=2),)
    made = study(point("native", 1e5, error(1e-3), more=more))
    figure = plots.work_precision(made, rows=1, threads=2)
    assert markers(figure)["native: rules"][:2] == (500.0, 1e-3)
    assert "1 row a call, 2 threads" in figure.texts[0].get_text()


def test_rows_that_were_not_measured_are_refused_with_those_that_were() -> None:
    with pytest.raises(ValueError, match="nothing was measured") as caught:
        plots.work_precision(small(), rows=7)
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
    assert (
        markers(plots.work_precision(study(*made), rows=1000))["broken: rules"][1]
        == 1.0
    )


def test_a_study_whose_errors_are_all_0_has_one_line() -> None:
    figure = plots.work_precision(study(point("a", 1e5, error(0.0))), rows=1000)
    assert len(figure.axes) == 1


@pytest.mark.one_in(2)
@pytest.mark.parametrize("suffix", plots.SUFFIXES)
def test_the_same_study_gives_the_same_bytes(suffix: str) -> None:
    again = plots.work_precision(small(), rows=1000)
    assert drawn(picture(), suffix) == drawn(again, suffix)


@pytest.mark.heavy
def test_a_users_settings_change_nothing() -> None:
    import matplotlib as mpl

    plain = drawn(picture(), ".svg")
    with mpl.rc_context({"font.size": 20, "axes.grid": True, "svg.fonttype": "none"}):
        again = plots.work_precision(small(), rows=1000)
        assert drawn(again, ".svg") == plain
        assert mpl.rcParams["font.size"] == 20


def test_an_svg_is_well_formed_and_has_no_date(tmp_path: Path) -> None:
    path = tmp_path / "study.svg"
    plots.save(picture(), path)
    text = path.read_text()
    assert ET.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    assert "<text" not in text  # letters are paths
    assert not re.search(r"dc:date|20\d\d-\d\d-\d\d", text)


def test_a_png_is_sixteen_hundred_dots_wide(tmp_path: Path) -> None:
    path = tmp_path / "study.PNG"
    figure = picture()
    plots.save(figure, path)
    content = path.read_bytes()
    width, height = struct.unpack(">II", content[16:24])
    assert (width, height) == (1600, round(figure.get_figheight() * 200))
    assert b"Software" not in content


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.pdf"
    with pytest.raises(ValueError, match="ends in") as caught:
        plots.save(picture(), path)
    assert str(caught.value) == f"{path}: a picture's name ends in .svg or .png"
    assert not path.exists()


def test_a_place_that_is_none_is_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "study.svg"
    with pytest.raises(WriteError, match="there is no folder"):
        plots.save(picture(), path)


def test_drawing_without_matplotlib_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(MissingExtraError) as caught:
        plots.work_precision(small(), rows=1000)
    assert str(caught.value) == (
        "drawing pictures needs matplotlib: pip install 'matplotlib>=3.8'"
    )


def test_drawing_leaves_no_figure_in_the_librarys_state() -> None:
    import matplotlib.pyplot as plt

    before = plt.get_fignums()
    plots.work_precision(small(), rows=1000)
    assert plt.get_fignums() == before


def test_close_times_still_have_a_number_on_their_axis() -> None:
    made = study(point("a", 3.1e5, error(1e-3)), point("b", 3.2e5, error(1e-4)))
    axes = plots.work_precision(made, rows=1000).axes[0]
    low, high = axes.get_xlim()
    assert [time for time in (10.0, 100.0, 1e3) if low < time < high]


def test_shares_are_percent() -> None:
    figure = picture()
    axes = markers(figure)["scikit-learn: tree"][2]
    figure.draw_without_rendering()
    shown = [tick.get_text() for tick in axes.get_yticklabels(which="both")]
    assert {text for text in shown if text} >= {"1 %", "10 %"}
    assert not any("times" in text for text in shown)


@pytest.mark.parametrize(
    ("nanoseconds", "text"),
    [(0.5, "0.5 ns"), (1.0, "1 ns"), (1e4, "10 µs"), (2.5e6, "2.5 ms"), (6e10, "60 s")],
)
def test_times_have_their_units(nanoseconds: float, text: str) -> None:
    assert time_text(nanoseconds) == text


@pytest.mark.heavy
def test_the_picture_of_the_docs_is_that_of_its_study(tmp_path: Path) -> None:
    docs = Path(__file__).resolve().parents[2] / "docs" / "how-to"
    measured = msgspec.json.decode((docs / "bench.json").read_bytes(), type=Study)
    drawn_by = "3.11.2"
    if importlib.metadata.version("matplotlib") != drawn_by:
        pytest.skip(f"drawn by matplotlib {drawn_by}, and others place letters apart")
    again = tmp_path / "bench.svg"
    plots.save(plots.work_precision(measured, rows=1_000_000), again)
    assert again.read_bytes() == (docs / "bench.svg").read_bytes()

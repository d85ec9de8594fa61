"""`fuzzytree bench` measures, reports, writes, and survives what users do."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from fuzzytree import api
from fuzzytree.benchmarking.records import Omission, OutputError, Study
from fuzzytree.errors import install_hint
from fuzzytree.report.bench import study_lines
from fuzzytree.report.text import duration
from tests.benchmarking.studies import error, point, study, timing
from tests.cli.conftest import Call

pytestmark = pytest.mark.usefixtures("few_objects")

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "bench"
FAST = ("--rows", "8", "--threads", "1", "--budget", "1", "--select", "native")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def made() -> Study:
    """Return a study with everything that a table can show."""
    return study(
        point("floor: the columns read once", 500.0, None, kind="floor"),
        point(
            "native",
            200_000.0,
            error(2e-16, 1e-15),
            probes=error(None, flips=2, rows=50),
            more=(timing(9_000.0, rows=1),),
        ),
        point("onnxruntime mixed", 100_000.0, error(8e-8, 3e-7)),
        point("native, points 1e-01", 150_000.0, error(0.08, 0.09), kind="variant"),
        point("a peer", 4e9, error(None, flips=3), kind="peer"),
    )


def test_the_report_says_all_that_was_found() -> None:
    expected = (GOLDEN / "report.txt").read_text("utf-8")
    assert "\n".join(study_lines(made(), is_verbose=True)) + "\n" == expected


def test_the_error_of_each_output_stands_in_its_unit_and_as_a_share() -> None:
    outputs = {"fan": OutputError(0.5, 0.005, 0.75), "valve": OutputError(0.0, 0.0)}
    fan = replace(error(0.005, 0.0075), outputs=outputs)
    lines = study_lines(study(point("c", 9e4, fan, question="system")), is_verbose=True)
    shown = [line.split() for line in lines if line.startswith(("  fan", "  valve"))]
    assert shown == [
        ["fan,", "c", "5.0e-01", "5.0e-03", "7.5e-01"],
        ["valve,", "c", "0.0e+00", "0.0e+00", "-"],
    ]


def test_all_variants_are_listed_on_request() -> None:
    lines = [*study_lines(made(), is_verbose=True)]
    assert any(line.startswith("  native, points 1e-01") for line in lines)
    assert not any("something beats" in line for line in lines)


@pytest.mark.parametrize(
    ("ns", "text"),
    [
        (0.02, "0.0200 ns"),
        (999.0, "999 ns"),
        (1000.0, "1.00 µs"),
        (123_456.0, "123 µs"),
        (5e6, "5.00 ms"),
        (2.5e9, "2.50 s"),
    ],
)
def test_a_time_has_three_digits_and_a_unit(ns: float, text: str) -> None:
    assert duration(ns) == text


def test_a_study_goes_to_stdout_with_its_advice_first(call: Call) -> None:
    code, out, err = call("bench", "grip.yaml", "--data", "grasps.csv", *FAST)
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith(
        "tree, 8 rows: fastest without a changed class in 4 rows"
    )
    assert "grip: grasps.csv, 4 rows, repeated to make 8; " in out
    starts = [line.split("  ")[0] for line in lines]
    assert {"computes", "tree", "relative rules"} <= {*starts}
    assert err == ""
    full = call("bench", "grip.yaml", "--data", "grasps.csv", "--verbose", *FAST)[1]
    assert "8 rows, 1 thread" in full.splitlines()
    assert "tree" in full.splitlines()


@pytest.mark.heavy
def test_without_data_rows_are_made_and_that_is_said(call: Call) -> None:
    _, out, _ = call("bench", "rules.yaml", "--seed", "5", *FAST)
    assert (
        "rules: 8 rows made from the model's declared ranges, seed 5; "
        "'slip' declares none: from terms or combinations; "
    ).partition(": ")[2] in " ".join(out.split())


@pytest.mark.heavy
def test_json_goes_to_stdout_and_to_a_file(call: Call) -> None:
    code, out, err = call("bench", "grip.yaml", "--json", "-o", "study.json", *FAST)
    assert code == 0
    facts = json.loads(out)
    assert [point["question"] for point in facts["points"]] == [
        "tree",
        "relative rules",
    ]
    assert json.loads(Path("study.json").read_bytes()) == facts
    assert "wrote    study.json" in err.splitlines()


@pytest.mark.heavy
def test_a_named_module_adds_candidates_and_omissions(call: Call) -> None:
    Path("my_peers.py").write_text(
        "from fuzzytree.benchmarking.records import Omission\n"
        "def peers(model, bounds):\n"
        "    return [], [Omission('my peer', 'it has no licence')]\n",
        "utf-8",
    )
    words = ("bench", "grip.yaml", "--peers", "my_peers.py", "--json", *FAST)
    code, out, err = call(*words)
    assert (code, err) == (1, "no peer of my_peers.py was measured\n")
    omission = {"name": "my peer", "why": "it has no licence", "is_peer": True}
    assert omission in json.loads(out)["omissions"]


def test_a_study_without_the_peers_asked_for_names_them_and_exits_with_1(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    why = "it did not answer within 60 s"
    left = (
        Omission("a peer: rules", why, is_peer=True),
        Omission("other: rules", why, is_peer=True),
    )
    found = replace(study(point("native", 9.0, error(0.0))), omissions=left)
    monkeypatch.setattr(api, "bench", lambda *_, **__: found)
    code, out, err = call("bench", "grip.yaml", "--peers", "some.py")
    assert (code, err) == (1, "no peer of some.py was measured\n")
    assert out.splitlines()[2] == (
        "peers left out: a peer (rules), other (rules): it did not answer within 60 s"
    )
    assert "candidate" not in out.splitlines()[-2]


@pytest.mark.heavy
def test_quiet_says_nothing_but_the_study(call: Call) -> None:
    code, out, err = call("bench", "grip.yaml", "--quiet", *FAST)
    assert (code, err) == (0, "")
    assert out


def test_a_wanted_error_is_in_the_advice(call: Call) -> None:
    _, out, _ = call("bench", "rules.yaml", "--error", "1e-4", *FAST)
    first = " ".join(out.split()).partition("rules, 8 rows: ")[2]
    assert first.startswith("fastest within an error of 0.0001: native")


def test_an_interrupted_study_is_reported_and_exits_with_130(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = replace(made(), is_interrupted=True, is_complete=False)
    monkeypatch.setattr(api, "bench", lambda *_, **__: found)
    code, out, err = call("bench", "grip.yaml", "-o", "study.json")
    assert code == 130
    assert out.startswith("rules, 1,000 rows: fastest within an error of 1e-15")
    assert json.loads(Path("study.json").read_bytes())["is_interrupted"] is True
    assert (
        err.splitlines()[-1] == "interrupted; the result has what was measured before"
    )


def test_an_error_beyond_the_certified_one_exits_with_1(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = study(point("native", 9.0, error(1e-3, 1e-6)))
    monkeypatch.setattr(api, "bench", lambda *_, **__: found)
    code, _, err = call("bench", "grip.yaml")
    assert code == 1
    assert err == (
        "native: rules: an error of 0.001 is larger than the certified 1e-06; "
        "this is a fault\n"
    )


def test_what_libraries_print_is_no_part_of_the_answer(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def talkative(*_: object, **__: object) -> Study:
        sys.stdout.write("welcome to a library\n")
        return made()

    monkeypatch.setattr(api, "bench", talkative)
    _, out, err = call("bench", "grip.yaml", "--json")
    assert json.loads(out)["model"] == "grip"
    assert err.startswith("welcome to a library\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rows", "0"), "rows: 1 is the least, not 0"),
        (("--threads", "-1"), "threads: 1 is the least, not -1"),
        (("--budget", "-5"), "the budget must be a number of seconds above 0, not -5"),
        (
            ("--budget", "inf"),
            "the budget must be a number of seconds above 0, not inf",
        ),
        (("--seed", "-1"), "seed: 0 is the least, not -1"),
        (("--error", "2"), "an error of a strength lies in [0, 1], not at 2"),
        (("--peers", "absent"), "peers: 'absent' is not a Python module or package"),
        (("--picture", "a.pdf"), "--picture a.pdf: a picture ends in .svg or .png"),
    ],
)
def test_an_option_that_cannot_be_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    expected = f"{message}\n  fuzzytree bench --help lists the options\n"
    assert call("bench", "grip.yaml", *words) == (2, "", expected)


def test_an_unknown_candidate_is_one_sentence(call: Call) -> None:
    code, out, err = call("bench", "grip.yaml", "--select", "nativ")
    assert (code, out) == (2, "")
    assert err.startswith("no candidate 'nativ'; there is floor: the columns read once")
    assert "or all of tree, floor, " in err
    assert "points" not in err
    assert err.splitlines()[0].endswith(" (did you mean 'native'?)")


@pytest.mark.heavy
def test_what_a_model_does_not_have_can_be_skipped(call: Call) -> None:
    assert call("bench", "grip.yaml", "--skip", "rules", *FAST)[0] == 0
    code, _, err = call("bench", "grip.yaml", "--select", "rules", "--budget", "1")
    assert code == 2
    assert err == (
        "no candidate is left to measure\n  fuzzytree bench --help lists the options\n"
    )


def test_a_table_without_rows_is_one_sentence(call: Call) -> None:
    Path("none.csv").write_text("slip,force\n", "utf-8")
    expected = (2, "", "none.csv has no rows\n")
    assert call("bench", "grip.yaml", "--data", "none.csv", *FAST) == expected


@pytest.mark.heavy
def test_pictures_are_drawn_for_most_rows(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("resvg_py")
    pytest.importorskip("font_roboto")
    monkeypatch.setattr(api, "bench", lambda *_, **__: made())
    code, _, err = call(
        "bench", "grip.yaml", "--picture", "a.svg", "--picture", "a.png"
    )
    assert code == 0
    assert err.splitlines()[:2] == ["wrote    a.svg", "wrote    a.png"]
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")
    assert Path("a.svg").read_text("utf-8").startswith("<svg")


def test_a_study_of_nothing_leaves_files_as_they_were(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("a.json").write_text("an earlier study", "utf-8")
    words = ("bench", "grip.yaml", "--picture", "a.svg", "-o", "a.json")
    monkeypatch.setattr(api, "bench", lambda *_, **__: study())
    code, out, err = call(*words)
    assert (code, err) == (2, "nothing could be measured\n")
    assert "\n1 candidate left out\n" in out
    early = replace(study(), is_interrupted=True, is_complete=False)
    monkeypatch.setattr(api, "bench", lambda *_, **__: early)
    code, _, err = call(*words)
    assert (code, err) == (
        130,
        "interrupted; nothing was measured, and files are as they were\n",
    )
    assert Path("a.json").read_text("utf-8") == "an earlier study"
    assert not Path("a.svg").exists()


def test_a_place_that_cannot_be_written_is_reported_before_any_work(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api, "bench", None)
    Path("file").touch()
    message = "file/such.json: cannot be written: 'file' is not a folder\n"
    assert call("bench", "grip.yaml", "-o", "file/such.json") == (2, "", message)
    code, _, err = call("bench", "grip.yaml", "--picture", "file/such.svg")
    assert (code, err) == (2, message.replace("json", "svg"))


def test_a_missing_extra_for_pictures_is_named(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    message = f"a PNG needs {install_hint('plots')}\n"
    assert call("bench", "grip.yaml", "--picture", "a.png") == (2, "", message)


def test_a_model_that_is_no_yaml_is_one_sentence(call: Call) -> None:
    code, out, err = call("bench", "grip.onnx", *FAST)
    assert (code, out) == (2, "")
    assert "is not read back as a model; keep the file" in err

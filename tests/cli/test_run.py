"""`fuzzytree run` answers rows, and says what was out of the ordinary."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fuzzytree import api, tables
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.testing import rated
from tests.cli.conftest import GRASPS, Call

ANSWERS = (
    "class,rule,status\nsoft,1,decided\nfirm,3,decided\nloose,2,decided\n,0,missing\n"
)
TALLY = (
    "predicted 4 rows firm 1, loose 1, soft 1, no class 1\n"
    "status    0 rows decided by the order of the rules; 0 rows with no rule fired; "
    "1 row with a missing input\n"
    "missing   1 cell in the inputs\n"
    "ignored   2 columns\n"
)


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


@pytest.mark.parametrize("model", ["grip.yaml", "rules.yaml"])
def test_rows_are_answered_on_stdout_and_counted_on_stderr(
    call: Call, model: str
) -> None:
    assert call("run", model, "grasps.csv") == (0, ANSWERS, TALLY)


def test_an_onnx_file_answers_like_the_tree_but_reports_no_ties(call: Call) -> None:
    tally = TALLY.replace(
        "0 rows decided by the order of the rules", "ties: not reported by this file"
    )
    assert call("run", "grip.onnx", "grasps.csv") == (0, ANSWERS, tally)


def test_a_stream_is_answered_like_a_file(call: Call) -> None:
    assert call("run", "grip.yaml", "-", stdin=GRASPS.encode())[1] == ANSWERS


def test_a_parquet_file_is_answered_like_its_csv(call: Call) -> None:
    table = pa.table({"force": [1.5, 2.5, 3, None], "slip": [0, 1, 0, 1]})
    pq.write_table(table, "grasps.parquet")
    assert call("run", "grip.yaml", "grasps.parquet")[1] == ANSWERS


def test_many_pieces_give_the_answers_of_one(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "PIECE", 1)
    assert call("run", "grip.yaml", "grasps.csv") == (0, ANSWERS, TALLY)


def test_a_file_appears_with_all_answers(call: Call) -> None:
    code, out, err = call("run", "grip.yaml", "grasps.csv", "-o", "out.csv")
    assert (code, out) == (0, "")
    assert err == TALLY + "wrote     out.csv\n"
    assert Path("out.csv").read_text("utf-8") == ANSWERS


def test_a_bad_row_leaves_the_old_file(call: Call) -> None:
    Path("out.csv").write_text("old", "utf-8")
    Path("bad.csv").write_text("force,slip\n1,1\nwet,2\n", "utf-8")
    code, out, err = call("run", "grip.yaml", "bad.csv", "-o", "out.csv")
    assert (code, out) == (2, "")
    assert err == (
        "bad.csv:3: column 'force' holds text where a number is needed: 'wet'\n"
    )
    assert Path("out.csv").read_text("utf-8") == "old"


def test_no_rows_give_a_head_line(call: Call) -> None:
    Path("none.csv").write_text("force,slip\n", "utf-8")
    assert call("run", "grip.yaml", "none.csv")[:2] == (0, "class,rule,status\n")


def test_strengths_are_reported_for_each_class(call: Call) -> None:
    out = call("run", "grip.yaml", "grasps.csv", "--strengths", "class")[1]
    assert out.splitlines() == [
        "class,rule,status,strength of class firm,strength of class loose,"
        "strength of class soft",
        "soft,1,decided,0.5,0.75,1.0",
        "firm,3,decided,1.0,0.5,0.75",
        "loose,2,decided,0.5,1.0,0.5",
        ",0,missing,,,",
    ]


def test_strengths_are_reported_for_each_rule(call: Call) -> None:
    out = call("run", "rules.yaml", "grasps.csv", "--strengths", "rule")[1]
    assert out.splitlines()[:2] == [
        "class,rule,status,strength of rule 1,strength of rule 2,strength of rule 3",
        "soft,1,decided,1.0,0.75,0.5",
    ]


def test_a_file_without_strengths_cannot_report_them(call: Call) -> None:
    code, _, err = call("run", "grip.onnx", "grasps.csv", "--strengths", "class")
    assert code == 2
    assert err == (
        "--strengths class: grip.onnx does not report them; export it with "
        "--outputs label,rule,status,strengths, or run the YAML file\n"
        "  fuzzytree run --help lists the options\n"
    )


def test_why_reports_the_rule_and_its_degrees(call: Call) -> None:
    out = call("run", "grip.yaml", "grasps.csv", "--why")[1]
    assert out.splitlines() == [
        "class,rule,status,why",
        "soft,1,decided,IF force is low THEN soft",
        "firm,3,decided,IF force is high AND slip is much THEN firm",
        "loose,2,decided,IF force is high AND slip is none THEN loose",
        ",0,missing,no finite value: force",
    ]


def test_why_needs_the_rules(call: Call) -> None:
    code, _, err = call("run", "grip.onnx", "grasps.csv", "--why")
    assert code == 2
    assert err == (
        "--why: grip.onnx does not contain the rules as text; run the YAML file\n"
        "  fuzzytree run --help lists the options\n"
    )


def test_the_columns_of_the_table_can_be_kept(call: Call) -> None:
    out = call("run", "grip.yaml", "grasps.csv", "--keep")[1]
    assert out.splitlines()[:2] == [
        "slip,force,note,grip,class,rule,status",
        "0,1.5,a,soft,soft,1,decided",
    ]


def test_a_kept_column_of_the_same_name_is_refused(call: Call) -> None:
    Path("named.csv").write_text("force,slip,class\n1,1,x\n", "utf-8")
    code, _, err = call("run", "grip.yaml", "named.csv", "--keep")
    assert code == 2
    assert err == (
        "named.csv has a column 'class' of its own; leave out --keep, "
        "or rename the column\n"
    )


def test_json_lines_hold_the_same_facts(call: Call) -> None:
    out = call("run", "grip.yaml", "grasps.csv", "--json", "--quiet")[1]
    first, *_, last = map(json.loads, out.splitlines())
    assert first == {"class": "soft", "rule": 1, "status": "decided"}
    assert last == {"class": None, "rule": 0, "status": "missing"}


def test_quiet_says_nothing(call: Call) -> None:
    assert call("run", "grip.yaml", "grasps.csv", "--quiet") == (0, ANSWERS, "")


@pytest.mark.parametrize(
    "runtime", ["reference", "native", "best-first", "onnxruntime float64"]
)
def test_every_runtime_gives_the_answers(call: Call, runtime: str) -> None:
    words = ("run", "rules.yaml", "grasps.csv", "--runtime", runtime)
    assert call(*words)[:2] == (0, ANSWERS)


def test_a_runtime_that_cannot_carry_the_model_says_so(call: Call) -> None:
    code, _, err = call("run", "grip.yaml", "grasps.csv", "--runtime", "best-first")
    assert code == 2
    assert err == "cannot run grip in best-first: it runs rules, not a tree\n"


def test_an_onnx_file_has_its_own_runtime(call: Call) -> None:
    code, _, err = call("run", "grip.onnx", "grasps.csv", "--runtime", "native")
    assert code == 2
    assert err == (
        "runtime 'native': an ONNX file runs in onnxruntime; other runtimes need "
        "the YAML file\n"
        "  fuzzytree run --help lists the options\n"
    )


def test_a_missing_column_is_named(call: Call) -> None:
    Path("few.csv").write_text("slipp,force\n1,2\n", "utf-8")
    code, out, err = call("run", "grip.yaml", "few.csv")
    assert (code, out) == (2, "")
    assert err == (
        "few.csv has no column 'slip', which the model needs; it has slipp, force "
        "(did you mean 'slipp'?)\n"
    )


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("absent.yaml", "absent.yaml: cannot be read: no such file or directory\n"),
        ("absent.onnx", "absent.onnx: cannot be read: no such file or directory\n"),
        (
            "grip",
            "grip: has no suffix that names its format; models are read from yaml, "
            "fcl, fll, fis, fml\n",
        ),
        (
            "grasps.csv",
            "grasps.csv: is a table, and a model stands here: `fuzzytree run MODEL "
            "TABLE`, and `--data TABLE` for other verbs\n",
        ),
        (
            "grip.py",
            "grip.py: a file in the format python is not read back as a model; "
            "keep the file that it was made of\n",
        ),
        ("broken.onnx", "broken.onnx: this is no ONNX file, or only a part of one\n"),
    ],
)
def test_a_file_that_is_no_model_is_one_sentence(
    call: Call, name: str, message: str
) -> None:
    Path("broken.onnx").write_bytes(b"no onnx")
    assert call("run", name, "grasps.csv") == (2, "", message)


def test_blanks_around_names_are_left_out_with_a_remark(call: Call) -> None:
    Path("blanks.csv").write_text(" force, slip\n1.0,0\n")
    code, _, said = call("run", "grip.yaml", "blanks.csv")
    text = "blanks around its name, which are left out (and 1 more)"
    assert code == 0
    assert f"remark    ' force' has {text}" in said.splitlines()


def test_probabilities_are_reported_for_each_class(call: Call) -> None:
    tree = api.load("grip.yaml")
    assert isinstance(tree, FuzzyTree)
    api.save(rated(tree, 3), "rated.yaml")
    out = call("run", "rated.yaml", "grasps.csv", "--probabilities")[1]
    head, first, *_, last = out.splitlines()
    assert head == (
        "class,rule,status,probability of class firm,probability of class loose,"
        "probability of class soft"
    )
    shares = [*map(float, first.split(",")[3:])]
    assert abs(sum(shares) - 1.0) <= 1e-15
    assert first.startswith("soft,1,decided,")
    assert max(shares) == shares[2]
    assert last == ",0,missing,,,"


def test_a_model_without_probabilities_cannot_report_them(call: Call) -> None:
    code, _, err = call("run", "grip.yaml", "grasps.csv", "--probabilities")
    assert code == 2
    assert err == (
        "grip has no probabilities of classes\n"
        "  fuzzytree run --help lists the options\n"
    )

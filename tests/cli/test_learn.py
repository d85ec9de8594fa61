"""`fuzzytree learn` says what it read, learnt, tested and wrote."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import msgspec
import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.cli.learn import command
from fuzzytree.learning import LearningSettings
from fuzzytree.model import fingerprint
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from tests.cli.conftest import Call

ROOT = Path(__file__).resolve().parent.parent.parent
WINE = str(ROOT / "examples" / "wine" / "wine.csv")
SCHEMAS = ROOT / "schemas"
HELP = "\n  fuzzytree learn --help lists the options\n"
FEW = "a,grip\n" + "".join(f"{k},{'soft' if k < 6 else 'firm'}\n" for k in range(12))


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("few.csv").write_text(FEW, "utf-8")


def _refused(call: Call, text: str, *words: str) -> str:
    Path("t.csv").write_text(text, "utf-8")
    Path("t.yaml").write_text("old", "utf-8")
    more = words or ("--target", "grip")
    code, out, err = call("learn", "t.csv", "-o", "t.yaml", "--quiet", *more)
    assert (code, out) == (2, "")
    assert Path("t.yaml").read_text("utf-8") == "old"
    return err


def test_five_lines_report_what_happened(call: Call) -> None:
    code, out, err = call("learn", "few.csv", "--target", "grip", "-o", "few.yaml")
    assert (code, out) == (0, "")
    assert re.sub(r"[0-9.]+ s$", "0 s", err, flags=re.MULTILINE) == (
        "accuracy 0.900    cross-validated (majority class 0.500; 5 folds: 0.500 to "
        "1.000), 0 s\n"
        "learnt   2 leaves depth 1, 1 of 1 columns, 0 s\n"
        "read     few.csv  12 rows, 1 column, 2 classes, 0 s\n"
        "adjusted 2 sets   fitted to rows that the paper's method does not expect; "
        "--verbose\n"
        "wrote    few.yaml next: fuzzytree check few.yaml --data few.csv\n"
    )
    tree = ft.load("few.yaml")
    assert isinstance(tree, FuzzyTree)
    assert tree.name == "few"


def test_what_was_left_out_is_reported(call: Call) -> None:
    lines = [f"{k},7,{'soft' if k < 6 else 'firm'}" for k in range(12)]
    text = "\n".join(["a,same,grip", *lines, "NA,7,soft", "3,7,", ""])
    Path("t.csv").write_text(text, "utf-8")
    words = ("learn", "t.csv", "--target", "grip", "-o", "t.yaml", "--no-test")
    err = call(*words, "--verbose")[2]
    assert re.sub(r"[0-9.]+ s$", "0 s", err, flags=re.MULTILINE) == (
        "learnt   2 leaves depth 1, 1 of 2 columns, 0 s\n"
        "read     t.csv    13 rows, 2 columns, 2 classes "
        "(1 missing cell, 1 row without a class left out), 0 s\n"
        "filled   1 row    a value is missing; what stands for it is part of the "
        "model\n"
        "ignored  1 column constant or too large: same\n"
        "adjusted 2 sets   sets with a fuller window than the middle one: 1; points "
        "clipped to 1: 3; sides whose polynomial rises: 1\n"
        "wrote    t.yaml   next: fuzzytree check t.yaml --data t.csv\n"
    )


def test_a_sample_is_reported_where_not_all_rows_are_kept(call: Call) -> None:
    words = ("learn", "few.csv", "--target", "grip", "-o", "few.yaml", "--no-test")
    err = call(*words, "--rows-per-class", "4")[2]
    # Rows that are powers of two apart are kept together or not at all.
    assert (
        "sampled   6 rows             learnt from 4 of 6 rows of class 'firm', 2 of 6 "
        "rows of class 'soft'\n"
    ) in err
    assert "sampled" not in call(*words)[2]


def test_a_large_table_is_tested_on_a_sample(call: Call) -> None:
    numbers = np.random.default_rng(0).normal(size=(21_000, 2)).round(3)
    numbers += 9.0 * (np.arange(21_000) % 2)[:, None]
    lines = [f"{a},{b},{k % 2}" for k, (a, b) in enumerate(numbers)]
    Path("t.csv").write_text("\n".join(["a,b,grip", *lines, ""]), "utf-8")
    err = call("learn", "t.csv", "--target", "grip", "-o", "t.yaml")[2]
    assert re.sub(r", [0-9.]+ s$", "", err.splitlines()[0]) == (
        "accuracy 1.000            cross-validated (majority class 0.500; 5 folds on "
        "20,000 of 21,000 rows: 1.000 to 1.000)"
    )


def test_a_large_table_tests_the_tree_itself(call: Call) -> None:
    values = np.random.default_rng(0).normal(size=4_200).round(6)
    lines = [f"{a + 9.0 * (k % 2)},{k % 2}" for k, a in enumerate(values)]
    Path("t.csv").write_text("\n".join(["a,grip", *lines, ""]), "utf-8")
    words = ("learn", "t.csv", "--target", "grip", "-o", "t.yaml", "--rows-per-class")
    _, out, err = call(*words, "900", "--json")
    assert re.sub(r", [0-9.]+ s$", "", err.splitlines()[0]) == (
        "accuracy  1.000              on 2,400 rows that it was not learnt from "
        "(majority class 0.500)"
    )
    facts = json.loads(out)
    assert (facts["accuracy"], facts["folds"], facts["rows_tested"]) == (1, None, 2400)
    assert facts["report"]["sampled"] == {"0": [900, 2100], "1": [900, 2100]}


def test_an_identifier_is_remarked_on_before_learning(call: Call) -> None:
    lines = [f"{k},{k % 7 + 9 * (k % 2)},{k % 2}" for k in range(30)]
    Path("t.csv").write_text("\n".join(["row id,a,grip", *lines, ""]), "utf-8")
    words = ("learn", "t.csv", "--target", "grip", "-o", "t.yaml", "--no-test")
    code, out, err = call(*words, "--json")
    said = (
        "a different whole number in each row, as an identifier has; "
        "--ignore 'row id' leaves it out"
    )
    assert code == 0
    assert err.splitlines()[2] == f"remark   row id   has {said}"
    assert json.loads(out)["remarks"] == {"row id": said}
    assert "remark" not in call(*words, "--ignore", "row id")[2]


def test_a_continuous_target_is_refused(call: Call) -> None:
    err = _refused(
        call,
        Path(WINE).read_text("utf-8"),
        "--target",
        "alcohol",
        "--ignore",
        "cultivar",
    )
    assert err == (
        "t.csv: the target 'alcohol' is continuous, with 126 different numbers in 178 "
        "rows, and a tree predicts classes; divide the numbers into ranges and learn "
        "these, or pass --categorical alcohol if each is a class\n"
    )


def test_whole_numbers_with_gaps_are_classes_only_if_somebody_says_so(
    call: Call,
) -> None:
    rows = "".join(f"{k % 7},{3 * (k % 61)}\n" for k in range(600))
    err = _refused(call, f"a,t\n{rows}", "--target", "t")
    assert err == (
        "t.csv: the target 't' is continuous, with 61 different numbers in 600 rows, "
        "and a tree predicts classes; divide the numbers into ranges and learn these, "
        "or pass --categorical t if each is a class\n"
    )
    words = ("learn", "t.csv", "--target", "t", "--no-test", "-o", "m.yaml")
    assert call(*words, "--categorical", "t")[0] == 0
    codes = "".join(f"{k % 7},{k % 61}\n" for k in range(600))
    Path("t.csv").write_text(f"a,t\n{codes}", "utf-8")
    assert call(*words)[0] == 0


def test_a_tree_that_learnt_nothing_says_so(call: Call) -> None:
    rows = "".join(f"{k % 2},{'ab'[k % 3 == 0]}\n" for k in range(60))
    Path("t.csv").write_text(f"a,t\n{rows}", "utf-8")
    code, _, err = call("learn", "t.csv", "--target", "t", "-o", "m.yaml")
    assert code == 0
    said = " ".join(err.split())
    assert "remark the tree has one leaf: it predicts 'a' for every row" in said
    assert "remark accuracy is not above the share of the majority class" in said


def test_a_column_in_the_place_of_a_table_is_named(call: Call) -> None:
    Path("t.csv").write_text("a,class\n1,x\n", "utf-8")
    assert call("learn", "t.csv", "class", "-o", "m.yaml") == (
        2,
        "",
        "there is no file 'class'; if it is the column of the classes, pass --target "
        "class\n  fuzzytree learn --help lists the options\n",
    )


def test_json_reports_the_same_facts(call: Call) -> None:
    code, out, err = call(
        "learn", WINE, "--target", "cultivar", "-o", "wine.yaml", "--json", "--quiet"
    )
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["rows"] == 178
    assert facts["classes"] == ["barbera", "barolo", "grignolino"]
    assert facts["accuracy"] == sum(facts["folds"]) / 5 > 0.9
    assert facts["majority"] == 71 / 178
    assert facts["rows_tested"] == 178
    schema = json.loads((SCHEMAS / "learn.schema.json").read_text("utf-8"))
    jsonschema.validate(facts, schema)
    assert facts["report"]["mode"] == "default"


def test_a_stream_gives_the_tree_of_the_file(call: Call) -> None:
    words = ("--target", "grip", "--name", "few", "--quiet")
    call("learn", "few.csv", "-o", "few.yaml", *words)
    code, out, err = call("learn", "-", "-o", "-", *words, stdin=FEW.encode())
    assert (code, err) == (0, "")
    assert out.encode() == Path("few.yaml").read_bytes()


@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_rules_can_be_written_in_place_of_the_tree(call: Call, kind: str) -> None:
    words = ("--as", "rules", "--terms", kind, "--conjunction", "product")
    call("learn", "few.csv", "--target", "grip", "-o", "few.yaml", *words)
    rules = ft.load("few.yaml")
    assert isinstance(rules, RuleBase)
    assert (rules.kind, rules.semantics.conjunction) == (kind, "product")


def test_every_setting_has_its_option() -> None:
    offered = {parameter.name for parameter in command.params}
    assert {field.name for field in msgspec.structs.fields(LearningSettings)} <= offered


def test_the_options_reach_the_learner(call: Call) -> None:
    code, out, _ = call(
        *("learn", WINE, "--target", "cultivar", "-o", "wine.yaml", "--json"),
        *("--mode", "paper", "--l-max", "3", "--alpha", "0.5", "--points", "2"),
        *("--separate-sides", "--patterns", "1", "--seed", "3", "--cost", "ash=2"),
        *("--unit", "ash=g/l", "--ignore", "proline", "--quiet"),
    )
    assert code == 0
    assert json.loads(out)["report"]["mode"] == "paper"
    tree = ft.learn(
        WINE,
        target="cultivar",
        units={"ash": "g/l"},
        ignore=["proline"],
        settings=ft.LearningSettings(
            mode="paper",
            l_max=3.0,
            alpha=0.5,
            points=2,
            separate_sides=True,
            patterns_per_class=1,
            seed=3,
            costs={"ash": 2.0},
        ),
    )
    assert ft.load("wine.yaml") == tree


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--points", "9"), "points lies in 1 to 8, not 9"),
        (
            ("--alpha", "0.5"),
            "alpha is a setting of the mode 'paper', not of 'default'",
        ),
        (("--cost", "a"), "--cost 'a': is not COLUMN=VALUE"),
        (("--cost", "a=b"), "--cost a: 'b' is no number"),
        (("--cost", "b=1"), "costs: there is no column 'b'"),
        (("--unit", "N"), "--unit 'N': is not COLUMN=VALUE"),
    ],
)
def test_a_wrong_option_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    assert _refused(call, FEW, "--target", "grip", *words) == message + HELP


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "t.csv is empty: it needs a line with column names"),
        ("a,grip\n", "t.csv has no rows"),
        ("a,grip\n1,x\n", "cannot learn from one row; two classes need two at least"),
        (
            "a,grip\n1,x\n2,x\n3,x\n",
            "cannot learn from one class: every row is 'x'",
        ),
        (
            "a,grap\n1,x\n",
            "t.csv has no column 'grip'; it has a, grap (did you mean 'grap'?)",
        ),
        (
            "a,b,grip\n" + 10 * "1,2,x\n" + "1,wet,x\nq,2,y\n",
            "t.csv:13: column 'a' holds text where a number is needed: 'q' "
            "(1 among 11 numbers)\n"
            "t.csv:12: column 'b' holds text where a number is needed: 'wet' "
            "(1 among 11 numbers)\n"
            "  leave columns out with ignore (--ignore a --ignore b), or take all "
            "their cells as categories with categorical (--categorical a --categorical "
            "b)",
        ),
        (
            "a,grip\n1,x\n1,y\n1,x\n",
            "cannot learn without a column that varies: every column is constant, "
            "or so wide that its range overflows",
        ),
        (
            "a,grip\n1,x\nnan,x\ninf,x\n2,x\n",
            "cannot learn from one class: every row is 'x'",
        ),
        ("a,a,grip\n1,1,x\n", "t.csv: column 'a' stands there more than once"),
    ],
)
def test_a_table_that_nothing_can_be_learnt_from_is_one_sentence(
    call: Call, text: str, message: str
) -> None:
    assert _refused(call, text) == message + "\n"


def test_missing_values_can_be_refused(call: Call) -> None:
    words = ("--target", "grip", "--missing", "refuse")
    assert _refused(call, FEW + ",soft\n", *words) == (
        "1 of 13 rows hold a missing or infinite value or no class\n"
        "  pass --missing drop to leave them out\n"
    )


def test_classes_that_look_like_words_or_numbers_are_answered_as_they_are(
    call: Call,
) -> None:
    names = ["no", "01", "1e-05", "~", "null", "12:30"]
    rows = [
        f"{10 * k + step},{name}" for k, name in enumerate(names) for step in (0, 1)
    ]
    Path("odd.csv").write_text("\n".join(["a,grip", *rows, ""]), "utf-8")
    words = ("--target", "grip", "--quiet")
    assert call("learn", "odd.csv", "-o", "odd.yaml", *words)[0] == 0
    tree = ft.load("odd.yaml")
    assert isinstance(tree, FuzzyTree)
    assert sorted(tree.classes) == sorted(names)
    for path in ("odd.yaml", "odd.onnx"):
        ft.save(tree, path)
        out = call("run", path, "odd.csv", "--quiet")[1]
        answers = [line.split(",")[0] for line in out.splitlines()[1:]]
        assert answers == [name for name in names for _ in range(2)]


def test_a_place_that_cannot_be_written_is_refused_before_learning(call: Call) -> None:
    words = ("learn", "few.csv", "--target", "grip", "-o", "few.csv/few.yaml")
    message = "few.csv/few.yaml: cannot be written: 'few.csv' is not a folder\n"
    assert call(*words) == (2, "", message)


def test_a_full_disk_is_one_sentence(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    message = "t.yaml: cannot be written: no space left on device\n"
    assert _refused(call, FEW) == message


def test_a_column_of_weights_counts_in_the_tree_and_in_the_test(call: Call) -> None:
    lines = [f"{k},{k % 3},{'soft' if k < 40 else 'firm'}" for k in range(90)]
    Path("heavy.csv").write_text("\n".join(["a,w,grip", *lines]), "utf-8")
    words = ("learn", "heavy.csv", "--target", "grip", "--weight", "w")
    more = ("--class-weight", "balanced", "-o", "heavy.yaml", "--json")
    code, out, err = call(*words, *more)
    assert code == 0
    assert "2 classes (30 rows of weight 0 left out)" in err
    assert "(by the weights of classes; majority class 0.500; " in err
    assert json.loads(out)["rows_without_weight"] == 30
    _, _, err = call(*words, "-o", "heavy.yaml")
    assert "majority class 0.567" in err  # 51 of 90
    tree = ft.load("heavy.yaml")
    assert isinstance(tree, FuzzyTree)
    assert tree.columns == ("a",)
    assert call("collect", "few.csv", "--target", "grip", "-o", "few.state")[0] == 0
    code, _, err = call("learn", "few.state", "--weight", "w", "-o", "few.yaml")
    assert code == 2
    assert "--weight: states count rows, which have no weights" in err


def test_groups_that_are_left_out_choose_the_floor_of_strengths(call: Call) -> None:
    random = np.random.default_rng(0)
    lines = ["a,press,grip"]
    for press in range(8):
        place = 5.0 * (press % 2) + random.normal()
        values = place + random.normal(0.0, 0.02, 20)
        lines += [f"{one},{press},{'firm' if press % 2 else 'soft'}" for one in values]
    Path("t.csv").write_text("\n".join(lines) + "\n", "utf-8")
    words = ("learn", "t.csv", "--target", "grip", "--groups", "press", "-o", "t.yaml")
    code, _, err = call(*words)
    assert code == 0
    assert "few      2 classes firm, soft: below 10 groups" in err
    said = r"floor    0 +0\.001 rejects [0-9.]+ % of the rows left out; below it a row"
    assert re.search(said, err)
    tree = ft.load("t.yaml")
    assert isinstance(tree, FuzzyTree)
    assert tree.semantics.floor == 0.0
    facts = json.loads(call(*words, "--json")[1])
    assert facts["fingerprint"] == fingerprint(tree)

    text = Path("t.yaml").read_text("utf-8")
    Path("old.yaml").write_text(text.replace("  floor: 0.0", "  floor: 0.1"), "utf-8")
    changes = call("diff", "old.yaml", "t.yaml")[1]
    assert "non-breaking the floor of strengths is 0.0, and was 0.1" in changes
    Path("bad.yaml").write_text(text.replace("  floor: 0.0", "  floor: 1.5"), "utf-8")
    code, _, err = call("show", "bad.yaml")
    assert code == 2
    assert "'floor' must be at most 1, not 1.5" in err

"""No text of a user makes a terminal or a spreadsheet obey."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import InvalidModelError
from fuzzytree.exporters.table import TABLE
from fuzzytree.model import FuzzySystem
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from tests.cli.conftest import GRASPS, Call

EVIL = "a\x1b[2J\x07\x7f\x9b1m\u202e"
OBEYED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e]")

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no such file names")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    for name in ("grip.yaml", "rules.yaml", "grip.onnx"):
        Path(EVIL + name).write_bytes(Path(name).read_bytes())
    Path(EVIL + "grasps.csv").write_text(GRASPS.replace("note", EVIL), "utf-8")
    system = Path(__file__).resolve().parent.parent.parent / "examples" / "tipper.fll"
    Path(EVIL + "tipper.fll").write_bytes(system.read_bytes())
    Path(EVIL + "torn.yaml").write_text("name: [", "utf-8")


M, R, GRAPH, S, T, TORN = (
    EVIL + one
    for one in (
        *("grip.yaml", "rules.yaml", "grip.onnx", "tipper.fll", "grasps.csv"),
        "torn.yaml",
    )
)
AUDIT = ("audit", M, "--select", "FT1,FT4,FT5,FT7", "--data", T)


@pytest.mark.parametrize(
    "words",
    [
        ("show", M),
        ("show", S),
        ("show", GRAPH),
        ("show", M, "--json"),
        ("needs", R),
        ("needs", M, "--data", T, "-o", EVIL + "left.yaml"),
        ("needs", M, "--json"),
        pytest.param(("stability", R), marks=pytest.mark.heavy),
        pytest.param(("stability", R, "--json"), marks=pytest.mark.heavy),
        ("run", M, T),
        ("run", M, T, "--why", "--strengths", "class"),
        ("run", M, T, "--json", "--keep", "--why"),
        ("check", M, R, GRAPH, "--data", T, "--generate", "50"),
        ("check", M, R, GRAPH, "--json", "--generate", "50"),
        (*AUDIT, "--page", EVIL + ".html"),
        (*AUDIT, "--json", "--output", EVIL + ".json"),
        (*AUDIT, "--output-format", "sarif", "--output", EVIL + ".sarif"),
        (*AUDIT, "--output-format", "github"),
        ("diff", M, R),
        ("diff", M, R, "--json"),
        ("convert", S, EVIL + ".yaml"),
        ("convert", S, EVIL + ".yaml", "--json"),
        ("learn", T, "--target", "grip", "--ignore", EVIL, "-o", EVIL + ".c"),
        ("learn", T, "--target", "grip", "-o", EVIL + ".c"),
        ("learn", T, "--target", EVIL, "-o", EVIL + ".c"),
        ("explain", EVIL),
        ("formats", "--format", EVIL),
        (EVIL,),
        ("show", EVIL),
        ("show", TORN),
        ("bench", TORN),
        ("tactile", "replay", M),
        ("tactile", "check", TORN),
        ("tactile", "features", TORN),
    ],
    ids=lambda words: " ".join(words).replace(EVIL, "@"),
)
def test_no_name_of_a_file_or_a_column_commands_a_terminal(
    call: Call, words: tuple[str, ...]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in Path().iterdir()}
    _, out, err = call(*words)
    assert not OBEYED.search(out + err)
    for path in Path().iterdir():
        is_text = path.suffix != ".onnx"
        if is_text and before.get(path) != path.stat().st_mtime_ns:
            assert not OBEYED.search(path.read_text("utf-8")), path


@pytest.mark.one_in(3)
@pytest.mark.parametrize("suffix", [one[0] for one in TABLE.values()])
def test_no_file_name_stands_raw_in_a_file_that_is_written(
    call: Call, suffix: str
) -> None:
    for source in (M, R, S):
        output = EVIL + f"new{suffix}"
        _, out, err = call("convert", source, output, "--allow-loss")
        assert not OBEYED.search(out + err)
        if suffix != ".onnx" and Path(output).exists():
            assert not OBEYED.search(Path(output).read_text("utf-8"))


def rules(name: str = "r", **names: str) -> RuleBase:
    """Return rules with some of their names replaced."""
    term = Term(names.get("term", "low"), Points((0.0, 1.0), (0.0, 1.0)))
    label = names.get("label", "c")
    inputs = (Variable(names.get("column", "x"), (term,), names.get("unit", "")),)
    when = (Proposition(inputs[0].name, (term.name,)),)
    return RuleBase(name, (label,), inputs, (Rule(when, label),))


@pytest.mark.parametrize(
    "mark", ["\x1b[2J", "\n", "\t", "\x7f", "\x9b", "\u202e", "\uffff"]
)
def test_a_model_has_no_name_with_a_control_character(mark: str) -> None:
    for where, text in (
        ("name", "the name {} has a control character"),
        ("label", "class {} has a control character"),
        ("column", "variable {} has a control character"),
        ("term", "term of 'x' {} has a control character"),
        ("unit", "the unit {} of 'x' has a control character"),
    ):
        with pytest.raises(InvalidModelError) as caught:
            rules(**{where: f"a{mark}"})
        assert text.format(repr(f"a{mark}")) in str(caught.value)


def test_no_part_of_a_system_has_a_control_character() -> None:
    system = ft.load(S)
    assert isinstance(system, FuzzySystem)
    (block,) = system.blocks
    odd = replace(block, name=EVIL, rules=(replace(block.rules[0], name=EVIL),))
    for changes in ({"name": EVIL}, {"note": EVIL}, {"blocks": (odd,)}):
        with pytest.raises(InvalidModelError, match="has a control character"):
            replace(system, **changes)
    assert replace(system, note="two\n\tlines").note == "two\n\tlines"


def test_a_file_with_such_a_name_is_refused_with_its_place(call: Call) -> None:
    text = Path("rules.yaml").read_text("utf-8")
    Path("odd.yaml").write_text(text.replace("grip", r'"a\e[2J"', 1), "utf-8")
    code, out, err = call("show", "odd.yaml")
    assert (code, out) == (2, "")
    text = r"odd\.yaml:\d+:\d+: the name 'a\\x1b\[2J' has a control character\n"
    assert re.fullmatch(text, err)


def test_such_columns_and_classes_are_not_learnt(call: Call) -> None:
    table = "a\x1b[2J,grip\n" + "".join(f"{k},{k % 2}\n" for k in range(8))
    Path("t.csv").write_text(table, "utf-8")
    words = ("learn", "t.csv", "--target", "grip", "-o", "t.yaml", "--quiet")
    code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert "the column 'a\\x1b[2J' has a control character; rename it" in err
    Path("t.csv").write_text("a,grip\n1,x\n2,y\x1b[2J\n3,x\n", "utf-8")
    code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert "the class 'y\\x1b[2J' has a control character; rename it" in err
    assert not Path("t.yaml").exists()


def test_a_graph_with_such_a_class_is_refused(call: Call) -> None:
    import onnx

    proto = onnx.load_from_string(Path("grip.onnx").read_bytes())
    for entry in proto.metadata_props:
        if entry.key == "fuzzytree.classes":
            entry.value = json.dumps(["a\x1b[2J", "loose", "soft"])
    Path("odd.onnx").write_bytes(proto.SerializeToString())
    err = "odd.onnx: the file's metadata: 'a\\x1b[2J' has a control character\n"
    assert call("run", "odd.onnx", "grasps.csv") == (2, "", err)


def test_a_table_may_have_odd_columns_that_the_model_does_not_need(call: Call) -> None:
    code, out, _ = call("run", "grip.yaml", T, "--quiet")
    assert code == 0
    assert out.startswith("class,rule,status\n")


def test_text_that_begins_like_a_formula_is_a_formula_no_more(call: Call) -> None:
    odd = (
        GRASPS.replace("note", "@note")
        .replace(",a,", ",=cmd,")
        .replace(",b,", ",-1.5,")
    )
    Path("t.csv").write_text(odd, "utf-8")
    words = ("run", "rules.yaml", "t.csv", "--keep", "--quiet")
    assert call(*words)[1].splitlines()[:2] == [
        "slip,force,@note,grip,class,rule,status",
        "0,1.5,=cmd,soft,soft,1,decided",
    ]
    assert call(*words, "--safe-csv")[1].splitlines()[:3] == [
        "slip,force,'@note,grip,class,rule,status",
        "0,1.5,'=cmd,soft,soft,1,decided",
        "1,2.5,-1.5,firm,firm,3,decided",
    ]
    code, _, err = call(*words, "--safe-csv", "--json")
    assert (code, err.split("\n")[0]) == (
        2,
        "--safe-csv is about CSV, and --json writes none",
    )

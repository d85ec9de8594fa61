"""`fuzzytree convert` reports what it read, lost, wrote and proved."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.errors import LossError
from fuzzytree.exporters import TABLE, all_formats, yaml
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document, Loss, Reading, Written
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.semantics.random_systems import random_system
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree
from tests.cli.conftest import Call, grip
from tests.formats.test_fcl import EITHER
from tests.interop.matrix_models import RULES

HELP = "\n  fuzzytree convert --help lists the options\n"
SYSTEMS = [form.name for form in all_formats() if "system" in form.carries]
TIPPER = Path(__file__).resolve().parent.parent.parent / "examples" / "tipper.fll"


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    (folder / "tipper.fll").write_bytes(TIPPER.read_bytes())


def test_what_was_read_written_and_proved_is_reported(call: Call) -> None:
    code, out, err = call("convert", "tipper.fll", "tipper.yaml")
    content = Path("tipper.yaml").read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    assert (code, out) == (0, "")
    assert err == (
        f"wrote    tipper.yaml yaml, {len(content)} bytes, sha256 {digest}\n"
        "proved   equal       read back from the file, "
        "the fuzzy system is equal in every number\n"
        "read     tipper.fll  fll: fuzzy system, 2 inputs, 1 output, 3 rules, 8 terms\n"
        "next     fuzzytree check tipper.fll tipper.yaml\n"
    )
    assert ft.load("tipper.yaml") == ft.load("tipper.fll")


def test_the_next_command_works(call: Call) -> None:
    assert call("convert", "tipper.fll", "tipper.yaml", "--quiet") == (0, "", "")
    code, out, err = call("check", "tipper.fll", "tipper.yaml", "--generate", "60")
    assert code == 0, out
    assert out.startswith("tipper: none of ")
    assert err == ""


def test_json_reports_the_same_facts(call: Call) -> None:
    code, out, err = call("convert", "tipper.fll", "t.yaml", "--json", "--quiet")
    content = Path("t.yaml").read_bytes()
    assert (code, err) == (0, "")
    assert json.loads(out) == {
        "read": {
            "file": "tipper.fll",
            "format": "fll",
            "carrier": "system",
            "name": "tipper",
            "inputs": ["service", "food"],
            "outputs": ["tip"],
            "rules": 3,
            "terms": 8,
            "losses": [],
            "remarks": [],
        },
        "format": "yaml",
        "carrier": "system",
        "file": "t.yaml",
        "bytes": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
        "losses": [],
        "remarks": [],
        "names": {},
        "proof": {
            "verdict": "equal",
            "sentence": "read back from the file, "
            "the fuzzy system is equal in every number",
        },
        "certificate": None,
        "coverage": {"rules": 3, "unfired": [], "rows": 1000, "uncovered": 0},
        "next": "fuzzytree check tipper.fll t.yaml",
    }


@pytest.mark.heavy
def test_json_has_every_changed_name_and_the_text_every_changed_input(
    call: Call,
) -> None:
    tree = random_tree(3, leaves=20, combinations=0.5)
    ft.save(tree, "mixed.yaml")
    words = ("convert", "mixed.yaml", "mixed.fcl", "--allow-loss", "--json")
    code, out, err = call(*words)
    assert code == 0
    names = json.loads(out)["names"]
    mixes = [one.name for one in tree.variables if one.parts]
    assert len(mixes) > 3
    assert {name: name.replace(" ", "_") for name in mixes}.items() <= names.items()
    (said,) = (line for line in err.splitlines() if "names were changed" in line)
    assert all(f"{name!r} is {names[name]}" in said for name in mixes)
    assert said.endswith(f", and {len(names) - max(12, len(mixes))} more")


def test_a_tree_goes_through_a_format_of_others_and_back(call: Call) -> None:
    assert call("convert", "grip.yaml", "grip.fll", "--quiet")[0] == 0
    assert call("convert", "grip.fll", "back.yaml", "--quiet")[0] == 0
    back = ft.load("back.yaml")
    assert isinstance(back, RuleBase)
    assert ft.run(back, "grasps.csv").classes == ft.run(grip(), "grasps.csv").classes


def test_streams_name_their_formats(call: Call) -> None:
    words = ("convert", "-", "-", "--from", "fll", "--to", "yaml")
    code, out, err = call(*words, stdin=TIPPER.read_bytes())
    assert code == 0
    assert out.encode() == ft.export(ft.load("tipper.fll"), "yaml").content
    assert "\nread     -     fll: fuzzy system" in err
    assert "next" not in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-", "a.yaml"), "`-` has no suffix; name the format with --from" + HELP),
        (("a.yaml", "-"), "`-` has no suffix; name the format with --to" + HELP),
        (
            ("grip.yaml", "a.yalm"),
            f"no format '.yalm'; there is {', '.join(TABLE)} (did you mean '.yaml'?); "
            "name one of them with --to" + HELP,
        ),
        (
            ("grip.yaml", "a.yaml", "--to", "yalm"),
            f"no format 'yalm'; there is {', '.join(TABLE)} (did you mean 'yaml'?)"
            + HELP,
        ),
        (
            ("grip.yalm", "a.yaml"),
            "grip.yalm: no format of a model has the suffix '.yalm'; "
            "models are read from yaml, fcl, fll, fis, fml (did you mean '.yaml'?)\n",
        ),
        (("folder.yaml", "a.yaml"), "folder.yaml: cannot be read: is a directory\n"),
        (("empty.fll", "a.yaml"), "empty.fll:1:1: the file is empty\n"),
        (("no.fll", "a.yaml"), "no.fll: cannot be read: no such file or directory\n"),
        (
            ("grip.onnx", "a.yaml"),
            "grip.onnx: a file in the format onnx is not read back as a model; "
            "keep the file that it was made of\n",
        ),
        (
            ("grip.yaml", "a.onnx", "--set", "opset"),
            "--set opset: must be NAME=VALUE" + HELP,
        ),
        (
            ("grip.yaml", "a.onnx", "--set", "opset=new"),
            "opset: must be a whole number, not 'new'" + HELP,
        ),
        (
            ("grip.yaml", "a.onnx", "--set", "dtype=float23"),
            "dtype: must be float64, mixed, float32 (did you mean 'float32'?), "
            "not 'float23'" + HELP,
        ),
        (
            ("grip.yaml", "a.onnx", "--set", "verify=maybe"),
            "verify: must be yes or no, not 'maybe'" + HELP,
        ),
        (
            ("grip.yaml", "a.yaml", "--dialect", "iec"),
            "yaml has no option 'dialect'; it has none" + HELP,
        ),
        (
            ("grip.yaml", "a.onnx", "--set", "ir=8", "--set", "ir=9"),
            "the option 'ir' is given twice" + HELP,
        ),
        (("grip.yaml", "a"), "a: has no suffix; name the format with --to" + HELP),
        *(
            (
                ("tipper.fll", "a.fcl", "--tolerance", text),
                f"tolerance: must be above 0 and below 1, such as 1e-3, not {text}"
                + HELP,
            )
            for text in ("0.0", "-1.0", "2.0", "nan", "inf")
        ),
        (
            ("tipper.fll", "a.yaml", "--as", "rules"),
            "--as rules: tipper is a fuzzy system whose outputs are numbers, "
            "and no rules that decide for a class can be made of it" + HELP,
        ),
        (
            ("tipper.fll", "a.yaml", "--terms", "raw"),
            "--terms raw: tipper is a fuzzy system; such rules are made from a tree"
            + HELP,
        ),
        (
            ("tipper.fll", "a.yaml", "--conjunction", "minimum"),
            "--conjunction minimum: tipper is a fuzzy system; such rules are made from "
            "a tree" + HELP,
        ),
        (
            ("tipper.fll", "a.yaml", "--as", "tree"),
            "--as tree: tipper is a fuzzy system, and no tree can be made of it" + HELP,
        ),
    ],
    ids=lambda one: " ".join(one) if isinstance(one, tuple) else "",
)
def test_what_cannot_be_had_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    Path("folder.yaml").mkdir()
    Path("empty.fll").touch()
    code, out, err = call("convert", *words)
    err = "".join(x for x in err.splitlines(keepends=True) if not x.startswith("read "))
    assert (code, out, err) == (2, "", message)
    assert not list(Path.cwd().glob("a.*"))
    assert not Path("a").exists()


@pytest.mark.heavy
def test_a_refusal_names_options_of_the_command_line(call: Call) -> None:
    Path("fan.fll").write_bytes(
        TIPPER.read_bytes()
        .replace(b"WeightedAverage TakagiSugeno", b"Centroid 100")
        .replace(b"aggregation: none", b"aggregation: Maximum")
        .replace(b"implication: none", b"implication: Minimum")
        .replace(b"Constant", b"Triangle 0.0 1.0")
    )
    err = call("convert", "fan.fll", "a.fcl")[2]
    assert "; pass --dialect fuzzylite, jfuzzylogic or iec\n" in err
    err = call("convert", "grip.yaml", "a.fcl", "--set", "scores=winner")[2]
    assert err.endswith("; pass --set scores=rule or scores=class\n")


def test_a_loss_without_a_bound_is_shown_by_a_check_that_exits_1(call: Call) -> None:
    words = ("convert", "tipper.fll", "a.fcl", "--allow-loss", "--tolerance", "0.01")
    code, out, err = call(*words, "--json")
    assert (code, json.loads(out)["next"]) == (0, None)
    check = ("check", "tipper.fll", "a.fcl")
    command = f"fuzzytree {' '.join(check)}"
    text = f"differs  {command} (exits 1, and shows what the losses change)\n"
    assert err.endswith(text)
    assert call(*check, "--generate", "50")[0] == 1


def test_points_for_curves_are_allowed_within_the_bound_of_the_losses(
    call: Call,
) -> None:
    ft.save(all_samples()["raw rules (LR curves)"], "raw.yaml")
    words = ("convert", "raw.yaml", "a.fcl", "--tolerance", "0.01")
    code, _, err = call(*words, "--allow-loss", "--json")
    assert code == 0
    check = ("check", "raw.yaml", "a.fcl")
    after = f"fuzzytree {' '.join(check)} --tolerance 0.01"
    assert err.endswith(f"next     {after} (shows what the losses change)\n")
    code, out, _ = call(*check, "--tolerance", "0.01", "--generate", "200", "--json")
    assert code == 0
    rows, content = [
        one
        for one in reversed(json.loads(out)["comparisons"])
        if one["representation"] == "a.fcl"
    ]
    assert content["against"] == "the model within 1.0e-02: curves became points"
    assert 0.001 < rows["largest_difference"] <= rows["allowed"] <= 0.01
    assert rows["origin"].startswith("largest certified error of a degree: lines")
    assert call(*check, "--generate", "200")[0] == 1  # of another tolerance


def test_no_command_comes_next_that_compares_numbers_with_classes(call: Call) -> None:
    for output in ("a.onnx", "a.yaml"):
        code, _, err = call("convert", "grip.yaml", output, "--as", "system")
        assert code == 0
        assert "next" not in err
    code, out, _ = call("check", "grip.yaml", "a.onnx", "--runtime", "native")
    assert code == 1
    assert "  it computes class from force, slip, which are not the model's\n" in out


def test_a_terminal_is_no_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = SimpleNamespace(buffer=SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("sys.stdin", terminal)
    assert main(["convert", "-", "a.yaml", "--from", "fll"]) == 2
    assert capsys.readouterr().err == (
        "`-` reads standard input, which is a terminal; name a file, or pipe one in"
        + HELP
    )


def test_options_reach_the_writer(call: Call) -> None:
    words = ("--set", "dtype=float32", "--set", "outputs=label,rule,status")
    assert call("convert", "grip.yaml", "a.onnx", "--as", "rules", *words)[0] == 0
    facts = json.loads(call("show", "a.onnx", "--json")[1])
    assert (facts["dtype"], facts["outputs"]) == (
        "float32",
        ["label", "rule", "status"],
    )


def test_an_onnx_file_of_a_system_is_run_before_it_is_believed(call: Call) -> None:
    code, _, err = call("convert", "tipper.fll", "tipper.onnx")
    assert code == 0
    proof = "run by onnxruntime, it answers 200 generated rows like the system"
    assert f"proved   alike       {proof}\n" in err
    code, _, err = call("convert", "tipper.fll", "tipper.c")
    said = "the file is not read back here; other programs run it"
    assert f"unproved            {said}\n" in err


def test_every_format_that_reads_a_system_writes_it_again(call: Call) -> None:
    for name in ("fll", "yaml"):
        suffix = TABLE[name][0]
        assert call("convert", "tipper.fll", f"again{suffix}")[0] == 0
        assert ft.load(f"again{suffix}") == ft.load("tipper.fll")


# --- losses, in YAML that loses something


def _lossy(monkeypatch: pytest.MonkeyPatch, *, on_read: bool, on_write: bool) -> None:
    losses = (
        Loss("default of 'tip'", "becomes 0"),
        Loss("term 'low' of 'tip'", "becomes 9 points", 0.0125),
    )

    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        written = yaml.write(model)
        if not on_write:
            return written
        if not allow_loss:
            raise LossError(
                "cannot write it as yaml: default of 'tip': becomes 0; term 'low' of "
                "'tip': becomes 9 points; pass allow_loss=True to write it as stated"
            )
        return replace(written, losses=losses)

    def read(content: bytes, name: str) -> Reading:
        model = read_yaml(content, name).model
        return Reading(model, losses if on_read else (), ("the dialect is northern",))

    monkeypatch.setattr(yaml, "FORMAT", replace(yaml.FORMAT, read=read, write=write))


def test_a_file_that_cannot_be_read_back_is_not_written(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planted(model: Document, /, *, allow_loss: bool = False) -> Written:
        return Written(b"nonsense\n")

    monkeypatch.setattr(yaml, "FORMAT", replace(yaml.FORMAT, write=planted))
    code, out, err = call("convert", "tipper.fll", "a.yaml", "--quiet")
    assert (code, out) == (2, "")
    assert err.startswith(
        "tipper as yaml cannot be read back, and is not written:\nyaml:1:1: "
    )
    assert not Path("a.yaml").exists()


LOST = (
    "lost     default of 'tip': becomes 0\n"
    "lost     term 'low' of 'tip': becomes 9 points (largest error 0.013)\n"
)


def test_a_loss_of_writing_is_refused_with_all_losses(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    _lossy(monkeypatch, on_read=False, on_write=True)
    code, out, err = call("convert", "tipper.fll", "a.yaml")
    assert (code, out) == (1, "")
    assert err.splitlines()[0] == (
        "cannot write it as yaml: default of 'tip': becomes 0; term 'low' of 'tip': "
        "becomes 9 points; pass --allow-loss to write it as stated"
    )
    assert not Path("a.yaml").exists()


def test_a_loss_of_reading_is_refused_with_all_losses(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call("convert", "tipper.fll", "tipper.yaml")[0] == 0
    _lossy(monkeypatch, on_read=True, on_write=False)
    code, out, err = call("convert", "tipper.yaml", "a.fll")
    assert (code, out) == (1, "")
    offer = "nothing is written; pass --allow-loss to write what remains\n"
    assert err == offer + LOST
    assert not Path("a.fll").exists()
    code, out, _ = call("convert", "tipper.yaml", "a.fll", "--json")
    facts = json.loads(out)
    assert (code, facts["file"], len(facts["read"]["losses"])) == (1, None, 2)


def test_losses_that_are_allowed_are_reported(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    _lossy(monkeypatch, on_read=False, on_write=True)
    code, _, err = call("convert", "tipper.fll", "a.yaml", "--allow-loss")
    assert code == 0
    assert LOST in err
    assert Path("a.yaml").exists()


def test_a_file_with_losses_is_run_shown_and_checked_only_if_allowed(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call("convert", "tipper.fll", "tipper.yaml")[0] == 0
    Path("meals.csv").write_text("service,food\n3,8\n", "utf-8")
    _lossy(monkeypatch, on_read=True, on_write=False)
    refusal = (
        "tipper.yaml: a model cannot hold all that the file says:\n"
        "  default of 'tip': becomes 0\n"
        "  term 'low' of 'tip': becomes 9 points (largest error 0.013)\n"
        "  pass --allow-loss to read it as stated\n"
    )
    for words in (("run", "tipper.yaml", "meals.csv"), ("check", "tipper.yaml")):
        assert call(*words) == (2, "", refusal)
        assert call(*words, "--allow-loss", "--quiet")[0] == 0
    code, out, err = call("show", "tipper.yaml")
    assert code == 0
    assert out.startswith("tipper: fuzzy system")
    assert err == f"{LOST}remark   the dialect is northern\n"


# --- in Python


def test_a_conversion_in_python_reports_the_same() -> None:
    found = ft.convert("tipper.fll", ".yaml")
    assert isinstance(found.model, FuzzySystem)
    assert (found.source, found.read_as, found.to) == ("tipper.fll", "fll", "yaml")
    assert found.proof.verdict == "equal"
    again = ft.convert(found.reading, "fll", scores="winner")
    assert again.proof.verdict in ("equal", "alike")


def test_losses_in_python_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    ft.convert("tipper.fll", "yaml")
    ft.save(ft.load("tipper.fll"), "tipper.yaml")
    _lossy(monkeypatch, on_read=True, on_write=True)
    with pytest.raises(LossError) as caught:
        ft.load("tipper.yaml")
    assert str(caught.value).endswith("pass allow_loss=True to read it as stated")
    assert isinstance(ft.load("tipper.yaml", allow_loss=True), FuzzySystem)
    assert len(ft.read("tipper.yaml").losses) == 2
    with pytest.raises(LossError):
        ft.convert("tipper.yaml", "fll")
    with pytest.raises(LossError):
        ft.convert("tipper.fll", "yaml")
    found = ft.convert("tipper.yaml", "yaml", allow_loss=True)
    assert found.proof.verdict == "equal"


def test_the_curves_of_raw_rules_become_points(call: Call) -> None:
    ft.save(all_samples()["raw rules (LR curves)"], "rules.yaml")
    code, _, err = call("convert", "rules.yaml", "a.fll", "--allow-loss")
    assert code == 0
    assert "points joined by lines" in err


@pytest.mark.parametrize("suffix", ["fcl", "fll", "fis", "fml"])
def test_relative_rules_of_columns_lose_nothing(call: Call, suffix: str) -> None:
    ft.save(all_samples()["relative rules"], "rules.yaml")
    code, _, err = call("convert", "rules.yaml", f"a.{suffix}")
    assert code == 0, err
    assert "becomes" not in err


def test_a_smaller_tolerance_gives_a_smaller_bound(call: Call) -> None:
    ft.save(all_samples()["raw rules (LR curves)"], "rules.yaml")
    bounds = []
    for tolerance in ("1e-2", "1e-5"):
        words = ("--tolerance", tolerance, "--allow-loss", "--json", "--quiet")
        facts = json.loads(call("convert", "rules.yaml", "a.fll", *words)[1])
        bounds.append(max(loss["bound"] or 0 for loss in facts["losses"]))
    assert 0.0 < bounds[1] <= 1e-5 < bounds[0] <= 1e-2


def test_needs_of_a_system_names_its_inputs(call: Call) -> None:
    code, out, _ = call("needs", "tipper.fll")
    assert code == 0
    assert "model    fuzzy system, 3 rules, 8 terms" in out
    assert "tipper: none of 2 comparisons disagrees" in out


@pytest.mark.parametrize("seed", range(3))
def test_a_system_answers_the_same_in_python_and_on_the_command_line(
    call: Call, seed: int
) -> None:
    system = random_system(seed)
    ft.save(system, "any.yaml")
    rows = [",".join(system.inputs), *(",".join(["0.5"] * 3) for _ in range(2)), ",,"]
    Path("rows.csv").write_text("\n".join(rows) + "\n", "utf-8")
    code, out, err = call("run", "any.yaml", "rows.csv")
    assert code == 0
    assert out == ft.run(system, "rows.csv").to_csv()
    assert "1 row with a missing input" in err
    found = ft.run("any.yaml", "rows.csv")
    assert isinstance(found, ft.Outputs)
    assert found.columns()["status"][-1] == "missing"
    assert str(found).startswith("3 rows: ")


def test_why_reports_the_rules_of_a_system_with_their_degrees(call: Call) -> None:
    Path("meals.csv").write_text("service,food\n5,0\n", "utf-8")
    code, out, _ = call("run", "tipper.fll", "meals.csv", "--why", "--quiet")
    assert code == 0
    assert "rule 1 (1): IF service is poor or food is rancid THEN tip is cheap; " in out
    assert "rule 2 (1): IF service is good THEN tip is average; " in out


def test_strengths_of_the_rules_of_a_system_are_columns(call: Call) -> None:
    Path("meals.csv").write_text("service,food\n5,0\n", "utf-8")
    words = ("run", "tipper.fll", "meals.csv", "--json", "--quiet")
    row = json.loads(call(*words, "--strengths", "rule")[1])
    assert list(row) == ["tip", "status", *(f"strength of rule {k}" for k in (1, 2, 3))]
    assert row["strength of rule 2"] == 1.0
    code, _, err = call(*words, "--strengths", "class")
    assert code == 2
    assert err.startswith("--strengths class: tipper is a fuzzy system")


def test_a_system_is_shown_with_its_rules_and_terms(call: Call) -> None:
    code, out, err = call("show", "tipper.fll")
    assert (code, err) == (0, "")
    assert out == SHOWN
    facts = json.loads(call("show", "tipper.fll", "--json")[1])
    assert facts["carrier"] == "system"
    assert facts["rules"][1]["text"] == "IF service is good THEN tip is average"


SHOWN = """\
tipper: fuzzy system, 2 inputs, 1 output, 3 rules, 8 terms
inputs   2: service, food
outputs  1: tip
answers  missing value: nan

rules: AND is minimum; OR is maximum; all rules
1. IF service is poor or food is rancid THEN tip is cheap
2. IF service is good THEN tip is average
3. IF service is excellent or food is delicious THEN tip is generous

service, 0 to 10
  poor       gaussian: mean 0, deviation 1.5
  good       gaussian: mean 5, deviation 1.5
  excellent  gaussian: mean 10, deviation 1.5
food, 0 to 10
  rancid     1 from 0 to 1, rises from 0 at 0, falls to 0 at 3
  delicious  1 from 9 to 10, rises from 0 at 7, falls to 0 at 10
tip, 0 to 30
  weighted average; no rule: nan
  cheap     5
  average   15
  generous  25
"""


def test_an_old_file_survives_a_conversion_that_fails(call: Call) -> None:
    Path("a.fcl").write_text("old", "utf-8")
    assert call("convert", "tipper.fll", "a.fcl")[0] == 1
    assert Path("a.fcl").read_text("utf-8") == "old"
    assert not list(Path.cwd().glob(".*.part"))


@pytest.mark.parametrize(
    ("output", "option", "message"),
    [
        ("a.fll", "scores=rule", "scores: are of rules; a system has outputs of its "),
        ("a.fcl", "scores=class", "scores: are of rules; a system has outputs of its "),
        (
            "a.pmml",
            "curves=points",
            "curves: points are for rules; a tree or a system ",
        ),
    ],
)
def test_an_option_that_does_nothing_is_refused(
    call: Call, output: str, option: str, message: str
) -> None:
    code, _, err = call("convert", "tipper.fll", output, "--set", option)
    assert code == 2
    assert err.splitlines()[0].startswith(message)
    assert not Path(output).exists()


@pytest.mark.heavy
@pytest.mark.parametrize(("norm", "has_next"), [("minimum", True), ("product", False)])
def test_rules_that_become_scores_name_no_check_that_cannot_be(
    call: Call, norm: str, has_next: bool
) -> None:
    """jFuzzyLogic has no maximum beside the product: scores are not read as rules."""
    Path("hand.yaml").write_text(RULES.replace("{and: minimum", f"{{and: {norm}"))
    words = ("convert", "hand.yaml", "hand.fcl", "--dialect", "jfuzzylogic")
    code, out, err = call(*words, "--allow-loss")
    assert code == 0
    assert ("next     fuzzytree check" in out + err) == has_next
    code, _, err = call("check", "hand.yaml", "hand.fcl")
    assert (code == 2) == ("outputs are numbers" in err) == (not has_next)


def test_points_in_pmml_are_refused_like_other_losses(call: Call) -> None:
    ft.save(ft.rules_from_tree(random_tree(2), "raw"), "r.yaml")
    words = ("convert", "r.yaml", "a.pmml", "--set", "curves=points")
    code, _, err = call(*words)
    assert code == 1
    assert err.endswith("\n  pass --allow-loss to write it as stated\n")
    assert call(*words, "--allow-loss")[0] == 0


@pytest.mark.parametrize(
    ("sample", "suffix", "dialect"),
    [
        ("a default answer", ".fcl", "portable"),
        ("a default answer", ".fcl", "iec"),
        ("a default answer", ".fcl", "fuzzylite"),
        ("a default answer", ".fcl", "jfuzzylogic"),
        ("Mamdani, centroid", ".fcl", "fuzzylite"),
        ("number of samples", ".fis", "matlab"),
        ("number of samples", ".fis", "octave"),
        ("number of samples", ".fis", "fuzzylite"),
    ],
)
def test_a_file_stays_in_its_dialect(
    call: Call, sample: str, suffix: str, dialect: str
) -> None:
    ft.save(all_samples()[sample], "s.yaml")
    words = ("convert", "s.yaml", f"a{suffix}", "--dialect", dialect, "--allow-loss")
    assert call(*words, "--quiet")[0] == 0
    assert call("convert", f"a{suffix}", f"b{suffix}", "--quiet") == (0, "", "")
    assert Path(f"a{suffix}").read_bytes() == Path(f"b{suffix}").read_bytes()
    assert ft.convert(f"a{suffix}", suffix).written.content == (
        Path(f"a{suffix}").read_bytes()
    )


VERBS = {
    "show": (),
    "run": ("r.csv",),
    "check": (),
    "audit": (),
    "diff": ("grip.yaml",),
    "bench": (),
    "needs": (),
    "stability": (),
    "export": ("-o", "a.yaml"),
    "convert": ("a.yaml",),
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_that_reads_a_model_takes_its_format_and_engine(
    call: Call, verb: str
) -> None:
    words = (verb, "grip.yaml", *VERBS[verb], "--from", "fis:iec")
    code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert err == (
        "dialect: must be matlab, octave, fuzzylite, not 'iec'\n"
        f"  fuzzytree {verb} --help lists the options\n"
    )


def test_the_named_engine_is_the_one_that_a_rule_is_read_for(call: Call) -> None:
    Path("e.fcl").write_text(EITHER)
    Path("r.csv").write_text("a,c,d\n.9,.1,.2\n")
    code, _, err = call("run", "e.fcl", "r.csv")
    assert (code, err) == (
        2,
        "e.fcl: a model cannot hold all that the file says:\n"
        "  line 10: a OR b AND c is read as a OR (b AND c), as in the standard; "
        "jFuzzyLogic reads (a OR b) AND c; write parentheses, or pass --from fcl:iec "
        "or --from fcl:jfuzzylogic\n"
        "  engines: y is 50 in fcl:iec and 0 in fcl:jfuzzylogic at "
        "a = 1.0, c = 0.4, d = 0.0; pass --from fcl:iec or "
        "--from fcl:jfuzzylogic\n"
        "  pass --allow-loss to read it as stated\n",
    )
    for engine, answer in (("jfuzzylogic", 20.0), ("iec", 90.0 / 1.7)):
        words = ("--from", f"fcl:{engine}")
        code, out, _ = call("run", "e.fcl", "r.csv", *words)
        assert code == 0
        assert float(out.split("\n")[1].split(",")[0]) == pytest.approx(answer)
        code, _, err = call("convert", "e.fcl", f"{engine}.yaml", *words)
        assert code == 0
        after = err.rpartition("next     fuzzytree ")[2].split()
        assert after == ["check", "e.fcl", f"{engine}.yaml", *words]
        assert call("check", *after[1:], "--generate", "50")[0] == 0
        assert call("diff", "e.fcl", f"{engine}.yaml", *words)[0] == 0
    assert call("diff", "e.fcl", "jfuzzylogic.yaml", "--from", "fcl:iec")[0] == 1


def test_an_audit_of_a_named_engine_is_repeated_for_it(call: Call) -> None:
    Path("e.fcl").write_text(EITHER)
    out = call("audit", "e.fcl", "--from", "fcl:iec", "--verbose")[1]
    assert "fuzzytree audit e.fcl --from fcl:iec --select" in out
    assert "e.fcl:10:" in out  # rules have their lines

"""`fuzzytree audit` among hostile names, files that change, pipes and full disks."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree import AuditSelection
from fuzzytree.api import verbs
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.report.audit_page import page
from tests.cli.conftest import Call

SELECTED = ("--select", "FT1,FT301,FT404")
NAMES = {
    "markup": '"/><script>alert(1)</script>&',
    "commands": "b ::error::x%0A ::next",
    "long": "L" * 900,
    "pictures": "🙂👨\u200d👩'\"`",
}

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def hostile(name: str) -> RuleBase:
    """Return rules of which one never wins, about inputs with such a name."""
    low = Term(f"low {name}", Points((2.0, 5.0), (1.0, 0.0)))
    high = Term(f"high {name}", Points((4.0, 8.0), (0.0, 1.0)))
    inputs = (
        Variable(f"in {name}", (low, high), f"u{name[:20]}", 0.0, 10.0),
        Variable(f"free {name}"),
    )
    kinds = ((low, f"c1 {name}"), (high, f"c2 {name}"), (high, f"c1 {name}"))
    rules = tuple(Rule((Proposition(inputs[0].name, (t.name,)),), c) for t, c in kinds)
    return RuleBase(f"m {name}", (f"c1 {name}", f"c2 {name}"), inputs, rules)


@pytest.mark.parametrize("name", NAMES.values(), ids=[*NAMES])
def test_no_name_breaks_out_of_any_output(call: Call, name: str) -> None:
    ft.save(hostile(name), "odd.yaml")
    for form in ("text", "github", "sarif", "json"):
        words = ["--json"] if form == "json" else ["--output-format", form]
        words += ["--output", "out"]
        words += ["--page", "page.html"] if form == "text" else []
        code, _, err = call("audit", "odd.yaml", *SELECTED, *words)
        assert code == 1
        out = Path("out").read_text("utf-8")
        if form in ("sarif", "json"):
            said = json.dumps(json.loads(out), ensure_ascii=False)
            assert "never wins" in said
            continue
        lines = [*out.split("\n"), *err.split("\n")]
        assert all(line.isprintable() for line in lines), lines
        assert "never wins" in out
        if form == "github":
            each = out.removesuffix("\n").split("\n")
            assert all(re.match("::(error|warning|notice) ", one) for one in each)
    content = Path("page.html").read_text("utf-8")
    assert content.count("<script>") == content.count("</script>") == 1
    assert all(line.isprintable() for line in content.split("\n"))


@pytest.mark.parametrize("place", ["model", "page", "data"])
def test_no_name_of_a_file_commands_a_terminal(call: Call, place: str) -> None:
    odd = "a\x1b[2Jb"
    names = {"model": "grip.yaml", "page": "page.html", "data": "grasps.csv"}
    old, names[place] = names[place], f"{odd}{Path(names[place]).suffix}"
    if place != "page":
        Path(old).rename(names[place])
    words = (names["model"], "--page", names["page"], "--data", names["data"])
    _, out, err = call("audit", *words, "--select", "FT501,FT701", "--all")
    shown = [*out.split("\n"), *err.split("\n")]
    assert all(line.isprintable() for line in shown)
    assert r"a\x1b[2Jb" in out + err
    assert "\x1b" not in Path(names["page"]).read_text("utf-8")


def test_a_model_and_a_table_may_be_pipes_for_each_is_read_once(call: Call) -> None:
    def feed(source: str, pipe: str) -> None:
        Path(pipe).write_bytes(Path(source).read_bytes())

    for source, pipe in (("grip.yaml", "pipe.yaml"), ("grasps.csv", "pipe.csv")):
        os.mkfifo(pipe)
        threading.Thread(target=feed, args=(source, pipe), daemon=True).start()
    words = ["--data", "pipe.csv", "--target", "grip", "--page", "page.html"]
    words += ["--verbose", "--select", "FT501,FT701"]
    code, out, _ = call("audit", "pipe.yaml", *words)
    assert code == 0
    assert "\nrows     4 of pipe.csv\n" in out
    assert "pipe.yaml" in Path("page.html").read_text("utf-8")


def test_a_model_that_changes_meanwhile_is_reported_as_it_was_read() -> None:
    material = verbs.material("grip.yaml", data="grasps.csv")
    before = page(
        verbs.audit(material, selection=AuditSelection(select=["FT5"])), material.model
    )
    ft.save(hostile("new"), "grip.yaml")
    Path("grasps.csv").unlink()
    assert (
        page(
            verbs.audit(material, selection=AuditSelection(select=["FT5"])),
            material.model,
        )
        == before
    )


def test_a_table_that_changes_while_it_is_read_is_refused(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = verbs.audited_rows

    def slow(*words: object, **more: object) -> object:
        found = read(*words, **more)  # type: ignore[arg-type]  # passed on as it came
        with Path("grasps.csv").open("a") as file:
            file.write("0,1,e,soft\n")
        return found

    monkeypatch.setattr(verbs, "audited_rows", slow)
    words = ("audit", "grip.yaml", "--data", "grasps.csv", "--select", "FT501")
    message = "grasps.csv: was changed while it was read\n"
    assert call(*words) == (2, "", message)


def test_rows_of_a_material_are_not_given_twice() -> None:
    material = verbs.material("grip.yaml")
    with pytest.raises(ValueError, match="a material is read already"):
        verbs.audit(material, data="grasps.csv")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "grip.yaml"), "grip.yaml: cannot be written: it is read as well"),
        (
            ("--page", "./grip.yaml"),
            "./grip.yaml: cannot be written: it is read as well",
        ),
        (
            ("--data", "grasps.csv", "--write-baseline", "grasps.csv"),
            "grasps.csv: cannot be written: it is read as well",
        ),
        (
            ("-o", "out", "--page", "out"),
            "out: cannot be written: another output goes there",
        ),
        (("-o", "."), ".: cannot be written: it is a folder"),
        (("--data", "."), ".: cannot be read: is a directory"),
        (("--baseline", "."), ".: cannot be read: is a directory"),
        (("--config", "."), ".: cannot be read: is a directory"),
        (("--results", "."), ".: cannot be read: is a directory"),
    ],
    ids=" ".join,
)
def test_a_place_that_is_none_is_one_sentence(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    before = {path: path.read_bytes() for path in Path().iterdir()}
    assert call("audit", "grip.yaml", *SELECTED, *words) == (2, "", f"{message}\n")
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


def test_a_dash_is_standard_output_for_the_findings_alone(call: Call) -> None:
    plain = call("audit", "grip.yaml", *SELECTED)
    assert call("audit", "grip.yaml", *SELECTED, "--output", "-") == plain
    message = (
        "`-` is stdout, where the findings go; name a file\n"
        "  fuzzytree audit --help lists the options\n"
    )
    for option in ("--page", "--write-baseline"):
        assert call("audit", "grip.yaml", *SELECTED, option, "-") == (2, "", message)
    assert not Path("-").exists()


@pytest.mark.parametrize("option", ["--output", "--page", "--write-baseline"])
def test_a_full_disk_is_one_sentence_and_the_text_is_reported(
    call: Call, option: str
) -> None:
    words = ("--limits", "force=3:5", "--select", "FT101", "--quiet")
    code, out, err = call("audit", "grip.yaml", *words, option, "/dev/full")
    assert (code, err) == (2, "/dev/full: cannot be written: no space left on device\n")
    assert ("FT101 error:" in out) == (option != "--output")


def test_a_configuration_names_what_is_hostile_without_obeying_it(call: Call) -> None:
    Path("fuzzytree-audit.yaml").write_text('select: ["FT\\e[2J"]\n', "utf-8")
    code, out, err = call("audit", "grip.yaml")
    assert (code, out) == (2, "")
    assert err.startswith("fuzzytree-audit.yaml:1:10: ")
    assert err.replace("\n", "").isprintable()


@pytest.mark.heavy
@pytest.mark.parametrize(
    "words",
    [
        ("audit", "odd.yaml", "--json", "--page", "page.html"),
        ("audit", "odd.yaml", "--all"),
        ("diff", "odd.yaml", "other.yaml"),
        ("explain",),
        ("recheck", "audit.json", "odd.yaml"),
    ],
    ids=" ".join,
)
def test_a_reader_who_leaves_at_once_sees_no_traceback_and_costs_no_file(
    call: Call, words: tuple[str, ...]
) -> None:
    rules = hostile("x")
    ft.save(rules, "odd.yaml")
    ft.save(replace(rules, rules=rules.rules[1:]), "other.yaml")
    call("audit", "odd.yaml", "--json", "-o", "audit.json")
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "fuzzytree", *words],
        stdout=writing,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        text=True,
        check=False,
    )
    os.close(writing)
    assert done.returncode == 141
    assert "Traceback" not in done.stderr
    assert Path("page.html").is_file() == ("--page" in words)

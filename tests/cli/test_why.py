"""`fuzzytree why` explains one decision on a page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import fuzzytree as ft
from tests.cli.conftest import Call

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
WOODS = "heat,wood,day,doors,kind\n" + "".join(
    f"{heat // 2},{wood},2024-0{1 + heat % 9}-1{heat % 7},{heat % 5},{kind}\n"
    for heat, wood, kind in (
        (n, ("oak", "fir", "elm")[n % 3], "y" if n % 3 == 1 or n > 40 else "n")
        for n in range(60)
    )
)


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    for name in ("grip.yaml", "tipper.fll"):
        shutil.copy(EXAMPLES / name, folder / f"example-{name}")


def test_a_rule_base_says_why_what_is_next_and_what_would_change_it(call: Call) -> None:
    words = ("why", "example-grip.yaml", "--row", "force=3,slip=0.2")
    assert call(*words) == (
        0,
        "grip: open by rule 1, strength 1; firm 0, soft 0\n"
        "because    force is low: 3, 2 N below its cut 5\n"
        "           slip is none: 0.2, 0.3 mm below its cut 0.5\n"
        "runner-up  rule 2 for soft, strength 0, kept back by force is high: 3, 2 N "
        "below its cut 5\n"
        "change     to soft: force 3 -> 5.0002; 20% of its range; proved smallest\n",
        "",
    )


def test_a_class_that_is_wanted_may_need_another_change(call: Call) -> None:
    words = ("why", "example-grip.yaml", "--row", "force=3,slip=0.2", "--quiet")
    code, _, err = call(*words)
    assert (code, "no such option" in err.lower()) == (2, True)
    _, out, _ = call(*words[:-1], "--wanted", "firm")
    assert "change     to firm: slip 0.2 -> 1.00004; 40%" in out
    assert "proved smallest" in out
    _, out, _ = call(*words[:-1], "--wanted", "open")
    assert "change     none is needed: the class is open already\n" in out
    _, out, _ = call(*words[:-1], "--wanted", "soft", "--fixed", "force")
    sentence = "no change that is allowed gives soft: proved on the whole domain"
    assert f"change     {sentence}\n" in out


def test_costs_decide_which_change_is_the_smallest(call: Call) -> None:
    words = ("why", "example-grip.yaml", "--row", "force=3,slip=0.2")
    _, out, _ = call(*words, "--costs", "force=10,slip=0.1")
    assert "; cost 0.0" in out
    assert "slip 0.2 -> " in out


def test_limits_say_what_a_change_may_reach(call: Call) -> None:
    words = ("why", "example-grip.yaml", "--row", "force=3,slip=0.2")
    _, out, _ = call(*words, "--limits", "force=0:4", "--limits", "slip=0:0.4")
    assert "no change that is allowed gives another class: proved" in out


def test_a_system_shows_the_rules_that_fire_and_its_slopes(call: Call) -> None:
    code, out, err = call("why", "example-tipper.fll", "--row", "service=3,food=8")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "tipper: tip 18.4848"
    assert lines[1].startswith(
        "fires      rule 3, degree 0.5, 47.8% of tip: IF service"
    )
    assert lines[-1].startswith("slope      tip: +1.108 per unit of service, +3.1")


def test_a_row_of_a_table_is_explained_by_its_number(call: Call, folder: Path) -> None:
    (folder / "rows.csv").write_text("force;slip\n1,5;0,1\n9,0;0,1\n")
    words = ("why", "example-grip.yaml", "--data", "rows.csv", "--decimal", ",")
    _, out, _ = call(*words, "--number", "2")
    assert out.startswith("grip: soft by rule 2, strength 1")
    _, out, _ = call(*words[:2], "--row", "force=1,5,slip=0,1", "--decimal", ",")
    assert "force is low: 1.5, 3.5 N below its cut 5" in out
    code, out, err = call(*words, "--number", "3")
    assert (code, out) == (2, "")
    assert err == "rows.csv has 2 rows, and no row 3\n"


def test_json_has_the_same_facts(call: Call) -> None:
    words = ("why", "example-grip.yaml", "--row", "force=3,slip=0.2", "--json")
    facts = json.loads(call(*words)[1])
    assert facts["format"] == "fuzzytree-why/1"
    assert facts["change"]["verdict"] == "PROVED"
    [move] = facts["change"]["moves"]
    assert (move["input"], move["value"], move["new"]) == ("force", 5.0002, "5.0002")
    assert facts["because"][0]["cut"] == 5.0


def test_categories_dates_and_whole_numbers_change_as_what_they_are(
    call: Call, folder: Path
) -> None:
    (folder / "woods.csv").write_text(WOODS)
    ft.save(ft.learn("woods.csv", target="kind", columns_per_node=1), "woods.yaml")
    row = "heat=15,wood=oak,day=2024-03-02,doors=2"
    code, out, err = call("why", "woods.yaml", "--row", row)
    assert (code, err) == (0, "")
    assert "change     to y:" in out
    _, out, _ = call("why", "woods.yaml", "--row", row, "--limits", "heat=0:19")
    assert "wood oak -> fir; a whole range; proved smallest" in out
    _, out, _ = call("why", "woods.yaml", "--row", row.replace("15", ""))
    assert "filled in  " in out
    assert " for a missing heat\n" in out
    assert "seen       " in out


def test_a_row_of_any_names_and_texts_is_written_in_json(
    call: Call, folder: Path
) -> None:
    lines = [f'{size},"{wood}",{wood}' for size in range(40) for wood in ("a=1", "b")]
    (folder / "odd.csv").write_text("\n".join(['"size, cm",a=b,y', *lines]))
    ft.save(ft.learn("odd.csv", target="y", columns_per_node=1), "odd.yaml")
    code, out, err = call("why", "odd.yaml", "--row", '{"size, cm": 3, "a=b": "a=1"}')
    assert (code, err) == (0, "")
    assert out.startswith("odd: a=1 by rule ")
    assert "change     to b: a=b a=1 -> b; a whole range; proved smallest" in out


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "name one row: with --row, or with --data and --number"),
        (("--row", "force=3"), "the row has no column 'slip', which the model needs; "),
        (("--row", "slip=1,slip=2"), "--row slip=1,slip=2: 'slip' stands twice"),
        (("--row", "force"), "--row force: must be NAME=VALUE,NAME=VALUE,..."),
        (("--row", '{"force":'), '--row {"force":: must be {"NAME": VALUE, ...} with'),
        (("--row", "force=3,slip=wet"), "the row, row 1: column 'slip' holds text"),
        (("--wanted", "hard"), "no class 'hard'; there is open, soft, firm"),
        (("--fixed", "forse"), "no input 'forse'; there is force, slip (did you mean "),
        (
            ("--fixed", "force", "--fixed", "slip"),
            "every input is fixed, which leaves ",
        ),
        (
            ("--costs", "force=0"),
            "the cost of 'force' must be above 0, not 0.0; fix",
        ),
        (("--costs", "force=nan"), "the cost of 'force' must be above 0, not nan; fix"),
        (("--costs", "force=much"), "--costs force=much: must be NAME=NUMBER,NAME="),
        (("--limits", "force=4:9"), "the row lies outside the limits: 'force' is 3.0"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(
    call: Call, words: tuple[str, ...], sentence: str
) -> None:
    row = () if not words or "--row" in words else ("--row", "force=3,slip=0.2")
    code, out, err = call("why", "example-grip.yaml", *row, *words)
    assert (code, out) == (2, "")
    assert err.startswith(sentence)


def test_a_system_has_no_class_to_change(call: Call) -> None:
    row = ("--row", "service=3,food=8")
    code, _, err = call("why", "example-tipper.fll", *row, "--wanted", "high")
    assert code == 2
    assert err.startswith(
        "'tipper' is a fuzzy system: it decides for no class, so that"
    )


def test_an_onnx_file_has_no_rules_to_explain(call: Call) -> None:
    code, _, err = call("why", "grip.onnx", "--row", "force=3,slip=0.2")
    assert code == 2
    assert "grip.onnx" in err

"""What changed between two models: structure by identity, decisions by proof."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Sampled,
    Witness,
)
from fuzzytree.auditing.diff.differences import difference
from fuzzytree.auditing.diff.records import Difference
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.errors import ReadError, TableError
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.semantics import as_system
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

FEW = AuditSettings(rows=500)


def grip(cut: float = 2.0) -> RuleBase:
    soft = Term("soft", Band(high=cut, right=cut + 1.0))
    hard = Term("hard", Band(low=cut, left=cut - 1.0))
    wet = Term("wet", Points((0.0, 1.0), (0.0, 1.0)))
    return RuleBase(
        "grip",
        ("hold", "drop"),
        (
            Variable("force", (soft, hard), "N", 0.0, 5.0),
            Variable("slip", (wet,), "", 0.0, 1.0),
        ),
        (
            Rule(
                (Proposition("force", ("soft",)), Proposition("slip", ("wet",))), "drop"
            ),
            Rule((Proposition("force", ("hard",)),), "hold"),
        ),
        Semantics(uncovered="hold"),
    )


def results(old: Document, new: Document) -> Difference:
    return ft.diff(old, new, settings=FEW)


def sentences(found: Difference) -> list[tuple[str, str]]:
    return [(change.grade, change.sentence) for change in found.changes]


def test_a_model_and_itself_are_equal_on_any_input() -> None:
    found = results(grip(), grip())
    assert (found.verdict, found.ok, found.changes) == ("equal", True, ())
    state = found.answers[0].state
    assert isinstance(state, Proved)
    assert state.confirmed.startswith("z3 ")
    assert state.how == (
        "both take the same curves of the same inputs in the same rules, on any input"
    )


def test_a_tree_and_its_rules_are_equal() -> None:
    tree = random_tree(1)
    assert results(tree, rules_from_tree(tree)).verdict == "equal"


def test_a_rule_of_another_class_breaks_decisions_and_its_repair_does_not() -> None:
    old = grip()
    new = replace(old, rules=(old.rules[0], replace(old.rules[1], then="drop")))
    found = results(old, new)
    assert (found.verdict, found.ok) == ("changed", False)
    assert sentences(found) == [
        ("breaking", "rule 2 has changed: its class is 'drop', and was 'hold'")
    ]
    (state,) = found.witnesses
    assert [claim.label for claim in state.claims] == ["hold", "drop"]
    assert [claim.of for claim in state.claims] == ["old", "new"]
    assert results(old, replace(new, rules=old.rules)).ok


def test_names_units_and_notes_are_cosmetic() -> None:
    old = grip()
    force, slip = old.variables
    soft, hard = force.terms
    new = replace(
        old,
        name="gripper",
        variables=(
            replace(force, unit="kN", terms=(replace(soft, name="weak"), hard)),
            slip,
        ),
        rules=(
            Rule(
                (Proposition("force", ("weak",)), old.rules[0].when[1]),
                "drop",
                support=9,
            ),
            old.rules[1],
        ),
    )
    found = results(old, new)
    assert found.verdict == "equal"
    assert sentences(found) == [
        ("cosmetic", "the unit of 'force' is 'kN', and was 'N'"),
        ("cosmetic", "the term 'soft' of 'force' is called 'weak'"),
        ("cosmetic", "1 rule is supported by other training rows"),
        ("cosmetic", "the model 'grip' is called 'gripper'"),
    ]
    assert all(change.is_proved for change in found.changes)


def test_rules_in_another_order_break_nothing_where_no_tie_changes() -> None:
    rules = rules_from_tree(random_tree(1, combinations=0))
    found = results(rules, replace(rules, rules=rules.rules[::-1]))
    assert (found.verdict, found.ok) == ("equal", True)
    ((grade, text),) = sentences(found)
    assert grade == "non-breaking"
    assert text == (
        "6 rules stand at another place among the others, which matters where two are "
        "equally strong"
    )


def test_a_class_that_is_called_otherwise_is_one_breaking_change() -> None:
    old = grip()
    new = replace(
        old,
        classes=("hold", "let go"),
        rules=(replace(old.rules[0], then="let go"), old.rules[1]),
    )
    found = results(old, new)
    assert sentences(found) == [
        ("breaking", "the class 'drop' is called 'let go'"),
    ]
    assert found.verdict == "changed"


def test_rules_are_matched_by_what_they_say() -> None:
    old = grip()
    extra = Rule((Proposition("slip", ("wet",), hedges=("not",)),), "hold")
    proposition = Proposition("slip", ("wet",), hedges=("not",))
    changed = replace(old.rules[0], when=(old.rules[0].when[0], proposition))
    new = replace(old, rules=(extra, old.rules[1], changed))
    found = results(old, new)
    assert [(c.sentence, c.old_rules, c.new_rules) for c in found.changes] == [
        (
            "rule 1 (now 3) has changed: it has 'slip is not wet' in place of "
            "'slip is wet'",
            (1,),
            (3,),
        ),
        ("rule 1 is new: IF slip is not wet THEN hold", (), (1,)),
        (
            "1 rule stands at another place among the others, which matters where two "
            "are equally strong",
            (),
            (),
        ),
    ]


def test_an_input_that_is_gone_breaks_and_a_range_does_not() -> None:
    old = grip()
    force, slip = old.variables
    new = replace(
        old,
        variables=(replace(force, high=6.0), replace(slip, name="slide")),
        rules=(
            Rule((old.rules[0].when[0], Proposition("slide", ("wet",))), "drop"),
            old.rules[1],
        ),
    )
    texts = {text: grade for grade, text in sentences(results(old, new))}
    assert texts["the input 'slip' was removed"] == "breaking"
    assert texts["the input 'slide' is new, so that rows need it"] == "breaking"
    assert texts["the range of 'force' is 0.0 to 6.0, and was 0.0 to 5.0"] == (
        "non-breaking"
    )


def test_another_answer_to_missing_values_breaks_though_all_others_are_equal() -> None:
    old = grip()
    semantics = replace(old.semantics, missing="drop")
    found = results(old, replace(old, semantics=semantics))
    assert (found.verdict, found.ok) == ("equal", False)
    assert sentences(found) == [
        ("breaking", "the answer where a value is missing is 'drop', and was no class")
    ]


def test_rows_of_data_are_answered_by_both() -> None:
    table = np.array([[1.0, 0.9], [2.5, 0.5], [math.nan, 0.5]])
    found = ft.diff(
        grip(2.0),
        grip(3.0),
        data=ft.table(table, columns=["force", "slip"]),
        settings=FEW,
    )
    assert found.rows == 3
    state = next(a.state for a in found.answers if a.subject == "rows")
    assert isinstance(state, Sampled)
    assert (state.hits, state.rows) == (1, 3)
    assert any("row 2: " in answer.sentence for answer in found.answers)


def test_a_row_beyond_the_domain_counts_too() -> None:
    table = np.array([[9.0, 0.9]])
    found = ft.diff(
        grip(8.0),
        grip(10.0),
        data=ft.table(table, columns=["force", "slip"]),
        settings=FEW,
        limits={"force": (0.0, 5.0)},
    )
    assert found.verdict == "changed"
    assert any("row 1: " in answer.sentence for answer in found.answers)


def test_limits_say_where_decisions_are_compared() -> None:
    near = {"force": (0.0, 1.0)}
    found = ft.diff(grip(2.0), grip(2.5), limits=near, settings=FEW)
    assert found.verdict == "equal"
    assert isinstance(found.answers[0].state, Proved)
    assert found.changes[0].sentence == (
        "the curve of 'soft' of 'force' has changed outside the domain"
    )


def test_what_cannot_be_decided_is_left_open_and_said_so() -> None:
    # The two meet at a third, which is no double.
    falls = Term("falls", Points((0.0, 1.0), (1.0, 0.0)))
    rises = Term("rises", Points((0.0, 2.0), (0.0, 1.0)))
    rules = (
        Rule((Proposition("x", ("falls",)),), "a"),
        Rule((Proposition("x", ("rises",)),), "b"),
    )
    old = RuleBase("tie", ("a", "b"), (Variable("x", (falls, rises), "", 0, 1),), rules)
    found = results(old, replace(old, rules=rules[::-1]))
    assert (found.verdict, found.ok) == ("open", True)
    state = found.answers[0].state
    assert isinstance(state, Bracket)
    assert (state.low, state.high) == (0.0, 0.0)
    assert found.answers[0].sentence == (
        "no decision was seen to differ, and where both margins are larger than 0 "
        "none does"
    )
    assert [change.is_proved for change in found.changes] == [False]


def test_points_that_a_spent_budget_leaves_out_are_reported() -> None:
    old, new = grip(), replace(grip(), rules=grip().rules[::-1])
    values = np.zeros((len(old.inputs), 5000))
    found = difference(
        old,
        new,
        domain=domain_of(old),
        rows=AuditRows("rows.csv", values),
        budget=Budget(20_000),
    )
    rows = next(one for one in found.answers if one.subject == "rows")
    assert isinstance(rows.state, Sampled)
    assert rows.state.rows < 5000
    assert f"of the first {rows.state.rows} of 5000 rows of rows.csv" in rows.sentence
    left = next(one for one in found.answers if one.subject == "points")
    assert isinstance(left.state, Declined)
    assert left.state.code == "FTD03"
    assert left.sentence.endswith(
        " points were not compared: the budget for single points was spent"
    )
    assert int(left.sentence.split()[0]) > 5000 - rows.state.rows


def test_a_curve_that_changed_is_reported_with_how_far() -> None:
    old = grip()
    slip = replace(
        old.variables[1], terms=(Term("wet", Points((0.0, 2.0), (0.0, 1.0))),)
    )
    found = results(old, replace(old, variables=(old.variables[0], slip)))
    (change,) = found.changes
    assert change.sentence == (
        "the curve of 'wet' of 'slip' has changed, by 0.5 at most, near 1"
    )
    assert change.measures[0].exact == "1/2"


def test_places_are_reported_of_both_files(tmp_path: Path) -> None:
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    first = grip()
    ft.save(first, old)
    ft.save(replace(first, rules=first.rules[:1]), new)
    found = ft.diff(old, new, settings=FEW)
    change = next(c for c in found.changes if "removed" in c.sentence)
    assert change.old is not None
    line = old.read_text("utf-8").splitlines()[change.old.line - 1]
    assert "hold" in line or "force is hard" in line
    assert change.new is None


def test_a_file_in_another_format_is_the_same_model(tmp_path: Path) -> None:
    soft = Term("soft", Points((1.0, 3.0), (1.0, 0.0)))
    hard = Term("hard", Points((1.0, 3.0), (0.0, 1.0)))
    force = replace(grip().variables[0], terms=(soft, hard))
    model = replace(grip(), variables=(force, grip().variables[1]))
    ft.save(model, tmp_path / "model.fcl", allow_loss=True)
    ft.save(model, tmp_path / "model.yaml")
    found = ft.diff(
        tmp_path / "model.yaml", tmp_path / "model.fcl", allow_loss=True, settings=FEW
    )
    assert found.verdict == "equal"


def test_systems_are_compared_by_their_numbers() -> None:
    one = as_system(grip(), scores="class")
    assert results(one, replace(one, note="new")).verdict == "equal"
    block = one.blocks[0]
    fewer = replace(one, blocks=(replace(block, rules=block.rules[1:]),))
    found = results(one, fewer)
    assert (found.verdict, found.ok) == ("changed", False)
    text = "rule 1 was removed: ALWAYS score hold is absent and score drop is absent"
    assert ("breaking", text) in sentences(found)
    moved = replace(one.variables[0], unit="kN", high=9.0)
    found = results(one, replace(one, variables=(moved, *one.variables[1:])))
    assert (found.verdict, found.ok) == ("equal", True)
    assert sentences(found) == [
        ("non-breaking", "the range of 'force' is 0.0 to 9.0, and was 0.0 to 5.0"),
        ("cosmetic", "the unit of 'force' is 'kN', and was 'N'"),
    ]


def test_the_same_input_gives_the_same_bytes() -> None:
    found = [results(grip(2.0), grip(2.5)).to_json() for _ in range(2)]
    assert found[0] == found[1]
    assert json.loads(found[0])["verdict"] == "changed"


def test_models_of_different_inputs_are_not_compared() -> None:
    other = RuleBase("b", ("x",), (Variable("p"),), (Rule((), "x"),))
    with pytest.raises(ReadError) as caught:
        ft.diff(grip(), other)
    assert str(caught.value) == (
        "b: has no input in common with grip: it uses 'p', and that uses 'force', "
        "'slip'"
    )


def test_numbers_are_not_compared_with_classes() -> None:
    system = random_system(2)
    name = system.inputs[0]
    rules = RuleBase(
        "b", ("x",), (Variable(name, low=0.0, high=1.0),), (Rule((), "x"),)
    )
    with pytest.raises(ReadError) as caught:
        ft.diff(rules, system)
    assert str(caught.value) == (
        f"{system.name}: is a fuzzy system whose outputs are numbers, and is not "
        "compared with rules or a tree"
    )


def test_wrong_limits_and_tables_are_refused() -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the text is compared
        ft.diff(grip(), grip(), limits={"forse": (0.0, 1.0)})
    assert str(caught.value) == (
        "limits for 'forse', which is no input; there is force, slip "
        "(did you mean 'force'?)"
    )
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the text is compared
        ft.diff(grip(), grip(), budget=0.0)
    assert str(caught.value) == "the budget must be above 0 million steps, not 0.0"
    with pytest.raises(TableError) as missing:
        ft.diff(
            grip(), grip(), data=ft.table(np.zeros((0, 2)), columns=["force", "slip"])
        )
    assert str(missing.value).endswith("has no rows")


@pytest.mark.heavy
def test_a_witness_is_kept_for_each_pair_of_classes() -> None:
    found = results(random_tree(1, combinations=0), random_tree(2, combinations=0))
    pairs = {tuple(claim.label for claim in state.claims) for state in found.witnesses}
    assert len(pairs) == len(found.witnesses) > 1
    assert all(isinstance(state, Witness) for state in found.witnesses)

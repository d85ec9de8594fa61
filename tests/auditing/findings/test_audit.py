"""An audit as a whole: codes run and not run, ids, locations, digest, bytes."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace
from sklearn import datasets

import fuzzytree as ft
from fuzzytree.api.verbs import audited_rows
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.codes import AUDITED, CODES, FAMILIES
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import (
    LIMITS,
    Audit,
    AuditSelection,
    AuditSettings,
    digest_of,
)
from fuzzytree.auditing.findings.subject import AuditRows, Material
from fuzzytree.errors import TableError
from fuzzytree.exporters import yaml
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.rechecking import recheck
from fuzzytree.report import page, sarif_text
from fuzzytree.semantics import rules_from_tree
from fuzzytree.testing import random_system, random_tree
from tests.auditing.findings.small_trees import one_cut, two_cuts
from tests.cli.conftest import GRASPS, grip

FAR = Domain((DomainSide("force", 3.0, 5.0), DomainSide("slip", 0.0, 1.0)))
"""Where the grip tree never reaches its first leaf."""


UNIT = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))
WINE = Path(__file__).parents[3] / "examples" / "wine" / "wine.csv"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    ft.save(grip(), tmp_path / "grip.yaml")
    (tmp_path / "grasps.csv").write_text(GRASPS, "utf-8")
    return tmp_path


def steep(*order: int) -> RuleBase:
    """Return three rules, in an order of one's own, of which one has no effect."""
    terms = (Term("low", Band(high=1.0)), Term("high", Band(low=1.0)))
    rules = (
        Rule((Proposition("x", ("low",)),), "a"),
        Rule((Proposition("x", ("high",)),), "b"),
        Rule((Proposition("x", ("low",)), Proposition("x", ("high",))), "c"),
    )
    return RuleBase(
        "steep",
        ("a", "b", "c"),
        (Variable("x", terms, low=0.0, high=2.0),),
        tuple(rules[k] for k in order or (0, 1, 2)),
    )


def test_each_code_is_answered_or_listed_as_not_run() -> None:
    found = audit(Material(grip()), domain=FAR)
    results = {one.code for one in found.answers}
    results |= {text.split()[0] for text in found.unasked}
    assert results >= AUDITED
    assert found.is_complete


@pytest.mark.parametrize("table", ["iris", "wine", "breast_cancer", "cultivars"])
def test_nothing_that_fails_is_found_in_a_fresh_tree(table: str) -> None:
    if table == "cultivars":
        tree = ft.learn(WINE, target="cultivar")
    else:
        data = getattr(datasets, f"load_{table}")(as_frame=True)
        names = data.target_names[data.target]
        tree = ft.learn(data.data, target=names)
    found = audit(Material(tree), selection=AuditSelection(skip=["FT6"]))
    assert [a.sentence for a in found.findings if a.severity != "info"] == []
    assert not {a.code for a in found.answers} & {"FT201", "FT203"}
    why = "not asked where true by construction of relative rules"
    raw = "not asked, as raw rules are another model; --select FT203 compares them"
    assert [text for text in found.unasked if ": not asked" in text] == [
        f"FT107 irrelevant proposition: {why}",
        f"FT201 conflict: {why}",
        f"FT203 tree and raw rules differ: {raw}",
    ]


@pytest.mark.parametrize("is_tree", [True, False])
def test_a_model_of_one_leaf_is_audited_shown_and_decided_again(is_tree: bool) -> None:
    tree = FuzzyTree("leaf", ("a", "b"), (), (), (Leaf("a", support=3),))
    model = tree if is_tree else rules_from_tree(tree)
    content = yaml.write(model).content
    material = Material(model, model_file("leaf.yaml", content))
    found = audit(material, selection=AuditSelection(skip=["FT6"]))
    assert (found.findings, found.is_complete) == ((), True)
    report = recheck(msgspec.json.encode(found), content, ("audit", "leaf.yaml"))
    assert report.wrong == []
    assert "Nothing found" in page(found, model)
    assert '"results": []' in sarif_text(found)


def test_the_raw_rules_of_a_tree_are_compared_on_request() -> None:
    select = AuditSelection(select=["FT203"])
    box = Domain((DomainSide("x", 0.0, 1.0),))
    found = audit(Material(one_cut(0.6)), domain=box, selection=select)
    assert {answer.code for answer in found.findings} == {"FT203"}


@pytest.mark.parametrize(
    ("tree", "codes"),
    [
        (two_cuts(0.7), {"FT404"}),
        (two_cuts(0.3), {"FT101", "FT103", "FT404"}),  # no value reaches a leaf
        (replace(two_cuts(0.7), leaves=tuple(map(Leaf, "abb"))), {"FT107", "FT404"}),
        (replace(two_cuts(0.7), leaves=tuple(map(Leaf, "bbb"))), {"FT107", "FT404"}),
    ],
)
def test_a_dead_leaf_and_a_node_without_a_choice_are_found_in_a_tree(
    tree: FuzzyTree, codes: set[str]
) -> None:
    found = audit(Material(tree), domain=UNIT, selection=AuditSelection(skip=["FT6"]))
    assert {answer.code for answer in found.findings} == codes


def test_every_code_belongs_to_one_table_or_another() -> None:
    elsewhere = {code for code in CODES if code.startswith(("FT8", "FT9", "FTD"))}
    assert AUDITED | elsewhere == set(CODES)
    assert not AUDITED & elsewhere


def test_every_function_that_answers_for_a_subject_is_in_the_table() -> None:
    folder = Path(__file__).parents[3] / "fuzzytree" / "auditing" / "findings"
    pattern = re.compile(r"^def (\w*answers)\(subject: Subject\)", re.M)
    functions = {
        f"{path.stem}:{name}"
        for path in folder.glob("*.py")
        for name in pattern.findall(path.read_text("utf-8"))
        if not name.startswith("_")
    }
    assert functions == {family.function for family in FAMILIES}


def test_every_family_answers_with_its_own_codes() -> None:
    found = audit(Material(grip()), domain=FAR)
    known = {code for family in FAMILIES for code in family.codes}
    assert {one.code for one in found.answers} <= known


def test_an_audit_read_from_its_json_is_the_same_and_keeps_its_digest() -> None:
    found = audit(Material(grip()), domain=FAR)
    again = msgspec.json.decode(msgspec.json.encode(found), type=Audit)
    assert again == found
    assert digest_of(again) == found.digest


@pytest.mark.parametrize(
    "edit",
    [{"rows": 7}, {"answers": ()}, {"limits": LIMITS[1:]}, {"is_complete": False}],
    ids=str,
)
def test_an_edit_changes_the_digest(edit: dict[str, object]) -> None:
    found = audit(Material(grip()), domain=FAR)
    assert digest_of(replace(found, **edit)) != found.digest


def test_the_same_audit_has_the_same_bytes() -> None:
    one, other = (
        msgspec.json.encode(audit(Material(grip()), domain=FAR)) for _ in range(2)
    )
    assert one == other


def test_an_unreachable_leaf_is_found_and_gone_where_it_is_reached() -> None:
    found = audit(
        Material(grip()), domain=FAR, selection=AuditSelection(select=["FT101"])
    )
    assert [one.rules for one in found.findings] == [(1,)]
    wide = Domain((DomainSide("force", 0.0, 5.0), DomainSide("slip", 0.0, 1.0)))
    assert not audit(
        Material(grip()), domain=wide, selection=AuditSelection(select=["FT101"])
    ).findings


def test_answers_stand_in_the_order_of_their_codes_and_have_their_own_ids() -> None:
    found = audit(Material(grip()), domain=FAR)
    codes = [one.code for one in found.answers]
    assert codes == sorted(codes)
    ids = [one.id for one in found.answers]
    assert len(set(ids)) == len(ids)
    assert all(one.id.startswith(one.code) for one in found.answers)


def test_an_id_says_what_a_rule_says_and_not_where_it_stands() -> None:
    box = Domain((DomainSide("x", 0.0, 2.0),))
    one = audit(
        Material(steep(0, 1, 2)), domain=box, selection=AuditSelection(select=["FT101"])
    )
    other = audit(
        Material(steep(2, 1, 0)), domain=box, selection=AuditSelection(select=["FT101"])
    )
    assert [a.rules for a in one.findings] == [(3,)]
    assert [a.rules for a in other.findings] == [(1,)]
    assert one.findings[0].id == other.findings[0].id


def test_codes_that_are_left_out_are_reported() -> None:
    found = audit(
        Material(grip()),
        domain=FAR,
        selection=AuditSelection(select=["FT10"], skip=["FT102"]),
    )
    codes = {one.code for one in found.answers}
    assert "FT101" in codes
    assert all(code.startswith("FT10") and code != "FT102" for code in codes)
    assert "FT102 marginal rule: left out by the user" in found.unasked
    assert "FT301 coverage gap: left out by the user" in found.unasked


def test_a_spent_budget_leaves_the_rest_unanswered_and_says_so() -> None:
    found = audit(Material(grip()), domain=FAR, settings=AuditSettings(budget=1e-4))
    assert not found.is_complete
    assert not found.was_interrupted
    why = "not run: the budget of 0.0001 million steps is spent"
    assert f"FT101 dead rule: {why}" in found.unasked


@pytest.mark.heavy
def test_a_budget_that_ends_midway_keeps_what_was_answered() -> None:
    whole = audit(Material(grip()), domain=FAR)
    counts = set[int]()
    for budget in (0.001, 0.01, 0.03, 0.1, 0.3):
        settings = AuditSettings(budget=budget)
        part = audit(Material(grip()), domain=FAR, settings=settings)
        # What is open in a part may be no question in the whole.
        assert {one.id for one in part.findings} <= {one.id for one in whole.findings}
        counts.add(len(part.answers))
    assert len(counts) > 2


def test_accepted_findings_are_no_longer_open() -> None:
    found = audit(
        Material(grip()), domain=FAR, selection=AuditSelection(select=["FT101"])
    )
    name = found.findings[0].id
    again = audit(
        Material(grip()),
        domain=FAR,
        selection=AuditSelection(select=["FT101"], accepted=[name, "FT101-0"]),
    )
    assert again.accepted == (name,)
    assert again.open_findings == ()
    assert again.findings == found.findings


def test_answers_know_their_places_and_how_to_ask_again(folder: Path) -> None:
    found = ft.audit(
        folder / "grip.yaml",
        repeat="fuzzytree audit grip.yaml",
        domain=ft.AuditDomain(limits={"force": (3.0, 5.0)}),
        selection=ft.AuditSelection(select=["FT101"]),
    )
    lines = (folder / "grip.yaml").read_text("utf-8").splitlines()
    place = found.findings[0].places[0]
    assert lines[place.line - 1][place.column - 1 :].startswith("{leaf: 1,")
    assert found.findings[0].repeat == "fuzzytree audit grip.yaml --select FT101"


def test_rows_come_with_their_classes(folder: Path) -> None:
    rows = audited_rows(folder / "grasps.csv", grip(), target="grip")
    assert rows is not None
    assert rows.values.shape == (2, 4)
    assert rows.codes is not None
    assert rows.codes.tolist() == [2, 0, 1, 0]
    (folder / "more.csv").write_text(GRASPS + "1,4,e,hard\n", "utf-8")
    rows = audited_rows(folder / "more.csv", grip(), target="grip")
    assert rows is not None
    assert rows.codes is not None
    assert rows.codes.tolist()[-1] == -1


def test_rows_without_a_class_of_the_model_are_refused(folder: Path) -> None:
    message = (
        f"{folder / 'grasps.csv'}: no row has in column 'note' a class of the model; "
        "there is firm, loose, soft"
    )
    with pytest.raises(TableError) as caught:
        audited_rows(folder / "grasps.csv", grip(), target="note")
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"force": 1.0}, "the row has no value of 'slip'"),
        (
            {"force": 1.0, "slpi": 0.0},
            "the row has a value of 'slpi', which is no input; "
            "there is force, slip (did you mean 'slip'?)",
        ),
        (
            {"force": float("nan"), "slip": 0.0},
            "the row's 'force' must be finite, not nan",
        ),
    ],
)
def test_a_wrong_row_is_one_sentence(row: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        audit(Material(grip()), domain=FAR, row=row)
    assert str(caught.value) == message


@pytest.mark.parametrize("seed", [3, 5])
def test_a_system_is_audited_as_a_view(seed: int) -> None:
    system = random_system(seed)
    box = Domain(tuple(DomainSide(name, 0.0, 1.0) for name in system.inputs))
    found = audit(
        Material(system), domain=box, selection=AuditSelection(select=["FT4", "FT5"])
    )
    assert found.form == "system"
    assert digest_of(found) == found.digest


def test_a_tree_with_rows_counts_them() -> None:
    rows = AuditRows("rows", np.array([[3.0, 4.0], [0.0, 1.0]]))
    assert (
        audit(
            Material(grip(), rows=rows),
            domain=FAR,
            selection=AuditSelection(select=["FT205"]),
        ).rows
        == 2
    )


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(3))
def test_every_random_tree_is_audited_to_its_end(seed: int) -> None:
    found = audit(Material(random_tree(seed)), settings=AuditSettings(rows=500))
    assert found.is_complete
    assert digest_of(found) == found.digest
    assert msgspec.json.decode(msgspec.json.encode(found), type=Audit) == found


def test_where_all_is_declined_the_audit_says_so() -> None:
    root = Path(__file__).resolve().parents[3]
    tipper = ft.load(root / "examples" / "tipper.fll")
    assert isinstance(tipper, ft.FuzzySystem)
    (block,) = tipper.blocks
    ors = (block.rules[0], block.rules[2])
    summed = replace(block, rules=ors, disjunction="algebraic sum")
    found = audit(
        Material(replace(tipper, blocks=(summed,))),
        selection=AuditSelection(select=["FT101"]),
    )
    assert found.answers
    assert all(isinstance(one.state, Declined) for one in found.answers)
    assert found.unasked[0] == ("FT101 dead rule: all that it applies to was declined")

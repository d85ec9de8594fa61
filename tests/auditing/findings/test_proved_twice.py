"""Only what a second program decides again is called proved."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

import fuzzytree as ft
from fuzzytree.auditing.engine.states import Computed, Proved
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import Audit, AuditSelection
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.exporters import yaml
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Conjunction
from fuzzytree.rechecking import recheck
from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.deciding import PROOFS
from fuzzytree.rechecking.outcomes import DoesNotHoldError, UndecidedError
from fuzzytree.rechecking.records import Answer
from fuzzytree.report import audit_verdict
from fuzzytree.testing import random_system
from tests.auditing.diff.test_system_numbers import tipper
from tests.auditing.engine.bases import Kind, random_base, with_hidden_rule

EXAMPLES = Path(__file__).parents[3] / "examples"
WITHOUT_RUNTIMES = AuditSelection(skip=["FT6"])


def audited(model: Document, content: bytes | None = None) -> Audit:
    file = None if content is None else model_file("model.yaml", content)
    return audit(Material(model, file), selection=WITHOUT_RUNTIMES)


def check(model: Document) -> None:
    """Check that the re-checker agrees with all that is called proved."""
    content = yaml.write(model).content
    result = audited(model, content)
    report = recheck(msgspec.json.encode(result), content, ("audit", "model"))
    assert report.wrong == []
    assert not [why for state, why in report.undecided if state == "PROVED"]


@pytest.mark.parametrize("name", ["grip.yaml", "tipper.fll"])
def test_all_that_is_proved_of_an_example_is_decided_again(name: str) -> None:
    check(ft.read(EXAMPLES / name).model)


def test_all_that_is_proved_of_the_tipper_is_decided_again() -> None:
    check(tipper())


@pytest.mark.parametrize("seed", range(2))
def test_all_that_is_proved_of_a_small_base_is_decided_again(seed: int) -> None:
    check(random_base(seed, rules=4, features=2, kind="points"))


@pytest.mark.heavy
def test_all_that_is_proved_of_a_learned_tree_is_decided_again() -> None:
    check(ft.learn(EXAMPLES / "wine" / "wine.csv", target="cultivar"))


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(50))
def test_all_that_is_proved_of_many_bases_is_decided_again(seed: int) -> None:
    norm: Conjunction = "product" if seed % 3 == 0 else "minimum"
    kind: Kind = "lr" if seed % 10 == 0 else "points"
    check(random_base(seed, 3 + seed % 4, 2 + seed % 2, norm, kind))


@pytest.mark.heavy
@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5, 6, 7, 8])
def test_all_that_is_proved_of_a_system_is_decided_again(seed: int) -> None:
    check(random_system(seed, formulas="none"))


def test_what_is_decided_otherwise_is_left_out_and_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuted(case: Case, answer: Answer) -> None:
        raise DoesNotHoldError("it is otherwise")

    monkeypatch.setitem(PROOFS, "FT404.used", refuted)
    result = audited(random_base(1, 4, 2, "minimum", "points"))
    (one,) = (a for a in result.answers if a.code == "FT901")
    sentence = "terms and variables: the proof of FT404 is refuted: it is otherwise"
    assert (one.sentence, one.severity, one.is_finding) == (sentence, "error", True)
    assert "FT404.used" not in {a.message for a in result.answers}


def test_a_dead_rule_that_is_not_confirmed_is_a_warning_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def late(case: Case, answer: Answer) -> None:
        raise UndecidedError("it takes too long")

    model = with_hidden_rule(random_base(1, 2, 2, "minimum", "points"))
    content = yaml.write(model).content
    monkeypatch.setitem(PROOFS, "FT101.never-wins", late)
    result = audited(model, content)
    (dead,) = (a for a in result.findings if a.message == "FT101.never-wins")
    assert isinstance(dead.state, Computed)
    assert (dead.severity, result.unconfirmed) == ("warning", 1)
    assert audit_verdict(result).startswith(
        f"{len(result.findings)} findings (1 unconf"
    )
    encoded = msgspec.json.encode(result)
    assert recheck(encoded, content, ("audit", "model")).wrong == []


def test_how_much_is_decided_again_is_a_number_of_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = random_base(1, 4, 2, "minimum", "points")
    spent = []
    for steps in (10**9, 20_000, 20_000):
        monkeypatch.setattr("fuzzytree.rechecking.STEPS_IN_ALL", steps)
        proofs = [a for a in audited(model).answers if isinstance(a.state, Proved)]
        spent.append([a.id for a in proofs])
    assert len(spent[0]) > len(spent[1]) > 0
    assert spent[1] == spent[2]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(12))
def test_nothing_that_is_said_of_a_system_is_refuted(seed: int) -> None:
    model = random_system(seed, formulas="none")
    content = yaml.write(model).content
    result = audited(model, content)
    assert not [one.sentence for one in result.answers if one.code == "FT901"]
    encoded = msgspec.json.encode(result)
    assert recheck(encoded, content, ("audit", "model")).wrong == []


def test_where_rules_stand_in_the_file_does_not_matter() -> None:
    model = random_base(1, 4, 2, "product", "points")
    content = b"# by hand\n" + yaml.write(model).content
    both = audited(model), audited(model, content)
    one, other = ([type(answer.state) for answer in of.answers] for of in both)
    assert one == other
    assert Proved in one

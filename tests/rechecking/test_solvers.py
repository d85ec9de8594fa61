"""Solvers of others read our text, agree with audits, and may fail."""

from __future__ import annotations

import random
import stat
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import msgspec
import pytest

import fuzzytree as ft
from fuzzytree.auditing.decide.states import Proved
from fuzzytree.auditing.findings.audit import audit, smt_text
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import Audit, AuditSelection
from fuzzytree.auditing.findings.records import digest_of as digest_of_audit
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.exporters import yaml
from fuzzytree.model import Document
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
from fuzzytree.rechecking import CannotRunError, model_text, recheck
from fuzzytree.rechecking.case import strengths
from fuzzytree.rechecking.models import Model
from fuzzytree.report.audit import audit_verdict
from fuzzytree.testing import random_tree
from tests.auditing.decide.bases import random_base as mixed_base
from tests.auditing.decide.old_bases import Kind, random_base, with_hidden_rule
from tests.rechecking.audits import grip

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = "audit.json", "model.yaml"
CVC5 = """
import sys
import cvc5

solver = cvc5.Solver(cvc5.TermManager())
solver.setOption("incremental", "true")
solver.setOption("rlimit-per", "400000")
parser = cvc5.InputParser(solver)
parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, sys.stdin.read(), "model")
symbols = parser.getSymbolManager()
while not (command := parser.nextCommand()).isNull():
    print(command.invoke(solver, symbols), end="")
"""

Program = Callable[[str], str]


@pytest.fixture
def program(tmp_path: Path) -> Program:
    """Return a function that writes a program, and returns its path."""

    def write(text: str) -> str:
        path = tmp_path / "solver"
        path.write_text(f"#!{sys.executable}\n{text}", "utf-8")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return str(path)

    return write


def audited(model: Document) -> tuple[Audit, bytes]:
    """Return an audit, and its model's file."""
    content = yaml.write(model).content
    material = Material(model, model_file(NAMES[1], content))
    return audit(material, selection=AuditSelection(skip=["FT6", "FT7"])), content


def both_agree(model: Document, program: Program) -> None:
    """Check that z3 and cvc5 refute nothing, and confirm the same answers."""
    pytest.importorskip("cvc5")
    result, content = audited(model)
    assert not [one.sentence for one in result.answers if one.code == "FT901"]
    text = msgspec.json.encode(result)
    ours = recheck(text, content, NAMES)
    theirs = recheck(text, content, NAMES, program(CVC5))
    assert (ours.wrong, theirs.wrong) == ([], [])
    assert [*ours.confirmed] == [*theirs.confirmed]


@pytest.mark.parametrize(
    "name", ["grip.yaml", pytest.param("tipper.fll", marks=pytest.mark.heavy)]
)
def test_z3_and_cvc5_agree_with_the_audit_of_an_example(
    name: str, program: Program
) -> None:
    both_agree(ft.read(EXAMPLES / name).model, program)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("seed", range(24))
def test_z3_and_cvc5_agree_with_the_audit_of_a_random_base(
    seed: int, program: Program
) -> None:
    kind: Kind = "band" if seed % 2 else "points"
    base = random_base(seed, 3 + seed % 4, 2, kind=kind, shared=0.5, odd=0.3)
    both_agree(base, program)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(3))
def test_z3_and_cvc5_agree_with_the_audit_of_a_random_tree(
    seed: int, program: Program
) -> None:
    both_agree(random_tree(seed, leaves=5), program)


def value_of(z3: Any, name: str, context: Any) -> Fraction:
    reply = z3.Z3_eval_smtlib2_string(context.ref(), f"(get-value ({name}))")
    text = reply[reply.rindex("| ") + 2 : reply.rindex("))")]
    numbers = [
        Fraction(word)
        for word in text.replace("(", " ").replace(")", " ").split()
        if word not in "-/"
    ]
    sign = -1 if "(-" in text else 1
    return sign * numbers[0] / (numbers[1] if len(numbers) > 1 else 1)


@pytest.mark.parametrize("kind", ["points", "band"])
@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_the_text_has_the_exact_strengths_at_points(norm: Any, kind: Kind) -> None:
    z3 = pytest.importorskip("z3")
    content = yaml.write(random_base(4, 4, 2, norm, kind, odd=0.5)).content
    model, chance = Model(content, "model.yaml"), random.Random(1)
    for _ in range(5):
        context = z3.Context()
        z3.Z3_eval_smtlib2_string(context.ref(), model_text(content))
        point = {n: Fraction(chance.randrange(65), 64) for n in ("x1", "x2")}
        for name, x in point.items():
            asked = f"(assert (= |{name}| (/ {x.numerator}.0 {x.denominator}.0)))"
            z3.Z3_eval_smtlib2_string(context.ref(), asked)
        assert z3.Z3_eval_smtlib2_string(context.ref(), "(check-sat)") == "sat\n"
        every = strengths(model.rules, point)
        names = [rule.name for rule in model.rules.rules]
        for name, (low, high) in zip(names, every, strict=True):
            assert low == high == value_of(z3, f"|{name}|", context)


def stepped() -> RuleBase:
    """Return rules of which the first wins at a single value, where a step begins."""
    band = Term("t0", Band(0.8, 2.6))
    slope = Term("t2", Points((0.2, 1.5, 3.4), (0.0, 1.0, 0.0)))
    x = Variable("x0", (band, slope), "", 0.0, 4.0)
    is_band, is_slope = Proposition("x0", ("t0",)), Proposition("x0", ("t2",))
    rules = (
        Rule((is_slope,), "b"),
        Rule((is_band,), "a"),
        Rule((is_band,), "c"),
        Rule((Proposition("x0", ("t0",), ("not",)),), "b"),
        Rule((is_band,), "c"),
    )
    return RuleBase("stepped", ("a", "b", "c"), (x,), rules, Semantics())


def test_a_rule_that_a_solver_sees_win_is_not_called_dead() -> None:
    result, content = audited(stepped())
    dead = [a for a in result.answers if a.message == "FT101.never-wins"]
    assert 1 not in [one.rules[0] for one in dead]
    assert recheck(msgspec.json.encode(result), content, NAMES).wrong == []


def test_what_a_solver_refutes_is_left_out_and_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def other(*_: object) -> Any:
        from fuzzytree.rechecking.solvers import Results

        return Results("z3 0", ["sat"] * len(_[1]))  # type: ignore[arg-type]

    monkeypatch.setattr("fuzzytree.rechecking.checks.ask", other)
    result, _ = audited(with_hidden_rule(random_base(1, 2, 2, kind="points")))
    codes = {one.code: one for one in result.answers}
    assert codes["FT901"].severity == "error"
    assert "is refuted: not so: rule " in codes["FT901"].sentence
    assert "FT101.never-wins" not in {one.message for one in result.answers}


@pytest.mark.parametrize(("rival", "many"), [(1, 0), (2, 0), (4, 1)])
def test_rivals_that_suffice_are_claimed_and_others_refuted(
    rival: int, many: int
) -> None:
    high, wide = Proposition("force", ("high",)), Proposition("slip", ("high",))
    low = Proposition("force", ("low",))
    every = (((high,), "soft"), ((wide,), "firm"), ((high, wide), "open"))
    rules = tuple(Rule(when, then) for when, then in (*every, ((low,), "soft")))
    base = msgspec.structs.replace(
        grip(), classes=("soft", "firm", "open"), rules=rules
    )
    result, content = audited(base)
    answers = [
        msgspec.structs.replace(one, state=Proved("by one", (rival,)))
        if one.message == "FT101.never-wins"
        else one
        for one in result.answers
    ]
    edited = msgspec.structs.replace(result, answers=tuple(answers))
    edited = msgspec.structs.replace(edited, digest=digest_of_audit(edited))
    wrong = recheck(msgspec.json.encode(edited), content, NAMES).wrong
    assert len(wrong) == many
    assert all(f"nowhere stronger than rule {rival}" in one for one in wrong)


def test_without_a_solver_proofs_stay_and_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "z3", None)
    result, content = audited(grip())
    states = [one.state for one in result.answers if isinstance(one.state, Proved)]
    assert {state.confirmed for state in states} == {"", "recheck"}
    why = "no solver is at hand: install fuzzytree-toolkit[proofs]"
    assert result.unasked[-1] == f"FT901 proof refuted: not asked: {why}"
    assert f"5 confirmed by recheck ({why})" in audit_verdict(result)
    report = recheck(msgspec.json.encode(result), content, NAMES)
    assert (report.wrong, report.exit_code) == ([], 2)
    assert report.unconfirmed == 4


def test_why_a_solver_confirms_nothing_is_in_the_audit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> Any:
        raise CannotRunError("z3 0: it fails: 'out of memory'")

    monkeypatch.setattr("fuzzytree.rechecking.checks.ask", fail)
    text = audit_verdict(audited(grip())[0])
    assert "12 PROVED, none confirmed (z3 0: it fails: 'out of memory')" in text


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import sys; sys.stdin.read(); print('perhaps')", "it fails: 'perhaps'"),
        ("import sys; sys.stdin.read(); print('unsat')", "1 answers to 11 claims"),
        ("raise SystemExit(3)", "it fails: 'exit 3'"),
    ],
)
def test_a_program_that_fails_is_one_sentence(
    text: str, what: str, program: Program
) -> None:
    result, content = audited(grip())
    with pytest.raises(CannotRunError) as caught:
        recheck(msgspec.json.encode(result), content, NAMES, program(text))
    assert str(caught.value).endswith(what)


def test_a_program_that_does_not_end_is_stopped(
    monkeypatch: pytest.MonkeyPatch, program: Program
) -> None:
    monkeypatch.setattr("fuzzytree.rechecking.solvers.MOST_SECONDS", 0.2)
    result, content = audited(grip())
    path = program("import time; time.sleep(60)")
    with pytest.raises(CannotRunError) as caught:
        recheck(msgspec.json.encode(result), content, NAMES, path)
    assert str(caught.value).endswith("no answer in 0.2 s")


def test_a_program_that_is_missing_is_one_sentence() -> None:
    result, content = audited(grip())
    with pytest.raises(CannotRunError, match=r"^no/such: no such program$"):
        recheck(msgspec.json.encode(result), content, NAMES, "no/such")


def test_the_claims_of_an_audit_are_a_text_for_any_solver() -> None:
    z3 = pytest.importorskip("z3")
    result, _ = audited(grip())
    text = smt_text(result, grip())
    assert "; FT104: rule 4 is nowhere stronger than rule 2: unsat proves it" in text
    context = z3.Context()
    answers = z3.Z3_eval_smtlib2_string(context.ref(), text).split()
    assert {*answers} == {"unsat"}


@pytest.mark.parametrize("name", ["grip.yaml", "tipper.fll", "scorecard.fll"])
def test_each_example_is_written_for_solvers(name: str) -> None:
    model = ft.read(EXAMPLES / name).model
    result = audit(Material(model), selection=AuditSelection(select=["FT404"]))
    assert "(set-logic QF_" in smt_text(result, model)


@pytest.mark.parametrize("kind", ["steps", "curves", "categories"])
@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_each_random_base_is_written_for_solvers(norm: Any, kind: Any) -> None:
    for seed in range(1 if kind == "curves" else 6):
        model, domain = mixed_base(seed, kind, norm, sums=seed % 2)
        only = AuditSelection(select=["FT404"])
        result = audit(Material(model), domain=domain, selection=only)
        assert f"; base {seed}: " in smt_text(result, model)


def test_values_names_and_missing_are_asserted() -> None:
    term = Term("any", Points((0.0, 2.0), (0.0, 1.0)))
    odd = Variable("x", (term,), "N", 0.0, 1.0, missing=-1.0)
    colour = Variable("colour|s", (term,), categories=("blue", "red"))
    when = (Proposition("x", ("any",)), Proposition("colour|s", ("any",)))
    base = RuleBase("odd", ("a",), (odd, colour), (Rule(when, "a"),), Semantics())
    text = model_text(yaml.write(base).content)
    assert "(declare-const |x'| Real) ; N\n" in text
    assert "(assert (or (and (<= 0.0 |x'|) (<= |x'| 1.0)) (= |x'| (- 1.0))))" in text
    assert "(assert (or (= |colour!s| 0.0) (= |colour!s| 1.0))) ; blue, red" in text


def test_a_system_that_no_solver_reads_is_refused_by_name() -> None:
    system = ft.read(EXAMPLES / "tipper.fll").model
    block = system.blocks[0]
    other = msgspec.structs.replace(block, disjunction="algebraic_sum")
    system = msgspec.structs.replace(system, blocks=(other,))
    with pytest.raises(CannotRunError) as caught:
        model_text(yaml.write(system).content)
    assert str(caught.value).startswith("rule 1: not a minimum, product or maximum")

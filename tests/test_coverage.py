"""Which rules of a fuzzy system fire in probes, and how much they cover."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.checking.representations import check
from fuzzytree.checking.subject import coverage_of
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Not,
    Or,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.agreement import Coverage
from fuzzytree.model.contracts import Outcome, Run
from fuzzytree.model.rulebase import Part
from fuzzytree.runtimes.programs import run_system
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.probing import Aim, range_rows
from fuzzytree.semantics.samples import all_samples

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

LOW = Term("low", Trapezoid(0.0, 0.1, 0.1, 0.2))
THIN = Term("thin", Trapezoid(0.5, 0.5, 0.5, 0.5))
NEVER = Term("never", Trapezoid(0.7, 0.8, 0.8, 0.9))
INPUTS = tuple(Variable(n, (LOW, THIN, NEVER), low=0.0, high=1.0) for n in "ab")
OUTPUT = SystemOutput(
    "y",
    (Term("one", Singleton(1.0)),),
    None,
    None,
    Defuzzifier("weighted average"),
)
THEN = (Conclusion("y", "one"),)


def system_of(*conditions: Condition) -> FuzzySystem:
    rules = tuple(SystemRule(one, THEN) for one in conditions)
    return FuzzySystem(
        "s", INPUTS, (OUTPUT,), (RuleBlock(rules, "minimum", "maximum"),)
    )


CONDITIONS: list[Condition] = [
    And((Proposition("a", ("thin",)), Proposition("b", ("thin",)))),
    And((Proposition("a", ("low",)), Proposition("b", ("never",)))),
    And(
        (
            Not(Proposition("a", ("low",))),
            Not(Or((Proposition("b", ("low",)), Proposition("b", ("thin",))))),
        )
    ),
    Or(
        (
            And((Proposition("a", ("thin",)), Proposition("b", ("low",)))),
            Proposition("a", ("never",)),
        )
    ),
    And(
        (Proposition("a", ("low",), ("very",)), Proposition("b", ("never",), ("not",)))
    ),
]


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_row_aimed_at_a_rule_fires_it(condition: Condition) -> None:
    system = system_of(condition)
    aim = Aim(system)
    for _ in range(20):
        row = aim.row(system.rules[0])
        assert infer(system, row).strengths[0] > 0.0


def test_a_row_is_aimed_at_a_rule_on_a_combination() -> None:
    mix = Variable("mix", (NEVER,), parts=(Part("a", 2.0, 0.5), Part("b", -3.0)))
    rule = SystemRule(Proposition("mix", ("never",)), THEN)
    system = FuzzySystem("s", (*INPUTS, mix), (OUTPUT,), (RuleBlock((rule,)),))
    assert infer(system, Aim(system).row(rule)).strengths[0] > 0.0


def test_every_rule_that_can_fire_fires_in_a_probe_of_a_check() -> None:
    found = check(system_of(*CONDITIONS), limit=10, runtimes=["native"])
    assert found.ok
    assert found.coverage is not None
    assert found.coverage.unfired == ()
    assert found.probes > 10


IMPOSSIBLE = And((Proposition("a", ("low",)), Proposition("a", ("never",))))


def test_a_rule_that_cannot_fire_is_named() -> None:
    system = system_of(CONDITIONS[0], IMPOSSIBLE)
    proof = ft.convert(system, "onnx").proof
    assert proof.verdict == "alike"
    assert proof.sentence.endswith(
        "generated rows like the system, in which 1 of 2 rules fire"
    )
    assert proof.coverage is not None
    assert proof.coverage.unfired == (2,)
    assert proof.coverage.sentences[0] == "no generated row fires rule 2 of 2"


def test_a_system_that_mostly_answers_its_default_is_reported() -> None:
    found = coverage_of(system_of(CONDITIONS[1]))
    assert found.uncovered > 900
    assert found.sentences == (
        f"in {found.uncovered} of 1000 rows drawn evenly from the ranges of the inputs "
        "an output has no number, and its default answers",
    )


def test_a_system_that_covers_its_ranges_has_nothing_to_report() -> None:
    system = all_samples()["Mamdani, singletons"]
    assert isinstance(system, FuzzySystem)
    assert coverage_of(system).sentences == ()


def test_many_rules_that_do_not_fire_are_named_in_a_line() -> None:
    shown = ", ".join(map(str, range(1, 21)))
    found = Coverage(30, tuple(range(1, 24)), 10, 0)
    assert found.sentences == (
        f"no generated row fires rules {shown} and 3 more of 30",
    )


def test_rows_are_drawn_from_the_ranges_themselves() -> None:
    wide = replace(LOW, function=Trapezoid(-100.0, 0.0, 1.0, 100.0))
    system = system_of(Proposition("a", ("low",)))
    inputs = tuple(replace(one, terms=(wide, THIN, NEVER)) for one in INPUTS)
    rows = range_rows(replace(system, variables=inputs), 50)
    assert all(0.0 <= value <= 1.0 for row in rows for value in row.values())


def test_probing_thousands_of_rules_runs_fewer_rows_than_rules(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    labels = tuple(Term(f"t{k}", Trapezoid(k - 1.0, k, k, k + 1.0)) for k in range(7))
    inputs = tuple(Variable(f"x{k}", labels, low=0.0, high=6.0) for k in range(4))
    rules = tuple(
        SystemRule(
            And(tuple(Proposition(f"x{k}", (f"t{t}",)) for k, t in enumerate(terms))),
            THEN,
        )
        for terms in itertools.product(range(7), repeat=4)
    )
    block = RuleBlock(rules, "minimum")
    widths: list[int] = []

    def counted(system: FuzzySystem) -> Run:
        run = run_system(system)

        def answer(values: FloatArray) -> Outcome:
            widths.append(values.shape[1])
            return run(values)

        return answer

    monkeypatch.setattr("fuzzytree.checking.subject.run_system", counted)
    found = coverage_of(FuzzySystem("grid", inputs, (OUTPUT,), (block,)))
    assert (found.rules, found.unfired, found.uncovered) == (2401, (), 0)
    assert sum(widths) - found.rows < found.rules

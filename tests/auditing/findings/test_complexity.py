"""How large a rule base is: counted, and Nauck's index by exact integrals."""

from __future__ import annotations

from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import AuditSelection
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.model.tree import depth
from fuzzytree.numerics.exact import exact_degree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.decide.old_bases import random_base

DOWN = Term("low", Points((0.0, 2.0), (1.0, 0.0)))
UP = Term("high", Points((0.0, 2.0), (0.0, 1.0)))
RULES = RuleBase(
    "grip",
    ("soft", "hard"),
    (Variable("force", (DOWN, UP), low=0.0, high=2.0),),
    (
        Rule((Proposition("force", ("low",)),), "soft"),
        Rule((Proposition("force", ("high",)),), "hard"),
    ),
)


def measures(model: RuleBase, domain: Domain | None = None) -> dict[str, str | float]:
    (answer,) = audit(
        Material(model), domain=domain, selection=AuditSelection(select=["FT501"])
    ).answers
    return {one.name: one.exact or one.value for one in answer.measures}


def test_a_partition_of_one_variable_has_the_index_one() -> None:
    assert measures(RULES) == {
        "rules": 2,
        "propositions": 2,
        "most propositions of a rule": 1,
        "propositions per rule": 1.0,
        "distinct terms in use": 2,
        "variables in use": 1,
        "complexity of Nauck": "1",
        "coverage of Nauck": "1",
        "partition of Nauck": "1",
        "index of Nauck": "1",
    }


def test_a_sum_of_degrees_above_one_covers_less() -> None:
    # One term is 1, the others p - 1 are 1 too: (3 - 2) / (3 - 1) on all of it.
    flat = Points((0.0,), (1.0,))
    terms = (Term("a", flat), Term("b", flat), Term("c", Points((0.0,), (0.0,))))
    rules = replace(
        RULES,
        variables=(Variable("force", terms, low=0.0, high=2.0),),
        rules=(Rule((Proposition("force", ("a",)),), "soft"),),
    )
    found = measures(rules)
    assert found["coverage of Nauck"] == "1/2"
    assert found["partition of Nauck"] == "1/2"
    assert found["complexity of Nauck"] == "2"


def test_the_coverage_equals_a_dense_sum() -> None:
    rules = random_base(5, rules=4, features=1, kind="lr")
    (variable,) = rules.variables
    count, steps, total = len(variable.terms), 500, 0.0
    for number in range(steps):
        at = Fraction(2 * number + 1, 2 * steps)
        degree = float(sum(exact_degree(t.shape, at) for t in variable.terms))
        total += degree if degree <= 1.0 else (count - degree) / (count - 1)
    found = float(measures(rules)["coverage of Nauck"])
    assert found == pytest.approx(total / steps, abs=1e-3)


def test_a_domain_of_one_point_has_no_index() -> None:
    domain = Domain((DomainSide("force", 1.0, 1.0),))
    assert "index of Nauck" not in measures(RULES, domain)


def test_rules_that_ask_nothing_have_no_index() -> None:
    rules = replace(RULES, rules=(Rule((), "soft"),))
    assert measures(rules)["propositions"] == 0


def test_the_depth_of_a_tree_is_its_longest_path() -> None:
    tree = random_tree(4, leaves=9)
    (answer,) = audit(
        Material(tree), selection=AuditSelection(select=["FT501"])
    ).answers
    longest = max(len(rule.when) for rule in rules_from_tree(tree).rules)
    results = {one.name: one.value for one in answer.measures}
    assert results["depth of the tree"] == depth(tree) == longest

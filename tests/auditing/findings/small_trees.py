"""Small trees, and subjects made of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.auditing.findings.subject import AuditRows, Subject, view
from fuzzytree.auditing.findings.subject import subject_of as ready
from fuzzytree.model.rulebase import (
    Band,
    Conjunction,
    Part,
    Points,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node, Sets
from fuzzytree.semantics.lowering import rules_from_tree


def bands(name: str, cut: float) -> tuple[Term, Term]:
    """Return the terms of a node with one cut, without flanks."""
    return Term(f"{name} low", Band(high=cut)), Term(f"{name} high", Band(low=cut))


def one_cut(
    meeting: float = 0.5,
    conjunction: Conjunction = "minimum",
    *,
    is_steep: bool = False,
) -> FuzzyTree:
    """Return a tree with one cut of x, at 0.5, and whose fitted sets meet elsewhere.

    Args:
        meeting: Where the two sets cross; at 0.5 the raw rules decide as the tree does.
        conjunction: The AND.
        is_steep: Whether the set of `a` ends soon, so that none covers 0.
    """
    low, high = bands("x", 0.5)
    ends = meeting - 1.0, meeting + 1.0
    falling = Points(ends, (1.0, 0.0))
    if is_steep:
        ends = meeting - 0.25, meeting + 0.25
        falling = Points((ends[0] - 0.1, ends[0], ends[1]), (0.0, 1.0, 0.0))
    sets = Sets("x", (Term("a", falling), Term("b", Points(ends, (0.0, 1.0)))))
    branches = (
        Branch((low.name,), ("a",), leaf=1),
        Branch((high.name,), ("b",), leaf=2),
    )
    return FuzzyTree(
        "one cut",
        ("a", "b"),
        (Variable("x", (low, high)),),
        (Node("x", (0.5,), (0, 1), branches),),
        (Leaf("a", "a"), Leaf("b", "b")),
        (sets,),
        Semantics(conjunction),
    )


def two_cuts(second: float, *, combined: bool = False) -> FuzzyTree:
    """Return a tree with a cut of x at 0.5, and above it another, or one of x + y.

    Args:
        second: The second cut; the leaf between the two is never reached if it is at
            most 0.5.
        combined: Whether the second question is about the sum.
    """
    first = bands("first", 0.5)
    again = bands("again", second)
    queries = "sum" if combined else "x"
    parts = (Part("x", 1.0), Part("y", 1.0)) if combined else ()
    variables = (
        Variable("x", first if combined else (*first, *again)),
        Variable("y"),
        *([Variable("sum", again, parts=parts)] if combined else []),
    )
    return FuzzyTree(
        "two cuts",
        ("a", "b", "c"),
        variables,
        (
            Node(
                "x",
                (0.5,),
                (0, 1),
                (Branch((first[0].name,), leaf=1), Branch((first[1].name,), node=2)),
            ),
            Node(
                queries,
                (second,),
                (0, 1),
                (Branch((again[0].name,), leaf=2), Branch((again[1].name,), leaf=3)),
            ),
        ),
        (Leaf("a"), Leaf("b"), Leaf("c")),
    )


def subject_of(
    model: FuzzyTree | RuleBase,
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
    rows: list[list[float]] | None = None,
    budget: Budget | None = None,
) -> Subject:
    """Return a model as it is audited, on [0, 1] for each input unless limited.

    Args:
        model: The model.
        limits: Other limits.
        rows: A list of values for each row.
        budget: How many steps there are.
    """
    rules = rules_from_tree(model) if isinstance(model, FuzzyTree) else model
    ends = dict.fromkeys(rules.inputs, (0.0, 1.0)) | dict(limits or {})
    domain = Domain(tuple(DomainSide(name, *of) for name, of in ends.items()))
    table = None
    if rows is not None:
        table = AuditRows("rows", np.array(rows, dtype=float).T)
    return ready(view(model, domain), AuditSettings(), budget, table)

"""Faults planted in the bounds are found: what is observed exceeds them."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.numerics import bounds, rounding
from fuzzytree.numerics.bounds import strength_bounds
from fuzzytree.numerics.oracle import strength_errors
from fuzzytree.numerics.rounding import TYPES, Type
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree, with_points

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fuzzytree.model.contracts import Dtype, FloatArray


@pytest.fixture(autouse=True)
def _no_remembered_bounds() -> Iterator[None]:
    """Keep the bounds that have a fault out of the other tests."""
    yield
    rounding.degree_bound.cache_clear()


NATIVE = {"float64": "native", "mixed": "native mixed", "float32": "native float32"}


def ruled(
    *shapes: Shape, conjunction: Conjunction = "minimum", parts: tuple[Part, ...] = ()
) -> RuleBase:
    """Return one rule that all shapes hold, of one variable each or of a sum."""
    names = [f"x{k}" for k in range(max(len(shapes), len(parts)))]
    terms = [(Term("t", shape),) for shape in shapes]
    tested = [Variable(n, t) for n, t in zip(names, terms, strict=False)]
    if parts:
        mix = Variable("mix", terms[0], parts=parts)
        tested = [*(Variable(part.input) for part in parts), mix]
    propositions = tuple(Proposition(v.name, ("t",)) for v in tested if v.terms)
    return RuleBase(
        "one", ("a",), tuple(tested), (Rule(propositions, "a"),), Semantics(conjunction)
    )


def beyond(rules: RuleBase, dtype: Dtype, values: FloatArray) -> int:
    """Count the rows whose error is, for sure, larger than its bound."""
    found = find_runtime(NATIVE[dtype]).load(rules)(values).strengths
    assert found is not None
    low, _ = strength_errors(rules, values, found)
    rounding.degree_bound.cache_clear()  # a fault may have been planted since
    return int((low > strength_bounds(rules, dtype, values)[0]).sum())


def rows(inputs: int, low: float, high: float) -> FloatArray:
    return np.random.default_rng(0).uniform(low, high, (inputs, 2000))


STEEP = Band(high=1.0, right=2.0)
FAR = Band(high=1000.0, right=1003.0)
BENT = LR(0.0, Side(1.0, (0.3, 0.3)), Side(1.0, (0.3, 0.3)))
SHORT = Band(high=0.0, right=3.0)
SUM = (Part("a", 0.7, 1.1), Part("b", -1.3, 0.9))

CASES: list[tuple[RuleBase, Dtype, FloatArray]] = [
    (ruled(STEEP), "float64", rows(1, 1.0, 2.0)),
    (ruled(STEEP), "mixed", rows(1, 1.0, 2.0)),
    (ruled(FAR), "float32", rows(1, 999.0, 1004.0)),
    (ruled(FAR, FAR, conjunction="product"), "float32", rows(2, 999.0, 1004.0)),
    (ruled(STEEP, parts=SUM), "float32", rows(2, -3.0, 3.0)),
    (ruled(BENT), "mixed", rows(1, -6.0, 6.0)),
    (ruled(SHORT, parts=(Part("a", 1.0, 1e5),)), "float32", rows(1, 1e5, 1e5 + 3)),
    (
        ruled(*[FAR] * 30, conjunction="product"),
        "float32",
        np.repeat(rows(1, 1000.0, 1000.01), 30, axis=0),
    ),
]


def test_nothing_observed_exceeds_the_bounds_as_they_are() -> None:
    assert [beyond(*case) for case in CASES] == [0] * len(CASES)


@pytest.mark.parametrize(
    "fields", [("stored",), ("cast", "degree", "curve"), ("axis", "degree")]
)
def test_roundings_that_are_forgotten_are_found(
    fields: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    none = dict.fromkeys(fields, 0.0)
    kinds = {dtype: kind._replace(**none) for dtype, kind in TYPES.items()}
    monkeypatch.setattr(rounding, "TYPES", kinds)
    monkeypatch.setattr(bounds, "TYPES", kinds)
    assert max(beyond(*case) for case in CASES) > 0


def test_a_product_that_passes_on_the_largest_error_alone_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bounds, "_summed", bounds._largest)
    assert max(beyond(*case) for case in CASES) > 0


def test_a_value_whose_rounding_is_forgotten_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bounds, "value_error", lambda *_: None)
    assert max(beyond(*case) for case in CASES) > 0


def test_a_step_that_is_forgotten_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    step = ruled(Band(high=0.1))  # float32 has 0.1 a little higher
    values = np.array([[0.1, np.nextafter(0.1, 1.0), 0.100000001]])
    assert beyond(step, "float32", values) == 0
    right = rounding._edge_bound

    def smooth(edge: float, end: float | None, kind: Type) -> rounding.DegreeBound:
        return right(edge, end, kind)._replace(steps=rounding.Steps())

    monkeypatch.setattr(rounding, "_edge_bound", smooth)
    assert beyond(step, "float32", values) > 0


@pytest.mark.heavy
@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_no_error_of_many_models_exceeds_its_bound(dtype: Dtype) -> None:
    forms = itertools.product(
        range(200, 230), ("relative", "raw"), ("minimum", "product")
    )
    for seed, kind, conjunction in forms:
        tree = random_tree(seed, leaves=2 + seed % 9, inputs=3)
        rules = rules_from_tree(
            tree,
            "raw" if kind == "raw" else "relative",
            conjunction="minimum" if conjunction == "minimum" else "product",
        )
        if seed % 3 == 0:
            rules = with_points(rules, seed)
        assert beyond(rules, dtype, probe_values(rules, 300)) == 0

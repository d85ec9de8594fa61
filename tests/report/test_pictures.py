"""The pictures of the page show what the model means, exactly."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Span
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model.curves import Singleton
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Points,
    Rule,
    RuleBase,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_axis, exact_degree
from fuzzytree.report.audit_findings import axis_values
from fuzzytree.report.audit_rows import data_of, histogram, passing
from fuzzytree.report.drawing import (
    Axis,
    Curve,
    Scale,
    axes_of,
    curve_points,
    cut,
    polyline,
    spread,
    term_curve,
    thinned,
    tick_words,
    ticks,
)
from fuzzytree.report.svg_terms import (
    terms_picture,
)
from fuzzytree.report.svg_tree import tree_picture
from fuzzytree.semantics.reference import descend
from fuzzytree.testing import random_tree
from tests.report.drawn_texts import assert_apart, texts_of
from tests.report.page_audits import rows_of, rule_base

HUGE = 1.7e308
ALWAYS = (Rule((), "k"),)


def test_a_name_is_cut_by_what_is_drawn_of_it() -> None:
    assert cut("a\u200d" * 9, 8) == r"a\u200d…"


def curve_of(name: str, shape: Shape) -> Curve:
    """Return the curve of a term with a shape."""
    return term_curve(Term(name, shape))


def axis(low: float | None = 0.0, high: float | None = 10.0) -> Axis:
    triangle = curve_of("medium", Points((2.0, 5.0, 8.0), (0.0, 1.0, 0.0)))
    return Axis("force", "N", (triangle,), (), low, high)


def _force(low: float, high: float) -> RuleBase:
    return RuleBase("r", ("k",), (Variable("force", (), "", low, high),), ALWAYS)


def test_the_axes_of_a_point_are_exact() -> None:
    mix = Variable("mix", parts=(Part("a", 0.1, 0.3), Part("b", -1.7)))
    rules = RuleBase("r", ("k",), (Variable("a"), Variable("b"), mix), ALWAYS)
    point = {"a": Fraction(0.7), "b": Fraction(1e-9)}
    found = axis_values(rules, point)
    assert found["mix"] == float(exact_axis(mix, {"a": 0.7, "b": 1e-9}))
    assert axis_values(rules, {"a": Fraction(1)}) == {"a": 1.0}


def test_a_drawn_curve_goes_through_the_exact_degrees_and_its_steps() -> None:
    band = Band(low=1.0, high=2.0, right=4.0)
    x, y = Scale(0.0, 5.0, 0.0, 500.0), Scale(0.0, 1.0, 100.0, 0.0)
    way = polyline(curve_of("on", band), x, y)
    dots = [tuple(map(float, one.split())) for one in way[1:].split("L")]
    for at, high in dots:
        near = (
            exact_degree(band, Fraction(at + step) / 100) for step in (-0.2, 0, 0.2)
        )
        assert min(abs(high - 100 * (1 - float(one))) for one in near) < 0.6
    assert (100.0, 100.0) in dots
    assert (100.0, 0.0) in dots


def test_a_curve_of_many_points_is_drawn_with_a_bounded_path() -> None:
    values = tuple(float(k) for k in range(4096))
    points = Points(values, tuple(float(k % 2) for k in range(4096)))
    way = polyline(
        curve_of("comb", points), Scale(0, 4096, 0, 300), Scale(0, 1, 100, 0)
    )
    assert len(way) < 10_000


@pytest.mark.parametrize(
    ("low", "high"),
    [(0.0, 1.0), (-HUGE, HUGE), (5.0, 5.0), (8e12, 8e12 + 1), (-1e-300, 1e-300)],
)
def test_ticks_and_pictures_are_finite_whatever_the_range(
    low: float, high: float
) -> None:
    start, end = spread([low, high])
    found = ticks(start, end)
    assert 1 <= len(found) <= 5
    assert len(set(tick_words(found))) == len(set(found))
    data = data_of(_force(low, high), AuditRows("", np.array([[low, high, low]])))
    for drawn in (
        terms_picture(axis(low, high), data, "p")[0],
        terms_picture(
            axis(low, high), data, "q", span=Span("force", low, high), value=low
        )[0],
    ):
        assert not re.search("nan|inf", drawn)


def test_names_that_do_not_fit_above_their_curves_are_numbered() -> None:
    curves = [
        curve_of(f"the term number {k}", Points((k - 1.0, k, k + 1.0), (0.0, 1.0, 0.0)))
        for k in range(30)
    ]
    many = Axis("force", "", tuple(curves), (), 0.0, 30.0)
    texts = texts_of(terms_picture(many, None, "p")[0])
    assert len([text for text in texts if text.words.isdigit()]) >= 30
    listing = " ".join(text.words for text in texts)
    for number in range(1, 31):
        assert f"{number} the term number {number - 1}" in listing
    assert_apart(texts)


def test_what_is_not_drawn_of_very_many_terms_is_counted() -> None:
    curve = curve_of("on", Band(low=1.0, high=2.0))
    many = Axis(
        "force", "", tuple(curve._replace(name=str(k)) for k in range(62)), (), 0, 9
    )
    text = " ".join(text.words for text in texts_of(terms_picture(many, None, "p")[0]))
    assert text.endswith("2 not drawn")


def test_a_spike_is_drawn() -> None:
    points = curve_points(term_curve(Term("five", Singleton(5.0))), 0.0, 30.0)
    assert (5.0, 1.0) in points
    assert {degree for value, degree in points if value != 5.0} == {0.0}


@pytest.mark.parametrize(
    "shape",
    [
        Band(low=1.0, high=2.0),
        Band(low=1.0, high=2.0, left=0.5, right=4.0),
        Points((1.0, 1.5, 3.0), (0.2, 1.0, 0.0)),
        LR(2.0, Side(0.5, (0.7, -0.1)), Side(1.0, (0.5,))),
    ],
    ids=["steps", "ramps", "points", "sets"],
)
def test_points_of_a_curve_are_exact_and_near_it_everywhere(shape: Shape) -> None:
    points = curve_points(curve_of("on", shape), 0.0, 5.0)
    values, degrees = zip(*points, strict=True)
    assert [*values] == sorted({*values})
    assert (values[0], values[-1]) == (0.0, 5.0)
    for value, degree in points:
        exact = float(exact_degree(shape, Fraction(value)))
        assert degree == pytest.approx(exact, abs=1e-15)
    for value in np.linspace(0.0, 5.0, 331).tolist():
        near = float(np.interp(value, values, degrees))
        assert near == pytest.approx(
            float(exact_degree(shape, Fraction(value))), abs=2e-3
        )


def test_the_thinned_dots_of_a_line_keep_its_corners() -> None:
    dots = [(0.0, 0.0), (1.0, 0.0), (1.0, 5.0), (2.0, 5.0), (9.0, 5.0)]
    assert thinned(dots) == [(0.0, 0.0), (1.0, 0.0), (1.0, 5.0), (9.0, 5.0)]


def test_rows_pass_a_tree_as_it_decides() -> None:
    tree = random_tree(7, leaves=9)
    values = np.random.default_rng(2).normal(size=(len(tree.inputs), 200))
    codes = np.arange(200) % len(tree.classes)
    found = passing(tree, data_of(tree, AuditRows("rows", values, codes)))
    leaves = [
        descend(tree, dict(zip(tree.inputs, r, strict=True))).rule for r in values.T
    ]
    for number, counts in enumerate(found.leaves, 1):
        mine = [
            code for code, leaf in zip(codes, leaves, strict=True) if leaf == number
        ]
        assert counts == (
            *(sum(one == k for one in mine) for k in range(len(tree.classes))),
            0,
        )
    assert sum(found.nodes[0]) == 200


def test_a_histogram_counts_the_rows_inside() -> None:
    rules = rule_base()
    data = data_of(rules, rows_of(rules))
    bins = histogram(data, "pressure", 0.0, 10.0, 7)
    values = data.axes["pressure"]
    inside = values[(values >= 0.0) & (values <= 10.0)]
    expected = np.histogram(inside, bins=7, range=(0.0, 10.0))[0]
    assert [sum(counts) for counts in bins] == expected.tolist()
    assert len(bins[0]) == 4


def test_a_combination_reaches_what_its_inputs_allow() -> None:
    mix = Variable("mix", parts=(Part("a", 2.0, 1.0), Part("b", -1.0)))
    rules = RuleBase("r", ("k",), (Variable("a"), Variable("b"), mix), ALWAYS)
    domain = Domain((DomainSide("a", 0.0, 2.0), DomainSide("b", 0.0, 3.0)))
    found = axes_of(rules, domain)["mix"]
    assert (found.low, found.high) == (-5.0, 2.0)
    assert axes_of(rules, Domain(()))["mix"].low is None


def test_a_tree_without_nodes_or_with_many_classes_is_drawn() -> None:
    for tree in (random_tree(0, leaves=1), random_tree(4, leaves=12)):
        drawn = tree_picture(tree, None)
        assert drawn.count('class="box') == len(tree.nodes) + len(tree.leaves)
        assert drawn.count('class="branch"') == len(tree.nodes) + len(tree.leaves) - 1

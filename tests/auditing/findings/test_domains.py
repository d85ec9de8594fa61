"""The domain of a model: ranges, curves, spreads, rows, and what is none of these."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.auditing.decide.domain import DomainSide
from fuzzytree.auditing.findings.domains import domain_of, limit_domain
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model import (
    LR,
    Arc,
    Band,
    Bell,
    Binary,
    Concave,
    Conclusion,
    Cosine,
    Curve,
    Defuzzifier,
    Document,
    Formula,
    FuzzySystem,
    Gaussian,
    Name,
    Part,
    PiCurve,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Shape,
    Sigmoid,
    SigmoidDifference,
    Singleton,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    TwoGaussians,
    Variable,
)
from fuzzytree.model import Side as SideOfSet
from tests.cli.conftest import grip

SET = LR(5.0, SideOfSet(1.0, (0.5,), 4.0), SideOfSet(2.0, (0.5,), 4.0))
POWER = SystemOutput(
    "power",
    (Term("on", Singleton(1.0)),),
    0.0,
    1.0,
    Defuzzifier("weighted average"),
)
ROWS = AuditRows("rows", np.array([[1.0, 3.0, np.nan]]))


def asking(
    *shapes: Shape, low: float | None = None, high: float | None = None
) -> RuleBase:
    """Return a rule base of one input with these curves."""
    terms = tuple(Term(f"t{k}", shape) for k, shape in enumerate(shapes))
    rule = Rule(tuple(Proposition("x", (term.name,)) for term in terms[:1]), "a")
    return RuleBase("asking", ("a",), (Variable("x", terms, "", low, high),), (rule,))


def side(model: Document, **options: object) -> DomainSide:
    """Return the only side of a model's domain."""
    (found,) = domain_of(model, **options).sides  # type: ignore[arg-type]  # by name
    return found


def test_the_declared_range_is_the_domain() -> None:
    assert side(asking(SET, low=1.0, high=2.0)) == DomainSide("x", 1.0, 2.0, "model")


@pytest.mark.parametrize(
    ("shapes", "low", "high"),
    [
        ([SET], 1.0, 13.0),
        ([Points((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))], 0.0, 2.0),
        ([Points((0.0, 1.0), (1.0, 0.0))], -1.0, 2.0),
        ([Band(high=3.0), Band(low=3.0)], 0.0, 6.0),
        ([Band(high=0.5)], -0.5, 1.5),
        ([Band(low=1.0, high=2.0, left=0.0)], 0.0, 2.0),
    ],
    ids=["set", "closed points", "open points", "cut", "small cut", "band"],
)
def test_without_a_range_it_is_the_span_of_the_curves(
    shapes: list[Shape], low: float, high: float
) -> None:
    assert side(asking(*shapes)) == DomainSide("x", low, high, "curves")


def test_half_a_range_is_completed_by_the_curves() -> None:
    assert side(asking(SET, low=-7.0)) == DomainSide("x", -7.0, 13.0, "curves")


def test_rows_give_their_smallest_and_largest_finite_value() -> None:
    assert side(asking(SET), within="data", rows=ROWS) == DomainSide(
        "x", 1.0, 3.0, "data"
    )


def test_spreads_are_counted_from_the_fitted_sets() -> None:
    assert side(asking(SET), spreads=2.0) == DomainSide("x", 3.0, 9.0, "spreads")


def test_spreads_are_counted_from_the_rows_where_there_are_no_sets() -> None:
    assert side(asking(Band(high=1.0)), spreads=2.0, rows=ROWS) == DomainSide(
        "x", 0.0, 4.0, "spreads"
    )


def test_a_system_is_audited_on_its_ranges_and_curves() -> None:
    inputs = (
        Variable("dirt", (Term("much", Gaussian(5.0, 1.0)),)),
        Variable("load", (), low=0.0, high=3.0),
    )
    rule = SystemRule(Proposition("dirt", ("much",)), (Conclusion("power", "on"),))
    system = FuzzySystem("wash", inputs, (POWER,), (RuleBlock((rule,)),))
    assert domain_of(system).sides == (
        DomainSide("dirt", 2.0, 8.0, "curves"),
        DomainSide("load", 0.0, 3.0, "model"),
    )


SUM = RuleBase(
    "sum",
    ("a",),
    (
        Variable("x"),
        Variable("y", (Term("t", Band(high=1.0)),), parts=(Part("x", 1.0),)),
    ),
    (Rule((Proposition("y", ("t",)),), "a"),),
)
EMPTY = AuditRows("rows", np.array([[np.nan]]))


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (
            SUM,
            {},
            "input 'x' has neither a range nor a curve to take its limits from; "
            "give its limits (--limits 'x=LOW:HIGH'), or rows (--data TABLE)",
        ),
        (
            SUM,
            {"spreads": 2.0},
            "input 'x' has no fitted sets to count spreads from; "
            "give rows (--data TABLE), or its limits (--limits 'x=LOW:HIGH')",
        ),
        (SUM, {"spreads": 0.0}, "spreads must be above 0 and finite, not 0.0"),
        (SUM, {"within": "data"}, "limits from data need rows (--data TABLE)"),
        (
            SUM,
            {"within": "data", "rows": EMPTY},
            "the rows have no value of input 'x'; "
            "give its limits (--limits 'x=LOW:HIGH')",
        ),
        (
            asking(Band(low=-1e308, high=1e308), Band(low=1e308)),
            {},
            "the curves of input 'x' span more than doubles hold; "
            "give its limits (--limits 'x=LOW:HIGH')",
        ),
    ],
    ids=["none", "no spreads", "0 spreads", "no rows", "empty rows", "too wide"],
)
def test_an_input_without_limits_is_one_sentence(
    model: Document, options: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        side(model, **options)
    assert str(caught.value) == message


def test_all_inputs_without_limits_are_named_at_once() -> None:
    names = [f"x{k}" for k in range(12)]
    parts = tuple(Part(name, 1.0) for name in names)
    total = Variable("y", (Term("t", Band(high=1.0)),), parts=parts)
    rule = Rule((Proposition("y", ("t",)),), "a")
    model = RuleBase("sum", ("a",), (*map(Variable, names), total), (rule,))
    with pytest.raises(ValueError, match=r".") as caught:
        domain_of(model)
    lines = str(caught.value).splitlines()
    assert [line.split("'")[1] for line in lines[:10]] == names[:10]
    assert lines[10:] == ["and 2 more such inputs"]


@pytest.mark.parametrize("options", [{}, {"spreads": 2.0}], ids=["model", "spreads"])
def test_an_input_on_which_nothing_depends_may_be_any_number(
    options: dict[str, object],
) -> None:
    assert side(asking(), **options) == DomainSide("x", 0.0, 1.0, "unused")
    assert side(asking(Band()), **options) == DomainSide("x", 0.0, 1.0, "unused")
    far = side(asking(), row={"x": -7.0}, **options)
    assert far == DomainSide("x", -7.0, 1.0, "unused")
    assert side(asking(), rows=ROWS, **options).origin != "unused"


@pytest.mark.parametrize(
    ("curve", "low", "high"),
    [
        (Sigmoid(10.0, 5.0), 7.0, 13.0),
        (SigmoidDifference(Sigmoid(0.0, 5.0), Sigmoid(9.0, -5.0)), -1.0, 10.0),
        (Bell(10.0, 2.0, 1.0), 4.0, 16.0),
        (TwoGaussians(0.0, 1.0, 5.0, 2.0), -3.0, 11.0),
        (PiCurve(0.0, 1.0, 2.0, 4.0), 0.0, 4.0),
        (Cosine(10.0, 4.0), 8.0, 12.0),
        (Spike(10.0, 4.0), 8.0, 12.0),
        (SemiEllipse(1.0, 2.0), 1.0, 2.0),
        (SCurve(1.0, 2.0), 0.0, 3.0),
        (Arc(2.0, 1.0), 0.0, 3.0),
        (Concave(1.0, 2.0), 0.0, 3.0),
        (Binary(2.0), 0.0, 4.0),
        (Singleton(0.0), -1.0, 1.0),
    ],
    ids=lambda one: type(one).__name__,
)
def test_every_curve_of_a_system_has_a_span(
    curve: Curve, low: float, high: float
) -> None:
    inputs = (Variable("dirt", (Term("much", curve),)),)
    rule = SystemRule(Proposition("dirt", ("much",)), (Conclusion("power", "on"),))
    system = FuzzySystem("wash", inputs, (POWER,), (RuleBlock((rule,)),))
    found = side(system)
    assert (found.low, found.high) == pytest.approx((low, high))


def test_an_input_that_a_formula_may_name_needs_limits() -> None:
    label = Term("much", Formula(Name("load")))
    inputs = (Variable("dirt", (label,), low=0.0, high=1.0), Variable("load", ()))
    rule = SystemRule(Proposition("dirt", ("much",)), (Conclusion("power", "on"),))
    system = FuzzySystem("wash", inputs, (POWER,), (RuleBlock((rule,)),))
    with pytest.raises(ValueError, match="input 'load' has neither a range nor"):
        domain_of(system)


def test_an_input_whose_limits_are_given_needs_no_others() -> None:
    box = domain_of(SUM, limited=["x"])
    assert limit_domain(box, {"x": (0.0, 1.0)}, SUM).sides == (
        DomainSide("x", 0.0, 1.0),
    )


def test_rows_stand_in_where_nothing_is_declared() -> None:
    assert side(SUM, rows=ROWS) == DomainSide("x", 1.0, 3.0, "data")


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        (
            {"force": (5.0, 3.0)},
            "the limits of 'force' are swapped: 5.0 to 3.0; "
            "the smaller one stands first",
        ),
        (
            {"force": (0.0, float("inf"))},
            "the limits of 'force' must be finite, not 0.0 to inf",
        ),
        (
            {"frce": (0.0, 1.0)},
            "limits for 'frce', which is no variable; "
            "there is force, slip (did you mean 'force'?)",
        ),
    ],
    ids=["swapped", "infinite", "unknown"],
)
def test_wrong_limits_are_one_sentence(
    limits: dict[str, tuple[float, float]], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        limit_domain(domain_of(grip()), limits, grip())
    assert str(caught.value) == message

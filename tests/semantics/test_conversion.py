"""Rule bases as systems with numeric outputs, and the way back."""

from __future__ import annotations

import itertools
import json
import math
import random
from collections.abc import Iterator
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.checking import export
from fuzzytree.checking.converting import read_content
from fuzzytree.checking.files import first_difference
from fuzzytree.errors import LossError
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    And,
    Band,
    Binary,
    Condition,
    FuzzySystem,
    Kind,
    Not,
    Or,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Singleton,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.numerics import BELOW_ONE
from fuzzytree.semantics import (
    Always,
    Scores,
    as_rules,
    as_system,
    cast_losses,
    cast_remarks,
    facts_of,
    flattened,
)
from fuzzytree.semantics.conversion.points import band_of, shape_of, straight_points
from fuzzytree.semantics.conversion.scores import winner
from fuzzytree.semantics.inference import curve_degree, infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.reference import Status, degree, evaluate
from fuzzytree.testing import random_tree, with_points

SCORES: tuple[Scores, ...] = ("rule", "class", "winner")
ALWAYS: tuple[Always, ...] = ("nothing", "any", "term")

LOW = Term("low", Points((0.0, 1.0), (1.0, 0.0)))
HIGH = Term("high", Points((0.0, 1.0), (0.0, 1.0)))
MIDDLE = Term("middle", Points((0.0, 0.5, 1.0), (0.0, 1.0, 0.0)))


def grip(*rules: Rule, **semantics: object) -> RuleBase:
    """Rules over two inputs and a combination of them."""
    variables = (
        Variable("force", (LOW, MIDDLE, HIGH), "N", 0.0, 1.0),
        Variable("speed", (LOW, HIGH)),
        Variable("sum", (LOW, HIGH), parts=(Part("force", 0.5), Part("speed", 0.5, 1))),
    )
    return RuleBase(
        "grip",
        ("soft", "firm", "none"),
        variables,
        rules or ODD_RULES,
        Semantics(**semantics),  # type: ignore[arg-type]
        columns=("speed", "force", "colour"),
    )


ODD_RULES = (
    Rule((Proposition("force", ("low", "middle"), hedges=("not",)),), "firm", 12),
    Rule(
        (Proposition("force", ("low", "high")), Proposition("speed", ("low",))), "soft"
    ),
    Rule(
        (
            Proposition("speed", ("low",), hedges=("not",)),
            Proposition("sum", ("low", "high"), hedges=("not",)),
            Proposition("speed", ("high",), hedges=("not",)),
        ),
        "firm",
        0,
    ),
    Rule((Proposition("speed", ("high",)), Proposition("force", ("middle",))), "soft"),
)


def many() -> Iterator[RuleBase]:
    """Rule bases of all kinds."""
    kinds: tuple[Kind, ...] = ("relative", "raw")
    for seed, kind in itertools.product(range(4), kinds):
        tree = random_tree(seed, semantics=Semantics(("minimum", "product")[seed % 2]))
        rules = rules_from_tree(tree, kind)
        yield rules
        yield with_points(rules, seed)
    yield rules_from_tree(random_tree(0, leaves=1))
    yield grip()
    yield grip(conjunction="product", uncovered="soft")
    yield grip(*ODD_RULES, Rule((), "none", 3), conjunction="product")
    yield grip(Rule((), "none"))


MANY = tuple(many())


def rows(rules: RuleBase) -> list[dict[str, float]]:
    return [dict(row) for row in probes(rules, limit=40)]


@pytest.mark.parametrize("rules", MANY, ids=lambda rules: rules.name)
def test_the_number_of_the_winner_is_that_of_the_rule_base(rules: RuleBase) -> None:
    system = as_system(rules, "winner")
    for row in rows(rules):
        answer = evaluate(rules, row)
        if answer.status == Status.MISSING:
            continue
        (number,) = infer(system, row).outputs
        assert winner(rules, [number], "winner") == answer.label
        if answer.label is not None:
            expected = rules.classes.index(answer.label) + 1
            assert abs(number - expected) < 1e-12


@pytest.mark.one_in(2)
@pytest.mark.parametrize("rules", MANY, ids=lambda rules: rules.name)
def test_the_score_of_a_rule_is_made_of_its_strength(rules: RuleBase) -> None:
    system = as_system(rules, "rule")
    for row in rows(rules):
        answer = evaluate(rules, row)
        scores = infer(system, row).outputs
        if answer.status == Status.MISSING:
            assert all(map(math.isnan, scores))
            continue
        assert scores == tuple(w / (1.0 + w) for w in answer.strengths)
        near = sorted(answer.strengths)[-2:]
        if near[0] == near[-1] or near[0] < near[-1] * (1 - 2.0**-50):
            assert winner(rules, scores) == answer.label


@pytest.mark.one_in(2)
@pytest.mark.parametrize("rules", MANY, ids=lambda rules: rules.name)
def test_the_score_of_a_class_is_that_of_its_strongest_rule(rules: RuleBase) -> None:
    system = as_system(rules, "class")
    for row in rows(rules):
        answer = evaluate(rules, row)
        if answer.status == Status.MISSING:
            continue
        found = infer(system, row).outputs
        for name, score in zip(rules.classes, found, strict=True):
            own = [
                w
                for w, rule in zip(answer.strengths, rules.rules, strict=True)
                if rule.then == name
            ]
            w = max(own, default=0.0)
            assert score == w / (1.0 + w)
        near = sorted(set(answer.strengths))[-2:]
        is_clear = len(near) < 2 or near[0] < near[1] * (1 - 2.0**-50)
        if is_clear and (answer.status != Status.TIE or rules.kind == "relative"):
            assert winner(rules, found, "class") == answer.label


@pytest.mark.one_in(4)
@pytest.mark.parametrize("always", ALWAYS)
@pytest.mark.parametrize("scores", SCORES)
@pytest.mark.parametrize("rules", MANY, ids=lambda rules: rules.name)
def test_a_system_and_its_facts_make_the_rule_base_again(
    rules: RuleBase, scores: Scores, always: Always
) -> None:
    if always != "nothing" and not rules.variables:
        with pytest.raises(LossError, match="must reference an input"):
            as_system(rules, scores, always=always)
        return
    system = as_system(rules, scores, always=always)
    found = as_rules(system, facts_of(rules, scores, always=always))
    loses = scores == "class" and any(
        not rule.when and [r.then for r in rules.rules].count(rule.then) > 1
        for rule in rules.rules
    )
    assert found == (None if loses else rules)


@pytest.mark.parametrize("scores", SCORES)
@pytest.mark.parametrize("rules", MANY[:6], ids=lambda rules: rules.name)
def test_names_that_a_target_changed_come_back_by_their_places(
    rules: RuleBase, scores: Scores
) -> None:
    system = as_system(rules, scores)
    flat, losses = flattened(system)
    assert bool(losses) == any(v.parts for v in rules.variables)
    names = {one.name: f"v{k}" for k, one in enumerate(flat.all_variables)}

    def renamed(condition: Condition | None) -> Condition | None:
        match condition:
            case Proposition(variable=variable, term=label):
                return replace(
                    condition, variable=names[variable], terms=(f"t {label}",)
                )
            case Not(part=part):
                return replace(condition, part=renamed(part))
            case And(parts=parts) | Or(parts=parts):
                return replace(condition, parts=tuple(map(renamed, parts)))
            case None:
                return None

    def labelled(one: object) -> object:
        labels = tuple(
            replace(label, name=f"t {label.name}")
            for label in one.terms  # type: ignore[attr-defined]
        )
        name = names[one.name]  # type: ignore[attr-defined]
        return replace(one, name=name, terms=labels, unit="", low=None, high=None)  # type: ignore[type-var]

    (block,) = flat.blocks
    block = replace(
        block,
        rules=tuple(
            replace(
                rule,
                when=renamed(rule.when),
                then=tuple(
                    replace(c, output=names[c.output], term=f"t {c.term}")
                    for c in rule.then
                ),
            )
            for rule in block.rules
        ),
    )
    changed = FuzzySystem(
        "other",
        tuple(map(labelled, flat.variables)),  # type: ignore[arg-type]
        tuple(map(labelled, flat.outputs)),  # type: ignore[arg-type]
        (block,),
    )
    assert as_rules(changed, facts_of(rules, scores)) == rules


def test_a_system_of_the_form_winner_is_recognised_without_facts() -> None:
    for rules in MANY:
        found = as_rules(as_system(rules, "winner"))
        if any(c.negated and len(c.terms) > 1 for r in rules.rules for c in r.when):
            continue
        assert found is not None
        bare = tuple(replace(rule, support=None, counts=()) for rule in rules.rules)
        assert found.rules == bare
        assert found.variables == rules.variables
        assert found.semantics.uncovered == rules.semantics.uncovered


def test_a_system_of_scores_is_no_rule_base_without_facts() -> None:
    assert as_rules(as_system(grip(), "rule")) is None


def changes(system: FuzzySystem) -> Iterator[FuzzySystem]:
    """The same system with one thing changed that can change an answer."""
    (block,) = system.blocks
    first, *others = block.rules
    yield replace(system, blocks=(replace(block, rules=tuple(others)),))
    yield replace(system, blocks=(replace(block, rules=(*others, first)),))
    light = replace(block.rules[-1], weight=0.5)
    yield replace(system, blocks=(replace(block, rules=(*block.rules[:-1], light)),))
    yield replace(system, blocks=(replace(block, conjunction="bounded difference"),))
    yield replace(system, blocks=(replace(block, disjunction="sum"),))
    yield replace(system, blocks=(block, block))
    last = block.rules[-1]
    negated = replace(last, when=Not(last.when or Proposition("force", ("low",))))
    yield replace(system, blocks=(replace(block, rules=(*block.rules[:-1], negated)),))
    one, *rest = system.variables
    yield replace(
        system, variables=(replace(one, clips=True, low=0.0, high=0.5), *rest)
    )
    half = replace(one.terms[0], height=0.5)
    yield replace(system, variables=(replace(one, terms=(half, *one.terms[1:])), *rest))
    output, *more = system.outputs
    half = replace(output.terms[-1], function=Singleton(0.5))
    labels = (*output.terms[:-1], half)
    yield replace(system, outputs=(replace(output, terms=labels), *more))
    how = replace(output.defuzzifier, method="weighted sum")
    yield replace(system, outputs=(replace(output, defuzzifier=how), *more))


@pytest.mark.parametrize("scores", SCORES)
def test_facts_never_make_rules_of_a_system_that_answers_otherwise(
    scores: Scores,
) -> None:
    rules = grip()
    facts = facts_of(rules, scores)
    found = list(changes(as_system(rules, scores)))
    assert len(found) == 11
    for system in found:
        assert as_rules(system, facts) is None
        if scores == "winner":
            again = as_rules(system)
            assert again is None or again.rules != rules.rules


@pytest.mark.heavy
def test_changed_facts_give_no_rules_or_rules_of_that_very_system() -> None:
    rules = grip()
    chance = random.Random(1)
    for scores in SCORES:
        system = as_system(rules, scores)
        text = facts_of(rules, scores)
        for _ in range(400):
            place = chance.randrange(len(text))
            broken = (
                text[:place] + chance.choice('0129{}[]",-e\x00é') + text[place + 1 :]
            )
            found = as_rules(system, broken)
            if found is not None:
                again = as_system(found, scores)
                assert [r.weight for r in again.rules] == [
                    r.weight for r in system.rules
                ]
                assert as_rules(again, facts_of(found, scores)) == found


@pytest.mark.parametrize(
    "facts",
    ["", "null", "[]", "{}", "[" * 100_000, "\ud800", '{"fuzzytree":1}', "9" * 9],
)
def test_hostile_facts_give_no_rules(facts: str) -> None:
    assert as_rules(as_system(grip()), facts) is None


def test_facts_that_stand_for_much_more_than_the_system_are_put_away_at_once() -> None:
    rules = grip()
    facts = json.loads(facts_of(rules, "winner"))
    facts["propositions"] = [[0, [0] * 100_000, False]]
    facts["rules"] = [[[0] * 1000, 0, None]] * 1000
    assert as_rules(as_system(rules, "winner"), json.dumps(facts)) is None


def test_facts_are_one_line_that_stands_in_any_comment() -> None:
    name = "a*b/c<d>&#%'`$--]]>*)\"é--- -\xa0"
    rules = replace(grip(), name=name)
    facts = facts_of(rules)
    assert facts.isascii()
    assert facts.isprintable()
    assert "--" not in facts
    assert not set(facts) & set("*/<>&#%'`$")
    found = as_rules(as_system(rules), facts)
    assert found is not None
    assert found.name == name


def test_equal_classes_are_a_loss_where_rules_of_classes_are_mixed() -> None:
    (loss,) = cast_losses(grip(), "class")
    assert loss.where == "equally strong rules"
    assert cast_losses(grip(*ODD_RULES[:1]), "class") == ()
    assert cast_losses(grip(), "rule") == ()
    assert cast_losses(rules_from_tree(random_tree(3)), "class") == ()


def test_a_class_for_missing_values_is_a_loss_and_none_is_a_remark() -> None:
    (loss,) = cast_losses(grip(missing="firm"), "rule")
    assert loss.what == "NaN stands in the place of 'firm'"
    assert len(cast_remarks(grip(missing="firm"))) == 2
    assert len(cast_remarks(grip())) == 3


def test_outputs_are_unlike_inputs_and_each_other() -> None:
    rules = RuleBase(
        "names",
        ("a", "a 2"),
        (Variable("score a", (LOW,)), Variable("class", (LOW,))),
        (Rule((Proposition("class", ("low",)),), "a"), Rule((), "a 2")),
    )
    names = [one.name for one in as_system(rules, "class").outputs]
    assert names == ["score a 2", "score a 2 2"]
    assert as_system(rules, "winner").outputs[0].name == "class 2"


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_scores_keep_the_order_of_strengths_that_differ(w: float, v: float) -> None:
    low, high = min(w, v), max(w, v)
    if Fraction(high) > Fraction(low) * (1 + Fraction(1, 2**50)):
        assert low / (1.0 + low) < high / (1.0 + high)


def test_scores_of_close_strengths_can_change_places() -> None:
    chance = random.Random(0)
    swapped = 0
    for _ in range(20_000):
        low = chance.random() * 1e-3
        high = math.nextafter(low, 1.0)
        swapped += low / (1.0 + low) > high / (1.0 + high)
    assert swapped > 0


def test_the_winner_of_relative_rules_alone_has_the_score_of_one_half() -> None:
    for k in range(1, 5000):
        w = 1.0 - k * 2.0**-53
        assert w / (1.0 + w) <= 0.5 - 2.0**-54


CURVES = [
    Trapezoid(0.0, 1.0, 2.0, 4.0),
    Trapezoid(0.0, 1.0, 1.0, 4.0),
    Trapezoid(1.0, 1.0, 2.0, 2.0),
    Trapezoid(1.0, 1.0, 1.0, 1.0),
    Trapezoid(None, 1.0, 2.0, 4.0),
    Trapezoid(0.1, 0.7, 2.0, None),
    Trapezoid(0.1, 0.1, 2.0, None),
    Trapezoid(None, 1.0, 2.0, None),
    Trapezoid(None, 1.0, 2.0, 2.0),
    Trapezoid(-1e300, 3e-320, 0.3, 0.7),
    Singleton(0.0),
    Singleton(-0.3),
    Binary(0.5),
    Binary(0.5, False),
]


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_a_curve_that_is_a_shape_has_equal_bits(curve: Trapezoid | Singleton) -> None:
    shape = shape_of(curve)
    assert shape is not None
    marks = [
        value
        for value in (getattr(curve, name) for name in curve.__struct_fields__)
        if isinstance(value, float)
    ]
    chance = random.Random(0)
    near = [math.nextafter(m, way) for m in marks for way in (-math.inf, math.inf)]
    spread = [chance.uniform(-1.0, 5.0) for _ in range(300)]
    for x in (*marks, *near, *spread, 1e308, -1e308):
        assert degree(shape, x) == curve_degree(curve, x)


def test_a_band_stays_a_band() -> None:
    band = Band(0.0, 1.0)
    assert shape_of(band) is band


BANDS = [
    Band(low, high, left, right)
    for low, left in ((None, None), (1.0, None), (1.0, 0.3))
    for high, right in ((None, None), (2.1, None), (2.1, 9.0))
]
NO_BANDS = [
    Points((1.0, 1.0), (0.0, 1.0)),
    Points((1.0, 2.1, 2.1, 3.0), (0.0, 1.0, BELOW_ONE, 0.0)),
    Points((0.3, 1.0, 1.0), (0.0, BELOW_ONE, 1.0)),
    Points((2.0,), (1.0,)),
]


@pytest.mark.parametrize("suffix", [".fcl", ".fll", ".fis", ".fml"])
def test_bands_come_back_from_a_file_as_bands_and_points_as_points(suffix: str) -> None:
    shapes: list[Band | Points] = [*BANDS, *NO_BANDS]
    terms = tuple(Term(f"t{k}", shape) for k, shape in enumerate(shapes))
    rules = tuple(Rule((Proposition("x", (t.name,)),), "a") for t in terms)
    base = RuleBase("m", ("a",), (Variable("x", terms),), rules)
    content = export(base, suffix, allow_loss=True).content
    again = read_content(content, find_format(suffix), name="m").model
    assert isinstance(again, RuleBase)
    assert first_difference(base, again) is None


def test_points_that_somebody_moved_stay_points() -> None:
    terms = (Term("low", Band(high=2.0, right=4.0)),)
    rule = Rule((Proposition("x", ("low",)),), "a")
    base = RuleBase("m", ("a",), (Variable("x", terms),), (rule,))
    content = export(base, "fcl").content
    moved = content.replace(b"(2.0, 0.9999999999999999)", b"(2.0, 0.99)")
    assert moved != content
    again = read_content(moved, find_format("fcl"), name="m").model
    assert again.variables[0].terms[0].function == Points(
        (2.0, 2.0, 4.0), (1.0, 0.99, 0.0)
    )


@pytest.mark.parametrize("band", BANDS, ids=str)
def test_the_points_of_a_band_are_those_of_no_other(band: Band) -> None:
    points, _ = straight_points(band)
    assert band_of(points) == band
    for place in range(len(points.values)):
        degrees = [*points.degrees]
        degrees[place] /= 2.0
        other = Points(points.values, tuple(degrees))
        assert other == points or band_of(other) is None


def twice(conjunction: str) -> RuleBase:
    """Return rules that test an input twice, several terms of it, and none of them."""
    low, high = (
        Term("low", Band(high=2.0, right=4.0)),
        Term("high", Band(2.0, None, 1.0)),
    )
    near = Term("near", Points((0.5, 2.5, 3.0), (0.0, 1.0, 0.5)))
    terms = (low, high, near)
    inputs = Variable("q r", terms), Variable("s", terms)
    either = ("low", "high") if conjunction == "minimum" else ("low",)
    rules = (
        Rule((Proposition("s", ("low",)), Proposition("q r", ("low", "near"))), "a"),
        Rule((Proposition("q r", ("high",)), Proposition("q r", ("near",))), "b"),
        Rule((Proposition("q r", either, ("not",)),), "a"),
        Rule((Proposition("s", ("near",), ("not",)),), "b"),
        Rule((), "b"),
    )
    semantics = Semantics(conjunction)  # type: ignore[arg-type]  # both are given
    return RuleBase("m", ("a", "b"), inputs, rules, semantics)


@pytest.mark.parametrize("suffix", [".fcl", ".fll", ".fis", ".fml"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_rules_that_test_an_input_twice_come_back_from_each_format(
    conjunction: str, suffix: str
) -> None:
    content = export(twice(conjunction), suffix, allow_loss=True).content
    again = read_content(content, find_format(suffix), name="m").model
    assert again == twice(conjunction)


def test_a_joint_term_with_other_points_stands_for_no_propositions() -> None:
    content = export(twice("minimum"), "fis", allow_loss=True).content
    head, name, points = content.partition(b"'low_or_near'")
    moved = head + name + points.replace(b" 4.0 ", b" 4.1 ", 1)
    assert moved != content
    again = read_content(moved, find_format("fis"), name="m").model
    assert isinstance(again, FuzzySystem)


def test_joint_terms_of_very_many_points_are_not_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    content = export(twice("minimum"), "fis", allow_loss=True).content
    monkeypatch.setattr("fuzzytree.semantics.conversion.joint_terms.MOST_JOINT", 8)
    again = read_content(content, find_format("fis"), name="m").model
    assert isinstance(again, FuzzySystem)


@pytest.mark.parametrize("suffix", [".fcl", ".fll", ".fis", ".fml"])
def test_the_flanks_of_a_system_come_back_from_a_file(suffix: str) -> None:
    shapes = [band for band in BANDS if band.flanks]
    terms = tuple(Term(f"t{k}", shape) for k, shape in enumerate(shapes))
    rules = tuple(Rule((Proposition("x", (t.name,)),), "a") for t in terms)
    base = RuleBase("m", ("a",), (Variable("x", terms),), rules)
    system = as_system(base, always="term")
    content = export(system, suffix, allow_loss=True).content
    again = read_content(content, find_format(suffix), name="m").model
    assert isinstance(again, FuzzySystem)
    read = [term.function for term in again.variables[0].terms]
    assert read[: len(shapes)] == shapes

"""What a model does not need is left out, and a change is never left unsaid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.checking.comparing import unequal
from fuzzytree.model.contracts import Document, Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.tree import FuzzyTree, Use
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import system_probes
from fuzzytree.semantics.satisfiability import always_holds, never_firing
from fuzzytree.semantics.simplification import (
    USES,
    Pruned,
    Removed,
    cannot_overflow,
    pruned,
)
from fuzzytree.semantics.simplification_proof import proof_faults, unguarded
from fuzzytree.testing import random_system, random_tree

SOFT = Term("soft", Band(high=1.0, right=2.0))
FIRM = Term("firm", Band(low=1.0, high=4.0, left=0.0))
HARD = Term("hard", Band(low=4.0))
ANY = Term("any", Band())
FORCE = Variable("force", (SOFT, FIRM, HARD))


def base(
    *when: tuple[Proposition, ...],
    variables: tuple[Variable, ...] = (FORCE,),
    semantics: Semantics | None = None,
) -> RuleBase:
    rules = tuple(
        Rule(propositions, "ab"[k % 2]) for k, propositions in enumerate(when)
    )
    return RuleBase("grip", ("a", "b"), variables, rules, semantics or Semantics())


def force(*terms: str, negated: bool = False) -> Proposition:
    return Proposition("force", terms, ("not",) if negated else ())


ALL = ((force("soft", "hard"),), (force("firm"),))
"""Rules that name every term."""

PATH: tuple[Use, ...] = ("tree",)


def where(found: Pruned) -> list[str]:
    return [one.where for one in found.removed]


# --- rule bases


def test_a_term_that_no_proposition_names_goes() -> None:
    found = pruned(base((force("soft"),), (force("hard"),)))
    assert found.removed == (Removed("term 'firm' of 'force'", "nothing names it"),)
    assert [term.name for term in found.model.variables[0].terms] == ["soft", "hard"]
    assert found.is_same


def test_of_two_terms_with_one_curve_the_first_stays() -> None:
    twin = replace(FIRM, name="tight")
    variable = Variable("force", (SOFT, FIRM, twin))
    rules = base(
        (force("tight"),), (force("soft", "firm", "tight"),), variables=(variable,)
    )
    found = pruned(rules)
    why = "its curve is that of 'firm', which stands in its place"
    assert found.removed == (Removed("term 'tight' of 'force'", why),)
    assert isinstance(found.model, RuleBase)
    assert [rule.when for rule in found.model.rules] == [
        (force("firm"),),
        (force("soft", "firm"),),
    ]


def test_curves_that_differ_in_the_sign_of_a_zero_stay_apart() -> None:
    one, two = Term("one", Band(high=0.0)), Term("two", Band(high=-0.0))
    propositions = Proposition("force", ("one",)), Proposition("force", ("two",))
    rules = base(
        (propositions[0],),
        (propositions[1],),
        variables=(Variable("force", (one, two)),),
    )
    assert pruned(rules).removed == ()


def test_a_proposition_that_always_holds_goes_and_its_variable_still_guards() -> None:
    slip = Variable("slip", (ANY,))
    rules = base(
        (Proposition("slip", ("any",)), force("soft")), (force("hard"),),
        variables=(FORCE, slip),
    )  # fmt: skip
    found = pruned(rules)
    assert where(found) == [
        "proposition 'slip is any' of rule 1",
        "term 'firm' of 'force'",
        "term 'any' of 'slip'",
    ]
    assert found.model.inputs == ("force", "slip")


def test_terms_that_together_cover_everything_always_hold() -> None:
    low, high = Term("low", Band(high=1.0)), Term("high", Band(low=0.5))
    rules = base(
        (Proposition("force", ("low", "high")),),
        variables=(Variable("force", (low, high)),),
    )
    assert where(pruned(rules))[0] == "proposition 'force is low or high' of rule 1"


def test_a_proposition_that_stands_twice_goes_under_min_and_counts_under_product() -> (
    None
):
    twice = ((force("soft"), force("soft")), (force("firm", "hard"),))
    assert where(pruned(base(*twice))) == ["proposition 'force is soft' of rule 1"]
    product = base(*twice, semantics=Semantics("product"))
    assert pruned(product).removed == ()


def test_a_combination_that_cannot_overflow_goes_though_its_inputs_stay() -> None:
    parts = (Part("force", 0.25), Part("slip", -0.5, 3.0))
    variables = (FORCE, Variable("slip"), Variable("mix", parts=parts))
    rules = base((force("soft"),), (force("firm"),), variables=variables)
    found = pruned(rules)
    assert "combination 'mix'" in where(found)
    assert found.is_same
    assert found.model.inputs == ("force", "slip")
    assert not list(proof_faults(rules, found.model, rules=found.rules))
    assert unguarded(rules, found.model) == ()


def test_a_combination_that_may_overflow_goes_on_request_alone() -> None:
    parts = (Part("force", 0.75), Part("slip", -0.5))
    variables = (FORCE, Variable("slip"), Variable("mix", parts=parts))
    rules = base(*ALL, variables=variables)
    assert "combination 'mix'" not in where(pruned(rules))
    found = pruned(rules, inputs=True)
    assert where(found)[-2:] == ["input 'slip'", "combination 'mix'"]
    assert not found.is_same
    assert unguarded(rules, found.model) == ("slip", "mix")


def test_an_input_that_nothing_asks_goes_on_request_and_the_change_is_said() -> None:
    rules = base(*ALL, variables=(FORCE, Variable("slip")))
    assert pruned(rules).removed == ()
    found = pruned(rules, inputs=True)
    change = "a row is answered though it is missing"
    assert found.removed == (Removed("input 'slip'", "nothing uses it", change),)
    assert found.model.inputs == ("force",)


def test_a_rule_that_never_fires_goes_on_request_and_others_are_renumbered() -> None:
    rules = base((force("soft"), force("hard")), (force("soft"),), (force("hard"),))
    assert "rule 1" not in where(pruned(rules))
    found = pruned(rules, rules=True)
    assert found.removed[0] == Removed(
        "rule 1",
        "force is soft AND force is hard never hold together",
        "the rules behind it have lower numbers",
    )
    assert found.rules == (2, 3)
    assert not list(proof_faults(rules, found.model, rules=found.rules))


def test_a_rule_base_whose_rules_never_fire_keeps_one() -> None:
    rules = base((force("soft"), force("hard")), (force("hard"), force("soft")))
    found = pruned(rules, rules=True)
    assert found.rules == (1,)
    assert pruned(found.model, rules=True).model == found.model


SLIM = Side(1.0, (0.5,), 2.0)


@pytest.mark.parametrize(
    ("one", "two", "is_never"),
    [
        (Band(high=1.0), Band(low=1.0), True),
        (Band(high=1.0), Band(low=math.nextafter(1.0, 0.0)), False),
        (Band(high=1.0, right=2.0), Band(low=2.0), True),
        (Band(high=1.0, right=2.0), Band(low=1.5), False),
        (LR(0.0, SLIM, SLIM), Band(low=2.1), True),
        (LR(0.0, SLIM, SLIM), Band(low=1.9), False),
        (Points((0.0, 1.0), (1.0, 0.0)), Band(low=1.0), True),
        (Points((0.0, 1.0), (1.0, 0.0)), Band(low=0.5), False),
        (Points((0.0, 0.0), (1.0, 0.0)), Band(low=0.0), True),
        (Points((5.0,), (0.0,)), Band(), True),
    ],
)
def test_shapes_that_share_no_value_never_hold_together(
    one: Shape, two: Shape, is_never: bool
) -> None:
    variable = Variable("force", (Term("one", one), Term("two", two)))
    rules = base((force("one"), force("two")), variables=(variable,))
    assert bool(never_firing(rules)) == is_never


def test_a_proposition_and_its_negation_never_hold_together_on_a_plateau_alone() -> (
    None
):
    crisp = Variable("force", (Term("crisp", Band(0.0, 1.0)), FIRM))
    both = (force("crisp"), force("crisp", negated=True))
    assert never_firing(base(both, variables=(crisp,))) == {
        1: "force is crisp AND force is not crisp never hold together"
    }
    fuzzy = (force("firm"), force("firm", negated=True))
    assert never_firing(base(fuzzy, variables=(crisp,))) == {}


def test_the_negation_of_what_never_holds_always_holds() -> None:
    shapes: dict[tuple[str, str], Shape] = {("x", "no"): Points((5.0,), (0.0,))}
    assert always_holds(Proposition("x", ("no",), hedges=("not",)), shapes)
    assert not always_holds(Proposition("x", ("no",)), shapes)


@pytest.mark.parametrize(
    ("parts", "is_finite"),
    [
        ((Part("a", 1.0),), False),
        ((Part("a", 0.999),), True),
        ((Part("a", 0.5), Part("b", -0.499)), True),
        ((Part("a", 0.5), Part("b", -0.501)), False),
        ((Part("a", 0.1, 1e31),), False),
        ((Part("a", 0.1, -1e30),), True),
    ],
)
def test_a_combination_overflows_unless_its_weights_are_small(
    parts: tuple[Part, ...], is_finite: bool
) -> None:
    assert cannot_overflow(parts) == is_finite


# --- trees


def test_a_tree_that_serves_its_path_needs_neither_sets_nor_flanks() -> None:
    tree = random_tree(2, leaves=5, combinations=0.0)
    found = pruned(tree, uses=PATH)
    assert isinstance(found.model, FuzzyTree)
    assert found.model.sets == ()
    shapes = [t.shape for v in found.model.variables for t in v.terms]
    assert shapes
    assert all(isinstance(s, Band) and s.left is s.right is None for s in shapes)


def test_a_tree_that_serves_raw_rules_keeps_the_sets_that_branches_name() -> None:
    tree = random_tree(2, leaves=5)
    found = pruned(tree, uses=("tree", "relative", "raw"))
    assert isinstance(found.model, FuzzyTree)
    assert rules_from_tree(found.model) == rules_from_tree(tree)
    raw = rules_from_tree(tree, "raw")
    left = rules_from_tree(found.model, "raw")
    assert not list(proof_faults(raw, left))
    assert left == pruned(raw).model


def test_one_set_that_stands_for_another_stands_in_every_branch() -> None:
    tree = random_tree(2, leaves=3, inputs=1)
    group, *others = tree.sets
    first, *more = group.terms
    same = (first, *(replace(term, function=first.shape) for term in more))
    alike = replace(tree, sets=(replace(group, terms=same), *others))
    found = pruned(alike, uses=USES)
    assert isinstance(found.model, FuzzyTree)
    assert [term.name for term in found.model.sets[0].terms] == [first.name]
    assert not list(proof_faults(alike, found.model, uses=USES))


@pytest.mark.parametrize(
    ("uses", "message"),
    [
        (("path",), "uses: there is tree, relative, raw, not 'path'"),
        ((), "uses: there is tree, relative, raw, not none"),
        (
            ("raw",),
            "uses: tree 'random 3' carries no fitted sets, so it has no raw rules",
        ),
    ],
)
def test_a_wrong_use_is_one_sentence(uses: tuple[Use, ...], message: str) -> None:
    tree = random_tree(1, leaves=3)
    bare = pruned(tree).model
    with pytest.raises(ValueError, match=f"^{message}$"):
        pruned(bare, uses=uses)


# --- laws

SEEDS = st.integers(0, 10_000)


def _models(seed: int) -> list[Model]:
    tree = random_tree(seed, leaves=1 + seed % 9, inputs=1 + seed % 4)
    return [tree, rules_from_tree(tree), rules_from_tree(tree, "raw")]


@given(SEEDS, st.booleans(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_pruning_twice_is_pruning_once(seed: int, inputs: bool, rules: bool) -> None:
    for model in _models(seed):
        once = pruned(model, inputs=inputs, rules=rules)
        twice = pruned(once.model, inputs=inputs, rules=rules)
        assert twice.model == once.model
        assert twice.removed == ()


@given(SEEDS, st.sampled_from([("tree",), ("relative",), ("tree", "raw"), USES]))
@settings(max_examples=60, deadline=None)
def test_every_pruned_model_is_proved(seed: int, uses: tuple[Use, ...]) -> None:
    for model in _models(seed):
        found = pruned(model, uses=uses, rules=True)
        faults = proof_faults(model, found.model, uses=uses, rules=found.rules)
        assert list(faults) == []
        assert unguarded(model, found.model) == ()


# --- planted faults


def _faults(before: Document, after: Document) -> list[str]:
    return list(proof_faults(before, after, uses=USES))


def test_a_member_missing_from_an_or_is_found() -> None:
    rules = base((force("soft", "firm"),), (force("hard"),))
    other = base((force("soft"),), (force("hard"),))
    assert _faults(rules, other) == ["rule 1 is another rule"]


def test_a_proposition_missing_under_product_is_found() -> None:
    product = Semantics("product")
    rules = base((force("soft"), force("soft")), semantics=product)
    other = base((force("soft"),), semantics=product)
    assert _faults(rules, other) == ["rule 1 is another rule"]


def test_a_missing_rule_that_may_fire_is_found() -> None:
    rules = base((force("soft"),), (force("hard"),))
    other = base((force("soft"),))
    assert list(proof_faults(rules, other, rules=(1,))) == [
        "rule 2 may fire and is gone"
    ]
    assert _faults(rules, other) == ["1 rules where 2 are right"]


def test_a_curve_that_changed_in_its_last_bit_is_found() -> None:
    rules = base((force("soft"),))
    end = math.nextafter(2.0, 3.0)
    soft = Term("soft", Band(high=1.0, right=end))
    other = base((force("soft"),), variables=(Variable("force", (soft,)),))
    assert _faults(rules, other) == ["rule 1 is another rule"]


def test_a_weight_that_changed_is_found() -> None:
    mixes = [
        (
            Variable("force"),
            Variable("mix", (SOFT,), parts=(Part("force", weight),)),
        )
        for weight in (0.5, 0.25)
    ]
    one, two = (base((Proposition("mix", ("soft",)),), variables=mix) for mix in mixes)
    assert _faults(one, two) == ["rule 1 is another rule"]


def test_other_semantics_are_found() -> None:
    rules = base((force("soft"),))
    assert _faults(rules, base((force("soft"),), semantics=Semantics(missing="a"))) == [
        "classes or semantics differ"
    ]


def test_a_tree_with_another_cut_leaf_or_set_is_found() -> None:
    tree = random_tree(2, leaves=4)
    first, *others = tree.leaves
    label = next(one for one in tree.classes if one != first.label)
    leaf = replace(first, label=label)
    assert _faults(tree, replace(tree, leaves=(leaf, *others))) == [
        "its leaves have other classes"
    ]
    bare = pruned(tree, uses=("tree", "relative")).model
    assert "node 1 is another node" in _faults(tree, bare)
    assert _faults(tree, rules_from_tree(tree)) == ["the two are models of other kinds"]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("inputs", [False, True])
def test_a_pruned_system_has_the_same_program_and_numbers(
    seed: int, inputs: bool
) -> None:
    system = random_system(seed)
    left = pruned(system, inputs=inputs)
    assert [*proof_faults(system, left.model)] == []
    rows = system_probes(system, limit=40, seed=seed)
    table = [[row[name] for row in rows] for name in system.inputs]
    values = np.array(table, np.float64).reshape(len(system.inputs), len(rows))
    values = values[:, np.isfinite(values).all(axis=0)]
    kept = values[[system.inputs.index(name) for name in left.model.inputs]]
    one, two = load(system)(values), load(left.model)(kept)
    assert not unequal(one, two).any()


def test_a_system_with_another_term_is_no_pruned_one() -> None:
    system = random_system(1)
    output = system.outputs[0]
    other = replace(output, default=1.0 if output.default is None else None)
    changed = replace(system, outputs=(other, *system.outputs[1:]))
    assert [*proof_faults(system, changed)] == ["its program has other steps"]

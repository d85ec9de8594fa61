"""A check that cannot fail is no check: each planted fault must be found."""

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.checking.files import first_difference
from fuzzytree.checking.representations import check
from fuzzytree.errors import DisagreementError
from fuzzytree.model.agreement import Agreement
from fuzzytree.model.rulebase import Band, Kind, RuleBase, Side
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.table import all_runtimes, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree

TREE = random_tree(3, leaves=6, inputs=3)
LIMIT = 1500


def by(agreement: Agreement, representation: str) -> list[str]:
    return [
        c.verdict for c in agreement.comparisons if c.representation == representation
    ]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(3))
def test_everything_made_from_a_tree_agrees(seed: int) -> None:
    agreement = check(random_tree(1 + seed, leaves=5 + seed, inputs=3), limit=LIMIT)
    assert agreement.ok, [c for c in agreement.comparisons if c.verdict == "DISAGREES"]


def test_every_installed_runtime_is_compared_in_all_it_can_run() -> None:
    agreement = check(TREE, limit=300)
    for runtime in all_runtimes():
        if is_installed(runtime) and "tree" in runtime.runs:
            assert by(agreement, f"{runtime.name}: tree"), runtime.name
        if is_installed(runtime) and "rules" in runtime.runs:
            results = by(agreement, f"{runtime.name}: relative rules")
            named = [s for s in agreement.skipped if s.startswith(runtime.name)]
            assert results or named, runtime.name


def test_the_proof_and_all_cells_stand_beside_the_rows() -> None:
    agreement = check(TREE, limit=300, runtimes=["native"])
    bases = [
        c.basis for c in agreement.comparisons if c.representation == "relative rules"
    ]
    assert bases == ["proof", "all cells", "rows"]


def test_the_difference_of_raw_rules_is_reported_and_no_fault() -> None:
    agreement = check(TREE, limit=300, runtimes=["native"])
    (raw,) = [c for c in agreement.comparisons if c.representation == "raw rules"]
    assert raw.verdict == "differs by design"
    assert raw.flips > 0


def test_missing_rows_are_counted_for_each_carrier() -> None:
    agreement = check(TREE, limit=300, runtimes=["native"])
    missing = {count.representation: count.missing for count in agreement.counts}
    assert set(missing) == {"tree", "relative rules", "raw rules"}
    assert len(set(missing.values())) == 1
    assert missing["tree"] >= 3 * len(TREE.inputs)  # nan, inf and -inf in each input


def test_a_rule_base_is_checked_without_its_tree() -> None:
    agreement = check(rules_from_tree(TREE, "raw"), limit=300)
    assert agreement.ok
    assert agreement.cells is None


def test_rows_of_ones_own_are_added_to_the_probes() -> None:
    data = np.zeros((len(TREE.inputs), 7))
    agreement = check(TREE, data=data, limit=200, runtimes=["native"])
    assert agreement.counts[0].rows == 207
    assert agreement.probes == 200


def test_data_of_another_width_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"^data must have shape \(3, rows\), not \(2, 5\)$"
    ):
        check(TREE, data=np.zeros((2, 5)), limit=100)


Change = Callable[[RuleBase], RuleBase]


def _with_rule(rules: RuleBase, number: int, **changes: object) -> RuleBase:
    changed = list(rules.rules)
    changed[number] = replace(changed[number], **changes)
    return replace(rules, rules=tuple(changed))


def swapped_class(rules: RuleBase) -> RuleBase:
    other = next(c for c in rules.classes if c != rules.rules[0].then)
    return _with_rule(rules, 0, then=other)


def dropped_proposition(rules: RuleBase) -> RuleBase:
    return _with_rule(rules, 0, when=rules.rules[0].when[1:])


def swapped_rules(rules: RuleBase) -> RuleBase:
    first, second, *rest = rules.rules
    return replace(rules, rules=(second, first, *rest))


def negated_proposition(rules: RuleBase) -> RuleBase:
    first, *rest = rules.rules[0].when
    return _with_rule(rules, 0, when=(replace(first, hedges=("not",)), *rest))


def other_conjunction(rules: RuleBase) -> RuleBase:
    return replace(rules, semantics=replace(rules.semantics, missing=rules.classes[0]))


def edge_by_one_ulp(rules: RuleBase) -> RuleBase:
    return _with_band(rules, lambda band: replace(band, high=_next(band.high)))


def flank_by_one_ulp(rules: RuleBase) -> RuleBase:
    def bend(band: Band) -> Band:
        assert band.right is not None
        return replace(band, right=_next(band.right))

    return _with_band(rules, bend)


def _next(value: float | None) -> float:
    assert value is not None
    return math.nextafter(value, math.inf)


def _with_band(rules: RuleBase, change: Callable[[Band], Band]) -> RuleBase:
    """Change the first term that has a right flank."""
    for position, variable in enumerate(rules.variables):
        for index, term in enumerate(variable.terms):
            if isinstance(term.shape, Band) and term.shape.right is not None:
                terms = list(variable.terms)
                terms[index] = replace(term, function=change(term.shape))
                variables = list(rules.variables)
                variables[position] = replace(variable, terms=tuple(terms))
                return replace(rules, variables=tuple(variables))
    raise AssertionError("no term has a right flank")


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    "plant",
    [
        swapped_class,
        dropped_proposition,
        swapped_rules,
        negated_proposition,
        other_conjunction,
        edge_by_one_ulp,
        flank_by_one_ulp,
    ],
)
def test_a_fault_in_a_rule_file_is_found_in_content_and_in_answers(
    plant: Change,
) -> None:
    faulty = plant(rules_from_tree(TREE))
    agreement = check(
        TREE, faulty, names=["rules.yaml"], limit=3000, runtimes=["native"]
    )
    results = {
        c.basis: c.verdict
        for c in agreement.comparisons
        if c.representation == "rules.yaml"
    }
    assert not agreement.ok
    assert results == {"file": "DISAGREES", "rows": "DISAGREES"}


def test_the_rules_of_the_tree_itself_agree_as_a_file() -> None:
    agreement = check(TREE, rules_from_tree(TREE), limit=300, runtimes=["native"])
    assert by(agreement, "file 1") == ["agrees", "agrees"]


def test_rules_that_say_to_be_raw_are_not_believed() -> None:
    tree = replace(
        TREE,
        sets=(),
        nodes=tuple(
            replace(n, branches=tuple(replace(b, sets=()) for b in n.branches))
            for n in TREE.nodes
        ),
    )
    rules = replace(rules_from_tree(tree), kind="raw")
    agreement = check(tree, rules, limit=300, runtimes=["native"])
    assert by(agreement, "file 1") == ["rows only", "agrees"]
    assert not agreement.ok
    assert check(tree, rules, limit=300, runtimes=["native"], rows_only=True).ok


@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_a_tree_is_compared_with_rules_by_the_rules_made_from_it(kind: Kind) -> None:
    rules = rules_from_tree(TREE, kind)
    agreement = check(rules, TREE, limit=300, runtimes=["native"])
    assert by(agreement, "file 1") == ["agrees", "agrees"]
    first, *rest = TREE.leaves
    other = next(c for c in TREE.classes if c != first.label)
    faulty = replace(TREE, leaves=(replace(first, label=other), *rest))
    assert not check(rules, faulty, limit=300, runtimes=["native"]).ok


def test_a_tree_of_other_classes_does_not_agree_with_rules() -> None:
    classes = {c: f"{c}!" for c in TREE.classes}
    leaves = tuple(replace(x, label=classes[x.label]) for x in TREE.leaves)
    semantics = TREE.semantics
    missing = classes[semantics.missing] if semantics.missing else None
    other = replace(
        TREE,
        classes=tuple(classes.values()),
        leaves=leaves,
        semantics=replace(semantics, missing=missing),
    )
    rules = replace(rules_from_tree(TREE), kind=None)
    agreement = check(rules, other, limit=300, runtimes=["native"])
    assert by(agreement, "file 1") == ["DISAGREES"]


def test_a_swapped_leaf_in_a_tree_file_is_found() -> None:
    first, *rest = TREE.leaves
    other = next(c for c in TREE.classes if c != first.label)
    faulty = replace(TREE, leaves=(replace(first, label=other), *rest))
    agreement = check(TREE, faulty, names=["old.yaml"], limit=300, runtimes=["native"])
    assert by(agreement, "old.yaml") == ["DISAGREES", "DISAGREES"]


def test_other_inputs_are_found_without_running_anything() -> None:
    other = random_tree(3, leaves=6, inputs=2)
    agreement = check(TREE, other, names=["other"], limit=100, runtimes=["native"])
    assert by(agreement, "other") == ["DISAGREES", "DISAGREES"]


def test_a_runtime_that_gives_other_answers_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = next(r for r in all_runtimes() if r.name == "reference")

    def load(model: FuzzyTree | RuleBase) -> Callable[..., object]:
        run = honest.load(model)

        def lie(values: np.ndarray) -> object:
            outcome = run(values)
            rule = np.where(outcome.status == 0, 1, outcome.rule)
            return msgspec.structs.replace(outcome, rule=rule)

        return lie

    liar = msgspec.structs.replace(honest, name="liar", load=load)
    monkeypatch.setattr("fuzzytree.runtimes.table.find_runtime", _found(liar))
    agreement = check(TREE, limit=300, runtimes=["liar"])
    assert by(agreement, "liar: tree")[0] == "DISAGREES"
    assert by(agreement, "liar: relative rules")[0] == "DISAGREES"


def _found(extra: object) -> Callable[[str], object]:
    from fuzzytree.runtimes.table import find_runtime

    return lambda name: extra if name == "liar" else find_runtime(name)


def test_a_disagreement_is_raised_with_its_first_row() -> None:
    faulty = swapped_class(rules_from_tree(TREE))
    agreement = check(TREE, faulty, names=["r.yaml"], limit=300, runtimes=["native"])
    with pytest.raises(DisagreementError) as caught:
        agreement.raise_if_not_ok()
    lines = str(caught.value).splitlines()
    assert lines[0] == "r.yaml disagrees with the model"
    assert "rules 1, then" in lines[-2]


def test_the_same_facts_are_there_for_programs() -> None:
    agreement = check(TREE, limit=200, runtimes=["native"])
    results = msgspec.json.decode(agreement.to_json())
    assert results["ok"] is True
    assert len(results["comparisons"]) == len(agreement.comparisons)


def test_first_difference_names_the_path_and_both_values() -> None:
    one, two = Side(1.0, (0.5, 0.5)), Side(1.0, (0.5, 0.25))
    assert first_difference(one, two) == "curve 2: 0.25 where 0.5 is right"
    assert first_difference(one, Side(1.0, (0.5,))) == "curve: 1 where 2 are right"
    assert first_difference(one, one) is None

"""What each format can carry is found by trying, and the page shows what was found.

`python tests/formats/test_formats.py` rewrites the table of
`docs/reference/formats.md`.
"""

from __future__ import annotations

import functools
import re
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace
from sklearn import datasets
from sklearn.tree import DecisionTreeClassifier

from fuzzytree import from_sklearn
from fuzzytree.checking import export, formed
from fuzzytree.checking.abilities import MEANINGS, Ability, abilities_of, dialects_of
from fuzzytree.errors import LossError
from fuzzytree.exporters.table import TABLE, all_formats, find_format
from fuzzytree.learning import learn_arrays
from fuzzytree.learning.units import FloatArray
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document, Loss, Written
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.report.formats import SIGNS, Found, ability_rows
from fuzzytree.semantics import as_system, flattened
from fuzzytree.semantics.inference import input_values
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.samples import all_samples

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "formats.md"
MARKED = re.compile(r"(<!-- abilities -->\n\n).*?(<!-- end -->\n)", re.DOTALL)
YAML = find_format("yaml")


@functools.cache
def _tried(form: str) -> tuple[Ability, ...]:
    return abilities_of(find_format(form))


def _ability_table(found: Found, *, legend: bool = True) -> str:
    """Return the table of abilities as Markdown."""
    head, *rows = ability_rows(found)
    lines = [head, ["---", *[":-:"] * (len(head) - 1)], *rows]
    table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    if not legend:
        return table
    signs = "".join(f"- `{SIGNS[one]}` {text}\n" for one, text in MEANINGS.items())
    return f"{table}\n{signs}"


def _page() -> str:
    made = _ability_table({one.name: _tried(one.name) for one in all_formats()})
    for form in all_formats():
        known = {name: abilities_of(form, dialect=name) for name in dialects_of(form)}
        lines = zip(*known.values(), strict=True)
        if any(len({one.outcome for one in line}) > 1 for line in lines):
            table = _ability_table(known, legend=False)
            made += f"\nThe dialects of {form.name}:\n\n{table}"
    text = PAGE.read_text("utf-8")
    return MARKED.sub(lambda found: f"{found[1]}{made}\n{found[2]}", text)


@pytest.mark.heavy
def test_the_page_shows_what_was_found() -> None:
    shown = PAGE.read_text("utf-8")
    assert shown == _page(), "python tests/formats/test_formats.py rewrites the page"


@functools.cache
def _learnt(name: str, *, by_sklearn: bool) -> tuple[RuleBase, FloatArray]:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    columns = [f"x{k}" for k in range(values.shape[1])]
    if by_sklearn:
        foreign = DecisionTreeClassifier(max_depth=4, random_state=0)
        tree = from_sklearn(foreign.fit(values, labels), columns=columns)
    else:
        classes = [f"c{k}" for k in range(int(labels.max()) + 1)]
        tree = learn_arrays(values, labels, columns=columns, classes=classes).tree
        assert name == "iris" or any(one.parts for one in tree.variables)
    return rules_from_tree(tree), values


@pytest.mark.one_in(10)
@pytest.mark.parametrize("by_sklearn", [False, True])
@pytest.mark.parametrize("name", ["iris", "wine", "breast_cancer"])
@pytest.mark.parametrize("form", ["fcl", "fll", "fis", "fml"])
def test_a_file_has_the_inputs_that_rules_use_and_no_row_is_outside_their_ranges(
    form: str, name: str, by_sklearn: bool
) -> None:
    rules, table = _learnt(name, by_sklearn=by_sklearn)
    inputs = as_system(rules).variables
    used = flattened(as_system(rules))[0].inputs
    assert set(used) == {one.name for one in rules.variables if one.terms}
    columns = [f"x{k}" for k in range(table.shape[1])]
    rows = [
        input_values(inputs, dict(zip(columns, row, strict=True)))
        for row in table.tolist()
    ]
    format_ = find_format(form)
    assert format_.read is not None
    for dialect in dialects_of(format_) or (None,):
        options = {} if dialect is None else {"dialect": dialect}
        written = export(rules, form, allow_loss=True, tolerance=0.01, **options)
        content = written.content.replace(b'"fuzzytree":1', b'"fuzzytree":0')
        system = format_.read(content, "model").model
        assert isinstance(system, FuzzySystem)
        for one, name in zip(system.variables, used, strict=True):
            values = [row[name] for row in rows]
            assert one.low is None or one.low <= min(values)
            assert one.high is None or max(values) <= one.high


def test_there_is_a_sample_of_every_kind_of_model() -> None:
    kinds = {type(model) for model in all_samples().values()}
    assert kinds == {FuzzyTree, RuleBase, FuzzySystem}


def test_each_dialect_of_a_format_is_tried() -> None:
    assert dialects_of(YAML) == ()
    fcl = find_format("fcl")
    assert dialects_of(fcl) == ("portable", "iec", "fuzzylite", "jfuzzylogic")
    one = {"Sugeno, linear": all_samples()["Sugeno, linear"]}
    assert abilities_of(fcl, one)[0].outcome == "refused"
    assert abilities_of(fcl, one, dialect="fuzzylite")[0].outcome == "alike"


def test_every_outcome_has_a_sign_and_a_meaning() -> None:
    assert list(SIGNS) == list(MEANINGS)
    assert len(set(SIGNS.values())) == len(SIGNS)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("name", TABLE)
def test_a_format_carries_what_it_says(name: str) -> None:
    form = find_format(name)
    found = {one.sample: one.outcome for one in _tried(name)}
    for sample, model in all_samples().items():
        kind = {FuzzyTree: "tree", RuleBase: "rules", FuzzySystem: "system"}[
            type(model)
        ]
        if kind in form.carries:
            assert found[sample] != "no"


def test_yaml_carries_trees_and_rules_as_they_are() -> None:
    for one in _tried("yaml"):
        model = all_samples()[one.sample]
        if not isinstance(model, FuzzySystem):
            assert one.outcome == "equal"


def _outcome(sample: str, *, bound: float | None, read: bool = True) -> str:
    """Return what is found of a format that has one loss."""

    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        written = YAML.write(model)
        return replace(written, losses=(Loss("all", "is less", bound),))

    form = replace(YAML, write=write, read=YAML.read if read else None)
    (found,) = abilities_of(form, {sample: all_samples()[sample]})
    return found.outcome


def test_a_loss_with_a_bound_differs_from_one_without() -> None:
    assert _outcome("tree", bound=1e-3) == "points"
    assert _outcome("tree", bound=None) == "lossy"


def test_a_refusal_is_reported_with_its_reason() -> None:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        raise LossError("turtles only")

    models = {"tree": all_samples()["tree"]}
    found = abilities_of(replace(YAML, write=write), models)[0]
    assert (found.outcome, found.reasons) == ("refused", ("turtles only",))


def test_what_is_read_back_as_another_model_is_lossy() -> None:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        assert isinstance(model, FuzzyTree)
        return YAML.write(replace(model, leaves=model.leaves[::-1]))

    models = {"tree": all_samples()["tree"]}
    found = abilities_of(replace(YAML, write=write), models)[0]
    assert (found.outcome, found.reasons) == (
        "lossy",
        ("it is read back as another model",),
    )


def test_a_tree_goes_as_rules_and_rules_as_a_system() -> None:
    tree = all_samples()["tree"]
    rules = formed(tree, replace(YAML, carries=("rules",)))
    assert isinstance(rules, RuleBase)
    system = formed(tree, replace(YAML, carries=("system",)))
    assert isinstance(system, FuzzySystem)
    again = formed(system, replace(YAML, carries=("rules",)))
    assert isinstance(again, RuleBase)
    assert len(again.rules) == len(rules.rules)


def test_a_system_whose_outputs_are_numbers_is_no_rule_base() -> None:
    with pytest.raises(LossError) as caught:
        formed(all_samples()["Mamdani, centroid"], replace(YAML, carries=("rules",)))
    representations = [form.name for form in all_formats() if "system" in form.carries]
    assert str(caught.value) == (
        "cannot write fan as yaml: it carries rules, "
        "and this is a fuzzy system whose outputs are numbers; "
        f"{', '.join(representations)} carry one"
    )


def test_a_tree_is_refused_with_what_to_do() -> None:
    with pytest.raises(LossError) as caught:
        export(all_samples()["tree"], "fll")
    assert str(caught.value) == (
        "cannot write grip as fll: it carries rules or system, and this is a tree; "
        "fuzzytree.convert makes rules of it"
    )


if __name__ == "__main__":
    PAGE.write_text(_page(), "utf-8")
    sys.exit()

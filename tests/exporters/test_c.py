"""Generated C: what stands in it, whatever a model says, and what it refuses."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.exporters.c import FORMAT, write_c
from fuzzytree.exporters.c_selftest import answer_of_tables, words_of
from fuzzytree.exporters.c_steps import number_text
from fuzzytree.exporters.c_tables import CModel, tables_of
from fuzzytree.exporters.c_text import DOUBLE, SINGLE, constants, prefix_of, remark
from fuzzytree.exporters.program_text import digest_of, places_of
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import Status, descend, evaluate
from fuzzytree.testing import probes, random_system, random_tree, with_points

HOSTILE = (
    "*/ int x; /*",
    "/*/",
    "**//",
    "??/ #error",
    '"; system("',
    "\\",
    "int",
    "é ☂ \\u2028 \\r\\n",
    "%s%n",
    "1st",
    "A" * 100,
    "a" * 100,
)


def hostile_rules() -> RuleBase:
    terms = tuple(Term(name, Band(high=1.0, right=2.0)) for name in HOSTILE)
    inputs = tuple(Variable(name, terms, unit=name) for name in HOSTILE)
    rules = tuple(Rule((Proposition(name, (name,)),), name) for name in HOSTILE)
    return RuleBase("*/ # ??/", HOSTILE, inputs, rules)


def edge_tree(cut: float) -> FuzzyTree:
    terms = Term("low", Band(high=cut)), Term("high", Band(low=cut))
    branches = Branch(("low",), leaf=1), Branch(("high",), leaf=2)
    return FuzzyTree(
        "edge",
        ("no", "yes"),
        (Variable("x", terms),),
        (Node("x", (cut,), (0, 1), branches),),
        (Leaf("no"), Leaf("yes")),
    )


def test_text_of_a_model_is_never_code() -> None:
    content = write_c(hostile_rules()).content
    text = content.decode("ascii")
    assert "??" not in text
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    assert "/*" not in code
    assert "*/" not in code
    for word in ("int x;", "#error\n", 'system("', "\\"):
        assert word not in code.replace("\\n", "")


def test_a_comment_is_one_line_that_cannot_end() -> None:
    for name in HOSTILE:
        found = remark(name)
        assert found.isascii()
        assert found.isprintable()
        assert "*/" not in f"{found} */"[:-2]
        assert not {"/*", "??"} & {found[i : i + 2] for i in range(len(found))}


def test_constants_are_unlike_and_not_too_long() -> None:
    found = constants("GRIP_CLASS_", HOSTILE)
    assert len(set(found)) == len(HOSTILE)
    assert all(len(name) <= 63 and re.fullmatch(r"[A-Z0-9_]+", name) for name in found)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Grip 2", "grip_2"),
        ("2 hands", "model_2_hands"),
        ("", "model"),
        ("wine quality of the north", "wine_quality_of_the"),
    ],
)
def test_a_prefix_is_made_of_the_model_s_name(name: str, expected: str) -> None:
    assert prefix_of(name) == expected


@pytest.mark.heavy
def test_writing_twice_gives_the_same_bytes() -> None:
    for model in (random_tree(4), rules_from_tree(random_tree(4)), random_system(4)):
        assert write_c(model).content == write_c(model).content


def test_numbers_are_written_with_all_their_bits() -> None:
    values = [0.1, -1e-320, 5e-324, 1.7976931348623157e308, -0.0, 3.0, 1 / 3]
    for value in values:
        assert float.fromhex(DOUBLE.text(value)) == value
        single = float(np.float32(min(value, 1e38)))
        text = SINGLE.text(single)
        assert text.endswith("f")
        assert float.fromhex(text[:-1]) == single
    assert number_text(-0.25) == "(-0x1p-2 /* -0.25 */)"
    assert number_text(float("-inf")) == "name_bits(UINT64_C(0xfff0000000000000))"


@pytest.mark.parametrize("seed", range(4))
def test_the_tables_of_a_tree_say_what_the_reference_says(seed: int) -> None:
    tree = random_tree(seed, leaves=9, combinations=0.3)
    file = CModel(tree, DOUBLE)
    assert len(file.tests) == sum(len(node.cuts) for node in tree.nodes)
    for row in probes(tree, limit=300):
        assert answer_of_tables(file, row) == descend(tree, row)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_the_tables_of_rules_say_what_the_reference_says(
    seed: int, conjunction: str
) -> None:
    is_product = conjunction == "product"
    tree = random_tree(seed, leaves=6, combinations=0.3)
    rules = rules_from_tree(
        tree,
        "raw" if seed % 2 else "relative",
        conjunction="product" if is_product else "minimum",
    )
    rules = with_points(rules, seed)
    file = CModel(rules, DOUBLE)
    for row in probes(rules, limit=200):
        answer, right = answer_of_tables(file, row), evaluate(rules, row)
        assert (answer.rule, answer.status) == (right.rule, right.status)
        if right.status is not Status.MISSING:
            assert answer.strengths == right.strengths


def test_rules_that_begin_alike_share_their_beginning() -> None:
    rules = rules_from_tree(random_tree(2, leaves=30))
    places = tables_of(rules, places_of(rules.variables), DOUBLE).places
    assert sorted(filter(None, places.rule)) == list(range(1, 31))
    assert len(places.rule) < sum(len(rule.when) for rule in rules.rules) / 2
    assert max(places.depth) == max(len(rule.when) for rule in rules.rules)


@pytest.mark.parametrize("place", range(3))
def test_a_digest_changes_with_the_last_bit_of_any_strength(place: int) -> None:
    given = [0.25, 1.0, 0.5]
    changed = given.copy()
    changed[place] = float(np.nextafter(given[place], 0.0))
    assert digest_of(words_of(given, DOUBLE)) != digest_of(words_of(changed, DOUBLE))
    assert digest_of(words_of([0.0], DOUBLE)) == digest_of(words_of([-0.0], DOUBLE))


def test_what_float_cannot_hold_is_refused_with_every_loss() -> None:
    with pytest.raises(LossError) as caught:
        write_c(edge_tree(1e300), dtype="float32")
    largest = float(np.finfo(np.float32).max)
    assert str(caught.value) == (
        "cannot write edge as c float32: node 1: cut 1e+300 lies beyond float32; "
        f"{largest!r} stands\n"
        "  pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )
    written = write_c(edge_tree(1e300), dtype="float32", allow_loss=True)
    assert len(written.losses) == 1
    assert "0x1.fffffep+127f" in written.content.decode()


def test_wrong_options_are_named() -> None:
    tree = random_tree(0)
    with pytest.raises(ValueError, match="float64, float32, q15, q31, not 'mixed'"):
        write_c(tree, dtype="mixed")  # type: ignore[arg-type] # that is the test
    with pytest.raises(ValueError, match="'Grip' cannot begin the names of C; 'grip'"):
        write_c(tree, name="Grip")
    with pytest.raises(ValueError, match="activations are those of fuzzy systems"):
        write_c(tree, activations=True)


def test_the_format_carries_all_models() -> None:
    assert FORMAT.carries == ("tree", "rules", "system")
    assert FORMAT.read is None


def test_a_file_without_its_test_is_the_same_up_to_there() -> None:
    tree = random_tree(3)
    for model in (tree, rules_from_tree(tree), random_system(1)):
        whole = write_c(model, name="m").content
        bare = write_c(model, name="m", selftest=False).content
        begin, _, _ = whole.partition(b"\n#ifdef M_SELFTEST")
        assert bare.replace(b";selftest=False", b"", 1) == begin + b"\n#endif\n"

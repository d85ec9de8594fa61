"""Writing YAML: nothing is lost, it is the same every time, and people can read it."""

from __future__ import annotations

import itertools
from pathlib import Path

import msgspec
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.errors import LossError
from fuzzytree.exporters.yaml import FORMAT, write
from fuzzytree.formats import text_files
from fuzzytree.formats.yaml import nodes
from fuzzytree.formats.yaml.nodes import Scalar, compose
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Side,
    Term,
    Variable,
    text_fault,
)
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

POSITIVE = Path(__file__).parents[1] / "example-files" / "positive"
WORDS = (
    "no off yes on y N ~ null NULL true False 1 -1 01 1.5 1e-05 1_000 12:30 0x1F 0o7 "
    ".inf -.INF .nan .5 1. - -- --- ... ? : , # | > % @ & * ! ` = << [] {} [a] {a:b} "
    'a:b a,b a] é ß 漢字 🙂 👩\u200d👧 x² °C µm \' " \\ it\'s "a" \\n 2026-11-21 or'
)
AWKWARD = [
    *WORDS.split(),
    *(" ", " a", "a ", "a  b", "a: b", "a #b"),
    *("- a", "? a", "\xa0", "\ufeff", "a\u200db"),
    *("a is b", "a or b", "not a", "no class", "class a", "2001-12-14 21:59:43"),
    *("0.8 to 1.7", "1 000", "x" * 200, "a, b", "''", "\U0010ffff", "e\u0301"),
]


def assert_kept(model: Model) -> bytes:
    content = write(model).content
    back = read_yaml(content, "model.yaml").model
    assert back == model
    # 0.0 and -0.0 are equal, and not the same.
    assert repr(msgspec.to_builtins(back)) == repr(msgspec.to_builtins(model))
    assert write(back).content == content
    return content


@pytest.mark.one_in(20)
@pytest.mark.parametrize("seed", range(30))
def test_every_random_model_comes_back_bit_for_bit(seed: int) -> None:
    labels = itertools.cycle([None, "class 1", "class 2"])
    answers = list(itertools.islice(labels, seed, seed + 2))
    meant = Semantics("minimum" if seed % 2 else "product", answers[0], answers[1])
    tree = random_tree(
        seed,
        leaves=1 + seed * 2,
        inputs=1 + seed % 7,
        classes=2 + seed % 4,
        semantics=meant,
    )
    assert_kept(tree)
    assert_kept(rules_from_tree(tree))
    assert_kept(rules_from_tree(tree, conjunction="product"))
    assert_kept(rules_from_tree(tree, "raw"))
    assert_kept(msgspec.structs.replace(tree, columns=()))


def named(names: list[str], *, kind: str = "rules") -> Model:
    """Return a model in which everything that has a name has one of these."""
    first, last = names[0], names[-1]
    if kind == "tree":
        return FuzzyTree(
            first, tuple(names), (), (), (Leaf(last, first, 3),), (), Semantics(), ()
        )
    terms = tuple(Term(name, Band()) for name in names)
    inputs = [Variable(name, terms, unit=last) for name in names]
    rules = [
        Rule(
            (Proposition(name, tuple(names[:3]), ("not",) if bool(index % 2) else ()),),
            name,
        )
        for index, name in enumerate(names)
    ]
    every = Rule(tuple(Proposition(name, (last,)) for name in names), last)
    meant = Semantics("minimum", first, last)
    return RuleBase(
        first, tuple(names), tuple(inputs), (*rules, every), meant, columns=tuple(names)
    )


@pytest.mark.one_in(6)
@pytest.mark.parametrize("kind", ["rules", "tree"])
@pytest.mark.parametrize("name", AWKWARD, ids=ascii)
def test_an_awkward_name_comes_back(name: str, kind: str) -> None:
    content = assert_kept(named([name], kind=kind))
    assert_kept(named([name, "other", "one more"], kind=kind))
    # A reader of YAML 1.1 sees the same name.
    if name.isprintable():
        assert yaml.safe_load(content)["name"] == name


@pytest.mark.heavy
def test_all_awkward_names_come_back_together() -> None:
    assert_kept(named(AWKWARD))
    assert_kept(named(AWKWARD, kind="tree"))


@pytest.mark.heavy
@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.lists(
        st.text(
            st.characters().filter(lambda sign: not text_fault(sign)),
            min_size=1,
            max_size=30,
        )
        | st.lists(
            st.sampled_from(["a", "b", "is", "or", "not", ",", "no"]), min_size=1
        ).map(" ".join),
        min_size=1,
        max_size=5,
        unique=True,
    )
)
def test_any_names_come_back(names: list[str]) -> None:
    assert_kept(named(names))
    assert_kept(named(names, kind="tree"))


FINITE = st.floats(allow_nan=False, allow_infinity=False)
SMALL = st.floats(-1e6, 1e6)
CURVES = st.lists(SMALL, min_size=1, max_size=8).map(tuple)
POSITIVE_NUMBERS = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
SIDES = st.builds(
    Side,
    spread=POSITIVE_NUMBERS,
    curve=CURVES,
    reach=st.floats(min_value=1, exclude_min=True, allow_infinity=False),
)
FLANKS = st.builds(
    lambda curve, error: 1.0,
    CURVES,
    st.none() | st.floats(allow_nan=False),
)
SHAPES = (
    st.builds(LR, mean=FINITE, left=SIDES, right=SIDES)
    | st.builds(lambda mean, side: LR(mean, side, side), FINITE, SIDES)
    | st.builds(lambda flank: Band(None, 0.0, None, flank), st.none() | FLANKS)
    | st.builds(lambda low: Band(low, None), FINITE)
    | st.just(Band())
)


@pytest.mark.heavy
@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(SHAPES, min_size=1, max_size=4), FINITE, FINITE, st.integers(0, 2**53))
def test_any_numbers_come_back(
    shapes: list[Band | LR], weight: float, centre: float, support: int
) -> None:
    terms = tuple(Term(f"t{n}", shape) for n, shape in enumerate(shapes))
    parts = (Part("x", weight or 1.0, centre),)
    low, high = sorted((weight, centre))
    variables = (
        Variable("x", terms, low=low, high=high),
        Variable("y", low=low),
        Variable("z", terms, high=high, parts=parts),
    )
    rule = Rule((Proposition("z", ("t0",)),), "a", support)
    assert_kept(RuleBase("any", ("a",), variables, (rule,)))


@pytest.mark.parametrize("value", [0.0, -0.0, 5e-324, 1e22, 1e16, 1e-5, 1 / 3, -2.0])
def test_a_number_is_the_same_for_readers_of_both_versions(value: float) -> None:
    rules = RuleBase(
        "n", ("a",), (Variable("x", low=value, high=value),), (Rule((), "a"),)
    )
    content = assert_kept(rules)
    seen = yaml.safe_load(content)["variables"][0]["range"]
    assert repr(seen) == repr({"from": value, "to": value})


@pytest.mark.parametrize("path", sorted(POSITIVE.glob("iris-*")), ids=lambda p: p.stem)
def test_an_example_is_written_as_it_stands(path: Path) -> None:
    assert (
        write(read_yaml(path.read_bytes(), path.name).model).content
        == path.read_bytes()
    )


def test_a_symmetric_set_is_written_once() -> None:
    side = Side(0.5, (0.25,))
    both, two = LR(1.0, side, side), LR(1.0, side, Side(0.5, (0.25,), 4.0))
    terms = (Term("both", both), Term("two", two))
    rules = RuleBase("s", ("a",), (Variable("x", terms),), (Rule((), "a"),))
    text = assert_kept(rules).decode()
    assert text[text.index("  - name: both") : text.index("rules:")] == (
        "  - name: both\n"
        "    mean: 1.0\n"
        "    spread: 0.5\n"
        "    curve: [0.25]\n"
        "    reach: 5.0\n"
        "  - name: two\n"
        "    mean: 1.0\n"
        "    left: {spread: 0.5, curve: [0.25], reach: 5.0}\n"
        "    right: {spread: 0.5, curve: [0.25], reach: 4.0}\n"
    )


def test_a_name_with_a_word_of_the_language_stands_in_quotes() -> None:
    terms = tuple(Term(name, Band()) for name in ("b", "not b", "c (cm)"))
    propositions = (
        Proposition("a", ("b",), hedges=("not",)),
        Proposition("a", ("not b",)),
        Proposition("a", ("b", "c (cm)")),
        Proposition("a", ("not b",), hedges=("not",)),
    )
    rules = RuleBase("s", ("k",), (Variable("a", terms),), (Rule(propositions, "k"),))
    text = assert_kept(rules).decode()
    assert text[text.index("- if:") : text.index("  then:")] == (
        "- if: [a is not b, 'a is \"not b\"', a is b or c (cm), 'a is not \"not b\"']\n"
    )


@pytest.mark.heavy
def test_no_line_is_long_where_it_can_be_broken() -> None:
    tree = random_tree(4, leaves=40, inputs=60)
    many = tuple(f"a rather long name {n}" for n in range(30))
    terms = tuple(Term(name, Band()) for name in many)
    propositions = (Proposition("x", many), Proposition("x", many, hedges=("not",)))
    wide = RuleBase(
        "w",
        many,
        (Variable("x", terms),),
        (Rule(propositions, many[0]),),
        columns=("x",),
    )
    for model in (tree, rules_from_tree(tree), rules_from_tree(tree, "raw"), wide):
        lines = assert_kept(model).decode().splitlines()
        assert max(map(len, lines)) <= 88


def test_a_file_begins_with_what_it_is() -> None:
    tree = random_tree(1)
    assert write(rules_from_tree(tree)).content.startswith(
        b"# A fuzzy rule base of fuzzytree: IF propositions THEN class.\n"
        b"format: fuzzytree/1\n"
        b"kind: rule base\n"
    )
    assert write(tree).content.startswith(
        b"# A fuzzy decision tree of fuzzytree: node 1 is the root.\n"
        b"format: fuzzytree/1\n"
        b"kind: tree\n"
    )


def test_quotes_stand_only_where_a_reader_needs_them() -> None:
    plain = ["setosa", "class 1", "below 0.144", "0.8 to 1.7", "x_1", "é", "°C", "a-b"]
    quoted = ["no", "Off", "1", "1_000", "12:30", "a:b", " a", "a,b", "#1", "0x1F"]
    labels = {*plain, *quoted}
    root, _ = compose(assert_kept(named([*plain, *quoted], kind="tree")), "x.yaml")
    assert isinstance(root, nodes.MappingNode)
    values = {key.text: one for key, one in root.pairs if isinstance(key, Scalar)}
    listed = values["classes"]
    assert isinstance(listed, nodes.ListNode)
    scalars = [one for one in listed.items if isinstance(one, Scalar)]
    assert {one.text for one in scalars} == labels
    assert [one.text for one in scalars if one.is_plain] == plain


def test_what_no_file_can_hold_is_refused() -> None:
    low = Term("low", Band())
    variables = (Variable("x", (low,), unit="n" * 1001),)
    rules = RuleBase("r", ("a",), variables, (Rule((), "a"), Rule((), "a", 2**53 + 1)))
    for allow_loss in (False, True):
        with pytest.raises(LossError) as caught:
            write(rules, allow_loss=allow_loss)
        assert str(caught.value) == (
            "cannot write r as yaml: unit 'nnnnnnnnnnnnnnnnnnnn'...: 1001 characters "
            "are more than the 1000 of a name\n"
            "rule 2: the support is above 9007199254740992"
        )
    assert text_files.LONGEST_NAME == 1000


def test_a_sentence_that_would_not_be_read_again_is_refused() -> None:
    names = tuple(f"{n:03}".ljust(1000, "x") for n in range(100))
    variable = Variable("v", tuple(Term(name, Band()) for name in names))
    rule = Rule((Proposition("v", names),), "a")
    with pytest.raises(LossError) as caught:
        write(RuleBase("r", ("a",), (variable,), (rule,)))
    assert str(caught.value) == (
        "cannot write r as yaml: rule 1: a sentence of more than 100000 characters"
    )


def test_a_file_that_would_not_be_read_again_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fuzzytree.exporters.yaml_text.MOST_BYTES", 500)
    with pytest.raises(LossError) as caught:
        write(random_tree(1))
    assert str(caught.value) == (
        "cannot write random 7 as yaml: a file of more than 500 bytes or 1,000,000 "
        "entries is not read again"
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_writer_counts_the_nodes_that_the_reader_counts(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    tree = random_tree(seed, leaves=9)
    rules, raw = rules_from_tree(tree), rules_from_tree(tree, "raw")
    for model in (tree, rules, raw, random_system(seed)):
        monkeypatch.undo()
        content = write(model).content
        root, _ = compose(content, "x.yaml")
        count = _size(root)
        monkeypatch.setattr("fuzzytree.exporters.yaml_text.MOST_NODES", count)
        monkeypatch.setattr("fuzzytree.formats.yaml.nodes.MOST_NODES", count)
        assert read_yaml(write(model).content, "x.yaml").model == model
        monkeypatch.setattr("fuzzytree.exporters.yaml_text.MOST_NODES", count - 1)
        with pytest.raises(LossError):
            write(model)


def _size(node: nodes.Node) -> int:
    match node:
        case nodes.MappingNode():
            return 1 + sum(_size(key) + _size(value) for key, value in node.pairs)
        case nodes.ListNode():
            return 1 + sum(map(_size, node.items))
        case _:
            return 1


def test_the_format_says_what_it_carries() -> None:
    assert FORMAT.name == "yaml"
    assert FORMAT.suffixes == (".yaml", ".yml")
    assert FORMAT.carries == ("tree", "rules", "system")
    assert FORMAT.cannot == ()
    assert FORMAT.write is write
    assert FORMAT.read is not None
    tree = random_tree(1)
    assert FORMAT.read(write(tree).content, "tree.yaml").model == tree

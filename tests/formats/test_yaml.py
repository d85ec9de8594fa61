"""Reading YAML: every mistake has its place, and nothing hostile gets through."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fuzzytree.errors import ReadError
from fuzzytree.exporters.yaml import write
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Proposition, RuleBase
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.work import at_most

EXAMPLES = Path(__file__).parents[1] / "example-files"
POSITIVE = sorted((EXAMPLES / "positive").glob("*.yaml"))
NEGATIVE = sorted((EXAMPLES / "negative").glob("*.yaml"))
RULES = (EXAMPLES / "positive" / "iris-rules.yaml").read_text("utf-8")


def error_of(content: str | bytes) -> str:
    content = content if isinstance(content, bytes) else content.encode()
    with pytest.raises(ReadError) as caught:
        read_yaml(content, "x.yaml")
    return str(caught.value)


def model_or_none(content: bytes) -> Document | None:
    """Return the model of a file, or None where it is refused as it should be."""
    try:
        return read_yaml(content, "x.yaml").model
    except ReadError as error:
        lines = str(error).splitlines()
    assert all(line.startswith("x.yaml:") for line in lines)
    return None


@pytest.mark.parametrize("path", POSITIVE, ids=lambda path: path.stem)
def test_an_example_to_accept_is_read_and_comes_back(path: Path) -> None:
    model = read_yaml(path.read_bytes(), path.name).model
    assert read_yaml(write(model).content, path.name).model == model


@pytest.mark.parametrize("path", NEGATIVE, ids=lambda path: path.stem)
def test_an_example_to_refuse_gives_the_message_beside_it(path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        read_yaml(path.read_bytes(), path.name)
    assert f"{caught.value}\n" == path.with_suffix(".txt").read_text("utf-8")


@pytest.mark.parametrize(
    ("wrong", "key"), [("conjunction", "and"), ("disjunction", "or")]
)
def test_the_python_word_for_an_operator_gets_the_key_as_a_hint(
    wrong: str, key: str
) -> None:
    lines = RULES.split("\n")
    line = next(k for k, one in enumerate(lines, 1) if one.startswith(f"  {key}: "))
    head = lines.index("semantics:") + 2
    choice = "and, or, not, uncovered, missing, label type, sharpness, floor, answer"
    reports = [
        f"x.yaml:{head}:3: the semantics of rules needs '{key}'",
        f"x.yaml:{line}:3: the semantics of rules has no key '{wrong}'; "
        f"there is {choice} (did you mean '{key}'?)",
    ]
    lines[line - 1] = lines[line - 1].replace(key, wrong, 1)
    assert error_of("\n".join(lines)) == "\n".join(sorted(reports))


def test_words_of_yaml_1_1_are_the_names_that_they_look_like() -> None:
    path = EXAMPLES / "positive" / "by-hand-switches.yaml"
    rules = read_yaml(path.read_bytes(), path.name).model
    assert isinstance(rules, RuleBase)
    assert rules.classes == ("no", "yes", "~", "é")
    assert rules.name == "2026-11-21"
    assert rules.rules[0].when == (Proposition("switch", ("off",)),)
    assert rules.rules[1].when == (
        Proposition("switch", ("off", "12:30"), hedges=("not",)),
        Proposition("load", ("heavy or so", "1_000")),
    )
    assert rules.semantics.uncovered == "no"
    assert rules.semantics.missing is None


@pytest.mark.one_in(5)
@pytest.mark.parametrize("seed", range(5))
def test_a_file_cut_short_is_never_a_smaller_model(seed: int) -> None:
    tree = random_tree(seed, leaves=4)
    for model in (tree, rules_from_tree(tree), rules_from_tree(tree, "raw")):
        content = write(model).content
        for end in range(0, len(content) - 1, 7):
            error_of(content[:end])
        again = read_yaml(content[:-1], "x.yaml").model
        assert again == model  # only the last line's end is gone


def test_every_line_that_can_be_left_out_matters_or_is_refused() -> None:
    lines = RULES.splitlines(keepends=True)
    whole = read_yaml(RULES.encode(), "x.yaml").model
    optional = ("#", "terms: relative", "columns", "  unit", "  range", "  support")
    for number, line in enumerate(lines):
        rest = "".join(lines[:number] + lines[number + 1 :]).encode()
        model = model_or_none(rest)
        if model is None:
            continue
        assert model != whole or line.startswith("#")
        assert line.startswith(optional) or "0 " in line or "to: " in line, line


FRAGMENTS = (
    "[", "]", "{", "}", ":", "- ", "? ", "#", "&a ", "*a ", "!!int ", "'", '"', "\n",
    "\t", "---\n", "...\n", "%YAML 1.2\n", "|\n", ">\n", "~", "null", ".nan", "-1",
    "1e999", "\x00", "\ud7ff", "é", " is ", " or ", "not ", "node 1", "leaf 9", "<<: ",
)  # fmt: skip


def mutated(chance: random.Random, text: str) -> bytes:
    """Return a text with some of it cut, doubled, moved or replaced."""
    for _ in range(chance.randint(1, 4)):
        start = chance.randrange(len(text) + 1)
        end = min(len(text), start + chance.choice([0, 1, 1, 2, 5, 20, 200]))
        other = chance.randrange(len(text) + 1)
        new = chance.choice(
            [
                "",
                chance.choice(FRAGMENTS),
                text[start:end] * 2,
                text[other : other + 20],
            ]
        )
        text = text[:start] + new + text[end:]
    content = text.encode()
    if chance.random() < 0.1 and content:
        at = chance.randrange(len(content))
        content = content[:at] + bytes([chance.randrange(256)]) + content[at + 1 :]
    return content


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(8))
def test_a_damaged_file_gives_a_read_error_or_a_model_after_bounded_work(
    seed: int,
) -> None:
    chance = random.Random(seed)
    tree = random_tree(seed, leaves=3)
    texts = [
        *(path.read_text("utf-8") for path in POSITIVE),
        *(write(m).content.decode() for m in (tree, rules_from_tree(tree))),
    ]
    for _ in range(150):
        content = mutated(chance, chance.choice(texts))
        with at_most(1_000_000):
            model = model_or_none(content)
            if model is not None:
                assert read_yaml(write(model).content, "x.yaml").model == model


def test_lines_are_swapped_without_an_error_of_another_kind() -> None:
    chance = random.Random(0)
    lines = RULES.splitlines(keepends=True)
    for _ in range(300):
        one, two = chance.sample(range(len(lines)), 2)
        lines[one], lines[two] = lines[two], lines[one]
        if model_or_none("".join(lines).encode()) is None:
            lines = RULES.splitlines(keepends=True)


@pytest.mark.one_in(8)
@pytest.mark.parametrize(
    "value", ["", "~", "[]", "{}", "x", "1", "[[]]", "{a: b}", "''"]
)
def test_no_key_takes_a_value_of_another_kind(value: str) -> None:
    for path in POSITIVE[1:]:
        lines = path.read_text("utf-8").splitlines()
        for number, line in enumerate(lines):
            key, colon, _ = line.partition(":")
            if colon:
                changed = [*lines[:number], f"{key}: {value}", *lines[number + 1 :]]
                model_or_none("\n".join(changed).encode())


def test_thousands_of_mistakes_are_listed_in_part_and_at_once() -> None:
    wrong = "".join(
        f"- if: [petal length is lowish {n}, petal width iz {n}]\n  then: class {n}\n"
        for n in range(4_000)
    )
    variables = "".join(
        f"- name: v{n}\n  terms:\n  - {{name: low {n}, degree: 1}}\n"
        for n in range(2_000)
    )
    text = RULES.replace("rules:\n", f"{variables}rules:\n{wrong}").replace(
        "columns: [sepal length, sepal width, petal length, petal width]\n", ""
    )
    with at_most(3_000_000):
        message = error_of(text).splitlines()
    assert len(message) == 101
    assert message[0].startswith("x.yaml:6033:8: rule 1: 'petal length' has no term")
    assert message[-1] == "x.yaml: and at least 200 more mistakes"


@pytest.mark.heavy
@pytest.mark.parametrize("longest", [8, 200])
def test_sentences_of_traps_are_read_with_bounded_work(longest: int) -> None:
    names = [" or ".join(["a"] * n) for n in range(1, longest)]
    listed = "".join(f"  - {{name: {name}, degree: 1}}\n" for name in names)
    text = RULES.replace(
        "rules:\n",
        f"- name: a\n  terms:\n{listed}rules:\n"
        + f"- {{if: [a is {'a or ' * 10_000}a], then: setosa}}\n" * 20
        + f"- {{if: [{'a is ' * 100}{'a or ' * 1000}a], then: setosa}}\n" * 20,
    ).replace("columns", "# columns")
    with at_most(1_000_000):
        assert error_of(text).startswith("x.yaml:")


def test_a_name_has_a_longest_length() -> None:
    message = error_of(RULES.replace("name: iris", f"name: {'i' * 1001}"))
    assert message == "x.yaml:4:7: 'name' is longer than 1000 characters"


@pytest.mark.heavy
def test_ten_thousand_rules_are_read_with_bounded_work() -> None:
    tree = random_tree(1, leaves=500, inputs=10, combinations=0.0)
    rules = rules_from_tree(tree)
    many = RuleBase(
        "many", rules.classes, rules.variables, rules.rules * 20, rules.semantics
    )
    with at_most(20_000_000):
        content = write(many).content
        assert read_yaml(content, "x.yaml").model == many

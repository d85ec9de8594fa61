"""Sentences of rules: one reading each, and a reason where there is none."""

from __future__ import annotations

import contextlib
import random

import pytest

from fuzzytree.formats.yaml.conditions import (
    HEDGES,
    SentenceError,
    conclusions_text,
    condition_sentence,
    condition_texts,
    parse_conclusions,
    parse_condition,
)
from fuzzytree.model import (
    MOST_LEVELS,
    And,
    Conclusion,
    Condition,
    Not,
    Or,
    Proposition,
)
from fuzzytree.testing import random_system

A, B, C = Proposition("a", ("b",)), Proposition("c", ("d",)), Proposition("e", ("f",))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a is b", A),
        ("  a \n is\tb ", A),
        ("a is b and c is d or e is f", Or((And((A, B)), C))),
        ("a is b or c is d and e is f", Or((A, And((B, C))))),
        ("(a is b or c is d) and e is f", And((Or((A, B)), C))),
        ("a is b and c is d and e is f", And((A, B, C))),
        ("(a is b and c is d) and e is f", And((And((A, B)), C))),
        ("not (a is b)", Not(A)),
        ("not (a is b or c is d) and e is f", And((Not(Or((A, B))), C))),
        ("not (not (a is b))", Not(Not(A))),
        ("((a is b))", A),
        ("a is not very b", Proposition("a", ("b",), ("not", "very"))),
        (
            "a is very-very cube-root b",
            Proposition("a", ("b",), ("very very", "cube root")),
        ),
        ("a is b or d", Proposition("a", ("b", "d"))),
        ("a is b or c is d or d", Or((A, Proposition("c", ("d", "d"))))),
        (
            "a is not b or 'or' or d and c is d",
            And((Proposition("a", ("b", "or", "d"), ("not",)), B)),
        ),
        ("a is b or 'c' is d", Or((A, B))),
        ("a is b or (c is d)", Or((A, B))),
        ("size (cm) is b", Proposition("size (cm)", ("b",))),
        ("(a is size (cm) or f(x))", Proposition("a", ("size (cm)", "f(x)"))),
        ("a is any", Proposition("a", (), ("any",))),
        ("a is not any and c is d", And((Proposition("a", (), ("not", "any")), B))),
        ("a is any b", Proposition("a", ("b",), ("any",))),
        ("wall distance is quite near", Proposition("wall distance", ("quite near",))),
        ("'is' is \"very\"", Proposition("is", ("very",))),
        ('\'it\'\'s\' is "a ""b"""', Proposition("it's", ('a "b"',))),
        ("it's is b's", Proposition("it's", ("b's",))),
        ("'' is b", Proposition("", ("b",))),
        ("a is 'any'", Proposition("a", ("any",))),
    ],
)
def test_a_sentence_has_one_reading(text: str, expected: Condition) -> None:
    assert parse_condition(text) == expected


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the end where a variable must stand"),
        ("a", "the end where 'is' must stand behind 'a'"),
        ("a b", "the end where 'is' must stand behind 'a b'"),
        ("a is", "the end where a term must stand behind 'a is'"),
        ("a is very", "the end where a term must stand behind 'a is very'"),
        ("a is b and", "the end where a variable must stand behind 'a is b and'"),
        ("a is b is c", "'is' where 'and', 'or' or the end must stand behind 'a is b'"),
        ("a is b)", "')' where 'and', 'or' or the end must stand behind 'a is b'"),
        ("(a is b", "the end where 'and', 'or' or ')' must stand behind '( a is b'"),
        ("(and a is b)", "'and' where a variable must stand behind '('"),
        ("not a is b", "'a' where '(' must stand behind 'not'"),
        ("a is (b or c)", "'(' where a term must stand behind 'a is'"),
        ("a is b or", "the end where a variable must stand behind 'a is b or'"),
        ("a is 'b", "the quote ' is not closed"),
        ("a is very 'b' c", "'c' where 'and', 'or' or the end must stand behind "
         "\"a is very 'b'\""),
        ("is is is", "'is' where a variable must stand"),
        ("(" * 200 + "a is b" + ")" * 200, f"nested deeper than {MOST_LEVELS} levels"),
    ],
)  # fmt: skip
def test_what_is_no_condition_is_refused_with_the_reason(
    text: str, reason: str
) -> None:
    with pytest.raises(SentenceError) as caught:
        parse_condition(text)
    assert str(caught.value) == reason


def test_conclusions_are_joined_by_and() -> None:
    found = parse_conclusions("power is not very high and the fan is 'off'")
    assert found == (
        Conclusion("power", "high", ("not", "very")),
        Conclusion("the fan", "off"),
    )
    for text in ("", "a is b or c is d", "a is any", "(a is b)", "not (a is b)", "a"):
        with pytest.raises(SentenceError):
            parse_conclusions(text)


@pytest.mark.parametrize("seed", range(20))
def test_what_was_written_is_read_as_the_equal_condition(seed: int) -> None:
    for offset in range(10):
        system = random_system(20 * offset + seed, has_odd_names=True)
        for rule in system.rules:
            parts = tuple(map(parse_condition, condition_texts(rule.when)))
            whole = And(parts) if len(parts) > 1 else parts[0] if parts else None
            assert whole == rule.when
            assert parse_conclusions(conclusions_text(rule.then)) == rule.then


def test_the_deepest_condition_of_a_system_is_read_again() -> None:
    for kind in range(4):
        condition: Condition = A
        for level in range(MOST_LEVELS - 1):
            match (kind + level) % 4 if kind else 0:
                case 0:
                    condition = Not(condition)
                case 1:
                    condition = And((B, condition))
                case 2:
                    condition = Or((B, condition))
                case _:
                    condition = And((condition, B))
        assert parse_condition(condition_sentence(condition)) == condition


def test_words_of_the_language_stand_in_quotes() -> None:
    for word in ("is", "and", "or", "not", *HEDGES):
        for name in (word, f"a {word}", f"{word} b"):
            text = condition_sentence(Proposition(name, (name,)))
            assert text == f'"{name}" is "{name}"'
            assert parse_condition(text) == Proposition(name, (name,))
    assert (
        condition_sentence(Proposition("island", ("android",))) == "island is android"
    )


def test_any_text_is_read_or_refused() -> None:
    chance = random.Random(0)
    words = ["a", "is", "b", "and", "or", "not", "(", ")", "very", "any", "'", '"', " "]
    for _ in range(5000):
        text = " ".join(chance.choice(words) for _ in range(chance.randint(0, 12)))
        for parse in (parse_condition, parse_conclusions):
            with contextlib.suppress(SentenceError):
                assert parse(text) != ()

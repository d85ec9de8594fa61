"""Sentences: their readings, and which of them are ambiguous."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.formats.yaml.propositions import guess, readings, words
from fuzzytree.model.rulebase import Proposition, proposition_text

PLAIN = {"size": words(["low", "high"]), "wet or dry": words(["wet", "dry"])}
TRAPS = {
    "a": words(["b", "not b", "b or c", "c", "is b", "b is c"]),
    "a is b": words(["c", "not c"]),
    "a is not": words(["b", "c"]),
}


@pytest.mark.parametrize(
    ("text", "proposition"),
    [
        ("size is low", Proposition("size", ("low",))),
        ("size is high or low", Proposition("size", ("high", "low"))),
        (
            "size is not low or high",
            Proposition("size", ("low", "high"), hedges=("not",)),
        ),
        ("wet or dry is wet or dry", Proposition("wet or dry", ("wet", "dry"))),
    ],
)
def test_a_sentence_of_plain_names_has_one_reading(
    text: str, proposition: Proposition
) -> None:
    assert readings(text, PLAIN) == (proposition,)


@pytest.mark.parametrize(
    "text",
    ["", "size", "size is", "size is ", "size is  low", "Size is low", "size is lo"],
)
def test_what_names_nothing_has_no_reading(text: str) -> None:
    assert readings(text, PLAIN) == ()


@pytest.mark.parametrize(
    ("text", "first", "second"),
    [
        (
            "a is not b",
            Proposition("a", ("not b",)),
            Proposition("a", ("b",), hedges=("not",)),
        ),
        ("a is b or c", Proposition("a", ("b", "c")), Proposition("a", ("b or c",))),
        ("a is b is c", Proposition("a", ("b is c",)), Proposition("a is b", ("c",))),
    ],
)
def test_every_reading_of_an_ambiguous_sentence_is_found(
    text: str, first: Proposition, second: Proposition
) -> None:
    assert set(readings(text, TRAPS)) == {first, second}


NAMES = st.lists(
    st.sampled_from(["a", "b", "is", "not", "or"]), min_size=1, max_size=4
).map(" ".join)


@pytest.mark.heavy
@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    st.dictionaries(
        NAMES, st.lists(NAMES, min_size=1, max_size=4, unique=True), min_size=1
    ),
    st.data(),
)
def test_readings_are_those_that_a_search_of_all_propositions_finds(
    terms: dict[str, list[str]], data: st.DataObject
) -> None:
    variable = data.draw(st.sampled_from(sorted(terms)))
    size = data.draw(st.integers(1, min(3, len(terms[variable]))))
    chosen = tuple(data.draw(st.permutations(terms[variable]))[:size])
    text = proposition_text(
        Proposition(variable, chosen, ("not",) if data.draw(st.booleans()) else ())
    )
    longest = text.count(" or ") + 1
    expected = {
        Proposition(name, several, ("not",) if negated else ())
        for name in terms
        for count in range(1, longest + 1)
        for several in itertools.product(terms[name], repeat=count)
        for negated in (False, True)
        if proposition_text(Proposition(name, several, ("not",) if negated else ()))
        == text
    }
    vocabulary = {name: words(labels) for name, labels in terms.items()}
    found = readings(text, vocabulary)
    assert len(found) == min(len(expected), 2)
    assert set(found) <= expected


def test_a_guess_prefers_a_variable_that_exists() -> None:
    assert guess("a is b is d", TRAPS) == Proposition("a is b", ("d",))
    assert guess("size is not lo or hi", PLAIN) == Proposition(
        "size", ("lo", "hi"), ("not",)
    )
    assert guess("sise is low", PLAIN) == Proposition("sise", ("low",))
    assert guess("size low", PLAIN) is None

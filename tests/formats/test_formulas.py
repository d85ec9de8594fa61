"""Formulas as text."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.formats.formulas import (
    MOST_CHARACTERS,
    FormulaError,
    fuzzylite_text_of,
    parse,
    text_of,
)
from fuzzytree.model import (
    FUNCTIONS,
    MOST_LEVELS,
    Call,
    Expression,
    Name,
    Number,
)
from fuzzytree.semantics.inference import value_of

VALUES = {"a": 2.0, "b": 3.0, "c": 4.0, "x": 0.5}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a + b * c", 14.0),
        ("(a + b) * c", 20.0),
        ("c - b - a", -1.0),
        ("c / a / a", 1.0),
        ("a ^ b ^ a", 512.0),
        ("a ** b", 8.0),
        ("pow(a, b)", 8.0),
        ("-a ^ b", -8.0),
        ("-a ^ 2", -4.0),
        ("~a ^ 2", 4.0),
        ("~2 ^ 2", 4.0),
        ("-2 ^ 2", -4.0),
        (".-a * b", -6.0),
        ("a * -b", -6.0),
        ("a ^ -1", 0.5),
        ("+a + .+b", 5.0),
        ("- - a", 2.0),
        ("7 % b", 1.0),
        ("!a", 0.0),
        ("!(a - a)", 1.0),
        ("lt(a, b) and gt(a, b) or eq(a, a)", 1.0),
        ("lt(a, b) or gt(a, b) and 0", 1.0),
        ("max(a, min(b, c))", 3.0),
        ("fabs(-1.5e-1)", 0.15),
        ("2*pi", 2.0 * math.pi),
        ("pi() / 2", math.pi / 2.0),
        (".5+1.", 1.5),
        ("-inf", -math.inf),
        ("x", 0.5),
    ],
)
def test_a_formula_has_the_value_that_its_signs_say(text: str, value: float) -> None:
    assert value_of(parse(text), VALUES) == value


def test_a_sign_before_a_number_belongs_to_the_number() -> None:
    assert parse("-2") == Number(-2.0)
    assert parse("~2") == Number(-2.0)
    assert parse("-(2)") == Call("negate", (Number(2.0),))


def test_names_with_blanks_and_words_of_the_language_are_quoted() -> None:
    formula = Call("+", (Name("wrist's force"), Name("min")))
    assert text_of(formula) == "'wrist''s force' + 'min'"
    assert parse(text_of(formula)) == formula


def test_a_variable_may_be_named_like_a_function() -> None:
    assert parse("min * 2", names=["min"]) == Call("*", (Name("min"), Number(2.0)))


def test_fuzzylite_gets_no_exponents_and_no_minus_before_a_name() -> None:
    formula = parse("-a * -1e-7 + 1e21 ^ -b")
    text = fuzzylite_text_of(formula)
    assert text == "~a * ~0.0000001 + 1000000000000000000000 ^ ~b"
    assert parse(text) == formula


@pytest.mark.parametrize(
    ("text", "column", "sentence"),
    [
        ("", 1, "the end where a number, a name or '(' must stand"),
        ("a +", 4, "the end where a number, a name or '(' must stand"),
        ("a b", 3, "'b' where an operator or the end must stand"),
        ("a + * b", 5, "'*' where a number, a name or '(' must stand"),
        ("a and and", 7, "'and' where a number, a name or '(' must stand"),
        ("(a + b", 1, "the parenthesis that opens here is not closed"),
        ("max(a, b", 4, "the parenthesis that opens here is not closed"),
        ("a + b)", 6, "')' where an operator or the end must stand"),
        ("(a, b)", 3, "',' where an operator or ')' must stand"),
        ("a $ b", 3, "'$' does not belong into a formula"),
        ("'a", 1, "the quote that opens here is not closed"),
        ("1e999", 1, "1e999 is too large for a number"),
        ("sqrt(a, b)", 1, "the function 'sqrt' takes 1 argument, not 2"),
        ("min(a)", 1, "the function 'min' takes 2 arguments, not 1"),
        ("sin", 1, "the function 'sin' needs its arguments in parentheses"),
        (
            "dirty * 2",
            1,
            "no variable 'dirty'; there is dirt, a, b (did you mean 'dirt'?)",
        ),
    ],
)
def test_what_is_no_formula_is_reported_with_its_column(
    text: str, column: int, sentence: str
) -> None:
    with pytest.raises(FormulaError) as error:
        parse(text, names=["dirt", "a", "b"])
    assert (error.value.column, error.value.sentence) == (column, sentence)


def test_a_function_that_does_not_exist_is_reported_with_the_nearest() -> None:
    with pytest.raises(FormulaError, match=r"no function 'squrt'.*mean 'sqrt'"):
        parse("squrt(a)")


@pytest.mark.parametrize("opening", ["(", "-", "~", "sin(", "a ^ ", "a + ("])
def test_deep_nesting_ends_in_one_sentence(opening: str) -> None:
    with pytest.raises(FormulaError, match=f"deeper than {MOST_LEVELS} levels"):
        parse(opening * 3000 + "a")


def test_a_long_chain_ends_in_one_sentence() -> None:
    with pytest.raises(FormulaError, match=f"deeper than {MOST_LEVELS} levels"):
        parse("a" + "+a" * 5000)
    with pytest.raises(FormulaError, match="characters"):
        parse("a" * (MOST_CHARACTERS + 1))


NAMES = st.one_of(
    st.sampled_from(["a", "min", "and", "pi", "inf", "a b", "1st", "it's", "a.b", ""]),
    st.text(max_size=8),
)
NUMBERS = st.floats(allow_nan=False)
BY_COUNT = {
    count: sorted(name for name, needed in FUNCTIONS.items() if needed == count)
    for count in set(FUNCTIONS.values())
}


def calls(parts: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    found: list[st.SearchStrategy[Expression]] = [
        st.builds(
            Call,
            st.sampled_from(names),
            st.lists(parts, min_size=n, max_size=n).map(tuple),
        )
        for n, names in BY_COUNT.items()
    ]
    return st.one_of(found)


EXPRESSIONS = st.recursive(
    st.builds(Number, NUMBERS) | st.builds(Name, NAMES), calls, max_leaves=12
)


@pytest.mark.heavy
@given(EXPRESSIONS)
@settings(max_examples=400)
def test_reading_a_written_formula_gives_the_equal_formula(formula: Expression) -> None:
    assert parse(text_of(formula)) == formula
    assert parse(fuzzylite_text_of(formula)) == formula


@given(st.text(alphabet="ab1.e+-*/^%~!(),' sqrtmin\0é", max_size=60))
def test_any_text_is_a_formula_or_refused_with_a_column(text: str) -> None:
    column = 1
    try:
        parse(text)
    except FormulaError as error:
        column = error.column
    assert 1 <= column <= len(text) + 1

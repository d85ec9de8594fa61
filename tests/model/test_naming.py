"""Names for targets: accepted, unlike, readable, and the way back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.model.naming import DIGITS, LETTERS, NameMap, changes_text, unlike
from tests.work import at_most


def made(*names: str, **options: object) -> list[str]:
    return list(NameMap.of(names, **options).accepted.values())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("petal length", "petal_length"),
        ("petal length (cm)", "petal_length_cm"),
        ("1st", "x_1st"),
        ("", "x"),
        ("%", "x"),
        ("Ärger", "Arger"),
        ("ﬁne", "fine"),
        ("Ωλ", "Omegalamda"),
        ("щ", "shcha"),
        ("温度", "u6e29u5ea6"),
        ("__kept__", "__kept__"),
        ("Straße", "Strasse"),
    ],
)
def test_a_name_becomes_one_that_reads_alike(name: str, expected: str) -> None:
    assert made(name) == [expected]


def test_an_accepted_name_keeps_itself_though_another_one_comes_first() -> None:
    assert made("a b", "a_b", "a-b") == ["a_b_2", "a_b", "a_b_3"]


def test_names_that_differ_only_in_case_are_numbered_where_case_is_ignored() -> None:
    assert made("Low", "low", ignores_case=True) == ["Low", "low_2"]
    assert made("Low", "low") == ["Low", "low"]


def test_reserved_words_are_no_names_in_any_case() -> None:
    assert made("And", reserved=["AND"]) == ["And_"]
    assert made("is not", reserved=["is_not"]) == ["is_not_"]


def test_names_of_others_are_not_given_again() -> None:
    assert made("x", taken=["x", "x_2"]) == ["x_3"]


def test_long_names_are_cut_and_still_unlike() -> None:
    found = made("a" * 40, "a" * 41, "a" * 42, longest=10)
    assert found == ["a" * 10, "a" * 8 + "_2", "a" * 8 + "_3"]


def test_a_target_without_a_filler_gets_names_of_letters_and_digits() -> None:
    found = made("a b", "ab", "_", first=LETTERS, rest=LETTERS + DIGITS, filler="")
    assert found == ["ab2", "ab", "x"]


def test_only_changed_names_are_listed() -> None:
    assert NameMap.of(["a", "b c"]).changed == {"b c": "b_c"}


def test_unlike_keeps_a_name_that_is_free() -> None:
    assert unlike("a", ["b"]) == "a"


@pytest.mark.heavy
@given(
    st.lists(st.text(max_size=12), max_size=20),
    st.booleans(),
    st.sampled_from([None, 8, 20]),
    st.lists(st.text("abAB_2", min_size=1, max_size=3), max_size=5),
)
def test_all_names_are_accepted_and_unlike(
    names: list[str], ignores_case: bool, longest: int | None, reserved: list[str]
) -> None:
    first, rest = LETTERS + "_", LETTERS + DIGITS + "_"
    found = NameMap.of(
        names,
        reserved=reserved,
        longest=longest,
        ignores_case=ignores_case,
        taken=["taken"],
    )
    values = list(found.accepted.values())
    keys = [v.casefold() if ignores_case else v for v in values]
    assert len(set(keys)) == len(set(names))
    assert "taken" not in keys
    words = {word.casefold() for word in reserved}
    for name, value in found.accepted.items():
        assert value[0] in first
        assert set(value) <= set(rest)
        assert len(value) <= (longest or 10**6)
        assert value.casefold() not in words
        assert found[name] == value


@pytest.mark.heavy
def test_many_names_that_become_alike_are_numbered_at_once() -> None:
    with at_most(30_000_000):
        names = NameMap.of("%" * count for count in range(1, 3000))
    assert len(set(names.accepted.values())) == 2999


def test_all_changed_inputs_are_shown_and_other_names_are_counted() -> None:
    assert changes_text({}, []) == ""
    changed = {f"x {k}": f"x_{k}" for k in range(14)}
    text = changes_text(changed, ["x 13"])
    assert text.startswith("names were changed: 'x 13' is x_13, 'x 0' is x_0, ")
    assert text.endswith(", 'x 10' is x_10, and 2 more")
    text = changes_text({**changed, "low %": "low"}, changed)
    assert text.startswith("names were changed: 'x 0' is x_0, 'x 1' is x_1, ")
    assert text.endswith(", 'x 13' is x_13, and 1 more")

"""Options of writers are read from their signatures and docstrings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import pytest
from msgspec.structs import replace

from fuzzytree.exporters.table import all_formats, find_format
from fuzzytree.model.contracts import Model, Written
from fuzzytree.model.options import check_options, option_value, options_of


def _write(
    model: Model,
    /,
    *,
    allow_loss: bool = False,
    dialect: Literal["north", "south"] = "north",
    tolerance: float = 1e-6,
    count: int | None = None,
    names: Sequence[str] = (),
    verbose: bool = False,
    title: str = "",
) -> Written:
    """Write nothing.

    Args:
        model: The model.
        allow_loss: Whatever.
        dialect: Of the file,
            in two lines.
        tolerance: The largest error.

    Returns:
        Nothing.
    """
    return Written(b"")


FORM = replace(find_format("yaml"), name="turtle", write=_write)


def test_options_are_listed_with_defaults_choices_and_help() -> None:
    found = options_of(FORM)
    names = ["dialect", "tolerance", "count", "names", "verbose", "title"]
    assert [one.name for one in found] == names
    assert found[0].choices == ("north", "south")
    assert (found[0].default, found[1].default) == ("north", 1e-6)
    assert found[0].help == "Of the file, in two lines."
    assert found[2].help == ""


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("dialect", "south", "south"),
        ("tolerance", "1e-3", 1e-3),
        ("count", "12", 12),
        ("count", "none", None),
        ("names", "a, b,", ("a", "b")),
        ("verbose", "YES", True),
        ("verbose", "0", False),
        ("title", "none at all", "none at all"),
    ],
)
def test_a_text_becomes_what_the_writer_wants(
    name: str, text: str, value: object
) -> None:
    assert option_value(FORM, name, text) == value


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "dialect",
            "soth",
            "dialect: must be north, south (did you mean 'south'?), not 'soth'",
        ),
        ("tolerance", "small", "tolerance: must be a number, not 'small'"),
        ("count", "1.5", "count: must be a whole number, not '1.5'"),
        ("verbose", "maybe", "verbose: must be yes or no, not 'maybe'"),
        (
            "dialct",
            "north",
            "turtle has no option 'dialct'; it has dialect, tolerance, count, names, "
            "verbose, title (did you mean 'dialect'?)",
        ),
        (
            "allow_loss",
            "yes",
            "turtle has no option 'allow_loss'; it has dialect, tolerance, count, "
            "names, verbose, title",
        ),
    ],
)
def test_a_text_that_means_nothing_is_one_sentence(
    name: str, text: str, message: str
) -> None:
    with pytest.raises(ValueError, match=r"must be|has no option") as caught:
        option_value(FORM, name, text)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("dialect", "soth", "must be north, south (did you mean 'south'?), not 'soth'"),
        ("tolerance", "1e-3", "must be a number, not '1e-3'"),
        ("tolerance", None, "must be a number, not None"),
        ("tolerance", True, "must be a number, not True"),
        ("count", 1.5, "must be a whole number, not 1.5"),
        ("names", "one", "must be a list, not 'one'"),
        ("verbose", "yes", "must be True or False, not 'yes'"),
        ("title", 3, "must be a text, not 3"),
    ],
)
def test_a_value_that_no_option_can_have_is_one_sentence(
    name: str, value: object, message: str
) -> None:
    with pytest.raises(ValueError, match="must be") as caught:
        check_options(FORM, {name: value})
    assert str(caught.value) == f"{name}: {message}"


def test_values_of_the_right_type_are_taken() -> None:
    check_options(FORM, {"dialect": "south", "tolerance": 1, "count": None})
    check_options(FORM, {"names": ["a"], "verbose": True, "title": "a"})


def test_every_option_of_every_format_has_help_and_takes_its_default() -> None:
    for form in all_formats():
        for one in options_of(form):
            assert one.help, (form.name, one.name)
            check_options(form, {one.name: one.default})
            for choice in one.choices:
                assert str(option_value(form, one.name, choice)) == choice

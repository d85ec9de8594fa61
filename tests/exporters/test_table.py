"""The table of formats: names, suffixes, and formats that other packages offer."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fuzzytree.exporters.table import TABLE, all_formats, find_format


def test_every_format_has_the_name_and_the_suffixes_of_its_line() -> None:
    for form, (name, suffixes) in zip(all_formats(), TABLE.items(), strict=True):
        assert (form.name, form.suffixes) == (name, suffixes)


def test_no_two_formats_share_a_suffix() -> None:
    every = [suffix for suffixes in TABLE.values() for suffix in suffixes]
    assert len(every) == len(set(every))
    assert all(suffix.startswith(".") for suffix in every)
    assert every == [suffix.lower() for suffix in every]


@pytest.mark.parametrize("name", TABLE)
def test_a_format_is_found_by_its_name_and_suffixes(name: str) -> None:
    for wanted in (name, *TABLE[name], *(one.upper() for one in TABLE[name])):
        assert find_format(wanted).name == name


def test_a_suffix_loads_its_own_format_alone() -> None:
    code = (
        "import sys\nfrom fuzzytree.exporters import find_format\n"
        "find_format('.yaml')\n"
        "known = {m.split('.')[2] for m in sys.modules "
        "if m.startswith('fuzzytree.exporters.')}\n"
        "assert all(name.startswith(('yaml', 'table')) for name in known), known\n"
        "assert not {'onnx', 'importlib.metadata'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], text=True, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("wanted", "hint"),
    [
        ("yml", " (did you mean 'yaml'?)"),
        ("js", " (did you mean 'javascript'?)"),
        (".yalm", " (did you mean '.yaml'?)"),
    ],
)
def test_an_unknown_format_is_reported_with_the_nearest(wanted: str, hint: str) -> None:
    with pytest.raises(ValueError, match="no format") as caught:
        find_format(wanted)
    known = ", ".join(TABLE)
    assert str(caught.value) == f"no format {wanted!r}; there is {known}{hint}"

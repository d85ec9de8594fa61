"""`fuzzytree explain` explains codes and lists them."""

from __future__ import annotations

import json

import pytest

from fuzzytree.auditing.findings.codes import CODES
from tests.cli.conftest import Call


@pytest.mark.parametrize("name", ["FT101", "ft101", "FT101-1a2b3c4d-2"])
def test_a_code_is_explained_by_its_name_or_by_an_id(call: Call, name: str) -> None:
    code, out, err = call("explain", name)
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "FT101  dead rule (error)"
    assert CODES["FT101"].remedy.split(";")[0] in " ".join(out.split())


def test_without_a_code_all_are_listed(call: Call) -> None:
    code, out, _ = call("explain", "--verbose")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[2:]] == [*CODES]
    code, out, _ = call("explain")
    assert code == 0
    findings = [name for name in CODES if not name.startswith("FTD")]
    assert [line.split()[0] for line in out.splitlines()[2:]] == [*findings, "FTD.."]


@pytest.mark.parametrize(
    ("begin", "codes"),
    [("FT2", ["FT201", "FT202", "FT203", "FT204", "FT205"]), ("ft70", ["FT701"])],
)
def test_how_codes_begin_lists_them(call: Call, begin: str, codes: list[str]) -> None:
    code, out, err = call("explain", begin)
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()[2:]] == codes
    found = json.loads(call("explain", begin, "--json")[1])
    assert [one["code"] for one in found] == codes


def test_programs_get_the_same(call: Call) -> None:
    found = json.loads(call("explain", "--json")[1])
    assert [one["code"] for one in found] == [*CODES]
    assert json.loads(call("explain", "FT301", "--json")[1])["title"] == "coverage gap"


def test_an_unknown_code_is_one_sentence(call: Call) -> None:
    code, out, err = call("explain", "FT1O1")
    assert (code, out) == (2, "")
    assert err.startswith("no code 'FT1O1'; there is FT101, ")
    assert "(did you mean 'FT101'?)" in err


def test_a_long_word_is_not_printed_whole(call: Call) -> None:
    code, out, err = call("explain", "x" * 5000)
    assert (code, out) == (2, "")
    assert len(err) < 300

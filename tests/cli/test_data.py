"""The verbs that take rows of one's own read them alike."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Call

VERBS = (
    ("check", "grip.yaml", "--generate", "50", "--runtime", "native"),
    ("stability", "grip.yaml", "--select", "N3", "--runtime", "native"),
    ("needs", "grip.yaml"),
    ("bench", "grip.yaml", "--rows", "2", "--budget", "5", "--select", "native"),
)
verbs = pytest.mark.parametrize("words", VERBS, ids=lambda words: words[0])


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


@verbs
def test_a_table_without_rows_is_refused(call: Call, words: tuple[str, ...]) -> None:
    Path("none.csv").write_text("slip,force\n", "utf-8")
    message = "none.csv has no rows\n"
    assert call(*words, "--data", "none.csv") == (2, "", message)
    message = "the table has no rows\n"
    found = call(*words, "--data", "-", stdin=b"slip,force\n")
    assert found == (2, "", message)


@verbs
def test_the_delimiter_can_be_reported_where_a_message_names_it(
    call: Call, words: tuple[str, ...]
) -> None:
    Path("odd.csv").write_text('slip;force;"a";b,c\n0;1.5;x;y\n', "utf-8")
    code, out, err = call(*words, "--data", "odd.csv")
    assert (code, out) == (2, "")
    assert err == (
        "odd.csv:1: both ',' and ';' stand between names; say which one is the "
        "delimiter (--delimiter)\n"
    )
    assert call(*words, "--data", "odd.csv", "--delimiter", ";")[0] == 0


def test_needs_refuses_a_place_within_a_file_before_any_work(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.benchmarking.savings.report", None)
    Path("file").touch()
    message = "file/left.yaml: cannot be written: 'file' is not a folder\n"
    assert call("needs", "grip.yaml", "-o", "file/left.yaml") == (2, "", message)

"""A configuration and a baseline are read whole, or refused with all their mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.configuration import (
    Configuration,
    LimitsOfFile,
    SettingsOfFile,
    configuration,
    read_configuration,
)
from fuzzytree.auditing.findings.records import Audit, AuditSelection, AuditSettings
from fuzzytree.auditing.findings.results import (
    baseline_of,
    obsolete_ids,
    read_baseline,
)
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.errors import ReadError
from tests.cli.conftest import grip

WHOLE = b"""\
select: [FT1, FT301]
skip: [FT103]
limits:
- {variable: force, from: 1, to: 5.5}
settings: {epsilon: 0.2, budget: 120, rows: 10}
baseline: accepted.json
fail-on: error
"""


def test_a_whole_configuration_is_read() -> None:
    whole = configuration(WHOLE, "x.yaml")
    assert whole == Configuration(
        select=("FT1", "FT301"),
        skip=("FT103",),
        limits=(LimitsOfFile(variable="force", from_=1.0, to=5.5),),
        settings=SettingsOfFile(epsilon=0.2, budget=120.0, rows=10),
        baseline="accepted.json",
        fail_on="error",
    )
    settings = AuditSettings(epsilon=0.2, budget=120.0, rows=10)
    assert whole.audit_settings == settings


def test_an_empty_mapping_changes_nothing() -> None:
    assert configuration(b"{}", "x.yaml") == Configuration()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"skpi: [FT1]\nfail-on: waring\n",
            "x.yaml:1:1: a configuration has no key 'skpi'; there is select, skip, "
            "limits, settings, baseline, fail-on (did you mean 'skip'?)\n"
            "x.yaml:2:10: 'fail-on' must be 'error' or 'info' or 'never' or 'warning', "
            "not 'waring'",
        ),
        (
            b"limits: [{variable: a, from: 1, to: x}]\n",
            "x.yaml:1:37: 'to' must be a number, not 'x'",
        ),
        (
            b"settings: {epsilon: 2, budget: 0}\n",
            "x.yaml:1:21: epsilon must be above 0 and at most 1, not 2.0\n"
            "x.yaml:1:32: budget must be above 0 and at most 1e9 million steps, "
            "not 0.0",
        ),
        (
            b"limits:\n"
            b"- {variable: a, from: .inf, to: 1}\n"
            b"- {variable: b, from: 2, to: 1}\n"
            b"- {variable: a, from: 0, to: 1}\n",
            "x.yaml:2:3: limits must be finite, not inf to 1.0\n"
            "x.yaml:3:3: limits are swapped: 2.0 to 1.0; the smaller one stands first\n"
            "x.yaml:4:3: 'a' has limits already",
        ),
        (b"[1]", "x.yaml:1:1: a configuration must be a mapping, not a list"),
        (b"", "x.yaml:1:1: the file is empty"),
        (
            b"a: &x 1\nb: *x\n",
            "x.yaml:1:1: a configuration has no key 'a'; there is select, skip, "
            "limits, settings, baseline, fail-on\n"
            "x.yaml:1:4: anchors are not read; leave out '&x'\n"
            "x.yaml:2:1: a configuration has no key 'b'; there is select, skip, "
            "limits, settings, baseline, fail-on\n"
            "x.yaml:2:4: aliases are not read; repeat the value",
        ),
    ],
    ids=["keys", "number", "settings", "limits", "list", "empty", "aliases"],
)
def test_mistakes_are_reported_with_their_places(content: bytes, message: str) -> None:
    with pytest.raises(ReadError) as caught:
        configuration(content, "x.yaml")
    assert str(caught.value) == message


def test_an_unknown_code_is_reported_with_its_place() -> None:
    with pytest.raises(ReadError, match=r"^x.yaml:1:15: no code begins with 'FT99'; "):
        configuration(b"select: [FT1, FT99]", "x.yaml")


def test_a_configuration_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    with pytest.raises(ReadError) as caught:
        read_configuration(path)
    assert str(caught.value) == f"{path}: cannot be read: no such file or directory"


def test_a_baseline_lies_beside_the_file_that_names_it(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("baseline: known/b.json", "utf-8")
    assert read_configuration(path).baseline == str(tmp_path / "known" / "b.json")


# --- baselines


def far() -> Audit:
    """Return an audit with one finding."""
    box = Domain((DomainSide("force", 3.0, 5.0), DomainSide("slip", 0.0, 1.0)))
    return audit(
        Material(grip()), domain=box, selection=AuditSelection(select=["FT101"])
    )


def test_a_baseline_that_was_written_is_read_and_accepts_all(tmp_path: Path) -> None:
    found = far()
    path = tmp_path / "accepted.json"
    path.write_bytes(baseline_of(found))
    (one,) = found.findings
    assert read_baseline(path) == {one.id: one.sentence}
    assert not [*obsolete_ids(read_baseline(path), found)]


def test_accepted_findings_that_are_gone_are_reported_for_codes_that_were_run() -> None:
    known = {"FT101-00000000": "a", "FT501-00000000": "not run here"}
    assert [*obsolete_ids(known, far())] == ["FT101-00000000"]


def test_of_a_code_that_was_cut_short_nothing_is_said_to_be_gone() -> None:
    cut = replace(far(), unasked=("FT101 dead rule: cut short: interrupted",))
    assert not [*obsolete_ids({"FT101-00000000": "a"}, cut)]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "Input data was truncated"),
        (b"[]", "Expected 'object', got 'array'"),
        (b'{"format": "x", "accepted": {}}', "Invalid enum value 'x' - at '$.format'"),
        (
            b'{"format": "fuzzytree-baseline/1", "accepted": {"FT1": "x"}}',
            "'FT1' is no id of a finding",
        ),
        (
            b'{"format": "fuzzytree-baseline/1", "accepted": {}, "more": 1}',
            "Object contains unknown field 'more'",
        ),
        (b"\xff", "JSON is malformed: invalid character (byte 0)"),
        (b"[" * 100_000, "Expected 'object', got 'array'"),
        (b'{"a": ' * 100_000, "Object contains unknown field 'a'"),
    ],
    ids=["empty", "list", "format", "id", "key", "bytes", "deep", "deep objects"],
)
def test_a_file_that_is_no_baseline_is_one_sentence(
    content: bytes, what: str, tmp_path: Path
) -> None:
    path = tmp_path / "b.json"
    path.write_bytes(content)
    with pytest.raises(ReadError) as caught:
        read_baseline(path)
    lead = f"{path}: is no baseline that --write-baseline wrote: "
    assert str(caught.value) == lead + what

"""`fuzzytree formats` and `fuzzytree doctor` list what is installed."""

from __future__ import annotations

import functools
import importlib.metadata
import json
import sys
from base64 import urlsafe_b64encode
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

import fuzzytree
from fuzzytree.checking.abilities import Ability, abilities_of
from fuzzytree.cli.doctor import installation_faults
from fuzzytree.exporters.table import TABLE, all_formats, find_format
from fuzzytree.runtimes.predictions import Predictions
from fuzzytree.runtimes.table import all_runtimes
from tests.cli.conftest import Call


@functools.cache
def abilities_of_yaml() -> tuple[Ability, ...]:
    return abilities_of(find_format("yaml"))


@pytest.fixture(autouse=True)
def _one_format_is_tried_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "fuzzytree.checking.abilities.abilities_of",
        lambda *_, **__: abilities_of_yaml(),
    )


def _without(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    real = importlib.metadata.version

    def version(name: str) -> str:
        if name == package:
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(importlib.metadata, "version", version)


def test_every_format_and_runtime_is_listed(call: Call) -> None:
    code, out, err = call("formats", "--verbose")
    assert (code, err) == (0, "")
    starts = [line.split("  ")[0] for line in out.splitlines()]
    known = [(one.name, one.cannot) for one in all_formats()]
    known += [(one.name, one.cannot) for one in all_runtimes()]
    for name, cannot in known:
        assert name in starts
        for limit in cannot:
            assert f"  {name}: {limit}" in out.splitlines()


def test_equal_bits_are_promised_only_where_they_are_kept(call: Call) -> None:
    lines = call("formats", "--verbose")[1].splitlines()
    promises = {line.split("  ")[0]: " ".join(line.split()) for line in lines}
    assert " equal bits -" in promises["native"]
    assert " within a derived bound -" in promises["native mixed"]
    assert " equal bits with native float32 -" in promises["c float32"]
    assert "systems with exp, powers and the like agree within a derived bound" in lines


def test_formats_have_the_facts_as_json(call: Call) -> None:
    facts = json.loads(call("formats", "--json")[1])
    assert [one["name"] for one in facts["formats"]] == [*TABLE]
    assert all(one["is_installed"] for one in facts["runtimes"])


def test_a_missing_extra_is_marked(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    _without(monkeypatch, "onnxruntime")
    assert "onnx (not installed)" in call("formats")[1]


def test_the_doctor_reports_versions_and_tries_everything(call: Call) -> None:
    code, out, err = call("doctor")
    assert (code, err) == (0, "")
    said = "self-test passed: learning, writing, reading and running agree"
    assert out.splitlines()[0] == said
    assert out.splitlines()[1].startswith(f"fuzzytree {fuzzytree.__version__}, Python ")
    assert f"numpy {np.__version__}," in " ".join(out.split())
    assert "selenium" not in out
    assert "selenium" in call("doctor", "--verbose")[1]


def test_the_doctor_reports_how_to_install_what_is_missing(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    _without(monkeypatch, "onnxruntime")
    code, out, _ = call("doctor")
    assert code == 0
    assert (
        "extra 'onnx' is not installed; it needs onnx and onnxruntime: "
        "pip install 'onnx>=1.16' 'onnxruntime>=1.18'\n"
    ) in out


def test_a_failed_self_test_is_exit_one(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Predictions, "classes", property(lambda _: ["other"]))
    code, out, _ = call("doctor", "--json")
    assert code == 1
    assert json.loads(out)["faults"] == ["the tree answers other classes"]


def _installed(site: Path, name: str, files: dict[str, bytes]) -> None:
    """Write the metadata of a distribution with some files, and no file itself."""
    lines = [
        f"{file},sha256={urlsafe_b64encode(sha256(content).digest()).decode()[:-1]},"
        for file, content in files.items()
    ]
    info = site / f"{name.replace('-', '_')}-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Name: {name}\nVersion: 0.1\nRequires-Dist: numpy", "utf-8"
    )
    (info / "RECORD").write_text("\n".join(lines), "utf-8")


def test_the_doctor_names_what_overwrites_or_removes_the_package(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = {
        "fuzzytree/__init__.py": b"ours",
        "fuzzytree/cli/__init__.py": b"",
        "fuzzytree/gone.py": b"ours",
    }
    _installed(tmp_path, "fuzzytree-toolkit", own)
    _installed(tmp_path, "fuzzytree", {"fuzzytree/__init__.py": b"theirs"})
    _installed(tmp_path, "other", {"other/fuzzytree/__init__.py": b""})
    (tmp_path / "fuzzytree" / "cli").mkdir(parents=True)
    (tmp_path / "fuzzytree" / "cli" / "__init__.py").touch()
    (tmp_path / "fuzzytree" / "__init__.py").write_bytes(b"theirs")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    again = "install fuzzytree-toolkit again with pip install --force-reinstall"
    faults = [
        "the distribution 'fuzzytree' has a package named fuzzytree, too: "
        f"pip uninstall fuzzytree, then {again}",
        f"fuzzytree/__init__.py, fuzzytree/gone.py: changed or missing; {again}",
    ]
    assert sorted(installation_faults()) == sorted(faults)
    monkeypatch.setattr("fuzzytree.cli.doctor.self_test", lambda _: [])
    code, out, _ = call("doctor")
    assert code == 1
    assert {*out.splitlines()} >= {f"installation: {fault}" for fault in faults}
    assert sorted(json.loads(call("doctor", "--json")[1])["faults"]) == sorted(faults)

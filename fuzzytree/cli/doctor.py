"""`fuzzytree doctor`: what is installed, and whether it works."""

from __future__ import annotations

import base64
import hashlib
import importlib.metadata
import platform
from pathlib import Path

import click

from fuzzytree.cli.console import (
    answer,
    answer_json,
    json_option,
    takes,
    verbose_option,
)
from fuzzytree.errors import (
    FuzzyTreeError,
    install_hint,
    package_name,
    requirements,
)
from fuzzytree.model import version

ABSENT = "not installed"

NEEDED = "needed"
"""What the packages are called that are always there."""

FOR_TESTS = ("witnesses", "peers")
"""The extras that only the test suite and the benchmarks use."""

_COLLECTIONS = (
    "all",
    "dev",
    "docs",
)  # extras of other extras, and of the docs


def packages() -> dict[str, list[str]]:
    """Return the packages of each extra; `""` has those that are always needed."""
    return {
        extra: [*map(package_name, needed)]
        for extra, needed in requirements().items()
        if extra not in _COLLECTIONS
    }


def missing_extras() -> set[str]:
    """Return the extras of which a package is not installed."""
    return {
        extra
        for extra, names in packages().items()
        if any(_version(name) == ABSENT for name in names)
    }


class DoctorOptions:
    """The arguments and options of the verb."""

    verbose: bool = verbose_option
    as_json: bool = json_option


@click.command("doctor", short_help="Report what is installed and whether it works.")
@takes(DoctorOptions)
def command(options: DoctorOptions) -> int:
    """Report versions and extras; learn, write, read and run a small model.

    Exit 1 if the small model fails, or if another distribution has changed or removed
    files of the package. The extras that only the test suite and the
    benchmarks use are listed by `--verbose`.
    """
    known = packages()
    versions = {
        "fuzzytree": version(),
        "python": platform.python_version(),
        **{name: _version(name) for names in known.values() for name in names},
    }
    missing = sorted(missing_extras())
    faults, mixture = self_test("onnx" not in missing), installation_faults()
    code = 1 if faults or mixture else 0
    if options.as_json:
        faults += mixture
        answer_json({"versions": versions, "missing": missing, "faults": faults})
        return code
    for fault in mixture:
        answer(f"installation: {fault}")
    for fault in faults:
        answer(f"self-test failed: {fault}")
    if not faults:
        answer("self-test passed: learning, writing, reading and running agree")
    answer(f"fuzzytree {version()}, Python {platform.python_version()}")
    shown = [extra for extra in known if options.verbose or extra not in FOR_TESTS]
    table = click.HelpFormatter(width=88)
    table.write_dl(
        [
            (extra or NEEDED, ", ".join(f"{name} {versions[name]}" for name in there))
            for extra in shown
            if (there := [one for one in known[extra] if versions[one] != ABSENT])
        ]
    )
    answer(table.getvalue().rstrip())
    for extra in missing:
        if extra in shown:
            answer(f"extra {extra!r} is not installed; it needs {install_hint(extra)}")
    return code


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ABSENT


def installation_faults() -> list[str]:
    """Return what another distribution of the same import name does to the package.

    pip writes its files over ours, and removes them when one of the two is removed.
    """
    own, again = "fuzzytree-toolkit", "again with pip install --force-reinstall"
    faults: list[str] = []
    for package in importlib.metadata.distributions():
        if "\nfuzzytree/__init__.py," not in f"\n{package.read_text('RECORD')}":
            continue
        name = package.metadata["Name"]
        if name != own:
            faults.append(
                f"the distribution {name!r} has a package named fuzzytree, too: pip "
                f"uninstall {name}, then install {own} {again}"
            )
            continue
        files = [file for file in package.files or () if file.parts[0] == "fuzzytree"]
        broken = [str(file) for file in files if not _is_intact(file)]
        if broken:
            text = ", ".join(broken[:3])
            faults.append(f"{text}: changed or missing; install {own} {again}")
    return faults


def _is_intact(file: importlib.metadata.PackagePath) -> bool:
    path = Path(str(file.locate()))
    digest = hashlib.sha256(path.read_bytes()).digest() if path.is_file() else b""
    text = base64.urlsafe_b64encode(digest).decode().rstrip("=")
    return file.hash is None or file.hash.value == text


def self_test(has_onnx: bool) -> list[str]:
    """Take a small table through learning, YAML, native and, if there, ONNX."""
    import numpy as np

    from fuzzytree import api
    from fuzzytree.formats import read_yaml
    from fuzzytree.runtimes import Predictions

    table = np.array([[k, k % 3] for k in range(12)], np.float64)
    classes = ["low"] * 6 + ["high"] * 6
    try:
        tree = api.learn(table, target=classes)
        content = api.export(tree, "yaml").content
        again = read_yaml(content, "self-test").model
        answers = api.run(again, table)
        found = answers.classes if isinstance(answers, Predictions) else []
        faults = [] if again == tree else ["YAML does not give the tree back"]
        faults += [] if found == classes else ["the tree answers other classes"]
        if has_onnx:
            onnx = api.run(api.export(tree, "onnx").content, table)
            same = isinstance(onnx, Predictions) and onnx.classes == found
            faults += [] if same else ["ONNX answers other classes"]
    except FuzzyTreeError as error:
        return [str(error)]
    return faults

"""Print what changed between two models, and write it as SARIF for a code host.

`python examples/diff_sarif.py OLD NEW FILE` exits as `fuzzytree diff` does: 1 if a
decision changes or if programs that call the model must change. The GitHub Action of
this project, `action.yml`, calls it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import fuzzytree as ft
from fuzzytree.auditing import Difference, FileLocation
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.files import write_atomically
from fuzzytree.report import diff_lines

LEVELS = {"error": "error", "warning": "warning", "info": "note"}
TITLES = {"FT801": "a decision changes", "FT802": "the model changes"}


def sarif(difference: Difference) -> str:
    """Return the differing decisions and the changes as SARIF 2.1.0."""
    results = [
        _result(difference, answer.code, LEVELS[answer.severity], answer.sentence)
        for answer in difference.answers
        if answer.is_finding
    ]
    for change in difference.changes:
        level = "error" if change.grade == "breaking" else "note"
        text = f"{change.grade}: {change.sentence}"
        results.append(_result(difference, change.code, level, text, change.new))
    rules = [
        {"id": code, "shortDescription": {"text": title}}
        for code, title in TITLES.items()
    ]
    driver = {"name": "fuzzytree", "version": difference.version, "rules": rules}
    run = {"tool": {"driver": driver}, "results": results}
    return json.dumps({"version": "2.1.0", "runs": [run]}, indent=2)


def _result(
    difference: Difference,
    code: str,
    level: str,
    text: str,
    place: FileLocation | None = None,
) -> dict[str, object]:
    file = difference.new.file
    name = place.file if place else file.name if file else difference.new.name
    where: dict[str, object] = {"artifactLocation": {"uri": Path(name).as_posix()}}
    if place:
        where["region"] = {"startLine": place.line, "startColumn": place.column}
    return {
        "ruleId": code,
        "level": level,
        "message": {"text": text},
        "locations": [{"physicalLocation": where}],
    }


def main(old: str, new: str, file: str) -> int:
    """Compare two files, print the difference and write it; return the exit code."""
    try:
        difference = ft.diff(old, new)
        print("\n".join(diff_lines(difference)))
        write_atomically(file, f"{sarif(difference)}\n".encode())
    except FuzzyTreeError as error:
        print(error, file=sys.stderr)
        return 2
    return 0 if difference.ok else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]) if len(sys.argv) == 4 else __doc__)

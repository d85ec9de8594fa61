"""The JSON Schemas of what `--json` prints, from the records of each result.

`python -m fuzzytree.report.schemas` rewrites their files among `fuzzytree.schemas`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Final, get_args

from fuzzytree.auditing.diff.difference_records import Difference, Verdict
from fuzzytree.checking.stability.results import Stability
from fuzzytree.model.agreement import Agreement
from fuzzytree.schemas.generation import Json, of_result, record

FILES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "audit.schema.json": "fuzzytree.auditing.findings.records:Audit",
        "bench.schema.json": "fuzzytree.benchmarking.records:Study",
        "check.schema.json": "fuzzytree.model.agreement:Agreement",
        "diff.schema.json": "fuzzytree.auditing.diff.difference_records:Difference",
        "learn.schema.json": "fuzzytree.api.holdout:Summary",
        "needs.schema.json": "fuzzytree.benchmarking.savings:Report",
        "stability.schema.json": "fuzzytree.checking.stability.results:Stability",
    }
)
"""Each file's name and the record that it describes, as MODULE:CLASS."""

_OK: Mapping[str, Json] = {"ok": {"type": "boolean"}}
"""What `to_json` writes before the fields of a record that has a verdict."""


def generate(name: str) -> bytes:
    """Return the JSON Schema (draft 2020-12) of a name in `FILES`.

    Example:
        >>> b'"title": "Error against run time' in generate("bench.schema.json")
        True
    """
    kind = record(FILES[name])
    added: dict[str, Json] = {}
    if issubclass(kind, Agreement | Stability):
        added |= {"format": {"const": kind.FORMAT}, "version": {"type": "string"}}
    if hasattr(kind, "ok"):
        added |= _OK
    if kind is Difference:
        added["verdict"] = {"enum": [*get_args(Verdict)]}
    return of_result(kind, **added)


if __name__ == "__main__":
    folder = Path(str(files("fuzzytree.schemas")))
    for name in FILES:
        (folder / name).write_bytes(generate(name))

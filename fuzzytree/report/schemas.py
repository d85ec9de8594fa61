"""The JSON Schemas of what `--json` prints, from the records of each result.

`python -m fuzzytree.report.schemas` rewrites their files among `fuzzytree.schemas`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Final, get_args

import msgspec

from fuzzytree.agreement import Agreement
from fuzzytree.auditing.difference_records import Difference, Verdict
from fuzzytree.auditing.records import Audit
from fuzzytree.criteria.results import Stability
from fuzzytree.holdout import Summary
from fuzzytree.recognition.experiment import Study as Experiment
from fuzzytree.recognition.timing import FramesStudy
from fuzzytree.savings import Report
from fuzzytree.schemas.generation import Json, of_result
from fuzzytree.timing.records import Study

FILES: Final[Mapping[str, type[msgspec.Struct]]] = MappingProxyType(
    {
        "audit.schema.json": Audit,
        "bench.schema.json": Study,
        "check.schema.json": Agreement,
        "diff.schema.json": Difference,
        "experiment.schema.json": Experiment,
        "learn.schema.json": Summary,
        "needs.schema.json": Report,
        "stability.schema.json": Stability,
        "tactile-bench.schema.json": FramesStudy,
    }
)
"""Each file's name and the record that it describes."""

_OK: Mapping[str, Json] = {"ok": {"type": "boolean"}}
"""What `to_json` writes before the fields of a record that has a verdict."""


def generate(name: str) -> bytes:
    """Return the JSON Schema (draft 2020-12) of a name in `FILES`.

    Example:
        >>> b'"title": "Error against run time' in generate("bench.schema.json")
        True
    """
    kind = FILES[name]
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

"""The JSON Schema of a study of run times.

`python -m fuzzytree.timing.schema` rewrites `schemas/bench.schema.json`.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from fuzzytree.schemas.generation import of_result
from fuzzytree.timing.records import Study

FILE = "bench.schema.json"


def generate() -> bytes:
    """Return the JSON Schema of what `Study.to_json` writes."""
    return of_result(Study)


if __name__ == "__main__":
    (Path(str(files("fuzzytree.schemas"))) / FILE).write_bytes(generate())

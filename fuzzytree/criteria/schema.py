"""The JSON Schema of a stability study.

`python -m fuzzytree.criteria.schema` rewrites `schemas/stability.schema.json`.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from fuzzytree.criteria.results import Stability
from fuzzytree.schemas.generation import of_result

FILE = "stability.schema.json"


def generate() -> bytes:
    """Return the JSON Schema of what `Stability.to_json` writes."""
    return of_result(Stability, ok={"type": "boolean"})


if __name__ == "__main__":
    (Path(str(files("fuzzytree.schemas"))) / FILE).write_bytes(generate())

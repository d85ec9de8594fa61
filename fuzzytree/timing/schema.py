"""The JSON Schema of a study, from the records that it is made of.

`python -m fuzzytree.timing.schema` rewrites `schemas/bench.schema.json`.
"""

from __future__ import annotations

import inspect
import json
from importlib.resources import files
from pathlib import Path

import msgspec

from fuzzytree.timing.records import Study

FILE = "bench.schema.json"

Json = dict[str, "Json"] | list["Json"] | str | float | int | bool | None


def generate() -> bytes:
    """Return the JSON Schema (draft 2020-12) of what `Study.to_json` writes.

    Example:
        >>> json.loads(generate())["title"]
        'Error against run time for one model.'
    """
    found: dict[str, dict[str, dict[str, Json]]] = msgspec.json.schema(Study)
    definitions = found["$defs"]
    for one in definitions.values():
        # Everything is always written, and nothing else.
        properties = one["properties"]
        one["required"] = [*properties] if isinstance(properties, dict) else []
        one["additionalProperties"] = False
        one["description"] = inspect.cleandoc(str(one["description"]))
    whole = definitions.pop(Study.__name__)
    text = str(whole.pop("description"))
    head: dict[str, Json] = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **whole,
        "title": text.partition("\n")[0],
        "description": text,
        "$defs": {name: definitions[name] for name in sorted(definitions)},
    }
    return (json.dumps(head, indent=2, ensure_ascii=False) + "\n").encode()


if __name__ == "__main__":
    (Path(str(files("fuzzytree.schemas"))) / FILE).write_bytes(generate())

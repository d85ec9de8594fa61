"""The JSON Schemas of YAML files and of what `--json` prints, from their records.

`python -m fuzzytree.schemas.generation` rewrites the files beside this module.
"""

from __future__ import annotations

import importlib
import inspect as python
import json
import re
import typing
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Final

import msgspec
from msgspec import inspect

from fuzzytree.formats import FileRecord

FILES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "audit.schema.json": "fuzzytree.auditing.findings.records:Audit",
        "bench.schema.json": "fuzzytree.benchmarking.records:Study",
        "board.schema.json": "fuzzytree.tactile.board_file:BoardFile",
        "check-trees.schema.json": "fuzzytree.model.agreement:TreeAgreement",
        "check.schema.json": "fuzzytree.model.agreement:Agreement",
        "diff.schema.json": "fuzzytree.auditing.diff.records:Difference",
        "learn.schema.json": "fuzzytree.api.holdout:Summary",
        "needs.schema.json": "fuzzytree.benchmarking.savings:Footprint",
        "require.schema.json": "fuzzytree.auditing.require.claims:Compliance",
        "requirements.schema.json": (
            "fuzzytree.auditing.require.phrases:RequirementsFile"
        ),
        "rulebase.schema.json": "fuzzytree.formats.yaml.layout:RuleBaseFile",
        "stability.schema.json": "fuzzytree.checking.stability.results:Stability",
        "system.schema.json": "fuzzytree.formats.yaml.layout:SystemFile",
        "tree.schema.json": "fuzzytree.formats.yaml.layout:TreeFile",
        "why.schema.json": "fuzzytree.auditing.explanation.records:Explanation",
    }
)
"""Each file's name and the record that it describes, as MODULE:CLASS."""

_DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
_REFERENCE: Final = re.compile(r"[,;]?\s+(?:\(|see\s+)`fuzzytree\.[\w.]+`\)?")

Json = dict[str, "Json"] | list["Json"] | str | float | int | bool | None
Definitions = dict[str, Json]


def generate(name: str) -> bytes:
    """Return the JSON Schema (draft 2020-12) of a name in `FILES`.

    Example:
        >>> json.loads(generate("tree.schema.json"))["title"]
        'A fuzzy decision tree of fuzzytree.'
    """
    kind = _record(FILES[name])
    return _text(_of_file(kind)) if issubclass(kind, FileRecord) else of_result(kind)


def write_all(folder: Path) -> None:
    """Write every schema into a folder."""
    for name in FILES:
        (folder / name).write_bytes(generate(name))


def _record(name: str) -> type[msgspec.Struct]:
    module, _, kind = name.partition(":")
    found: type[msgspec.Struct] = getattr(importlib.import_module(module), kind)
    return found


def _of_file(kind: type[FileRecord]) -> Definitions:
    definitions: Definitions = {}
    _define(kind, definitions)
    whole = definitions.pop(kind.__name__)
    head: Definitions = {
        "$schema": _DRAFT,
        "title": python.cleandoc(kind.__doc__ or "").partition("\n")[0],
    }
    if isinstance(whole, dict):
        del whole["description"]
        head |= whole
    return {**head, "$defs": {key: definitions[key] for key in sorted(definitions)}}


def of_result(kind: type[msgspec.Struct]) -> bytes:
    """Return the JSON Schema (draft 2020-12) of a result as its `to_json` writes it.

    Args:
        kind: The record: every field of it is always written, and nothing else.
    """
    schemas: dict[str, dict[str, Json]] = msgspec.json.schema(kind)["$defs"]
    for name, one in schemas.items():
        properties = one["properties"]
        own = properties if isinstance(properties, dict) else {}
        if name == kind.__name__:
            own = _added(kind) | own
        one["properties"], one["required"] = own, [*own]
        one["additionalProperties"] = False
        text = _REFERENCE.sub("", python.cleandoc(str(one["description"])))
        one["description"] = text
    whole = schemas.pop(kind.__name__)
    title = str(whole["description"]).partition("\n")[0]
    head: Definitions = {"$schema": _DRAFT, **whole, "title": title}
    if schemas:
        head["$defs"] = {name: schemas[name] for name in sorted(schemas)}
    return _text(head)


def _text(schema: Definitions) -> bytes:
    return (json.dumps(schema, indent=2, ensure_ascii=False) + "\n").encode()


def _added(kind: type[msgspec.Struct]) -> Definitions:
    """Return the schemas of what `to_json` writes before the fields of a record."""
    found: Definitions = {}
    if constant := getattr(kind, "FORMAT", None):
        found |= {"format": {"const": constant}, "version": {"type": "string"}}
    if hasattr(kind, "ok"):
        found["ok"] = {"type": "boolean"}
    if isinstance(verdict := getattr(kind, "verdict", None), property):
        known = typing.get_type_hints(verdict.fget)["return"]
        found["verdict"] = {"enum": [*typing.get_args(known)]}
    return found


def _define(kind: type[FileRecord], definitions: Definitions) -> None:
    """Add the definition of a record, and of the records in it."""
    if kind.__name__ in definitions:
        return
    definitions[kind.__name__] = None  # a record in itself would be met again
    info = inspect.type_info(kind)
    fields = info.fields if isinstance(info, inspect.StructType) else ()
    properties: Definitions = {}
    for field in fields:
        one = _schema(field.type, definitions)
        if isinstance(field.default, str | float | int):
            one["default"] = field.default
        properties[field.encode_name] = one
    definition: Definitions = {
        "description": python.cleandoc(kind.__doc__ or ""),
        "type": "object",
        "properties": properties,
        "required": [field.encode_name for field in fields if field.required],
        "additionalProperties": False,
    }
    if kind.forms:
        definition["anyOf"] = [*_forms(kind, list(properties))]
    definitions[kind.__name__] = definition


def _forms(kind: type[FileRecord], keys: list[str]) -> list[Json]:
    """Return what each form needs and forbids."""
    choosable = {key for form in kind.forms for key in (*form.needs, *form.may)}
    free = [key for key in keys if key not in choosable]
    return [
        {
            "required": [*form.needs],
            "propertyNames": {"enum": [*free, *form.needs, *form.may]},
        }
        for form in kind.forms
    ]


def _schema(kind: inspect.Type, definitions: Definitions) -> Definitions:
    match kind:
        case inspect.Metadata():
            extra: Definitions = {**(kind.extra_json_schema or {})}
            return _schema(kind.type, definitions) | extra
        case inspect.UnionType():
            kinds = [one for one in kind.types if not isinstance(one, inspect.NoneType)]
            found: list[Json] = [_schema(one, definitions) for one in kinds]
            return (
                _schema(kinds[0], definitions) if len(kinds) == 1 else {"anyOf": found}
            )
        case inspect.StructType():
            if issubclass(kind.cls, FileRecord):
                _define(kind.cls, definitions)
            return {"$ref": f"#/$defs/{kind.cls.__name__}"}
        case inspect.DictType():
            names = _schema(kind.key_type, definitions)
            numbers = _schema(kind.value_type, definitions)
            return {
                "type": "object",
                "propertyNames": names,
                "additionalProperties": numbers,
            }
        case inspect.VarTupleType():
            item = _schema(kind.item_type, definitions)
            sizes = {"minItems": kind.min_length, "maxItems": kind.max_length}
            return {"type": "array", "items": item, **_limits(sizes)}
        case inspect.StrType():
            sizes = {"minLength": kind.min_length, "maxLength": kind.max_length}
            pattern: Definitions = {"pattern": kind.pattern} if kind.pattern else {}
            return {"type": "string", **_limits(sizes), **pattern}
        case inspect.IntType():
            return {
                "type": "integer",
                **_limits({"minimum": kind.ge, "maximum": kind.le}),
            }
        case inspect.FloatType():
            return {
                "type": "number",
                **_limits({"minimum": kind.ge, "maximum": kind.le}),
            }
        case inspect.LiteralType():
            return {"enum": [*kind.values]}
        case _:
            raise TypeError(f"no rule for {kind}")


def _limits(limits: Mapping[str, float | None]) -> Definitions:
    return {key: limit for key, limit in limits.items() if limit is not None}


if __name__ == "__main__":
    write_all(Path(str(files("fuzzytree.schemas"))))

"""Results of `check` and `stability` for the same model, named in an audit."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterable
from typing import NamedTuple

import msgspec
from msgspec import inspect

from fuzzytree.auditing.findings.locations import writable
from fuzzytree.auditing.findings.records import SourceFile, VerbResult
from fuzzytree.checking import Stability
from fuzzytree.errors import ReadError
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.model import Agreement, Document, fingerprint, version

_MOST_BYTES = 64 * 2**20
_KINDS: dict[str, type[Agreement] | type[Stability]] = {
    kind.FORMAT: kind for kind in (Agreement, Stability)
}


class LoadedResult(NamedTuple):
    """A result of another verb: its summary in an audit, and all of it."""

    result: VerbResult
    record: Agreement | Stability


def read_results(
    paths: Iterable[PathLike], model: Document
) -> tuple[LoadedResult, ...]:
    """Return what `fuzzytree check --json` and `stability --json` wrote of a model.

    Args:
        paths: Their files, at most one of each verb.
        model: The model that they must be about.
    """
    results: dict[str, LoadedResult] = {}
    for path in paths:
        one = _read(path, model)
        verb = one.result.verb
        if verb in results:
            raise ReadError(
                f"{os.fspath(path)}: is a result of {verb}, and so is "
                f"{results[verb].result.file.name}; give one of them"
            )
        results[verb] = one
    return tuple(results.values())


def _read(path: PathLike, model: Document) -> LoadedResult:
    """Return one result; raise ReadError as `read_results` does."""
    name = os.fspath(path)
    content = read_bounded(path, _MOST_BYTES)
    record = _decoded(content, name)
    result = _result(
        record, SourceFile(writable(name), hashlib.sha256(content).hexdigest())
    )
    wanted = fingerprint(model)
    if record.fingerprint != wanted:
        raise ReadError(
            f"{name}: is a result of another model: its fingerprint is "
            f"{record.fingerprint[:12]}..., and that of {model.name[:60]!r} is "
            f"{wanted[:12]}...; run `fuzzytree {result.verb}` again"
        )
    return LoadedResult(result, record)


def _result(record: Agreement | Stability, file: SourceFile) -> VerbResult:
    """Return the summary of a result."""
    if isinstance(record, Stability):
        verdicts = [one.verdict for one in record.criteria]
        return VerbResult("stability", file, len(verdicts), verdicts.count("FAILS"))
    count = len(record.comparisons) + len(record.certificates)
    return VerbResult("check", file, count, len(record.wrong))


def _decoded(content: bytes, name: str) -> Agreement | Stability:
    """Return the record in a file; raise ReadError if this version did not write it."""
    lead = f"{name}: is no result that `fuzzytree check` or `stability` --json wrote"
    try:
        facts = msgspec.json.decode(content, type=dict[str, object])
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ReadError(f"{lead}: {_quoted(error)}") from error
    form, made_by = facts.get("format"), facts.get("version")
    kind = _KINDS.get(form) if isinstance(form, str) else None
    if kind is None:
        raise ReadError(f"{lead}: its format is none of {', '.join(_KINDS)}")
    if made_by != version():
        raise ReadError(
            f"{name}: is a result of fuzzytree {str(made_by)[:40]}, and this is "
            f"{version()}; run it again"
        )
    try:
        record = msgspec.convert(_whole(facts, inspect.type_info(kind)), kind)
    except msgspec.ValidationError as error:
        raise ReadError(f"{lead}: {_quoted(error)}") from error
    if msgspec.json.decode(record.to_json()) != facts:
        raise ReadError(f"{lead}: what it says does not fit together")
    return record


def _quoted(error: Exception) -> str:
    return str(error).replace("`", "'")


def _whole(facts: object, kind: inspect.Type) -> object:
    """Return facts with infinity where a number must be and JSON could hold none."""
    match kind:
        case inspect.FloatType() if facts is None:
            return math.inf
        case inspect.StructType(fields=fields) if isinstance(facts, dict):
            known = {one.name: one.type for one in fields}
            return {
                key: _whole(value, known[key]) if key in known else value
                for key, value in facts.items()
            }
        case inspect.VarTupleType(item_type=item) if isinstance(facts, list):
            return [_whole(one, item) for one in facts]
        case _:
            return facts

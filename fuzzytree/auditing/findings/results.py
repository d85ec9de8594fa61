"""Files of earlier runs: accepted findings, and results of `check` and `stability`."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import msgspec
from msgspec import inspect

from fuzzytree.auditing.findings.locations import writable
from fuzzytree.auditing.findings.records import Audit, SourceFile, VerbResult
from fuzzytree.errors import ReadError
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.model import Agreement, Document, fingerprint, version

if TYPE_CHECKING:
    from fuzzytree.checking import Stability

FORMAT: Final = "fuzzytree-baseline/1"

_MOST_BYTES = 64 * 2**20
_ID = re.compile(r"FT[0-9D][0-9]{2}-[0-9a-f]{8}(-[1-9][0-9]*)?")


# --- accepted findings


class Baseline(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The sentences of accepted findings, which are for people, by their ids."""

    format: Literal["fuzzytree-baseline/1"]
    accepted: dict[str, str]


def read_baseline(path: PathLike) -> Mapping[str, str]:
    """Return the accepted findings' sentences by id; raise ReadError if it is none."""
    lead = f"{os.fspath(path)}: is no baseline that --write-baseline wrote"
    try:
        content = read_bounded(path, _MOST_BYTES)
        accepted = msgspec.json.decode(content, type=Baseline).accepted
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ReadError(f"{lead}: {_error_text(error)}") from error
    for name in accepted:
        if not _ID.fullmatch(name):
            raise ReadError(f"{lead}: {name[:40]!r} is no id of a finding")
    return accepted


def baseline_of(audit: Audit) -> bytes:
    """Return the baseline that accepts every finding of an audit."""
    accepted = {answer.id: answer.sentence for answer in audit.findings}
    facts = {"format": FORMAT, "accepted": dict(sorted(accepted.items()))}
    return (json.dumps(facts, indent=2, ensure_ascii=False) + "\n").encode()


def obsolete_ids(baseline: Mapping[str, str], audit: Audit) -> Iterator[str]:
    """Yield the accepted ids that an audit no longer finds, in order.

    Codes that were not run, or were cut short, are left out.
    """
    ids = {answer.id for answer in audit.findings}
    unasked = {text.partition(" ")[0] for text in audit.unasked}
    for name in sorted(baseline):
        if name not in ids and name.partition("-")[0] not in unasked:
            yield name


# --- results of other verbs


class LoadedResult(NamedTuple):
    """A result of another verb: its summary in an audit, and all of it."""

    result: VerbResult
    record: Agreement | Stability


def read_results(
    paths: Iterable[PathLike], model: Document
) -> tuple[LoadedResult, ...]:
    """Return what `fuzzytree check --json` and `stability --json` wrote of a model.

    ReadError is raised if a file is none of these, was changed by hand, is about
    another model or of another version, or another file is of the same verb.
    """
    results: dict[str, LoadedResult] = {}
    for path in paths:
        name = os.fspath(path)
        content = read_bounded(path, _MOST_BYTES)
        record = _read_record(content, name)
        file = SourceFile(writable(name), hashlib.sha256(content).hexdigest())
        result = _result(record, file)
        wanted = fingerprint(model)
        if record.fingerprint != wanted:
            raise ReadError(
                f"{name}: is a result of another model: its fingerprint is "
                f"{record.fingerprint[:12]}..., and that of {model.name[:60]!r} is "
                f"{wanted[:12]}...; run `fuzzytree {result.verb}` again"
            )
        if result.verb in results:
            raise ReadError(
                f"{name}: is a result of {result.verb}, and so is "
                f"{results[result.verb].result.file.name}; give one of them"
            )
        results[result.verb] = LoadedResult(result, record)
    return tuple(results.values())


def _result(record: Agreement | Stability, file: SourceFile) -> VerbResult:
    """Return the summary of a result."""
    if isinstance(record, Agreement):
        count = len(record.comparisons) + len(record.certificates)
        return VerbResult("check", file, count, len(record.wrong))
    verdicts = [criterion.verdict for criterion in record.criteria]
    return VerbResult("stability", file, len(verdicts), verdicts.count("FAILS"))


def _read_record(content: bytes, name: str) -> Agreement | Stability:
    """Return the record in a file, which must be as this version wrote it."""
    from fuzzytree.checking import Stability  # which few audits need

    every: tuple[type[Agreement] | type[Stability], ...] = (Agreement, Stability)
    kinds = {kind.FORMAT: kind for kind in every}
    lead = f"{name}: is no result that `fuzzytree check` or `stability` --json wrote"
    try:
        facts = msgspec.json.decode(content, type=dict[str, object])
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ReadError(f"{lead}: {_error_text(error)}") from error
    form, made_by = facts.get("format"), facts.get("version")
    kind = kinds.get(form) if isinstance(form, str) else None
    if kind is None:
        raise ReadError(f"{lead}: its format is none of {', '.join(kinds)}")
    if made_by != version():
        raise ReadError(
            f"{name}: is a result of fuzzytree {str(made_by)[:40]}, and this is "
            f"{version()}; run it again"
        )
    try:
        record = msgspec.convert(_whole(facts, inspect.type_info(kind)), kind)
    except msgspec.ValidationError as error:
        raise ReadError(f"{lead}: {_error_text(error)}") from error
    if msgspec.json.decode(record.to_json()) != facts:
        raise ReadError(f"{lead}: what it says does not fit together")
    return record


def _error_text(error: Exception) -> str:
    return str(error).replace("`", "'")


def _whole(facts: object, kind: inspect.Type) -> object:
    """Return facts with infinity where a number must be and JSON could hold none."""
    match kind:
        case inspect.FloatType() if facts is None:
            return math.inf
        case inspect.StructType(fields=fields) if isinstance(facts, dict):
            kinds = {field.name: field.type for field in fields}
            return {
                key: _whole(value, kinds[key]) if key in kinds else value
                for key, value in facts.items()
            }
        case inspect.VarTupleType(item_type=item) if isinstance(facts, list):
            return [_whole(fact, item) for fact in facts]
        case _:
            return facts

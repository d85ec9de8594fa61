"""A baseline: the findings that a user has looked at and accepts."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from typing import Final, Literal

import msgspec

from fuzzytree.auditing.findings.records import Audit
from fuzzytree.errors import ReadError
from fuzzytree.files import PathLike, read_bounded

FORMAT: Final = "fuzzytree-baseline/1"

_MOST_BYTES = 16 * 2**20
_ID = re.compile(r"FT[0-9D][0-9]{2}-[0-9a-f]{8}(-[1-9][0-9]*)?")


class Baseline(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Accepted findings.

    Attributes:
        accepted: What each of them says, by its id; the sentences are for people.
    """

    format: Literal["fuzzytree-baseline/1"]
    accepted: dict[str, str]


def read_baseline(path: PathLike) -> Mapping[str, str]:
    """Return the accepted findings' sentences by id."""
    content = read_bounded(path, _MOST_BYTES)
    try:
        accepted = msgspec.json.decode(content, type=Baseline).accepted
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _refused(path, str(error).replace("`", "'")) from error
    for name in accepted:
        if not _ID.fullmatch(name):
            raise _refused(path, f"{name[:40]!r} is no id of a finding")
    return accepted


def _refused(path: PathLike, what: str) -> ReadError:
    lead = "is no baseline that --write-baseline wrote"
    return ReadError(f"{os.fspath(path)}: {lead}: {what}")


def baseline_of(audit: Audit) -> bytes:
    """Return the baseline that accepts every finding of an audit."""
    accepted = {answer.id: answer.sentence for answer in audit.findings}
    facts = {"format": FORMAT, "accepted": dict(sorted(accepted.items()))}
    return (json.dumps(facts, indent=2, ensure_ascii=False) + "\n").encode()


def resolved_ids(baseline: Mapping[str, str], audit: Audit) -> Iterator[str]:
    """Yield the accepted ids that an audit no longer finds, in order.

    Codes that were not run, or were cut short, are left out.
    """
    ids = {answer.id for answer in audit.findings}
    unasked = {text.partition(" ")[0] for text in audit.unasked}
    for one in sorted(baseline):
        if one not in ids and one.partition("-")[0] not in unasked:
            yield one

"""Check an audit again without the engine that made it: `recheck AUDIT MODEL`.

    python -m fuzzytree.auditing.recheck audit.json model.yaml

This folder needs Python 3.11 and nothing else, and imports nothing of the rest of
fuzzytree: copy it, read it, run it alone (docs/how-to/recheck.md). It reads the audit
and the model itself, evaluates every witness again in fractions, decides again what it
can, and says what it could not. Exit 0: all holds; 1: something does not, and all of
that is listed; 2: it could not be run.

Read it in this order: the records (`audit_records`, `model_records`) and how files
become them (`yaml`, `models`); what a model means (`polynomials`, `enclosing`,
`meaning`); how a "never" is decided again (`grid`); the checks
(`cases`, `head`, `forms`, `deciding`, `answers`) and how they end (`outcomes`).
"""

from __future__ import annotations

from pathlib import Path

from fuzzytree.auditing.recheck.answers import check_answer
from fuzzytree.auditing.recheck.audit_records import Audit
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.head import check_files, check_head
from fuzzytree.auditing.recheck.model_records import System
from fuzzytree.auditing.recheck.models import built, read_file, read_json
from fuzzytree.auditing.recheck.outcomes import (
    MOST_BYTES,
    CannotRunError,
    DoesNotHoldError,
    Report,
)

__all__ = ["CannotRunError", "Report", "recheck", "recheck_files"]


def recheck(audit: bytes, model: bytes, names: tuple[str, str]) -> Report:
    """Check an audit against the model that it is of.

    `names`: what messages call the two.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    facts = read_json(audit, names[0])
    result = built(Audit, facts, names[0])
    whole, places = read_file(model, names[1])
    if isinstance(whole, System) and result.policy.decision == "strongest":
        text = "a system that stands for rules is not checked again; audit these"
        raise CannotRunError(f"{names[0]}: {text}")
    report = Report()
    try:
        case = Case(result, whole, places)
        check_files(case, report, facts, model, names[1])
        check_head(case, report)
        for number, answer in enumerate(case.audit.answers, 1):
            where = f"answer {number} ({answer.code}, {answer.subject:.60})"
            check_answer(case, report, answer, where)
    except DoesNotHoldError as error:
        report.wrong.append(str(error))
    return report


def recheck_files(audit: str, model: str) -> Report:
    """Check an audit's file against a model's file.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    contents: list[bytes] = []
    for name in (audit, model):
        try:
            with Path(name).open("rb") as file:
                contents.append(file.read(MOST_BYTES + 1))
        except OSError as error:
            raise CannotRunError(f"{name}: {error.strerror or error}") from error
    return recheck(contents[0], contents[1], (audit, model))

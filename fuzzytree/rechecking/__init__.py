"""Check an audit again without the engine that made it: `recheck AUDIT MODEL`.

    python -m fuzzytree.rechecking audit.json model.yaml
    python -m fuzzytree.rechecking diff.json old.yaml new.yaml

This folder needs Python 3.11 and nothing else, and imports nothing of the rest of
fuzzytree: copy it, read it, run it alone (docs/how-to/recheck.md). It reads the audit
and the model itself, evaluates every witness again in fractions, decides every proof
again, and says what it could not decide. Exit 0: all holds; 1: something does not, and
all of that is listed; 2: it could not be run.

Read it in this order: how files become records and models (`records`, `yaml`,
`sentences_of_rules`, `models`); degrees (`curves`); the one question (`cells`, and
`boxes` for products); what a check needs (`case`); the checks (`deciding`, `checks`)
and how they end (`outcomes`). `two_models` checks what `diff` says.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.checks import (
    LIMITS,
    UNCHECKED,
    check_answer,
    check_files,
    check_head,
    digest_of,
    is_unconfirmed,
)
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.outcomes import (
    STEPS_IN_ALL,
    CannotRunError,
    DoesNotHoldError,
    Limit,
    Report,
    UndecidedError,
)
from fuzzytree.rechecking.records import (
    Audit,
    Declined,
    Proved,
    built,
    read_json,
)
from fuzzytree.rechecking.sentences import (
    MESSAGES,
    names_in,
    open_interval,
    sentence_of,
)
from fuzzytree.rechecking.two_models import (
    recheck_difference,
    undecided_difference,
)
from fuzzytree.rechecking.yaml import MOST_BYTES

__all__ = [
    "LIMITS",
    "MESSAGES",
    "CannotRunError",
    "Report",
    "digest_of",
    "is_unconfirmed",
    "names_in",
    "open_interval",
    "recheck",
    "recheck_difference",
    "recheck_files",
    "sentence_of",
    "undecided",
    "undecided_difference",
]


def recheck(audit: bytes, model: bytes, names: tuple[str, str]) -> Report:
    """Check an audit against the model that it is of.

    `names`: what messages call the two.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    facts, result, case = _read(audit, model, names, Limit())
    report = Report(UNCHECKED)
    report.codes = [one.code for one in case.answers]
    try:
        check_files(case, report, facts, model, names[1])
        check_head(result, case, report)
        for number, answer in enumerate(case.answers, 1):
            check_answer(case, report, answer, number)
    except (DoesNotHoldError, UndecidedError) as error:
        report.wrong.append(str(error))
    except (LookupError, TypeError, ValueError):
        report.wrong.append("an answer names what there is not")
    return report


def undecided(
    audit: bytes, model: bytes, is_late: Callable[[], bool]
) -> dict[int, str]:
    """Return the PROVED answers that are not decided again here.

    Args:
        audit: An audit that was made here, and is not yet done.
        model: Its model, as YAML.
        is_late: Whether nothing more shall be begun.

    Returns:
        By the position of each such answer what is wrong with it; nothing if it is
        beyond the limits.

    Raises:
        CannotRunError: If the model cannot be read.
    """
    names, limit = ("the audit", "model.yaml"), Limit(STEPS_IN_ALL, is_late)
    _, _, case = _read(audit, model, names, limit)
    result: dict[int, str] = {}
    for place, answer in enumerate(case.answers):
        if isinstance(answer.state, Proved):
            report = Report()
            check_answer(case, report, answer, place + 1)
            if not report.counts["answers PROVED, decided again"]:
                result[place] = report.first
    return result


def _read(
    audit: bytes, model: bytes, names: tuple[str, str], limit: Limit
) -> tuple[dict[str, Any], Audit, Case]:
    facts = read_json(audit, names[0])
    result: Audit = built(Audit, facts, names[0])
    left_out = [
        one.subject for one in result.answers if isinstance(one.state, Declined)
    ]
    whole = Model(model, names[1], left_out)
    if whole.form == "system" and result.policy.decision == "strongest":
        text = "a system that stands for rules is not checked again; audit these"
        raise CannotRunError(f"{names[0]}: {text}")
    if any(side.is_open for side in result.domain.sides):
        raise CannotRunError(f"{names[0]}: a domain with an open side is not checked")
    return facts, result, Case(result, whole, limit)


def recheck_files(*names: str) -> Report:
    """Check an audit's file against a model's, or a comparison's against two.

    Raises:
        CannotRunError: If one of them cannot be read.
    """
    contents: list[bytes] = []
    for name in names:
        try:
            with Path(name).open("rb") as file:
                contents.append(file.read(MOST_BYTES + 1))
        except OSError as error:
            raise CannotRunError(f"{name}: {error.strerror or error}") from error
    if len(names) == 2:
        return recheck(contents[0], contents[1], (names[0], names[1]))
    diff, old, new = contents
    return recheck_difference(diff, old, new, (names[0], names[1], names[2]))

"""Check an audit again without the engine that made it: `recheck AUDIT MODEL`.

    python -m fuzzytree.rechecking audit.json model.yaml
    python -m fuzzytree.rechecking diff.json old.yaml new.yaml

This folder needs Python 3.11 and nothing else, and imports nothing of the rest of
fuzzytree: copy it, read it, run it alone (docs/how-to/recheck.md). It reads the audit
and the model itself, evaluates every witness again in fractions, writes what is PROVED
as SMT-LIB 2 and asks a solver, and says what was not confirmed. Exit 0: all holds; 1:
something does not, and all of that is listed; 2: it could not be run, or no solver is
at hand.

Read it in this order: how files become records and models (`records`, `words`, `yaml`,
`sentences_of_rules`, `models`); degrees (`curves`); the text for solvers (`smt`);
what a check needs (`case`); what is claimed (`claims`), who decides it (`solvers`),
all other checks (`witnesses`, `checks`), and how they end (`outcomes`). `two_models`
checks what `diff` says; `sentences` are those of an audit.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.checks import (
    UNCHECKED,
    check_answer,
    check_files,
    check_gaps,
    check_head,
    digest_of,
    judge,
)
from fuzzytree.rechecking.claims import Statement
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.outcomes import (
    CannotRunError,
    DoesNotHoldError,
    Report,
    UndecidedError,
)
from fuzzytree.rechecking.records import (
    Answer,
    Audit,
    Declined,
    Proved,
    built,
    read_json,
)
from fuzzytree.rechecking.sentences import (
    LIMITS,
    MESSAGES,
    names_in,
    open_interval,
    sentence_of,
)
from fuzzytree.rechecking.smt import Script
from fuzzytree.rechecking.solvers import ask, script_text
from fuzzytree.rechecking.two_models import recheck_difference
from fuzzytree.rechecking.words import (
    DATE_UNIT,
    MISSING,
    is_plain,
    listed,
    stretch,
    stretch_word,
    value_word,
)
from fuzzytree.rechecking.yaml import MOST_BYTES

__all__ = [
    "DATE_UNIT",
    "LIMITS",
    "MESSAGES",
    "MISSING",
    "CannotRunError",
    "Confirmation",
    "Report",
    "claims_text",
    "confirm",
    "confirm_difference",
    "digest_of",
    "is_plain",
    "listed",
    "model_text",
    "names_in",
    "open_interval",
    "recheck",
    "recheck_difference",
    "recheck_files",
    "sentence_of",
    "stretch",
    "stretch_word",
    "value_word",
]

Questions = list[tuple[int, Answer, list[Statement]]]
"""The number of each answer that a solver must decide, and its claims."""


def recheck(
    audit: bytes, model: bytes, names: tuple[str, str], solver: str = ""
) -> Report:
    """Check an audit against the model that it is of.

    Args:
        audit: The audit.
        model: The model's file.
        names: What messages call the two.
        solver: The program that decides claims; the package z3 by default.

    Raises:
        CannotRunError: If one of them cannot be read, or the solver fails.
    """
    facts, result, case = _read(audit, model, names)
    report = Report(UNCHECKED)
    report.codes = [one.code for one in case.answers]
    questions: Questions = []
    try:
        check_files(case, report, facts, model, names[1])
        check_head(result, case, report)
        for number, answer in enumerate(case.answers, 1):
            questions.append(
                (number, answer, check_answer(case, report, answer, number))
            )
        gaps = check_gaps(result, case)
        if gaps is not None:
            questions.append((case.answers.index(gaps[0]) + 1, *gaps))
    except (DoesNotHoldError, UndecidedError) as error:
        report.wrong.append(str(error))
    except (LookupError, TypeError, ValueError):
        report.wrong.append("an answer names what there is not")
    _decide(case, report, questions, solver)
    return report


def _decide(case: Case, report: Report, questions: Questions, solver: str) -> None:
    """Ask a solver for all claims, and note which answers it confirms."""
    questions = [one for one in questions if one[2]]
    every = [claim for *_, claims in questions for claim in claims]
    if not every and not solver:
        return
    results = ask(case.script.text(), every, solver)
    answers = iter(results.answers)
    for number, answer, claims in questions:
        pairs = [(claim, next(answers)) for claim in claims]
        is_proof = isinstance(answer.state, Proved)
        if not results.solver:
            report.unconfirmed += is_proof
            continue
        with report.answer(number, answer):
            judge(pairs, is_exact=case.script.is_exact)
            state = "answers PROVED" if is_proof else "bounds of other answers"
            report.counts[f"{state}, confirmed by {results.solver}"] += 1
            report.confirmed[number - 1] = results.solver


class Confirmation(NamedTuple):
    """What is confirmed of the PROVED answers of an audit that is not yet done.

    Attributes:
        confirmed: By its position what confirms an answer: a solver, or `recheck`.
        refuted: By the position of each answer that is wrong, why.
    """

    confirmed: dict[int, str]
    refuted: dict[int, str]


def confirm(audit: bytes, model: bytes) -> Confirmation:
    """Ask the package z3, if it is there, for each PROVED answer of an audit.

    Args:
        audit: An audit that was made here, and is not yet done.
        model: Its model, as YAML.

    Raises:
        CannotRunError: If the model cannot be read, or the solver fails.
    """
    case, questions, report = _claims(audit, model)
    _decide(case, report, questions, "")
    return _confirmation(report)


def claims_text(audit: bytes, model: bytes) -> str:
    """Return a model and the claims of its audit as SMT-LIB 2.

    Raises:
        CannotRunError: If the model cannot be read.
    """
    case, questions, _ = _claims(audit, model)
    every = [
        claim._replace(text=f"{answer.code}: {claim.text}")
        for _, answer, claims in questions
        for claim in claims
    ]
    return script_text(case.script.text(), every)


def confirm_difference(diff: bytes, old: bytes, new: bytes) -> Confirmation:
    """Ask the package z3, if it is there, for each PROVED answer of a comparison.

    Raises:
        CannotRunError: If a model cannot be read, or the solver fails.
    """
    names = "the comparison", "old.yaml", "new.yaml"
    return _confirmation(recheck_difference(diff, old, new, names))


def model_text(model: bytes) -> str:
    """Return a model as SMT-LIB 2, its inputs within their declared ranges.

    Raises:
        CannotRunError: If it cannot be said for a solver; the text says why.
    """
    whole = Model(model, "model.yaml")
    if whole.reasons:
        every = (f"{name}: {why}" for name, why in whole.reasons.items())
        raise CannotRunError("; ".join(every))
    script = Script()
    ends = {
        v.name: (Fraction(v.low), Fraction(v.high))
        for v in whole.variables.values()
        if v.low is not None and v.high is not None
    }
    values = {
        v.name: [
            *map(Fraction, range(len(v.categories))),
            *([] if v.missing is None else [v.missing]),
        ]
        for v in whole.variables.values()
    }
    script.add(whole, ends, values=values)
    return script.text()


def _claims(audit: bytes, model: bytes) -> tuple[Case, Questions, Report]:
    """Return the claims of all PROVED answers."""
    _, _, case = _read(audit, model, ("the audit", "model.yaml"))
    report, questions = Report(), Questions()
    for number, answer in enumerate(case.answers, 1):
        if isinstance(answer.state, Proved):
            questions.append(
                (number, answer, check_answer(case, report, answer, number))
            )
    return case, questions, report


def _confirmation(report: Report) -> Confirmation:
    refuted: dict[int, str] = {}
    for text in report.wrong:
        where, is_answer, why = text.partition("): ")
        if is_answer:
            refuted.setdefault(int(where.split(" ")[1]) - 1, why)
    return Confirmation(report.confirmed, refuted)


def _read(
    audit: bytes, model: bytes, names: tuple[str, str]
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
    return facts, result, Case(result, whole)


def recheck_files(*names: str, solver: str = "") -> Report:
    """Check an audit's file against a model's, or a comparison's against two.

    Raises:
        CannotRunError: If one of them cannot be read, or the solver fails.
    """
    contents: list[bytes] = []
    for name in names:
        try:
            with Path(name).open("rb") as file:
                contents.append(file.read(MOST_BYTES + 1))
        except OSError as error:
            raise CannotRunError(f"{name}: {error.strerror or error}") from error
    if len(names) == 2:
        return recheck(contents[0], contents[1], (names[0], names[1]), solver)
    diff, old, new = contents
    return recheck_difference(diff, old, new, (names[0], names[1], names[2]), solver)

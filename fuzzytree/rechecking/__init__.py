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
all other checks (`checks`), and how they end (`outcomes`). `two_models`
checks what `diff` says; `sentences` reads those of an audit from `sentences.toml`.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.checks import (
    UNCHECKED,
    Questions,
    check_answer,
    check_gaps,
    check_head,
    check_source,
    decide,
    digest_of,
)
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.outcomes import (
    CannotRunError,
    DoesNotHoldError,
    Report,
    UndecidedError,
)
from fuzzytree.rechecking.records import Audit, Declined, Proved, decode, read_json
from fuzzytree.rechecking.sentences import (
    LIMITS,
    MESSAGES,
    names_in,
    open_interval,
    sentence_of,
)
from fuzzytree.rechecking.smt import Script
from fuzzytree.rechecking.solvers import script_text
from fuzzytree.rechecking.two_models import recheck_difference
from fuzzytree.rechecking.words import (
    DATE_UNIT,
    MISSING,
    interval_word,
    is_plain,
    minute_word,
    side_values,
    stretch,
    stretch_word,
    table_word,
    value_word,
)
from fuzzytree.rechecking.yaml import MOST_BYTES, read_yaml

__all__ = [
    "DATE_UNIT",
    "LIMITS",
    "MESSAGES",
    "MISSING",
    "CannotRunError",
    "Report",
    "claims_text",
    "confirm",
    "digest_of",
    "interval_word",
    "is_plain",
    "minute_word",
    "model_text",
    "names_in",
    "open_interval",
    "read_json",
    "read_yaml",
    "recheck",
    "recheck_difference",
    "recheck_files",
    "sentence_of",
    "side_values",
    "stretch",
    "stretch_word",
    "table_word",
    "value_word",
]


def recheck(
    audit: bytes,
    model: bytes,
    names: tuple[str, str],
    solver: str = "",
    source: bytes = b"",
) -> Report:
    """Check an audit against the model that it is of.

    Args:
        audit: The audit.
        model: The model's file.
        names: What messages call the two.
        solver: The program that decides claims; the package z3 by default.
        source: The audited file, if `model` is YAML that was made of it.

    Raises:
        CannotRunError: If one of them cannot be read, or the solver fails.
    """
    result, case = _read(audit, model, names)
    unchecked = UNCHECKED
    if source:
        case.answers = tuple(answer._replace(places=()) for answer in case.answers)
        unchecked += f"\n{names[1]} was read by fuzzytree itself, whose YAML of it was "
        unchecked += "checked; lines and columns were compared with nothing"
    report = Report(unchecked, case.answers)
    questions: Questions = []
    digest = digest_of(read_json(audit, names[0]))
    report.expect(result.digest == digest, f"the digest is {digest}")
    check_source(report, case.file, source or model, names[1])
    try:
        check_head(result, case, report)
        questions = _questions(case, report) + check_gaps(result, case)
    except (DoesNotHoldError, UndecidedError) as error:
        report.wrong.append(str(error))
    except (LookupError, TypeError, ValueError):
        report.wrong.append("an answer names what there is not")
    decide(case.script, report, questions, solver)
    return report


def _read(
    audit: bytes, model: bytes, names: tuple[str, str] = ("the audit", "model.yaml")
) -> tuple[Audit, Case]:
    result: Audit = decode(Audit, read_json(audit, names[0]), names[0])
    left_out = [o.subject for o in result.answers if isinstance(o.state, Declined)]
    whole = Model(model, names[1], left_out)
    if whole.form == "system" and result.policy.decision == "strongest":
        text = "a system that stands for rules is not checked again; audit these"
        raise CannotRunError(f"{names[0]}: {text}")
    if any(side.is_open for side in result.domain.sides):
        raise CannotRunError(f"{names[0]}: a domain with an open side is not checked")
    return result, Case(result, whole)


def _questions(case: Case, report: Report, kinds: type = object) -> Questions:
    """Return the claims of answers whose states are of a kind."""
    return [
        (place, check_answer(case, report, place))
        for place, answer in enumerate(case.answers)
        if isinstance(answer.state, kinds)
    ]


def confirm(audit: bytes, model: bytes) -> Report:
    """Ask the package z3, if it is there, for each PROVED answer of an audit.

    Args:
        audit: An audit that was made here, and is not yet done.
        model: Its model, as YAML.

    Raises:
        CannotRunError: If the model cannot be read, or the solver fails.
    """
    _, case = _read(audit, model)
    case.has_all_rules = False
    report = Report("", case.answers)
    decide(case.script, report, _questions(case, report, Proved), "")
    return report


def claims_text(audit: bytes, model: bytes) -> str:
    """Return a model and the claims of its audit as SMT-LIB 2.

    Raises:
        CannotRunError: If the model cannot be read.
    """
    _, case = _read(audit, model)
    every = [
        claim._replace(text=f"{case.answers[place].code}: {claim.text}")
        for place, claims in _questions(case, Report("", case.answers), Proved)
        for claim in claims
    ]
    return script_text(case.script.text(), every)


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
    script.add(whole, ends, {})
    return script.text()


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

"""An audit: run every family of questions within a budget, and keep the answers."""

from __future__ import annotations

import functools
import hashlib
import importlib
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, cast

import msgspec

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.answers import Progress
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Computed, Declined, Proved, counted
from fuzzytree.auditing.findings.codes import (
    ANSWERED_BY_CONSTRUCTION,
    AUDITED,
    CODES,
    FAMILIES,
    audit_answer,
)
from fuzzytree.auditing.findings.configuration import check_settings, chosen_codes
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.locations import (
    locations_of,
    with_ids,
    writable,
)
from fuzzytree.auditing.findings.records import (
    INTERRUPTED,
    LIMITS,
    Audit,
    AuditAnswer,
    AuditSelection,
    AuditSettings,
    Policy,
    SourceFile,
    digest_of,
)
from fuzzytree.auditing.findings.subject import AuditView, Material, Subject, subject_of
from fuzzytree.auditing.findings.table_words import Words
from fuzzytree.auditing.findings.views import view
from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    Document,
    FuzzyTree,
    RuleBase,
    fingerprint,
    name_choice,
    version,
)
from fuzzytree.rechecking import (
    CannotRunError,
    Report,
    claims_text,
    confirm,
)

FamilyFunction = Callable[[Subject], Iterator[AuditAnswer]]

_BY_CONSTRUCTION = "not asked where true by construction of relative rules"
_OF_RAW_RULES = "FT203"
_RAW = "not asked, as raw rules are another model; --select FT203 compares them"
_OF_A_ROW = "FT204"
_LATE = "FTD03"
_TOO_LARGE = "it needs more memory than there is"


def audit(
    material: Material,
    *,
    domain: Domain | None = None,
    row: Mapping[str, float] | None = None,
    selection: AuditSelection | None = None,
    settings: AuditSettings | None = None,
    report: Progress | None = None,
    repeat: str = "",
) -> Audit:
    """Answer every question about a model.

    When the budget is spent, or at a Ctrl-C, nothing new is begun: what is proved is
    kept, and `unasked` lists the rest.

    Args:
        material: The model, its file and the user's rows.
        domain: The domain; the model's ranges by default.
        row: A row whose nearest other decision is also sought.
        selection: The codes to answer; all by default.
        settings: The thresholds.
        report: Called with what is done now, and with the share of all work that is
            done, in [0, 1].
        repeat: The command that repeats this audit.

    Raises:
        ValueError: If a code or a setting is none, or the domain is not known.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> counts = AuditSelection(select=["FT501"])
        >>> audit(Material(random_tree(1)), selection=counts).is_complete
        True
    """
    model, rows, file = material.model, material.rows, material.file
    selection, settings = selection or AuditSelection(), settings or AuditSettings()
    check_settings(settings)
    wanted = chosen_codes(selection.select, selection.skip)
    if row is not None:
        _check_row(row, model.inputs)
    viewed = view(model, domain or domain_of(model))
    reasons: dict[str, str] = {}
    if viewed.rules is not None and viewed.rules.kind == "relative":
        reasons = dict.fromkeys(wanted & ANSWERED_BY_CONSTRUCTION, _BY_CONSTRUCTION)
    if viewed.raw is not None and not selection.select:
        reasons |= dict.fromkeys(wanted & {_OF_RAW_RULES}, _RAW)
    progress = _Progress([*viewed.declined], {})
    budget = Budget(int(settings.budget * 1e6), report=report)
    if viewed.rules is not None:
        subject = subject_of(viewed, settings, budget, rows)
        asked = {code for code in wanted if reasons.get(code) != _RAW}
        _run_all([*_tasks(asked, row)], subject, progress)
    words = Words(viewed.domain, model.variables)
    worded = map(words.answer, progress.answers)
    answers = tuple(_located(worded, wanted, viewed, material, repeat))
    result = Audit(
        version=version(),
        model=model.name,
        form=_form(model),
        fingerprint=fingerprint(model),
        file=source_of(file.name, file.content) if file else None,
        data=material.data,
        rows=0 if rows is None else rows.values.shape[1],
        policy=viewed.policy,
        domain=words.domain,
        settings=settings,
        answers=answers,
        unasked=tuple(_unasked(viewed.policy, wanted, progress, reasons)),
        limits=LIMITS,
        is_complete=not progress.cut,
        results=tuple(one.result for one in material.results),
        numbers=() if _is_plain(viewed.numbers) else viewed.numbers,
    )
    # A count among doubles is a double from here on, as it is for who reads the file.
    result = msgspec.json.decode(msgspec.json.encode(result), type=Audit)
    result = _confirmed(result, _audited(viewed, model))
    ids = {one.id for one in result.findings}
    accepted = tuple(sorted(ids.intersection(selection.accepted)))
    result = msgspec.structs.replace(result, accepted=accepted)
    return msgspec.structs.replace(result, digest=digest_of(result))


def _confirmed(result: Audit, model: Document) -> Audit:
    """Return an audit whose PROVED answers a solver confirms, if one is at hand."""

    def confirmation() -> Report:
        return confirm(*_for_solver(result, model))

    answers = with_confirmations(result.answers, confirmation)
    return msgspec.structs.replace(result, answers=answers)


def smt_text(result: Audit, model: Document) -> str:
    """Return a model and what is PROVED of it as SMT-LIB 2, for any solver.

    Raises:
        LossError: If the model cannot be written.
        ReadError: If it cannot be said for a solver.
    """
    try:
        return claims_text(
            *_for_solver(result, _audited(view(model, result.domain), model))
        )
    except CannotRunError as error:
        raise ReadError(str(error)) from error


def _audited(viewed: AuditView, model: Document) -> Document:
    """Return what answers are about: the rules for which a system may stand."""
    is_class = viewed.policy.decision == "strongest" and model is viewed.system
    return viewed.rules if is_class and viewed.rules is not None else model


def _for_solver(result: Audit, model: Document) -> tuple[bytes, bytes]:
    """Return an audit without places, and its model written anew."""
    moved = (msgspec.structs.replace(one, places=()) for one in result.answers)
    bare = msgspec.structs.replace(result, file=None, answers=tuple(moved))
    return msgspec.json.encode(bare), find_format("yaml").write(model).content


def with_confirmations(
    answers: Sequence[AuditAnswer], confirmation: Callable[[], Report]
) -> tuple[AuditAnswer, ...]:
    """Return answers with what confirms each.

    What it refutes is left out, and FT901 stands in its place.
    """
    try:
        report = confirmation()
    except (LossError, CannotRunError):
        return (*answers,)
    result = [*answers]
    for place, one in enumerate(answers):
        if isinstance(one.state, Proved) and place in report.confirmed:
            state = msgspec.structs.replace(
                one.state, confirmed=report.confirmed[place]
            )
            result[place] = msgspec.structs.replace(one, state=state)
    for place, why in report.refuted.items():
        if isinstance(answers[place].state, Proved):
            result[place] = _refuted(answers[place], why)
    return tuple(sorted(result, key=lambda one: one.code))


def _refuted(answer: AuditAnswer, why: str) -> AuditAnswer:
    """Return the finding that a solver refutes an answer."""
    result = audit_answer(
        "FT901.refuted",
        answer.subject,
        Computed("each PROVED answer was checked again"),
        rules=answer.rules,
        terms=answer.terms,
        facts={"code": answer.code, "detail": why},
    )
    name = answer.id.replace(answer.code, result.code, 1)
    return msgspec.structs.replace(
        result,
        id=name,
        places=answer.places,
        repeat=answer.repeat,
    )


def _check_row(row: Mapping[str, float], inputs: Sequence[str]) -> None:
    """Refuse a row without a finite value for each input.

    Raises:
        ValueError: If it is one.
    """
    for name, value in row.items():
        if name not in inputs:
            raise ValueError(
                f"the row has a value of {name!r}, which is no input; "
                f"{name_choice(name, inputs)}"
            )
        if not math.isfinite(value):
            raise ValueError(f"the row's {name!r} must be finite, not {value!r}")
    absent = [name for name in inputs if name not in row]
    if absent:
        raise ValueError(f"the row has no value of {', '.join(map(repr, absent))}")


def source_of(name: str, content: bytes) -> SourceFile:
    """Return the name of a file and the SHA-256 of its bytes."""
    return SourceFile(writable(name), hashlib.sha256(content).hexdigest())


class _Progress(NamedTuple):
    """The answers so far, and by code why it was cut short or not begun."""

    answers: list[AuditAnswer]
    cut: dict[str, str]


class _Task(NamedTuple):
    """Questions that one function answers together."""

    codes: Sequence[str]
    run: FamilyFunction
    part: float


def _tasks(wanted: set[str], row: Mapping[str, float] | None) -> Iterator[_Task]:
    """Yield the tasks in order: the user's row first, then the families."""
    if row is not None and _OF_A_ROW in wanted:
        yield _Task([_OF_A_ROW], functools.partial(_row_answers, row), 0.5)
    for family in FAMILIES:
        codes = [code for code in family.codes if code in wanted]
        if codes:
            run = functools.partial(_answers, family.function)
            yield _Task(codes, run, family.part)


def _answers(place: str, subject: Subject) -> Iterator[AuditAnswer]:
    """Return what a function of a family yields; its module is imported here."""
    module, _, name = place.partition(":")
    family = importlib.import_module(f"fuzzytree.auditing.findings.{module}")
    # Every function of the table has this type; a test calls each.
    return cast("FamilyFunction", getattr(family, name))(subject)


def _row_answers(row: Mapping[str, float], subject: Subject) -> Iterator[AuditAnswer]:
    from fuzzytree.auditing.findings.robustness import row_answers

    return row_answers(subject, row)


def _run_all(tasks: Sequence[_Task], subject: Subject, progress: _Progress) -> None:
    """Run all tasks, each within its part of the budget."""
    why = f"the budget of {subject.settings.budget:g} million steps is spent"
    budget = subject.budget
    for position, task in enumerate(tasks):
        part = 1.0 if position == len(tasks) - 1 else task.part
        report = _reporter(budget, position, len(tasks))
        share = budget.share(part, report=report)
        try:
            budget.check()
            share.report(CODES[task.codes[0]].title, 0.0)
            for answer in task.run(msgspec.structs.replace(subject, budget=share)):
                progress.answers.append(answer)
                state = answer.state
                if isinstance(state, Declined) and state.code == _LATE:
                    progress.cut[answer.code] = why
        except OutOfStepsError:
            progress.cut.update(dict.fromkeys(task.codes, why))
        except MemoryError:
            progress.cut.update(dict.fromkeys(task.codes, _TOO_LARGE))
        except KeyboardInterrupt:
            rest = [code for one in tasks[position:] for code in one.codes]
            progress.cut.update(dict.fromkeys(rest, INTERRUPTED))
            return


def _reporter(budget: Budget, position: int, count: int) -> Progress:
    """Return a function that reports a family's progress as part of the whole."""
    return lambda text, share: budget.report(text, (position + share) / count)


def _unasked(
    policy: Policy, wanted: set[str], progress: _Progress, reasons: Mapping[str, str]
) -> Iterator[str]:
    """Yield which codes have no answer and why, in order."""
    answered = Counter(one.code for one in progress.answers)
    for code in sorted(AUDITED):
        name = f"{code} {CODES[code].title}"
        if code not in wanted:
            yield f"{name}: left out by the user"
        elif code in progress.cut:
            begun = "not run"
            if answered[code]:
                begun = f"cut short after {counted(answered[code], 'answer')}"
            yield f"{name}: {begun}: {progress.cut[code]}"
        elif code in reasons:
            yield f"{name}: {reasons[code]}"
        elif code in answered:
            continue
        elif policy.decision == "all" and CODES[code].decision == "strongest":
            yield f"{name}: not run: every rule takes part in the answer"
        elif answered and all(one.startswith("FTD") for one in answered):
            yield f"{name}: all that it applies to was declined"
        else:
            yield f"{name}: nothing in this model that it applies to"


def _located(
    answers: Iterable[AuditAnswer],
    wanted: Collection[str],
    viewed: AuditView,
    material: Material,
    repeat: str,
) -> Iterator[AuditAnswer]:
    """Yield the wanted answers with ids, places and the commands that repeat them."""
    kept = sorted((a for a in answers if a.code in wanted), key=lambda a: a.code)
    whole = viewed.rules, viewed.raw
    representations = [rules for rules in whole if rules is not None]
    for answer in with_ids(kept, representations, viewed.curves):
        numbers = [viewed.numbers[number - 1] for number in answer.rules]
        if not numbers and answer.subject in viewed.left_out:
            numbers = [viewed.left_out[answer.subject]]
        yield msgspec.structs.replace(
            answer,
            places=locations_of(answer, material.model, material.file, numbers),
            repeat=f"{writable(repeat)} --select {answer.code}" if repeat else "",
        )


def _is_plain(numbers: Sequence[int]) -> bool:
    """Return whether the rules of a view are those of the model, one by one."""
    return [*numbers] == [*range(1, len(numbers) + 1)]


def _form(model: Document) -> str:
    match model:
        case FuzzyTree():
            return "tree"
        case RuleBase(kind=kind):
            return f"{kind} rules" if kind else "rules"
        case _:
            return "system"

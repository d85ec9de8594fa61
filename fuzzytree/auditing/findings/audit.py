"""An audit: run every family of questions within a budget, and keep the answers."""

from __future__ import annotations

import hashlib
import importlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.answers import Progress
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Computed, Declined, Proved, counted
from fuzzytree.auditing.findings.codes import (
    ANSWERED_BY_CONSTRUCTION,
    AUDITED,
    CODES,
    FAMILIES,
    Family,
    audit_answer,
)
from fuzzytree.auditing.findings.configuration import check_settings, code_selection
from fuzzytree.auditing.findings.domains import Words, domain_of, row_values
from fuzzytree.auditing.findings.locations import (
    ModelFile,
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
from fuzzytree.auditing.findings.subject import (
    AuditView,
    Material,
    Subject,
    subject_of,
    view,
)
from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters import find_format
from fuzzytree.model import Document, fingerprint, kind_of, version
from fuzzytree.rechecking import CannotRunError, Report, claims_text, confirm

_BY_CONSTRUCTION = "not asked where true by construction of relative rules"
_RAW = "not asked, as raw rules are another model; --select FT203 compares them"
_RUNTIMES = "not asked, as `fuzzytree check` compares runtimes; --select FT6 asks"
_ON_REQUEST = {"FT203": _RAW, "FT601": _RUNTIMES, "FT602": _RUNTIMES}
_LATE = "FTD03"
_NO_SOLVER = "no solver is at hand: install fuzzytree-toolkit[proofs]"
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

    The `domain` is that of the model's ranges by default. Of a `row` the nearest other
    decision is also sought. `report` is called with what is done now, and with its
    share in [0, 1] of all; `repeat` is the command that repeats this audit.
    """
    model, rows, file = material.model, material.rows, material.file
    selection, settings = selection or AuditSelection(), settings or AuditSettings()
    check_settings(settings)
    wanted = code_selection(selection.select, selection.skip)
    if row is not None:
        row = row_values(model, row)
    viewed = view(model, domain or domain_of(model))
    reasons: dict[str, str] = {}
    if viewed.rules is not None and viewed.rules.kind == "relative":
        reasons = dict.fromkeys(wanted & ANSWERED_BY_CONSTRUCTION, _BY_CONSTRUCTION)
    left = {} if selection.select else dict(_ON_REQUEST)
    if viewed.raw is None:
        left.pop("FT203", None)
    reasons |= {code: why for code, why in left.items() if code in wanted}
    answers, cut = [*viewed.declined], dict[str, str]()
    if viewed.rules is not None:
        budget = Budget(int(settings.budget * 1e6), report=report)
        subject = subject_of(viewed, settings, budget, rows, row)
        _answer_all(subject, wanted - left.keys(), answers, cut)
    kind = model.kind or ""
    is_plain = [*viewed.numbers] == [*range(1, len(viewed.numbers) + 1)]
    words = Words(viewed.domain, model.variables)
    kept = sorted((a for a in answers if a.code in wanted), key=lambda a: a.code)
    located = _with_places(map(words.answer, kept), viewed, material, repeat)
    result = Audit(
        version=version(),
        model=model.name,
        form=f"{kind} {kind_of(model)}".lstrip(),
        fingerprint=fingerprint(model),
        file=source_of(file.name, file.content) if file else None,
        data=material.data,
        rows=0 if rows is None else rows.values.shape[1],
        policy=viewed.policy,
        domain=words.domain,
        settings=settings,
        answers=tuple(located),
        unasked=tuple(_omissions(viewed.policy, wanted, answers, cut, reasons)),
        limits=LIMITS,
        is_complete=not cut,
        results=tuple(loaded.result for loaded in material.results),
        numbers=() if is_plain else viewed.numbers,
    )
    # A count among doubles is a double from here on, as it is for who reads the file.
    result = msgspec.json.decode(msgspec.json.encode(result), type=Audit)
    subject_model = _model_of_answers(viewed, model)
    own_file = file if subject_model is model else None
    confirmed, why = with_confirmations(
        result.answers, lambda: confirm(*_for_solver(result, subject_model, own_file))
    )
    unasked = result.unasked
    if why:
        unasked = (*unasked, f"FT901 {CODES['FT901'].title}: not asked: {why}")
    result = replace(result, answers=confirmed, unasked=unasked)
    ids = {answer.id for answer in result.findings}
    accepted = tuple(sorted(ids.intersection(selection.accepted)))
    result = replace(result, accepted=accepted)
    return replace(result, digest=digest_of(result))


def smt_text(result: Audit, model: Document) -> str:
    """Return a model and what is PROVED of it as SMT-LIB 2, for any solver."""
    try:
        return claims_text(
            *_for_solver(result, _model_of_answers(view(model, result.domain), model))
        )
    except CannotRunError as error:
        raise ReadError(str(error)) from error


def _model_of_answers(viewed: AuditView, model: Document) -> Document:
    """Return what answers are about: the rules for which a system may stand."""
    is_class = viewed.policy.decision == "strongest" and model is viewed.system
    return viewed.rules if is_class and viewed.rules is not None else model


def _for_solver(
    result: Audit, model: Document, file: ModelFile | None = None
) -> tuple[bytes, bytes]:
    """Return an audit without places, and its model: its YAML, or written anew."""
    moved = (replace(answer, places=()) for answer in result.answers)
    bare = msgspec.json.encode(replace(result, file=None, answers=tuple(moved)))
    if file is not None and file.name.endswith((".yaml", ".yml")):
        return bare, file.content
    return bare, find_format("yaml").write(model).content


def with_confirmations(
    answers: Sequence[AuditAnswer], confirmation: Callable[[], Report]
) -> tuple[tuple[AuditAnswer, ...], str]:
    """Return answers with what confirms each, and why nothing does if so.

    What it refutes is left out, and FT901 stands in its place.
    """
    if not any(isinstance(answer.state, Proved) for answer in answers):
        return (*answers,), ""
    try:
        report = confirmation()
    except (LossError, CannotRunError) as error:
        return (*answers,), str(error).partition("\n")[0]
    result: list[AuditAnswer] = []
    for place, answer in enumerate(answers):
        if isinstance(answer.state, Proved) and place in report.refuted:
            facts = {"code": answer.code, "detail": report.refuted[place]}
            refuted = audit_answer(
                "FT901.refuted",
                answer.subject,
                Computed("each PROVED answer was checked again"),
                facts=facts,
                rules=answer.rules,
                terms=answer.terms,
            )
            name = answer.id.replace(answer.code, refuted.code, 1)
            places, repeat = answer.places, answer.repeat
            answer = replace(refuted, id=name, places=places, repeat=repeat)
        elif isinstance(answer.state, Proved) and place in report.confirmed:
            state = replace(answer.state, confirmed=report.confirmed[place])
            answer = replace(answer, state=state)
        result.append(answer)
    why = _NO_SOLVER if report.unconfirmed else ""
    return tuple(sorted(result, key=lambda answer: answer.code)), why


def source_of(name: str, content: bytes) -> SourceFile:
    """Return the name of a file and the SHA-256 of its bytes."""
    return SourceFile(writable(name), hashlib.sha256(content).hexdigest())


def _answer_all(
    subject: Subject, wanted: set[str], answers: list[AuditAnswer], cut: dict[str, str]
) -> None:
    """Add the answers of all families, each within its part of the budget.

    `cut` gets the codes that were cut short or not begun, and why.
    """
    spent = f"the budget of {subject.settings.budget:g} million steps is spent"
    chosen = [(family, wanted & {*family.codes}) for family in FAMILIES]
    chosen = [(family, codes) for family, codes in chosen if codes]
    for number, (family, codes) in enumerate(chosen, 1):
        try:
            subject.budget.check()
            part = 1.0 if number == len(chosen) else family.part
            report = _reporter(subject.budget, number - 1, len(chosen))
            own = subject.budget.share(part, report=report)
            own.report(CODES[min(codes)].title, 0.0)
            for answer in family_answers(family, replace(subject, budget=own)):
                answers.append(answer)
                if isinstance(answer.state, Declined) and answer.state.code == _LATE:
                    cut[answer.code] = spent
        except OutOfStepsError:
            cut.update(dict.fromkeys(codes, spent))
        except MemoryError:
            cut.update(dict.fromkeys(codes, _TOO_LARGE))
        except KeyboardInterrupt:
            for _, rest in chosen[number - 1 :]:
                cut.update(dict.fromkeys(rest, INTERRUPTED))
            return


def _reporter(budget: Budget, position: int, count: int) -> Progress:
    """Return a function that reports a family's progress as part of the whole."""
    return lambda text, share: budget.report(text, (position + share) / count)


def family_answers(family: Family, subject: Subject) -> Iterator[AuditAnswer]:
    """Yield what the function of a family answers; its module is imported here."""
    module, _, name = family.function.partition(":")
    place = importlib.import_module(f"fuzzytree.auditing.findings.{module}")
    yield from getattr(place, name)(subject)


def _omissions(
    policy: Policy,
    wanted: Collection[str],
    answers: Sequence[AuditAnswer],
    cut: Mapping[str, str],
    reasons: Mapping[str, str],
) -> Iterator[str]:
    """Yield which codes have no answer and why, in order."""
    answered = Counter(answer.code for answer in answers)
    for code in sorted(AUDITED):
        name = f"{code} {CODES[code].title}"
        if code not in wanted:
            yield f"{name}: left out by the user"
        elif code in cut:
            begun = "not run"
            if answered[code]:
                begun = f"cut short after {counted(answered[code], 'answer')}"
            yield f"{name}: {begun}: {cut[code]}"
        elif code in reasons:
            yield f"{name}: {reasons[code]}"
        elif code in answered:
            continue
        elif policy.decision == "all" and CODES[code].decision == "strongest":
            yield f"{name}: not run: every rule takes part in the answer"
        elif answered and all(other.startswith("FTD") for other in answered):
            yield f"{name}: all that it applies to was declined"
        else:
            yield f"{name}: nothing in this model that it applies to"


def _with_places(
    answers: Iterable[AuditAnswer], viewed: AuditView, material: Material, repeat: str
) -> Iterator[AuditAnswer]:
    """Yield answers with ids, places and the commands that repeat them."""
    representations = [rules for rules in (viewed.rules, viewed.raw) if rules]
    for answer in with_ids(answers, representations, viewed.curves):
        numbers = [viewed.numbers[number - 1] for number in answer.rules]
        if not numbers and answer.subject in viewed.left_out:
            numbers = [viewed.left_out[answer.subject]]
        yield replace(
            answer,
            places=locations_of(answer, material.model, material.file, numbers),
            repeat=f"{writable(repeat)} --select {answer.code}" if repeat else "",
        )

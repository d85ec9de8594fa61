"""Where runtimes usually differ: ties, missing values, ends of curves, far outside.

Each question is a finite list of probes, answered by every form of a model in every
runtime at hand, and all answers must be alike.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.states import (
    Claim,
    Computed,
    Representation,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.support import rows_outside, sample_points
from fuzzytree.checking import ModelRun, compare_bits, row_set
from fuzzytree.errors import LossError
from fuzzytree.model import (
    FloatArray,
    FuzzySystem,
    FuzzyTree,
    Model,
    RuleBase,
    Run,
    Runtime,
    SystemOutcome,
    SystemRun,
    kind_of,
)
from fuzzytree.numerics import TIE, decide, exact_answer
from fuzzytree.runtimes import all_runtimes, is_installed
from fuzzytree.semantics import Status, few_probes, forms, probe_values

MOST: Final = 240
"""The most probes of one question."""

_OF_SYSTEMS = ("missing values", "infinite values", "far outside")
_BASES = 6  # rows in which one value is replaced
_TRIED = 1_000  # probes, and as many drawn points, among which ties are looked for
_FAR = (-1e300, -1e30, 1e30, 1e300)


class Convention(NamedTuple):
    """A convention, and the probes that test it, of shape (inputs, probes).

    How many probes were too many is counted; `fuzzytree check` tests all.
    """

    name: str
    values: FloatArray
    left_out: int = 0


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Compare all forms and runtimes where these usually differ.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    if subject.system is not None:
        yield from _of_system(subject, subject.system)
        return
    runs = [*_runs(subject.rules if subject.tree is None else subject.tree)]
    for question in questions(subject):
        subject.budget.check()
        values = question.values
        results = [ModelRun(title, form, run(values)) for title, form, run in runs]
        yield from convention_answers(subject, question, results)


def _runs(model: Model) -> Iterator[tuple[str, Model, Run]]:
    """Yield each form of a model in each runtime, the native ones first of a form."""
    for name, form in forms(model).items():
        kind = kind_of(form)
        for runtime in _runtimes():
            if kind in runtime.runs and is_installed(runtime):
                with contextlib.suppress(LossError):  # other comparisons report it
                    yield f"{runtime.name}: {name}", form, runtime.load(form)


def _runtimes() -> list[Runtime]:
    """Return the audited runtimes of float64, the baseline of the others first."""
    every = [
        one
        for one in all_runtimes()
        if (one.in_audits or one.is_definition) and one.dtype == "float64"
    ]
    return sorted(every, key=lambda one: not one.is_baseline)


def questions(subject: Subject) -> Iterator[Convention]:
    """Yield the conventions with their probes, at most `MOST` of each."""
    rules = subject.rules
    yield _ties(subject)
    aimed = few_probes(rules, 2 * MOST)[
        :MOST
    ]  # the first half: ends of all propositions
    bases = aimed[:: max(len(aimed) // _BASES, 1)][:_BASES]
    missing = ((name, math.nan) for name in rules.inputs)
    infinite = ((name, x) for name in rules.inputs for x in (math.inf, -math.inf))
    yield _question("missing values", rules, bases, missing)
    yield _question("infinite values", rules, bases, infinite)
    yield Convention("ends of curves and cuts", _values(rules, aimed))
    yield _question("far outside", rules, bases, _outside(subject))


def _question(
    name: str,
    rules: RuleBase,
    bases: Sequence[Mapping[str, float]],
    changes: Iterable[tuple[str, float]],
) -> Convention:
    """Return rows in which one value is replaced, in each of the bases."""
    every = [{**row, one: x} for one, x in changes for row in bases]
    rows = every[:: -(-len(every) // MOST) or 1]
    return Convention(name, _values(rules, rows), len(every) - len(rows))


def _values(rules: RuleBase, rows: Sequence[Mapping[str, float]]) -> FloatArray:
    table = [[row[name] for row in rows] for name in rules.inputs]
    return np.array(table, np.float64).reshape(len(rules.inputs), len(rows))


def _ties(subject: Subject) -> Convention:
    """Return the points on which rules tie exactly, of drawn ones and of probes."""
    points = np.hstack(
        [
            probe_values(subject.rules, _TRIED),
            sample_points(subject.rules, subject.domain, _TRIED, subject.settings.seed),
        ]
    )
    is_tied = np.zeros(points.shape[1], np.bool_)
    for rules in (subject.rules, subject.raw):
        if rules is not None:
            is_tied |= decide(rules, points, with_strengths=False).status == TIE
    tied = points[:, is_tied]
    return Convention("ties", tied[:, :MOST], max(tied.shape[1] - MOST, 0))


def _outside(subject: Subject) -> Iterator[tuple[str, float]]:
    """Yield values next to the domain, one width beyond it, and far away."""
    for name in subject.rules.inputs:
        side = subject.domain.side(name)
        if side is not None:
            width = min(side.high - side.low, 1e300)
            yield name, math.nextafter(side.low, -math.inf)
            yield name, math.nextafter(side.high, math.inf)
            yield name, max(side.low - width, -1e308)
            yield name, min(side.high + width, 1e308)
        for far in _FAR:
            yield name, far


def convention_answers(
    subject: Subject, question: Convention, results: Sequence[ModelRun]
) -> Iterator[AuditAnswer]:
    """Yield each representation that differs in a question, or that none does.

    The first of a form is compared with the first of all, the others with the first of
    their form. Raw rules are a model of their own.
    """
    first: dict[str, ModelRun] = {}
    rows = row_set(subject.rules.inputs, question.values, None)
    is_alike = True
    for one in results:
        form = one.title.rpartition(": ")[2]
        base = first.setdefault(form, one)
        if base is one and form != "raw rules":
            base = results[0]
        is_of_tree = type(one.model) is not type(base.model)
        answers, right = (_decision(x, has_ties=not is_of_tree) for x in (one, base))
        compared = compare_bits(answers, right, rows)
        if compared.differing:
            is_alike = False
            answer = _differing(
                question, one.title, compared.detail[0], compared.differing
            )
            numbers = [*compared.row_numbers]
            state = witness(subject, base.model, question.values[:, numbers])
            yield answer if state is None else replace(answer, state=state)
    if is_alike:
        yield _alike(question, [one.title for one in results])


def _decision(run: ModelRun, *, has_ties: bool) -> ModelRun:
    """Return answers without strengths, and without ties, unknown to a tree."""
    outcome = replace(run.outcome, strengths=None)
    if not has_ties:
        is_tie = outcome.status == Status.TIE
        status = np.where(is_tie, Status.DECIDED, outcome.status)
        outcome = replace(outcome, status=status.astype(np.int64))
    return replace(run, outcome=outcome)


def _alike(question: Convention, titles: Sequence[str]) -> AuditAnswer:
    name, count = question.name, question.values.shape[1]
    how = f"each generated row was answered by {', '.join(titles)}"
    if question.left_out:
        how += f"; {question.left_out} more generated rows were left out"
    message = "FT602.alike" if count else "FT602.none"
    facts = {"count": len(titles), "probes": count}
    return audit_answer(message, name, Computed(how), facts=facts)


def _differing(question: Convention, title: str, fact: str, count: int) -> AuditAnswer:
    """Return that a representation differs in some probes, and the first of them."""
    return audit_answer(
        "FT602.differs",
        f"{question.name}, {title}",
        Computed(f"both were run; {fact}"),
        facts={
            "convention": question.name,
            "representation": title,
            "count": count,
            "probes": question.values.shape[1],
            "detail": fact,
        },
    )


# --- systems


def _of_system(subject: Subject, system: FuzzySystem) -> Iterator[AuditAnswer]:
    """Compare a system's runtimes where values are missing, infinite or far away.

    How an answer came about must be alike, and which outputs have a number. Numbers
    are compared among the representations, within what rounding may do to them.
    """
    runs: list[tuple[str, SystemRun]] = []
    for runtime in _runtimes():
        if runtime.load_system is not None and is_installed(runtime):
            with contextlib.suppress(LossError):  # reported by the other comparisons
                runs.append((runtime.name, runtime.load_system(system)))
    for question in questions(subject):
        if question.name not in _OF_SYSTEMS:
            continue
        subject.budget.check()
        results = [(name, run(question.values)) for name, run in runs]
        yield from system_answers(subject, question, results)


def system_answers(
    subject: Subject, question: Convention, results: Sequence[tuple[str, SystemOutcome]]
) -> Iterator[AuditAnswer]:
    """Yield what runtimes of a system answer: each that differs, or that none does."""
    first, base = results[0]
    rows = row_set(subject.rules.inputs, question.values, None)
    is_alike = True
    for name, one in results[1:]:
        differ = one.status != base.status
        differ |= (np.isnan(one.outputs) != np.isnan(base.outputs)).any(axis=0)
        if differ.any():
            is_alike = False
            row = rows.text(int(np.flatnonzero(differ)[0]))
            fact = f"{row}: {first} gives a number to other outputs"
            yield _differing(question, name, fact, int(differ.sum()))
    if is_alike:
        yield _alike(question._replace(left_out=0), [name for name, _ in results])


# --- witnesses


def witness(subject: Subject, form: Model, values: FloatArray) -> Witness | None:
    """Return the first of some rows that lies in the domain, with a form's answer."""
    inside = ~rows_outside(subject.rules, subject.domain, values)
    inside &= np.isfinite(values).all(axis=0)
    for row in np.flatnonzero(inside).tolist()[:1]:
        named = dict(zip(form.inputs, values[:, row].tolist(), strict=True))
        of: Representation = "rules"
        if isinstance(form, FuzzyTree):
            of = "tree"
        elif form.kind == "raw" and subject.tree is not None:
            of = "raw rules"
        claim = Claim("decides", of=of, label=exact_answer(form, named).label)
        point = {name: Fraction(x) for name, x in named.items()}
        return Witness(coordinates(point), (claim,))
    return None

"""Do all representations of a model, in every installed runtime, answer as the model?

Bits are compared on probes of every proposition, and on the rows. A certificate bounds
what a number type can change on all of the domain, and a share of the rows, or of
random points, shows how often that could matter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Bracket, Computed, Declined, State
from fuzzytree.auditing.findings import conventions
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.support import sample_points, sampled_share
from fuzzytree.checking import check, probed
from fuzzytree.model import Agreement, Basis, Certified, Comparison, Dtype, Model
from fuzzytree.numerics import Certificate, certify
from fuzzytree.runtimes import all_runtimes
from fuzzytree.semantics import forms

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray
    from fuzzytree.runtimes import OnnxModel


PROBES: Final = 2_000
"""The most probes of a comparison."""

_DTYPES: Final[Mapping[str, Dtype]] = MappingProxyType(
    {"float64": "float64", "mixed": "mixed", "float32": "float32"}
)
_MOST_ROWS = 2_000  # rows or points that stand behind the probes


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Compare all representations of a model with it.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    subject.budget.check()
    values, how = _points(subject)
    result = agreement(subject, values)
    yield from agreement_answers(subject, result, values)
    if subject.system is None:
        models = {str(name): form for name, form in forms(_model(subject)).items()}
        for one in result.certificates:
            subject.budget.check()
            yield from _certified(
                subject, one, models[one.representation.rpartition(" in ")[0]], how
            )
    yield from conventions.answers(subject)


def _model(subject: Subject) -> Model:
    return subject.rules if subject.tree is None else subject.tree


def _points(subject: Subject) -> tuple[FloatArray, str]:
    """Return the user's rows, or drawn points without, and where they come from."""
    settings = subject.settings
    most = min(settings.rows, _MOST_ROWS)
    if subject.rows is None:
        points = sample_points(subject.rules, subject.domain, most, settings.seed)
        return points, f"points drawn evenly from the domain, seed {settings.seed}"
    values, name = subject.rows.values, subject.rows.name
    count = values.shape[1]
    if count <= most:
        return values, f"every row of {name}"
    chosen = np.random.default_rng(settings.seed).choice(count, most, replace=False)
    return values[:, np.sort(chosen)], f"rows drawn from {name}, seed {settings.seed}"


def agreement(
    subject: Subject, values: FloatArray, *others: Model | OnnxModel
) -> Agreement:
    """Return what a check finds of the model and its representations."""
    every = all_runtimes()
    if subject.system is not None:
        names = [one.name for one in every if one.in_audits or one.is_definition]
        return check(subject.system, data=values, runtimes=names, limit=PROBES)
    names = [one.name for one in every if one.in_audits]
    return check(_model(subject), *others, data=values, runtimes=names, limit=PROBES)


def agreement_answers(
    subject: Subject, result: Agreement, values: FloatArray
) -> Iterator[AuditAnswer]:
    """Yield an answer for each disagreement of a check, and a summary of the rest."""
    clean: dict[Basis, list[Comparison]] = {}
    for one in result.comparisons:
        if one.verdict in ("DISAGREES", "rows only"):
            yield _disagreement(subject, one, values)
        elif one.verdict == "agrees":  # raw rules differ from a tree by design: FT203
            basis = "proof" if one.basis in ("file", "all cells") else one.basis
            clean.setdefault(basis, []).append(one)
    for basis, ones in clean.items():
        yield _agreeing(basis, ones)
    for text in result.skipped:
        if text.startswith("all cells"):  # a proof covers them
            continue
        name = text.partition(" is not installed")[0].partition(": ")[0]
        yield audit_answer("FT601.not-compared", name, Declined("FTD08", text))


def _disagreement(subject: Subject, one: Comparison, values: FloatArray) -> AuditAnswer:
    noun = "rows" if one.basis == "rows" else "ways"
    facts = "; ".join(one.detail[:2])
    state: State = Computed(f"both were run or read; {facts}")
    if subject.system is None and one.row_numbers:
        model = _model(subject)
        models = {str(name): form for name, form in forms(model).items()}
        form = models.get(_form(one), model)
        rows = probed(model, values, PROBES).values
        witness = conventions.witness(subject, form, rows[:, [*one.row_numbers]])
        state = witness or state
    measures = (
        Measure("rows that differ", one.differing),
        Measure("rows of another class", one.flips),
        Measure("largest difference", one.largest_difference),
    )
    known: dict[str, FactValue]
    known = {"against": one.against, "rows": one.rows, "noun": noun}
    return audit_answer(
        "FT601.disagrees",
        one.representation,
        state,
        measures=measures,
        facts=known | ({"detail": facts} if facts else {}),
    )


def _form(one: Comparison) -> str:
    """Return the form of the model that a title names, after its runtime."""
    return one.representation.rpartition(": ")[2]


def _agreeing(basis: Basis, ones: Iterable[Comparison]) -> AuditAnswer:
    """Return the answer that sums up comparisons in which nothing differs."""
    ones = [*ones]
    how = "; ".join(
        f"{c.representation} and {c.against}: {c.rows}, {c.origin}" for c in ones
    )
    messages = {"rows": "FT601.alike", "calls": "FT601.alike-by-calls"}
    return audit_answer(
        messages.get(basis, "FT601.equal"),
        f"representations, by {basis}",
        Computed(how),
        facts={"count": len(ones), "rows": max(one.rows for one in ones)},
    )


# --- what a number type can change


def _certified(
    subject: Subject, one: Certified, form: Model, how: str
) -> Iterator[AuditAnswer]:
    """Yield the bound of a number type's error, and where it leaves a class open."""
    name = one.representation
    if one.verdict == "DISAGREES":
        facts = {"detail": "; ".join(one.detail[:2])}
        compared = Computed("each row was compared with its exact answer")
        yield audit_answer("FT601.exceeds", name, compared, facts=facts)
    bound = certify(_within(form, subject.domain), _DTYPES[one.dtype])
    measures = []
    if bound.delta is not None:
        measures.append(Measure("certified error of a strength", bound.delta))
        measures.append(Measure("margin that is certain", 2.0 * bound.delta))
    if one.largest is not None:
        measures.append(Measure("largest error seen", one.largest))
    yield audit_answer(
        "FT601.certified",
        name,
        _bounded(bound, one),
        measures=tuple(measures),
        facts={"bound": bound.sentence},
    )
    if one.on == "data" and one.rows:
        noun = "rows" if subject.rows is not None else "points"
        share = sampled_share(
            f"{noun} within the band of {name}", one.in_band, one.rows, how
        )
        yield audit_answer(
            "FT601.band",
            f"{name}, its band",
            share,
            facts={"representation": name, "noun": noun},
        )


def _bounded(bound: Certificate, one: Certified) -> State:
    origin = bound.origin.replace("the declared ranges", "the domain")
    if bound.delta is not None or not bound.reasons:
        return Computed(origin)
    largest = one.largest or 0.0
    of = f"the largest error of a strength of {one.representation}"
    return Bracket(of, largest, 1.0, "; ".join(bound.reasons))


def _within(form: Model, domain: Domain) -> Model:
    """Return a model that declares the domain as the ranges of its variables."""
    sides = {side.variable: side for side in domain.sides}
    variables = tuple(
        replace(one, low=sides[one.name].low, high=sides[one.name].high)
        if one.name in sides
        else one
        for one in form.variables
    )
    return replace(form, variables=variables)

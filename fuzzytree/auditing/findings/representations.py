"""Do all representations of a model, in every installed runtime, answer as the model?

Bits are compared on probes of every proposition, on rows, and where runtimes usually
differ: at ties, missing or infinite values, ends of curves, outside the domain. A
certificate bounds what a number type can change on all of the domain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Bracket, Computed, Declined, State
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.support import (
    rows_outside,
    sample_points,
    share_in_sample,
)
from fuzzytree.checking import check
from fuzzytree.model import Agreement, Certified, Comparison, Dtype, Model, Variable
from fuzzytree.numerics import TIE, certify, decide
from fuzzytree.runtimes import all_runtimes
from fuzzytree.semantics import forms, probe_values

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray
    from fuzzytree.runtimes import OnnxModel

PROBES: Final = 2_000  # the most probes of a comparison
_MOST_ROWS = 2_000  # rows or points that stand behind the probes


class Result(NamedTuple):
    """What a check says, and its rows of generated values from the number `first` on.

    `values` has the shape (inputs, rows).
    """

    agreement: Agreement
    values: FloatArray
    first: int = 0


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Compare all representations of a model with it, and bound what types change."""
    subject.budget.check()
    values, how = _rows(subject)
    result = agreement(subject, values)
    yield from agreement_answers(result.agreement)
    yield from convention_answers(subject, result)
    models = {}
    if subject.system is None:
        models = {str(name): form for name, form in forms(_model(subject)).items()}
    for certified in result.agreement.certificates:
        subject.budget.check()
        form = models[certified.representation.rpartition(" in ")[0]]
        yield from _error_bound(subject, certified, form, how)


def _model(subject: Subject) -> Model:
    return subject.tree or subject.rules


def _rows(subject: Subject) -> tuple[FloatArray, str]:
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
) -> Result:
    """Return what a check finds of the model and its representations.

    Special values of a system stand behind its rows, those of rules among the probes.
    """
    system, model = subject.system, _model(subject)
    names = [
        runtime.name
        for runtime in all_runtimes()
        if runtime.in_audits or (system is not None and runtime.is_definition)
    ]
    probes = probe_values(model if system is None else subject.rules, PROBES)
    if system is None:
        result = check(model, *others, data=values, runtimes=names, limit=PROBES)
        return Result(result, probes)
    data = np.hstack([values, probes])
    result = check(system, data=data, runtimes=names, limit=PROBES)
    return Result(result, probes, result.probes + values.shape[1])


# --- FT601: is there a disagreement?


def agreement_answers(result: Agreement) -> Iterator[AuditAnswer]:
    """Yield an answer for each disagreement of a check, and a summary of the rest."""
    clean: dict[str, list[Comparison]] = {}
    for compared in result.comparisons:
        if compared.verdict in ("DISAGREES", "rows only"):
            yield _disagreement(compared)
        elif compared.verdict == "agrees":  # raw rules differ by design: FT203
            is_proof = compared.basis in ("file", "all cells")
            title = "proof" if is_proof else str(compared.basis)
            clean.setdefault(title, []).append(compared)
    messages = {"rows": "FT601.alike", "calls": "FT601.alike-by-calls"}
    for title, group in clean.items():
        parts = (
            f"{c.representation} and {c.against}: {c.rows}, {c.origin}" for c in group
        )
        facts = {"count": len(group), "rows": max(c.rows for c in group)}
        message, name = (
            messages.get(title, "FT601.equal"),
            f"representations, by {title}",
        )
        yield audit_answer(message, name, Computed("; ".join(parts)), facts=facts)
    for text in result.skipped:
        if not text.startswith("all cells"):  # a proof covers them
            name = text.partition(" is not installed")[0].partition(": ")[0]
            yield audit_answer("FT601.not-compared", name, Declined("FTD08", text))


def _disagreement(compared: Comparison) -> AuditAnswer:
    detail = "; ".join(compared.detail[:2])
    facts = {
        "against": compared.against,
        "rows": compared.rows,
        "noun": "rows" if compared.basis == "rows" else "ways",
        **({"detail": detail} if detail else {}),
    }
    return audit_answer(
        "FT601.disagrees",
        compared.representation,
        Computed(f"both were run or read; {detail}"),
        Measure("rows that differ", compared.differing),
        Measure("rows of another class", compared.flips),
        Measure("largest difference", compared.largest_difference),
        facts=facts,
    )


# --- FT602: do they agree where runtimes usually differ?


def convention_answers(subject: Subject, result: Result) -> Iterator[AuditAnswer]:
    """Yield for each convention which representation breaks it, or that none does."""
    every = [c for c in result.agreement.comparisons if c.basis == "rows"]
    most = max((c.rows for c in every), default=0)
    alike = [c for c in every if c.verdict == "agrees" and c.rows == most]
    names = dict.fromkeys(name for c in alike for name in (c.representation, c.against))
    for convention, rows in _conventions(subject, result.values).items():
        numbers = {result.first + row for row in rows}
        is_broken = False
        for compared in every if numbers else ():
            last = zip(compared.row_numbers[::-1], compared.detail[::-1], strict=False)
            faults = [text for row, text in last if row in numbers]
            if compared.verdict == "DISAGREES" and faults:
                is_broken = True
                title, against = compared.representation, compared.against
                facts = {"representation": title, "against": against}
                facts |= {"convention": convention, "detail": faults[-1]}
                state = Computed(f"both were run; {faults[-1]}")
                name = f"{convention}, {title}"
                yield audit_answer("FT602.differs", name, state, facts=facts)
        if not is_broken:
            state = Computed(f"each generated row was answered by {', '.join(names)}")
            message = "FT602.alike" if rows else "FT602.none"
            counts = {"count": len(alike) + 1, "probes": len(rows)}
            yield audit_answer(message, convention, state, facts=counts)


def _conventions(subject: Subject, values: FloatArray) -> dict[str, Sequence[int]]:
    """Return the rows that show each convention."""
    is_finite = np.isfinite(values).all(axis=0)
    is_missing = np.isnan(values).any(axis=0)
    is_outside = is_finite & rows_outside(subject.rules, subject.domain, values)
    masks = {
        "missing values": is_missing,
        "infinite values": ~is_finite & ~is_missing,
        "far outside": is_outside,
    }
    if subject.system is None:
        status = decide(subject.rules, values, with_strengths=False).status
        masks["ties"] = status == TIE
        masks["ends of curves and cuts"] = is_finite & ~is_outside
    return {name: np.flatnonzero(mask).tolist() for name, mask in masks.items()}


# --- what a number type can change


def _error_bound(
    subject: Subject, certified: Certified, form: Model, how: str
) -> Iterator[AuditAnswer]:
    """Yield the bound of a number type's error, and where it leaves a class open."""
    name, measures = certified.representation, list[Measure]()
    if certified.verdict == "DISAGREES":
        facts = {"detail": "; ".join(certified.detail[:2])}
        state: State = Computed("each row was compared with its exact answer")
        yield audit_answer("FT601.exceeds", name, state, facts=facts)
    bound = certify(_within(form, subject.domain), cast("Dtype", certified.dtype))
    state = Computed(bound.origin.replace("the declared ranges", "the domain"))
    if bound.delta is not None:
        measures.append(Measure("certified error of a strength", bound.delta))
        measures.append(Measure("margin that is certain", 2.0 * bound.delta))
    elif bound.reasons:
        of = f"the largest error of a strength of {name}"
        state = Bracket(of, certified.largest or 0.0, 1.0, "; ".join(bound.reasons))
    if certified.largest is not None:
        measures.append(Measure("largest error seen", certified.largest))
    facts = {"bound": bound.sentence}
    yield audit_answer("FT601.certified", name, state, *measures, facts=facts)
    if certified.on == "data" and certified.rows:
        noun = "rows" if subject.rows is not None else "points"
        of, hits = f"{noun} within the band of {name}", certified.in_band
        state = share_in_sample(of, hits, certified.rows, how)
        facts = {"representation": name, "noun": noun}
        yield audit_answer("FT601.band", f"{name}, its band", state, facts=facts)


def _within(form: Model, domain: Domain) -> Model:
    """Return a model that declares the domain as the ranges of its variables."""
    sides = {side.variable: (side.low, side.high) for side in domain.sides}
    variables: list[Variable] = []
    for variable in form.variables:
        low, high = sides.get(variable.name, (variable.low, variable.high))
        variables.append(replace(variable, low=low, high=high))
    return replace(form, variables=tuple(variables))

"""What changed from one model to another: structure by identity, decisions by proof."""

from __future__ import annotations

import msgspec

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Proved
from fuzzytree.auditing.diff.decisions import class_answers
from fuzzytree.auditing.diff.numbers import number_answers
from fuzzytree.auditing.diff.records import ComparedModel, Difference
from fuzzytree.auditing.diff.samples import (
    Pair,
    Progress,
    all_inputs,
    silent,
    union,
)
from fuzzytree.auditing.diff.structure import Structure
from fuzzytree.auditing.findings.audit import source_of, with_confirmations
from fuzzytree.auditing.findings.domains import Limits, Words, domain_of, limit_domain
from fuzzytree.auditing.findings.locations import ModelFile
from fuzzytree.auditing.findings.records import AuditAnswer, AuditSettings, SourceFile
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.errors import ReadError
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    Document,
    FuzzySystem,
    RuleBase,
    fingerprint,
    kind_of,
    name_choice,
    version,
)
from fuzzytree.rechecking import Report, recheck_difference
from fuzzytree.semantics import as_rules, rules_of


def check_common_inputs(old: Document, new: Document, names: tuple[str, str]) -> None:
    """Refuse two models that are about different things.

    Raises:
        ReadError: If no input of one is an input of the other.
    """
    before, after = old.inputs, new.inputs
    if before and after and not set(before) & set(after):
        raise ReadError(
            f"{names[1]}: has no input in common with {names[0]}: it uses "
            f"{', '.join(map(repr, after))}, and that uses "
            f"{', '.join(map(repr, before))}"
        )


def common_domain(
    old: Document,
    new: Document,
    limits: Limits,
    rows: AuditRows | None = None,
) -> Domain:
    """Return where two models are compared: what either of them declares.

    `limits` go before what is declared; `rows` are for inputs without range and curve.

    Raises:
        ValueError: If an input has no limits, or if those given are none.
    """
    inputs = all_inputs(old, new)
    for name in limits:
        if name not in inputs:
            raise ValueError(
                f"limits for {name!r}, which is no input; {name_choice(name, inputs)}"
            )
    sides: dict[str, DomainSide] = {}
    for model in (old, new):
        own_rows = None
        if rows is not None:
            places = [inputs.index(name) for name in model.inputs]
            own_rows = AuditRows(rows.name, rows.values[places])
        for side in domain_of(model, rows=own_rows, limited=limits).sides:
            earlier = sides.get(side.variable)
            origins = (earlier.origin if earlier else "unused", side.origin)
            if origins[0] == "unused" or origins == ("curves", "model"):
                sides[side.variable] = side
            elif earlier is not None and earlier.origin == side.origin:
                sides[side.variable] = msgspec.structs.replace(
                    side,
                    low=min(earlier.low, side.low),
                    high=max(earlier.high, side.high),
                    values=tuple(sorted({*earlier.values, *side.values})),
                )
    domain = Domain(tuple(sides.values()))
    if limits:
        domain = limit_domain(domain, limits, union(old, new))
    ends = {side.variable: side for side in domain.sides}
    return Domain(tuple(ends[name] for name in inputs))


def difference(
    old: Document,
    new: Document,
    *,
    domain: Domain,
    rows: AuditRows | None = None,
    settings: AuditSettings | None = None,
    budget: Budget | None = None,
    report: Progress = silent,
    files: tuple[ModelFile | None, ModelFile | None] = (None, None),
    data: SourceFile | None = None,
) -> Difference:
    """Return what changed from one model to another.

    Raises:
        ReadError: If one decides and the other gives numbers.

    Example:
        >>> from fuzzytree.auditing.findings.domains import domain_of
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, combinations=0)
        >>> difference(tree, tree, domain=domain_of(tree)).verdict
        'equal'
    """
    settings = settings or AuditSettings()
    budget = budget or Budget()
    models, inputs = (old, new), all_inputs(old, new)
    both = tuple(map(_as_rules, models))
    report("comparing decisions", 0.1)
    match both:
        case RuleBase() as first, RuleBase() as second:
            are_trees = bool(old.leaves and new.leaves)
            rules = Pair(first, second, inputs, domain, are_trees)
            answers, evidence = class_answers(rules, rows, settings, budget, report)
        case FuzzySystem() as first, FuzzySystem() as second:
            systems = Pair(first, second, inputs, domain)
            answers, evidence = number_answers(systems, rows, settings, budget, report)
        case _:
            place = [bool(model.outputs) for model in both].index(True)
            file = files[place]
            raise ReadError(
                f"{file.name if file else models[place].name}: is a fuzzy system whose "
                "outputs are numbers, and is not compared with rules or a tree"
            )
    report("comparing rules", 0.9)
    changes = Structure(first, second, domain, evidence, models, files).changes
    order = {"breaking": 0, "non-breaking": 1, "cosmetic": 2}
    compared = [
        ComparedModel(
            model.name,
            kind_of(model),
            fingerprint(model),
            source_of(file.name, file.content) if file else None,
        )
        for model, file in zip(models, files, strict=True)
    ]
    words = Words(domain, union(old, new).variables)
    result = Difference(
        version(),
        compared[0],
        compared[1],
        data,
        0 if rows is None else rows.values.shape[1],
        words.domain,
        settings,
        tuple(sorted(changes, key=lambda change: order[change.grade])),
        tuple(map(words.answer, answers)),
    )
    return _confirm(result, models)


def _as_rules(model: Document) -> RuleBase | FuzzySystem:
    """Return a model as rules; a system whose outputs are numbers as it is."""
    rules = rules_of(model)
    return rules if isinstance(rules, RuleBase) else as_rules(rules) or rules


def _confirm(result: Difference, models: tuple[Document, Document]) -> Difference:
    """Return a comparison whose PROVED answers a solver confirms, if one is at hand."""

    def confirmation() -> Report:
        old, new = (find_format("yaml").write(model).content for model in models)
        names = "the comparison", "old.yaml", "new.yaml"
        return recheck_difference(result.to_json().encode(), old, new, names)

    answers, why = with_confirmations(result.answers, confirmation)
    if why:
        answers = tuple(_with_reason(answer, why) for answer in answers)
    return msgspec.structs.replace(result, answers=answers)


def _with_reason(answer: AuditAnswer, why: str) -> AuditAnswer:
    """Return an answer that says why nothing confirms it, if it is PROVED."""
    state = answer.state
    if not isinstance(state, Proved) or state.confirmed:
        return answer
    how = f"{state.how}; not confirmed: {why}"
    state = msgspec.structs.replace(state, how=how)
    return msgspec.structs.replace(answer, state=state)

"""What changed from one model to another: structure by identity, decisions by proof."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Proved
from fuzzytree.auditing.diff.decisions import (
    Progress,
    RulePair,
    all_inputs,
    decisions,
    silent,
    union,
)
from fuzzytree.auditing.diff.difference_records import (
    Change,
    ComparedModel,
    DecisionEvidence,
    Difference,
    Draft,
    grade,
)
from fuzzytree.auditing.diff.structure import draft_changes
from fuzzytree.auditing.diff.system_differences import draft_system_changes
from fuzzytree.auditing.diff.system_numbers import SystemPair, number_answers
from fuzzytree.auditing.findings.audit import source_of, with_confirmations
from fuzzytree.auditing.findings.domains import Limits, Words, domain_of, limited
from fuzzytree.auditing.findings.locations import ModelFile
from fuzzytree.auditing.findings.records import AuditAnswer, AuditSettings, SourceFile
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.errors import ReadError
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    Document,
    FuzzySystem,
    FuzzyTree,
    Path,
    RuleBase,
    fingerprint,
    kind_of,
    name_choice,
    version,
)
from fuzzytree.rechecking import Report, recheck_difference
from fuzzytree.semantics import as_rules, rules_from_tree


def check_common_inputs(old: Document, new: Document, names: tuple[str, str]) -> None:
    """Refuse two models that are about different things.

    Raises:
        ReadError: If no input of one is an input of the other.
    """
    one, other = old.inputs, new.inputs
    if one and other and not set(one) & set(other):
        raise ReadError(
            f"{names[1]}: has no input in common with {names[0]}: it uses "
            f"{', '.join(map(repr, other))}, and that uses "
            f"{', '.join(map(repr, one))}"
        )


def joined_domain(
    old: Document,
    new: Document,
    limits: Limits,
    rows: AuditRows | None = None,
) -> Domain:
    """Return where two models are compared: what either of them declares.

    Args:
        old: A model.
        new: Another one.
        limits: The ends of inputs, which go before what is declared.
        rows: Rows of the inputs of either, for inputs without range and curve.

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
            known = sides.get(side.variable)
            origins = (known.origin if known else "unused", side.origin)
            if origins[0] == "unused" or origins == ("curves", "model"):
                sides[side.variable] = side
            elif known is not None and known.origin == side.origin:
                sides[side.variable] = msgspec.structs.replace(
                    side,
                    low=min(known.low, side.low),
                    high=max(known.high, side.high),
                    values=tuple(sorted({*known.values, *side.values})),
                )
    domain = Domain(tuple(sides.values()))
    if limits:
        domain = limited(domain, limits, union(old, new))
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

    Args:
        old: A tree, a rule base or a fuzzy system.
        new: Another one.
        domain: A side for each input of either.
        rows: Rows of the inputs of either, the old one's first.
        settings: How many points are drawn, and their seed.
        budget: How many steps may be taken.
        report: Called with the current step, and the share of the work that is done.
        files: Where the two were read from.
        data: Where the rows were read from.

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
    both = old, new
    systems = [one for one in both if isinstance(one, FuzzySystem)]
    systems = [one for one in systems if as_rules(one, None) is None]
    if len(systems) == 2:
        first, second = systems
        drafts = [*draft_system_changes(first, second)]
        numbers = SystemPair(first, second, all_inputs(old, new), domain)
        answers = number_answers(numbers, rows, settings, budget, report)
        is_equal = any(one.subject == "decisions" for one in answers)  # proved
        has_number = any(one.is_finding for one in answers)
        evidence = DecisionEvidence(is_equal=is_equal, has_number=has_number)
    else:
        pair = _rule_pair(both, files, domain)
        report("comparing rules", 0.0)
        drafts = [*draft_changes(pair.old, pair.new, domain, pair.trees)]
        report("comparing decisions", 0.1)
        answers, evidence = decisions(pair, rows, settings, budget, report)
    changes = [_placed(one, evidence, both, files) for one in drafts]
    order = {"breaking": 0, "non-breaking": 1, "cosmetic": 2}
    one, other = (
        ComparedModel(
            model.name,
            kind_of(model),
            fingerprint(model),
            source_of(file.name, file.content) if file else None,
        )
        for model, file in zip(both, files, strict=True)
    )
    words = Words(domain, union(old, new).variables)
    result = Difference(
        version(),
        one,
        other,
        data,
        0 if rows is None else rows.values.shape[1],
        words.domain,
        settings,
        tuple(sorted(changes, key=lambda change: order[change.grade])),
        tuple(map(words.answer, answers)),
    )
    return _confirmed(result, both)


def _confirmed(result: Difference, models: tuple[Document, Document]) -> Difference:
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


def _rule_pair(
    models: Sequence[Document], files: Sequence[ModelFile | None], domain: Domain
) -> RulePair:
    """Return two models as rules.

    Raises:
        ReadError: If the outputs of one are numbers.
    """
    rules: list[RuleBase] = []
    for model, file in zip(models, files, strict=True):
        known: RuleBase | FuzzySystem | None
        known = rules_from_tree(model) if isinstance(model, FuzzyTree) else model
        if isinstance(known, FuzzySystem):
            known = as_rules(known, None)
        if known is None:
            raise ReadError(
                f"{file.name if file else model.name}: is a fuzzy system whose outputs "
                "are numbers, and is not compared with rules or a tree"
            )
        rules.append(known)
    old, new = rules
    trees = [model for model in models if isinstance(model, FuzzyTree)]
    both = (trees[0], trees[1]) if len(trees) == 2 else None
    return RulePair(old, new, all_inputs(old, new), domain, both)


def _placed(
    draft: Draft,
    evidence: DecisionEvidence,
    models: Sequence[Document],
    files: Sequence[ModelFile | None],
) -> Change:
    """Return a change with its grade and its places; a tree's rules are its leaves."""
    places = [
        None if file is None or path is None else file.place(_path(model, path))
        for file, path, model in zip(files, (draft.old, draft.new), models, strict=True)
    ]
    change = grade(draft, evidence)
    return msgspec.structs.replace(change, old=places[0], new=places[1])


def _path(model: Document, path: Path) -> Path:
    match model:
        case FuzzyTree() if path[0] == "rules":
            return ("leaves", *path[1:])
        case FuzzySystem():  # that stands for rules
            return ("blocks", 0, *path) if path[:1] == ("rules",) else path
        case _:
            return path

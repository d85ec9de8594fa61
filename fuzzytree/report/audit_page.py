"""An audit as one HTML page: it needs no network, and can be read without its script.

The page is `templates/page.html` with its style and script, filled with the parts that
are made here. The same audit gives the same bytes. What a policy of content allows is
the page's own style and script, named by their digests, and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from fuzzytree.auditing import Audit, AuditAnswer, AuditRows, Declined, view
from fuzzytree.model import Agreement, FuzzySystem, FuzzyTree, RuleBase
from fuzzytree.report.audit import (
    ORIGINS,
    SUMMARY,
    asked_text,
    found_text,
    gathered,
    summary_rows,
)
from fuzzytree.report.audit_findings import (
    Scene,
    anchors,
    findings_section,
)
from fuzzytree.report.audit_model import rules_section, terms_section, tree_section
from fuzzytree.report.audit_rows import data_of, passing
from fuzzytree.report.audit_states import (
    as_in_file,
    gravest_first,
    known_as,
    result_text,
    state_note,
)
from fuzzytree.report.drawing import Markup, axes_of, joined
from fuzzytree.report.parts import part, whole_page
from fuzzytree.report.stability import advice, criterion_row
from fuzzytree.report.stability import stability_verdict as stability_text
from fuzzytree.report.text import agreement_verdict as agreement_text
from fuzzytree.report.text import certified_row, comparison_row, counted, number

if TYPE_CHECKING:
    from fuzzytree.checking import Stability

MOST_QUESTIONS = 1000
"""That are listed one by one."""

_MOST_DECLINED = 100  # reasons that are listed

_Section = tuple[str, str, Markup]  # its anchor, its title, its content
_FORMS = {"tree": "a tree", "rules": "a rule base", "system": "a fuzzy system"}


def page(
    audit: Audit,
    model: FuzzyTree | RuleBase | FuzzySystem,
    *,
    rows: AuditRows | None = None,
    agreement: Agreement | None = None,
    stability: Stability | None = None,
) -> str:
    """Return an audit as a page for a browser.

    Args:
        audit: What was found.
        model: What was audited.
        rows: The user's rows, in the order of the model's inputs.
        agreement: The result of a check of the same model.
        stability: The result of a study of the same model.

    Example:
        >>> from fuzzytree.auditing.findings.records import Policy, AuditSettings
        >>> from fuzzytree.auditing.engine.domain import Domain
        >>> from fuzzytree.testing import random_tree
        >>> tree, nothing = random_tree(1), Domain(())
        >>> audit = Audit("0.1", tree.name, "tree", "", None, None, 0,
        ...     Policy("min", "strongest"), nothing, AuditSettings(), (), (), (), True)
        >>> "Nothing found" in page(audit, tree)
        True
    """
    audit = as_in_file(audit)
    sections = [*_sections(audit, model, rows, agreement, stability)]
    return whole_page(
        title=f"{audit.model}: audit",
        head=_head(audit, model),
        verdict=verdict(audit),
        sections=sections,
        body=joined(part("section", *section) for section in sections),
    )


def _sections(
    audit: Audit,
    model: FuzzyTree | RuleBase | FuzzySystem,
    rows: AuditRows | None,
    agreement: Agreement | None,
    stability: Stability | None,
) -> Iterator[_Section]:
    axes = axes_of(model, audit.domain)
    data = data_of(model, rows) if rows is not None else None
    viewed = view(model, audit.domain)
    findings = gravest_first(audit.findings)
    if isinstance(model, FuzzyTree):
        passed = passing(model, data) if data is not None else None
        yield "tree", "The tree", tree_section(model, passed)
    yield "terms", "Variables and terms", terms_section(model, axes, data)
    links = _links(findings)
    yield "rules", "Rules", rules_section(viewed, audit.answers, links)
    scene = Scene(axes, viewed)
    shown = findings_section(findings, scene, audit.accepted)
    yield "findings", "Findings", shown
    yield "questions", "All questions", _questions(audit)
    if agreement is not None:
        yield "agreement", "Agreement", agreement_section(agreement)
    if stability is not None:
        yield "stability", "Numerical stability", stability_section(stability)
    yield "limits", "What this audit does not establish", part("limits", audit)
    yield "repeat", "How to repeat it", _repeat(audit)


def _head(audit: Audit, model: FuzzyTree | RuleBase | FuzzySystem) -> Markup:
    data = "no table was given"
    if audit.data is not None:
        data = f"{audit.data.name}, {counted(audit.rows, 'row')}"
    elif audit.rows:
        data = counted(audit.rows, "row")
    results = [
        ("agreement" if one.verb == "check" else one.verb, result_text(one))
        for one in audit.results
    ]
    classes = None if isinstance(model, FuzzySystem) else model.classes
    kind = _FORMS.get(audit.form, audit.form)
    return part("head", audit, kind, classes, _policy_text(audit), data, results)


def _policy_text(audit: Audit) -> str:
    policy = audit.policy
    if policy.decision == "all":
        return f"AND is {policy.conjunction}; every rule that fires takes part"
    who = "the first of the strongest rules wins"
    none = [
        f"{what}: {'no class' if label is None else label}"
        for what, label in (
            ("no rule fires", policy.uncovered),
            ("a missing value", policy.missing),
        )
    ]
    return f"AND is {policy.conjunction}; {'; '.join([who, *none])}"


def _links(findings: Sequence[AuditAnswer]) -> dict[int, Markup]:
    """Return links to the findings about each rule, by its number: one for a code."""
    about: dict[int, dict[str, list[str]]] = {}
    for answer, name in zip(findings, anchors(findings), strict=True):
        for k in dict.fromkeys(answer.rules):
            about.setdefault(k, {}).setdefault(answer.code, []).append(name)
    return {k: part("links", codes) for k, codes in about.items()}


def _questions(audit: Audit) -> Markup:
    declined = [
        *dict.fromkeys(
            f"{one.subject}: {state_note(one.state)}"
            for one in audit.answers
            if isinstance(one.state, Declined)
        )
    ]
    if len(declined) > _MOST_DECLINED:
        more = len(declined) - _MOST_DECLINED
        declined[_MOST_DECLINED:] = [f"and {more} more in the JSON"]
    title = f"Every question, {len(audit.answers)} in all"
    if len(audit.answers) > MOST_QUESTIONS:
        title += f"; the first {MOST_QUESTIONS} are here, the JSON has all"
    return part(
        "questions",
        SUMMARY,
        [*summary_rows(audit)],
        [*gathered(audit.unasked)],
        declined,
        title,
        audit.answers[:MOST_QUESTIONS],
    )


def _repeat(audit: Audit) -> Markup:
    sources = [("model", audit.file), ("table", audit.data)]
    names = {"check": "check", "stability": "study of stability"}
    sources += [(names[one.verb], one.file) for one in audit.results]
    settings: list[tuple[str, str]] = []
    for name in audit.settings.__struct_fields__:
        value: float = getattr(audit.settings, name)
        unit = " s" if name.endswith("_s") else ""
        settings.append((name.removesuffix("_s"), f"{number(value)}{unit}"))
    sides = [
        (
            side.variable,
            f"{'above ' if side.is_open else ''}{side.low!r}",
            repr(side.high),
            ORIGINS[side.origin],
        )
        for side in audit.domain.sides[:MOST_QUESTIONS]
    ]
    return part("repeat", audit, _command(audit.answers), sources, settings, sides)


def _command(answers: Sequence[AuditAnswer]) -> str:
    """Return the command of the audit: what the commands of all answers share.

    The command of an answer is that of the audit with `--select` and its code.
    """
    commands = {one.repeat.removesuffix(f" --select {one.code}") for one in answers}
    return commands.pop() if len(commands) == 1 else ""


_MOST_URGENT = 12  # findings that are named


def verdict(audit: Audit) -> Markup:
    """Return what was found, in words, and how it is known."""
    states = known_as(audit.answers)
    found, said = found_text(audit), asked_text(audit)
    open_ones = {id(one) for one in audit.open_findings if one.severity != "info"}
    findings = gravest_first(audit.findings)
    urgent: dict[tuple[str, str], list[tuple[AuditAnswer, str]]] = {}
    for one, name in zip(findings, anchors(findings), strict=True):
        if id(one) in open_ones:
            urgent.setdefault((one.code, one.sentence), []).append((one, name))
    shown = [(*alike[0], len(alike)) for alike in urgent.values()]
    return part(
        "verdict",
        _sign(audit, states),
        f"{found[0].upper()}{found[1:]}",
        f"{said[0].upper()}{said[1:]}",
        audit.is_complete,
        shown[:_MOST_URGENT],
        len(shown) - _MOST_URGENT,
        states,
    )


def _sign(audit: Audit, states: Mapping[str, int]) -> str:
    """Return the icon of a verdict: no audit that left something open looks calm."""
    if findings := gravest_first(audit.open_findings):
        return findings[0].severity
    declined = states["DECLINED"]
    if declined and declined == len(audit.answers):
        return "declined"
    return "calm" if audit.is_complete and not declined else "info"


_MOST_CALM = 12  # comparisons that agree and are not folded


def agreement_section(agreement: Agreement) -> Markup:
    """Return the result of a check as a table."""
    calm = [one for one in agreement.comparisons if one.verdict == "agrees"]
    if len(calm) <= _MOST_CALM:
        calm = []
    wrong = [one for one in agreement.comparisons if one not in calm]
    details = [line for one in agreement.comparisons for line in one.detail]
    details += [line for one in agreement.certificates for line in one.detail]
    return part(
        "agreement",
        agreement_text(agreement),
        [*map(comparison_row, wrong)],
        [*map(comparison_row, calm)],
        [*map(certified_row, agreement.certificates)],
        details,
        agreement.skipped,
    )


def stability_section(study: Stability) -> Markup:
    """Return the result of a study as a table of its stability checks."""
    probes, tried = counted(study.probes, "probe"), counted(study.tried, "row")
    return part(
        "stability",
        f"{stability_text(study)} ({probes}, {tried})",
        [*map(criterion_row, study.criteria)],
        [*advice(study)],
        [f"{one.code}: {line}" for one in study.criteria for line in one.detail],
        [f"{one.code}: {line}" for one in study.criteria for line in one.skipped],
    )

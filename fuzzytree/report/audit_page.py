"""An audit as one HTML page: it needs no network, and can be read without its script.

The page is `templates/page.html` with its style and script, filled with the parts that
are made here. The same audit gives the same bytes. What a policy of content allows is
the page's own style and script, named by their digests, and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from fuzzytree.auditing import Audit, AuditAnswer, AuditRows, view
from fuzzytree.model import Agreement, Document
from fuzzytree.report.audit import (
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
)
from fuzzytree.report.drawing import axes_of
from fuzzytree.report.markup import Markup
from fuzzytree.report.models import missing_text
from fuzzytree.report.parts import part, whole_page

if TYPE_CHECKING:
    from fuzzytree.checking import Stability

MOST_QUESTIONS = 1000
"""That are listed one by one."""

_Section = tuple[str, str, Markup]  # its anchor, its title, its content


def page(
    audit: Audit,
    model: Document,
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
        >>> from fuzzytree.auditing.decide.domain import Domain
        >>> from fuzzytree.testing import random_tree
        >>> tree, nothing = random_tree(1), Domain(())
        >>> audit = Audit("0.1", tree.name, "tree", "", None, None, 0,
        ...     Policy("minimum", "strongest"), nothing, AuditSettings(), (), (), (),
        ...     is_complete=True)
        >>> "Nothing found" in page(audit, tree)
        True
    """
    audit = as_in_file(audit)
    missing = audit.policy.missing or "no class"
    if model.classes:
        missing = missing_text(model)
    sections = [*_sections(audit, model, rows, agreement, stability)]
    return whole_page(
        title=f"{audit.model}: audit",
        head=part("head", audit, model.classes or None, missing),
        verdict=verdict(audit),
        sections=sections,
        body=[part("section", *section) for section in sections],
    )


def _sections(
    audit: Audit,
    model: Document,
    rows: AuditRows | None,
    agreement: Agreement | None,
    stability: Stability | None,
) -> Iterator[_Section]:
    axes = axes_of(model, audit.domain)
    data = data_of(model, rows) if rows is not None else None
    viewed = view(model, audit.domain)
    findings = gravest_first(audit.findings)
    if model.leaves:
        passed = passing(model, data) if data is not None else None
        yield "tree", "The tree", tree_section(model, passed)
    yield "terms", "Variables and terms", terms_section(model, axes, data)
    links = _links(findings)
    yield "rules", "Rules", rules_section(viewed, audit.answers, links)
    scene = Scene(axes, viewed)
    shown = findings_section(findings, scene, audit.accepted)
    yield "findings", "Findings", shown
    asked, unasked = audit.answers[:MOST_QUESTIONS], [*gathered(audit.unasked)]
    shown = part("questions", audit, SUMMARY, [*summary_rows(audit)], unasked, asked)
    yield "questions", "All questions", shown
    if agreement is not None:
        yield "agreement", "Agreement", part("agreement", agreement)
    if stability is not None:
        yield "stability", "Numerical stability", part("stability", stability)
    yield "limits", "What this audit does not establish", part("limits", audit)
    command, sides = _command(audit.answers), audit.domain.sides[:MOST_QUESTIONS]
    repeat = part("repeat", audit, command, sides)
    yield "repeat", "How to repeat it", repeat


def _links(findings: Sequence[AuditAnswer]) -> dict[int, Markup]:
    """Return links to the findings about each rule, by its number: one for a code."""
    about: dict[int, dict[str, list[str]]] = {}
    for answer, name in zip(findings, anchors(findings), strict=True):
        for k in dict.fromkeys(answer.rules):
            about.setdefault(k, {}).setdefault(answer.code, []).append(name)
    return {k: part("links", codes) for k, codes in about.items()}


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

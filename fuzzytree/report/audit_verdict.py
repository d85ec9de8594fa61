"""What an audit found, in a few lines: the head of its page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from fuzzytree.auditing.findings.records import Answer, Audit
from fuzzytree.report.audit_findings import anchors, gravest_first
from fuzzytree.report.audit_states import (
    SEVERITIES,
    STATES,
    icon,
    known_as,
    state_badge,
)
from fuzzytree.report.markup import Content, Markup, joined, listed, tag, text
from fuzzytree.report.text import counted

_MOST_URGENT = 12  # findings that are named
_MOST_ALIKE = 3  # of one code and severity


def verdict(audit: Audit) -> Markup:
    """Return what was found, in words, and how it is known."""
    findings = gravest_first(audit.open_findings)
    states = known_as(audit.answers)
    sign, said = _result(findings, states, is_complete=audit.is_complete)
    accepted = len(audit.findings) - len(findings)
    if accepted:
        said += f"; {counted(accepted, 'other')} {'is' if accepted == 1 else 'are'} "
        said += "accepted"
    asked = counted(len(audit.answers), "question")
    whole = f"The audit is complete: {asked} asked, all of them answered or declined"
    if not audit.is_complete:
        by = "by hand" if audit.was_interrupted else "by its budget"
        whole = f"The audit was cut short {by}: {asked} asked, others were not"
    shown = [
        tag("li", state_badge(word), tag("b", str(states[word])), f" {meaning}")
        for word, meaning in STATES.items()
    ]
    return joined(
        [
            tag("p", icon(sign), said, class_=f"said {sign}"),
            tag("p", whole, class_="whole" if audit.is_complete else "whole cut"),
            _urgent(findings, gravest_first(audit.findings)),
            tag("ul", *shown, class_="known"),
        ]
    )


def _result(
    findings: Sequence[Answer], states: Mapping[str, int], *, is_complete: bool
) -> tuple[str, str]:
    """Return a sign and a sentence: what was found, and what that is worth."""
    counts = {one: sum(f.severity == one for f in findings) for one in SEVERITIES}
    told = [counted(counts[one], SEVERITIES[one]) for one in SEVERITIES if counts[one]]
    if told:
        worst = next(one for one in SEVERITIES if counts[one])
        verb = "was" if len(findings) == 1 else "were"
        others = ", ".join(told[:-1])
        return worst, f"{others}{' and ' if others else ''}{told[-1]} {verb} found"
    whole, declined = sum(states.values()), states["DECLINED"]
    if declined and declined == whole:
        return "declined", "Nothing was decided: every question was declined"
    said = "Nothing was found" if is_complete else "Nothing was found so far"
    if declined:
        said += f"; {declined} of {whole} questions were declined"
    return "calm" if is_complete and not declined else "info", said


def _urgent(findings: Sequence[Answer], named: Sequence[Answer]) -> Markup | None:
    """Return links to the errors and warnings among findings.

    Args:
        findings: Those that are not accepted.
        named: All, in the order of the page.
    """
    told = {id(one) for one in findings if one.severity != "info"}
    urgent: dict[tuple[str, str], list[tuple[Answer, str]]] = {}
    for one, name in zip(named, anchors(named), strict=True):
        if id(one) in told:
            urgent.setdefault((one.code, one.sentence), []).append((one, name))
    if not urgent:
        return None
    items: list[Content] = []
    kinds: Counter[tuple[str, str]] = Counter()
    for alike in urgent.values():
        one, name = alike[0]
        kinds[one.code, one.severity] += 1
        if kinds[one.code, one.severity] > _MOST_ALIKE or len(items) == _MOST_URGENT:
            continue
        times = f" {len(alike)} times" if len(alike) > 1 else ""
        parts = [
            tag("span", icon(one.severity), class_=one.severity),
            tag("a", one.sentence, href=f"#{name}"),
            text(times) if times else None,
            " ",
            tag("span", one.code, class_="code"),
        ]
        items.append(joined(parts))
    more = len(urgent) - len(items)
    if more > 0:
        items.append(tag("a", f"and {more} more", href="#findings"))
    return listed(items, class_="urgent")

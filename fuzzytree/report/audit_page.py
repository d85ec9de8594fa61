"""An audit as one HTML page: it needs no network, and can be read without its script.

The page is `audit.html` with its style and script, filled with what is made here. The
same audit gives the same bytes. What a policy of content allows is the page's own style
and script, named by their digests, and nothing else.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from string import Template
from typing import TYPE_CHECKING

from fuzzytree.auditing import CODES, Answer, Audit, AuditRows, Declined, view
from fuzzytree.model import Agreement, Comparison, FuzzySystem, FuzzyTree, RuleBase
from fuzzytree.report.audit import ORIGINS, gathered
from fuzzytree.report.audit_findings import (
    Scene,
    anchors,
    facts_section,
    findings_section,
    gravest_first,
)
from fuzzytree.report.audit_model import (
    class_name,
    rules_section,
    terms_section,
    tree_section,
)
from fuzzytree.report.audit_rows import data_of, passing
from fuzzytree.report.audit_states import (
    SEVERITIES,
    STATES,
    as_in_file,
    icon,
    known_as,
    result_text,
    state_badge,
    state_note,
    state_word,
)
from fuzzytree.report.drawing import axes_of
from fuzzytree.report.markup import (
    Content,
    Markup,
    folded,
    joined,
    listed,
    table,
    tag,
    text,
)
from fuzzytree.report.stability import CRITERION, advice, criterion_row
from fuzzytree.report.stability import stability_verdict as stability_text
from fuzzytree.report.text import (
    CERTIFIED,
    COMPARISON,
    certified_row,
    comparison_row,
    counted,
    number,
)
from fuzzytree.report.text import agreement_verdict as agreement_text

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
        >>> "Nothing was found" in page(audit, tree)
        True
    """
    audit = as_in_file(audit)
    sections = [*_sections(audit, model, rows, agreement, stability)]
    links = [tag("li", tag("a", title, href=f"#{name}")) for name, title, _ in sections]
    shown = [
        tag(
            "section",
            tag("h2", title, id=f"{name}-title"),
            content,
            id=name,
            aria_labelledby=f"{name}-title",
        )
        for name, title, content in sections
    ]
    whole = (
        resources.files("fuzzytree.report").joinpath("audit.html").read_text("utf-8")
    )
    return Template(whole).substitute(
        policy=_policy(whole),
        title=text(f"{audit.model}: audit"),
        head=_head(audit, model),
        verdict=verdict(audit),
        links=joined(links),
        body=joined(shown),
    )


def _policy(whole: str) -> str:
    """Return what the page may do: run its own style and script."""
    allowed: list[str] = []
    for kind in ("script", "style"):
        found = re.search(f"<{kind}>(.*?)</{kind}>", whole, re.DOTALL)
        content = found[1] if found else ""
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        allowed.append(f"{kind}-src 'sha256-{digest}'")
    others = "base-uri 'none'; form-action 'none'"
    return f"default-src 'none'; {'; '.join(allowed)}; {others}"


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
    linked = _links(findings)
    yield "rules", "Rules", rules_section(viewed, audit.answers, linked)
    scene = Scene(axes, viewed)
    shown = findings_section(findings, scene, audit.accepted)
    yield "findings", "Findings", shown
    facts = facts_section(audit.answers)
    if facts is not None:
        yield "facts", "What else is known", facts
    yield "questions", "All questions", _questions(audit)
    if agreement is not None:
        yield "agreement", "Agreement", agreement_section(agreement)
    if stability is not None:
        yield "stability", "Numerical stability", stability_section(stability)
    yield "limits", "What this audit does not establish", _limits(audit)
    yield "repeat", "How to repeat it", _repeat(audit)


def _head(audit: Audit, model: FuzzyTree | RuleBase | FuzzySystem) -> Markup:
    said = f"fuzzytree audit of {_FORMS.get(audit.form, audit.form)}"
    file = audit.file.name if audit.file else "a model in memory"
    facts: list[tuple[str, Content]] = [("read from", tag("code", file))]
    if not isinstance(model, FuzzySystem):
        names = [class_name(label, k) for k, label in enumerate(model.classes[:12])]
        more = len(model.classes) - len(names)
        names += [text(f"and {more} more")] if more > 0 else []
        facts.append(("classes", joined(names, " ")))
    facts.append(("decides", _policy_text(audit)))
    data = "no table was given"
    if audit.data is not None:
        data = f"{audit.data.name}, {counted(audit.rows, 'row')}"
    elif audit.rows:
        data = counted(audit.rows, "row")
    facts.append(("rows", data))
    for result in audit.results:
        section = "agreement" if result.verb == "check" else result.verb
        facts.append((section, tag("a", result_text(result), href=f"#{section}")))
    pairs = [tag("div", tag("dt", name), tag("dd", said)) for name, said in facts]
    return joined(
        [
            tag("p", said, class_="kicker"),
            tag("h1", audit.model),
            tag("dl", *pairs, class_="about"),
        ]
    )


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


def _links(findings: Sequence[Answer]) -> dict[int, list[Markup]]:
    """Return links to the findings about each rule, by its number: one for a code."""
    about: dict[int, dict[str, list[str]]] = {}
    for answer, name in zip(findings, anchors(findings), strict=True):
        for k in dict.fromkeys(answer.rules):
            about.setdefault(k, {}).setdefault(answer.code, []).append(name)
    return {
        k: [
            joined(
                [
                    tag("a", code, href=f"#{names[0]}"),
                    text(f" ({len(names)})") if len(names) > 1 else None,
                ]
            )
            for code, names in codes.items()
        ]
        for k, codes in about.items()
    }


def _questions(audit: Audit) -> Markup:
    groups: dict[str, list[Answer]] = {}
    for answer in audit.answers:
        groups.setdefault(answer.code, []).append(answer)
    rows: list[Sequence[Content]] = []
    for code, answers in groups.items():
        title = CODES[code].title if code in CODES else ""
        found = sum(answer.is_finding for answer in answers)
        states = [str(n) if n else "·" for n in known_as(answers).values()]
        rows.append((code, title, str(len(answers)), str(found), *states))
    head = ("code", "question", "count", "findings", *map(str.lower, STATES))
    right = tuple(range(2, len(head)))
    summary = table(head, rows, caption="Questions by code", right=right, sorts=True)
    parts: list[Content] = [summary]
    if audit.unasked:
        parts += [tag("h3", "Not examined"), listed(gathered(audit.unasked))]
    declined = [one for one in audit.answers if isinstance(one.state, Declined)]
    if declined:
        lines = (f"{one.subject}: {state_note(one.state)}" for one in declined)
        listing: list[Content] = [*dict.fromkeys(lines)]
        if len(listing) > _MOST_DECLINED:
            more = len(listing) - _MOST_DECLINED
            listing[_MOST_DECLINED:] = [f"and {more} more in the JSON"]
        parts += [tag("h3", "Declined"), listed(listing)]
    each: list[Sequence[Content]] = [
        (
            answer.code,
            answer.subject,
            state_badge(state_word(answer.state)),
            "yes" if answer.is_finding else "no",
            joined([answer.sentence, tag("small", state_note(answer.state))]),
        )
        for answer in audit.answers[:MOST_QUESTIONS]
    ]
    head = ("code", "about", "known as", "finding", "answer")
    said = f"Every question, {len(audit.answers)} in all"
    if len(audit.answers) > MOST_QUESTIONS:
        said += f"; the first {MOST_QUESTIONS} are here, the JSON has all"
    whole = table(head, each, caption="Every question with its answer", sorts=True)
    parts.append(folded(said, whole))
    return joined(parts)


def _limits(audit: Audit) -> Markup:
    return tag("div", listed(audit.limits), class_="panel")


def _repeat(audit: Audit) -> Markup:
    facts: list[tuple[str, Content]] = [("fuzzytree", audit.version)]
    command = _command(audit.answers)
    if command:
        facts.insert(0, ("command", tag("code", command, class_="copied")))
    facts.append(("the model", audit.model))
    facts.append(("its content, SHA-256", tag("code", audit.fingerprint)))
    sources = [("model", audit.file), ("table", audit.data)]
    names = {"check": "check", "stability": "study of stability"}
    sources += [(names[one.verb], one.file) for one in audit.results]
    for what, source in sources:
        if source is not None:
            facts.append((f"the {what}'s file", tag("code", source.name)))
            facts.append(("its bytes, SHA-256", tag("code", source.sha256)))
    facts.append(("this audit, SHA-256", tag("code", audit.digest or "not taken")))
    for name in audit.settings.__struct_fields__:
        value: float = getattr(audit.settings, name)
        unit = " s" if name.endswith("_s") else ""
        facts.append((name.removesuffix("_s"), f"{number(value)}{unit}"))
    pairs = [tag("div", tag("dt", name), tag("dd", said)) for name, said in facts]
    head = ("variable", "from", "to", "where that comes from")
    sides = [
        (
            side.variable,
            tag("code", f"{'above ' if side.is_open else ''}{side.low!r}"),
            tag("code", repr(side.high)),
            ORIGINS[side.origin],
        )
        for side in audit.domain.sides[:MOST_QUESTIONS]
    ]
    caption = "The domain: the audit covers these ranges and no others"
    return joined(
        [
            tag("dl", *pairs, class_="facts-list"),
            table(head, sides, caption=caption, right=(1, 2), is_compact=True),
        ]
    )


def _command(answers: Sequence[Answer]) -> str:
    """Return the command of the audit: what the commands of all answers share.

    The command of an answer is that of the audit with `--select` and its code.
    """
    found = {one.repeat.removesuffix(f" --select {one.code}") for one in answers}
    return found.pop() if len(found) == 1 else ""


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
    questions = counted(len(audit.answers), "question")
    whole = f"The audit is complete: {questions}, all answered or declined"
    if not audit.is_complete:
        by = "by hand" if audit.was_interrupted else "by its budget"
        whole = f"The audit was cut short {by}: {questions} examined, others were not"
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
    listing = [
        counted(counts[one], SEVERITIES[one]) for one in SEVERITIES if counts[one]
    ]
    if listing:
        worst = next(one for one in SEVERITIES if counts[one])
        verb = "was" if len(findings) == 1 else "were"
        others = ", ".join(listing[:-1])
        return worst, f"{others}{' and ' if others else ''}{listing[-1]} {verb} found"
    whole, declined = sum(states.values()), states["DECLINED"]
    if declined and declined == whole:
        return "declined", "Nothing was decided: every question was declined"
    said = "Nothing was found" if is_complete else "Nothing was found so far"
    if declined:
        said += f"; {declined} of {whole} questions were declined"
    return "calm" if is_complete and not declined else "info", said


def _urgent(findings: Sequence[Answer], named: Sequence[Answer]) -> Markup | None:
    """Return links to the errors and warnings among findings."""
    listing = {id(one) for one in findings if one.severity != "info"}
    urgent: dict[tuple[str, str], list[tuple[Answer, str]]] = {}
    for one, name in zip(named, anchors(named), strict=True):
        if id(one) in listing:
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


_MOST_CALM = 12  # comparisons that agree and are not folded
_MOST_LISTED = 200  # sentences


def agreement_section(found: Agreement) -> Markup:
    """Return the result of a check as a table."""
    calm = [one for one in found.comparisons if one.verdict == "agrees"]
    if len(calm) <= _MOST_CALM:
        calm = []
    shown = [one for one in found.comparisons if one not in calm]
    parts: list[Content] = [tag("p", agreement_text(found), class_="lead")]
    if shown:
        parts.append(_compared(shown, "Comparisons"))
    if calm:
        said = f"{counted(len(calm), 'comparison')} agree"
        parts.append(folded(said, _compared(calm, "Comparisons that agree")))
    if found.certificates:
        bounds = map(certified_row, found.certificates)
        parts.append(table(CERTIFIED, bounds, caption="What rounding can change"))
    details = [line for one in found.comparisons for line in one.detail]
    details += [line for one in found.certificates for line in one.detail]
    parts += [_folded("Differences", details), _folded("Not examined", found.skipped)]
    return joined(parts)


def _compared(found: Sequence[Comparison], caption: str) -> Markup:
    rows = map(comparison_row, found)
    return table(COMPARISON, rows, caption=caption, right=(3, 4, 5), sorts=True)


def stability_section(found: Stability) -> Markup:
    """Return the result of a study as a table of its stability checks."""
    rows = map(criterion_row, found.criteria)
    details = [f"{one.code}: {line}" for one in found.criteria for line in one.detail]
    missed = [f"{one.code}: {line}" for one in found.criteria for line in one.skipped]
    probes, tried = counted(found.probes, "probe"), counted(found.tried, "row")
    return joined(
        [
            tag("p", f"{stability_text(found)} ({probes}, {tried})", class_="lead"),
            table(CRITERION, rows, caption="Stability checks", right=(2, 3)),
            _folded("What to do", [*advice(found)]),
            _folded("What was measured", details),
            _folded("Not tried", missed),
        ]
    )


def _folded(name: str, listing: list[str] | tuple[str, ...]) -> Markup | None:
    if not listing:
        return None
    shown: list[Content] = [*listing[:_MOST_LISTED]]
    if len(listing) > _MOST_LISTED:
        shown.append(f"and {len(listing) - _MOST_LISTED} more")
    return folded(f"{name} ({len(listing)})", listed(shown))

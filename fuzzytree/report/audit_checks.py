"""Agreement and stability on the page of an audit, where their results are given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fuzzytree.model.agreement import Agreement, Comparison
from fuzzytree.report.markup import Content, Markup, folded, joined, listed, table, tag
from fuzzytree.report.stability import advice
from fuzzytree.report.text import counted, verdict_text

if TYPE_CHECKING:
    from fuzzytree.checking.stability.results import Stability

_MOST_CALM = 12  # comparisons that agree and are not folded
_MOST_TOLD = 200  # sentences


def agreement_section(found: Agreement) -> Markup:
    """Return the result of a check as a table."""
    calm = [one for one in found.comparisons if one.verdict == "agrees"]
    if len(calm) <= _MOST_CALM:
        calm = []
    shown = [one for one in found.comparisons if one not in calm]
    parts: list[Content] = [tag("p", verdict_text(found), class_="lead")]
    if shown:
        parts.append(_compared(shown, "What was held against what"))
    if calm:
        said = f"{counted(len(calm), 'comparison')} agree"
        parts.append(folded(said, _compared(calm, "What agrees")))
    if found.certificates:
        bounds = [
            (
                one.carrier,
                "-" if one.largest is None else f"{one.largest:.2g}",
                f"{one.in_band} of {one.rows}",
                str(one.flips),
                one.verdict,
                one.sentence,
            )
            for one in found.certificates
        ]
        names = ["against exact arithmetic", "largest error", "inside the band"]
        names += ["flips", "verdict", "certified"]
        parts.append(table(names, bounds, caption="What rounding can change"))
    told = [line for one in found.comparisons for line in one.detail]
    told += [line for one in found.certificates for line in one.detail]
    parts += [_folded("What differed", told), _folded("Not examined", found.skipped)]
    return joined(parts)


def _compared(found: Sequence[Comparison], caption: str) -> Markup:
    rows = [
        (
            one.carrier,
            one.against,
            one.basis,
            str(one.rows),
            f"{one.largest_difference:.2g}",
            f"{one.allowed:.2g}",
            str(one.flips),
            one.verdict,
        )
        for one in found
    ]
    head = ("carrier", "against", "on", "rows", "largest difference", "allowed")
    whole = (*head, "flips", "verdict")
    return table(whole, rows, caption=caption, right=(3, 4, 5, 6), sorts=True)


def stability_section(found: Stability) -> Markup:
    """Return the result of a study as a table of its criteria."""
    failing = sum(one.verdict == "FAILS" for one in found.criteria)
    said = "No criterion fails"
    if failing:
        verb = "fails" if failing == 1 else "fail"
        said = f"{failing} of {counted(len(found.criteria), 'criterion', 'criteria')}"
        said += f" {verb}"
    said += (
        f"; tried on {counted(found.probes, 'probe')} and {counted(found.tried, 'row')}"
    )
    rows = [
        (
            one.code,
            one.title,
            str(one.cases) if one.cases else "-",
            "-" if one.worst is None else f"{one.worst:.2g}",
            one.verdict,
        )
        for one in found.criteria
    ]
    head = ("code", "criterion", "cases", "worst", "verdict")
    shown = table(head, rows, caption="Criteria", right=(2, 3))
    told = [f"{one.code}: {line}" for one in found.criteria for line in one.detail]
    missed = [f"{one.code}: {line}" for one in found.criteria for line in one.skipped]
    return joined(
        [
            tag("p", said, class_="lead"),
            shown,
            _folded("What to do", [*advice(found)]),
            _folded("What was measured", told),
            _folded("Not tried", missed),
        ]
    )


def _folded(name: str, told: list[str] | tuple[str, ...]) -> Markup | None:
    if not told:
        return None
    shown: list[Content] = [*told[:_MOST_TOLD]]
    if len(told) > _MOST_TOLD:
        shown.append(f"and {len(told) - _MOST_TOLD} more")
    return folded(f"{name} ({len(told)})", listed(shown))

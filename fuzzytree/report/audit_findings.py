"""The findings of an audit on its page: what, where, how it is known, what to do."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing import (
    CODES,
    AuditAnswer,
    AuditView,
    Bracket,
    Severity,
    Span,
    Witness,
    point_of,
)
from fuzzytree.model import RuleBase
from fuzzytree.report.drawing import Axis
from fuzzytree.report.markup import Markup
from fuzzytree.report.parts import part
from fuzzytree.report.svg_terms import span_text, terms_picture
from fuzzytree.report.text import counted

MOST_FINDINGS = 300
"""The most that are listed one by one."""

MOST_PICTURED = 30
"""That have pictures: the first, and the gravest stand first."""

MOST_WHOLE = 3
"""Of a code that are shown whole; of the others all but errors are folded."""

_PLAIN = re.compile(r"[A-Za-z0-9-]{1,60}")


def anchors(findings: Sequence[AuditAnswer]) -> list[str]:
    """Return a name for each finding by which links find it: its id if it has one."""
    names: dict[str, None] = {}
    for place, answer in enumerate(findings, 1):
        is_plain = _PLAIN.fullmatch(answer.id) and answer.id not in names
        names[answer.id if is_plain else f"finding_{place}"] = None
    return [*names]


def findings_section(
    findings: Sequence[AuditAnswer], scene: Scene, accepted: Collection[str] = ()
) -> Markup:
    """Return all findings, the gravest first, those of one code together."""
    names = anchors(findings)
    shown = [*zip(findings, names, strict=True)][:MOST_FINDINGS]
    groups: dict[tuple[Severity, str], list[ShownFinding]] = {}
    for place, (answer, name) in enumerate(shown):
        group = groups.setdefault((answer.severity, answer.code), [])
        group.append(
            ShownFinding(
                answer,
                name,
                answer.id in accepted,
                answer.severity == "error" or len(group) < MOST_WHOLE,
                _concerned(answer, scene),
                _region_text(answer.region, scene),
                pictures(answer, name, scene) if place < MOST_PICTURED else None,
            )
        )
    notes: list[str] = []
    if len(findings) > len(shown):
        more = counted(len(findings) - len(shown), "more finding")
        notes.append(f"{more}: the JSON has all of them")
    if len(shown) > MOST_PICTURED:
        notes.append(f"Only the first {MOST_PICTURED} findings have pictures")
    known = [(code, CODES.get(code), some) for (_, code), some in groups.items()]
    return part("findings", known, notes)


class ShownFinding(NamedTuple):
    """A finding as the page shows it; links find it by its name."""

    answer: AuditAnswer
    name: str
    is_accepted: bool
    is_whole: bool
    concerned: list[str]
    where: str
    pictures: Markup | None


def _region_text(region: Sequence[Span], scene: Scene) -> str:
    units = {span.variable: scene.axes.get(span.variable) for span in region}
    return " and ".join(
        f"{span.variable} is {span_text(span, axis.unit if axis else '')}"
        for span, axis in zip(region, units.values(), strict=True)
    )


def _concerned(answer: AuditAnswer, scene: Scene) -> list[str]:
    """Return the rules and terms that a finding is about, in words."""
    viewed = scene.viewed
    rules = viewed.rules.rules if viewed.rules else ()
    classes = viewed.rules.classes if viewed.rules else ()
    numbers = [k for k in answer.rules if 0 < k <= len(rules)]
    items: list[str] = []
    for k in numbers[:6]:
        name = viewed.rule_name(k)
        items.append(part("concerned_rule", k, name, rules[k - 1], classes))
    if len(numbers) > 6:
        items.append(f"and {counted(len(numbers) - 6, 'more rule')}")
    if not numbers:
        items += [f"{one.variable} is {one.term}" for one in answer.terms[:6]]
        if len(answer.terms) > 6:
            items.append(f"and {counted(len(answer.terms) - 6, 'more term')}")
    return items


_MOST_BARS = 6  # of one finding


class Scene(NamedTuple):
    """All variables by name, and the rules as they are audited."""

    axes: Mapping[str, Axis]
    viewed: AuditView


def pictures(answer: AuditAnswer, name: str, scene: Scene) -> Markup:
    """Return a picture of each variable that a finding is about, with its region."""
    point: dict[str, Fraction] = {}
    words: dict[str, str] = {}
    if isinstance(answer.state, (Witness, Bracket)):
        point = point_of(answer.state.point)
        words = {one.input: one.word for one in answer.state.point}
    spans = answer.region
    if not spans and isinstance(answer.state, Witness):
        spans = answer.state.region
    region = {span.variable: span for span in spans}
    values = axis_values(scene.viewed.rules, point)
    shown = _concerning(answer, region, values, scene)
    bars = [
        (
            _bar_text(
                axis,
                region.get(axis.name),
                values.get(axis.name),
                words.get(axis.name, ""),
            ),
            terms_picture(
                axis,
                None,
                f"{name}-v{k}",
                span=region.get(axis.name),
                value=values.get(axis.name),
                named={one.term for one in answer.terms if one.variable == axis.name},
            )[0],
        )
        for k, axis in enumerate(shown[:_MOST_BARS])
    ]
    undrawn = ", ".join(axis.name for axis in shown[_MOST_BARS:])
    return part("pictures", bars, undrawn)


def _bar_text(axis: Axis, span: Span | None, value: float | None, word: str) -> str:
    said = [span_text(span, axis.unit, 3)] if span else []
    said += [] if value is None else [f"witness {word or f'{value:.4g}'}"]
    return f"{axis.name}: {'; '.join(said)}" if said else axis.name


def axis_values(
    rules: RuleBase | None, point: Mapping[str, Fraction]
) -> dict[str, float]:
    """Return the value of every variable at a point, as far as it is known.

    Example:
        >>> from fuzzytree.model.rulebase import Part, Rule, Variable
        >>> sums = Variable("sum", parts=(Part("a", 2.0, 1.0),))
        >>> rules = RuleBase("r", ("k",), (Variable("a"), sums), (Rule((), "k"),))
        >>> axis_values(rules, {"a": Fraction(1, 4)})
        {'a': 0.25, 'sum': -1.5}
    """
    values = {name: float(value) for name, value in point.items()}
    for variable in rules.variables if rules else ():
        if variable.parts and all(one.input in point for one in variable.parts):
            products = (
                Fraction(one.weight) * (point[one.input] - Fraction(one.centre))
                for one in variable.parts
            )
            values[variable.name] = float(sum(products))
    return values


def _concerning(
    answer: AuditAnswer,
    region: Mapping[str, Span],
    values: Mapping[str, float],
    scene: Scene,
) -> list[Axis]:
    """Return the variables to draw: of the region, or else of the rules and terms."""
    names = dict.fromkeys(region)
    if not names:
        names = dict.fromkeys(one.variable for one in answer.terms)
    rules = scene.viewed.rules
    if not names and rules is not None and values:
        for k in answer.rules[:2]:
            if 0 < k <= len(rules.rules):
                names |= dict.fromkeys(c.variable for c in rules.rules[k - 1].when)
    return [scene.axes[one] for one in names if one in scene.axes]

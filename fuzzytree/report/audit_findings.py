"""The findings of an audit on its page: what, where, how it is known, what to do."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.auditing import (
    CODES,
    Answer,
    AuditView,
    Bracket,
    FileLocation,
    Measure,
    Severity,
    Span,
    Witness,
    point_of,
)
from fuzzytree.model import RuleBase
from fuzzytree.report.audit_model import MOST_RULES, sentence_of
from fuzzytree.report.audit_states import (
    SEVERITIES,
    evidence,
    severity_badge,
    state_badge,
    state_word,
)
from fuzzytree.report.drawing import Axis
from fuzzytree.report.markup import Content, Markup, folded, joined, listed, tag, text
from fuzzytree.report.svg_terms import bar_picture, map_picture, span_text, windows
from fuzzytree.report.text import counted, number

MOST_FINDINGS = 300
"""The most that are listed one by one."""

MOST_PICTURED = 30
"""That have pictures: the first, and the gravest stand first."""

MOST_MAPPED = 10
"""That have maps of the decision: one takes up to a second."""

MOST_WHOLE = 3
"""Of a code that are shown whole; of the others all but errors are folded."""

MOST_FACTS = 8
"""The most facts of a code, beside its findings."""

_SHORT = 16  # characters of a fraction that a reader may want to see
_PLAIN = re.compile(r"[A-Za-z0-9-]{1,60}")


def anchors(findings: Sequence[Answer]) -> list[str]:
    """Return a name for each finding by which links find it: its id if it has one."""
    names: dict[str, None] = {}
    for place, answer in enumerate(findings, 1):
        is_plain = _PLAIN.fullmatch(answer.id) and answer.id not in names
        names[answer.id if is_plain else f"finding_{place}"] = None
    return [*names]


def gravest_first(findings: Sequence[Answer]) -> list[Answer]:
    """Return findings by severity, then by code, else in their order."""
    order = {severity: place for place, severity in enumerate(SEVERITIES)}
    return sorted(findings, key=lambda one: (order[one.severity], one.code))


def findings_section(
    findings: Sequence[Answer], scene: Scene, accepted: Collection[str] = ()
) -> Markup:
    """Return all findings, the gravest first, those of one code together."""
    if not findings:
        return tag("p", "There is no finding.")
    names = anchors(findings)
    shown = [*zip(findings, names, strict=True)][:MOST_FINDINGS]
    groups: dict[tuple[Severity, str], list[Markup]] = {}
    for place, (answer, name) in enumerate(shown):
        known = answer.id in accepted
        drawn: Drawn = "nothing" if place >= MOST_PICTURED else "bars"
        if place < MOST_MAPPED:
            drawn = "maps"
        group = groups.setdefault((answer.severity, answer.code), [])
        is_whole = answer.severity == "error" or len(group) < MOST_WHOLE
        group.append(
            _finding(answer, name, scene, drawn, is_known=known, is_whole=is_whole)
        )
    parts = [_group(code, shown) for (_, code), shown in groups.items()]
    more = len(findings) - len(shown)
    if more > 0:
        said = f"{counted(more, 'more finding')}: the JSON has all of them"
        parts.append(tag("p", said, class_="left-out"))
    if len(shown) > MOST_MAPPED:
        said = f"Only the first {MOST_MAPPED} findings have maps"
        if len(shown) > MOST_PICTURED:
            said += f", and the first {MOST_PICTURED} pictures of variables"
        parts.append(tag("p", said, class_="left-out"))
    return joined(parts)


def facts_section(answers: Sequence[Answer]) -> Markup | None:
    """Return what else is known: answers that are no findings and have numbers.

    What rows say of single rules is not among them: it stands in the table of rules.
    """
    groups: dict[str, list[Answer]] = {}
    for answer in answers:
        has_numbers = bool(answer.measures or answer.region)
        is_of_rule = answer.code == "FT701" and answer.rules
        if has_numbers and not answer.is_finding and not is_of_rule:
            groups.setdefault(answer.code, []).append(answer)
    parts: list[Markup] = []
    for code, known in groups.items():
        parts += [_fact(answer) for answer in known[:MOST_FACTS]]
        if len(known) > MOST_FACTS:
            more = f"{code}: {counted(len(known) - MOST_FACTS, 'more answer')} below"
            parts.append(tag("p", more, class_="left-out"))
    return tag("div", *parts, class_="facts-of") if parts else None


def _fact(answer: Answer) -> Markup:
    code = tag("span", answer.code, class_="code", title=_title(answer.code))
    said = tag("p", answer.sentence, " ", code)
    badge = state_badge(state_word(answer.state))
    return tag(
        "div", badge, tag("div", said, _measures(answer.measures)), class_="fact"
    )


def _title(code: str) -> str:
    return CODES[code].title if code in CODES else "a finding"


def _group(code: str, shown: Sequence[Markup]) -> Markup:
    known = CODES.get(code)
    head = tag("h3", tag("span", code, class_="code"), f" {_title(code)}")
    parts: list[Content] = [head]
    if known and (known.what or known.why or known.example or known.remedy):
        named = (
            ("What it means", known.what),
            ("Why it matters", known.why),
            ("Example", known.example),
            ("What to do", known.remedy),
        )
        pairs: list[Markup] = []
        for name, said in named:
            if said:
                lines = (
                    tag("span", _with_code(line), class_="line")
                    for line in said.splitlines()
                )
                pairs += [tag("dt", name), tag("dd", *lines)]
        parts.append(folded("What this means and what to do", tag("dl", *pairs)))
    return tag("section", *parts, *shown, class_="group")


def _with_code(line: str) -> Markup:
    """Return a line in which what stands between backticks is code."""
    parts = line.split("`")
    return joined(
        tag("code", part) if place % 2 else part for place, part in enumerate(parts)
    )


def _finding(
    answer: Answer,
    name: str,
    scene: Scene,
    drawn: Drawn,
    *,
    is_known: bool,
    is_whole: bool,
) -> Markup:
    places = joined((tag("code", _place(one)) for one in answer.places[:6]), ", ")
    facts: list[Content] = [
        severity_badge(answer.severity),
        state_badge(state_word(answer.state)),
        tag("span", answer.subject, class_="subject"),
    ]
    if is_known:
        facts.append(tag("span", "accepted", class_="accepted"))
    if places:
        facts.append(tag("span", places, class_="places"))
    head: list[Content] = [
        tag("h4", answer.sentence),
        tag("p", *facts, class_="facts"),
        _concerned(answer, scene),
    ]
    parts: list[Content] = []
    if answer.region:
        where = _region_text(answer.region, scene)
        parts.append(tag("p", f"Where {where}", class_="how"))
    if drawn != "nothing":
        parts.append(pictures(answer, name, scene, drawn))
    parts += [evidence(answer.state), _measures(answer.measures)]
    named = tag("code", answer.id) if answer.id else None
    repeat = tag("code", answer.repeat, class_="copied") if answer.repeat else None
    if named or repeat:
        parts.append(tag("p", named, repeat, class_="repeat"))
    if not is_whole:
        whole = tag("div", *parts, class_="rest")
        parts = [folded("Where it is, and how it is known", whole)]
    return tag("article", *head, *parts, id=name, class_=f"finding {answer.severity}")


def _place(place: FileLocation) -> str:
    return f"{place.file}:{place.line}:{place.column}"


def _region_text(region: Sequence[Span], scene: Scene) -> str:
    units = {span.variable: scene.axes.get(span.variable) for span in region}
    return " and ".join(
        f"{span.variable} is {span_text(span, axis.unit if axis else '')}"
        for span, axis in zip(region, units.values(), strict=True)
    )


def _concerned(answer: Answer, scene: Scene) -> Markup | None:
    """Return the rules and terms that a finding is about, in words."""
    viewed = scene.viewed
    whole = viewed.rules
    items: list[Content] = []
    rules: list[int] = []
    if whole is not None:
        rules = [k for k in answer.rules if 0 < k <= len(whole.rules)]
        items += [_named(k, viewed, whole) for k in rules[:6]]
    if len(rules) > 6:
        items.append(f"and {counted(len(rules) - 6, 'more rule')}")
    if not rules:
        items += [f"{one.variable} is {one.term}" for one in answer.terms[:6]]
        if len(answer.terms) > 6:
            items.append(f"and {counted(len(answer.terms) - 6, 'more term')}")
    return listed(items, class_="concerned") if items else None


def _named(number: int, viewed: AuditView, rules: RuleBase) -> Markup:
    name = viewed.rule_names[number - 1] if viewed.rule_names else f"rule {number}"
    href = f"#rule-{number}" if number <= MOST_RULES else None
    said = sentence_of(rules.rules[number - 1], rules)
    return joined([tag("a", name, href=href), text(": "), said])


def _measures(measures: Sequence[Measure]) -> Markup | None:
    if not measures:
        return None
    pairs: list[Markup] = []
    for one in measures:
        exact = one.exact if one.exact and len(one.exact) <= _SHORT else None
        unit = f" {one.unit}" if one.unit else ""
        is_told = exact is not None and exact != number(one.value)
        note = tag("span", f" = {exact}", class_="exact") if is_told else None
        pairs.append(
            tag("div", tag("dt", one.name), tag("dd", number(one.value), unit, note))
        )
    return tag("dl", *pairs, class_="measures")


_MOST_BARS = 6  # of one finding
_MOST_MAP_RULES = 200

Drawn = Literal["nothing", "bars", "maps"]
"""Which pictures a finding has: maps stand beside bars."""


class Scene(NamedTuple):
    """What the text and pictures of findings are made from.

    Attributes:
        axes: Every variable, by name.
        viewed: The rules as they are audited.
    """

    axes: Mapping[str, Axis]
    viewed: AuditView

    @property
    def deciding(self) -> RuleBase | None:
        """The rules, if the strongest of them decides."""
        is_strongest = self.viewed.policy.decision == "strongest"
        return self.viewed.rules if is_strongest else None


def pictures(answer: Answer, name: str, scene: Scene, drawn: Drawn) -> Markup | None:
    """Return the region as pictures: a bar for each variable, a map of two."""
    point: dict[str, Fraction] = {}
    if isinstance(answer.state, (Witness, Bracket)):
        point = point_of(answer.state.point)
    spans = answer.region
    if not spans and isinstance(answer.state, Witness):
        spans = answer.state.region
    region = {span.variable: span for span in spans}
    values = _values(point, scene)
    shown = _concerning(answer, region, values, scene)
    parts = [
        bar_picture(
            axis,
            region.get(axis.name),
            _near(values, axis),
            f"{name}-v{k}",
            {one.term for one in answer.terms if one.variable == axis.name},
        )
        for k, axis in enumerate(shown[:_MOST_BARS])
    ]
    if len(shown) > _MOST_BARS:
        others = ", ".join(axis.name for axis in shown[_MOST_BARS:])
        parts.append(tag("p", f"not drawn: {others}", class_="left-out"))
    maps: list[Markup] = []
    for whose, rules in _deciding(answer, scene) if drawn == "maps" else ():
        maps += _maps(
            _mapped(shown, rules, whose, scene),
            region,
            values,
            f"{name}-{len(maps)}",
            whose,
            rules,
        )
    if not parts and not maps:
        return None
    return tag(
        "div",
        tag("div", *parts, class_="bars") if parts else None,
        *maps,
        class_="pictures",
    )


def _values(point: Mapping[str, Fraction], scene: Scene) -> dict[str, Fraction]:
    """Return the value of every variable at a point, as far as it is known."""
    rules = scene.viewed.rules
    if rules is None or not point:
        return dict(point)
    return exact_axes(rules, point) or dict(point)


def exact_axes(
    rules: RuleBase, point: Mapping[str, Fraction]
) -> dict[str, Fraction] | None:
    """Return the value of every variable at a point; None if an input has no value.

    Example:
        >>> from fuzzytree.model.rulebase import Part, Rule, Variable
        >>> sums = Variable("sum", parts=(Part("a", 2.0, 1.0),))
        >>> rules = RuleBase("r", ("k",), (Variable("a"), sums), (Rule((), "k"),))
        >>> exact_axes(rules, {"a": Fraction(1, 3)})["sum"]
        Fraction(-4, 3)
    """
    if any(name not in point for name in rules.inputs):
        return None
    axes = {name: point[name] for name in rules.inputs}
    for variable in rules.variables:
        if variable.parts:
            axes[variable.name] = sum(
                (
                    Fraction(part.weight) * (point[part.input] - Fraction(part.centre))
                    for part in variable.parts
                ),
                start=Fraction(0),
            )
    return axes


def _near(values: Mapping[str, Fraction], axis: Axis) -> float | None:
    value = values.get(axis.name)
    return None if value is None else float(value)


def _concerning(
    answer: Answer,
    region: Mapping[str, Span],
    values: Mapping[str, Fraction],
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


def _deciding(answer: Answer, scene: Scene) -> list[tuple[str, RuleBase]]:
    """Return whose decisions maps show: those of the tree and of its raw rules."""
    if scene.deciding is None:
        return []
    claims = answer.state.claims if isinstance(answer.state, Witness) else ()
    raw = scene.viewed.raw
    if raw is not None and any(claim.of == "raw rules" for claim in claims):
        return [("the tree", scene.deciding), ("the raw rules", raw)]
    return [("", scene.deciding)]


def _mapped(
    shown: Sequence[Axis], rules: RuleBase, whose: str, scene: Scene
) -> list[Axis]:
    """Return the variables that a map may show; of one who differs, all if two."""
    tested = dict.fromkeys(clause.variable for r in rules.rules for clause in r.when)
    found = {axis.name: axis for axis in shown}
    if whose and len(tested) == 2:
        found |= {name: scene.axes[name] for name in tested if name in scene.axes}
    return [axis for axis in found.values() if axis.name in tested]


def _maps(
    shown: Sequence[Axis],
    region: Mapping[str, Span],
    values: Mapping[str, Fraction],
    name: str,
    whose: str,
    rules: RuleBase,
) -> Iterator[Markup]:
    """Yield maps of the decision on the two variables that a region limits most."""
    tested = {clause.variable for rule in rules.rules for clause in rule.when}
    drawn = sorted(shown, key=lambda axis: _share(axis, region.get(axis.name)))
    if len(drawn) < 2 or tested - values.keys():
        return
    if len(rules.rules) > _MOST_MAP_RULES:
        said = f"not drawn: a map of more than {_MOST_MAP_RULES} rules"
        yield tag("p", said, class_="left-out")
        return
    across, down = drawn[:2]
    for k, (where, window) in enumerate(windows(across, down, region)):
        axes = (across, down)
        picture = map_picture(rules, axes, window, region, values, f"{name}-m{k}")
        said = (
            f"What {whose or 'the rules'} decide{'s' * (whose == 'the tree')} {where}"
        )
        others = len(tested - {across.name, down.name})
        if others:
            said += f", with {counted(others, 'other variable')} as at the witness"
        if across.parts or down.parts:
            said += "; a combination is drawn as if it were free"
        yield tag("figure", picture, tag("figcaption", said))


def _share(axis: Axis, span: Span | None) -> float:
    """Return which part of the domain a side of a region takes."""
    if span is None or axis.low is None or axis.high is None:
        return 1.0
    low = axis.low if span.low is None else span.low
    high = axis.high if span.high is None else span.high
    width = axis.high / 2 - axis.low / 2  # halves: no range overflows
    return (high / 2 - low / 2) / width if width > 0.0 else 1.0

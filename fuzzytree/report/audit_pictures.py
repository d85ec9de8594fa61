"""The pictures of a finding: a bar for each variable, maps of the decision."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.auditing.engine.states import Bracket, Span, Witness, point_of
from fuzzytree.auditing.findings.records import Answer
from fuzzytree.auditing.findings.views import View
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.report.drawing import Axis
from fuzzytree.report.markup import Markup, tag
from fuzzytree.report.svg_regions import bar_picture, map_picture, windows
from fuzzytree.report.text import counted

_MOST_BARS = 6  # of one finding
_MOST_MAP_RULES = 200

Drawn = Literal["nothing", "bars", "maps"]
"""Which pictures a finding has: maps stand beside bars."""


class Scene(NamedTuple):
    """What findings are told and drawn with.

    Attributes:
        axes: Every variable, by name.
        viewed: The rules as they are audited.
    """

    axes: Mapping[str, Axis]
    viewed: View

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
    asked = dict.fromkeys(clause.variable for r in rules.rules for clause in r.when)
    found = {axis.name: axis for axis in shown}
    if whose and len(asked) == 2:
        found |= {name: scene.axes[name] for name in asked if name in scene.axes}
    return [axis for axis in found.values() if axis.name in asked]


def _maps(
    shown: Sequence[Axis],
    region: Mapping[str, Span],
    values: Mapping[str, Fraction],
    name: str,
    whose: str,
    rules: RuleBase,
) -> Iterator[Markup]:
    """Yield maps of the decision on the two variables that a region limits most."""
    asked = {clause.variable for rule in rules.rules for clause in rule.when}
    drawn = sorted(shown, key=lambda axis: _share(axis, region.get(axis.name)))
    if len(drawn) < 2 or asked - values.keys():
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
        others = len(asked - {across.name, down.name})
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

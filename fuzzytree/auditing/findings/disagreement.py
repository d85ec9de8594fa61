"""Where a tree and its raw rules decide differently, and how near that is to rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.auditing.engine.arrangement import Ground, ground, strengths_at
from fuzzytree.auditing.engine.regions import Region, boxes, regions
from fuzzytree.auditing.engine.states import (
    Proved,
    State,
    Witness,
    answer_text,
    point_of,
)
from fuzzytree.auditing.findings.deciders import Both, other_in
from fuzzytree.auditing.findings.nearby import nearest_difference
from fuzzytree.auditing.findings.records import Answer
from fuzzytree.auditing.findings.rows import points_of
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.trees import NOT_LOOKED_AT, too_many
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree

_PART = 0.25  # of the time that is left, for one leaf


def answers(subject: Subject) -> Iterator[Answer]:
    """Yield where a tree and its raw rules differ, leaf by leaf, and near which rows.

    Nothing is asked of a model that is no tree, or has no fitted sets.
    """
    tree, raw = subject.tree, subject.raw
    if tree is None or raw is None:
        return
    found = regions(tree)
    declined = too_many(found)
    if declined is not None:
        yield Answer("FT203", "leaves", NOT_LOOKED_AT, declined, False)
        return
    told: list[Answer] = []
    for answer in differing(subject, raw, tree, found):
        told.append(answer)
        yield answer
    if subject.rows is not None:
        both = Both(tree, raw, subject.domain, found)
        points = points_of(subject, subject.rows)
        known = [
            point_of(one.state.point) for one in told if isinstance(one.state, Witness)
        ]
        # Only the answer about all leaves is left where they are alike everywhere.
        is_alike = len(told) == 1
        yield from nearest_difference(
            both, points, subject.clock, known=known, is_alike=is_alike
        )


def differing(
    subject: Subject, raw: RuleBase, tree: FuzzyTree, found: Sequence[Region]
) -> Iterator[Answer]:
    """Yield the leaves in whose regions the raw rules decide otherwise.

    Args:
        subject: The tree as it is audited.
        raw: Its raw rules.
        tree: The tree itself.
        found: Its regions.
    """
    given = ground(raw, subject.domain)
    alike = asked = 0
    for region in found:
        subject.clock.tell(
            f"leaf {region.leaf} against the raw rules", region.leaf / len(found)
        )
        inside = [*boxes(region, tree, subject.domain)]
        subject.clock.check()
        part = subject.clock.share(_PART)
        state = other_in(given, inside, region.label, part)
        asked += len(inside)
        if isinstance(state, Proved):
            alike += 1
        else:
            yield _difference(given, region, state)
    text = f"in {alike} of {len(found)} leaves the raw rules decide as the tree does"
    how = f"all other decisions asked in {asked} boxes of the leaves"
    yield Answer("FT203", "leaves", text, Proved(how), False)


def _difference(given: Ground, region: Region, state: State) -> Answer:
    name, rules = f"leaf {region.leaf}", (region.leaf,)
    if not isinstance(state, Witness):
        text = f"whether the raw rules decide otherwise in {name} is left open"
        return Answer("FT203", name, text, state, False, rules=rules)
    strengths = strengths_at(given, point_of(state.point))
    best = max(strengths)
    winner = strengths.index(best) + 1
    return Answer(
        code="FT203",
        subject=name,
        sentence=f"in {name} the tree answers {region.label!r}, and somewhere there "
        f"the raw rules answer {answer_text(state.claims[-1].label)}",
        state=state,
        is_finding=True,
        severity="warning",
        rules=rules if not best or (winner,) == rules else (*rules, winner),
        region=state.region,
    )

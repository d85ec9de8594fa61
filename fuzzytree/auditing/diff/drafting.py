"""A change before it is graded, and what grades it: the decisions that differ."""

from __future__ import annotations

from typing import Literal, NamedTuple

from fuzzytree.auditing.diff.difference_records import Change, Grade
from fuzzytree.auditing.findings.records import Measure
from fuzzytree.model.rulebase import Path

Shown = Literal["always", "never", "rules", "ties", "uncovered", "any"]
"""By which differing decision a change is shown to break something: by any; by one
that a rule concerned makes, or a tie, or that no rule makes; always, or never."""


class Draft(NamedTuple):
    """A change that is not graded yet.

    Attributes:
        part: As in `Change`.
        sentence: The change.
        shown: What would show that it breaks something.
        old: Where the old model holds it.
        new: Where the new model holds it.
        old_rules: The old rules concerned.
        new_rules: The new rules concerned.
        measures: Numbers that belong to it.
        is_harmless: Whether it is for people only.
    """

    part: str
    sentence: str
    shown: Shown
    old: Path | None = None
    new: Path | None = None
    old_rules: tuple[int, ...] = ()
    new_rules: tuple[int, ...] = ()
    measures: tuple[Measure, ...] = ()
    is_harmless: bool = False


class Evidence(NamedTuple):
    """How decisions that differ come about.

    Attributes:
        old_rules: The old rules that win there.
        new_rules: The new rules that win there.
        has_tie: Whether two rules are equally strong in one of them.
        has_none: Whether no rule fires in one of them.
        is_equal: Whether decisions are proved equal.
    """

    old_rules: frozenset[int] = frozenset()
    new_rules: frozenset[int] = frozenset()
    has_tie: bool = False
    has_none: bool = False
    is_equal: bool = False

    @property
    def is_any(self) -> bool:
        """Whether some decision differs."""
        return bool(self.old_rules or self.new_rules or self.has_none)


def graded(draft: Draft, evidence: Evidence) -> Change:
    """Return a change with its grade, and whether that is certain."""
    is_broken = {
        "always": True,
        "never": False,
        "any": evidence.is_any,
        "ties": evidence.has_tie,
        "uncovered": evidence.has_none,
        "rules": not evidence.old_rules.isdisjoint(draft.old_rules)
        or not evidence.new_rules.isdisjoint(draft.new_rules),
    }[draft.shown]
    grade: Grade = "breaking" if is_broken else "non-breaking"
    if draft.is_harmless:
        grade = "cosmetic"
    return Change(
        grade,
        is_broken or draft.is_harmless or draft.shown == "never" or evidence.is_equal,
        draft.part,
        draft.sentence,
        draft.old_rules,
        draft.new_rules,
        draft.measures,
    )

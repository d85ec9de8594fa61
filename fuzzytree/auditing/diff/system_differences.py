"""What changed from one fuzzy system to another, whose outputs are numbers.

Structure is compared by identity, numbers by `fuzzytree.auditing.diff.system_numbers`.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence

import msgspec

from fuzzytree.auditing.diff.difference_records import Change, Grade
from fuzzytree.auditing.diff.system_numbers import SystemPair, number_answers
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.findings.records import Answer, AuditSettings
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model import (
    FuzzySystem,
    Path,
    RuleBlock,
    SystemInput,
    SystemOutput,
    SystemRule,
)

Found = tuple[list[tuple[Change, Path | None, Path | None]], list[Answer]]


def system_changes(
    old: FuzzySystem,
    new: FuzzySystem,
    domain: Domain,
    rows: AuditRows | None,
    settings: AuditSettings,
    clock: Clock,
) -> Found:
    """Return the changes of a system with their places, and how its numbers differ.

    A change that can move a number counts as breaking where some number was seen to
    move; which of several changes moved it is not looked for.

    Args:
        old: The old system.
        new: The new one.
        domain: A side for each column of either.
        rows: Rows of the columns of either, the old one's first.
        settings: How many points are drawn, and their seed.
        clock: How much time there is.

    Example:
        >>> from fuzzytree.auditing.findings.domains import domain_of
        >>> from fuzzytree.testing import random_system
        >>> system = random_system(2)
        >>> changes, answers = system_changes(
        ...     system, system, domain_of(system), None, AuditSettings(), Clock()
        ... )
        >>> changes, answers[0].sentence
        ([], 'both systems compute alike')
    """
    columns = tuple(dict.fromkeys((*old.columns, *new.columns)))
    pair = SystemPair(old, new, columns, domain)
    answers = number_answers(pair, rows, settings, clock)
    moves = any(answer.is_finding for answer in answers)
    is_equal = any(answer.subject == "decisions" for answer in answers)  # proved
    found: Found = ([], answers)
    for shown, part, sentence, one, other in _drafts(old, new):
        grade: Grade = "breaking" if shown == "always" else "non-breaking"
        if shown == "moves" and moves:
            grade = "breaking"
        elif shown == "cosmetic":
            grade = "cosmetic"
        is_proved = is_equal or grade != "non-breaking" or shown == "never"
        found[0].append((Change(grade, is_proved, part, sentence), one, other))
    return found


# --- structure

_Draft = tuple[str, str, str, Path | None, Path | None]
"""What shows that it breaks something (`always`, `moves`, `never`, `cosmetic`), the
part, the sentence, and where both models hold it."""


def _drafts(old: FuzzySystem, new: FuzzySystem) -> Iterator[_Draft]:
    if old.name != new.name:
        text = f"the model {old.name!r} is called {new.name!r}"
        yield "cosmetic", "name", text, ("name",), ("name",)
    if old.note != new.note:
        yield "cosmetic", "name", "the note has changed", ("note",), ("note",)
    yield from _variable_drafts("input", old.inputs, new.inputs)
    yield from _variable_drafts("output", old.outputs, new.outputs)
    yield from _block_drafts(old.blocks, new.blocks)


_Variables = Sequence[SystemInput | SystemOutput]


def _variable_drafts(noun: str, old: _Variables, new: _Variables) -> Iterator[_Draft]:
    mine = {one.name: (k, one) for k, one in enumerate(old)}
    theirs = {one.name: (k, one) for k, one in enumerate(new)}
    field = f"{noun}s"
    for name, (place, one) in mine.items():
        here: Path = (field, place)
        if name not in theirs:
            yield "always", noun, f"the {noun} {name!r} was removed", here, None
            continue
        at, other = theirs[name]
        there: Path = (field, at)
        for key in one.__struct_fields__:
            was, now = getattr(one, key), getattr(other, key)
            if key == "labels" or was == now:
                continue
            shown = "cosmetic" if key == "unit" else "moves"
            text = f"the {key} of {name!r} is {_text(now)}, and was {_text(was)}"
            if key == "clips":
                text = (
                    f"values of {name!r} are {'now' if now else 'no longer'} clamped "
                )
                text += "to its range"
            yield shown, "unit" if key == "unit" else noun, text, here, there
        yield from _label_drafts(one, other, here, there)
    for name, (place, _) in theirs.items():
        if name not in mine:
            shown = "always" if noun == "input" else "never"
            yield shown, noun, f"the {noun} {name!r} is new", None, (field, place)


def _text(value: object) -> str:
    if isinstance(value, msgspec.Struct):
        return " ".join(str(getattr(value, name)) for name in value.__struct_fields__)
    return "none" if value is None else repr(value)


def _label_drafts(
    one: SystemInput | SystemOutput,
    other: SystemInput | SystemOutput,
    here: Path,
    there: Path,
) -> Iterator[_Draft]:
    mine = {label.name: (k, label) for k, label in enumerate(one.labels)}
    theirs = {label.name: (k, label) for k, label in enumerate(other.labels)}
    for name, (place, label) in mine.items():
        path: Path = (*here, "labels", place)
        term = f"the term {name!r} of {one.name!r}"
        if name not in theirs:
            yield "moves", "term", f"{term} was removed", path, None
        elif theirs[name][1] != label:
            text = f"the curve of {name!r} of {one.name!r} has changed"
            yield "moves", "term", text, path, (*there, "labels", theirs[name][0])
    for name, (place, _) in theirs.items():
        if name not in mine:
            text = f"the term {name!r} of {one.name!r} is new"
            yield "moves", "term", text, None, (*there, "labels", place)


def _block_drafts(
    old: Sequence[RuleBlock], new: Sequence[RuleBlock]
) -> Iterator[_Draft]:
    for place in range(max(len(old), len(new))):
        path: Path = ("blocks", place)
        if place >= len(new):
            yield "moves", "block", f"block {place + 1} was removed", path, None
        elif place >= len(old):
            yield "moves", "block", f"block {place + 1} is new", None, path
        else:
            yield from _in_block(old[place], new[place], place)


def _in_block(old: RuleBlock, new: RuleBlock, place: int) -> Iterator[_Draft]:
    path: Path = ("blocks", place)
    of = "" if not place else f" of block {place + 1}"
    for key in old.__struct_fields__:
        was, now = getattr(old, key), getattr(new, key)
        if key == "rules" or was == now:
            continue
        shown = "cosmetic" if key == "name" else "moves"
        text = f"the {key}{of} is {_text(now)}, and was {_text(was)}"
        yield shown, "block", text, path, path
    keys: list[dict[int, Hashable]] = [
        {k: _said(rule) for k, rule in enumerate(block.rules)} for block in (old, new)
    ]
    left = {key: [*keys[1].values()].count(key) for key in keys[1].values()}
    gone: list[int] = []
    for k, said in keys[0].items():
        if left.get(said, 0):
            left[said] -= 1
        else:
            gone.append(k)
    come = [k for k in reversed(keys[1]) if _taken(left, keys[1][k])][::-1]
    for k in gone:
        when = old.rules[k].when
        match = next((n for n in come if new.rules[n].when == when), None)
        here: Path = (*path, "rules", k)
        if match is None:
            yield "moves", "rule", f"rule {k + 1}{of} was removed", here, None
            continue
        come.remove(match)
        text = f"rule {k + 1}{of} has another conclusion or weight"
        yield "moves", "rule", text, here, (*path, "rules", match)
    for k in come:
        yield "moves", "rule", f"rule {k + 1}{of} is new", None, (*path, "rules", k)
    if not gone and not come and [*keys[0].values()] != [*keys[1].values()]:
        text = f"the rules{of} stand in another order"
        yield "moves", "order", text, (*path, "rules"), (*path, "rules")


def _taken(left: dict[Hashable, int], key: Hashable) -> bool:
    """Return True as often as a key is left, and count it down."""
    if not left[key]:
        return False
    left[key] -= 1
    return True


def _said(rule: SystemRule) -> Hashable:
    return rule.when, rule.then, rule.weight

"""What changed from one fuzzy system to another, whose outputs are numbers.

Structure is compared by identity; outputs are compared on probes of both systems, on
points drawn from the domain and on rows of data. Nothing is proved of numbers, so a
difference is told as a share that was sampled, and none as none that was seen.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.auditing.difference_records import Change, Grade
from fuzzytree.auditing.records import Answer, Measure, Settings
from fuzzytree.auditing.subject import Rows
from fuzzytree.auditing.support import share
from fuzzytree.probing import system_probes
from fuzzytree.proving.domain import Domain
from fuzzytree.proving.states import Proved
from fuzzytree.rulebase import Path
from fuzzytree.runtimes.systems import run_system
from fuzzytree.system import (
    FuzzySystem,
    RuleBlock,
    SystemInput,
    SystemOutput,
    SystemRule,
)

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray

_PROBES = 2_000  # of each system
_DRAWN = 4_000  # at most, for numbers take longer than decisions

Found = tuple[list[tuple[Change, Path | None, Path | None]], list[Answer]]


def compared(
    old: FuzzySystem,
    new: FuzzySystem,
    domain: Domain,
    rows: Rows | None,
    settings: Settings,
) -> Found:
    """Return what a new system says otherwise, with places, and how numbers differ.

    A change that can move a number counts as breaking where some number was seen to
    move; which of several changes moved it is not looked for.

    Args:
        old: The old system.
        new: The new one.
        domain: A side for each column of either.
        rows: Rows of the columns of either, the old one's first.
        settings: How many points are drawn, and their seed.

    Example:
        >>> from fuzzytree.auditing.domains import domain_of
        >>> from fuzzytree.testing import random_system
        >>> system = random_system(2)
        >>> changes, answers = compared(
        ...     system, system, domain_of(system), None, Settings()
        ... )
        >>> changes, answers[0].sentence
        ([], 'both systems compute alike')
    """
    answers = [*_answers(old, new, domain, rows, settings)]
    moves = any(answer.is_finding for answer in answers)
    found: Found = ([], answers)
    for shown, part, sentence, one, other in _drafts(old, new):
        grade: Grade = "breaking" if shown == "always" else "non-breaking"
        if shown == "moves" and moves:
            grade = "breaking"
        elif shown == "cosmetic":
            grade = "cosmetic"
        is_proved = grade != "non-breaking" or shown == "never"
        found[0].append((Change(grade, is_proved, part, sentence), one, other))
    return found


# --- numbers


def _answers(
    old: FuzzySystem,
    new: FuzzySystem,
    domain: Domain,
    rows: Rows | None,
    settings: Settings,
) -> Iterator[Answer]:
    if _bare(old) == _bare(new):
        state = Proved("both systems say the same in every part")
        sentence = "both systems compute alike"
        yield Answer("FT801", "decisions", sentence, state, is_finding=False)
        return
    columns = tuple(dict.fromkeys((*old.columns, *new.columns)))
    outputs = [one.name for one in old.outputs]
    both = [name for name in outputs if name in {one.name for one in new.outputs}]
    sides = [domain.side(name) for name in columns]
    low, high = (
        np.array([getattr(side, end) for side in sides if side])[:, None]
        for end in ("low", "high")
    )
    chance = np.random.default_rng(settings.seed)
    u = chance.random((len(columns), min(settings.rows, _DRAWN)))
    probes = np.hstack([_probes(model, columns, low, high) for model in (old, new)])
    asked: list[tuple[str, FloatArray, str]] = [
        ("probes", probes, "probes of both systems within the domain"),
        (
            "domain",
            low * (1.0 - u) + high * u,
            f"points drawn evenly from the domain, seed {settings.seed}",
        ),
    ]
    if rows is not None:
        asked.append(("rows", rows.values, f"rows of {rows.name}"))
    for subject, values, how in asked:
        if values.shape[1]:
            yield _answer(old, new, columns, both, values, subject, how)


def _bare(system: FuzzySystem) -> FuzzySystem:
    return msgspec.structs.replace(system, name="system", note="")


def _probes(
    system: FuzzySystem, columns: Sequence[str], low: FloatArray, high: FloatArray
) -> FloatArray:
    known = system_probes(system, limit=_PROBES)
    middle = (low / 2 + high / 2)[:, 0].tolist()
    table = [
        [row.get(name, at) for row in known]
        for name, at in zip(columns, middle, strict=True)
    ]
    values = np.array(table, np.float64).reshape(len(columns), len(known))
    inside = ((values >= low) & (values <= high)).all(axis=0)
    kept: FloatArray = values[:, inside]
    return kept


def _answer(
    old: FuzzySystem,
    new: FuzzySystem,
    columns: Sequence[str],
    outputs: Sequence[str],
    values: FloatArray,
    subject: str,
    how: str,
) -> Answer:
    """Return how the outputs that both have differ on some rows."""
    one, other = (
        run_system(system)(values[[columns.index(n) for n in system.columns]])
        .outputs[[[o.name for o in system.outputs].index(n) for n in outputs]]
        for system in (old, new)
    )  # fmt: skip
    with np.errstate(invalid="ignore"):
        gap = np.abs(one - other)
    gap[(one == other) | (np.isnan(one) & np.isnan(other))] = 0.0
    gap[np.isnan(gap)] = np.inf
    differs = (gap > 0.0).any(axis=0)
    hits, count = int(differs.sum()), values.shape[1]
    state = share("rows in which an output differs", hits, count, f"{count} {how}")
    sentence = f"no output differs on {count} {how}"
    measures: tuple[Measure, ...] = ()
    if hits:
        place, row = np.unravel_index(int(gap.argmax()), gap.shape)
        name = outputs[int(place)]
        at = ", ".join(
            f"{column} = {value!r}"
            for column, value in zip(columns, values[:, row].tolist(), strict=True)
        )
        was, now = float(one[place, row]), float(other[place, row])
        sentence = (
            f"an output differs on {hits} of {count} {how}, most at {at}: {name!r} is "
            f"{now!r}, and was {was!r}"
        )
        measures = (Measure("largest difference", float(gap[place, row])),)
    return Answer(
        "FT801",
        subject,
        sentence,
        state,
        is_finding=hits > 0,
        severity="error" if hits else "info",
        measures=measures,
    )


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
        text = f"rule {k + 1}{of} concludes otherwise, or has another weight"
        yield "moves", "rule", text, here, (*path, "rules", match)
    for k in come:
        yield "moves", "rule", f"rule {k + 1}{of} is new", None, (*path, "rules", k)
    if not gone and not come and [*keys[0].values()] != [*keys[1].values()]:
        text = f"the rules{of} stand in another order"
        yield "moves", "order", text, (*path, "rules"), (*path, "rules")


def _taken(left: dict[Hashable, int], key: Hashable) -> bool:
    """Return whether a key is still to be told of, and count it as told."""
    if not left[key]:
        return False
    left[key] -= 1
    return True


def _said(rule: SystemRule) -> Hashable:
    return rule.when, rule.then, rule.weight

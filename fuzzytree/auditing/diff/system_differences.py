"""Changes of the structure of fuzzy systems, whose parts are matched by their names.

How their numbers differ is in `fuzzytree.auditing.diff.system_numbers`.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence

import msgspec

from fuzzytree.auditing.diff.difference_records import (
    Draft,
    Shown,
    renamed_model,
    together,
)
from fuzzytree.auditing.diff.matching import paired
from fuzzytree.model import (
    FuzzySystem,
    Path,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Variable,
)

_Variable = Variable | SystemOutput


def draft_system_changes(old: FuzzySystem, new: FuzzySystem) -> Iterator[Draft]:
    """Yield the changes from an old system to a new one.

    A change that can move a number breaks something if any number was seen to move;
    which of several changes moved it is not looked for.
    """
    yield from renamed_model(old, new)
    if old.note != new.note:
        here: Path = ("note",)
        yield Draft(
            "name", "the note has changed", "never", here, here, is_harmless=True
        )
    yield from _variable_drafts("input", old.variables, new.variables)
    yield from _variable_drafts("output", old.outputs, new.outputs)
    yield from _block_drafts(old.blocks, new.blocks)


def _variable_drafts(
    noun: str, old: Sequence[_Variable], new: Sequence[_Variable]
) -> Iterator[Draft]:
    mine, theirs = (
        {one.name: ((f"{noun}s", k), one) for k, one in enumerate(variables)}
        for variables in (old, new)
    )
    for name, one, other in together(mine, theirs):
        if one and other:
            yield from _fact_drafts(noun, one, other, f" of {name!r}")
            yield from _label_drafts(one, other)
        else:
            is_needed = one is not None or noun == "input"
            shown: Shown = "always" if is_needed else "never"
            yield _alone(noun, f"the {noun} {name!r}", one, other)._replace(shown=shown)


def _alone(
    part: str,
    text: str,
    old: tuple[Path, object] | None,
    new: tuple[Path, object] | None,
) -> Draft:
    """Return that a part is new, or was removed."""
    text += " is new" if old is None else " was removed"
    return Draft(part, text, "any", old and old[0], new and new[0])


def _fact_drafts(
    part: str,
    old: tuple[Path, _Variable | RuleBlock],
    new: tuple[Path, _Variable | RuleBlock],
    of: str,
) -> Iterator[Draft]:
    """Yield what differs of a variable beside its terms, or of a block beside rules."""
    for key in old[1].__struct_fields__:
        was, now = getattr(old[1], key), getattr(new[1], key)
        if key in ("terms", "rules") or was == now:
            continue
        text = f"the {key}{of} is {_text(now)}, and was {_text(was)}"
        if key == "clips":
            still = "now" if now else "no longer"
            text = f"values{of} are {still} clamped to its range"
        draft = Draft("unit" if key == "unit" else part, text, "any", old[0], new[0])
        yield draft._replace(is_harmless=key in ("unit", "name"))


def _text(value: object) -> str:
    if isinstance(value, msgspec.Struct):
        return " ".join(str(getattr(value, name)) for name in value.__struct_fields__)
    return "none" if value is None else repr(value)


def _label_drafts(
    old: tuple[Path, _Variable], new: tuple[Path, _Variable]
) -> Iterator[Draft]:
    mine, theirs = (
        {label.name: ((*path, "terms", k), label) for k, label in enumerate(one.terms)}
        for path, one in (old, new)
    )
    for name, one, other in together(mine, theirs):
        term = f"{name!r} of {old[1].name!r}"
        if not (one and other):
            yield _alone("term", f"the term {term}", one, other)
        elif one[1] != other[1]:
            text = f"the curve of {term} has changed"
            yield Draft("term", text, "any", one[0], other[0])


def _block_drafts(
    old: Sequence[RuleBlock], new: Sequence[RuleBlock]
) -> Iterator[Draft]:
    mine, theirs = (
        {k: (("blocks", k), block) for k, block in enumerate(blocks)}
        for blocks in (old, new)
    )
    for place, one, other in together(mine, theirs):
        if one and other:
            of = f" of block {place + 1}" if place else ""
            yield from _fact_drafts("block", one, other, of)
            yield from _rule_drafts(one[1].rules, other[1].rules, one[0], of)
        else:
            yield _alone("block", f"block {place + 1}", one, other)


def _rule_drafts(
    old: Sequence[SystemRule], new: Sequence[SystemRule], block: Path, of: str
) -> Iterator[Draft]:
    pairs = paired(dict(enumerate(map(_key, old))), dict(enumerate(map(_key, new))))
    gone = sorted({*range(len(old))} - {k for k, _ in pairs})
    come = sorted({*range(len(new))} - {k for _, k in pairs})
    for k in gone:
        match = next((n for n in come if new[n].when == old[k].when), None)
        here: Path = (*block, "rules", k)
        if match is None:
            yield Draft("rule", f"rule {k + 1}{of} was removed", "any", here)
            continue
        come.remove(match)
        text = f"rule {k + 1}{of} has another conclusion or weight"
        yield Draft("rule", text, "any", here, (*block, "rules", match))
    for k in come:
        there: Path = (*block, "rules", k)
        yield Draft("rule", f"rule {k + 1}{of} is new", "any", None, there)
    if len(pairs) == len(old) == len(new) and any(a != b for a, b in pairs):
        text, rules = f"the rules{of} stand in another order", (*block, "rules")
        yield Draft("order", text, "any", rules, rules)


def _key(rule: SystemRule) -> Hashable:
    return rule.when, rule.then, rule.weight

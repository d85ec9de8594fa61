"""All candidates of a study in one list, and which of them are wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fuzzytree.contracts import Dtype, Model
from fuzzytree.numerics.bounds import certify
from fuzzytree.rulebase import RuleBase
from fuzzytree.timing.candidates import Bound, Bounds, Layouts, own, questions
from fuzzytree.timing.floors import floors
from fuzzytree.timing.peers import peers
from fuzzytree.timing.records import Candidate, Omission
from fuzzytree.timing.variants import variants

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray


def gather(model: Model, values: FloatArray) -> tuple[list[Candidate], list[Omission]]:
    """Return every candidate for a model, and what cannot be one.

    Args:
        model: A tree or a rule base.
        values: The rows of the study: certified bounds hold on them.
    """
    layouts = Layouts()
    main = next(iter(questions(model)))
    found, omitted = floors(main)
    bounds = _bounds(values)
    mine, absent = own(model, bounds, layouts)
    others, missing = peers(model, bounds)
    changed, left = variants(model, bounds, layouts)
    return [*found, *mine, *others, *changed], [*omitted, *absent, *missing, *left]


def foreign(model: Model) -> list[Candidate]:
    """Return the candidates that a child process tries; see `trial`."""
    main = next(iter(questions(model)))
    mine = own(model, lambda _rules, _dtype: None, Layouts())[0]
    return [*floors(main)[0], *mine, *peers(model)[0]]


def chosen(
    candidates: Sequence[Candidate], only: Sequence[str], skip: Sequence[str]
) -> tuple[list[Candidate], list[Omission]]:
    """Return the candidates that are wanted, and a line about the others.

    Args:
        candidates: All there are.
        only: Names, parts before the colon, questions or kinds; all if none.
        skip: The same, for what is not wanted.

    Raises:
        ValueError: If a word names nothing, or nothing is left; the message lists
            what there is.
    """
    for word in (*only, *skip):
        if not any(word in _words(one) for one in candidates):
            known = dict.fromkeys(_short(one) for one in candidates)
            groups = dict.fromkeys(w for one in candidates for w in _groups(one))
            raise ValueError(
                f"no candidate {word!r}; there is {', '.join(known)}, "
                f"or all of {', '.join(groups)}"
            )
    kept = [
        one
        for one in candidates
        if (not only or not _words(one).isdisjoint(only))
        and _words(one).isdisjoint(skip)
    ]
    if not kept:
        raise ValueError("no candidate is left to measure")
    left = len(candidates) - len(kept)
    if not left:
        return kept, []
    return kept, [Omission(_counted(left), "not asked for")]


def _counted(count: int) -> str:
    return f"{count} candidate{'' if count == 1 else 's'}"


def _words(one: Candidate) -> set[str]:
    return {one.name, _short(one), *_groups(one)}


def _short(one: Candidate) -> str:
    return one.name.removesuffix(f": {one.question}")


def _groups(one: Candidate) -> tuple[str, str]:
    return one.question, one.kind


def _bounds(values: FloatArray) -> Bounds:
    """Return what certifies rule bases on these rows, each but once."""
    known: dict[tuple[RuleBase, Dtype], Bound | None] = {}

    def bounds(rules: RuleBase, dtype: Dtype) -> Bound | None:
        key = (rules, dtype)
        if key not in known:
            found = certify(rules, dtype, values)
            delta = None if found.unbounded else found.delta
            known[key] = None if delta is None else (delta, found.origin)
        return known[key]

    return bounds

"""The page's first part: what follows from all numbers, in a sentence each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from fuzzytree.model.rulebase import Kind
from paper.judging import ABOUT, PRIMARY, Line, Verdict, counted, growth, verdicts
from paper.records import Claims, Size
from paper.text import bullet, half_text, listed, place, short_name, spanned, three

KINDS: tuple[Kind, ...] = ("raw", "relative")


def in_short(claims: Claims, found: Sequence[Line]) -> Iterator[str]:
    """Yield the blocks of the summary; conclusions hang on the numbers alone."""
    yield "## In short"
    points = []
    if claims.sizes:
        points += [_counted_in_short(claims.sizes), _timed_in_short(found)]
        points.append(_overhead_in_short(found))
    if claims.comparisons:
        points.append(_reliable_in_short(verdicts(claims.comparisons)))
    points += _search_in_short(found)
    yield "\n".join(bullet(point) for point in points)


def _counted_in_short(sizes: Sequence[Size]) -> str:
    alone = [counted(size)[0] / size.rules for size in sizes]
    last = max(sizes, key=lambda size: size.rules)
    is_right = all(1 / ABOUT <= share <= ABOUT for share in alone)
    head = "is right" if is_right else "is not right"
    return (
        f'**Counted, "n times" {head}.** The propositions of all rules are '
        f"{spanned(alone)} "
        "times n the questions that a row meets on its way down the tree. But rules "
        f"share propositions: at {last.rules:,} rules, computing each different one "
        f"once is {three(counted(last)[1])} times the tree's questions."
    )


def _timed_in_short(found: Sequence[Line]) -> str:
    fired = [line for line in found if line.what == "rules" and line.kind == "raw"]
    groups: dict[str, list[Line]] = {}
    for line in fired:
        groups.setdefault(place(line), []).append(line)
    like = [
        where
        for where, members in groups.items()
        if all(line.law and growth(line.law) == "like n" for line in members)
    ]
    right = [
        where
        for where, members in groups.items()
        if all(line.is_about_n for line in members)
    ]
    parts = []
    for is_batch, rows in ((False, "One row at a time"), (True, "In batches")):
        ranges = [
            f"{spanned(share for line in members for share in line.shares)} in "
            f"{short_name(members[0])}"
            for members in groups.values()
            if members[0].is_batch == is_batch
        ]
        if ranges:
            parts.append(f"{rows}: {listed(ranges)}.")
    return (
        f"**Timed, the ratio grows like n {_places(like, groups)}, and is n, within a "
        f"factor of {ABOUT:g}, {_places(right, groups)}.** Of n times the tree's time, "
        f"firing raw rules takes this much. {' '.join(parts)}"
    )


def _places(chosen: Sequence[str], of: Collection[str]) -> str:
    if len(chosen) == len(of):
        return "everywhere"
    return f"in {listed(chosen)}" if chosen else "nowhere"


def _overhead_in_short(found: Sequence[Line]) -> str:
    known = [
        line
        for line in found
        if line.family == PRIMARY
        and (line.what, line.kind, line.is_batch) == ("rules", "raw", False)
        and line.half is not None
    ]
    if not known:
        return "**Overhead** cannot be estimated from so few sizes."
    is_seen = any((line.half or 0.0) > line.sizes[0] for line in known)
    head = "decides at first" if is_seen else "does not decide"
    parts = [f"{half_text(line)} in {short_name(line)}" for line in known]
    return (
        f"**For a single row, overhead {head}.** The fixed cost of a call is more than "
        "half of the time of firing raw rules up to this many rules: "
        f"{listed(parts)}."
    )


def _reliable_in_short(found: Sequence[Verdict]) -> str:
    tree, raw, is_open = (
        sum(verdict.winner == name for verdict in found)
        for name in ("tree", "raw rules", "open")
    )
    if tree and not raw:
        head = '"Less reliable" is not what was measured, rather the opposite.'
    elif raw and not tree:
        head = '"Less reliable" is confirmed.'
    elif tree and raw:
        head = 'Which is "less reliable" depends on the table.'
    else:
        head = '"Less reliable" can neither be confirmed nor denied here.'
    return (
        f"**{head}** In {len(found)} comparisons on test rows, the tree "
        f"is right more often in {tree}, the raw rules in {raw}; {is_open} are open "
        "(exact McNemar tests, corrected for their number)."
    )


def _search_in_short(found: Sequence[Line]) -> Iterator[str]:
    chosen = {
        line.kind: line
        for line in found
        if (line.what, line.is_batch, line.family) == ("best-first", True, PRIMARY)
    }
    if set(chosen) != set(KINDS):
        return
    relative, raw = chosen["relative"], chosen["raw"]
    last = raw.prices[-1]
    parts = [
        f"For {line.kind} rules its price {'is' if line.is_near_tree else 'is not'} "
        f"nearly the tree's: {spanned(line.ratios)} times it in batches"
        for line in (relative, raw)
    ]
    if last.to_firing:
        parts.append(
            f"At {raw.sizes[-1]:,} raw rules that is {three(last.to_firing.median)} "
            "times as fast as firing"
        )
    yield (
        "**Best-first gives the answers of all rules while firing few.** "
        f"{'. '.join(parts)}."
    )

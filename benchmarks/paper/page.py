"""The page: tables of what was measured, and what follows from them, as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.benchmarking.machine import noise
from fuzzytree.model.rulebase import Kind
from paper.inference import wilson
from paper.judging import (
    LARGE,
    LEVEL,
    PRIMARY,
    Line,
    Verdict,
    counted,
    first_gain,
    growth,
    lines,
    spread,
    verdicts,
)
from paper.records import Claims, Comparison, Family, Size
from paper.summary import KINDS, in_short
from paper.text import (
    bullet,
    duration,
    half_text,
    listed,
    middle,
    p_value,
    paragraph,
    percent,
    spanned,
    table,
    three,
)

FLAT = 0.05  # an exponent of less in size is no growth worth a word
ENOUGH = 6  # samples of which the smallest and largest enclose the median with 95 %
FAMILIES: tuple[Family, ...] = ("multiway", "grown")
FIRING = ("reference", "native", "onnxruntime float64", "scikit-fuzzy")


def page(claims: Claims) -> str:
    """Return the page as Markdown.

    The same measurements give the same text.
    """
    found = list(lines(claims))
    blocks = [
        *_opening(claims),
        *in_short(claims, found),
        *_speed(claims, found),
        *_reliability(claims),
        *_search(claims, found),
        *_method(claims),
    ]
    return "\n\n".join(blocks) + "\n"


def _opening(claims: Claims) -> Iterator[str]:
    yield "# The paper's claims about speed and reliability, measured"
    yield paragraph(
        'The paper says that a fuzzy tree "reaches a result about n-times faster than '
        'its corresponding fuzzy rule-based system", where n is the number of rules, '
        'and that it is "less reliable". It measures neither. This page does, for raw '
        "rules, which are the paper's, and for relative rules, which equal their tree."
    )
    yield paragraph(
        "`python benchmarks/claims.py` measures and writes this page, its pictures and "
        "[all the numbers](claims.json); what is concluded here is computed from them."
    )
    for warning in noise(claims.machine, ()):
        yield paragraph(f"**Beware:** {warning}.")
    if claims.is_quick:
        yield "**This is a trial run, with few sizes and rounds.**"


def _speed(claims: Claims, found: Sequence[Line]) -> Iterator[str]:
    if not claims.sizes:
        return
    yield "## n times faster"
    yield "![Price of a rule base in units of its tree's](claims-speed.svg)"
    yield paragraph(
        "How many times as long as the tree a rule base takes for a row, in the same "
        f"runtime. Trees are {PRIMARY}: two to five branches a node, every leaf "
        "equally likely. scikit-fuzzy runs no trees and stands against `native`; the "
        "reference runs batches row by row. A dash: not measured, see below."
    )
    for is_batch in (False, True):
        for kind in KINDS:
            rows = "in a batch" if is_batch else "one row at a time"
            yield f"**{kind.capitalize()} rules, {rows}:**"
            yield _ratios(claims, found, kind, is_batch=is_batch)
    yield _certainty(claims.sizes)
    yield from _growth(found)
    yield paragraph(
        "**What is counted.** If rows reach all leaves equally often and every rule "
        "computes all of its propositions, the work is exactly n times the questions "
        "of the tree: the propositions of all rules are n times the mean length of a "
        "path. What is timed differs from it for three reasons: rules share "
        "propositions; a raw proposition is the union of the sets of all patterns "
        "below its branch, so it costs more the higher it stands; and a call has a "
        "price of its own."
    )
    yield _counts(claims.sizes)


def _certainty(sizes: Sequence[Size]) -> str:
    prices = [price for size in sizes for price in size.prices if price.to_tree]
    few = sum(price.rounds < ENOUGH for price in prices)
    return paragraph(
        "Half of all ratios are known to within "
        f"{spread([price.to_tree for price in prices if price.to_tree]):.0%} or better "
        "(95 % intervals of the median quotient). For "
        f"{few} of {len(prices)} there was time for fewer than {ENOUGH} rounds; their "
        "intervals, from the smallest quotient to the largest, promise less."
    )


def _growth(found: Sequence[Line]) -> Iterator[str]:
    yield paragraph(
        f"**How the ratio grows.** The exponent b of a law n^b, fitted from {LARGE} "
        "rules on, with its 95 % interval, for both families of trees; the ratio "
        "divided by n, smallest to largest over all sizes of both; and up to how many "
        f"rules of {PRIMARY} trees a call's fixed cost is more than half of its time."
    )
    yield _laws(found)
    yield _growth_text(found)


def _ratios(
    claims: Claims, found: Sequence[Line], kind: Kind, *, is_batch: bool
) -> str:
    here = [
        line
        for line in found
        if (line.family, line.kind, line.is_batch) == (PRIMARY, kind, is_batch)
    ]
    columns = [
        (name, what, [f for f in here if (f.runtime, f.what) == (runtime, what)])
        for name, runtime, what in (
            *((name, name, "rules") for name in FIRING),
            ("best-first", "native", "best-first"),
        )
    ]
    columns = [column for column in columns if column[2]]
    trees = {
        size.rules: price.ns
        for size in claims.sizes
        for price in size.prices
        if size.family == PRIMARY
        and (price.what, price.runtime, price.is_batch) == ("tree", "native", is_batch)
    }
    rows = []
    for rules, ns in trees.items():
        cells = []
        for _, _, matching in columns:
            known = dict(zip(matching[0].sizes, matching[0].ratios, strict=True))
            cells.append(three(known[rules]) if rules in known else "-")
        rows.append([f"{rules:,}", *cells, duration(ns)])
    head = ["n", *(name for name, _, _ in columns), "tree in native, a row"]
    return table(head, rows)


def _laws(found: Sequence[Line]) -> str:
    groups: dict[tuple[str, str, bool], list[Line]] = {}
    for line in found:
        if line.what == "rules":
            key = (line.kind, line.runtime, line.is_batch)
            groups.setdefault(key, []).append(line)
    order = sorted(
        groups, key=lambda key: (key[0] != "raw", FIRING.index(key[1]), key[2])
    )
    rows = []
    for kind, runtime, is_batch in order:
        members = {line.family: line for line in groups[kind, runtime, is_batch]}
        shares = [share for line in members.values() for share in line.shares]
        rows.append(
            [
                kind,
                runtime,
                "batch" if is_batch else "one row",
                *(_law(members.get(family)) for family in FAMILIES),
                spanned(shares),
                half_text(members.get(PRIMARY)),
            ]
        )
    bs = [f"b, {family}" for family in FAMILIES]
    head = ["rules", "runtime", "rows", *bs, "ratio / n", "overhead up to n"]
    return table(head, rows)


def _law(line: Line | None) -> str:
    law = line.law if line else None
    if law is None:
        return "-"
    return f"{law.exponent:.2f} ({law.low:.2f} to {law.high:.2f})"


def _growth_text(found: Sequence[Line]) -> str:
    laws = [(line, line.law) for line in found if line.what == "rules"]
    known = [(line, law) for line, law in laws if law is not None]
    if not known:
        return paragraph("There are too few sizes to fit a law.")
    words = [growth(law) for _, law in known]
    kinds = [
        f"{words.count(word)} grow {word}"
        for word in ("like n", "slower than n", "faster than n")
    ]
    exponents = [law.exponent for _, law in known]
    return paragraph(
        f"Within these intervals, of {len(known)} ratios {listed(kinds)}; b is "
        f"between {min(exponents):.2f} and {max(exponents):.2f}. An interval measures "
        "how far the points lie off a straight line, not whether the law is a line."
    )


def _counts(sizes: Sequence[Size]) -> str:
    rows = [
        [
            size.family,
            f"{size.rules:,}",
            f"{size.path:.2f}",
            f"{size.propositions:,}",
            three(counted(size)[0]),
            f"{size.distinct:,}",
            three(counted(size)[1]),
        ]
        for size in sorted(sizes, key=lambda size: (size.family, size.rules))
    ]
    head = [
        "trees",
        "n",
        "questions of a row",
        "propositions",
        "times the questions",
        "different propositions",
        "times the questions",
    ]
    return table(head, rows)


def _reliability(claims: Claims) -> Iterator[str]:
    found = verdicts(claims.comparisons)
    if not found:
        return
    seeds = len(found[0].comparison.of_seeds)
    yield "## Less reliable"
    yield "![Who is right where raw rules and tree differ](claims-agreement.svg)"
    yield paragraph(
        "Each table is cut into ten folds, stratified and shuffled, "
        f"{'once' if seeds == 1 else f'{seeds} times with different seeds'}; each fold "
        "is predicted by a tree learned from the other nine, and by the raw rules of "
        "that tree. Accuracies and shares are per cent of all predictions. "
        "*Differ*: both predict, differently (with Wilson's 95 % interval for as many "
        "trials as the table has rows). *Uncovered*: no raw rule fires; the tree's "
        "right predictions among them in brackets."
    )
    yield _comparisons(found)
    yield paragraph(
        "*Votes*: each row counts once, for the model that was right more often over "
        "the seeds; the tree's share of them, in per cent, is Wilson's 95 % interval. "
        "p is that of the exact McNemar test on the votes, corrected by Holm's method "
        f"for all {len(found)} tests; below {LEVEL:g} a winner is named. Rows of one "
        "tree are not independent, which no test of this kind detects."
    )
    yield _reliable_text(claims.comparisons, found)


def _comparisons(found: Sequence[Verdict]) -> str:
    head = [
        "table",
        "mode",
        "AND",
        "leaves",
        "tree",
        "raw",
        "differ",
        "right there: tree, raw, none",
        "uncovered",
        "votes, tree : raw",
        "tree's share",
        "p",
        "right more often",
    ]
    return table(head, [_comparison_row(verdict) for verdict in found])


def _comparison_row(verdict: Verdict) -> list[str]:
    found = verdict.comparison
    total = found.answers
    low, high = wilson(found.differ / total, found.rows)
    tree, raw = found.votes
    shares = wilson(tree / max(tree + raw, 1), tree + raw)
    return [
        found.table,
        found.mode,
        found.conjunction,
        f"{found.leaves:.1f}",
        percent(found.tree_right, total),
        percent(found.raw_right, total),
        f"{percent(found.differ, total)} ({100 * low:.1f} to {100 * high:.1f})",
        ", ".join(
            percent(count, total)
            for count in (found.tree_only, found.raw_only, found.both_wrong)
        ),
        f"{percent(found.uncovered, total)} "
        f"({percent(found.uncovered_tree_right, total)})",
        f"{tree} : {raw}",
        f"{100 * shares[0]:.0f} to {100 * shares[1]:.0f}" if tree + raw else "-",
        p_value(verdict.corrected),
        verdict.winner,
    ]


def _reliable_text(comparisons: Sequence[Comparison], found: Sequence[Verdict]) -> str:
    in_all = verdicts(comparisons, lambda one: one.votes_in_all)
    changed = sum(a.winner != b.winner for a, b in zip(found, in_all, strict=True))
    answers = sum(one.answers for one in comparisons)
    differs = sum(one.relative_differs for one in comparisons)
    ties = sum(one.ties for one in comparisons)
    tied = sum(one.ties_that_differ for one in comparisons)
    apart = sum(one.differ for one in comparisons)
    verdict = "changes no verdict" if not changed else f"changes {changed} verdicts"
    by_and = {
        name: sum(one.raw_right for one in comparisons if one.conjunction == name)
        for name in ("minimum", "product")
    }
    return "\n".join(
        bullet(sentence)
        for sentence in (
            f"Counting rows without a prediction as wrong {verdict}.",
            f"The relative rules differ from their tree in {differs:,} of {answers:,} "
            "predictions.",
            f"Raw rules are decided by their order among equals in {ties:,} rows; "
            f"{tied:,} of these are among the {apart:,} that differ from the tree's.",
            f"With minimum, raw rules are right in {by_and['minimum']:,} rows, with "
            f"product in {by_and['product']:,}.",
        )
    )


def _search(claims: Claims, found: Sequence[Line]) -> Iterator[str]:
    chosen = [line for line in found if line.what == "best-first"]
    if not chosen:
        return
    yield "## Best-first and the trade"
    yield paragraph(
        "The paper trades reliability for speed: all rules, or one path. Best-first "
        "need not: a rule is never stronger than its beginning, so what cannot win is "
        "not fired, and the result is the rule base's own, tie and all. Below, its "
        "time over the tree's, and how many times as fast it is as firing in "
        "`native`."
    )
    yield _search_table(chosen)
    yield _search_text(claims, chosen)


def _search_table(chosen: Sequence[Line]) -> str:
    order = [
        line
        for kind in KINDS
        for is_batch in (False, True)
        for line in chosen
        if (line.family, line.kind, line.is_batch) == (PRIMARY, kind, is_batch)
    ]
    head = ["n"]
    cells: dict[int, list[str]] = {}
    for line in order:
        where = f"{line.kind}, {'batch' if line.is_batch else 'one row'}"
        head += [f"{where}: of the tree", "as fast as firing, times"]
        for size, price in zip(line.sizes, line.prices, strict=True):
            cells.setdefault(size, [f"{size:,}"]).extend(
                [middle(price.to_tree), middle(price.to_firing)]
            )
    rows = [row for row in cells.values() if len(row) == len(head)]
    return table(head, rows)


def _search_text(claims: Claims, chosen: Sequence[Line]) -> str:
    sentences = []
    for line in chosen:
        start = first_gain(line)
        gain = (
            "not surely faster than firing at the largest n"
            if start is None
            else f"surely faster than firing from {start:,} rules on"
        )
        law = line.law
        grows = ""
        if law:
            is_flat = abs(law.exponent) < FLAT
            grows = ", whatever n" if is_flat else f", growing as n^{law.exponent:.2f}"
        sentences.append(
            f"{line.kind.capitalize()} rules of {line.family} trees, "
            f"{'in batches' if line.is_batch else 'row by row'}: {gain}; "
            f"{spanned(line.ratios)} times the tree's time{grows}."
        )
    checked = sum(size.checked for size in claims.sizes)
    sentences.append(_trade(claims))
    sentences.append(
        f"On all {checked:,} rows that were compared, best-first gave the results of "
        "firing, and relative rules those of the tree."
    )
    return "\n".join(bullet(sentence) for sentence in sentences)


def _trade(claims: Claims) -> str:
    """Return what is left of the trade of reliability for speed."""
    winners = {verdict.winner for verdict in verdicts(claims.comparisons)}
    if "raw rules" in winners:
        return (
            "Where raw rules are right more often, this is the price of their "
            "predictions."
        )
    return (
        "On no table above are raw rules surely right more often than the tree, so "
        "there is no such trade. The search is useful if you need the result of all "
        "raw rules for another reason."
    )


def _method(claims: Claims) -> Iterator[str]:
    machine = claims.machine
    yield "## How it was measured"
    versions = ", ".join(f"{name} {v}" for name, v in sorted(machine.versions.items()))
    load = " and ".join(
        f"{values[0]:.2f} {when}"
        for values, when in (
            (machine.load_before, "before"),
            (machine.load_after, "after"),
        )
        if values
    )
    yield paragraph(
        f"On {machine.processor}, {machine.cores} cores, {machine.system}, "
        f"{machine.python}; {versions}. One thread, and its own time, which does not "
        "run while a neighbour has the core." + (f" Load {load}." if load else "")
    )
    yield paragraph(
        "Rows are standard normal in 11 columns; rules are joined by min. *Multiway* "
        "trees follow a plan. *Grown* ones are binary and were grown by "
        "scikit-learn on 100,000 rows of three noisy classes, then imported. All "
        "representations of a size are timed in interleaved rounds, each in another "
        "order; a ratio is the median of the quotients of the rounds. One row at a "
        "time: 64 rows in turn, of firing as many as take 0.02 s. Batches: 10,000 "
        "rows, of firing as many as make 10 million strengths (1,000 at 10,000 rules), "
        "and 1,000 in scikit-fuzzy. Laying out the rows is not timed; Python's call "
        "of each runtime is."
    )
    omissions = claims.omissions or ("nothing",)
    yield "Left out:\n\n" + "\n".join(bullet(sentence) for sentence in omissions)

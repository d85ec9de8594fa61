"""What learning and predicting cost from a million to a thousand million rows.

    python benchmarks/scale.py [--most ROWS] [--largest ROWS] [--only TEXT] [--again]

Each step runs in a process of its own (`scale_steps.py`, or the command line). Its
seconds of processor time and its memory are those of the process with all that it
started, sampled ten times a second. What is measured is kept in scale.json, so that a
run that was interrupted goes on; with --again the page is made from it alone. Tables
lie in out/scale, 5 GB for each 10^8 rows; it needs psutil and lightgbm.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scale_steps import CLASSES, COLUMNS, KIND, WORKERS, place

from fuzzytree.files import write_atomically

psutil: Any = importlib.import_module("psutil")

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "explanation" / "scale.json"
PAGE = RESULTS.with_suffix(".md")
STEPS = Path(__file__).with_name("scale_steps.py")
ENGINES = ("polars", "duckdb", "ibis", "dask", "spark")
PACKAGES = ("polars", "duckdb", "ibis-framework", "dask", "pyspark", "pyarrow")
CSV_MOST = 10_000_000
LIMIT = 5400.0  # seconds of a step
MANY = (10_000, 100_000)  # classes
MACHINES, TARGET = 100, 10**11

Facts = dict[str, Any]


def main() -> int:
    """Measure what is not measured yet, and write the page."""
    parser = argparse.ArgumentParser(description="Measure learning and predicting.")
    parser.add_argument("--most", type=float, default=1e8, metavar="ROWS")
    parser.add_argument("--largest", type=float, default=1e9, metavar="ROWS")
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "scale")
    parser.add_argument("--only", default="", metavar="TEXT", help="steps named so")
    parser.add_argument("--again", action="store_true", help="measure nothing")
    options = parser.parse_args()
    results: dict[str, Facts] = {}
    if RESULTS.exists():
        results = json.loads(RESULTS.read_bytes())
    if not options.again:
        options.folder.mkdir(parents=True, exist_ok=True)
        sizes = [10**k for k in range(6, 20) if 10**k <= options.most]
        for name, command in steps(sizes, int(options.largest), options.folder):
            is_done = "failed" not in results.get(name, {"failed": ""})
            if is_done or options.only not in name:
                continue
            print(f"{time.strftime('%H:%M:%S')} {name}", file=sys.stderr, flush=True)
            results[name] = measured(command)
            results["machine"] = machine()
            text = json.dumps(results, indent=1)
            write_atomically(RESULTS, f"{text}\n".encode())
    write_atomically(PAGE, page(results).encode())
    print(f"wrote {PAGE}")
    return 0


def machine() -> Facts:
    """Return what the figures depend on."""
    return {
        "cores": os.cpu_count(),
        "memory": psutil.virtual_memory().total,
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
    }


def steps(
    sizes: Sequence[int], largest: int, folder: Path
) -> Iterator[tuple[str, list[str]]]:
    """Yield the name of each step and its command."""

    def step(kind: str, engine: str, rows: int) -> tuple[str, list[str]]:
        command = [sys.executable, str(STEPS), kind, engine, str(rows), str(folder)]
        return f"{kind} {engine} {rows}", command

    model = str(folder / "model.yaml")
    for rows in sizes:
        for kind in ("parquet", "csv"):
            if kind == "csv" and rows > CSV_MOST:
                continue
            yield step("write", kind, rows)
            table = str(place(folder, rows, kind))
            yield (
                f"learn files-{kind} {rows}",
                _verb(
                    "learn",
                    table,
                    "--target",
                    KIND,
                    "--name",
                    "tree",
                    "-o",
                    model,
                    "--json",
                ),
            )
            answers = str(folder / f"answers.{kind}")
            yield (
                f"predict files-{kind} {rows}",
                _verb("run", model, table, "-o", answers),
            )
            yield step("shares", kind, rows)
        for engine in ENGINES:
            yield step("learn", engine, rows)
            yield step("predict", engine, rows)
        yield step("bayes", "scikit-learn", rows)
        yield step("boosting", "lightgbm", rows)
    for classes in MANY:
        yield step("classes", "learn" if classes < 50_000 else "collect", classes)
    yield step("generated", "numpy", largest)


def _verb(*words: str) -> list[str]:
    return [sys.executable, "-m", "fuzzytree", *words]


def measured(command: Sequence[str]) -> Facts:
    """Return what a command printed, and its seconds and memory with all it started.

    What is counted begins when it prints `ready`, or at once; the memory is the largest
    sum over the processes.
    """
    load = os.getloadavg()[0]
    begin = time.monotonic()
    cpu: dict[int, float] = {}
    before, peak, text, is_ready = 0.0, 0, b"", False
    with (
        tempfile.TemporaryFile() as errors,
        psutil.Popen(command, stdout=subprocess.PIPE, stderr=errors) as process,
    ):
        os.set_blocking(process.stdout.fileno(), False)
        while process.poll() is None and time.monotonic() - begin < LIMIT:
            peak = max(peak, _sampled(process, cpu))
            text += process.stdout.read() or b""
            if b"ready\n" in text and not is_ready:
                is_ready, before = True, sum(cpu.values())
            time.sleep(0.1)
        wall = time.monotonic() - begin
        if process.poll() is None:
            for child in [*process.children(recursive=True), process]:
                child.kill()
            return {"failed": f"not done after {LIMIT:.0f} s"}
        text += process.stdout.read() or b""
        if process.returncode:
            errors.seek(0)
            lines = errors.read().decode().strip().splitlines()
            return {"failed": lines[-1] if lines else f"exit {process.returncode}"}
    text = text.removeprefix(b"ready\n")
    facts: Facts = json.loads(text) if text.strip() else {}
    facts.setdefault("seconds", wall)
    if "report" in facts:  # the summary of `fuzzytree learn`
        facts = {key: facts[key] for key in ("seconds", "fingerprint", "accuracy")}
    return {
        **facts,
        "wall": wall,
        "cpu": sum(cpu.values()) - before,
        "peak": peak,
        "load": load,
    }


def _sampled(process: Any, cpu: dict[int, float]) -> int:
    """Note the processor time of each process; return the sum of their memory."""
    total = 0
    for one in [process, *process.children(recursive=True)]:
        try:
            times, memory = one.cpu_times(), one.memory_info()
        except psutil.Error:
            continue
        cpu[one.pid] = times.user + times.system
        total += memory.rss
    return total


# --- the page


def page(results: dict[str, Facts]) -> str:
    """Return the page of all figures."""
    sizes = sorted({int(name.split()[-1]) for name in results if name[:6] == "learn "})
    parts = [
        _introduction(results),
        "## Learning",
        _table("learn", sizes, results),
        "## Predicting",
        "Class, rule and strength, written as Parquet; with CSV in, as CSV.",
        _table("predict", sizes, results),
        "## Who else",
        "GaussianNB of scikit-learn with `partial_fit`, batch by batch; LightGBM with "
        "files behind `lightgbm.Sequence`, ten rounds, two threads: it keeps a byte "
        "for each number in memory.",
        _peers(sizes, results),
        "## Where the time goes",
        _shares(sizes, results),
        "## Many classes",
        _classes(results),
        "## A thousand million rows, and more",
        _largest(results),
    ]
    return "\n\n".join(parts) + "\n"


def _introduction(results: dict[str, Facts]) -> str:
    known = results.get("machine", {})
    packages = ", ".join(f"{n} {v}" for n, v in known.get("packages", {}).items())
    loads = [facts["load"] for facts in results.values() if "load" in facts]
    same = {
        facts["fingerprint"]
        for name, facts in results.items()
        if name.startswith(("learn", "shares")) and name.endswith(" 1000000")
        if "fingerprint" in facts
    }
    answers = {
        json.dumps(facts["counts"])
        for name, facts in results.items()
        if name.startswith("predict") and name.endswith(" 1000000")
        if "counts" in facts
    }
    memory = known.get("memory", 0) / 2**30
    text = f"""`python benchmarks/scale.py` measures and writes this page and
[all the numbers](scale.json). The table has {COLUMNS} columns and {CLASSES} classes;
it lies in Parquet or CSV files of a million rows each, or is made block by block.
Measured on {known.get("cores")} cores with {memory:.0f} GiB, Python
{known.get("python")}, {packages}.

The load before a step was {min(loads, default=0):.1f} to {max(loads, default=0):.1f};
so processor seconds count here, and wall seconds stand beside them; *busy* is where a
step got less than half a core, as others had the machine. *us* is
microseconds of processor time a row, that of engines' own processes included (a JVM,
workers), without their start. *GiB* is the largest resident memory of all these
processes together. The exponent is that of the growth of processor time over the last
two sizes.

Learning from a million rows through files and engines gave {len(same)} fingerprint(s),
and predicting them {len(answers)} set(s) of counts by class."""
    return f"# From a million to a thousand million rows\n\n{_flowed(text)}"


def _rows(cells: Sequence[Sequence[str]]) -> str:
    head, *rest = (f"| {' | '.join(row)} |" for row in cells)
    marks = f"| {' | '.join('---' for _ in cells[0])} |"
    return "\n".join([head, marks, *rest])


def _table(kind: str, sizes: Sequence[int], results: dict[str, Facts]) -> str:
    names = ["files-parquet", "files-csv", *ENGINES]
    return _costs(kind, names, sizes, results)


def _costs(
    kind: str, names: Sequence[str], sizes: Sequence[int], results: dict[str, Facts]
) -> str:
    cells = [["", *(f"{_power(rows)}: s, us, GiB" for rows in sizes), "exponent"]]
    for name in names:
        found = [results.get(f"{kind} {name} {rows}", {}) for rows in sizes]
        shown = [_cost(facts, rows) for facts, rows in zip(found, sizes, strict=True)]
        cells.append(
            [name.replace("files-", "files: "), *shown, _exponent(found, sizes)]
        )
    return _rows(cells)


def _cost(facts: Facts, rows: int) -> str:
    if "cpu" not in facts:
        return str(facts.get("failed", "-"))
    each = facts["cpu"] / rows * 1e6
    is_free = facts["cpu"] > facts["seconds"] / 2
    seconds = f"{facts['seconds']:.1f}" if is_free else "busy"
    return f"{seconds}, {each:.2f}, {facts['peak'] / 2**30:.2f}"


def _exponent(found: Sequence[Facts], sizes: Sequence[int]) -> str:
    """Return by which power of the rows processor time grew over the last step."""
    known = [(s, f["cpu"]) for f, s in zip(found, sizes, strict=True) if "cpu" in f]
    if len(known) < 2:
        return "-"
    (rows, cpu), (more, longer) = known[-2:]
    return f"{math.log(longer / cpu) / math.log(more / rows):.2f}"


def _power(rows: int) -> str:
    return f"10^{round(math.log10(rows))}"


def _peers(sizes: Sequence[int], results: dict[str, Facts]) -> str:
    both = [
        _costs(kind, [name], sizes, results).splitlines()[2]
        for kind, name in (("bayes", "scikit-learn"), ("boosting", "lightgbm"))
    ]
    ours = _costs("learn", ["files-parquet"], sizes, results)
    return "\n".join([ours, *both])


def _shares(sizes: Sequence[int], results: dict[str, Facts]) -> str:
    cells = [["seconds, one after another", *map(_power, sizes)]]
    columns = [results.get(f"shares parquet {rows}", {}) for rows in sizes]
    for key in (
        "read",
        "read and update",
        "write a state",
        "read and merge a state",
        "learn",
    ):
        shown = [f"{column[key]:.3g}" if key in column else "-" for column in columns]
        cells.append([key, *shown])
    return _rows(cells)


def _classes(results: dict[str, Facts]) -> str:
    keys = ("update", "write and read a state", "merge", "learn")
    cells = [["classes", "rows", "state, MB", *(f"{key}, s" for key in keys)]]
    for name, facts in results.items():
        if name.startswith("classes") and "state bytes" in facts:
            count = int(name.split()[-1])
            shown = [f"{facts[key]:.2f}" if key in facts else "-" for key in keys]
            size = f"{facts['state bytes'] / 1e6:.1f}"
            cells.append([f"{count:,}", f"{20 * count:,}", size, *shown])
    return (
        "A state grows with classes times columns, and with the rows that it keeps, "
        "20,000 of a class at most. Twenty rows of each class here.\n\n" + _rows(cells)
    )


def _largest(results: dict[str, Facts]) -> str:
    names = [name for name in results if name.startswith("generated")]
    if not names or "cpu" not in results[names[-1]]:
        return "Not measured."
    facts, rows = results[names[-1]], int(names[-1].split()[-1])
    own = (facts["cpu"] - facts["making"]) / rows
    sizes = [int(name.split()[-1]) for name in results if name[:14] == "shares parquet"]
    parts = results.get(f"shares parquet {max(sizes, default=0)}", {})
    peak, size = facts["peak"] / 2**30, max(facts["bytes"]) / 1e6
    text = f"""{rows:,} rows, made in {WORKERS} processes by blocks of a million that
are forgotten once they are taken: {facts["seconds"]:.0f} s, with a load of
{facts["load"]:.1f} before. Of {facts["cpu"]:.0f} s of processor time
{facts["making"]:.0f} s were for making the rows, so taking them took {own * 1e6:.2f} us
a row; at most {peak:.2f} GiB; {WORKERS} states of {size:.1f} MB."""
    if "read and update" in parts:
        each = parts["read and update"] / max(sizes)
        cores = MACHINES * WORKERS
        merging = parts["read and merge a state"] * math.ceil(math.log2(MACHINES))
        size = MACHINES * parts["state bytes"]
        seconds = TARGET * each / cores
        rounds = math.ceil(math.log2(MACHINES))
        text += f"""

**By calculation, not measured:** {_power(TARGET)} rows in Parquet files on {MACHINES}
machines of {WORKERS} such cores each take {TARGET:.0e} x {each * 1e6:.2f} us / {cores}
= {seconds:.0f} s to read and take, if each machine reads its files as fast as this one.
{size / 1e6:.0f} MB of states are sent, and merged in pairs in {rounds} rounds of
{parts["read and merge a state"]:.2f} s ({merging:.1f} s); learning from the last takes
{parts["learn"]:.1f} s."""
    return _flowed(text)


def _flowed(text: str) -> str:
    parts = text.split("\n\n")
    fill = functools.partial(textwrap.fill, width=96, break_long_words=False)
    return "\n\n".join(map(fill, parts))


if __name__ == "__main__":
    sys.exit(main())

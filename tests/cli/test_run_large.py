"""`fuzzytree run` on tables of many files and rows: threads, types, memory, signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq
import pytest

import fuzzytree as ft
from fuzzytree import csv_rows, tables
from fuzzytree.cli import run
from fuzzytree.errors import TableError
from fuzzytree.model import Semantics
from fuzzytree.tables import batches, in_order
from fuzzytree.testing import random_system
from tests.cli.conftest import Call, grip
from tests.cli.test_loads import loaded

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read few rows at a time."""
    monkeypatch.setattr(tables, "PIECE", 7)
    monkeypatch.setattr(tables, "BLOCK", 256)
    monkeypatch.setattr(csv_rows, "BLOCK", 256)


def _rows(count: int, seed: int = 0) -> pa.Table:
    random = np.random.default_rng(seed)
    force = random.uniform(0, 5, count)
    missing = random.random(count) < 0.1
    return pa.table(
        {
            "slip": pa.array(random.integers(0, 2, count), pa.int16()),
            "force": pa.array(force, mask=missing),
            "note": pa.array([f"note {k}" for k in range(count)]),
        }
    )


def _write_arrow(table: pa.Table, path: str, compression: str | None = None) -> None:
    options = pa.ipc.IpcWriteOptions(compression=compression)
    with pa.ipc.new_file(path, table.schema, options=options) as file:
        file.write_table(table)


def _folder(count: int = 100) -> None:
    """Write a folder of rows in four formats, the columns in several orders."""
    Path("rows").mkdir()
    table = _rows(4 * count)
    parts = [table.slice(k * count, count) for k in range(4)]
    arrow_csv.write_csv(parts[0], "rows/a.csv")
    pq.write_table(parts[1].select(["note", "force", "slip"]), "rows/b.parquet")
    _write_arrow(parts[2].select(["force", "slip", "note"]), "rows/c.arrow")
    _write_arrow(parts[3], "rows/d.feather", "lz4")


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("output", ["out.csv", "out.parquet", "out.arrow"])
@pytest.mark.parametrize("keep", [(), ("--keep",)])
def test_every_number_of_threads_writes_the_same_bytes(
    call: Call, monkeypatch: pytest.MonkeyPatch, output: str, keep: tuple[str, ...]
) -> None:
    _folder()
    written: list[bytes] = []
    for threads in (1, 2, 5):
        monkeypatch.setattr(tables, "THREADS", threads)
        words = ("run", "grip.yaml", "rows", *keep, "-o", output)
        assert call(*words, "--quiet") == (0, "", "")
        written.append(Path(output).read_bytes())
    assert written[0] == written[1] == written[2]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("keep", [(), ("--keep",)])
def test_a_folder_of_several_formats_is_predicted_row_by_row(
    call: Call, keep: tuple[str, ...]
) -> None:
    _folder()
    arrow_csv.write_csv(_rows(400), "whole.csv")
    whole = call("run", "grip.yaml", "whole.csv")[1]
    found = call("run", "grip.yaml", "rows", *keep)[1]
    ends = [",".join(line.split(",")[-3:]) for line in found.splitlines()]
    assert ends == whole.splitlines()
    assert {line.split(",")[2] for line in ends[1:]} == {"decided", "missing"}


@pytest.mark.parametrize("suffix", ["parquet", "arrow", "feather"])
def test_a_binary_file_has_types_and_the_rows_of_the_csv_file(
    call: Call, suffix: str
) -> None:
    words = ("run", "grip.yaml", "grasps.csv", "--strengths", "class", "--why")
    code, out, err = call(*words, "-o", f"out.{suffix}")
    assert (code, out) == (0, "")
    assert err.endswith(f"wrote     out.{suffix}\n")
    read = pq.read_table if suffix == "parquet" else pa.ipc.open_file
    table = read(f"out.{suffix}")
    table = table if suffix == "parquet" else table.read_all()
    assert {field.name: str(field.type) for field in table.schema} == {
        "class": "string",
        "rule": "int32",
        "status": "dictionary<values=string, indices=int8, ordered=0>",
        "strength of class firm": "double",
        "strength of class loose": "double",
        "strength of class soft": "double",
        "why": "string",
    }
    lines = call(*words)[1].splitlines()
    cells = [["" if v is None else str(v) for v in row.values()]
             for row in table.to_pylist()]  # fmt: skip
    assert [",".join(row) for row in cells] == lines[1:]
    assert table["strength of class soft"].null_count == 1


@pytest.mark.parametrize(
    ("label_type", "names", "kind"),
    [
        ("number", ("1", "2", "3"), "int64"),
        ("number", ("1", "2", "3.5"), "double"),
        ("boolean", ("False", "True"), "bool"),
    ],
)
def test_the_class_has_the_type_of_the_labels(
    call: Call, label_type: str, names: tuple[str, ...], kind: str
) -> None:
    tree = grip()
    position = {name: k % len(names) for k, name in enumerate(tree.classes)}
    leaves = tuple(
        msgspec.structs.replace(leaf, label=names[position[leaf.label]])
        for leaf in tree.leaves
    )
    semantics = Semantics(label_type=label_type)  # type: ignore[arg-type]
    model = msgspec.structs.replace(
        tree, classes=names, leaves=leaves, semantics=semantics
    )
    ft.save(model, "typed.yaml")
    words = ("run", "typed.yaml", "grasps.csv", "--quiet", "-o", "out.parquet")
    assert call(*words)[0] == 0
    column = pq.read_table("out.parquet")["class"]
    assert (str(column.type), column.null_count) == (kind, 1)
    assert column.to_pylist() == ft.run(model, "grasps.csv").classes


def test_the_outputs_of_a_system_are_doubles_with_null(call: Call) -> None:
    system = random_system(3)
    ft.save(system, "system.yaml")
    rows = {name: [0.5, None] for name in system.inputs}
    pq.write_table(pa.table(rows), "rows.parquet")
    words = ("run", "system.yaml", "rows.parquet", "--quiet", "-o", "out.parquet")
    assert call(*words)[0] == 0
    table = pq.read_table("out.parquet")
    values = ft.run(system, "rows.parquet").values
    for output, expected in zip(system.outputs, values, strict=True):
        assert str(table[output.name].type) == "double"
        first, last = table[output.name].to_pylist()
        assert (first, last) == (expected[0], None)
    assert table["status"].to_pylist()[1] == "missing"


def test_kept_columns_keep_their_types(call: Call) -> None:
    table = _rows(20).append_column("on", pa.array([None, True] * 10))
    pq.write_table(table, "rows.parquet", row_group_size=5)
    words = ("run", "grip.yaml", "rows.parquet", "--keep", "--quiet", "-o", "out.arrow")
    assert call(*words) == (0, "", "")
    found = pa.ipc.open_file("out.arrow").read_all()
    assert found.select(table.column_names).equals(table)


def test_kept_columns_of_two_types_are_refused(call: Call) -> None:
    Path("rows").mkdir()
    pq.write_table(_rows(3), "rows/a.parquet")
    other = _rows(3).set_column(2, "note", pa.array([[1], [2], [3]]))
    pq.write_table(other, "rows/b.parquet")
    words = ("run", "grip.yaml", "rows", "--keep", "--quiet", "-o", "out.parquet")
    code, _, err = call(*words)
    assert code == 2
    assert err.startswith(
        "rows/b.parquet: columns have other types than in the files before it; leave "
        "out --keep, or convert them: "
    )
    assert err.count("\n") == 1
    assert not Path("out.parquet").exists()


@pytest.mark.parametrize(
    ("flag", "output", "text"),
    [
        ("--json", "o.parquet", "--json is about text, and o.parquet is a binary file"),
        ("--json", "o.Feather", "--json is about text, and o.Feather is a binary file"),
        ("--safe-csv", "o.arrow", "--safe-csv is about text, and o.arrow is a binary "
         "file"),
    ],
)  # fmt: skip
def test_text_options_and_a_binary_file_are_one_sentence(
    call: Call, flag: str, output: str, text: str
) -> None:
    hint = "\n  fuzzytree run --help lists the options\n"
    words = ("run", "grip.yaml", "grasps.csv", flag, "-o", output)
    assert call(*words) == (2, "", text + hint)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("threads", [1, 2, 8])
def test_the_first_bad_cell_of_a_folder_is_reported(
    call: Call, monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    monkeypatch.setattr(tables, "THREADS", threads)
    Path("rows").mkdir()
    for number in range(1, 21):
        lines = ["force,slip", *["1.5,0"] * 30]
        if number == 17:
            lines[12] = "wet,0"
        if number >= 17:
            lines[29] = "worse,0"
        Path(f"rows/{number:02}.csv").write_text("\n".join(lines) + "\n")
    Path("out.parquet").write_text("old")
    for _ in range(3):
        assert call("run", "grip.yaml", "rows", "-o", "out.parquet") == (
            2,
            "",
            "rows/17.csv:13: column 'force' holds text where a number is needed: "
            "'wet'\n",
        )
    assert sorted(path.name for path in Path().glob("*out*")) == ["out.parquet"]
    assert Path("out.parquet").read_text() == "old"


def test_a_file_of_a_folder_without_a_column_is_named(call: Call) -> None:
    Path("rows").mkdir()
    Path("rows/1.csv").write_text("force,slip\n1.5,0\n")
    Path("rows/2.csv").write_text("force\n1.5\n")
    assert call("run", "grip.yaml", "rows", "--quiet") == (
        2,
        "class,rule,status\nsoft,1,decided\n",
        "rows/2.csv has no column 'slip', which rows/1.csv has; it has force\n",
    )


def test_a_file_with_a_header_alone_adds_no_rows(call: Call) -> None:
    Path("rows").mkdir()
    for name, line in (("1", ""), ("2", "1.5,0\n"), ("3", ""), ("4", "1.5,0\n")):
        Path(f"rows/{name}.csv").write_text(f"force,slip\n{line}")
    out = "class,rule,status\nsoft,1,decided\nsoft,1,decided\n"
    assert call("run", "grip.yaml", "rows", "--quiet") == (0, out, "")
    assert call("run", "grip.yaml", "rows", "--quiet", "-o", "out.parquet")[0] == 0
    assert pq.read_table("out.parquet")["class"].to_pylist() == ["soft", "soft"]


def test_no_rows_give_a_binary_file_with_columns(call: Call) -> None:
    Path("none.csv").write_text("force,slip\n")
    assert call("run", "grip.yaml", "none.csv", "--quiet", "-o", "out.arrow")[0] == 0
    table = pa.ipc.open_file("out.arrow").read_all()
    assert (table.column_names, len(table)) == (["class", "rule", "status"], 0)


@pytest.mark.usefixtures("small")
def test_progress_reports_rows_and_their_rate(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[str, float | None]] = []

    @contextmanager
    def bar(*, quiet: bool) -> Generator[Callable[[str, float | None], None]]:
        yield lambda text, share: None if quiet else shown.append((text, share))

    monkeypatch.setattr(run, "progress_bar", bar)
    arrow_csv.write_csv(_rows(20), "rows.csv")
    assert call("run", "grip.yaml", "rows.csv", "--quiet")[0] == 0
    assert not shown
    assert call("run", "grip.yaml", "rows.csv")[0] == 0
    texts = [text.split(" rows, ") for text, _ in shown]
    assert {int(rows) for rows, _ in texts} >= {7, 20}
    assert all(rate.endswith(" rows/s") for _, rate in texts)


def test_binary_tables_are_read_without_pandas(folder: Path) -> None:
    pq.write_table(_rows(20), "rows.parquet")
    _write_arrow(_rows(20), "rows.arrow")
    words = ("run", "grip.yaml", "--quiet")
    lines = [(*words, "rows.parquet"), (*words, "rows.arrow")]
    assert loaded(folder, lines, ("pandas",)) == [[0], [0]]


CELLS = (
    "1", " 2.5 ", "", "NA", "nan", "None", "+3", "1e400", "-1e-400", ".5", "7.",
    "inf", "n/a", "0x1", "1_0", "1,5", "wet", "9007199254740993", "1e23", "-0",
)  # fmt: skip


@pytest.mark.parametrize("seed", range(30))
def test_numbers_are_read_as_from_text(seed: int) -> None:
    random = np.random.default_rng(seed)
    known = CELLS[:6] if seed % 2 else CELLS[:13]
    cells = random.choice(known if seed % 3 else CELLS, (25, 2))
    text = "a,b\n" + "".join(f'"{a}","{b}"\n' for a, b in cells)
    results: list[object] = []
    for with_others in (False, True):
        try:
            parts = batches(_stream(text), ["b", "a"], with_others=with_others)
            values = np.hstack([part.values for part in parts])
            results.append(values.tobytes())
        except TableError as error:
            results.append(str(error))
    assert results[0] == results[1]


def _stream(text: str) -> object:
    Path("cells.csv").write_text(text)
    return "cells.csv"


@pytest.mark.parametrize(
    "kind", [pa.int8(), pa.uint64(), pa.int64(), pa.float32(), pa.float64()], ids=str
)
@pytest.mark.parametrize("start", [0, 3, 8, 13])
@pytest.mark.parametrize("has_null", [False, True])
def test_numbers_become_an_array_and_null_nan(
    kind: pa.DataType, start: int, has_null: bool
) -> None:
    cells = [None if has_null and k % 5 == 2 else k for k in range(40)]
    column = pa.chunked_array([pa.array(cells, kind)] * 2).slice(start, 50)
    found, expected = csv_rows.number_array(column), column.to_numpy()
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_the_first_error_in_order_is_raised_after_what_comes_before(
    monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    monkeypatch.setattr(tables, "THREADS", threads)
    later = threading.Event()

    def work(item: int) -> int:
        if item == 3:
            later.set()
            raise KeyError(item)
        if item == 2:
            later.wait(0.2)
            raise ValueError(item)
        return item

    def items() -> Iterator[int]:
        yield from range(4)
        raise ZeroDivisionError

    results: list[int] = []
    with pytest.raises(ValueError, match="2"):
        results.extend(in_order(work, items()))
    assert results == [0, 1]
    with pytest.raises(ZeroDivisionError):
        results.extend(in_order(int, items()))
    assert results == [0, 1, 0, 1, 2, 3]


def test_few_items_are_taken_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "THREADS", 2)
    taken = iter(range(1000))
    result = in_order(str, taken)
    assert next(result) == "0"
    result.close()
    assert next(taken) < 10


PEAK = """
import re, sys
from fuzzytree.cli import main
code = main(sys.argv[1:])
with open("/proc/self/status") as file:  # ru_maxrss counts the parent's memory too
    print(code, re.search(r"VmHWM:\\s*(\\d+) kB", file.read())[1])
"""


@pytest.mark.heavy
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("name", ["t.csv", "t.parquet", "t.arrow"])
@pytest.mark.parametrize("output", ["out.csv", "out.parquet"])
def test_memory_is_bounded_for_one_huge_batch(name: str, output: str) -> None:
    count = 4_000_000
    force = np.random.default_rng(0).uniform(0, 5, count).round(4)
    columns = {"force": force, "slip": force % 1, **{f"x{k}": force for k in range(6)}}
    table = pa.table(columns)
    if name == "t.csv":
        arrow_csv.write_csv(table.select([0, 1, 2, 3]), name)
    elif name == "t.parquet":
        pq.write_table(table, name, row_group_size=count, use_dictionary=False)
        assert pq.ParquetFile(name).num_row_groups == 1
    else:
        _write_arrow(table, name)
        assert pa.ipc.open_file(name).num_record_batches == 1
    keep = ("--keep",) if output == "out.parquet" else ()
    size = table.nbytes // 1024
    del table, columns
    words = ("run", "grip.yaml", name, *keep, "-o", output, "--quiet")
    done = subprocess.run(
        [sys.executable, "-c", PEAK, *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True, capture_output=True, check=True,
    )  # fmt: skip
    code, peak_kb = map(int, done.stdout.split())
    assert code == 0
    assert peak_kb < (400_000 if keep else 200_000) < size + 200_000


@pytest.mark.heavy
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("output", ["out.csv", "out.parquet", "out.arrow"])
def test_a_signal_leaves_no_file(number: int, output: str) -> None:
    Path("rows").mkdir()
    pq.write_table(_rows(1_000_000).drop(["note"]), "rows/0.parquet")
    for k in range(1, 40):
        os.link("rows/0.parquet", f"rows/{k}.parquet")
    Path("to").mkdir()
    for wait_s in (0.0, 0.3):
        process = subprocess.Popen(
            [sys.executable, "-m", "fuzzytree", "run", "grip.yaml", "rows",
             "-o", f"to/{output}"],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            text=True, stderr=subprocess.PIPE,
        )  # fmt: skip
        while process.poll() is None and not any(Path("to").iterdir()):
            time.sleep(0.01)
        time.sleep(wait_s)
        process.send_signal(number)
        _, err = process.communicate(timeout=120)
        assert (process.returncode, err) == (
            130,
            "interrupted; files are as they were\n",
        )
        assert not any(Path("to").iterdir())

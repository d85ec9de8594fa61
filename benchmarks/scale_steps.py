"""One step of `scale.py` in a process of its own: it prints `ready`, then a JSON line.

    python benchmarks/scale_steps.py STEP ENGINE ROWS FOLDER

The table of `ROWS` rows is a folder of Parquet or CSV files of a million rows each. Its
blocks come from a generator with the number of the block as its seed, so that a table
can be had without files, too.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.dataset
import pyarrow.parquet

import fuzzytree as ft
from fuzzytree.model import fingerprint

pc: Any = importlib.import_module("pyarrow.compute")

COLUMNS, CLASSES, BLOCK = 11, 7, 1_000_000
KIND = "kind"
WORKERS = 2
ROUNDS = 10  # of boosting

Facts = dict[str, Any]


def main() -> None:
    """Run the step that the command line names."""
    step, engine, rows, folder = sys.argv[1:]
    facts = STEPS[step](engine, int(rows), Path(folder))
    print(json.dumps(facts), flush=True)


def ready() -> float:
    """Say that what is timed begins, and return the time."""
    print("ready", flush=True)
    return time.perf_counter()


# --- the table


def block(number: int, rows: int = BLOCK) -> pa.Table:
    """Return a block of the table: gaussian classes, four decimals."""
    centres = np.random.default_rng(5).normal(0.0, 3.0, (CLASSES, COLUMNS))
    random = np.random.default_rng([7, number])
    codes = random.integers(0, CLASSES, rows, dtype=np.int32)
    values = centres[codes] + random.normal(0.0, 1.5, (rows, COLUMNS))
    values = np.round(values, 4)
    columns = {f"x{k}": values[:, k] for k in range(COLUMNS)}
    names = pa.array([f"class {k}" for k in range(CLASSES)])
    kinds = pa.DictionaryArray.from_arrays(pa.array(codes), names)
    return pa.table({**columns, KIND: kinds.cast(pa.string())})


def blocks(rows: int) -> Iterator[tuple[int, int]]:
    """Yield the number and the rows of each block."""
    for number, first in enumerate(range(0, rows, BLOCK)):
        yield number, min(BLOCK, rows - first)


def place(folder: Path, rows: int, kind: str = "parquet") -> Path:
    """Return the folder of a table."""
    return folder / f"{kind}-{rows}"


def write(engine: str, rows: int, folder: Path) -> Facts:
    """Write the table as Parquet or CSV."""
    target = place(folder, rows, engine)
    target.mkdir(parents=True, exist_ok=True)
    begin = ready()
    for number, count in blocks(rows):
        path = target / f"part-{number:04d}.{engine}"
        if path.exists():
            continue
        whole = block(number, count)
        if engine == "csv":
            pyarrow.csv.write_csv(whole, path)
        else:
            pyarrow.parquet.write_table(whole, path)
    size = sum(file.stat().st_size for file in target.iterdir())
    return {"seconds": time.perf_counter() - begin, "bytes": size}


# --- engines


def frame(engine: str, folder: Path) -> Any:
    """Return a lazy frame of a folder of Parquet files."""
    files = f"{folder}/*.parquet"
    match engine:
        case "polars":
            import polars as pl

            return pl.scan_parquet(files)
        case "duckdb":
            import duckdb

            return duckdb.read_parquet(files)
        case "ibis":
            ibis: Any = importlib.import_module("ibis")
            return ibis.duckdb.connect().read_parquet(files)
        case "dask":
            dask: Any = importlib.import_module("dask.dataframe")
            distributed: Any = importlib.import_module("distributed")
            cluster = distributed.LocalCluster(
                n_workers=WORKERS, threads_per_worker=1, dashboard_address=None
            )
            distributed.Client(cluster)
            return dask.read_parquet(files)
        case "spark":
            return spark().read.parquet(str(folder))
        case _:
            raise ValueError(engine)


def spark() -> Any:
    """Return a session of Spark with a driver and two worker processes."""
    pyspark: Any = importlib.import_module("pyspark")
    sql: Any = importlib.import_module("pyspark.sql")
    os.environ["SPARK_HOME"] = str(Path(pyspark.__file__).parent)
    os.environ["SPARK_LOCAL_IP"] = "127.0.0.1"
    os.environ["PYSPARK_PYTHON"] = sys.executable
    return (
        sql.SparkSession.builder.master(f"local-cluster[{WORKERS},1,1024]")
        .config("spark.driver.host", "127.0.0.1")
        .config("spark.ui.enabled", "false")
        .config("spark.log.level", "ERROR")
        .getOrCreate()
    )


def sink(engine: str, answers: Any, target: Path) -> None:
    """Write a lazy frame as Parquet."""
    match engine:
        case "polars":
            answers.sink_parquet(target)
        case "duckdb":
            answers.write_parquet(str(target))
        case "ibis":
            answers.to_parquet(target)
        case "dask":
            answers.to_parquet(str(target))
        case "spark":
            answers.write.mode("overwrite").parquet(str(target))
        case _:
            raise ValueError(engine)


def learn(engine: str, rows: int, folder: Path) -> Facts:
    """Learn from a lazy frame."""
    source = frame(engine, place(folder, rows))
    begin = ready()
    tree = ft.learn(source, target=KIND)
    seconds = time.perf_counter() - begin
    return {"seconds": seconds, "fingerprint": fingerprint(tree)}


def predict(engine: str, rows: int, folder: Path) -> Facts:
    """Predict a lazy frame and write class, rule and strength as Parquet."""
    source = frame(engine, place(folder, rows))
    model = ft.load(folder / "model.yaml")
    target = folder / f"answers-{engine}"
    begin = ready()
    answers = ft.predict(source, model)
    wanted = ["class", "rule", "strength"]
    answers = answers.select(*wanted) if engine != "dask" else answers[wanted]
    sink(engine, answers, target)
    return {"seconds": time.perf_counter() - begin, "counts": counted(target)}


def counted(target: Path) -> dict[str, int]:
    """Return how many rows got which class."""
    table = pyarrow.dataset.dataset(target).to_table(columns=["class"])
    labels = pc.cast(table["class"], pa.string())
    found = pc.value_counts(labels).to_pylist()
    pairs = sorted((str(one["values"]), int(one["counts"])) for one in found)
    return dict(pairs)


# --- shares, peers, classes, and the largest table


def shares(engine: str, rows: int, folder: Path) -> Facts:
    """Time the parts of learning from files, in one thread."""
    from fuzzytree.tables import pieces

    source = place(folder, rows, engine)
    begin = ready()
    for _ in pieces(source):
        pass
    read = time.perf_counter() - begin
    halves = [ft.Learner(KIND) for _ in range(WORKERS)]
    begin = time.perf_counter()
    for number, file in enumerate(sorted(source.iterdir())):
        halves[number % WORKERS].update(file)
    update = time.perf_counter() - begin
    begin = time.perf_counter()
    contents = [half.to_bytes() for half in halves if half.rows]
    written = time.perf_counter() - begin
    begin = time.perf_counter()
    first, *others = map(ft.Learner.from_bytes, contents)
    for other in others:
        first = first.merge(other)
    merged = time.perf_counter() - begin
    begin = time.perf_counter()
    tree = first.learn()
    return {
        "read": read,
        "read and update": update,
        "write a state": written / len(contents),
        "read and merge a state": merged / len(contents),
        "learn": time.perf_counter() - begin,
        "state bytes": len(contents[0]),
        "fingerprint": fingerprint(tree),
    }


def batches(source: Path) -> Iterator[pa.RecordBatch]:
    """Yield a folder of Parquet files in batches."""
    for file in sorted(source.iterdir()):
        yield from pyarrow.parquet.ParquetFile(file).iter_batches(1 << 17)


def matrix(batch: pa.RecordBatch) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return the numbers and the class codes of a batch."""
    numbers = [batch.column(k).to_numpy() for k in range(COLUMNS)]
    names = pa.array([f"class {k}" for k in range(CLASSES)])
    codes = pc.index_in(batch.column(COLUMNS), names).to_numpy()
    return np.column_stack(numbers), codes


def bayes(engine: str, rows: int, folder: Path) -> Facts:
    """Fit scikit-learn's GaussianNB batch by batch."""
    from sklearn.naive_bayes import GaussianNB

    model = GaussianNB()
    begin = ready()
    for batch in batches(place(folder, rows)):
        model.partial_fit(*matrix(batch), classes=np.arange(CLASSES))
    return {"seconds": time.perf_counter() - begin}


def boosting(engine: str, rows: int, folder: Path) -> Facts:
    """Boost with LightGBM, which keeps a byte for each number, from files."""
    lightgbm: Any = importlib.import_module("lightgbm")

    class Rows(lightgbm.Sequence):  # type: ignore[misc]  # it has no types
        """The numbers of a file, read when they are wanted."""

        batch_size = BLOCK

        def __init__(self, file: Path) -> None:
            self.file = pyarrow.parquet.ParquetFile(file)
            self.values: np.ndarray[Any, Any] | None = None

        def __len__(self) -> int:
            return int(self.file.metadata.num_rows)

        def __getitem__(self, wanted: Any) -> np.ndarray[Any, Any]:
            whole = self.values
            if whole is None:
                table = self.file.read([f"x{k}" for k in range(COLUMNS)])
                whole = np.column_stack([column.to_numpy() for column in table])
            self.values = None if isinstance(wanted, slice) else whole
            found: np.ndarray[Any, Any] = whole[wanted]
            return found

    files = sorted(place(folder, rows).iterdir())
    begin = ready()
    names = pa.array([f"class {k}" for k in range(CLASSES)])
    labels = np.concatenate(
        [
            pc.index_in(pyarrow.parquet.read_table(file, columns=[KIND])[0], names)
            for file in files
        ]
    )
    settings = {
        "objective": "multiclass",
        "num_class": CLASSES,
        "num_threads": WORKERS,
        "verbosity": -1,
    }
    data = lightgbm.Dataset(list(map(Rows, files)), labels, params=settings)
    lightgbm.train(settings, data, ROUNDS)
    return {"seconds": time.perf_counter() - begin}


def classes(engine: str, rows: int, folder: Path) -> Facts:
    """Collect and learn `rows` classes of 20 rows each."""
    random = np.random.default_rng(0)
    codes = np.repeat(np.arange(rows), 20)
    values = random.normal(size=(rows, COLUMNS))[codes]
    values = values + 0.1 * random.normal(size=values.shape)
    order = random.permutation(len(codes))
    columns = {f"x{k}": values[order, k] for k in range(COLUMNS)}
    whole = pa.table({**columns, KIND: codes[order]})
    half = len(codes) // 2
    first, second = ft.Learner(KIND), ft.Learner(KIND)
    begin = ready()
    first.update(whole.slice(0, half))
    second.update(whole.slice(half))
    update = time.perf_counter() - begin
    begin = time.perf_counter()
    content = first.to_bytes()
    ft.Learner.from_bytes(content)
    bytes_seconds = time.perf_counter() - begin
    begin = time.perf_counter()
    merged = first.merge(second)
    merge = time.perf_counter() - begin
    result = {
        "update": update,
        "write and read a state": bytes_seconds,
        "merge": merge,
        "state bytes": len(content),
    }
    if engine == "learn":
        begin = time.perf_counter()
        result["leaves"] = len(merged.learn().leaves)
        result["learn"] = time.perf_counter() - begin
    return result


def generated(engine: str, rows: int, folder: Path) -> Facts:
    """Learn from a table that is generated block by block in two processes."""
    begin = ready()
    jobs = [(number, rows) for number in range(WORKERS)]
    with ProcessPoolExecutor(WORKERS) as pool:
        found = list(pool.map(_half, *zip(*jobs, strict=True)))
    collected = time.perf_counter() - begin
    first, *others = (ft.Learner.from_bytes(content) for content, _ in found if content)
    for other in others:
        first = first.merge(other)
    tree = first.learn()
    return {
        "seconds": time.perf_counter() - begin,
        "collected": collected,
        "making": sum(seconds for _, seconds in found),
        "rows": first.rows,
        "bytes": [len(content) for content, _ in found],
        "fingerprint": fingerprint(tree),
    }


def _half(worker: int, rows: int) -> tuple[bytes, float]:
    """Return the state of every other block, and the seconds that making them took."""
    learner, making = ft.Learner(KIND), 0.0
    for number, count in blocks(rows):
        if number % WORKERS != worker:
            continue
        begin = time.process_time()
        table = block(number, count)
        making += time.process_time() - begin
        learner.update(table)
    return learner.to_bytes() if learner.rows else b"", making


STEPS: dict[str, Callable[[str, int, Path], Facts]] = {
    "write": write,
    "learn": learn,
    "predict": predict,
    "shares": shares,
    "bayes": bayes,
    "boosting": boosting,
    "classes": classes,
    "generated": generated,
}

if __name__ == "__main__":
    main()

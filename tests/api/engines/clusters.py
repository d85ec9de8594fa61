"""Clusters of several processes for tests, which leave no process behind."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import pytest

_MARK = "FUZZYTREE_TEST_CLUSTER"
_SETTINGS = """
spark.driver.host 127.0.0.1
spark.ui.enabled false
spark.ui.showConsoleProgress false
spark.connect.grpc.binding.address 127.0.0.1
"""
_LOG = """
rootLogger.level = error
rootLogger.appenderRef.console.ref = console
appender.console.type = Console
appender.console.name = console
appender.console.target = SYSTEM_ERR
appender.console.layout.type = PatternLayout
appender.console.layout.pattern = %p %c: %m%n
"""
# The virtual machines live for seconds: they start twice as fast without the second
# compiler and with the simplest collector.
_JAVA = "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC"


def needs(module: str, program: str = "") -> None:
    """Skip a module's tests where an engine is not installed; fail where all are."""
    absent = [] if importlib.util.find_spec(module) else [f"the Python module {module}"]
    absent += [] if not program or shutil.which(program) else [f"the program {program}"]
    if not absent:
        return
    text = f"{' and '.join(absent)} is not installed"
    if os.environ.get("FUZZYTREE_WITNESSES") == "all":
        pytest.fail(text)
    pytest.skip(text, allow_module_level=True)


def processes_of(mark: str) -> list[int]:
    """Return the processes, other than this one, that inherited a mark."""
    wanted, numbers = f"{_MARK}={mark}".encode(), list[int]()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if wanted in (folder / "environ").read_bytes().split(b"\0"):
                numbers.append(int(folder.name))
    return [number for number in numbers if number != os.getpid()]


@contextlib.contextmanager
def no_survivors() -> Iterator[pytest.MonkeyPatch]:
    """Mark all processes that start inside; none of them may survive.

    Yields:
        What sets variables of the environment until then.
    """
    mark = uuid.uuid4().hex
    resource_tracker.ensure_running()  # it lives as long as this process
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(_MARK, mark)
        try:
            yield patch
        finally:
            deadline = time.monotonic() + 120
            while (survivors := processes_of(mark)) and time.monotonic() < deadline:
                time.sleep(0.05)
            for number in survivors:
                os.kill(number, signal.SIGKILL)
    assert not survivors, (
        f"processes {survivors} of the cluster survived, and are killed now"
    )


@contextlib.contextmanager
def _spark_home(folder: Path) -> Iterator[pytest.MonkeyPatch]:
    """Let Spark run from a folder, where it also writes."""
    import pyspark

    for part in Path(pyspark.__file__).parent.iterdir():
        if part.name not in ("conf", "work"):
            (folder / part.name).symlink_to(part)
    (folder / "conf").mkdir()
    (folder / "conf" / "spark-defaults.conf").write_text(_SETTINGS)
    (folder / "conf" / "log4j2.properties").write_text(_LOG)
    with no_survivors() as patch:
        patch.setenv("SPARK_HOME", str(folder))
        patch.setenv("SPARK_LOCAL_IP", "127.0.0.1")
        patch.setenv("SPARK_LOCAL_DIRS", str(folder / "local"))
        patch.setenv("PYSPARK_PYTHON", sys.executable)
        patch.setenv("JDK_JAVA_OPTIONS", _JAVA)
        patch.chdir(folder)
        yield patch


@contextlib.contextmanager
def spark_cluster(folder: Path) -> Iterator[Any]:
    """Yield a session of Spark with a driver and two worker processes."""
    from pyspark.sql import SparkSession

    with spark_driver(folder):
        builder: Any = SparkSession.builder
        session = builder.master("local-cluster[2,1,1024]").getOrCreate()
        try:
            yield session
        finally:
            session.stop()


@contextlib.contextmanager
def spark_driver(folder: Path) -> Iterator[None]:
    """Stop the virtual machine that drives the Spark that starts inside."""
    from pyspark import SparkContext

    with _spark_home(folder):
        try:
            yield
        finally:
            gateway: Any = SparkContext._gateway
            if gateway is not None:
                gateway.shutdown()
                gateway.proc.stdin.close()
                gateway.proc.wait(60)
            SparkContext._gateway = SparkContext._jvm = None


@contextlib.contextmanager
def spark_server(folder: Path) -> Iterator[Any]:
    """Yield a session of Spark Connect with a server in a process of its own."""
    from pyspark.sql.connect.session import SparkSession

    with _spark_home(folder), socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()
        command = [str(folder / "bin" / "spark-submit"), "--master", "local[2]"]
        command += ["--conf", f"spark.connect.grpc.binding.port={port}", "--class"]
        command += ["org.apache.spark.sql.connect.service.SparkConnectServer"]
        server = subprocess.Popen([*command, "spark-internal"])
        try:
            while server.poll() is None:
                with contextlib.suppress(OSError):
                    socket.create_connection(("127.0.0.1", port)).close()
                    break
                time.sleep(0.05)
            builder: Any = SparkSession.builder
            session = builder.remote(f"sc://127.0.0.1:{port}").create()
            try:
                yield session
            finally:
                session.stop()
        finally:
            server.terminate()
            server.wait(60)


@contextlib.contextmanager
def dask_cluster(folder: Path) -> Iterator[Any]:
    """Yield a client of a Dask cluster of two processes."""
    import distributed

    with no_survivors() as patch:
        patch.chdir(folder)
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=":0"
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client

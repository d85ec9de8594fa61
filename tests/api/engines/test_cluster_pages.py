"""The examples of the pages about clusters run and print what the pages show."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.api.engines.clusters import needs, no_survivors, spark_driver
from tests.test_python_pages import ROOT, run_page

pytestmark = pytest.mark.heavy
needs("distributed")
needs("pyspark", "java")


@pytest.mark.filterwarnings("ignore:PySpark does not yet fully support pandas")
def test_the_page_about_spark_is_true(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with spark_driver(tmp_path):
        monkeypatch.chdir(ROOT)
        run_page("spark.md", capsys)


@pytest.mark.filterwarnings("ignore:Port 8787 is already in use")
def test_the_page_about_dask_is_true(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with no_survivors():
        monkeypatch.chdir(ROOT)
        run_page("dask.md", capsys)

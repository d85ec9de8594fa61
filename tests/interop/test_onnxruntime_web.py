"""onnxruntime for browsers, run by node, gives the bits of onnxruntime."""

from __future__ import annotations

import base64
import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document, Dtype
from fuzzytree.semantics.probing import probes, system_probes
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.tables import FloatArray
    from tests.interop.conftest import Need

PACKAGE = "onnxruntime-web"
ROOT = Path(__file__).parents[2]
HOME = ROOT / "build" / "web" / "node_modules" / PACKAGE
SCRIPT = """
const { readFileSync, writeFileSync } = require("node:fs");
const ort = require(process.argv[2]);
ort.env.wasm.numThreads = 1;
(async () => {
  const jobs = JSON.parse(readFileSync(process.argv[3]));
  for (const job of jobs) {
    const bytes = Buffer.from(job.values, "base64");
    const kind = job.type === "float64" ? Float64Array : Float32Array;
    const values = new kind(new Uint8Array(bytes).buffer);
    const session = await ort.InferenceSession.create(readFileSync(job.file));
    const inputs = { inputs: new ort.Tensor(job.type, values, job.shape) };
    job.found = Object.entries(await session.run(inputs)).map(([name, one]) => [
      name, one.type, one.type === "string" ? one.data : Buffer.from(
        one.data.buffer, one.data.byteOffset, one.data.byteLength).toString("base64"),
    ]);
  }
  writeFileSync(process.argv[3], JSON.stringify(jobs.map((job) => job.found)));
})();
"""


def graphs() -> Iterator[tuple[str, Document, dict[str, Any]]]:
    tree = random_tree(3, leaves=6)
    relative, raw = (ft.rules_from_tree(tree, kind) for kind in ("relative", "raw"))
    product = ft.rules_from_tree(tree, conjunction="product")
    dtypes: tuple[Dtype, ...] = ("float64", "mixed", "float32")
    few = {"outputs": ("label", "rule", "status")}
    all_of = {"outputs": ("label", "rule", "status", "strengths")}
    for dtype in dtypes:
        yield f"tree {dtype}", tree, {"dtype": dtype, **few}
        yield f"relative {dtype}", relative, {"dtype": dtype, **all_of}
        yield f"raw {dtype}", raw, {"dtype": dtype, **all_of}
        yield f"points {dtype}", with_points(product, 3), {"dtype": dtype, **all_of}
    yield "plain tree", tree, {"plain": True, **few}
    yield "net", tree, {"net": True, **few}
    yield "readable", relative, {"readable": True, **all_of}
    systems = [one for one in all_samples().values() if isinstance(one, FuzzySystem)]
    yield "system", systems[0], {}


def rows_of(model: Document) -> FloatArray:
    if isinstance(model, FuzzySystem):
        rows = system_probes(model, limit=300)
        found = [[row[name] for name in model.inputs] for row in rows]
    else:
        rows = probes(model, limit=2_000)
        found = [[row[name] for name in model.inputs] for row in rows]
    return np.array(found, np.float64)


def test_a_browser_gives_the_bits_of_onnxruntime_for_every_kind_of_graph(
    tmp_path: Path, program: Need, missing: Callable[[str], None]
) -> None:
    if not HOME.is_dir():
        missing(f"npm install --prefix build/web {PACKAGE} was not run")
    onnxruntime: Any = pytest.importorskip("onnxruntime")
    jobs, expected, count = [], [], 0
    for title, model, options in graphs():
        file = tmp_path / f"{title}.onnx"
        file.write_bytes(ft.export(model, "onnx", allow_loss=True, **options).content)
        session = onnxruntime.InferenceSession(str(file))
        is_single = options.get("dtype") == "float32"
        with np.errstate(over="ignore"):
            values = rows_of(model).astype(np.float32 if is_single else np.float64)
        names = [one.name for one in session.get_outputs()]
        expected.append(
            dict(zip(names, session.run(None, {"inputs": values}), strict=True))
        )
        jobs.append(
            {
                "file": str(file),
                "type": values.dtype.name,
                "shape": values.shape,
                "values": base64.b64encode(values.tobytes()).decode(),
            }
        )
    work = tmp_path / "jobs.json"
    work.write_text(json.dumps(jobs), "utf-8")
    script = tmp_path / "script.cjs"
    script.write_text(SCRIPT, "utf-8")
    words = [program("node"), str(script), str(HOME), str(work)]
    subprocess.run(words, check=True, timeout=300)
    for found, right in zip(json.loads(work.read_text("utf-8")), expected, strict=True):
        assert {name for name, *_ in found} == set(right)
        for name, kind, data in found:
            if kind == "string":
                assert data == right[name].ravel().tolist()
            else:
                assert base64.b64decode(data) == right[name].tobytes()
            count += 1
    assert len(jobs) == 16
    assert count > 50

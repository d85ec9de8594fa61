"""OpenVINO, which computes in float32, on the graphs that are written for it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.exporters.onnx_session import open_bare
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree

if TYPE_CHECKING:
    import numpy.typing as npt

    from tests.interop.conftest import Need

    Arrays = list[npt.NDArray[Any]]

SYSTEMS = {
    name: model
    for name, model in all_samples().items()
    if isinstance(model, FuzzySystem)
}


@pytest.fixture
def openvino(library: Need) -> Any:
    return import_module(library("openvino"))


def outputs_of(openvino: Any, content: bytes, values: npt.NDArray[Any]) -> Arrays:
    core = openvino.Core()
    model = core.compile_model(core.read_model(content), "CPU", _SINGLE)
    results = model([values])
    return [np.asarray(results[one]) for one in model.outputs]


_SINGLE = {"INFERENCE_PRECISION_HINT": "f32"}  # some processors would take 16 bits


def both(
    openvino: Any, model: Document, values: npt.NDArray[Any], **options: Any
) -> tuple[Arrays, Arrays]:
    """Return the outputs in onnxruntime and in OpenVINO."""
    content = write_onnx(model, **options).content
    right = open_bare(content)(list(options["outputs"]), {"inputs": values})
    return [np.asarray(one) for one in right], outputs_of(openvino, content, values)


def test_it_refuses_a_tree_as_it_is_written_without_options(openvino: Any) -> None:
    written = write_onnx(random_tree(2))
    assert "OpenVINO" in written.remarks[0]
    with pytest.raises(RuntimeError, match=r"ai\.onnx\.ml\.TreeEnsemble"):
        outputs_of(openvino, written.content, np.zeros((1, 4)))


@pytest.mark.parametrize("seed", [2, 3, 5])
@pytest.mark.parametrize("form", ["plain", "net", "relative rules"])
def test_graphs_in_float32_decide_there_as_in_onnxruntime(
    openvino: Any, form: str, seed: int
) -> None:
    tree = random_tree(seed, leaves=9, combinations=0.0)
    model = rules_from_tree(tree) if form == "relative rules" else tree
    table = [list(row.values()) for row in probes(model, limit=500)]
    with np.errstate(over="ignore"):  # beyond float32 is missing in float32
        values = np.array(table).astype(np.float32)
    names = ("label", "rule", "status")
    right, found = both(
        openvino,
        model,
        values,
        dtype="float32",
        plain=form == "plain",
        net=form == "net",
        outputs=names,
        allow_loss=True,
    )
    assert len(values) > 400
    assert len(set(right[1].tolist())) > 3  # leaves, and 0 of the missing rows
    for one, other in zip(right, found, strict=True):
        assert one.tolist() == other.tolist()


def test_a_graph_in_double_decides_otherwise_beside_a_cut(openvino: Any) -> None:
    tree = random_tree(2, leaves=9, combinations=0.0)
    values = np.array([list(row.values()) for row in probes(tree, limit=500)])
    right, found = both(openvino, tree, values, plain=True, outputs=("rule",))
    assert 1 <= int((right[0] != found[0]).sum()) < 50


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_is_loaded_and_its_numbers_are_near(
    openvino: Any, name: str
) -> None:
    system = SYSTEMS[name]
    steps = np.linspace(0.37, 9.61, 60)  # at no corner of a term
    values = np.column_stack([steps, *([steps[::-1]] * (len(system.inputs) - 1))])
    right, found = both(openvino, system, values, outputs=("outputs", "status"))
    # Measured, not derived: the page states it so.
    np.testing.assert_allclose(found[0], right[0], rtol=2e-6, atol=2e-6)
    assert found[1].tolist() == right[1].tolist()

"""A graph on its way to an ONNX file: nodes and constants in the order of their making.

Nothing in it depends on a hash, a clock or a default of the onnx package, so that the
same calls give the same bytes.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping, Sequence

import msgspec
import numpy as np
import numpy.typing as npt
import onnx
from onnx import helper, numpy_helper

from fuzzytree.model import Dtype, NameMap
from fuzzytree.numerics import RealArray, RealKind

TREES = "ai.onnx.ml"
"""The domain of `TreeEnsemble`."""

Constant = npt.NDArray[np.generic]

_LONGEST_NAME = 60

_ENDS = (
    *("inputs", "frames", "outputs", "activations", "label", "rule", "winner"),
    *("status", "strengths", "probabilities", "state", "features"),
)
"""Names that only a graph's own inputs and outputs bear."""


Attribute = int | Sequence[int] | onnx.TensorProto

_NEUTRAL: Mapping[str, float] = {"Add": 0.0, "Sub": 0.0, "Mul": 1.0, "Div": 1.0}
"""What changes nothing as the right operand."""


def _is_mistaken(value: Constant) -> bool:
    """Return whether a constant is a double that only float32 takes for 0 or 1."""
    if value.dtype != np.float64 or value.size != 1:
        return False
    number = float(value.item())
    if number in (0.0, 1.0) or abs(number) > 2.0:
        return False
    return float(np.float32(number)) in (0.0, 1.0)


def identifier(title: str) -> str:
    """Return words as a name that ONNX accepts, of at most 60 characters.

    Example:
        >>> identifier("Größe (mm) is not very big")
        'Grosse_mm_is_not_very_big'
    """
    return NameMap.of([title], longest=_LONGEST_NAME).accepted[title]


def _number_name(value: Constant, hint: str) -> str:
    """Return the name of a constant: of a single number, what it is."""
    if value.size != 1:
        return hint
    kind = {"f": "number", "i": "whole", "b": "is"}[value.dtype.kind]
    if value.shape:
        kind = "index" if kind == "whole" else hint
    text = str(value.item()).lower().removesuffix(".0")
    text = text.replace("-", "minus_").replace("+", "")
    return identifier(f"{kind}_{text}")


class Precision(msgspec.Struct, frozen=True):
    """The types in which a graph computes.

    Attributes:
        axis: Of input values and everything up to the cast.
        degree: Of degrees and strengths.
    """

    axis: type[RealKind]
    degree: type[RealKind]

    @property
    def below_one(self) -> float:
        """The largest number below 1 of the degrees' type."""
        return float(np.nextafter(self.degree(1), self.degree(0)))

    @property
    def is_mixed(self) -> bool:
        """Return whether degrees have another type than values."""
        return self.axis is not self.degree


NUMBERS: dict[Dtype, Precision] = {
    "float64": Precision(np.float64, np.float64),
    "mixed": Precision(np.float64, np.float32),
    "float32": Precision(np.float32, np.float32),
}


class OnnxGraph:
    """Nodes and constants, collected; every result is known by its name.

    Attributes:
        opset: The version of the operators.
        types: The types in which it computes.
        source: The name of the input values, of shape (rows, columns).
        topic: What the next nodes are part of: their names begin with it.
        nodes: The nodes so far.
        tensors: The constants so far, equal ones once.
    """

    def __init__(
        self,
        opset: int,
        types: Precision = NUMBERS["float64"],
    ) -> None:
        self.opset, self.types = opset, types
        self.source = "inputs"
        self.topic = ""
        self.nodes: list[onnx.NodeProto] = []
        self.tensors: list[onnx.TensorProto] = []
        self._known: dict[tuple[str, tuple[int, ...], bytes], str] = {}
        self._taken: dict[str, int] = dict.fromkeys(_ENDS, 1)
        self._results: dict[tuple[str, ...], str] = {}
        self._mistaken: dict[str, Constant] = {}
        self._ones: dict[str, Constant] = {}

    def node(
        self,
        op: str,
        *inputs: str,
        named: str = "",
        hint: str = "",
        domain: str = "",
        **attributes: Attribute,
    ) -> str:
        """Add a node with one result and return the result's name.

        A node without settings that stands there already is not added again.

        Args:
            op: The operator.
            inputs: The names of its inputs.
            named: The name of the result, which must be the only one.
            hint: What the result is, as a name that may get a number behind it; the
                operator unless given.
            domain: The operator's domain.
            attributes: The operator's own settings.
        """
        key = (op, *inputs)
        if key in self._results and not (named or attributes):
            return self._results[key]
        if op in _NEUTRAL and not self._mistaken.keys().isdisjoint(inputs):
            turned = self._turned(op, inputs)
            if turned:
                return self.node("Neg", turned, named=named, hint=hint)
        if op == "Div" and inputs[0] in self._ones:
            # onnxruntime makes `y / x` of `(1 / x) * y`, which rounds once less.
            minus = self.constant(np.negative(self._ones[inputs[0]]), "minus")
            turned = self.node("Div", minus, inputs[1])
            return self.node("Neg", turned, named=named, hint=hint)
        result = named or self._fresh(hint or f"{self.topic}_{op.lower()}".strip("_"))
        if not (named or attributes or domain):
            self._results[key] = result
        # Some versions of onnxruntime mistake nodes without a name for one another.
        node = helper.make_node(op, inputs, [result], name=result, domain=domain)
        for name in sorted(attributes):
            node.attribute.append(helper.make_attribute(name, attributes[name]))
        self.nodes.append(node)
        return result

    def constant(self, value: Constant, hint: str) -> str:
        """Return the name of a constant, which is added once."""
        key = (value.dtype.str, value.shape, value.tobytes())
        if key not in self._known:
            name = self._fresh(_number_name(value, hint))
            tensor = numpy_helper.from_array(np.ascontiguousarray(value), name)
            tensor = tensor if value.shape else numpy_helper.from_array(value, name)
            self.tensors.append(tensor)
            self._known[key] = name
            if _is_mistaken(value):
                self._mistaken[name] = value
            if value.size == 1 and value.dtype.kind == "f" and value.item() == 1.0:
                self._ones[name] = value
        return self._known[key]

    def _turned(self, op: str, inputs: Sequence[str]) -> str:
        """Return minus a result, without the constant that would be taken as neutral.

        onnxruntime drops `x + c`, `x - c`, `x * c` and `x / c` where c is a single
        number whose float32 is 0 or 1, though it may be a double that is neither. The
        results here are exactly the negatives, for rounding knows no sign. "" where
        onnxruntime makes no such mistake.
        """
        left, right = inputs
        if op in ("Add", "Mul") and left in self._mistaken:
            left, right = right, left
        value = self._mistaken.get(right)
        if value is None or np.float32(value.item()) != _NEUTRAL[op]:
            return ""
        if op == "Sub" and left in self._mistaken:  # turned about, it is the same case
            return self.constant(np.subtract(value, self._mistaken[left]), "minus")
        if op == "Sub":
            return self.node("Sub", right, left)
        minus = self.constant(np.negative(value), "minus")
        if op == "Add":
            return self.node("Sub", minus, left)
        return self.node(op, left, minus)

    def texts(self, values: Sequence[str], hint: str) -> str:
        """Return the name of a new constant list of texts."""
        name = self._fresh(hint)
        tensor = onnx.TensorProto(
            name=name,
            data_type=onnx.TensorProto.STRING,
            dims=[len(values)],
            string_data=[value.encode() for value in values],
        )
        self.tensors.append(tensor)
        return name

    def numbers(self, values: Sequence[int], hint: str) -> str:
        """Return the name of a constant list of whole numbers."""
        return self.constant(np.array(values, np.int64), hint)

    def number(self, value: float, kind: type[RealKind] = np.float64) -> str:
        """Return the name of a constant number."""
        return self.constant(np.array(value, kind), "number")

    def whole(self, value: int) -> str:
        """Return the name of a constant whole number."""
        return self.constant(np.array(value, np.int64), "whole")

    def column(self, values: RealArray, hint: str) -> str:
        """Return the name of a constant with one number for each row of a block."""
        return self.constant(values.reshape(-1, 1), hint)

    @contextlib.contextmanager
    def about(self, topic: str) -> Generator[None, None, None]:
        """Name the nodes that are added within after what they are part of."""
        before, self.topic = self.topic, topic
        yield
        self.topic = before

    def take(self, source: str, rows: Sequence[int]) -> str:
        """Return the named rows of a block; the same ones are taken once."""
        chosen = self.numbers(rows, "rows")
        key = ("take", source, chosen)
        if key not in self._results:
            self._results[key] = self.node("Gather", source, chosen, axis=0)
        return self._results[key]

    def split(self, source: str, count: int) -> list[str]:
        """Return the rows of a block, of shape (1, columns) each."""
        names = [self._fresh(f"{source}_row") for _ in range(count)]
        node = helper.make_node("Split", [source], names, name=names[0])
        node.attribute.append(helper.make_attribute("axis", 0))
        if self.opset >= 18:
            node.attribute.append(helper.make_attribute("num_outputs", count))
        self.nodes.append(node)
        return names

    def total(self, source: str, *, axis: int, keepdims: int) -> str:
        """Return the sum along an axis, in the form that the opset knows."""
        if self.opset >= 13:
            axes = self.numbers([axis], "axes")
            return self.node("ReduceSum", source, axes, keepdims=keepdims)
        return self.node("ReduceSum", source, axes=[axis], keepdims=keepdims)

    def highest(self, source: str, *, axis: int) -> str:
        """Return the largest number along an axis, which stays with the length 1."""
        if self.opset >= 18:
            return self.node("ReduceMax", source, self.numbers([axis], "axes"))
        return self.node("ReduceMax", source, axes=[axis])

    def used(self) -> list[onnx.TensorProto]:
        """Return the constants that a node takes; `_turned` leaves some behind."""
        taken = {name for node in self.nodes for name in node.input}
        return [one for one in self.tensors if one.name in taken]

    def _fresh(self, hint: str) -> str:
        name, number = hint, self._taken.get(hint, 0)
        while name in self._taken:
            number += 1
            name = f"{hint}_{number}"
        self._taken[hint] = max(number, 1)
        self._taken.setdefault(name, 1)
        return name


def np_to_onnx(kind: npt.DTypeLike) -> int:
    """Return the number by which ONNX knows a type of numpy."""
    return int(helper.np_dtype_to_tensor_dtype(np.dtype(kind)))


def model_proto(
    graph: OnnxGraph,
    name: str,
    source: tuple[str, int, list[str | int]],
    outputs: Mapping[str, tuple[int, list[str | int]]],
    *,
    ir: int,
    text: str,
    facts: Mapping[str, str],
) -> onnx.ModelProto:
    """Return the file of a filled graph.

    Args:
        graph: All nodes.
        name: The name of the graph.
        source: The name, type and shape of the input.
        outputs: The type and shape of each output, in order.
        ir: The version of the file.
        text: The description of the model.
        facts: The metadata, by keys without `fuzzytree.`.
    """
    body = helper.make_graph(
        graph.nodes,
        name,
        [helper.make_tensor_value_info(*source)],
        [helper.make_tensor_value_info(key, *how) for key, how in outputs.items()],
        graph.tensors,
    )
    imports = [helper.make_opsetid("", graph.opset)]
    if any(node.domain == TREES for node in graph.nodes):
        imports.append(helper.make_opsetid(TREES, 5))
    proto = helper.make_model(
        body,
        opset_imports=imports,
        ir_version=ir,
        producer_name="fuzzytree",
        producer_version=facts["version"],
        doc_string=text,
    )
    for key, value in facts.items():
        proto.metadata_props.add(key=f"fuzzytree.{key}", value=value)
    return proto


class DegreeRows:
    """Rows of degrees, collected block by block and known by their number."""

    def __init__(self, graph: OnnxGraph) -> None:
        self._graph = graph
        self._blocks: list[tuple[str, int, int]] = []
        self._joined: tuple[int, str] = (0, "")
        self.count = 0

    def append(self, block: str, count: int) -> int:
        """Add a block of `count` rows and return the number of its first row."""
        first = self.count
        self._blocks.append((block, first, count))
        self.count += count
        return first

    def take(self, rows: Sequence[int]) -> str:
        """Return a block of these rows, without a node where it stands already."""
        for block, first, count in self._blocks:
            if all(first <= row < first + count for row in rows):
                local = [row - first for row in rows]
                if local == list(range(count)):
                    return block
                return self._graph.take(block, local)
        if list(rows) == list(range(self.count)):
            return self._all()
        return self._graph.take(self._all(), rows)

    def _all(self) -> str:
        """Return all rows as one block."""
        if self._joined[0] != len(self._blocks):
            names = [block for block, _, _ in self._blocks]
            self._joined = (len(names), self._graph.node("Concat", *names, axis=0))
        return self._joined[1]

"""How much an ONNX graph computes, from the shapes of its results, before it runs.

The shape inference of the onnx package crashes on some broken files.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import onnx

    Shape = tuple[int, ...]

_UNKNOWN = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError)
_FEW = 16  # whole numbers that are the axes of a shape


def graph_size(proto: onnx.ModelProto, rows: int) -> int:
    """Return how many numbers the nodes of a graph compute for some rows, at most.

    Raises:
        ValueError: If the shape of a result is not known before the graph runs.

    Example:
        >>> import onnx
        >>> from fuzzytree.exporters.onnx import write_onnx
        >>> from fuzzytree.testing import random_tree
        >>> proto = onnx.load_from_string(write_onnx(random_tree(1)).content)
        >>> graph_size(proto, 1), graph_size(proto, 3)
        (51, 153)
    """
    from onnx import TensorProto, helper, numpy_helper

    shapes: dict[str, Shape] = {}
    known: dict[str, Any] = {}  # whole numbers that are a shape, or places in one
    total, title = 0, "its input"
    try:
        for end in proto.graph.input:
            width = [one.dim_value for one in end.type.tensor_type.shape.dim[1:]]
            shapes[end.name] = (rows, *width)
        for tensor in proto.graph.initializer:
            title = repr(tensor.name)
            shapes[tensor.name] = tuple(tensor.dims)
            if tensor.data_type == TensorProto.INT64:
                known[tensor.name] = numpy_helper.to_array(tensor)
        for node in proto.graph.node:
            title = ", ".join(map(repr, node.output))
            how = {one.name: helper.get_attribute_value(one) for one in node.attribute}
            operands = [shapes[name] for name in node.input if name]
            whole: list[Any] = [known.get(name) for name in node.input]
            shape = _shape(node, operands, whole, how)
            if min(shape, default=0) < 0:
                raise ValueError  # it would be refused anyway
            shapes |= dict.fromkeys(node.output, shape)
            total += math.prod(shape) * len(node.output)
            if node.op_type in ("MatMul", "Gemm"):
                total += math.prod(shape) * operands[1][0]
            if node.op_type == "Shape":
                known[node.output[0]] = np.array(operands[0])
            elif math.prod(shape) <= _FEW and all(one is not None for one in whole):
                if node.op_type == "Gather":
                    known[node.output[0]] = np.take(*whole)
                elif node.op_type == "Concat":
                    known[node.output[0]] = np.concatenate(whole)
    except _UNKNOWN as error:
        raise ValueError(f"the size of {title} is not known before it runs") from error
    return total


def _shape(
    node: onnx.NodeProto,
    operands: Sequence[Shape],
    whole: Sequence[Any],
    how: Mapping[str, Any],
) -> Shape:
    """Return the shape of a node's results, from those of its operands.

    `whole` are the operands' whole numbers, None where they are not known, and `how`
    the node's attributes.
    """
    first, axis = operands[0], how.get("axis", 0)
    match node.op_type:
        case "ArgMax" | "ReduceMax" | "ReduceMin" | "ReduceSum":
            axes = [axis] if node.op_type == "ArgMax" else how.get("axes") or whole[1]
            axes = {range(len(first))[one] for one in axes}
            one = (1,) if how.get("keepdims", 1) else ()
            sides = [one if k in axes else (size,) for k, size in enumerate(first)]
            return tuple(itertools.chain(*sides))
        case "Concat":
            length = sum(one[axis] for one in operands)
            return (*first[:axis], length, *first[axis:][1:])
        case "ConstantOfShape":
            return tuple(whole[0].tolist())
        case "Expand":
            return np.broadcast_shapes(first, tuple(whole[1].tolist()))
        case "Gather":
            return (*first[:axis], *operands[1], *first[axis:][1:])
        case "GatherElements":
            return operands[1]
        case "MatMul" | "Gemm":
            return first[how.get("transA", 0)], operands[1][1]
        case "Pad":
            pads = whole[1].reshape(2, -1).sum(axis=0)
            return tuple((pads + first).tolist())
        case "Reshape":
            free = math.prod(first) // max(-math.prod(whole[1].tolist()), 1)
            return tuple(free if side == -1 else side for side in whole[1].tolist())
        case "Shape":
            return (len(first),)
        case "Slice":
            (start,), (end,), (place,) = whole[1:4]
            length = len(range(first[place])[start:end])
            return (*first[:place], length, *first[place + 1 :])
        case "Split":
            return (*first[:axis], first[axis] // len(node.output), *first[axis + 1 :])
        case "TreeEnsemble":
            return first[0], how["n_targets"]
        case "Transpose":
            return tuple(first[place] for place in how["perm"])
        case "Unsqueeze":
            return (1, *first)
        case _:
            return np.broadcast_shapes(*operands)

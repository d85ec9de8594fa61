"""How much an ONNX graph computes, from the shapes of its results, before it runs.

The inference of the onnx package does the same, and crashes on some broken files.
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
    Whole = np.ndarray[Any, np.dtype[np.int64]]


_FEW = 16  # whole numbers that are the axes of a shape


def graph_size(proto: onnx.ModelProto, rows: int) -> int:
    """Return how many numbers the nodes of a graph compute in a call, at most.

    Args:
        proto: A graph with the operators `fuzzytree.exporters.OPERATORS`.
        rows: The length of the first axis of its input.

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

    graph = proto.graph
    shapes: dict[str, Shape] = {}
    numbers: dict[str, Whole] = {}  # the whole numbers that are known
    for end in graph.input:
        width = [one.dim_value for one in end.type.tensor_type.shape.dim[1:]]
        shapes[end.name] = (rows, *width)
    try:
        for tensor in graph.initializer:
            shapes[tensor.name] = tuple(tensor.dims)
            if tensor.data_type == TensorProto.INT64:
                numbers[tensor.name] = numpy_helper.to_array(tensor)
    except (ValueError, TypeError) as error:
        raise ValueError(f"constant {tensor.name!r} cannot be decoded") from error
    total = 0
    for node in graph.node:
        try:
            known = [numbers.get(name) for name in node.input]
            operands = [shapes[name] for name in node.input if name]
            settings = {
                one.name: helper.get_attribute_value(one) for one in node.attribute
            }
            shape = _shape(node.op_type, operands, known, settings, len(node.output))
            if math.prod(shape) <= _FEW:  # else they are sizes of nothing
                numbers |= _numbers(node, operands, known, settings)
        except (LookupError, ValueError, TypeError, ArithmeticError) as error:
            text = f"the size of {', '.join(node.output)!r} is not known before it runs"
            raise ValueError(text) from error
        shapes |= dict.fromkeys(node.output, shape)
        total += math.prod(shape) * max(len(node.output), 1)
        if node.op_type == "MatMul":
            total += math.prod(shape) * operands[0][-1]
    if any(size < 0 for shape in shapes.values() for size in shape):
        raise ValueError("a size is negative")
    return total


def _numbers(
    node: onnx.NodeProto,
    operands: Sequence[Shape],
    known: Sequence[Any],
    settings: Mapping[str, Any],
) -> dict[str, Whole]:
    """Return the whole numbers that a node makes of shapes, by its result."""
    axis = settings.get("axis", 0)
    if node.op_type == "Shape":
        return {node.output[0]: np.array(operands[0], np.int64)}
    if any(one is None for one in known):
        return {}
    if node.op_type == "Gather":
        return {node.output[0]: np.take(known[0], known[1], axis)}
    if node.op_type == "Concat":
        return {node.output[0]: np.concatenate(known, axis)}
    return {}


def _shape(
    operator: str,
    operands: Sequence[Shape],
    known: Sequence[Any],
    settings: Mapping[str, Any],
    outputs: int,
) -> Shape:
    """Return the shape of a node's results.

    Args:
        operator: Of the node.
        operands: The shapes of its operands.
        known: Their whole numbers; None where they are not known.
        settings: The node's attributes.
        outputs: How many results it has.
    """

    def whole(place: int) -> list[int]:
        if known[place] is None:
            raise LookupError
        numbers: list[int] = known[place].tolist()
        return numbers

    first, axis = operands[0], settings.get("axis", 0)
    match operator:
        case "ArgMax" | "ReduceMax" | "ReduceMin" | "ReduceSum":
            axes = [axis] if operator == "ArgMax" else settings.get("axes")
            axes = [range(len(first))[one] for one in axes or whole(1)]
            ones = (1,) if settings.get("keepdims", 1) else ()
            shape = [ones if k in axes else (size,) for k, size in enumerate(first)]
            return tuple(itertools.chain.from_iterable(shape))
        case "Concat":
            length = sum(one[axis] for one in operands)
            return (*first[:axis], length, *first[axis:][1:])
        case "ConstantOfShape":
            return tuple(whole(0))
        case "Expand":
            return np.broadcast_shapes(first, tuple(whole(1)))
        case "Gather":
            return (*first[:axis], *operands[1], *first[axis:][1:])
        case "GatherElements":
            return operands[1]
        case "MatMul":
            (rows, _), (_, columns) = operands
            return rows, columns
        case "Pad":
            pads = whole(1)
            before, after = pads[: len(first)], pads[len(first) :]
            return tuple(map(sum, zip(first, before, after, strict=True)))
        case "Reshape":
            sides = whole(1)
            if -1 in sides:
                sides[sides.index(-1)] = math.prod(first) // -math.prod(sides)
            return tuple(sides)
        case "Shape":
            return (len(first),)
        case "Slice":
            lengths = [*first]
            for start, end, place in zip(
                *(k.tolist() for k in known[1:4]), strict=True
            ):
                lengths[place] = len(range(first[place])[start:end])
            return tuple(lengths)
        case "Split":
            return (*first[:axis], first[axis] // outputs, *first[axis:][1:])
        case "TreeEnsemble":
            return first[0], settings["n_targets"]
        case "Transpose":
            return tuple(first[place] for place in settings["perm"])
        case "Unsqueeze":
            (place,) = settings.get("axes") or whole(1)
            return (*first[:place], 1, *first[place:])
        case _:
            return np.broadcast_shapes(*operands)

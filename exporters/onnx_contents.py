"""What an ONNX file consists of: its operators and constants, counted."""

from __future__ import annotations

from collections import Counter

import msgspec


class Contents(msgspec.Struct, frozen=True):
    """The size of a graph.

    Attributes:
        bytes: Of the file.
        operators: How many nodes there are of each operator, by name.
        constants: How many constants there are.
    """

    bytes: int
    operators: dict[str, int]
    constants: int

    @property
    def nodes(self) -> int:
        """The number of nodes."""
        return sum(self.operators.values())


def contents(content: bytes) -> Contents:
    """Count what an ONNX file consists of; nodes within functions count once.

    Example:
        >>> from fuzzytree.exporters.onnx import write
        >>> from fuzzytree.testing import random_tree
        >>> written = write(random_tree(1), verify=False).content
        >>> contents(written).operators["TreeEnsemble"]
        1
    """
    import onnx

    graph = onnx.load_model_from_string(content)
    bodies = [graph.graph.node, *(function.node for function in graph.functions)]
    counted = Counter(node.op_type for body in bodies for node in body)
    return Contents(
        len(content), dict(sorted(counted.items())), len(graph.graph.initializer)
    )

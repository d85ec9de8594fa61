"""Parts of a file by their keys, and the places of a model's mistakes in it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Final, TypeVar

from fuzzytree.formats.yaml.binding import Entries, bind, not_a_list
from fuzzytree.formats.yaml.layout import Record
from fuzzytree.formats.yaml.nodes import Found, ListNode, MappingNode, Node, Scalar
from fuzzytree.model.rulebase import Mistake, Path

_KEYS: Final = {
    # What a field of the model is called in the file, where the words differ.
    "when": ("if",),
    "parts": ("sum of",),
    "low": ("range",),
    "high": ("range",),
    "label": ("class",),
    "variable": ("ask", "variable"),
    "terms": ("is", "is not", "terms"),
    "owners": ("interval owners",),
    "labels": ("terms",),
}
R = TypeVar("R", bound=Record)


def value_of(node: Node, key: str) -> Node | None:
    """Return the value of a key, None if the node has no such key."""
    for one, value in node.pairs if isinstance(node, MappingNode) else ():
        if isinstance(one, Scalar) and one.text == key:
            return value
    return None


def record_at(kept: Entries, key: str, kind: type[R], found: list[Found]) -> R | None:
    """Return the record under a key, None if it is broken or left out."""
    return bind(kept[key], kind, found) if key in kept else None


def records_at(
    kept: Entries, key: str, kind: type[R], found: list[Found]
) -> list[R | None] | None:
    """Return the records of a list, None for a broken one; None if it is no list."""
    node = kept.get(key)
    if node is None:
        return None if key in ("rules", "leaves") else []
    if not isinstance(node, ListNode):
        not_a_list(node, key, found)
        return None
    return [bind(item, kind, found) for item in node.items]


def located(
    root: Node, mistakes: Iterable[Mistake], broken: Collection[Path] = ()
) -> Iterator[Found]:
    """Yield mistakes with their places, but not those in broken parts."""
    for path, text in mistakes:
        if path[:2] not in broken and path[:4] not in broken:
            node = find(root, path)
            yield node.line, node.column, text


def find(node: Node, path: Path) -> Node:
    """Return the deepest node on a path of the model that is in the file."""
    for step in path:
        inner = _child(node, step)
        if inner is None:
            break
        node = inner
    return node


def _child(node: Node, step: str | int) -> Node | None:
    if isinstance(step, int):
        items = node.items if isinstance(node, ListNode) else ()
        return items[step] if step < len(items) else None
    keys = (*_KEYS.get(step, ()), step)
    found = (value_of(node, key) for key in keys)
    return next((one for one in found if one is not None), None)

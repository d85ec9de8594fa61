"""Nodes of a file as records, and the positions of all mistakes."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Final, TypeVar

from msgspec import inspect

from fuzzytree.formats.text_files import MOST_SHOWN, FileMistake
from fuzzytree.formats.yaml.layout import FileRecord, KeyForm
from fuzzytree.formats.yaml.nodes import (
    ListNode,
    MappingNode,
    Node,
    Refused,
    Scalar,
    meaning,
)
from fuzzytree.model import Mistake, Path

R = TypeVar("R", bound=FileRecord)
V = TypeVar("V")
Entries = dict[str, Node]
_LONGEST_DIGITS: Final = 18


def bind(node: Node, kind: type[R], mistakes: list[FileMistake]) -> R | None:
    """Return a mapping as a record, or None if it cannot be one.

    Args:
        node: The mapping.
        kind: The record.
        mistakes: Where mistakes are added. An unknown key is one, and the record is
            returned without it.
    """
    if not isinstance(node, MappingNode):
        _expected(node, f"{kind.noun} must be a mapping", mistakes)
        return None
    return record(entries(node, kind, mistakes), kind, mistakes)


def entries(
    node: MappingNode, kind: type[FileRecord], mistakes: list[FileMistake]
) -> Entries:
    """Return the values of a mapping by key; check its keys and their choice."""
    known = _fields(kind)
    kept: Entries = {}
    is_known = True
    for key, value in node.pairs:
        if not isinstance(key, Scalar):
            _expected(key, f"a key of {kind.noun} must be text", mistakes)
        elif key.text in kept:
            _add(mistakes, key, f"key {shortened(key.text)} stands twice")
        elif key.text not in known:
            is_known = False
            choice = _choice(key.text, known, has_hint=len(mistakes) < MOST_SHOWN)
            text = f"{kind.noun} has no key {shortened(key.text)}; {choice}"
            _add(mistakes, key, text)
        else:
            kept[key.text] = value
    for name, field in known.items():
        if field.required and name not in kept:
            _add(mistakes, node, f"{kind.noun} needs {shortened(name)}")
    if is_known and not _fits_a_form(kind, kept):
        _add(mistakes, node, _form_mistake(kind, kept))
    return kept


def record(kept: Entries, kind: type[R], mistakes: list[FileMistake]) -> R | None:
    """Return the record of checked entries; entries of no field are left alone."""
    values: dict[str, object] = {}
    is_whole = True
    for name, field in _fields(kind).items():
        if name in kept:
            value = _value(kept[name], shortened(name), field.type, mistakes)
            is_whole = is_whole and value is not None
            values[field.name] = value
        elif field.required:
            is_whole = False
    is_whole = is_whole and _fits_a_form(kind, kept)
    return kind(**values) if is_whole else None


@functools.cache
def _fields(kind: type[FileRecord]) -> dict[str, inspect.Field]:
    info = inspect.type_info(kind)
    fields = info.fields if isinstance(info, inspect.StructType) else ()
    return {field.encode_name: field for field in fields}


def _fits_a_form(kind: type[FileRecord], kept: Iterable[str]) -> bool:
    chosen = frozenset[str]().union(*map(_keys, kind.forms)).intersection(kept)
    return not kind.forms or any(
        chosen.issuperset(form.needs) and chosen <= _keys(form) for form in kind.forms
    )


def _form_mistake(kind: type[FileRecord], kept: Iterable[str]) -> str:
    """Return which keys belong together."""
    sets: dict[frozenset[str], str] = {}
    for form in kind.forms:
        sets.setdefault(_keys(form), ", ".join((*form.needs, *form.may)))
    choosable = frozenset[str]().union(*map(_keys, kind.forms))
    has = ", ".join(sorted(choosable.intersection(kept))) or "nothing"
    either = "; or ".join(sets.values())
    return f"{kind.noun} cannot be made of {has}; it is made of {either}"


@functools.cache
def _keys(form: KeyForm) -> frozenset[str]:
    return frozenset((*form.needs, *form.may))


def _value(
    node: Node,
    what: str,
    kind: inspect.Type,
    mistakes: list[FileMistake],
    about: str = "",
) -> object | None:
    """Return a value of a type, or None after adding why there is none."""
    match kind:
        case inspect.Metadata():
            about = str((kind.extra_json_schema or {}).get("description", ""))
            return _value(node, what, kind.type, mistakes, about)
        case inspect.UnionType():
            return _value(node, what, _chosen(node, kind), mistakes)
        case inspect.StructType():
            return bind(node, _record_type(kind), mistakes)
        case inspect.DictType():
            return _numbers_by_name(node, what, kind, mistakes)
        case inspect.VarTupleType():
            return _list(node, what, kind, mistakes)
        case inspect.StrType():
            return _text(node, what, kind, about, mistakes)
        case inspect.IntType():
            return _integer(node, what, kind, mistakes)
        case inspect.FloatType():
            return _number(node, what, kind, mistakes)
        case inspect.LiteralType():
            return _literal(node, what, kind, mistakes)
        case _:
            raise TypeError(f"no rule for {kind}")


def _record_type(kind: inspect.StructType) -> type[FileRecord]:
    if not issubclass(kind.cls, FileRecord):
        raise TypeError(f"{kind.cls} is no record of the layout")
    return kind.cls


def _chosen(node: Node, union: inspect.UnionType) -> inspect.Type:
    """Return the type that a node is meant to have: records are mappings."""
    kinds = [one for one in union.types if not isinstance(one, inspect.NoneType)]
    records = [one for one in kinds if isinstance(one, inspect.StructType)]
    if isinstance(node, MappingNode) and records:
        return records[0]
    return next((one for one in kinds if one not in records), kinds[0])


def _list(
    node: Node, what: str, kind: inspect.VarTupleType, mistakes: list[FileMistake]
) -> tuple[object, ...] | None:
    if not isinstance(node, ListNode):
        _expected(node, f"{what} must be a list", mistakes)
        return None
    least, most = kind.min_length or 0, kind.max_length
    size = len(node.items)
    if size < least or (most is not None and size > most):
        size_text = f"at least {least}" if most is None else f"{least} to {most}"
        size_text = str(least) if least == most else size_text
        _add(mistakes, node, f"{what} needs {size_text} entries, not {size}")
        return None
    item = f"an entry of {what}"
    values = [_value(one, item, kind.item_type, mistakes) for one in node.items]
    return None if None in values else tuple(values)


def _numbers_by_name(
    node: Node, what: str, kind: inspect.DictType, mistakes: list[FileMistake]
) -> dict[str, object] | None:
    if not isinstance(node, MappingNode):
        _expected(node, f"{what} must be a mapping", mistakes)
        return None
    values: dict[str, object] = {}
    before = len(mistakes)
    for key, value in node.pairs:
        name = _value(key, f"a key of {what}", kind.key_type, mistakes)
        if isinstance(name, str) and name in values:
            _add(mistakes, key, f"key {shortened(name)} stands twice")
        elif isinstance(name, str):
            text = f"{shortened(name)} of {what}"
            values[name] = _value(value, text, kind.value_type, mistakes)
    return values if len(mistakes) == before else None


def _text(
    node: Node,
    what: str,
    kind: inspect.StrType,
    about: str,
    mistakes: list[FileMistake],
) -> str | None:
    if not isinstance(node, Scalar):
        _expected(node, f"{what} must be text", mistakes)
        return None
    if meaning(node) != "text":
        hint = f"; in quotes it is text: '{node.text}'" if node.text else ""
        _expected(node, f"{what} must be text", mistakes, hint)
        return None
    size = len(node.text)
    if size < (kind.min_length or 0):
        _add(mistakes, node, f"{what} must not be empty")
    elif kind.max_length is not None and size > kind.max_length:
        text = f"{what} is longer than {kind.max_length} characters"
        _add(mistakes, node, text)
    elif kind.pattern is not None and not re.search(kind.pattern, node.text):
        _add(mistakes, node, f"{what} cannot be {shortened(node.text)}; it is {about}")
    else:
        return node.text
    return None


def _integer(
    node: Node, what: str, kind: inspect.IntType, mistakes: list[FileMistake]
) -> int | None:
    if not isinstance(node, Scalar) or meaning(node) != "an integer":
        _expected(node, f"{what} must be an integer", mistakes)
        return None
    text = node.text
    if len(text) > _LONGEST_DIGITS:
        _add(mistakes, node, f"{what} has more than {_LONGEST_DIGITS} digits")
        return None
    value = _read_integer(text)
    return value if _is_in_range(value, node, what, kind, mistakes) else None


def _number(
    node: Node, what: str, kind: inspect.FloatType, mistakes: list[FileMistake]
) -> float | None:
    is_number = isinstance(node, Scalar) and meaning(node) in (
        "a number",
        "an integer",
    )
    if not (isinstance(node, Scalar) and is_number):
        _expected(node, f"{what} must be a number", mistakes)
        return None
    text = node.text
    if text.startswith(("0o", "0x")):
        if len(text) > _LONGEST_DIGITS:
            _add(mistakes, node, f"{what} has more than {_LONGEST_DIGITS} digits")
            return None
        value = float(_read_integer(text))
    else:
        value = float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return value if _is_in_range(value, node, what, kind, mistakes) else None


def _is_in_range(
    value: float,
    node: Node,
    what: str,
    kind: inspect.IntType | inspect.FloatType,
    mistakes: list[FileMistake],
) -> bool:
    """Return whether a number is in its range; NaN is in none that has an end."""
    is_large = kind.ge is None or value >= kind.ge
    is_small = kind.le is None or value <= kind.le
    if not (is_large and is_small):
        form = "g" if isinstance(kind, inspect.FloatType) else ""
        bound = f"most {kind.le:{form}}" if is_large else f"least {kind.ge:{form}}"
        _add(mistakes, node, f"{what} must be at {bound}, not {value:{form}}")
    return is_large and is_small


def _read_integer(text: str) -> int:
    if text.startswith(("0o", "0x")):
        return int(text, 0)
    return int(text)


def _literal(
    node: Node, what: str, kind: inspect.LiteralType, mistakes: list[FileMistake]
) -> str | int | None:
    if isinstance(node, Scalar):
        for value in kind.values:
            expected = "text" if isinstance(value, str) else "an integer"
            if node.text == str(value) and meaning(node) == expected:
                return value
    allowed = " or ".join(shortened(str(value)) for value in kind.values)
    _expected(node, f"{what} must be {allowed}", mistakes)
    return None


def not_a_list(node: Node, key: str, mistakes: list[FileMistake]) -> None:
    """Add that the value of a key must be a list."""
    _expected(node, f"{shortened(key)} must be a list", mistakes)


def _expected(
    node: Node, what: str, mistakes: list[FileMistake], hint: str = ""
) -> None:
    """Add that a node is not what it must be; a refused one was added before."""
    match node:
        case Scalar():
            is_text = meaning(node) == "text"
            it = shortened(node.text) if is_text else f"{meaning(node)}"
        case ListNode():
            it = "a list"
        case MappingNode():
            it = "a mapping"
        case Refused():
            return
    _add(mistakes, node, f"{what}, not {it}{hint}")


def _add(mistakes: list[FileMistake], node: Node, sentence: str) -> None:
    mistakes.append((node.line, node.column, sentence))


def shortened(text: str) -> str:
    """Return a text in quotes, its beginning only if it is long."""
    return repr(text if len(text) <= 100 else f"{text[:100]}...")


def _choice(wrong: str, known: Iterable[str], *, has_hint: bool) -> str:
    names = list(known)
    close = [name for name in _KEYS.get(wrong, ()) if name in names]
    if has_hint and not close:
        close = difflib.get_close_matches(wrong[:100], names, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return f"there is {', '.join(names)}{hint}"


_KEYS: Final = {
    # What a field of the model is called in the file, where the words differ.
    "when": ("if",),
    "conjunction": ("and",),
    "disjunction": ("or",),
    "parts": ("sum of",),
    "low": ("range",),
    "high": ("range",),
    "label": ("class",),
    "variable": ("ask", "variable"),
    "terms": ("is", "is not", "terms"),
    "owners": ("interval owners",),
}


def value_of(node: Node, key: str) -> Node | None:
    """Return the value of a key, None if the node has no such key."""
    for one, value in node.pairs if isinstance(node, MappingNode) else ():
        if isinstance(one, Scalar) and one.text == key:
            return value
    return None


def record_at(
    kept: Entries, key: str, kind: type[R], mistakes: list[FileMistake]
) -> R | None:
    """Return the record under a key, None if it is broken or left out."""
    return bind(kept[key], kind, mistakes) if key in kept else None


def records_at(
    kept: Entries, key: str, kind: type[R], mistakes: list[FileMistake]
) -> list[R | None] | None:
    """Return the records of a list, None for a broken one; None if it is no list."""
    node = kept.get(key)
    if node is None:
        return None if key in ("rules", "leaves") else []
    if not isinstance(node, ListNode):
        not_a_list(node, key, mistakes)
        return None
    return [bind(item, kind, mistakes) for item in node.items]


def variables_at(
    kept: Entries,
    key: str,
    kind: type[R],
    build: Callable[[Path, R, list[Mistake]], V],
    bare: Callable[[str, Sequence[str]], V],
    mistakes: tuple[list[FileMistake], list[Mistake]],
    broken: set[Path],
) -> tuple[V, ...] | None:
    """Return the variables under a key; None if it is no list or a name is unknown.

    In the place of a broken variable stands one of its name and its terms' names, so
    that what speaks of it can be checked.
    `build` makes a variable of its path and record, `bare` one of names alone.
    """
    bound = records_at(kept, key, kind, mistakes[0])
    variables: list[V] = []
    for position, one in enumerate(bound or ()):
        path: Path = (key, position)
        if one is not None:
            variables.append(build(path, one, mistakes[1]))
            continue
        names = _names(kept[key], position)
        if names is None:
            return None
        broken.add(path)
        variables.append(bare(names[0], names[1:]))
    return None if bound is None else tuple(variables)


def _names(variables: Node, position: int) -> list[str] | None:
    """Return the name of a variable and of its terms, as far as they can be read."""
    node = variables.items[position] if isinstance(variables, ListNode) else variables
    terms = value_of(node, "terms")
    items = terms.items if isinstance(terms, ListNode) else ()
    named = [value_of(node, "name"), *(value_of(term, "name") for term in items)]
    texts = [one.text for one in named if isinstance(one, Scalar)]
    return texts if len(texts) == len(named) else None


def located(
    root: Node, mistakes: Iterable[Mistake], broken: Collection[Path] = ()
) -> Iterator[FileMistake]:
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
    result = (value_of(node, key) for key in keys)
    return next((one for one in result if one is not None), None)

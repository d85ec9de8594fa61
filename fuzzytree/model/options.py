"""The options of a writer, from its signature and its docstring."""

from __future__ import annotations

import difflib
import inspect
import re
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union, get_args, get_origin

import msgspec

from fuzzytree.model.contracts import Format

Option = str | int | float | bool | Sequence[str] | None

_TRUTHS = {"yes": True, "true": True, "on": True, "1": True}
_FALSITIES = {"no": False, "false": False, "off": False, "0": False}


class OptionFacts(msgspec.Struct, frozen=True):
    """An option of a writer.

    Attributes:
        name: As in `--set NAME=VALUE`, and the keyword in Python.
        default: What it is unless given.
        choices: The values that it can have, if they are few.
        help: What it does, as the writer's docstring says.
    """

    name: str
    default: Option
    choices: tuple[str, ...] = ()
    help: str = ""


def options_of(form: Format) -> tuple[OptionFacts, ...]:
    """Return the options of a format's writer, without `allow_loss`.

    Example:
        >>> from fuzzytree.exporters import find_format
        >>> options_of(find_format("onnx"))[0].choices
        ('float64', 'mixed', 'float32')
    """
    helps = _helps(inspect.getdoc(form.write) or "")
    return tuple(
        OptionFacts(
            name,
            None if one.default is one.empty else one.default,
            tuple(map(str, _choices(_kind(form, name)))),
            helps.get(name, ""),
        )
        for name, one in _parameters(form).items()
    )


def check_names(form: Format, options: Mapping[str, object]) -> None:
    """Refuse an option that a writer does not have.

    Raises:
        ValueError: It names the options that there are, and the nearest.
    """
    known = list(_parameters(form))
    for name in options:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f" (did you mean {close[0]!r}?)" if close else ""
            raise ValueError(
                f"{form.name} has no option {name!r}; "
                f"it has {', '.join(known) or 'none'}{hint}"
            )


def check_options(form: Format, options: Mapping[str, object]) -> None:
    """Refuse an option that a writer does not have, and a value that one cannot have.

    Raises:
        ValueError: As `check_names`; or it names the values that there are.

    Example:
        >>> from fuzzytree.exporters import find_format
        >>> check_options(find_format("javascript"), {"module": "est"})
        Traceback (most recent call last):
        ValueError: module: must be es, script (did you mean 'es'?), not 'est'
    """
    check_names(form, options)
    for name, value in options.items():
        kind = _kind(form, name)
        faults = [_fault(value, part) for part in _parts(kind)]
        if all(faults):
            raise ValueError(f"{name}: must be {faults[0]}, not {value!r}")


def option_value(form: Format, name: str, text: str) -> Option:
    """Return what a text means as an option: a number, a truth value, a list.

    The elements of a list are separated by commas.

    Raises:
        ValueError: If there is no such option, or the text is no value of it.

    Example:
        >>> from fuzzytree.exporters import find_format
        >>> option_value(find_format("onnx"), "outputs", "label,rule")
        ('label', 'rule')
    """
    check_names(form, {name: text})
    return _meant(name, text, _kind(form, name))


def _parameters(form: Format) -> dict[str, inspect.Parameter]:
    return {
        name: one
        for name, one in inspect.signature(form.write).parameters.items()
        if one.kind is one.KEYWORD_ONLY and name != "allow_loss"
    }


def _kind(form: Format, name: str) -> Any:
    """Return the type of an option, as annotated, or else that of its default."""
    try:
        hints = typing.get_type_hints(form.write)
    except NameError:  # a name that only type checkers see
        hints = {}
    default = _parameters(form)[name].default
    return hints.get(name, str if default is None else type(default))


def _choices(kind: Any) -> tuple[object, ...]:
    if get_origin(kind) is Literal:
        return get_args(kind)
    if get_origin(kind) in (Union, types.UnionType):
        return tuple(one for part in get_args(kind) for one in _choices(part))
    return ()


def _parts(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)


def _fault(value: object, part: Any) -> str:
    """Return what a value would have to be to be of a type; empty if it is."""
    origin = get_origin(part) or part
    if origin is Literal:
        known = get_args(part)
        return "" if value in known else _one_of(str(value), tuple(map(str, known)))
    if part is bool:
        return "" if isinstance(value, bool) else "True or False"
    if part in (int, float):
        wanted = int if part is int else (int, float)
        is_number = isinstance(value, wanted) and not isinstance(value, bool)
        what = "a whole number" if part is int else "a number"
        return "" if is_number else what
    if part is str:
        return "" if isinstance(value, str) else "a text"
    if _is_sequence(origin):
        is_list = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        return "" if is_list else "a list"
    if part is type(None):
        return "" if value is None else "None"
    return ""


def _meant(name: str, text: str, kind: Any) -> Option:
    parts = _parts(kind)
    if type(None) in parts and text.lower() == "none":
        return None
    wrong = "a value"
    for part in parts:
        origin = get_origin(part) or part
        if origin is Literal:
            result = [one for one in get_args(part) if str(one) == text]
            if result:
                return typing.cast("Option", result[0])  # a Literal holds options
            wrong = _one_of(text, tuple(map(str, get_args(part))))
        elif part is bool:
            known = {**_TRUTHS, **_FALSITIES}
            if text.lower() in known:
                return known[text.lower()]
            wrong = "yes or no"
        elif part in (int, float):
            try:
                return int(text) if part is int else float(text)
            except ValueError:
                wrong = "a whole number" if part is int else "a number"
        elif origin is not str and _is_sequence(origin):
            return tuple(one.strip() for one in text.split(",") if one.strip())
        elif part is str:
            return text
    raise ValueError(f"{name}: must be {wrong}, not {text!r}")


def _one_of(text: str, choices: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(text, choices, n=1)
    return ", ".join(choices) + (f" (did you mean {close[0]!r}?)" if close else "")


def _is_sequence(origin: Any) -> bool:
    return isinstance(origin, type) and issubclass(origin, Sequence)


def _helps(doc: str) -> dict[str, str]:
    """Return the entries of a docstring's `Args`, each as one line."""
    section = re.split(r"^Args:\n", doc, maxsplit=1, flags=re.MULTILINE)
    if len(section) < 2:
        return {}
    body = re.split(r"^\S", section[1], maxsplit=1, flags=re.MULTILINE)[0]
    result: dict[str, str] = {}
    name = ""
    for line in body.splitlines():
        entry = re.match(r"    (\w+): (.*)", line)
        if entry:
            name = entry[1]
            result[name] = entry[2]
        elif name and line.strip():
            result[name] += f" {line.strip()}"
    return result

"""What every format must do, tried on models: the same for ours and for others.

`fuzzytree.testing.check_exporter` is the door. A failure is a sentence; nothing stops
at the first one. What a format cannot carry it may refuse, with a LossError that lists
everything; what it must never do is change a model without a word.
"""

from __future__ import annotations

import inspect
import math
import random
import re
import time
import traceback
from collections.abc import Iterable, Iterator
from typing import get_args

from fuzzytree.checking.equivalence import equivalence
from fuzzytree.errors import FuzzyTreeError, LossError, ReadError
from fuzzytree.model import (
    Document,
    Format,
    Loss,
    ModelKind,
    Reading,
    Written,
    fingerprint,
    kind_of,
)

_PATIENCE_S = 10.0  # for one hostile input
_LONGEST = 300  # characters of an error that are shown
_OFFER = "allow_loss=True"


def failures(
    form: Format,
    models: Iterable[tuple[str, Document]],
    *,
    seed: int = 0,
    damaged: int = 3,
) -> tuple[str, ...]:
    """Return what a format does wrong, a sentence each; empty if nothing.

    Args:
        form: The format.
        models: Models of any kind with their titles; those that the format does not
            carry are passed over.
        seed: Of the hostile inputs.
        damaged: How many of the files, the smallest, are damaged and read.
    """
    faults = [*_record_failures(form)]
    if faults:
        return tuple(faults)
    files: list[bytes] = []
    tried: set[ModelKind] = set()
    for title, model in models:
        if kind_of(model) not in form.carries:
            continue
        tried.add(kind_of(model))
        faults += (f"{title}: {text}" for text in _model_failures(form, model, files))
    for representation in form.carries:
        if representation not in tried:
            faults.append(f"it carries {representation}, and no such model was tried")
    if not files:
        faults.append("it writes none of the models")
    good = sorted(set(files), key=lambda one: (len(one), one))[:damaged]
    faults += _reader_failures(form, good, random.Random(seed))
    return tuple(dict.fromkeys(faults))


def _record_failures(form: Format) -> Iterator[str]:
    """Yield what is wrong with the record of a format itself."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", form.name):
        yield f"the name {form.name!r} must be small letters, digits and hyphens"
    if not form.suffixes:
        yield "it needs at least one suffix"
    for suffix in form.suffixes:
        if not re.fullmatch(r"\.[a-z0-9]+", suffix):
            yield f"the suffix {suffix!r} must be a dot and small letters or digits"
    unknown = [one for one in form.carries if one not in get_args(ModelKind)]
    if unknown or not form.carries:
        yield f"'carries' must be some of {get_args(ModelKind)}, not {form.carries}"
    for text in form.cannot:
        if not text or text != text.strip() or text.endswith("."):
            yield f"a limit is a phrase without a full stop, not {text!r}"
    parameters = inspect.signature(form.write).parameters
    allow = parameters.get("allow_loss")
    if allow is None or allow.kind is not allow.KEYWORD_ONLY or allow.default:
        yield "its writer needs the keyword `allow_loss`, False unless given"
    for one in list(parameters.values())[1:]:
        if one.kind is one.VAR_KEYWORD or one.kind is one.VAR_POSITIONAL:
            yield f"its writer takes any {one.name!r}; options are named one by one"
        elif one.kind is not one.KEYWORD_ONLY or one.default is one.empty:
            yield f"the option {one.name!r} must be a keyword with a default"


# --- writing


def _model_failures(form: Format, model: Document, files: list[bytes]) -> Iterator[str]:
    before = fingerprint(model)
    written, error = _tried(form, model, allow_loss=False)
    if written is not None:
        files.append(written.content)
        if written.losses:
            yield f"it loses {_listed(written.losses)} without being allowed to"
        yield from _written_failures(form, model, written, allow_loss=False)
        yield from _read_back_failures(form, model, written)
    elif isinstance(error, LossError):
        yield from _refusal_failures(form, model, error, files)
    else:
        yield f"writing raises {_told(error)}"
    if fingerprint(model) != before:
        yield "writing changes the model"


def _tried(
    form: Format, model: Document, *, allow_loss: bool
) -> tuple[Written | None, Exception | None]:
    try:
        return form.write(model, allow_loss=allow_loss), None
    except Exception as error:  # whatever it is, it is a finding
        return None, error


def _written_failures(
    form: Format, model: Document, written: Written, *, allow_loss: bool
) -> Iterator[str]:
    """Yield what is wrong with what a writer returned."""
    how = " with allow_loss=True" if allow_loss else ""
    if not _is_written(written):
        yield f"writing{how} returns no Written with bytes"
        return
    again, error = _tried(form, model, allow_loss=allow_loss)
    if again is None:
        yield f"writing{how} a second time raises {_told(error)}"
    elif again != written:
        yield f"writing{how} twice gives different bytes, losses or remarks"
    for loss in written.losses:
        if not loss.where.strip() or not loss.what.strip():
            yield f"a loss{how} does not say where and what: {loss}"
        if loss.bound is not None and not 0.0 <= loss.bound < math.inf:
            yield f"the bound of a loss{how} is {loss.bound!r}: {loss.where}"
    if any(not remark.strip() for remark in written.remarks):
        yield f"a remark{how} is empty"


def _is_written(result: object) -> bool:
    """Return whether a writer, which may be of others, returned what it must."""
    return isinstance(result, Written) and type(result.content) is bytes


def _is_reading(result: object) -> bool:
    return isinstance(result, Reading)


def _refusal_failures(
    form: Format, model: Document, error: LossError, files: list[bytes]
) -> Iterator[str]:
    """Yield what is wrong with how a loss is refused, and with what is then allowed.

    A refusal that offers `allow_loss=True` must keep the offer. One that does not is
    final: then nothing is ever written, and the reason stays the same.
    """
    text = str(error)
    if not text.strip():
        yield "it refuses without a reason"
    written, second = _tried(form, model, allow_loss=True)
    if written is None:
        if not isinstance(second, LossError):
            yield f"writing with allow_loss=True raises {_told(second)}"
        elif _OFFER in text:
            yield f"it offers allow_loss=True and then raises {_told(second)}"
        return
    files.append(written.content)
    if _OFFER not in text:
        yield "its refusal does not say that allow_loss=True would write it"
    if not written.losses:
        yield f"it refuses, and with allow_loss=True it lists no loss: {text[:100]}"
    for loss in written.losses:
        if loss.what not in text and loss.where not in text:
            yield f"its refusal does not list a loss: {loss.where}: {loss.what}"
    yield from _written_failures(form, model, written, allow_loss=True)
    if form.read is not None:
        again, reading_error = _read(form, written.content)
        if again is None:
            yield f"what it writes with losses is read as {_told(reading_error)}"


def _read_back_failures(
    form: Format, model: Document, written: Written
) -> Iterator[str]:
    """Yield how a model that was written without a loss differs when it is read."""
    if form.read is None:
        return
    again, error = _read(form, written.content)
    if again is None:
        yield f"what it writes is read as {_told(error)}"
        return
    if again.losses:
        yield f"reading what it writes loses {_listed(again.losses)}"
    match equivalence(model, written, again):
        case "other":
            what = f"{kind_of(model)} {model.name!r}"
            yield f"read back, {what} is another model, and no loss was reported"
        case "renamed":
            yield "read back, names or notes differ, and no remark was made"
        case _:
            pass


def _read(form: Format, content: bytes) -> tuple[Reading | None, Exception | None]:
    assert form.read is not None  # the callers test it
    try:
        return form.read(content, "model"), None
    except Exception as error:  # whatever it is, it is a finding
        return None, error


# --- reading what is damaged, or was never right


def _reader_failures(
    form: Format, files: list[bytes], chance: random.Random
) -> Iterator[str]:
    if form.read is None:
        return
    for title, content in [*_nonsense(), *_damaged(files, chance)]:
        begin = time.perf_counter()
        reading, error = _read(form, content)
        spent = time.perf_counter() - begin
        if spent > _PATIENCE_S:
            yield f"reading {title} takes {spent:.0f} s"
        if reading is None:
            yield from _error_failures(title, error)
        elif not _is_reading(reading):
            yield f"reading {title} returns no Reading"
    for content in files:
        yield from _line_end_failures(form, content)


def _error_failures(title: str, error: Exception | None) -> Iterator[str]:
    if not isinstance(error, ReadError):
        yield f"reading {title} raises {_told(error)}"
    elif not str(error).startswith("model"):
        yield f"reading {title}: the error does not begin with the file's name"
    elif len(str(error)) > 100_000:
        yield f"reading {title}: the error is {len(str(error))} characters long"


def _nonsense() -> Iterator[tuple[str, bytes]]:
    """Yield files that are no model in any format."""
    yield "an empty file", b""
    yield "a file of blanks", b" \n\t\r\n" * 10
    yield "NUL bytes", b"\0" * 1000
    yield "random bytes", random.Random(7).randbytes(2000)
    yield "bytes that are no UTF-8", b"name: \xff\xfe\xfa\n" * 5
    yield "text in UTF-16", "name: grip\n".encode("utf-16")
    yield "a long line", b"x" * 1_000_000
    yield "a million lines", b"x\n" * 1_000_000
    for opening in ("(", "[", "{", "<a>", "not ", "- ", "if (", "/*", "(*", "'", '"'):
        yield f"100,000 times {opening!r}", opening.encode() * 100_000
    yield (
        "an entity bomb",
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "bb">'
        + b"".join(
            b'<!ENTITY c%d "%s">' % (k, b"&c%d;" % (k - 1) * 10 if k else b"&b;" * 10)
            for k in range(12)
        )
        + b"]><a>&c11;</a>",
    )


def _damaged(files: list[bytes], chance: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yield files that were models before something happened to them."""
    for content in files:
        size = len(content)
        for _ in range(12):
            end = chance.randrange(size)
            yield f"a file that ends early ({end} of {size} bytes)", content[:end]
        for _ in range(40):
            place = chance.randrange(size)
            byte = bytes([chance.choice(b"\0\n ;:(){}[]<>'\"#-0.eE\xff")])
            changed = content[:place] + byte + content[place + 1 :]
            yield f"a file with byte {place} changed to {byte!r}", changed
        lines = content.splitlines(keepends=True)
        for _ in range(12):
            place = chance.randrange(len(lines))
            yield (
                f"a file without line {place + 1}",
                b"".join(lines[:place] + lines[place + 1 :]),
            )
            yield (
                f"a file with line {place + 1} twice",
                b"".join(lines[: place + 1] + lines[place:]),
            )
        for number in (b"nan", b"inf", b"-inf", b"1e999", b"9" * 400, b"0x1", b"1_0"):
            places = [*re.finditer(rb"(?<![\w.])\d+\.\d+(?![\w.])", content)]
            for match in chance.sample(places, min(3, len(places))):
                changed = content[: match.start()] + number + content[match.end() :]
                yield f"a file with {number[:9]!r} for a number", changed


def _line_end_failures(form: Format, content: bytes) -> Iterator[str]:
    """Yield it where other line ends or a byte order mark make another model."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return  # a binary format
    plain, _ = _read(form, content)
    if plain is None or b"\r" in content:
        return
    for title, changed in (
        ("lines that end in CR and LF", content.replace(b"\n", b"\r\n")),
        ("lines that end in CR", content.replace(b"\n", b"\r")),
        ("a byte order mark", b"\xef\xbb\xbf" + content),
        ("no end of the last line", content.rstrip(b"\n")),
    ):
        reading, error = _read(form, changed)
        if reading is None:
            yield f"a file with {title} is read as {_told(error)}"
        elif fingerprint(reading.model) != fingerprint(plain.model):
            yield f"a file with {title} is read as another model"


# --- words


def _told(error: Exception | None) -> str:
    text = " ".join(str(error).split())[:_LONGEST]
    name = type(error).__name__
    if isinstance(error, FuzzyTreeError):
        return f"{name}: {text}"
    frames = traceback.extract_tb(error.__traceback__ if error else None)
    place = "".join(f" in {last.name}, line {last.lineno}" for last in frames[-1:])
    return f"{name}{place}: {text}"


def _listed(losses: Iterable[Loss]) -> str:
    return "; ".join(f"{loss.where}: {loss.what}" for loss in losses)[:_LONGEST]

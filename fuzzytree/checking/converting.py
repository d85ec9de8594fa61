"""From a file to a model, and from a model to a file, with a proof of what arrived."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast, get_args

import msgspec

from fuzzytree.checking.equivalence import equivalence
from fuzzytree.checking.kinds import CALLED, formed, refuse_other_kind
from fuzzytree.errors import DisagreementError, LossError, ReadError
from fuzzytree.exporters import all_formats, find_format
from fuzzytree.files import read_bounded
from fuzzytree.formats import from_simpful, from_skfuzzy, from_sklearn
from fuzzytree.model import (
    Conjunction,
    Coverage,
    Document,
    Dtype,
    Format,
    FuzzySystem,
    Kind,
    Model,
    ModelKind,
    ModelPath,
    ModelSource,
    Option,
    Reading,
    Written,
    check_options,
    kind_of,
    loss_text,
    option_value,
    sampled_values,
)
from fuzzytree.semantics import (
    check_tolerance,
    probe_values,
    unsampled_terms,
)
from fuzzytree.tables import SUFFIXES

if TYPE_CHECKING:
    from fuzzytree.numerics import Certificate

_FEW = 200  # probes of a file that is run
_TRIED = 1000  # probes of what a loss does to decisions

_NOT_READ = "the file is not read back here; other programs run it"


class Proof(msgspec.Struct, frozen=True):
    """How a written file stands to the model that it was made of.

    Attributes:
        verdict: `equal`: read back, it is that model in every number and name.
            `alike`: read back, it is that model but for names and notes, of which the
            writer reported; or run, it answers like that model.
            `certified`: it computes, within the bound of the certificate.
            `as listed`: it differs by the losses that were allowed.
            `unproved`: the file is not read back.
        sentence: The same for people.
        certificate: What a number type can change, if the file computes.
        coverage: Of a fuzzy system: which rules probes fire, and what is uncovered.
        kind: Which kind of model the file is read back as, if it is.
    """

    verdict: Literal["equal", "alike", "certified", "as listed", "unproved"]
    sentence: str
    certificate: Certificate | None = None
    coverage: Coverage | None = None
    kind: ModelKind | None = None


class Conversion(msgspec.Struct, frozen=True):
    """A model that went from one file to another.

    Attributes:
        source: The file that was read, or the model's name.
        read_as: The format that was read; empty for a model.
        reading: What was read.
        to: The format that was written.
        model: What was written: the model that was read, or what it was turned into.
        written: The file.
        proof: How the file stands to the model.
    """

    source: str
    read_as: str
    reading: Reading
    to: str
    model: Document
    written: Written
    proof: Proof


def reading_format(name: str) -> Format:
    """Return a format by its name, and read as an engine does whose name follows.

    Raises:
        ValueError: If there is no such format, or the reader knows no such dialect.

    Example:
        >>> reading_format("fcl:jfuzzylogic").name
        'fcl'
        >>> reading_format("fis:iec")
        Traceback (most recent call last):
        ValueError: dialect: must be matlab, octave, fuzzylite, not 'iec'
    """
    name, colon, dialect = name.partition(":")
    form = find_format(name)
    if not colon or form.read is None:
        return form
    option_value(msgspec.structs.replace(form, write=form.read), "dialect", dialect)
    read = functools.partial(form.read, dialect=dialect)
    return msgspec.structs.replace(form, read=read)


def format_of(path: str | os.PathLike[str]) -> Format:
    """Return the format in which a file is read, by its suffix or as it is named.

    Raises:
        ReadError: If the suffix names none.
    """
    if isinstance(path, ModelPath) and path.read_as is not None:
        return reading_format(path.read_as)
    name, suffix = os.fspath(path) or "''", Path(path).suffix
    try:
        return find_format(suffix or "no suffix")
    except ValueError as error:
        if name.lower().endswith(SUFFIXES):
            raise ReadError(
                f"{name}: is a table, and a model stands here: `fuzzytree run MODEL "
                "TABLE`, and `--data TABLE` for other verbs"
            ) from error
        _, mark, hint = str(error).rpartition(" (")
        known = ", ".join(form.name for form in all_formats() if form.read)
        shown = f"no format of a model has the suffix {suffix!r}"
        shown = shown if suffix else "has no suffix that names its format"
        text = (
            f"{name}: {shown}; models are read from {known}{mark}{hint if mark else ''}"
        )
        raise ReadError(text) from error


def read(path: str | os.PathLike[str], *, format: str | None = None) -> Reading:
    """Read a model from a file, with what the model cannot hold.

    Args:
        path: The file.
        format: The name of its format, and perhaps of a dialect, such as
            `fcl:jfuzzylogic`; the one of its suffix unless given.

    Raises:
        ReadError: If the file cannot be read, or says something wrong; the message
            lists all mistakes with their lines.
        ValueError: If there is no such format or dialect.
    """
    form = reading_format(format) if format else format_of(path)
    refuse_unreadable(form, os.fspath(path))
    return read_content(read_bounded(path), form, name=os.fspath(path))


def refuse_unreadable(form: Format, name: str) -> None:
    """Refuse a file in a format that only others read.

    Raises:
        ReadError: If the format has no reader.
    """
    if form.read is None:
        raise ReadError(
            f"{name}: a file in the format {form.name} is not read back as a model; "
            "keep the file that it was made of"
        )


def read_content(content: bytes, form: Format, *, name: str) -> Reading:
    """Read a model from the content of a file.

    Raises:
        ReadError: As `read`.
    """
    refuse_unreadable(form, name)
    if not content:
        raise ReadError(f"{name}:1:1: the file is empty")
    assert form.read is not None  # refused above; for type checkers
    reading = form.read(content, name)
    if reading.rivals:
        from fuzzytree.checking.engines import with_answers

        reading = with_answers(reading, functools.partial(form.read, content, name))
    if not reading.model.outputs:
        return reading
    narrow = [
        f"term {label.name!r} of {output.name!r} is 0 at all "
        f"{len(sampled_values(output))} values at which the range is sampled: rules "
        "that conclude it change nothing"
        for output, label in unsampled_terms(cast("FuzzySystem", reading.model))
    ]
    return msgspec.structs.replace(reading, remarks=(*reading.remarks, *narrow))


def load(
    path: str | os.PathLike[str], *, allow_loss: bool = False, format: str | None = None
) -> Document:
    """Read a model from a file: a tree, a rule base or a fuzzy system.

    Args:
        path: The file.
        allow_loss: Whether to read what the model cannot hold as near as it can.
        format: As in `read`.

    Raises:
        ReadError: As `read`.
        LossError: If the model cannot hold all that the file says, unless allowed;
            the message lists all losses.
        ValueError: If there is no such format.
    """
    return _whole(read(path, format=format), os.fspath(path), allow_loss=allow_loss)


def load_content(content: bytes, name: str, *, allow_loss: bool = False) -> Document:
    """Return the model of a file that was read already; its suffix names the format.

    Raises:
        ReadError: As `load`.
        LossError: As `load`.
    """
    reading = read_content(content, format_of(name), name=name)
    return _whole(reading, name, allow_loss=allow_loss)


def as_model(source: ModelSource, *, allow_loss: bool = False) -> Document:
    """Return the model that an argument of a public function stands for.

    Args:
        source: A tree, a rule base or a fuzzy system; a fitted `FuzzyTreeClassifier`
            or `DecisionTreeClassifier`, or a `Pipeline` of scalers and the latter; a
            system of scikit-fuzzy or simpful; or the path of a file.
        allow_loss: As in `load`.

    Raises:
        TypeError: If it is something else.
        NotFittedError: If it is a classifier that is not fitted.
        ReadError: If a file cannot be read, or an object of another library has what
            no model can represent.
        LossError: As `load`.
    """
    if isinstance(source, Document):
        return source
    if isinstance(source, str | os.PathLike):
        return load(source, allow_loss=allow_loss)
    if hasattr(source, "__fuzzytree__") and not isinstance(source, type):
        return source.__fuzzytree__()
    for parent in inspect.getmro(type(source)):
        reader = _OBJECT_READERS.get((parent.__module__, parent.__name__))
        if reader is not None:
            return reader(source)
    raise TypeError(
        "a model is a FuzzyTree, a RuleBase, a FuzzySystem, a fitted "
        "FuzzyTreeClassifier or DecisionTreeClassifier, a Pipeline that ends with the "
        "latter, a ControlSystem of scikit-fuzzy, a FuzzySystem of simpful, or the "
        f"path of a file, and not a value of type {type(source).__name__}"
    )


_OBJECT_READERS: dict[tuple[str, str], Callable[[object], Document]] = {
    ("sklearn.tree._classes", "DecisionTreeClassifier"): from_sklearn,
    ("sklearn.pipeline", "Pipeline"): from_sklearn,
    ("simpful.simpful", "FuzzySystem"): from_simpful,
    ("skfuzzy.control.controlsystem", "ControlSystem"): from_skfuzzy,
    ("skfuzzy.control.controlsystem", "ControlSystemSimulation"): from_skfuzzy,
}
"""The module and name of a class of another library, and what reads its objects."""


def _whole(reading: Reading, name: str, *, allow_loss: bool) -> Document:
    """Return what was read.

    Raises:
        LossError: If the model cannot hold all of it, unless allowed.
    """
    if reading.losses and not allow_loss:
        listed = "\n".join(f"  {loss_text(loss)}" for loss in reading.losses)
        raise LossError(
            f"{name}: a model cannot hold all that the file says:\n{listed}\n"
            "  pass allow_loss=True to read it as stated"
        )
    return reading.model


def export(
    model: ModelSource,
    to: str = "yaml",
    *,
    allow_loss: bool = False,
    **options: Option,
) -> Written:
    """Write a model in a format, as bytes.

    Args:
        model: A tree, a rule base or a fuzzy system; see `as_model`.
        to: The name of a format, or a suffix such as `.onnx`.
        allow_loss: Whether to write what the format cannot hold as near as it can.
        options: The writer's own options, such as `dtype` for onnx.

    Returns:
        The content and what was lost.

    Raises:
        LossError: If something would be lost, unless allowed.
        MissingExtraError: If a package is missing; the message names the extra.
        ValueError: If there is no such format or option.
    """
    model = as_model(model, allow_loss=allow_loss)
    form = find_format(to)
    refuse_other_kind(model, form)
    check_options(form, options)
    if isinstance(tolerance := options.get("tolerance"), int | float):
        check_tolerance(tolerance)
    # Each writer checks its own options; the protocol knows the common one alone.
    write = cast("Callable[..., Written]", form.write)
    return write(model, allow_loss=allow_loss, **options)


def proved(
    model: Document, form: Format, written: Written, *, dtype: object = None
) -> Proof:
    """Read a file back, or derive what it can change.

    Args:
        model: What was written.
        form: The format.
        written: The file.
        dtype: The number type that the writer used, if any.

    Raises:
        DisagreementError: If the file is read back as another model, though the writer
            and the reader reported nothing.
    """
    if not model.outputs:
        return _proved(model, form, written, dtype=dtype)
    system = cast("FuzzySystem", model)
    if form.read is None and form.name == "onnx" and not written.losses:
        return _run(system, written)
    from fuzzytree.checking.subject import coverage_of

    proof = _proved(model, form, written, dtype=dtype)
    return msgspec.structs.replace(proof, coverage=coverage_of(system))


def _proved(model: Document, form: Format, written: Written, *, dtype: object) -> Proof:
    from fuzzytree.numerics import Certificate, certify

    if form.read is None:
        if form.dtype is None or model.outputs:
            return Proof("unproved", _NOT_READ)
        chosen = dtype if dtype in get_args(Dtype) else form.dtype
        facts = certify(cast("Model", model), cast("Dtype", chosen), None)
        return Proof("certified", facts.sentence, facts)
    try:
        again = form.read(written.content, form.name)
    except ReadError as error:
        raise DisagreementError(
            f"{model.name} as {form.name} cannot be read back, and is not written:\n"
            f"{error}"
        ) from error
    match equivalence(model, written, again):
        case "equal":
            what = CALLED[kind_of(model)]
            text = f"read back from the file, the {what} is equal in every number"
            exact = Certificate(None, kind_of(model), 0.0, text)
            bound = None if model.outputs else exact
            return Proof("equal", text, bound, kind=kind_of(model))
        case "alike":
            text = "read back from the file, it is equal but for names and notes"
            return Proof("alike", text, kind=kind_of(again.model))
        case "other" if written.losses or again.losses:
            text = "read back from the file, it differs by what was lost"
            text += _decided(model, again.model)
            return Proof("as listed", text, kind=kind_of(again.model))
        case _:
            raise DisagreementError(
                f"{model.name} as {form.name} is read back as another model; "
                "nothing is written"
            )


def _decided(model: Document, other: Document) -> str:
    """Return what a loss did to the decisions of rules, in words; empty for others."""
    if model.outputs or other.outputs or not model.rules:
        return ""
    if len(model.rules) != len(other.rules) or model.inputs != other.inputs:
        return ""
    from fuzzytree.runtimes import baseline

    rows = probe_values(model, _TRIED)
    one, two = (baseline().load(each)(rows).rule for each in (model, other))
    count, size = int((one != two).sum()), rows.shape[1]
    if count:
        return f"; another rule wins in {count} of {size} generated rows"
    return f"; the same rule wins in all of {size} generated rows"


def in_dialect(
    options: Mapping[str, Option], reading: Reading, form: Format
) -> dict[str, Option]:
    """Return a writer's options, with the dialect of what was read in its format."""
    name, _, dialect = reading.dialect.partition(":")
    is_known = "dialect" in inspect.signature(form.write).parameters
    is_same = name == form.name and is_known
    return {"dialect": dialect, **options} if is_same else {**options}


def _run(system: FuzzySystem, written: Written) -> Proof:
    """Run the ONNX file of a system, and compare its numbers.

    Raises:
        DisagreementError: If it answers other numbers, though no loss was reported.
    """
    from fuzzytree.checking.representations import check
    from fuzzytree.runtimes import open_onnx

    model = open_onnx(written.content, "the file")
    agreement = check(system, model, runtimes=[], limit=_FEW)
    agreement.raise_if_not_ok()
    rows = f"{agreement.probes} generated rows"
    text = f"run by onnxruntime, it answers {rows} like the system"
    coverage = agreement.coverage
    if coverage is not None and coverage.unfired:
        fired = coverage.rules - len(coverage.unfired)
        text += f", in which {fired} of {coverage.rules} rules fire"
    return Proof("alike", text, coverage=coverage)


def convert(
    source: ModelSource | Reading,
    to: str,
    *,
    format: str | None = None,
    allow_loss: bool = False,
    representation: ModelKind | None = None,
    terms: Kind | None = None,
    conjunction: Conjunction | None = None,
    **options: Option,
) -> Conversion:
    """Bring a model from one format to another, and prove what arrived.

    Args:
        source: The path of a file, a model as in `as_model`, or what was read.
        to: The name of a format, or a suffix such as `.fll`.
        format: Of the file, as in `read`.
        allow_loss: Whether to read and write what has no place as near as it can.
        representation: `tree`, `rules` or `system`; what the format carries unless
            given.
        terms: Of rules made from a tree: `relative`, which equal it, or `raw`.
        conjunction: Of rules made from a tree.
        options: The writer's own.

    Returns:
        What was read, what was written, and how the file stands to the model.

    Raises:
        ReadError: As `read`.
        LossError: If something would be lost, unless allowed.
        DisagreementError: If the file is read back as another model without a word.
        ValueError: If there is no such format, form or option.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> convert(random_tree(1), "yaml", representation="rules").proof.verdict
        'equal'
    """
    form = find_format(to)
    name, read_as = "", ""
    if isinstance(source, Reading):
        reading = source
    elif isinstance(source, str | os.PathLike):
        reading = read(source, format=format)
        name = os.fspath(source)
        read_as = (reading_format(format) if format else format_of(source)).name
    else:
        reading = Reading(as_model(source))
    name = name or reading.model.name
    model = formed(
        _whole(reading, name, allow_loss=allow_loss),
        form,
        representation=representation,
        kind=terms,
        conjunction=conjunction,
    )
    chosen = in_dialect(options, reading, form)
    written = export(model, form.name, allow_loss=allow_loss, **chosen)
    proof = proved(model, form, written, dtype=options.get("dtype"))
    return Conversion(name, read_as, reading, form.name, model, written, proof)

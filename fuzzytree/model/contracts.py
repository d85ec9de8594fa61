"""The records that readers, writers and runtimes fill in."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self, TypeAlias

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import Path, RuleBase
from fuzzytree.model.system import FuzzySystem
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.model.values import ModelKind as ModelKind
from fuzzytree.model.values import summary

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

FloatArray: TypeAlias = "npt.NDArray[np.float64]"
IntArray: TypeAlias = "npt.NDArray[np.int64]"
BoolArray: TypeAlias = "npt.NDArray[np.bool_]"

Model = FuzzyTree | RuleBase
"""What decides for a class."""

Document = FuzzyTree | RuleBase | FuzzySystem
"""What a file can hold."""


def kind_of(model: Document) -> ModelKind:
    """Return which kind of model it is."""
    return model.representation


class Fitted(Protocol):
    """A fitted classifier that can say which tree it predicts with."""

    def __fuzzytree__(self) -> FuzzyTree:
        """Return the tree, or raise what scikit-learn raises where none is fitted."""
        ...


ModelSource = Document | Fitted | str | os.PathLike[str]
"""What public functions take as a model; `checking.converting.as_model` reads it."""


class ModelPath(str):
    """A path with the format to read, and perhaps a dialect; None is the suffix's.

    It stands for a path in every function that takes one.

    Example:
        >>> ModelPath("tip.fcl", "fcl:jfuzzylogic").read_as
        'fcl:jfuzzylogic'
    """

    read_as: str | None

    def __new__(cls, path: str | os.PathLike[str], read_as: str | None = None) -> Self:
        """Return the path."""
        result = super().__new__(cls, os.fspath(path))
        result.read_as = read_as
        return result


Dtype = Literal["float64", "mixed", "float32"]


class Loss(msgspec.Struct, frozen=True):
    """One thing that a format or runtime cannot carry.

    Attributes:
        where: The part of the model, as people name it.
        what: What is lost, and what stands in its place.
        bound: The largest error of a degree that it causes, if it is that kind.
    """

    where: str
    what: str
    bound: float | None = None


class Written(msgspec.Struct, frozen=True):
    """What a writer made.

    Attributes:
        content: The file.
        losses: What was lost on the way, and can change an answer.
        remarks: What else is worth knowing, a sentence each, such as facts that the
            file has no place for and no answer depends on.
        names: The names that are others in the file, by those of the model.
    """

    content: bytes
    losses: tuple[Loss, ...] = ()
    remarks: tuple[str, ...] = ()
    names: Mapping[str, str] = msgspec.field(default_factory=dict)

    def __repr__(self) -> str:
        """Show how large the file is, and how many losses and remarks there are."""
        return summary(
            "Written",
            bytes=len(self.content),
            losses=len(self.losses),
            remarks=len(self.remarks),
        )


Locate = Callable[[Path], tuple[int, int] | None]
"""Where a part of a model stands in its file: line and column from 1, if known."""


def nowhere(_: Path) -> None:
    """Locate nothing: the parts of a model that has no lines."""


class Reading(msgspec.Struct, frozen=True):
    """What a reader made of a file.

    Attributes:
        model: A tree, a rule base or a system.
        losses: What the file says that the model cannot hold, and what stands in its
            place.
        remarks: What else is worth knowing, such as the dialect that was detected.
        locate: Where the parts of the model stand in the file.
        dialect: Whose meaning counted, behind the format: `fcl:jfuzzylogic`; empty of
            a format that has one meaning.
        rivals: Other dialects that may be meant, if the file does not say which.
    """

    model: Document
    losses: tuple[Loss, ...] = ()
    remarks: tuple[str, ...] = ()
    locate: Locate = nowhere
    dialect: str = ""
    rivals: tuple[str, ...] = ()


class Writer(Protocol):
    """A writer: a model to bytes; options are the writer's own, by keyword.

    It gets only what its format says that it carries.
    """

    def __call__(self, model: Any, /, *, allow_loss: bool = False) -> Written:
        """Write a model, or raise LossError when something would be lost."""
        ...


class Format(msgspec.Struct, frozen=True):
    """A file format.

    Attributes:
        name: As in `--to`.
        suffixes: With the dot; the first is the usual one.
        write: Model to bytes.
        carries: What the format can hold; every kind of model unless given.
        read: Bytes and a name for messages to a reading; None if it cannot be read.
            Raises ReadError with all mistakes of the file. Its keyword `dialect`, if
            it has one, is a Literal of those whose meaning a file can have.
        cannot: What it cannot hold, a sentence each.
        extra: The optional packages it needs, if any.
        dtype: The number type in which a file of it computes, unless the writer's
            option of that name says another; None if it only holds the model.
    """

    name: str
    suffixes: tuple[str, ...]
    write: Writer
    carries: tuple[ModelKind, ...] = ("tree", "rules", "system")
    read: Callable[..., Reading] | None = None
    cannot: tuple[str, ...] = ()
    extra: str | None = None
    dtype: Dtype | None = None


class Outcome(msgspec.Struct, frozen=True):
    """The results of a runtime for many rows.

    Attributes:
        rule: The number of the winning rule or leaf of each row, from 1; 0 for none, as
            for a fuzzy system.
        status: A `fuzzytree.semantics.reference.Status` for each row. A row of a system
            is decided, uncovered (a default or NaN answers an output) or missing.
        strengths: Shape (rules, rows), of a system the degrees of activation of the
            rules of all blocks; None where only the path was followed or strengths were
            not requested. NaN in rows with missing values.
        probabilities: Shape (classes, rows), where the runtime computes them itself
            and they were requested. NaN in rows without a rule.
        outputs: Shape (outputs, rows), the numbers of a system in its order; NaN
            without number. None of what answers a class.
    """

    rule: IntArray
    status: IntArray
    strengths: FloatArray | None = None
    probabilities: FloatArray | None = None
    outputs: FloatArray | None = None

    def part(self, rows: slice | IntArray) -> Outcome:
        """Return the results of some of the rows."""
        arrays = msgspec.structs.asdict(self).items()
        parts = {name: None if a is None else a[..., rows] for name, a in arrays}
        return msgspec.structs.replace(self, **parts)


Progress = Callable[[str, float], None]
"""Called with what is done next and the share that is done, in [0, 1]."""

Run = Callable[["FloatArray"], Outcome]
"""Results for values of shape (inputs, rows), in the order of the model's inputs."""


class Prepared(msgspec.Struct, frozen=True):
    """A model as a graph in a session.

    Attributes:
        run: Answers to values of shape (inputs, rows).
        table: The same values as the graph takes them, shape (rows, columns).
        call: The answers to such a table and nothing else: some rows at a time, as
            `run` does, and thrown away.
        content: The graph as a file.
        dtype: The number type of the table.
    """

    run: Run
    table: Callable[[FloatArray], npt.NDArray[np.generic]]
    call: Callable[[npt.NDArray[np.generic]], None]
    content: bytes
    dtype: Dtype


class Loader(Protocol):
    """Prepares a model for many rows."""

    def __call__(self, model: Any, /, *, with_strengths: bool = True) -> Run:
        """Return what runs a model, or raise LossError if it is outside its means.

        Without `with_strengths` those that cost time are left out.
        """
        ...


class Runtime(msgspec.Struct, frozen=True):
    """Something that can execute a model.

    Attributes:
        name: As in reports, such as `onnxruntime float32`.
        runs: Which models it can execute.
        load: Prepare a model of one of these kinds.
        dtype: The number type of degrees and strengths.
        bound: The largest difference of a strength that is allowed against the
            reference, for a model, and where it comes from; None demands equal bits
            with the runtime `native` of the same number type.
        cannot: What it cannot do, a sentence each.
        extra: The optional packages it needs, if any.
        modules: The modules that must be importable.
        programs: The programs of which one must be installed.
        is_slow: Whether rows cost so much that a check gives it only a share of them.
        is_baseline: Whether the other runtimes of its number type are compared with it.
        is_definition: Whether it evaluates the definition, row by row, and so is the
            one that a baseline is compared with.
        in_audits: Whether an audit compares it.
        is_reentrant: Whether several threads may use what it loads at once.
        in_variants: Whether a benchmark also measures it on approximated curves.
        prepare: Makes a graph of a model, for a number of threads, so that a benchmark
            times the call of the graph alone; None if it runs no graph.
        size: The bytes of the file or code that runs, for a model, if there is one.
        note: What a reader of a benchmark must know about it.
    """

    name: str
    runs: tuple[ModelKind, ...]
    load: Loader
    dtype: Dtype = "float64"
    bound: Callable[[Any], tuple[float, str]] | None = None
    cannot: tuple[str, ...] = ()
    extra: str | None = None
    modules: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()
    is_slow: bool = False
    is_baseline: bool = False
    is_definition: bool = False
    in_audits: bool = False
    is_reentrant: bool = False
    in_variants: bool = False
    prepare: Callable[..., Prepared] | None = None
    size: Callable[[Any], int] | None = None
    note: str = ""


def loss_text(loss: Loss) -> str:
    """Return a loss as people read it, with its bound.

    Example:
        >>> loss_text(Loss("term 'low' of 'force'", "becomes 9 points", 1e-3))
        "term 'low' of 'force': becomes 9 points (largest error 0.001)"
    """
    bound = "" if loss.bound is None else f" (largest error {loss.bound:.2g})"
    return f"{loss.where}: {loss.what}{bound}"


def refusal(model: str, to: str, losses: Sequence[Loss]) -> LossError:
    """Return the error with which a writer refuses to lose something.

    Example:
        >>> print(refusal("grip", "turtle", [Loss("AND", "a product becomes min")]))
        cannot write grip as turtle without loss:
          AND: a product becomes min
          pass allow_loss=True to write it as stated
    """
    listed = "".join(f"  {loss_text(loss)}\n" for loss in losses)
    return LossError(
        f"cannot write {model[:100]} as {to} without loss:\n{listed}"
        "  pass allow_loss=True to write it as stated"
    )


def narrowing_refusal(model: str, to: str, losses: Sequence[Loss]) -> LossError:
    """Return the error with which a writer refuses to narrow numbers.

    It lists the first ten losses.
    """
    lines = [f"{loss.where}: {loss.what}" for loss in losses[:10]]
    if len(losses) > 10:
        lines.append(f"and {len(losses) - 10} more")
    lines.append(
        "pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )
    return LossError(f"cannot write {model} as {to}: " + "\n  ".join(lines))

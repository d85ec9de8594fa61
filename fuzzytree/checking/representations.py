"""Do all representations of a model give its answers?

No representation is trusted: each is loaded and run. Kinds of evidence are kept
apart: *file* (two contents are equal), *proof* and *all cells* (statements about every
input), *rows* (probes aimed at every proposition, and the user's data: a sample,
however well aimed) and *calls* (ways of calling that break programs).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from fuzzytree.checking.comparing import (
    Finding,
    RowSet,
    counted,
    file_content,
    judged,
)
from fuzzytree.checking.models import CheckedModel
from fuzzytree.checking.programs import ProgramFile, check_program
from fuzzytree.checking.systems import CheckedSystem
from fuzzytree.errors import FuzzyTreeError, LossError, ReadError
from fuzzytree.model import (
    MOST_PROBES,
    MOST_SYSTEM_PROBES,
    TOLERANCE,
    Agreement,
    Comparison,
    Count,
    Document,
    FileContent,
    FloatArray,
    FuzzySystem,
    FuzzyTree,
    Kind,
    Outcome,
    Progress,
    RuleBase,
    Runtime,
    checkpoint,
    fingerprint,
    kind_of,
)
from fuzzytree.runtimes import (
    OnnxModel,
    chosen_runtimes,
    is_installed,
    joined,
    needed_by,
)
from fuzzytree.semantics import Status, as_rules, as_system

if TYPE_CHECKING:
    Checked = CheckedModel | CheckedSystem
    Shipped = Document | OnnxModel | ProgramFile


def check(
    model: Document,
    *others: Shipped,
    data: FloatArray | None = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    limit: int | None = None,
    rows_only: bool = False,
    terms: Kind = "relative",
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> Agreement:
    """Compare every representation of a model with the model itself.

    Args:
        model: A tree, a rule base or a fuzzy system.
        others: Files that were made of it: models, opened ONNX files
            (`fuzzytree.runtimes.onnxruntime.open_onnx`), programs.
        data: Rows of one's own, shape (inputs, rows), in the order of the model's
            inputs; of a system, of its `columns`.
        names: What to call each of the others; `file 1`, `file 2` unless given.
        runtimes: The names of the runtimes to run; all that are installed if None.
        limit: The most probes; as in `CheckSettings` if None.
        rows_only: Whether files whose rows agree are accepted with other content.
        terms: As in `CheckSettings`.
        tolerance: As in `CheckSettings`.
        progress: Called with what is compared next and the share that is done.

    Returns:
        What was compared, on what, and with which result. A row of a system `flips`
        where its status differs.

    Raises:
        ReadError: If one of the others is a model of another kind.
        ValueError: If `data` is not of shape (inputs, rows), or a runtime is unknown.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> check(random_system(2), runtimes=["native"], limit=50).ok
        True
    """
    titles = [*names, *(f"file {k + 1}" for k in range(len(names), len(others)))]
    files = [
        (title, _comparable(other, model, title))
        for title, other in zip(titles, others, strict=False)
    ]
    subject: Checked
    if isinstance(model, FuzzySystem):
        subject = CheckedSystem(model, data, limit or MOST_SYSTEM_PROBES)
    else:
        subject = CheckedModel(model, data, limit or MOST_PROBES, terms)
        subject.tolerance = tolerance
    chosen = chosen_runtimes(runtimes)
    steps = [(form, runtime) for form in subject.outcomes for runtime in chosen]
    parts = len(steps) + len(files)
    findings = [*subject.own()]
    for number, (form, runtime) in enumerate(steps):
        if progress:
            progress(f"comparing {subject.title(form, runtime)}", number / parts)
        findings += _in_runtime(subject, form, runtime)
    for number, (title, other) in enumerate(files, len(steps)):
        if progress:
            progress(f"comparing {title}", number / parts)
        findings += _shipped(subject, title, other, terms)
    return Agreement(
        model.name,
        fingerprint(model),
        tuple(one for one in findings if isinstance(one, Comparison)),
        tuple(_count(title, outcome) for title, outcome in subject.outcomes.items()),
        tuple(dict.fromkeys(one for one in findings if isinstance(one, str))),
        subject.cells,
        subject.rows.probes,
        tuple(subject.certificates(chosen)),
        rows_only,
        subject.coverage,
        tuple(one for one in findings if isinstance(one, FileContent)),
    )


def _comparable(other: Shipped, model: Document, title: str) -> Shipped:
    """Return what is compared: a model of the same kind, if one stands for it.

    Rules beside a system become the system that gives the number of their class; a
    system beside rules or a tree becomes the rules that it stands for.

    Raises:
        ReadError: If nothing of that kind stands for it.
    """
    is_system = isinstance(model, FuzzySystem)
    if is_system and isinstance(other, FuzzyTree):
        raise ReadError(f"{title}: is a tree, and is not compared with a fuzzy system")
    if is_system and isinstance(other, RuleBase):
        return as_system(other, "winner")
    if is_system or not isinstance(other, FuzzySystem):
        return other
    rules = as_rules(other, None)
    if rules is None:
        raise ReadError(
            f"{title}: is a fuzzy system whose outputs are numbers, and is not "
            "compared with rules or a tree"
        )
    return rules


def _in_runtime(subject: Checked, form: str, runtime: Runtime) -> Iterator[Finding]:
    """Run one form in a runtime that can, and compare it with the native one."""
    title = subject.title(form, runtime)
    if kind_of(subject.forms[form]) not in runtime.runs:
        return
    if not is_installed(runtime):
        yield f"{runtime.name} is not installed ({needed_by(runtime)})"
        return
    checkpoint()
    try:
        run: Any = subject.load(form, runtime)
    except LossError as error:
        yield f"{title}: {error}"
        return
    checkpoint()
    share = subject.share(form) if runtime.is_slow else slice(None)
    yield from subject.compared(form, runtime, run, share)
    checkpoint()
    yield _calls(title, subject, run, subject.rows.part(share))


def _calls(title: str, subject: Checked, run: Any, rows: RowSet) -> Comparison:
    """Call a runtime in the ways that break: no row, one, other order, wrong width."""
    width, total = rows.values.shape
    rows = rows.part(slice(None, None, max(total // 24, 1)))
    sample = np.ascontiguousarray(rows.values)
    count = sample.shape[1]
    whole = run(sample)
    alone = joined([run(sample[:, row : row + 1]) for row in range(count)])
    faults = [
        f"a row answered alone differs from the same row in a batch, {text}"
        for text in subject.faults(alone, whole, rows)
    ]
    if subject.faults(run(np.asfortranarray(sample)), whole, rows):
        faults.append("another memory order changes the answers")
    empty = run(np.empty((width, 0)))
    arrays = [array for array in msgspec.structs.astuple(empty) if array is not None]
    if any(array.shape[-1:] != (0,) for array in arrays):
        faults.append("no rows do not give empty answers")
    try:
        run(np.zeros((width + 1, 3)))
        faults.append(f"{width + 1} inputs are accepted where {width} are right")
    except (ValueError, FuzzyTreeError):
        pass
    return counted("calls", title, "itself", count + 3, faults)


def _shipped(
    subject: Checked, title: str, other: Shipped, terms: Kind
) -> Iterator[Finding]:
    """Compare a file that was shipped beside a model: its content, then its answers."""
    if isinstance(other, ProgramFile):
        yield from check_program(title, other, subject.model, subject.rows, terms)
    elif isinstance(other, OnnxModel):
        yield from _shipped_onnx(subject, title, other)
    else:
        yield file_content(title, other)
        yield from subject.shipped(title, other)


def _shipped_onnx(subject: Checked, title: str, file: OnnxModel) -> Iterator[Finding]:
    """Compare an ONNX file: what it says of itself, its graph, and its answers."""
    forms = {"descent": "tree", "relative": "relative rules", "raw": "raw rules"}
    yield FileContent(title, forms.get(file.kind, file.kind), file.dtype)
    fault = subject.foreign(file)
    if fault is not None:
        yield counted("file", title, f"{subject.noun}'s facts", 1, (fault,))
        return
    from fuzzytree.exporters import differences

    expected = subject.counterpart(file)
    if isinstance(expected, str):
        faults: Sequence[str] = (expected,)
    else:
        apart = differences(file.content, expected)
        faults = apart.graph
        yield counted("file", title, f"{subject.noun}'s metadata", 1, apart.metadata)
    try:
        results = [*subject.file_rows(title, file)]
    except LossError as error:  # the file loads, but onnxruntime cannot run it
        size = len(subject.rows.numbers)
        results = [counted("rows", title, subject.base, size, (str(error),))]
    yield judged(title, "a freshly written graph", faults, results)
    yield from results


def _count(title: str, outcome: Outcome) -> Count:
    kinds = (Status.TIE, Status.UNCOVERED, Status.MISSING)
    status = outcome.status
    return Count(title, status.size, *(int((status == one).sum()) for one in kinds))

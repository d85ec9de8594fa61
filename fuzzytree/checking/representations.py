"""Do all representations of a model give its answers?

No representation is trusted: each is loaded and run. Kinds of evidence are kept
apart: *file* (two contents are equal), *proof* and *all cells* (statements about every
input), *rows* (probes aimed at every proposition, and the user's data: a sample,
however well aimed) and *calls* (ways of calling that break programs).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import msgspec
import numpy as np

from fuzzytree.checking.comparing import (
    Finding,
    ModelRun,
    RowSet,
    counted,
    differences,
)
from fuzzytree.checking.files import Shipped, check_file
from fuzzytree.checking.subject import Subject
from fuzzytree.errors import FuzzyTreeError, LossError, ReadError
from fuzzytree.model import (
    TOLERANCE,
    Agreement,
    Comparison,
    Count,
    Document,
    FileContent,
    FloatArray,
    FuzzySystem,
    Kind,
    Outcome,
    Progress,
    RuleBase,
    Run,
    Runtime,
    Unchecked,
    checkpoint,
    fingerprint,
    kind_of,
)
from fuzzytree.runtimes import (
    chosen_runtimes,
    is_installed,
    joined,
    needed_by,
)
from fuzzytree.semantics import Status, as_rules, as_system


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
    subject = Subject(model, data, limit, terms=terms, tolerance=tolerance)
    chosen = chosen_runtimes(runtimes)
    steps = [(form, runtime) for form in subject.forms for runtime in chosen]
    parts = len(steps) + len(files)
    findings = [*subject.own()]
    for number, (form, runtime) in enumerate(steps):
        if progress:
            progress(f"comparing {subject.title(form, runtime)}", number / parts)
        findings += _in_runtime(subject, form, runtime)
    for number, (title, other) in enumerate(files, len(steps)):
        if progress:
            progress(f"comparing {title}", number / parts)
        findings += check_file(subject, title, other)
    unchecked = tuple(one for one in findings if isinstance(one, Unchecked))
    skipped = (
        one.sentence if isinstance(one, Unchecked) else one
        for one in findings
        if isinstance(one, str | Unchecked)
    )
    return Agreement(
        model.name,
        fingerprint(model),
        tuple(one for one in findings if isinstance(one, Comparison)),
        tuple(_count(title, run.outcome) for title, run in subject.runs.items()),
        tuple(dict.fromkeys(skipped)),
        subject.cells,
        subject.rows.probes,
        tuple(subject.certificates(chosen)),
        rows_only,
        subject.coverage,
        tuple(one for one in findings if isinstance(one, FileContent)),
        unchecked,
    )


def _comparable(other: Shipped, model: Document, title: str) -> Shipped:
    """Return what is compared: a model of the same kind, if one stands for it.

    Rules beside a system become the system that gives the number of their class; a
    system beside rules or a tree becomes the rules that it stands for.

    Raises:
        ReadError: If nothing of that kind stands for it.
    """
    if not isinstance(other, Document) or bool(model.outputs) == bool(other.outputs):
        return other
    if model.outputs and not other.rules:
        raise ReadError(f"{title}: is a tree, and is not compared with a fuzzy system")
    if model.outputs:
        return as_system(cast("RuleBase", other), "winner")
    rules = as_rules(cast("FuzzySystem", other), None)
    if rules is None:
        raise ReadError(
            f"{title}: is a fuzzy system whose outputs are numbers, and is not "
            "compared with rules or a tree"
        )
    return rules


def _in_runtime(subject: Subject, form: str, runtime: Runtime) -> Iterator[Finding]:
    """Run one form in a runtime that can, and compare it with the native one."""
    title, model = subject.title(form, runtime), subject.forms[form]
    if kind_of(model) not in runtime.runs:
        return
    if not is_installed(runtime):
        yield f"{runtime.name} is not installed ({needed_by(runtime)})"
        return
    checkpoint()
    try:
        run = runtime.load(model)
    except LossError as error:
        yield f"{title}: {error}"
        return
    checkpoint()
    rows = subject.share(form) if runtime.is_slow else subject.rows
    yield from subject.compared(form, runtime, run, rows)
    checkpoint()
    yield _calls(title, subject, model, run, rows)


def _calls(
    title: str, subject: Subject, model: Document, run: Run, rows: RowSet
) -> Comparison:
    """Call a runtime in the ways that break: no row, one, other order, wrong width.

    A library may compute a function of one number otherwise than of many, so that the
    answers to a row may be apart as far as those of two runners.
    """
    width, total = rows.values.shape
    rows = rows.part(slice(None, None, max(total // 24, 1)))
    sample = np.ascontiguousarray(rows.values)
    whole, count = run(sample), sample.shape[1]

    def wrong_rows(outcome: Outcome) -> list[str]:
        one, two = (ModelRun(title, model, each) for each in (outcome, whole))
        apart = differences(one, two, rows, subject.exactly(model))
        return [rows.name(row) for row in apart.results.rows[apart.wrong].tolist()]

    alone = joined([run(sample[:, row : row + 1]) for row in range(count)])
    faults = [
        f"a row answered alone differs from the same row in a batch, {text}"
        for text in wrong_rows(alone)
    ]
    if wrong_rows(run(np.asfortranarray(sample))):
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


def _count(title: str, outcome: Outcome) -> Count:
    kinds = (Status.TIE, Status.UNCOVERED, Status.MISSING)
    status = outcome.status
    return Count(title, status.size, *(int((status == one).sum()) for one in kinds))

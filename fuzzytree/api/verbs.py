"""What one does with fuzzytree, a function for each verb of the command line."""

from __future__ import annotations

import hashlib
import io
import os
import stat
import warnings
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar, Unpack, cast, get_args, overload

import msgspec
import numpy as np

from fuzzytree import (
    auditing,
    benchmarking,
    checking,
    learning,
    numerics,
    report,
    semantics,
)
from fuzzytree.api.answering import Carried, opened
from fuzzytree.api.answering import run as run
from fuzzytree.api.engines import engine_of
from fuzzytree.api.settings import (
    AuditArguments,
    BenchArguments,
    CheckArguments,
    DrawArguments,
    check_arguments,
    with_arguments,
)
from fuzzytree.api.trees import check_trees
from fuzzytree.checking import convert as convert
from fuzzytree.checking import export as export
from fuzzytree.checking import load as load
from fuzzytree.checking import read as read
from fuzzytree.errors import ReadError, TableError
from fuzzytree.exporters import all_formats, find_format
from fuzzytree.files import check_stream, read_bounded, reason, write_atomically
from fuzzytree.model import (
    DATE_UNIT,
    Agreement,
    CheckSettings,
    Conjunction,
    Document,
    Dtype,
    FuzzyTree,
    Kind,
    Model,
    ModelSource,
    Option,
    Progress,
    RuleBase,
    TreeAgreement,
    Written,
    as_names,
    fingerprint,
    kind_of,
    name_choice,
    printable,
    with_label_type,
)
from fuzzytree.runtimes import chosen_runtimes
from fuzzytree.tables import (
    Batch,
    Table,
    TableSource,
    Weights,
    batches,
    class_names,
    path_of,
    stem_of,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, Use
    from fuzzytree.rechecking import Report
    from fuzzytree.report import Picture


Frame = TypeVar("Frame")


def learn(
    table: object,
    *,
    target: str | Sequence[object] | npt.NDArray[np.generic],
    weights: Weights = None,
    ignore: Sequence[str] = (),
    name: str | None = None,
    units: Mapping[str, str] | None = None,
    settings: learning.LearningSettings | learning.SettingArguments | None = None,
    progress: Progress | None = None,
    **options: Unpack[learning.SettingArguments],
) -> FuzzyTree:
    """Learn a fuzzy tree from a table with a class for each row.

    Of more than 200 classes a `RuleBase` is learnt in its place, a rule for each class:
    it has the attributes of a tree, empty where they are about nodes and leaves.
    `form="tree"` or a limit of the tree's size learns a tree.

    Args:
        table: A path, a pandas, polars or arrow table, an array of shape
            (rows, columns), or what `fuzzytree.table` returns; or a lazy frame of
            Polars, DuckDB, Ibis, Spark or Dask, which is not collected. Files of any
            length are read in bounded memory.
        target: The column of the classes, or the classes themselves.
        weights: The column of the rows' weights, which is no input then, or the weights
            themselves. A row of the whole weight k counts as k equal rows, and one of
            the weight 0 is left out; of other weights only the ratios matter. All are 1
            unless given. Lazy frames and tables of more than 2^25 numbers have none.
        ignore: Columns to leave out.
        name: Of the tree; the file's, or `tree`, unless given.
        units: The units of columns, by name.
        settings: How to learn; the defaults of `LearningSettings` unless given.
        progress: Called with the current step and the share that is done.
        options: Settings by name, such as `leaves=4`, which go before `settings`; see
            `LearningSettings`.

    Raises:
        TypeError: If there is no setting of a name.
        TableError: If a column is absent, if a weight is missing, infinite or negative,
            or if there are no rows.
        ValueError: If a setting is out of its range; if weights that are no column are
            not one number for each row, or cannot be weights.
        LearningError: If nothing can be learnt from the table, or its target is
            continuous.

    Warns:
        UserWarning: If a column looks like an identifier, or there are many classes
            with few rows for each.

    Example:
        >>> tree = learn(
        ...     np.array([[1.0], [1.5], [7.0], [7.5]]),
        ...     target=["soft", "soft", "firm", "firm"],
        ...     leaves=2,
        ... )
        >>> run(tree, np.array([[2.0], [7.0]])).classes
        ['soft', 'firm']
    """
    chosen, engine = learning.settings_of(settings, options), engine_of(table)
    result: Table | learning.Learner
    if engine is not None:
        if weights is not None:
            raise TableError(
                f"a {engine.type_name} of {engine.package} has no weights of rows, as "
                "it is not collected: collect it first"
            )
        from fuzzytree.api.engines.core import collect_frame

        result = collect_frame(table, engine, target, ignore=ignore, settings=chosen)
    else:
        result = learning.read_or_collect(
            table,
            target=target,
            weights=weights,
            ignore=ignore,
            settings=chosen,
            progress=progress,
        )
    rows = result if isinstance(result, Table) else result.table()
    for column, text in learning.remarks(rows, lambda column: f"ignore=[{column!r}]"):
        warnings.warn(f"{rows.name}: {column} has {text}", stacklevel=2)
    learnt = learn_table(
        result,
        name=name or printable(stem_of(path_of(table) or "")) or "tree",
        units=units or {},
        settings=chosen,
        progress=progress,
    )
    return cast("FuzzyTree", learnt.model)  # rules have the attributes of a tree


def learn_table(
    table: Table | learning.Learner,
    *,
    name: str,
    units: Mapping[str, str],
    settings: learning.LearningSettings,
    progress: Progress | None = None,
) -> learning.Learnt:
    """Learn from a table that was read, and return the report beside the tree.

    A table that was collected is a learner, with settings of its own.

    Raises:
        TableError: If a unit is given for a column that is not there.
        LearningError: If nothing can be learnt from the table.
    """
    columns = table.columns or ()
    absent = [column for column in units if column not in columns]
    if absent:
        known = ", ".join(columns)
        raise TableError(
            f"a unit for {absent[0]!r}, which is no column; it has {known}"
        )
    if isinstance(table, learning.Learner):
        table.name, table.units = name, dict(units)
        return table.learnt(progress=progress)
    learnt = learning.learn_arrays(
        table.values.T,
        table.codes,
        columns=table.columns,
        classes=table.classes,
        units={**units, **dict.fromkeys(table.dates, DATE_UNIT)},
        name=name,
        settings=settings,
        categories=table.categories,
        ordered=table.ordered,
        weights=table.row_weights,
        progress=progress,
    )
    model = with_label_type(learnt.model, table.label_type)
    return msgspec.structs.replace(learnt, model=model)


def predict(frame: Frame, model: ModelSource) -> Frame:
    """Return a frame with the predictions of a model beside its columns.

    A lazy frame of Polars, DuckDB, Ibis, Spark or Dask comes back as a lazy frame: the
    rows are predicted by the engine, when they are collected. The predictions have the
    same bits as those of `run`.

    Args:
        frame: A lazy frame, or a pandas, polars or arrow table. Columns are found by
            name.
        model: A tree or a rule base, or the path of one.

    Returns:
        All columns of the frame, and `class`, of the type of the labels that the model
        was learnt from, null for no class; `rule`, the number of the winning rule or
        leaf, from 1, and 0 for none; `status`: decided, tie, uncovered or missing;
        `strength`: the firing strength of the winning rule, in a tree of its relative
        rule, null for none.

    Raises:
        TableError: If a column is absent or holds text, or has the name of one that is
            added. In a lazy frame, text is noticed when it is collected.
        LossError: If a query in DuckDB or Ibis cannot hold the model.
        ReadError: If the model cannot be read, or decides for no class.
        MissingExtraError: If a package that the engine needs is not installed.
        TypeError: If it is no frame.

    Example:
        >>> import pandas as pd
        >>> frame = pd.DataFrame({"cm": [1.0, 1.5, 7.0], "size": ["s", "s", "b"]})
        >>> tree = learn(frame, target="size")
        >>> predict(frame, tree)["class"].tolist()
        ['s', 's', 'b']
    """
    from fuzzytree.api.engines.core import Predictor, predict_frame

    return cast("Frame", predict_frame(frame, Predictor(_model_of(model, "predict"))))


def rules_from_tree(
    tree: ModelSource,
    kind: Kind = "relative",
    *,
    conjunction: Conjunction | None = None,
) -> RuleBase:
    """Turn each path of a tree into a rule, in the order of the leaves.

    Args:
        tree: A tree, a fitted classifier, or the path of a file that holds a tree.
        kind: `relative` for rules that equal the tree on every input; `raw` for the
            paper's rules, whose terms are the fitted sets as they are.
        conjunction: The AND of the rules; the tree's own unless given.

    Returns:
        A rule base whose rule k is leaf k, with the variables that the nodes use.

    Raises:
        TypeError: If it is no tree.
        InvalidModelError: If `kind` is `raw` and the tree carries no sets.
    """
    result = checking.as_model(tree)
    if not isinstance(result, FuzzyTree):
        called = checking.CALLED[kind_of(result)]
        raise TypeError(
            f"rules_from_tree takes a tree, and {result.name} is a {called}"
        )
    return semantics.rules_from_tree(result, kind, conjunction=conjunction)


def save(
    model: ModelSource,
    path: str | os.PathLike[str],
    *,
    to: str | None = None,
    allow_loss: bool = False,
    **options: Option,
) -> Written:
    """Write a model to a file whole, or leave what stood there.

    Args:
        model: A tree, a rule base or a fuzzy system.
        path: The file.
        to: The format; the one of the suffix unless given.
        allow_loss: As in `export`.
        options: As in `export`.

    Raises:
        WriteError: If the file cannot be written.
        LossError: As `export`.
        ValueError: As `export`.
    """
    form = to or Path(path).suffix
    if not form:
        raise ValueError(f"{os.fspath(path)}: has no suffix; pass to='yaml', say")
    written = export(model, form, allow_loss=allow_loss, **options)
    write_atomically(path, written.content)
    return written


def rows_of(data: object, model: Document) -> FloatArray | None:
    """Return the rows of a table for a model, of shape (inputs, rows).

    Args:
        data: A table; see `fuzzytree.tables`. Without one (None) there are no rows.
        model: Whose inputs they are for.

    Raises:
        TableError: If a column is absent or holds text, or the table has no row.
    """
    if data is None:
        return None
    return _rows(data, model)[0]


def _rows(
    data: object,
    model: Document,
    *,
    name: str | None = None,
    with_others: bool = False,
) -> tuple[FloatArray, list[Batch]]:
    """Return rows for a model, of shape (inputs, rows), and as they came."""
    variables, others = model.variables, with_others
    result = [
        *batches(data, model.inputs, name=name, with_others=others, variables=variables)
    ]
    return _values(result), result


def _values(parts: Sequence[Batch]) -> FloatArray:
    values = np.hstack([batch.values for batch in parts])
    if not values.shape[1]:
        raise TableError(f"{parts[0].piece.name} has no rows")
    return values


@overload
def check(
    model: Document,
    *others: Carried,
    data: object = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    settings: CheckSettings | None = None,
    allow_loss: bool = False,
    progress: Progress | None = None,
    **options: Unpack[CheckArguments],
) -> Agreement: ...
@overload
def check(
    model: ModelSource,
    *others: Carried,
    data: object = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    settings: CheckSettings | None = None,
    allow_loss: bool = False,
    progress: Progress | None = None,
    **options: Unpack[CheckArguments],
) -> Agreement | TreeAgreement: ...
def check(
    model: ModelSource,
    *others: Carried,
    data: object = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    settings: CheckSettings | None = None,
    allow_loss: bool = False,
    progress: Progress | None = None,
    **options: Unpack[CheckArguments],
) -> Agreement | TreeAgreement:
    """Compare a model with everything that is made of it, in every runtime.

    Two tree ensembles of other libraries are compared with each other: estimators of
    scikit-learn, or the paths of `.skops` and ONNX files and of models of XGBoost
    (JSON) and LightGBM (text). The result is a `TreeAgreement` then.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        others: What was shipped beside it: models, ONNX files opened or as bytes, or
            paths.
        data: A table with rows of one's own, beside the probes.
        names: What to call each of the others; its path unless given.
        runtimes: The names of the runtimes; all that are installed unless given.
        settings: How many probes, and what is accepted; see `CheckSettings`.
        allow_loss: As in `load`, for every file.
        progress: Called with what is compared next and the share that is done.
        options: Settings by name, such as `tolerance=1e-3`, which go before `settings`.

    Raises:
        TypeError: If there is no setting of a name.
        ReadError: If a file cannot be read, or holds another kind of model.
        MissingExtraError: If what runs a file is not installed.
        LossError: As `load`.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If a runtime is unknown.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> check(random_tree(1), runtimes=["native"]).ok
        True
    """
    check_arguments(check, options, CheckArguments)
    chosen = with_arguments(settings or CheckSettings(), options)
    names = as_names(names)
    trees = check_trees(model, others, data, names, runtimes, chosen.limit)
    if trees is not None:
        return trees
    first = checking.as_model(model, allow_loss=allow_loss)
    titles = [
        os.fspath(other) if isinstance(other, str | os.PathLike) else f"file {number}"
        for number, other in enumerate(others, 1)
    ]
    titles = [*names, *titles[len(names) :]][: len(others)]
    rest = [
        _program(other, chosen.run_code) or opened(other, allow_loss=allow_loss)
        for other in others
    ]

    return checking.check(
        first,
        *rest,
        data=rows_of(data, first),
        names=titles,
        runtimes=runtimes,
        limit=chosen.limit,
        rows_only=chosen.rows_only,
        terms=chosen.terms,
        tolerance=chosen.tolerance,
        progress=progress,
    )


def _program(source: Carried, may_run: bool) -> checking.ProgramFile | None:
    """Return what the path of a file that is run and not read stands for."""
    if not isinstance(source, str | os.PathLike):
        return None
    form = checking.format_of(source)
    if form.name == "fml" and b"<project xmlns=" in read_bounded(source)[:200]:
        form = find_format("structured-text")  # PLCopen XML has the suffix of FML
    if form.read is not None or form.name == "onnx":
        return None

    return checking.ProgramFile(form.name, read_bounded(source), may_run)


def certify(
    model: ModelSource,
    dtype: Dtype = "float64",
    *,
    data: object = None,
) -> numerics.Certificate:
    """Return how far a number type can take a model from its exact answers, at most.

    Args:
        model: A tree or a rule base, or the path of one.
        dtype: `float64`, `mixed` or `float32`.
        data: A table with the rows for which it shall hold; all values in the declared
            ranges of the inputs unless given.

    Raises:
        ReadError: If a file cannot be read.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If there is no such number type.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> certify(random_tree(1, combinations=0)).sentence
        'the class cannot change: no value is rounded before it meets a cut'
    """
    if dtype not in get_args(Dtype):
        known = ", ".join(get_args(Dtype))
        raise ValueError(f"there is no number type {dtype!r}; there are {known}")
    first = _model_of(model, "certify")
    return numerics.certify(first, dtype, rows_of(data, first))


def bench(
    model: ModelSource,
    *,
    data: object = None,
    select: Sequence[str] = (),
    skip: Sequence[str] = (),
    settings: benchmarking.BenchSettings | None = None,
    progress: Progress | None = None,
    **options: Unpack[BenchArguments],
) -> benchmarking.Study:
    """Measure error against run time for every way of running a model.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        data: A table with rows to time and to judge on, repeated where there are too
            few; rows are made of the model's declared ranges if None.
        select: Names of candidates, such as `native`, questions, such as `raw rules`,
            or kinds, such as `variant`: the others are left out.
        skip: The same, for what is left out.
        settings: Rows in a call, threads, the largest error allowed, and about how many
            seconds it may take, and a module with further candidates, whose code is
            run; the defaults of `BenchSettings` unless given.
        progress: Called with the current step and the share that is done.
        options: Settings by name, such as `budget_s=60`, which go before `settings`.

    Returns:
        The study. After Ctrl-C it holds what was measured by then.

    Raises:
        TypeError: If there is no setting of a name.
        ReadError: If the model cannot be read.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If a number is out of its range, or a name is unknown.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> study = bench(random_tree(1), select=["native"], rows=(9,), budget_s=9)
        >>> [point.question for point in study.points]
        ['tree', 'relative rules', 'raw rules']
    """
    check_arguments(bench, options, BenchArguments)
    plan = with_arguments(settings or benchmarking.BenchSettings(), options)
    first, path = checking.as_model(model), path_of(data)
    return benchmarking.bench(
        first,
        values=rows_of(data, first),
        data=Path(path).name if path else "the table",
        select=select,
        skip=skip,
        plan=plan,
        progress=progress,
    )


def _model_of(model: ModelSource, verb: str) -> Model:
    decider = checking.as_model(model)
    if decider.outputs:
        raise ReadError(
            f"{decider.name} is a fuzzy system, which decides for no class; "
            f"{verb} takes a tree or a rule base"
        )
    return cast("Model", decider)


def audit(
    model: ModelSource | auditing.Material,
    *,
    data: object = None,
    target: str | None = None,
    domain: auditing.AuditDomain | None = None,
    selection: auditing.AuditSelection | None = None,
    settings: auditing.AuditSettings | None = None,
    repeat: str = "",
    progress: Progress | None = None,
    **options: Unpack[AuditArguments],
) -> auditing.Audit:
    """Search a rule base for dead rules, gaps, conflicts and other findings.

    Ctrl-C ends it early and keeps what is proved; see `Audit.was_interrupted`.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one; or what
            `material` has read, and then neither data nor target.
        data: A table with rows of one's own.
        target: The column of the classes, if the table has one.
        domain: Where the model is audited; the ranges that it declares unless given.
        selection: Which findings are looked for; all unless given.
        settings: What counts as small, and the budget of time.
        repeat: The command that repeats the audit, for the answers.
        progress: Called with the current step and the share that is done.
        options: Fields of `domain`, `selection` and `settings` by name, such as
            `select=["FT1"], budget=5`, which go before these.

    Raises:
        TypeError: If there is no setting of a name.
        ReadError: If the file cannot be read.
        LossError: As `load`.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If a limit, a code or a setting is invalid, or an input has no
            limits.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> audit(random_tree(1), select=["FT501"]).is_complete
        True
    """
    check_arguments(audit, options, AuditArguments)
    chosen = with_arguments(settings or auditing.AuditSettings(), options)
    auditing.check_settings(chosen)
    where = with_arguments(domain or auditing.AuditDomain(), options)
    if not isinstance(model, auditing.Material):
        model = material(model, data=data, target=target)
    elif data is not None or target:
        raise ValueError("a material is read already: pass its data to material()")
    row = auditing.row_values(model.model, where.row) if where.row else {}
    box = auditing.domain_of(
        model.model,
        within=where.within,
        spreads=where.spreads,
        rows=model.rows,
        limited=where.limits,
        row=row,
    )
    return auditing.audit(
        model,
        domain=auditing.limit_domain(box, where.limits, model.model),
        row=row or None,
        selection=with_arguments(selection or auditing.AuditSelection(), options),
        settings=chosen,
        report=progress,
        repeat=repeat,
    )


def material(
    model: ModelSource,
    *,
    data: object = None,
    target: str | None = None,
    results: Sequence[str | os.PathLike[str]] = (),
    allow_loss: bool = False,
) -> auditing.Material:
    """Return all that an audit is about, each file read once.

    Args:
        model: As in `audit`, as all others.
        data: A table.
        target: The column of the classes.
        results: Paths of results.
        allow_loss: As in `load`.

    Raises:
        ReadError: If a file cannot be read, or a result is not of this model.
        LossError: As `load`.
        TableError: If a column is absent or holds text, the table has no row, or it
            changes while it is read.
    """
    document, file = _model_and_file(model, allow_loss)
    known = auditing.read_results(results, document)
    data, name = _readable_twice(data)
    source = _source_of(data, name)
    rows = audited_rows(data, document, target=target, name=name)
    if _source_of(data, name) != source:
        raise TableError(f"{name}: was changed while it was read")
    return auditing.Material(document, file, rows, source, known)


def _model_and_file(
    model: ModelSource, allow_loss: bool
) -> tuple[Document, auditing.ModelFile | None]:
    """Return a model, and what is known of its file if it is the path of one."""
    if not isinstance(model, str | os.PathLike):
        return checking.as_model(model), None
    checking.refuse_unreadable(checking.format_of(model), os.fspath(model))
    file = auditing.model_file(os.fspath(model), read_bounded(model))
    return checking.load_content(file.content, file.name, allow_loss=allow_loss), file


def _readable_twice(data: object) -> tuple[object, str | None]:
    """Return a table that can be hashed and then read, and its path if it has one.

    Raises:
        TableError: If it is a path that is not there, or of a folder or a device.
        ReadError: If it is a pipe of more bytes than fit.
    """
    name = path_of(data)
    if name is None:
        return data, None
    try:
        check_stream(name)
        is_pipe = stat.S_ISFIFO(Path(name).stat().st_mode)
    except (OSError, ValueError) as error:
        raise TableError(f"{name}: cannot be read: {reason(error)}") from error
    if not is_pipe:
        return data, name
    content = io.BytesIO(read_bounded(name))
    if isinstance(data, TableSource):
        return msgspec.structs.replace(data, source=content), name
    return content, name


def _source_of(data: object, name: str | None = None) -> auditing.SourceFile | None:
    """Return the name and the hash of a table that is a file, None for another."""
    table = data.source if isinstance(data, TableSource) else data
    if isinstance(table, io.BytesIO):
        return auditing.source_of(name or "standard input", table.getvalue())
    path = path_of(table)
    if path is None:
        return None
    try:
        with Path(path).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise TableError(f"{path}: cannot be read: {reason(error)}") from error
    return auditing.SourceFile(auditing.writable(path), digest)


def audited_rows(
    data: object,
    model: Document,
    *,
    target: str | None = None,
    name: str | None = None,
) -> auditing.AuditRows | None:
    """Return the rows of a table for an audit, with their classes; None without one.

    Args:
        data: A table; see `fuzzytree.tables`.
        model: Whose inputs they are for.
        target: The column of the classes. A class that the model does not know is -1.
        name: What messages call the table; its path unless given.

    Raises:
        TableError: If a column is absent or holds text, or the table has no row, or
            none of a class of the model.
    """
    if data is None:
        return None
    values, result = _rows(
        data,
        model,
        name=name,
        with_others=target is not None,
    )
    name = result[0].piece.name
    if target is None:
        return auditing.AuditRows(name, values)
    known = result[0].piece.columns
    if target not in known:
        raise TableError(
            f"{name} has no column {target!r}; {name_choice(target, known)}"
        )
    place = known.index(target)
    labels = class_names([batch.piece.cells[place] for batch in result])
    classes = model.classes
    numbers = {label: number for number, label in enumerate(classes)}
    codes = np.array([numbers.get(label or "", -1) for label in labels], np.int64)
    if classes and not np.any(codes >= 0):
        raise TableError(
            f"{name}: no row has in column {target!r} a class of the model; "
            f"{name_choice(str(labels[0]), classes)}"
        )
    return auditing.AuditRows(name, values, codes)


def diff(
    old: ModelSource,
    new: ModelSource,
    *,
    data: object = None,
    limits: auditing.Limits | None = None,
    budget: float = 60.0,
    settings: auditing.AuditSettings | None = None,
    allow_loss: bool = False,
    progress: Progress | None = None,
    **options: Unpack[DrawArguments],
) -> auditing.Difference:
    """Return what has changed from one model to another, and which decisions do.

    Args:
        old: A tree, a rule base or a fuzzy system, or the path of one.
        new: Another one, in any format.
        data: A table with rows of one's own, which both answer.
        limits: The ends of inputs, which go before the ranges of the models.
        budget: After so many million steps what is not decided stays open. A million
            is about a second of work, and the same answers on any machine.
        settings: How many points are drawn from the domain, and their seed.
        allow_loss: As in `load`, for both files.
        progress: Called with what is done and which share of it.
        options: `rows` and `seed` of the settings by name, which go before these.

    Raises:
        TypeError: If there is no setting of a name.
        ReadError: If a file cannot be read, or the two are about different inputs, or
            one gives numbers and the other decides.
        LossError: As `load`.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If a limit is none, or an input has no limits, or the budget is not
            above 0.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, combinations=0)
        >>> diff(tree, rules_from_tree(tree)).verdict
        'equal'
    """
    check_arguments(diff, options, DrawArguments)
    if not budget > 0.0:
        raise ValueError(f"the budget must be above 0 million steps, not {budget!r}")
    models, files = zip(
        *(_model_and_file(model, allow_loss) for model in (old, new)), strict=True
    )
    first, second = models
    titles = [f.name if f else m.name for f, m in zip(files, models, strict=True)]
    auditing.check_common_inputs(first, second, (titles[0], titles[1]))
    data, name = _readable_twice(data)
    source = _source_of(data, name)
    rows = None
    if data is not None:
        variables = (*first.variables, *second.variables)
        inputs = auditing.all_inputs(first, second)
        result = [*batches(data, inputs, name=name, variables=variables)]
        rows = auditing.AuditRows(result[0].piece.name, _values(result))
    return auditing.difference(
        first,
        second,
        domain=auditing.common_domain(first, second, limits or {}, rows),
        rows=rows,
        settings=with_arguments(
            settings or auditing.AuditSettings(budget=budget), options
        ),
        budget=auditing.Budget(int(min(budget, 1e9) * 1e6)),
        report=progress or auditing.silent,
        files=(files[0], files[1]),
        data=source,
    )


def require(
    model: ModelSource,
    requirements: str | os.PathLike[str] | Sequence[str] | None = None,
    *,
    that: Sequence[str] = (),
    limits: auditing.Limits | None = None,
    steps: int | None = None,
    allow_loss: bool = False,
) -> auditing.Compliance:
    """Prove or refute what a model must do.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        requirements: The path of a YAML file of requirements, or a list of sentences.
        that: More sentences, such as `class is never firm where force < 2`.
        limits: The ends of inputs, which go before the ranges of the model.
        steps: The budget of each question, in steps of about a microsecond.
        allow_loss: As in `load`.

    Raises:
        ReadError: If a file cannot be read.
        LossError: As `load`.
        ValueError: If a sentence states no requirement, or no row meets its
            conditions.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> system = random_system(1)
        >>> result = require(system, [f"{system.outputs[0].name} is at least 2"])
        >>> len(result.answers)
        1
    """
    document, file = _model_and_file(model, allow_loss)
    claims: list[auditing.Requirement] = []
    source = ""
    if isinstance(requirements, str | os.PathLike):
        source = os.fspath(requirements)
        claims += auditing.read_requirements(source, document)
    elif requirements is not None:
        that = (*requirements, *that)
    claims += [auditing.parse_requirement(text, document) for text in that]
    ends = limits or {}
    domain = auditing.domain_of(document, limited=ends)
    return auditing.comply(
        document,
        claims,
        auditing.limit_domain(domain, ends, document),
        steps=auditing.STEPS if steps is None else steps,
        title=str(file.name) if file else "",
        source=source,
    )


def needs(
    model: ModelSource,
    *,
    data: object = None,
    uses: Sequence[Use] = ("tree", "relative"),
    drop: Collection[Literal["inputs", "rules"]] = (),
    budget_s: float = 0.0,
    progress: Progress | None = None,
) -> benchmarking.Footprint:
    """Return what a model needs, and what leaving out the rest saves.

    Args:
        model: A tree, a rule base or a fuzzy system; see `as_model`.
        data: A table with rows of one's own, for the proof.
        uses: What a tree serves: its path, its `relative` rules, its `raw` rules.
        drop: Leave out `inputs` that nothing uses, or `rules` that never fire, too.
        budget_s: How long to measure run times; 0 measures none.
        progress: Called with what is done and which share of it.

    Raises:
        ReadError: If the file cannot be read.
        TableError: If a column is absent or holds text, or the table has no row.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> needs(random_tree(1)).ok
        True
    """
    first = checking.as_model(model)
    return benchmarking.report(
        first,
        semantics.pruned(
            first, uses=uses, inputs="inputs" in drop, rules="rules" in drop
        ),
        uses=uses,
        data=rows_of(data, first),
        table=data if path_of(data) else None,
        budget_s=budget_s,
        progress=progress,
    )


def explain(code: str) -> auditing.Code:
    """Return what a code of an audit means, why it matters, and what to do about it.

    Args:
        code: Such as `FT101`, or the id of a finding, such as `FT101-1a2b3c4d`.

    Raises:
        ValueError: If there is no such code.
        TypeError: If it is no text.

    Example:
        >>> explain("FT101").title
        'dead rule'
    """
    if not isinstance(code, str):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(
            f"explain takes a code such as 'FT101', and not a {type(code).__name__}"
        )
    name = code.upper().partition("-")[0]
    if name not in auditing.CODES:
        choice = name_choice(name[:40], [*auditing.CODES])
        raise ValueError(f"no code {code[:40]!r}; {choice}")
    return auditing.CODES[name]


def recheck(
    audit: str | os.PathLike[str],
    model: str | os.PathLike[str],
    *,
    new: str | os.PathLike[str] | None = None,
    solver: str = "",
) -> Report:
    """Check the JSON file of an audit against the file of its model, on its own.

    With `new`, it is the JSON file of a comparison of `model` with this other model.
    The re-checker reads YAML; any other file is checked as the YAML that is made of it.
    `solver` is the program that decides what is PROVED; the package z3 by default.

    The report's `wrong` lists what does not hold; `lines()` is what the command prints.

    Raises:
        ReadError: If one of the files cannot be read, or the solver fails.
    """
    from fuzzytree.rechecking import CannotRunError, recheck_files

    names = [os.fspath(path) for path in (audit, model, new) if path is not None]
    try:
        return recheck_files(*names, solver=solver)
    except CannotRunError as error:
        report = None if new else _recheck_conversion(names[0], names[1], solver)
        if report is None:
            raise ReadError(str(error)) from error
        return report


def _recheck_conversion(audit: str, path: str, solver: str) -> Report | None:
    """Check an audit against the YAML of a file that the re-checker does not read."""
    from fuzzytree.rechecking import CannotRunError, read_json, read_yaml, recheck

    source = read_bounded(path)
    with suppress(CannotRunError):
        if checking.format_of(path).name == "yaml" and read_yaml(source, path):
            return None
    content, model = read_bounded(audit), read(path).model
    try:
        if read_json(content, audit).get("fingerprint") != fingerprint(model):
            raise ReadError(f"{path}: not the audited model, or read by another --from")
        text = find_format("yaml").write(model).content
        return recheck(content, text, (audit, path), solver, source)
    except CannotRunError as error:
        raise ReadError(str(error)) from error


def draw(
    model: ModelSource,
    *,
    title: str | None = None,
    row: Mapping[str, float | str] | None = None,
    surface: Sequence[str] | None = None,
) -> Picture:
    """Draw a tree, the terms of a model, its rules for a row, or a surface.

    Args:
        model: A tree, a fitted classifier, a rule base or a fuzzy system, or the path
            of one. A tree is drawn with the terms of its branches and the rows of each
            box; of the others the terms of all variables are drawn.
        title: Above the picture; the name of the model unless given.
        row: The value of each input, a text in the words of the table: what each rule
            makes of the row is drawn.
        surface: Two inputs of numbers: the class or the outputs over both. Other inputs
            have the values of `row`, where it has them, or else what stands for missing
            values, or the middle of their ranges, as the picture says.

    Returns:
        A picture, which a notebook shows; `picture.save("tree.svg")` writes it.

    Raises:
        ReadError: If the file cannot be read.
        ValueError: If the model is too large for a picture, the row does not fit, or
            there is no such surface.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2)
        >>> "strength 1:" in draw(tree, row=dict.fromkeys(tree.inputs, 0.0)).svg
        True
    """
    document = checking.as_model(model)
    return report.draw_model(document, title=title, row=row, surface=surface)


def export_text(model: ModelSource) -> str:
    """Return a model as text, as the command `show` prints it.

    Args:
        model: A tree, a fitted classifier, a rule base or a fuzzy system, or the path
            of one.

    Raises:
        ReadError: If the file cannot be read.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(export_text(random_tree(1, leaves=2))[:43])
        random 2: fuzzy tree, 1 node, 2 leaves, dep
    """
    return "\n".join(report.model_lines(checking.as_model(model)))


def draw_reliability(
    probabilities: FloatArray,
    labels: Sequence[object] | npt.NDArray[np.generic],
    *,
    classes: Sequence[object] | npt.NDArray[np.generic] | None = None,
    title: str = "",
) -> Picture:
    """Draw how often the likeliest class is right, over its probability.

    Args:
        probabilities: Shape (rows, classes), as `predict_proba` returns them.
        labels: The class of each row.
        classes: The class of each column; 0, 1, 2, ... unless given.
        title: Above the picture.

    Returns:
        A picture, which a notebook shows; `picture.save("reliability.svg")` writes it.

    Raises:
        ValueError: If the shapes do not fit, there is no row, or a label is no class.

    Example:
        >>> shares = np.array([[0.9, 0.1], [0.2, 0.8]])
        >>> picture = draw_reliability(shares, ["no", "yes"], classes=["no", "yes"])
        >>> "log-loss 0.164" in picture.svg
        True
    """
    columns = range(probabilities.shape[1]) if classes is None else classes
    known = {label: code for code, label in enumerate(np.asarray(columns).tolist())}
    rows = np.asarray(labels).tolist()
    for label in rows:
        if label not in known:
            raise ValueError(f"label {label!r} is none of the classes {[*known]}")
    codes = np.array([known[label] for label in rows], np.int64)
    return report.draw_reliability(probabilities, codes, title=title)


def stability(
    model: ModelSource,
    *,
    data: object = None,
    select: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> checking.Stability:
    """Apply the criteria N1 to N10 to a model: is it numerically stable?

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        data: A table with rows of one's own, beside the probes.
        select: The codes of criteria, such as `N3`; all unless given.
        runtimes: The names of the runtimes; all that are installed unless given.
        progress: Called with what is done and which share of it.

    Raises:
        ReadError: If the file cannot be read.
        TableError: If a column is absent or holds text, or the table has no row.
        ValueError: If a criterion or a runtime is unknown.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> stability(random_tree(1), runtimes=["native"], select=["N3", "N7"]).ok
        True
    """
    first = checking.as_model(model)
    chosen = chosen_runtimes(runtimes)
    return checking.examine(
        first,
        runtimes=chosen,
        formats=all_formats(),
        data=rows_of(data, first),
        select=select,
        progress=progress or (lambda _text, _share: None),
    )

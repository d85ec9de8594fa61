"""Our own ways of running a model: every runtime, every form of the model."""

from __future__ import annotations

import difflib
import functools
import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, get_args

import numpy as np
from msgspec.structs import replace

from fuzzytree.benchmarking.judging import MOST_ROWS, output_bound
from fuzzytree.benchmarking.records import (
    Bound,
    Candidate,
    CandidateOutput,
    Kind,
    LoadedCandidate,
    Omission,
    Question,
)
from fuzzytree.errors import install_hint
from fuzzytree.model import (
    LR,
    Document,
    Dtype,
    FuzzySystem,
    Outcome,
    Prepared,
    Runtime,
    kind_of,
)
from fuzzytree.numerics import ApproximateRules, by_degree, by_points, certify
from fuzzytree.runtimes import (
    Predictions,
    all_runtimes,
    answers_of,
    is_installed,
    needed_by,
)
from fuzzytree.semantics import forms

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray

Bounds = Callable[[Document, Dtype], Bound | None]
"""The certified error of strengths or outputs in a number type, if there is one."""

Candidates = tuple[list[Candidate], list[Omission]]
"""What can be measured, and what cannot be, each with its reason."""

_BLOCK_NUMBERS = 1 << 25  # strengths that a call of the native runtime makes at once
_BLOCK = 1 << 16


@functools.lru_cache(maxsize=1)
def questions(model: Document) -> Mapping[Question, Document]:
    """Return the questions that a model answers, each with its form.

    The raw rules of a large tree take seconds to make: so they are kept.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> list(questions(random_tree(1)))
        ['tree', 'relative rules', 'raw rules']
    """
    return MappingProxyType(forms(model))


def title(runtime: str, question: Question) -> str:
    """Return the name of a candidate, such as `native: tree`."""
    return f"{runtime}: {question}"


class Layouts:
    """Tables as sessions take them: made once for all candidates that share them.

    A million rows of many columns would else lie in memory once for each candidate.
    """

    def __init__(self) -> None:
        self._values: FloatArray | None = None
        self._tables: dict[Dtype, npt.NDArray[np.generic]] = {}

    def table(self, values: FloatArray, prepared: Prepared) -> npt.NDArray[np.generic]:
        """Return the table of a graph whose columns are the model's inputs."""
        if values is not self._values:
            self._values, self._tables = values, {}
        key: Dtype = "float32" if prepared.dtype == "float32" else "float64"
        if key not in self._tables:
            self._tables[key] = prepared.table(values)
        return self._tables[key]


def own(model: Document, bounds: Bounds, layouts: Layouts) -> Candidates:
    """Return a candidate for each runtime and each question that it can answer.

    `bounds` certifies the strengths of a rule base; sessions share their tables in
    `layouts`. What is not installed is omitted.
    """
    runtimes = all_runtimes()
    omitted = [
        Omission(one.name, f"not installed ({needed_by(one)})")
        for one in runtimes
        if not is_installed(one)
    ]
    candidates = [
        Candidate(
            title(runtime.name, question),
            question,
            "runtime",
            partial(load_runtime, runtime, form, layouts),
            bound=partial(_bound, runtime, form, bounds),
            note=runtime.note,
            modules=runtime.modules,
            is_parallel=runtime.prepare is not None,
        )
        for runtime in runtimes
        if is_installed(runtime)
        for question, form in questions(model).items()
        if kind_of(form) in runtime.runs
    ]
    return candidates, omitted


def _bound(runtime: Runtime, model: Document, bounds: Bounds) -> Bound | None:
    """Return a certified bound of what a runtime decides by, or answers."""
    if not model.rules:
        return None
    certified = bounds(model, runtime.dtype)
    if runtime.bound is None or certified is None:
        return certified
    try:
        more, origin = runtime.bound(model)
    except ValueError:  # it cannot carry the model, as loading it will say
        return None
    return certified[0] + more, f"{certified[1]}, and {origin}"


def load_runtime(
    runtime: Runtime, model: Document, layouts: Layouts, threads: int
) -> LoadedCandidate:
    """Prepare a model in a runtime of the table.

    Of a graph only the session's call is timed. Others take the rows as they are;
    those of a rule base go through in blocks, whose strengths are thrown away: a
    million rows and a thousand rules would make 8 GB of them.
    """
    if runtime.prepare is not None:
        graph = runtime.prepare(model, threads=threads)
        return LoadedCandidate(
            partial(_found, graph.run, model),
            lambda values: partial(graph.call, layouts.table(values, graph)),
            len(graph.content),
        )
    run = runtime.load(model, with_strengths=not model.outputs)
    fired = () if model.outputs else model.rules
    block = max(1, min(_BLOCK, _BLOCK_NUMBERS // max(len(fired), 1)))

    def call(values: FloatArray) -> Callable[[], object]:
        if not fired or values.shape[1] <= block:
            return partial(run, values)
        starts = range(0, values.shape[1], block)
        parts = [values[:, start : start + block] for start in starts]
        return partial(_each, run, parts)

    size = None if runtime.size is None else runtime.size(model)
    return LoadedCandidate(partial(_found, run, model), call, size)


def _each(run: Callable[[FloatArray], object], parts: Sequence[FloatArray]) -> None:
    for part in parts:
        run(part)


def _found(
    run: Callable[[FloatArray], Outcome], model: Document, values: FloatArray
) -> CandidateOutput:
    return found_of(run(np.ascontiguousarray(values)), model)


def found_of(outcome: Outcome, model: Document) -> CandidateOutput:
    """Return a runtime's outcome as class numbers and strengths, or as outputs."""
    answers = answers_of(outcome, model)
    if isinstance(answers, Predictions):
        return CandidateOutput(answers.codes, outcome.strengths)
    return CandidateOutput(outcome.status, None, outcome.outputs)


_GRAPHS = ("onnx", "onnxruntime")
READING = "floor: the columns read once"
SESSION = "floor: an empty session call"


def floors(question: Question) -> Candidates:
    """Return the floors; they answer nothing and have no error.

    They are listed under the `question`.

    Example:
        >>> found, omitted = floors("tree")
        >>> found[0].name
        'floor: the columns read once'
    """
    candidates = [
        Candidate(
            READING, question, "floor", _load_reading, note="the sum of each column"
        )
    ]
    if not all(map(importlib.util.find_spec, _GRAPHS)):
        return candidates, [
            Omission(SESSION, f"not installed ({install_hint('onnx')})")
        ]
    note = "onnxruntime hands the same table back"
    session = Candidate(
        SESSION, question, "floor", _load_session, note=note, modules=_GRAPHS
    )
    return [*candidates, session], []


def _nothing(values: FloatArray) -> CandidateOutput:
    return CandidateOutput(np.full(values.shape[1], -1))


def _load_reading(threads: int) -> LoadedCandidate:
    return LoadedCandidate(_nothing, lambda values: partial(values.sum, axis=1))


def _load_session(threads: int) -> LoadedCandidate:
    from onnx import TensorProto, helper

    from fuzzytree.exporters import open_bare

    shapes = [
        helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["rows", "columns"])
        for name in ("inputs", "same")
    ]
    node = helper.make_node("Identity", ["inputs"], ["same"])
    graph = helper.make_graph([node], "empty", shapes[:1], shapes[1:])
    imports = [helper.make_opsetid("", 17)]
    proto = helper.make_model(graph, ir_version=8, opset_imports=imports)
    content = proto.SerializeToString()
    bare = open_bare(content, threads)

    def call(values: FloatArray) -> Callable[[], object]:
        table = np.ascontiguousarray(values.T)
        return partial(bare, ["same"], {"inputs": table})

    return LoadedCandidate(_nothing, call, len(content))


TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Of a degree, where curves become points."""

_MOST_TERMS = 400  # their points take seconds

SAMPLES = (100, 50, 20, 10)
"""At how many values a cheaper system looks at the curves of its outputs."""

Make = Callable[[], tuple[Document, Bound | None]]
"""Makes a cheaper model, with the bound of its difference where one is known."""


def variants(model: Document, bounds: Bounds, layouts: Layouts) -> Candidates:
    """Return the variants of each rule base that a model gives, or of a system.

    The arguments are those of `own`. A candidate's bound is known once it is loaded;
    what has too many terms is omitted. An approximation is made when it is first used.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> found, _ = variants(random_tree(1), lambda rules, dtype: None, Layouts())
        >>> found[0].name
        'native, points 1e-01: raw rules'
    """
    candidates: list[Candidate] = []
    omitted: list[Omission] = []
    runtimes = [one for one in all_runtimes() if one.in_variants and is_installed(one)]
    for question, form in questions(model).items():
        makers: Mapping[str, Make] = {}
        if form.outputs:
            makers = _fewer_samples(form)
        elif form.rules:
            terms = sum(len(variable.terms) for variable in form.variables)
            if terms > _MOST_TERMS:
                why = f"{terms:,} terms, and {_MOST_TERMS} are the most to approximate"
                omitted.append(Omission(f"variants: {question}", why))
                continue
            makers = _makers(form)
        for what, make in makers.items():
            candidates += (
                Candidate(
                    title(f"{runtime.name}, {what}", question),
                    question,
                    "variant",
                    partial(_load, runtime, functools.cache(make), bounds, layouts),
                    is_parallel=runtime.prepare is not None,
                )
                for runtime in runtimes
            )
    return candidates, omitted


def _makers(rules: Document) -> dict[str, Make]:
    """Return what makes each variant: points, and degrees below the largest there is.

    Without curves there is nothing to approximate.
    """
    largest = _largest_degree(rules)
    makers: dict[str, Make] = {}
    if largest:
        for tolerance in TOLERANCES:
            make = partial(_approximate, by_points, rules, tolerance)
            makers[f"points {tolerance:.0e}"] = make
    for degree in range(1, largest):
        makers[f"degree {degree}"] = partial(_approximate, by_degree, rules, degree)
    return makers


def _approximate(
    change: Callable[..., ApproximateRules], rules: Document, size: float
) -> tuple[Document, Bound | None]:
    changed = change(rules, size)
    return changed.model, (changed.bound, changed.origin)


def _fewer_samples(system: Document) -> dict[str, Make]:
    """Return what makes a system look at the curves of its outputs at fewer values."""
    ways = [one.defuzzifier for one in system.outputs]
    most = max((one.samples for one in ways if not one.is_weighted), default=0)
    return {
        f"{count} samples": partial(_with_samples, system, count)
        for count in SAMPLES
        if count < most
    }


def _with_samples(system: Document, count: int) -> tuple[Document, Bound | None]:
    outputs = [*system.outputs]
    for line, output in enumerate(outputs):
        way = output.defuzzifier
        fewer = replace(way, samples=min(way.samples, count))
        outputs[line] = replace(output, defuzzifier=fewer)
    return replace(system, outputs=tuple(outputs)), None


def _largest_degree(rules: Document) -> int:
    shapes = [term.shape for variable in rules.variables for term in variable.terms]
    sets = [shape for shape in shapes if isinstance(shape, LR)]
    sides = [side for shape in sets for side in (shape.left, shape.right)]
    return max((len(side.curve) for side in sides), default=0)


def _load(
    runtime: Runtime,
    make: Make,
    bounds: Bounds,
    layouts: Layouts,
    threads: int,
) -> LoadedCandidate:
    model, difference = make()
    loaded = load_runtime(runtime, model, layouts, threads)

    def bound() -> Bound | None:
        certified = bounds(model, runtime.dtype) if difference else None
        if not (certified and difference):
            return None
        largest = min(difference[0] + certified[0], 1.0)
        return largest, f"{difference[1]}, and {certified[1]}"

    return replace(loaded, bound=bound)


Peers = Callable[[Document, Bounds], Candidates]
"""Returns candidates of third-party libraries for a model."""

_GROUPS = (*get_args(Question), *get_args(Kind))
_MOST_DEGREES = 10_000_000  # whose errors are bounded in about a second


def gather(model: Document, values: FloatArray, peers: str | None = None) -> Candidates:
    """Return every candidate for a model, and what cannot be one.

    Certified bounds hold on the `values`, or on the first of them where the model is
    large; for `peers` see `load_peers`.
    """
    layouts = Layouts()
    main = next(iter(questions(model)))
    measures, omitted = floors(main)
    bounds = _bounds(values)
    mine, absent = own(model, bounds, layouts)
    others, missing = load_peers(peers)(model, bounds)
    missing = [replace(one, is_peer=True) for one in missing]
    changed, left = variants(model, bounds, layouts)
    return [*measures, *mine, *others, *changed], [*omitted, *absent, *missing, *left]


def load_peers(path: str | None) -> Peers:
    """Run a Python module or package and return its function `peers`.

    The function takes a model and a function that certifies the error of its strengths
    in a number type. It returns further candidates, and omissions with their reasons.

    The `path` is a module's file or a package's folder; None gives no candidates.

    Raises:
        ValueError: If there is no such module, it cannot be run or has no function
            `peers`, or another module of its name is loaded.
    """
    if path is None:
        return lambda _model, _bounds: ([], [])
    folder = Path(path).resolve()
    file = folder / "__init__.py" if folder.is_dir() else folder
    spec = spec_from_file_location(folder.stem, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise ValueError(f"peers: {path!r} is not a Python module or package")
    module = sys.modules.get(spec.name)
    if module is None:
        module = sys.modules[spec.name] = module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # whatever the user's code raises
            del sys.modules[spec.name]
            raise ValueError(f"peers: {path!r} cannot be run: {error}") from error
    elif getattr(module, "__file__", None) != str(file):
        raise ValueError(
            f"peers: another module {spec.name!r} is loaded; rename {path!r}"
        )
    peers: Peers | None = getattr(module, "peers", None)
    if peers is None:
        raise ValueError(f"peers: {path!r} has no function 'peers'")
    return peers


def chosen(
    candidates: Sequence[Candidate], select: Sequence[str], skip: Sequence[str]
) -> tuple[list[Candidate], list[Omission]]:
    """Return the candidates that are wanted, and a line about the others.

    `select` and `skip` have names, parts before the colon, questions or kinds.

    Raises:
        ValueError: If a word names nothing that could be there, or nothing is left;
            the message lists what there is.
    """
    known = set().union(_GROUPS, *map(_words, candidates))
    for word in (*select, *skip):
        if word not in known:
            raise ValueError(_unknown(word, candidates))
    kept = [
        one
        for one in candidates
        if (not select or not _words(one).isdisjoint(select))
        and _words(one).isdisjoint(skip)
    ]
    if not kept:
        raise ValueError("no candidate is left to measure")
    left = len(candidates) - len(kept)
    name = f"{left} candidate{'' if left == 1 else 's'}"
    return kept, [Omission(name, "not selected")] if left else []


def _unknown(word: str, candidates: Sequence[Candidate]) -> str:
    """Say what there is, without the variants of each number, and what was meant."""
    names = [_short(one) for one in candidates if one.kind != "variant"]
    groups = [group for one in candidates for group in _groups(one)]
    known = [*dict.fromkeys((*names, *groups))]
    close = difflib.get_close_matches(word, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return (
        f"no candidate {word!r}; there is {', '.join(dict.fromkeys(names))}, "
        f"or all of {', '.join(dict.fromkeys(groups))}{hint}"
    )


def _words(one: Candidate) -> set[str]:
    return {one.name, _short(one), *_groups(one)}


def _short(one: Candidate) -> str:
    return one.name.removesuffix(f": {one.question}")


def _groups(one: Candidate) -> tuple[str, str]:
    return one.question, one.kind


def _bounds(values: FloatArray) -> Bounds:
    """Return what certifies rule bases on these rows, each but once.

    Of many terms only the first rows are certified, which the bound's origin counts;
    candidates are judged on fewer.
    """

    @functools.cache
    def bounds(rules: Document, dtype: Dtype) -> Bound | None:
        if isinstance(rules, FuzzySystem):
            return output_bound(rules, values) if dtype == "float64" else None
        terms = sum(len(variable.terms) for variable in rules.variables)
        rows = max(_MOST_DEGREES // max(terms, 1), MOST_ROWS)
        certificate = certify(rules, dtype, values[:, :rows])
        if certificate.unbounded or certificate.delta is None:
            return None
        return certificate.delta, certificate.origin

    return bounds

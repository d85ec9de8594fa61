"""Peers that run fuzzy systems: engines of others, each with the system as it has it.

fuzzylite reads the system as FLL; the others have it built from their own parts. Their
own answers are compared with ours: an engine that answers otherwise is shown with its
error. What an engine has no word for is refused. Rows with missing values are answered
by us, as engines raise errors there or know none.
"""

from __future__ import annotations

import ctypes
import itertools
import subprocess
import tempfile
from contextlib import redirect_stdout
from functools import cache, partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from fuzzytree.benchmarking.records import CandidateOutput, LoadedCandidate
from fuzzytree.errors import LossError
from fuzzytree.exporters import find_format
from fuzzytree.model.curves import (
    Bell,
    Curve,
    Gaussian,
    Linear,
    Sigmoid,
    Singleton,
    Trapezoid,
)
from fuzzytree.model.functions import Points
from fuzzytree.model.rules import And, Condition, Not, Or, Proposition
from fuzzytree.model.system import FuzzySystem, SystemOutput
from fuzzytree.model.variables import Variable
from fuzzytree.semantics.inference import curve_degree

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from fuzzytree.model.contracts import FloatArray

    Infer = Callable[[FloatArray], FloatArray]
    """Outputs, a line each, of finite values of shape (inputs, rows)."""

Word = TypeVar("Word")

_COMPILE_S = 40.0
_POINTS = 257  # of a curve that an engine does not have
_GRID = 1001  # values of an input at which scikit-fuzzy has the degrees


class Words(NamedTuple):
    """How an engine spells the condition of a rule."""

    both: str
    either: str
    negation: str
    proposition: str
    denial: str


def load_fuzzylite(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare a pyfuzzylite engine that reads the system as FLL.

    Raises:
        LossError: If FLL cannot carry the system.
    """
    import fuzzylite as fl

    text = find_format("fll").write(system).content.decode("utf-8")
    engine = fl.FllImporter().from_string(text)

    def infer(values: FloatArray) -> FloatArray:
        engine.restart()
        for variable, column in zip(engine.input_variables, values, strict=True):
            variable.value = column
        with np.errstate(all="ignore"):
            engine.process()
        lines = [variable.value for variable in engine.output_variables]
        return _lines(lines, values.shape[1])

    return _loaded(system, infer, len(text))


def load_fuzzylite_cpp(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare fuzzylite's engine in C++, which loops over the rows itself.

    Raises:
        LossError: If FLL cannot carry the system, g++ cannot compile the loop, or the
            engine does not read the file.
    """
    content = find_format("fll").write(system).content
    library = _library()
    handle = library.open_engine(content)
    if not handle:
        raise LossError(f"fuzzylite does not read {system.name} as FLL")

    def infer(values: FloatArray) -> FloatArray:
        table = np.ascontiguousarray(values)
        outputs = np.empty((len(system.outputs), values.shape[1]))
        library.infer(handle, table.ctypes.data, table.shape[1], outputs.ctypes.data)
        return outputs

    return _loaded(system, infer, len(content))


@cache
def _library() -> ctypes.CDLL:
    source = Path(__file__).with_name("fuzzylite.cpp")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "fuzzylite_loop.so")
        words = ["g++", "-O2", "-w", "-shared", "-fPIC", str(source), "-o", str(target)]
        try:
            subprocess.run(
                [*words, "-lfuzzylite"],
                check=True,
                capture_output=True,
                text=True,
                timeout=_COMPILE_S,
            )
        except subprocess.TimeoutExpired as error:
            why = f"g++ did not compile it within {_COMPILE_S:g} s"
            raise LossError(why) from error
        except subprocess.CalledProcessError as error:
            first = (error.stderr.strip().splitlines() or ["no reason given"])[0]
            raise LossError(f"g++ does not compile it: {first}") from error
        library = ctypes.CDLL(str(target))
    library.open_engine.argtypes = (ctypes.c_char_p,)
    library.open_engine.restype = ctypes.c_void_p
    address = ctypes.c_void_p
    library.infer.argtypes = (address, address, ctypes.c_long, address)
    library.infer.restype = None
    return library


def load_ferrifuzz(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare a ferrifuzz system; it answers on all cores.

    Raises:
        LossError: If it has no word for a part of the system.
    """
    import ferrifuzz as ff

    method, samples = _defuzzifier(
        system,
        "ferrifuzz",
        {"weighted average": "weighted_average", "centroid": "centroid"},
    )
    both = {"minimum": "min", "product": "product", None: "min"}
    either = {"maximum": "max", "algebraic sum": "probor", None: "max"}
    conjunction, disjunction = _operators(system, "ferrifuzz", both, either)
    made = ff.FuzzySystem(
        and_method=conjunction,
        or_method=disjunction,
        defuzz_method=method,
        resolution=samples,
        clamp_inputs=False,
    )
    for variable in system.all_variables:
        low, high = _range(variable)
        other = ff.Variable(variable.name, low, high)
        for term in variable.terms:
            if not isinstance(term.function, Linear):
                other[term.name] = _ferrifuzz_curve(ff, term.function, low, high)
        if isinstance(variable, SystemOutput):
            made.add_output(other)
            for term in variable.terms:
                if isinstance(term.function, Linear):
                    weights = dict(
                        zip(system.inputs, term.function.weights, strict=True)
                    )
                    made.add_consequent(
                        variable.name, term.name, weights, term.function.offset
                    )
        else:
            made.add_input(other)
    words = Words(" AND ", " OR ", "NOT ({})", "{} IS {}", "{} IS NOT {}")
    made.add_rules([*_sentences(system, "ferrifuzz", words)])

    def infer(values: FloatArray) -> FloatArray:
        answers = made.compute_batch(dict(zip(system.inputs, values, strict=True)))
        lines = [answers[output.name] for output in system.outputs]
        return _lines(lines, values.shape[1])

    return _loaded(system, infer)


def _ferrifuzz_curve(ff: Any, curve: Curve, low: float, high: float) -> Any:
    match curve:
        case Gaussian(mean=mean, deviation=deviation):
            return ff.mf.gaussian(mean, deviation)
        case Bell(center=center, width=width, slope=slope):
            return ff.mf.bell(center, width, slope)
        case Sigmoid(inflection=inflection, slope=slope):
            return ff.mf.sigmoid(inflection, slope)
        case Singleton(value=value):
            return ff.mf.singleton(value)
        case Trapezoid():
            return ff.mf.trapezoid(*_corners(curve, low, high))
        case Points(degrees=(0.0, 1.0), values=(a, b)):
            return ff.mf.trapezoid(*_corners(Trapezoid(a, b, b, None), low, high))
        case Points(degrees=(1.0, 0.0), values=(c, d)):
            return ff.mf.trapezoid(*_corners(Trapezoid(None, c, c, d), low, high))
        case _:
            raise LossError(f"ferrifuzz has no {type(curve).__name__}")


def load_simpful(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare a simpful system; it answers one row after another.

    Curves that it does not have are points joined by lines.

    Raises:
        LossError: If it has no word for a part of the system.
    """
    import simpful as sf

    methods = {"weighted average": "Sugeno", "centroid": "Mamdani"}
    method, samples = _defuzzifier(system, "simpful", methods)
    both: dict[Any, str | None] = {
        "minimum": None,
        "product": "AND_PRODUCT",
        None: None,
    }
    either: dict[Any, str | None] = {"maximum": None, None: None}
    operators = [word for word in _operators(system, "simpful", both, either) if word]
    made = sf.FuzzySystem(operators=operators or None, show_banner=False, verbose=False)
    is_sugeno = method == "Sugeno"
    for variable in system.variables if is_sugeno else system.all_variables:
        low, high = _range(variable)
        sets = [
            _simpful_set(sf, term.function, term.name, low, high)
            for term in variable.terms
        ]
        other = sf.LinguisticVariable(sets, universe_of_discourse=[low, high])
        made.add_linguistic_variable(variable.name, other)
    names = [term.name for output in system.outputs for term in output.terms]
    if is_sugeno and len({*names}) < len(names):
        raise LossError("simpful's numbers have one name for all outputs")
    words = Words(" AND ", " OR ", "(NOT {})", "({} IS {})", "((NOT ({} IS {})))")
    with redirect_stdout(StringIO()):  # it prints which type it detected
        for output in system.outputs if is_sugeno else ():
            for term in output.terms:
                match term.function:
                    case Singleton(value=value):
                        made.set_crisp_output_value(term.name, value, verbose=False)
                    case Linear(weights=weights, offset=offset):
                        parts = zip(system.inputs, weights, strict=True)
                        text = "+".join(f"{weight!r}*{name}" for name, weight in parts)
                        text = f"{text}+{offset!r}"
                        made.set_output_function(term.name, text, verbose=False)
                    case _:
                        raise LossError("simpful's Sugeno rules conclude numbers alone")
        made.add_rules([*_sentences(system, "simpful", words)], verbose=False)
    names = [output.name for output in system.outputs]

    def single(row: list[float]) -> list[float]:
        for name, value in zip(system.inputs, row, strict=True):
            made.set_variable(name, value)
        if is_sugeno:
            answers = made.Sugeno_inference(names, ignore_warnings=True)
        else:
            answers = made.Mamdani_inference(
                names, subdivisions=samples, ignore_warnings=True
            )
        return [answers[name] for name in names]

    def infer(values: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            rows = [single(row) for row in values.T.tolist()]
        return np.array(rows, np.float64).reshape(-1, len(names)).T

    return _loaded(system, infer)


def _simpful_set(sf: Any, curve: Curve, name: str, low: float, high: float) -> Any:
    if isinstance(curve, Gaussian):
        return sf.GaussianFuzzySet(curve.mean, curve.deviation, name)
    if isinstance(curve, Trapezoid):
        a, b, c, d = _corners(curve, low, high)
        points = [[a, 0.0], [b, 1.0], [c, 1.0], [d, 0.0]]
        points = points[1:] if a == b else points
        points = points[:-1] if c == d else points
    elif isinstance(curve, Points):
        points = [[x, y] for x, y in zip(curve.values, curve.degrees, strict=True)]
    else:
        values = np.linspace(low, high, _POINTS).tolist()
        points = [[x, curve_degree(curve, x)] for x in values]
    points = [point for point, _ in itertools.groupby(points)]  # a peak stands once
    return sf.FuzzySet(points=points, term=name)


def load_scikit_fuzzy(system: FuzzySystem, threads: int) -> LoadedCandidate:
    """Prepare a control system of scikit-fuzzy, whose curves are arrays of degrees.

    It has no weighted average: numbers become spikes, of which it takes the centroid.

    Raises:
        LossError: If it has no word for a part of the system.
    """
    from skfuzzy import control

    method, samples = _defuzzifier(
        system,
        "scikit-fuzzy",
        {
            "weighted average": "centroid",
            "centroid": "centroid",
            "bisector": "bisector",
            "mean of maximum": "mom",
            "smallest of maximum": "som",
            "largest of maximum": "lom",
        },
    )
    both: dict[Any, Any] = {"minimum": np.fmin, "product": np.multiply, None: np.fmin}
    either: dict[Any, Any] = {"maximum": np.fmax, None: np.fmax}
    conjunction, disjunction = _operators(system, "scikit-fuzzy", both, either)
    variables: dict[str, Any] = {}
    for variable in system.all_variables:
        low, high = _range(variable)
        curves = [term.function for term in variable.terms]
        knots = [x for curve in curves for x in curve.knots() if low <= x <= high]
        if isinstance(variable, SystemOutput):
            grid = np.union1d(np.linspace(low, high, samples), knots)
            other = control.Consequent(grid, variable.name, defuzzify_method=method)
        else:
            grid = np.union1d(np.linspace(low, high, _GRID), knots)
            other = control.Antecedent(grid, variable.name)
        for term in variable.terms:
            degrees = [curve_degree(term.function, x) for x in grid.tolist()]
            other[term.name] = np.array(degrees)
        variables[variable.name] = other
    rules = [
        control.Rule(
            _scikit_fuzzy_condition(rule.when, variables),
            [variables[one.output][one.term] % rule.weight for one in rule.then],
            and_func=conjunction,
            or_func=disjunction,
        )
        for rule in system.rules
    ]
    whole = control.ControlSystem(rules)
    used = {antecedent.label for antecedent in whole.antecedents}

    @cache
    def simulation_of(rows: int) -> Any:
        """Return one for so many rows: it warns where their number changes."""
        return control.ControlSystemSimulation(whole)

    def infer(values: FloatArray) -> FloatArray:
        simulation = simulation_of(values.shape[1])
        for name, column in zip(system.inputs, values, strict=True):
            if name in used:
                simulation.input[name] = column
        simulation.compute()
        lines = [simulation.output[output.name] for output in system.outputs]
        simulation.reset()
        return _lines(lines, values.shape[1])

    return _loaded(system, infer)


def _scikit_fuzzy_condition(
    condition: Condition | None, variables: dict[str, Any]
) -> Any:
    match condition:
        case Proposition(hedges=("not",)):
            return ~variables[condition.variable][condition.term]
        case Proposition(hedges=()):
            return variables[condition.variable][condition.term]
        case Not(part=part):
            return ~_scikit_fuzzy_condition(part, variables)
        case And(parts=parts) | Or(parts=parts):
            terms = [_scikit_fuzzy_condition(part, variables) for part in parts]
            whole = terms[0]
            for term in terms[1:]:
                whole = whole & term if isinstance(condition, And) else whole | term
            return whole
        case _:
            raise LossError("scikit-fuzzy has no such condition")


def _loaded(
    system: FuzzySystem, infer: Infer, size: int | None = None
) -> LoadedCandidate:
    """Return an engine that answers finite rows, and gives no status."""

    def answer(values: FloatArray) -> CandidateOutput:
        is_known = np.isfinite(values).all(axis=0)
        outputs = np.full((len(system.outputs), values.shape[1]), np.nan)
        if is_known.any():
            outputs[:, is_known] = infer(np.ascontiguousarray(values[:, is_known]))
        return CandidateOutput(np.full(values.shape[1], -1), None, outputs)

    def call(values: FloatArray) -> Callable[[], object]:
        return partial(infer, values)

    return LoadedCandidate(answer, call, size)


def _lines(lines: list[Any], rows: int) -> FloatArray:
    """Return the numbers of outputs; one for all rows where an engine gives one."""
    flat = [np.broadcast_to(np.ravel(line), rows) for line in lines]
    return np.array(flat, np.float64)


def _defuzzifier(
    system: FuzzySystem, peer: str, methods: dict[str, str]
) -> tuple[str, int]:
    """Return the engine's word for the method of all outputs, and the samples."""
    known = {(o.defuzzifier.method, o.defuzzifier.samples) for o in system.outputs}
    if len(known) > 1:
        raise LossError(f"{peer} has one defuzzifier for all outputs")
    ((method, samples),) = known
    if method not in methods:
        raise LossError(f"{peer} has no {method}")
    bent = {o.aggregation for o in system.outputs if not o.defuzzifier.is_weighted}
    if bent - {"maximum"}:
        raise LossError(f"{peer} aggregates by the maximum")
    return methods[method], samples


def _operators(
    system: FuzzySystem,
    peer: str,
    both: Mapping[Any, Word],
    either: Mapping[Any, Word],
) -> tuple[Word, Word]:
    """Return the engine's AND and OR, the same in all blocks of rules."""
    for block in system.blocks:
        for word in (block.conjunction, block.disjunction):
            if word not in both and word not in either:
                raise LossError(f"{peer} has no {word}")
        if block.implication not in (None, "minimum"):
            raise LossError(f"{peer} limits conclusions by the minimum")
        if block.activation.method != "general":
            raise LossError(f"{peer} activates all rules")
    pairs = {(block.conjunction, block.disjunction) for block in system.blocks}
    if len(pairs) > 1:
        raise LossError(f"{peer} has one AND and one OR for all rules")
    ((conjunction, disjunction),) = pairs
    return both[conjunction], either[disjunction]


def _sentences(system: FuzzySystem, peer: str, words: Words) -> Iterator[str]:
    """Yield the rules as an engine reads them, one for each conclusion."""

    def text(condition: Condition | None) -> str:
        match condition:
            case Proposition(hedges=()):
                return words.proposition.format(condition.variable, condition.term)
            case Proposition(hedges=("not",)):
                return words.denial.format(condition.variable, condition.term)
            case Not(part=part):
                return words.negation.format(text(part))
            case And(parts=parts) | Or(parts=parts):
                word = words.both if isinstance(condition, And) else words.either
                return f"({word.join(map(text, parts))})"
            case _:
                raise LossError(f"{peer} has no such condition")

    for number, rule in enumerate(system.rules, 1):
        if rule.weight != 1.0 or any(one.hedges for one in rule.then):
            raise LossError(f"{peer} has no weight or hedge, as of rule {number}")
        for one in rule.then:
            then = words.proposition.format(one.output, one.term)
            yield f"IF {text(rule.when)} THEN {then}"


def _range(variable: Variable | SystemOutput) -> tuple[float, float]:
    """Return the declared range, or one around the terms."""
    if variable.low is not None and variable.high is not None:
        return variable.low, variable.high
    knots = [x for term in variable.terms for x in term.function.knots()]
    low, high = min(knots, default=0.0), max(knots, default=1.0)
    return low - (high - low), high + (high - low)


def _corners(
    curve: Trapezoid, low: float, high: float
) -> tuple[float, float, float, float]:
    """Return the corners of a trapezoid; an open side ends with the range."""
    a = min(low, curve.c) if curve.a is None else curve.a
    d = max(high, curve.b) if curve.d is None else curve.d
    return a, a if curve.a is None else curve.b, d if curve.d is None else curve.c, d

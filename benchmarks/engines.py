"""How fast fuzzy systems run, here and in third-party engines.

    python benchmarks/engines.py [--quick] [--write docs/reference/engines.md]

Two systems: the tipper of examples/tipper.fll, and the relative rules of a tree with
seven leaves and straight flanks, with a number for each rule. Every engine gets the
same system; its numbers are compared with the reference's before it is timed. Calls are
timed in interleaved rounds; C and C++ loop over rows themselves, so that no call of
Python is counted.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib
import os
import re
import shutil
import statistics
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.benchmarking.clock import time_calls
from fuzzytree.benchmarking.machine import load_averages, machine
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Or,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import Band, RuleBase
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.inference import curve_degree, infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree

ROOT = Path(__file__).resolve().parents[1]
ROWS = 10_000
Floats = npt.NDArray[np.float64]
Answer = Callable[[Floats], Floats]
"""Answers to values of shape (inputs, rows): the first output of each row."""


class Engine(NamedTuple):
    """One way to run a system.

    Attributes:
        many: Answers a batch.
        one: Answers one row; None where rows are looped over outside Python.
        loop: Nanoseconds for all rows, one after another, in the engine's own language;
            a figure for each round.
        note: What is different.
    """

    many: Answer
    one: Callable[[Sequence[float]], object] | None = None
    loop: Callable[[Floats, int], list[int]] | None = None
    note: str = ""


def main() -> None:
    """Print the tables, and write them on request."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    parser.add_argument("--write", metavar="FILE", help="a page with the tables")
    options = parser.parse_args()
    rounds = 5 if options.quick else 15
    with tempfile.TemporaryDirectory() as folder:
        lines = list(_page(rounds, Path(folder)))
    text = "\n".join(lines) + "\n"
    print(text)
    if options.write:
        Path(options.write).write_text(_HEAD + text, encoding="utf-8")


def _page(rounds: int, folder: Path) -> Iterator[str]:
    names = ["numpy", "onnxruntime", "pyfuzzylite", "scikit-fuzzy", "simpful"]
    found = machine([*names, "ferrifuzz"])
    versions = ", ".join(
        f"{name} {version}" for name, version in found.versions.items()
    )
    load = " ".join(f"{value:.2f}" for value in load_averages())
    yield f"{found.python}, {versions}; fuzzylite of Debian, g++ and gcc -O2."
    yield f"{found.processor}, {found.cores} cores; load at the start {load}."
    tipper = ft.load(ROOT / "examples" / "tipper.fll")
    if not isinstance(tipper, FuzzySystem):
        raise SystemExit("the tipper is read as something else")
    seven = seven_rules()
    for title, system in (("The tipper", tipper), ("Seven rules", seven)):
        yield f"\n## {title}\n"
        yield from _table(system, rounds, folder)
    yield ""
    yield _decided(seven, rounds, folder)


def _decided(system: FuzzySystem, rounds: int, folder: Path) -> str:
    """Say what it costs in C to decide by the tree that the seven rules equal."""
    tree = random_tree(_seed(), leaves=7, combinations=0.0)
    values = _values(system)
    loop = _loop(ft.export(tree, "c", name="model").content + _TREE, folder / "tree.so")
    right = find_runtime("reference").load(tree)(values).rule
    if loop(values).tolist() != right.tolist():
        raise SystemExit("the tree in C decides otherwise")
    mine = time_calls({"c": lambda: loop(values)}, rows=ROWS, rounds=rounds).timings[
        "c"
    ]
    engine = _fuzzylite(system, folder)
    others = statistics.median(engine.loop(values, rounds) if engine.loop else [0])
    return (
        "If you need the decision of these rules and not a number, use the tree that "
        "they equal,\nby proof and on all of these rows: in C "
        f"{mine.median_ns / ROWS:.1f} ns a row, {others / mine.median_ns:.0f} times as "
        "fast as fuzzylite's C++ fires the rules."
    )


def seven_rules() -> FuzzySystem:
    """Return the relative rules of a tree with seven leaves as a weighted average."""
    rules = _straight(_seed())
    curves = {
        (v.name, t.name): _trapezoid(t.shape) for v in rules.variables for t in v.terms
    }
    inputs = tuple(
        Variable(
            v.name,
            tuple(Term(_word(t.name), curves[v.name, t.name]) for t in v.terms),
            low=v.low,
            high=v.high,
        )
        for v in rules.variables
    )
    output = SystemOutput(
        "answer",
        tuple(Term(f"rule{k}", Singleton(float(k))) for k in range(1, 8)),
        0.0,
        8.0,
        Defuzzifier("weighted average"),
    )
    written = tuple(
        SystemRule(
            And(
                tuple(Proposition(c.variable, (_word(c.terms[0]),)) for c in rule.when)
            ),
            (Conclusion("answer", f"rule{number}"),),
        )
        for number, rule in enumerate(rules.rules, 1)
    )
    return FuzzySystem("seven", inputs, (output,), (RuleBlock(written),))


def _seed() -> int:
    """Return the first seed whose rules ask for one term in each proposition."""
    return next(s for s in range(1000) if _is_plain(_straight(s)))


def _straight(seed: int) -> RuleBase:
    """Return the rules of a random tree without its origin."""
    rules = rules_from_tree(random_tree(seed, leaves=7, combinations=0.0))
    return replace(rules, kind=None)


def _is_plain(rules: RuleBase) -> bool:
    propositions = [proposition for rule in rules.rules for proposition in rule.when]
    return len(rules.inputs) == 4 and all(len(c.terms) == 1 for c in propositions)


def _trapezoid(shape: object) -> Trapezoid:
    """Return a straight band as a trapezoid, which differs at its edges alone."""
    if not isinstance(shape, Band):
        raise TypeError("relative rules have bands")
    low, high = shape.low, shape.high
    a = low if shape.left is None else shape.left
    d = high if shape.right is None else shape.right
    inner = [one for one in (low, high) if one is not None]
    return Trapezoid(
        a, inner[0] if low is None else low, inner[-1] if high is None else high, d
    )


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name)


# --- the rows and the table


def _values(system: FuzzySystem) -> Floats:
    chance = np.random.default_rng(0)
    columns = []
    for one in system.variables:
        marks = [m for label in one.terms for m in _marks(label.function)]
        columns.append(chance.uniform(min(marks), max(marks), ROWS))
    return np.array(columns)


def _marks(curve: Curve) -> list[float]:
    match curve:
        case Trapezoid():
            return [c for c in (curve.a, curve.b, curve.c, curve.d) if c is not None]
        case Gaussian():
            return [curve.mean - curve.deviation, curve.mean + curve.deviation]
        case _:
            return [0.0, 1.0]


def _table(system: FuzzySystem, rounds: int, folder: Path) -> Iterator[str]:
    values = _values(system)
    rows = [dict(zip(system.inputs, row, strict=True)) for row in values.T.tolist()]
    right = np.array([infer(system, row).outputs[0] for row in rows])
    found: dict[str, Engine] = {}
    absent: list[str] = []
    for name, make in ENGINES.items():
        try:
            found[name] = make(system, folder)
        except (ImportError, OSError, ValueError, subprocess.SubprocessError) as error:
            absent.append(f"- {name}: {str(error).splitlines()[0]}")
    errors = {
        name: _error(engine.many(values), right) for name, engine in found.items()
    }
    first = [float(x) for x in values[:, 0]]
    singles = {
        name: (lambda one=engine.one: one(first))
        for name, engine in found.items()
        if engine.one is not None
    }
    batches = {
        name: (lambda many=engine.many: many(values))
        for name, engine in found.items()
        if engine.loop is None
    }
    batches["reading the columns once"] = values.sum
    one = {
        name: timing.median_ns
        for name, timing in time_calls(singles, rows=1, rounds=rounds).timings.items()
    }
    many = {
        name: timing.median_ns
        for name, timing in time_calls(
            batches, rows=ROWS, rounds=rounds
        ).timings.items()
    }
    for name, engine in found.items():
        if engine.loop is not None:
            many[name] = statistics.median(engine.loop(values, rounds))
            one[name] = many[name] / ROWS
    best = min(many[name] for name in OURS if name in many)
    yield "| engine | one row, us | 10,000 rows, ms | times ours | largest difference |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    for name in sorted(many, key=lambda n: many[n]):
        single = f"{one[name] / 1e3:.3g}" if name in one else ""
        gap = f"{errors[name]:.1e}" if name in errors else ""
        if errors.get(name) == 0.0:
            gap = "0"
        yield (
            f"| {name} | {single} | {many[name] / 1e6:.3g} | {many[name] / best:.2f} "
            f"| {gap} |"
        )
    if "C, generated" in one and "fuzzylite, C++" in one:
        ratio = one["fuzzylite, C++"] / one["C, generated"]
        yield f"\nOne row: generated C is {ratio:.0f} times as fast as fuzzylite's C++."
    notes = [f"- {name}: {e.note}" for name, e in found.items() if e.note]
    if notes or absent:
        yield ""
        yield from [*notes, *absent]


def _error(found: Floats, right: Floats) -> float:
    both = np.isnan(found) & np.isnan(right)
    return float(np.max(np.where(both, 0.0, np.abs(found - right))))


# --- ours


def _runtime(name: str) -> Callable[[FuzzySystem, Path], Engine]:
    def make(system: FuzzySystem, _: Path) -> Engine:
        run = find_runtime(name).load(system, with_strengths=False)

        def many(values: Floats) -> Floats:
            found: Floats = cast("Floats", run(values).outputs)[0]
            return found

        return Engine(many, lambda row: many(np.array(row)[:, None]))

    return make


def _c(system: FuzzySystem, folder: Path) -> Engine:
    content = ft.export(system, "c", name="model").content
    call = _loop(content + _SYSTEM, folder / f"{system.name}.so")

    def timed(values: Floats, rounds: int) -> list[int]:
        found = time_calls(
            {"c": lambda: call(values)}, rows=ROWS, rounds=rounds
        ).timings
        return [int(found["c"].median_ns)]

    return Engine(call, loop=timed, note="a loop over rows in C")


def _loop(content: bytes, library: Path) -> Answer:
    """Return a loop over rows in C, compiled from a file of ours and its loop."""
    source = library.with_suffix(".c")
    source.write_bytes(content)
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise OSError("no C compiler is there")
    words = [compiler, "-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([*words, source, "-o", library, "-lm"], check=True)
    loop = ctypes.CDLL(str(library)).loop
    loop.restype = None
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(values: Floats) -> Floats:
        rows = np.ascontiguousarray(values.T)
        answers = np.empty(len(rows))
        loop(
            rows.ctypes.data_as(pointer),
            ctypes.c_long(len(rows)),
            ctypes.c_long(len(values)),
            answers.ctypes.data_as(pointer),
        )
        return answers

    return call


_SYSTEM = b"""
void loop(const double *rows, long count, long width, double *answers) {
    long k;
    for (k = 0; k < count; k++) {
        double outputs[1];
        model_infer(rows + k * width, outputs);
        answers[k] = outputs[0];
    }
}
"""

_TREE = b"""
void loop(const double *rows, long count, long width, double *answers) {
    long k;
    for (k = 0; k < count; k++)
        answers[k] = (double)model_decide(rows + k * width).rule;
}
"""


# --- third-party engines


def _fuzzylite(system: FuzzySystem, folder: Path) -> Engine:
    program, model = folder / "engines", folder / f"{system.name}.fll"
    source = Path(__file__).with_suffix(".cpp")
    if not program.exists():
        words = ["g++", "-O2", "-w", str(source), "-o", str(program), "-lfuzzylite"]
        subprocess.run(words, check=True, capture_output=True)
    model.write_bytes(ft.export(system, "fll").content)

    def call(values: Floats, rounds: int) -> tuple[list[int], Floats]:
        rows, answers = folder / "rows.bin", folder / "answers.bin"
        rows.write_bytes(np.ascontiguousarray(values.T).tobytes())
        words = [str(program), str(model), str(rows), *map(str, values.shape)]
        words += [str(rounds), str(answers)]
        printed = subprocess.run(words, check=True, capture_output=True).stdout
        return [int(line) for line in printed.split()], np.fromfile(answers)

    return Engine(
        lambda values: call(values, 1)[1],
        loop=lambda values, rounds: call(values, rounds)[0],
        note="a loop over rows in C++",
    )


def _pyfuzzylite(system: FuzzySystem, _: Path) -> Engine:
    fuzzylite = importlib.import_module("fuzzylite")
    text = ft.export(system, "fll").content.decode()
    engine = fuzzylite.FllImporter().from_string(text)
    output = engine.output_variables[0]

    def many(values: Floats) -> Floats:
        for variable, column in zip(engine.input_variables, values, strict=True):
            variable.value = column
        engine.process()
        found: Floats = np.array(output.value, np.float64, ndmin=1)
        return found

    return Engine(many, lambda row: many(np.array(row)))


def _ferrifuzz(system: FuzzySystem, _: Path) -> Engine:
    ff = importlib.import_module("ferrifuzz")
    made = ff.FuzzySystem(defuzz_method="weighted_average", clamp_inputs=False)
    for one in system.variables:
        low, high = _range(one)
        variable = ff.Variable(one.name, low, high)
        for label in one.terms:
            match label.function:
                case Gaussian(mean=mean, deviation=deviation):
                    variable[label.name] = ff.mf.gaussian(mean, deviation)
                case Trapezoid():
                    corners = _corners(label.function, low, high)
                    variable[label.name] = ff.mf.trapezoid(*corners)
                case _:
                    raise ValueError(f"no {type(label.function).__name__} there")
        made.add_input(variable)
    output = system.outputs[0]
    variable = ff.Variable(output.name, output.low, output.high)
    for name, value in _numbers(output):
        variable[name] = ff.mf.singleton(value)
    made.add_output(variable)
    for rule in system.rules:
        made.add_rule(_sentence(rule, " AND ", " OR ", "{} IS {}"))

    def many(values: Floats) -> Floats:
        given = dict(zip(system.inputs, values, strict=True))
        found: Floats = np.asarray(made.compute_batch(given)[output.name])
        return found

    return Engine(many, made.evaluate, note="on all cores")


def _simpful(system: FuzzySystem, _: Path) -> Engine:
    sf = importlib.import_module("simpful")
    made = sf.FuzzySystem(show_banner=False)
    for one in system.variables:
        low, high = _range(one)
        sets = [_simpful_set(sf, label, low, high) for label in one.terms]
        variable = sf.LinguisticVariable(sets, universe_of_discourse=[low, high])
        made.add_linguistic_variable(one.name, variable)
    output = system.outputs[0]
    for name, value in _numbers(output):
        made.set_crisp_output_value(name, value)
    made.add_rules(
        [
            _sentence(rule, " AND ", " OR ", "({} IS {})", is_grouped=True)
            for rule in system.rules
        ]
    )

    def single(row: Sequence[float]) -> float:
        for name, value in zip(system.inputs, row, strict=True):
            made.set_variable(name, value)
        found: float = made.Sugeno_inference([output.name])[output.name]
        return found

    def many(values: Floats) -> Floats:
        return np.array([single(row) for row in values.T.tolist()])

    return Engine(many, single, note="a loop over rows in Python")


def _simpful_set(sf: Any, label: Term, low: float, high: float) -> Any:
    if isinstance(label.function, Gaussian):
        shape = sf.GaussianFuzzySet(
            label.function.mean, label.function.deviation, label.name
        )
        return shape
    if not isinstance(label.function, Trapezoid):
        raise ValueError(f"no {type(label.function).__name__} there")
    corners = _corners(label.function, low, high)
    points = [[x, y] for x, y in zip(corners, (0.0, 1.0, 1.0, 0.0), strict=True)]
    if corners[0] == corners[1]:
        points = points[1:]
    if corners[-1] == corners[-2]:
        points = points[:-1]
    return sf.FuzzySet(points=points, term=label.name)


def _skfuzzy(system: FuzzySystem, _: Path) -> Engine:
    control = importlib.import_module("skfuzzy.control")
    inputs = {}
    for one in system.variables:
        low, high = _range(one)
        knots = {m for label in one.terms for m in _marks(label.function)}
        grid = np.unique([*np.linspace(low, high, 1001), *knots])
        made = inputs[one.name] = control.Antecedent(grid, one.name)
        for label in one.terms:
            made[label.name] = np.array([curve_degree(label.function, x) for x in grid])
    output = system.outputs[0]
    universe = np.linspace(output.low or 0.0, output.high or 0.0, 301)
    made = control.Consequent(universe, output.name)
    for name, value in _numbers(output):
        made[name] = (np.abs(universe - value) < 1e-9).astype(float)
    rules = []
    for rule in system.rules:
        asked = _skfuzzy_condition(rule.when, inputs)
        rules.append(control.Rule(asked, made[rule.then[0].term]))
    simulation = control.ControlSystemSimulation(control.ControlSystem(rules))

    def many(values: Floats) -> Floats:
        for name, column in zip(system.inputs, values, strict=True):
            simulation.input[name] = column
        simulation.compute()
        found: Floats = simulation.output[output.name]
        simulation.reset()
        return found

    def single(row: Sequence[float]) -> object:
        return many(np.array(row)[:, None])

    note = "has no weighted average: the centroid of spikes, another number"
    return Engine(many, single, note=note)


def _skfuzzy_condition(condition: Condition | None, inputs: Mapping[str, Any]) -> Any:
    match condition:
        case Proposition(variable=variable, term=label):
            return inputs[variable][label]
        case And(parts=parts):
            found = [_skfuzzy_condition(part, inputs) for part in parts]
            total = found[0]
            for one in found[1:]:
                total = total & one
            return total
        case Or(parts=parts):
            found = [_skfuzzy_condition(part, inputs) for part in parts]
            total = found[0]
            for one in found[1:]:
                total = total | one
            return total
        case _:
            raise ValueError("no such condition there")


def _range(one: Variable) -> tuple[float, float]:
    marks = [m for label in one.terms for m in _marks(label.function)]
    low, high = min(marks), max(marks)
    return low - (high - low), high + (high - low)


def _corners(curve: Trapezoid, low: float, high: float) -> tuple[float, ...]:
    a = low if curve.a is None else curve.a
    b = low if curve.a is None else curve.b
    c = high if curve.d is None else curve.c
    d = high if curve.d is None else curve.d
    return (a, b, c, d)


def _numbers(output: SystemOutput) -> Iterator[tuple[str, float]]:
    for label in output.terms:
        if not isinstance(label.function, Singleton):
            raise ValueError("only numbers are concluded there")
        yield label.name, label.function.value


def _sentence(
    rule: SystemRule, both: str, either: str, question: str, *, is_grouped: bool = False
) -> str:
    def told(condition: Condition | None) -> str:
        match condition:
            case Proposition(variable=variable, term=label):
                return question.format(variable, label)
            case And(parts=parts):
                text = both.join(map(told, parts))
            case Or(parts=parts):
                text = either.join(map(told, parts))
            case _:
                raise ValueError("no such condition there")
        return f"({text})" if is_grouped and len(parts) > 1 else text

    then = rule.then[0]
    return f"IF {told(rule.when)} THEN {question.format(then.output, then.term)}"


OURS = ("native", "onnxruntime", "C, generated")
ENGINES: Mapping[str, Callable[[FuzzySystem, Path], Engine]] = {
    "native": _runtime("native"),
    "onnxruntime": _runtime("onnxruntime float64"),
    "C, generated": _c,
    "fuzzylite, C++": _fuzzylite,
    "pyfuzzylite": _pyfuzzylite,
    "ferrifuzz": _ferrifuzz,
    "scikit-fuzzy": _skfuzzy,
    "simpful": _simpful,
}

_HEAD = """\
# Our runtimes beside third-party engines

`python benchmarks/engines.py --write docs/reference/engines.md`, on a quiet machine.
Medians of interleaved rounds; one thread, except where noted. *Times ours* compares
10,000 rows with the fastest of our runtimes. *Largest difference* is that of the
outputs from the reference's, on the same rows.

"""


if __name__ == "__main__":
    main()

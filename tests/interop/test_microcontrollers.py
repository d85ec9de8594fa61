"""Controllers in C for small machines: bits, sizes, and what the machines answer."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.exporters.c import write_c
from fuzzytree.formats import read_fll
from fuzzytree.model import FloatArray, FuzzySystem
from fuzzytree.runtimes.c import compiled, load
from fuzzytree.runtimes.machines import MACHINES, MachineSize, machine_sizes
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics import error_bounds, from_system, infer, system_probes
from fuzzytree.testing import random_system

Need = Callable[[str], str]
Dtype = Literal["float64", "float32", "q15", "q31"]
FOLDER = Path(__file__).parent
TIPPER = FOLDER.parents[1] / "examples" / "tipper.fll"
FAN = """\
Engine: fan
InputVariable: temperature
  range: 0.0 40.0
  term: cold Triangle -1.0 5.0 20.0
  term: mild Triangle 8.0 20.0 31.0
  term: hot Triangle 22.0 33.0 41.0
InputVariable: humidity
  range: 0.0 100.0
  term: dry Triangle -1.0 15.0 50.0
  term: normal Triangle 20.0 50.0 80.0
  term: wet Triangle 50.0 85.0 101.0
OutputVariable: speed
  range: 0.0 100.0
  aggregation: Maximum
  defuzzifier: Centroid 100
  term: low Triangle 0.0 20.0 45.0
  term: medium Triangle 30.0 50.0 70.0
  term: high Triangle 55.0 80.0 100.0
RuleBlock: rules
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
"""
METHODS = (
    "Centroid 100",
    "Centroid 128",
    "Bisector 100",
    "MeanOfMaximum 100",
    "SmallestOfMaximum 100",
    "LargestOfMaximum 33",
)


def fan(method: str = METHODS[0], source: str = "") -> FuzzySystem:
    """Return a Mamdani controller of nine rules on two inputs."""
    text = (source or FAN).replace(METHODS[0], method)
    labels = ("low", "low", "medium", "low", "medium", "high", "medium", "high", "high")
    pairs = [(a, b) for a in ("cold", "mild", "hot") for b in ("dry", "normal", "wet")]
    for (a, b), label in zip(pairs, labels, strict=True):
        when = f"temperature is {a} and humidity is {b}"
        text += f"  rule: if {when} then speed is {label}\n"
    system = read_fll(text.encode(), "fan.fll").model
    assert isinstance(system, FuzzySystem)
    return system


def size_of(content: bytes, machine: str) -> tuple[int, int]:
    """Return the bytes of code and constants, and of the stack, without libraries."""
    for size in machine_sizes(content):
        if isinstance(size, MachineSize) and size.machine == machine:
            assert size.ram == 0
            return size.flash, size.stack
    raise AssertionError(f"no size for {machine}")


@pytest.mark.parametrize("method", METHODS)
def test_no_array_on_the_stack_holds_all_samples(method: str) -> None:
    text = write_c(fan(method), selftest=False).content.decode()
    sizes = re.findall(r"    fan_real \w+\[(\d+)\];", text)
    assert all(int(size) <= 8 for size in sizes)
    assert "static const double" not in text


@pytest.mark.heavy
@pytest.mark.parametrize("method", [*METHODS, "random"])
def test_samples_in_another_order_have_the_references_bits(
    program: Need, method: str
) -> None:
    program("gcc")
    is_random = method == "random"
    for system in map(random_system, range(24)) if is_random else [fan(method)]:
        rows = system_probes(system, limit=100)
        values = np.array([[row[name] for row in rows] for name in system.inputs])
        values = values.reshape(len(system.inputs), len(rows))
        outcome = find_runtime("c").load(system)(values)
        assert outcome.outputs is not None
        expected = np.array([infer(system, row).outputs for row in rows]).T
        bounds = error_bounds(from_system(system), values)[: len(expected)]
        is_alike = outcome.outputs.view(np.int64) == expected.view(np.int64)
        is_alike |= np.isnan(outcome.outputs) & np.isnan(expected)
        assert (is_alike | (bounds > 0.0)).all()
        assert is_random or not bounds.any()


@pytest.mark.heavy
@pytest.mark.parametrize("machine", ["Cortex-M4", "Cortex-M0"])
def test_a_controller_of_nine_rules_is_small(
    tmp_path: Path, program: Need, machine: str
) -> None:
    program("arm-none-eabi-gcc")
    flash, stack = size_of(write_c(fan(), selftest=False).content, machine)
    assert 1000 < flash <= 2500
    assert 100 < stack <= 300


def points(system: FuzzySystem, count: int = 100_000) -> FloatArray:
    """Return all corners of the ranges and random rows, of shape (inputs, rows)."""
    ends = [(one.low or 0.0, one.high or 0.0) for one in system.variables]
    corners = np.array(list(itertools.product(*ends))).T
    low, high = (np.array(end).reshape(-1, 1) for end in zip(*ends, strict=True))
    rows = np.random.default_rng(5).uniform(low, high, (len(ends), count))
    return np.hstack([corners, rows])


def stated_bounds(content: bytes) -> list[float]:
    """Return the bounds of errors that the comment of a file states."""
    found = re.findall(rb" \* \w+ is within (\S+) of exact numbers for inputs", content)
    return [float(text) for text in found]


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["fan", "tipper"])
def test_float32_is_within_the_stated_bound(program: Need, name: str) -> None:
    program("gcc")
    system = {"fan": fan(), "tipper": ft.load(TIPPER)}[name]
    assert isinstance(system, FuzzySystem)
    values = np.asarray(points(system), np.float32).astype(np.float64)
    bounds = stated_bounds(write_c(system, dtype="float32", selftest=False).content)
    outcome = load(system, "float32", with_strengths=False)(values)
    expected = find_runtime("native").load(system)(values)
    assert outcome.outputs is not None
    assert expected.outputs is not None
    np.testing.assert_array_equal(outcome.status, expected.status)
    worst = np.abs(outcome.outputs - expected.outputs).max(axis=1)
    assert (worst <= bounds).all()
    assert (worst > np.array(bounds) / 1000).all()  # and the bound says something


def test_float32_says_where_it_knows_no_bound() -> None:
    written = write_c(fan("MeanOfMaximum 100"), dtype="float32", selftest=False)
    assert written.remarks == ("speed: no bound of its error is known",)
    system = fan()
    first = replace(system.variables[0], low=None)
    open_ended = replace(system, variables=(first, *system.variables[1:]))
    written = write_c(open_ended, dtype="float32", selftest=False)
    assert written.remarks == ("nothing is known of errors: an input has no range",)


def answer_of(folder: Path, words: list[str], run: list[str]) -> str:
    """Return what the self-test says, built for a machine and run by a simulator."""
    target = folder / "model.elf"
    subprocess.run([*words, "-o", str(target), "-lm"], check=True)
    done = subprocess.run(
        [*run, str(target)], capture_output=True, text=True, check=False, timeout=60
    )
    return done.stdout + done.stderr


def all_right(answer: str) -> bool:
    """Return whether a self-test met all examples, and has some."""
    counts = re.search(r"(\d+) of (\d+) examples answered as expected", answer)
    return counts is not None and counts[1] == counts[2] and int(counts[1]) > 20


@pytest.mark.heavy
@pytest.mark.parametrize("machine", ["Cortex-M4", "Cortex-M0"])
@pytest.mark.parametrize("dtype", ["float64", "float32", "q15", "q31"])
def test_the_self_test_holds_on_a_cortex(
    tmp_path: Path, program: Need, machine: str, dtype: Dtype
) -> None:
    program("arm-none-eabi-gcc")
    source = tmp_path / "model.c"
    build = [*MACHINES[machine].split(), "-DFAN_SELFTEST"]
    build += ["--specs=rdimon.specs", "-Wl,--section-start=.vectors=0"]
    simulator = [program("qemu-system-arm"), "-M", "mps2-an386"]  # runs code of both
    simulator += ["-nographic", "-semihosting", "-kernel"]
    start = FOLDER / "cortex_start.c"
    text = write_c(fan(), dtype=dtype).content.decode()
    source.write_text(text)
    answer = answer_of(tmp_path, [*build, str(source), str(start)], simulator)
    assert all_right(answer), answer
    changed = re.sub(r" / (v106|0x1\.4p\+4)", r" * 3 / \1", text)
    assert changed != text
    source.write_text(changed)
    answer = answer_of(tmp_path, [*build, str(source), str(start)], simulator)
    assert "instead of" in answer


@pytest.mark.heavy
@pytest.mark.parametrize("dtype", ["float32", "q15"])
def test_the_self_test_holds_on_an_avr(
    tmp_path: Path, program: Need, dtype: Dtype
) -> None:
    program("avr-gcc")
    source, machine = (
        tmp_path / "model.c",
        "atmega1284p",
    )  # an ATmega328P, with more RAM
    source.write_bytes(write_c(fan(), dtype=dtype).content)
    build = ["avr-gcc", f"-mmcu={machine}", "-std=gnu99", "-ffp-contract=off", "-Os"]
    build += ["-DFAN_NOT_FUSED", "-DFAN_SELFTEST", str(source)]
    simulator = [program("simavr"), "-m", machine, "-f", "16000000"]
    words = [*build, str(FOLDER / "avr_start.c")]
    answer = answer_of(tmp_path, words, simulator)
    assert all_right(answer), answer


FIXED_LOOP = """
extern void fan_many(const fan_real *x, size_t rows, fan_real *outputs)
{
    size_t place;
    for (place = 0; place < rows; place++)
        if (fan_infer(x + FAN_INPUTS * place, outputs + FAN_OUTPUTS * place))
            outputs[FAN_OUTPUTS * place] = -1;
}
"""
CURVED = FAN.replace("mild Triangle 8.0 20.0 31.0", "mild Gaussian 20 5").replace(
    "medium Triangle 30.0 50.0 70.0", "medium Bell 50 12 3"
)
FIXED_SYSTEMS: dict[str, Callable[[], object]] = {
    "100 samples": fan,
    "37 samples": lambda: fan("Centroid 37"),
    "curves": lambda: fan(source=CURVED),
    "tipper": lambda: ft.load(TIPPER),
}


@pytest.mark.heavy
@pytest.mark.parametrize("name", FIXED_SYSTEMS)
@pytest.mark.parametrize("dtype", ["q15", "q31"])
def test_fixed_point_is_within_the_stated_bound(
    program: Need, dtype: Literal["q15", "q31"], name: str
) -> None:
    program("gcc")
    system = FIXED_SYSTEMS[name]()
    assert isinstance(system, FuzzySystem)
    content = write_c(
        system, dtype=dtype, tolerance=1e-4, allow_loss=True, selftest=False, name="fan"
    ).content
    assert not re.search(rb"float|double|math\.h", content.partition(b"*/")[2])
    bits = [int(text) for text in re.findall(rb"is \w+ times 2\^(\d+)", content)]
    kind = np.int16 if dtype == "q15" else np.int32
    values = points(system) * 2.0 ** np.array(bits[:2]).reshape(-1, 1)
    x = np.ascontiguousarray(np.trunc(values).T, kind)
    outputs = np.empty(len(x), kind)
    run = compiled(content, "#include <stddef.h>" + FIXED_LOOP, 1, function="fan_many")
    run(x.ctypes.data, len(x), outputs.ctypes.data)
    inputs = x.T.astype(np.float64) / 2.0 ** np.array(bits[:2]).reshape(-1, 1)
    expected = find_runtime("native").load(system)(inputs)
    assert expected.outputs is not None
    numbers = outputs.astype(np.float64) / 2.0 ** bits[2]
    worst = np.abs(numbers - expected.outputs[0]).max()
    (bound,) = stated_bounds(content)
    assert bound / 1000 < worst <= bound
    assert bound < (1.5 if dtype == "q15" else 1e-4 if "samples" in name else 0.1)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("Centroid 100", "MeanOfMaximum 100"), "fixed point has no highest, which"),
        (
            ("mild Triangle 8.0 20.0 31.0", "mild Gaussian 20 5"),
            "no exponential, which",
        ),
        (("cold Triangle -1.0 5.0 20.0", "cold Triangle -1 5 7"), "has no range"),
    ],
)
def test_what_fixed_point_cannot_do_is_refused(
    change: tuple[str, str], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "FAN", FAN.replace(*change))
    with pytest.raises(ValueError, match=text) as refusal:
        write_c(fan(change[1] if "Maximum" in change[1] else METHODS[0]), dtype="q15")
    assert "\n" not in str(refusal.value)


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("dtype", "machine", "flash", "stack"),
    [
        ("q15", "Cortex-M4", 1200, 100),
        ("q15", "Cortex-M0", 1300, 100),
        ("q15", "ATmega328P", 2500, 100),
        ("q31", "Cortex-M4", 1100, 150),
    ],
)
def test_a_controller_in_fixed_point_is_small(
    tmp_path: Path,
    program: Need,
    dtype: Literal["q15", "q31"],
    machine: str,
    flash: int,
    stack: int,
) -> None:
    program(MACHINES[machine].split()[0])
    content = write_c(fan(), dtype=dtype, selftest=False).content
    code, depth = size_of(content, machine)
    assert 800 < code <= flash
    assert 30 < depth <= stack


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("machine", "most"),
    [("Cortex-M4", 1400), ("Cortex-M0", 1400), ("ATmega328P", 3300)],
)
def test_a_controller_in_float32_is_small(
    tmp_path: Path, program: Need, machine: str, most: int
) -> None:
    program(MACHINES[machine].split()[0])
    content = write_c(fan(), dtype="float32", selftest=False).content
    flash, stack = size_of(content, machine)
    assert 1000 < flash <= most
    assert 50 < stack <= 150


def test_a_report_shows_what_the_compilers_say(
    program: Need, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program("arm-none-eabi-gcc")
    model, target = tmp_path / "fan.yaml", tmp_path / "fan.c"
    ft.save(fan(), model)
    words = ["export", str(model), "-o", str(target), "--report", "--json"]
    assert main(words) == 0
    flash, stack = size_of(target.read_bytes(), "Cortex-M4")
    shown = capsys.readouterr()
    assert f"{flash:,} bytes of flash, 0 of RAM, {stack:,} of stack" in shown.err
    report = json.loads(shown.out)["report"]
    assert f"steps    {report['steps']:,}" in shown.err
    machines = {one["machine"]: one for one in report["machines"]}
    assert len(machines) + len(report["unmeasured"]) == len(MACHINES)
    for name, size in machines.items():
        compiler, *flags = MACHINES[name].split()
        item = tmp_path / "fan.o"
        subprocess.run([compiler, *flags, "-c", target, "-o", item], check=True)
        tool = [compiler.replace("-gcc", "-size"), "-A", str(item)]
        text = subprocess.run(tool, capture_output=True, text=True, check=True).stdout
        sections = re.findall(r"^\.(text|rodata|data|bss)\S*\s+(\d+)", text, re.M)
        pairs = [(kind, int(size)) for kind, size in sections]
        assert size["flash"] == sum(n for kind, n in pairs if kind != "bss")
        assert size["ram"] == sum(n for kind, n in pairs if kind in ("data", "bss"))


def test_a_report_names_compilers_that_are_missing_and_other_formats(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, target = tmp_path / "fan.yaml", tmp_path / "fan.c"
    ft.save(fan(), model)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["export", str(model), "-o", str(target), "--report"]) == 0
    shown = capsys.readouterr().err
    assert "size     Cortex-M0: arm-none-eabi-gcc is not installed" in shown
    assert "size     ATmega328P: avr-gcc is not installed" in shown
    assert main(["export", str(model), "-o", str(tmp_path / "a.py"), "--report"]) == 2
    assert "--report is about a file of C" in capsys.readouterr().err
    assert not (tmp_path / "a.py").exists()

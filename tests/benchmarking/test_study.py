"""A study tries, judges and times its candidates, and survives all of them."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.benchmarking import judging, trial
from fuzzytree.benchmarking.candidates import chosen, found_of, gather
from fuzzytree.benchmarking.clock import TimeSource
from fuzzytree.benchmarking.judging import made_rows, repeated
from fuzzytree.benchmarking.records import (
    Candidate,
    CandidateOutput,
    LoadedCandidate,
    Omission,
    OutputError,
    Study,
)
from fuzzytree.benchmarking.study import (
    BenchSettings,
    bench,
    faults,
    fitting,
    run_study,
)
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree
from tests.benchmarking.studies import error as error_by_hand
from tests.benchmarking.studies import point

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, Progress

pytestmark = pytest.mark.usefixtures("few_objects")

ROOT = Path(__file__).resolve().parents[2]
RULES = rules_from_tree(random_tree(3), "raw")
PATIENCE_S = 600.0  # of what ends by its rounds, however busy the machine is
SMALL = BenchSettings(rows=(4,), threads=(1,), rounds=6, budget_s=PATIENCE_S)
MS = 1_000_000


class FakeTime:
    """A clock that stands still unless a candidate takes its time."""

    def __init__(self) -> None:
        self.now = 0

    def clock(self) -> TimeSource:
        return TimeSource(lambda: self.now, lambda: self.now)


def candidate(
    name: str = "ours",
    *,
    time: FakeTime | None = None,
    ms_a_row: float = 0.0,
    ms: float = 1.0,
    before: Callable[[], object] = lambda: None,
    error: float = 0.0,
    bound: float | None = None,
    loads: list[int] | None = None,
    rules: RuleBase = RULES,
    **more: bool,
) -> Candidate:
    """Return a candidate that answers as the native runtime, with a planted error."""
    run = load(rules)

    def answer(values: FloatArray) -> CandidateOutput:
        outcome = run(values)
        result = found_of(outcome, rules)
        assert result.strengths is not None
        return CandidateOutput(result.labels, result.strengths - error)

    def call(values: FloatArray) -> Callable[[], object]:
        def timed() -> None:
            before()
            if time:
                time.now += int((ms + ms_a_row * values.shape[1]) * MS)

        return timed

    def prepare(threads: int) -> LoadedCandidate:
        if loads is not None:
            loads.append(threads)
        return LoadedCandidate(answer, call)

    one = Candidate(
        f"{name}: rules",
        "rules",
        "runtime",
        prepare,
        bound=None if bound is None else lambda: (bound, "by hand"),
    )
    return msgspec.structs.replace(one, **more)


def studied(
    *candidates: Candidate,
    plan: BenchSettings = SMALL,
    time: FakeTime | None = None,
    progress: Progress | None = None,
) -> Study:
    values, data = made_rows(RULES, 40)
    return run_study(
        RULES,
        candidates,
        values=values,
        data=data,
        plan=plan,
        clock=time.clock() if time else None,
        progress=progress,
    )


def omitted(study: Study) -> dict[str, str]:
    return {one.name: one.why for one in study.omissions}


def counting(at: int, error: BaseException) -> Callable[[], None]:
    """Return what raises an error when it is called for the n-th time."""
    left = [at]

    def count() -> None:
        left[0] -= 1
        if left[0] == 0:
            raise error

    return count


def test_a_candidate_is_timed_and_judged() -> None:
    study = studied(candidate(error=1e-3, bound=2e-3))
    (point,) = study.points
    assert point.error is not None
    assert point.error.rows == 40
    assert point.error.largest == pytest.approx(1e-3, rel=1e-6)
    assert point.error.bound == 2e-3
    assert point.probes is not None
    assert point.probes.bound is None
    (timing,) = point.timings
    assert (timing.rows, timing.threads, len(timing.samples_ns)) == (4, 1, 6)
    assert study.is_complete
    assert study.fingerprint
    assert study.advice == (
        "rules, 4 rows: fastest within an error of 0.01: ours, the only one",
    )


@pytest.mark.heavy
def test_an_error_beyond_the_certified_one_is_a_fault() -> None:
    study = studied(candidate(error=1e-3, bound=1e-4))
    (fault,) = faults(study.points)
    assert fault == (
        "ours: rules: an error of 0.001 is larger than the certified 0.0001; "
        "this is a fault"
    )
    assert fault in study.warnings
    assert [*faults(studied(candidate(bound=1e-4)).points)] == []


@pytest.mark.one_in(4)
@pytest.mark.parametrize("calls", [1, 2, 3, 5])
def test_what_fails_is_an_omission_and_the_others_are_measured(calls: int) -> None:
    broken = candidate("broken", before=counting(calls, RuntimeError("no.\nmore")))
    study = studied(broken, candidate())
    assert "no" in omitted(study)["broken: rules"]
    assert "ours: rules" in [point.name for point in study.points]


def test_what_cannot_be_loaded_is_an_omission() -> None:
    def refuse(threads: int) -> LoadedCandidate:
        raise OSError("no such library")

    broken = msgspec.structs.replace(candidate("broken"), load=refuse)
    study = studied(broken, candidate())
    assert omitted(study) == {"broken: rules": "no such library"}


@pytest.mark.heavy
def test_what_ends_its_process_is_an_omission() -> None:
    # A child process cannot make it again, as it cannot make what crashes.
    peer = msgspec.structs.replace(candidate("a peer"), modules=("a_library",))
    study = studied(peer, candidate())
    assert omitted(study) == {
        "a peer: rules": "it could not be made again in a child process"
    }


@pytest.mark.heavy
def test_an_interrupted_study_keeps_what_was_measured() -> None:
    time = FakeTime()
    plan = BenchSettings(rows=(1, 50), threads=(1,), rounds=6, budget_s=60.0)
    stop = counting(13, KeyboardInterrupt())  # in the second number of rows
    study = studied(
        candidate("nervous", time=time, before=stop, ms=5.0),
        candidate("calm", time=time, ms=5.0),
        plan=plan,
        time=time,
    )
    assert study.is_interrupted
    assert not study.is_complete
    assert study.warnings[0] == "interrupted: this is what was measured by then"
    result = {p.name: [t.rows for t in p.timings] for p in study.points}
    assert result == {"nervous: rules": [1, 50], "calm: rules": [1, 50]}
    assert len(study.points[0].timings[1].samples_ns) < 6
    assert study.advice


def test_a_study_that_is_interrupted_before_it_times_has_no_points() -> None:
    study = studied(candidate(before=counting(1, KeyboardInterrupt())))
    assert study.is_interrupted
    assert study.points == ()
    assert study.advice == ()
    assert json.loads(study.to_json())["points"] == []


@pytest.mark.one_in(4)
@pytest.mark.parametrize("at", [1, 2, 4, 9])
def test_an_interruption_that_a_library_swallows_is_noticed(at: int) -> None:
    calls = [0]

    def swallow() -> None:
        calls[0] += 1
        if calls[0] == at:
            with contextlib.suppress(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
                for _ in range(1000):  # the signal is handled between two steps
                    pass

    study = studied(candidate("deaf", before=swallow), candidate("other"))
    assert study.is_interrupted
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.heavy
def test_the_budget_is_kept_and_slow_ones_are_left_out() -> None:
    time = FakeTime()
    plan = BenchSettings(rows=(1, 1000), threads=(1,), rounds=15, budget_s=4.0)
    study = studied(
        candidate("slow", time=time, ms_a_row=10.0),
        candidate("fast", time=time, ms_a_row=0.01),
        plan=plan,
        time=time,
    )
    assert study.seconds <= 4.0 + 0.5  # judging has its own limits
    assert omitted(study) == {
        "slow: rules": "1,000 rows: too slow for the budget; a larger one helps"
    }
    slow, fast = study.points
    assert [timing.rows for timing in slow.timings] == [1]
    assert [len(timing.samples_ns) for timing in fast.timings] == [15, 15]


@pytest.mark.heavy
def test_half_of_the_budget_is_for_timing() -> None:
    time = FakeTime()
    plan = BenchSettings(rows=(1,), threads=(1,), rounds=6, budget_s=2.0)
    study = studied(
        candidate("b", time=time, ms=1200.0),
        candidate("c", time=time),
        candidate("native", time=time),
        plan=plan,
        time=time,
    )
    assert omitted(study) == {
        "b: rules": "1 row: too slow for the budget; a larger one helps",
        "c: rules": "half of the budget was over before it was judged; "
        "a larger one helps",
    }
    assert [point.name for point in study.points] == ["native: rules"]


def test_no_load_leaves_out_a_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    time = FakeTime()

    def slow_trial(*_: object, left: Callable[[], float], **__: object) -> object:
        time.now += 500_000 * MS  # of loading libraries on a busy machine
        return {} if left() > 0.0 else pytest.fail("the budget was over")

    monkeypatch.setattr(trial, "tried", slow_trial)
    study = studied(
        candidate("b", time=time, ms=1200.0),
        msgspec.structs.replace(candidate("c", time=time, ms=40.0), kind="peer"),
        candidate("native", time=time),
        plan=BenchSettings(rows=(1,), threads=(1,), rounds=6, budget_s=2.0),
        time=time,
    )
    assert {point.name for point in study.points} >= {"native: rules", "c: rules"}


def test_what_others_are_compared_with_comes_first() -> None:
    costs = {"native": 3.0, "ours": 1.0, "peer": 1.0, "other": 1.0}
    ranks = {"native": 0, "ours": 1, "peer": 2, "other": 2}
    assert fitting(costs, ranks, 210.0, 6) == {"native", "ours", "peer", "other"}
    assert fitting(costs, ranks, 41.0, 6) == {"native"}
    assert fitting(costs, dict.fromkeys(costs, 1), 209.0, 6) == {
        "ours",
        "peer",
        "other",
    }
    many = {f"peer {k}": 2.0 for k in range(20)}
    ranks = dict.fromkeys(many, 2) | {"native": 0}
    kept = fitting(many | {"native": 2.0}, ranks, 140.0, 6)
    assert "native" in kept
    assert len(kept) == 10
    assert fitting({}, {}, 1.0, 9) == set()


@pytest.mark.heavy
def test_two_threads_are_for_those_who_can_use_them() -> None:
    loads: dict[str, list[int]] = {"one": [], "both": []}
    plan = BenchSettings(rows=(2, 3), threads=(1, 2), rounds=6, budget_s=PATIENCE_S)
    study = studied(
        candidate("one", loads=loads["one"]),
        candidate("both", loads=loads["both"], is_parallel=True),
        plan=plan,
    )
    assert loads == {"one": [1], "both": [1, 2]}
    threads = {p.name: [t.threads for t in p.timings] for p in study.points}
    assert threads == {"one: rules": [1, 1], "both: rules": [1, 2, 1, 2]}


def test_what_takes_longer_to_load_again_than_there_is_time_is_an_omission() -> None:
    time = FakeTime()
    light = candidate("heavy", time=time, is_parallel=True)

    def slowly(threads: int) -> LoadedCandidate:
        time.now += 3000 * MS
        return light.load(threads)

    plan = BenchSettings(rows=(2,), threads=(1, 2), rounds=6, budget_s=5.0)
    heavy = msgspec.structs.replace(light, load=slowly)
    study = studied(heavy, plan=plan, time=time)
    why = "loading it again for 2 threads takes too long for the budget"
    assert omitted(study) == {"heavy: rules": f"2 rows: {why}; a larger one helps"}
    assert [timing.threads for timing in study.points[0].timings] == [1]


def test_nobody_waits_for_a_second_thread_that_nobody_uses() -> None:
    plan = BenchSettings(rows=(2,), threads=(1, 2), rounds=6, budget_s=PATIENCE_S)
    study = studied(candidate("native"), plan=plan)
    assert [timing.threads for timing in study.points[0].timings] == [1]


@pytest.mark.heavy
def test_rows_that_memory_does_not_hold_are_an_omission() -> None:
    plan = BenchSettings(rows=(2, 10**9), threads=(1,), rounds=6, budget_s=PATIENCE_S)
    (why,) = omitted(studied(candidate(), plan=plan)).values()
    pattern = (
        r"1,000,000,000 rows: their layouts take about \d+ GiB, and 6 are the most"
    )
    assert re.fullmatch(pattern, why)


def test_progress_grows_from_nothing_to_nearly_all() -> None:
    shares: list[float] = []
    studied(candidate(), progress=lambda _text, share: shares.append(share))
    assert shares == sorted(shares)
    assert shares[0] == pytest.approx(0.1)
    assert 0.3 < shares[-1] < 1.0


def test_json_has_every_sample_and_fits_the_schema() -> None:
    study = studied(candidate(bound=1e-9), candidate("other", error=0.25))
    schema = json.loads((ROOT / "schemas" / "bench.schema.json").read_text("utf-8"))
    facts = json.loads(study.to_json())
    jsonschema.Draft202012Validator(schema).validate(facts)
    samples = facts["points"][0]["timings"][0]["samples_ns"]
    assert samples == list(study.points[0].timings[0].samples_ns)
    assert msgspec.json.decode(study.to_json(), type=Study) == study


# --- rows


def test_rows_are_made_of_the_declared_ranges() -> None:
    tree = random_tree(2)
    values, what = made_rows(tree, 500, seed=7)
    again, _ = made_rows(tree, 500, seed=7)
    assert np.array_equal(values, again)
    assert what.startswith("made from the model's declared ranges, seed 7")
    declared = {v.name: (v.low, v.high) for v in tree.variables if not v.parts}
    for line, name in zip(values, tree.inputs, strict=True):
        low, high = declared.get(name, (None, None))
        if low is not None and high is not None:
            assert low <= line.min() <= line.max() <= high


def test_an_input_that_declares_no_range_is_named() -> None:
    variables = tuple(
        msgspec.structs.replace(v, low=None, high=None) for v in RULES.variables
    )
    rules = msgspec.structs.replace(RULES, variables=variables)
    values, what = made_rows(rules, 10)
    assert np.isfinite(values).all()
    assert f"; {rules.inputs[0]!r}" in what
    assert what.endswith(" declare none: from terms or combinations")


def test_rows_are_repeated_in_their_order() -> None:
    values = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert repeated(values, 2).tolist() == [[1.0, 2.0], [4.0, 5.0]]
    assert repeated(values, 4).tolist() == [[1.0, 2.0, 3.0, 1.0], [4.0, 5.0, 6.0, 4.0]]
    assert repeated(values, 4).flags.c_contiguous


# --- which candidates


def names_of(only: Sequence[str] = (), skip: Sequence[str] = ()) -> list[str]:
    tree = random_tree(1)
    result, _ = gather(tree, made_rows(tree, 5)[0])
    return [one.name for one in chosen(result, only, skip)[0]]


def test_candidates_have_names_of_their_own() -> None:
    names = names_of()
    assert len(names) == len(set(names)) > 30


@pytest.mark.parametrize(
    ("only", "skip", "names"),
    [
        (["native: tree"], [], ["native: tree"]),
        (["native"], ["raw rules"], ["native: tree", "native: relative rules"]),
        (["floor"], [], [
            "floor: the columns read once", "floor: an empty session call",
        ]),
        (["reference", "python"], ["tree", "raw rules"], [
            "reference: relative rules", "python: relative rules",
        ]),
    ],
)  # fmt: skip
def test_names_questions_and_kinds_choose_candidates(
    only: list[str], skip: list[str], names: list[str]
) -> None:
    assert names_of(only, skip) == names


def test_candidates_that_are_not_selected_are_counted() -> None:
    three = [candidate("a"), candidate("b"), candidate("c")]
    assert chosen(three, ["a"], ())[1] == [Omission("2 candidates", "not selected")]
    assert chosen(three, (), ())[1] == []


def test_a_name_of_nothing_is_refused_with_what_there_is() -> None:
    two = [candidate("a"), candidate("b")]
    message = "no candidate 'nativ'; there is a, b, or all of rules, runtime"
    with pytest.raises(ValueError, match=f"^{message}$"):
        chosen(two, ["nativ"], ())
    with pytest.raises(ValueError, match=f"^{message}$"):
        chosen(two, (), ["nativ"])
    with pytest.raises(ValueError, match=r"^no candidate is left to measure$"):
        chosen(two, ["a"], ["a"])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rows": (0,)}, "rows: 1 is the least, not 0"),
        ({"rows": ()}, "rows: name at least one number"),
        ({"threads": (1, -2)}, "threads: 1 is the least, not -2"),
        ({"threads": (1, 5000)}, "threads: 256 is the most, not 5000"),
        ({"budget_s": -3.0}, "the budget must be a number of seconds above 0, not -3"),
        (
            {"budget_s": math.inf},
            "the budget must be a number of seconds above 0, not inf",
        ),
        ({"most": 1.5}, r"an error of a strength lies in \[0, 1\], not at 1.5"),
        ({"rounds": 0}, "rounds: 1 is the least, not 0"),
        ({"seed": -1}, "seed: 0 is the least, not -1"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(
    wrong: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        BenchSettings(**wrong)  # type: ignore[arg-type] # the point of the test


def test_values_that_do_not_fit_are_refused() -> None:
    tree = random_tree(1)
    width = len(tree.inputs)
    with pytest.raises(ValueError, match=rf"^values must have shape \({width}, rows\)"):
        bench(tree, values=np.zeros((width + 1, 3)))
    with pytest.raises(ValueError, match=r"^there are no rows to answer"):
        bench(tree, values=np.zeros((width, 0)))


@pytest.mark.heavy
def test_a_study_of_a_real_model_agrees_with_itself() -> None:
    only = ["native", "native float32", "best-first", "python", "floor"]
    plan = BenchSettings(rows=(1, 300), threads=(1,), rounds=6, budget_s=PATIENCE_S)
    study = bench(random_tree(5), select=only, plan=plan)
    assert study.is_complete
    assert [*faults(study.points)] == []
    assert study.data.startswith("300 rows made from the model's declared ranges")
    exact = {p.name: p.error for p in study.points if p.error}
    for name, error in exact.items():
        if "float32" not in name:
            assert error.flips == 0, name
    assert {front.question for front in study.fronts} == {
        "tree",
        "relative rules",
        "raw rules",
    }
    assert all("fastest " in sentence for sentence in study.advice)


def test_rows_of_a_table_are_named_and_counted() -> None:
    tree = random_tree(1)
    values = made_rows(tree, 7)[0]
    plan = BenchSettings(rows=(5, 20), threads=(1,), rounds=6, budget_s=PATIENCE_S)
    study = bench(tree, values=values, data="t.csv", select=["native: tree"], plan=plan)
    assert study.data == "t.csv, 7 rows, repeated to make 20"
    assert study.points[0].error is not None
    assert study.points[0].error.rows == 7


def test_a_system_is_measured_in_each_runtime_that_runs_systems() -> None:
    system = random_system(4, formulas="none", defuzzifier="of curves")
    plan = BenchSettings(rows=(20,), threads=(1,), rounds=6, budget_s=20.0)
    study = bench(system, select=["native", "reference", "floor"], plan=plan)
    points = {one.name: one for one in study.points}
    assert {"native: system", "reference: system"} <= set(points)
    for measured in points.values():
        if measured.kind == "floor":
            continue
        error = measured.error
        assert error is not None
        assert error.flips == 0
        assert set(error.outputs) == {output.name for output in system.outputs}
        assert error.largest is not None
        assert error.bound is None or error.largest <= error.bound


def test_a_system_that_answers_otherwise_has_an_error() -> None:
    system = random_system(4, formulas="none", defuzzifier="of curves")
    values, _ = made_rows(system, 30)
    sample = judging.exact_sample(system, values)
    assert sample.outputs is not None
    moved = CandidateOutput(sample.labels, None, sample.outputs + 0.5)
    error = judging.measured_error(moved, sample, 1e-9, "a test")
    for output, bound in zip(system.outputs, sample.bounds, strict=True):
        assert output.low is not None
        assert output.high is not None
        measured = error.outputs[output.name]
        assert measured.largest == pytest.approx(0.5)
        assert measured.share == pytest.approx(0.5 / (output.high - output.low))
        assert measured.bound == bound
    assert error.largest == max(one.share or 0.0 for one in error.outputs.values())


def test_a_candidate_without_status_changes_rows_where_it_has_no_number() -> None:
    system = random_system(4, formulas="none", defuzzifier="of curves")
    sample = judging.exact_sample(system, made_rows(system, 30)[0])
    assert sample.outputs is not None
    numbers = sample.outputs.copy()
    row = int(np.flatnonzero(np.isfinite(numbers).all(axis=0))[0])
    numbers[0, row] = np.nan
    output = CandidateOutput(np.full(30, -1), None, numbers)
    error = judging.measured_error(output, sample, None, "")
    assert error.flips == 1
    first = error.outputs[system.outputs[0].name]
    assert (first.largest, first.share, first.bound) == (None, None, None)
    assert error.largest == math.inf


def test_an_output_beyond_its_own_bound_is_a_fault() -> None:
    outputs = {"a": OutputError(1.0, 0.01, 2.0), "b": OutputError(1.0, 0.01, 0.5)}
    wrong = replace(error_by_hand(0.01, 0.02), outputs=outputs)
    assert [*faults([point("c", 9e4, wrong, question="system")])] == [
        "c: system, output 'b': an error of 1 is larger than the certified 0.5; "
        "this is a fault"
    ]

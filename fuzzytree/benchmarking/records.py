"""What a study of run times consists of, as frozen values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import msgspec

from fuzzytree.model import FloatArray, IntArray, Result, summary
from fuzzytree.semantics import Form

Question = Form
"""What a candidate computes. Errors are measured against the exact answer to it."""

Kind = Literal["runtime", "variant", "peer", "floor"]

Bound = tuple[float, str]
"""The certified largest error of a strength, and where it comes from."""


class CandidateOutput(msgspec.Struct, frozen=True):
    """What a candidate answered.

    Attributes:
        labels: The class number of each row, -1 for no class; of a fuzzy system the
            status of each row, -1 where the candidate returns none.
        strengths: Shape (rules, rows), or None where the candidate returns none.
        outputs: Shape (outputs, rows), of a fuzzy system.
    """

    labels: IntArray
    strengths: FloatArray | None = None
    outputs: FloatArray | None = None


class LoadedCandidate(msgspec.Struct, frozen=True):
    """A candidate that is ready.

    Attributes:
        answer: Answers values of shape (inputs, rows), in the order of the model's
            inputs; not timed.
        call: Lays out the same values as the candidate wants them, outside the timed
            part, and returns the call that is timed.
        bytes: The size of the file or code that runs, if there is one.
        bound: As of a candidate, where it is known only once that is loaded.
    """

    answer: Callable[[FloatArray], CandidateOutput]
    call: Callable[[FloatArray], Callable[[], object]]
    bytes: int | None = None
    bound: Callable[[], Bound | None] | None = None


class Candidate(msgspec.Struct, frozen=True):
    """One way of running a model: a point of a study, once measured.

    Attributes:
        name: Unique in a study, as people read it.
        question: What it computes.
        kind: A runtime of ours, a variant of the model, a peer, or a floor.
        load: Prepare it for a number of threads. Raises a FuzzyTreeError, or what the
            foreign library raises; the study lists it among the omissions.
        bound: Certifies the largest error of a strength against the exact one, which
            takes its time and is called once the candidate has answered; it gives
            None, or is None, where nothing is certified.
        note: What a reader must know to compare it fairly.
        modules: The modules of others whose code runs, which may crash or hang the
            process: a child process tries it before the study does.
        is_parallel: Whether a second thread can make it faster; if not, it is timed
            with one only.
    """

    name: str
    question: Question
    kind: Kind
    load: Callable[[int], LoadedCandidate]
    bound: Callable[[], Bound | None] | None = None
    note: str = ""
    modules: tuple[str, ...] = ()
    is_parallel: bool = False


class Omission(msgspec.Struct, frozen=True):
    """What was left out of a study, and why, and whether it is a peer."""

    name: str
    why: str
    is_peer: bool = False


class Timing(msgspec.Struct, frozen=True):
    """How long calls of a candidate took, on so many rows.

    Attributes:
        rows: Rows in each call.
        threads: Threads it was allowed.
        samples_ns: Every measured time of one call, in the order of measuring.
        median_ns: Their median.
        low_ns: Lower end of the 95 % confidence interval of the median, from order
            statistics (binomial); no assumption on the distribution.
        high_ns: Upper end of it.
        confidence: How surely the median lies in the interval, exactly: at least 0.95,
            or less where fewer than six samples could be taken.
        calls: Calls in each sample; its time is divided by them.
        rounds: The round of each sample. Samples of two candidates that share a round
            were taken one after the other.
        stolen: Share of the time in which the process did not run; None where the
            clocks cannot measure it.
    """

    rows: int
    threads: int
    samples_ns: tuple[float, ...]
    median_ns: float
    low_ns: float
    high_ns: float
    confidence: float = 0.95
    calls: int = 1
    rounds: tuple[int, ...] = ()
    stolen: float | None = None


class OutputError(msgspec.Struct, frozen=True):
    """How far an output of a fuzzy system is from the definition's.

    Attributes:
        largest: The largest observed difference, in the output's unit; None where in a
            row one of the two has a number and the other none.
        share: The same as a share of the output's range; of 1 where it declares none.
        bound: The derived bound of `largest`; None where there is none.
    """

    largest: float | None
    share: float | None
    bound: float | None = None


class Error(msgspec.Struct, frozen=True):
    """How far a candidate is from the exact answer to its question.

    Attributes:
        rows: Rows on which it was observed.
        largest: The largest observed difference of a strength from the exact one, or of
            an output of a fuzzy system from the definition's, as a share of its range;
            None where the candidate returns neither.
        bound: The certified bound of it; None where there is none.
        origin: Where the bound comes from, or why there is none.
        flips: Rows whose class differs from the exact one; in a fuzzy system those
            whose status does, or, of a candidate without, which outputs have a number.
        largest_flip_margin: The largest exact margin of such a row.
        in_band: Share of rows whose exact margin is at most twice the bound.
        cover_lost: Rows that a rule covers exactly and none in the candidate.
        cover_gained: Rows that none covers exactly and one in the candidate.
        outputs: The error of each output of a fuzzy system.
    """

    rows: int
    largest: float | None
    bound: float | None
    origin: str
    flips: int
    largest_flip_margin: float | None = None
    in_band: float | None = None
    cover_lost: int = 0
    cover_gained: int = 0
    outputs: dict[str, OutputError] = {}


class Point(msgspec.Struct, frozen=True):
    """A candidate, measured: run time against error.

    Attributes:
        name: Unique in a study.
        question: What it computes.
        kind: As of the candidate.
        error: On rows of the study; None for a floor, which answers nothing.
        timings: One for each number of rows and threads.
        load_ms: What it took to prepare it, in milliseconds, once.
        bytes: The size of the file or code that runs, if there is one.
        note: What a reader must know to compare it fairly.
        probes: The error on rows aimed at edges and cuts, where representations part;
            it says nothing about how often that happens in use.
    """

    name: str
    question: Question
    kind: Kind
    error: Error | None
    timings: tuple[Timing, ...]
    load_ms: float
    bytes: int | None = None
    note: str = ""
    probes: Error | None = None


class Machine(msgspec.Struct, frozen=True):
    """Where and with what it was measured.

    Attributes:
        processor: As the system names it.
        cores: How many the process may use.
        system: Operating system and its version.
        python: Its version.
        versions: Of each package that took part.
        load_before: Load averages of 1, 5 and 15 minutes, where the system has them.
        load_after: The same at the end.
        stolen: Share of the wall time in which the process was ready and did not run,
            as far as the clocks measure it; None where they do not.
    """

    processor: str
    cores: int
    system: str
    python: str
    versions: dict[str, str]
    load_before: tuple[float, ...] = ()
    load_after: tuple[float, ...] = ()
    stolen: float | None = None


class Front(msgspec.Struct, frozen=True):
    """Whom nobody beats in both run time and error, for one question.

    Attributes:
        question: What they compute.
        rows: Rows in each call.
        threads: Threads they were allowed.
        names: From the fastest to the one with the smallest error.
    """

    question: Question
    rows: int
    threads: int
    names: tuple[str, ...]


class Study(Result, msgspec.Struct, frozen=True):
    """Error against run time for one model.

    Attributes:
        model: The model's name.
        fingerprint: The SHA-256 of its content.
        data: What the rows are: a file's name, or how they were made.
        machine: Where it was measured.
        points: What was measured, floors among it.
        omissions: What was left out and why.
        warnings: What makes the numbers doubtful, such as a noisy machine.
        advice: For an error of at most E, what to use, and how much faster than what.
        is_complete: False if the budget or the user ended it early.
        fronts: Of each question, number of rows and number of threads.
        seed: Of made rows and of the order of the rounds.
        seconds: What the whole study took.
        is_interrupted: Whether the user ended it early.
    """

    model: str
    fingerprint: str
    data: str
    machine: Machine
    points: tuple[Point, ...]
    omissions: tuple[Omission, ...]
    warnings: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()
    is_complete: bool = True
    fronts: tuple[Front, ...] = ()
    seed: int = 0
    seconds: float = 0.0
    is_interrupted: bool = False

    def __repr__(self) -> str:
        """Show how much was measured, and how much was left out."""
        return summary("Study", points=len(self.points), omissions=len(self.omissions))

    def to_json(self) -> str:
        """Return the same facts for programs, every raw timing included."""
        raw = msgspec.json.encode(self)
        return msgspec.json.format(raw, indent=2).decode()

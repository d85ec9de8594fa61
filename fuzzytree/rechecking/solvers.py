"""Solvers of SMT-LIB 2: the package z3, or any program that reads standard input."""

from __future__ import annotations

import importlib
import itertools
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, NamedTuple

from fuzzytree.rechecking.claims import Statement
from fuzzytree.rechecking.outcomes import CannotRunError

STEPS_OF_A_CLAIM, STEPS_OF_MORE, STEPS_IN_ALL = 2_000_000, 100_000, 40_000_000
"""Of z3's own count of its work, which is the same on any machine: for a claim, for one
beside a claim of the same answer that stays unknown, and for all of them."""
MOST_SECONDS = 3600
"""After which a program that does not end is stopped."""
_ARGUMENTS = {
    "z3": ("-in",),
    "cvc5": ("--lang=smt2", "--incremental"),
    "yices-smt2": ("--incremental",),
    "yices_smt2": ("--incremental",),
}
"""What makes a program read standard input, and several questions of it."""
_ANSWER = re.compile(r"sat|unsat|unknown")


class Results(NamedTuple):
    """The answers to claims, one after the other, and which solver gave them."""

    solver: str
    answers: list[str]


def script_text(text: str, statements: Sequence[Statement]) -> str:
    """Return a model's text with its claims, each between push and pop."""
    return "\n".join([text, *map(_block, statements)])


def _block(claim: Statement) -> str:
    text = "".join(c if c.isprintable() else " " for c in claim.text)
    return (
        f"(push 1) ; {text}: {claim.expected} proves it\n"
        f"(assert {claim.formula})\n(check-sat)\n(pop 1)\n"
    )


def ask(
    text: str, statements: Sequence[Sequence[Statement]], program: str = ""
) -> Results:
    """Ask a solver for each claim about a model.

    Args:
        text: The model.
        statements: The claims of each answer.
        program: The path of a program, and its arguments; the package z3 by default.

    Returns:
        The answers; of a solver without a name if there is none.
    """
    every = [*itertools.chain(*statements)]
    if program:
        return _ask_program(text, every, program)
    try:
        z3: Any = importlib.import_module("z3")
    except ImportError:
        return Results("", ["unknown"] * len(every))
    name = f"z3 {z3.get_version_string()}"
    context, answers, left = z3.Context(), list[str](), STEPS_IN_ALL

    def run(command: str) -> str:
        try:
            result: str = z3.Z3_eval_smtlib2_string(context.ref(), command)
        except z3.Z3Exception as error:
            raise CannotRunError(f"{name}: it fails: {error!s:.200}") from error
        return result.strip()

    def steps_so_far() -> int:
        match = re.search(r"\d+", run("(get-info :rlimit)"))
        return int(match[0]) if match else 0

    run(text)
    claims = ((claim, place) for place, of in enumerate(statements) for claim in of)
    unknown: set[int] = set()
    for claim, place in claims:
        most = STEPS_OF_MORE if place in unknown else STEPS_OF_A_CLAIM
        steps = min(left, most)
        if steps <= 0:
            answers.append("unknown")
            continue
        before = steps_so_far()
        reply = run(f"(set-option :rlimit {steps})\n{_block(claim)}")
        left -= steps_so_far() - before
        if not _ANSWER.fullmatch(reply):
            raise CannotRunError(f"{name}: it answers {reply!r:.100}")
        answers.append(reply)
        if reply == "unknown":
            unknown.add(place)
    return Results(name, answers)


def _ask_program(text: str, statements: Sequence[Statement], program: str) -> Results:
    path, *arguments = shlex.split(program)
    if shutil.which(path) is None:
        raise CannotRunError(f"{path}: no such program")
    name = PurePath(path).stem
    try:
        ran = subprocess.run(
            [path, *(arguments or _ARGUMENTS.get(name, ()))],
            input=script_text(text, statements),
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
            timeout=MOST_SECONDS,
        )
    except subprocess.TimeoutExpired as error:
        raise CannotRunError(f"{path}: no answer in {MOST_SECONDS:,} s") from error
    except OSError as error:
        raise CannotRunError(f"{path}: {error.strerror or error}") from error
    answers = ran.stdout.split()
    is_wrong = not all(map(_ANSWER.fullmatch, answers))
    if is_wrong or (ran.returncode and len(answers) < len(statements)):
        reply = (ran.stdout if is_wrong else ran.stderr).strip()
        reply = reply or f"exit {ran.returncode}"
        raise CannotRunError(f"{path}: it fails: {reply!r:.200}")
    if len(answers) != len(statements):
        counts = f"{len(answers)} answers to {len(statements)} claims"
        raise CannotRunError(f"{path}: {counts}")
    return Results(name, answers)

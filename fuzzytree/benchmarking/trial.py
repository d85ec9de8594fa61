"""Foreign code is tried in a process of its own before it may run in ours.

A library may end the process or never return, and no `except` catches that. So a child
process loads every foreign candidate, lets it answer a few rows and reports; what ends
it, or takes too long, is left out of the study, and another child goes on behind it.
One child does for all that behave. What only happens later, in a study's own calls, is
not caught: they do the same on more rows.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import IO, cast

from fuzzytree.benchmarking.candidates import gather
from fuzzytree.benchmarking.records import Candidate
from fuzzytree.model import Document, FloatArray, Progress

_START = """
import json, sys
sys.path[:] = json.loads(sys.stdin.buffer.readline())
from fuzzytree.benchmarking import trial
trial.serve()
"""
_SECONDS = 60.0  # imports of large libraries included
_PATIENCE_S = 5.0
_LATE = "a third of the budget was over before it was tried; a larger one helps"


def tried(
    model: Document,
    names: Sequence[str],
    values: FloatArray,
    *,
    peers: str | None = None,
    seconds: float = _SECONDS,
    left: Callable[[], float] = lambda: math.inf,
    progress: Progress | None = None,
) -> dict[str, str]:
    """Return why candidates cannot be run, by name; those that can are not in it.

    Each has `seconds` to load and to answer the few rows of `values`; what is not tried
    when no time is `left` is not run.
    """
    faults: dict[str, str] = {}
    todo = list(names)
    while todo and left() > 0.0:
        done = _one_child(model, todo, values, peers, seconds, left, progress)
        faults |= {name: why for name, why in done.items() if why}
        todo = [name for name in todo if name not in done]
    return faults | dict.fromkeys(todo, _LATE)


def _one_child(
    model: Document,
    names: Sequence[str],
    values: FloatArray,
    peers: str | None,
    seconds: float,
    left: Callable[[], float],
    progress: Progress | None,
) -> dict[str, str]:
    """Return what one child says of each candidate until it ends; "" for well."""
    done: dict[str, str] = {}
    lines: queue.Queue[bytes | None] = queue.Queue()
    patience = seconds
    with (
        tempfile.TemporaryFile() as talk,
        subprocess.Popen(
            [sys.executable, "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=talk,
        ) as child,
    ):
        source, target = cast("IO[bytes]", child.stdout), cast("IO[bytes]", child.stdin)
        reader = threading.Thread(target=_read, args=(source, lines), daemon=True)
        reader.start()
        try:
            _send(target, (peers, model, names, values))
            for position, name in enumerate(names):
                if progress:
                    progress(f"trying {name}", position / len(names))
                patience = min(seconds, max(left(), 0.0))
                line = lines.get(timeout=patience)
                if line is None:
                    done[name] = _end_text(child.wait(), talk)
                    break
                done[name] = json.loads(line)
        except queue.Empty:
            late = f"it did not answer within {seconds:g} s"
            done[names[len(done)]] = late if patience == seconds else _LATE
        finally:
            child.kill()
            reader.join(_PATIENCE_S)  # it ends with the child's last line
    return done


def _send(
    stream: IO[bytes], work: tuple[str | None, Document, Sequence[str], object]
) -> None:
    try:
        stream.write(json.dumps(sys.path).encode() + b"\n")
        stream.write(pickle.dumps(work))
        stream.close()
    except BrokenPipeError:
        pass  # it has ended, which its exit code will show


def _read(stream: IO[bytes], lines: queue.Queue[bytes | None]) -> None:
    """Pass on the lines of a stream as they arrive, and None at its end."""
    for line in stream:
        lines.put(line)
    lines.put(None)


def _end_text(code: int, talk: IO[bytes]) -> str:
    """Say how a child ended, and the last thing it said."""
    talk.seek(0)
    lines = talk.read().decode("utf-8", "replace").strip().splitlines()
    last = f": {lines[-1]}" if lines else ""
    if code < 0:
        names = {int(one): one.name for one in signal.Signals}
        return f"it crashed the process ({names.get(-code, f'signal {-code}')}){last}"
    return f"it ended the process (exit code {code}){last}"


def serve() -> None:
    """Be the child: try what stdin names, and write a line of JSON for each."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints must not look like a report
    peers, model, names, values = cast(
        "tuple[str | None, Document, Sequence[str], FloatArray]",
        pickle.loads(sys.stdin.buffer.read()),  # written by our own parent
    )
    known = {one.name: one for one in gather(model, values, peers)[0]}
    for name in names:
        out.write(json.dumps(_try(known, name, values)).encode() + b"\n")
        out.flush()


def _try(known: Mapping[str, Candidate], name: str, values: FloatArray) -> str:
    if name not in known:
        return "it could not be made again in a child process"
    try:
        loaded = known[name].load(1)
        loaded.answer(values)
        loaded.call(values)()
    except Exception as error:  # whatever foreign code raises is a finding
        return error_text(error)
    return ""


def error_text(error: Exception) -> str:
    """Return the first line of what an error says, or its type.

    Example:
        >>> error_text(KeyError())
        'KeyError'
    """
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__

"""Generated C as a runtime: what `fuzzytree.exporters.c` writes, compiled and loaded.

The file is compiled in a folder of its own, which is gone when the library is loaded.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from fuzzytree.errors import FuzzyTreeError, LossError, MissingExtraError
from fuzzytree.exporters import write_c
from fuzzytree.model import (
    Document,
    FloatArray,
    FuzzySystem,
    Model,
    Outcome,
    Run,
    Runtime,
)
from fuzzytree.runtimes.rows import checked, system_outcome
from fuzzytree.runtimes.table import rules_only

if TYPE_CHECKING:
    import numpy.typing as npt

    Decide = Callable[..., None]

Dtype = Literal["float64", "float32"]

COMPILERS = ("gcc", "cc", "clang")
"""The programs of which one is needed; the first that is found compiles."""

_OPTIONS = ("-std=c99", "-ffp-contract=off", "-shared", "-fPIC", "-x", "c", "-")
_LONG = 1 << 19  # bytes of straight code, on which more than -O0 takes minutes
_LONGEST_WAIT = 600.0  # seconds

_LOOP = """
#include <stddef.h>

/* Answer many rows: x holds one line of `rows` values for each input. The strengths of
 * a row go to `fired`; where that is null, the winner alone is looked for. */
extern void model_many(const model_real *x, size_t rows, int64_t *rule,
    int64_t *status, model_real *fired, double *strengths)
{
    model_real row[MODEL_INPUTS + 1];
    size_t place, line;
    for (place = 0; place < rows; place++) {
        model_answer found;
        for (line = 0; line < MODEL_INPUTS; line++)
            row[line] = x[line * rows + place];
        FIND
        rule[place] = found.rule;
        status[place] = found.status;
    }
}
"""

_INFER_LOOP = """
#include <stddef.h>

extern void model_many(const model_real *x, size_t rows, double *outputs,
    int64_t *status)
{
    model_real row[MODEL_INPUTS + 1], found[MODEL_OUTPUTS];
    size_t place, line;
    for (place = 0; place < rows; place++) {
        for (line = 0; line < MODEL_INPUTS; line++)
            row[line] = x[line * rows + place];
        status[place] = model_infer(row, found);
        for (line = 0; line < MODEL_OUTPUTS; line++)
            outputs[line * rows + place] = (double)found[line];
    }
}
"""

_DECIDE = "(void)fired, (void)strengths, found = model_decide(row);"

_EITHER = """\
found = fired ? model_strengths(row, fired) : model_decide(row);
        for (line = 0; fired && line < MODEL_RULES; line++)
            strengths[line * rows + place] = (double)fired[line];
"""


def load(
    model: Document, dtype: Dtype = "float64", *, with_strengths: bool = True
) -> Run:
    """Return a function that answers rows by compiled C.

    Without `with_strengths` only the winner of a rule base is looked for.

    Raises:
        LossError: If float32 cannot represent a number of the model.
        MissingExtraError: If no compiler is installed.
        FuzzyTreeError: If the compiler fails.
    """
    if isinstance(model, FuzzySystem):
        return _load_system(model, dtype, with_strengths=with_strengths)
    try:
        written = write_c(model, dtype=dtype, name="model", selftest=False)
    except LossError as error:
        text = str(error).replace("cannot write", "cannot run", 1)
        raise LossError(text.partition("\n  pass allow_loss")[0]) from error
    return load_content(written.content, model, dtype, with_strengths=with_strengths)


def load_content(
    content: bytes,
    model: Model,
    dtype: Dtype = "float64",
    *,
    prefix: str = "model",
    with_strengths: bool = True,
) -> Run:
    """Return the same for a file that `fuzzytree.exporters.c` wrote of a model.

    `prefix` is the beginning of all names in the file.

    Raises:
        MissingExtraError: As `load`.
        FuzzyTreeError: As `load`.
    """
    find = _EITHER if model.rules else _DECIDE
    loop = _LOOP.replace("FIND", find).replace("model_", f"{prefix}_")
    loop = loop.replace("MODEL_", f"{prefix.upper()}_")
    decide = compiled(content, loop, 4, function=f"{prefix}_many")
    count = len(model.rules) if with_strengths else 0
    real = np.dtype(dtype)

    def run(values: FloatArray) -> Outcome:
        array = checked(values, model.inputs)
        with np.errstate(over="ignore"):  # what float32 cannot hold is missing
            inputs = np.ascontiguousarray(array, real)
        rows = array.shape[1]
        rule, status = np.empty((2, rows), np.int64)
        fired = np.empty(count, real) if count else None
        strengths = np.empty((count, rows), np.float64) if count else None
        filled = map(_at, (rule, status, fired, strengths))
        decide(_at(inputs), rows, *filled)
        return Outcome(rule, status, strengths)

    return run


def load_best_first(model: Model, *, with_strengths: bool = False) -> Run:
    """Return a function that looks for the winner of a rule base alone.

    Raises:
        LossError: If the model is no rule base.
    """
    rules = rules_only(model, "c best-first", "searches")
    return load(rules, with_strengths=False)


def _load_system(system: FuzzySystem, dtype: Dtype, *, with_strengths: bool) -> Run:
    """Return a function that answers rows of a fuzzy system by compiled C."""
    file = write_c(
        system,
        dtype=dtype,
        name="model",
        activations=with_strengths,
        selftest=False,
        tables=True,  # quicker where memory is no concern
    )
    return load_system_content(
        file.content, system, dtype, with_strengths=with_strengths
    )


def load_system_content(
    content: bytes,
    system: FuzzySystem,
    dtype: Dtype = "float64",
    *,
    prefix: str = "model",
    with_strengths: bool = True,
) -> Run:
    """Return the same for a file that `fuzzytree.exporters.c` wrote of a system.

    `prefix` is the beginning of all names in the file, which gives activations if
    `with_strengths`.

    Raises:
        MissingExtraError: As `load`.
        FuzzyTreeError: As `load`.
    """
    speed = "-O0" if len(content) > _LONG else "-O2"
    loop = _INFER_LOOP.replace("model_", f"{prefix}_")
    loop = loop.replace("MODEL_", f"{prefix.upper()}_")
    infer = compiled(content, loop, 2, speed, f"{prefix}_many")
    count = len(system.outputs) + with_strengths * len(system.rules)

    def run(values: FloatArray) -> Outcome:
        inputs = np.ascontiguousarray(checked(values, system.inputs), dtype)
        rows = inputs.shape[1]
        numbers, status = np.empty((count, rows)), np.empty(rows, np.int64)
        infer(_at(inputs), rows, _at(numbers), _at(status))
        return system_outcome(system, np.vstack([numbers, status.astype(np.float64)]))

    return run


def _at(array: npt.NDArray[np.generic] | None) -> int | None:
    return None if array is None else array.ctypes.data


@lru_cache(maxsize=64)
def compiled(
    content: bytes,
    loop: str,
    pointers: int,
    speed: str = "-O2",
    function: str = "model_many",
) -> Decide:
    """Return a function of a loop behind a file.

    The function takes a pointer, a number of rows, and `pointers` more pointers.

    Raises:
        MissingExtraError: If no compiler is installed.
        FuzzyTreeError: If the compiler fails.
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise MissingExtraError(f"the runtime 'c' needs one of {', '.join(COMPILERS)}")
    with tempfile.TemporaryDirectory(prefix="fuzzytree-") as folder:
        path = Path(folder, "model.so")
        done = subprocess.run(
            [compiler, speed, *_OPTIONS, "-o", str(path), "-lm"],
            input=content + loop.encode("ascii"),
            capture_output=True,
            check=False,
            timeout=_LONGEST_WAIT,
        )
        if done.returncode:
            message = done.stderr.decode("utf-8", "replace").strip()[:1000]
            raise FuzzyTreeError(f"{compiler} cannot compile the model: {message}")
        result = getattr(ctypes.CDLL(str(path)), function)
    pointer = ctypes.c_void_p
    result.argtypes = [pointer, ctypes.c_size_t, *[pointer] * pointers]
    result.restype = None
    many: Decide = result
    return many


_FLOAT32 = "numbers beyond float32, and different numbers that become one in it"

RUNTIMES = (
    Runtime(
        "c",
        ("tree", "rules", "system"),
        load,
        programs=COMPILERS,
    ),
    Runtime(
        "c best-first",
        ("rules",),
        load_best_first,
        cannot=("strengths of rules",),
        programs=COMPILERS,
    ),
    Runtime(
        "c float32",
        ("tree", "rules"),
        partial(load, dtype="float32"),
        dtype="float32",
        cannot=(_FLOAT32,),
        programs=COMPILERS,
    ),
)

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
from fuzzytree.exporters import FixedSteps, write_c
from fuzzytree.model import (
    Document,
    FloatArray,
    Model,
    Outcome,
    Run,
    Runtime,
)
from fuzzytree.runtimes.rows import checked
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

/* Answer many rows: x holds one line of `rows` values for each input. The numbers of a
 * row go to `made` first; where that is null, the winner alone is looked for. */
extern void model_many(const model_real *x, size_t rows, int64_t *rule,
    int64_t *status, model_real *made, double *numbers)
{
    model_real row[MODEL_INPUTS + 1];
    size_t place, line;
    for (place = 0; place < rows; place++) {
        for (line = 0; line < MODEL_INPUTS; line++)
            row[line] = x[line * rows + place];
        FIND
        for (line = 0; made && line < COUNT; line++)
            numbers[line * rows + place] = (double)made[line];
    }
}
"""

_ANSWER = """{
            model_answer found = ANSWER;
            rule[place] = found.rule;
            status[place] = found.status;
        }"""


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
    is_system = bool(model.outputs)
    try:
        written = write_c(
            model,
            dtype=dtype,
            name="model",
            activations=is_system and with_strengths,
            selftest=False,
            tables=is_system,  # quicker where memory is no concern
        )
    except LossError as error:
        text = str(error).replace("cannot write", "cannot run", 1)
        raise LossError(text.partition("\n  pass allow_loss")[0]) from error
    return load_content(written.content, model, dtype, with_strengths=with_strengths)


def load_content(
    content: bytes,
    model: Document,
    dtype: Dtype = "float64",
    *,
    prefix: str = "model",
    with_strengths: bool = True,
    fixed: FixedSteps | None = None,
) -> Run:
    """Return the same for a file that `fuzzytree.exporters.c` wrote of a model.

    `prefix` is the beginning of all names in the file, which gives the activations of a
    system if `with_strengths`. Of a file that is `fixed`, values become the nearest
    that it has.

    Raises:
        MissingExtraError: As `load`.
        FuzzyTreeError: As `load`.
    """
    count = len(model.outputs) + with_strengths * len(model.rules)
    find = "status[place] = model_infer(row, made);"
    if not model.outputs:
        decide = "made ? model_strengths(row, made) : model_decide(row)"
        decide = decide if model.rules else "model_decide(row)"
        find = _ANSWER.replace("ANSWER", decide)
    loop = _LOOP.replace("FIND", find).replace("COUNT", str(count))
    loop = loop.replace("model_", f"{prefix}_").replace("MODEL_", f"{prefix.upper()}_")
    is_long = bool(model.outputs) and len(content) > _LONG
    answer = compiled(content, loop, 4, "-O0" if is_long else "-O2", f"{prefix}_many")
    real = np.dtype(fixed.fixed.kind if fixed else dtype)

    def run(values: FloatArray) -> Outcome:
        array = checked(values, model.inputs)
        array = fixed.whole_inputs(array) if fixed else array
        with np.errstate(over="ignore"):  # what float32 cannot hold is missing
            inputs = np.ascontiguousarray(array, real)
        rows = array.shape[1]
        rule, status = np.zeros((2, rows), np.int64)
        made = np.empty(count, real) if count else None
        numbers = np.empty((count, rows), np.float64)
        answer(_at(inputs), rows, *map(_at, (rule, status, made, numbers)))
        numbers /= fixed.output_units if fixed else 1.0
        outputs, strengths = np.split(numbers, [len(model.outputs)])
        return Outcome(
            rule,
            status,
            strengths if len(strengths) else None,
            outputs=outputs if model.outputs else None,
        )

    return run


def load_best_first(model: Model, *, with_strengths: bool = False) -> Run:
    """Return a function that looks for the winner of a rule base alone.

    Raises:
        LossError: If the model is no rule base.
    """
    rules = rules_only(model, "c best-first", "searches")
    return load(rules, with_strengths=False)


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

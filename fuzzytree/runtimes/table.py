"""What can execute a model, one module per runtime family, and their table.

A runtime is a value in the tuple `RUNTIMES` of its module (see
`fuzzytree.model.contracts.Runtime`), and the module a line in `TABLE`. These modules
import what they run on only inside `load`, so the table can be read without it.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import shutil
from collections.abc import Sequence

from fuzzytree.errors import LossError, install_hint
from fuzzytree.model import (
    Document,
    Dtype,
    RuleBase,
    Run,
    Runtime,
    as_names,
    remember,
)

TABLE = (
    "fuzzytree.runtimes.reference",
    "fuzzytree.runtimes.native",
    "fuzzytree.runtimes.onnxruntime",
    "fuzzytree.runtimes.python",
    "fuzzytree.runtimes.c",
    "fuzzytree.runtimes.skfuzzy",
)
"""The modules that hold `RUNTIMES`; the reference comes first."""


def all_runtimes() -> tuple[Runtime, ...]:
    """Return every runtime of the table, installed or not, in its order."""
    return tuple(runtime for module in TABLE for runtime in _runtimes_of(module))


def find_runtime(name: str) -> Runtime:
    """Return the runtime of that name.

    Raises:
        ValueError: If there is none; the message lists all of them.
    """
    for module in TABLE:
        for runtime in _runtimes_of(module):
            if runtime.name == name:
                return runtime
    known = [runtime.name for runtime in all_runtimes()]
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise ValueError(f"no runtime {name!r}; there is {', '.join(known)}{hint}")


def baseline(dtype: Dtype = "float64") -> Runtime:
    """Return the runtime with which the others of a number type are compared.

    Example:
        >>> baseline("float32").name
        'native float32'
    """
    every = (runtime for module in TABLE for runtime in _runtimes_of(module))
    return next(one for one in every if one.is_baseline and one.dtype == dtype)


def definition() -> Runtime:
    """Return the runtime that evaluates the definition, row by row."""
    return next(runtime for runtime in all_runtimes() if runtime.is_definition)


def chosen_runtimes(names: Sequence[str] | None) -> tuple[Runtime, ...]:
    """Return the runtimes of those names; all of the table if None.

    Raises:
        ValueError: If one is unknown; the message lists all of them.
    """
    if names is None:
        return all_runtimes()
    return tuple(map(find_runtime, as_names(names)))


def is_installed(runtime: Runtime) -> bool:
    """Return whether the modules and one of the programs it needs are there."""
    has_program = not runtime.programs or any(map(shutil.which, runtime.programs))
    return has_program and all(map(importlib.util.find_spec, runtime.modules))


def needed_by(runtime: Runtime) -> str:
    """Return what a runtime that is not installed needs, for a message.

    Example:
        >>> needed_by(find_runtime("c"))
        'one of the programs gcc, cc, clang'
    """
    if runtime.programs:
        return f"one of the programs {', '.join(runtime.programs)}"
    return install_hint(runtime.extra or "")


def run_of(model: Document, runtime: Runtime, *, with_strengths: bool = False) -> Run:
    """Return what executes a model; where threads may share it, it is made once.

    Raises:
        LossError: If the runtime cannot carry the model.
    """
    has_strengths = with_strengths and bool(model.rules)

    def load() -> Run:
        return runtime.load(model, with_strengths=has_strengths)

    if not runtime.is_reentrant:
        return load()
    return remember(model, (runtime.name, has_strengths), load)


def rules_only(model: Document, runtime: str, verb: str) -> RuleBase:
    """Return a rule base.

    Raises:
        LossError: If it is a tree; the message says what the runtime does with rules.
    """
    if isinstance(model, RuleBase):
        return model
    raise LossError(
        f"cannot run {model.name} as {runtime}: it {verb} rule bases, and this "
        "is a tree\n  pass rules_from_tree(tree)"
    )


def _runtimes_of(module: str) -> tuple[Runtime, ...]:
    result: tuple[Runtime, ...] = importlib.import_module(module).RUNTIMES
    return result

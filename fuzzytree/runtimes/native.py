"""The runtimes that need numpy and nothing else, in three number types."""

from __future__ import annotations

from functools import partial

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Document,
    Dtype,
    FuzzySystem,
    FuzzyTree,
    Model,
    RuleBase,
    Run,
    Runtime,
)
from fuzzytree.numerics import losses
from fuzzytree.runtimes.best_first import search
from fuzzytree.runtimes.descent import follow
from fuzzytree.runtimes.native_rules import fire
from fuzzytree.runtimes.programs import run_system
from fuzzytree.runtimes.table import rules_only


def load(
    model: Document, dtype: Dtype = "float64", *, with_strengths: bool = True
) -> Run:
    """Return a function that answers many rows at once.

    A tree is descended; of a rule base every rule is fired; of a fuzzy system the
    program is run.

    Raises:
        LossError: If the type cannot hold the model.
    """
    lost = losses(model, dtype)
    if lost:
        result = "; ".join(f"{loss.where}: {loss.what}" for loss in lost[:3])
        more = f"; and {len(lost) - 3} more" if len(lost) > 3 else ""
        raise LossError(f"cannot run {model.name} in {dtype}: {result}{more}")
    match model:
        case FuzzyTree():
            return follow(model, dtype)
        case RuleBase():
            return fire(model, dtype)
        case FuzzySystem():
            return run_system(model, with_strengths=with_strengths)


def load_best_first(model: Model, *, with_strengths: bool = False) -> Run:
    """Return a function that answers a rule base by searching it as a tree.

    Raises:
        LossError: If the model is no rule base.
    """
    return search(rules_only(model, "best-first", "searches"))


_FLOAT32 = "numbers beyond float32, and different numbers that become one in it"

RUNTIMES = (
    Runtime(
        "native",
        ("tree", "rules", "system"),
        load,
        is_baseline=True,
        in_audits=True,
        is_reentrant=True,
        in_variants=True,
    ),
    Runtime(
        "native mixed",
        ("tree", "rules"),
        partial(load, dtype="mixed"),
        dtype="mixed",
        is_baseline=True,
        in_audits=True,
        is_reentrant=True,
    ),
    Runtime(
        "native float32",
        ("tree", "rules"),
        partial(load, dtype="float32"),
        dtype="float32",
        cannot=(_FLOAT32,),
        is_baseline=True,
        in_audits=True,
        is_reentrant=True,
    ),
    Runtime(
        "best-first",
        ("rules",),
        load_best_first,
        cannot=("strengths of rules",),
        is_reentrant=True,
        note="the winner without the strengths of the others",
    ),
)

"""Peers beside ours: what others would run for the same question, in the same study.

A tree's cuts are carried over to trees of other libraries, a rule base's terms and a
system to fuzzy engines. Every peer answers rows with missing values, and those beyond
its number type, in our code; its own code sees the others.
"""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable, Sequence
from ctypes.util import find_library
from functools import partial
from typing import Any

import msgspec

from fuzzytree.benchmarking.candidates import Bounds, questions, title
from fuzzytree.benchmarking.records import (
    Bound,
    Candidate,
    LoadedCandidate,
    Omission,
    Question,
)
from fuzzytree.model.contracts import Document, Dtype, Model
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.system import FuzzySystem
from fuzzytree.model.tree import FuzzyTree
from peers import engines, evaluator, systems, trees
from peers.sampling import lines_bound

_PYTHON = "one row after another"
_SINGLE = "compares values rounded to float32 with cuts in double"
_BARE = "missing values are not looked for within the call"
_LINES = f"the strongest rule is taken by us: it has no word for ties; {_BARE}"


class Peer(msgspec.Struct, frozen=True):
    """A peer that follows a tree's path or runs a system.

    Attributes:
        name: As in the candidate's name.
        modules: What must be importable.
        load: Prepares a tree or a system for a number of threads.
        note: What a reader must know to compare it fairly.
        program: A program that it needs, if any.
        library: A library of C or C++ that it needs, if any.
        is_parallel: Whether a second thread can make it faster.
    """

    name: str
    modules: tuple[str, ...]
    load: Callable[[Any, int], LoadedCandidate]
    note: str
    program: str | None = None
    library: str | None = None
    is_parallel: bool = False


TREE_PEERS = (
    Peer("scikit-learn", ("sklearn",), trees.load_scikit_learn, _SINGLE),
    Peer(
        "scikit-learn core",
        ("sklearn",),
        trees.load_scikit_learn_core,
        f"what predict calls behind its checks; {_SINGLE}; {_BARE}",
    ),
    Peer(
        "skl2onnx",
        ("sklearn", "skl2onnx", "onnx", "onnxruntime"),
        trees.load_skl2onnx,
        "from the scikit-learn tree, in onnxruntime, all in float32, without zipmap; "
        f"{_BARE}",
        is_parallel=True,
    ),
    Peer(
        "treelite",
        ("treelite",),
        trees.load_treelite,
        f"its interpreter GTIL, in double; {_BARE}",
        is_parallel=True,
    ),
    Peer(
        "m2cgen python",
        ("sklearn", "m2cgen"),
        trees.load_m2cgen_python,
        f"its generated Python, in double; {_PYTHON}; {_BARE}",
    ),
    Peer(
        "m2cgen c",
        ("sklearn", "m2cgen"),
        trees.load_m2cgen_c,
        f"its generated C, in double, by gcc -O3, in a loop of ours; {_BARE}",
        program="gcc",
    ),
)
"""Peers for the question `tree`."""

_MISSING = "rows with missing values are answered by us"
SYSTEM_PEERS = (
    Peer(
        "pyfuzzylite",
        ("fuzzylite",),
        systems.load_fuzzylite,
        f"the system as FLL; {_MISSING}",
    ),
    Peer(
        "fuzzylite c++",
        (),
        systems.load_fuzzylite_cpp,
        f"the system as FLL, in a loop of ours by g++ -O2; {_MISSING}",
        program="g++",
        library="fuzzylite",
    ),
    Peer(
        "ferrifuzz",
        ("ferrifuzz",),
        systems.load_ferrifuzz,
        f"on all cores, whatever the number of threads; {_MISSING}",
    ),
    Peer(
        "simpful",
        ("simpful",),
        systems.load_simpful,
        f"{_PYTHON}; curves that it lacks as points joined by lines; {_MISSING}",
    ),
    Peer(
        "scikit-fuzzy",
        ("skfuzzy", "scipy", "networkx"),
        systems.load_scikit_fuzzy,
        "degrees at points joined by lines; a weighted average is another number "
        f"there, the centroid of spikes; {_MISSING}",
    ),
)
"""Peers for the question `system`."""

_PACKAGES = {
    "sklearn": "scikit-learn",
    "skfuzzy": "scikit-fuzzy",
    "fuzzylite": "--no-deps pyfuzzylite",
}
"""What pip calls the modules that have another name there."""


def _uncertified(rules: Document, dtype: Dtype) -> None:
    """Certify nothing."""


def peers(
    model: Document, bounds: Bounds = _uncertified
) -> tuple[list[Candidate], list[Omission]]:
    """Return a candidate for each peer and each question that it can answer.

    Args:
        model: A tree, a rule base or a fuzzy system.
        bounds: Certifies the strengths of a rule base in a number type.

    Returns:
        The candidates, and the peers that are not installed or have no use here.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> found, omitted = peers(random_tree(1))
        >>> {candidate.kind for candidate in found}
        {'peer'}
    """
    found: list[Candidate] = []
    omitted: dict[str, Omission] = {}
    for question, form in questions(model).items():
        match form:
            case RuleBase():
                made, left = _of_rules(form, question, bounds)
            case FuzzyTree():
                made, left = _of_tree(form)
            case FuzzySystem():
                made, left = _of_table(form, SYSTEM_PEERS)
        for one in made:
            name = title(one.name, question)
            found.append(msgspec.structs.replace(one, name=name, question=question))
        omitted |= {one.name: one for one in left}
    return found, [*omitted.values()]


def _of_tree(tree: FuzzyTree) -> tuple[list[Candidate], list[Omission]]:
    made, omitted = _of_table(tree, TREE_PEERS)
    if not tree.nodes:
        omitted += [Omission(peer.name, "the tree has no node") for peer in made]
        made = []
    if any(variable.parts for variable in tree.variables):
        more = "; combinations are computed by numpy within the call"
        made = [msgspec.structs.replace(one, note=one.note + more) for one in made]
    return _with_evaluator(tree, lambda: None, made, omitted)


def _of_table(
    model: Document, table: Sequence[Peer]
) -> tuple[list[Candidate], list[Omission]]:
    """Return the peers of a table that are installed, and why the others are not."""
    why = {peer: _absent(peer.modules, peer.program, peer.library) for peer in table}
    made = [
        Candidate(
            peer.name,
            "tree",
            "peer",
            partial(peer.load, model),
            note=peer.note,
            modules=peer.modules,
            is_parallel=peer.is_parallel,
        )
        for peer in table
        if not why[peer]
    ]
    return made, [Omission(peer.name, text) for peer, text in why.items() if text]


def _of_rules(
    rules: RuleBase, question: Question, bounds: Bounds
) -> tuple[list[Candidate], list[Omission]]:
    found: list[Candidate] = []
    omitted: list[Omission] = []
    count = len(engines.names_of(rules))
    for name, module, load, points in (
        ("pyfuzzylite", "fuzzylite", engines.load_fuzzylite, engines.FINE),
        ("simpful", "simpful", engines.load_simpful, engines.COARSE),
    ):
        why = _absent((module,))
        if why:
            omitted.append(Omission(name, why))
            continue
        if count > engines.MOST_TERMS:
            most = f"{engines.MOST_TERMS:,}"
            why = f"{count:,} terms, and {most} are the most to make points of"
            omitted.append(Omission(title(name, question), why))
            continue
        is_rowwise = name == "simpful"
        note = f"each curved piece as {points} lines; {_LINES}"
        bound = partial(_lines, rules, points, bounds, is_rowwise=is_rowwise)
        one = Candidate(
            name,
            "rules",
            "peer",
            partial(load, rules),
            bound=bound,
            note=f"{_PYTHON}; {note}" if is_rowwise else note,
            modules=(module,),
        )
        found.append(one)
    return _with_evaluator(rules, partial(bounds, rules, "float64"), found, omitted)


def _with_evaluator(
    model: Model,
    bound: Callable[[], Bound | None],
    found: list[Candidate],
    omitted: list[Omission],
) -> tuple[list[Candidate], list[Omission]]:
    """Add the reference evaluator of onnx to what there is."""
    name = "onnx evaluator"
    why = _absent(("onnx", "onnxruntime"))
    if why:
        return found, [*omitted, Omission(name, why)]
    note = "the readable graph" if isinstance(model, RuleBase) else "the plain graph"
    one = Candidate(
        name,
        "rules",
        "peer",
        partial(evaluator.load_evaluator, model),
        bound=bound,
        note=f"{note} in double, its operators one by one in numpy",
        modules=("onnx",),
    )
    return [*found, one], omitted


def _lines(
    rules: RuleBase, points: int, bounds: Bounds, *, is_rowwise: bool
) -> Bound | None:
    """Return the certified bound of an engine that joins points by lines."""
    certified = bounds(rules, "float64")
    if certified is None:
        return None
    terms = engines.sampled_terms(rules, points)
    if is_rowwise and engines.is_steep(terms):
        return None
    errors = {key: one.error for key, one in terms.items()}
    more, origin = lines_bound(rules, errors)
    return min(certified[0] + more, 1.0), f"{certified[1]}, and {origin}"


def _absent(
    modules: tuple[str, ...], program: str | None = None, library: str | None = None
) -> str:
    """Return what is not installed, and how to get it; nothing if all is there."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            return f"not installed (pip install {_PACKAGES.get(module, module)})"
    if program and shutil.which(program) is None:
        return f"the program {program!r} is not installed"
    if library and find_library(library) is None:
        return f"the library {library!r} is not installed"
    return ""

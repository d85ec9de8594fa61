"""All candidates of a study in one list, and which of them are wanted."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from fuzzytree.benchmarking.candidates import Bounds, Layouts, own, questions
from fuzzytree.benchmarking.floors import floors
from fuzzytree.benchmarking.judging import MOST_ROWS
from fuzzytree.benchmarking.records import Bound, Candidate, Kind, Omission, Question
from fuzzytree.benchmarking.variants import variants
from fuzzytree.model.contracts import Dtype, Model
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.numerics.bounds import certify

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

Candidates = tuple[list[Candidate], list[Omission]]
"""What can be measured, and what cannot be, each with its reason."""

Peers = Callable[[Model, Bounds], Candidates]
"""Returns candidates of third-party libraries for a model."""

_GROUPS = (*get_args(Question), *get_args(Kind))
_MOST_DEGREES = 10_000_000  # whose errors are bounded in about a second


def gather(model: Model, values: FloatArray, peers: str | None = None) -> Candidates:
    """Return every candidate for a model, and what cannot be one.

    Args:
        model: A tree or a rule base.
        values: The rows of the study: certified bounds hold on them, or on the first
            of them where the model is large.
        peers: The path of a module with further candidates; see `load_peers`.
    """
    layouts = Layouts()
    main = next(iter(questions(model)))
    found, omitted = floors(main)
    bounds = _bounds(values)
    mine, absent = own(model, bounds, layouts)
    others, missing = load_peers(peers)(model, bounds)
    changed, left = variants(model, bounds, layouts)
    return [*found, *mine, *others, *changed], [*omitted, *absent, *missing, *left]


def foreign(model: Model, peers: str | None) -> list[Candidate]:
    """Return the candidates that a child process tries; see `trial`."""
    main = next(iter(questions(model)))
    mine = own(model, _no_bounds, Layouts())[0]
    return [*floors(main)[0], *mine, *load_peers(peers)(model, _no_bounds)[0]]


def load_peers(path: str | None) -> Peers:
    """Run a Python module or package and return its function `peers`.

    The function takes a model and a function that certifies the error of its strengths
    in a number type. It returns further candidates, and omissions with their reasons.

    Args:
        path: The module's file or the package's folder. None: no further candidates.

    Raises:
        ValueError: If there is no such module, it cannot be run or has no function
            `peers`, or another module of its name is loaded.
    """
    if path is None:
        return lambda _model, _bounds: ([], [])
    folder = Path(path).resolve()
    file = folder / "__init__.py" if folder.is_dir() else folder
    spec = spec_from_file_location(folder.stem, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise ValueError(f"peers: {path!r} is not a Python module or package")
    module = sys.modules.get(spec.name)
    if module is None:
        module = sys.modules[spec.name] = module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # whatever the user's code raises
            del sys.modules[spec.name]
            raise ValueError(f"peers: {path!r} cannot be run: {error}") from error
    elif getattr(module, "__file__", None) != str(file):
        raise ValueError(
            f"peers: another module {spec.name!r} is loaded; rename {path!r}"
        )
    peers: Peers | None = getattr(module, "peers", None)
    if peers is None:
        raise ValueError(f"peers: {path!r} has no function 'peers'")
    return peers


def _no_bounds(rules: RuleBase, dtype: Dtype) -> None:
    """Certify nothing."""


def chosen(
    candidates: Sequence[Candidate], only: Sequence[str], skip: Sequence[str]
) -> tuple[list[Candidate], list[Omission]]:
    """Return the candidates that are wanted, and a line about the others.

    Args:
        candidates: All there are.
        only: Names, parts before the colon, questions or kinds; all if none.
        skip: The same, for what is not wanted.

    Raises:
        ValueError: If a word names nothing that could be there, or nothing is left;
            the message lists what there is.
    """
    known = set().union(_GROUPS, *map(_words, candidates))
    for word in (*only, *skip):
        if word not in known:
            raise ValueError(_unknown(word, candidates))
    kept = [
        one
        for one in candidates
        if (not only or not _words(one).isdisjoint(only))
        and _words(one).isdisjoint(skip)
    ]
    if not kept:
        raise ValueError("no candidate is left to measure")
    left = len(candidates) - len(kept)
    if not left:
        return kept, []
    return kept, [Omission(_counted(left), "not asked for")]


def _unknown(word: str, candidates: Sequence[Candidate]) -> str:
    """Say what there is, without the variants of each number, and what was meant."""
    names = [_short(one) for one in candidates if one.kind != "variant"]
    groups = [group for one in candidates for group in _groups(one)]
    known = [*dict.fromkeys((*names, *groups))]
    close = difflib.get_close_matches(word, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return (
        f"no candidate {word!r}; there is {', '.join(dict.fromkeys(names))}, "
        f"or all of {', '.join(dict.fromkeys(groups))}{hint}"
    )


def _counted(count: int) -> str:
    return f"{count} candidate{'' if count == 1 else 's'}"


def _words(one: Candidate) -> set[str]:
    return {one.name, _short(one), *_groups(one)}


def _short(one: Candidate) -> str:
    return one.name.removesuffix(f": {one.question}")


def _groups(one: Candidate) -> tuple[str, str]:
    return one.question, one.kind


def _bounds(values: FloatArray) -> Bounds:
    """Return what certifies rule bases on these rows, each but once.

    Of many terms only the first rows are certified, which the bound's origin counts;
    candidates are judged on fewer.
    """
    known: dict[tuple[RuleBase, Dtype], Bound | None] = {}

    def bounds(rules: RuleBase, dtype: Dtype) -> Bound | None:
        key = (rules, dtype)
        if key not in known:
            terms = sum(len(variable.terms) for variable in rules.variables)
            rows = max(_MOST_DEGREES // max(terms, 1), MOST_ROWS)
            found = certify(rules, dtype, values[:, :rows])
            delta = None if found.unbounded else found.delta
            known[key] = None if delta is None else (delta, found.origin)
        return known[key]

    return bounds

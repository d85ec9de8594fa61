"""A control system of scikit-fuzzy as a fuzzy system of ours.

The library itself is not imported: what is read are the objects that it made. Their
meaning is that of scikit-fuzzy 0.5, whose centroid is that of the lines between the
points of an output's universe: our grid `lines`.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from typing import Any, Final, TypeVar

import numpy as np

from fuzzytree.errors import LossError
from fuzzytree.formats.yaml.conditions import blocks_of, joined
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Not,
    Or,
    Points,
    Proposition,
    SNorm,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Variable,
)

_ROUNDING: Final = 2.0**-50
"""How far a degree may be off a line through its neighbours: a few roundings."""


def from_skfuzzy(system: object, *, name: str = "scikit-fuzzy system") -> FuzzySystem:
    """Return a `ControlSystem` as a system that answers like its simulation.

    An input outside its universe is moved to the nearest end of it, as a simulation
    does unless it was made with `clip_to_bounds=False`. An output that no rule
    concludes is NaN, where a simulation leaves it out.

    Args:
        system: A `ControlSystem` or a `ControlSystemSimulation`.
        name: The system's name.

    Raises:
        TypeError: If it is neither.
        LossError: If it holds what a system of ours cannot, such as another
            defuzzification than the centroid.
        InvalidModelError: If its parts contradict each other.

    Example:
        >>> import numpy as np
        >>> from skfuzzy import control
        >>> food = control.Antecedent(np.arange(11), "food")
        >>> tip = control.Consequent(np.arange(26), "tip")
        >>> food.automf(3), tip.automf(3)
        (None, None)
        >>> rule = control.Rule(food["good"], tip["good"])
        >>> from_skfuzzy(control.ControlSystem([rule])).inputs
        ('food',)
    """
    source: Any = system
    if _is_of_skfuzzy(system, "ControlSystemSimulation"):
        source = source.ctrl
    if not _is_of_skfuzzy(source, "ControlSystem"):
        raise TypeError(
            "from_skfuzzy reads a ControlSystem of scikit-fuzzy, and not a value of "
            f"type {type(system).__name__}"
        )
    rules: list[tuple[SystemRule, TNorm, SNorm]] = []
    for number, rule in enumerate(source.rules, 1):
        kinds: set[str] = set()
        when = _condition(rule.antecedent, kinds)
        with_and, with_or = _AND["fmin"], _OR["fmax"]
        if "and" in kinds:
            with_and = _norm(rule.and_func, _AND, f"rule {number} takes as AND")
        if "or" in kinds:
            with_or = _norm(rule.or_func, _OR, f"rule {number} takes as OR")
        label = rule.label if isinstance(rule.label, str) else ""
        for end in rule.consequent:
            then = Conclusion(end.term.parent.label, end.term.label)
            part = SystemRule(when, (then,), float(end.weight), label)
            rules.append((part, with_and, with_or))
    return FuzzySystem(
        name,
        tuple(_input(one) for one in source.antecedents),
        tuple(_output(one) for one in source.consequents),
        blocks_of(rules, "minimum"),
    )


def _condition(part: Any, kinds: set[str]) -> Condition:
    """Return a condition, and note which kinds of joints it has."""
    if _is_of_skfuzzy(part, "Term"):
        return Proposition(part.parent.label, (part.label,))
    kinds.add(part.kind)
    left = _condition(part.term1, kinds)
    if part.kind == "not":
        return Not(left)
    join = And if part.kind == "and" else Or
    return joined(join, left, _condition(part.term2, kinds))


_Norm = TypeVar("_Norm")
_AND: Final[Mapping[str, TNorm]] = {
    **dict.fromkeys(("fmin", "minimum", "min"), "minimum"),
    **dict.fromkeys(("multiply", "accumulation_mult"), "product"),
}
_OR: Final[Mapping[str, SNorm]] = dict.fromkeys(
    ("fmax", "maximum", "max", "accumulation_max"), "maximum"
)
"""What functions of numpy, Python and scikit-fuzzy are called here."""


def _norm(function: Any, names: Mapping[str, _Norm], where: str) -> _Norm:
    name = getattr(function, "__name__", "")
    own = getattr(function, "__module__", "") or ""
    is_known = own.startswith("skfuzzy.") or function in (
        getattr(np, name, None),
        getattr(builtins, name, None),
    )
    if name not in names or not is_known:
        raise _refusal(f"{where} a function {name!r}")
    return names[name]


def _input(variable: Any) -> Variable:
    values = _universe(variable)
    low, high = values[0], values[-1]
    return Variable(variable.label, _labels(variable), low=low, high=high, clips=True)


def _output(variable: Any) -> SystemOutput:
    values = _universe(variable)
    where = f"the output {variable.label!r}"
    if variable.defuzzify_method.lower() != "centroid":
        raise _refusal(
            f"{where} is defuzzified by {variable.defuzzify_method!r}; only 'centroid' "
            "does not depend on how scikit-fuzzy rounds the points that it adds"
        )
    _norm(variable.accumulation_method, _OR, f"{where} accumulates by")
    even = np.linspace(values[0], values[-1], len(values))
    if np.abs(even - values).max() > _ROUNDING * np.abs(values).max():
        raise _refusal(f"the universe of {where} is not evenly spaced")
    return SystemOutput(
        variable.label,
        _labels(variable),
        values[0],
        values[-1],
        Defuzzifier("centroid", len(values), "lines"),
        aggregation="maximum",
    )


def _universe(variable: Any) -> list[float]:
    values = np.asarray(variable.universe, np.float64)
    if len(values) < 2 or not bool(np.all(np.diff(values) > 0.0)):
        raise _refusal(f"the universe of {variable.label!r} does not rise")
    results: list[float] = values.tolist()
    return results


def _labels(variable: Any) -> tuple[Term, ...]:
    values = _universe(variable)
    labels: list[Term] = []
    for term in variable.terms.values():
        degrees = np.asarray(term.mf, np.float64).tolist()
        kept = _corners(values, degrees)
        curve = Points(tuple(values[k] for k in kept), tuple(degrees[k] for k in kept))
        labels.append(Term(term.label, curve))
    return tuple(labels)


def _corners(values: list[float], degrees: list[float]) -> list[int]:
    """Return the places of points that are not on the line between their neighbours."""
    xs, ys = np.array(values), np.array(degrees)
    kept = {0, len(values) - 1}
    todo = [(0, len(values) - 1)]
    while todo:
        first, last = todo.pop()
        inner = slice(first + 1, last)
        line = np.interp(xs[inner], xs[[first, last]], ys[[first, last]])
        misses = np.abs(line - ys[inner])
        if misses.size and misses.max() > _ROUNDING:
            middle = first + 1 + int(np.argmax(misses))
            kept.add(middle)
            todo += [(first, middle), (middle, last)]
    return sorted(kept)


def _is_of_skfuzzy(part: object, name: str) -> bool:
    kind = type(part)
    return kind.__module__.startswith("skfuzzy.") and kind.__name__ == name


def _refusal(reason: str) -> LossError:
    return LossError(f"cannot read a ControlSystem of scikit-fuzzy: {reason}")

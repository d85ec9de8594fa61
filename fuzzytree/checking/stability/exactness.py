"""N2, N4, N5 and N8: answers and degrees are right, near zero and far from it.

With one rule for each term every runtime returns the degree of each term: it is the
strength of its rule.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, get_args

import msgspec
import numpy as np

from fuzzytree.checking.equivalence import with_functions
from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    ExactCheck,
    FirstOutcomes,
    LoadedForm,
    Truth,
    exact_check,
    first_line,
    loaded_form,
    loaded_forms,
    other_bits,
)
from fuzzytree.checking.stability.sensitivity import input_scales
from fuzzytree.checking.stability.transforms import UnitChange, in_units, moved
from fuzzytree.errors import InvalidModelError
from fuzzytree.model import (
    LR,
    Activation,
    Band,
    Curve,
    Document,
    Dtype,
    FloatArray,
    Proposition,
    Rule,
    RuleBase,
    Runtime,
    Side,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.runtimes import definition
from fuzzytree.semantics import forms, landmarks_of, neighbours, probe_values

_ADVICE = (
    "the runtime computes something else, or in another number type than it says; "
    "do not use it for this model"
)


def exactness(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Hold every runtime against the right answers, within its bound (N8).

    Runtimes of one number type that claim no bound of their own promise the same
    operations: they are compared with each other as well, bit for bit.

    Values are each breakpoint with its neighbouring floats, in float32 and float64, and
    rows of data, of shape (inputs, rows).
    """
    trial = Trial("N8", _ADVICE)
    right: dict[tuple[str, int], Truth] = {}
    checks: dict[str, list[ExactCheck]] = {}
    first: FirstOutcomes = {}
    for one in loaded_forms(model, runtimes, trial.skipped):
        rows = one.some(values)
        check = exact_check(one, rows, right)
        trial.add(check.rows, *check.faults, worst=check.worst)
        trial.faults += other_bits(one, rows, check.outcome, first)
        own = f" in {one.runtime.name}" if one.runtime.bound is not None else ""
        checks.setdefault(f"{one.runtime.dtype}{own}", []).append(check)
    nouns = ("numbers", "statuses") if model.outputs else ("strengths", "classes")
    return trial.result(*(_fact(name, check, *nouns) for name, check in checks.items()))


def _fact(name: str, checks: Sequence[ExactCheck], numbers: str, answers: str) -> str:
    worst = max(checks, key=lambda one: one.worst)
    flips = max(one.flips for one in checks)
    text = f"{name}: {numbers} off by at most {worst.worst:.2g}"
    text += f" where {worst.allowed:.2g} is allowed, {answers} changed: {flips}"
    unbounded = max(one.unbounded for one in checks)
    if unbounded:
        text += f"; no bound in {unbounded}, beyond the type or near a step"
    return text


RATIOS = tuple(10.0**-k for k in range(1, 13))
"""Spread over distance from zero, the same for every input."""

_PROBES = 150
_DATA = 300
_REPORTED: tuple[float, ...] = tuple(10.0**-k for k in (1, 3, 5, 7, 9, 11))
_ADVICE_OFFSETS = (
    "take differences before anything is divided or raised to a power: polynomials in "
    "the raw value lose every digit far from zero"
)


def offsets(
    model: Document, runtimes: Sequence[Runtime], data: FloatArray
) -> Criterion:
    """Move every input until its narrowest term is 1e-1 to 1e-12 of its distance (N2).

    The moved model is a model of its own, whose numbers are rounded once. A runtime is
    compared with its right predictions, on probes of its edges and on moved data.

    There may be no rows of data. Slow runtimes get a share of the rows; those with a
    bound of their own promise nothing far from zero and are left out. What gives up at
    a distance is not tried farther away.
    """
    trial = Trial("N2", _ADVICE_OFFSETS, worst=0.0)
    facts: list[str] = []
    scales = input_scales(model, data)
    rows = data[:, :: max(-(-data.shape[1] // _DATA), 1)]
    for representation, form in forms(model).items():
        chosen = [runtime for runtime in runtimes if runtime.bound is None]
        for ratio in RATIOS:
            steps = {
                name: one.spread / ratio - (0.5 * one.low + 0.5 * one.high)
                if np.isfinite(one.spread)
                else 0.0
                for name, one in scales.items()
            }
            where = f"{representation}, spread over distance {ratio:.0e}"
            try:
                far = moved(form, steps)
            except InvalidModelError as error:
                trial.skipped.append(f"{where}: {first_line(error)}")
                continue
            away = rows + np.array([*steps.values()]).reshape(-1, 1)
            values = np.concatenate([probe_values(far, _PROBES), away], axis=1)
            right: dict[tuple[str, int], Truth] = {}
            loaded = [loaded_form(where, far, one, trial.skipped) for one in chosen]
            checks: list[tuple[ExactCheck, Dtype]] = []
            for one in filter(None, loaded):
                check = exact_check(one, one.some(values), right)
                trial.add(check.rows, *check.faults, worst=check.worst)
                checks.append((check, one.runtime.dtype))
            chosen = [one.runtime for one in loaded if one is not None]
            if ratio in _REPORTED and form.rules:
                facts += (f"{where}: {cost}" for cost in _costs(checks))
    return trial.result(*facts)


def _costs(checks: Sequence[tuple[ExactCheck, Dtype]]) -> Iterator[str]:
    """Yield what a distance costs in each number type."""
    for dtype in get_args(Dtype):
        every = [check for check, kind in checks if kind == dtype]
        if every:
            error = max(one.largest for one in every)
            flips = max(one.flips for one in every)
            text = f"{dtype} is off by {error:.1e}"
            yield f"{text}, and {flips} of {every[0].rows} answers change"


MOST_TERMS = 240
"""Terms that are tested one by one; of more, evenly drawn ones."""


class TermProbes(msgspec.Struct, frozen=True):
    """A model whose strengths are degrees, and the rows to run."""

    model: Document  # with one rule for each term
    values: FloatArray  # of shape (inputs, rows)
    places: tuple[tuple[str, str, Curve], ...]  # of each rule: variable, term, function
    left_out: int  # how many terms are not tested, for there are too many


def term_probes(form: Document) -> TermProbes | None:
    """Return the terms of a model as rules, and their edges as rows.

    Returns:
        The rows and rules; None if no rule tests a term. A tree has no rules. The
        combinations of a rule base count as inputs, those of a system are left out.
    """
    is_system = bool(form.outputs)
    sources = [v for v in form.variables if form.rules and not (is_system and v.parts)]
    step = -(-sum(len(v.terms) for v in sources) // MOST_TERMS) or 1
    numbers = itertools.count()
    variables: list[Variable] = []
    lines: list[list[float]] = []
    places: list[tuple[str, str, Curve]] = []
    propositions: list[Proposition] = []
    for source in sources:
        line: list[float] = []
        terms: list[Term] = []
        for term in source.terms:
            if next(numbers) % step:
                continue
            terms.append(term)
            marks = landmarks_of(term.function)
            line += (near for x in marks for near in neighbours(x))
            places.append((source.name, term.name, term.function))
            propositions.append(Proposition(source.name, (term.name,)))
        if terms or is_system:
            kept = source if is_system else Variable(source.name)
            variables.append(msgspec.structs.replace(kept, terms=tuple(terms)))
            lines.append([*dict.fromkeys(line)] or [0.0])
    if not propositions:
        return None
    longest = max(map(len, lines))
    values = np.array([(line * longest)[:longest] for line in lines], np.float64)
    model: Document
    if is_system:
        blocks: Any = form.blocks
        then = blocks[0].rules[0].then[:1]
        rules = tuple(SystemRule(one, then) for one in propositions)
        block = msgspec.structs.replace(blocks[0], rules=rules, activation=Activation())
        others = [v for v in form.variables if v.parts]
        every = (*variables, *others)
        model = msgspec.structs.replace(form, variables=every, blocks=(block,))
    else:
        tests = tuple(Rule((one,), "true") for one in propositions)
        model = RuleBase(form.name, ("true",), tuple(variables), tests)
    left_out = sum(len(v.terms) for v in sources) - len(propositions)
    return TermProbes(model, values, tuple(places), left_out)


def collapsed(curve: Curve) -> Curve:
    """Return the narrowest function at the same place: what one sample would leave.

    Curves of other engines stay. Plateaus that are closed on both sides hold one
    double, flanks end at the next double, spreads are one unit in the last place of
    the mean.
    """

    def narrow(end: float | None, edge: float | None) -> float | None:
        if end is None or edge is None:
            return end
        return math.nextafter(edge, math.copysign(math.inf, end - edge))

    def thin(side: Side, mean: float) -> Side:
        spread = max(math.ulp(mean), 2.0**-1000)
        return msgspec.structs.replace(side, spread=spread)

    match curve:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and high is not None:
                high = math.nextafter(low, math.inf)
            return Band(low, high, narrow(left, low), narrow(right, high))
        case LR(mean=mean, left=below, right=above):
            return LR(mean, thin(below, mean), thin(above, mean))
        case _:
            return curve


def _try_terms(
    trial: Trial,
    model: Document,
    runtimes: Sequence[Runtime],
    title: str,
    change: Callable[[Curve], Curve] = lambda curve: curve,
) -> None:
    """Compare the degrees of all terms in all runtimes with what must be.

    `title` names the terms of a form, with `{}` for its name; `change` gives what is
    tested in place of each membership function.
    """
    for representation, form in forms(model).items():
        terms = term_probes(with_functions(form, change)) if form.rules else None
        if terms is None:
            continue
        if terms.left_out:
            trial.skipped.append(f"{terms.left_out} of the terms: there are too many")
        right: dict[tuple[str, int], Truth] = {}
        name = title.format(representation)
        defined: dict[tuple[bool, int], TermDegrees | None] = {}
        for runtime in runtimes:
            one = loaded_form(name, terms.model, runtime, trial.skipped)
            if one is None:
                continue
            if runtime.bound is not None:  # it promises nothing at a single value
                trial.skipped.append(f"{runtime.name} promises a bound, and no edge")
                continue
            values = one.some(terms.values)
            outcome, warning = one.run_with_warning(values)
            trial.add(0, warning and f"{one.title}: it warns: {warning}")
            if outcome.strengths is None:
                trial.skipped.append(f"{runtime.name} returns no degrees")
                continue
            key = runtime.dtype == "float32", values.shape[1]
            if not form.outputs and key not in defined:
                defined[key] = _term_degrees(terms.model, values, is_single=key[0])
            if (wanted := defined.get(key)) is not None:
                trial.faults += _edge_faults(one, terms, wanted, outcome.strengths)
            check = exact_check(one, values, right)
            trial.add(outcome.strengths.size, *check.faults, worst=check.worst)


class TermDegrees(NamedTuple):
    """The degrees of terms, by the definition, and the values at which they are."""

    values: FloatArray
    right: FloatArray


def _term_degrees(
    model: Document, values: FloatArray, *, is_single: bool
) -> TermDegrees | None:
    """Return what degrees must be; values and stored numbers may be rounded to float32.

    None if places become one, and so have no edges.
    """
    if is_single:
        with np.errstate(over="ignore"):
            values = values.astype(np.float32).astype(np.float64)
        try:
            model = in_units(model, UnitChange(_single, _single, lambda _, part: part))
        except InvalidModelError:
            return None
    right = definition().load(model)(values).strengths
    assert right is not None  # rules have them
    return TermDegrees(values, right)


def _edge_faults(
    one: LoadedForm, terms: TermProbes, wanted: TermDegrees, degrees: FloatArray
) -> Iterator[str]:
    """Yield which degrees must be 1 or 0 or neither, and are not.

    The tail of an LR set is so flat that only doubles agree about its end.
    """
    values, right = wanted
    dtype = one.runtime.dtype
    kinds = np.array([type(curve) for *_, curve in terms.places])[:, np.newaxis]
    is_one, is_zero = right == 1.0, right == 0.0
    if dtype != "float64":
        is_zero &= kinds != LR
    wrong = (is_one | is_zero) & (degrees != right)
    wrong |= (degrees == 1.0) & (right < 1.0) & (kinds == Band)
    wrong |= (degrees < 0.0) | (degrees > 1.0) | (np.isnan(degrees) & ~np.isnan(right))
    lines = {name: line for line, name in enumerate(one.model.inputs)}
    for rule, row in np.argwhere(wrong).tolist():
        (name, term, _), degree = terms.places[rule], float(degrees[rule, row])
        value = float(values[lines[name], row])
        demand = {1.0: "one", 0.0: "zero"}.get(float(right[rule, row]), "below one")
        where = f"{one.title}: {name} is {term} at {value!r}"
        yield f"{where}: degree {degree!r}, not {demand}"


def _single(_: str, value: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(value))


_ADVICE_EDGES = (
    "compare with <= where the model says <=, clip before evaluating, and make the end "
    "of a term a comparison and not a cancellation"
)


def edges(model: Document, runtimes: Sequence[Runtime]) -> Criterion:
    """Test each term at its mean, its edges and its ends, and beside them (N5).

    Every landmark comes with the neighbouring floats, in double and in float32. Where
    the definition has the degree 1 or 0, as on a plateau, at a mean and from an end on,
    it is exactly that; off a plateau it is below 1; elsewhere within the bound of the
    exact one. The degrees of a system are those of its definition.
    """
    trial = Trial("N5", _ADVICE_EDGES, worst=0.0)
    _try_terms(trial, model, runtimes, "terms of {}")
    return trial.result()


_ADVICE_DEGENERATE = (
    "a set made from one value must keep degree 1 at that value: compare values with "
    "the mean before dividing by the spread"
)


def degenerate(model: Document, runtimes: Sequence[Runtime]) -> Criterion:
    """Collapse every term to its narrowest (N4).

    A collapsed set keeps degree exactly 1 at its mean or on its plateau, is exactly 0
    from its end on, and no runtime warns.
    """
    trial = Trial("N4", _ADVICE_DEGENERATE)
    _try_terms(trial, model, runtimes, "{}, collapsed", collapsed)
    return trial.result()

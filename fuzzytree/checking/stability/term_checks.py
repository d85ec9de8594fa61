"""The terms of a model one by one, and what must hold for each without any tolerance.

With one rule for each term every runtime returns the degree of each term: it is the
strength of its rule.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, assert_never

import msgspec
import numpy as np

from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    LoadedForm,
    exact_check,
    forms_of,
    loaded_form,
    loaded_forms,
    run_with_warning,
    truth,
)
from fuzzytree.checking.stability.transforms import UnitChange, in_units
from fuzzytree.errors import FuzzyTreeError, InvalidModelError
from fuzzytree.model import (
    LR,
    Activation,
    Band,
    Curve,
    Document,
    FloatArray,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Runtime,
    Shape,
    Side,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.runtimes import definition
from fuzzytree.semantics import landmarks_of, neighbours

MOST_TERMS = 240
"""Terms that are tested one by one; of more, evenly drawn ones."""


class TermProbes(msgspec.Struct, frozen=True):
    """A model whose strengths are degrees, and the rows to run.

    Attributes:
        model: It has one rule for each term.
        values: Shape (inputs, rows).
        places: For each rule the variable and the term that it tests, and the function.
        left_out: How many terms are not tested, for there are too many.
    """

    model: Document
    values: FloatArray
    places: tuple[tuple[str, str, Curve], ...]
    left_out: int


def term_probes(
    form: Document, change: Callable[[Shape], Shape] | None = None
) -> TermProbes | None:
    """Return the terms of a model as rules, and their edges as rows.

    `change` gives what is tested in place of each membership function.

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
            if change is not None and isinstance(term.function, Band | LR | Points):
                term = msgspec.structs.replace(term, function=change(term.function))
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


def collapsed(shape: Shape) -> Shape:
    """Return the narrowest shape at the same place: what one sample would leave.

    Plateaus that are closed on both sides hold one double, flanks end at the next
    double, spreads are one unit in the last place of the mean.
    """

    def narrow(end: float | None, edge: float | None) -> float | None:
        if end is None or edge is None:
            return end
        return math.nextafter(edge, math.copysign(math.inf, end - edge))

    def thin(side: Side, mean: float) -> Side:
        spread = max(math.ulp(mean), 2.0**-1000)
        return msgspec.structs.replace(side, spread=spread)

    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and high is not None:
                high = math.nextafter(low, math.inf)
            return Band(low, high, narrow(left, low), narrow(right, high))
        case LR(mean=mean, left=below, right=above):
            return LR(mean, thin(below, mean), thin(above, mean))
        case Points():
            return shape
    assert_never(shape)


def _try_terms(
    trial: Trial,
    model: Document,
    runtimes: Sequence[Runtime],
    title: str,
    change: Callable[[Shape], Shape] | None = None,
) -> None:
    """Compare the degrees of all terms in all runtimes with what must be.

    `title` names the terms of a form, with `{}` for its name; `change` gives what is
    tested in place of each membership function.
    """
    for representation, form in forms_of(model).items():
        terms = term_probes(form, change)
        if terms is None:
            continue
        if terms.left_out:
            trial.skipped.append(f"{terms.left_out} of the terms: there are too many")
        right = truth(terms.model, terms.values)
        name = title.format(representation)
        for runtime in runtimes:
            one = loaded_form(name, terms.model, runtime, trial.skipped)
            if one is None:
                continue
            if runtime.bound is not None:  # it promises nothing at a single value
                trial.skipped.append(f"{runtime.name} promises a bound, and no edge")
                continue
            values = one.some(terms.values)
            outcome, warning = run_with_warning(one, values)
            trial.add(0, warning and f"{one.title}: it warns: {warning}")
            if outcome.strengths is None:
                trial.skipped.append(f"{runtime.name} returns no degrees")
                continue
            if not form.outputs:
                trial.faults += _edge_faults(one, terms, values, outcome.strengths)
            is_all = values.shape == terms.values.shape
            check = exact_check(one, values, right if is_all else None)
            trial.add(outcome.strengths.size, *check.faults, worst=check.worst)


def _edge_faults(
    one: LoadedForm, terms: TermProbes, values: FloatArray, degrees: FloatArray
) -> Iterator[str]:
    """Yield which degrees must be 1 or 0 or neither, and are not.

    The definition decides, for values and stored numbers as float32 rounds them. The
    tail of an LR set is so flat that only doubles agree about its end.
    """
    model, dtype = one.model, one.runtime.dtype
    if dtype == "float32":
        with np.errstate(over="ignore"):
            values = values.astype(np.float32).astype(np.float64)
        try:
            model = in_units(model, UnitChange(_single, _single, lambda _, part: part))
        except InvalidModelError:
            return  # places that become one have no edges
    right = definition().load(model)(values).strengths
    assert right is not None  # rules have them
    kinds = np.array([type(curve) for *_, curve in terms.places])[:, np.newaxis]
    is_one, is_zero = right == 1.0, right == 0.0
    if dtype != "float64":
        is_zero &= kinds != LR
    wrong = (is_one | is_zero) & (degrees != right)
    wrong |= (degrees == 1.0) & (right < 1.0) & (kinds == Band)
    wrong |= (degrees < 0.0) | (degrees > 1.0) | (np.isnan(degrees) & ~np.isnan(right))
    lines = {name: line for line, name in enumerate(model.inputs)}
    for rule, row in np.argwhere(wrong).tolist():
        (name, term, _), degree = terms.places[rule], float(degrees[rule, row])
        value = float(values[lines[name], row])
        demand = {1.0: "one", 0.0: "zero"}.get(float(right[rule, row]), "below one")
        where = f"{one.title}: {name} is {term} at {value!r}"
        yield f"{where}: degree {degree!r}, not {demand}"


def _single(_: str, value: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(value))


_ADVICE = (
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
    trial = Trial("N5", _ADVICE, worst=0.0)
    _try_terms(trial, model, runtimes, "terms of {}")
    return trial.result()


_COPIES = 50  # rows of a table whose columns are all constant
_ADVICE_DEGENERATE = (
    "a set made from one value must keep degree 1 at that value: compare values with "
    "the mean before dividing by the spread"
)


def degenerate(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Collapse every term to its narrowest and every table to its smallest (N4).

    A collapsed set keeps degree exactly 1 at its mean or on its plateau, is exactly 0
    from its end on, and no runtime warns. A table of equal rows, given without copies
    (its columns have no stride), is answered like one of them; so are tables of two,
    one and no rows.
    """
    trial = Trial("N4", _ADVICE_DEGENERATE)
    _try_terms(trial, model, runtimes, "{}, collapsed", collapsed)
    for one in loaded_forms(model, runtimes, trial.skipped):
        for fault in _small_tables(one, one.some(values)):
            trial.add(1, fault)
    return trial.result()


def _small_tables(one: LoadedForm, values: FloatArray) -> Iterator[str | None]:
    """Try small tables; yield for each what went wrong, if anything."""
    width, count = values.shape
    for row in range(min(count, 3)):
        column = values[:, row : row + 1]
        table = np.broadcast_to(column, (width, _COPIES))
        alone = one.run(np.ascontiguousarray(column)).part(np.zeros(_COPIES, np.int64))
        fault = f": {_COPIES} equal rows are not answered like one of them"
        yield one.fault(fault, table, one.run(table), alone)[1]
    for size in (0, 1, 2):
        try:
            outcome = one.run(np.ascontiguousarray(values[:, :size]))
        except FuzzyTreeError as error:
            yield f"{one.title}: a table of {size} rows is refused: {error}"
            continue
        shape = (min(size, count),)
        is_wrong = outcome.rule.shape != shape or outcome.status.shape != shape
        answers = f"a table of {size} rows gets {outcome.rule.shape[0]} answers"
        yield f"{one.title}: {answers}" if is_wrong else None

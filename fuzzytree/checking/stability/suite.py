"""All criteria on one model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fuzzytree.checking.stability.exactness import exactness, offsets
from fuzzytree.checking.stability.results import (
    TITLES,
    Criterion,
    CurveFault,
    OffsetCost,
    Stability,
    Trial,
    Usable,
)
from fuzzytree.checking.stability.roundtrips import roundtrips
from fuzzytree.checking.stability.row_checks import decades, order, scaling, specials
from fuzzytree.checking.stability.sensitivity import curves, stiffness
from fuzzytree.checking.stability.term_checks import degenerate, edges
from fuzzytree.model import (
    Document,
    FloatArray,
    Format,
    Progress,
    Runtime,
    as_names,
    fingerprint,
)
from fuzzytree.runtimes import is_installed
from fuzzytree.semantics import probe_values

_PROBES = 2_000  # for the comparison with the exact answers
_SOME = 250  # probes for criteria that load a model anew many times
_SOME_DATA = 100  # rows of data beside them
_NOT_MEASURED = "measured by `fuzzytree bench`, for it takes time on a quiet machine"
_DATA = 1_000  # rows of data for the comparison with the exact answers


def examine(
    model: Document,
    *,
    runtimes: Sequence[Runtime],
    formats: Sequence[Format],
    data: FloatArray | None = None,
    select: Sequence[str] = (),
    progress: Progress = lambda _text, _share: None,
) -> Stability:
    """Apply the criteria N1 to N10 to a model.

    Args:
        model: A tree, a rule base or a fuzzy system.
        runtimes: What to run; those that are not installed are named and left out.
        formats: What to write and take back.
        data: Rows of one's own, shape (inputs, rows); at most 1,000, evenly drawn.
        select: The codes of criteria to apply; all if empty. `N2` includes `N2b`.
        progress: Called with the current check and the share that is done, in [0, 1].

    Returns:
        The result of each criterion, and what is known of inputs and curves.

    Raises:
        ValueError: If there is no such criterion, or `data` has another shape.

    Example:
        >>> from fuzzytree.runtimes import find_runtime
        >>> from fuzzytree.testing import random_tree
        >>> found = examine(
        ...     random_tree(1, leaves=3), runtimes=[find_runtime("native")],
        ...     formats=(), select=["N3"],
        ... )
        >>> [one.verdict for one in found.criteria]
        ['holds']
    """
    wanted = _wanted(select)
    rows = _checked(data, len(model.inputs))
    probes = probe_values(model, _PROBES)
    values = np.concatenate([probes, _thinned(rows, _DATA)], axis=1)
    some = np.concatenate(
        [probe_values(model, _SOME), _thinned(rows, _SOME_DATA)], axis=1
    )
    criteria: list[Criterion] = []
    usable: tuple[Usable, ...] = ()
    costs: tuple[OffsetCost, ...] = ()
    faults: tuple[CurveFault, ...] = ()
    for number, code in enumerate(wanted):
        progress(f"{code} {TITLES[code]}", number / (len(wanted) + 1))
        match code:
            case "N1":
                one, usable = scaling(model, runtimes, some)
            case "N2":
                one, costs = offsets(model, runtimes, rows)
            case "N2b":
                one = decades(model, runtimes, some)
            case "N3":
                one = order(model, runtimes, some)
            case "N4":
                one = degenerate(model, runtimes, some)
            case "N5":
                one = edges(model, runtimes)
            case "N6":
                one = specials(model, runtimes, some)
            case "N7":
                one, faults = curves(model)
            case "N8":
                one = exactness(model, runtimes, values)
            case "N9":
                one = roundtrips(model, formats, some)
            case _:
                one = Trial(code, skipped=[_NOT_MEASURED]).result()
        criteria.append(one)
    has_data = rows.shape[1] > 0
    progress("stiffness of the inputs", len(wanted) / (len(wanted) + 1))
    return Stability(
        model.name,
        fingerprint(model),
        probes.shape[1],
        rows.shape[1],
        values.shape[1] - probes.shape[1],
        tuple(runtime.name for runtime in runtimes if is_installed(runtime)),
        tuple(criteria),
        stiffness(model, rows if has_data else probes, is_data=has_data),
        faults,
        usable,
        costs,
    )


def _wanted(select: Sequence[str]) -> tuple[str, ...]:
    select = as_names(select)
    codes = [code.upper().replace("B", "b") for code in select]
    known = ", ".join(TITLES)
    for text, code in zip(select, codes, strict=True):
        if code not in TITLES:
            raise ValueError(f"no criterion {text!r}; there is {known}")
    if "N2" in codes:
        codes.append("N2b")
    return tuple(code for code in TITLES if not codes or code in codes)


def _checked(data: FloatArray | None, inputs: int) -> FloatArray:
    if data is None:
        return np.empty((inputs, 0))
    if data.ndim != 2 or data.shape[0] != inputs:
        raise ValueError(f"data must have shape ({inputs}, rows), not {data.shape}")
    return data


def _thinned(rows: FloatArray, limit: int) -> FloatArray:
    step = max(-(-rows.shape[1] // limit), 1)
    return rows[:, ::step]

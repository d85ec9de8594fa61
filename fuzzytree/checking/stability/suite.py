"""All criteria on one model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fuzzytree.checking.comparing import row_set
from fuzzytree.checking.stability.exactness import degenerate, edges, exactness, offsets
from fuzzytree.checking.stability.results import TITLES, Criterion, Stability, Trial
from fuzzytree.checking.stability.row_checks import (
    order,
    roundtrips,
    scaling,
    specials,
)
from fuzzytree.checking.stability.sensitivity import curves, stiffness
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
        select: The codes of criteria to apply; all if empty.
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
    probes = probe_values(model, _PROBES)
    whole = row_set(model.inputs, probes, data)
    rows = whole.values[:, whole.probes :]
    values = np.hstack([probes, _thinned(rows, _DATA)])
    some = np.hstack([probe_values(model, _SOME), _thinned(rows, _SOME_DATA)])
    checks: dict[str, Callable[[], Criterion]] = {
        "N1": lambda: scaling(model, runtimes, some),
        "N2": lambda: offsets(model, runtimes, rows),
        "N3": lambda: order(model, runtimes, some),
        "N4": lambda: degenerate(model, runtimes),
        "N5": lambda: edges(model, runtimes),
        "N6": lambda: specials(model, runtimes, some),
        "N7": lambda: curves(model),
        "N8": lambda: exactness(model, runtimes, values),
        "N9": lambda: roundtrips(model, formats, some),
        "N10": lambda: Trial("N10", skipped=[_NOT_MEASURED]).result(),
    }
    criteria: list[Criterion] = []
    for number, code in enumerate(wanted):
        progress(f"{code} {TITLES[code]}", number / (len(wanted) + 1))
        criteria.append(checks[code]())
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
    )


def _wanted(select: Sequence[str]) -> tuple[str, ...]:
    codes = {code.upper(): code for code in as_names(select)}
    for code, text in codes.items():
        if code not in TITLES:
            raise ValueError(f"no criterion {text!r}; there is {', '.join(TITLES)}")
    return tuple(code for code in TITLES if not codes or code in codes)


def _thinned(rows: FloatArray, limit: int) -> FloatArray:
    return rows[:, :: max(-(-rows.shape[1] // limit), 1)]

"""Models to test with, for us and for people who write formats and runtimes.

`random_tree` makes valid trees of any size from a seed; `probes` (from
`fuzzytree.probing`) the rows that matter for a model, `probe_values` as an array.
`random_system` makes fuzzy systems with numeric outputs, `random_rows` rows for them.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence

from msgspec.structs import replace

from fuzzytree.probing import SPECIAL, landmarks, probe_values, probes
from fuzzytree.random_systems import random_rows, random_system
from fuzzytree.rulebase import (
    LR,
    Band,
    Flank,
    Part,
    Points,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.tree import (
    Branch,
    FuzzyTree,
    Leaf,
    Node,
    Sets,
    interval_names,
    intervals,
)

__all__ = [
    "SPECIAL",
    "probe_values",
    "probes",
    "random_rows",
    "random_system",
    "random_tree",
    "with_points",
]


def random_tree(
    seed: int,
    *,
    leaves: int = 7,
    inputs: int = 4,
    classes: int = 3,
    combinations: float = 0.3,
    semantics: Semantics | None = None,
) -> FuzzyTree:
    """Return a valid tree with relative terms and fitted sets, made from a seed.

    Args:
        seed: The same seed and sizes give the same tree.
        leaves: How many leaves; 1 gives a tree without nodes.
        inputs: How many input columns, on scales from 1e-3 to 1e6.
        classes: How many classes; every class that has a leaf can win.
        combinations: The share of nodes that ask a combination of inputs.
        semantics: The defaults unless given.
    """
    chance = random.Random(seed)
    columns = tuple(f"x{number}" for number in range(1, inputs + 1))
    labels = tuple(f"class {number}" for number in range(1, classes + 1))
    scale = {name: 10.0 ** chance.randint(-3, 6) for name in columns}
    asked: list[tuple[str, tuple[float, ...], tuple[int, ...]]] = []
    derived: list[Variable] = []
    plan = _grow(chance, leaves, [])

    def ask(branches: int) -> None:
        if len(columns) > 1 and chance.random() < combinations:
            chosen = chance.sample(columns, chance.randint(2, len(columns)))
            parts = tuple(
                Part(
                    name,
                    chance.uniform(0.2, 2.0) * chance.choice((-1, 1)) / scale[name],
                    chance.uniform(-1.0, 1.0) * scale[name],
                )
                for name in chosen
            )
            name, unit = f"mix {len(derived) + 1}", 1.0
            derived.append(Variable(name, parts=parts))
        else:
            name = chance.choice(columns)
            unit = scale[name]
        owners = list(range(branches))
        if branches == 2 and chance.random() < 0.25:
            owners = [0, 1, 0]
        cuts = sorted(chance.uniform(-2.0, 2.0) * unit for _ in owners[1:])
        asked.append((name, tuple(cuts), tuple(owners)))

    for children in plan:
        ask(len(children))
    return _assemble(
        chance, columns, labels, derived, asked, plan, semantics or Semantics()
    )


def with_points(rules: RuleBase, seed: int, *, share: float = 0.6) -> RuleBase:
    """Return a rule base some of whose terms are points, made from a seed.

    The points lie about where the term was: ramps, steps, plateaus, single points, and
    now and then more than a few of them. So the rules equal no tree any more.

    Args:
        rules: Any rule base.
        seed: The same seed gives the same points.
        share: How many of the terms become points.
    """
    chance = random.Random(seed)

    def changed(term: Term) -> Term:
        if chance.random() > share:
            return term
        return Term(term.name, _points(chance, term.shape))

    variables = tuple(
        replace(variable, terms=tuple(map(changed, variable.terms)))
        for variable in rules.variables
    )
    return replace(rules, variables=variables, kind=None)


def _points(chance: random.Random, shape: Shape) -> Points:
    marks = landmarks(shape) or (0.0, 1.0)
    low, high = min(marks), max(marks)
    count = chance.choice((1, 2, 3, 4, 5, 9, 40))
    chosen = [chance.choice(marks) for _ in range(count // 2)]
    chosen += [chance.uniform(low, high) for _ in range(count - len(chosen))]
    chosen += chance.sample(chosen, chance.randint(0, count // 2))  # steps
    values = [v for v, same in itertools.groupby(sorted(chosen)) for _ in [*same][:2]]
    degrees = [chance.choice((0.0, 1.0, chance.random())) for _ in values]
    level = chance.randrange(len(values))  # and a plateau
    degrees[level : level + 2] = [degrees[level]] * len(degrees[level : level + 2])
    return Points(tuple(values), tuple(degrees))


Plan = list[list[tuple[str, int]]]


def _grow(chance: random.Random, leaves: int, plan: Plan) -> Plan:
    """Return, for each node in depth-first order, its children as (kind, number)."""
    count = 0

    def grow(size: int) -> tuple[str, int]:
        nonlocal count
        if size == 1:
            count += 1
            return ("leaf", count)
        number = len(plan) + 1
        plan.append([])
        branches = 3 if size > 2 and chance.random() < 0.25 else 2
        marks = sorted(chance.sample(range(1, size), branches - 1))
        sizes = [b - a for a, b in zip([0, *marks], [*marks, size], strict=True)]
        plan[number - 1].extend(grow(part) for part in sizes)
        return ("node", number)

    grow(leaves)
    return plan


def _assemble(
    chance: random.Random,
    columns: tuple[str, ...],
    labels: tuple[str, ...],
    derived: list[Variable],
    asked: list[tuple[str, tuple[float, ...], tuple[int, ...]]],
    plan: Plan,
    semantics: Semantics,
) -> FuzzyTree:
    total = 1 + max((n for c in plan for kind, n in c if kind == "leaf"), default=1) - 1
    leaves = tuple(
        Leaf(chance.choice(labels), f"pattern {number}", chance.randint(0, 99))
        for number in range(1, total + 1)
    )
    below = _leaves_below(plan)
    terms: dict[str, list[Term]] = {}
    names: dict[int, list[str]] = {}
    for variable in dict.fromkeys(name for name, _, _ in asked):
        here = [i for i, entry in enumerate(asked) if entry[0] == variable]
        texts = interval_names([asked[i][1] for i in here])
        names.update(zip(here, texts, strict=True))
    nodes: list[Node] = []
    for position, (variable, cuts, owners) in enumerate(asked):
        own = names[position]
        bare = Node(variable, cuts, owners, ())
        known = terms.setdefault(variable, [])
        for name, (low, high) in zip(own, intervals(bare), strict=True):
            if name not in {term.name for term in known}:
                known.append(Term(name, _band(chance, low, high, cuts)))
        branches = tuple(
            Branch(
                terms=tuple(n for n, o in zip(own, owners, strict=True) if o == index),
                sets=tuple(f"pattern {leaf}" for leaf in below[kind, number]),
                node=number if kind == "node" else None,
                leaf=number if kind == "leaf" else None,
            )
            for index, (kind, number) in enumerate(plan[position])
        )
        nodes.append(Node(variable, cuts, owners, branches))
    used = {name for name, _, _ in asked}
    parts = {part.input for v in derived for part in v.parts}
    variables = tuple(
        Variable(n, tuple(terms.get(n, ())), unit="cm", low=-9.5e6, high=9.5e6)
        for n in columns
        if n in used | parts
    ) + tuple(Variable(v.name, tuple(terms[v.name]), parts=v.parts) for v in derived)
    spans = {name: cuts for name, cuts, _ in asked}
    sets = tuple(
        Sets(
            name,
            tuple(
                Term(f"pattern {number}", _lr(chance, spans[name]))
                for number in range(1, total + 1)
            ),
        )
        for name in spans
    )
    return FuzzyTree(
        f"random {len(leaves)}",
        labels,
        variables,
        tuple(nodes),
        leaves,
        sets,
        semantics,
        columns,
    )


def _leaves_below(plan: Plan) -> dict[tuple[str, int], tuple[int, ...]]:
    below: dict[tuple[str, int], tuple[int, ...]] = {}
    for number in range(len(plan), 0, -1):
        for kind, child in plan[number - 1]:
            if kind == "leaf":
                below[kind, child] = (child,)
        below["node", number] = tuple(
            leaf for entry in plan[number - 1] for leaf in below[entry]
        )
    return below


def _band(
    chance: random.Random,
    low: float | None,
    high: float | None,
    cuts: Sequence[float],
) -> Band:
    unit = max(map(abs, cuts)) or 1.0

    def flank(start: float, sign: int) -> Flank:
        b1 = chance.uniform(0.3, 1.0)
        b2 = chance.uniform(0.0, b1)
        # Bernstein coefficients 0, b2, b1, 1 in q: rising, 0 at q = 0, 1 at q = 1.
        curve: tuple[float, ...] = (3 * b2, 3 * b1 - 6 * b2, 1 - 3 * b1 + 3 * b2)
        if chance.random() < 0.3:
            curve = (1.0,)
        return Flank(start, start + sign * unit * chance.uniform(0.1, 2.0), curve)

    return Band(
        low,
        high,
        None if low is None else flank(low, -1),
        None if high is None else flank(high, 1),
    )


def _lr(chance: random.Random, cuts: Sequence[float]) -> LR:
    unit = max(map(abs, cuts)) or 1.0

    def side() -> Side:
        drop = chance.uniform(0.2, 0.8)
        curve = (drop,) if chance.random() < 0.5 else (drop, chance.uniform(-0.1, 0.1))
        return Side(unit * chance.uniform(0.05, 1.0), curve)

    left = side()
    right = left if chance.random() < 0.5 else side()
    return LR(chance.uniform(-2.0, 2.0) * unit, left, right)

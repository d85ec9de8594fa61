"""Rows at which the representations of a model tend to part.

Uniform rows almost never fall where two representations could differ: within rounding
of a cut, of a support's end, of a mean. A probe puts one proposition of one rule
exactly there, or on a neighbouring float, while the other propositions of that rule
hold as far as they can, so that a fault in the proposition reaches the answer.
"""

from __future__ import annotations

import itertools
import math
import random
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence

from fuzzytree.model import (
    LR,
    And,
    Band,
    Bell,
    Binary,
    Condition,
    Cosine,
    Curve,
    Document,
    FloatArray,
    Formula,
    FuzzySystem,
    Gaussian,
    Hedge,
    Linear,
    Not,
    Or,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Spike,
    SystemRule,
    TwoGaussians,
    Variable,
    shapes_of,
)
from fuzzytree.semantics.inference.degrees import curve_degree, hedged
from fuzzytree.semantics.lowering import rules_of
from fuzzytree.semantics.reference import axis_values

SPECIAL = (
    math.nan,
    math.inf,
    -math.inf,
    0.0,
    -0.0,
    5e-324,
    -1e-310,
    1e30,
    -1e30,
    1e300,
    -1e300,
    1.7976931348623157e308,
)
"""Values that number types and runtimes treat differently."""

_RANDOM_ROWS = 100
_ROUNDS = 12  # of moving a row towards what a path requires of its combinations
_TRIES = 48  # of meeting one value of a combination to the last bit

Row = dict[str, float]
Interval = tuple[float, float]


def probes(model: Document, *, limit: int = 20_000, seed: int = 0) -> list[Row]:
    """Return rows that put each distinct proposition on its landmarks and beside them.

    Args:
        model: A rule base, or a tree, which is probed through its relative rules; of a
            system the rows are those of `system_probes`.
        limit: The most rows to return. Above it, propositions' landmarks are drawn from
            the seed; random rows and special values always keep their place.
        seed: The same model, limit and seed give the same rows.

    Returns:
        A value for each input in each row: landmarks first, then 100 random rows,
        then each of `SPECIAL` in each input.
    """
    rules = rules_of(model)
    if isinstance(rules, FuzzySystem):
        return system_probes(rules, limit=limit, seed=seed)
    chance = random.Random(seed)
    maker = _Maker(rules, chance)
    tail = [maker.draw() for _ in range(_RANDOM_ROWS)]
    for name in rules.inputs:
        tail += [{**maker.draw(), name: value} for value in SPECIAL]
    tail = tail[:limit]
    targets = list(_targets(rules, maker.shapes))
    if len(targets) > limit - len(tail):
        targets = chance.sample(targets, max(limit - len(tail), 0))
    return [maker.meet(*target) for target in targets] + tail


def few_probes(model: Document, limit: int) -> list[Row]:
    """Return a few rows of every kind that `probes` returns, for tests within files.

    Args:
        model: The model; of a system the rows are those of `probes`.
        limit: The most rows: half of them on landmarks, an eighth random ones, the
            rest with special values. `probes` itself keeps its random rows first.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> len(few_probes(random_tree(1), 64))
        64
    """
    if model.outputs:
        return probes(model, limit=limit)
    special = len(SPECIAL) * len(model.inputs)
    rows = probes(model, limit=_RANDOM_ROWS + special + 10 * limit)
    last = len(rows) - special
    first = max(last - _RANDOM_ROWS, 0)
    return [
        *_spread(rows[:first], limit // 2),
        *_spread(rows[first:last], limit // 8),
        *_spread(rows[last:], limit - limit // 2 - limit // 8),
    ]


def _spread(rows: Sequence[Row], count: int) -> list[Row]:
    """Return some rows that stand equally far from each other."""
    step = max((len(rows) - 1) / max(count - 1, 1), 1.0)
    return [rows[round(k * step)] for k in range(min(count, len(rows)))]


def probe_values(model: Document, limit: int, *, seed: int = 0) -> FloatArray:
    """Return the rows of `probes` as (inputs, rows)."""
    return row_values(model, probes(model, limit=limit, seed=seed))


def row_values(model: Document, rows: Sequence[Row]) -> FloatArray:
    """Return rows as an array of shape (inputs, rows)."""
    import numpy as np

    table = np.array([[row[n] for row in rows] for n in model.inputs], np.float64)
    return table.reshape(len(model.inputs), len(rows))


def system_probes(
    system: FuzzySystem, *, limit: int = 2_000, seed: int = 0
) -> list[Row]:
    """Return rows that put each input of a system on the landmarks of its curves.

    Landmarks are the numbers by which a curve is given, the middles between them, and
    the ends of the input's range, each with its neighbouring doubles.

    Args:
        system: The system.
        limit: The most rows to return. Above it, landmarks are drawn from the seed;
            random rows, and one in five of all rows with a special value, keep their
            place.
        seed: The same system, limit and seed give the same rows.

    Returns:
        A value for each column in each row.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> len(system_probes(random_system(1), limit=50))
        50
    """
    chance = random.Random(seed)
    points = _system_points(system)
    ranges = {name: _hull(values) for name, values in points.items()}

    def draw() -> Row:
        return {name: chance.uniform(*ends) for name, ends in ranges.items()}

    special = [(name, value) for name in points for value in SPECIAL]
    chance.shuffle(special)
    random_rows = max(limit // 5, 1)
    tail = [draw() for _ in range(random_rows)]
    tail += [{**draw(), name: value} for name, value in special[: limit // 5]]
    near = [
        (name, value)
        for name, values in points.items()
        for point in dict.fromkeys(values)
        for value in neighbours(point)
    ]
    room = max(limit - len(tail), 0)
    if len(near) > room:
        near = chance.sample(near, room)
    rows = [{**draw(), name: value} for name, value in near]
    while len(rows) < room:
        rows.append({n: chance.choice(points[n]) for n in points} if points else {})
    return [*rows, *tail][:limit]


def range_rows(system: FuzzySystem, count: int, *, seed: int = 0) -> list[Row]:
    """Return rows drawn evenly from the range of each column.

    Where a range is not known, that of the landmarks stands for it.
    """
    chance = random.Random(seed)
    ranges = {name: _hull(values) for name, values in _system_points(system).items()}
    for one in system.variables:
        if not one.parts and one.low is not None and one.high is not None:
            ranges[one.name] = one.low, one.high
    return [
        {name: chance.uniform(*ends) for name, ends in ranges.items()}
        for _ in range(count)
    ]


class Aim:
    """Makes rows in which rules of a system are likely to fire.

    Each variable that a rule tests gets the landmark at which its propositions are
    truest together, or a value beside it that is at least half as true, so that rules
    next to it fire as well. Propositions on outputs are left out.
    """

    def __init__(self, system: FuzzySystem, *, seed: int = 0) -> None:
        self._chance = random.Random(seed)
        self._points = _system_points(system)
        self._inputs = {one.name: one for one in system.variables}
        self._curves = {
            (one.name, label.name): label.function
            for one in system.variables
            for label in one.terms
        }
        self._known: dict[tuple[str, frozenset[_Wish]], tuple[float, float]] = {}

    def row(self, rule: SystemRule) -> Row:
        """Return a row for a rule; what it does not test is drawn at random."""
        chance = self._chance
        row = {name: chance.uniform(*_hull(at)) for name, at in self._points.items()}
        wishes: dict[str, set[_Wish]] = {}
        for variable, wish in _wishes(rule.when, is_true=True):
            if variable in self._inputs:
                wishes.setdefault(variable, set()).add(wish)
        for variable, wish_set in wishes.items():
            value = self._value(variable, frozenset(wish_set), row)
            one = self._inputs[variable]
            if not one.parts:
                row[variable] = value
                continue
            *others, last = one.parts
            rest = sum(p.weight * (row[p.input] - p.centre) for p in others)
            row[last.input] = last.centre + (value - rest) / last.weight
        return row

    def _value(self, variable: str, wish_set: frozenset[_Wish], row: Row) -> float:
        key = variable, wish_set
        if key not in self._known:
            self._known[key] = self._best(variable, wish_set, row)
        best, degree = self._known[key]
        low, high = self._ends(variable)
        near = best + 0.05 * (high - low) * self._chance.uniform(-1.0, 1.0)
        is_near = self._degree(variable, wish_set, near, row) >= 0.5 * degree
        return near if is_near and low <= near <= high else best

    def _best(
        self, variable: str, wish_set: frozenset[_Wish], row: Row
    ) -> tuple[float, float]:
        """Return the landmark at which some propositions are truest, and how true."""
        points = sorted(dict.fromkeys(self._landmarks(variable)))
        middles = [a + 0.5 * (b - a) for a, b in itertools.pairwise(points)]
        results = [
            (self._degree(variable, wish_set, x, row), x) for x in points + middles
        ]
        degree, best = max(results, key=lambda pair: pair[0])
        return best, degree

    def _landmarks(self, variable: str) -> list[float]:
        one = self._inputs[variable]
        if not one.parts:
            return self._points[variable]
        numbers = [x for label in one.terms for x in landmarks_of(label.function)]
        return numbers or [0.0, 1.0]

    def _ends(self, variable: str) -> Interval:
        one = self._inputs[variable]
        if one.low is not None and one.high is not None:
            return one.low, one.high
        return _hull(self._landmarks(variable))

    def _degree(
        self, variable: str, wish_set: frozenset[_Wish], value: float, row: Row
    ) -> float:
        names = {**row, variable: value}
        degrees = []
        for label, hedges, is_true in wish_set:
            curve = self._curves[variable, label]
            degree = hedged(hedges, curve_degree(curve, value, names))
            degrees.append(degree if is_true else 1.0 - degree)
        return min((one for one in degrees if not math.isnan(one)), default=0.0)


_Wish = tuple[str, tuple[Hedge, ...], bool]
"""A term, the hedges before it, and whether the proposition shall be true."""


def _wishes(
    condition: Condition | None, *, is_true: bool
) -> Iterator[tuple[str, _Wish]]:
    """Yield propositions that make a condition true, or untrue, as far as they are."""
    match condition:
        case Proposition(variable=variable, term=str(label), hedges=hedges):
            yield variable, (label, hedges, is_true)
        case Not(part=part):
            yield from _wishes(part, is_true=not is_true)
        case And(parts=parts) | Or(parts=parts):
            needs_all = isinstance(condition, And) == is_true
            for part in parts if needs_all else parts[:1]:
                yield from _wishes(part, is_true=is_true)
        case _:
            return


def _system_points(system: FuzzySystem) -> dict[str, list[float]]:
    """Return the landmarks of each column; of combinations, those of their parts."""
    points: dict[str, list[float]] = {name: [] for name in system.inputs}
    for one in system.variables:
        ends = [end for end in (one.low, one.high) if end is not None]
        own = [value for label in one.terms for value in landmarks_of(label.function)]
        inner = [a + 0.5 * (b - a) for a, b in itertools.pairwise(sorted(set(own)))]
        if not one.parts:
            points[one.name] += [*ends, *own, *filter(math.isfinite, inner)]
        for part in one.parts:
            points[part.input].append(part.centre)
    return {name: values or [0.0, 1.0] for name, values in points.items()}


def landmarks_of(curve: Curve) -> list[float]:
    """Return the values at which a system's curve may change its formula.

    Example:
        >>> from fuzzytree.model import Gaussian, Trapezoid
        >>> landmarks_of(Trapezoid(None, 1.0, 2.0, 4.0))
        [1.0, 2.0, 4.0]
        >>> landmarks_of(Gaussian(5.0, 2.0))
        [5.0, 3.0, 7.0]
    """
    match curve:
        case Band() | LR() | Points():
            return [*landmarks(curve)]
        case Linear() | Formula():
            return []
        case (
            SigmoidDifference(first=first, second=second)
            | SigmoidProduct(first=first, second=second)
        ):
            return [*landmarks_of(first), *landmarks_of(second)]
        case Bell(center=middle, width=width) | Gaussian(mean=middle, deviation=width):
            results = [middle, middle - width, middle + width]
        case Cosine(center=middle, width=width) | Spike(center=middle, width=width):
            results = [middle, middle - width / 2.0, middle + width / 2.0]
        case Sigmoid(inflection=middle):
            results = [middle]
        case TwoGaussians(left=left, right=right):
            results = [left, right]
        case Binary(start=start):
            results = [start]
        case _:
            fields = [getattr(curve, name) for name in curve.__struct_fields__]
            results = [value for value in fields if value is not None]
    return [value for value in results if math.isfinite(value)]


def landmarks(shape: Shape) -> tuple[float, ...]:
    """Return the values at which a shape changes its formula, and one within each."""
    match shape:
        case Band(low=low, high=high):
            ends = [value for value in (low, high) if value is not None]
            for start, end in shape.flanks:
                ends += [end, start + 0.4 * (end - start)]
        case LR(mean=mean, left=below, right=above):
            ends = [mean]
            for sign, side in ((-1.0, below), (1.0, above)):
                for u in (0.6, 1.0, 0.5 + 0.5 * side.reach, side.reach):
                    ends.append(mean + sign * side.spread * u)
        case Points(values=values):
            inner = [a + 0.4 * (b - a) for a, b in itertools.pairwise(values)]
            ends = [*values, *inner]
    return tuple(dict.fromkeys(filter(math.isfinite, ends)))


def neighbours(value: float) -> tuple[float, ...]:
    """Return a value, the doubles next to it, and its float32 with its neighbours."""
    near = [value, math.nextafter(value, -math.inf), math.nextafter(value, math.inf)]
    if abs(value) < 1e38:
        single: float = struct.unpack("f", struct.pack("f", value))[0]
        step = max(math.ulp(single) * 2.0**29, 2.0**-149)
        near += [single, single - step, single + step]
    return tuple(filter(math.isfinite, dict.fromkeys(near)))


def _targets(
    rules: RuleBase, shapes: Mapping[tuple[str, str], Shape]
) -> Iterator[tuple[Rule, Proposition, float]]:
    """Yield a rule, a proposition and a value, once for each distinct proposition."""
    earlier: set[Proposition] = set()
    for rule in rules.rules:
        for proposition in rule.when:
            if proposition in earlier:
                continue
            earlier.add(proposition)
            values = itertools.chain.from_iterable(
                landmarks(shapes[proposition.variable, term])
                for term in proposition.terms
            )
            for value in dict.fromkeys(values):
                for near in neighbours(value):
                    yield rule, proposition, near


class _Maker:
    """Makes rows for one rule base; keeps what every row needs."""

    def __init__(self, rules: RuleBase, chance: random.Random) -> None:
        self.chance = chance
        self.shapes = shapes_of(rules.variables)
        self.variables = {v.name: v for v in rules.variables}
        self.ranges = _ranges(rules)

    def draw(self) -> Row:
        """Return a row within the range of the model's own landmarks."""
        return {
            name: self.chance.uniform(low, high)
            for name, (low, high) in self.ranges.items()
        }

    def meet(self, rule: Rule, proposition: Proposition, value: float) -> Row:
        """Return a row for which a rule holds, with one variable put on a value."""
        wanted = [
            (self.variables[other.variable], self._inside(other))
            for other in rule.when
            if other.variable != proposition.variable
        ]
        # Inputs can be set at once; combinations have to be moved, round by round.
        wanted.sort(key=lambda entry: not entry[0].parts, reverse=True)
        row = self.draw()
        target = self.variables[proposition.variable]
        for part in target.parts:  # small summands: no digits are lost in their sum
            row[part.input] = part.centre + self.chance.uniform(-0.5, 0.5) / part.weight
        for _ in range(_ROUNDS if any(v.parts for v, _ in wanted) else 1):
            moved = [self._move(row, variable, inside) for variable, inside in wanted]
            self._move(row, target, (value, value))
            if not any(moved):
                break
        self._hit(row, target, value)
        return row

    def _inside(self, proposition: Proposition) -> Interval:
        """Return an interval on which a proposition holds best."""
        shape = self.shapes[proposition.variable, self.chance.choice(proposition.terms)]
        match shape:
            case Band(low=low, high=high):
                width = max((abs(a - b) for a, b in shape.flanks), default=1.0)
                if low is None:
                    low = -math.inf if high is None else high - width
                if high is None:
                    high = math.inf if low == -math.inf else low + width
                return low, high
            case LR(mean=mean, left=below, right=above):
                return mean - 0.1 * below.spread, mean + 0.1 * above.spread
            case Points():
                return _highest(shape)

    def _move(self, row: Row, variable: Variable, inside: Interval) -> bool:
        """Shift a row so that a variable falls inside an interval; say if it did."""
        low, high = inside
        value = axis_values((variable,), row)[variable.name]
        if low < value < high or value == low == high or not math.isfinite(value):
            return False
        if math.isinf(low) or math.isinf(high):
            return False
        goal = (
            low if low == high else low + (high - low) * self.chance.uniform(0.1, 0.9)
        )
        if not variable.parts:
            row[variable.name] = goal
            return True
        share = (goal - value) / len(variable.parts)  # every summand moves alike
        for part in variable.parts:
            row[part.input] += share / part.weight
        return True

    def _hit(self, row: Row, variable: Variable, value: float) -> None:
        """Set the finest of a variable's inputs so that it has a value exactly.

        The values of a combination that doubles can reach are a lattice; where the
        value is not on it, the row stays on the nearest point that was found.
        """
        if not variable.parts:
            row[variable.name] = value
            return
        steps = {
            p.input: abs(p.weight) * math.ulp(max(abs(row[p.input]), abs(p.centre)))
            for p in variable.parts
        }
        weights = {p.input: p.weight for p in variable.parts}
        finest = min(steps, key=lambda name: steps[name])
        best, nearest = math.inf, dict(row)
        for attempt in range(_TRIES):
            gap = value - axis_values((variable,), row)[variable.name]
            if abs(gap) < best:
                best, nearest = abs(gap), dict(row)
            if not abs(gap) > 0:
                break
            # Mostly the finest input in its own steps; at times another, which
            # shifts the lattice of sums that the finest can reach.
            name = finest if attempt % 3 else self.chance.choice(list(steps))
            here, step = row[name], gap / weights[name]
            if here + step == here:
                step = math.copysign(math.ulp(here) * self.chance.randint(1, 5), step)
            row[name] = here + step
        row.update(nearest)


def _highest(points: Points) -> Interval:
    """Return the longest stretch on which points reach their largest degree."""
    top = max(points.degrees)
    ends = [-math.inf, *points.values, math.inf]
    degrees = [points.degrees[0], *points.degrees, points.degrees[-1]]
    pairs = itertools.pairwise(zip(ends, degrees, strict=True))
    level = [(a, b) for (a, p), (b, r) in pairs if p == r == top]
    peak = points.values[points.degrees.index(top)]
    return max(level, key=lambda ab: ab[1] - ab[0], default=(peak, peak))


def _ranges(rules: RuleBase) -> dict[str, Interval]:
    """Return, for each input, a range that holds its landmarks and weights' units."""
    points: dict[str, list[float]] = {name: [] for name in rules.inputs}
    for variable in rules.variables:
        if not variable.parts:
            points[variable.name] += _known(variable)
    for variable in rules.variables:
        for part in variable.parts:
            unit = min(max(1.0 / abs(part.weight), 1e-100), 1e100)
            points[part.input] += [part.centre - unit, part.centre + unit]
    return {name: _hull(values) for name, values in points.items()}


def _known(variable: Variable) -> Iterable[float]:
    ends = [end for end in (variable.low, variable.high) if end is not None]
    return [*ends, *(v for term in variable.terms for v in landmarks(term.shape))]


def _hull(values: Sequence[float]) -> Interval:
    low, high = min(values, default=0.0), max(values, default=1.0)
    return (low, high) if low < high else (low - 1.0, high + 1.0)

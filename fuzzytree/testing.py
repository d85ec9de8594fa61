"""Models to test with, for us and for people who write formats and runtimes.

`random_tree` makes valid trees of any size from a seed; `probes` (from
`fuzzytree.semantics.probing`) the rows that matter for a model, `probe_values` as an
array. `random_system` makes fuzzy systems with numeric outputs, `random_rows` rows for
them. `check_exporter` tries everything that a format must do, in one call:

    def test_the_turtle_format_keeps_its_promises() -> None:
        check_exporter(turtle.FORMAT)
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from typing import TypeVar

from msgspec.structs import replace

from fuzzytree.checking import failures
from fuzzytree.errors import DisagreementError
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    LR,
    PARTS,
    SHARPNESS,
    Band,
    Branch,
    Conclusion,
    Defuzzifier,
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Leaf,
    Node,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Sets,
    Shape,
    Side,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    interval_names,
    intervals,
)
from fuzzytree.semantics import (
    SPECIAL,
    all_samples,
    landmarks,
    probe_values,
    probes,
    random_rows,
    random_system,
    rules_from_tree,
)

Rated = TypeVar("Rated", FuzzyTree, RuleBase)

__all__ = [
    "SPECIAL",
    "check_exporter",
    "exporter_models",
    "probe_values",
    "probes",
    "random_rows",
    "random_system",
    "random_tree",
    "rated",
    "with_points",
]


def check_exporter(form: Format | str, *, seed: int = 0, rounds: int = 2) -> None:
    """Try whatever a format must do, and tell everything that it does wrong.

    It writes some seventy models of the kinds that the format says it carries: with
    every feature, odd names and extreme numbers. Each must be written twice as the same
    bytes, or be refused by a LossError that lists what would be lost. What is written
    without a loss must be read back as an equal model, if the format reads. Damaged and
    hostile files must end in a ReadError.

    Args:
        form: The format, or the name of one that is installed.
        seed: Of the random models and the damaged files.
        rounds: How many random trees, rule bases and systems are tried, and how many
            more files are damaged.

    Raises:
        DisagreementError: It lists every failure, a sentence each.
        ValueError: If there is no format of the name.

    Example:
        >>> check_exporter("yaml")
    """
    form = find_format(form) if isinstance(form, str) else form
    models = exporter_models(seed, rounds)
    result = failures(form, models, seed=seed, damaged=1 + rounds)
    if result:
        listed = "\n".join(f"  {text}" for text in result)
        raise DisagreementError(f"{form.name} fails in {len(result)} points:\n{listed}")


def exporter_models(seed: int = 0, rounds: int = 2) -> Iterator[tuple[str, Document]]:
    """Yield the models that `check_exporter` tries, each with a title.

    Args:
        seed: Of the random ones.
        rounds: How many random trees; there are twice as many systems.
    """
    yield from all_samples().items()
    for number in range(seed, seed + rounds):
        tree = random_tree(number, leaves=5)
        yield f"random_tree({number})", tree
        for kind in ("relative", "raw"):
            rules = rules_from_tree(tree, kind)
            yield f"{kind} rules of random_tree({number})", rules
        yield f"rated tree of random_tree({number})", rated(tree, number)
        more = rated(rules_from_tree(tree), number)
        yield f"rated rules of random_tree({number})", more
        points = with_points(rules_from_tree(tree, conjunction="product"), number)
        yield f"with_points of random_tree({number})", points
    for number in range(seed, seed + 2 * rounds):
        yield f"random_system({number})", random_system(number)
    for start in range(0, len(ODD_NAMES), 4):
        names = ODD_NAMES[start : start + 4]
        yield f"rules named {names}", _named_rules(names)
        yield f"a system named {names}", _named_system(names)
    yield "rules with extreme numbers", _extreme_rules()
    yield "a system with extreme numbers", _extreme_system()
    yield "a system by lines", _system_by_lines()


ODD_NAMES = (
    *("petal length", "is", "IF", "and", "not", "then", "x", "class", "END_RULE"),
    *("rule", "1st", "3.5", "-1", "null", "größe", "温度", "😀", "  blanks  "),
    *("A", "a", "a_b", "a b", "a'b", 'a"b', "a\\b", "a;b", "a:b", "a,b", "a#b"),
    *("a//b", "*/", "(* b *)", "]]>", "<a&b>", "{a}", "%s", "--"),
    *("\u00e9", "e\u0301", "x" * 300, "$a", "a.b"),
)
"""Names that one format or another cannot hold as they are."""


def _named_rules(names: Sequence[str]) -> RuleBase:
    """Return rules whose classes, variables and terms have these names."""
    ramp = Points((0.0, 1.0), (0.0, 1.0))
    terms = tuple(Term(name, ramp) for name in names)
    return RuleBase(
        names[0],
        tuple(names),
        tuple(Variable(name, terms, unit=name) for name in names),
        tuple(
            Rule(tuple(Proposition(one, (other,)) for one in names), other)
            for other in names
        ),
    )


def _named_system(names: Sequence[str]) -> FuzzySystem:
    """Return a system whose inputs and terms have these names."""
    ramp = Points((0.0, 1.0), (0.0, 1.0))
    curves = tuple(Term(name, ramp) for name in names)
    numbers = tuple(Term(name, Singleton(float(k))) for k, name in enumerate(names, 1))
    output = SystemOutput(
        f"{names[0]} 2", numbers, 0.0, 9.0, Defuzzifier("weighted average")
    )
    rules = tuple(
        SystemRule(
            Proposition(one, (other,)), (Conclusion(output.name, other),), name=one
        )
        for one, other in zip(names, names[::-1], strict=True)
    )
    inputs = tuple(
        Variable(name, curves, low=0.0, high=1.0, unit=name) for name in names
    )
    return FuzzySystem(names[0], inputs, (output,), (RuleBlock(rules, name=names[0]),))


_EXTREMES = (-1e308, -1.5, -5e-324, -0.0, 5e-324, 1e-310, 0.1, 1e308)


def _extreme_rules() -> RuleBase:
    """Return rules over points at the ends of the doubles, and between the smallest."""
    degrees = (0.0, 1.0, 5e-324, 0.5, 1.0 - 2.0**-53, 0.1, 1.0, 0.0)
    terms = (
        Term("wide", Points(_EXTREMES, degrees)),
        Term("all", Points((0.0,), (1.0,))),
    )
    mix = Variable("mix", terms, parts=(Part("a", 5e-324), Part("b", -1e300, 1e308)))
    inputs = (Variable("a", terms, low=-1e308, high=1e308), Variable("b", terms))
    rules = (
        Rule((Proposition("a", ("wide",)), Proposition("mix", ("all",))), "one", 2**53),
        Rule((Proposition("b", ("wide", "all"), hedges=("not",)),), "two", 0),
        Rule((), "one"),
    )
    return RuleBase("extreme", ("one", "two"), (*inputs, mix), rules)


def _extreme_system() -> FuzzySystem:
    """Return a system of extreme numbers."""
    degrees = (0.0, 1.0, 5e-324, 0.5, 1.0 - 2.0**-53, 0.1, 1.0, 0.0)
    label = Term("wide", Points(_EXTREMES, degrees), height=5e-324)
    numbers = tuple(Term(f"n{k}", Singleton(x)) for k, x in enumerate(_EXTREMES))
    how = Defuzzifier("weighted average")
    output = SystemOutput("y", numbers, -1e308, 1e308, how, default=-0.0)
    rules = tuple(
        SystemRule(Proposition("a", ("wide",)), (Conclusion("y", one.name),), weight)
        for one, weight in zip(numbers, degrees, strict=True)
    )
    inputs = (Variable("a", (label,), low=-1e308, high=1e308),)
    return FuzzySystem("extreme", inputs, (output,), (RuleBlock(rules),))


def _system_by_lines() -> FuzzySystem:
    """Return a system whose output's curve is made of lines."""
    ramp = Term("ramp", Points((0.0, 1.0), (0.0, 1.0)))
    labels = (
        Term("low", Points((0.0, 0.4, 1.0), (1.0, 0.25, 0.0))),
        Term("high", Points((0.1, 0.5, 0.9), (0.0, 1.0, 0.3)), height=0.75),
        Term("all", Points((0.0,), (0.125,))),
    )
    how = Defuzzifier("centroid", 6, "lines")
    output = SystemOutput("y", labels, 0.0, 1.0, how, aggregation="maximum")
    rules = tuple(
        SystemRule(when, (Conclusion("y", name),), weight)
        for name, weight, when in (
            ("low", 1.0, Proposition("a", ("ramp",), ("not",))),
            ("high", 0.5, Proposition("a", ("ramp",))),
            ("all", 1.0, None),
            ("high", 1.0, Proposition("a", ("ramp",), ("very",))),
        )
    )
    inputs = (Variable("a", (ramp,), low=0.0, high=1.0),)
    block = RuleBlock(rules, implication="minimum")
    return FuzzySystem("lines", inputs, (output,), (block,))


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
        combinations: The share of nodes that test a combination of inputs.
        semantics: The defaults unless given.
    """
    chance = random.Random(seed)
    columns = tuple(f"x{number}" for number in range(1, inputs + 1))
    labels = tuple(f"class {number}" for number in range(1, classes + 1))
    scale = {name: 10.0 ** chance.randint(-3, 6) for name in columns}
    tests: list[tuple[str, tuple[float, ...], tuple[int, ...]]] = []
    derived: list[Variable] = []
    plan = _grow(chance, leaves, [])

    def add_test(branches: int) -> None:
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
        tests.append((name, tuple(cuts), tuple(owners)))

    for children in plan:
        add_test(len(children))
    return _assemble(
        chance, columns, labels, derived, tests, plan, semantics or Semantics()
    )


def rated(model: Rated, seed: int) -> Rated:
    """Return a tree or rule base with random probabilities at its leaves or rules.

    Example:
        >>> rated(random_tree(1), 0).semantics.sharpness
        512
    """
    chance = random.Random(seed)
    vectors: list[tuple[float, ...]] = []
    for _ in model.rule_labels:
        count = len(model.classes) - 1
        marks: list[int] = sorted(chance.choices(range(PARTS + 1), k=count))
        steps = itertools.pairwise([0, *marks, PARTS])
        vectors.append(tuple((high - low) / PARTS for low, high in steps))
    semantics = replace(model.semantics, sharpness=chance.choice(SHARPNESS))
    ends = zip(model.leaves or model.rules, vectors, strict=True)
    parts = tuple(replace(end, probabilities=vector) for end, vector in ends)
    place = str(model.rule_path(1)[0])
    return replace(model, semantics=semantics, **{place: parts})


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


def _leaf(label: str, number: int, support: int, labels: tuple[str, ...]) -> Leaf:
    """Return a leaf, a few of whose rows are of the first class."""
    counts = dict.fromkeys(labels, 0)
    counts[labels[0]] += support // 4
    counts[label] += support - support // 4
    rows = tuple(counts.values()) if number % 3 else ()
    return Leaf(label, f"pattern {number}", support, counts=rows)


def _assemble(
    chance: random.Random,
    columns: tuple[str, ...],
    labels: tuple[str, ...],
    derived: list[Variable],
    tests: list[tuple[str, tuple[float, ...], tuple[int, ...]]],
    plan: Plan,
    semantics: Semantics,
) -> FuzzyTree:
    total = 1 + max((n for c in plan for kind, n in c if kind == "leaf"), default=1) - 1
    leaves = tuple(
        _leaf(chance.choice(labels), number, chance.randint(0, 99), labels)
        for number in range(1, total + 1)
    )
    below = _leaves_below(plan)
    terms: dict[str, list[Term]] = {}
    names: dict[int, list[str]] = {}
    for variable in dict.fromkeys(name for name, _, _ in tests):
        here = [i for i, entry in enumerate(tests) if entry[0] == variable]
        texts = interval_names([tests[i][1] for i in here])
        names.update(zip(here, texts, strict=True))
    nodes: list[Node] = []
    for position, (variable, cuts, owners) in enumerate(tests):
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
    used = {name for name, _, _ in tests}
    parts = {part.input for v in derived for part in v.parts}
    variables = tuple(
        Variable(n, tuple(terms.get(n, ())), unit="cm", low=-9.5e6, high=9.5e6)
        for n in columns
        if n in used | parts
    ) + tuple(Variable(v.name, tuple(terms[v.name]), parts=v.parts) for v in derived)
    spans = {name: cuts for name, cuts, _ in tests}
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

    def width() -> float:
        return unit * chance.uniform(0.1, 2.0)

    return Band(
        low,
        high,
        None if low is None else low - width(),
        None if high is None else high + width(),
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

"""Small models, each with one thing that not every format can carry.

`fuzzytree formats` writes each of them in each format and reports the result; the
conformance suite reads and writes them as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from msgspec.structs import replace

from fuzzytree.model import (
    LR,
    Activation,
    And,
    Band,
    Branch,
    Call,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Gaussian,
    Leaf,
    Linear,
    Name,
    Node,
    Not,
    Number,
    Or,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    SCurve,
    Semantics,
    Sets,
    Side,
    Sigmoid,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.semantics.lowering import rules_from_tree


def all_samples() -> dict[str, Document]:
    """Return every sample, by what is special about it.

    Example:
        >>> list(all_samples())[:3]
        ['tree', 'tree with combined features', 'relative rules']
    """
    return {name: make() for name, make in SAMPLES.items()}


# --- trees and rule bases


def _tree() -> FuzzyTree:
    """Return a tree of two nodes: force, then slip."""
    low = Term("low", Band(high=2.0, right=4.0))
    high = Term("high", Band(low=2.0, left=0.0))
    none = Term("none", Band(high=0.5, right=1.5))
    much = Term("much", Band(low=0.5, left=-0.5))
    first = (Branch(("low",), ("soft",), leaf=1), Branch(("high",), ("firm",), node=2))
    second = (
        Branch(("none",), ("loose",), leaf=2),
        Branch(("much",), ("firm",), leaf=3),
    )
    return FuzzyTree(
        "grip",
        ("firm", "loose", "soft"),
        (
            Variable("force", (low, high), low=0.0, high=5.0),
            Variable("slip", (none, much), low=0.0, high=1.0),
        ),
        (
            Node("force", (2.0,), (0, 1), first),
            Node("slip", (0.5,), (0, 1), second),
        ),
        (Leaf("soft"), Leaf("loose"), Leaf("firm")),
        sets=(
            Sets("force", (_lr("soft", 1.0), _lr("firm", 3.0))),
            Sets("slip", (_lr("loose", 0.2), _lr("firm", 0.9))),
        ),
    )


def _lr(name: str, mean: float) -> Term:
    return Term(name, LR(mean, Side(0.5, (0.6, 0.1)), Side(0.75, (0.5,))))


def _mixed_tree() -> FuzzyTree:
    """Return a tree that tests a sum of two inputs."""
    mix = Variable(
        "mix",
        (
            Term("low", Band(high=1.5, right=2.5)),
            Term("high", Band(low=1.5, left=0.5)),
        ),
        parts=(Part("force", 0.5, 1.0), Part("slip", -2.0)),
    )
    inputs = (
        Variable("force", low=0.0, high=5.0),
        Variable("slip", low=0.0, high=1.0),
    )
    ends = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    return FuzzyTree(
        "mixed",
        ("firm", "soft"),
        (*inputs, mix),
        (Node("mix", (1.5,), (0, 1), ends),),
        (Leaf("soft"), Leaf("firm")),
    )


def _rules(*rules: Rule, semantics: Semantics | None = None) -> RuleBase:
    """Return a rule base over two inputs whose terms are ramps."""
    low, high = Points((0.0, 4.0), (1.0, 0.0)), Points((0.0, 4.0), (0.0, 1.0))
    middle = Points((0.0, 2.0, 4.0), (0.0, 1.0, 0.0))
    terms = (Term("low", low), Term("middle", middle), Term("high", high))
    return RuleBase(
        "ramps",
        ("firm", "soft"),
        (
            Variable("force", terms, low=0.0, high=4.0),
            Variable("slip", terms, low=0.0, high=4.0),
        ),
        rules or _PLAIN,
        semantics or Semantics(),
    )


_PLAIN = (
    Rule((Proposition("force", ("low",)), Proposition("slip", ("high",))), "soft"),
    Rule((Proposition("force", ("high",)),), "firm"),
)


def _stepped() -> RuleBase:
    """Return rules whose terms have a vertical edge."""
    rules = _rules()
    step = Points((1.0, 1.0, 4.0), (0.25, 1.0, 0.0))
    first = replace(rules.variables[0], terms=(Term("low", step), Term("high", step)))
    return replace(rules, variables=(first, rules.variables[1]))


# --- systems


_LOW: Condition = Proposition("heat", ("low",))
_HIGH: Condition = Proposition("heat", ("high",))
_DRY: Condition = Proposition("damp", ("dry",))


def _input(name: str, low: str, high: str) -> Variable:
    return Variable(
        name,
        (
            Term(low, Trapezoid(None, 0.0, 2.0, 6.0)),
            Term(high, Trapezoid(4.0, 8.0, 10.0, None)),
        ),
        low=0.0,
        high=10.0,
    )


def _sugeno(
    *rules: SystemRule,
    slow: Curve | None = None,
    fast: Curve | None = None,
    method: Defuzzifier | None = None,
) -> FuzzySystem:
    """Return a system whose output is a weighted number."""
    labels = (
        Term("slow", slow or Singleton(1.0)),
        Term("fast", fast or Singleton(3.5)),
    )
    output = SystemOutput(
        "fan", labels, 0.0, 5.0, method or Defuzzifier("weighted average")
    )
    return FuzzySystem(
        "fan",
        (_input("heat", "low", "high"), _input("damp", "dry", "wet")),
        (output,),
        (RuleBlock(rules or _two()),),
    )


def _two(weight: float = 1.0) -> tuple[SystemRule, ...]:
    return (
        SystemRule(And((_LOW, _DRY)), (Conclusion("fan", "slow"),), weight),
        SystemRule(_HIGH, (Conclusion("fan", "fast"),)),
    )


def _mamdani(method: Defuzzifier | None = None) -> FuzzySystem:
    """Return a system whose output is the centroid of curves."""
    system = _sugeno(
        slow=Trapezoid(0.0, 1.0, 1.0, 3.0), fast=Trapezoid(2.0, 4.0, 4.0, 5.0)
    )
    output = replace(
        system.outputs[0],
        defuzzifier=method or Defuzzifier("centroid"),
        aggregation="maximum",
    )
    block = replace(system.blocks[0], implication="minimum")
    return replace(system, outputs=(output,), blocks=(block,))


def _singletons() -> FuzzySystem:
    """Return a classifier as JFML writes them: terms without width, and a maximum."""
    system = _mamdani(Defuzzifier("smallest of maximum", 1000))
    labels = (Term("slow", Singleton(1.0)), Term("fast", Singleton(3.5)))
    output = replace(system.outputs[0], terms=labels)
    return replace(system, outputs=(output,))


def _curved(curve: Curve) -> FuzzySystem:
    system = _sugeno()
    heat = replace(
        system.variables[0], terms=(system.variables[0].terms[0], Term("high", curve))
    )
    return replace(system, variables=(heat, system.variables[1]))


def _several_outputs() -> FuzzySystem:
    system = _sugeno()
    lamp = replace(system.outputs[0], name="lamp")
    both = (Conclusion("fan", "slow"), Conclusion("lamp", "fast"))
    rules = (SystemRule(_LOW, both), *_two())
    return replace(system, outputs=(*system.outputs, lamp), blocks=(RuleBlock(rules),))


def _several_blocks() -> FuzzySystem:
    first, second = _two()
    blocks = (RuleBlock((first,)), RuleBlock((second,), conjunction="product"))
    return replace(_sugeno(), blocks=blocks)


def _default() -> FuzzySystem:
    system = _sugeno()
    return replace(system, outputs=(replace(system.outputs[0], default=2.5),))


def _clipped() -> FuzzySystem:
    system = _sugeno()
    inputs = tuple(replace(one, clips=True) for one in system.variables)
    return replace(system, variables=inputs)


SAMPLES: Mapping[str, Callable[[], Document]] = {
    "tree": _tree,
    "tree with combined features": _mixed_tree,
    "relative rules": lambda: rules_from_tree(_tree()),
    "raw rules (LR curves)": lambda: rules_from_tree(_tree(), "raw"),
    "rules with combined features": lambda: rules_from_tree(_mixed_tree()),
    "point lists": lambda: _rules(),
    "vertical edges": _stepped,
    "AND as product": lambda: _rules(semantics=Semantics("product")),
    "several terms in a proposition": lambda: _rules(
        Rule((Proposition("force", ("low", "high")),), "soft"), _PLAIN[1]
    ),
    "negated propositions": lambda: _rules(
        Rule((Proposition("force", ("low",), hedges=("not",)),), "soft"), _PLAIN[0]
    ),
    "a rule that always holds": lambda: _rules(_PLAIN[0], Rule((), "firm")),
    "answers where no rule fires": lambda: _rules(
        semantics=Semantics(uncovered="firm", missing="soft")
    ),
    "Sugeno, numbers": _sugeno,
    "Sugeno, linear": lambda: _sugeno(
        slow=Linear((0.5, -0.25), 1.0), fast=Linear((0.0, 1.0), 2.0)
    ),
    "Sugeno, formulas": lambda: _sugeno(
        slow=Formula(Call("/", (Call("^", (Name("heat"), Number(2.0))), Number(20.0))))
    ),
    "weighted sum": lambda: _sugeno(method=Defuzzifier("weighted sum")),
    "Tsukamoto": lambda: _sugeno(
        slow=Points((0.0, 5.0), (1.0, 0.0)), fast=Points((0.0, 5.0), (0.0, 1.0))
    ),
    "Mamdani, centroid": _mamdani,
    "Mamdani, mean of maximum": lambda: _mamdani(Defuzzifier("mean of maximum")),
    "Mamdani, singletons": _singletons,
    "number of samples": lambda: _mamdani(Defuzzifier("centroid", samples=777)),
    "samples at low ends": lambda: _mamdani(Defuzzifier("centroid", 1000, "low ends")),
    "weights of rules": lambda: _sugeno(*_two(0.75)),
    "hedges": lambda: _sugeno(
        _two()[0],
        SystemRule(
            Proposition("heat", ("high",), ("very",)), (Conclusion("fan", "fast"),)
        ),
    ),
    "OR": lambda: _sugeno(
        SystemRule(Or((And((_LOW, _DRY)), _HIGH)), (Conclusion("fan", "fast"),))
    ),
    "NOT": lambda: _sugeno(
        SystemRule(And((_LOW, Not(_DRY))), (Conclusion("fan", "slow"),)), _two()[1]
    ),
    "a conclusion without a condition": lambda: _sugeno(
        *_two(), SystemRule(None, (Conclusion("fan", "slow"),))
    ),
    "gaussian curves": lambda: _curved(Gaussian(5.0, 1.5)),
    "sigmoid curves": lambda: _curved(Sigmoid(5.0, 2.0)),
    "S curves": lambda: _curved(SCurve(2.0, 8.0)),
    "several outputs": _several_outputs,
    "several rule blocks": _several_blocks,
    "product and algebraic sum": lambda: replace(
        _sugeno(), blocks=(RuleBlock(_two(), "product", "algebraic sum"),)
    ),
    "Hamacher norms": lambda: replace(
        _sugeno(), blocks=(RuleBlock(_two(), "hamacher product", "hamacher sum"),)
    ),
    "the highest rule alone": lambda: replace(
        _sugeno(), blocks=(RuleBlock(_two(), activation=Activation("highest", 1)),)
    ),
    "a default answer": _default,
    "inputs clamped to their range": _clipped,
}
"""What makes each sample, by what is special about it."""

"""Systems as objects of pyfuzzylite, as far as it can hold them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from msgspec.structs import replace

from fuzzytree.model import (
    Activation,
    And,
    Arc,
    Bell,
    Binary,
    Call,
    Concave,
    Conclusion,
    Condition,
    Cosine,
    Curve,
    Defuzzifier,
    Expression,
    Formula,
    FuzzySystem,
    Gaussian,
    Hedge,
    Linear,
    Name,
    Not,
    Number,
    Or,
    PiCurve,
    Proposition,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.model.rulebase import Points

if TYPE_CHECKING:
    import fuzzylite as fl

HEDGES: Final[tuple[Hedge, ...]] = (
    "any", "not", "very", "somewhat", "extremely", "seldom",
)  # fmt: skip
NORMS: Final = {
    "minimum": "Minimum",
    "product": "AlgebraicProduct",
    "bounded difference": "BoundedDifference",
    "drastic product": "DrasticProduct",
    "einstein product": "EinsteinProduct",
    "hamacher product": "HamacherProduct",
    "nilpotent minimum": "NilpotentMinimum",
    "maximum": "Maximum",
    "algebraic sum": "AlgebraicSum",
    "bounded sum": "BoundedSum",
    "drastic sum": "DrasticSum",
    "einstein sum": "EinsteinSum",
    "hamacher sum": "HamacherSum",
    "nilpotent maximum": "NilpotentMaximum",
    "normalized sum": "NormalizedSum",
    "sum": "UnboundedSum",
}
DEFUZZIFIERS: Final = {
    "centroid": "Centroid",
    "bisector": "Bisector",
    "smallest of maximum": "SmallestOfMaximum",
    "largest of maximum": "LargestOfMaximum",
    "mean of maximum": "MeanOfMaximum",
    "weighted average": "WeightedAverage",
    "weighted sum": "WeightedSum",
}


def term(curve: Curve, columns: Sequence[str] = (), height: float = 1.0) -> fl.Term:
    """Return a curve as a term; a number where it is a singleton."""
    import fuzzylite as fl

    made: fl.Term
    match curve:
        case Points(values=(first, last), degrees=(0.0, 1.0)):
            made = fl.Ramp("", first, last)
        case Points(values=(first, last), degrees=(1.0, 0.0)):
            made = fl.Ramp("", last, first)
        case Points(values=values, degrees=degrees):
            pairs = zip(values, degrees, strict=True)
            made = fl.Discrete("", [number for pair in pairs for number in pair])
        case Trapezoid(a=a, b=b, c=c, d=d):
            first = -math.inf if a is None else a
            last = math.inf if d is None else d
            if b == c:
                made = fl.Triangle("", first, b, last)
            elif (a, c) == (b, d):
                made = fl.Rectangle("", b, c)
            else:
                made = fl.Trapezoid("", first, b, c, last)
        case Gaussian(mean=mean, deviation=deviation):
            made = fl.Gaussian("", mean, deviation)
        case TwoGaussians():
            made = fl.GaussianProduct(
                "",
                curve.left,
                curve.left_deviation,
                curve.right,
                curve.right_deviation,
            )
        case Bell(center=center, width=width, slope=slope):
            made = fl.Bell("", center, width, slope)
        case Sigmoid(inflection=inflection, slope=slope):
            made = fl.Sigmoid("", inflection, slope)
        case SigmoidDifference(first=a, second=b):
            made = fl.SigmoidDifference(
                "", a.inflection, a.slope, b.slope, b.inflection
            )
        case SigmoidProduct(first=a, second=b):
            made = fl.SigmoidProduct("", a.inflection, a.slope, b.slope, b.inflection)
        case SCurve(start=start, end=end):
            rises = start <= end
            made = fl.SShape("", start, end) if rises else fl.ZShape("", end, start)
        case PiCurve(a=a, b=b, c=c, d=d):
            made = fl.PiShape("", a, b, c, d)
        case Cosine(center=center, width=width):
            made = fl.Cosine("", center, width)
        case Concave(inflection=inflection, end=end):
            made = fl.Concave("", inflection, end)
        case Spike(center=center, width=width):
            made = fl.Spike("", center, width)
        case Arc(start=start, end=end):
            made = fl.Arc("", start, end)
        case SemiEllipse(start=start, end=end):
            made = fl.SemiEllipse("", start, end)
        case Binary(start=start, is_above=is_above):
            made = fl.Binary("", start, math.inf if is_above else -math.inf)
        case Singleton(value=value):
            made = fl.Constant("", value)
        case Linear(weights=weights, offset=offset):
            made = fl.Linear("", [*weights, offset])
        case Formula(expression=expression):
            made = fl.Function("", text(expression), load=True)
        case _:
            raise TypeError(f"no term for {curve}")
    made.height = height
    return made


_TRUTHS: Final = ("lt", "le", "gt", "ge", "eq", "neq")


def text(expression: Expression) -> str:
    """Return a formula as pyfuzzylite reads it.

    Its `min` and `max` fail where a curve is looked at, and its truths make the
    functions of numpy compute in half precision: both are written with numbers.
    """
    match expression:
        case Number(value=value):
            return repr(value)
        case Name(name=name):
            return name
        case Call(function="negate", arguments=(one,)):
            return f"(0 - {text(one)})"
        case Call(function="not", arguments=(one,)):
            return f"(1.0 * (! {text(one)}))"
        case Call(function="min" | "max" as function, arguments=(one, other)):
            a, b = text(one), text(other)
            less, more = ("lt", "ge") if function == "min" else ("gt", "le")
            return f"({less}({a}, {b}) * {a} + {more}({a}, {b}) * {b})"
        case Call(function=function, arguments=arguments):
            parts = [text(one) for one in arguments]
            if function in ("and", "or"):
                return f"(1.0 * ({f' {function} '.join(parts)}))"
            if function in _TRUTHS:
                return f"(1.0 * {function}({', '.join(parts)}))"
            if function.isalnum():
                return f"{function}({', '.join(parts)})"
            return f"({f' {function} '.join(parts)})"


def alike(system: FuzzySystem) -> FuzzySystem:
    """Return a system near to one, of which pyfuzzylite means the same.

    Left out is what it lacks: our own shapes, some hedges, NOT around several
    conditions, rules without a condition, other grids; then what it means otherwise,
    see `docs/reference/systems.md`: rules of degree 0 conclude too (so no hedge may
    raise 0, and an S curve takes the place of the curves that are infinite there),
    weighted numbers are summed for each label before they are weighted, and degrees
    above 1 are bounded later. Maxima become centroids: theirs hang on the last digit.
    """
    outputs = tuple(map(_output_alike, system.outputs))
    inputs = tuple(
        replace(one, terms=tuple(map(_looked_at, one.terms)))
        for one in system.variables
        if not one.parts
    )
    first = inputs[0].name
    known = {one.name for one in inputs} | {one.name for one in outputs}
    blocks = tuple(_block_alike(block, first, known) for block in system.blocks)
    return replace(system, variables=inputs, outputs=outputs, blocks=blocks)


def _looked_at(label: Term) -> Term:
    match label.function:
        case Singleton(value=value):
            return replace(label, function=Trapezoid(value, value, value, value))
        case Formula():
            return replace(label, height=1.0)
        case Linear():
            raise TypeError("no curve is linear")
        case curve:
            try:
                term(curve)
            except TypeError:
                return replace(label, function=Trapezoid(-1.0, -0.5, 0.25, 1.0))
            return label


_NUMBERS: Final = (Singleton, Linear, Formula)


def _output_alike(output: SystemOutput) -> SystemOutput:
    if not output.defuzzifier.is_weighted:
        is_maximum = output.defuzzifier.method.endswith("maximum")
        method = "centroid" if is_maximum else output.defuzzifier.method
        how = Defuzzifier(method, output.defuzzifier.samples)
        labels = tuple(map(_looked_at, output.terms))
        return replace(output, terms=labels, defuzzifier=how)
    first = output.terms[0].function
    labels = output.terms
    if isinstance(first, _NUMBERS):
        labels = tuple(
            replace(one, height=1.0)
            if isinstance(one.function, _NUMBERS)
            else replace(one, function=Singleton(0.5), height=1.0)
            for one in labels
        )
    else:
        rising = SCurve(0.0, 1.0) if _is_edge(first) else Trapezoid(0.0, 0.2, 0.5, 1.0)
        labels = tuple(replace(one, function=rising) for one in labels)
    return replace(output, terms=labels, aggregation=output.aggregation or "sum")


def _is_edge(curve: Curve) -> bool:
    return isinstance(curve, SCurve | Arc | Sigmoid | Concave) or (
        isinstance(curve, Points) and len(curve.values) == 2
    )


def _block_alike(block: RuleBlock, first: str, known: set[str]) -> RuleBlock:
    rules: list[SystemRule] = []
    for rule in block.rules:
        when = rule.when or Proposition(first, (), ("any",))
        then = tuple(
            replace(one, hedges=_hedges(one.hedges, ("any", "not")))
            for one in rule.then
        )
        rules.append(replace(rule, when=_condition(when, first, known), then=then))
    is_sum = block.disjunction == "sum"
    disjunction = "maximum" if is_sum else block.disjunction
    return replace(block, rules=tuple(rules), disjunction=disjunction)


def _hedges(hedges: Sequence[Hedge], but: Sequence[Hedge] = ()) -> tuple[Hedge, ...]:
    return tuple(one for one in hedges if one in HEDGES and one not in but)


def _condition(condition: Condition, first: str, known: set[str]) -> Condition:
    match condition:
        case Proposition(variable=variable) if variable not in known:
            return Proposition(first, (), ("any",))
        case Proposition(hedges=hedges) if "any" in hedges:
            # Behind `any` it reads nothing more, and nothing more matters.
            kept = _hedges(hedges[: hedges.index("any") + 1])
            return Proposition(condition.variable, (), kept)
        case Proposition(hedges=hedges):
            return replace(condition, hedges=_hedges(hedges))
        case And(parts=parts):
            return And(tuple(_condition(part, first, known) for part in parts))
        case Or(parts=parts):
            return Or(tuple(_condition(part, first, known) for part in parts))
        case Not(part=part):
            inner = _condition(part, first, known)
            if isinstance(inner, Proposition):
                return replace(inner, hedges=("not", *inner.hedges))
            return inner


def engine(system: FuzzySystem) -> fl.Engine:
    """Return an engine for a system that came from `alike`."""
    import fuzzylite as fl

    made = fl.Engine(system.name)
    for one in system.variables:
        variable = fl.InputVariable(
            one.name,
            minimum=-math.inf if one.low is None else one.low,
            maximum=math.inf if one.high is None else one.high,
            lock_range=one.clips,
        )
        variable.terms = _terms(one.terms, system.inputs)
        made.input_variables.append(variable)
    for output in system.outputs:
        how = getattr(fl, DEFUZZIFIERS[output.defuzzifier.method])()
        if not output.defuzzifier.is_weighted:
            how.resolution = output.defuzzifier.samples
        concluded = fl.OutputVariable(
            output.name,
            minimum=-math.inf if output.low is None else output.low,
            maximum=math.inf if output.high is None else output.high,
            lock_range=output.clips,
            default_value=math.nan if output.default is None else output.default,
            aggregation=norm(output.aggregation),
            defuzzifier=how,
        )
        concluded.terms = _terms(output.terms, system.inputs)
        made.output_variables.append(concluded)
    for held in made.variables:
        for made_term in held.terms:
            made_term.update_reference(made)
    for block in system.blocks:
        rules = fl.RuleBlock(
            block.name,
            conjunction=norm(block.conjunction),
            disjunction=norm(block.disjunction),
            implication=norm(block.implication),
            activation=activation(block.activation),
        )
        for rule in block.rules:
            rules.rules.append(fl.Rule.create(_sentence(rule), made))
        made.rule_blocks.append(rules)
    return made


def _terms(labels: Sequence[Term], columns: Sequence[str]) -> list[fl.Term]:
    terms: list[fl.Term] = []
    for label in labels:
        made = term(label.function, columns, label.height)
        made.name = label.name
        terms.append(made)
    return terms


def norm(name: str | None) -> Any:
    """Return a norm by our name for it."""
    import fuzzylite as fl

    return None if name is None else getattr(fl, NORMS[name])()


def activation(how: Activation) -> fl.Activation:
    """Return an activation method."""
    import fuzzylite as fl

    match how.method:
        case "general":
            return fl.General()
        case "first":
            return fl.First(how.count, how.threshold)
        case "last":
            return fl.Last(how.count, how.threshold)
        case "highest":
            return fl.Highest(how.count)
        case "lowest":
            return fl.Lowest(how.count)
        case "proportional":
            return fl.Proportional()
        case "threshold":
            return fl.Threshold(how.relation, how.threshold)


def _sentence(rule: SystemRule) -> str:
    then = " and ".join(map(_proposition, rule.then))
    when = _words(rule.when) if rule.when is not None else ""
    return f"if {when} then {then} with {rule.weight!r}"


def _words(condition: Condition) -> str:
    match condition:
        case Proposition():
            return _proposition(condition)
        case And(parts=parts) | Or(parts=parts):
            word = "and" if isinstance(condition, And) else "or"
            found = _words(parts[0])
            for part in parts[1:]:
                found = f"( {found} {word} {_words(part)} )"
            return found
        case Not():
            raise TypeError("NOT is a hedge")


def _proposition(one: Proposition | Conclusion) -> str:
    variable = one.variable if isinstance(one, Proposition) else one.output
    return " ".join([variable, "is", *one.hedges, one.term or ""])

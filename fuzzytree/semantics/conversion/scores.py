"""Rule bases in the form that formats for control know: outputs that are numbers.

Three ways, `scores`:

- `winner`: one output, the number of the class of the first strongest rule, from 1.
  Of all rules only the highest is activated. Exactly the decision of the rule base.
- `rule`: for targets that activate all rules and sum. One output per rule. A rule that
  always holds says that all scores are `absent` (0), rule k that score k is `present`
  (1); the weighted average of the two is `w / (1 + w)` for a strength w. The highest
  score wins, the first of equals; the strength is `w = s / (1 - s)`. All scores are 0
  where no rule fires.
- `class`: one output per class, with the strength of its strongest rule (an OR of their
  conditions) in the place of w. Equal classes are decided by the order of the classes.

**What rounding does to scores.** The computed `s = w / (1 + w)` has two roundings, each
of a relative error of at most u = 2^-53. So with w < w' a computed s' can be equal to s
or below it only if the true scores are within `4 u` of each other, relatively. As
`d log s = d log w / (1 + w)` and w is at most 1, the strengths are then within
`8 u = 2^-50`: strengths that differ by a larger share never change their order. Equal
strengths have equal scores, so that the first of them wins as before.

**Relative rules stay exact.** The winner has strength 1, so its score is exactly 1/2.
Let another have `w = 1 - k u`. `1 + w = 2 - k u` is a double for an even k, and for an
odd one it is rounded to `2 - (k - 1) u` or `2 - (k + 1) u`. The quotient is at most
`(1 - k u) / (2 - (k + 1) u)`, which is `1/2 - (k - 1) u / (4 - 2 (k + 1) u)`, at most
`1/2 - u / 2` for k >= 3; for k = 2 it is `(1 - 2 u) / (2 - 2 u)`, less than
`1/2 - u / 2`; for k = 1 the sum is rounded to the even 2, and the quotient is
`1/2 - u / 2`. That is the double before 1/2, so every other score is below 1/2.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Activation,
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Linear,
    Loss,
    Not,
    Or,
    Proposition,
    RuleBase,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Variable,
    combined,
    questions,
    stand_ins,
    unlike,
)
from fuzzytree.semantics.conversion.joint_terms import EVERYWHERE

Scores = Literal["rule", "class", "winner"]
"""What the outputs of a system say about a rule base."""

Always = Literal["nothing", "any", "term"]
"""What a rule without propositions tests: nothing; `input is any`; or whether it is a
term of degree 1 everywhere. The input is the first that is not for sums alone."""

_AVERAGE = Defuzzifier("weighted average")


def as_system(
    rules: RuleBase, scores: Scores = "rule", *, always: Always = "nothing"
) -> FuzzySystem:
    """Return a rule base as a system with numeric outputs.

    `fuzzytree.semantics.conversion.scores` says what the outputs mean. A proposition
    with several terms becomes an OR of one variable, joined by maximum. A negated one
    becomes `is not`, which under min applies to each of its terms; under product it is
    a NOT of the OR.

    Raises:
        LossError: If a rule without propositions must reference an input and there is
            none.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0, leaves=2))
        >>> [output.name for output in as_system(rules, "rule").outputs]
        ['score 1 class 1', 'score 2 class 1']
    """
    inputs = tuple(
        replace(one, categories=(), missing=None, is_whole=False)
        for one in rules.variables
    )
    tautology: Condition | None = None
    needs_one = scores != "winner" or any(not rule.when for rule in rules.rules)
    if always != "nothing" and needs_one:
        inputs, tautology = _with_tautology(inputs, always)
    taken = [one.name for one in inputs]
    conditions = _conditions(rules, tautology)
    if scores == "winner":
        outputs: tuple[SystemOutput, ...] = (_class_output(rules, taken),)
        winner_rules = tuple(
            SystemRule(when, (Conclusion(outputs[0].name, rule.then),))
            for when, rule in zip(conditions, rules.rules, strict=True)
        )
        block = _block(rules, winner_rules, Activation("highest"))
    else:
        result = _scored(rules, scores, conditions, tautology)
        outputs = _score_outputs([one.name for one in result], taken)
        absent = tuple(Conclusion(one.name, "absent") for one in outputs)
        present = tuple(
            SystemRule(one.when, (Conclusion(output.name, "present"),))
            for one, output in zip(result, outputs, strict=True)
            if one.has_rules
        )
        block = _block(rules, (SystemRule(tautology, absent), *present), Activation())
    return FuzzySystem(rules.name, inputs, outputs, (block,), _note(rules, scores))


def winner(
    rules: RuleBase, outputs: Sequence[float], scores: Scores = "rule"
) -> str | None:
    """Return the class that the outputs of `as_system` decide for.

    Args:
        rules: The rule base.
        outputs: The system's answer to a row, NaN where a value was missing.
        scores: What the outputs say.

    Returns:
        The class, or None for "no class"; for NaN as the number of a winner too, for it
        does not say whether a value was missing or no rule fired.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0, leaves=2))
        >>> winner(rules, [0.5, 0.25])
        'class 1'
    """
    if scores == "winner":
        number = outputs[0]
        return None if math.isnan(number) else rules.classes[round(number) - 1]
    if any(map(math.isnan, outputs)):
        return rules.semantics.missing
    best = max(outputs)
    if best == 0.0:
        return rules.semantics.uncovered
    place = outputs.index(best)
    return rules.classes[place] if scores == "class" else rules.rules[place].then


def cast_losses(rules: RuleBase, scores: Scores = "rule") -> tuple[Loss, ...]:
    """Return what `as_system` cannot carry and an answer depends on."""
    return tuple(_cast_losses(rules, scores))


def _cast_losses(rules: RuleBase, scores: Scores) -> Iterator[Loss]:
    if rules.semantics.missing is not None:
        yield Loss(
            "the answer to missing values",
            f"NaN stands in the place of {rules.semantics.missing!r}",
        )
    if scores == "class" and rules.kind != "relative":
        numbers = [rules.classes.index(rule.then) for rule in rules.rules]
        if any(a > b for a, b in itertools.pairwise(numbers)):
            yield Loss(
                "equally strong rules",
                "the first class wins and not the first rule, for scores by class "
                "do not say which rule was strongest",
            )


def cast_remarks(rules: RuleBase, scores: Scores = "rule") -> tuple[str, ...]:
    """Return how the numbers of `as_system` are to be read, a sentence each."""
    results = [_note(rules, scores)]
    if rules.semantics.missing is None:
        results.append("a row with a missing value answers NaN, which is no class")
    if scores == "rule" and rules.kind != "relative":
        results.append(
            "rules whose strengths differ by less than 1 part in 2^50 may change places"
        )
    stand = [f"{v!r} of {name!r}" for name, v in stand_ins(rules.variables).items()]
    if stand:
        more = f" and {len(stand) - 8} more" if len(stand) > 8 else ""
        results.append(
            "the caller replaces a missing value by what stands for it: "
            f"{', '.join(stand[:8])}{more}"
        )
    for one in rules.variables:
        if one.categories:
            shown = [f"{k} {name}" for k, name in enumerate(one.categories[:8])]
            dots = ", ..." if len(one.categories) > 8 else ""
            results.append(
                f"{one.name!r} is the position of a category: {', '.join(shown)}{dots}"
            )
    return tuple(results)


def refuse_singletons(system: FuzzySystem, to: str) -> None:
    """Refuse a system whose singletons a format that samples ranges would miss.

    Raises:
        LossError: If an output that is not weighted has a singleton.
    """
    for output in system.outputs:
        for label in output.terms if not output.defuzzifier.is_weighted else ():
            if isinstance(label.function, Singleton):
                raise LossError(
                    f"cannot write {system.name[:100]} as {to}: its engines sample the "
                    f"range of {output.name!r} and miss the singleton {label.name!r}; "
                    "fml and yaml keep it"
                )


def flattened(system: FuzzySystem) -> tuple[FuzzySystem, tuple[Loss, ...]]:
    """Return a system whose combinations are inputs, and a loss for each of them.

    The caller must compute the sum that the loss names, in that order. An input that
    serves for sums alone is left out.

    Example:
        >>> from fuzzytree.model.rulebase import Part
        >>> mixed = Variable("mix", parts=(Part("a", 2.0, 0.5), Part("b", -1.0)))
        >>> labels = (Term("one", Singleton(1.0)),)
        >>> how = Defuzzifier("weighted average")
        >>> output = SystemOutput("y", labels, 0.0, 1.0, how)
        >>> block = RuleBlock((SystemRule(None, (Conclusion("y", "one"),)),))
        >>> inputs = Variable("a"), Variable("b"), mixed
        >>> flat, losses = flattened(FuzzySystem("s", inputs, (output,), (block,)))
        >>> flat.inputs
        ('mix',)
        >>> losses[0].what
        "it is an input, to be given as 2.0 * ('a' - 0.5) + -1.0 * ('b' - 0.0)"
    """
    losses = tuple(
        Loss(
            f"combination {one.name!r}",
            "it is an input, to be given as "
            + " + ".join(
                f"{p.weight!r} * ({p.input!r} - {p.centre!r})" for p in one.parts
            ),
        )
        for one in system.variables
        if one.parts
    )
    if not losses:
        return system, ()
    return replace(
        system,
        variables=tuple(replace(one, parts=()) for one in _kept(system)),
        outputs=tuple(
            replace(
                one,
                terms=tuple(_widened(label, system.variables) for label in one.terms),
            )
            for one in system.outputs
        ),
    ), losses


def _kept(system: FuzzySystem) -> Iterator[Variable]:
    """Yield the inputs that something other than a combination uses."""
    summed = {part.input for one in system.variables for part in one.parts}
    used = {one.variable for r in system.rules for one in questions(r.when)}
    curves = [label.function for one in system.all_variables for label in one.terms]
    is_computed = any(isinstance(curve, Linear | Formula) for curve in curves)
    for one in system.variables:
        if one.terms or one.name not in summed or one.name in used or is_computed:
            yield one


def _widened(label: Term, inputs: tuple[Variable, ...]) -> Term:
    """Return a conclusion that gives combinations, which are columns now, no weight."""
    if not isinstance(label.function, Linear):
        return label
    left = iter(label.function.weights)
    weights = tuple(0.0 if one.parts else next(left) for one in inputs)
    return replace(label, function=replace(label.function, weights=weights))


def _note(rules: RuleBase, scores: Scores) -> str:
    uncovered = rules.semantics.uncovered
    answer = "no class" if uncovered is None else repr(uncovered)
    match scores:
        case "winner":
            return (
                "the output is the number of the class, from 1, of the first strongest "
                "rule; where no rule fires, " + answer
            )
        case "rule":
            return (
                "score k is w / (1 + w) for the strength w of rule k; the highest "
                "score wins, the first of equals; where all are 0, " + answer
            )
        case "class":
            return (
                "each score is w / (1 + w) for the strength w of its class's strongest "
                "rule; the highest wins, the first of equals; where all are 0, "
                + answer
            )


def _with_tautology(
    inputs: tuple[Variable, ...], always: Always
) -> tuple[tuple[Variable, ...], Condition]:
    """Return inputs, and a proposition on one of them that is always true."""
    if not inputs:
        raise LossError(
            "a rule without propositions must reference an input, but there is none"
        )
    summed = {part.input for one in inputs for part in one.parts}
    first = next(one for one in inputs if one.terms or one.name not in summed)
    if always == "any":
        return inputs, Proposition(first.name, (), ("any",))
    name = unlike("always", {label.name for label in first.terms})
    label = Term(name, EVERYWHERE)
    changed = replace(first, terms=(*first.terms, label))
    return tuple(changed if one is first else one for one in inputs), Proposition(
        first.name, (name,)
    )


def _conditions(rules: RuleBase, tautology: Condition | None) -> list[Condition | None]:
    """Return the condition of each rule; rules share what their propositions become."""
    is_product = rules.semantics.conjunction == "product"
    known: dict[int, tuple[Condition, ...]] = {}
    results: list[Condition | None] = []
    for rule in rules.rules:
        parts: list[Condition] = []
        for proposition in rule.when:
            if id(proposition) not in known:
                known[id(proposition)] = _proposition(
                    proposition, is_product=is_product
                )
            parts += known[id(proposition)]
        results.append(combined(And, parts) if parts else tautology)
    return results


def _proposition(
    proposition: Proposition, *, is_product: bool
) -> tuple[Condition, ...]:
    """Return what a proposition becomes: conditions that are joined by AND."""
    variable, terms = proposition.variable, proposition.terms
    if not proposition.negated:
        return (combined(Or, (Proposition(variable, (term,)) for term in terms)),)
    if len(terms) == 1 or not is_product:  # 1 - max = min of 1 - each, exactly
        return tuple(Proposition(variable, (term,), ("not",)) for term in terms)
    return (Not(Or(tuple(Proposition(variable, (term,)) for term in terms))),)


def _class_output(rules: RuleBase, taken: list[str]) -> SystemOutput:
    number = {name: float(k) for k, name in enumerate(rules.classes, 1)}
    uncovered = rules.semantics.uncovered
    return SystemOutput(
        unlike("class", taken),
        tuple(Term(name, Singleton(value)) for name, value in number.items()),
        1.0,
        float(len(number)),
        _AVERAGE,
        default=None if uncovered is None else number[uncovered],
    )


def _score_outputs(names: list[str], taken: list[str]) -> tuple[SystemOutput, ...]:
    labels = (
        Term("absent", Singleton(0.0)),
        Term("present", Singleton(1.0)),
    )
    used = set(taken)
    results: list[SystemOutput] = []
    for name in names:
        results.append(SystemOutput(unlike(name, used), labels, 0.0, 1.0, _AVERAGE))
        used.add(results[-1].name)
    return tuple(results)


class _Score(NamedTuple):
    """What is known of a score."""

    name: str
    when: Condition | None
    has_rules: bool = True


def _scored(
    rules: RuleBase,
    scores: Scores,
    conditions: list[Condition | None],
    tautology: Condition | None,
) -> list[_Score]:
    """Return what each score is called and the condition of its rules."""
    if scores == "rule":
        return [
            _Score(f"score {number} {rule.then}", condition)
            for number, (rule, condition) in enumerate(
                zip(rules.rules, conditions, strict=True), 1
            )
        ]
    own: dict[str, list[Condition | None]] = {name: [] for name in rules.classes}
    for rule, condition in zip(rules.rules, conditions, strict=True):
        own[rule.then].append(condition)
    return [
        _Score(f"score {name}", _any_of(some, tautology), bool(some))
        for name, some in own.items()
    ]


def _any_of(
    conditions: list[Condition | None], tautology: Condition | None
) -> Condition | None:
    """Return an OR of conditions; a rule that always holds is as strong as can be."""
    propositions = [
        one for one in conditions if one is not None and one is not tautology
    ]
    if len(propositions) < len(conditions) or not propositions:
        return tautology
    return combined(Or, propositions)


def _block(
    rules: RuleBase, result: tuple[SystemRule, ...], activation: Activation
) -> RuleBlock:
    conjunction: TNorm = (
        "product" if rules.semantics.conjunction == "product" else "minimum"
    )
    return RuleBlock(result, conjunction, "maximum", None, activation)

"""The rules of a fuzzy system as frozen values: conditions, conclusions, blocks.

What they *mean* is computed in `fuzzytree.semantics.inference`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Literal

from fuzzytree.model.curves import MOST_LEVELS
from fuzzytree.model.mistakes import Mistake, Path, name_choice
from fuzzytree.model.norms import Hedge, SNorm, TNorm
from fuzzytree.model.values import Value


class Proposition(Value, frozen=True, tag="is"):
    """`variable is term`, with hedges before the term; or one of several terms.

    Attributes:
        variable: An input; in a fuzzy system also an output, where it says how far a
            term of it was concluded so far.
        terms: Its terms; of several the largest degree counts, in class rules alone.
            None only behind the hedge `any`.
        hedges: As they are read, from left to right; the last is applied first. Class
            rules have none, or `not`.
    """

    variable: str
    terms: tuple[str, ...]
    hedges: tuple[Hedge, ...] = ()

    @property
    def term(self) -> str | None:
        """The term, where it is one; None without a term."""
        return self.terms[0] if self.terms else None

    @property
    def negated(self) -> bool:
        """Whether it is the negation of `variable is term or term`."""
        return self.hedges == ("not",)


class And(Value, frozen=True, tag="and"):
    """Conditions joined by the block's conjunction, from left to right."""

    parts: tuple[Condition, ...]


class Or(Value, frozen=True, tag="or"):
    """Conditions joined by the block's disjunction, from left to right."""

    parts: tuple[Condition, ...]


class Not(Value, frozen=True, tag="not"):
    """1 minus the degree of a condition."""

    part: Condition


Condition = Proposition | And | Or | Not


class Conclusion(Value, frozen=True):
    """`output is hedge ... term`; hedges change the degree of activation.

    They act on the conclusions of the rule that stand behind it too, as in fuzzylite:
    of `a is very high and b is low` both get the square of the rule's degree.
    """

    output: str
    term: str
    hedges: tuple[Hedge, ...] = ()


class SystemRule(Value, frozen=True):
    """IF a condition holds THEN some conclusions are activated.

    Attributes:
        when: The condition; None is always true. It may use an output: of a label of it
            the degrees concluded so far, joined by the output's aggregation (summed if
            None), by earlier blocks, and by rules of this block that were run before,
            unless its activation must know all degrees first (`highest`, `lowest`,
            `proportional`).
        then: The conclusions.
        weight: What the degree of the condition is multiplied by, in [0, 1].
        name: For people; may be empty.
    """

    when: Condition | None
    then: tuple[Conclusion, ...]
    weight: float = 1.0
    name: str = ""


ActivationMethod = Literal[
    "general", "first", "last", "highest", "lowest", "proportional", "threshold"
]
Relation = Literal["<", "<=", "==", "!=", ">=", ">"]


class Activation(Value, frozen=True):
    """Which of a block's rules are activated, of those whose degree is above 0.

    Attributes:
        method: `general`: all. `first`, `last`: at most `count` of them in the order of
            the rules or against it, whose degree is at least `threshold`; the block is
            run in that order. `highest`,
            `lowest`: at most `count` of them by degree, the first of equals first.
            `proportional`: all, each degree divided by their sum. `threshold`: those
            whose degree stands in `relation` to `threshold`.
        count: How many.
        threshold: A degree.
        relation: How a degree must compare with the threshold.
    """

    method: ActivationMethod = "general"
    count: int = 1
    threshold: float = 0.0
    relation: Relation = ">="


class RuleBlock(Value, frozen=True):
    """Rules with the operators that they share; blocks are run in order.

    Attributes:
        rules: The rules, in order.
        conjunction: The AND; None where no rule needs one.
        disjunction: The OR; None where no rule needs one.
        implication: How an activated rule limits its conclusion's curve; None where the
            outputs are weighted numbers.
        activation: Which rules are activated.
        name: For people; may be empty.
    """

    rules: tuple[SystemRule, ...]
    conjunction: TNorm | None = "minimum"
    disjunction: SNorm | None = "maximum"
    implication: TNorm | None = None
    activation: Activation = Activation()
    name: str = ""


def conditions_in(condition: Condition | None) -> Iterator[Condition]:
    """Yield a condition and all conditions that it consists of, from left to right."""
    if condition is not None:
        yield condition
    for part in _parts(condition):
        yield from conditions_in(part)


def questions(condition: Condition | None) -> Iterator[Proposition]:
    """Yield the propositions of a condition, from left to right."""
    return (one for one in conditions_in(condition) if isinstance(one, Proposition))


def joints(condition: Condition | None) -> Iterator[type[And] | type[Or]]:
    """Yield how the parts of a condition are joined, from the outside in."""
    return (type(one) for one in conditions_in(condition) if isinstance(one, And | Or))


def combined(kind: type[And] | type[Or], parts: Iterable[Condition]) -> Condition:
    """Return conditions joined by AND or OR; a single one as it is.

    Example:
        >>> low = Proposition("force", ("low",))
        >>> combined(And, [low]) == low
        True
    """
    every = tuple(parts)
    return every[0] if len(every) == 1 else kind(every)


def condition_text(
    condition: Condition,
    proposition_text: Callable[[Proposition], str],
    says: Callable[[str], str] = str,
    *,
    has_all_brackets: bool = False,
) -> str:
    """Return a condition in words, with brackets where AND does not bind closer.

    Args:
        condition: The condition.
        proposition_text: Returns the words of a proposition.
        says: Returns how `and`, `or` and `not` are written.
        has_all_brackets: Whether an AND within an OR has brackets too.

    Example:
        >>> a, b = (Proposition("force", (term,)) for term in ("low", "high"))
        >>> condition_text(And((Not(a), Or((a, b)))), lambda one: one.terms[0])
        'not (low) and (low or high)'
    """

    def text(one: Condition) -> str:
        match one:
            case Proposition():
                return proposition_text(one)
            case Not(part=part):
                return f"{says('not')} ({text(part)})"
            case And(parts=parts) | Or(parts=parts):
                closer = () if has_all_brackets or isinstance(one, And) else (And,)
                texts = [
                    f"({text(part)})"
                    if isinstance(part, And | Or) and not isinstance(part, closer)
                    else text(part)
                    for part in parts
                ]
                word = "and" if isinstance(one, And) else "or"
                return f" {says(word)} ".join(texts)

    return text(condition)


Terms = Mapping[str, Mapping[str, None]]


def activation_mistakes(path: Path, how: Activation) -> Iterator[Mistake]:
    """Yield what is wrong with an activation."""
    if how.count < 1:
        yield path, f"at least 1 rule is activated, not {how.count}"
    if not 0.0 <= how.threshold <= 1.0:
        yield path, f"the threshold must lie in [0, 1], not {how.threshold!r}"


def condition_mistakes(
    condition: Condition | None, block: RuleBlock, terms: Terms
) -> Iterator[str]:
    """Yield what is wrong with a condition, given the terms of each variable."""
    if _levels(condition) > MOST_LEVELS:
        yield f"nested deeper than {MOST_LEVELS} levels"
        return
    for one in conditions_in(condition):
        if isinstance(one, And | Or) and len(one.parts) < 2:
            yield "it joins fewer than two conditions"
    kinds = set(joints(condition))
    for one in questions(condition):
        if len(one.terms) > 1:
            each = " or ".join(f"{one.variable} is {term}" for term in one.terms)
            yield f"a proposition of a system has one term; write {each[:200]!r}"
        if one.terms or one.variable not in terms:
            yield from reference_mistakes(one.variable, one.term, terms)
        elif not one.hedges or one.hedges[-1] != "any":
            yield f"{one.variable!r} is used without a term"
    if block.conjunction is None and And in kinds:
        yield "it needs a conjunction, and its block has none"
    if block.disjunction is None and Or in kinds:
        yield "it needs a disjunction, and its block has none"


def reference_mistakes(variable: str, label: str | None, terms: Terms) -> Iterator[str]:
    """Yield which of two names nothing declares."""
    if variable not in terms:
        yield f"no variable {variable!r}; {name_choice(variable, terms)}"
    elif label is not None and label not in terms[variable]:
        choice = name_choice(label, terms[variable])
        yield f"{variable!r} has no term {label!r}; {choice}"


def _levels(condition: Condition | None) -> int:
    deepest, todo = 0, [(condition, 1)]
    while todo:
        one, level = todo.pop()
        deepest = max(deepest, level)
        if level <= MOST_LEVELS:
            todo += [(part, level + 1) for part in _parts(one)]
    return deepest


def _parts(condition: Condition | None) -> tuple[Condition, ...]:
    match condition:
        case And(parts=parts) | Or(parts=parts):
            return parts
        case Not(part=part):
            return (part,)
        case _:
            return ()

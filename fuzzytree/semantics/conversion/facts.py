"""The way back: which rule base a system stands for, if it stands for one.

A file of a format for control holds the curves and rules of a system, and in a comment
the *facts*: what it has no place for. The two make a rule base again, and only if
`as_system` would make that very system of it. So nothing in a comment can change what
the rules of the file say.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, Literal

import msgspec
from msgspec.structs import replace

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model import (
    Activation,
    And,
    Condition,
    FuzzySystem,
    Kind,
    Not,
    Or,
    Part,
    Points,
    Probabilities,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Value,
    Variable,
    questions,
)
from fuzzytree.numerics import BELOW_ONE
from fuzzytree.semantics.conversion.canonical import canonical_form
from fuzzytree.semantics.conversion.joint_terms import with_joint_terms
from fuzzytree.semantics.conversion.points import band_of, shape_of, stepped
from fuzzytree.semantics.conversion.scores import Always, Scores, as_system, flattened

_UNSAFE = {character: f"\\u{ord(character):04x}" for character in "*/<>&#%'`$\x7f"}

FACTS: Final = "rules of fuzzytree: "
"""What a comment with facts begins with, in formats whose comments are text."""

_MOST = 4 * 2**20  # bytes of facts
_MOST_JOINT = 64  # propositions that a joint term stands for, in the mean


class _Named(Value, frozen=True):
    """A variable without its curves.

    Points that a band would have are read as one, but for the terms in `points`.
    """

    name: str
    terms: tuple[str, ...]
    unit: str = ""
    low: float | None = None
    high: float | None = None
    parts: tuple[Part, ...] = ()
    categories: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET
    missing: float | msgspec.UnsetType = msgspec.UNSET
    is_whole: Literal[True] | msgspec.UnsetType = msgspec.UNSET
    points: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET


class _Facts(Value, frozen=True):
    """A rule base without its curves, and how it became a system.

    Propositions are (place of the variable, places of its terms, whether it is
    negated); rules are (places of the propositions, place of the class, support, or the
    counts that sum to it).
    """

    fuzzytree: int
    scores: Scores
    always: Always
    name: str
    kind: Kind | None
    classes: tuple[str, ...]
    columns: tuple[str, ...]
    semantics: Semantics
    variables: tuple[_Named, ...]
    propositions: tuple[tuple[int, tuple[int, ...], bool], ...]
    rules: tuple[tuple[tuple[int, ...], int, int | tuple[int, ...] | None], ...]
    probabilities: tuple[Probabilities, ...] | msgspec.UnsetType = msgspec.UNSET


def facts_of(
    rules: RuleBase, scores: Scores = "rule", *, always: Always = "nothing"
) -> str:
    """Return one line of JSON with what a file for control has no place for.

    It is ASCII, and holds no `*`, `/`, `<`, `>`, `#`, `%` and no two `-` in a row: so
    it can stand in a comment of any format.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> as_rules(as_system(rules), facts_of(rules)) == rules
        True
    """
    places = {
        v.name: (k, {term.name: n for n, term in enumerate(v.terms)})
        for k, v in enumerate(rules.variables)
    }
    propositions = list(dict.fromkeys(c for rule in rules.rules for c in rule.when))
    number = {proposition: k for k, proposition in enumerate(propositions)}
    labels = {name: k for k, name in enumerate(rules.classes)}
    facts = _Facts(
        fuzzytree=1,
        scores=scores,
        always=always,
        name=rules.name,
        kind=rules.kind,
        classes=rules.classes,
        columns=rules.columns,
        semantics=rules.semantics,
        variables=tuple(
            _Named(
                v.name,
                tuple(t.name for t in v.terms),
                v.unit,
                v.low,
                v.high,
                v.parts,
                v.categories or msgspec.UNSET,
                msgspec.UNSET if v.missing is None else v.missing,
                True if v.is_whole else msgspec.UNSET,
                tuple(k for k, t in enumerate(v.terms) if band_of(t.shape))
                or msgspec.UNSET,
            )
            for v in rules.variables
        ),
        propositions=tuple(
            (
                places[proposition.variable][0],
                tuple(
                    places[proposition.variable][1][term] for term in proposition.terms
                ),
                proposition.negated,
            )
            for proposition in propositions
        ),
        rules=tuple(
            (
                tuple(number[c] for c in rule.when),
                labels[rule.then],
                rule.counts or rule.support,
            )
            for rule in rules.rules
        ),
        probabilities=tuple(rule.probabilities for rule in rules.rules)
        if rules.semantics.sharpness
        else msgspec.UNSET,
    )
    text = json.dumps(msgspec.to_builtins(facts), separators=(",", ":"))
    for character, escape in _UNSAFE.items():
        text = text.replace(character, escape)
    return text.replace("--", "-\\u002d")


def as_rules(
    system: FuzzySystem, facts: str | None = None, *, by_input: bool = False
) -> RuleBase | None:
    """Return the rule base that a system stands for, or None.

    The names of the system may be others than those of the facts: what belongs
    together stands at the same place. Names of people, units and ranges are those of
    the facts; curves, conditions and conclusions must be the system's.

    Args:
        system: A system, such as one that was read.
        facts: The line that `facts_of` made; None recognises systems of the form
            `winner`, with the defaults for what a system does not say.
        by_input: Whether each rule has one term for each input, in the order of the
            inputs, so that a joint term stands for several propositions.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> as_rules(as_system(rules, "winner")).rules[0].then
        'class 1'
        >>> as_rules(as_system(rules)) is None
        True
    """
    if facts is None:
        return _recognised(system)
    system, _ = flattened(system)
    try:
        result = _decoded(facts)
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
        return None
    if result is None or not _may_fit(system, result, by_input=by_input):
        return None
    places = _places(result)
    curves = _shapes(system, [len(result.variables[place].terms) for place in places])
    if curves is None:
        return None
    try:
        rules = _rules(result, dict(zip(places, curves, strict=True)))
        expected, _ = flattened(as_system(rules, result.scores, always=result.always))
        if by_input:
            expected = with_joint_terms(expected)
    except (FuzzyTreeError, IndexError, ValueError):
        return None
    is_winner = result.scores == "winner"
    value, wanted = (_plain(one, has_default=is_winner) for one in (system, expected))
    return _with_bands(rules, result) if value == wanted else None


def _with_bands(rules: RuleBase, facts: _Facts) -> RuleBase:
    """Return rules whose points are bands again where the facts do not object."""

    def original(term: Term, *, is_points: bool) -> Term:
        if isinstance(points := term.function, Points):
            for shape in (points, Points(stepped(points.values), points.degrees)):
                if band := band_of(shape):
                    return replace(term, function=shape if is_points else band)
        return term

    variables = tuple(
        replace(
            variable,
            terms=tuple(
                original(term, is_points=k in (named.points or ()))
                for k, term in enumerate(variable.terms)
            ),
        )
        for variable, named in zip(rules.variables, facts.variables, strict=True)
    )
    return replace(rules, variables=variables)


def with_flanks(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose inputs have bands for points that only a flank has."""

    def original(term: Term) -> Term:
        if isinstance(points := term.function, Points) and BELOW_ONE in points.degrees:
            band = band_of(Points(stepped(points.values), points.degrees))
            return replace(term, function=band or points)
        return term

    variables = (
        replace(one, terms=tuple(map(original, one.terms))) for one in system.variables
    )
    return replace(system, variables=tuple(variables))


def as_written(
    system: FuzzySystem, comments: Iterable[str], *, by_input: bool = False
) -> tuple[RuleBase | FuzzySystem, str | None]:
    """Return the rule base that a file was made of, and its facts, or the system.

    Args:
        system: What the file says.
        comments: Its comments.
        by_input: As in `as_rules`.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> as_written(as_system(rules), [FACTS + facts_of(rules)])[0] == rules
        True
    """
    every = (comment.strip() for comment in comments)
    facts = next(
        (one.removeprefix(FACTS) for one in every if one.startswith(FACTS)), None
    )
    rules = None if facts is None else as_rules(system, facts, by_input=by_input)
    return (with_flanks(system), None) if rules is None else (rules, facts)


def numbers_of(facts: str) -> tuple[int, ...]:
    """Return for each rule of a rule base the place of the system's rule that holds it.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0, leaves=2))
        >>> numbers_of(facts_of(rules)), numbers_of(facts_of(rules, "winner"))
        ((1, 2), (0, 1))
    """
    result = _decoded(facts)
    if result is None:
        return ()
    labels = [label for _, label, _ in result.rules]
    if (
        result.scores == "class"
    ):  # behind the rule that always holds, one for each class
        used = sorted(set(labels))
        return tuple(1 + used.index(label) for label in labels)
    first = 0 if result.scores == "winner" else 1
    return tuple(range(first, first + len(labels)))


def places_of(facts: str) -> tuple[int | None, ...]:
    """Return for each variable of a rule base the place of the file's input, if any.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> rules = rules_from_tree(random_tree(0, leaves=2, combinations=1.0))
        >>> places_of(facts_of(rules))
        (None, None, None, 0)
    """
    result = _decoded(facts)
    if result is None:
        return ()
    places = {place: k for k, place in enumerate(_places(result))}
    return tuple(places.get(place) for place in range(len(result.variables)))


def _decoded(facts: str) -> _Facts | None:
    data = facts.encode()
    if len(data) > _MOST:
        return None
    result = msgspec.json.decode(data, type=_Facts)
    return result if result.fuzzytree == 1 else None


def _may_fit(system: FuzzySystem, facts: _Facts, *, by_input: bool) -> bool:
    """Return whether facts are as large as the system, before anything is made of them.

    Facts name a proposition by its place, so that few bytes could stand for very much.
    """
    sizes = [len(terms) for _, terms, _ in facts.propositions]
    needed = 0
    for propositions, place, _ in facts.rules:
        if not 0 <= place < len(facts.classes):
            return False
        if not all(0 <= k < len(sizes) for k in propositions):
            return False
        needed += sum(sizes[k] for k in propositions) if propositions else 1
    if len(_places(facts)) != len(system.variables):
        return False
    result = sum(1 for rule in system.rules for _ in questions(rule.when))
    room = result + 2 * len(facts.rules) + 1
    return needed <= room * (_MOST_JOINT if by_input else 1)


def _shapes(system: FuzzySystem, counts: Sequence[int]) -> list[list[Term]] | None:
    """Return the curves of each input's first labels, as terms, if all are shapes."""
    results: list[list[Term]] = []
    for one, count in zip(system.variables, counts, strict=True):
        terms: list[Term] = []
        for label in one.terms[:count]:
            shape = shape_of(label.function)
            if shape is None or label.height != 1.0:
                return None
            terms.append(Term(label.name, shape))
        if len(terms) < count or one.clips:
            return None
        results.append(terms)
    return results


def _places(facts: _Facts) -> list[int]:
    """Return which variables a file has: not those that serve for sums alone."""
    summed = {part.input for one in facts.variables for part in one.parts}
    return [
        place
        for place, one in enumerate(facts.variables)
        if one.terms or one.name not in summed
    ]


def _rules(facts: _Facts, curves: Mapping[int, Sequence[Term]]) -> RuleBase:
    variables = tuple(
        Variable(
            v.name,
            tuple(
                replace(term, name=name)
                for name, term in zip(v.terms, curves.get(place, ()), strict=True)
            ),
            v.unit,
            v.low,
            v.high,
            v.parts,
            categories=() if v.categories is msgspec.UNSET else v.categories,
            missing=None if v.missing is msgspec.UNSET else v.missing,
            is_whole=v.is_whole is True,
        )
        for place, v in enumerate(facts.variables)
    )
    propositions = [
        Proposition(
            variables[_place(place)].name,
            tuple(variables[place].terms[_place(k)].name for k in terms),
            ("not",) if negated else (),
        )
        for place, terms, negated in facts.propositions
    ]
    vectors = facts.probabilities or (msgspec.UNSET,) * len(facts.rules)
    rules = tuple(
        Rule(
            tuple(propositions[k] for k in places),
            facts.classes[label],
            sum(rows) if isinstance(rows, tuple) else rows,
            shares,
            rows if isinstance(rows, tuple) else (),
        )
        for (places, label, rows), shares in zip(facts.rules, vectors, strict=True)
    )
    return RuleBase(
        facts.name,
        facts.classes,
        variables,
        rules,
        facts.semantics,
        facts.kind,
        facts.columns,
    )


def _place(place: int) -> int:
    if place < 0:
        raise IndexError(place)
    return place


def _recognised(system: FuzzySystem) -> RuleBase | None:
    """Return the rule base of a system of the form `winner`."""
    if len(system.outputs) != 1 or len(system.blocks) != 1:
        return None
    output, block = system.outputs[0], system.blocks[0]
    default = output.default
    is_number = default is None or default in range(1, len(output.terms) + 1)
    curves = _shapes(system, [len(one.terms) for one in system.variables])
    if not is_number or curves is None:
        return None
    classes = tuple(label.name for label in output.terms)
    variables = tuple(
        Variable(one.name, tuple(terms), one.unit, one.low, one.high, one.parts)
        for one, terms in zip(system.variables, curves, strict=True)
    )
    is_product = block.conjunction == "product" and any(
        isinstance(rule.when, And) for rule in block.rules
    )
    uncovered = None if default is None else classes[int(default) - 1]
    semantics = Semantics("product" if is_product else "minimum", uncovered)
    try:
        rules = tuple(
            Rule(tuple(_propositions(rule.when)), rule.then[0].term)
            for rule in block.rules
        )
        result = RuleBase(system.name, classes, variables, rules, semantics)
        expected = as_system(result, "winner")
    except (FuzzyTreeError, LookupError, ValueError):
        return None
    value, wanted = (_plain(one, has_default=True) for one in (system, expected))
    return result if value == wanted else None


def _propositions(condition: Condition | None) -> Iterator[Proposition]:
    """Yield the propositions of a condition, from left to right.

    What is no AND of propositions gives other propositions, or raises LookupError.
    """
    match condition:
        case None:
            return
        case And(parts=parts):
            for part in parts:
                yield from _propositions(part)
        case Proposition(
            variable=variable, term=str(label), hedges=() | ("not",) as hedges
        ):
            yield Proposition(variable, (label,), ("not",) if bool(hedges) else ())
        case Not(part=part):
            (whole,) = _propositions(part)
            yield replace(whole, hedges=() if whole.negated else ("not",))
        case Or(parts=parts):
            inner = [
                proposition for part in parts for proposition in _propositions(part)
            ]
            terms = tuple(term for proposition in inner for term in proposition.terms)
            yield Proposition(inner[0].variable, terms)
        case _:
            raise LookupError


def _plain(system: FuzzySystem, *, has_default: bool) -> object:
    """Return what must be alike in two systems for them to be one, up to names.

    Names become places. Ranges, units, notes, and operators that no rule uses cannot
    change an answer. As no label is concluded by two rules that are activated at a
    time, an aggregation changes nothing.

    Args:
        system: The system.
        has_default: Whether a default can answer; of scores some rule always fires.
    """
    inputs = (
        replace(one, categories=(), missing=None, is_whole=False)
        for one in system.variables
    )
    outputs = (
        replace(
            one,
            default=one.default if has_default else None,
            aggregation=None if one.defuzzifier.is_weighted else one.aggregation,
        )
        for one in system.outputs
    )
    blocks = (
        replace(block, activation=_activation(block.activation))
        for block in system.blocks
    )
    return canonical_form(
        replace(
            system,
            variables=tuple(inputs),
            outputs=tuple(outputs),
            blocks=tuple(blocks),
        )
    )


def _activation(activation: Activation) -> Activation:
    """Return what matters of an activation."""
    match activation.method:
        case "general" | "proportional":
            return Activation(activation.method)
        case "highest" | "lowest":
            return Activation(activation.method, activation.count)
        case _:
            return activation

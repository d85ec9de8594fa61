"""Rules of FCL, with the operators of their block."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import msgspec
from lark import Token
from msgspec.structs import replace

from fuzzytree.formats.fcl.fcl_dialects import (
    CHOICE,
    FCL_SNORMS,
    FCL_TNORMS,
    JFUZZYLOGIC_PAIRS,
    PAIRS,
    Dialect,
    norm_of,
)
from fuzzytree.formats.fcl.fcl_syntax import (
    Connective,
    FclBlock,
    FclChain,
    FclCondition,
    FclNegation,
    FclProposition,
    RuleStatement,
    place,
    raw,
)
from fuzzytree.formats.fll.fll_words import FLL_HEDGES
from fuzzytree.formats.text_files import ReaderNotes, no_such, number_of
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    FuzzySystem,
    Hedge,
    Loss,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SNorm,
    SystemRule,
    TNorm,
    combined,
    joints,
    name_choice,
    questions,
)
from fuzzytree.semantics import EVERYWHERE


class Scope(msgspec.Struct, frozen=True):
    """What rules can speak of."""

    terms: Mapping[str, Collection[str]]
    outputs: Collection[str]
    curved: Collection[str]
    dialect: Dialect
    notes: ReaderNotes
    is_certain: bool


def _read(text: RuleStatement, number: int, scope: Scope) -> SystemRule:
    """Return a rule; its mistakes are noted."""
    when = _condition(text.condition, scope)
    if _is_ambiguous(text.condition):
        where = f"line {text.keyword.line}"
        first, second = "(a OR b) AND c", "a OR (b AND c)"
        if scope.dialect == "jfuzzylogic":
            what = f"a OR b AND c is read as {first}, as in jFuzzyLogic"
            scope.notes.remark(f"{where}: {what}; the standard reads {second}")
        elif not scope.is_certain:
            what = f"a OR b AND c is read as {second}, as in the standard"
            what = f"{what}; jFuzzyLogic reads {first}; write parentheses, or {CHOICE}"
            scope.notes.loss(where, what)
    then = tuple(_conclusion(one, scope) for one in text.conclusions)
    label = "".join(map(str, text.label))
    weight = 1.0 if text.weight is None else _weight(text.weight, scope)
    return SystemRule(when, then, weight, "" if label == str(number) else label)


def _weight(token: Token, scope: Scope) -> float:
    value = number_of(str(token))
    if value is None or not 0.0 <= value <= 1.0:
        sentence = f"the weight must lie in [0, 1], not {token}"
        scope.notes.mistake(place(token), sentence)
        return 1.0
    return value


def _condition(condition: FclCondition, scope: Scope) -> Condition:
    match condition:
        case FclProposition():
            return _proposition(condition, scope)
        case FclNegation(part=part):
            return Not(_condition(part, scope))
        case FclChain(words=words):
            parts = [_condition(part, scope) for part in condition.parts]
            if scope.dialect == "jfuzzylogic":
                return _from_the_left(parts, words)
            groups: list[list[Condition]] = [[]]
            for word, inner in zip(("and", *words), parts, strict=True):
                if word == "or":
                    groups.append([])
                groups[-1].append(inner)
            return combined(Or, (combined(And, group) for group in groups))


def _from_the_left(
    parts: Sequence[Condition], words: Sequence[Connective]
) -> Condition:
    """Return a chain as jFuzzyLogic reads it: AND and OR bind alike."""
    kinds: dict[Connective, type[And] | type[Or]] = {"and": And, "or": Or}
    group, last = [parts[0]], words[0]
    for word, part in zip(words, parts[1:], strict=True):
        if word != last:
            group, last = [combined(kinds[last], group)], word
        group.append(part)
    return combined(kinds[last], group)


def _proposition(proposition: FclProposition, scope: Scope) -> Proposition:
    variable = str(proposition.variable)
    if variable in scope.outputs and scope.dialect not in ("fuzzylite", "portable"):
        what = (
            "used in an antecedent: how far earlier rules conclude it counts, as "
            "in fuzzylite, and not its value"
        )
        loss = Loss(f"output {variable!r}", what)
        if loss not in scope.notes.losses:
            scope.notes.losses.append(loss)
    if proposition.words[-1].lower() == "any" and "any" not in scope.terms.get(
        variable, ()
    ):
        _known_variable(proposition.variable, scope.terms, scope.notes)
        return Proposition(variable, (), _hedges(proposition.words, scope))
    label = _known(proposition, scope.terms, scope.notes)
    return Proposition(variable, (label,), _hedges(proposition.words[:-1], scope))


def _conclusion(proposition: FclProposition, scope: Scope) -> Conclusion:
    known = {name: scope.terms[name] for name in scope.outputs}
    label = _known(proposition, known, scope.notes)
    return Conclusion(
        str(proposition.variable), label, _hedges(proposition.words[:-1], scope)
    )


def _hedges(words: Sequence[Token], scope: Scope) -> tuple[Hedge, ...]:
    results: list[Hedge] = []
    for word in words:
        hedge = FLL_HEDGES.get(word.lower())
        if hedge is None:
            sentence = no_such("hedge", str(word), FLL_HEDGES)
            scope.notes.mistake(place(word), sentence)
        else:
            results.append(hedge)
    return tuple(results)


def _known_variable(
    token: Token, terms: Mapping[str, Collection[str]], notes: ReaderNotes
) -> bool:
    if str(token) in terms or notes.is_full:
        return True
    notes.mistake(place(token), no_such("variable", str(token), terms))
    return False


def _known(
    proposition: FclProposition,
    terms: Mapping[str, Collection[str]],
    notes: ReaderNotes,
) -> str:
    label = proposition.words[-1]
    if _known_variable(proposition.variable, terms, notes):
        known = terms.get(str(proposition.variable), ())
        if str(label) not in known and not notes.is_full:
            choice = name_choice(label[:99], known)
            whose = repr(str(proposition.variable))
            sentence = f"{whose} has no term {str(label)!r}; {choice}"
            notes.mistake(place(label), sentence)
    return str(label)


def _is_ambiguous(condition: FclCondition) -> bool:
    """Return whether `a OR b AND c` stands somewhere without parentheses."""
    match condition:
        case FclProposition():
            return False
        case FclNegation(part=part):
            return _is_ambiguous(part)
        case FclChain(parts=parts, words=words):
            mixed = "or" in words and "and" in words[words.index("or") :]
            return mixed or any(map(_is_ambiguous, parts))


class FclRuleBlock(msgspec.Struct, frozen=True):
    """A block of rules, where it and each rule begins, what it says about ACCU."""

    block: RuleBlock
    head: Token
    tokens: tuple[Token, ...]
    accu: SNorm | None

    @property
    def concluded(self) -> set[str]:
        """The outputs that its rules conclude."""
        return {one.output for rule in self.block.rules for one in rule.then}


def read_block(block: FclBlock, scope: Scope) -> FclRuleBlock:
    """Return a block of rules; mistakes are noted."""
    rules: list[SystemRule] = []
    tokens: list[Token] = []
    last: str | None = None
    for text in block.rules:
        rule = _read(text, len(rules) + 1, scope)
        label = raw(text.label)
        is_portable = scope.dialect == "portable"
        if is_portable and label == last:
            # One conclusion per rule: one rule was written as several.
            whole = replace(rules[-1], then=(*rules[-1].then, *rule.then))
            if whole == replace(rule, then=whole.then, name=whole.name):
                rules[-1] = whole
                continue
        rules.append(rule)
        tokens.append(text.keyword)
        last = label
    conjunction, disjunction = _norms(block, rules, scope)
    result = RuleBlock(
        rules=tuple(rules),
        conjunction=conjunction,
        disjunction=disjunction,
        implication=_implication(block, rules, scope),
        name=raw(block.head.words),
    )
    accu = norm_of(block, "ACCU", FCL_SNORMS, scope.notes)
    return FclRuleBlock(result, block.head.keyword, tuple(tokens), accu)


def _implication(
    block: FclBlock, rules: Sequence[SystemRule], scope: Scope
) -> TNorm | None:
    stated = norm_of(block, "ACT", FCL_TNORMS, scope.notes)
    is_needed = any(one.output in scope.curved for rule in rules for one in rule.then)
    if stated is not None or not is_needed:
        return stated
    scope.notes.remark(f"line {block.line}: ACT is missing; MIN is taken")
    return "minimum"


def _norms(
    block: FclBlock, rules: Sequence[SystemRule], scope: Scope
) -> tuple[TNorm | None, SNorm | None]:
    """Return AND and OR; one that is missing and needed comes with the other one."""
    conjunction: TNorm | None = norm_of(block, "AND", FCL_TNORMS, scope.notes)
    disjunction: SNorm | None = norm_of(block, "OR", FCL_SNORMS, scope.notes)
    is_jfuzzylogic = scope.dialect == "jfuzzylogic"
    pairs = JFUZZYLOGIC_PAIRS if is_jfuzzylogic else PAIRS
    partners: dict[SNorm, TNorm] = {s: t for t, s in pairs.items()}
    if conjunction and disjunction and pairs[conjunction] != disjunction:
        if is_jfuzzylogic:
            first, second = (place(block.words(word)[0]) for word in ("AND", "OR"))
            if first > second:
                disjunction = pairs[conjunction]
            else:
                conjunction = partners.get(disjunction, conjunction)
        elif not scope.is_certain:
            what = "AND and OR are no partners: both are taken, and jFuzzyLogic takes "
            what += f"the last one and its partner; {CHOICE}"
            scope.notes.loss(f"line {block.line}", what)
    if conjunction is None and any(And in joints(rule.when) for rule in rules):
        conjunction = partners.get(disjunction or "maximum", "minimum")
        text = f"line {block.line}: AND is missing; {conjunction} is taken"
        scope.notes.remark(text)
    if disjunction is None and any(Or in joints(rule.when) for rule in rules):
        disjunction = pairs.get(conjunction or "minimum", "maximum")
        text = f"line {block.line}: OR is missing; {disjunction} is taken"
        scope.notes.remark(text)
    return conjunction, disjunction


def without_questions(system: FuzzySystem) -> FuzzySystem:
    """Return a system that was written here, with rules that have no condition again.

    The writer makes them test whether the first input is `any`, or its last term, which
    it adds.
    """
    if not system.variables:
        return system
    first = system.variables[0]
    proposition: Condition = Proposition(first.name, (), ("any",))
    if first.terms and first.terms[-1].function == EVERYWHERE:
        proposition = Proposition(first.name, (first.terms[-1].name,))
        first = replace(first, terms=first.terms[:-1])
    others = [
        one
        for rule in system.rules
        if rule.when is not None and rule.when != proposition
        for one in questions(rule.when)
    ]
    if proposition in others or all(rule.when != proposition for rule in system.rules):
        return system
    blocks = tuple(
        replace(
            block,
            rules=tuple(
                replace(rule, when=None) if rule.when == proposition else rule
                for rule in block.rules
            ),
        )
        for block in system.blocks
    )
    return replace(system, variables=(first, *system.variables[1:]), blocks=blocks)

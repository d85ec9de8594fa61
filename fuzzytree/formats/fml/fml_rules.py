"""The rule bases of FML as blocks of rules."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

import msgspec

from fuzzytree.formats.fml import fml_words as words
from fuzzytree.formats.fml.fml_words import number
from fuzzytree.formats.fml.xml import FmlElement
from fuzzytree.formats.text_files import ReaderNotes
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Hedge,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SNorm,
    SystemOutput,
    SystemRule,
    TNorm,
    combined,
    name_choice,
)

_Word = TypeVar("_Word")

_RULES: Final = {
    "mamdaniRuleBase": ("rule", "consequent", "then", "else", "clause"),
    "tsukamotoRuleBase": ("rule", "consequent", "then", "else", "clause"),
    "tskRuleBase": ("tskRule", "tskConsequent", "tskThen", "tskElse", "tskClause"),
}


_MOST_LEVELS: Final = 20
_MOST_DEFINITIONS: Final = 50_000


class FmlVariables(msgspec.Struct, frozen=True):
    """What rules can reference and conclude.

    `labels` has, for each variable, the names of its terms in rules and in the system,
    `circular` the terms that are made of others, `negated` those that are the
    complement of their shape. `spent` grows with each definition that is followed, so
    that terms which are made of others many times over come to an end.
    """

    labels: dict[str, dict[str, str]]
    circular: dict[tuple[str, str], FmlElement]
    outputs: dict[str, SystemOutput]
    negated: set[tuple[str, str]] = msgspec.field(default_factory=set)
    spent: list[None] = msgspec.field(default_factory=list)


class _Norms(msgspec.Struct, frozen=True):
    conjunction: TNorm
    disjunction: SNorm
    implication: TNorm | None


class _Inner(NamedTuple):
    """An <and> or <or> of a circular definition, and what it joins by."""

    element: FmlElement
    t_norm: TNorm | None = None
    s_norm: SNorm | None = None


_About = tuple[FmlVariables, list[_Inner]]
"""What rules can reference, and the operators within the terms of one rule."""


def blocks_of(
    bases: Sequence[FmlElement], variables: FmlVariables, notes: ReaderNotes
) -> tuple[RuleBlock, ...]:
    """Return the rule bases; rules in a row with equal norms are one block."""
    blocks: list[RuleBlock] = []
    for base in bases:
        if base.name not in _RULES:
            what = "has no place in a system here"
            if base.name != "anYaRuleBase":
                what = f"is no rule base; {name_choice(base.name[:40], _RULES)}"
            notes.mistake(base.position, f"<{base.name[:40]}> {what}")
            continue
        name = base.attributes.get("name", "")
        rule_name, *_ = _RULES[base.name]
        run: list[SystemRule] = []
        norms: _Norms | None = None
        for element in base.children:
            if element.name != rule_name:
                notes.mistake(
                    element.position, f"<{element.name[:40]}> is no <{rule_name}>"
                )
                continue
            result = _rule(base, element, variables, notes)
            if result is None:
                continue
            rule, meaning = result
            if norms is not None and meaning != norms:
                blocks.append(_block(run, norms, name))
                run = []
            norms = meaning
            run.append(rule)
        if norms is not None and run:
            blocks.append(_block(run, norms, name))
    return tuple(blocks)


def _block(rules: Sequence[SystemRule], norms: _Norms, name: str) -> RuleBlock:
    how = norms.conjunction, norms.disjunction, norms.implication
    return RuleBlock(tuple(rules), *how, name=name)


def _norms(base: FmlElement, rule: FmlElement, notes: ReaderNotes) -> _Norms:
    """Return the norms of a rule: its own, or those of its base."""
    of_and, of_or = (
        rule if key in rule.attributes else base for key in ("andMethod", "orMethod")
    )
    conjunction = word_of(of_and, "andMethod", words.FML_TNORMS, "MIN", notes)
    disjunction = word_of(of_or, "orMethod", words.FML_SNORMS, "MAX", notes)
    implication: TNorm | None = None
    if base.name == "mamdaniRuleBase":
        implication = word_of(base, "activationMethod", words.FML_TNORMS, "MIN", notes)
    return _Norms(conjunction or "minimum", disjunction or "maximum", implication)


def word_of(
    element: FmlElement,
    key: str,
    known: Mapping[str, _Word],
    default: str,
    notes: ReaderNotes,
) -> _Word | None:
    """Return what the word of an attribute means; None, and a mistake, if nothing."""
    text = element.attributes.get(key, default)
    if text.upper() not in known:
        notes.mistake(element.position, _unknown(key, text, known))
    return known.get(text.upper())


def _unknown(key: str, text: str, known: Iterable[str]) -> str:
    return f"no {key} {text[:40]!r}; {name_choice(text[:40].upper(), known)}"


def _rule(
    base: FmlElement, element: FmlElement, variables: FmlVariables, notes: ReaderNotes
) -> tuple[SystemRule, _Norms] | None:
    """Return a rule and its norms, with those that its terms are made with."""
    norms = _norms(base, element, notes)
    inner: list[_Inner] = []
    about = variables, inner
    _, consequent, then, otherwise, clause = _RULES[base.name]
    before = len(notes.mistakes)
    name = element.attributes.get("name", "")
    antecedent = _only(element, "antecedent", notes)
    concluded = _only(element, consequent, notes)
    if antecedent is None or concluded is None:
        return None
    parts = [
        part
        for one in antecedent.all("clause")
        if (part := _question(one, about, notes)) is not None
    ]
    if not parts and len(notes.mistakes) == before:
        notes.mistake(antecedent.position, f"rule {name!r} has an empty antecedent")
    for one in concluded.all(otherwise):
        what = "its else is left out"
        notes.loss(f"rule {name!r}, line {one.line}", what)
    wanted = _only(concluded, then, notes)
    results = [
        conclusion
        for child in ([] if wanted is None else wanted.all(clause))
        if (conclusion := _conclusion(child, about[0], name, notes)) is not None
    ]
    weight = number(element, "weight", notes, 1.0)
    if len(notes.mistakes) > before:
        return None
    if not 0.0 <= weight <= 1.0:
        notes.mistake(
            element.position, f"the weight must lie in [0, 1], not {weight!r}"
        )
        return None
    connector = element.attributes.get("connector", "and").lower()
    if connector not in ("and", "or"):
        notes.mistake(
            element.position, f"the connector is and or or, not {connector[:20]!r}"
        )
        return None
    when = combined(Or if connector == "or" else And, parts)
    own = None if len(parts) == 1 else connector
    norms = _with_inner(norms, own, inner, notes)
    return SystemRule(when, tuple(results), weight, name), norms


def _with_inner(
    norms: _Norms, connector: str | None, inner: Iterable[_Inner], notes: ReaderNotes
) -> _Norms:
    """Return the norms of a rule, of which its terms may settle what it leaves open."""
    t_norms = {norms.conjunction} if connector == "and" else set()
    s_norms = {norms.disjunction} if connector == "or" else set()
    for one in inner:
        if one.t_norm is not None:
            t_norms.add(one.t_norm)
        if one.s_norm is not None:
            s_norms.add(one.s_norm)
        if max(len(t_norms), len(s_norms)) > 1:
            both = sorted(t_norms if len(t_norms) > 1 else s_norms)
            what = f"one rule cannot join by {both[0]} and by {both[1]}"
            notes.mistake(one.element.position, what)
            return norms
    return msgspec.structs.replace(
        norms,
        conjunction=next(iter(t_norms), norms.conjunction),
        disjunction=next(iter(s_norms), norms.disjunction),
    )


def _only(element: FmlElement, name: str, notes: ReaderNotes) -> FmlElement | None:
    result = element.all(name)
    if len(result) != 1:
        what = f"<{element.name}> needs one <{name}>, and has {len(result)}"
        notes.mistake(element.position, what)
        return None
    return result[0]


def _named(
    clause: FmlElement, variables: FmlVariables, notes: ReaderNotes
) -> tuple[str, str] | None:
    """Return the variable and the term of a clause, as the file calls them."""
    variable, term = _only(clause, "variable", notes), _only(clause, "term", notes)
    if variable is None or term is None:
        return None
    if variable.text not in variables.labels:
        choice = name_choice(variable.text[:40], variables.labels)
        notes.mistake(
            variable.position, f"no variable {variable.text[:40]!r}; {choice}"
        )
        return None
    known = variables.labels[variable.text]
    if term.text not in known:
        choice = name_choice(term.text[:40], known)
        what = f"{variable.text!r} has no term {term.text[:40]!r}; {choice}"
        notes.mistake(term.position, what)
        return None
    return variable.text, term.text


def _modifier(clause: FmlElement, notes: ReaderNotes) -> tuple[Hedge, ...]:
    word = clause.attributes.get("modifier")
    if word is None:
        return ()
    if word in words.MODIFIERS:
        return (words.MODIFIERS[word],)
    if word not in words.OTHER_MODIFIERS and not word.startswith("custom_"):
        known = [*words.MODIFIERS, *words.OTHER_MODIFIERS]
        notes.mistake(clause.position, _unknown("modifier", word, known))
        return ()
    what = f"the modifier {word!r} has no meaning here and is left out"
    notes.loss(f"line {clause.line}", what)
    return ()


def _question(
    clause: FmlElement, about: _About, notes: ReaderNotes
) -> Condition | None:
    named = _named(clause, about[0], notes)
    if named is None:
        return None
    hedges = _modifier(clause, notes)
    antecedent = _condition_of(named, about, notes, 0)
    if hedges == ("any",):
        return Proposition(named[0], (), ("any",))
    match antecedent:
        case Proposition(hedges=before):
            return msgspec.structs.replace(antecedent, hedges=(*hedges, *before))
        case None:
            return None
        case _ if hedges == ("not",):
            return Not(antecedent)
        case _ if not hedges:
            return antecedent
        case _:
            what = f"{hedges[0]!r} of a term that is made of others has no place here"
            notes.mistake(clause.position, what)
            return None


def _condition_of(
    named: tuple[str, str], about: _About, notes: ReaderNotes, level: int
) -> Condition | None:
    """Return the condition that a term stands for: itself, or what it is made of."""
    variables, _ = about
    definition = variables.circular.get(named)
    if definition is None:
        label = variables.labels[named[0]][named[1]]
        hedges: tuple[Hedge, ...] = ("not",) if named in variables.negated else ()
        return Proposition(named[0], (label,), hedges)
    variables.spent.append(None)
    if level > _MOST_LEVELS or len(variables.spent) > _MOST_DEFINITIONS:
        what = f"the term {named[1]!r} is made of too many others, or of itself"
        notes.mistake(definition.position, what)
        return None
    parts = [
        part
        for child in definition.children
        if (part := _joined(child, named[0], about, notes, level)) is not None
    ]
    if len(parts) != 1:
        notes.mistake(
            definition.position, f"the term {named[1]!r} needs one <and> or <or>"
        )
        return None
    return Not(parts[0]) if named in variables.negated else parts[0]


def _inner(element: FmlElement, notes: ReaderNotes) -> _Inner:
    """Return what an <and> or an <or> joins its parts by."""
    if element.name == "and":
        t_norm = word_of(element, "t-norm", words.FML_TNORMS, "MIN", notes)
        return _Inner(element, t_norm=t_norm)
    s_norm = word_of(element, "t-conorm", words.FML_SNORMS, "MAX", notes)
    return _Inner(element, s_norm=s_norm)


def _joined(
    element: FmlElement,
    variable: str,
    about: _About,
    notes: ReaderNotes,
    level: int,
) -> Condition | None:
    """Return an <and>, an <or> or a <termName> of a circular definition."""
    variables, inner_norms = about
    if element.name == "termName":
        if element.text not in variables.labels[variable]:
            choice = name_choice(element.text[:40], variables.labels[variable])
            what = f"{variable!r} has no term {element.text[:40]!r}; {choice}"
            notes.mistake(element.position, what)
            return None
        result = _condition_of((variable, element.text), about, notes, level + 1)
        is_not = element.attributes.get("complement", "false").lower() == "true"
        if is_not and isinstance(result, Proposition):
            return Proposition(variable, result.terms, ("not", *result.hedges))
        return Not(result) if is_not and result is not None else result
    if element.name not in ("and", "or"):
        notes.mistake(
            element.position, f"<{element.name[:40]}> is no <and>, <or> or <termName>"
        )
        return None
    inner_norms.append(_inner(element, notes))
    parts = [
        part
        for child in element.children
        if (part := _joined(child, variable, about, notes, level)) is not None
    ]
    if len(parts) != 2:
        notes.mistake(
            element.position, f"<{element.name}> needs two parts, not {len(parts)}"
        )
        return None
    kind = And if element.name == "and" else Or
    first, second = parts
    # From left to right: (a and b) and c is a and b and c.
    inner = first.parts if isinstance(first, kind) else (first,)
    return kind((*inner, second))


def _conclusion(
    clause: FmlElement, variables: FmlVariables, rule: str, notes: ReaderNotes
) -> Conclusion | None:
    named = _named(clause, variables, notes)
    if named is None:
        return None
    if named[0] not in variables.outputs:
        notes.mistake(
            clause.position, f"rule {rule!r} concludes {named[0]!r}, which is an input"
        )
        return None
    if "modifier" in clause.attributes:
        word = clause.attributes["modifier"][:40]
        what = f"the modifier {word!r} of a conclusion is left out"
        notes.loss(f"rule {rule!r}", what)
    return Conclusion(named[0], variables.labels[named[0]][named[1]])

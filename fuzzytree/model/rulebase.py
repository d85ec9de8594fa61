"""The hub: a fuzzy rule base as a frozen value that knows no file and no array.

What a rule base *means* is computed, slowly and plainly, in
`fuzzytree.semantics.reference`; everything that could change an answer stands in the
values below.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import ClassVar, Final, Literal

import msgspec

from fuzzytree.model.functions import LR as LR
from fuzzytree.model.functions import MOST_POINTS as MOST_POINTS
from fuzzytree.model.functions import Band as Band
from fuzzytree.model.functions import Points as Points
from fuzzytree.model.functions import Shape as Shape
from fuzzytree.model.functions import Side as Side
from fuzzytree.model.mistakes import Mistake as Mistake
from fuzzytree.model.mistakes import Path as Path
from fuzzytree.model.mistakes import name_choice as name_choice
from fuzzytree.model.mistakes import name_mistakes as name_mistakes
from fuzzytree.model.mistakes import refuse as refuse
from fuzzytree.model.mistakes import text_fault as text_fault
from fuzzytree.model.nodes import Leaf, Node, Sets
from fuzzytree.model.probabilities import (
    Probabilities,
    probability_mistakes,
    sharpness_mistakes,
)
from fuzzytree.model.rules import Proposition as Proposition
from fuzzytree.model.values import AnyModel, ModelKind, summary
from fuzzytree.model.values import Value as Value
from fuzzytree.model.variables import DATE_UNIT as DATE_UNIT
from fuzzytree.model.variables import Part as Part
from fuzzytree.model.variables import Term as Term
from fuzzytree.model.variables import Variable as Variable
from fuzzytree.model.variables import shapes_of as shapes_of
from fuzzytree.model.variables import stand_ins as stand_ins
from fuzzytree.model.variables import term_names as term_names
from fuzzytree.model.variables import variable_mistakes as variable_mistakes

_NO_COLUMN = b',"categories":[],"missing":null}'  # in no text: quotes are escaped there


class Rule(Value, frozen=True):
    """IF all propositions hold THEN the class is `then`; no proposition holds always.

    Attributes:
        when: The propositions, joined by AND in this order.
        then: The class.
        support: How many training rows reached it, if known.
        probabilities: Of the classes, in the order of the model's, which
            `fuzzytree.model.probabilities` mixes; unset in a model without any.
        counts: The support by class, in the order of the model's; empty if unknown.
    """

    when: tuple[Proposition, ...]
    then: str
    support: int | None = None
    probabilities: Probabilities = msgspec.UNSET
    counts: tuple[int, ...] = ()


Conjunction = Literal["minimum", "product"]

LabelType = Literal["number", "boolean"]
"""What class names stand for where they are no text."""

Label = str | float | bool
"""The label of a class; a whole number is an `int`."""


USUAL_FLOOR: Final = 0.001
"""The floor of strengths of what was not measured: fitted sets end below it."""


class Semantics(Value, frozen=True):
    """What the rules leave open and an answer depends on.

    The class is that of the strongest rule, of the first of them on a tie.

    Attributes:
        conjunction: How the degrees of a rule's propositions become its strength.
        uncovered: The answer where no rule fires; None answers "no class".
        missing: The answer where a needed value is missing or not finite, or a
            combination overflows; None answers "no class".
        label_type: What the class names stand for, if not text: a number, such as
            "1" or "0.5", or a boolean, "False" or "True". Predictions have these.
        sharpness: The power of the strengths that weigh the rules' probabilities, one
            of 1, 2, 4, ..., 1024; unset in a model without probabilities.
        floor: The strength of a raw rule below which a row is like none that was
            learnt from, in [0, 1]; no answer depends on it. Unset where it was not
            measured.
    """

    conjunction: Conjunction = "minimum"
    uncovered: str | None = None
    missing: str | None = None
    label_type: LabelType | msgspec.UnsetType = msgspec.UNSET
    sharpness: int | msgspec.UnsetType = msgspec.UNSET
    floor: float | msgspec.UnsetType = msgspec.UNSET


Kind = Literal["relative", "raw"]


class RuleBase(AnyModel, frozen=True):
    """A named, ordered set of fuzzy rules that decides for one class.

    Attributes:
        name: For people and files.
        classes: The possible answers, in the order of their numbers.
        variables: Inputs and combinations; a combination stands after its inputs.
        rules: In order: the first of equally strong rules wins.
        semantics: What an answer depends on beside the rules.
        kind: `relative` (equal to its tree) or `raw` (the paper's sets); None for
            rules that come from no tree.
        columns: The columns of the training table, of which the inputs are some.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]
    semantics: Semantics = Semantics()
    kind: Kind | None = None
    columns: tuple[str, ...] = ()

    representation: ClassVar[ModelKind] = "rules"
    outputs: ClassVar[tuple[()]] = ()  # its answers are classes
    blocks: ClassVar[tuple[()]] = ()  # its rules stand alone
    nodes: ClassVar[tuple[Node, ...]] = ()
    leaves: ClassVar[tuple[Leaf, ...]] = ()
    sets: ClassVar[tuple[Sets, ...]] = ()
    note: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Refuse a rule base that contradicts itself."""
        refuse(
            naming_mistakes(self.name, self.classes, self.semantics),
            variable_mistakes(self.variables, self.columns),
            _rule_mistakes(self),
            probability_mistakes(
                "rules",
                [rule.probabilities for rule in self.rules],
                len(self.classes),
                self.semantics.sharpness,
            ),
        )

    @property
    def rule_labels(self) -> tuple[str, ...]:
        """The class of each rule, in order."""
        return tuple(rule.then for rule in self.rules)

    def rule_path(self, number: int) -> Path:
        """Return where the rule of a number, from 1, stands in the model."""
        return ("rules", number - 1)

    def __repr__(self) -> str:
        """Show how much it holds; `str` shows the rules."""
        rules, inputs = len(self.rules), len(self.inputs)
        return summary(
            "RuleBase", rules=rules, inputs=inputs, classes=len(self.classes)
        )

    def __str__(self) -> str:
        """Show the rules as numbered sentences."""
        return "\n".join(
            f"{number}. {sentence(rule)}" for number, rule in enumerate(self.rules, 1)
        )


def sentence(rule: Rule) -> str:
    """Return a rule as people read it.

    Example:
        >>> sentence(Rule((Proposition("grip", ("firm", "hard")),), "hand"))
        'IF grip is firm or hard THEN hand'
    """
    if not rule.when:
        return f"ALWAYS {rule.then}"
    propositions = " AND ".join(
        proposition_text(proposition) for proposition in rule.when
    )
    return f"IF {propositions} THEN {rule.then}"


def proposition_text(proposition: Proposition) -> str:
    """Return a proposition as people read it, such as `grip is not soft or loose`."""
    verb = "is not" if proposition.negated else "is"
    return f"{proposition.variable} {verb} {' or '.join(proposition.terms)}"


def fingerprint(value: msgspec.Struct) -> str:
    """Return the SHA-256 of a model's content, as 64 hexadecimal digits.

    Equal models have equal fingerprints on every machine; numbers enter with all
    their digits. Variables without categories and stand-ins have the fingerprints
    that they had before variables could have them.
    """
    content = msgspec.json.encode(value).replace(_NO_COLUMN, b"}")
    return hashlib.sha256(content).hexdigest()


def label_type_of(labels: Iterable[object]) -> LabelType | msgspec.UnsetType:
    """Return the type of labels that are all numbers or all booleans.

    Example:
        >>> label_type_of([0, 1.5]), label_type_of([True]), label_type_of([True, 2])
        ('number', 'boolean', UNSET)
    """
    result = [*labels]
    if all(isinstance(label, bool) for label in result):
        return "boolean"
    if any(isinstance(label, bool) for label in result):
        return msgspec.UNSET
    is_number = all(isinstance(label, int | float) for label in result)
    return "number" if is_number else msgspec.UNSET


def label_of(name: str, label_type: LabelType | msgspec.UnsetType) -> Label:
    """Return the label that a class name stands for.

    Raises:
        ValueError: If the name is not what Python writes for such a label.

    Example:
        >>> label_of("1", "number"), label_of("1", msgspec.UNSET)
        (1, '1')
    """
    if label_type is msgspec.UNSET:
        return name
    if label_type == "boolean":
        label: Label = name == "True"
    else:
        label = int(name) if name.lstrip("-").isdecimal() else float(name)
    if str(label) != name:
        raise ValueError(name)
    return label


def is_label(name: str, label_type: LabelType | msgspec.UnsetType) -> bool:
    """Return whether a class name is what Python writes for a label of a type."""
    try:
        label_of(name, label_type)
    except ValueError:
        return False
    return True


def naming_mistakes(
    name: str, classes: tuple[str, ...], semantics: Semantics
) -> Iterator[Mistake]:
    """Yield what is wrong with a model's name, classes and default answers."""
    yield from sharpness_mistakes(semantics.sharpness)
    if semantics.floor is not msgspec.UNSET and not 0.0 <= semantics.floor <= 1.0:
        text = f"a floor of strengths lies in 0 to 1, not {semantics.floor!r}"
        yield ("semantics", "floor"), text
    if not name:
        yield ("name",), "a model needs a name"
    fault = text_fault(name)
    if fault:
        yield ("name",), f"the name {name!r} {fault}"
    if not classes:
        yield ("classes",), "a model needs at least one class"
    yield from name_mistakes(("classes",), "class", classes)
    for position, label in enumerate(classes):
        if not label:
            yield ("classes", position), "a class name cannot be empty"
        elif not is_label(label, semantics.label_type):
            text = f"the label type is {semantics.label_type}"
            yield ("classes", position), f"{text}, and the class {label!r} is none"
    for field in ("uncovered", "missing"):
        answer: str | None = getattr(semantics, field)
        if answer is not None and answer not in classes:
            yield (
                ("semantics", field),
                f"the answer for {field} is no class: {answer!r}; "
                f"{name_choice(answer, classes)}",
            )


def proposition_mistakes(
    path: Path,
    where: str,
    proposition: Proposition,
    terms: Mapping[str, Collection[str]],
) -> Iterator[Mistake]:
    """Yield what is wrong with a proposition, given the term names of each variable."""
    if proposition.variable not in terms:
        yield (
            (*path, "variable"),
            f"{where}: no variable {proposition.variable!r}; "
            f"{name_choice(proposition.variable, list(terms))}",
        )
        return
    if not proposition.terms:
        yield (
            (*path, "terms"),
            f"{where}: the proposition on {proposition.variable!r} names no term",
        )
    if proposition.hedges not in ((), ("not",)):
        hedges = ", ".join(proposition.hedges)
        yield (*path, "hedges"), f"{where}: only a fuzzy system has hedges: {hedges}"
    known = terms[proposition.variable]
    for index, term in enumerate(proposition.terms):
        if term not in known:
            yield (
                (*path, "terms", index),
                f"{where}: {proposition.variable!r} has no term {term!r}; "
                f"{name_choice(term, known)}",
            )
    yield from name_mistakes((*path, "terms"), f"term in {where}", proposition.terms)


def _rule_mistakes(rules: RuleBase) -> Iterator[Mistake]:
    if not rules.rules:
        yield ("rules",), "a rule base needs at least one rule"
    classes = dict.fromkeys(rules.classes)
    terms = term_names(rules.variables)
    checked: set[int] = set()  # propositions are shared between rules of one tree
    for number, rule in enumerate(rules.rules, 1):
        path: Path = ("rules", number - 1)
        if rule.then not in classes:
            yield (
                (*path, "then"),
                f"rule {number}: no class {rule.then!r}; "
                f"{name_choice(rule.then, rules.classes)}",
            )
        yield from support_mistakes(path, f"rule {number}", rule, len(classes))
        for index, proposition in enumerate(rule.when):
            if id(proposition) not in checked:
                checked.add(id(proposition))
                yield from proposition_mistakes(
                    (*path, "when", index), f"rule {number}", proposition, terms
                )


def support_mistakes(
    path: Path, where: str, part: Rule | Leaf, classes: int
) -> Iterator[Mistake]:
    """Yield what is wrong with the training rows of a rule or leaf."""
    if part.support is not None and part.support < 0:
        yield (*path, "support"), f"{where}: the support cannot be below 0"
    if not part.counts:
        return
    total = sum(part.counts)
    if len(part.counts) != classes or min(part.counts) < 0:
        text = f"{where}: the counts are one of each class, none below 0"
        yield (*path, "counts"), text
    elif total != part.support:
        text = f"{where}: the counts sum to {total}, not to the support"
        yield (*path, "counts"), text

"""FML files (IEEE 1855-2016) as systems.

`docs/reference/fml.md` describes what is read. All names of a document are XML IDs;
terms that are all called `variable.term`, as our writer does to keep them distinct, get
their own name back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fml import fml_words as words
from fuzzytree.formats.fml import xml
from fuzzytree.formats.fml.fml_rules import FmlVariables, blocks_of, word_of
from fuzzytree.formats.fml.fml_words import CIRCULAR, curve_of, number
from fuzzytree.formats.fml.xml import FmlElement
from fuzzytree.formats.text_files import (
    PositionGroup,
    Positions,
    ReaderNotes,
    locating,
    placed,
    positions_of,
    report,
)
from fuzzytree.model import (
    Defuzzifier,
    FuzzySystem,
    Linear,
    Points,
    Reading,
    RuleBlock,
    SCurve,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    name_choice,
    numbered,
)
from fuzzytree.semantics import as_written

_VARIABLES: Final = ("fuzzyVariable", "tskVariable", "tsukamotoVariable")
_OUTSIDE: Final = ("anYaDataCloud", "anYaRuleBase", "aggregatedFuzzyVariable")


def read_fml(content: bytes, name: str) -> Reading:
    """Return what an FML file says.

    Raises:
        ReadError: With every mistake of the file.

    Example:
        >>> read_fml(b"<fuzzySystem/>", "a.xml")
        Traceback (most recent call last):
        fuzzytree.errors.ReadError: a.xml:1:1: <fuzzySystem> has no <knowledgeBase>
    """
    document = xml.parse(content, name)
    notes = ReaderNotes()
    root = document.root
    if root.name != "fuzzySystem":
        what = f"the root is <{root.name[:40]}>; that of FML is <fuzzySystem>"
        notes.mistake(root.position, what)
    elif root.namespace != words.NAMESPACE:
        value = repr(root.namespace) if root.namespace else "none"
        what = (
            f"the namespace is {value} and not {words.NAMESPACE!r}; read as if it was"
        )
        notes.remark(what)
    parts = None if notes.mistakes else _parts(root, notes)
    if notes.mistakes or parts is None:
        raise report(name, notes.mistakes)
    title = root.attributes.get("name", "") or name.rpartition(".")[0] or "system"
    try:
        system = parts.system(title)
    except InvalidModelError as error:
        raise report(name, placed(parts.positions(), error.mistakes)) from error
    model, facts = as_written(system, document.comments)
    return notes.reading(model, locating(parts.positions, facts))


class _Parts(NamedTuple):
    """The parts of a system, each with what it was made of."""

    inputs: Sequence[tuple[FmlElement, Variable]]
    outputs: Sequence[tuple[FmlElement, SystemOutput]]
    blocks: tuple[RuleBlock, ...]
    rules: Sequence[tuple[FmlElement, FmlElement]]
    variables: FmlVariables

    def system(self, title: str) -> FuzzySystem:
        """Return the system.

        Raises:
            InvalidModelError: With everything that is wrong with it.
        """
        inputs = tuple(one for _, one in self.inputs)
        outputs = tuple(one for _, one in self.outputs)
        return FuzzySystem(title, inputs, outputs, self.blocks)

    def positions(self) -> Positions:
        """Return where its parts stand."""
        waiting = iter(self.rules)
        blocks: list[PositionGroup] = []
        for block in self.blocks:
            rules = [next(waiting) for _ in block.rules]
            head = rules[0][0].position if rules else (1, 1)
            blocks.append((head, [one.position for _, one in rules]))
        inputs = (self._group(*one) for one in self.inputs)
        outputs = (self._group(*one) for one in self.outputs)
        return positions_of(inputs, outputs, blocks)

    def _group(
        self, element: FmlElement, variable: Variable | SystemOutput
    ) -> PositionGroup:
        names = self.variables.labels[variable.name]
        terms = {
            names[name]: child.position
            for child in element.children
            if (name := child.attributes.get("name")) in names
        }
        return element.position, [terms[one.name] for one in variable.terms]


def _parts(root: FmlElement, notes: ReaderNotes) -> _Parts | None:
    """Return the parts of the system; None where something is wrong, which is noted."""
    bases = root.all("knowledgeBase")
    if len(bases) != 1:
        has = f"has {len(bases)} <knowledgeBase>" if bases else "has no <knowledgeBase>"
        notes.mistake(root.position, f"<fuzzySystem> {has}")
        return None
    elements: list[FmlElement] = []
    for child in bases[0].children:
        if child.name in _VARIABLES:
            elements.append(child)
        elif child.name in _OUTSIDE:
            notes.mistake(
                child.position, f"<{child.name}> has no place in a system here"
            )
        else:
            choice = name_choice(child.name[:40], _VARIABLES)
            notes.mistake(
                child.position, f"no kind of variable <{child.name[:40]}>; {choice}"
            )
    names: dict[str, str] = {}
    for element in elements:
        value = element.attributes.get("name", "")
        if not value:
            notes.mistake(
                element.position, f"<{element.name}> needs the attribute name"
            )
        elif value in names:
            notes.mistake(element.position, f"variable {value!r} stands twice")
        names[value] = value
    inputs = [one for one in elements if not _is_output(one)]
    outputs = [one for one in elements if _is_output(one)]
    variables = FmlVariables({}, {}, {})
    found_inputs = tuple(_input(one, variables, notes) for one in inputs)
    found_outputs = tuple(
        _output(one, len(inputs), variables, notes) for one in outputs
    )
    variables.outputs.update({one.name: one for one in found_outputs})
    rule_bases = [child for child in root.children if child.name != "knowledgeBase"]
    blocks = blocks_of(rule_bases, variables, notes)
    if notes.mistakes:
        return None
    rules = [(base, child) for base in rule_bases for child in base.children]
    pairs = (
        zip(inputs, found_inputs, strict=True),
        zip(outputs, found_outputs, strict=True),
    )
    return _Parts([*pairs[0]], [*pairs[1]], blocks, rules, variables)


def _is_output(element: FmlElement) -> bool:
    if element.name != "fuzzyVariable":
        return True
    return element.attributes.get("type", "input").lower() == "output"


def _terms(
    element: FmlElement, variables: FmlVariables, notes: ReaderNotes
) -> list[tuple[str, FmlElement]]:
    """Return the names and elements of terms, and note how each is called in rules."""
    variable = element.attributes.get("name", "")
    kind = element.name.replace("Variable", "Term")
    start = f"{variable}."
    # A term called `variable.` stands where the schema wants one and there is none.
    terms = [t for t in element.all(kind) if t.attributes.get("name") != start]
    for other in element.children:
        if other.name != kind:
            notes.mistake(
                other.position, f"<{other.name[:40]}> stands where <{kind}> does"
            )
    value = [term.attributes.get("name", "") for term in terms]
    is_ours = all(one.startswith(start) and len(one) > len(start) for one in value)
    taken: dict[str, int] = {}
    called: list[str] = []
    for term, one in zip(terms, value, strict=True):
        plain = one.removeprefix(start) if is_ours else one
        if not one or plain in taken:
            what = "stands twice" if one else "has no name"
            notes.mistake(term.position, f"term {one!r} of {variable!r} {what}")
        called.append(numbered(plain, taken))
    variables.labels[variable] = dict(zip(value, called, strict=True))
    return [*zip(called, terms, strict=True)]


def _is_complement(term: FmlElement) -> bool:
    return term.attributes.get("complement", "false").lower() == "true"


def _input(
    element: FmlElement, variables: FmlVariables, notes: ReaderNotes
) -> Variable:
    name = element.attributes.get("name", "")
    labels: list[Term] = []
    for plain, term in _terms(element, variables, notes):
        key = (name, term.attributes.get("name", ""))
        if _is_complement(term):
            variables.negated.add(key)
        circular = term.all(CIRCULAR)
        if circular:
            variables.circular[key] = circular[0]
            continue
        curve = curve_of(term, f"term {plain!r} of {name!r}", notes)
        labels += [Term(plain, curve)] if curve is not None else []
    low, high = _range(element, notes)
    unit = element.attributes.get("scale", "")
    return Variable(name, tuple(labels), low=low, high=high, unit=unit)


def _range(
    element: FmlElement, notes: ReaderNotes
) -> tuple[float | None, float | None]:
    """Return the two ends of a domain; None for one without end."""
    low, high = (
        None
        if element.attributes.get(key, "").strip() == endless
        else number(element, key, notes)
        for key, endless in (("domainleft", "-INF"), ("domainright", "INF"))
    )
    return low, high


def _output(
    element: FmlElement, inputs: int, variables: FmlVariables, notes: ReaderNotes
) -> SystemOutput:
    name = element.attributes.get("name", "")
    labels: list[Term] = []
    for plain, term in _terms(element, variables, notes):
        where = f"term {plain!r} of {name!r}"
        if _is_complement(term) or term.all(CIRCULAR):
            notes.mistake(
                term.position, f"{where}: an output's term must be a curve of its own"
            )
            continue
        match element.name:
            case "tskVariable":
                result = _tsk_term(term, plain, inputs, notes)
            case "tsukamotoVariable":
                result = _tsukamoto_term(term, plain, where, notes)
            case _:
                curve = curve_of(term, where, notes)
                result = None if curve is None else Term(plain, curve)
        labels += [result] if result is not None else []
    default = number(element, "defaultValue", notes, 0.0)
    low, high = (
        (None, None) if element.name == "tskVariable" else _range(element, notes)
    )
    how, aggregation = Defuzzifier("weighted average"), None
    if element.name == "fuzzyVariable":
        how = _defuzzifier(element, notes)
        aggregation = word_of(element, "accumulation", words.FML_SNORMS, "MAX", notes)
        if not all(isinstance(label.function, Singleton) for label in labels):
            notes.remark(
                f"output {name!r}: FML says nothing of samples; read with {how.samples}"
            )
    elif element.attributes.get("combination", "WA").upper() != "WA":
        notes.mistake(
            element.position, "the combination must be WA, the weighted average"
        )
    return SystemOutput(
        name,
        tuple(labels),
        low,
        high,
        how,
        aggregation,
        None if math.isnan(default) else default,
        unit=element.attributes.get("scale", ""),
    )


def _defuzzifier(element: FmlElement, notes: ReaderNotes) -> Defuzzifier:
    method = word_of(element, "defuzzifier", words.FML_METHODS, "COG", notes)
    return Defuzzifier(method or "centroid", words.USUAL.samples, words.USUAL.grid)


def _tsk_term(
    term: FmlElement, plain: str, inputs: int, notes: ReaderNotes
) -> Term | None:
    numbers: list[float] = []
    for value in term.all("tskValue"):
        holder = xml.FmlElement("tskValue", "", {"": value.text}, *value.position, [])
        numbers.append(number(holder, "", notes))
    order = term.attributes.get("order", "")
    needed = {"0": 1, "1": inputs + 1}.get(order)
    if needed is None:
        notes.mistake(
            term.position, f"the order of {plain!r} is 0 or 1, not {order[:20]!r}"
        )
        return None
    if len(numbers) != needed:
        what = f"{plain!r} of order {order} needs {needed} <tskValue>"
        notes.mistake(term.position, f"{what}, not {len(numbers)}")
        return None
    if order == "0":
        return Term(plain, Singleton(numbers[0]))
    return Term(plain, Linear(tuple(numbers[1:]), numbers[0]))


def _tsukamoto_term(
    term: FmlElement, plain: str, where: str, notes: ReaderNotes
) -> Term | None:
    curve = curve_of(term, where, notes)
    is_ramp = isinstance(curve, Points) and sorted(curve.degrees) == [0.0, 1.0]
    if curve is not None and not (is_ramp or isinstance(curve, SCurve)):
        what = "only linear, s and z shapes can be turned round, as Tsukamoto's must"
        notes.mistake(term.position, f"{where}: {what}")
        return None
    return None if curve is None else Term(plain, curve)

"""FLL files of fuzzylite and pyfuzzylite as systems.

`docs/reference/fll.md` describes the file and says where the two engines mean other
things by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import NamedTuple

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fll.fll_meaning import as_meant, differences, without_disabled
from fuzzytree.formats.fll.fll_variables import (
    Known,
    ReadBlock,
    read_block,
    read_variables,
    vocabulary_of,
)
from fuzzytree.formats.fll.fll_words import MOST_BYTES, Entry, Notes, Section, read_page
from fuzzytree.formats.lines import decoded
from fuzzytree.formats.yaml.nodes import MOST_SHOWN, report
from fuzzytree.formats.yaml.spots import Group, Spots
from fuzzytree.model.contracts import Locate, Reading
from fuzzytree.model.naming import printable
from fuzzytree.model.system import FuzzySystem, SystemInput
from fuzzytree.semantics.conversion import as_written


def read(content: bytes, name: str) -> Reading:
    r"""Return what an FLL file says.

    Args:
        content: The file.
        name: What messages call it.

    Raises:
        ReadError: With every mistake of the file.

    Example:
        >>> lines = ["Engine: tip", "InputVariable: food", "  term: good Ramp 0 10",
        ...          "OutputVariable: tip", "  defuzzifier: WeightedAverage",
        ...          "  term: much Constant 25", "RuleBlock:",
        ...          "  rule: if food is good then tip is much"]
        >>> read("\n".join(lines).encode(), "tip.fll").model.columns
        ('food',)
    """
    return _read(content, name)[0]


def places(content: bytes, name: str) -> Locate:
    """Return where the parts of the model of an FLL file stand: their values.

    Raises:
        ReadError: With every mistake of the file.
    """
    _, parts, facts = _read(content, name)
    return parts.spots().of_facts(facts).find


class _Parts(NamedTuple):
    """A system, and what its parts were made of."""

    system: FuzzySystem
    inputs: Sequence[Known]
    outputs: Sequence[Known]
    blocks: Sequence[ReadBlock]

    def spots(self) -> Spots:
        return _spots(self.inputs, self.outputs, self.blocks)


def _read(content: bytes, name: str) -> tuple[Reading, _Parts, str | None]:
    """Return what a file says, what of, and the facts of a rule base if it is one."""
    notes = Notes([], [], [])
    text, remarks = decoded(content, name, MOST_BYTES)
    notes.remarks.extend(remarks)
    page = read_page(text, notes)
    parts = None
    if not notes.is_full:
        parts = _system(page.sections, printable(PurePath(name).stem), notes)
    if notes.found or parts is None:
        raise report(name, notes.found)
    model, facts = as_written(parts.system, page.comments)
    reading = Reading(model, tuple(notes.losses), tuple(notes.remarks))
    return reading, parts, facts


def _system(sections: Sequence[Section], stem: str, notes: Notes) -> _Parts | None:
    """Return the system; None where it has mistakes, which are noted."""
    variables = read_variables(sections, notes)
    vocabulary = vocabulary_of(variables)
    blocks = [
        read_block(section, vocabulary, notes)
        for section in sections
        if section.kind == "RuleBlock" and not notes.is_full
    ]
    if not any(one.is_output and one.is_enabled for one in variables):
        notes.found.append((1, 1, "there is no OutputVariable that is enabled"))
    if notes.found:
        return None
    variables, blocks = without_disabled(variables, blocks, notes)
    _tell_descriptions(sections, notes)
    outputs = [one for one in variables if one.is_output]
    inputs = [one for one in variables if not one.is_output]
    engine = next((one for one in sections if one.kind == "Engine"), None)
    described = None if engine is None else engine.one_of("description")
    try:
        system = FuzzySystem(
            (engine.head.value if engine else "") or stem or "system",
            tuple(
                one.variable for one in inputs if isinstance(one.variable, SystemInput)
            ),
            tuple(as_meant(one, notes) for one in outputs),
            tuple(one.block for one in blocks),
            described.value if described else "",
        )
    except InvalidModelError as error:
        mistakes = error.mistakes[: MOST_SHOWN + 1]
        notes.found.extend(_spots(inputs, outputs, blocks).placed(mistakes))
        return None
    notes.remarks.extend(differences(system))
    return _Parts(system, inputs, outputs, blocks)


def _tell_descriptions(sections: Sequence[Section], notes: Notes) -> None:
    told = [
        one.head.value or one.kind
        for one in sections
        if one.kind != "Engine" and one.one_of("description")
    ]
    if told:
        names = ", ".join(map(repr, told[:5])) + (", ..." if len(told) > 5 else "")
        notes.remarks.append(f"descriptions have no place here: of {names}")


def _spots(
    inputs: Sequence[Known], outputs: Sequence[Known], blocks: Sequence[ReadBlock]
) -> Spots:
    """Return where the parts of the system stand."""
    return Spots(
        tuple(_group(one.section, one.lines) for one in inputs),
        tuple(_group(one.section, one.lines) for one in outputs),
        tuple(_group(one.section, one.lines) for one in blocks),
    )


def _group(section: Section, lines: Sequence[Entry]) -> Group:
    spots = tuple((one.line, one.start) for one in lines)
    return Group((section.head.line, section.head.start), spots)

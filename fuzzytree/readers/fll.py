"""FLL files of fuzzylite and pyfuzzylite as systems.

`docs/fll.md` describes the file and says where the two engines mean other things by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from fuzzytree.casting import as_rules
from fuzzytree.contracts import Document, Reading
from fuzzytree.errors import InvalidModelError
from fuzzytree.readers.fll_meaning import as_meant, differences, without_disabled
from fuzzytree.readers.fll_variables import (
    Known,
    ReadBlock,
    read_block,
    read_variables,
    vocabulary_of,
)
from fuzzytree.readers.fll_words import MOST_BYTES, Notes, Section, read_page
from fuzzytree.readers.lines import decoded
from fuzzytree.readers.nodes import MOST_SHOWN, report
from fuzzytree.rulebase import Path
from fuzzytree.system import FuzzySystem, SystemInput

FACTS: Final = "rules of fuzzytree: "
"""How a comment begins that says which rule base a file was made of."""


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
    notes = Notes([], [], [])
    page = read_page(decoded(content, name, MOST_BYTES), notes)
    system = None
    if not notes.is_full:
        system = _system(page.sections, PurePath(name).stem, notes)
    if notes.found or system is None:
        raise report(name, notes.found)
    model: Document = system
    for comment in page.comments:
        if comment.startswith(FACTS):
            model = as_rules(system, comment.removeprefix(FACTS)) or system
    return Reading(model, tuple(notes.losses), tuple(notes.remarks))


def _system(sections: Sequence[Section], stem: str, notes: Notes) -> FuzzySystem | None:
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
        for path, sentence in error.mistakes[: MOST_SHOWN + 1]:
            place = _place_of(path, inputs, outputs, blocks)
            notes.found.append((*place, sentence))
        return None
    notes.remarks.extend(differences(system))
    return system


def _tell_descriptions(sections: Sequence[Section], notes: Notes) -> None:
    told = [
        one.head.value or one.kind
        for one in sections
        if one.kind != "Engine" and one.one_of("description")
    ]
    if told:
        names = ", ".join(map(repr, told[:5])) + (", ..." if len(told) > 5 else "")
        notes.remarks.append(f"descriptions have no place here: of {names}")


def _place_of(
    path: Path,
    inputs: Sequence[Known],
    outputs: Sequence[Known],
    blocks: Sequence[ReadBlock],
) -> tuple[int, int]:
    """Return the line and column of a part of the system."""
    match path:
        case ("inputs", int(place), "labels", int(index), *_):
            entry = inputs[place].lines[index]
        case ("outputs", int(place), "labels", int(index), *_):
            entry = outputs[place].lines[index]
        case ("inputs", int(place), *_):
            entry = inputs[place].section.head
        case ("outputs", int(place), *_):
            entry = outputs[place].section.head
        case ("blocks", int(place), "rules", int(index), *_):
            entry = blocks[place].lines[index]
        case ("blocks", int(place), *_):
            entry = blocks[place].section.head
        case _:
            return 1, 1
    return entry.line, entry.start

"""FIS files of MATLAB, Octave and fuzzylite as systems.

`docs/reference/fis.md` describes the file and the differences between the three. A file
does not name its dialect: the reader detects it from words that only one dialect has,
and takes MATLAB's meaning by default.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Final

import msgspec

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fis import fis_parts as text
from fuzzytree.formats.fis import fis_words as words
from fuzzytree.formats.fis.fis_parts import FisEntry, FisSection, labels_of, rules_of
from fuzzytree.formats.fis.fis_words import Dialect
from fuzzytree.formats.fll.fll_differences import fuzzylite_losses
from fuzzytree.formats.shapes import FAR
from fuzzytree.formats.text_files import (
    Positions,
    ReaderNotes,
    locating,
    number_of,
    placed,
    report,
)
from fuzzytree.model import (
    Defuzzifier,
    FuzzySystem,
    Reading,
    RuleBlock,
    SNorm,
    SystemOutput,
    SystemRule,
    TNorm,
    Variable,
    name_choice,
    numbered,
    printable,
)
from fuzzytree.semantics import as_written, joined_by_number

DIALECT: Final = "dialect: "

_SYSTEM_KEYS: Final = (
    *("Name", "Type", "Version", "NumInputs", "NumOutputs", "NumRules"),
    *("AndMethod", "OrMethod", "ImpMethod", "AggMethod", "DefuzzMethod"),
)
_VARIABLE_KEYS: Final = ("Name", "Range", "NumMFs", "MF1")
_PRIVATE_KEYS: Final = frozenset({"Enabled", "Default", "LockPrevious", "LockRange"})
DEFAULTS: Final = {
    "matlab": Defuzzifier("centroid", 101, "ends"),
    "octave": Defuzzifier("centroid", 101, "half ends"),
    "fuzzylite": Defuzzifier("centroid", 100, "middle"),
}


class _Methods(msgspec.Struct, frozen=True):
    """What [System] says."""

    name: str
    conjunction: TNorm | None
    disjunction: SNorm | None
    implication: TNorm | None
    aggregation: SNorm | None
    defuzzifier: Defuzzifier
    counts: Mapping[str, FisEntry]


def read_fis(content: bytes, name: str, *, dialect: Dialect | None = None) -> Reading:
    r"""Return what a FIS file says.

    Args:
        content: The file.
        name: What messages call it.
        dialect: Whose meaning counts; None finds it out.

    Raises:
        ReadError: With every mistake of the file.

    Example:
        >>> lines = ["[System]", "Name='tip'", "Type='sugeno'", "DefuzzMethod='wtaver'",
        ...          "[Input1]", "Name='food'", "Range=[0 10]", "NumMFs=1",
        ...          "MF1='good':'linsmf',[0 10]", "[Output1]", "Name='tip %'",
        ...          "Range=[0 30]", "NumMFs=1", "MF1='much':'constant',[25]",
        ...          "[Rules]", "1, 1 (1) : 1"]
        >>> read_fis("\n".join(lines).encode(), "tip.fis").model.inputs
        ('food',)
    """
    notes = ReaderNotes()
    page = text.read_page(content, name, notes)
    dialect = _dialect(page, dialect, notes)
    parts = _system(page, name, dialect, notes)
    if notes.mistakes or parts is None:
        raise report(name, notes.mistakes)
    system, positions = parts
    model, facts = as_written(system, tuple(page.comments), by_input=True)
    return notes.reading(model, locating(positions, facts), f"fis:{dialect}")


def _dialect(page: text.FisFile, wanted: Dialect | None, notes: ReaderNotes) -> Dialect:
    """Return whose file it is; say why, or what contradicts the wanted dialect."""
    signs = list(_signs(page))
    if not signs:
        signs.append(("matlab", "nothing says otherwise", 0))
        notes.rivals.extend(() if wanted else ("octave", "fuzzylite"))
    if wanted is None:
        result, why, _ = signs[0]
        notes.remark(f"read as {result}'s: {why}")
        return result
    for known, why, line in signs:
        is_shared = known == "octave" and wanted == "fuzzylite"
        if line and known != wanted and not is_shared:
            notes.mistake((line, 1), f"{why}; pass --from fis:{known}")
            break
    return wanted


def _signs(page: text.FisFile) -> Iterator[tuple[Dialect, str, int]]:
    """Yield whose words a file has, why, and where, those that count most first.

    The line is 0 of what other engines have or ignore.
    """
    for known in words.DIALECTS:
        if line := page.comments.get(f"{DIALECT}{known}"):
            yield known, f"the file says that it is {known}'s", line
    entries = [entry for section in page.sections for entry in section.entries]
    for entry in entries:
        kind = entry.value.rpartition("[")[0].rstrip(" ,").rpartition(":")[2]
        word = kind.strip(" '")
        is_term = text.TERM.fullmatch(entry.key) is not None
        if entry.key in _PRIVATE_KEYS or (is_term and word in words.PRIVATE):
            what = word if is_term else entry.key
            why = f"{what} in line {entry.line} is only fuzzylite's"
            yield "fuzzylite", why, entry.line if what != "discretemf" else 0
    comments = " ".join(page.comments).lower()
    if "fuzzylite" in comments:
        yield "fuzzylite", "a comment names it", 0
    if "fuzzy-logic-toolkit" in comments:
        yield "octave", "a comment names its fuzzy-logic-toolkit", 0
    for entry in entries:
        if entry.key.endswith("Method") and "_" in entry.value:
            why = f"{entry.value} in line {entry.line} is no word of MATLAB"
            yield "octave", why, entry.line
        indices = entry.value.partition("(")[0]
        numbers = text.numbers_of(indices, 0, 0, [])
        if not entry.key and any(number % 1 for number in numbers):
            why = f"line {entry.line} has hedges, which MATLAB has not"
            yield "octave", why, entry.line


def _system(
    page: text.FisFile, name: str, dialect: Dialect, notes: ReaderNotes
) -> tuple[FuzzySystem, Callable[[], Positions]] | None:
    parts: dict[str, list[FisSection]] = {"input": [], "output": []}
    single: dict[str, FisSection] = {}
    for section in page.sections:
        if section.kind in parts:
            parts[section.kind].append(section)
        else:
            single.setdefault(section.kind, section)
    for kind, sections in parts.items():
        sections.sort(key=lambda section: section.number)
        for place, section in enumerate(sections, 1):
            if section.number != place and not notes.mistakes:
                what = f"[{kind.capitalize()}{place}] is missing before this one"
                notes.mistake((section.line, 1), what)
    if "system" not in single or not parts["output"]:
        missing = "[Output1]" if "system" in single else "[System]"
        notes.mistake((1, 1), f"the file has no section {missing}")
        return None
    methods = _methods(single["system"], name, dialect, notes)
    taken: dict[str, int] = {}
    inputs = tuple(_input(one, dialect, taken, notes) for one in parts["input"])
    outputs = tuple(
        _output(one, methods, dialect, (inputs, taken), notes)
        for one in parts["output"]
    )
    lines = single["rules"].entries if "rules" in single else []
    result = rules_of(lines, (inputs, outputs), dialect, notes)
    _check_counts(methods, (len(inputs), len(outputs), len(lines)), dialect, notes)
    if notes.mistakes:
        return None
    is_weighted = methods.defuzzifier.is_weighted
    block = RuleBlock(
        tuple(rule for _, rule in result),
        methods.conjunction,
        methods.disjunction,
        None if is_weighted else methods.implication,
    )
    if dialect == "matlab":
        outputs = _with_middles(outputs, block.rules, notes)
    if dialect == "fuzzylite":
        for output in outputs:
            notes.losses.extend(fuzzylite_losses(output))
    entries = [entry for entry, _ in result]
    positions = functools.partial(
        text.fis_positions, parts["input"], parts["output"], entries
    )
    try:
        system = FuzzySystem(methods.name, inputs, outputs, (block,))
    except InvalidModelError as error:
        notes.mistakes.extend(placed(positions(), error.mistakes))
        return None
    return joined_by_number(system), positions


def _keyed(
    section: FisSection, known: Sequence[str], notes: ReaderNotes
) -> tuple[dict[str, FisEntry], list[FisEntry]]:
    """Return the entries by key, and those of terms."""
    results: dict[str, FisEntry] = {}
    terms: list[FisEntry] = []
    for entry in section.entries:
        if section.kind != "system" and text.TERM.fullmatch(entry.key):
            terms.append(entry)
        elif entry.key not in known and entry.key not in _PRIVATE_KEYS:
            what = f"no key {entry.key[:40]!r}; {name_choice(entry.key[:40], known)}"
            notes.mistake((entry.line, 1), what)
        elif entry.key in results:
            what = f"{entry.key} stands twice; the first is in line"
            notes.mistake((entry.line, 1), f"{what} {results[entry.key].line}")
        else:
            results[entry.key] = entry
    return results, terms


def _methods(
    section: FisSection, name: str, dialect: Dialect, notes: ReaderNotes
) -> _Methods:
    entries, _ = _keyed(section, _SYSTEM_KEYS, notes)

    def word(key: str) -> str:
        return text.unquoted(entries[key], notes.mistakes) if key in entries else ""

    def norm(key: str, known: Mapping[str, str]) -> str | None:
        source = word(key)
        if source and source not in known:
            entry = entries[key]
            what = f"no {key} {source[:40]!r}; {name_choice(source[:40], known)}"
            notes.mistake(entry.position, what)
        return known.get(source)

    title = word("Name")
    if not title:
        title = printable(PurePath(name).stem) or "system"
        notes.remark(f"the system has no name; {title!r} stands for it")
    method = norm("DefuzzMethod", words.FIS_METHODS)
    is_sugeno = word("Type").lower() == "sugeno"
    if method is None:
        method = "weighted average" if is_sugeno else "centroid"
        if "DefuzzMethod" not in entries:
            notes.remark(f"the file has no DefuzzMethod; read as {method}")
    how = msgspec.structs.replace(DEFAULTS[dialect], method=method)
    if how.is_weighted:
        how = Defuzzifier(how.method)
    else:
        notes.remark(
            f"FIS has no resolution: curves are sampled at {how.samples} values, "
            f"the default of {dialect}"
        )
    if is_sugeno != how.is_weighted and dialect != "fuzzylite" and "Type" in entries:
        entry = entries["Type"]
        what = f"a {word('Type')!r} system cannot have the DefuzzMethod {method!r}"
        notes.mistake(entry.position, what)
    return _Methods(
        title,
        norm("AndMethod", words.FIS_TNORMS),  # type: ignore[arg-type]  # its values
        norm("OrMethod", words.FIS_SNORMS),  # type: ignore[arg-type]
        norm("ImpMethod", words.FIS_TNORMS),  # type: ignore[arg-type]
        norm("AggMethod", words.FIS_SNORMS),  # type: ignore[arg-type]
        how,
        entries,
    )


def _check_counts(
    methods: _Methods,
    result: tuple[int, int, int],
    dialect: Dialect,
    notes: ReaderNotes,
) -> None:
    for key, count in zip(("NumInputs", "NumOutputs", "NumRules"), result, strict=True):
        entry = methods.counts.get(key)
        if entry is None or entry.value.split("%")[0].strip() == str(count):
            continue
        what = f"{key} says {entry.value[:20]}, and there are {count}"
        if key == "NumRules" and dialect == "fuzzylite":
            notes.remark(f"{what}: fuzzylite reads them all")
        else:
            notes.mistake(entry.position, what)


def _range(
    entries: Mapping[str, FisEntry], notes: ReaderNotes
) -> tuple[float | None, float | None]:
    entry = entries.get("Range")
    if entry is None:
        return None, None
    inside = entry.value.partition("[")[2].partition("]")[0]
    start = entry.column + entry.value.find("[") + 1
    ends = text.numbers_of(inside, entry.line, start, notes.mistakes)
    if len(ends) != 2 or not ends[0] <= ends[1]:
        what = f"the Range must be two rising numbers, [0 1], not {entry.value[:40]!r}"
        notes.mistake(entry.position, what)
        return None, None
    low, high = (end if abs(end) < FAR else None for end in ends)
    return low, high


def _name(
    section: FisSection,
    entries: Mapping[str, FisEntry],
    taken: dict[str, int],
    notes: ReaderNotes,
) -> str:
    entry = entries.get("Name")
    name = text.unquoted(entry, notes.mistakes) if entry else ""
    if not name:
        name = f"{section.kind} {section.number}"
        notes.remark(f"{name} has no name of its own")
    result = numbered(name, taken)
    if result != name:
        what = f"{section.kind} {section.number} is called {name!r} like another"
        notes.remark(f"{what}; here it is {result!r}")
    return result


def _input(
    section: FisSection, dialect: Dialect, taken: dict[str, int], notes: ReaderNotes
) -> Variable:
    entries, terms = _keyed(section, _VARIABLE_KEYS, notes)
    name = _name(section, entries, taken, notes)
    low, high = _range(entries, notes)
    _note_enabled(entries, name, notes)
    labels = labels_of(terms, entries.get("NumMFs"), (name, dialect, None), notes)
    return Variable(
        name, labels, low=low, high=high, clips=_is_set(entries, "LockRange")
    )


def _output(
    section: FisSection,
    methods: _Methods,
    dialect: Dialect,
    known: tuple[tuple[Variable, ...], dict[str, int]],
    notes: ReaderNotes,
) -> SystemOutput:
    inputs, taken = known
    entries, terms = _keyed(section, _VARIABLE_KEYS, notes)
    name = _name(section, entries, taken, notes)
    low, high = _range(entries, notes)
    _note_enabled(entries, name, notes)
    how = methods.defuzzifier
    about = (name, dialect, (how.is_weighted, len(inputs)))
    labels = labels_of(terms, entries.get("NumMFs"), about, notes)
    if _is_set(entries, "LockPrevious"):
        what = "where no rule fires, fuzzylite answers as for the row before"
        notes.loss(f"output {name!r}", f"{what}; here it is no number")
    default: float | None = None
    if "Default" in entries:
        default = number_of(entries["Default"].value)
        if default is None or math.isinf(default):
            entry = entries["Default"]
            what = f"the Default must be a number or nan, not {entry.value[:40]!r}"
            notes.mistake(entry.position, what)
    is_joined = not how.is_weighted or (
        dialect == "octave" and methods.aggregation != "sum"
    )
    if lost := words.method_loss(how.method, low, dialect):
        notes.loss(f"output {name!r}", lost)
    return SystemOutput(
        name,
        labels,
        low,
        high,
        how,
        methods.aggregation if is_joined else None,
        None if default is None or math.isnan(default) else default,
        clips=_is_set(entries, "LockRange"),
    )


def _is_set(entries: Mapping[str, FisEntry], key: str) -> bool:
    return key in entries and entries[key].value.lower() in ("1", "true")


def _note_enabled(
    entries: Mapping[str, FisEntry], name: str, notes: ReaderNotes
) -> None:
    if "Enabled" in entries and not _is_set(entries, "Enabled"):
        what = "it is not enabled in the file, and takes part here"
        notes.loss(f"variable {name!r}", what)


def _with_middles(
    outputs: Iterable[SystemOutput], rules: Sequence[SystemRule], notes: ReaderNotes
) -> tuple[SystemOutput, ...]:
    """Return outputs with what MATLAB answers where no rule fires."""
    results = []
    always = always_concluded(rules)
    for one in outputs:
        default = one.default
        if default is None and one.name not in always:
            default = middle(one.low, one.high)
        results.append(msgspec.structs.replace(one, default=default))
    if any(one.default is not None for one in results):
        notes.remark(
            "where no rule fires, an output is the middle of its range, as in MATLAB"
        )
    return tuple(results)


def always_concluded(rules: Iterable[SystemRule]) -> set[str]:
    """Return the outputs that a rule without a condition concludes in every row.

    Example:
        >>> from fuzzytree.model import Conclusion
        >>> always_concluded([SystemRule(None, (Conclusion("tip", "small"),))])
        {'tip'}
    """
    return {
        one.output
        for rule in rules
        if rule.when is None and rule.weight > 0.0
        for one in rule.then
    }


def middle(low: float | None, high: float | None) -> float | None:
    """Return what MATLAB answers where no rule fires, if the range is known.

    Example:
        >>> middle(0.0, 30.0)
        15.0
    """
    return None if low is None or high is None else low / 2 + high / 2

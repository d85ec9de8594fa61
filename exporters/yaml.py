"""Rule bases and trees as YAML that reads like something a person wrote.

Nothing is lost: reading what was written gives an equal model, bit for bit. Words and
numbers are written so that readers of YAML 1.1 and of YAML 1.2 see the same.
`docs/yaml-format.md` describes the file.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from typing import Final

import msgspec

from fuzzytree.contracts import Format, Loss, Model, Written
from fuzzytree.errors import LossError
from fuzzytree.readers import layout
from fuzzytree.readers.layout import LARGEST_COUNT, LONGEST_NAME, LONGEST_SENTENCE
from fuzzytree.readers.nodes import MOST_BYTES, MOST_NODES
from fuzzytree.readers.sentences import Vocabulary, readings, vocabulary_of
from fuzzytree.readers.yaml import reading
from fuzzytree.rulebase import (
    LR,
    Band,
    Clause,
    Flank,
    Part,
    Points,
    RuleBase,
    Semantics,
    Side,
    Term,
    Variable,
    clause_text,
)
from fuzzytree.tree import Branch, FuzzyTree, Node

_WIDTH: Final = 88
_TITLES: Final = {
    "rule base": "# A fuzzy rule base of fuzzytree: IF clauses THEN class.",
    "tree": "# A fuzzy decision tree of fuzzytree: node 1 asks first.",
}
_ORIGINS: Final = {
    "relative": "these rules equal the tree that they come from",
    "raw": "the fitted sets of a tree as they are",
}


class Short(msgspec.Struct, frozen=True):
    """A mapping or list that stands in one line if it fits.

    If not, a list of numbers or names runs on in further lines (`is_run_on`), anything
    else has a line for each entry.
    """

    entries: Entries
    is_run_on: bool = False


class Noted(msgspec.Struct, frozen=True):
    """A text with a comment behind it."""

    text: str
    note: str


Scalar = str | float | int
Entries = dict[str, "Entry"] | list["Entry"]
Entry = Scalar | Noted | Short | dict[str, "Entry"] | list["Entry"]


def write(model: Model, /, *, allow_loss: bool = False) -> Written:
    """Return a rule base or tree as YAML.

    Args:
        model: The model.
        allow_loss: Without effect: what cannot be written whole is not written.

    Raises:
        LossError: If a name is longer than 1000 characters or is no Unicode text, a
            count is above 2**53, or the file is too large to be read again.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(write(random_tree(1, leaves=1)).content.decode().splitlines()[0])
        # A fuzzy decision tree of fuzzytree: node 1 asks first.
    """
    losses = [*_losses(model)]
    if losses:
        text = "\n".join(f"{loss.where}: {loss.what}" for loss in losses)
        raise LossError(f"cannot write {model.name[:100]} as yaml: {text}")
    match model:
        case RuleBase():
            entries = _rule_base(model)
        case FuzzyTree():
            entries = _tree(model)
    return Written(_joined(model.name, entries))


def _joined(name: str, entries: dict[str, Entry]) -> bytes:
    """Return the file; refuse one that is too large to be read again."""
    kind = str(entries["kind"])
    size = 0
    lines: list[str] = []
    for line in itertools.chain([_TITLES[kind]], _block(entries, 0)):
        lines.append(line)
        size += len(line) + 1
        if size > MOST_BYTES:
            break
    content = ("\n".join(lines) + "\n").encode()
    if len(content) > MOST_BYTES or _count(entries) > MOST_NODES:
        raise LossError(
            f"cannot write {name} as yaml: a file of more than {MOST_BYTES:,} bytes "
            f"or {MOST_NODES:,} entries is not read again"
        )
    return content


def _count(entry: Entry) -> int:
    """Return how many nodes of YAML an entry makes."""
    match entry:
        case Short():
            return _count(entry.entries)
        case dict():
            return 1 + len(entry) + sum(map(_count, entry.values()))
        case list():
            return 1 + sum(map(_count, entry))
        case _:
            return 1


def _losses(model: Model) -> Iterator[Loss]:
    for where, text in _names(model):
        if len(text) > LONGEST_NAME:
            what = f"{len(text)} characters are more than the {LONGEST_NAME} of a name"
            yield Loss(f"{where} {text[:20]!r}...", what)
        try:
            text.encode()
        except UnicodeEncodeError:
            yield Loss(f"{where} {text[:20]!r}", "a lone surrogate is no Unicode text")
    if isinstance(model, RuleBase):
        counts = [(f"rule {n}", r.support) for n, r in enumerate(model.rules, 1)]
    else:
        counts = [(f"leaf {n}", r.support) for n, r in enumerate(model.leaves, 1)]
    for where, count in counts:
        if count is not None and count > LARGEST_COUNT:
            yield Loss(where, f"the support is above {LARGEST_COUNT}")


def _names(model: Model) -> Iterator[tuple[str, str]]:
    """Yield every text of a model that is a name, and what it is the name of."""
    yield "name", model.name
    yield from (("class", name) for name in model.classes)
    yield from (("column", name) for name in model.columns)
    for variable in model.variables:
        yield "variable", variable.name
        yield "unit", variable.unit
        yield from (("term", term.name) for term in variable.terms)
    if isinstance(model, FuzzyTree):
        yield from (("pattern", leaf.pattern) for leaf in model.leaves)
        yield from (("set", term.name) for group in model.sets for term in group.terms)


def _rule_base(rules: RuleBase) -> dict[str, Entry]:
    entries = _head(rules, "rule base")
    if rules.kind:
        entries["terms"] = Noted(rules.kind, _ORIGINS[rules.kind])
    entries |= _body(rules)
    vocabulary = vocabulary_of(rules.variables)
    clauses: dict[int, Entry] = {}  # rules share clauses
    listed: list[Entry] = []
    for rule in rules.rules:
        for clause in rule.when:
            if id(clause) not in clauses:
                clauses[id(clause)] = _clause(clause, vocabulary)
        whole: dict[str, Entry] = {
            "if": Short([clauses[id(clause)] for clause in rule.when]),
            "then": rule.then,
        }
        if rule.support is not None:
            whole["support"] = rule.support
        listed.append(whole)
    entries["rules"] = listed
    entries["semantics"] = {
        **_semantics(rules.semantics),
        "answer": "the class of the first of the strongest rules",
    }
    return entries


def _tree(tree: FuzzyTree) -> dict[str, Entry]:
    entries = _head(tree, "tree") | _body(tree)
    if tree.nodes:
        entries["nodes"] = [_node(n, node) for n, node in enumerate(tree.nodes, 1)]
    leaves: list[Entry] = []
    for number, leaf in enumerate(tree.leaves, 1):
        end: dict[str, Entry] = {"leaf": number, "class": leaf.label}
        if leaf.pattern:
            end["pattern"] = leaf.pattern
        if leaf.support is not None:
            end["support"] = leaf.support
        leaves.append(Short(end))
    entries["leaves"] = leaves
    if tree.sets:
        entries["sets"] = [
            {"variable": group.variable, "terms": [*map(_term, group.terms)]}
            for group in tree.sets
        ]
    meant = _semantics(tree.semantics)
    del meant["or"], meant["not"]
    entries["semantics"] = {
        **meant,
        "cuts": "a value equal to a cut lies below it",
        "answer": "the class of the leaf that the nodes lead to",
    }
    return entries


def _head(model: Model, kind: str) -> dict[str, Entry]:
    return {"format": layout.FORMAT, "kind": kind, "name": model.name}


def _body(model: Model) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"classes": Short([*model.classes], is_run_on=True)}
    if model.columns:
        entries["columns"] = Short([*model.columns], is_run_on=True)
    if model.variables:
        entries["variables"] = [*map(_variable, model.variables)]
    return entries


def _variable(variable: Variable) -> dict[str, Entry]:
    entries: dict[str, Entry] = {"name": variable.name}
    if variable.unit:
        entries["unit"] = variable.unit
    ends: dict[str, Entry] = {}
    if variable.low is not None:
        ends["from"] = float(variable.low)
    if variable.high is not None:
        ends["to"] = float(variable.high)
    if ends:
        entries["range"] = Short(ends)
    if variable.parts:
        entries["sum of"] = [*map(_part, variable.parts)]
    if variable.terms:
        entries["terms"] = [*map(_term, variable.terms)]
    return entries


def _part(part: Part) -> Short:
    entries: dict[str, Entry] = {"input": part.input, "weight": float(part.weight)}
    if repr(float(part.centre)) != "0.0":
        entries["centre"] = float(part.centre)
    return Short(entries)


def _term(term: Term) -> dict[str, Entry]:
    match term.shape:
        case Band():
            return {"name": term.name, **_band(term.shape)}
        case LR(mean, left, right):
            middle: dict[str, Entry] = {"name": term.name, "mean": float(mean)}
            if repr(left) == repr(right):  # 0.0 and -0.0 differ
                return middle | _side(left)
            return {**middle, "left": Short(_side(left)), "right": Short(_side(right))}
        case Points(values, degrees):
            pairs = zip(values, degrees, strict=True)
            return {
                "name": term.name,
                "points": Short([*map(_numbers, pairs)], is_run_on=True),
            }


def _band(band: Band) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    if band.low is not None:
        entries["above"] = float(band.low)
    if band.high is not None:
        entries["up to"] = float(band.high)
    if band.left is not None:
        entries["left flank"] = _flank(band.left)
    if band.right is not None:
        entries["right flank"] = _flank(band.right)
    return entries or {"degree": 1}


def _flank(flank: Flank) -> Short:
    entries: dict[str, Entry] = {"from": float(flank.start), "to": float(flank.end)}
    if flank.curve != (1.0,):
        entries["curve"] = _numbers(flank.curve)
    if flank.error is not None:
        entries["fit error"] = float(flank.error)
    return Short(entries)


def _side(side: Side) -> dict[str, Entry]:
    return {
        "spread": float(side.spread),
        "curve": _numbers(side.curve),
        "reach": float(side.reach),
    }


def _numbers(values: Iterable[float]) -> Short:
    return Short([*map(float, values)], is_run_on=True)


def _clause(clause: Clause, vocabulary: Vocabulary) -> Entry:
    """Return a clause as a sentence if that has one reading, else with its parts."""
    text = clause_text(clause)
    if len(text) <= LONGEST_SENTENCE and readings(text, vocabulary) == (clause,):
        return text
    verb = "is not" if clause.negated else "is"
    terms = Short([*clause.terms], is_run_on=True)
    return Short({"variable": clause.variable, verb: terms})


def _node(number: int, node: Node) -> dict[str, Entry]:
    entries: dict[str, Entry] = {
        "node": number,
        "ask": node.variable,
        "cuts": _numbers(node.cuts),
    }
    if node.owners != tuple(range(len(node.branches))):
        owners: list[Entry] = [owner + 1 for owner in node.owners]
        entries["interval owners"] = Short(owners, is_run_on=True)
    entries["branches"] = [*map(_branch, node.branches)]
    return entries


def _branch(branch: Branch) -> Short:
    entries: dict[str, Entry] = {"is": Short([*branch.terms], is_run_on=True)}
    if branch.sets:
        entries["sets"] = Short([*branch.sets], is_run_on=True)
    where = f"leaf {branch.leaf}" if branch.node is None else f"node {branch.node}"
    return Short({**entries, "go to": where})


def _semantics(semantics: Semantics) -> dict[str, Entry]:
    return {
        "and": semantics.conjunction,
        "or": "max",
        "not": "1 - degree",
        "uncovered": Noted(_answer(semantics.uncovered), "where no rule fires"),
        "missing": Noted(
            _answer(semantics.missing), "where a needed value is missing or infinite"
        ),
    }


def _answer(label: str | None) -> str:
    return "no class" if label is None else f"class {label}"


def _block(entries: Entries, indent: int) -> Iterator[str]:
    """Yield the lines of a mapping or list, indented."""
    pad = " " * indent
    if isinstance(entries, dict):
        for key, entry in entries.items():
            yield from _pair(f"{pad}{key}:", entry, indent)
        return
    for entry in entries:
        if isinstance(entry, Short):
            line = f"{pad}- {_flow(entry)}"
            if len(line) <= _WIDTH:
                yield line
                continue
            entry = entry.entries
        if isinstance(entry, dict | list):
            lines = _block(entry, indent + 2)
            yield f"{pad}- {next(lines)[indent + 2 :]}"
            yield from lines
        else:
            yield from _wrapped(f"{pad}- {_scalar(entry)}", indent + 2)


def _pair(head: str, entry: Entry, indent: int) -> Iterator[str]:
    if isinstance(entry, Short):
        line = f"{head} {_flow(entry)}"
        if len(line) <= _WIDTH:
            yield line
            return
        if entry.is_run_on:
            yield from _run_on(head, entry.entries, indent)
            return
        entry = entry.entries
    if isinstance(entry, dict | list):
        yield head
        yield from _block(entry, indent + 2 if isinstance(entry, dict) else indent)
    else:
        yield f"{head} {_scalar(entry)}"


def _run_on(head: str, entries: Iterable[Entry], indent: int) -> Iterator[str]:
    """Yield a list in brackets that fills its lines."""
    line = f"{head} ["
    tokens = [f"{_flow(entry)}," for entry in entries]
    tokens[-1] = f"{tokens[-1][:-1]}]"
    for token in tokens:
        separator = "" if line.endswith("[") else " "
        if separator and len(line) + 1 + len(token) > _WIDTH:
            yield line
            line = " " * (indent + 2) + token
        else:
            line += separator + token
    yield line


def _wrapped(line: str, indent: int) -> Iterator[str]:
    """Yield a line, broken before ` or ` where it is long and a reader joins it."""
    pieces = line.split(" or ")
    is_quoted = line.lstrip(" -")[:1] in "'\""
    if len(line) <= _WIDTH or is_quoted or any(p != p.strip() for p in pieces[1:]):
        yield line
        return
    line = pieces[0]
    for piece in pieces[1:]:
        if len(line) + len(piece) + 4 > _WIDTH:
            yield line
            line = f"{' ' * indent}or {piece}"
        else:
            line += f" or {piece}"
    yield line


def _flow(entry: Entry) -> str:
    """Return an entry in one line."""
    match entry:
        case Short():
            return _flow(entry.entries)
        case dict():
            pairs = ", ".join(f"{key}: {_flow(one)}" for key, one in entry.items())
            return f"{{{pairs}}}"
        case list():
            return f"[{', '.join(map(_flow, entry))}]"
        case _:
            return _scalar(entry)


_PLAIN: Final = re.compile(r"(?:[^\W_]|°)(?:[\w .()/%+*^°²-]*[\w.()/%+*^°²-])?")
_WORDS: Final = frozenset(
    ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"]
)
_LETTER_AND_SPACE: Final = re.compile(r"(?=.*[^\W\d_]).* ")


def _scalar(value: Scalar | Noted) -> str:
    match value:
        case Noted():
            return f"{_text(value.text)}  # {value.note}"
        case float():
            return _number(value)
        case int():
            return str(value)
        case str():
            return _text(value)


def _number(value: float) -> str:
    """Return the shortest digits that give the same number in any version of YAML."""
    text = float.__repr__(value)
    if text.lstrip("-") in ("inf", "nan"):
        return text.replace("inf", ".inf").replace("nan", ".nan")
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if mark and "." not in mantissa else text


def _text(text: str) -> str:
    """Return a text with quotes if any reader could take it for something else."""
    is_plain = _PLAIN.fullmatch(text) and text.lower() not in _WORDS
    if is_plain and (not text[0].isdecimal() or _LETTER_AND_SPACE.match(text)):
        return text
    if text.isprintable():
        return "'" + text.replace("'", "''") + "'"
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    if character.isprintable():
        return character
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


FORMAT = Format("yaml", (".yaml", ".yml"), ("tree", "rules"), write, reading)

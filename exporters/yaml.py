"""Rule bases, trees and systems as YAML that reads like something a person wrote.

Nothing is lost: reading what was written gives an equal model, bit for bit. Words and
numbers are written so that readers of YAML 1.1 and of YAML 1.2 see the same.
`docs/reference/yaml-format.md` describes the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fuzzytree import formats
from fuzzytree.errors import LossError
from fuzzytree.exporters.yaml_system import entries_of, losses_of
from fuzzytree.exporters.yaml_text import (
    Entry,
    Noted,
    Short,
    joined,
    name_losses,
    named_shape,
    numbers,
    range_ends,
    summand,
)
from fuzzytree.formats import (
    LARGEST_COUNT,
    LONGEST_SENTENCE,
    Vocabulary,
    read_yaml,
    readings,
    vocabulary_of,
)
from fuzzytree.model import (
    Branch,
    Clause,
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Loss,
    Model,
    Node,
    RuleBase,
    Semantics,
    Term,
    Variable,
    Written,
    clause_text,
)

_TITLES: Final = {
    "rule base": "# A fuzzy rule base of fuzzytree: IF clauses THEN class.",
    "tree": "# A fuzzy decision tree of fuzzytree: node 1 is the root.",
    "system": "# A fuzzy system of fuzzytree: rules whose conclusions become numbers.",
}
_ORIGINS: Final = {
    "relative": "these rules equal the tree that they come from",
    "raw": "the fitted sets of a tree as they are",
}


def write(model: Document, /, *, allow_loss: bool = False) -> Written:
    """Return a rule base, tree or system as YAML.

    Args:
        model: The model.
        allow_loss: Without effect: what cannot be written whole is not written.

    Raises:
        LossError: If a name is longer than 1000 characters or is no Unicode text, a
            count is above 2**53, a formula is nested too deeply for its text, or the
            file is too large to be read again.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> print(write(random_tree(1, leaves=1)).content.decode().splitlines()[0])
        # A fuzzy decision tree of fuzzytree: node 1 is the root.
    """
    result = losses_of(model) if isinstance(model, FuzzySystem) else _losses(model)
    losses = [*result]
    if losses:
        text = "\n".join(f"{loss.where}: {loss.what}" for loss in losses)
        raise LossError(f"cannot write {model.name[:100]} as yaml: {text}")
    match model:
        case RuleBase():
            entries = _rule_base(model)
        case FuzzyTree():
            entries = _tree(model)
        case FuzzySystem():
            entries = entries_of(model)
    return Written(joined(model.name, _TITLES[str(entries["kind"])], entries))


def _losses(model: Model) -> Iterator[Loss]:
    yield from name_losses(_names(model))
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
    return {"format": formats.YAML_FORMAT, "kind": kind, "name": model.name}


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
    ends = range_ends(variable.low, variable.high)
    if ends:
        entries["range"] = Short(ends)
    if variable.parts:
        entries["sum of"] = [*map(summand, variable.parts)]
    if variable.terms:
        entries["terms"] = [*map(_term, variable.terms)]
    return entries


def _term(term: Term) -> dict[str, Entry]:
    return named_shape(term.name, term.shape)


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
        "cuts": numbers(node.cuts),
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
    entries: dict[str, Entry] = {
        "and": semantics.conjunction,
        "or": "max",
        "not": "1 - degree",
        "uncovered": Noted(_answer(semantics.uncovered), "where no rule fires"),
        "missing": Noted(
            _answer(semantics.missing), "where a needed value is missing or infinite"
        ),
    }
    if semantics.label_type:
        entries["label type"] = Noted(semantics.label_type, "of predicted classes")
    return entries


def _answer(label: str | None) -> str:
    return "no class" if label is None else f"class {label}"


FORMAT = Format(
    name="yaml",
    suffixes=(".yaml", ".yml"),
    carries=("tree", "rules", "system"),
    write=write,
    read=read_yaml,
)

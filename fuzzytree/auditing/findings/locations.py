"""Where rules and terms stand in a model's file, and ids that outlive their order."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec

from fuzzytree.auditing.findings.records import AuditAnswer, FileLocation, TermName
from fuzzytree.checking import format_of
from fuzzytree.errors import ReadError
from fuzzytree.model import (
    Document,
    Locate,
    Path,
    Rule,
    RuleBase,
    nowhere,
    sentence,
    shapes_of,
)


class ModelFile(msgspec.Struct, frozen=True, eq=False):
    """A file that a model was read from: its path as the user wrote it, and its bytes.

    `locate` returns where a part of its model stands.
    """

    name: str
    content: bytes
    locate: Locate = nowhere

    def place(self, path: Path) -> FileLocation | None:
        """Return where a part of the model stands, None if that is not known."""
        spot = self.locate(path)
        return None if spot is None else FileLocation(writable(self.name), *spot)


def writable(text: str) -> str:
    """Return a text as UTF-8 holds it: bytes of a path that are no text as escapes."""
    return text.encode("utf-8", "backslashreplace").decode()


def model_file(name: str, content: bytes) -> ModelFile:
    """Return a file with its places; it is read at the first look-up."""

    @functools.cache
    def locate() -> Locate:
        try:
            read = format_of(name).read
            return nowhere if read is None else read(content, name).locate
        except ReadError:  # such as another format under this suffix
            return nowhere

    return ModelFile(name, content, lambda path: locate()(path))


def term_path(model: Document, label: TermName) -> Path:
    """Return where a model has a term; where its variables are if it has none."""
    owners = [("variables", k, v.name, v.terms) for k, v in enumerate(model.variables)]
    outputs = enumerate(model.outputs)
    owners += [("outputs", k, o.name, o.terms) for k, o in outputs]
    owners += [("sets", k, s.variable, s.terms) for k, s in enumerate(model.sets)]
    for kind, k, name, terms in owners:
        names = [term.name for term in terms]
        if name == label.variable and label.term in names:
            return (kind, k, "terms", names.index(label.term))
    return ("variables",)


def locations_of(
    answer: AuditAnswer, model: Document, file: ModelFile | None, numbers: Iterable[int]
) -> tuple[FileLocation, ...]:
    """Return where the rules and terms of an answer stand, in that order."""
    if file is None:
        return ()
    paths = [model.rule_path(number) for number in numbers]
    paths += [term_path(model, label) for label in answer.terms]
    places = (file.place(path) for path in paths)
    return tuple(dict.fromkeys(place for place in places if place is not None))


# --- ids


def with_ids(
    answers: Iterable[AuditAnswer],
    representations: Sequence[RuleBase],
    curves: Mapping[tuple[str, str], object] | None = None,
) -> Iterator[AuditAnswer]:
    """Yield answers with ids: the code and a hash of what it is about.

    The hash is taken over the sentences and curves of the rules and the terms
    concerned, whatever their place in the file; where there are neither, over the
    subject and the region. Equal ids are numbered `-2`, `-3` in order.

    Numbers of rules mean the first of some `representations`; terms may be of others.
    `curves` are the true ones of terms with another shape.
    """
    shapes: dict[tuple[str, str], object] = {}
    for representation in reversed(representations):
        shapes |= shapes_of(representation.variables)
    shapes |= curves or {}
    rules = representations[0].rules if representations else ()
    counts: dict[str, int] = {}
    for answer in answers:
        facts = [_rule_facts(rules[k - 1], shapes) for k in answer.rules]
        for variable, term in map(msgspec.structs.astuple, answer.terms):
            facts.append([variable, term, shapes.get((variable, term))])
        other = [] if facts else [answer.subject, answer.region]
        content = msgspec.json.encode([answer.code, facts, other])
        name = f"{answer.code}-{hashlib.sha256(content).hexdigest()[:8]}"
        counts[name] = counts.get(name, 0) + 1
        if counts[name] > 1:
            name = f"{name}-{counts[name]}"
        yield msgspec.structs.replace(answer, id=name)


def _rule_facts(rule: Rule, shapes: Mapping[tuple[str, str], object]) -> list[object]:
    """Return what a rule says, with its propositions in an order of their own."""
    curves = [
        [
            proposition.variable,
            proposition.negated,
            sorted(
                msgspec.json.encode(shapes[proposition.variable, term]).decode()
                for term in proposition.terms
            ),
        ]
        for proposition in rule.when
    ]
    ordered = msgspec.structs.replace(rule, when=tuple(sorted(rule.when, key=str)))
    return [sentence(ordered), sorted(curves, key=str)]

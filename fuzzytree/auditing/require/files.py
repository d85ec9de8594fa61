"""A YAML file of requirements.

```yaml
requirements:
  - that: class is never firm
    where: force < 2
    name: gentle
    why: Eggs break.
```
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from fuzzytree.auditing.require.claims import Requirement
from fuzzytree.auditing.require.phrases import parse_requirement
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats import FileRecord, bind, compose, find, report
from fuzzytree.model import Document

_MOST_BYTES = 2**20
_Sentence = Annotated[str, Meta(min_length=1, max_length=1000)]


class RequirementOfFile(FileRecord, frozen=True, kw_only=True):
    """A sentence, `that`, which must be true for all rows that meet `where`."""

    noun: ClassVar[str] = "a requirement"
    that: _Sentence
    where: _Sentence | None = None
    name: _Sentence | None = None
    why: _Sentence | None = None


class RequirementsFile(FileRecord, frozen=True, kw_only=True):
    """Requirements of a model, which `fuzzytree require` proves or refutes."""

    noun: ClassVar[str] = "a file of requirements"
    requirements: Annotated[
        tuple[RequirementOfFile, ...], Meta(min_length=1, max_length=1000)
    ]


def read_requirements(path: PathLike, model: Document) -> tuple[Requirement, ...]:
    """Return the requirements of a file about a model."""
    root, mistakes = compose(read_bounded(path, _MOST_BYTES), str(path))
    record = bind(root, RequirementsFile, mistakes)
    results: list[Requirement] = []
    for position, entry in enumerate(record.requirements if record else ()):
        node = find(root, ("requirements", position, "that"))
        try:
            requirement = parse_requirement(entry.that, model, entry.where or "")
        except ValueError as error:
            mistakes.append((node.line, node.column, str(error)))
            continue
        requirement = requirement._replace(name=entry.name or "", why=entry.why or "")
        results.append(requirement._replace(line=node.line, column=node.column))
    if mistakes:
        raise report(str(path), mistakes)
    return tuple(results)

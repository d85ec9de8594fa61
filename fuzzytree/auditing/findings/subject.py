"""What is audited, in the form that every family of questions takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.findings.held import Held
from fuzzytree.auditing.findings.records import Answer, Policy, Settings, Source
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.system import FuzzySystem
from fuzzytree.model.tree import FuzzyTree

if TYPE_CHECKING:
    from fuzzytree.auditing.findings.places import ModelFile
    from fuzzytree.auditing.findings.results import Given
    from fuzzytree.model.contracts import FloatArray, IntArray


class Rows(msgspec.Struct, frozen=True, eq=False):
    """Rows of a table.

    Attributes:
        name: What messages call the table.
        values: Shape (inputs, rows), in the order of the model's inputs.
        codes: The number of each row's class, -1 if it has none of the model's; None
            if the table has no column of classes.
    """

    name: str
    values: FloatArray
    codes: IntArray | None = None


class Material(msgspec.Struct, frozen=True, eq=False):
    """What an audit is about, each file of it read once: it may change meanwhile.

    Attributes:
        model: The model.
        file: Where it was read from; None if from memory.
        rows: The user's rows.
        data: The table that they come from, if it is a file.
        given: What other verbs found of the model.
    """

    model: Document
    file: ModelFile | None = None
    rows: Rows | None = None
    data: Source | None = None
    given: tuple[Given, ...] = ()


class Subject(msgspec.Struct, frozen=True, eq=False):
    """A model as it is audited.

    Attributes:
        rules: The rules: of a tree its relative rules, which decide as it does; of a
            system a view of it, whose classes are the texts of conclusions.
        policy: How the rules decide.
        domain: Where everything is asked.
        settings: What is taken for small.
        clock: How much time is left.
        tree: The tree that the rules come from.
        raw: The tree's raw rules, if it has fitted sets.
        system: The system that the rules are a view of.
        rows: The user's rows.
        places: Texts such as `rule 2 of block 1` for the rules of a system, one for
            each rule; empty where rules are simply numbered.
        declined: What the view could not take over, as answers.
        is_whole: Whether no rule is left out of the view that may fire. Otherwise what
            no rule of it covers may be covered all the same, and a term that no rule of
            it asks may be asked.
        held: The rules from below and from above; None if they are as they stand here.
    """

    rules: RuleBase
    policy: Policy
    domain: Domain
    settings: Settings
    clock: Clock
    tree: FuzzyTree | None = None
    raw: RuleBase | None = None
    system: FuzzySystem | None = None
    rows: Rows | None = None
    places: tuple[str, ...] = ()
    declined: tuple[Answer, ...] = ()
    is_whole: bool = True
    held: Held | None = None

    def rule_name(self, number: int) -> str:
        """Return what messages call a rule."""
        return self.places[number - 1] if self.places else f"rule {number}"

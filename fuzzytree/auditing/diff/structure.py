"""Changes of the structure of models: matched by content, and not by order.

Inputs are known by their names, combinations by what they sum, terms by their names and
then by their curves, rules by what they say (`fuzzytree.auditing.diff.matching`). Which
of several changes moves the number of a system is not looked for.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection, Hashable, Mapping, Sequence
from itertools import zip_longest
from typing import Any, Literal, NamedTuple

import msgspec

from fuzzytree.auditing.decide.domain import Domain, span
from fuzzytree.auditing.decide.measures import curve_distance
from fuzzytree.auditing.decide.states import answer_text, names_text
from fuzzytree.auditing.diff.keys import Curves
from fuzzytree.auditing.diff.matching import (
    CURVES,
    SAME,
    Matching,
    match_parts,
    match_rules,
    rules_to_match,
)
from fuzzytree.auditing.diff.records import Change, Evidence, Grade
from fuzzytree.auditing.findings.locations import ModelFile
from fuzzytree.auditing.findings.records import FileLocation, Measure
from fuzzytree.model import (
    Document,
    FuzzySystem,
    Path,
    Rule,
    RuleBase,
    Semantics,
    SystemRule,
    Variable,
    kind_of,
)
from fuzzytree.numerics import outwards
from fuzzytree.semantics import shape_of

Shown = Literal["always", "never", "rules", "ties", "uncovered", "any"]
"""By which differing decision a change is shown to break something: by any; by one
that a rule concerned makes, or a tie, or that no rule makes; always, or never."""

_Names = Mapping[str, str]
AnyRules = RuleBase | FuzzySystem


class _Spot(NamedTuple):
    """A part of a model, where it stands, and the numbers of the rules concerned."""

    path: Path
    part: Any = None
    rules: tuple[int, ...] = ()


class Structure:
    """The changes from one model to another, both as rules or both as systems.

    `models` are the two as their `files` have them.
    """

    def __init__(
        self,
        old: AnyRules,
        new: AnyRules,
        domain: Domain,
        evidence: Evidence,
        models: tuple[Document, Document],
        files: tuple[ModelFile | None, ModelFile | None],
    ) -> None:
        self.domain, self.evidence = domain, evidence
        self.models, self.files = models, files
        self.is_system, self.curves = bool(new.outputs), Curves()
        self.users: list[dict[tuple[str, str], tuple[int, ...]]] = []
        for model in (old, new):
            users: defaultdict[tuple[str, str], tuple[int, ...]] = defaultdict(tuple)
            for number, rule in enumerate(rules_to_match(model, self.curves), 1):
                for term in rule.terms:
                    users[term] += (number,)
            self.users.append(users)
        self.changes: list[Change] = []
        self._compare(old, new)

    def _report(
        self,
        part: str,
        sentence: str,
        shown: Shown,
        old: _Spot | None = None,
        new: _Spot | None = None,
        measures: tuple[Measure, ...] = (),
        *,
        is_harmless: bool = False,
    ) -> None:
        """Keep a change with its grade; one that is harmless is for people only."""
        evidence = self.evidence
        old_rules, new_rules = (spot.rules if spot else () for spot in (old, new))
        shows = {
            "always": True,
            "never": False,
            "any": evidence.has_any,
            "ties": evidence.has_tie or evidence.has_number,
            "uncovered": evidence.has_none,
            "rules": evidence.has_number
            or not evidence.old_rules.isdisjoint(old_rules)
            or not evidence.new_rules.isdisjoint(new_rules),
        }
        grade: Grade = "breaking" if shows[shown] else "non-breaking"
        grade = "cosmetic" if is_harmless else grade
        is_sure = grade != "non-breaking" or shown == "never" or evidence.is_equal
        places = self._place(0, old), self._place(1, new)
        change = Change(
            grade, is_sure, part, sentence, old_rules, new_rules, measures, *places
        )
        self.changes.append(change)

    def _place(self, side: int, spot: _Spot | None) -> FileLocation | None:
        """Return where a part stands in the file of its model."""
        file, model = self.files[side], self.models[side]
        if file is None or spot is None or not spot.path:
            return None
        name, *rest = spot.path
        if name == "rules" and rest:
            return file.place((*model.rule_path(int(rest[0]) + 1), *rest[1:]))
        return file.place(spot.path)

    def _report_name(self, text: str, old: _Spot, new: _Spot | None = None) -> None:
        self._report("name", text, "never", old, new or old, is_harmless=True)

    def _report_fact(
        self, part: str, what: str, was: object, now: object, shown: Shown, *path: str
    ) -> None:
        """Report that something is another one, if it is."""
        if was != now:
            here = _Spot(path)
            self._report(part, f"{what} {now}, and was {was}", shown, here, here)

    def _compare(self, old: AnyRules, new: AnyRules) -> None:
        names = self._compare_classes(old, new)
        matching = self._compare_rules(old, new, names)
        self._compare_variables("variables", old.variables, new.variables)
        self._compare_variables("outputs", old.outputs, new.outputs)
        self._compare_semantics(old.semantics, new.semantics, names)
        if not self.is_system:
            self._compare_probabilities(old, new, matching)
        self._compare_blocks(old, new)
        if old.note != new.note:
            self._report_name("the note has changed", _Spot(("note",)))
        if len({kind_of(model) for model in self.models}) == 1:
            self._compare_sets(*self.models)
        if old.name != new.name:
            text = f"the model {old.name!r} is called {new.name!r}"
            self._report_name(text, _Spot(("name",)))
        text = "the columns of the training table are"
        columns = names_text(old.columns), names_text(new.columns)
        self._report_fact("columns", text, *columns, "never", "columns")
        if old.inputs != new.inputs and sorted(old.inputs) == sorted(new.inputs):
            text = f"the inputs stand in another order: {names_text(new.inputs)}"
            here = _Spot(("variables",))
            self._report("input", text, "never", here, here)

    # --- class rules

    def _compare_classes(self, old: AnyRules, new: AnyRules) -> dict[str, str]:
        """Return new names of classes: those with equal antecedents are the same."""

        def labels(model: AnyRules) -> list[tuple[str, Hashable]]:
            rules = rules_to_match(model, self.curves)
            return [
                (label, frozenset(r.antecedent for r in rules if r.then == label))
                for label in model.classes
            ]

        matches, removed, added = match_parts(
            labels(old),
            labels(new),
            lambda label: label[0],
            lambda label: label[1] or label[0],
        )
        names = {
            old.classes[a]: new.classes[b] for a, b, is_renamed in matches if is_renamed
        }
        texts = [f"{label!r} is called {name!r}" for label, name in names.items()]
        texts += [f"{old.classes[a]!r} was removed" for a in removed]
        texts += [f"{new.classes[b]!r} was added" for b in added]
        here = _Spot(("classes",))
        for text in texts:
            self._report("class", f"the class {text}", "always", here, here)
        if old.classes != new.classes and sorted(old.classes) == sorted(new.classes):
            text = f"the classes have other numbers: {names_text(new.classes)}"
            self._report("class", text, "never", here, here)
        return names

    def _compare_semantics(self, old: Semantics, new: Semantics, names: _Names) -> None:
        cases: tuple[tuple[str, str, Shown], ...] = (
            ("uncovered", "no rule fires", "uncovered"),
            ("missing", "a value is missing", "always"),
        )
        for key, case, shown in cases:
            was, now = getattr(old, key), getattr(new, key)
            texts = answer_text(names.get(was, was)), answer_text(now)
            text = f"the answer where {case} is"
            self._report_fact("answer", text, *texts, shown, "semantics", key)
        types = old.label_type or "text", new.label_type or "text"
        was, now = (
            "not measured" if floor is msgspec.UNSET else floor
            for floor in (old.floor, new.floor)
        )
        report, root = self._report_fact, "semantics"
        report("class", "the label type is", *types, "never", root)
        report("support", "the floor of strengths is", was, now, "never", root)
        norms = old.conjunction, new.conjunction
        report("answer", "the AND of rules is", *norms, "any", root, "conjunction")

    def _compare_probabilities(
        self, old: AnyRules, new: AnyRules, pairs: Matching
    ) -> None:
        """Report other supports and probabilities, which decide no class."""
        was, now = old.semantics.sharpness, new.semantics.sharpness
        sharpness = f"; the sharpness is {now or 'none'}, and was {was or 'none'}"
        for field, verbs, what in (
            ("support", ("is", "are"), "supported by other training rows"),
            ("probabilities", ("has", "have"), "other probabilities of classes"),
        ):
            rules = [
                (a + 1, b + 1)
                for a, b, _ in pairs.matches
                if _differ(field, old.rules[a], new.rules[b])
            ]
            is_support, count = field == "support", len(rules)
            if rules or not (is_support or was == now):
                noun = f"rule {verbs[0]}" if count == 1 else f"rules {verbs[1]}"
                text = f"{count} {noun} {what}"
                text += "" if is_support or was == now else sharpness
                mine = _Spot((), rules=tuple(a for a, _ in rules))
                theirs = _Spot((), rules=tuple(b for _, b in rules))
                self._report(
                    "support", text, "never", mine, theirs, is_harmless=is_support
                )

    def _compare_sets(self, old: Document, new: Document) -> None:
        """Report which fitted sets of trees differ: only raw rules use them."""
        mine, theirs = (
            {
                (s.variable, t.name): self.curves.key(t)
                for s in tree.sets
                for t in s.terms
            }
            for tree in (old, new)
        )
        both, here = mine.keys() & theirs.keys(), _Spot(("sets",))
        counts = {
            "changed": sum(mine[key] != theirs[key] for key in both),
            "removed": len(mine) - len(both),
            "new": len(theirs) - len(both),
        }
        texts = [f"{count} {what}" for what, count in counts.items() if count]
        if texts:
            text = f"of the fitted sets {', '.join(texts)}; only raw rules use them"
            self._report("term", text, "never", here, here)

    # --- systems

    def _compare_blocks(self, old: AnyRules, new: AnyRules) -> None:
        for place, (was, now) in enumerate(zip_longest(old.blocks, new.blocks)):
            if was and now:
                of = f" of block {place + 1}" if place else ""
                a, b = (_Spot(("blocks", place), block) for block in (was, now))
                self._compare_fields("block", of, a, b, ("rules",))
            else:
                text = f"block {place + 1} {'was removed' if was else 'is new'}"
                sides = _side(_Spot(("blocks", place)), is_new=was is None)
                self._report("block", text, "any", *sides)

    def _compare_fields(
        self, part: str, of: str, old: _Spot, new: _Spot, skip: Collection[str]
    ) -> None:
        """Report what differs of two parts in other fields."""
        for key in old.part.__struct_fields__:
            was, now = getattr(old.part, key), getattr(new.part, key)
            if key in skip or was == now:
                continue
            text = f"the {key}{of} is {_text(now)}, and was {_text(was)}"
            if key == "clips":
                still = "now" if now else "no longer"
                text = f"values{of} are {still} clamped to its range"
            self._report(part, text, "any", old, new, is_harmless=key == "name")

    # --- rules

    def _compare_rules(self, old: AnyRules, new: AnyRules, names: _Names) -> Matching:
        mine = rules_to_match(old, self.curves, names)
        theirs = rules_to_match(new, self.curves)
        matching, left = match_rules(mine, theirs)
        for a, b, how in matching.matches:
            if how not in (SAME, CURVES):  # their terms are reported
                place = "" if a == b else f" (now {b + 1})"
                text = f"rule {a + 1}{place} has changed: {mine[a].changes(theirs[b])}"
                spots = (
                    _Spot(mine[a].path, rules=(a + 1,)),
                    _Spot(theirs[b].path, rules=(b + 1,)),
                )
                self._report("rule", text, "rules", *spots)
        for a in matching.removed:
            text = f"rule {a + 1} was removed: {mine[a].text}"
            self._report("rule", text, "rules", _Spot(mine[a].path, rules=(a + 1,)))
        for b in matching.added:
            text = f"rule {b + 1} is new: {theirs[b].text}"
            self._report(
                "rule", text, "rules", None, _Spot(theirs[b].path, rules=(b + 1,))
            )
        if left:
            text = f"{left} rules are too many to be matched with each other"
            self._report("rule", text, "never", is_harmless=True)
        ends: list[int] = []  # of the longest rises: what can stay where it is
        for _, b, _ in matching.matches:
            at = bisect_left(ends, b)
            ends[at : at + 1] = [b]
        count = len(matching.matches) - len(ends)
        if count:
            text = "1 rule stands" if count == 1 else f"{count} rules stand"
            text += " at another place among the others"
            if not self.is_system:
                text += ", which matters where two are equally strong"
            here = _Spot(("blocks",) if self.is_system else ("rules",))
            self._report("order", text, "ties", here, here)
        return matching

    # --- variables

    def _compare_variables(
        self, key: str, old: Sequence[Any], new: Sequence[Any]
    ) -> None:
        """Compare inputs and combinations, or outputs."""
        mine, theirs = (
            [
                _Spot((key, place), variable, self._users_of(side, variable))
                for place, variable in enumerate(variables)
            ]
            for side, variables in enumerate((old, new))
        )
        matches, removed, added = match_parts(
            mine,
            theirs,
            lambda spot: spot.part.parts or spot.part.name,
            lambda spot: spot.part.name,
        )
        for a, b, is_other in matches:
            if is_other:
                self._report_sums(mine[a], theirs[b])
        for a in removed:
            self._report_alone(key, mine[a], is_new=False)
        for b in added:
            self._report_alone(key, theirs[b], is_new=True)
        for a, b, _ in matches:
            was, now = mine[a]._replace(rules=()), theirs[b]._replace(rules=())
            self._compare_facts(key, was, now)
            self._compare_terms(was, now)

    def _users_of(self, side: int, variable: Any) -> tuple[int, ...]:
        """Return the numbers of the rules that use a combination."""
        users = self.users[side].items() if variable.parts else ()
        return tuple(
            sorted({n for (name, _), of in users if name == variable.name for n in of})
        )

    def _report_alone(self, key: str, spot: _Spot, *, is_new: bool) -> None:
        """Report that an input, an output or a combination is new, or was removed."""
        noun, parts = _NOUNS[key], spot.part.parts
        text = f"the {noun} {spot.part.name!r}"
        shown: Shown = "never" if is_new and noun == "output" else "always"
        if parts:
            noun, shown = "combination", "rules"
            text = f"the combination {spot.part.name!r}"
            text += (
                f" of {names_text([part.input for part in parts])}" if is_new else ""
            )
        text += " is new" if is_new else " was removed"
        if is_new and noun == "input":
            text += ", so that rows need it"
        self._report(noun, text, shown, *_side(spot, is_new=is_new))

    def _report_sums(self, old: _Spot, new: _Spot) -> None:
        """Report that a variable of one name looks at something else."""
        mine, theirs = ([part.input for part in s.part.parts] for s in (old, new))
        gone = [name for name in mine if name not in theirs]
        come = [name for name in theirs if name not in mine]
        text = f"{new.part.name!r} sums other inputs or weights"
        text += f", without {names_text(gone)}" if gone else ""
        text += f", with {names_text(come)}" if come else ""
        if not (gone or come):
            text += ": its weights, centres or order have changed"
        shown: Shown = "rules" if mine and theirs else "always"
        self._report("combination", text, shown, old, new)

    def _compare_facts(self, key: str, was: _Spot, now: _Spot) -> None:
        """Report what differs of a variable beside its terms."""
        old, new, of = was.part, now.part, f" of {now.part.name!r}"
        if old.name != new.name:
            text = f"the combination {old.name!r} is called {new.name!r}"
            self._report_name(text, was, now)
        if old.unit != new.unit:
            text = f"the unit{of} is {new.unit!r}, and was {old.unit!r}"
            self._report("unit", text, "never", was, now, is_harmless=True)
        if (old.low, old.high) != (new.low, new.high):
            text = f"the range{of} is {_range(new)}, and was {_range(old)}"
            self._report("range", text, "any" if self.is_system else "never", was, now)
        skip = ("name", "unit", "low", "high", "terms", "parts")
        self._compare_fields(_NOUNS[key], of, was, now, skip)

    def _compare_terms(self, was: _Spot, now: _Spot) -> None:
        """Report what differs of a variable's terms, by name first, then by curve."""
        old, new = was.part, now.part
        mine, theirs = (
            [
                _Spot(
                    (*spot.path, "terms", n),
                    term,
                    users.get((variable.name, term.name), ()),
                )
                for n, term in enumerate(variable.terms)
            ]
            for spot, variable, users in zip(
                (was, now), (old, new), self.users, strict=True
            )
        )
        matches, removed, added = match_parts(
            mine,
            theirs,
            lambda spot: spot.part.name,
            lambda spot: self.curves.key(spot.part),
        )
        for a, b, is_renamed in matches:
            spot, other = mine[a], theirs[b]
            name = f"{spot.part.name!r} of "
            if is_renamed:
                text = f"the term {name}{old.name!r} is called {other.part.name!r}"
                self._report_name(
                    text, spot._replace(rules=()), other._replace(rules=())
                )
            elif self.curves.key(spot.part) != self.curves.key(other.part):
                text = f"the curve of {name}{new.name!r} has changed"
                self._report_curve(text, old, spot, other)
        for is_used in (True, False):
            gone = [mine[a] for a in removed if bool(mine[a].rules) is is_used]
            come = [theirs[b] for b in added if bool(theirs[b].rules) is is_used]
            self._report_terms(was, gone, is_new=False)
            self._report_terms(now, come, is_new=True)

    def _report_terms(self, of: _Spot, terms: list[_Spot], *, is_new: bool) -> None:
        """Report that terms of a variable are new or gone, all used or all not."""
        if not terms:
            return
        rules = tuple(sorted({number for term in terms for number in term.rules}))
        verb = "term was" if len(terms) == 1 else "terms were"
        verb += " added" if is_new else " removed"
        names = names_text([term.part.name for term in terms])
        text = f"of {of.part.name!r} {len(terms)} {verb}: {names}"
        text += "" if rules else ", which no rule uses"
        spot = _Spot((*of.path, "terms"), rules=rules)
        is_harmless = not rules and isinstance(of.part, Variable)
        sides = _side(spot, is_new=is_new)
        self._report("term", text, "rules", *sides, is_harmless=is_harmless)

    def _report_curve(self, text: str, variable: Any, old: _Spot, new: _Spot) -> None:
        """Report that a curve has changed, with how far the two are apart."""
        measures: tuple[Measure, ...] = ()
        mine, theirs = shape_of(old.part.function), shape_of(new.part.function)
        heights = {old.part.height, new.part.height}
        if isinstance(variable, Variable) and mine and theirs and heights == {1.0}:
            low, high = span(variable, self.domain)
            if low <= high:
                distance = curve_distance(mine, theirs, low, high)
                most, at = outwards(distance.high)[1], float(distance.at)
                exact = str(distance.low) if distance.low == distance.high else None
                near = f", by {most:.3g} at most, near {at:.6g}"
                text += near if distance.high else " outside the domain"
                measures = (
                    Measure("largest difference", most, exact),
                    Measure("at least", outwards(distance.low)[0], str(distance.low)),
                    Measure("place of the largest difference", at, str(distance.at)),
                )
        is_unused = not (old.rules or new.rules) and isinstance(variable, Variable)
        self._report("term", text, "rules", old, new, measures, is_harmless=is_unused)


_NOUNS: Mapping[str, str] = {"variables": "input", "outputs": "output"}


def _side(spot: _Spot, *, is_new: bool) -> tuple[_Spot | None, _Spot | None]:
    """Return a part of one model alone."""
    return (None, spot) if is_new else (spot, None)


def _range(variable: Any) -> str:
    if variable.low is None and variable.high is None:
        return "not declared"
    low = "-inf" if variable.low is None else f"{variable.low!r}"
    high = "inf" if variable.high is None else f"{variable.high!r}"
    return f"{low} to {high}"


def _differ(field: str, old: Rule | SystemRule, new: Rule | SystemRule) -> bool:
    """Return whether a field differs, as far as both rules know it."""
    if field == "support" and isinstance(old, Rule) and isinstance(new, Rule):
        both = old.counts and new.counts
        return old.counts != new.counts if both else old.support != new.support
    return bool(getattr(old, field) != getattr(new, field))


def _text(value: object) -> str:
    if isinstance(value, msgspec.Struct):
        return " ".join(str(getattr(value, name)) for name in value.__struct_fields__)
    return "none" if value is None else repr(value)

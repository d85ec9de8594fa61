"""Changes of the structure of rule bases: matched by content, and not by order."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from fractions import Fraction

import msgspec

from fuzzytree.auditing.decide.domain import Domain, span
from fuzzytree.auditing.decide.measures import curve_distance
from fuzzytree.auditing.decide.states import answer_text, listed
from fuzzytree.auditing.diff.difference_records import Draft, Shown, renamed_model
from fuzzytree.auditing.diff.matching import (
    AxisKey,
    Curves,
    Match,
    Matching,
    RuleKeys,
    matching,
    words_of,
)
from fuzzytree.auditing.findings.records import Measure
from fuzzytree.model import (
    FuzzyTree,
    Path,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
    proposition_text,
    sentence,
)
from fuzzytree.numerics import outwards


def draft_changes(
    old: RuleBase,
    new: RuleBase,
    domain: Domain,
    trees: tuple[FuzzyTree, FuzzyTree] | None = None,
) -> Iterator[Draft]:
    """Yield the changes from an old rule base to a new one."""
    curves = Curves()
    names = _renamed_classes(old, new, curves)
    yield from _class_drafts(old, new, names)
    yield from _answer_drafts(old, new, names)
    keys = RuleKeys(old, curves, names), RuleKeys(new, curves)
    result = matching(*keys)
    yield from _rule_drafts(result, *keys)
    yield from variable_drafts(old, new, curves, domain)
    if trees is not None:
        yield from set_drafts(*trees, curves)
    yield from _head_drafts(old, new, result)


def _head_drafts(old: RuleBase, new: RuleBase, result: Matching) -> Iterator[Draft]:
    yield from renamed_model(old, new)
    here: Path = ("columns",)
    if old.columns != new.columns:
        text = f"the columns of the training table are {listed(new.columns)}"
        text += f", and were {listed(old.columns)}"
        yield Draft("columns", text, "never", here, here)
    here = ("variables",)
    if old.inputs != new.inputs and sorted(old.inputs) == sorted(new.inputs):
        text = f"the inputs stand in another order: {listed(new.inputs)}"
        yield Draft("input", text, "never", here, here)
    moved = [
        (match.old, match.new)
        for match in result.matches
        if old.rules[match.old - 1].support != new.rules[match.new - 1].support
    ]
    if moved:
        count = "1 rule is" if len(moved) == 1 else f"{len(moved)} rules are"
        text = f"{count} supported by another number of rows"
        was, now = zip(*moved, strict=True)
        draft = Draft("support", text, "never", old_rules=was, new_rules=now)
        yield draft._replace(is_harmless=True)
    yield from _rated_drafts(old, new, result)


def _rated_drafts(old: RuleBase, new: RuleBase, result: Matching) -> Iterator[Draft]:
    """Yield that probabilities of classes changed, which decide no class."""
    moved = [
        (match.old, match.new)
        for match in result.matches
        if old.rules[match.old - 1].probabilities
        != new.rules[match.new - 1].probabilities
    ]
    if moved or old.semantics.sharpness != new.semantics.sharpness:
        count = "1 rule has" if len(moved) == 1 else f"{len(moved)} rules have"
        text = f"{count} other probabilities of classes"
        if old.semantics.sharpness != new.semantics.sharpness:
            text += f"; the sharpness is {new.semantics.sharpness or 'none'}"
            text += f", and was {old.semantics.sharpness or 'none'}"
        was, now = zip(*moved, strict=True) if moved else ((), ())
        yield Draft("support", text, "never", old_rules=was, new_rules=now)


# --- classes and answers


def _renamed_classes(old: RuleBase, new: RuleBase, curves: Curves) -> dict[str, str]:
    """Return which classes have a new name: those whose antecedents are the same."""
    come = [label for label in new.classes if label not in old.classes]
    antecedents: list[defaultdict[str, set[Hashable]]] = []
    for rules in (old, new):
        keys = RuleKeys(rules, curves)
        antecedents.append(defaultdict(set))
        for rule in rules.rules:
            antecedents[-1][rule.then].add(keys.antecedent(rule))
    mine, theirs = antecedents
    names: dict[str, str] = {}
    for label in old.classes:
        if label not in new.classes and mine[label]:
            match = next((k for k in come if theirs[k] == mine[label]), None)
            if match is not None and match not in names.values():
                names[label] = match
    return names


def _class_drafts(
    old: RuleBase, new: RuleBase, names: Mapping[str, str]
) -> Iterator[Draft]:
    here: tuple[Path, Path] = (("classes",), ("classes",))
    for label, other in names.items():
        text = f"the class {label!r} is called {other!r}"
        yield Draft("class", text, "always", *here)
    for label in old.classes:
        if label not in new.classes and label not in names:
            yield Draft("class", f"the class {label!r} was removed", "always", *here)
    for label in new.classes:
        if label not in old.classes and label not in names.values():
            yield Draft("class", f"the class {label!r} was added", "always", *here)
    if old.classes != new.classes and sorted(old.classes) == sorted(new.classes):
        text = f"the classes have other numbers: {listed(new.classes)}"
        yield Draft("class", text, "never", *here)


def _answer_drafts(
    old: RuleBase, new: RuleBase, names: Mapping[str, str]
) -> Iterator[Draft]:
    one, other = old.semantics, new.semantics
    fields: tuple[tuple[str, str, Shown], ...] = (
        ("uncovered", "where no rule fires", "uncovered"),
        ("missing", "where a value is missing", "always"),
    )
    for field, where, shown in fields:
        was: str | None = getattr(one, field)
        now: str | None = getattr(other, field)
        if (None if was is None else names.get(was, was)) != now:
            text = f"the answer {where} is {answer_text(now)}"
            path = ("semantics", field)
            text += f", and was {answer_text(was)}"
            yield Draft("answer", text, shown, path, path)
    if one.label_type != other.label_type:
        text = f"the label type is {other.label_type or 'text'}"
        text += f", and was {one.label_type or 'text'}"
        yield Draft("class", text, "never", ("semantics",), ("semantics",))
    if one.floor != other.floor:
        before, after = (
            "not measured" if floor is msgspec.UNSET else floor
            for floor in (one.floor, other.floor)
        )
        text = f"the floor of strengths is {after}, and was {before}"
        yield Draft("support", text, "never", ("semantics",), ("semantics",))
    if one.conjunction != other.conjunction:
        text = f"the AND of rules is {other.conjunction}, and was {one.conjunction}"
        path = ("semantics", "conjunction")
        yield Draft("answer", text, "any", path, path)


# --- rules


def _rule_drafts(result: Matching, one: RuleKeys, other: RuleKeys) -> Iterator[Draft]:
    for match in result.matches:
        if match.how not in ("same", "curves"):  # their terms are reported
            yield _changed_rule(match, one, other)
    for number in result.removed:
        text = f"rule {number} was removed: {sentence(one.rules[number - 1])}"
        yield Draft("rule", text, "rules", ("rules", number - 1), None, (number,))
    for number in result.added:
        text = f"rule {number} is new: {sentence(other.rules[number - 1])}"
        yield Draft("rule", text, "rules", None, ("rules", number - 1), (), (number,))
    if result.left:
        text = f"{result.left} rules are too many to be matched with each other"
        yield Draft("rule", text, "never", is_harmless=True)
    yield from _order_drafts(result.matches)


def _changed_rule(match: Match, one: RuleKeys, other: RuleKeys) -> Draft:
    was, now = one.rules[match.old - 1], other.rules[match.new - 1]
    texts = [*_proposition_texts(was, now, one, other)]
    if one.then(was) != now.then:
        texts.append(f"its class is {now.then!r}, and was {was.then!r}")
    place = "" if match.old == match.new else f" (now {match.new})"
    text = f"rule {match.old}{place} has changed: {'; '.join(texts)}"
    paths = ("rules", match.old - 1), ("rules", match.new - 1)
    return Draft("rule", text, "rules", *paths, (match.old,), (match.new,))


def _proposition_texts(
    was: Rule, now: Rule, one: RuleKeys, other: RuleKeys
) -> Iterator[str]:
    """Yield which propositions a rule has lost and gained."""
    gone = _unlike(was, one, now, other)
    come = _unlike(now, other, was, one)
    for proposition in gone:
        match = next((c for c in come if c.variable == proposition.variable), None)
        if match is None:
            yield f"it no longer has {proposition_text(proposition)!r}"
        else:
            come.remove(match)
            before, after = proposition_text(proposition), proposition_text(match)
            yield f"it has {after!r} in place of {before!r}"
    for proposition in come:
        yield f"it also has {proposition_text(proposition)!r}"


def _unlike(
    rule: Rule, keys: RuleKeys, other: Rule, other_keys: RuleKeys
) -> list[Proposition]:
    """Return propositions of a rule that another has neither by curve nor word."""
    known = {other_keys.proposition(c) for c in other.when}
    words = {words_of(c) for c in other.when}
    return [
        c
        for c in rule.when
        if keys.proposition(c) not in known and words_of(c) not in words
    ]


def _order_drafts(matches: Sequence[Match]) -> Iterator[Draft]:
    """Yield that rules stand in another order, as many as were overtaken."""
    count = len(matches) - _longest_run([match.new for match in matches])
    if count:
        text = "1 rule stands" if count == 1 else f"{count} rules stand"
        text += " at another place among the others, which matters where two are "
        text += "equally strong"
        yield Draft("order", text, "ties", ("rules",), ("rules",))


def _longest_run(numbers: Sequence[int]) -> int:
    """Return how many numbers of a list can stay where they are: its longest rise."""
    ends: list[int] = []
    for number in numbers:
        place = bisect_left(ends, number)
        ends[place : place + 1] = [number]
    return len(ends)


Users = Mapping[tuple[str, str], tuple[int, ...]]
"""The numbers of the rules that name a term, by variable and term."""


def variable_drafts(
    old: RuleBase, new: RuleBase, curves: Curves, domain: Domain
) -> Iterator[Draft]:
    """Yield the changes of the variables of a rule base.

    Inputs are known by their names, combinations by what they sum.
    """
    mine, theirs = (
        {_key(v): (k, v) for k, v in enumerate(model.variables)} for model in (old, new)
    )
    users = _users(old), _users(new)
    pairs = [(key, key) for key in mine if key in theirs]
    lost = [key for key in mine if key not in theirs]
    come = [key for key in theirs if key not in mine]
    for key in list(lost):
        place, variable = mine[key]
        twin = next((k for k in come if theirs[k][1].name == variable.name), None)
        if twin is not None:
            lost.remove(key)
            come.remove(twin)
            pairs.append((key, twin))
            yield _summed(mine[key], theirs[twin], users)
    for key in lost:
        yield _alone(*mine[key], users[0], is_new=False)
    for key in come:
        yield _alone(*theirs[key], users[1], is_new=True)
    for one, other in pairs:
        (place, variable), (at, match) = mine[one], theirs[other]
        paths: tuple[Path, Path] = (("variables", place), ("variables", at))
        yield from _fact_drafts(variable, match, paths)
        ends = span(variable, domain)
        yield from _term_drafts(variable, match, paths, users, curves, ends)


def _key(variable: Variable) -> AxisKey:
    return variable.parts or variable.name


def _alone(place: int, variable: Variable, users: Users, *, is_new: bool) -> Draft:
    """Return that an input or a combination is new, or was removed."""
    parts = [part.input for part in variable.parts]
    noun = "combination" if parts else "input"
    text = f"the {noun} {variable.name!r}"
    if is_new and parts:
        text += f" of {listed(parts)}"
    text += " is new" if is_new else " was removed"
    if is_new and not parts:
        text += ", so that rows need it"
    path: Path = ("variables", place)
    rules = _users_of(variable, users) if parts else ()
    draft = Draft(noun, text, "rules" if parts else "always")
    if is_new:
        return draft._replace(new=path, new_rules=rules)
    return draft._replace(old=path, old_rules=rules)


def _summed(
    was: tuple[int, Variable], now: tuple[int, Variable], users: tuple[Users, Users]
) -> Draft:
    """Return that a variable of one name looks at something else."""
    (place, old), (at, new) = was, now
    text = f"{new.name!r} sums other inputs or weights"
    one, other = ([part.input for part in variable.parts] for variable in (old, new))
    gone = [name for name in one if name not in other]
    come = [name for name in other if name not in one]
    if gone:
        text += f", without {listed(gone)}"
    if come:
        text += f", with {listed(come)}"
    if not (gone or come):
        text += ": its weights, centres or order have changed"
    shown: Shown = "rules" if old.parts and new.parts else "always"
    paths = ("variables", place), ("variables", at)
    rules = _users_of(old, users[0]), _users_of(new, users[1])
    return Draft("combination", text, shown, *paths, *rules)


def _users_of(variable: Variable, users: Users) -> tuple[int, ...]:
    """Return the numbers of the rules that use a variable."""
    known = (rules for (name, _), rules in users.items() if name == variable.name)
    return tuple(sorted({number for rules in known for number in rules}))


def _users(rules: RuleBase) -> Users:
    uses: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    for number, rule in enumerate(rules.rules, 1):
        named = {
            (proposition.variable, t)
            for proposition in rule.when
            for t in proposition.terms
        }
        for term in named:
            uses[term].append(number)
    return {term: tuple(numbers) for term, numbers in uses.items()}


def _fact_drafts(
    old: Variable, new: Variable, paths: tuple[Path, Path]
) -> Iterator[Draft]:
    """Yield what differs of a variable beside its terms."""
    if old.name != new.name:
        text = f"the combination {old.name!r} is called {new.name!r}"
        yield Draft("name", text, "never", *paths, is_harmless=True)
    if old.unit != new.unit:
        text = f"the unit of {new.name!r} is {new.unit!r}, and was {old.unit!r}"
        yield Draft("unit", text, "never", *paths, is_harmless=True)
    if (old.low, old.high) != (new.low, new.high):
        text = f"the range of {new.name!r} is {_range(new)}, and was {_range(old)}"
        yield Draft("range", text, "never", *paths)


def _range(variable: Variable) -> str:
    if variable.low is None and variable.high is None:
        return "not declared"
    low = "-inf" if variable.low is None else f"{variable.low!r}"
    high = "inf" if variable.high is None else f"{variable.high!r}"
    return f"{low} to {high}"


def _term_drafts(
    old: Variable,
    new: Variable,
    paths: tuple[Path, Path],
    users: tuple[Users, Users],
    curves: Curves,
    ends: tuple[Fraction, Fraction],
) -> Iterator[Draft]:
    """Yield what differs of a variable's terms, by name first and then by curve."""
    mine = {term.name: (k, term) for k, term in enumerate(old.terms)}
    theirs = {term.name: (k, term) for k, term in enumerate(new.terms)}
    for name in (n for n in mine if n in theirs):
        (a, term), (b, other) = mine[name], theirs[name]
        if curves.number(term.shape) != curves.number(other.shape):
            yield _changed_term(
                new.name,
                (term, other),
                ((*paths[0], "terms", a), (*paths[1], "terms", b)),
                (
                    users[0].get((old.name, name), ()),
                    users[1].get((new.name, name), ()),
                ),
                ends,
            )
    gone = [n for n in mine if n not in theirs]
    come = [n for n in theirs if n not in mine]
    for name in list(gone):
        a, term = mine[name]
        number = curves.number(term.shape)
        twin = next(
            (n for n in come if curves.number(theirs[n][1].shape) == number), None
        )
        if twin is not None:
            gone.remove(name)
            come.remove(twin)
            here: Path = (*paths[0], "terms", a)
            there: Path = (*paths[1], "terms", theirs[twin][0])
            text = f"the term {name!r} of {old.name!r} is called {twin!r}"
            yield Draft("name", text, "never", here, there, is_harmless=True)
    for is_used in (True, False):
        removed = [n for n in gone if bool(users[0].get((old.name, n))) is is_used]
        added = [n for n in come if bool(users[1].get((new.name, n))) is is_used]
        if removed:
            yield _terms(old.name, removed, "removed", users[0], (*paths[0], "terms"))
        if added:
            yield _terms(new.name, added, "added", users[1], (*paths[1], "terms"))


def _terms(
    variable: str, names: list[str], what: str, users: Users, path: Path
) -> Draft:
    """Return that terms of a variable were removed or added, all used or all not."""
    rules = sorted({n for name in names for n in users.get((variable, name), ())})
    verb = "term was" if len(names) == 1 else "terms were"
    text = f"of {variable!r} {len(names)} {verb} {what}: {listed(names)}"
    text += "" if rules else ", which no rule uses"
    old, new = (tuple(rules), ()) if what == "removed" else ((), tuple(rules))
    here, there = (path, None) if what == "removed" else (None, path)
    return Draft("term", text, "rules", here, there, old, new, is_harmless=not rules)


def _changed_term(
    variable: str,
    terms: tuple[Term, Term],
    paths: tuple[Path, Path],
    rules: tuple[tuple[int, ...], tuple[int, ...]],
    ends: tuple[Fraction, Fraction],
) -> Draft:
    """Return that a curve has changed, with how far the two are apart on the domain."""
    text = f"the curve of {terms[0].name!r} of {variable!r} has changed"
    measures: tuple[Measure, ...] = ()
    if ends[0] <= ends[1]:
        distance = curve_distance(terms[0].shape, terms[1].shape, *ends)
        most, at = outwards(distance.high)[1], float(distance.at)
        exact = str(distance.low) if distance.low == distance.high else None
        near = f", by {most:.3g} at most, near {at:.6g}"
        text += near if distance.high else " outside the domain"
        measures = (
            Measure("largest difference", most, exact),
            Measure("at least", outwards(distance.low)[0], str(distance.low)),
            Measure("place of the largest difference", at, str(distance.at)),
        )
    draft = Draft("term", text, "rules", *paths, *rules, measures)
    return draft._replace(is_harmless=not any(rules))


def set_drafts(old: FuzzyTree, new: FuzzyTree, curves: Curves) -> Iterator[Draft]:
    """Yield which fitted sets of trees differ: only raw rules use them."""
    mine, theirs = (
        {
            (group.variable, term.name): term.shape
            for group in tree.sets
            for term in group.terms
        }
        for tree in (old, new)
    )
    both = [key for key in mine if key in theirs]
    counts = {
        "changed": sum(
            curves.number(mine[key]) != curves.number(theirs[key]) for key in both
        ),
        "removed": len(mine) - len(both),
        "new": len(theirs) - len(both),
    }
    changes = [f"{count} {what}" for what, count in counts.items() if count]
    if changes:
        text = f"of the fitted sets {', '.join(changes)}; only raw rules use them"
        yield Draft("term", text, "never", ("sets",), ("sets",))

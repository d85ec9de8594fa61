"""Changes of the structure of rule bases: matched by content, and not by order."""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from fuzzytree.auditing.diff.difference_records import Draft, Shown, renamed_model
from fuzzytree.auditing.diff.matching import (
    Curves,
    Match,
    Matching,
    RuleKeys,
    matching,
    words_of,
)
from fuzzytree.auditing.engine.contenders import AxisKey
from fuzzytree.auditing.engine.domain import Domain, span
from fuzzytree.auditing.engine.measures import curve_distance
from fuzzytree.auditing.engine.states import answer_text, listed
from fuzzytree.auditing.findings.records import Measure
from fuzzytree.model import (
    FuzzyTree,
    Path,
    Rule,
    RuleBase,
    Term,
    Variable,
    clause_text,
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
    found = matching(RuleKeys(old, curves, names), RuleKeys(new, curves))
    yield from _rule_drafts(old, new, found, curves, names)
    yield from variable_drafts(old, new, curves, domain)
    if trees is not None:
        yield from set_drafts(*trees, curves)
    yield from _head_drafts(old, new, found)


def _head_drafts(old: RuleBase, new: RuleBase, found: Matching) -> Iterator[Draft]:
    yield from renamed_model(old, new)
    if old.columns != new.columns:
        yield Draft(
            "columns",
            "the columns of the training table are "
            f"{listed(new.columns)}, and were {listed(old.columns)}",
            "never",
            ("columns",),
            ("columns",),
        )
    if old.inputs != new.inputs and sorted(old.inputs) == sorted(new.inputs):
        yield Draft(
            "input",
            f"the inputs stand in another order: {listed(new.inputs)}",
            "never",
            ("variables",),
            ("variables",),
        )
    moved = [
        (match.old, match.new)
        for match in found.matches
        if old.rules[match.old - 1].support != new.rules[match.new - 1].support
    ]
    if moved:
        rules = "1 rule is" if len(moved) == 1 else f"{len(moved)} rules are"
        yield Draft(
            "support",
            f"{rules} supported by another number of rows",
            "never",
            old_rules=tuple(one for one, _ in moved),
            new_rules=tuple(other for _, other in moved),
            is_harmless=True,
        )


# --- classes and answers


def _renamed_classes(old: RuleBase, new: RuleBase, curves: Curves) -> dict[str, str]:
    """Return which classes have a new name: those whose antecedents are the same."""
    gone = [label for label in old.classes if label not in new.classes]
    come = [label for label in new.classes if label not in old.classes]
    if not gone or not come:
        return {}
    one, other = RuleKeys(old, curves), RuleKeys(new, curves)
    antecedents = {
        label: {other.antecedent(rule) for rule in new.rules if rule.then == label}
        for label in come
    }
    found: dict[str, str] = {}
    for label in gone:
        mine = {one.antecedent(rule) for rule in old.rules if rule.then == label}
        match = next((k for k in come if mine and antecedents[k] == mine), None)
        if match is not None and match not in found.values():
            found[label] = match
    return found


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
        if (names.get(was, was) if was is not None else None) != now:
            text = f"the answer {where} is {answer_text(now)}"
            text += f", and was {answer_text(was)}"
            path = ("semantics", field)
            yield Draft("answer", text, shown, path, path)
    if one.label_type != other.label_type:
        text = f"the label type is {other.label_type or 'text'}"
        text += f", and was {one.label_type or 'text'}"
        yield Draft("class", text, "never", ("semantics",), ("semantics",))
    if one.conjunction != other.conjunction:
        text = f"the AND of rules is {other.conjunction}, and was {one.conjunction}"
        path = ("semantics", "conjunction")
        yield Draft("answer", text, "any", path, path)


# --- rules


def _rule_drafts(
    old: RuleBase,
    new: RuleBase,
    found: Matching,
    curves: Curves,
    names: Mapping[str, str],
) -> Iterator[Draft]:
    one, other = RuleKeys(old, curves, names), RuleKeys(new, curves)
    for match in found.matches:
        yield from _changed_rule(match, one, other)
    for number in found.removed:
        text = f"rule {number} was removed: {sentence(old.rules[number - 1])}"
        path = ("rules", number - 1)
        yield Draft("rule", text, "rules", path, None, (number,))
    for number in found.added:
        text = f"rule {number} is new: {sentence(new.rules[number - 1])}"
        path = ("rules", number - 1)
        yield Draft("rule", text, "rules", None, path, (), (number,))
    if found.left:
        text = f"{found.left} rules are too many to be matched with each other"
        yield Draft("rule", text, "never", is_harmless=True)
    yield from _order_drafts(found.matches)


def _changed_rule(match: Match, one: RuleKeys, other: RuleKeys) -> Iterator[Draft]:
    if match.how in ("same", "curves"):
        return  # changed curves are reported with their terms
    was, now = one.rules[match.old - 1], other.rules[match.new - 1]
    texts = [*_clause_texts(was, now, one, other)]
    if one.then(was) != now.then:
        texts.append(f"its class is {now.then!r}, and was {was.then!r}")
    numbered = f"rule {match.old}"
    if match.old != match.new:
        numbered += f" (now {match.new})"
    yield Draft(
        "rule",
        f"{numbered} has changed: {'; '.join(texts)}",
        "rules",
        ("rules", match.old - 1),
        ("rules", match.new - 1),
        (match.old,),
        (match.new,),
    )


def _clause_texts(
    was: Rule, now: Rule, one: RuleKeys, other: RuleKeys
) -> Iterator[str]:
    """Yield which clauses a rule has lost and gained."""
    keys, read = {other.clause(c) for c in now.when}, {words_of(c) for c in now.when}
    gone = [c for c in was.when if one.clause(c) not in keys]
    gone = [c for c in gone if words_of(c) not in read]
    known, words = {one.clause(c) for c in was.when}, {words_of(c) for c in was.when}
    come = [c for c in now.when if other.clause(c) not in known]
    come = [c for c in come if words_of(c) not in words]
    for clause in gone:
        match = next((c for c in come if c.variable == clause.variable), None)
        if match is None:
            yield f"it no longer has {clause_text(clause)!r}"
        else:
            come.remove(match)
            yield f"it has {clause_text(match)!r} in place of {clause_text(clause)!r}"
    for clause in come:
        yield f"it also has {clause_text(clause)!r}"


def _order_drafts(matches: Sequence[Match]) -> Iterator[Draft]:
    """Yield that rules stand in another order, as many as were overtaken."""
    moved = [(a, b) for (a, b) in itertools.pairwise(matches) if b.new < a.new]
    if moved:
        kept = _longest_run([match.new for match in matches])
        count = len(matches) - kept
        rules = "1 rule stands" if count == 1 else f"{count} rules stand"
        yield Draft(
            "order",
            f"{rules} at another place among the others, which matters where two "
            "are equally strong",
            "ties",
            ("rules",),
            ("rules",),
        )


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
        yield _gone(*mine[key], users[0])
    for key in come:
        yield _come(*theirs[key], users[1])
    for one, other in pairs:
        (place, variable), (at, match) = mine[one], theirs[other]
        paths: tuple[Path, Path] = (("variables", place), ("variables", at))
        yield from _fact_drafts(variable, match, paths)
        ends = span(variable, domain)
        yield from _term_drafts(variable, match, paths, users, curves, ends)


def _key(variable: Variable) -> AxisKey:
    return variable.parts or variable.name


def _gone(place: int, variable: Variable, users: Users) -> Draft:
    path: Path = ("variables", place)
    if not variable.parts:
        text = f"the input {variable.name!r} was removed"
        return Draft("input", text, "always", path)
    text = f"the combination {variable.name!r} was removed"
    return Draft("combination", text, "rules", path, None, _asking(variable, users))


def _come(place: int, variable: Variable, users: Users) -> Draft:
    path: Path = ("variables", place)
    if not variable.parts:
        text = f"the input {variable.name!r} is new, so that rows need it"
        return Draft("input", text, "always", None, path)
    parts = listed([part.input for part in variable.parts])
    text = f"the combination {variable.name!r} of {parts} is new"
    rules = _asking(variable, users)
    return Draft("combination", text, "rules", None, path, (), rules)


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
    return Draft(
        "combination",
        text,
        "rules" if old.parts and new.parts else "always",
        ("variables", place),
        ("variables", at),
        _asking(old, users[0]),
        _asking(new, users[1]),
    )


def _asking(variable: Variable, users: Users) -> tuple[int, ...]:
    """Return the numbers of the rules that use a variable."""
    return tuple(
        sorted({n for (name, _), rules in users.items() if name == variable.name
                for n in rules})
    )  # fmt: skip


def _users(rules: RuleBase) -> Users:
    found: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    for number, rule in enumerate(rules.rules, 1):
        named = {(clause.variable, t) for clause in rule.when for t in clause.terms}
        for term in named:
            found[term].append(number)
    return {term: tuple(numbers) for term, numbers in found.items()}


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
    low, high = ends
    name = repr(terms[0].name)
    text = f"the curve of {name} of {variable!r} has changed"
    measures: tuple[Measure, ...] = ()
    if low <= high:
        found = curve_distance(terms[0].shape, terms[1].shape, low, high)
        most, at = outwards(found.high)[1], float(found.at)
        text += f", by {most:.3g} at most, near {at:.6g}"
        if not found.high:
            text = f"the curve of {name} of {variable!r} has changed outside the domain"
        exact = str(found.low) if found.low == found.high else None
        measures = (
            Measure("largest difference", most, exact),
            Measure("at least", outwards(found.low)[0], str(found.low)),
            Measure("place of the largest difference", at, str(found.at)),
        )
    return Draft(
        "term",
        text,
        "rules",
        *paths,
        *rules,
        measures,
        is_harmless=not any(rules),
    )


def set_drafts(old: FuzzyTree, new: FuzzyTree, curves: Curves) -> Iterator[Draft]:
    """Yield which fitted sets of trees differ: only raw rules use them."""
    mine, theirs = (
        {
            (group.variable, term.name): (("sets", g, "terms", t), term.shape)
            for g, group in enumerate(tree.sets)
            for t, term in enumerate(group.terms)
        }
        for tree in (old, new)
    )
    counts = {"changed": 0, "removed": 0, "new": 0}
    for key, (_, shape) in mine.items():
        if key not in theirs:
            counts["removed"] += 1
        elif curves.number(shape) != curves.number(theirs[key][1]):
            counts["changed"] += 1
    counts["new"] = sum(key not in mine for key in theirs)
    changes = [f"{count} {what}" for what, count in counts.items() if count]
    if changes:
        text = f"of the fitted sets {', '.join(changes)}; only raw rules use them"
        yield Draft("term", text, "never", ("sets",), ("sets",))

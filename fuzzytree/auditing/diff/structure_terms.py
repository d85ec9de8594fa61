"""What is said otherwise of variables: inputs, combinations, ranges, units, terms."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from fractions import Fraction

from fuzzytree.auditing.diff.drafting import Draft
from fuzzytree.auditing.diff.matching import Curves
from fuzzytree.auditing.engine.contenders import Key
from fuzzytree.auditing.engine.domain import Domain, span
from fuzzytree.auditing.engine.measures import distance
from fuzzytree.auditing.engine.states import listed
from fuzzytree.auditing.findings.records import Measure
from fuzzytree.model.rulebase import Path, RuleBase, Term, Variable
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.numerics.exact import outwards

Users = Mapping[tuple[str, str], tuple[int, ...]]
"""The numbers of the rules that name a term, by variable and term."""


def variable_drafts(
    old: RuleBase, new: RuleBase, curves: Curves, domain: Domain
) -> Iterator[Draft]:
    """Yield what a new rule base says otherwise of its variables.

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


def _key(variable: Variable) -> Key:
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
    text = f"{new.name!r} sums otherwise"
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
    """Return the numbers of the rules that ask a variable."""
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
    text += "" if rules else ", which no rule asks"
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
        found = distance(terms[0].shape, terms[1].shape, low, high)
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
    """Yield which fitted sets of trees differ: raw rules alone ask them."""
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
    told = [f"{count} {what}" for what, count in counts.items() if count]
    if told:
        text = f"of the fitted sets {', '.join(told)}; raw rules alone ask them"
        yield Draft("term", text, "never", ("sets",), ("sets",))

"""A model without what its answers do not need, and the proof that it is the same.

Nothing is left out that an output could show. What would change an answer, the number
of a rule, or what can be made of a tree is left out only on request, and said.

Why an answer keeps its bits:

- *A term that no proposition names* enters no operation.
- *Two terms of one curve* have equal degrees, and max of equal numbers is that number.
- *A proposition that always holds* has degree 1: `min(1, d)` and `1 * d` are d.
- *A proposition that stands twice* under min: `min(d, d)` is d. Under product it
  counts.
- *A combination that no proposition uses* still shows whether a value is missing. It
  may go where it cannot overflow: then it is finite wherever its inputs are.
- *A rule whose propositions never hold together* has strength 0 for every input, and a
  rule of strength 0 neither wins nor ties; but the rules behind it change their
  numbers.
- *An input that nothing uses* decides alone whether a row with a missing value is
  answered: leaving it out answers more rows.

Of a fuzzy system the same terms go, and with them terms of outputs that no rule
concludes or tests. Terms of an output with equal curves stay, for its conclusions are
joined term by term, and so do all terms of a sampled output with a singleton, for each
singleton is a sample. A rule of weight 0 is never activated. What is left has the steps
of the whole system's program, and equal programs are equal bits for every input.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import partial
from typing import TypeVar, cast

import msgspec
from msgspec.structs import replace

from fuzzytree.model import (
    Band,
    Branch,
    Condition,
    Document,
    Formula,
    Linear,
    Not,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Sets,
    Singleton,
    SystemOutput,
    Term,
    Use,
    Value,
    Variable,
    is_drawn_by_lines,
    names_in,
    proposition_text,
    questions,
    shapes_of,
)
from fuzzytree.semantics.satisfiability import always_holds, never_firing

D = TypeVar("D", bound=Document)
_Same = Mapping[str, Mapping[str, str]]  # of each variable, a term and its stand-in

USES: tuple[Use, ...] = ("tree", "relative", "raw")

_SMALL_CENTRE = 2.0**100  # below half a unit in the last place of float32's largest


class Removed(Value, frozen=True):
    """One thing that was left out, or could be."""

    where: str
    why: str
    changes: str = ""


class Pruned(Value, frozen=True):
    """A model without what it does not need.

    Attributes:
        model: What is left.
        removed: What is not.
        rules: For each rule that is left its number before, from 1; empty for a tree,
            whose leaves keep their numbers.
    """

    model: Document
    removed: tuple[Removed, ...]
    rules: tuple[int, ...] = ()

    @property
    def is_same(self) -> bool:
        """Whether every output keeps every bit, for every input."""
        return not any(one.changes for one in self.removed)


def pruned(
    model: Document,
    *,
    uses: Collection[Use] = ("tree", "relative"),
    inputs: bool = False,
    rules: bool = False,
) -> Pruned:
    """Leave out of a model what its answers do not need.

    Ranges, units, supports and the names of the training table's columns
    stay: people and other tools read them, and no answer depends on them.

    Args:
        model: A tree, a rule base or a fuzzy system.
        uses: What a tree is to serve. Its fitted sets stay for `raw`, its flanks for
            `relative`; its path needs the cuts alone. Without effect on other models.
        inputs: Whether inputs that nothing uses go as well, and combinations that
            might overflow: rows in which only these are missing are then answered.
        rules: Whether rules that can never fire go as well: the rules behind them then
            have other numbers.

    Returns:
        The model that is left, and what is not.

    Raises:
        ValueError: If a use is unknown or none is given, or if raw rules are wanted of
            a tree without sets.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2, inputs=1)
        >>> [one.where for one in pruned(tree).removed]
        ["the fitted sets of 'x1'"]
    """
    _check_uses(model, uses)
    removed: list[Removed] = []
    numbers = _numbers_left(model, _idle_rules(model) if rules else {}, removed)
    variables = [*model.variables]
    if model.leaves and "relative" not in uses:
        variables = _without_flanks(variables, removed)
    same = _stand_ins(variables, removed)
    if model.outputs:
        left: Document = _reworded_system(with_rules(model, numbers), same)
    elif model.rules:
        left = _reworded_rules(cast("RuleBase", model), numbers, same, removed)
    else:
        left = _reworded_tree(model, uses, same, removed)
    left = replace(left, variables=tuple(_merged(variables, same)))
    left = with_named_terms(left, removed)
    kept = _used_variables(left, removed, drops_inputs=inputs)
    return Pruned(replace(left, variables=kept), tuple(removed), tuple(numbers))


def _check_uses(model: Document, uses: Collection[Use]) -> None:
    wrong = [use for use in uses if use not in USES]
    if wrong or not uses:
        named = repr(wrong[0]) if wrong else "none"
        raise ValueError(f"uses: there is {', '.join(USES)}, not {named}")
    if model.rules or model.sets or "raw" not in uses:
        return
    if model.nodes:
        raise ValueError(
            f"uses: tree {model.name!r} carries no fitted sets, so it has no raw rules"
        )


def _idle_rules(model: Document) -> Mapping[int, str]:
    """Return the rules that change no answer, by number, with the reason."""
    if model.outputs:
        return never_activated(model)
    return never_firing(cast("RuleBase", model)) if model.rules else {}


def _reworded_rules(
    rules: RuleBase, numbers: Iterable[int], same: _Same, removed: list[Removed]
) -> RuleBase:
    """Return some of the rules, without propositions that change no strength."""
    is_min = rules.semantics.conjunction == "minimum"
    # Rules of a tree share their propositions, and these may name thousands of terms.
    renamed = functools.cache(partial(_renamed, same=same))
    is_idle = functools.cache(partial(always_holds, shapes=shapes_of(rules.variables)))
    kept: list[Rule] = []
    for number in numbers:
        rule = rules.rules[number - 1]
        when = [renamed(proposition) for proposition in rule.when]
        needed = _needed_propositions(when, is_idle, is_min=is_min)
        texts = [proposition_text(c) for k, c in enumerate(when) if k not in needed]
        removed += [
            Removed(f"proposition {text!r} of rule {number}", "it changes no strength")
            for text in texts
        ]
        kept.append(replace(rule, when=tuple(when[k] for k in needed)))
    return replace(rules, rules=tuple(kept))


def _numbers_left(
    model: Document, dead: Mapping[int, str], removed: list[Removed]
) -> list[int]:
    """Return the numbers of the rules that stay: a model of rules needs one."""
    every = range(1, len(model.rules) + 1)
    numbers = [number for number in every if number not in dead] or [*every[:1]]
    change = "the rules behind it have lower numbers"
    removed += [
        Removed(f"rule {number}", why, change)
        for number, why in dead.items()
        if number not in numbers
    ]
    return numbers


def _needed_propositions(
    when: list[Proposition], is_idle: Callable[[Proposition], bool], *, is_min: bool
) -> list[int]:
    """Return the positions of the propositions that can lower a strength."""
    needed: dict[Proposition | int, int] = {}
    for position, proposition in enumerate(when):
        if not is_idle(proposition):
            needed.setdefault(proposition if is_min else position, position)
    return list(needed.values())


def _duplicate(where: str, other: str) -> Removed:
    return Removed(where, f"its curve is that of {other!r}, which stands in its place")


def _stand_ins(
    variables: Iterable[Variable], removed: list[Removed]
) -> dict[str, dict[str, str]]:
    """Return which terms of each variable others stand in for."""
    same = {v.name: _same_curves(v.terms) for v in variables}
    removed += [
        _duplicate(f"term {name!r} of {variable!r}", other)
        for variable, names in same.items()
        for name, other in names.items()
    ]
    return same


def _same_curves(terms: Iterable[Term]) -> dict[str, str]:
    """Return, for each term whose curve an earlier one has, that one's name."""
    first: dict[bytes, str] = {}
    same: dict[str, str] = {}
    for term in terms:
        curve = curve_bytes((term.function, term.height))
        other = first.setdefault(curve, term.name)
        if other != term.name:
            same[term.name] = other
    return same


def curve_bytes(curve: object) -> bytes:
    """Return what distinguishes curves: the bits of all their numbers.

    Example:
        >>> curve_bytes(Band(high=0.0)) == curve_bytes(Band(high=-0.0))
        False
    """
    return msgspec.msgpack.encode(curve)


def _renamed(proposition: Proposition, same: _Same) -> Proposition:
    of = same.get(proposition.variable, {})  # none of an output
    if not of.keys() & set(proposition.terms):
        return proposition
    names = dict.fromkeys(of.get(name, name) for name in proposition.terms)
    return replace(proposition, terms=tuple(names))


def _merged(variables: Iterable[Variable], same: _Same) -> list[Variable]:
    """Return variables without the terms that others stand in for."""
    return [
        replace(v, terms=tuple(t for t in v.terms if t.name not in same[v.name]))
        for v in variables
    ]


def _used_variables(
    model: Document, removed: list[Removed], *, drops_inputs: bool
) -> tuple[Variable, ...]:
    """Leave out variables without terms that nothing else uses either."""
    used = {one.variable for one in _tests(model)}
    every: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
    for curve in (term.function for variable in every for term in variable.terms):
        if isinstance(curve, Linear):
            used.update(model.inputs)  # it has a weight for each
        elif isinstance(curve, Formula):
            used.update(names_in(curve.expression))
    gone: set[str] = set()
    for one, name in _idle_variables(model.variables, used):
        if drops_inputs or not one.changes:
            removed.append(one)
            gone.add(name)
    return tuple(v for v in model.variables if v.name not in gone)


def _named_terms(
    variable: Variable | SystemOutput,
    named: Collection[tuple[str, str]],
    removed: list[Removed],
) -> tuple[Term, ...]:
    """Return the terms that something names."""
    removed += [
        Removed(f"term {term.name!r} of {variable.name!r}", "nothing names it")
        for term in variable.terms
        if (variable.name, term.name) not in named
    ]
    return tuple(t for t in variable.terms if (variable.name, t.name) in named)


def _idle_variables(
    variables: Iterable[Variable], names: Collection[str]
) -> Iterator[tuple[Removed, str]]:
    """Yield each variable that nothing uses, with what leaving it out changes.

    An input that only idle combinations use is idle as well.
    """
    known = list(variables)
    used = {p.input for v in known if v.terms or v.name in names for p in v.parts}
    used.update(names)
    for variable in known:
        if variable.terms or variable.name in used:
            continue
        name = repr(variable.name)
        if not variable.parts:
            change = "a row is answered though it is missing"
            yield Removed(f"input {name}", "nothing uses it", change), variable.name
            continue
        change = "a row is answered though it overflows"
        change = "" if cannot_overflow(variable.parts) else change
        yield Removed(f"combination {name}", "nothing uses it", change), variable.name


def cannot_overflow(parts: Iterable[Part]) -> bool:
    """Return whether a combination is finite for all finite inputs, in every type.

    With M the largest number of the type, `|x - c|` rounds to M at most where |c| is
    below half a unit in M's last place, and `w (x - c)` is at most |w| M. The sum over
    n parts makes at most n + 1 roundings, each of at most one part in 2**24; for them,
    and for weights that are rounded to float32, a share of (n + 3) / 2**22 is left
    free. The sum of the weights is taken in rational numbers.

    Example:
        >>> cannot_overflow((Part("a", 0.5), Part("b", 0.25)))
        True
        >>> cannot_overflow((Part("a", 0.5), Part("b", 0.75)))
        False
    """
    known = list(parts)
    if any(abs(part.centre) > _SMALL_CENTRE for part in known):
        return False
    weights = sum((abs(Fraction(part.weight)) for part in known), Fraction(0))
    return weights * (1 + Fraction(len(known) + 3, 2**22)) <= 1


# --- fuzzy systems


def _reworded_system(system: Document, same: _Same) -> Document:
    """Return a system whose conditions name the terms that stand in for others."""
    blocks = tuple(
        replace(
            block,
            rules=tuple(replace(r, when=_reworded(r.when, same)) for r in block.rules),
        )
        for block in system.blocks
    )
    return replace(system, blocks=blocks)


def with_named_terms(model: D, removed: list[Removed] | None = None) -> D:
    """Return a model without the terms that nothing names, and that are no samples.

    Args:
        model: The model.
        removed: Gets what is left out.
    """
    removed = [] if removed is None else removed
    named = {(n.variable, t) for n in model.nodes for b in n.branches for t in b.terms}
    named |= {(one.variable, term) for one in {*_tests(model)} for term in one.terms}
    rules = (rule for block in model.blocks for rule in block.rules)
    named |= {(one.output, one.term) for rule in rules for one in rule.then}
    outputs = tuple(
        output
        if _has_samples(output)
        else replace(output, terms=_named_terms(output, named, removed))
        for output in model.outputs
    )
    variables = tuple(
        replace(v, terms=_named_terms(v, named, removed)) for v in model.variables
    )
    result: D = replace(model, variables=variables)
    return replace(result, outputs=outputs) if outputs else result


def _tests(model: Document) -> Iterator[Proposition]:
    """Yield the propositions of all rules."""
    for rule in model.rules:
        yield from rule.when if isinstance(rule, Rule) else questions(rule.when)


def _has_samples(output: SystemOutput) -> bool:
    """Return whether terms of an output say where its range is looked at."""
    is_weighted = output.defuzzifier.is_weighted
    curves = [term.function for term in output.terms]
    return not is_weighted and any(isinstance(one, Singleton) for one in curves)


def never_activated(system: Document) -> dict[int, str]:
    """Return the rules that conclude nothing, by number, with the reason.

    The grid `lines` joins its lines at every term that is concluded, at degree 0 too.
    """
    drawn = {one.name for one in system.outputs if is_drawn_by_lines(one)}
    rules = (rule for block in system.blocks for rule in block.rules)
    return {
        number: "its weight is 0"
        for number, rule in enumerate(rules, 1)
        if rule.weight == 0.0 and drawn.isdisjoint(one.output for one in rule.then)
    }


def with_rules(system: D, numbers: Collection[int]) -> D:
    """Return a system with some of its rules, and the blocks that still have one."""
    order = iter(range(1, len(system.rules) + 1))
    blocks = [
        replace(b, rules=tuple(r for r in b.rules if next(order) in numbers))
        for b in system.blocks
    ]
    return replace(system, blocks=tuple(block for block in blocks if block.rules))


def _reworded(when: Condition | None, same: _Same) -> Condition | None:
    """Return a condition that names the terms that stand in for others."""
    match when:
        case None:
            return None
        case Proposition():
            return _renamed(when, same)
        case Not(part=part):
            return replace(when, part=_reworded(part, same))
        case _:
            return replace(when, parts=tuple(_reworded(p, same) for p in when.parts))


# --- trees


def _reworded_tree(
    tree: Document, uses: Collection[Use], same: _Same, removed: list[Removed]
) -> Document:
    """Return a tree whose branches name the terms and sets that stand for others."""
    sets, same_sets = _pruned_sets(tree, uses, removed)

    def left(variable: str, branch: Branch) -> Branch:
        terms = tuple(same[variable].get(name, name) for name in branch.terms)
        if not sets:
            return replace(branch, terms=terms, sets=())
        of = same_sets[variable]
        patterns = dict.fromkeys(of.get(name, name) for name in branch.sets)
        return replace(branch, terms=terms, sets=tuple(patterns))

    nodes = tuple(
        replace(node, branches=tuple(left(node.variable, b) for b in node.branches))
        for node in tree.nodes
    )
    return replace(tree, nodes=nodes, sets=sets)


def _without_flanks(
    variables: Iterable[Variable], removed: list[Removed]
) -> list[Variable]:
    """Return variables whose bands are their plateaus alone."""
    kept: list[Variable] = []
    for variable in variables:
        terms: list[Term] = []
        for term in variable.terms:
            shape = term.shape
            if isinstance(shape, Band) and shape.flanks:
                where = f"the flanks of term {term.name!r} of {variable.name!r}"
                removed.append(Removed(where, "only relative rules need them"))
                shape = Band(shape.low, shape.high)
            terms.append(Term(term.name, shape))
        kept.append(replace(variable, terms=tuple(terms)))
    return kept


def _pruned_sets(
    tree: Document, uses: Collection[Use], removed: list[Removed]
) -> tuple[tuple[Sets, ...], dict[str, dict[str, str]]]:
    """Return the fitted sets that raw rules need, and which stand in for which."""
    named = {(n.variable, s) for n in tree.nodes for b in n.branches for s in b.sets}
    used = {variable for variable, _ in named}
    same: dict[str, dict[str, str]] = {}
    kept: list[Sets] = []
    for group in tree.sets:
        where = f"the fitted sets of {group.variable!r}"
        if "raw" not in uses or group.variable not in used:
            is_idle = group.variable not in used
            why = "no node uses it" if is_idle else "only raw rules need them"
            removed.append(Removed(where, why))
            continue
        same[group.variable] = of = _same_curves(group.terms)
        stands = {of.get(s, s) for v, s in named if v == group.variable}
        for term in group.terms:
            text = f"set {term.name!r} of {group.variable!r}"
            if term.name in of:
                removed.append(_duplicate(text, of[term.name]))
            elif term.name not in stands:
                removed.append(Removed(text, "no branch names it"))
        terms = tuple(t for t in group.terms if t.name in stands)
        kept.append(Sets(group.variable, terms))
    return tuple(kept), same

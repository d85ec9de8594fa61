"""The proof that a model without what its answers do not need is the same function."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator
from typing import Any

from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import (
    Document,
    FuzzySystem,
    FuzzyTree,
    Model,
    Part,
    Proposition,
    RuleBase,
    Use,
    Variable,
    kind_of,
    shapes_of,
)
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.semantics.satisfiability import always_holds, never_firing
from fuzzytree.semantics.simplification import (
    cannot_overflow,
    curve_bytes,
    never_activated,
    with_named_terms,
    with_rules,
)


def proof_faults(
    before: Document,
    after: Document,
    *,
    uses: Collection[Use] = ("tree", "relative"),
    rules: Collection[int] = (),
) -> Iterator[str]:
    """Yield what keeps two models from being the same function; nothing if they are.

    Both are brought to a form in which a name stands for nothing but itself: a
    proposition becomes the curves that it takes the largest of, on the inputs and the
    chain of sums that it looks at; what always holds is left out, and so is what cannot
    change whether a value is missing. Equal forms perform equal operations on equal
    numbers, whatever the input. Where `after` has fewer inputs or combinations the two
    are the same for rows in which those left out are neither missing nor overflow.

    Of two fuzzy systems the steps of their programs are compared, bit for bit.

    This reads both models afresh and trusts no list of what was removed.

    Args:
        before: A model.
        after: What is left of it.
        uses: What a tree serves.
        rules: For each rule of `after` its number in `before`; the same unless given.
    """
    order = [name for name in before.inputs if name in set(after.inputs)]
    if list(after.inputs) != order:
        yield f"its inputs are {', '.join(after.inputs)}"
    if kind_of(before) != kind_of(after):
        yield "the two are models of other kinds"
        return
    one: Any = before
    two: Any = after  # of the same kind
    if before.outputs:
        yield from _system_faults(one, two, rules)
        return
    yield from _head_faults(one, two)
    if before.rules:
        yield from _rule_faults(one, two, rules)
    else:
        yield from _tree_faults(one, two, uses)


def _head_faults(before: Model, after: Model) -> Iterator[str]:
    if before.classes != after.classes or before.semantics != after.semantics:
        yield "classes or semantics differ"


def unguarded(before: Document, after: Document) -> tuple[str, ...]:
    """Return the variables whose missing values only the first of two models sees.

    Where a combination stands, none of its inputs can be missing unseen: the weights
    are not 0, so the sum is not finite either.
    """
    earlier = {variable.parts for variable in after.variables if variable.parts}
    inputs = {v.name for v in after.variables if not v.parts}
    return tuple(
        variable.name
        for variable in before.variables
        if not (
            variable.name in inputs
            if not variable.parts
            else variable.parts in earlier
            or (
                cannot_overflow(variable.parts)
                and {part.input for part in variable.parts} <= inputs
            )
        )
    )


def _axes(model: Document) -> dict[str, str | tuple[Part, ...]]:
    """Return what each variable looks at: an input's name, or a chain of sums."""
    return {v.name: v.parts or v.name for v in model.variables}


def _system_faults(
    before: FuzzySystem, after: FuzzySystem, numbers: Collection[int]
) -> Iterator[str]:
    """Compare the steps of a system without what is gone with those of what is left.

    That nothing uses a variable that is gone, the system itself makes sure of.
    """
    kept = list(numbers) or list(range(1, len(before.rules) + 1))
    gone = {*range(1, len(before.rules) + 1)}.difference(kept, never_activated(before))
    yield from (f"rule {n} may be activated and is gone" for n in sorted(gone))
    whole = with_named_terms(with_rules(before, kept))
    names = {variable.name for variable in after.variables}
    variables = tuple(v for v in whole.variables if v.name in names)
    try:
        whole = replace(whole, variables=variables)
    except InvalidModelError as error:
        yield f"what is gone is used: {error}"
        return
    build = from_system.__wrapped__  # the cache takes -0.0 for 0.0
    programs = [build(one, activations=True) for one in (whole, after)]
    one, two = (curve_bytes((p.inputs, p.steps, p.results)) for p in programs)
    if one != two:
        yield "its program has other steps"


def _rule_faults(
    before: RuleBase, after: RuleBase, numbers: Collection[int]
) -> Iterator[str]:
    kept = list(numbers) or list(range(1, len(before.rules) + 1))
    dead = never_firing(before)
    gone = sorted({*range(1, len(before.rules) + 1)}.difference(kept))
    yield from (f"rule {n} may fire and is gone" for n in gone if n not in dead)
    if len(kept) != len(after.rules) or kept != sorted(set(kept)):
        yield f"{len(after.rules)} rules where {len(kept)} are right"
        return
    forms, others = _rule_forms(before), _rule_forms(after)
    for place, number in enumerate(kept):
        if forms[number - 1] != others[place]:
            yield f"rule {number} is another rule"


def _rule_forms(rules: RuleBase) -> list[object]:
    axes, shapes = _axes(rules), shapes_of(rules.variables)
    curves = {key: curve_bytes(shape) for key, shape in shapes.items()}
    is_min = rules.semantics.conjunction == "minimum"

    @functools.cache
    def form(proposition: Proposition) -> tuple[object, ...]:
        if always_holds(proposition, shapes):
            return ()
        met = frozenset(curves[proposition.variable, t] for t in proposition.terms)
        return axes[proposition.variable], proposition.negated, met

    forms: list[object] = []
    for rule in rules.rules:
        when = [result for proposition in rule.when if (result := form(proposition))]
        forms.append((rule.then, frozenset(when) if is_min else tuple(when)))
    return forms


def _tree_faults(
    before: FuzzyTree, after: FuzzyTree, uses: Collection[Use]
) -> Iterator[str]:
    if [leaf.label for leaf in before.leaves] != [leaf.label for leaf in after.leaves]:
        yield "its leaves have other classes"
    if len(before.nodes) != len(after.nodes):
        yield f"{len(after.nodes)} nodes where {len(before.nodes)} are right"
        return
    pairs = zip(_node_forms(before, uses), _node_forms(after, uses), strict=True)
    for number, (one, two) in enumerate(pairs, 1):
        if one != two:
            yield f"node {number} is another node"


def _node_forms(tree: FuzzyTree, uses: Collection[Use]) -> Iterator[object]:
    axes, terms = _axes(tree), shapes_of(tree.variables)
    sets = shapes_of(Variable(group.variable, group.terms) for group in tree.sets)
    for node in tree.nodes:
        ways: list[object] = []
        for branch in node.branches:
            curves = [(terms, name) for name in branch.terms if "relative" in uses]
            fitted = [(sets, name) for name in branch.sets if "raw" in uses]
            results = [
                frozenset(curve_bytes(known[node.variable, name]) for known, name in of)
                for of in (curves, fitted)
            ]
            ways.append((branch.node, branch.leaf, *results))
        yield axes[node.variable], node.cuts, node.owners, ways

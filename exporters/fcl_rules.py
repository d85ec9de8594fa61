"""Rules of FCL, what a dialect cannot express, and the data check list of a model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from msgspec.structs import replace

from fuzzytree.exporters.fcl_dialects import FclWords
from fuzzytree.exporters.fll_text import WordsOf, has_not, hedge_losses, rule_text
from fuzzytree.exporters.fuzzy_files import file_system, grid_losses
from fuzzytree.formats import (
    DEFUZZIFIERS,
    JFUZZYLOGIC_PAIRS,
    PAIRS,
    fuzzylite_losses,
)
from fuzzytree.model import (
    And,
    FuzzySystem,
    Loss,
    Or,
    Points,
    Proposition,
    RuleBase,
    RuleBlock,
    SNorm,
    SystemOutput,
    SystemRule,
    Term,
    condition_text,
    joints,
    questions,
    unlike,
)
from fuzzytree.semantics import EVERYWHERE, number_losses


def with_conditions(system: FuzzySystem, words: FclWords) -> FuzzySystem:
    """Return a system whose rules all have a condition.

    A rule without one tests the first input for a term of degree 1 everywhere.
    """
    rules = [rule for block in system.blocks for rule in block.rules]
    is_needed = any(rule.when is None for rule in rules)
    if words.has_hedges or not is_needed or not system.variables:
        return system
    first = system.variables[0]
    name = unlike("always", [label.name for label in first.terms])
    label = Term(name, EVERYWHERE)
    always = Proposition(first.name, (name,))
    return replace(
        system,
        variables=(replace(first, terms=(*first.terms, label)), *system.variables[1:]),
        blocks=tuple(
            replace(
                block,
                rules=tuple(
                    rule if rule.when is not None else replace(rule, when=always)
                    for rule in block.rules
                ),
            )
            for block in system.blocks
        ),
    )


def block_lines(
    block: RuleBlock,
    name: str,
    words: FclWords,
    words_of: WordsOf,
    always: str,
    accu: str,
) -> Iterator[str]:
    """Yield the lines of a block of rules."""
    yield f"RULEBLOCK {name}"
    yield from (f"  {line}" for line in _operators(block, words))
    if block.implication is not None and block.implication in words.acts:
        yield f"  ACT : {words.acts[block.implication]};"
    if accu:
        yield f"  ACCU : {accu};"
    for number, rule in enumerate(block.rules, 1):
        if words.joiner:
            yield f"  RULE {number} : {_text(rule, words, words_of, always)}"
            continue
        for one in rule.then:
            alone = replace(rule, then=(one,))
            yield f"  RULE {number} : {_text(alone, words, words_of, always)}"
    yield "END_RULEBLOCK"


def _operators(block: RuleBlock, words: FclWords) -> Iterator[str]:
    """Yield the lines for OR and AND: in this order, for the last one counts."""
    uses_or = any(Or in joints(rule.when) for rule in block.rules)
    uses_and = any(And in joints(rule.when) for rule in block.rules)
    # The standard has one line for both; others read OR, and then AND.
    says_or = uses_or if words.has_pair else True
    says_and = True
    if words.name == "iec":
        says_or, says_and = uses_or and not uses_and, uses_and or not uses_or
    if says_or and block.disjunction in words.ors and block.disjunction is not None:
        yield f"OR : {words.ors[block.disjunction]};"
    if says_and and block.conjunction in words.ands and block.conjunction is not None:
        yield f"AND : {words.ands[block.conjunction]};"


def _text(rule: SystemRule, words: FclWords, words_of: WordsOf, always: str) -> str:
    if words.has_hedges:
        return rule_text(rule, words_of, always)
    says = str.lower if words.is_lower else str.upper
    when = always
    if rule.when is not None:  # jFuzzyLogic reads AND and OR from left to right
        when = condition_text(
            rule.when,
            lambda one: _proposition(one, words_of, says),
            says,
            has_all_brackets=True,
        )
    then = words.joiner.join(
        _proposition(Proposition(one.output, (one.term,)), words_of, says)
        for one in rule.then
    )
    weight = "" if rule.weight == 1.0 else f"{says(' with ')}{float(rule.weight)!r}"
    return f"{says('if ')}{when}{says(' then ')}{then}{weight};"


def _proposition(
    one: Proposition, words_of: WordsOf, says: Callable[[str], str]
) -> str:
    name, term = words_of(one.variable, one.term)
    nots = one.hedges.count("not")
    text = f"{name}{says(' is not ' if nots else ' is ')}{term}"
    for _ in range(nots - 1):
        text = f"{says('not ')}({text})"
    return text


def rule_losses(system: FuzzySystem, words: FclWords) -> Iterator[Loss]:
    """Yield the parts of rules that the dialect has no words for."""
    rules = system.rules
    if words.has_hedges:
        yield from hedge_losses(rules)
        return
    outputs = {one.name for one in system.outputs}
    for number, rule in enumerate(rules, 1):
        hedges = {hedge for one in questions(rule.when) for hedge in one.hedges}
        unknown = sorted(hedges - {"not"})
        then = sorted({hedge for one in rule.then for hedge in one.hedges})
        if unknown or then:
            names = ", ".join(map(repr, [*unknown, *then]))
            what = f"the dialect {words.name} has no {names}: left out"
            yield Loss(f"rule {number}", what)
        tested = {one.variable for one in questions(rule.when)} & outputs
        if tested:
            names = ", ".join(map(repr, sorted(tested)))
            what = f"engines test the value of {names}, and not how far it is concluded"
            yield Loss(f"rule {number}", what)


def norm_losses(block: RuleBlock, number: int, words: FclWords) -> Iterator[str]:
    """Yield the operators of a block that the dialect has no words for."""
    where = f"rule block {number}"
    uses_and = any(And in joints(rule.when) for rule in block.rules)
    uses_or = any(Or in joints(rule.when) for rule in block.rules)
    if uses_and and block.conjunction not in words.ands:
        yield f"{where}: the dialect {words.name} has no AND {block.conjunction!r}"
    if uses_or and block.disjunction not in words.ors:
        yield f"{where}: the dialect {words.name} has no OR {block.disjunction!r}"
    propositions = [one for rule in block.rules for one in questions(rule.when)]
    if not words.has_hedges and any(one.term is None for one in propositions):
        yield f"{where}: the dialect {words.name} has no 'any'"
    if words.name == "portable" and any(
        one.hedges.count("not") > 1 for one in propositions
    ):
        yield f"{where}: the dialect portable has one 'not' in front of a term"
    if block.activation.method != "general":
        yield (
            f"{where}: FCL activates all rules, and not {block.activation.method!r} "
            "ones; a rule base can be written with scores=rule"
        )


def losses_of(system: FuzzySystem, words: FclWords) -> Iterator[Loss]:
    """Yield what outputs depend on and the dialect cannot express."""
    default = DEFUZZIFIERS[words.name]
    for one in system.variables:
        if one.clips:
            yield Loss(f"input {one.name!r}", "its values are not clamped to its range")
    for output in system.outputs:
        where = f"output {output.name!r}"
        whose = f"FCL does not say so; {words.name} takes"
        yield from grid_losses(output, default, whose)
        if output.clips and words.name != "fuzzylite":
            yield Loss(where, "its value is not clamped to its range")
        if words.name == "fuzzylite":
            yield from fuzzylite_losses(output)
        yield from _accu_losses(output, system, words)
    if has_accu(words):
        yield from number_losses(system)
    yield from rule_losses(system, words)
    for k, block in enumerate(system.blocks, 1):
        pairs = JFUZZYLOGIC_PAIRS if words.name == "jfuzzylogic" else PAIRS
        both = [
            any(kind in joints(rule.when) for rule in block.rules) for kind in (And, Or)
        ]
        norm = block.conjunction
        if not words.has_pair or not all(both) or norm is None:
            continue
        if pairs[norm] != block.disjunction:
            what = f"AND {norm!r} brings OR {pairs[norm]!r} with it, and not "
            yield Loss(f"rule block {k}", what + repr(block.disjunction))


def is_always_concluded(output: SystemOutput, system: FuzzySystem) -> bool:
    """Return whether some rule concludes an output for every row."""
    constants = {
        (one.name, label.name)
        for one in system.variables
        for label in one.terms
        if set(getattr(label.function, "degrees", ())) == {1.0}
    }
    for rule in system.rules:
        if rule.weight == 0.0 or output.name not in {one.output for one in rule.then}:
            continue
        propositions = list(questions(rule.when))
        if all(
            (one.variable, one.term) in constants or one.hedges == ("any",)
            for one in propositions
        ):
            return not any(one.hedges and one.term for one in propositions)
    return False


def _accu_losses(
    output: SystemOutput, system: FuzzySystem, words: FclWords
) -> Iterator[Loss]:
    """Yield the aggregation of an output that the dialect cannot express."""
    where = f"output {output.name!r}"
    norm, file_norm = output.aggregation, output.aggregation
    is_weighted = output.defuzzifier.is_weighted
    if has_accu(words):
        blocks = [
            {one.output for rule in block.rules for one in rule.then}
            for block in system.blocks
        ]
        result = [accu_of(system, one, words) for one in blocks if output.name in one]
        file_norm = next(filter(None, result), None)
        if file_norm == "sum" and is_weighted:
            file_norm = None
    elif is_weighted:
        file_norm = None
    curves = {one.name: one.function for one in output.terms}
    counts = Counter(
        curves[one.term]
        for rule in system.rules
        for one in rule.then
        if one.output == output.name
    )
    if is_weighted and max(counts.values(), default=0) < 2:
        return  # there is nothing to join
    if file_norm != norm and counts:
        meant = "summed one by one" if file_norm is None else f"joined by {file_norm!r}"
        wanted = "one by one" if norm is None else f"by {norm!r}"
        yield Loss(where, f"its conclusions are {meant}, and not {wanted}")
    elif norm is None and words.name == "iec":
        yield Loss(where, "the standard has no ACCU that sums; none is written")


def has_accu(words: FclWords) -> bool:
    """Return whether ACCU stands in blocks of rules, for all their outputs."""
    return words.name in ("iec", "jfuzzylogic")


def accu_of(system: FuzzySystem, outputs: set[str], words: FclWords) -> SNorm | None:
    """Return the ACCU of a block that concludes some outputs: that of the first."""
    for output in system.outputs:
        norm = output.aggregation
        if output.name in outputs and norm is not None and norm in words.accus:
            return norm
    return None


_MOST_BASIC, _MOST_EXTENDED = 3, 4  # points of a term


def check_list(model: RuleBase | FuzzySystem) -> str:
    """Return the data check list of IEC 61131-7 of a model, a fact to a line.

    The standard requires each vendor to state what a controller must be able to do for
    a model, and divides models into three classes: *Basic*, *Extension* and *Open*.

    A rule base is described as the system with a score for each rule that is written
    for it.

    Example:
        >>> from fuzzytree.semantics.samples import all_samples
        >>> system = all_samples()["Sugeno, numbers"]
        >>> print(check_list(system).splitlines()[0])
        data check list (IEC 61131-7)
    """
    system = file_system(model, 1e-6, always="term").system
    return "\n".join(_lines(system)) + "\n"


def _lines(system: FuzzySystem) -> Iterator[str]:
    variables = system.all_variables
    labels = [label for one in variables for label in one.terms]
    rules = system.rules
    yield "data check list (IEC 61131-7)"
    yield f"inputs: {len(system.variables)}"
    yield f"outputs: {len(system.outputs)}"
    yield f"terms of an input: {_span(len(one.terms) for one in system.variables)}"
    yield f"terms of an output: {_span(len(one.terms) for one in system.outputs)}"
    points = [
        len(one.function.values) for one in labels if isinstance(one.function, Points)
    ]
    yield f"points of a term: {_span(points)}"
    others = sorted({type(one.function).__name__ for one in labels} - {"Points"})
    yield f"other terms: {', '.join(others) or 'none'}"
    yield f"rule blocks: {len(system.blocks)}"
    yield f"rules: {len(rules)}"
    conditions = (len([*questions(rule.when)]) for rule in rules)
    yield f"conditions of a rule: {_span(conditions)}"
    yield f"conclusions of a rule: {_span(len(rule.then) for rule in rules)}"
    yield f"weighted rules: {sum(rule.weight != 1.0 for rule in rules)}"
    yield f"operators: {', '.join(_operator_names(system)) or 'none'}"
    methods = sorted({one.defuzzifier.method for one in system.outputs})
    yield f"methods: {', '.join(methods)}"
    names = [one.name for one in (*variables, *labels)]
    yield f"characters of a name: {_span(map(len, names))}"
    beyond_basic = list(_beyond_basic(system, labels))
    beyond_extension = list(_beyond_extension(system, labels))
    if beyond_extension:
        yield f"class: Open, for {_some(beyond_extension)}"
    elif beyond_basic:
        yield f"class: Extension, for {_some(beyond_basic)}"
    else:
        yield "class: Basic"


def _some(reasons: list[str]) -> str:
    return "; ".join(reasons[:3]) + ("; ..." if len(reasons) > 3 else "")


def _span(counts: Iterator[int] | list[int] | map[int]) -> str:
    result = list(counts)
    if not result:
        return "none"
    low, high = min(result), max(result)
    return str(low) if low == high else f"{low} to {high}"


def _operator_names(system: FuzzySystem) -> Iterator[str]:
    """Yield the operators that rules use, each once."""
    result: list[str] = []
    is_curved = any(not output.defuzzifier.is_weighted for output in system.outputs)
    for block in system.blocks:
        if any(And in joints(rule.when) for rule in block.rules):
            result.append(f"AND {block.conjunction}")
        if any(Or in joints(rule.when) for rule in block.rules):
            result.append(f"OR {block.disjunction}")
        if is_curved:
            result.append(f"ACT {block.implication}")
    result += [
        f"ACCU {output.aggregation}"
        for output in system.outputs
        if output.aggregation is not None
    ]
    yield from dict.fromkeys(result)


def _beyond_basic(system: FuzzySystem, labels: list[Term]) -> Iterator[str]:
    if any(_most_points(label) > _MOST_BASIC for label in labels):
        yield f"terms of more than {_MOST_BASIC} points"
    if any(not output.defuzzifier.is_weighted for output in system.outputs):
        yield "outputs with curves"
    for block in system.blocks:
        if block.conjunction not in (None, "minimum"):
            yield f"AND {block.conjunction}"
    if any(Or in joints(rule.when) or has_not(rule.when) for rule in system.rules):
        yield "OR or NOT"
    if any(len(rule.then) > 1 for rule in system.rules):
        yield "several conclusions of a rule"
    if any(rule.weight != 1.0 for rule in system.rules):
        yield "weighted rules"
    if any(output.aggregation != "maximum" for output in system.outputs):
        yield "numbers that are summed, and not joined by ACCU maximum"


def _beyond_extension(system: FuzzySystem, labels: list[Term]) -> Iterator[str]:
    if any(_most_points(label) > _MOST_EXTENDED for label in labels):
        yield f"terms of more than {_MOST_EXTENDED} points"
    degrees = {
        degree
        for label in labels
        if isinstance(label.function, Points)
        for degree in label.function.degrees
    }
    if degrees - {0.0, 1.0}:
        yield "points of degrees between 0 and 1"
    kinds = {type(label.function).__name__ for label in labels} - {
        "Points",
        "Singleton",
    }
    if kinds:
        yield f"terms that are no points ({', '.join(sorted(kinds))})"
    hedges = {
        hedge
        for rule in system.rules
        for question in questions(rule.when)
        for hedge in question.hedges
    }
    if hedges - {"not"}:
        yield "hedges"
    if any(one.parts for one in system.variables):
        yield "inputs that are combined"
    if any(output.defuzzifier.method == "weighted sum" for output in system.outputs):
        yield "weighted sums"


def _most_points(label: Term) -> int:
    return len(label.function.values) if isinstance(label.function, Points) else 0

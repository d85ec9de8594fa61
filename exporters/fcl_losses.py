"""What an answer depends on and a dialect of FCL cannot say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fuzzytree.exporters.fcl_dialects import Words
from fuzzytree.exporters.fcl_rules import rule_losses, uses
from fuzzytree.formats.fcl.fcl_dialects import DEFUZZIFIERS, JFUZZYLOGIC_PAIRS, PAIRS
from fuzzytree.formats.fll.fll_differences import fuzzylite_losses
from fuzzytree.model.contracts import Loss
from fuzzytree.model.system import And, FuzzySystem, Or, SNorm, SystemOutput, questions
from fuzzytree.semantics.conversion import number_losses


def losses_of(system: FuzzySystem, words: Words) -> Iterator[Loss]:
    """Yield what an answer depends on and the dialect cannot say."""
    default = DEFUZZIFIERS[words.name]
    for one in system.inputs:
        if one.clips:
            yield Loss(f"input {one.name!r}", "its values are not held in its range")
    for output in system.outputs:
        where = f"output {output.name!r}"
        how = output.defuzzifier
        if not how.is_weighted and (how.samples, how.grid) != (
            default.samples,
            default.grid,
        ):
            yield Loss(
                where,
                f"{how.samples} values of its range are looked at; FCL does not say "
                f"how many, {words.name} means {default.samples}",
            )
        if output.clips and words.name != "fuzzylite":
            yield Loss(where, "its answer is not held in its range")
        if not _says_nothing(output, words) and not _is_always_concluded(
            output, system
        ):
            yield Loss(where, "NaN where no rule fires: engines keep the value before")
        if words.name == "fuzzylite":
            yield from fuzzylite_losses(output)
        yield from _accu_losses(output, system, words)
    if has_accu(words):
        yield from number_losses(system)
    yield from rule_losses(system, words)
    for k, block in enumerate(system.blocks, 1):
        pairs = JFUZZYLOGIC_PAIRS if words.name == "jfuzzylogic" else PAIRS
        both = [
            any(uses(rule.when, kind) for rule in block.rules) for kind in (And, Or)
        ]
        norm = block.conjunction
        if not words.has_pair or not all(both) or norm is None:
            continue
        if pairs[norm] != block.disjunction:
            what = f"AND {norm!r} brings OR {pairs[norm]!r} with it, and not "
            yield Loss(f"rule block {k}", what + repr(block.disjunction))


def _says_nothing(output: SystemOutput, words: Words) -> bool:
    """Return whether a file can say what an output answers where no rule fires."""
    return output.default is not None or words.name == "fuzzylite"


def _is_always_concluded(output: SystemOutput, system: FuzzySystem) -> bool:
    """Return whether some rule concludes an output for every row."""
    constants = {
        (one.name, label.name)
        for one in system.inputs
        for label in one.labels
        if set(getattr(label.curve, "degrees", ())) == {1.0}
    }
    for rule in system.rules:
        if rule.weight == 0.0 or output.name not in {one.output for one in rule.then}:
            continue
        asked = list(questions(rule.when))
        if all(
            (one.variable, one.label) in constants or one.hedges == ("any",)
            for one in asked
        ):
            return not any(one.hedges and one.label for one in asked)
    return False


def _accu_losses(
    output: SystemOutput, system: FuzzySystem, words: Words
) -> Iterator[Loss]:
    """Yield what an output's aggregation means that the dialect cannot say."""
    where = f"output {output.name!r}"
    norm, said = output.aggregation, output.aggregation
    is_weighted = output.defuzzifier.is_weighted
    if has_accu(words):
        blocks = [
            {one.output for rule in block.rules for one in rule.then}
            for block in system.blocks
        ]
        found = [accu_of(system, one, words) for one in blocks if output.name in one]
        said = next(filter(None, found), None)
        if said == "sum" and is_weighted:
            said = None
    elif is_weighted:
        said = None
    curves = {one.name: one.curve for one in output.labels}
    counts = Counter(
        curves[one.label]
        for rule in system.rules
        for one in rule.then
        if one.output == output.name
    )
    if is_weighted and max(counts.values(), default=0) < 2:
        return  # there is nothing to join
    if said != norm and counts:
        meant = "summed one by one" if said is None else f"joined by {said!r}"
        wanted = "one by one" if norm is None else f"by {norm!r}"
        yield Loss(where, f"its conclusions are {meant}, and not {wanted}")
    elif norm is None and words.name == "iec":
        yield Loss(where, "the standard has no ACCU that sums; none is written")


def has_accu(words: Words) -> bool:
    """Return whether ACCU stands in blocks of rules, for all their outputs."""
    return words.name in ("iec", "jfuzzylogic")


def accu_of(system: FuzzySystem, outputs: set[str], words: Words) -> SNorm | None:
    """Return the ACCU of a block that concludes some outputs: that of the first."""
    for output in system.outputs:
        norm = output.aggregation
        if output.name in outputs and norm is not None and norm in words.accus:
            return norm
    return None

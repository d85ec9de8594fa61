"""A comparison of two models, checked again: its witnesses, and what is called alike.

Rules are alike if no solver finds a point at which the first of the strongest rules of
both are of different classes. Systems are alike if their files are, but for names,
units and notes. Whatever else is alike is not decided here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fuzzytree.rechecking.case import Case, class_at, values_of
from fuzzytree.rechecking.checks import (
    check_message,
    check_sample,
    check_source,
    decide,
)
from fuzzytree.rechecking.claims import Statement
from fuzzytree.rechecking.curves import Facts
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.outcomes import Report, UndecidedError, require
from fuzzytree.rechecking.records import (
    Answer,
    Bracket,
    Computed,
    Declined,
    Difference,
    Proved,
    Sampled,
    Witness,
    built,
    read_json,
)
from fuzzytree.rechecking.smt import Script, all_of, any_of

UNCHECKED = "the version, the hashes of the models' contents, the table, the changes"
Names = tuple[str, str, str]


def recheck_difference(
    diff: bytes, old: bytes, new: bytes, names: Names, solver: str = ""
) -> Report:
    """Check a comparison against the two models that it is of.

    `names`: what messages call the three.

    Raises:
        CannotRunError: If one of them cannot be read, or the solver fails.
    """
    facts: Difference = built(Difference, read_json(diff, names[0]), names[0])
    both = (Case(facts, Model(old, names[1])), Case(facts, Model(new, names[2])))
    report = Report(UNCHECKED, facts.answers)
    for model, case, content, name in zip(
        (facts.old, facts.new), both, (old, new), names[1:], strict=True
    ):
        report.expect(
            model.name == case.model.name, f"the name of {name} is another one"
        )
        check_source(report, model.file, content, name)
    is_changed = any(o.is_finding for o in facts.answers)
    breaks = any(o.grade == "breaking" for o in facts.changes)
    sure = [o for o in facts.answers if isinstance(o.state, Proved | Computed)]
    is_open = any(isinstance(o.state, Bracket | Declined) for o in facts.answers)
    is_equal = any(o.subject == "decisions" for o in sure) and not is_open
    verdict = "changed" if is_changed else "equal" if is_equal else "open"
    report.expect(facts.verdict == verdict, f"the verdict is {verdict}")
    is_ok = not is_changed and not breaks
    report.expect(facts.ok is is_ok, f"it is {'' if is_ok else 'not '}ok")
    for number, answer in enumerate(facts.answers, 1):
        with report.answer(number, answer):
            check_message(answer)
            report.counts["sentences written again"] += 1
            if isinstance(answer.state, Proved):
                _check_proof(both, report, answer, number, solver)
            else:
                _check_state(both, report, answer)
    return report


def _check_state(both: tuple[Case, Case], report: Report, answer: Answer) -> None:
    state = answer.state
    if isinstance(state, Sampled):
        check_sample(state)
    elif isinstance(state, Witness):
        _check_witness(both, state)
        report.counts["answers with a WITNESS, evaluated again"] += 1
    elif isinstance(state, Computed):
        report.counts["answers COMPUTED, not decided again"] += 1
    else:
        raise UndecidedError("what is open is not looked at here")


def _check_proof(
    both: tuple[Case, Case], report: Report, answer: Answer, number: int, solver: str
) -> None:
    if answer.subject != "decisions":
        raise UndecidedError("one output of several")
    if any(case.model.form == "system" for case in both):
        _same_systems(*(case.model for case in both))
        report.confirm(number, "recheck")
    else:
        script, claims = difference_claims(both, str(answer.facts.get("where", "")))
        decide(script, report, [(number, answer, claims)], solver)


def _check_witness(both: tuple[Case, Case], state: Witness) -> None:
    """Check that both models predict at a point what is claimed of them."""
    point = values_of(state.point)
    inputs = {name for case in both for name in case.inputs}
    require(point.keys() == inputs, "the point does not have a value of every input")
    require(all(case.is_within(point) for case in both), "it lies outside the domain")
    classes = {c.of: c.label for c in state.claims if c.kind == "decides"}
    if not classes:
        raise UndecidedError("numbers of outputs are not computed here")
    require(classes.keys() == {"old", "new"}, "it is not claimed what both predict")
    require(classes["old"] != classes["new"], "both predict the same")
    if any(case.model.form == "system" for case in both):
        raise UndecidedError("a system that stands for rules")
    predicted = [class_at(case.rules, point) for case in both]
    text = f"the models predict {predicted[0]!r} and {predicted[1]!r}"
    require(predicted == [classes["old"], classes["new"]], text)


# --- what is alike


def difference_claims(
    both: tuple[Case, Case], where: str
) -> tuple[Script, list[Statement]]:
    """Return the text of two models, and claims that they decide alike.

    `where`: empty if they do for any input, also outside of the domain.
    """
    script = Script()
    for case, of in zip(both, ("old ", "new "), strict=True):
        case.add_to(script, of, is_bounded=bool(where))
    if "missing" not in where:
        require(both[0].model.missing == both[1].model.missing, "of missing values")
    return script, [*_claims(script, both)]


def _claims(script: Script, both: tuple[Case, Case]) -> Iterator[Statement]:
    old, new = (
        [script.symbol(f"{of}{case.name(n)}") for n in case.numbers]
        for case, of in zip(both, ("old ", "new "), strict=True)
    )
    for is_strict in (True, False):
        wins = [
            [case.wins(n, symbols, is_strict=is_strict) for n in case.numbers]
            for case, symbols in zip(both, (old, new), strict=True)
        ]
        for n, way in enumerate(wins[0], 1):
            others = [
                wins[1][m - 1]
                for m in both[1].numbers
                if both[1].then(m) != both[0].then(n)
            ]
            if both[1].rules.uncovered != both[0].then(n) and not is_strict:
                others.append(all_of(f"(<= {own} 0.0)" for own in new))
            text = f"where old {both[0].name(n)} decides, no new rule decides otherwise"
            if is_strict:
                text += ", apart from exact ties"
            formula = all_of([way, any_of(others)])
            yield Statement(text, formula, is_sure=is_strict)
    bare = all_of(f"(<= {own} 0.0)" for own in old)
    others = [
        f"(> {new[m - 1]} 0.0)"
        for m in both[1].numbers
        if both[1].then(m) != both[0].rules.uncovered
    ]
    if both[0].rules.uncovered != both[1].rules.uncovered:
        others.append(all_of(f"(<= {own} 0.0)" for own in new))
    text = "where no old rule fires, no new rule decides otherwise"
    yield Statement(text, all_of([bare, any_of(others)]), is_sure=False)


def _same_systems(old: Model, new: Model) -> None:
    require(old.form == new.form, "one of them is no system")
    if _system_form(old.facts) != _system_form(new.facts):
        raise UndecidedError("systems that are not the same, one rule after the other")


def _system_form(top: Facts) -> list[Any]:
    """Return a system's file without what is for people only."""
    outputs = [_without(entry, "unit") for entry in top["outputs"]]
    inputs: list[Facts] = []
    for entry in top.get("variables", []):
        is_free = "outside" not in entry.get("range", {})
        terms = {"terms": sorted(entry.get("terms", []), key=repr)}
        inputs.append(_without(entry, "unit", *["range"] * is_free) | terms)
    if "'linear'" not in repr(outputs):  # whose weights are in the order of inputs
        inputs.sort(key=repr)
    blocks: list[Facts] = []
    for block in top["blocks"]:
        rules = [_without(rule, "name") for rule in block["rules"]]
        rules = [rule for rule in rules if rule.get("weight", 1)]
        blocks.append(_without(block, "name") | {"rules": rules})
    return [top["semantics"], inputs, outputs, blocks]


def _without(facts: Facts, *names: str) -> Facts:
    return {key: value for key, value in facts.items() if key not in names}

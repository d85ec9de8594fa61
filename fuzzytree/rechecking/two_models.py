"""A comparison of two models, checked again: its witnesses, and what is called alike.

Rules are alike if no solver finds a point at which the first of the strongest rules of
both are of different classes. Systems are alike if their files are, but for names,
units and notes. Whatever else is alike is not decided here.
"""

from __future__ import annotations

from typing import Any

from fuzzytree.rechecking.case import Case, class_at, values_of
from fuzzytree.rechecking.checks import (
    check_message,
    check_sample,
    check_source,
    decide,
)
from fuzzytree.rechecking.claims import Statement, agreement
from fuzzytree.rechecking.curves import Facts
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.outcomes import Report, UndecidedError, require
from fuzzytree.rechecking.records import (
    Bracket,
    Computed,
    Declined,
    Difference,
    Proved,
    Sampled,
    Witness,
    decode,
    read_json,
)
from fuzzytree.rechecking.smt import Script, all_of, any_of

UNCHECKED = "the version, the hashes of the models' contents, the table, the changes"


def recheck_difference(
    diff: bytes, old: bytes, new: bytes, names: tuple[str, str, str], solver: str = ""
) -> Report:
    """Check a comparison against the two models that it is of.

    Args:
        diff: The comparison.
        old: The file of one model.
        new: The file of the other one.
        names: What messages call the three.
        solver: The program that decides claims; the package z3 by default.

    Raises:
        CannotRunError: If one of them cannot be read, or the solver fails.
    """
    facts: Difference = decode(Difference, read_json(diff, names[0]), names[0])
    models = Model(old, names[1]), Model(new, names[2])
    for whole, of in zip(models, ("old ", "new "), strict=True):
        whole.put_before_names(of)
    both = Case(facts, models[0]), Case(facts, models[1])
    report = Report(UNCHECKED, facts.answers)
    decide(Script(), report, [], solver)  # which a program that is missing refuses
    for model, case, content, name in zip(
        (facts.old, facts.new), both, (old, new), names[1:], strict=True
    ):
        is_named = model.name == case.model.name
        report.expect(is_named, f"the name of {name} is another one")
        check_source(report, model.file, content, name)
    is_changed = any(o.is_finding for o in facts.answers)
    breaks = any(change.grade == "breaking" for change in facts.changes)
    sure = [o for o in facts.answers if isinstance(o.state, Proved | Computed)]
    is_open = any(isinstance(o.state, Bracket | Declined) for o in facts.answers)
    is_equal = any(o.subject == "decisions" for o in sure) and not is_open
    verdict = "changed" if is_changed else "equal" if is_equal else "open"
    report.expect(facts.verdict == verdict, f"the verdict is {verdict}")
    is_ok = not is_changed and not breaks
    report.expect(facts.ok is is_ok, f"it is {'' if is_ok else 'not '}ok")
    for place in range(len(facts.answers)):
        _check_answer(both, report, place, solver)
    return report


def _check_answer(
    both: tuple[Case, Case], report: Report, place: int, solver: str
) -> None:
    with report.answer(place) as answer:
        check_message(answer)
        state = answer.state
        if isinstance(state, Witness):
            _check_witness(both, state)
            report.counts["answers with a WITNESS, evaluated again"] += 1
        elif isinstance(state, Computed):
            report.counts["answers COMPUTED, not decided again"] += 1
        elif isinstance(state, Sampled):
            check_sample(state)
        elif not isinstance(state, Proved):
            raise UndecidedError("what is open is not looked at here")
        elif answer.subject != "decisions":
            raise UndecidedError("one output of several")
        elif any(case.model.form == "system" for case in both):
            _check_systems(*(case.model for case in both))
            report.confirm(place, "recheck")
        else:
            script = Script()
            claims = _claims(script, both, str(answer.facts.get("where", "")))
            decide(script, report, [(place, claims)], solver)


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
    old, new = (class_at(case.rules, point) for case in both)
    is_so = (old, new) == (classes["old"], classes["new"])
    require(is_so, f"the models predict {old!r} and {new!r}")


def _claims(script: Script, both: tuple[Case, Case], where: str) -> list[Statement]:
    """Add two models to a text, and return claims that they decide alike.

    `where`: empty if they do for any input, also outside of the domain.
    """
    for case in both:
        case.add_to(script, is_bounded=bool(where))
    if "missing" not in where:
        require(both[0].model.missing == both[1].model.missing, "of missing values")
    old, new = (
        (case, [script.symbol(case.name(n)) for n in case.numbers]) for case in both
    )
    claims = [
        agreement(old[0].name(n), n, old, new, is_strict=is_strict)
        for is_strict in (True, False)
        for n in old[0].numbers
    ]
    uncovered = both[0].rules.uncovered
    others = [f"(> {new[1][n - 1]} 0.0)" for n in new[0].numbers]
    others = [o for n, o in enumerate(others, 1) if new[0].then(n) != uncovered]
    silent_old, silent_new = (
        all_of(f"(<= {own} 0.0)" for own in symbols) for _, symbols in (old, new)
    )
    others += [silent_new] * (uncovered != both[1].rules.uncovered)
    text = "where no old rule fires, no new rule decides otherwise"
    formula = all_of([silent_old, any_of(others)])
    return [*claims, Statement(text, formula, is_sure=False)]


def _check_systems(old: Model, new: Model) -> None:
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

"""Systems are read, evaluated and decided again by the re-checker's own code."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from typing import Any, get_args

import msgspec
import pytest

from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import AuditSelection
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.auditing.recheck import CannotRunError, recheck
from fuzzytree.auditing.recheck.audit_records import Audit
from fuzzytree.auditing.recheck.enclosing import NORMS, bounds, hedged
from fuzzytree.auditing.recheck.head import digest_of, fingerprint
from fuzzytree.auditing.recheck.meaning import View
from fuzzytree.auditing.recheck.model_records import System
from fuzzytree.auditing.recheck.models import HEDGES, built, read_condition, read_file
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.errors import LossError
from fuzzytree.exporters import yaml
from fuzzytree.model import (
    And,
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    Is,
    Not,
    Or,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import fingerprint as our_fingerprint
from fuzzytree.semantics.inference import hedged as hedged_degree
from fuzzytree.semantics.inference import infer, s_norm, t_norm
from fuzzytree.semantics.inference.degrees import curve_degree
from fuzzytree.testing import random_system

CLOSE = 1e-12
"""How far a degree of ours in doubles may be from the true one."""


def systems(seeds: range) -> list[FuzzySystem]:
    """Return systems of every kind, without formulas."""
    found = [random_system(seed, formulas="none") for seed in seeds]
    return [one for one in found if "formula" not in str(one).lower()]


def read(system: FuzzySystem) -> System:
    """Return a system as the re-checker reads it."""
    found, _ = read_file(yaml.write(system).content, "system.yaml")
    assert isinstance(found, System)
    return found


def test_its_reading_of_a_system_is_ours() -> None:
    for seed in range(12):
        odd = random_system(seed, formulas="none", has_odd_names=True)
        for system in (odd, *systems(range(seed, seed + 1))):
            try:
                found = read(system)
            except LossError:
                continue
            assert fingerprint(found) == our_fingerprint(system)


def test_its_degrees_enclose_ours_on_every_curve() -> None:
    kinds: set[str] = set()
    for system in systems(range(12)):
        for mine, ours in zip(read(system).inputs, system.inputs, strict=True):
            low, high = ours.low or 0.0, ours.high or 1.0
            points = [low + (high - low) * k / 6 for k in range(-1, 8)]
            for one, label in zip(mine.terms, ours.terms, strict=True):
                kinds.add(str(label.function.__struct_config__.tag))
                for x in points:
                    least, most = bounds(one.function, Fraction(x))
                    degree = curve_degree(label.function, x)
                    assert 0 <= most - least < Fraction(1, 2**100)
                    assert least - CLOSE <= degree <= most + CLOSE, (label, x)
    assert len(kinds) > 15


def test_its_norms_and_hedges_are_ours() -> None:
    degrees = [0.0, 0.125, 0.5, 0.875, 1.0]
    for name, norm in NORMS.items():
        for a in degrees:
            for b in degrees:
                mine = float(norm(Fraction(a), Fraction(b)))
                known: Any = t_norm if name in get_args(TNorm) else s_norm
                assert math.isclose(mine, known(name, a, b), abs_tol=CLOSE), name
    for hedge in HEDGES:
        for degree in degrees:
            low, high = hedged(hedge, (Fraction(degree), Fraction(degree)))
            ours = hedged_degree([hedge], degree)  # type: ignore[list-item] # of the same
            assert low - CLOSE <= ours <= high + CLOSE, hedge


def test_sentences_are_read_as_conditions() -> None:
    found = read_condition('a is very-very b or not (c is any) and "is it" is d')
    assert str(found) == (
        "Or(parts=(Is(variable='a', label='b', hedges=('very very',)), "
        "And(parts=(Not(part=Is(variable='c', label=None, hedges=('any',))), "
        "Is(variable='is it', label='d', hedges=())))))"
    )
    for text in ("a is", "a is b and", "(a is b", "a is b)", "not a is b", "a b", '"a'):
        with pytest.raises(ValueError, match=r"missing|more|closed"):
            read_condition(text)
    with pytest.raises(ValueError, match="levels"):
        read_condition("(" * 400 + "a is b" + ")" * 400)


LEFT, RIGHT = Trapezoid(None, 0.0, 1.0, 3.0), Trapezoid(1.0, 3.0, 4.0, None)
TIP = SystemOutput(
    "tip",
    (Term("small", Singleton(1.0)), Term("large", Singleton(2.0))),
    None,
    None,
    Defuzzifier("weighted average"),
)
INPUTS = tuple(
    Variable(name, (Term("left", LEFT), Term("right", RIGHT)), low=0.0, high=4.0)
    for name in ("x", "y")
)


def rule(condition: Any, label: str = "small") -> SystemRule:
    """Return a rule that concludes a tip."""
    return SystemRule(condition, (Conclusion("tip", label),))


def system(*rules: SystemRule) -> FuzzySystem:
    """Return a system of one block."""
    return FuzzySystem("tipper", INPUTS, (TIP,), (RuleBlock(rules),))


SMALL = system(
    rule(And((Is("x", "left"), Or((Is("x", "right"), Is("y", "right")))))),
    rule(Not(And((Is("x", "left"), Is("y", "left")))), "large"),
    rule(Is("x", "left", ("very",)), "large"),
    rule(Is("y", None, ("not", "any"))),
)


def audited(model: FuzzySystem, **options: Any) -> tuple[bytes, bytes]:
    """Return the audit of a system and the file that it is of."""
    content = yaml.write(model).content
    file = model_file("tipper.yaml", content)
    wanted = AuditSelection(
        select=options.pop("select", ()), ignore=options.pop("ignore", ["FT6", "FT7"])
    )
    material = Material(model, file, options.pop("rows", None))
    found = audit(material, selection=wanted, **options)
    return msgspec.json.encode(found), content


def wrong_of(facts: dict[str, Any], content: bytes) -> list[str]:
    """Return what does not hold of facts, once their digest is made again."""
    facts["digest"] = digest_of(facts)
    try:
        return recheck(json.dumps(facts).encode(), content, ("a.json", "m.yaml")).wrong
    except CannotRunError as error:
        return [str(error)]


def test_the_audit_of_a_system_holds() -> None:
    found = recheck(*audited(SMALL), ("a.json", "m.yaml"))
    assert found.wrong == []
    assert found.counts["answers with a WITNESS, evaluated again"] > 2
    assert found.counts["answers PROVED, decided again"] > 3


def test_the_ways_of_a_rule_are_numbered_as_the_audit_numbers_them() -> None:
    facts, content = audited(SMALL)
    whole, _ = read_file(content, "m.yaml")
    assert isinstance(whole, System)
    view = View(whole, built(Audit, json.loads(facts), "a.json"))
    assert view.names[:4] == [
        *(f"way {n} of rule 1" for n in (1, 2)),
        *(f"way {n} of rule 2" for n in (1, 2)),
    ]
    assert view.silent == ["rule 4"]


@pytest.mark.heavy
def test_strengths_of_a_system_are_those_of_its_inference() -> None:
    checked = 0
    for one in systems(range(8)):
        whole = read(one)
        blank = json.loads(audited(SMALL)[0]) | {"answers": []}
        view = View(whole, built(Audit, blank, "a.json"))
        row = {
            c.name: 0.75 * (c.low or 0.0) + 0.25 * (1.0 if c.high is None else c.high)
            for c in one.inputs
            if not c.parts
        }
        values = {v.name: Fraction(row[v.name]) for v in whole.inputs if v.name in row}
        ours = infer(one, row)
        for owner in dict.fromkeys(view.owners):
            strength = ours.activations[owner.number]
            is_all = owner.block.activation.method != "proportional"
            if not (strength and is_all):
                continue  # not activated
            try:
                low, high = view.condition(owner.when, owner.block, values)
            except (UndecidedError, KeyError):
                continue  # an output, or a combination
            checked += 1
            assert owner.weight * low - CLOSE <= strength <= owner.weight * high + CLOSE
    assert checked > 9


@pytest.mark.heavy
def test_edits_of_a_system_audit_are_reported() -> None:
    text, content = audited(SMALL)
    for number, answer in enumerate(json.loads(text)["answers"]):
        if answer["state"]["state"] != "WITNESS":
            continue
        facts = json.loads(text)
        claim = facts["answers"][number]["state"]["claims"][0]
        claim["rules"] = [4 if one != 4 else 2 for one in claim["rules"]]
        assert wrong_of(facts, content), answer["subject"]
    facts = json.loads(text)
    facts["domain"]["sides"][0]["high"] = 3.0
    assert wrong_of(facts, content)


def test_a_rule_that_is_left_out_without_need_is_reported() -> None:
    text, content = audited(system(*SMALL.blocks[0].rules[:2]))
    facts = json.loads(text)
    reason = "its weight of 0.5 has no exact method"
    left_out = {
        "code": "FTD07",
        "subject": "rule 1",
        "state": {"state": "DECLINED", "code": "FTD07", "reason": reason},
        "is_finding": False,
        "severity": "info",
        "rules": [],
        "terms": [],
        "region": [],
        "measures": [],
        "places": [],
    }
    facts["answers"].append(facts["answers"][-1] | left_out)
    assert wrong_of(facts, content) == ["rule 1 is left out, and can be audited"]

"""Structured Text as text; `tests/interop/test_structured_text.py` runs it."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.exporters.st_text import LONG, RESERVED, SINGLE, identifiers, remark
from fuzzytree.exporters.structured_text import write
from fuzzytree.model.rulebase import (
    Band,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
    fingerprint,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree


def grip() -> RuleBase:
    low = Term("low", Band(high=1.0, right=3.0))
    rules = (Rule((Proposition("grip force", ("low",)),), "soft"), Rule((), "hard"))
    inputs = (Variable("grip force", (low,), unit="N"),)
    return RuleBase(
        "grip", ("soft", "hard"), inputs, rules, Semantics("minimum", "hard")
    )


def test_a_small_rule_base_as_one_reads_it() -> None:
    written = write(grip())
    assert written.remarks == ("'grip force' is called grip_force",)
    text = written.content.decode("ascii")
    # What the steps of a rule compute is seen where they are run.
    text = re.sub(r"(    [vb]\d+ : (LREAL|BOOL);\n)+", "    ...\n", text)
    steps = r"(?<=THEN soft \*\)\n).*?(?=    \(\* 2)"
    text = re.sub(steps, "    ...\n", text, flags=re.DOTALL)
    assert (
        text
        == f"""\
(* Written by fuzzytree: grip *)
(* Fingerprint: {fingerprint(grip())} *)
(* Input grip_force (LREAL): grip force (N) *)
(* Output class_number (INT): -1: no class; 0: soft; 1: hard *)
(* Output rule (DINT): number of the rule, 0: none *)
(* Output status (INT): 0: decided, 1: tie, 2: no rule fires, 3: missing *)
(* Output strengths (ARRAY [1..2] OF LREAL): firing strength of each rule *)
(* Nothing is kept from one call to the next. *)
FUNCTION_BLOCK grip
VAR_INPUT
    grip_force : LREAL; (* grip force (N) *)
END_VAR
VAR_OUTPUT
    class_number : INT; (* -1: no class *)
        (* 0: soft *)
        (* 1: hard *)
    rule : DINT; (* number of the rule, 0: none *)
    status : INT; (* 0: decided, 1: tie, 2: no rule fires, 3: missing *)
    strengths : ARRAY [1..2] OF LREAL; (* firing strength of each rule *)
END_VAR
VAR CONSTANT
    rule_class : ARRAY [0..1] OF INT := [ (* places of the rules' classes *)
        0, 1
    ];
END_VAR
VAR
    is_known : BOOL;
    k : DINT;
    ...
END_VAR

is_known := TRUE;
IF NOT (grip_force = grip_force) THEN is_known := FALSE; END_IF;
IF is_known THEN
    IF ABS(grip_force) > LREAL#1.7976931348623157E308 THEN is_known := FALSE; END_IF;
END_IF;
IF NOT is_known THEN
    class_number := -1;
    rule := 0;
    status := 3;
    FOR k := 1 TO 2 DO
        strengths[k] := LREAL#0.0;
    END_FOR;
ELSE
    (* 1. IF grip force is low THEN soft *)
    ...
    (* 2. ALWAYS hard *)
    strengths[2] := LREAL#1.0;
    rule := 1;
    status := 0;
    FOR k := 2 TO 2 DO
        IF strengths[k] > strengths[rule] THEN
            rule := k;
            status := 0;
        ELSIF strengths[k] = strengths[rule] THEN
            status := 1;
        END_IF;
    END_FOR;
    class_number := rule_class[rule - 1];
    IF strengths[rule] = LREAL#0.0 THEN
        rule := 0;
        status := 2;
        class_number := 1;
    END_IF;
END_IF;
END_FUNCTION_BLOCK
"""
    )


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("a *) b (* c", "a * ) b ( * c"),
        ("(*)", "( * )"),
        ("é\n", r"\xe9\n"),
        ("/* */", "/ * * /"),
    ],
)
def test_text_in_a_comment_cannot_end_it(text: str, made: str) -> None:
    assert remark(text) == made


def test_names_are_unlike_in_any_case_and_no_words_of_the_language() -> None:
    given = ["x", "X", "force", "FORCE", "if", "End_If", "a__b", "_a", "a_", "1st", "é"]
    names = identifiers([*given, "y" * 99, "y" * 99 + "z"], ["v1"]).accepted
    assert len({name.casefold() for name in names.values()}) == len(given) + 2
    for name in names.values():
        assert re.fullmatch(r"[A-Za-z]([A-Za-z0-9]|_(?=[A-Za-z0-9]))*", name)
        assert name.upper() not in RESERVED
        assert len(name) <= 30


def test_numbers_keep_every_bit_and_have_a_point() -> None:
    for value in (0.1, -0.0, 5e-324, 1e22, 1.7976931348623157e308, 1 / 3):
        text = LONG.digits(value)
        assert float(text) == value
        assert math.copysign(1.0, float(text)) == math.copysign(1.0, value)
        assert "." in text
    assert np.float32(SINGLE.digits(float(np.float32(0.1)))) == np.float32(0.1)


def test_a_number_of_real_is_never_infinite_and_zero_only_for_zero() -> None:
    assert SINGLE.nearest(1e300) == SINGLE.largest
    assert SINGLE.nearest(1e-300) > 0.0
    assert SINGLE.nearest(0.0) == 0.0


def test_a_cut_of_real_is_the_largest_one_up_to_the_cut() -> None:
    for cut in (0.1, -0.1, 1 / 3, 1e300, -1e300, 5e-324, -5e-324, 0.0, 16777217.0):
        found = SINGLE.at_most(cut)
        with np.errstate(over="ignore"):
            above = float(np.nextafter(np.float32(found), np.float32(np.inf)))
        assert found <= max(cut, -SINGLE.largest)
        assert above > cut or cut < -SINGLE.largest


def test_a_deep_tree_has_a_loop_as_long_as_its_longest_path() -> None:
    nodes: list[Node] = []
    terms: list[Term] = []
    length = 700
    for number in range(1, length + 1):
        cut = float(number)
        terms += [Term(f"to {cut}", Band(high=cut)), Term(f"from {cut}", Band(low=cut))]
        last = number == length
        ends = (None, number + 1) if last else (number + 1, None)
        branches = (
            Branch((f"to {cut}",), leaf=number),
            Branch((f"from {cut}",), node=ends[0], leaf=ends[1]),
        )
        nodes.append(Node("x", (cut,), (0, 1), branches))
    leaves = tuple(Leaf("a") for _ in range(length + 1))
    variable = Variable("x", tuple(terms))
    tree = FuzzyTree("deep", ("a",), (variable,), tuple(nodes), leaves)
    text = write(tree).content.decode()
    assert "    FOR level := 1 TO 700 DO\n" in text
    assert "    x_2 : LREAL; (* x *)\n" in text


def test_a_name_can_be_given_to_the_function_block() -> None:
    assert b"\nFUNCTION_BLOCK FB_Grip\n" in write(grip(), name="FB_Grip").content
    assert write(grip(), name="IF").remarks[0] == "'IF' is called IF_2"


def test_a_project_of_plcopen_holds_one_block_as_one_reads_it() -> None:
    constant = RuleBase("on", ("x]]>",), (), (Rule((), "x]]>"),))
    text = write(constant, layout="plcopen").content.decode("ascii")
    start = text.index('      <pou name="on')
    # What follows the inputs and outputs is compared with the block's own text.
    shown = text[start : text.index("          <localVars")]
    assert (
        shown
        == """\
      <pou name="on_2" pouType="functionBlock">
        <interface>
          <outputVars>
            <variable name="class_number">
              <type>
                <INT/>
              </type>
              <documentation>
                <xhtml:p>-1: no class
0: x]]&gt;</xhtml:p>
              </documentation>
            </variable>
            <variable name="rule">
              <type>
                <DINT/>
              </type>
              <documentation>
                <xhtml:p>number of the rule, 0: none</xhtml:p>
              </documentation>
            </variable>
            <variable name="status">
              <type>
                <INT/>
              </type>
              <documentation>
                <xhtml:p>0: decided, 1: tie, 2: no rule fires, 3: missing</xhtml:p>
              </documentation>
            </variable>
            <variable name="strengths">
              <type>
                <array>
                  <dimension lower="1" upper="1"/>
                  <baseType>
                    <LREAL/>
                  </baseType>
                </array>
              </type>
              <documentation>
                <xhtml:p>firing strength of each rule</xhtml:p>
              </documentation>
            </variable>
          </outputVars>
"""
    )
    assert f"Fingerprint: {fingerprint(constant)} Options: layout=plcopen\n" in text


def test_nothing_is_lost_and_the_same_model_gives_the_same_bytes() -> None:
    rules = rules_from_tree(random_tree(3))
    assert write(rules).losses == ()
    assert write(rules) == write(rules_from_tree(random_tree(3)))
    assert b"LREAL" not in write(rules, dtype="float32").content


def test_a_system_has_its_outputs_and_reports_whether_they_are_numbers() -> None:
    system = all_samples()["Sugeno, numbers"]
    written = write(system)
    text = written.content.decode("ascii")
    outputs = text[text.index("VAR_OUTPUT") : text.index("\nVAR\n")]
    assert outputs == (
        "VAR_OUTPUT\n"
        "    fan : LREAL; (* fan *)\n"
        "    is_number : ARRAY [1..1] OF BOOL; (* whether each output has a number *)\n"
        "    status : INT; (* 0: decided, 2: an output has no number of its own, "
        "3: missing *)\n"
        "END_VAR"
    )
    assert written.remarks[0] == "'fan' is called fan_2"
    assert written.remarks[-1] == (
        "an output without a number is 0 and its `is_number` is FALSE"
    )


def test_a_system_that_needs_what_the_language_has_not_is_refused() -> None:
    with pytest.raises(LossError) as caught:
        write(all_samples()["Sugeno, formulas"], allow_loss=True)
    assert str(caught.value) == (
        "cannot write fan as structured-text: "
        "it needs a division or a power ('slow' of 'fan')"
    )

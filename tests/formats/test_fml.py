"""Reading FML: shapes, modifiers, circular terms, and every mistake at its place."""

from __future__ import annotations

import math
import re

import pytest

from fuzzytree.errors import ReadError
from fuzzytree.exporters.fml import write
from fuzzytree.formats.fml.fml_reader import read_fml
from fuzzytree.formats.fml.fml_words import FML_FAR, USUAL
from fuzzytree.model import (
    And,
    Condition,
    Curve,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Linear,
    Not,
    Or,
    PiCurve,
    Points,
    Proposition,
    SCurve,
    Singleton,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.samples import all_samples
from tests.work import at_most

TIPPER = """\
<?xml version="1.0" encoding="UTF-8"?>
<fuzzySystem xmlns="http://www.ieee1855.org" name="tipper">
  <knowledgeBase>
    <fuzzyVariable name="food" domainleft="0" domainright="10" scale="points">
      <fuzzyTerm name="bad"><leftLinearShape param1="2" param2="4"/></fuzzyTerm>
      <fuzzyTerm name="good" complement="true"
        ><leftLinearShape param1="5" param2="9"/></fuzzyTerm>
      <fuzzyTerm name="either"><circularDefinition>
        <or><termName>bad</termName><termName complement="true">good</termName></or>
      </circularDefinition></fuzzyTerm>
    </fuzzyVariable>
    <fuzzyVariable name="service" domainleft="0" domainright="10" type="input">
      <fuzzyTerm name="slow"><gaussianShape param1="0" param2="2"/></fuzzyTerm>
    </fuzzyVariable>
    <tskVariable name="tip" type="output" combination="WA" defaultValue="3">
      <tskTerm name="small" order="0"><tskValue>5</tskValue></tskTerm>
      <tskTerm name="fair" order="1">
        <tskValue>2</tskValue><tskValue>1</tskValue><tskValue>0.5</tskValue>
      </tskTerm>
    </tskVariable>
  </knowledgeBase>
  <tskRuleBase name="rules" andMethod="PROD" orMethod="MAX">
    <tskRule name="r1" connector="and" weight="0.5">
      <antecedent>
        <clause modifier="very"><variable>food</variable><term>bad</term></clause>
        <clause><variable>service</variable><term>slow</term></clause>
      </antecedent>
      <tskConsequent><tskThen>
        <tskClause><variable>tip</variable><term>small</term></tskClause>
      </tskThen></tskConsequent>
    </tskRule>
    <tskRule name="r2" connector="or" andMethod="MIN">
      <antecedent>
        <clause><variable>food</variable><term>either</term></clause>
        <clause modifier="not"><variable>food</variable><term>good</term></clause>
      </antecedent>
      <tskConsequent><tskThen>
        <tskClause><variable>tip</variable><term>fair</term></tskClause>
      </tskThen></tskConsequent>
    </tskRule>
  </tskRuleBase>
</fuzzySystem>
"""


def read(text: str) -> FuzzySystem:
    model = read_fml(text.encode(), "tip.xml").model
    assert isinstance(model, FuzzySystem)
    return model


def test_a_sugeno_system_is_read_whole() -> None:
    system = read(TIPPER)
    assert system.inputs == ("food", "service")
    assert system.variables[0].unit == "points"
    assert [label.name for label in system.variables[0].terms] == ["bad", "good"]
    (output,) = system.outputs
    assert output.default == 3.0
    assert output.terms[0].function == Singleton(5.0)
    assert output.terms[1].function == Linear((1.0, 0.5), 2.0)
    first, second = system.blocks
    assert (first.conjunction, second.conjunction) == ("product", "minimum")
    assert first.rules[0].when == And(
        (Proposition("food", ("bad",), ("very",)), Proposition("service", ("slow",)))
    )
    assert first.rules[0].weight == 0.5
    either: Condition = Or(
        (Proposition("food", ("bad",)), Proposition("food", ("good",), ("not", "not")))
    )
    assert second.rules[0].when == Or(
        (either, Proposition("food", ("good",), ("not", "not")))
    )
    (tip,) = infer(system, {"food": 0.0, "service": 0.0}).outputs
    assert tip == pytest.approx((0.5 * 5.0 + 1.0 * 2.0) / 1.5)


@pytest.mark.parametrize(
    ("shape", "curve"),
    [
        ("rightLinearShape 1 2", Points((1.0, 2.0), (0.0, 1.0))),
        ("leftLinearShape 1 2", Points((1.0, 2.0), (1.0, 0.0))),
        ("piShape 1 3", PiCurve(1.0, 3.0, 3.0, 5.0)),
        ("triangularShape 1 2 4", Trapezoid(1.0, 2.0, 2.0, 4.0)),
        ("trapezoidShape 1 2 4 5", Trapezoid(1.0, 2.0, 4.0, 5.0)),
        ("gaussianShape 1 2", Gaussian(1.0, 2.0)),
        ("rightGaussianShape 1 2", TwoGaussians(1.0, 2.0, FML_FAR, 1.0)),
        ("leftGaussianShape 1 2", TwoGaussians(-FML_FAR, 1.0, 1.0, 2.0)),
        ("singletonShape 1", Singleton(1.0)),
        ("rectangularShape 1 2", Trapezoid(1.0, 1.0, 2.0, 2.0)),
        ("zShape 1 2", SCurve(2.0, 1.0)),
        ("sShape 1 2", SCurve(1.0, 2.0)),
        ("zShape 2 1", Points((2.0, 2.0), (1.0, 0.0))),
        ("zShape 2 2", Points((2.0, 2.0), (1.0, 0.0))),
        ("sShape 2 1", Points((2.0, 2.0), (0.0, 1.0))),
        ("rightLinearShape 2 1", Points((2.0, 2.0), (0.0, 1.0))),
        ("leftLinearShape 2 1", Points((2.0, 2.0), (1.0, 0.0))),
    ],
)
def test_every_shape(shape: str, curve: Curve) -> None:
    name, *numbers = shape.split()
    given = " ".join(f'param{k}="{n}"' for k, n in enumerate(numbers, 1))
    old = '<gaussianShape param1="0" param2="2"/>'
    system = read(TIPPER.replace(old, f"<{name} {given}/>"))
    assert system.variables[1].terms[0].function == curve


def points(method: str) -> str:
    old = '<gaussianShape param1="0" param2="2"/>'
    new = f'<pointSetShape interpolationMethod="{method}"><point x="1" y="0.5"/>'
    return TIPPER.replace(old, f'{new}<point x="2" y="1"/></pointSetShape>')


def test_points_are_joined_by_lines_and_other_ways_are_a_loss() -> None:
    curve = Points((1.0, 2.0), (0.5, 1.0))
    assert read(points("linear")).variables[1].terms[0].function == curve
    found = read_fml(points("spline").encode(), "tip.xml")
    assert [loss.what for loss in found.losses] == [
        "points joined by spline are joined by lines here"
    ]


@pytest.mark.parametrize(
    ("modifier", "hedges"),
    [
        ("extremely", ("cubed",)),
        ("intensify", ("extremely",)),
        ("more_or_less", ("cube root",)),
        ("not", ("not",)),
    ],
)
def test_modifiers_have_their_meaning(modifier: str, hedges: tuple[str, ...]) -> None:
    system = read(TIPPER.replace('"very"', f'"{modifier}"'))
    when = system.blocks[0].rules[0].when
    assert isinstance(when, And)
    assert when.parts[0] == Proposition("food", ("bad",), hedges)  # type: ignore[arg-type]


@pytest.mark.parametrize("modifier", ["above", "below", "norm", "slightly", "custom_a"])
def test_modifiers_without_a_meaning_here_are_a_loss(modifier: str) -> None:
    text = TIPPER.replace('"very"', f'"{modifier}"')
    (loss,) = read_fml(text.encode(), "tip.xml").losses
    assert loss.what == (
        f"the modifier {modifier!r} has no meaning here and is left out"
    )


def mamdani() -> str:
    text = TIPPER.replace("tskVariable", "fuzzyVariable").replace(
        'combination="WA"', 'domainleft="0" domainright="30" defuzzifier="LM"'
    )
    start, _, rest = text.partition('      <tskTerm name="small"')
    _, _, rest = rest.partition("</tskTerm>\n    </")
    term = '<fuzzyTerm name="{}"><triangularShape param1="0" param2="1" param3="2"/>'
    terms = "".join(f"{term.format(name)}</fuzzyTerm>" for name in ("small", "fair"))
    text = f"{start}{terms}</{rest}"
    for old, new in (("tskR", "r"), ("tskC", "c"), ("tskT", "t")):
        text = text.replace(old, new)
    return text.replace("ruleBase", "mamdaniRuleBase")


def test_a_mamdani_system_has_its_defuzzifier_and_accumulation() -> None:
    system = read(mamdani())
    (output,) = system.outputs
    how = Defuzzifier("smallest of maximum", USUAL.samples, USUAL.grid)
    assert output.defuzzifier == how
    assert output.aggregation == "maximum"
    assert {block.implication for block in system.blocks} == {"minimum"}


def test_a_modifier_of_a_conclusion_and_an_else_are_losses() -> None:
    text = mamdani().replace("</then>", "</then><else><clause/></else>", 1)
    clause = "<clause><variable>tip</variable>"
    text = text.replace(clause, clause.replace(">", ' modifier="very">', 1), 1)
    losses = read_fml(text.encode(), "tip.xml").losses
    assert [loss.what for loss in losses] == [
        "its else is left out",
        "the modifier 'very' of a conclusion is left out",
    ]


def test_operators_are_read_in_any_case() -> None:
    text = TIPPER
    for word in ("PROD", "MAX", "MIN", "WA"):
        text = text.replace(f'"{word}"', f'"{word.lower()}"')
    assert text != TIPPER
    assert read(text) == read(TIPPER)
    system = all_samples()["Mamdani, mean of maximum"]
    assert isinstance(system, FuzzySystem)
    written = write(system, allow_loss=True).content.decode()
    keys = "(andMethod|orMethod|activationMethod|accumulation|defuzzifier)"
    lower = re.sub(f'{keys}="[A-Z]+"', lambda found: _lowered(found[0]), written)
    assert lower.count("mom") == 1
    assert read(lower) == read(written)


def _lowered(text: str) -> str:
    key, _, word = text.partition("=")
    return f"{key}={word.lower()}"


def test_a_term_made_of_others_settles_the_norm_that_its_rule_leaves_open() -> None:
    text = TIPPER.replace("<or><t", '<or t-conorm="probor"><t')
    text = text.replace('connector="or" and', 'connector="and" and')
    first, second = read(text).blocks
    assert (first.disjunction, second.disjunction) == ("maximum", "algebraic sum")
    row = {"food": 3.0, "service": 0.0}
    (tip,) = infer(read(text.replace('"r1"', '"r1" andMethod="MIN"')), row).outputs
    assert math.isfinite(tip)


def test_a_complement_of_a_circular_term_is_a_not() -> None:
    text = TIPPER.replace('"either"', '"either" complement="true"')
    when = read(text).blocks[1].rules[0].when
    assert isinstance(when, Or)
    assert isinstance(when.parts[0], Not)


MISTAKES = [
    (("</fuzzySystem>", ""), "43:1: no well-formed XML: no element found"),
    (("<fuzzySystem x", "<!DOCTYPE a><fuzzySystem x"), "2:12: a document type (DOC"),
    (("gaussianShape", "gaussShape"), "13:30: term 'slow' of 'service': no shape"),
    (('param2="2"/></f', '/></f'), "13:30: <gaussianShape> needs the attribute param2"),
    (('param2="2"/></f', 'param2="0x2"/></f'), "13:30: param2 of <gaussianShape> must"),
    (('param2="2"/></f', 'param2="0"/></f'), "13:30: term 'slow' of 'service': the"),
    (('name="service"', 'name="food"'), "12:5: variable 'food' stands twice"),
    (("<term>small<", "<term>smal<"), "29:44: 'tip' has no term 'smal'"),
    (("<variable>service<", "<variable>servce<"), "26:17: no variable 'servce'"),
    (('andMethod="PROD"', 'andMethod="PRODUCT"'), "22:3: no andMethod 'PRODUCT'"),
    (('connector="or"', 'connector="xor"'), "32:5: the connector is and or or, not"),
    (('weight="0.5"', 'weight="1.5"'), "23:5: the weight must lie in [0, 1], not 1.5"),
    (('order="1"', 'order="2"'), "17:7: the order of 'fair' is 0 or 1, not '2'"),
    (("<tskValue>1</tskValue>", ""), "17:7: 'fair' of order 1 needs 3 <tskValue>"),
    (('"very"', '"veri"'), "25:9: no modifier 'veri'; there is any, not, very"),
    (("<termName>bad", "<termName>either"), "8:32: the term 'either' is made of too"),
    (('<or><t', '<or t-conorm="ESUM"><t'), "9:9: one rule cannot join by einstein su"),
    (("<knowledgeBase>", "<knowledgeBase><anYaDataCloud/>"), "3:18: <anYaDataCloud>"),
    (("<term>small<", "<term>bad<"), "29:44: 'tip' has no term 'bad'"),
    (('domainleft="0"', 'domainleft="20"'), "4:5: the range of 'food' starts at 20.0"),
    (("</tskThen>", "<x/></tskThe>"), "30:13: no well-formed XML: mismatched tag"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), MISTAKES)
def test_a_mistake_is_reported_with_its_place(
    change: tuple[str, str], message: str
) -> None:
    assert change[0] in TIPPER
    with pytest.raises(ReadError) as caught:
        read(TIPPER.replace(*change, 1))
    assert any(
        line.startswith(f"tip.xml:{message}") for line in str(caught.value).splitlines()
    ), caught.value


def bomb(levels: int) -> str:
    """Return terms of which each is made of the one before it, twice."""
    old = '<fuzzyTerm name="either">'
    before, rest = "bad", ""
    for level in range(levels):
        name = f"t{level}"
        twice = f"<termName>{before}</termName>" * 2
        rest += (
            f'<fuzzyTerm name="{name}"><circularDefinition><or>{twice}</or>'
            "</circularDefinition></fuzzyTerm>"
        )
        before = name
    text = TIPPER.replace(old, rest + old)
    return text.replace("<term>either", f"<term>{before}")


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00",
        b"<a>" * 100,
        b"<a>" + b"<b/>" * 600_000 + b"</a>",
        b"<a>" + b"x" * 200_000 + b"</a>",
        b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
        b'<?xml version="1.0" encoding="utf-42"?><a/>',
        b"x" * (16 * 2**20 + 1),
        "<fuzzySystem/>".encode("utf-16"),
        b"<FuzzySystem/>",
        bomb(19).encode(),
        bomb(200).encode(),
    ],
    ids=range(12),
)
def test_hostile_files_end_in_a_sentence_after_bounded_work(content: bytes) -> None:
    with at_most(6_000_000), pytest.raises(ReadError) as caught:
        read_fml(content, "x.xml")
    assert len(str(caught.value)) < 10_000


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_encodings_change_nothing(encoding: str) -> None:
    text = TIPPER.replace(' encoding="UTF-8"', "")
    assert read_fml(text.encode(encoding), "tip.xml").model == read(TIPPER)


def test_a_file_without_the_namespace_is_read_with_a_remark() -> None:
    text = TIPPER.replace(' xmlns="http://www.ieee1855.org"', "")
    found = read_fml(text.encode(), "tip.xml")
    assert found.model == read(TIPPER)
    assert found.remarks[0].startswith("the namespace is none and not")

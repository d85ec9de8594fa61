"""Systems as YAML: what was written is read whole, and mistakes have their places."""

from __future__ import annotations

import random
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters.yaml import write
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model import (
    MOST_LEVELS,
    Call,
    Conclusion,
    Expression,
    Formula,
    FuzzySystem,
    Hedge,
    Name,
    Number,
    Or,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.semantics.inference import infer
from fuzzytree.testing import random_rows, random_system
from tests.work import at_most

EXAMPLES = Path(__file__).parents[1] / "example-files" / "positive"
TIPPER = (EXAMPLES / "system-tipper.yaml").read_text("utf-8")


def system_of(text: str) -> FuzzySystem:
    found = read_yaml(text.encode(), "x.yaml").model
    assert isinstance(found, FuzzySystem)
    return found


def error_of(text: str) -> str:
    with pytest.raises(ReadError) as caught:
        read_yaml(text.encode(), "x.yaml")
    return str(caught.value)


def all_of(system: object) -> str:
    return repr(msgspec.to_builtins(system))


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("has_odd_names", [False, True], ids=["plain", "odd names"])
def test_what_was_written_is_read_as_the_equal_system(
    seed: int, has_odd_names: bool
) -> None:
    system = random_system(seed, formulas="wild", has_odd_names=has_odd_names)
    written = write(system)
    again = read_yaml(written.content, "x.yaml").model
    assert again == system
    assert all_of(again) == all_of(system)  # 0.0 and -0.0 differ
    assert not written.losses
    assert not written.remarks
    assert write(again) == written


def test_numbers_keep_all_their_digits_and_the_sign_of_zero() -> None:
    text = TIPPER.replace("[0, 5, 10]", "[-0.0, 5e-324, 1.7976931348623157e+308]")
    system = system_of(text.replace("default: 15", "default: 0.1"))
    assert all_of(read_yaml(write(system).content, "x.yaml").model) == all_of(system)
    assert "-0.0" in repr(system.outputs[0].terms[0].function)


def test_the_example_typed_by_hand_means_what_it_says() -> None:
    system = system_of(TIPPER)
    service, food = system.variables
    assert [label.name for label in service.terms] == ["poor", "good", "excellent"]
    assert (food.name, food.unit, food.clips) == ("food quality", "points", True)
    assert system.rules[2].when == Or(
        (
            Proposition("service", ("excellent",)),
            system_of(TIPPER).rules[2].when.parts[1],  # type: ignore[union-attr]
        )
    )
    assert system.rules[3].when is None
    assert system.rules[3].name == "never less than nothing"
    good = infer(system, {"service": 10.0, "food quality": 99.0}).outputs[0]
    poor = infer(system, {"service": 0.0, "food quality": -99.0}).outputs[0]
    assert 22.0 < good < 27.0
    assert 4.0 < poor < 8.0


def test_a_triangle_is_a_trapezoid_with_a_peak() -> None:
    wide = TIPPER.replace("triangle: [0, 5, 10]", "trapezoid: [0, 5, 5, 10]")
    assert system_of(wide) == system_of(TIPPER)


@pytest.mark.heavy
def test_a_file_cut_short_is_never_a_smaller_system() -> None:
    system = random_system(4, rules=4)
    content = write(system).content
    for end in range(0, len(content) - 1, 7):
        error_of(content[:end].decode())
    assert read_yaml(content[:-1], "x.yaml").model == system


def test_every_line_that_is_left_out_matters_or_is_refused() -> None:
    lines = TIPPER.splitlines(keepends=True)
    whole = system_of(TIPPER)
    same = [
        lines[number]
        for number in range(len(lines))
        if _or_none("".join(lines[:number] + lines[number + 1 :])) == whole
    ]
    # A comment; what is said again, and 1 is the weight of a rule without one.
    assert same == [lines[0], "    weight: 1\n"]


def _or_none(text: str) -> FuzzySystem | None:
    try:
        return system_of(text)
    except ReadError:
        return None


def test_mistakes_of_every_part_are_reported_at_once() -> None:
    text = (
        TIPPER.replace("service is good", "service is god")
        .replace("deviation: 1.5}}\n  - {name: good", "deviation: 0}}\n  - {name: good")
        .replace("weight: 1\n", "weight: 2\n")
        .replace("then: tip is generous", "then: tip is")
        .replace("defuzzifier: centroid", "defuzzifier: centroids")
    )
    assert error_of(text) == "\n".join(
        [
            "x.yaml:10:5: term 'poor' of 'service': the deviation must be above 0, "
            "not 0.0",
            "x.yaml:27:16: 'defuzzifier' must be 'bisector' or 'centroid' or 'largest "
            "of maximum' or 'mean of maximum' or 'smallest of maximum' or 'weighted "
            "average' or 'weighted sum', not 'centroids'",
            "x.yaml:39:9: rule 2: 'service' has no term 'god'; there is poor, good, "
            "excellent (did you mean 'good'?)",
            "x.yaml:41:13: rule 2: the weight must lie in [0, 1], not 2.0",
            "x.yaml:45:11: 'tip is': the end where a term must stand behind 'tip is'",
        ]
    )


def test_a_system_that_yaml_cannot_hold_is_not_written() -> None:
    def refusal(system: FuzzySystem) -> str:
        with pytest.raises(LossError) as caught:
            write(system, allow_loss=True)
        return str(caught.value)

    whole = random_system(1)
    assert "more than the 1000 of a name" in refusal(replace(whole, name="a" * 1001))
    deep: Expression = Name("x1")
    for _ in range(MOST_LEVELS - 1):
        deep = Call("+", (Number(1.0), deep))
    first = replace(whole.variables[0], terms=(Term("deep", Formula(deep)),))
    rule = SystemRule(None, (Conclusion("y1", whole.outputs[0].terms[0].name),))
    text = refusal(
        replace(
            whole, variables=(first, *whole.variables[1:]), blocks=(RuleBlock((rule,)),)
        )
    )
    assert text == (
        "cannot write random 8 as yaml: term 'deep' of 'x1': its formula is too long "
        "or nested too deeply"
    )


def hostile() -> dict[str, str]:
    """Return files that are large or contradict themselves many times."""
    head = "format: fuzzytree/1\nkind: system\nname: hostile\n"
    tail = (
        "semantics:\n  not: 1 - degree\n"
        "  activated: rules whose weighted degree is above 0\n  missing: a value that "
        "is missing or infinite makes every output nan\n"
    )
    output = (
        "outputs:\n- name: y\n  terms:\n  - {name: one, singleton: 1}\n"
        "  defuzzifier: weighted sum\n"
    )
    block = "blocks:\n- activation: {method: general}\n  and: minimum\n  rules:\n"

    def rules(*sentences: str) -> str:
        return "".join(f"  - if: ['{one}']\n    then: y is one\n" for one in sentences)

    count = 4000
    inputs = "variables:\n" + "".join(
        f"- {{name: v{k}, terms: [{{name: low, at least: {k}}}]}}\n"
        for k in range(count)
    )
    formulas = "variables:\n- name: a\n  terms:\n" + "".join(
        f"  - {{name: t{k}, formula: w{k} + sine(x)}}\n" for k in range(count)
    )
    names = "variables:\n- name: a\n  terms:\n" + "".join(
        f"  - {{name: t{k}, formula: w{k} + x}}\n" for k in range(count)
    )
    return {
        "unknown names": head
        + inputs
        + output
        + block
        + rules(*(f"u{k} is low" for k in range(count)))
        + tail,
        "wrong sentences": head
        + inputs
        + output
        + block
        + rules(*(f"v{k} low" for k in range(count)))
        + tail,
        "wrong formulas": head + formulas + output + block + rules("y is any") + tail,
        "unknown names of formulas": head
        + names
        + output
        + block
        + rules("y is any")
        + tail,
        "parentheses": head + output + block + rules("(" * 90_000 + "y is one") + tail,
        "a long sentence": head
        + output
        + block
        + rules(" and ".join(["y is one"] * 9000) + " and")
        + tail,
        "a deep formula": head
        + "variables:\n- name: a\n  terms:\n  - {name: t, formula: '"
        + "-" * 9000
        + "1'}\n"
        + output
        + block
        + rules("y is any")
        + tail,
        "many blocks": head
        + inputs
        + output
        + "blocks:\n"
        + "- {activation: {method: general}, rules: [{if: [a is b], then: y is one}]}\n"
        * count
        + tail,
    }


@pytest.mark.one_in(6)
@pytest.mark.parametrize("name", hostile())
def test_a_hostile_system_ends_in_an_error_after_bounded_work(name: str) -> None:
    with at_most(6_000_000):
        text = error_of(hostile()[name])
    assert len(text.splitlines()) <= 101
    assert len(text) < 200_000
    assert all(line.startswith("x.yaml:") for line in text.splitlines())


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(6))
def test_a_damaged_system_gives_a_read_error_or_a_system(seed: int) -> None:
    chance = random.Random(seed)
    texts = [
        *(path.read_text("utf-8") for path in EXAMPLES.glob("system-*.yaml")),
        write(random_system(seed, has_odd_names=True, rules=4)).content.decode(),
    ]
    words = [
        *("is", "and", "or", "not", "(", ")", "'", '"', "very", "any", "x", "1e999"),
        *("-", ".inf", ".nan", "[", "]", "{", "}", ": ", "\n", "~", "\x00", "always"),
    ]
    for _ in range(120):
        text = chance.choice(texts)
        for _ in range(chance.randint(1, 3)):
            start = chance.randrange(len(text))
            end = min(len(text), start + chance.choice((0, 1, 3, 12)))
            new = chance.choice((*words, text[end : end + 9], ""))
            text = text[:start] + new + text[end:]
        try:
            system = read_yaml(text.encode(), "x.yaml").model
        except ReadError as error:
            lines = str(error).splitlines()
            assert all(line.startswith("x.yaml:") for line in lines)
            continue
        assert isinstance(system, FuzzySystem)
        assert read_yaml(write(system).content, "x.yaml").model == system
        for row in random_rows(system, seed, 2):
            infer(system, row)


def test_a_hedge_of_two_words_is_written_with_a_hyphen() -> None:
    hedges: tuple[Hedge, ...] = ("very very", "cube root")
    system = random_system(0, rules=1)
    variable: Variable | SystemOutput = system.variables[0]
    when = Proposition(variable.name, (variable.terms[0].name,), hedges)
    block = replace(system.blocks[0], rules=(replace(system.rules[0], when=when),))
    text = write(replace(system, blocks=(block,))).content.decode()
    assert "is very-very cube-root " in text

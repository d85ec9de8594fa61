"""Generated JavaScript as text; `tests/interop/test_node.py` runs it."""

from __future__ import annotations

import re

import pytest

from fuzzytree.exporters.javascript import FORMAT, words_of, write
from fuzzytree.exporters.js_text import literal, number_text, text_of
from fuzzytree.exporters.program_text import digest_of
from fuzzytree.model.rulebase import (
    Band,
    Clause,
    Flank,
    Points,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
    fingerprint,
)
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

HOSTILE = (
    "\n*/ process.exit(3); /*",
    '"]; throw 1; ["',
    "</script><script>alert(1)</script>",
    "<!-- --> \u2028 \u2029 \r",
    "\\",
    "`${process.exit(3)}`",
    "__proto__",
    "constructor",
    "@doors@ @name@",
    "é ☂ 😀",
)


def grip() -> RuleBase:
    low = Term("low", Band(high=1.0, right=Flank(1.0, 3.0)))
    some = Term("some", Points((0.0, 0.1), (0.0, 1.0)))
    rules = (Rule((Clause("force", ("low", "some"), True),), "soft"), Rule((), "hard"))
    inputs = (Variable("force", (low, some), unit="N"),)
    return RuleBase("grip", ("soft", "hard"), inputs, rules, Semantics("min", "hard"))


def test_the_tables_of_a_small_rule_base() -> None:
    text = write(grip()).content.decode("ascii")
    assert text[: text.index("/* Return the inputs")] == (
        '/* A fuzzy rule base, named "grip". Written by fuzzytree. */\n'
        f"/* Fingerprint: {fingerprint(grip())} */\n"
        "\n/* Status of an answer. */\n"
        "const DECIDED = 0, TIE = 1, UNCOVERED = 2, MISSING = 3;\n"
        '\nconst INPUTS = [\n  "force", // "N"\n];\n'
        '\nconst CLASSES = [\n  "soft",\n  "hard",\n];\n'
        "const WHEN_MISSING = null;\n"
        "\n/* Place of an input, weight and centre of each part. */"
        "\nconst COMBINATIONS = [\n];\n"
        "\n/* Line of the variable, places of terms in TERMS, if it is negated. */"
        "\nconst CLAUSES = [\n  [0, [0, 1], true],\n];\n"
        "\n/* Places of the clauses in CLAUSES, and of the class. */"
        "\nconst RULES = [\n"
        '  [[0], 0], // 1. "IF force is not low or some THEN soft"\n'
        '  [[], 1], // 2. "ALWAYS hard"\n'
        "];\n"
        'const WHEN_UNCOVERED = "hard";\n'
        "const IS_PRODUCT = false;\n"
        "\n/* The kind of each term, and its numbers. */"
        "\nconst TERMS = [\n"
        '  ["band", null, 1.0, null, [1.0, 3.0, [1.0]]], // "force" is "low"\n'
        '  ["points", [0.0, 0.1], [0.0, 1.0]], // "force" is "some"\n'
        "];\n\n"
    )


def test_text_becomes_one_line_that_ends_neither_comment_nor_script() -> None:
    for text in HOSTILE:
        made = text_of(text)
        assert made.isascii()
        assert made.isprintable()
        assert not re.search(r"[<>]|\*/", made)


def test_numbers_keep_their_bits_and_signs() -> None:
    numbers = [0.1, -0.0, 5e-324, 1.7976931348623157e308, float("-inf"), float("nan")]
    assert literal(numbers) == (
        "[0.1, -0.0, 5e-324, 1.7976931348623157e+308, -Infinity, NaN]"
    )
    assert float(number_text(1.0 - 2.0**-53)) == 1.0 - 2.0**-53


def test_what_is_no_literal_is_refused() -> None:
    with pytest.raises(TypeError, match="no literal for dict"):
        literal({})


def test_a_digest_reports_every_bit() -> None:
    assert digest_of(words_of([0.5, 1.0])) != digest_of(words_of([0.5, 1.0 - 2.0**-53]))
    assert digest_of(words_of([0.0])) != digest_of(words_of([-0.0]))


@pytest.mark.parametrize(
    ("model", "doors"),
    [
        (random_tree(1), "INPUTS, CLASSES, decide, answer, selfTest"),
        (
            rules_from_tree(random_tree(1)),
            "INPUTS, CLASSES, decide, strengths, answer, selfTest",
        ),
        (random_system(1), "INPUTS, OUTPUTS, infer, answer, selfTest"),
    ],
    ids=["tree", "rules", "system"],
)
def test_a_module_exports_its_doors_and_a_script_gives_them_a_name(
    model: RuleBase, doors: str
) -> None:
    assert f"\nexport {{ {doors} }};\n" in write(model).content.decode()
    script = write(model, module="script").content.decode()
    assert f"\nconst model = {{ {doors} }};\n" in script
    assert f"[{text_of(model.name)}] = model;\n" in script
    assert not re.search(r"^(export|import) |import\.meta", script, re.MULTILINE)


def test_nothing_is_lost_and_the_same_model_gives_the_same_bytes() -> None:
    tree = random_tree(3)
    written = write(tree)
    assert written == write(random_tree(3))
    assert (written.losses, written.remarks) == ((), ())
    assert FORMAT.suffixes == (".mjs", ".js")

"""Generated JavaScript as text; `tests/interop/test_node.py` runs it."""

from __future__ import annotations

import re

import pytest

from fuzzytree.exporters.javascript import FORMAT, write
from fuzzytree.exporters.js_text import literal, number_text, text_of
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
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
    low = Term("low", Band(high=1.0, right=3.0))
    some = Term("some", Points((0.0, 0.1), (0.0, 1.0)))
    rules = (
        Rule((Proposition("force", ("low", "some"), ("not",)),), "soft"),
        Rule((), "hard"),
    )
    inputs = (Variable("force", (low, some), unit="N"),)
    return RuleBase(
        "grip", ("soft", "hard"), inputs, rules, Semantics("minimum", "hard")
    )


def test_a_small_rule_base_is_written_step_by_step() -> None:
    text = write(grip()).content.decode("ascii")
    assert text[: text.index("\nfunction minimum")] == (
        '/* A fuzzy rule base, named "grip". Written by fuzzytree. */\n'
        f"/* Fingerprint: {fingerprint(grip())} */\n"
        "\n/* Status of an answer. */\n"
        "const DECIDED = 0, TIE = 1, UNCOVERED = 2, MISSING = 3;\n"
        '\nconst INPUTS = [\n  "force", // "N"\n];\n'
        '\nconst CLASSES = [\n  "soft",\n  "hard",\n];\n'
        "\nconst TABLE_0 = [1.0, 0.0, 1.0];\n"
        "\n/* Return class, rule, status and strength as numbers. */"
        "\nfunction numbers(x) {\n"
        '  const v0 = x[0]; // "force"\n'
        "  const v1 = Number.isFinite(v0);\n"
        "  const v4 = v0 - 3.0;\n"
        "  const v6 = v4 / -2.0;\n"
        "  const v8 = maximum(v6, 0.0);\n"
        "  const v10 = minimum(v8, 0.9999999999999999);\n"
        "  const v11 = 1.0 < v0;\n"
        '  const v12 = v11 ? v10 : 1.0; // "force is low"\n'
        "  const v14 = v0 / 0.1;\n"
        "  const v15 = minimum(v14, 1.0);\n"
        '  const v16 = maximum(v15, 0.0); // "force is some"\n'
        "  const v17 = maximum(v12, v16);\n"
        "  const v18 = 1.0 - v17;\n"
        "  const v19 = maximum(v18, 1.0);\n"
        "  const v20 = v18 === v19;\n"
        "  const v21 = 1.0 === v19;\n"
        "  const v23 = v20 ? 1.0 : 2.0;\n"
        "  const v24 = v21 ? 2.0 : 1.0;\n"
        "  const v25 = v19 === 0.0;\n"
        "  const v26 = v25 ? 0.0 : v23;\n"
        "  const v27 = v26 === v24;\n"
        "  const v28 = v27 ? 0.0 : 1.0;\n"
        "  const v29 = v25 ? 2.0 : v28;\n"
        '  const v30 = v1 ? v26 : 0.0; // "rule"\n'
        '  const v31 = v1 ? v29 : 3.0; // "status"\n'
        "  const v32 = pick(TABLE_0, v30);\n"
        '  const v34 = v1 ? v32 : -1.0; // "class"\n'
        '  const v36 = v1 ? v18 : NaN; // "rule 1 strength"\n'
        '  const v37 = v1 ? 1.0 : NaN; // "rule 2 strength"\n'
        "  return [\n"
        '    v34, // "class"\n'
        '    v30, // "rule"\n'
        '    v31, // "status"\n'
        '    v36, // "IF force is not low or some THEN soft"\n'
        '    v37, // "ALWAYS hard"\n'
        "  ];\n"
        "}\n"
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

"""The report of a stability study, as a whole text."""

from __future__ import annotations

from fuzzytree.checking.stability.results import (
    Move,
    Stability,
    Stiff,
    Trial,
)
from fuzzytree.report.stability import stability_lines

STUDY = Stability(
    "grip",
    "0" * 64,
    12,
    30_000,
    20_000,
    ("native", "native float32"),
    (
        Trial(
            "N3",
            "use another one",
            [f"native: tree: {k} of 8 rows" for k in (5, 4, 3, 2, 1, 1)],
            cases=40,
        ).result(),
        Trial("N7", cases=3, worst=0.01).result("1 of 3 sides bulges"),
        Trial("N10", skipped=["a", "b", "b", "c", "d"]).result(),
    ),
    (
        Stiff(
            "force",
            0.5,
            1e6,
            5e-7,
            0.12,
            0.1,
            3,
            80,
            1e6,
            "use mixed",
            (Move("1 ulp", 0.25, 2, "the tip", "force 1.0, slip 0.5"),),
        ),
        Stiff("slip", 1.0, 2.0, 0.5, 1e-7, 0.0, 0, 80, None, "float32 is safe"),
    ),
)

TEXT = """\
grip: 1 of 3 stability checks fails: N3 (12 generated rows, 30000 rows of data, \
20000 of them tried; 2 runtimes)
runtimes: native, native float32
code  stability check                                  cases  worst  verdict
N3    row order, copies and batch size change no bit   40     -      FAILS
N7    fitted curves are well conditioned and monotone  3      0.01   passes
N10   error against run time                           -      -      not applicable
N3: native: tree: 5 of 8 rows
N3: native: tree: 4 of 8 rows
N3: native: tree: 3 of 8 rows
N3: native: tree: 2 of 8 rows
N3: native: tree: 1 of 8 rows
N3: and 1 more
N7: 1 of 3 sides bulges
N10: not tried: a
N10: not tried: b
N10: not tried: c
N10: not tried: d
input  spread/size  float32 costs  observed  changed  advice
force  5.0e-07      1.2e-01        1.0e-01   3 of 80  use mixed
slip   5.0e-01      1.0e-07        0.0e+00   0 of 80  float32 is safe
input  moved by  answer moves by                  changed  most at
force  1 ulp     2.5e-01 of the range of the tip  2 of 80  force 1.0, slip 0.5
what to do: N3: use another one
what to do: force: use mixed"""


def test_a_report_tells_everything_in_order() -> None:
    assert "\n".join(stability_lines(STUDY, is_verbose=True)) == TEXT


def test_a_short_report_has_the_failures_and_the_inputs_that_need_care() -> None:
    short = list(stability_lines(STUDY))
    assert short[0] == TEXT.partition("\n")[0]
    assert not any("not tried" in line or "sides bulges" in line for line in short)
    assert "float32 is safe for 1 of 2 inputs" in short
    assert any(line.startswith("force  ") for line in short)


def test_a_study_with_a_failure_is_not_ok() -> None:
    assert not STUDY.ok

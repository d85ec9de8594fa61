"""An audit in the terminal: every state looks like itself, and nothing is left out."""

from __future__ import annotations

import re

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined
from fuzzytree.auditing.findings.records import LIMITS, SourceFile
from fuzzytree.report.audit import (
    MOST_FINDINGS,
    WIDTH,
    audit_lines,
    audit_verdict,
)
from tests.report.audits import LINES, every_state

WHOLE = """\
2 findings: 1 error, 1 warning beside 1 accepted; incomplete: the budget is spent \
(--budget STEPS);
  1 PROVED, none confirmed; `fuzzytree explain FT101` explains the gravest
grip: audited as rules; AND is minimum, the strongest rule decides
rows     4 of grasps.csv
domain
  force  0 to 5  the model's range
  slip   0 to 1  --limits

grip.yaml:4:3: FT101 error: rule 2 never wins
    |
  4 | - if: [force is high]
    |   ^
  PROVED   12 levels and 40 cells were visited
  see also 2:3
  id       FT101-00000001
  again    fuzzytree audit grip.yaml --select FT101

grip.yaml: FT202 warning: rules 1 and 2 are equally strong on a part of the domain
  WITNESS  rules 1, 2 are equally strong
  at       force = 2.5 (0x1.4000000000000p+1), slip = 0.3333333333333333 (1/3)
  region   force 2 to 3; slip up to 0.5
  measured width 0.25 N
  id       FT202-00000002

1 accepted finding of the baseline

open
  FT401 DECLINED the term 'low' of 'force' is not decided (FTD02: its curve (gaussian) \
has no exact
                 method)

1 more answer is no finding; --all lists each

code   question      count  found  proved  computed  witness  bracket  sampled  declined
FT101  dead rule     1      1      1       -         -        -        -        -
FT202  ambiguity     1      1      -       -         1        -        -        -
FT301  coverage gap  1      1      -       -         -        1        -        -
FT401  empty term    1      -      -       -         -        -        -        1
FT701  data support  1      -      -       -         -        -        1        -
all                  5      3      1       -         1        1        1        1

not examined, or not to the end
- FT102 marginal rule: cut short: the budget of 60 s is spent
- FT103, FT104: left out by the user
- FT107 irrelevant proposition: not run: the budget of 60 s is spent

"""


def shown() -> str:
    return "\n".join(audit_lines(every_state(), LINES))


def test_an_audit_is_printed_as_it_is() -> None:
    assert shown().partition("this audit does not establish")[0] == WHOLE


def test_what_is_open_is_reported_and_the_rest_counted_unless_all_are_wanted() -> None:
    audit = every_state()
    open_one = replace(audit.answers[2], is_finding=False)
    answers = (*audit.answers[:2], open_one, audit.answers[4], audit.answers[4])
    audit = replace(audit, answers=answers, accepted=())
    short = "\n".join(audit_lines(audit, LINES))
    bracket = "  FT301 BRACKET  how weak the weakest cover is was not settled\n"
    assert f"\nopen\n{bracket}\n2 more answers are no findings; --all" in short
    assert "rule 1 wins 3 of 4 rows" not in short
    many = replace(audit, answers=(open_one,) * 42)
    assert f"\nopen\n{bracket * 40}  and 2 more; --all lists each\n" in "\n".join(
        audit_lines(many)
    )
    whole = "\n".join(audit_lines(audit, LINES, is_whole=True))
    sampled = "  FT701 SAMPLED  rule 1 wins 3 of 4 rows\n"
    assert f"\nanswers that are no findings\n{bracket}{sampled}{sampled}\n" in whole
    assert "--all" not in whole


def test_what_is_alike_is_said_once() -> None:
    audit = every_state()
    state = Declined("FTD02", "its curve (gaussian) has no exact method")
    answer = replace(audit.answers[3], code="FTD02", state=state)
    reason = "not run: every rule takes part in the answer"
    unasked = (f"FT102 marginal rule: {reason}", f"FT105 a: {reason}", "FT204 b: c")
    text = "\n".join(audit_lines(replace(audit, answers=(answer,), unasked=unasked)))
    assert "\n  FTD02 DECLINED the term 'low' of 'force' is not decided" in text
    assert "\nFTD02  a curve without an exact method  1 " in text
    assert f"\n- FT102, FT105: {reason}\n- FT204 b: c\n" in text


def test_the_gravest_finding_comes_first() -> None:
    audit = every_state()
    first, second, third = audit.answers[:3]
    audit = replace(audit, answers=(third, second, first), accepted=())
    text = "\n".join(audit_lines(audit))
    places = [
        text.index(f"{one.code} {one.severity}:") for one in (first, second, third)
    ]
    assert places == sorted(places)


def test_the_panel_is_printed_whole() -> None:
    panel = shown().partition("this audit does not establish\n")[2]
    assert panel.replace("\n  ", " ").splitlines() == [f"- {text}" for text in LIMITS]


def test_no_line_is_wider_than_a_terminal() -> None:
    assert max(map(len, shown().splitlines())) <= WIDTH


def test_colour_changes_nothing_but_colour() -> None:
    coloured = "\n".join(audit_lines(every_state(), LINES, is_coloured=True))
    assert "\x1b[" in coloured
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == shown()
    assert "\x1b" not in shown()


def test_what_a_terminal_would_obey_is_written_as_an_escape() -> None:
    lines = [*audit_lines(every_state("a\x1b[2J\nb.yaml", "rule '\x1b[31m\x07' never"))]
    assert not any("\x1b" in line or "\x07" in line for line in lines)
    assert any(r"rule '\x1b[31m\x07' never" in line for line in lines)


def test_the_head_shows_no_name_as_it_should_not_be_shown() -> None:
    audit = every_state()
    evil = "\x1b[31m\u202e\n"
    domain = Domain((DomainSide(evil, 0.0, 5.0), DomainSide("L" * 10_000, 0.0, 1.0)))
    data = SourceFile(evil, "b" * 64)
    lines = [*audit_lines(replace(audit, model=evil, domain=domain, data=data))]
    assert all(line.isprintable() for line in lines)
    start = lines.index(r"rows     4 of \x1b[31m\u202e\n")
    assert lines[start - 1].startswith(r"\x1b[31m\u202e\n: audited as rules")
    assert lines[start + 3] == f"  {'L' * 59}…  0 to 1  --limits"


def test_a_place_beyond_the_file_has_no_caret() -> None:
    lines = [*audit_lines(every_state(), LINES[:1])]
    assert not any(line.endswith("^") for line in lines)


def test_a_long_line_is_shown_around_its_place() -> None:
    audit = every_state()
    place = replace(audit.answers[0].places[0], line=1, column=500)
    first = replace(audit.answers[0], places=(place,))
    audit = replace(audit, answers=(first, *audit.answers[1:]))
    source = "x" * 499 + "HERE" + "y" * 500
    lines = [*audit_lines(audit, [source])]
    caret = next(line for line in lines if line.endswith("^"))
    assert lines[lines.index(caret) - 1][len(caret) - 1 :].startswith("HERE")
    assert max(map(len, lines)) <= WIDTH


def test_findings_beyond_the_most_are_counted() -> None:
    audit = every_state()
    many = tuple(
        replace(audit.answers[0], id=f"FT101-{k:08x}") for k in range(MOST_FINDINGS + 2)
    )
    lines = [*audit_lines(replace(audit, answers=many), LINES)]
    assert "2 more findings: FT101 (2); --all lists all" in lines
    whole = [*audit_lines(replace(audit, answers=many), LINES, is_whole=True)]
    assert sum("FT101 error:" in line for line in whole) == MOST_FINDINGS + 2


def test_the_verdict_counts_and_says_what_next() -> None:
    audit = every_state()
    assert audit_verdict(audit, ["FT101-0"]) == (
        "2 findings: 1 error, 1 warning beside 1 accepted; incomplete: the budget is "
        "spent (--budget STEPS); 1 accepted finding no longer found, which "
        "--write-baseline forgets; 1 PROVED, none confirmed; `fuzzytree explain FT101` "
        "explains the gravest"
    )
    calm = replace(audit, answers=audit.answers[3:], accepted=(), is_complete=True)
    assert audit_verdict(calm) == "nothing found; 2 questions, 1 declined"
    bare = replace(calm, answers=())
    assert audit_verdict(bare) == "nothing found; no question applies to this model"
    none = replace(calm, answers=calm.answers[:1])
    assert audit_verdict(none) == (
        "nothing found; 1 question, all declined: nothing is known; "
        "`fuzzytree explain FTD02` explains why"
    )
    bracket = replace(audit.answers[2], is_finding=False)
    unsure = replace(calm, answers=(bracket, *calm.answers))
    assert audit_verdict(unsure) == (
        "nothing found; 3 questions, 1 open and 1 declined"
    )
    sure = replace(calm, answers=calm.answers[1:])
    assert audit_verdict(sure) == "nothing found; 1 question answered"
    cut = replace(calm, unasked=("FT101 dead rule: cut short: interrupted",))
    assert audit_verdict(replace(cut, is_complete=False)) == (
        "nothing found; interrupted: what is proved is kept, the rest is not examined"
    )

"""The questions of an audit and the reasons for declining, each with a stable code."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final, Literal, TypedDict, Unpack

from fuzzytree.auditing.engine.states import Span, State
from fuzzytree.auditing.findings.records import AuditAnswer, Measure, Severity, TermName
from fuzzytree.model import Value


class Code(Value, frozen=True):
    """A kind of question.

    Attributes:
        code: Its name in every output, which never changes its meaning.
        title: What a finding says, in a few words.
        severity: Of a finding, unless it says otherwise.
        decision: `strongest` if it applies only where the strongest rule decides.
        what: What a finding means, exactly.
        why: Why a reader should care.
        example: A small case.
        remedy: What to do about it.
    """

    code: str
    title: str
    severity: Severity
    decision: Literal["strongest", "any"] = "any"
    what: str = ""
    why: str = ""
    example: str = ""
    remedy: str = ""


_CODES = (
    Code(
        "FT101",
        "dead rule",
        "error",
        what="The rule never gives the answer: nowhere on the domain is it stronger "
        "than every rule of another class; where all rules take part in the answer, "
        "it never fires. For a tree: no value leads to the leaf.",
        why="The rule is superfluous, or the case that it was written for is decided "
        "differently.",
        example="1. IF force is high THEN firm\n"
        "2. IF slip is much THEN loose\n"
        "3. IF force is high AND slip is much THEN soft\n"
        "Rule 3 is never stronger than rule 1 or than rule 2.",
        remedy="Delete the rule, narrow those that hide it, or audit a wider domain "
        "(--limits NAME=LOW:HIGH).",
    ),
    Code(
        "FT102",
        "marginal rule",
        "warning",
        "strongest",
        what="The rule wins somewhere, but nowhere by more than the setting `lead` "
        "over every rule of another class.",
        why="It decides in a sliver of the domain, where a rounded number or a noisy "
        "sensor gives another answer.",
        example="A rule whose largest lead is 2.8e-8.",
        remedy="If it should decide at the witness, widen its terms or narrow those "
        "of its rival; if not, delete it.",
    ),
    Code(
        "FT103",
        "redundant rule",
        "info",
        "strongest",
        what="Without the rule every decision on the domain stays the same.",
        why="It costs reading and computing, and changes nothing.",
        example="1. IF force is high THEN firm\n"
        "2. IF slip is none THEN firm\n"
        "3. IF force is high AND slip is none THEN firm\n"
        "Rule 3 can go.",
        remedy="Delete it, one rule at a time: two may not be redundant together.",
    ),
    Code(
        "FT104",
        "subsumed rule",
        "warning",
        what="One other rule of the same class is at least as strong everywhere on "
        "the domain; where all rules take part, one with the same conclusion.",
        why="The rule says a special case of what another one says already.",
        example="1. IF force is high THEN firm\n"
        "2. IF force is high AND slip is none THEN firm\n"
        "Rule 1 subsumes rule 2.",
        remedy="Delete the narrower rule, or narrow the wider one.",
    ),
    Code(
        "FT105",
        "rule masked by another class",
        "error",
        "strongest",
        what="One rule of another class is at least as strong everywhere on the "
        "domain and goes before it in a tie: the rule is never answered.",
        why="The two rules contradict each other, and one always wins.",
        example="1. IF force is high THEN firm\n"
        "2. IF force is high AND slip is much THEN loose\n"
        "Rule 1 is at least as strong and stands first.",
        remedy="Exclude the special case from the general rule (AND slip is not "
        "much), or let it stand first if ties are all that matters.",
    ),
    Code(
        "FT106",
        "duplicate antecedent",
        "warning",
        what="Two rules have the same antecedent: equal curves, or curves that differ "
        "by no more than a tolerance, which the sentence states. With different "
        "classes the finding is an error; where all rules take part in the answer, a "
        "note.",
        why="One of two equal rules is superfluous; of two contradicting ones the "
        "order of the file decides.",
        example="1. IF force is high THEN firm\n"
        "2. IF force is strong THEN soft\n"
        "The terms high and strong have one curve.",
        remedy="Delete one of the two rules, and one of the two names of the term.",
    ),
    Code(
        "FT107",
        "irrelevant clause",
        "info",
        "strongest",
        what="Without the clause the rule base decides the same on all of the domain.",
        why="It makes a rule look more careful than it is, and may cost a sensor.",
        example="IF force is high AND slip is any THEN firm\n"
        "The term any is 1 on all of the domain.",
        remedy="Delete the clause; one at a time, for two may not be irrelevant "
        "together.",
    ),
    Code(
        "FT201",
        "conflict",
        "info",
        what="Two rules of different classes reach the setting `level` at one point.",
        why="Both say with some force that they are right.",
        example="1. IF force is high THEN firm\n"
        "2. IF slip is much THEN loose\n"
        "Where the force is high and the slip is much, both have the strength 1.",
        remedy="Exclude the witness from the rule that should not apply there, or "
        "accept the overlap in a baseline.",
    ),
    Code(
        "FT202",
        "ambiguity",
        "warning",
        "strongest",
        what="The two strongest rules of different classes are equally strong, or "
        "within the setting `margin`, on a part of the domain with an interior.",
        why="There the order of the rules in the file decides.",
        example="1. IF force is high AND slip is none THEN firm\n"
        "2. IF force is high AND slip is much THEN loose\n"
        "Under min both may be as strong as `force is high`.",
        remedy="Put the safer class first; or use product, under which such ties are "
        "rare.",
    ),
    Code(
        "FT203",
        "tree and raw rules differ",
        "warning",
        "strongest",
        what="At the witness the tree decides for one class and its raw rules (those "
        "over the fitted sets) for another, or for none. Places where strengths only "
        "touch are left aside.",
        why="Raw rules are another classifier than the tree.",
        example="Just below a cut the set of the right branch is already stronger.",
        remedy="Ship the relative rules, which equal the tree everywhere, or test the "
        "raw rules as a model of their own.",
    ),
    Code(
        "FT204",
        "nearest other decision of a row",
        "info",
        "strongest",
        what="How far a row is from the nearest point with another decision: the "
        "largest change of an input, in widths of its domain. Of rules, places where "
        "the strengths of two classes only touch are left aside where the sentence "
        "says so.",
        why="A row with a small radius is decided by noise.",
        example="fuzzytree audit grip.yaml --row force=2.1,slip=0",
        remedy="Compare the radius with the noise of the sensors; where it is "
        "smaller, show the class together with its rival.",
    ),
    Code(
        "FT205",
        "region of a leaf",
        "info",
        "strongest",
        what="The box, or boxes, of values that lead to the leaf.",
        why="It is what the tree says, without any degree.",
        example="leaf 2: force above 2, slip up to 0.5",
        remedy="Nothing; read it beside the rules.",
    ),
    Code(
        "FT301",
        "coverage gap",
        "warning",
        what="In a region of the domain no rule reaches the setting `epsilon`; where "
        "it says 0, no rule fires at all.",
        why="There the model answers by default, by a very weak rule or not at all.",
        example="IF force is high THEN firm\n"
        "IF force is low THEN soft\n"
        "with low up to 2 and high from 3 on: nothing is said about 2.5.",
        remedy="Add a rule, widen a neighbour's term, or declare limits without the "
        "region. Start with the gap nearest to the data.",
    ),
    Code(
        "FT401",
        "empty term",
        "error",
        what="The term's degree stays below the setting `level` on all of the domain.",
        why="Rules that need the term never fire, or only faintly.",
        example="A term whose curve begins at 120, of an input that goes up to 100.",
        remedy="Correct the curve or the range of the input; a wrong unit is the "
        "usual cause.",
    ),
    Code(
        "FT402",
        "shape defect",
        "warning",
        what="The curve would leave [0, 1] if it were not clipped, has several peaks, "
        "has no point of degree 1, or lies outside of the domain for the most part.",
        why="A value further from the middle may then belong more to the term.",
        example="A fitted polynomial that falls to 0.2, rises to 0.3 and falls again.",
        remedy="Fit with fewer points or a lower degree; move support into the "
        "domain; or use a curve of straight lines.",
    ),
    Code(
        "FT403",
        "terms hard to distinguish",
        "info",
        what="Two terms of a variable share at least the setting `overlap` of their "
        "area: the integral of their minimum by that of their maximum (Jaccard).",
        why="Rules with one and rules with the other differ less than they read.",
        example="`warm` from 18 to 26 and `mild` from 17 to 26 share 0.9 of their "
        "area.",
        remedy="Merge the two, or move them apart.",
    ),
    Code(
        "FT404",
        "unused term or variable",
        "info",
        what="No rule uses the term, or the variable at all.",
        why="An unused input must be measured all the same.",
        example="`force` has low, medium and high, and no rule uses medium.",
        remedy="Delete it, or write the rule that was forgotten.",
    ),
    Code(
        "FT501",
        "complexity",
        "info",
        what="Counts: rules, clauses, terms in use, the depth of a tree, and the "
        "index of Nauck (complexity times coverage times partition).",
        why="They show whether a person can still read the rules.",
        example="12 rules of 2.4 clauses, 9 terms in use, index 0.11",
        remedy="Nothing; watch the numbers from release to release.",
    ),
    Code(
        "FT601",
        "representations disagree",
        "error",
        what="The rules and another form of them, such as the ONNX graph, give "
        "different strengths or classes to a row.",
        why="What is shipped is not what was audited.",
        example="A graph that was exported before a cut was corrected.",
        remedy="Export again, and run `fuzzytree check MODEL FILE` on what is shipped.",
    ),
    Code(
        "FT602",
        "convention broken",
        "error",
        what="At a tie, at a missing or infinite value, at the end of a curve or "
        "outside of the domain two forms of the model answer differently.",
        why="These are the inputs on which runtimes usually differ.",
        example="A runtime in which NaN has degree 0 answers a class instead of none.",
        remedy="Use the runtime that agrees, or handle such rows before the model.",
    ),
    Code(
        "FT701",
        "data support",
        "info",
        what="How many of the given rows a rule fires on and wins, how many of those "
        "have its class (with an interval), and how many rows are uncovered or tied.",
        why="A rule that no row supports is an opinion.",
        example="rule 4 fires on 31 rows and wins none",
        remedy="Look at rules without rows together with FT101, FT102 and FT103.",
    ),
    Code(
        "FT801",
        "decisions changed",
        "error",
        "strongest",
        what="Two versions of a model decide differently at the witness.",
        why="It is what a user of the model notices.",
        example="fuzzytree diff old.yaml new.yaml",
        remedy="If it is not meant, find the change of structure behind it (FT802).",
    ),
    Code(
        "FT802",
        "structure changed",
        "info",
        what="Two versions of a model differ in a rule, a term, a range or a name; "
        "rules are matched by what they mean, not by their order.",
        why="It explains a change of decisions, or is harmless.",
        example="rule `IF force is high THEN firm` was removed",
        remedy="Nothing, where FT801 finds no change of decisions.",
    ),
    Code(
        "FTD01",
        "declined: a norm without an exact method",
        "info",
        what="A rule uses an AND other than min and product, or an OR other than max; "
        "what depends on it is not decided.",
        why="A guess would look like a proof.",
        example="A block of a fuzzy system whose AND is the Hamacher product.",
        remedy="Audit a version with min or product.",
    ),
    Code(
        "FTD02",
        "declined: a curve without an exact method",
        "info",
        what="A term's curve is no piecewise polynomial, such as a gaussian. It is "
        "bounded by two lines of points, about 0.001 apart: what is proved or has a "
        "witness is true of the curve itself, and what lies between the lines is a "
        "BRACKET. A formula has no such lines: what depends on it is not decided.",
        why="Its degrees are no fractions, so not every question has an exact answer.",
        example="gaussian: {mean: 20, deviation: 3}",
        remedy="Nothing, where the answers suffice. `fuzzytree convert --allow-loss` "
        "writes curves as points; that file can be audited in full.",
    ),
    Code(
        "FTD03",
        "declined: the budget was spent",
        "info",
        what="The question would have taken longer than the time that was left.",
        why="An unknown answer is reported as unknown.",
        example="40 rules over 11 inputs with --budget 10",
        remedy="Give more time (--budget SECONDS), fewer codes (--select), or a "
        "smaller domain (--limits).",
    ),
    Code(
        "FTD04",
        "declined: inputs that depend on each other",
        "info",
        what="Two variables share inputs, as combinations do, and the question needs "
        "them to be free of each other.",
        why="A point may exist on the variables' axes and at no input.",
        example="`flow` = 0.3 * force + 0.7 * slip, in one rule with `force`",
        remedy="Read the answers that do not need it; a proof of `never` is valid.",
    ),
    Code(
        "FTD05",
        "declined: a model too large",
        "info",
        what="The model, or a part of it, is too large for the question.",
        why="Nothing is begun that cannot end.",
        example="A tree whose leaves are made of more than 20,000 boxes.",
        remedy="Audit parts: fewer rules, a smaller domain, or selected codes.",
    ),
    Code(
        "FTD06",
        "declined: needs rows",
        "info",
        what="The question is about rows, and there are none.",
        why="Without rows nothing can be counted.",
        example="fuzzytree audit wine.yaml",
        remedy="Give rows: --data TABLE, and --target COLUMN for their classes.",
    ),
    Code(
        "FTD07",
        "declined: a condition without an exact method",
        "info",
        what="A condition uses an output, or the negation of a product or of an OR "
        "under products.",
        why="The rule is left out of what is proved.",
        example="IF power is low AND force is high THEN brake is on, with the output "
        "power",
        remedy="Use inputs alone, or audit the rules before and behind as two systems.",
    ),
    Code(
        "FTD08",
        "declined: a runtime that is not at hand",
        "info",
        what="A runtime is not installed, or cannot run this model.",
        why="Its answers were not compared.",
        example="c is not installed (one of the programs gcc, cc, clang)",
        remedy="Install the packages or the program that the reason names.",
    ),
)

CODES: Final = MappingProxyType({code.code: code for code in _CODES})


class Details(TypedDict, total=False):
    """What an answer is about, and its numbers; see `AuditAnswer`."""

    rules: tuple[int, ...]
    terms: tuple[TermName, ...]
    region: tuple[Span, ...]
    measures: tuple[Measure, ...]


def finding(
    code: str, subject: str, sentence: str, state: State, **details: Unpack[Details]
) -> AuditAnswer:
    """Return a finding, of the severity of its code."""
    severity = CODES[code].severity
    return AuditAnswer(code, subject, sentence, state, True, severity, **details)


def note(
    code: str, subject: str, sentence: str, state: State, **details: Unpack[Details]
) -> AuditAnswer:
    """Return what was checked or declined, and is no finding."""
    return AuditAnswer(code, subject, sentence, state, False, **details)


class Family(Value, frozen=True):
    """Codes that one function of this package answers.

    Attributes:
        function: The function, as `module:name`; it yields the answers for a subject.
        codes: The codes.
        part: The share of the remaining time that it may use; what it leaves goes to
            the families after it.
    """

    function: str
    codes: tuple[str, ...]
    part: float = 0.5


FAMILIES: Final = (
    Family("terms:answers", ("FT401", "FT404"), 0.2),
    Family("support:answers", ("FT701",), 0.2),
    Family("gaps:answers", ("FT301",), 0.2),
    Family("deciding:answers", ("FT101", "FT102", "FT103", "FT202")),
    Family("leaves:answers", ("FT101", "FT205")),
    Family("pairs:answers", ("FT104", "FT105", "FT106", "FT107", "FT201")),
    Family("disagreement:answers", ("FT203",)),
    Family("terms:shape_answers", ("FT402",), 0.2),
    Family("terms:overlap_answers", ("FT403",), 0.2),
    Family("complexity:answers", ("FT501",), 0.2),
    Family("robustness:answers", ("FT204",)),
    Family("representations:answers", ("FT601", "FT602"), 1.0),
)
"""In the order of the audit: quick and severe questions first, so that a spent budget
costs as little as it can."""

AUDITED: Final = frozenset(code for family in FAMILIES for code in family.codes)
"""The codes that an audit answers; the others belong to `diff`, or are reasons for
declining."""

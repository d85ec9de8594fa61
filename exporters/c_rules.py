"""Rules as C: tables of terms, propositions and rules, and functions that fire them.

Rules that begin with the same propositions share places of a tree. All are fired by
going through the places in order. The winner alone is found by leaving out what lies
below a strength that is exceeded already: minimum and product never grow along a path.
"""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.exporters.c_tables import (
    HIGH_END,
    LEFT_SIDE,
    LOW_END,
    POINTS,
    RIGHT_SIDE,
    Tables,
)
from fuzzytree.exporters.c_text import (
    CNumbers,
    place_type,
    real_table,
    whole_lines,
    whole_table,
)
from fuzzytree.model import WEIGHT_OF_ONE, RuleBase, parts_of, squarings

_MANY_RULES = 16  # from which a first guess at the winner pays
_MOST_KEPT = 512  # propositions whose degrees are kept while rules are evaluated

_HELPERS = """
static name_real name_held(name_real value, name_real low, name_real high)
{
    value = value > low ? value : low;
    return value < high ? value : high;
}
"""

_PROBABILITIES = """
void name_probabilities(
    name_answer found, const name_real *strengths, double *probabilities)
{
    double total = 0, largest = 0;
    unsigned place, rule;
    for (place = 0; place < NAME_CLASSES; place++)
        probabilities[place] = found.rule == 0 ? (double)name_no_number() : 0;
    if (found.rule == 0)
        return;
    for (rule = 0; rule < NAME_RULES; rule++) { /* whole numbers: all sums are exact */
        double weight = (double)strengths[rule];
        const uint32_t *part = name_millionths + rule * NAME_CLASSES;
SQUARE        weight = (double)(uint32_t)(WEIGHT * weight);
        for (place = 0; place < NAME_CLASSES; place++)
            probabilities[place] += weight * part[place];
    }
    for (place = 0; place < NAME_CLASSES; place++)
        if ((int)place != found.label && probabilities[place] > largest)
            largest = probabilities[place];
    if (!(probabilities[found.label] > largest))
        probabilities[found.label] = largest + 1;
    for (place = 0; place < NAME_CLASSES; place++)
        total += probabilities[place];
    for (place = 0; place < NAME_CLASSES; place++)
        probabilities[place] /= total;
}
"""

_HORNER = """
/* c0 + x (c1 + x (c2 + ...)), from the inside out. */
static name_real name_curve(const name_real *c, unsigned count, name_real x)
{
    name_real total = c[--count];
    while (count > 0)
        total = total * x + c[--count];
    return total;
}
"""

_FLANK = """
/* Off a plateau: falls to 0 at n[1], always below 1. */
static name_real name_flank(const name_real *n, unsigned count, name_real x)
{
    if (count == 1)
        return 0;
    return name_held((x - n[1]) / n[2], 0, NAME_BELOW_ONE);
}
"""

_SIDE = """
/* One side of a set: falls with the distance from the mean. */
static name_real name_side(const name_real *n, unsigned count, name_real x)
{
    name_real u = name_held((x - n[0]) / n[1], 0, n[2]);
    name_real t = u < 1 ? u : 1;
    name_real body = name_held(1 - t * name_curve(n + 4, count, 2 * t - 1), 0, 1);
    name_real w = name_held((n[2] - u) / n[3], 0, 1);
    name_real square = w * w;
    return body * (square * square);
}
"""

_LINES = """
/* On the line between the points beside x: values, then degrees. */
static name_real name_line(const name_real *n, unsigned count, name_real x)
{
    const name_real *degree = n + count;
    unsigned low = 0, high = count, near, far;
    name_real width, found;
    while (low < high) { /* n[low - 1] < x <= n[low], by halves */
        unsigned middle = (low + high) / 2;
        if (x > n[middle])
            low = middle + 1;
        else
            high = middle;
    }
    if (low == 0)
        return degree[0];
    if (low == count)
        return degree[count - 1];
    near = degree[low - 1] > 0 ? low : low - 1;
    far = near == low ? low - 1 : low;
    if (!(degree[near] < degree[far] || degree[near] > degree[far]))
        return degree[near];
    width = name_held(n[far] - n[near], -NAME_LARGEST, NAME_LARGEST);
    found = degree[near] + (x - n[near]) / width * (degree[far] - degree[near]);
    if (degree[near] < degree[far])
        return name_held(found, degree[near], degree[far]);
    return name_held(found, degree[far], degree[near]);
}
"""

_CASES = {
    LOW_END: "x > n[0] ? 1 : name_flank(n, count, x); /* low end of a plateau */",
    HIGH_END: "x > n[0] ? name_flank(n, count, x) : 1; /* high end of a plateau */",
    LEFT_SIDE: "name_side(n, count, x); /* left of a mean, with a spread below 0 */",
    RIGHT_SIDE: "name_side(n, count, x); /* right of a mean */",
    POINTS: "name_line(n, count, x); /* points */",
}

_ATOM_START = """
static name_real name_atom(AT atom, name_real x)
{
    const name_real *n = name_number + name_first[atom];
    unsigned count = name_count[atom];
    switch (name_kind[atom]) {
"""

_NO_ATOM = """
static name_real name_atom(AT atom, name_real x)
{
    (void)atom;
    (void)x;
    return 1;
}
"""

_PROPOSITION = """
/* The largest degree of a proposition's terms; of a term the smallest of its atoms. */
static name_real name_degree(AT proposition, const name_real *value)
{
    name_real largest = 0;
    AT part = name_proposition_first[proposition];
    AT end = name_proposition_first[proposition + 1];
    if (part == end)
        return 1;
    for (; part < end; part++) {
        AT term = name_proposition_term[part];
        AT atom = name_term_first[term], last = name_term_first[term + 1];
        name_real least = 1;
        for (; atom < last && least > largest; atom++) {
            name_real one = name_atom(atom, value[name_proposition_line[proposition]]);
            least = one < least ? one : least;
        }
        largest = least > largest ? least : largest;
    }
    return NEGATED;
}
"""

_JOIN = """
static name_real name_join(name_real a, name_real b)
{
    return JOIN;
}
"""

_KEPT = """
/* The same; each proposition is looked at once, and kept is below 0 until it was. */
static name_real name_once(AT proposition, const name_real *value, name_real *kept)
{
    if (kept[proposition] < 0)
        kept[proposition] = name_degree(proposition, value);
    return kept[proposition];
}
"""

_FORGET = """\
    for (place = 0; place < NAME_PROPOSITIONS; place++)
        kept[place] = -1;
"""

_CONCLUDE = """
/* Enter a rule that is as strong as the strongest so far, or stronger. */
static void name_enter(name_answer *found, long rule, int is_stronger)
{
    if (is_stronger || found->rule == 0) {
        found->rule = rule;
        found->status = NAME_DECIDED;
    } else {
        found->rule = rule < found->rule ? rule : found->rule;
        found->status = NAME_TIE;
    }
    found->label = name_label[found->rule - 1];
}
"""

_NO_NUMBER = """
static name_real name_no_number(void)
{
    union { UINT bits; name_real value; } made;
    made.bits = QUIET;
    return made.value;
}
"""

_STRENGTHS = """
name_answer name_strengths(const name_real *x, name_real *strengths)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
    name_real path[NAME_DEPTH + 1], best = 0;
    AT place;
DECLARE_KEPT
    for (place = 0; place < NAME_RULES; place++)
        strengths[place] = name_no_number();
TAKE_AXES
FORGET
    answer.label = NAME_WHEN_UNCOVERED;
    answer.status = NAME_UNCOVERED;
    path[0] = 1;
    for (place = 0; place < NAME_PLACES; place++) {
        unsigned depth = name_depth[place];
        long rule = (long)name_rule[place];
        name_real one = name_join(path[depth - 1], DEGREE(name_proposition[place]));
        path[depth] = one;
        if (rule == 0)
            continue;
        strengths[rule - 1] = one;
        if (one > 0 && one >= best) {
            name_enter(&answer, rule, one > best);
            best = one;
        }
    }
    return answer;
}
"""

_GUESS = """
    /* Follow the best places down to a rule: no winner is weaker than that. */
    for (place = 0, end = NAME_PLACES; place < end;) {
        name_real most = -1;
        AT best_place = place;
        for (; place < end; place = name_skip[place]) {
            name_real one = name_join(path[0], DEGREE(name_proposition[place]));
            if (one > most) {
                most = one;
                best_place = place;
            }
        }
        path[0] = most;
        place = best_place + 1;
        end = name_skip[best_place];
    }
    best = path[0];
    path[0] = 1;
"""

_DECIDE = """
name_answer name_decide(const name_real *x)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
    name_real path[NAME_DEPTH + 1], best = 0;
    AT placeDECLARE_END;
DECLARE_KEPT
TAKE_AXES
FORGET
    answer.label = NAME_WHEN_UNCOVERED;
    answer.status = NAME_UNCOVERED;
    path[0] = 1;
GUESS
    for (place = 0; place < NAME_PLACES;) {
        unsigned depth = name_depth[place];
        long rule = (long)name_rule[place];
        name_real one = name_join(path[depth - 1], DEGREE(name_proposition[place]));
        if (!(one > 0 && one >= best)) { /* nor are those that begin with it */
            place = name_skip[place];
            continue;
        }
        path[depth] = one;
        if (rule != 0) {
            name_enter(&answer, rule, one > best);
            best = one;
        }
        place++;
    }
    return answer;
}
"""


def rules_code(
    tables: Tables, numbers: CNumbers, axes: str, *, is_product: bool
) -> Iterator[str]:
    """Yield the tables of a rule base and the functions that fire it."""
    yield from _data(tables, numbers)
    tallest = max(len(tables.number), len(tables.proposition_term), len(tables.label))
    kind = place_type(max(tallest, len(tables.places.proposition)))
    for template in _functions(tables, numbers):
        text = template.replace("JOIN", "a * b" if is_product else "b < a ? b : a")
        yield text.replace("TAKE_AXES\n", axes).replace("AT ", f"{kind} ")


def probability_code(rules: RuleBase) -> Iterator[str]:
    """Yield the probabilities of all rules in millionths, and what mixes them."""
    parts = [part for rule in rules.rules for part in parts_of(rule.probabilities)]
    about = "The probabilities of the classes, rule by rule, in millionths."
    yield f"/* {about} */\n"
    yield f"static const uint32_t name_millionths[{len(parts)}] = {{\n"
    yield from whole_lines(parts)
    yield "};\n"
    square = "        weight = weight * weight;\n" * squarings(
        rules.semantics.sharpness
    )
    text = _PROBABILITIES.replace("SQUARE", square)
    yield text.replace("WEIGHT", f"{WEIGHT_OF_ONE}")


def _data(tables: Tables, numbers: CNumbers) -> Iterator[str]:
    places = tables.places
    yield f"#define NAME_PLACES {len(places.proposition)}u\n"
    yield f"#define NAME_DEPTH {max(places.depth)}u\n"
    yield f"#define NAME_PROPOSITIONS {len(tables.negated)}u\n"
    about = "The numbers of ends of plateaus, of sides of sets, and of points."
    yield "\n"
    if tables.kind:
        yield from real_table("name_number", tables.number, about, numbers)
    for name, values, about in (
        ("kind", tables.kind or None, "What each of them is."),
        ("count", tables.count or None, "How many coefficients or points it has."),
        ("first", tables.first or None, "Where its numbers begin."),
        ("term_first", tables.term_first, "Where each term begins among them."),
        (
            "proposition_first",
            tables.proposition_first,
            "Where the terms of a proposition begin.",
        ),
        ("proposition_term", tables.proposition_term, "The terms of all propositions."),
        (
            "proposition_line",
            tables.proposition_line,
            "The value that each proposition tests.",
        ),
        ("negated", tables.negated if any(tables.negated) else None, "1: is not."),
        (
            "proposition",
            places.proposition,
            "Beginnings of rules, in order: the last proposition,",
        ),
        ("depth", places.depth, "how many there are,"),
        ("skip", places.skip, "the place behind all rules that begin so,"),
        ("rule", places.rule, "and the number of the rule that it is, or 0."),
        ("label", tables.label, "The class of each rule."),
    ):
        if values is not None:
            yield from whole_table(f"name_{name}", values or [0], about)


def _functions(tables: Tables, numbers: CNumbers) -> Iterator[str]:
    kinds = set(tables.kind)
    has_flank, has_side = kinds & {LOW_END, HIGH_END}, kinds & {LEFT_SIDE, RIGHT_SIDE}
    if has_flank:
        yield f"\n#define NAME_BELOW_ONE {numbers.text(numbers.below_one)}\n"
    if POINTS in kinds:
        yield f"\n#define NAME_LARGEST {numbers.text(numbers.largest)}\n"
    yield _HELPERS if kinds else ""
    yield _HORNER if has_side else ""
    yield _FLANK if has_flank else ""
    yield _SIDE if has_side else ""
    yield _LINES if POINTS in kinds else ""
    yield _atom(sorted(kinds)) if kinds else _NO_ATOM
    is_negated = "name_negated[proposition] ? 1 - largest : largest"
    yield _PROPOSITION.replace(
        "NEGATED", is_negated if any(tables.negated) else "largest"
    )
    yield _JOIN
    yield _CONCLUDE
    propositions, places = len(tables.negated), len(tables.places.proposition)
    is_kept = propositions <= _MOST_KEPT and 2 * places >= 3 * propositions
    yield _KEPT if is_kept else ""
    is_double = numbers.name == "double"
    quiet = _NO_NUMBER.replace("UINT", "uint64_t" if is_double else "uint32_t")
    bits = "UINT64_C(0x7ff8000000000000)" if is_double else "UINT32_C(0x7fc00000)"
    yield quiet.replace("QUIET", bits)
    yield _settled(_STRENGTHS, is_kept=is_kept)
    is_guessed = len(tables.label) >= _MANY_RULES
    decide = _DECIDE.replace("GUESS\n", _GUESS.lstrip("\n") if is_guessed else "")
    decide = decide.replace("DECLARE_END", ", end" if is_guessed else "")
    yield _settled(decide, is_kept=is_kept)


def _atom(kinds: list[int]) -> str:
    lines = [f"    case {kind}: return {_CASES[kind]}\n" for kind in kinds[:-1]]
    lines.append(f"    default: return {_CASES[kinds[-1]]}\n")
    return "".join([_ATOM_START, *lines, "    }\n}\n"])


def _settled(function: str, *, is_kept: bool) -> str:
    """Return a function that keeps the degrees of propositions, or does not."""
    look = "name_proposition[place], value"
    text = function.replace(
        "DEGREE(name_proposition[place])",
        f"name_once({look}, kept)" if is_kept else f"name_degree({look})",
    )
    declared = "    name_real kept[NAME_PROPOSITIONS];\n" if is_kept else ""
    text = text.replace("DECLARE_KEPT\n", declared)
    return text.replace("FORGET\n", _FORGET if is_kept else "")

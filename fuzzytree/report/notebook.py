"""Models and results as `str` prints them, and as a notebook shows them.

A result is a `fuzzytree.model.Result` and has a line in `_LINES`, the lines that its
verb prints; a notebook shows these, or what `html_of` has for its type.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any, Final

from fuzzytree.auditing import Audit, Code, Compliance, Difference, Explanation
from fuzzytree.benchmarking import Footprint, Study
from fuzzytree.checking import Stability
from fuzzytree.model import (
    Agreement,
    FuzzySystem,
    FuzzyTree,
    Result,
    RuleBase,
    TreeAgreement,
)
from fuzzytree.numerics import Certificate
from fuzzytree.report.audit import audit_lines, explanation_lines
from fuzzytree.report.bench import study_lines
from fuzzytree.report.diff import diff_lines
from fuzzytree.report.markup import Markup
from fuzzytree.report.models import head_lines, model_lines, term_lines
from fuzzytree.report.needs import report_lines
from fuzzytree.report.parts import part
from fuzzytree.report.require import compliance_lines
from fuzzytree.report.stability import stability_lines
from fuzzytree.report.text import agreement_lines
from fuzzytree.report.trees import tree_lines
from fuzzytree.report.why import why_lines
from fuzzytree.runtimes import Outputs, Predictions

_MOST_ROWS = 10  # of predictions in a notebook

_LINES: Final[dict[type[Any], Callable[[Any], Iterable[str]]]] = {
    Agreement: agreement_lines,
    Audit: functools.partial(audit_lines, is_verbose=False),
    Certificate: lambda certificate: [certificate.sentence, certificate.origin],
    Code: explanation_lines,
    Compliance: compliance_lines,
    Difference: diff_lines,
    Explanation: why_lines,
    Footprint: report_lines,
    FuzzySystem: model_lines,
    FuzzyTree: model_lines,
    RuleBase: model_lines,
    Stability: stability_lines,
    Study: study_lines,
    TreeAgreement: tree_lines,
}


def lines_of(result: Result) -> Iterable[str]:
    """Return the lines that the command of a result prints.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> [*lines_of(random_tree(1, leaves=2))][0]
        'random 2: fuzzy tree, 1 node, 2 leaves, depth 1'
    """
    return _LINES[type(result)](result)


@functools.singledispatch
def html_of(result: Result) -> Markup:
    """Return what a notebook shows of a result: its lines, or tables where it has them.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> "line-height" in html_of(random_tree(1))
        True
    """
    lines = lines_of(result) if type(result) in _LINES else str(result).splitlines()
    return _printed(lines)


@html_of.register
def _(rules: RuleBase) -> Markup:
    terms = _printed(term_lines(rules.variables))
    tables = part("rule_base", _printed(head_lines(rules)), rules, terms)
    return part("aligned", tables)


@html_of.register
def _(agreement: Agreement) -> Markup:
    return part("aligned", part("agreement", agreement))


@html_of.register
def _(audit: Audit) -> Markup:
    return _printed(audit_lines(audit))


@html_of.register
def _(answers: Predictions | Outputs) -> Markup:
    columns = answers[:_MOST_ROWS].columns()
    rows = zip(range(len(answers)), *columns.values(), strict=False)
    caption = str(answers)
    if len(answers) > _MOST_ROWS:
        caption += f"; the first {_MOST_ROWS} rows"
    numbers = range(1, len(columns)) if "class" not in columns else (2,)
    head, body = ("row", *columns), [*islice(rows, _MOST_ROWS)]
    return part("aligned", part("table", head, body, caption, right=numbers))


def _printed(lines: Iterable[str]) -> Markup:
    return part("printed", [*lines])

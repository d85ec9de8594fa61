"""Models and results as HTML for a notebook, by the renderers of text and pages."""

from __future__ import annotations

from collections.abc import Iterable

from fuzzytree.auditing import Audit
from fuzzytree.model import Agreement, Document
from fuzzytree.report.audit import audit_lines
from fuzzytree.report.markup import Markup
from fuzzytree.report.models import head_lines, model_lines, term_lines
from fuzzytree.report.parts import part


def model_html(model: Document) -> Markup:
    """Return a model: rules as a table, a tree or a system as `show` prints it.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> model_html(random_tree(1)).startswith("<pre>")
        True
    """
    if model.leaves or model.outputs:
        return _lines(model_lines(model))
    terms = _lines(term_lines(model.variables))
    return part("rule_base", _lines(head_lines(model)), model, terms)


def agreement_html(agreement: Agreement) -> Markup:
    """Return the result of a check as a table."""
    return part("agreement", agreement)


def audit_html(audit: Audit) -> Markup:
    """Return an audit: its verdict, and all else as it is printed."""
    verdict, *rest = audit_lines(audit)
    return part("printed", rest, verdict)


def _lines(lines: Iterable[str]) -> Markup:
    return part("printed", [*lines])

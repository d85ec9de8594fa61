"""Pages of a model that a browser opens from a file."""

from __future__ import annotations

import os
import shlex
from typing import TYPE_CHECKING

from fuzzytree import checking, report
from fuzzytree.api.verbs import rows_of
from fuzzytree.model import ModelPath

if TYPE_CHECKING:
    from fuzzytree.model import ModelSource
    from fuzzytree.report import Page


def page(model: ModelSource, data: object = None, *, allow_loss: bool = False) -> Page:
    """Return a page that runs a model: inputs to move, what it answers, and why.

    The page is one file that loads nothing. Its answers are those of the JavaScript
    that `export` writes, which has the bits of `run`.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        data: A table whose rows can be chosen in the page, which holds the first 300
            of them; the ends of the sliders are those of its columns. Without one they
            are the ranges of the model, or the ends of its terms.
        allow_loss: As in `load`.

    Returns:
        A page, which a notebook shows; `page.save("model.html")` writes it.

    Raises:
        ReadError: If the file cannot be read.
        LossError: As `load`.
        TableError: If a column is absent or holds text, or the table has no row.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> page(random_tree(1)).html.startswith("<!doctype html>")
        True
    """
    document = checking.as_model(model, allow_loss=allow_loss)
    words = ["fuzzytree", "why", "MODEL"]
    if isinstance(model, str | os.PathLike):
        words[2] = os.fspath(model)
    if isinstance(model, ModelPath) and model.read_as is not None:
        words += ["--from", model.read_as]
    rows = rows_of(data, document)
    return report.what_if_page(document, rows, command=shlex.join(words))

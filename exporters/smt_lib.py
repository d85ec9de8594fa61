"""SMT-LIB 2: a model as text for solvers, a function for each term and rule.

It is `fuzzytree.rechecking` that writes it, from the model's YAML.
"""

from __future__ import annotations

from fuzzytree.errors import LossError
from fuzzytree.exporters.table import find_format
from fuzzytree.model import Document, Format, Written
from fuzzytree.rechecking import CannotRunError, model_text


def write(model: Document, /, *, allow_loss: bool = False) -> Written:
    """Return a model as SMT-LIB 2, its inputs within their declared ranges.

    Args:
        model: The model.
        allow_loss: Without effect: what cannot be written whole is not written.

    Raises:
        LossError: If it has a norm other than the minimum, product and maximum, or a
            condition on an output.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> text = write(random_tree(1, leaves=1)).content.decode()
        >>> text.splitlines()[0]
        '(set-logic QF_LRA)'
    """
    content = find_format("yaml").write(model).content
    try:
        return Written(model_text(content).encode())
    except CannotRunError as error:
        name = model.name[:100]
        raise LossError(f"cannot write {name} as smt-lib: {error}") from error


FORMAT = Format(
    name="smt-lib",
    suffixes=(".smt2",),
    write=write,
    cannot=(
        "norms other than minimum, product and maximum",
        "conditions on outputs",
        "outputs of systems: only how far each rule applies is written",
    ),
)

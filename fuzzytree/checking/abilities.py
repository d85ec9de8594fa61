"""What each format can carry, found by writing and reading, and claimed by nobody."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, cast

import msgspec

from fuzzytree.checking.equivalence import equivalence
from fuzzytree.checking.kinds import formed
from fuzzytree.errors import FuzzyTreeError, LossError, MissingExtraError
from fuzzytree.model import Document, Format, Written, kind_of, options_of
from fuzzytree.semantics import all_samples

Outcome = Literal["equal", "alike", "written", "points", "lossy", "refused", "no"]
"""How far a format carries something, the best first; see `Ability`."""

MEANINGS: Mapping[Outcome, str] = {
    "equal": "written without loss, and read back as the equal model",
    "alike": "written without loss, and read back with other names or notes",
    "written": "written without loss, and not read back",
    "points": "curves become points, within a stated bound that can be set",
    "lossy": "written with --allow-loss, which lists what is lost",
    "refused": "never written; the error has the reason",
    "no": "not a kind of model that the format carries",
}


class Ability(msgspec.Struct, frozen=True):
    """What came of a small model in a format.

    Attributes:
        sample: What is special about the model.
        outcome: `equal`, `alike`, `written`: without a loss. `points`: curves became
            points within a bound. `lossy`: something else was lost. `refused`, `no`: it
            cannot be written.
        reasons: The losses, or why not, in sentences.
        bound: The largest error of a degree, where curves became points.
    """

    sample: str
    outcome: Outcome
    reasons: tuple[str, ...] = ()
    bound: float | None = None


def abilities_of(
    form: Format,
    models: Mapping[str, Document] | None = None,
    *,
    dialect: str | None = None,
) -> tuple[Ability, ...]:
    """Return what comes of each sample in a format.

    Args:
        form: The format.
        models: The samples; those of `fuzzytree.semantics.samples` unless given.
        dialect: Of the file; the writer's own unless given.

    Raises:
        MissingExtraError: If a package is missing that the format needs.

    Example:
        >>> from fuzzytree.exporters import find_format
        >>> abilities_of(find_format("python"))[0].outcome
        'written'
    """
    samples = all_samples() if models is None else models
    options = {} if dialect is None else {"dialect": dialect}
    return tuple(
        _ability(form, name, model, options) for name, model in samples.items()
    )


def dialects_of(form: Format) -> tuple[str, ...]:
    """Return the dialects that a format's writer knows, its own first.

    Example:
        >>> from fuzzytree.exporters import find_format
        >>> dialects_of(find_format("fcl"))[0]
        'portable'
    """
    for one in options_of(form):
        if one.name == "dialect":
            others = [choice for choice in one.choices if choice != one.default]
            return (str(one.default), *others)
    return ()


def _ability(
    form: Format, name: str, model: Document, options: Mapping[str, str]
) -> Ability:
    try:
        document = formed(model, form)
    except LossError:
        return Ability(name, "no")
    if kind_of(document) not in form.carries:
        return Ability(name, "no")
    # Each writer checks its own options; the protocol knows the common one alone.
    write = cast("Callable[..., Written]", form.write)
    try:
        written = write(document, allow_loss=True, **options)
    except MissingExtraError:
        raise
    except FuzzyTreeError as error:
        return Ability(name, "refused", (str(error),))
    if written.losses:
        reasons = tuple(f"{loss.where}: {loss.what}" for loss in written.losses)
        bounds = [loss.bound for loss in written.losses if loss.bound is not None]
        is_bounded = len(bounds) == len(written.losses)
        bound = max(bounds, default=None)
        return Ability(name, "points" if is_bounded else "lossy", reasons, bound)
    if form.read is None:
        return Ability(name, "written")
    again = form.read(written.content, form.name)
    match equivalence(document, written, again):
        case "equal" if not again.losses:
            return Ability(name, "equal")
        case "equal" | "alike" | "renamed":
            return Ability(name, "alike")
        case "other":
            return Ability(name, "lossy", ("it is read back as another model",))

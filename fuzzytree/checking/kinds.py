"""Kinds of models: what each is called, and what formats make of it."""

from __future__ import annotations

from typing import cast

from fuzzytree.errors import LossError
from fuzzytree.exporters import all_formats
from fuzzytree.model import (
    Conjunction,
    Document,
    Format,
    FuzzySystem,
    FuzzyTree,
    Kind,
    ModelKind,
    RuleBase,
    kind_of,
)
from fuzzytree.semantics import as_rules, as_system, rules_from_tree

CALLED: dict[ModelKind, str] = {
    "tree": "tree",
    "rules": "rule base",
    "system": "fuzzy system",
}
"""What people call each representation."""


def formed(
    model: Document,
    form: Format,
    *,
    representation: ModelKind | None = None,
    kind: Kind | None = None,
    conjunction: Conjunction | None = None,
) -> Document:
    """Return a model in the wanted form, or in one that a format carries.

    Without options a model stays what it is. Where the format does not carry
    that, a tree becomes rules, rules become the system that decides alike, and a
    system that decides as rules do becomes those rules.

    Args:
        model: A tree, a rule base or a system.
        form: The format that it goes to.
        representation: What it shall be.
        kind: The terms of rules made from a tree; relative unless given.
        conjunction: The AND of rules made from a tree.

    Raises:
        LossError: If the format does not carry it in any form.
        ValueError: If the model has no such form.
    """
    if model.rules:
        _refuse_remaking(model, representation, kind, conjunction)
    else:
        usual = "rules" if kind or conjunction else _nearest("tree", form)
        wanted = representation or usual
        if wanted == "tree":
            return model
        tree = cast("FuzzyTree", model)
        model = rules_from_tree(tree, kind or "relative", conjunction=conjunction)
    wanted = representation or _nearest(kind_of(model), form)
    if wanted == kind_of(model):
        return model
    if not model.outputs:
        return as_system(cast("RuleBase", model), scores="winner")
    rules = as_rules(cast("FuzzySystem", model), None)
    if rules is not None:
        return rules
    if representation:
        raise ValueError(
            f"as rules: {model.name} is a fuzzy system whose outputs are numbers, "
            "and no rules that decide for a class can be made of it"
        )
    raise LossError(
        f"cannot write {model.name} as {form.name}: it carries "
        f"{' or '.join(form.carries)}, and this is a fuzzy system whose outputs "
        f"are numbers; {_carriers('system')}"
    )


def refuse_other_kind(model: Document, form: Format) -> None:
    """Refuse a model whose kind a format does not carry.

    Raises:
        LossError: If it does not.
    """
    kind = kind_of(model)
    if kind in form.carries:
        return
    nearest, way_out = _nearest(kind, form), _carriers(kind)
    if nearest != kind:
        noun = "rules" if nearest == "rules" else f"a {CALLED[nearest]}"
        way_out = f"fuzzytree.convert makes {noun} of it"
    raise LossError(
        f"cannot write {model.name} as {form.name}: it carries "
        f"{' or '.join(form.carries)}, and this is a {CALLED[kind]}; {way_out}"
    )


def _carriers(representation: ModelKind) -> str:
    """Return the formats that carry a kind of model, in words."""
    names = (form.name for form in all_formats() if representation in form.carries)
    return f"{', '.join(names)} carry one"


_FORMS: dict[ModelKind, tuple[ModelKind, ...]] = {
    "tree": ("tree", "rules", "system"),
    "rules": ("rules", "system"),
    "system": ("system", "rules"),
}
"""What each kind of model can be turned into, the nearest first."""


def _nearest(representation: ModelKind, form: Format) -> ModelKind:
    """Return the nearest kind of model that a format carries, or else the same."""
    for nearest in _FORMS[representation]:
        if nearest in form.carries:
            return nearest
    return representation


def _refuse_remaking(
    model: Document,
    representation: ModelKind | None,
    kind: Kind | None,
    conjunction: Conjunction | None,
) -> None:
    """Refuse what can be made of a tree alone, unless the model is of that form.

    Raises:
        ValueError: If it is not.
    """
    what = f"{model.name} is a {CALLED[kind_of(model)]}"
    if representation == "tree":
        raise ValueError(f"as tree: {what}, and no tree can be made of it")
    own: dict[str, str | None] = {}
    why = "; such rules are made from a tree"
    if not model.outputs:
        rules = cast("RuleBase", model)
        own = {"terms": rules.kind, "conjunction": rules.semantics.conjunction}
    for option, wanted in (("terms", kind), ("conjunction", conjunction)):
        if wanted is not None and wanted != own.get(option):
            if own:
                noun = own[option] or "other"
                why = f" with {noun}; other rules are made from the tree"
            raise ValueError(f"{option} {wanted}: {what}{why}")

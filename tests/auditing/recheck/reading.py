"""Models of every kind, and how the re-checker reads them."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.auditing.recheck import model_records
from fuzzytree.auditing.recheck.models import read_file
from fuzzytree.errors import LossError
from fuzzytree.exporters import yaml
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.testing import exporter_models


def models(seed: int) -> Iterator[RuleBase | FuzzyTree]:
    """Yield models of every kind that can be written."""
    for _, model in exporter_models(seed):
        if isinstance(model, RuleBase | FuzzyTree):
            try:
                yaml.write(model)
            except LossError:
                continue
            yield model


def read(model: RuleBase | FuzzyTree) -> model_records.Model:
    """Return a model as the re-checker reads it."""
    found, _ = read_file(yaml.write(model).content, "model.yaml")
    assert not isinstance(found, model_records.System)
    return found

"""Rule bases as systems with numeric outputs, the way back, and points for curves."""

from __future__ import annotations

from fuzzytree.semantics.conversion.facts import FACTS, as_rules, as_written, facts_of
from fuzzytree.semantics.conversion.points import check_tolerance, pointed
from fuzzytree.semantics.conversion.rule_forms import (
    joined_by_number,
    joined_outputs,
    number_losses,
)
from fuzzytree.semantics.conversion.scores import (
    Always,
    Scores,
    as_system,
    cast_losses,
    cast_remarks,
    flattened,
    refuse_singletons,
    winner,
)

__all__ = [
    "FACTS",
    "Always",
    "Scores",
    "as_rules",
    "as_system",
    "as_written",
    "cast_losses",
    "cast_remarks",
    "check_tolerance",
    "facts_of",
    "flattened",
    "joined_by_number",
    "joined_outputs",
    "number_losses",
    "pointed",
    "refuse_singletons",
    "winner",
]

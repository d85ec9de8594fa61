"""Learn fuzzy decision trees, read them as rules, run them anywhere, prove them equal.

Nothing heavy is loaded before it is used: each name below comes from the module that
stands beside it at its first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fuzzytree.api import (
        audit,
        bench,
        certify,
        check,
        convert,
        diff,
        draw,
        explain,
        export,
        learn,
        load,
        material,
        needs,
        read,
        recheck,
        rules_from_tree,
        run,
        save,
        stability,
    )
    from fuzzytree.auditing import AuditDomain, AuditSelection, AuditSettings
    from fuzzytree.benchmarking import BenchSettings
    from fuzzytree.errors import FuzzyTreeError
    from fuzzytree.estimator import FuzzyTreeClassifier
    from fuzzytree.formats import from_simpful, from_skfuzzy, from_sklearn
    from fuzzytree.learning import LearningSettings
    from fuzzytree.model import (
        Agreement,
        CheckSettings,
        FuzzySystem,
        FuzzyTree,
        RuleBase,
    )
    from fuzzytree.runtimes import Outputs, Predictions
    from fuzzytree.tables import table

    __version__: str

__all__ = [
    "Agreement",
    "AuditDomain",
    "AuditSelection",
    "AuditSettings",
    "BenchSettings",
    "CheckSettings",
    "FuzzySystem",
    "FuzzyTree",
    "FuzzyTreeClassifier",
    "FuzzyTreeError",
    "LearningSettings",
    "Outputs",
    "Predictions",
    "RuleBase",
    "__version__",
    "audit",
    "bench",
    "certify",
    "check",
    "convert",
    "diff",
    "draw",
    "explain",
    "export",
    "from_simpful",
    "from_skfuzzy",
    "from_sklearn",
    "learn",
    "load",
    "material",
    "needs",
    "read",
    "recheck",
    "rules_from_tree",
    "run",
    "save",
    "stability",
    "table",
]

_HOMES = {
    "Agreement": "fuzzytree.model.agreement",
    "Predictions": "fuzzytree.runtimes.predictions",
    "AuditDomain": "fuzzytree.auditing.findings.domains",
    "AuditSelection": "fuzzytree.auditing.findings.records",
    "AuditSettings": "fuzzytree.auditing.findings.records",
    "BenchSettings": "fuzzytree.benchmarking.study",
    "CheckSettings": "fuzzytree.model.agreement",
    "FuzzySystem": "fuzzytree.model.system",
    "FuzzyTree": "fuzzytree.model.tree",
    "FuzzyTreeClassifier": "fuzzytree.estimator",
    "FuzzyTreeError": "fuzzytree.errors",
    "LearningSettings": "fuzzytree.learning.settings",
    "Outputs": "fuzzytree.runtimes.predictions",
    "RuleBase": "fuzzytree.model.rulebase",
    "audit": "fuzzytree.api.verbs",
    "bench": "fuzzytree.api.verbs",
    "certify": "fuzzytree.api.verbs",
    "check": "fuzzytree.api.verbs",
    "convert": "fuzzytree.api.verbs",
    "diff": "fuzzytree.api.verbs",
    "draw": "fuzzytree.api.verbs",
    "explain": "fuzzytree.api.verbs",
    "export": "fuzzytree.api.verbs",
    "from_simpful": "fuzzytree.formats.simpful",
    "from_skfuzzy": "fuzzytree.formats.skfuzzy",
    "from_sklearn": "fuzzytree.formats.sklearn",
    "learn": "fuzzytree.api.verbs",
    "load": "fuzzytree.api.verbs",
    "material": "fuzzytree.api.verbs",
    "needs": "fuzzytree.api.verbs",
    "read": "fuzzytree.api.verbs",
    "recheck": "fuzzytree.api.verbs",
    "rules_from_tree": "fuzzytree.api.verbs",
    "run": "fuzzytree.api.verbs",
    "save": "fuzzytree.api.verbs",
    "stability": "fuzzytree.api.verbs",
    "table": "fuzzytree.tables",
}


if not TYPE_CHECKING:  # a type checker knows the names above, and no others

    def __getattr__(name: str) -> object:
        """Load a public name from its module, once."""
        if name == "__version__":
            value: object = importlib.import_module(_HOMES["Agreement"]).version()
        elif name in _HOMES:
            value = getattr(importlib.import_module(_HOMES[name]), name)
        else:
            raise AttributeError(f"module 'fuzzytree' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)

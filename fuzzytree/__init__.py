"""Learn fuzzy decision trees, read them as rules, run them anywhere, prove them equal.

Nothing heavy is loaded before it is used: each name below comes from the module that
stands beside it when it is first asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fuzzytree.agreement import Agreement
    from fuzzytree.answers import Answers
    from fuzzytree.errors import FuzzyTreeError
    from fuzzytree.estimator import FuzzyTreeClassifier
    from fuzzytree.outputs import Outputs
    from fuzzytree.readers.simpful import from_simpful
    from fuzzytree.readers.skfuzzy import from_skfuzzy
    from fuzzytree.readers.sklearn import from_sklearn
    from fuzzytree.rulebase import RuleBase
    from fuzzytree.system import FuzzySystem
    from fuzzytree.tree import FuzzyTree
    from fuzzytree.verbs import (
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
        needs,
        read,
        recheck,
        rules_from_tree,
        run,
        save,
        stability,
    )

    __version__: str

__all__ = [
    "Agreement",
    "Answers",
    "FuzzySystem",
    "FuzzyTree",
    "FuzzyTreeClassifier",
    "FuzzyTreeError",
    "Outputs",
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
    "needs",
    "read",
    "recheck",
    "rules_from_tree",
    "run",
    "save",
    "stability",
]

_HOMES = {
    "Agreement": "fuzzytree.agreement",
    "Answers": "fuzzytree.answers",
    "FuzzySystem": "fuzzytree.system",
    "FuzzyTree": "fuzzytree.tree",
    "FuzzyTreeClassifier": "fuzzytree.estimator",
    "FuzzyTreeError": "fuzzytree.errors",
    "Outputs": "fuzzytree.outputs",
    "RuleBase": "fuzzytree.rulebase",
    "audit": "fuzzytree.verbs",
    "bench": "fuzzytree.verbs",
    "certify": "fuzzytree.verbs",
    "check": "fuzzytree.verbs",
    "convert": "fuzzytree.verbs",
    "diff": "fuzzytree.verbs",
    "draw": "fuzzytree.verbs",
    "explain": "fuzzytree.verbs",
    "export": "fuzzytree.verbs",
    "from_simpful": "fuzzytree.readers.simpful",
    "from_skfuzzy": "fuzzytree.readers.skfuzzy",
    "from_sklearn": "fuzzytree.readers.sklearn",
    "learn": "fuzzytree.verbs",
    "load": "fuzzytree.verbs",
    "needs": "fuzzytree.verbs",
    "read": "fuzzytree.verbs",
    "recheck": "fuzzytree.verbs",
    "rules_from_tree": "fuzzytree.verbs",
    "run": "fuzzytree.verbs",
    "save": "fuzzytree.verbs",
    "stability": "fuzzytree.verbs",
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

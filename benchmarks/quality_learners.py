"""The learners of the study of quality, each with the settings that it is run with.

A learner makes an estimator in the manner of scikit-learn for a table whose text
columns are codes, and tells the size of a fitted one. Where an estimator takes numbers
only, text columns are one-hot; where it knows categories, it is told of them. To hold
C5.0 to 10 leaves, the least rows of a leaf are doubled; FIGS gets fewer splits.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import quality_tables as tables
from quality_tables import Table
from sklearn.base import BaseEstimator, ClassifierMixin

Make = Callable[[Table, int], Any]
Told = Callable[[Table], dict[str, Any]]

Size = tuple[float, float]
UNKNOWN = (float("nan"), float("nan"))
MOST = 10
"""Leaves or rules of a small model."""


def _no_size(_model: Any) -> Size:
    return UNKNOWN


def _size(rules: Iterable[Iterable[Any]]) -> Size:
    """Return the number of rules and of columns in one, from the columns of each."""
    used = [len(set(columns)) for columns in rules]
    return len(used), float(np.mean(used)) if used else 0.0


def _leaves(
    node: Any, children: Callable[[Any], Iterable[Any]], columns: frozenset[Any]
) -> Iterator[frozenset[Any]]:
    """Yield the columns on the way to each leaf below a node that names its column."""
    below = list(children(node))
    if not below:
        yield columns
        return
    column = node.feature_index if hasattr(node, "feature_index") else node.feature
    for child in below:
        yield from _leaves(child, children, columns | {column})


def _by_name(node: Any) -> list[Any]:
    return list(node.children.values())


def _left_and_right(node: Any) -> list[Any]:
    return [] if node.left is None else [node.left, node.right]


@dataclass(frozen=True)
class Learner:
    """One line of the tables of results.

    Attributes:
        make: From a table and the leaves that `like` had in this fold to an estimator.
        size: From a fitted estimator to its leaves (or rules) and the mean number of
            columns of a rule; nan where it has none.
        is_small: Whether it has at most 10 leaves or rules.
        like: The learner whose leaves it is held to, which must have been run before.
        takes_frame: Whether it is given a pandas frame with categories by name.
        package: The package that it comes from.
    """

    make: Make
    size: Callable[[Any], Size] = _no_size
    is_small: bool = False
    like: str = ""
    takes_frame: bool = False
    package: str = "scikit-learn"


def _prepared(table: Table, estimator: Any, *, scaled: bool = False) -> Any:
    from sklearn.compose import make_column_transformer
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import OneHotEncoder, StandardScaler

    texts = np.flatnonzero(table.is_categorical)
    one_hot = OneHotEncoder(handle_unknown="ignore", sparse_output=False)
    steps = [StandardScaler()] if scaled else []
    if len(texts):
        columns = make_column_transformer((one_hot, texts), remainder="passthrough")
        steps.insert(0, columns)
    return make_pipeline(*steps, estimator)


class Small(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # both are untyped
    """The first of several estimators whose model has so few leaves or rules."""

    def __init__(
        self, makes: Iterable[Callable[[], Any]], size: Callable[[Any], Size], most: int
    ) -> None:
        self.makes = makes
        self.size = size
        self.most = most

    def fit(self, values: Any, labels: Any) -> Any:
        """Fit one after another; the last one counts where none is small."""
        for make in self.makes:
            self.model_ = make().fit(values, labels)
            if self.size(self.model_)[0] <= self.most:
                break
        self.classes_ = self.model_.classes_
        return self

    def predict(self, values: Any) -> Any:
        """Return the class of each row."""
        return self.model_.predict(values)

    def predict_proba(self, values: Any) -> Any:
        """Return the probability of each class."""
        return self.model_.predict_proba(values)


class OrderedRipper:
    """RIPPER for any number of classes, as Cohen has it: the rarest class first.

    Each class but the most frequent one is told from those that are left.
    """

    def __init__(self, most: int | None) -> None:
        self.most = most  # rules for each class

    def fit(self, values: Any, labels: tables.IntArray) -> Any:
        """Learn a set of rules for each class but one."""
        from wittgenstein import RIPPER

        order = np.argsort(np.bincount(labels), kind="stable")
        self.steps: list[tuple[int, Any]] = []
        for code in order[:-1]:
            ripper = RIPPER(random_state=0, max_rules=self.most)
            is_class = (labels == code).astype(int)
            ripper.fit(values, is_class, pos_class=1)
            self.steps.append((int(code), ripper))
            values, labels = values[labels != code], labels[labels != code]
        self.default = int(order[-1])
        return self

    def predict(self, values: Any) -> tables.IntArray:
        """Return the class of the first set that covers each row."""
        answers = np.full(len(values), self.default)
        for code, ripper in reversed(self.steps):
            answers[np.asarray(ripper.predict(values), bool)] = code
        return answers


def _peer(
    path: str, told: Told | None = None, *, scaled: bool = False, **settings: Any
) -> Make:
    """Return what makes an estimator of a class by its path, imported when needed.

    Args:
        path: Of the class.
        told: What it is told of the table; without it, text columns are one-hot.
        scaled: Whether columns are brought to mean 0 and standard deviation 1.
        settings: Of the class.
    """
    module, _, name = path.rpartition(".")

    def make(table: Table, _leaves: int) -> Any:
        kind = getattr(importlib.import_module(module), name)
        if told:
            return kind(**told(table), **settings)
        return _prepared(table, kind(**settings), scaled=scaled)

    return make


def _columns(table: Table) -> dict[str, Any]:
    columns = np.flatnonzero(table.is_categorical).tolist()
    return {"categorical_features": columns or None}


def _tree(**settings: Any) -> Make:
    def make(table: Table, leaves: int) -> Any:
        from sklearn.tree import DecisionTreeClassifier

        bound = {"max_leaf_nodes": max(leaves, 2)} if leaves else {}
        tree = DecisionTreeClassifier(random_state=0, **settings, **bound)
        return _prepared(table, tree)

    return make


def _tree_size(model: Any) -> Size:
    tree = model[-1].tree_
    rules = []
    stack: list[tuple[int, frozenset[int]]] = [(0, frozenset())]
    while stack:
        node, columns = stack.pop()
        if tree.children_left[node] < 0:
            rules.append(columns)
            continue
        columns |= {int(tree.feature[node])}
        stack += [(tree.children_left[node], columns)]
        stack += [(tree.children_right[node], columns)]
    return _size(rules)


def _figs(table: Table, leaves: int) -> Any:
    from imodels import FIGSClassifier

    fresh = partial(FIGSClassifier, random_state=0)
    if leaves:  # splits and trees together
        fewer = (partial(fresh, max_rules=k) for k in range(max(leaves - 1, 1), 0, -1))
        return _prepared(table, Small(list(fewer), _figs_size, leaves))
    return _prepared(table, fresh())


def _small_figs(table: Table, _leaves: int) -> Any:
    return _figs(table, MOST)


def _figs_size(model: Any) -> Size:
    model = getattr(model, "model_", model)
    return _size(
        rule
        for root in model.trees_
        for rule in _leaves(root, _left_and_right, frozenset())
    )


def _in_pipeline(size: Callable[[Any], Size]) -> Callable[[Any], Size]:
    return lambda model: size(model[-1])


def _c5(kind: str, *, is_small: bool = False) -> Make:
    def make(table: Table, _leaves: int) -> Any:
        import c50py

        fresh = partial(getattr(c50py, kind), **_columns(table))
        if not is_small:
            return fresh()
        more = (2**k for k in range(1, len(table.labels).bit_length()))
        larger = [partial(fresh, min_samples_leaf=least) for least in more]
        return Small(larger, _c5_size, MOST)

    return make


def _c5_size(model: Any) -> Size:
    model = getattr(model, "model_", model)
    if hasattr(model, "rules_"):
        rules = [{test.feature for test in rule.conditions} for rule in model.rules_]
        return _size([*rules, ()])  # the default
    return _size(_leaves(model.tree_, _by_name, frozenset()))


def _ripper(table: Table, _leaves: int) -> Any:
    return OrderedRipper(None)


def _small_ripper(table: Table, _leaves: int) -> Any:
    return OrderedRipper(max((MOST - 1) // table.labels.max(), 1))


def _ripper_size(model: OrderedRipper) -> Size:
    rules = [
        {test.feature for test in rule.conds}
        for _, ripper in model.steps
        for rule in ripper.ruleset_.rules
    ]
    return _size([*rules, ()])  # the default


def _optimal_size(model: Any) -> Size:
    def below(node: Any) -> list[Any]:
        return [] if node.is_leaf_node() else [node.left_child, node.right_child]

    return _size(_leaves(model[-1].get_tree(), below, frozenset()))


def _ferl_size(model: Any) -> Size:
    return _size(leaf["path_features"] for leaf in model[-1]._extract_leaves())


def _fuzzy_rules_size(model: Any) -> Size:
    return _size([*model[-1]._rules["features"], ()])  # the default


def _fuzzydtree_size(model: Any) -> Size:
    return _size(_leaves(model.tree_, _left_and_right, frozenset()))


def _htsk_size(model: Any) -> Size:
    return float(model[-1].model_.n_rules), float(model[-1].n_features_in_)


def _farc_size(model: Any) -> Size:
    rules = model.final_rule_base_.ruleBase
    return _size(np.flatnonzero(rule.antecedent[:, 0] >= 0) for rule in rules)


def _fuzzytree_size(model: Any) -> Size:
    from fuzzytree.semantics import rules_from_tree

    rules = rules_from_tree(model.tree_)
    inputs = {
        variable.name: {part.input for part in variable.parts} or {variable.name}
        for variable in rules.variables
    }
    return _size(
        set[str]().union(*(inputs[one.variable] for one in rule.when))
        for rule in rules.rules
    )


OURS = "fuzzytree"


def _ours(*, is_small: bool = False, **settings: Any) -> Learner:
    return Learner(
        _peer("fuzzytree.estimator.FuzzyTreeClassifier", lambda _table: {}, **settings),
        _fuzzytree_size,
        is_small,
        takes_frame=True,
        package="fuzzytree-toolkit",
    )


LEARNERS: dict[str, Learner] = {
    "fuzzytree": _ours(),
    "fuzzytree, one column": _ours(columns_per_node=1),
    "fuzzytree, paper": Learner(
        _peer("fuzzytree.estimator.FuzzyTreeClassifier", mode="paper"),
        _in_pipeline(_fuzzytree_size),
        package="fuzzytree-toolkit",
    ),
    "fuzzytree, 10 leaves": _ours(leaves=MOST, is_small=True),
    "fuzzytree, one column, 10 leaves": _ours(
        columns_per_node=1, leaves=MOST, is_small=True
    ),
    "DecisionTree": Learner(_tree(), _tree_size),
    "DecisionTree of as many leaves": Learner(_tree(), _tree_size, like="fuzzytree"),
    "DecisionTree of as many leaves as one column": Learner(
        _tree(), _tree_size, like="fuzzytree, one column"
    ),
    "GaussianNB": Learner(_peer("sklearn.naive_bayes.GaussianNB", scaled=True)),
    "LDA": Learner(
        _peer("sklearn.discriminant_analysis.LinearDiscriminantAnalysis", scaled=True)
    ),
    "logistic regression": Learner(
        _peer("sklearn.linear_model.LogisticRegression", scaled=True, max_iter=1000)
    ),
    "random forest": Learner(
        _peer(
            "sklearn.ensemble.RandomForestClassifier", n_estimators=100, random_state=0
        )
    ),
    "histogram boosting": Learner(
        _peer(
            "sklearn.ensemble.HistGradientBoostingClassifier", _columns, random_state=0
        )
    ),
    "EBM": Learner(
        _peer(
            "interpret.glassbox.ExplainableBoostingClassifier",
            lambda _table: {},
            outer_bags=2,
            n_jobs=1,
            random_state=0,
        ),
        takes_frame=True,
        package="interpret",
    ),
    "FIGS": Learner(_figs, _in_pipeline(_figs_size), package="imodels"),
    "FIGS of as many leaves as one column": Learner(
        _figs, _in_pipeline(_figs_size), like="fuzzytree, one column", package="imodels"
    ),
    "C5.0": Learner(_c5("C5Classifier"), _c5_size, package="c50py"),
    "C5.0 rules": Learner(_c5("C5RulesClassifier"), _c5_size, package="c50py"),
    "RIPPER": Learner(_ripper, _ripper_size, takes_frame=True, package="wittgenstein"),
    "FERL": Learner(
        _peer("ex_fuzzy.FERL", random_state=0), _ferl_size, package="ex-fuzzy"
    ),
    "FuzzyRules": Learner(
        _peer("ex_fuzzy.FuzzyRulesClassifier", random_state=0),
        _fuzzy_rules_size,
        package="ex-fuzzy",
    ),
    "fuzzydtree": Learner(
        _peer("fuzzydtree.FuzzyTreeClassifier", _columns, random_state=0),
        _fuzzydtree_size,
        package="fuzzydtree",
    ),
    "HTSK": Learner(
        _peer("highfis.HTSKClassifier", scaled=True, random_state=0),
        _htsk_size,
        is_small=True,
        package="highfis",
    ),
    "FARC-HD": Learner(
        _peer(
            "farc_hd.FarcHDClassifier.FarcHDClassifier",
            lambda table: {"categorical_variables": table.is_categorical.tolist()},
        ),
        _farc_size,
        package="farc-hd",
    ),
    "DecisionTree, 10 leaves": Learner(
        _tree(max_leaf_nodes=MOST), _tree_size, is_small=True
    ),
    "FIGS, 10 leaves": Learner(
        _small_figs, _in_pipeline(_figs_size), is_small=True, package="imodels"
    ),
    "C5.0, 10 leaves": Learner(
        _c5("C5Classifier", is_small=True), _c5_size, is_small=True, package="c50py"
    ),
    "C5.0 rules, 10 rules": Learner(
        _c5("C5RulesClassifier", is_small=True),
        _c5_size,
        is_small=True,
        package="c50py",
    ),
    "RIPPER, 10 rules": Learner(
        _small_ripper,
        _ripper_size,
        is_small=True,
        takes_frame=True,
        package="wittgenstein",
    ),
    "optimal tree, 10 leaves": Learner(
        _peer(
            "pystreed.STreeDClassifier",
            max_depth=4,
            max_num_nodes=MOST - 1,
            hyper_tune=True,
            time_limit=3600,
        ),
        _optimal_size,
        is_small=True,
        package="pystreed",
    ),
    "FERL, 10 rules": Learner(
        _peer("ex_fuzzy.FERL", random_state=0, max_rules=MOST),
        _ferl_size,
        is_small=True,
        package="ex-fuzzy",
    ),
    "FuzzyRules, 10 rules": Learner(
        _peer("ex_fuzzy.FuzzyRulesClassifier", random_state=0, nRules=MOST - 1),
        _fuzzy_rules_size,
        is_small=True,
        package="ex-fuzzy",
    ),
    "fuzzydtree, 10 leaves": Learner(
        _peer(
            "fuzzydtree.FuzzyTreeClassifier", _columns, random_state=0, max_leaves=MOST
        ),
        _fuzzydtree_size,
        is_small=True,
        package="fuzzydtree",
    ),
}

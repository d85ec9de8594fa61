"""The learner as a scikit-learn classifier; the only module that imports it."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, Self, cast

import narwhals as nw
import numpy as np
import numpy.typing as npt

from fuzzytree.cells import checked_weights, numbers_only
from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.learning import (
    ArrayLearner,
    LearningReport,
    LearningSettings,
    importances,
    refuse_measurements,
    refuse_unknown,
)
from fuzzytree.model import (
    DATE_UNIT,
    PARTS,
    FuzzyTree,
    RuleBase,
    depth,
    label_type_of,
    leaf_paths,
    with_label_type,
)
from fuzzytree.report import Picture, draw_model
from fuzzytree.runtimes import baseline, mix, rule_codes, run_of
from fuzzytree.semantics import Status, rules_of
from fuzzytree.tables import TableSource, batches, read_table

try:
    from scipy.sparse import csr_array
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils import (
        _safe_indexing,  # pyright: ignore[reportPrivateUsage]  # in its reference
    )
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import (
        _num_samples,  # pyright: ignore[reportPrivateUsage]  # rows of any container
        check_array,
        check_is_fitted,
        check_X_y,
        validate_data,
    )
except ImportError as error:
    raise MissingExtraError(
        f"FuzzyTreeClassifier needs {install_hint('sklearn')}"
    ) from error

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray, Outcome, Run

P = ParamSpec("P")
LabelArray = npt.NDArray[np.generic]
Mode = Literal["default", "paper"]
Form = Literal["tree", "rules"]
PatternsPerClass = int | Mapping[str, int] | None
LabelWeight = Mapping[Any, float] | Literal["balanced"] | None

_LEAST_PROBABILITY = 0.5 / PARTS  # half the smallest one that a leaf can have


def _validated(estimator: object, X: Any, *y: Any, **options: Any) -> Any:
    """Return what scikit-learn's check makes of X and y, where masked is missing."""
    table: Any = X
    if isinstance(X, np.ndarray) and X.dtype.kind != "c":  # which scikit-learn refuses
        table = numbers_only(X, "X")
    return validate_data(estimator, table, *map(_sound_labels, y), **options)


def _frame_of(X: Any) -> nw.DataFrame[Any] | None:
    """Return a frame, None for anything else, or if two columns have one name."""
    if isinstance(X, np.ndarray | list):  # which takes long to find out
        return None
    try:
        frame = nw.from_native(X, eager_only=True)
    except TypeError:
        return None
    return frame if len(set(frame.columns)) == len(frame.columns) else None


def _as_numbers(
    frame: nw.DataFrame[Any],
) -> tuple[FloatArray, dict[str, tuple[str, ...]], list[str], list[str]]:
    """Return a frame to learn from as numbers, shape (rows, columns).

    A column that is left out is 0.

    Returns:
        The numbers, the categories by column, the columns of dates, and those whose
        categories have an order.
    """
    table = read_table(frame.to_native(), target=np.zeros(len(frame)), name="X")
    for column, text in table.remarks:
        warnings.warn(f"X: {column} has {text}", stacklevel=3)
    titles = {name.strip(): name for name in frame.columns}
    values = np.zeros((len(titles), len(frame)))
    values[[[*titles].index(name) for name in table.columns]] = table.values
    categories = {titles[name]: texts for name, texts in table.categories.items()}
    dates, ordered = (
        [titles[name] for name in names] for names in (table.dates, table.ordered)
    )
    return values.T, categories, dates, ordered


def _with_hints(construct: Callable[P, None]) -> Callable[P, None]:
    """Return a constructor that refuses a keyword of another name with ours."""
    names = [*inspect.signature(construct).parameters][1:]

    @functools.wraps(construct)
    def check_names(*args: P.args, **settings: P.kwargs) -> None:
        refuse_unknown("FuzzyTreeClassifier", settings, names)
        construct(*args, **settings)

    return check_names


def _sound_labels(y: Any) -> Any:
    """Return labels, unless some are masked or they cannot be sorted."""
    if np.ma.is_masked(y):
        raise ValueError("y holds masked labels")
    labels = np.asanyarray(y)
    if labels.dtype == object:
        kinds = sorted({type(label).__name__ for label in labels.ravel().tolist()})
        if len(kinds) > 1 and ("str" in kinds or "NoneType" in kinds):
            raise ValueError(f"y holds labels of several kinds: {', '.join(kinds)}")
    return y


class FuzzyTreeClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # both are untyped
    """Learn a fuzzy decision tree and answer by it.

    Class k of the tree is named `str(classes_[k])`; its columns are those of the table
    it was fitted on, or `x1`, `x2`, ... Frames may have columns of text, categories,
    truth values and dates. Missing values are learnt from and answered, and an infinite
    value is a missing one; paper mode refuses both. Rows and classes may have weights;
    paper mode counts rows, so it takes whole weights of rows alone. A pickle or a copy
    of a fitted classifier holds its tree, with the range of each column and the centre
    of each combination, and no training rows.

    Args:
        mode: `default`, or `paper` for the paper's algorithm.
        form: `tree`; or `rules`, one for each class. None: rules of more than 200
            classes, unless one of the next four limits a tree.
        columns_per_node: How many columns a node looks at, at most; 1 gives rules in
            the table's own words, None as many as help.
        leaves: How many leaves the tree has, at most.
        min_rows: How many rows a leaf holds, at least.
        depth: How many conditions lead to a leaf, at most.
        alpha: Weight of the difference of means in the distance of two patterns, of the
            mode `paper`, as the next two.
        l_max: How wide a gap one column must leave before it is trusted; None is 8.
        patterns_per_class: How many shapes a class has: a number, or a number for each
            class by its name in the tree.
        points: n of the paper's 2n + 1 points on a fuzzy set, 1 to 8.
        separate_sides: Whether a set's two sides are fitted apart.
        shrinkage: How far the off-diagonal of a scatter is shrunk, in [0, 1).
        entry: How much one more column must help a combination.
        costs: The cost of a column, by its name in the tree; 1 unless given.
        class_weight: By what the weights of a class' rows are multiplied: a number by
            label, 1 for labels that are not named; or `balanced`, for all classes to
            weigh the same.
        rows_per_class: How many rows of a class are kept at most, as many as
            `report_.sampled` says; None for up to 20,000.
        seed: Moves the folds of held-out rows. The same seed and table give the
            same tree. `fuzzytree.learning.LearningSettings` says more about each.

    Attributes:
        model_: The tree or the rules, as every other part of fuzzytree takes them.
        tree_: The tree; absent if rules were learnt.
        report_: What learning repaired and counted.
        classes_: The labels, sorted.
        n_features_in_: The number of columns seen in `fit`.
        feature_names_in_: Their names, if the table had any.
        feature_importances_: The share of each column in what the nodes learn about
            the classes, shape (n_features_in_,); see
            `fuzzytree.learning.importance`.

    Example:
        >>> import numpy as np
        >>> values = np.array([[1.0], [1.5], [2.0], [7.0], [7.5], [8.0]])
        >>> model = FuzzyTreeClassifier().fit(values, [0, 0, 0, 1, 1, 1])
        >>> model.predict([[1.2], [7.2]]).tolist()
        [0, 1]
    """

    mode: Mode
    form: Form | None
    patterns_per_class: PatternsPerClass
    class_weight: LabelWeight
    model_: FuzzyTree | RuleBase
    report_: LearningReport
    classes_: LabelArray
    n_features_in_: int
    feature_names_in_: npt.NDArray[np.object_]
    _learner: ArrayLearner

    @_with_hints
    def __init__(
        self,
        *,
        mode: Mode = "default",
        form: Form | None = None,
        columns_per_node: int | None = None,
        leaves: int | None = None,
        min_rows: int | None = None,
        depth: int | None = None,
        alpha: float | None = None,
        l_max: float | None = None,
        patterns_per_class: PatternsPerClass = None,
        points: int = 3,
        separate_sides: bool = False,
        shrinkage: float = 1e-3,
        entry: float = 0.0,
        costs: Mapping[str, float] | None = None,
        class_weight: LabelWeight = None,
        rows_per_class: int | None = None,
        seed: int = 0,
    ) -> None:
        self.mode = mode
        self.form = form
        self.columns_per_node = columns_per_node
        self.leaves = leaves
        self.min_rows = min_rows
        self.depth = depth
        self.alpha = alpha
        self.l_max = l_max
        self.points = points
        self.separate_sides = separate_sides
        self.patterns_per_class = patterns_per_class
        self.shrinkage = shrinkage
        self.entry = entry
        self.costs = costs
        self.class_weight = class_weight
        self.rows_per_class = rows_per_class
        self.seed = seed

    def fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        sample_weight: npt.ArrayLike | None = None,
    ) -> Self:
        """Learn a tree.

        A row of the weight 3 counts as three equal rows, one of the weight 0 is left
        out. Of weights that are no whole numbers only the ratios matter.

        Args:
            X: Numbers, shape (rows, columns), or a frame. NaN and infinity are missing,
                and `report_.rows_filled` counts the rows that have one.
            y: A label for each row; at least two different ones.
            sample_weight: A weight for each row, finite and not negative; all 1 unless
                given.

        Returns:
            The classifier itself.

        Raises:
            ValueError: If the table has one row, one class or no varying column, if a
                setting is out of its range, or if a weight is negative, missing or
                infinite, or all are 0.

        Example:
            >>> import numpy as np
            >>> values, labels = np.array([[1.0], [2.0], [7.0], [8.0]]), [0, 0, 1, 1]
            >>> model = FuzzyTreeClassifier()
            >>> tree = model.fit(values, labels, sample_weight=[1, 1, 3, 1]).tree_
            >>> tree.leaves[1].counts
            (0, 4)
        """
        rows: Any = X, y
        weights = None
        if sample_weight is not None:
            weights = checked_weights(np.asarray(sample_weight), _num_samples(X))
            if not weights.all():
                kept = np.flatnonzero(weights)
                rows = [_safe_indexing(part, kept) for part in rows]
                weights = weights[kept]
        categories: dict[str, tuple[str, ...]] = {}
        dates: list[str] = []
        ordered: list[str] = []
        frame = _frame_of(rows[0])
        if frame is None:
            values, labels = _validated(self, *rows, **self._numeric())
        else:
            _validated(self, *rows, skip_check_array=True)
            found = _as_numbers(self._with_own_names(frame))
            table, categories, dates, ordered = found
            values, labels = check_X_y(table, rows[1], **self._numeric())
        check_classification_targets(labels)
        if len(values) == 1:
            raise ValueError("cannot learn from one sample (n_samples = 1)")
        classes, codes = np.unique(labels, return_inverse=True)
        refuse_measurements("y", "", [*map(str, classes)], codes)
        self._start(classes, categories, dates, ordered)
        return self._learn(values, labels, weights)

    def partial_fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        classes: npt.ArrayLike | None = None,
        sample_weight: npt.ArrayLike | None = None,
    ) -> Self:
        """Take more rows and learn again from all rows so far.

        Only statistics and a bounded sample of the rows are kept. The last tree is
        the one of a single `fit` on all rows, however they were cut; a first chunk
        must hold rows of two classes. A pickle and a copy leave these rows out: they
        predict, and learn again from `fit` alone.

        Args:
            X: As in `fit`.
            y: As in `fit`; labels out of `classes`.
            classes: All labels that will come; needed in the first call.
            sample_weight: As in `fit`; whole numbers, if more than one chunk comes.

        Returns:
            The classifier itself.

        Raises:
            ValueError: As `fit`, or if a label is not among the classes, or if the
                classifier is a pickle or a copy of a fitted one.
        """
        is_first = not hasattr(self, "_learner")
        if is_first and hasattr(self, "model_"):
            raise ValueError(
                "a pickled or copied classifier holds no training rows, so partial_fit "
                "cannot continue; call fit, or partial_fit on the original"
            )
        frame = _frame_of(X)
        for name, kind in frame.schema.items() if frame else ():
            is_plain = isinstance(kind, nw.Boolean | nw.Object | nw.Unknown)
            if not (is_plain or kind.is_numeric()):
                raise ValueError(
                    f"X: column {name!r} holds no numbers ({kind}), and only all rows "
                    "show what it is: call fit, or learn with fuzzytree.Learner"
                )
        values, labels = _validated(self, X, y, reset=is_first, **self._numeric())
        check_classification_targets(labels)
        if is_first:
            if classes is None:
                raise ValueError("the first call of partial_fit needs classes")
            self._start(np.unique(np.asarray(classes)))
        unknown = np.setdiff1d(labels, self.classes_)
        if len(unknown):
            raise ValueError(
                f"label {unknown[0]!s} is not among the classes {self.classes_}"
            )
        weights = None
        if sample_weight is not None:
            weights = checked_weights(np.asarray(sample_weight), len(values))
        return self._learn(values, labels, weights)

    def _numeric(self) -> dict[str, Any]:
        """Return which numbers scikit-learn's check takes."""
        return {"dtype": np.float64, "ensure_all_finite": self.mode == "paper"}

    def __sklearn_tags__(self) -> Any:
        """Say that missing values and categories are learnt from, but in paper mode."""
        tags: Any = super().__sklearn_tags__()
        tags.input_tags.allow_nan = self.mode != "paper"
        tags.input_tags.categorical = self.mode != "paper"
        return tags

    def _start(
        self,
        classes: LabelArray,
        categories: Mapping[str, tuple[str, ...]] | None = None,
        dates: Sequence[str] = (),
        ordered: Sequence[str] = (),
    ) -> None:
        self.classes_ = classes
        names = [str(label) for label in classes]
        chosen: dict[str, Any] = self.get_params(deep=False)
        chosen["costs"] = self.costs or {}
        if isinstance(self.class_weight, Mapping):  # by names in the tree
            weights = self.class_weight.items()
            chosen["class_weight"] = {str(label): weight for label, weight in weights}
        self._learner = ArrayLearner(
            self._columns(),
            names,
            dict.fromkeys(dates, DATE_UNIT),
            settings=LearningSettings(**chosen),
            categories=categories or {},
            ordered=ordered,
        )

    def _learn(
        self, values: FloatArray, labels: LabelArray, weights: FloatArray | None = None
    ) -> Self:
        codes = np.searchsorted(self.classes_, labels)
        self._learner.partial_fit(values, codes, weights=weights)
        learnt = self._learner.finish()
        label_type = label_type_of(self.classes_.tolist())
        self.model_ = with_label_type(learnt.model, label_type)
        self.report_ = learnt.report
        return self

    def predict(self, X: npt.ArrayLike) -> LabelArray:
        """Return the label of each row, by its leaf or its strongest rule.

        Raises:
            ValueError: If X does not fit the table of `fit`, or a value is so large
                that a combination of columns overflows.
        """
        rules = self._rules(X)
        return self.classes_[rule_codes(self.model_)[rules]]

    def apply(self, X: npt.ArrayLike) -> IntArray:
        """Return the number of the leaf of each row, as scikit-learn's trees do.

        Nodes and leaves are numbered together, depth-first from 0, in the order of
        `export_text`. The number of the rule that answers, from 1, is in
        `fuzzytree.run(model, X).rule`.

        Raises:
            ValueError: As `predict`.
        """
        ends = np.array([path[-1] for path in leaf_paths(self.tree_)], np.int64)
        numbers: IntArray = ends[self._rules(X) - 1]
        return numbers

    def _rules(self, X: npt.ArrayLike) -> IntArray:
        values = self._values(X)
        return self._answers(values, run_of(self.model_, baseline())).rule

    def predict_proba(self, X: npt.ArrayLike) -> FloatArray:
        """Return the probability of each class, as the tree's leaves have it.

        `fuzzytree.model.probabilities` says how they are mixed. The largest belongs to
        the class of `predict`; every runtime gives the same bits.

        Returns:
            Shape (rows, classes), in the order of `classes_`.

        Raises:
            ValueError: As `predict`, or if classes and leaves are so many that the
                tree has no probabilities.
        """
        values = self._values(X)
        rules = rules_of(self.model_)
        if not rules.semantics.sharpness:
            raise ValueError(
                f"a model of {len(rules.rules)} rules and {len(self.classes_)} classes "
                "has no probabilities: there are too many"
            )
        run = mix(rules)
        mixed = self._answers(values, run).probabilities
        assert mixed is not None  # the tree has a sharpness
        return np.ascontiguousarray(mixed.T)

    def predict_log_proba(self, X: npt.ArrayLike) -> FloatArray:
        """Return the logarithm of the probability of each class; -inf for none.

        Returns:
            Shape (rows, classes), as `predict_proba`.

        Raises:
            ValueError: As `predict_proba`.
        """
        with np.errstate(divide="ignore"):
            found: FloatArray = np.log(self.predict_proba(X))
        return found

    def decision_function(self, X: npt.ArrayLike) -> FloatArray:
        """Return how much speaks for each class: logarithms of its probability.

        A probability below half a millionth counts as that, so all are finite. The
        largest belongs to the class of `predict`.

        Returns:
            Of two classes the logarithm of the odds of the second one, shape (rows,),
            above 0 where it is predicted; else shape (rows, classes).

        Raises:
            ValueError: As `predict_proba`.

        Example:
            >>> import numpy as np
            >>> values, labels = np.array([[1.0], [2.0], [7.0], [8.0]]), [0, 0, 1, 1]
            >>> model = FuzzyTreeClassifier().fit(values, labels)
            >>> model.decision_function([[1.0], [8.0]]).round(2).tolist()
            [-1.1, 1.1]
        """
        found = np.log(np.maximum(self.predict_proba(X), _LEAST_PROBABILITY))
        odds: FloatArray = found[:, 1] - found[:, 0] if found.shape[1] == 2 else found
        return odds

    @property
    def feature_importances_(self) -> FloatArray:
        """The share of each column in what the nodes learn about the classes."""
        check_is_fitted(self)
        shares = importances(self.tree_)
        return np.array([shares[name] for name in self._columns()])

    @property
    def tree_(self) -> FuzzyTree:
        """The tree."""
        model = self.__fuzzytree__()
        if not model.leaves:
            text = f"model_ holds rules of {len(model.classes)} classes, and no tree"
            raise AttributeError(f"{text}; form='tree' learns one")
        return cast("FuzzyTree", model)  # nothing else has leaves

    def get_depth(self) -> int:
        """Return how many conditions lead to the deepest leaf."""
        check_is_fitted(self)
        return depth(self.tree_)

    def get_n_leaves(self) -> int:
        """Return how many leaves the tree has."""
        check_is_fitted(self)
        return len(self.tree_.leaves)

    def decision_path(self, X: npt.ArrayLike) -> csr_array:
        """Return which nodes and which leaf each row passes.

        Returns:
            A sparse indicator of shape (rows, nodes and leaves), whose columns have
            the numbers of `apply`.

        Raises:
            ValueError: As `predict`.

        Example:
            >>> import numpy as np
            >>> values, labels = np.array([[1.0], [2.0], [7.0], [8.0]]), [0, 0, 1, 1]
            >>> model = FuzzyTreeClassifier().fit(values, labels)
            >>> model.decision_path([[1.0], [8.0]]).toarray().tolist()
            [[1, 1, 0], [1, 0, 1]]
        """
        rules, paths = self._rules(X), leaf_paths(self.tree_)
        ends = np.cumsum([0, *map(len, paths)])
        size = len(self.tree_.nodes) + len(paths)
        ways = csr_array(
            (np.ones(ends[-1], np.int64), np.concatenate(paths), ends),
            shape=(len(paths), size),
        )
        return ways[rules - 1]

    def plot(
        self,
        *,
        title: str | None = None,
        row: Mapping[str, float | str] | None = None,
        surface: Sequence[str] | None = None,
    ) -> Picture:
        """Return a picture of the tree, or of a row or two columns, as `draw` does.

        A notebook shows it; `picture.save` writes it.

        Raises:
            ValueError: If the tree is too large for a picture, the row does not fit, or
                there is no such surface.
        """
        tree = self.__fuzzytree__()
        return draw_model(tree, title=title, row=row, surface=surface)

    def __fuzzytree__(self) -> FuzzyTree | RuleBase:
        """Return the model, so that every function of fuzzytree takes the classifier.

        Raises:
            NotFittedError: If the classifier is not fitted.
        """
        check_is_fitted(self, "model_")
        return self.model_

    def __getstate__(self) -> dict[str, Any]:
        """Leave out training rows."""
        state: Any = super().__getstate__()
        return {name: value for name, value in state.items() if name != "_learner"}

    def _columns(self) -> list[str]:
        names = getattr(self, "feature_names_in_", None)
        if names is None:
            return [f"x{number}" for number in range(1, self.n_features_in_ + 1)]
        return [str(name) for name in names]

    def _with_own_names(self, frame: nw.DataFrame[Any]) -> nw.DataFrame[Any]:
        """Return a frame whose columns have the names of the tree's."""
        return frame.rename(dict(zip(frame.columns, self._columns(), strict=True)))

    def _values(self, X: npt.ArrayLike) -> FloatArray:
        """Return the columns that the tree needs, shape (inputs, rows)."""
        check_is_fitted(self)
        frame, tree = _frame_of(X), self.model_
        variables = [one for one in tree.variables if not one.parts]
        if frame is None:
            rows: Any = _validated(self, X, reset=False, **self._numeric())
            place = {name.strip(): k for k, name in enumerate(self._columns())}
            places = [place.get(one.name.strip()) for one in variables]
            if not (None in places or any(one.categories for one in variables)):
                return np.ascontiguousarray(rows.T[places])
        else:
            _validated(self, X, reset=False, skip_check_array=True)
            rows = self._with_own_names(frame).to_native()
        table = TableSource(rows, self._columns())
        [part] = batches(table, tree.inputs, variables=variables, name="X")
        if frame is not None:
            title: dict[str, Any] = {"input_name": "X", "ensure_min_features": 0}
            check_array(part.values.T, **title, **self._numeric())
        return part.values

    def _answers(self, values: FloatArray, run: Run) -> Outcome:
        outcome = run(values)
        overflown = np.flatnonzero(outcome.status == Status.MISSING)
        if len(overflown):
            raise ValueError(
                f"row {overflown[0]}: its values are so large that a combination "
                f"of columns overflows ({len(overflown)} such rows)"
            )
        return outcome

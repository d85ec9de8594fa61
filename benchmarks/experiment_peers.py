"""Other learners on the same frames, features and division, from scikit-learn."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.errors import MissingExtraError, install_hint

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

Peer = Callable[[int], Any]
"""From a seed to a learner of scikit-learn."""


def are_there() -> bool:
    """Return whether scikit-learn is installed."""
    return importlib.util.find_spec("sklearn") is not None


def _lda(_seed: int) -> Any:
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    return LinearDiscriminantAnalysis()


def _shrunk_lda(_seed: int) -> Any:
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    return LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")


def _bayes(_seed: int) -> Any:
    from sklearn.naive_bayes import GaussianNB

    return GaussianNB()


def _tree(seed: int) -> Any:
    from sklearn.tree import DecisionTreeClassifier

    return DecisionTreeClassifier(random_state=seed)


def _forest(seed: int) -> Any:
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(n_estimators=100, random_state=seed)


PEERS: Mapping[str, Peer] = MappingProxyType(
    {
        "LDA": _lda,
        "LDA, shrunk": _shrunk_lda,
        "GaussianNB": _bayes,
        "DecisionTree": _tree,
        "random forest": _forest,
    }
)
"""The peers with their library's own settings; the shrunk LDA's shrinkage is that of
Ledoit and Wolf, the forest has 100 trees."""


def peer_answers(
    name: str, train: FloatArray, codes: IntArray, test: FloatArray, seed: int = 0
) -> IntArray:
    """Return the class that a peer gives each frame.

    Features are brought to mean 0 and standard deviation 1 of the training frames,
    which GaussianNB and LDA need for moments that range over twelve decades.

    Args:
        name: A key of `PEERS`.
        train: Features to learn from, shape (features, frames).
        codes: Their classes, shape (frames,).
        test: Features to answer, shape (features, other frames).
        seed: Of the tree and the forest.

    Returns:
        The class of each frame to answer; -1 where the learner gives up, as LDA does
        where no class varies.

    Raises:
        MissingExtraError: If scikit-learn is not installed.
    """
    if not are_there():
        raise MissingExtraError(
            f"comparing with other learners needs {install_hint('sklearn')}"
        )
    mean = train.mean(axis=1, keepdims=True)
    spread = train.std(axis=1, keepdims=True)
    spread[spread == 0.0] = 1.0
    learner = PEERS[name](seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # LDA warns of features that depend
        try:
            learner.fit(((train - mean) / spread).T, codes)
            found = learner.predict(((test - mean) / spread).T)
        except (ValueError, IndexError, np.linalg.LinAlgError):
            return np.full(test.shape[1], -1, np.int64)
    return np.asarray(found, np.int64)

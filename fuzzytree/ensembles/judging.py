"""Are two tree ensembles the same function? Proved where it can be, run where not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fuzzytree.ensembles.programs import Opened
from fuzzytree.ensembles.running import Pair, Witness
from fuzzytree.ensembles.ties import Search
from fuzzytree.ensembles.trees import Ensemble, Rows
from fuzzytree.ensembles.walking import Box, Walk, is_same_shape, row_of
from fuzzytree.errors import LossError
from fuzzytree.model import (
    FloatArray,
    IntArray,
    Question,
    TreeAgreement,
    TreeAnswer,
    TreeVerdict,
)

MOST_ROWS = 20_000
_MOST_TRIED = 20  # rows of a question that are run because the files differ there
_COMPLEMENT = 2.0**-48  # of what two probabilities sum to, beside 1

LeafPair = tuple[int, int, Box | None]
"""A leaf of a tree, one of another that the same row reaches, and which rows do."""


def judge(
    first: Opened,
    second: Opened,
    *,
    limit: int | None = None,
    data: FloatArray | None = None,
) -> TreeAgreement:
    """Compare two tree ensembles, in all rows that both accept.

    Args:
        first: An ensemble.
        second: What was made of it, or another one.
        limit: The most rows that are generated for each number type.
        data: Rows of the user, which are run as well, shape (rows, columns).

    Raises:
        LossError: If one predicts classes and the other numbers, or their numbers of
            columns or of classes differ.
    """
    one, two = _comparable(first.ensemble, second.ensemble)
    first, second = first._replace(ensemble=one), second._replace(ensemble=two)
    answers: list[TreeAnswer] = []
    remarks = [*one.remarks, *two.remarks]
    kinds: tuple[Rows, ...] = ("float32", "float64")
    for rows in kinds:
        pair = Pair(first, second, rows)
        pair.run_many(limit or MOST_ROWS, data)
        answers += _Judge(pair).answers()
        remarks += pair.remarks
    return TreeAgreement(
        one.name,
        two.name,
        (one.kind, two.kind),
        (first.program, second.program),
        (one.leaf_count, two.leaf_count),
        tuple(answers),
        tuple(one.columns or two.columns or ()),
        tuple(remarks),
    )


def _comparable(one: Ensemble, two: Ensemble) -> tuple[Ensemble, Ensemble]:
    """Return two ensembles with the same scores, in the same order of trees.

    Raises:
        LossError: If they predict different things.
    """
    if one.width and two.width and one.width != two.width:
        raise LossError(
            f"{one.name} takes {one.width} columns and {two.name} takes {two.width}"
        )
    if (one.decides == "not") != (two.decides == "not"):
        number, other = (one, two) if one.decides == "not" else (two, one)
        raise LossError(
            f"{number.name} predicts numbers and {other.name} predicts classes"
        )
    if "FuzzyTree" in (one.kind, two.kind):
        one, two = _labels_alone(one), _labels_alone(two)
    counts = [max(2, len(each.base)) if each.decides != "not" else len(each.base)
              for each in (one, two)]  # fmt: skip
    if counts[0] != counts[1]:
        raise LossError(
            f"{one.name} has {counts[0]} classes or outputs and {two.name} {counts[1]}"
        )
    if len(one.base) != len(two.base):
        one, two = _one_score(one), _one_score(two)
    return _in_order(one), _in_order(two)


def _labels_alone(ensemble: Ensemble) -> Ensemble:
    """Return one tree whose leaves say 1 for their class, and 0 for the others.

    Raises:
        LossError: If it is more than one tree.
    """
    if len(ensemble.trees) != 1:
        raise LossError(
            f"{ensemble.name}: {len(ensemble.trees)} trees are not compared with a "
            "fuzzy tree, which is one"
        )
    tree = ensemble.trees[0]
    count = max(2, len(ensemble.base))
    classes = _decided(ensemble, tree.values + ensemble.base)
    return replace(
        ensemble,
        trees=[replace(tree, values=np.eye(count)[classes])],
        base=np.zeros(count),
        link="none",
        decides="largest",
        bar=0.0,
        has_labels_alone=True,
    )


def _one_score(ensemble: Ensemble) -> Ensemble:
    """Return two probabilities that sum to 1 as that of the second class."""
    if len(ensemble.base) == 1:
        return ensemble
    shares = [tree.values.sum(axis=1) for tree in ensemble.trees]
    total = sum(float(share.max()) for share in shares) + float(ensemble.base.sum())
    if abs(total - 1.0) > 1e-6:
        raise LossError(f"{ensemble.name}: two scores that are no probabilities")
    is_complement = all(
        (share.max() - tree.values[:, 1] == tree.values[:, 0]).all()
        for share, tree in zip(shares, ensemble.trees, strict=True)
    )
    if len(ensemble.trees) == 1:
        lower, upper = ensemble.trees[0].values.T
        if ((upper > lower) != (upper > 0.5)).any():
            raise LossError(f"{ensemble.name}: a leaf is tied but for rounding")
    return replace(
        ensemble,
        trees=[replace(tree, values=tree.values[:, 1:]) for tree in ensemble.trees],
        base=ensemble.base[1:],
        decides="above",
        bar=0.5,
        label_slack=0.0 if is_complement else _COMPLEMENT,
    )


def _in_order(ensemble: Ensemble) -> Ensemble:
    """Return trees that each add to one score in the order of the scores."""
    scores = []
    for tree in ensemble.trees:
        used = np.flatnonzero((tree.values != 0).any(axis=0))
        if len(used) > 1:
            return ensemble
        scores.append(int(used[0]) if len(used) else -1)
    if -1 in scores:  # a tree of zeros may belong to any score
        return ensemble
    order = np.argsort(scores, kind="stable")
    return replace(ensemble, trees=[ensemble.trees[place] for place in order])


class _Judge:
    """The answers to all questions about two ensembles, for rows of one type."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self._one, self._two = pair.ensembles
        self._domain = pair.domain()
        self._unread = [name for side in pair.sides for name in side.unread]

    def answers(self) -> list[TreeAnswer]:
        """Return the answer to each question."""
        if len(self._one.trees) == len(self._two.trees):
            routes, scores, leaves = self._walked()
        else:
            counts = f"{len(self._one.trees)} trees and {len(self._two.trees)}"
            routes = self._answer("routes", "open", f"{counts} have no pairs")
            scores, leaves = self._as_run("scores", f"{counts} have no pairs"), []
        labels = self._labels(scores, leaves)
        return [routes, scores, labels, self._missing(), self._programs()]

    def _walked(self) -> tuple[TreeAnswer, TreeAnswer, list[LeafPair]]:
        """Return the answers on routes and scores, and the pairs of leaves of one tree.

        Leaves belong together if each reaches no other leaf of the other tree, or if
        they add the same.
        """
        apart: list[tuple[int, Box]] = []
        is_whole = is_paired = True
        leaves: list[LeafPair] = []
        trees = zip(self._one.trees, self._two.trees, strict=True)
        for number, (left, right) in enumerate(trees, 1):
            if is_same_shape(left, right, self._domain):
                near = self._pair.is_near(left.values, right.values)
                leaves = [(leaf, leaf, None) for leaf in range(len(near))]
                if not near.all():
                    leaf = int(np.argmin(near))
                    walk = Walk(left, right, self._domain)
                    boxes = (pair.box for pair in walk.pairs() if pair.first == leaf)
                    apart += [(number, box) for box in boxes][:1]
                continue
            walk = Walk(left, right, self._domain)
            leaves, wrong = [], []
            partners: tuple[dict[int, int], dict[int, int]] = {}, {}
            one_to_one = True
            for box, first, second in walk.pairs():
                one_to_one &= partners[0].setdefault(first, second) == second
                one_to_one &= partners[1].setdefault(second, first) == first
                leaves.append((first, second, box))
                if not self._pair.is_near(left.values[first], right.values[second]):
                    wrong.append((number, box))
                if not one_to_one and len(wrong) >= _MOST_TRIED:
                    break
            is_paired &= one_to_one or not wrong
            is_whole &= walk.is_whole
            apart += wrong[: _MOST_TRIED - len(apart)]
            if not is_paired and len(apart) >= _MOST_TRIED:
                break
        routes = self._routes(is_paired, is_whole, apart)
        return routes, self._scores(is_whole, [box for _, box in apart]), leaves

    def _routes(
        self, is_paired: bool, is_whole: bool, apart: Sequence[tuple[int, Box]]
    ) -> TreeAnswer:
        if is_paired and is_whole:
            text = "each row arrives at leaves that belong together, in all trees"
            return self._proved("routes", text)
        if is_paired:
            return self._answer("routes", "open", "the trees are too large to walk")
        for number, box in apart:
            witness = self._tried(box, "scores")
            if witness is not None:
                text = f"a row arrives at another leaf in tree {number}"
                return self._answer("routes", "DIFFER", text, witness)
        text = f"the files differ in {len(apart)} rows, in which the programs do not"
        return self._answer("routes", "open", text)

    def _scores(self, is_whole: bool, apart: Sequence[Box]) -> TreeAnswer:
        one, two = self._one, self._two
        if one.has_labels_alone:
            text = "of a fuzzy tree labels are compared"
            return self._answer("scores", "not asked", text)
        if self._unread or one.link != two.link:
            text = f"not read: {', '.join(self._unread)}"
            text = text if self._unread else f"the links are {one.link} and {two.link}"
            return self._as_run("scores", text)
        is_same_base = bool(self._pair.is_near(one.base, two.base))
        if is_whole and is_same_base and not apart and not self._differs("scores"):
            bound = float(np.max(self._pair.allowed))
            text = f"no two scores differ by more than {bound:.2g}, which is rounding"
            return self._proved("scores", text, bound)
        boxes = [*apart, *([] if is_same_base else [Box()])]
        for box in boxes:
            witness = self._tried(box, "scores")
            if witness is not None:
                return self._answer(
                    "scores", "DIFFER", "leaves add other numbers", witness
                )
        text = f"leaves differ in {len(boxes)} rows, in which the programs do not"
        return self._as_run("scores", text)

    def _labels(self, scores: TreeAnswer, leaves: Sequence[LeafPair]) -> TreeAnswer:
        one, two = self._one, self._two
        if one.decides == "not":
            return self._answer("labels", "not asked", "both predict numbers")
        names = [
            each and [_class_name(label) for label in each]
            for each in (one.classes, two.classes)
        ]
        if names[0] and names[1] and names[0] != names[1]:
            text = f"the classes are {names[0]} and {names[1]}"
            return self._answer("labels", "DIFFER", text)
        if self._unread or self._differs("labels"):
            return self._as_run("labels", f"not read: {', '.join(self._unread)}")
        if (one.decides, one.bar > 0) != (two.decides, two.bar > 0):
            return self._as_run("labels", "classes are decided by different rules")
        is_proved = scores.verdict == "PROVED"
        if leaves and len(one.trees) == 1 and (is_proved or one.has_labels_alone):
            return self._labels_of_leaves(leaves)
        return self._labels_of_sums(is_paired=is_proved)

    def _labels_of_leaves(self, leaves: Sequence[LeafPair]) -> TreeAnswer:
        """Compare the classes of leaves: one tree adds nothing that is rounded."""
        left, right = (
            _decided(each, each.trees[0].values + each.base)
            for each in (self._one, self._two)
        )
        wrong = [pair for pair in leaves if left[pair[0]] != right[pair[1]]]
        if not wrong:
            return self._proved("labels", "leaves that belong together have one class")
        for _, _, box in wrong[:_MOST_TRIED]:
            witness = self._tried(box, "labels") if box is not None else None
            if witness is not None:
                return self._answer("labels", "DIFFER", "classes differ", witness)
        text = f"{len(wrong)} pairs of leaves have other classes in the files"
        return self._answer("labels", "open", text)

    def _labels_of_sums(self, *, is_paired: bool) -> TreeAnswer:
        """Look for rows whose best classes are tied but for rounding."""
        one, two = self._one, self._two
        if is_paired and self._is_exact():
            text = "no sum of leaves is rounded, so scores and their ties are equal"
            return self._proved("labels", text)
        slack = float(np.max(self._pair.allowed)) * (1 + (one.decides == "largest"))
        slack += one.label_slack + two.label_slack
        slack *= 2  # sums of the search are rounded, too
        search = Search([one] if is_paired else [one, two], self._domain, slack)
        tied = 0
        for box in search.boxes():
            tied += 1
            witness = self._tried(box, "labels")
            if witness is not None:
                return self._answer("labels", "DIFFER", "classes differ", witness)
            if tied == _MOST_TRIED:
                break
        if search.is_whole and not tied:
            text = f"no row is within {slack:.2g} of a tie, and scores differ by less"
            text = text if is_paired else "no row is given different classes"
            return self._proved("labels", text)
        text = f"none is known to be within {slack:.2g} of a tie"
        if tied:
            text = f"{tied} rows within {slack:.2g} of a tie have one class in both"
        text = f"{search.looked_at:,} boxes of rows were searched; {text}"
        return self._answer("labels", "open", text)

    def _is_exact(self) -> bool:
        """Return whether both have the same trees, and add them without rounding."""
        one, two = self._one, self._two
        return (
            one.is_exact()
            and two.is_exact()
            and one.label_slack == two.label_slack == 0.0
            and np.array_equal(one.base, two.base)
            and all(
                is_same_shape(left, right, self._domain)
                and np.array_equal(left.values, right.values)
                for left, right in zip(one.trees, two.trees, strict=True)
            )
        )

    def _missing(self) -> TreeAnswer:
        """Compare rows with missing values: one of each column and side is enough."""
        one, two = self._one, self._two
        refusing = [each.kind for each in (one, two) if not each.takes_missing]
        if refusing:
            text = f"{' and '.join(refusing)} does not take them"
            return self._answer("missing values", "not asked", text)
        if len(one.trees) != len(two.trees):
            return self._as_run("missing values", "trees have no pairs")
        domain = self._pair.domain(has_missing=True)
        settled: set[tuple[int, bool]] = set()
        is_whole, differing = True, 0
        for left, right in zip(one.trees, two.trees, strict=True):
            if is_same_shape(left, right, domain):
                is_whole &= bool(self._pair.is_near(left.values, right.values).all())
                continue
            walk = Walk(left, right, domain, settled)
            for box, first, second in walk.pairs():
                if self._pair.is_near(left.values[first], right.values[second]):
                    continue
                differing += 1
                walk.settle()
                if differing > _MOST_TRIED:
                    break
                row = row_of(box, self._pair.width, domain, prefers_missing=True)
                if not np.isnan(row).any():  # they differ without missing values, too
                    continue
                witness = self._pair.tried(row, "missing values")
                if witness is not None:
                    text = "a row with missing values arrives at another leaf"
                    return self._answer("missing values", "DIFFER", text, witness)
            is_whole &= walk.is_whole
        if is_whole and not differing and not self._differs("missing values"):
            text = "each row with missing values arrives at leaves that belong together"
            return self._proved("missing values", text)
        text = f"the files differ in {differing} ways, the programs in none of them"
        return self._as_run("missing values", text)

    def _programs(self) -> TreeAnswer:
        """Say what the rows that were run show; this is no proof."""
        pair = self._pair
        if not pair.ran:
            absent = [side.program for side in pair.sides if side.run is None]
            return self._answer("programs", "open", f"not run by {', '.join(absent)}")
        counts = [f"{_OTHER[each]} in {n:,}" for each, n in pair.counts.items()]
        shown = ", ".join(counts) or "no answer differs"
        text = f"{pair.ran:,} rows were run: {shown}"
        if not counts:
            return self._answer("programs", "agree", text)
        witness = next(iter(pair.differing.values()))
        return self._answer("programs", "DIFFER", text, witness)

    def _differs(self, question: Question) -> bool:
        return question in self._pair.differing

    def _tried(self, box: Box, question: Question) -> Witness | None:
        row = row_of(box, self._pair.width, self._domain)
        return self._pair.tried(row, question)

    def _proved(
        self, question: Question, text: str, bound: float | None = None
    ) -> TreeAnswer:
        if self._pair.remarks:
            text = "a program does not do what its file says"
            return self._answer(question, "open", text)
        return TreeAnswer(question, self._pair.rows, "PROVED", text, bound)

    def _as_run(self, question: Question, text: str) -> TreeAnswer:
        """Return what the rows that were run say, where nothing more is known."""
        witness = self._pair.differing.get(question)
        if witness is not None:
            return self._answer(
                question, "DIFFER", f"{_WHAT[question]} differ", witness
            )
        run = "rows that were run agree" if self._pair.ran else "no row was run"
        return self._answer(question, "open", f"{text}; {run}")

    def _answer(
        self,
        question: Question,
        verdict: TreeVerdict,
        text: str,
        witness: Witness | None = None,
    ) -> TreeAnswer:
        if witness is None:
            return TreeAnswer(question, self._pair.rows, verdict, text)
        values = witness.row[0].tolist()
        row = tuple(None if math.isnan(value) else value for value in values)
        answers = witness.answers
        return TreeAnswer(question, self._pair.rows, verdict, text, None, row, answers)


_WHAT: dict[Question, str] = {
    "labels": "classes",
    "scores": "numbers",
    "missing values": "answers with missing values",
}

_OTHER: dict[Question, str] = {
    "labels": "other classes",
    "scores": "other numbers",
    "missing values": "other answers with missing values",
}


def _class_name(label: object) -> str:
    """Return a label as text; converters write booleans as 0 and 1."""
    return str(int(label) if isinstance(label, bool) else label)


def _decided(ensemble: Ensemble, scores: FloatArray) -> IntArray:
    """Return the number of the class of each row of scores."""
    if ensemble.decides == "above":
        return np.asarray(scores[:, -1] > ensemble.bar).astype(np.int64)
    return np.asarray(np.argmax(scores, axis=1))

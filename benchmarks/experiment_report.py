"""An experiment as plain text, and its confusion table as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping

from experiment_study import NOTHING, UNKNOWN, Study

from fuzzytree.report.text import aligned, counted

_WIDEST = 12  # classes; a larger table is in the CSV file
_NAMES_TOLD = 12
_PLURAL = {"subject": "subjects", "press": "presses"}

_PEER = ("learner", "accuracy", "tree better", "worse", "equal", "chance")


def experiment_lines(
    study: Study, *, printed: Mapping[str, int] | None = None
) -> Iterator[str]:
    """Yield an experiment: what was done, the rates, the table, the other learners.

    Args:
        study: The experiment.
        printed: By class how many of 50 presses the paper recognised, to stand beside.
    """
    yield f"{study.task}: {study.about}"
    yield f"division  {study.split}"
    yield f"sensor    {study.sensor}"
    yield f"features  {_features_text(study)}"
    yield f"learnt    {study.settings}; {_trees_text(study)}"
    for count, text in (
        (study.clipped, "above what a cell can take, read as that"),
        (study.negative, "below 0, read as 0"),
    ):
        if count:
            yield f"clipped   {counted(count, 'reading')} {text}"
    left_out = sum(trial.left_out for trial in study.trials)
    if left_out:
        yield f"left out  {counted(left_out, 'empty frame')} to learn from"
    yield ""
    yield from aligned(_rates(study, printed or {}))
    if len(study.classes) <= _WIDEST:
        yield ""
        yield from aligned(_table(study))
    yield ""
    yield from aligned(_trials(study))
    yield ""
    yield accuracy_text(study)
    yield f"          {percent(study.commonest)} by the commonest class alone"
    fresh = [trial.accuracy for trial in study.trials if trial.is_fresh]
    if 0 < len(fresh) < len(study.trials):
        share = percent(sum(fresh) / len(fresh))
        yield f"          {share} of the {len(fresh)} on whom nothing was chosen"
    if study.peers:
        yield ""
        yield from aligned([_PEER, *_peers(study)])
        unit = _PLURAL[study.unit]
        yield f"pairs are made of {unit}; chance is that of the sign test"


def accuracy_text(study: Study) -> str:
    """Return the accuracy with its spread, in a sentence."""
    shares = [trial.accuracy for trial in study.trials]
    text = f"accuracy  {percent(study.accuracy)}"
    if len(shares) < 2:
        return f"{text} of {study.trials[0].tested} frames"
    return (
        f"{text}, mean of {len(shares)} divisions ({percent(min(shares))} to "
        f"{percent(max(shares))}, standard deviation {100 * study.spread:.1f})"
    )


def percent(share: float) -> str:
    """Return a share in percent with one digit.

    Example:
        >>> percent(0.8974)
        '89.7 %'
    """
    return f"{100 * share:.1f} %"


def confusion_csv(study: Study) -> str:
    """Return the confusion table: a line for each class, a column for each answer."""
    rows = [["class", *study.classes, NOTHING, UNKNOWN]]
    for name, counts in zip(study.classes, study.confusion, strict=True):
        rows.append([name, *map(str, counts)])
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows(rows)
    return file.getvalue()


def _features_text(study: Study) -> str:
    names = study.names
    shown = ", ".join(names)
    if len(names) > _NAMES_TOLD:
        shown = f"{names[0]}, ..., {names[-1]}"
    if study.features == shown:
        return shown
    return f"{study.features} ({len(names)}: {shown})"


def _trees_text(study: Study) -> str:
    leaves = sorted({trial.leaves for trial in study.trials})
    asked = sorted({trial.features for trial in study.trials})
    features = "feature" if asked == [1] else "features"
    return f"{_span(leaves)} leaves, which ask for {_span(asked)} {features}"


def _span(numbers: list[int]) -> str:
    if len(numbers) == 1:
        return str(numbers[0])
    return f"{numbers[0]} to {numbers[-1]}"


def _rates(study: Study, printed: Mapping[str, int]) -> Iterator[tuple[str, ...]]:
    yield ("class", "frames", "right", "rate", *(["paper"] if printed else []))
    total = right = 0
    for place, (name, counts) in enumerate(
        zip(study.classes, study.confusion, strict=True)
    ):
        frames, own = sum(counts), counts[place]
        total, right = total + frames, right + own
        yield (
            name,
            str(frames),
            str(own),
            percent(own / frames) if frames else "-",
            *([percent(printed[name] / 50)] if printed else []),
        )
    yield (
        "all",
        str(total),
        str(right),
        percent(right / total),
        *([percent(sum(printed.values()) / (50 * len(printed)))] if printed else []),
    )


def _table(study: Study) -> Iterator[tuple[str, ...]]:
    columns = [
        place
        for place in range(len(study.classes) + 2)
        if place < len(study.classes) or any(line[place] for line in study.confusion)
    ]
    heads = (*study.classes, NOTHING, UNKNOWN)
    yield ("was \\ taken for", *(heads[place] for place in columns))
    for name, counts in zip(study.classes, study.confusion, strict=True):
        yield (name, *(str(counts[place] or ".") for place in columns))


def _trials(study: Study) -> Iterator[tuple[str, ...]]:
    is_chosen = any(trial.settings for trial in study.trials)
    yield ("tested", "learnt from", "frames", "right", *(["chosen"] * is_chosen))
    for trial in study.trials:
        yield (
            trial.name,
            str(trial.trained),
            str(trial.tested),
            percent(trial.accuracy),
            *([trial.settings] * is_chosen),
        )


def _peers(study: Study) -> Iterator[tuple[str, ...]]:
    yield ("this tree", percent(study.accuracy), "", "", "", "")
    for peer in study.peers:
        pairing = peer.pairing
        lost = f" ({peer.unanswered} frames unanswered)" if peer.unanswered else ""
        yield (
            peer.name,
            f"{percent(peer.accuracy)}{lost}",
            str(pairing.better),
            str(pairing.worse),
            str(pairing.equal),
            f"{pairing.chance:.2g}",
        )

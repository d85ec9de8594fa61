"""Formats as plain text and Markdown: what each can carry, its limits, its options."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence

from fuzzytree.checking import MEANINGS, Ability, Outcome
from fuzzytree.model import Format, OptionFacts, Runtime
from fuzzytree.report.text import aligned, counted

Found = Mapping[str, tuple[Ability, ...] | str]
"""The abilities of each format, or why there are none."""

_LONGEST = 120  # characters of a reason

SIGNS = {
    "equal": "=",
    "alike": "~",
    "written": "w",
    "points": "p",
    "lossy": "L",
    "refused": "x",
    "no": "-",
}
"""What stands for each outcome in the table."""


def overview_lines(
    formats: Sequence[Format],
    runtimes: Sequence[Runtime],
    missing: set[str],
    *,
    is_verbose: bool = False,
) -> Iterator[str]:
    """Yield the formats and the runtimes, after how many there are.

    Args:
        formats: All of them.
        runtimes: All of them.
        missing: The extras that are not installed.
        is_verbose: Whether to print the table of runtimes and all limits, too.
    """
    extras = {one.extra for one in formats} | {one.extra for one in runtimes}
    wanted = sorted(missing.intersection(map(str, extras)))
    count = f"{counted(len(formats), 'format')}, {counted(len(runtimes), 'runtime')}"
    said = f"missing extras: {', '.join(wanted)}" if wanted else "no extra is missing"
    yield f"{count}; {said}"
    rows = [("format", "suffix", "reads", "writes", "extra")]
    for one in formats:
        carried = ", ".join(one.carries)
        reads = carried if one.read else "-"
        suffixes = " ".join(one.suffixes)
        rows.append((one.name, suffixes, reads, carried, _extra(one.extra, missing)))
    yield from aligned(rows)
    if not is_verbose:
        names = ", ".join(
            f"{one.name} (not installed)" if one.extra in missing else one.name
            for one in runtimes
        )
        yield from textwrap.wrap(f"runtimes: {names}", 96, subsequent_indent="  ")
        yield "--verbose lists what each cannot express, and which models it carries"
        return
    yield "cannot:"
    yield from _limits((one.name, one.cannot) for one in formats)
    yield ""
    rows = [("runtime", "runs", "numbers", "agreement", "extra")]
    for run in runtimes:
        runs, extra = ", ".join(run.runs), _extra(run.extra, missing)
        rows.append((run.name, runs, run.dtype, promise_of(run), extra))
    yield from aligned(rows)
    yield "systems with exp, powers and the like agree within a derived bound"
    yield "cannot:"
    yield from _limits((one.name, one.cannot) for one in runtimes)


def promise_of(runtime: Runtime) -> str:
    """Return how the strengths of a runtime agree with those of the reference."""
    if runtime.bound is not None or runtime.name == f"native {runtime.dtype}":
        return "within a derived bound"
    if runtime.dtype == "float64":
        return "equal bits"
    return f"equal bits with native {runtime.dtype}"


def format_facts(one: Format, missing: set[str]) -> dict[str, object]:
    """Return a line of the table of formats for programs."""
    return {
        "name": one.name,
        "suffixes": one.suffixes,
        "reads": one.carries if one.read else (),
        "writes": one.carries,
        "cannot": one.cannot,
        "extra": one.extra,
        "is_installed": one.extra not in missing,
    }


def runtime_facts(one: Runtime, missing: set[str]) -> dict[str, object]:
    """Return a line of the table of runtimes for programs."""
    return {
        "name": one.name,
        "runs": one.runs,
        "dtype": one.dtype,
        "equal_bits": one.bound is None,
        "cannot": one.cannot,
        "extra": one.extra,
        "is_installed": one.extra not in missing,
    }


def _extra(extra: str | None, missing: set[str]) -> str:
    if extra is None:
        return "-"
    return f"{extra} (not installed)" if extra in missing else extra


def _limits(limits: Iterable[tuple[str, tuple[str, ...]]]) -> Iterator[str]:
    for name, cannot in limits:
        for text in cannot:
            yield f"  {name}: {text}"


def ability_lines(abilities: Found) -> Iterator[str]:
    """Yield the table of what each format can carry: a line for each kind of model."""
    rows = [*ability_rows(abilities)]
    if rows:
        yield from aligned(rows)
        yield ""
    yield from aligned((f"  {SIGNS[one]}", text) for one, text in MEANINGS.items())
    for name, reason in abilities.items():
        if isinstance(reason, str):
            yield f"  {name}: {reason}"


def ability_rows(abilities: Found) -> Iterator[Sequence[str]]:
    """Yield the names of formats, then the signs of each kind of model."""
    known = {name: one for name, one in abilities.items() if not isinstance(one, str)}
    if not known:
        return
    yield ["", *known]
    for line in zip(*known.values(), strict=True):
        yield [line[0].sample, *(SIGNS[one.outcome] for one in line)]


def detail_lines(
    form: Format,
    abilities: tuple[Ability, ...] | str,
    options: Sequence[OptionFacts],
    dialects: Found,
    *,
    is_verbose: bool = False,
) -> Iterator[str]:
    """Yield everything that is known of one format.

    Args:
        form: The format.
        abilities: What it can carry, or why that is not known.
        options: The options of its writer.
        dialects: What it can carry in each of its dialects, if it has several.
        is_verbose: Whether to print the outcome for each kind of model.
    """
    reads = "read and written" if form.read else "written"
    computes = f", computes in {form.dtype}" if form.dtype else ""
    yield f"{form.name}: {' '.join(form.suffixes)}, {reads}{computes}"
    yield f"carries  {', '.join(form.carries)}"
    yield from (f"cannot   {text}" for text in form.cannot)
    if options:
        yield ""
        yield "options, as --set NAME=VALUE:"
        yield from aligned(
            (f"  {one.name}", _default(one), one.help or "") for one in options
        )
    yield ""
    if isinstance(abilities, str):
        yield abilities
        return
    if not is_verbose:
        outcomes: list[Outcome] = [one.outcome for one in abilities]
        yield f"{counted(len(abilities), 'kind')} of models; --verbose lists them"
        yield from aligned(
            (f"  {outcomes.count(name)}", name, MEANINGS[name])
            for name in dict.fromkeys(outcomes)
        )
        return
    rows = [(f"  {one.sample}", *_outcome(one)) for one in abilities]
    yield from aligned(rows)
    if dialects:
        yield ""
        yield from ability_lines(dialects)


def _default(one: OptionFacts) -> str:
    default = one.default
    if isinstance(default, tuple | list):
        shown = ",".join(map(str, default))
    elif isinstance(default, bool):
        shown = "yes" if default else "no"
    else:
        shown = "none" if default is None else str(default)
    others = [choice for choice in one.choices if choice != shown]
    return f"{shown} (or {', '.join(others)})" if others else shown


def _outcome(one: Ability) -> tuple[str, str]:
    reason = " ".join(one.reasons[0].split())[:_LONGEST] if one.reasons else ""
    if len(one.reasons) > 1:
        reason += f" (and {len(one.reasons) - 1} more)"
    bound = "" if one.bound is None else f"within {one.bound:.1g}: "
    return one.outcome, f"{bound}{reason}"

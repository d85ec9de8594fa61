"""Where something was measured: processor, system, versions, and how busy it was."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import statistics
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from fuzzytree.benchmarking.records import Machine, Point, Timing

PACKAGES = ("fuzzytree-toolkit", "numpy")
"""Packages whose versions are always reported."""

_STOLEN = 0.05  # share of the wall time from which the machine counts as noisy
_SPREAD = 0.1  # width of an interval, as a share of its median, that is worth a word
_CPU_INFO = Path("/proc/cpuinfo")


def machine(modules: Iterable[str] = ()) -> Machine:
    """Return what there is to know about this machine now.

    Versions are those of the packages that have the `modules`, beside `PACKAGES`.

    Example:
        >>> machine(["no_such_module"]).cores >= 1
        True
    """
    owners = importlib.metadata.packages_distributions()
    names = sorted({*PACKAGES, *(p for one in {*modules} for p in owners.get(one, ()))})
    versions = {name: version for name in names if (version := _version(name))}
    return Machine(
        _processor(),
        _cores(),
        f"{platform.system()} {platform.release()} {platform.machine()}",
        f"{platform.python_implementation()} {platform.python_version()}",
        versions,
        load_before=load_averages(),
    )


def after(before: Machine, timings: Sequence[Timing]) -> Machine:
    """Return a machine with what is known of it once everything is measured."""
    measured = [one for one in timings if one.stolen is not None]
    spent = [sum(one.samples_ns) * one.calls for one in measured]
    lost = [(one.stolen or 0.0) * s for one, s in zip(measured, spent, strict=True)]
    return msgspec.structs.replace(
        before,
        load_after=load_averages(),
        stolen=sum(lost) / sum(spent) if sum(spent) > 0 else None,
    )


def noise(facts: Machine, points: Sequence[Point]) -> Iterator[str]:
    """Yield what makes the times doubtful, a sentence each.

    The machine counts as noisy if the process was kept from running for more than a
    twentieth of the time, if others wanted its cores before it began, or if half of
    the intervals are wider than a tenth of their median.
    """
    if facts.stolen is not None and facts.stolen > _STOLEN:
        yield (
            f"the machine was noisy: for {facts.stolen:.0%} of the time the process "
            "was ready and did not run; times are too high by about as much"
        )
    if facts.load_before and facts.load_before[0] > facts.cores - 0.5:
        yield (
            f"the machine was busy: its load was {facts.load_before[0]:.2g} on "
            f"{facts.cores} cores before the study began"
        )
    widths = [
        (one.high_ns - one.low_ns) / one.median_ns
        for point in points
        for one in point.timings
        if one.median_ns > 0
    ]
    if widths and statistics.median(widths) > _SPREAD:
        yield (
            "the times are uncertain: half of the confidence intervals are wider than "
            f"{statistics.median(widths):.0%} of their median"
        )


def load_averages() -> tuple[float, ...]:
    """Return the load of the last 1, 5 and 15 minutes; nothing if unknown."""
    return os.getloadavg() if hasattr(os, "getloadavg") else ()


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    if _CPU_INFO.exists():
        for line in _CPU_INFO.read_text("utf-8", "replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _cores() -> int:
    """Return how many cores the process may use, which can be fewer than there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1

"""What must be set before any library is imported, and what all tests share."""

import gc
import os
import shlex
import signal
import sys
from collections import Counter
from collections.abc import Generator

import pytest
from hypothesis import HealthCheck, settings

# Examples are the same in each run, and no clock judges: a busy machine is no fault.
settings.register_profile(
    "same",
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("same")

# A shell has the jobs of its background ignore Ctrl-C, which tests send to themselves.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Modules are compiled once, not by each worker and by each program that a test starts.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# scikit-learn leaves checks of its estimators out without it.
os.environ.setdefault("SCIPY_ARRAY_API", "1")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Spare the garbage collector the thousands of tests, which live to the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.collect()
        gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print, for each test that failed, the command that runs it alone."""
    stats = terminalreporter.stats
    names = [
        report.nodeid for kind in ("failed", "error") for report in stats.get(kind, ())
    ]
    for name in dict.fromkeys(names):
        words = (".venv/bin/python", "-m", "pytest", "-m", "heavy or not heavy", name)
        terminalreporter.write_line(f"run it alone: {shlex.join(words)}")


_MANY_CASES = 6


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a run be bounded: `--every 2` runs every second case of large heavy tests."""
    text = f"run one case in so many of heavy tests with {_MANY_CASES} cases or more"
    parser.addoption("--every", type=int, default=1, help=text)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Mark cases as heavy, and leave some of the heavy ones out with `--every`."""
    _mark_heavy(items)
    step = config.getoption("--every")
    heavy = [item for item in items if item.get_closest_marker("heavy") is not None]
    sizes = Counter(item.nodeid.partition("[")[0] for item in heavy)
    seen: Counter[str] = Counter()
    for item in heavy if step > 1 else ():
        name = item.nodeid.partition("[")[0]
        if sizes[name] >= _MANY_CASES and seen[name] % step:
            items.remove(item)
        seen[name] += 1


def _mark_heavy(items: list[pytest.Item]) -> None:
    """Leave one case in so many of a test with the mark `one_in`; others are heavy."""
    cases: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("one_in")
        if mark is None or item.get_closest_marker("heavy") is not None:
            continue
        name = item.nodeid.partition("[")[0]
        if cases[name] % mark.args[0]:
            item.add_marker("heavy")
        cases[name] += 1


@pytest.fixture(scope="module")
def few_objects() -> None:
    """Keep what tests before have made from the collection before a measurement."""
    gc.collect()
    gc.freeze()

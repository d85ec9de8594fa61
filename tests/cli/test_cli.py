"""The command line as a whole: help, mistakes, streams, exit codes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fuzzytree.cli import main, run
from fuzzytree.cli.console import progress_bar
from fuzzytree.cli.program import VERBS
from tests.cli.conftest import Call

ROOT = Path(__file__).resolve().parent.parent.parent
HEAVY = "numpy|onnx|onnxruntime|sklearn|pandas|polars|pyarrow|narwhals|rich|yaml"


def _python(*words: str, **more: object) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-W", "error", *words],
        env=environment, text=True, capture_output=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "code",
    [
        "import fuzzytree; dir(fuzzytree)",
        "from fuzzytree.cli import main\n"
        f"for words in [], *([verb] for verb in {tuple(VERBS)!r}):\n"
        "    assert main([*words, '--help']) == 0",
    ],
    ids=["import", "help"],
)
def test_neither_the_import_nor_help_loads_anything_heavy(code: str) -> None:
    ask = (
        f"{code}\nimport sys\nheavy = set('{HEAVY}'.split('|')) & set(sys.modules)\n"
        "sys.exit(' '.join(heavy) or 0)"
    )
    done = _python("-c", ask)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_package_runs_as_a_program() -> None:
    done = _python("-m", "fuzzytree", "--help")
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: fuzzytree [OPTIONS] VERB")


def test_every_verb_has_help(call: Call) -> None:
    for verb in VERBS:
        code, out, err = call(verb, "--help")
        assert (code, err) == (0, "")
        assert out.startswith(f"Usage: fuzzytree {verb}")


def test_the_version_is_reported(call: Call) -> None:
    code, out, _ = call("--version")
    assert code == 0
    assert out.startswith("fuzzytree ")


def test_an_unknown_verb_is_a_sentence_with_a_guess(call: Call) -> None:
    assert call("chekc") == (
        2,
        "",
        f"no verb 'chekc'; there is {', '.join(VERBS)} (did you mean 'check'?)\n"
        "  fuzzytree --help lists the options\n",
    )


@pytest.mark.parametrize(
    ("word", "verb"), [("predict", "run"), ("train", "learn"), ("fit", "learn")]
)
def test_the_words_of_other_libraries_lead_to_a_verb(
    call: Call, word: str, verb: str
) -> None:
    code, _, err = call(word, "t.csv")
    assert (code, err.splitlines()[0]) == (
        2,
        f"no verb {word!r}; there is {', '.join(VERBS)} (did you mean {verb!r}?)",
    )


def test_an_unknown_option_is_a_sentence_with_a_guess(call: Call) -> None:
    code, out, err = call("run", "a", "b", "--strenths")
    assert (code, out) == (2, "")
    assert err.startswith("no such option '--strenths'")
    assert "'--strengths'" in err
    assert err.endswith("\n  fuzzytree run --help lists the options\n")


def test_an_option_of_scikit_learn_is_refused_with_ours(call: Call) -> None:
    assert call("learn", "a.csv", "--random-state", "3") == (
        2,
        "",
        "no such option '--random-state' (did you mean '--seed'?)\n"
        "  fuzzytree learn --help lists the options\n",
    )
    assert call("show", "a.yaml", "--random-state", "3") == (
        2,
        "",
        "no such option '--random-state'\n  fuzzytree show --help lists the options\n",
    )


def test_a_missing_argument_is_a_sentence(call: Call) -> None:
    message = "missing argument 'MODEL'\n  fuzzytree run --help lists the options\n"
    assert call("run") == (2, "", message)


def test_an_interrupt_that_becomes_another_error_ends_with_130(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def imported(*_: object, **__: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setattr(run.command, "callback", imported)
    message = "interrupted; files are as they were\n"
    assert call("run", "grip.yaml", "grasps.csv") == (130, "", message)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_ends_with_130(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run.command, "callback", interrupt)
    message = "interrupted; files are as they were\n"
    assert call("run", "a", "b") == (130, "", message)


def _shell(command: str, folder: Path, **more: str) -> tuple[int, str, str]:
    done = subprocess.run(
        ["bash", "-c", command.replace("fuzzytree", f"{sys.executable} -m fuzzytree")],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT), "LC_ALL": "C", **more},
        text=True, capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.heavy
def test_a_reader_who_leaves_early_sees_no_traceback(folder: Path) -> None:
    with (folder / "long.csv").open("w") as file:
        file.write("force,slip\n" + "1,0\n" * 50_000)
    command = (
        "fuzzytree run grip.yaml long.csv --quiet | head -1; exit ${PIPESTATUS[0]}"
    )
    assert _shell(command, folder) == (141, "class,rule,status\n", "")


def test_a_full_standard_output_is_one_sentence(folder: Path) -> None:
    code, _, err = _shell("fuzzytree show grip.yaml > /dev/full", folder)
    assert (code, err) == (2, "cannot continue: no space left on device\n")


def test_a_terminal_without_lines_to_draw_gets_escapes(folder: Path) -> None:
    command = "fuzzytree show grip.yaml"
    code, out, err = _shell(command, folder, PYTHONIOENCODING="latin-1")
    assert (code, err) == (0, "")
    assert "\\u251c\\u2500 low (<= 2): soft" in out


def test_a_bar_appears_only_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.cli.console._PATIENCE_S", 0.0)
    with progress_bar() as show:
        show("learning", 0.5)
    assert capsys.readouterr().err == ""


def test_a_bar_waits_half_a_second(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with progress_bar() as show:
        show("learning", 0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("fuzzytree.cli.console._PATIENCE_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar() as show:
        show("learning [/b]\x1b[2J", 0.5)
    assert r"learning [/b]\x1b[2J" in capsys.readouterr().err


def test_a_bar_appears_while_one_long_piece_of_work_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting: list[Callable[[], None]] = []

    class Timer:
        def __init__(self, _seconds: float, function: Callable[[], None]) -> None:
            waiting.append(function)

        def start(self) -> None:
            """Wait for the test."""

        cancel = start

    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("fuzzytree.cli.console.threading.Timer", Timer)
    monkeypatch.setattr("fuzzytree.cli.console._PATIENCE_S", 1e9)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar() as show:
        waiting[0]()
        assert capsys.readouterr().err == ""
        show("reading grip.yaml", None)
        waiting[0]()
    assert "reading grip.yaml" in capsys.readouterr().err
    waiting[0]()
    assert capsys.readouterr().err == ""


def test_a_conversion_reports_its_progress_from_reading_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts: list[str] = []

    @contextlib.contextmanager
    def bar(**_: object) -> Iterator[Callable[[str, float | None], None]]:
        yield lambda text, _share: texts.append(text)

    monkeypatch.chdir(folder)
    monkeypatch.setattr("fuzzytree.cli.convert.progress_bar", bar)
    assert main(["convert", "grip.yaml", "new.yaml"]) == 0
    assert texts == [
        "reading grip.yaml",
        "writing yaml",
        "comparing yaml with the model",
    ]


def test_main_takes_the_words_of_the_process(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["fuzzytree", "--version"])
    assert main() == 0
    assert capsys.readouterr().out.startswith("fuzzytree ")


def test_too_little_memory_is_one_sentence(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("fuzzytree.api.read", fail)
    monkeypatch.setattr("fuzzytree.checking.converting.read_bounded", fail)
    assert call("show", "grip.yaml") == (
        2,
        "",
        "cannot continue: there is not enough memory\n",
    )

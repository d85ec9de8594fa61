"""The command line: one module per verb, loaded when its verb is used.

Data goes to stdout, messages go to stderr. Exit codes: 0 fine; 1 it ran and found
something; 2 it could not run; 130 interrupted; 141 the reader of the output is gone.
"""

from __future__ import annotations

import contextlib
import difflib
import importlib
import io
import os
import signal
import sys
import threading
from collections.abc import Generator, Mapping, Sequence
from types import MappingProxyType

import click

from fuzzytree.cli.console import say
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.files import reason
from fuzzytree.model import noticed, version, watched

_OWN = (
    *("learn", "collect", "show", "page", "export", "convert", "run", "why", "check"),
    *("audit", "require", "diff", "explain", "recheck", "bench", "needs"),
    "stability",
)
VERBS: Mapping[str, str] = MappingProxyType(
    {
        **{name: f"fuzzytree.cli.{name}" for name in _OWN},
        "tactile": "fuzzytree.tactile.cli",
        **{name: f"fuzzytree.cli.{name}" for name in ("formats", "doctor")},
    }
)
"""The module whose `command` each verb is, in the order of the help."""


_OTHER_WORDS: Mapping[str, str] = MappingProxyType(
    {"train": "learn", "fit": "learn", "predict": "run", "verify": "check"}
)


class Verbs(click.Group):
    """A group that imports a verb's module when the verb is used.

    Attributes:
        modules: The module whose `command` each verb is, in the order of the help.
    """

    modules: Mapping[str, str] = VERBS

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs in the order of their usual use."""
        return list(self.modules)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a verb, or None if there is none of that name."""
        if cmd_name not in self.modules:
            return None
        module = importlib.import_module(self.modules[cmd_name])
        command: click.Command = module.command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb, or say which one it might have been."""
        name = args[0]
        if name not in self.modules and not name.startswith("-"):
            close = difflib.get_close_matches(name, self.modules, n=1)
            meant = {_OTHER_WORDS.get(name, ""), *close} & {*self.modules}
            hint = f" (did you mean {meant.pop()!r}?)" if meant else ""
            raise click.UsageError(
                f"no verb {name!r}; there is {', '.join(self.modules)}{hint}", ctx
            )
        return super().resolve_command(ctx, args)


def _show_version(ctx: click.Context, _: click.Parameter, is_asked: bool) -> None:
    if is_asked:
        click.echo(f"fuzzytree {version()}")
        ctx.exit()


@click.group(
    "fuzzytree",
    cls=Verbs,
    subcommand_metavar="VERB [ARGUMENTS]...",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_version,
    help="Show the version.",
)
def program() -> None:
    """Learn a fuzzy decision tree, read it as rules, run it anywhere, check it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Args:
        arguments: The words after the program's name; those of the process if None.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    _spare_encodings()
    try:
        with _interruptible(), program.make_context("fuzzytree", words) as context:
            code = program.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Exit as found:
        return found.exit_code
    except click.ClickException as error:
        say(_usage_text(error))
        return 2
    except BrokenPipeError:
        _forget_stdout()
        return 141
    except FuzzyTreeError as error:
        say(_error_text(error, words[0] if words else ""))
        return 2
    except OSError as error:
        say(f"cannot continue: {reason(error)}")
        _forget_stdout()
        return 2
    except MemoryError:
        say("cannot continue: there is not enough memory")
        return 2
    except (KeyboardInterrupt, click.Abort):
        say("interrupted; files are as they were")
        return 130
    return code if isinstance(code, int) else 0


@contextlib.contextmanager
def _interruptible() -> Generator[None]:
    """Report a Ctrl-C as one, although an interrupted library raised another error.

    An extension module that is being imported does so. SIGTERM is a Ctrl-C too.
    """
    is_main = threading.current_thread() is threading.main_thread()
    with noticed() as check, watched(check), contextlib.ExitStack() as stack:
        if is_main and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, signal.getsignal(signal.SIGINT))
            stack.callback(signal.signal, signal.SIGTERM, signal.SIG_DFL)
        try:
            yield
        except (FuzzyTreeError, click.ClickException, click.exceptions.Exit):
            raise
        except Exception:
            check()
            raise


def _error_text(error: FuzzyTreeError, verb: str) -> str:
    """Return a message that names options of the command line."""
    text = str(error).replace("pass dialect=", "pass --dialect ")
    text = text.replace("pass scores=", "pass --set scores=")
    text = text.replace("pass missing='drop'", "pass --missing drop")
    text = text.replace("pass repeated=True", "pass --repeated")
    command = program.get_command(click.Context(program), verb)
    options = [name for one in command.params for name in one.opts] if command else []
    offer = "use `fuzzytree convert --allow-loss`"
    if "--allow-loss" in options:
        offer = "pass --allow-loss"
    return text.replace("pass allow_loss=True", offer)


_SYNONYMS = {
    **{"--columns": "--inputs", "--full": "--verbose", "--ignore": "--skip"},
    **{"--label": "--target", "--limit": "--generate", "--max-depth": "--depth"},
    **{"--max-leaf-nodes": "--leaves", "--min-samples-leaf": "--min-rows"},
    **{"--only": "--select", "--page": "--serve", "--plot": "--picture"},
    **{"--random-state": "--seed", "--rows": "--generate", "--time": "--budget"},
}
"""What options are called elsewhere, and here."""


def _usage_text(error: click.ClickException) -> str:
    message = error.format_message().strip()
    context = error.ctx if isinstance(error, click.UsageError) else None
    if context and isinstance(error, click.NoSuchOption):
        name = _SYNONYMS.get(error.option_name)
        if any(name in parameter.opts for parameter in context.command.params):
            message = f"{error.message.removesuffix('.')} (did you mean {name!r}?)"
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        return message
    message = message[:1].lower() + message[1:]
    if not message.endswith("..."):
        message = message.removesuffix(".")
    hint = f"\n  {context.command_path} --help lists the options" if context else ""
    return message + hint


def _forget_stdout() -> None:
    """Keep Python from flushing to a closed stream, which would be an error."""
    with contextlib.suppress(OSError):  # tests have a stdout without a number
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _spare_encodings() -> None:
    """Write a character that the terminal does not know as an escape, not an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.encoding.lower() != "utf-8":
            stream.reconfigure(errors="backslashreplace")

"""The command line: the group of commands, and the exit code of every error."""

import ast
import os
import re
import sys
import traceback
import warnings
from importlib import import_module
from pathlib import Path

import click

from dropspin.reports.commands import environment_checks
from dropspin.reports.terminal.interrupts import handle_interrupts, stop_if_interrupted
from dropspin.reports.terminal.streams import error_of, unfailing

GROUPS = {
    "Use": ("run", "list", "show", "replay", "report", "diagnose", "calibrate"),
    "Compare with a recording": ("log check", "log fit", "log compare"),
    "Judge": ("check", "accept", "compare", "compare history"),
    "Study": ("tradeoff", "limits", "symmetries", "symmetries twins", "sweep", "reproduce"),
    "Write an adapter": ("new-adapter", "conform"),
    "Maintain": ("record", "record rerun", "record publish", "bugs", "doctor"),
}
COMMANDS = [name for group in GROUPS.values() for name in group]
"""The commands, each in `reports/commands/`, in a file of its name with `_` for `-` and for spaces."""
MOVED = {name.rpartition(" ")[2]: name for name in ("compare history", "symmetries twins", "record rerun", "record publish")}
"""The commands that were commands of their own in earlier versions."""
VERSION = """dropspin, version %(version)s
To cite: The dropspin authors, dropspin, version %(version)s;
for the engine wang: Huamin Wang, Rigid Body Dynamics (lecture note)."""
"""The version and the text to cite; a test compares it with CITATION.cff."""
LONGEST_ARGUMENT = 4096
LONGEST_MESSAGE = 1500
INTERRUPTED = 130  # 128 + SIGINT, as in shells
INTERNAL_ERROR = 70  # EX_SOFTWARE of sysexits.h: neither a verdict nor a usage error


def main() -> None:
    """Run the command line; every expected error ends with one line and exit code 2."""
    sys.stdout, sys.stderr = map(unfailing, (sys.stdout, sys.stderr))
    handle_interrupts()
    warnings.showwarning = lambda message, *_: _say(f"warning: {message}")
    code = _run_and_report_errors()
    if (error := error_of(sys.stdout)) is not None and not isinstance(error, BrokenPipeError):
        _say(f"standard output cannot be written: {error.strerror}; what was printed is lost.")
        code = code or 2
    sys.exit(code)


def _run_and_report_errors() -> int:
    """Run the command, print its error if it has one, and return the exit code."""
    if problem := environment_checks.problem():
        click.echo(f"dropspin: {problem}.", err=True)
        return 2
    os.environ.pop("MPLBACKEND", None)  # plots become files; the backend of a notebook need not be installed here
    try:
        return _run()
    except (click.Abort, KeyboardInterrupt) as interrupt:
        details = (interrupt.__cause__ or interrupt).args  # click wraps the interrupts of commands in its own
        click.echo(f"dropspin: interrupted; {details[0] if details else 'nothing was written'}.", err=True)
        return INTERRUPTED
    except OSError as error:
        _say(_text(error))
        return 2
    except Exception as error:
        limit = environment_checks.limited_to()
        if limit is not None or isinstance(error, MemoryError):
            click.echo(
                f"dropspin: {environment_checks.shortage(limit)} ({type(error).__name__}: {' '.join(str(error).split())}).", err=True
            )
            return 2
        click.echo("dropspin: internal error; please report the following output.", err=True)
        traceback.print_exc()
        return INTERNAL_ERROR


def _run() -> int:
    """Run the command, and return the exit code."""
    try:
        for argument in sys.argv[1:]:
            if not argument.isprintable() or len(argument) > LONGEST_ARGUMENT:
                text = f"{argument!r:.60}"
                raise click.UsageError(f"the argument {text} is not printable text of at most {LONGEST_ARGUMENT} characters.")
        return dropspin(prog_name="dropspin", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return 2
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        hint = f" To list the arguments and options: {context.command_path} --help" if context else ""
        message = error.format_message().rstrip(".")
        _say(f"{message}{'' if message.endswith('?') else '.'}{hint}")
        return 2
    except click.Abort:  # an interrupt of a command, with its message
        raise
    except SystemExit:  # click exits here only on a closed pipe, to a process, with code 1, which would mean a failed check
        raise OSError("a process has closed the pipe to it") from None
    except Exception as error:
        stop_if_interrupted()  # compiled code, such as the import of an engine, may turn an interrupt into another exception
        from dropspin.scenarios import DropspinError

        if not isinstance(error, DropspinError):
            raise
        _say(_text(error))
        from dropspin.comparisons.engines.base import EngineBroken, EngineMissing

        return 3 if isinstance(error, EngineBroken | EngineMissing) else 2


def _text(error: Exception) -> str:
    """The message of an error, and the notes that were added to it."""
    return " ".join([str(error), *getattr(error, "__notes__", [])])


def _say(message: str) -> None:
    """Print an error message as one line. Names in a file may have any length: of a longer line, the middle is left out."""
    from dropspin.reports.terminal.safe_output import echo

    line = " ".join(message.splitlines())
    if len(line) > LONGEST_MESSAGE:
        line = f"{line[: LONGEST_MESSAGE // 2]} ... {line[-LONGEST_MESSAGE // 2 :]}"
    echo(f"dropspin: {line}", err=True)


def _module_of(command: str) -> str:
    return command.replace("-", "_").replace(" ", "_")


def _line_of(command: str) -> str:
    """The first sentence of the docstring of a command, read without an import."""
    tree = ast.parse(Path(__file__).with_name(f"{_module_of(command)}.py").read_text(encoding="utf-8"))
    text = next(ast.get_docstring(node) for node in tree.body if isinstance(node, ast.FunctionDef))
    return re.split(r":|\.(?!\w)", text or "")[0] + "."


class _LazyGroup(click.Group):
    """A group that imports a command only when it is called, so that the help imports no command."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return COMMANDS

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        words = 2 if " ".join(args[:2]) in COMMANDS else 1
        name = " ".join(args[:words])
        if name in MOVED:
            raise click.UsageError(f"{name} is now: dropspin {MOVED[name]}.")
        if name not in COMMANDS and (below := [command for command in COMMANDS if command.startswith(f"{name} ")]):
            listed = {command.removeprefix(f"{name} "): click.Command(command, short_help=_line_of(command)) for command in below}
            return name, click.Group(name, listed), args[1:]
        if name not in COMMANDS and not name.startswith("-"):
            from dropspin.scenarios import UnknownName

            raise click.UsageError(str(UnknownName("command", name, COMMANDS)), ctx)
        return super().resolve_command(ctx, [name, *args[words:]])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = _module_of(cmd_name)
        return getattr(import_module(f"dropspin.reports.commands.{module}"), f"{module}_command")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, names in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name, _line_of(name)) for name in names])


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100, "show_default": True})
@click.version_option(package_name="dropspin", message=VERSION, help="Show the version and what to cite, and exit.")
def dropspin() -> None:
    """Run drop and spin scenes with rigid-body engines and compare them with exact solutions."""

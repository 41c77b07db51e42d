"""Options that several commands share."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from dropspin.comparisons.running.process_limits import ResourceLimits

Command = TypeVar("Command", bound=Callable[..., Any])

as_json = click.option("--json", "json_output", is_flag=True, help="Print JSON instead of a table.")
BASELINE = "dropspin-baseline.toml"
"""The baseline that `accept` writes and `check` reads unless another one is named."""
scenes_argument = click.argument("scenes", nargs=-1, metavar="[SCENE]...")
baseline_option = click.option("--baseline", metavar="FILE", help="Baseline to compare the run with: the file that dropspin accept wrote.")
summary_option = click.option("--summary", metavar="FILE", help="Append a Markdown summary to this file, such as $GITHUB_STEP_SUMMARY.")


def write_text(path: str, text: str, *, append: bool = False) -> None:
    """Write a text to a file, or append it.

    Raises:
        DropspinError: The file cannot be written.
    """
    from dropspin.comparisons.results.complete_folders import written_whole
    from dropspin.scenarios import DropspinError

    target = Path(path)
    if not append and (target.is_file() or not target.exists()):
        with written_whole(path) as unfinished:
            unfinished.write_text(text, encoding="utf-8")
        return
    try:  # a summary grows, and /dev/stdout is written as it is
        target.parent.mkdir(parents=True, exist_ok=True)
        with open(target, "a" if append else "w", encoding="utf-8", opener=_open_at_once) as file:
            os.set_blocking(file.fileno(), True)
            file.write(text)
    except OSError as error:
        raise DropspinError(f"{path}: cannot be written: {error.strerror}; choose another file.") from None


def _open_at_once(path: str, flags: int) -> int:
    """Open a file; a pipe that no process reads is an error, and not a wait for one."""
    return os.open(path, flags | os.O_NONBLOCK, 0o666)


class _Finite(click.FloatRange):
    """A number in a range that is finite: click's own range accepts nan, and inf."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


POSITIVE = _Finite(0.0, min_open=True)
ONE_MINUTE, FIVE_MINUTES = 60.0, 300.0
"""Processor times of the `ResourceLimits` of these names [s], whose module takes longer to import than a command to print its help."""
within_option = click.option(
    "--within",
    type=POSITIVE,
    metavar="SHARE",
    help="Largest error, relative to its scale, up to which the conclusion recommends an engine. [default: 0.01]",
)


class WholeNumbers(click.ParamType):  # type: ignore[type-arg]  # not generic at run time before click 8.5
    """Whole numbers above 0, separated by commas."""

    name = "whole numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        parts = value.split(",")
        if not all(part.isascii() and part.isdigit() and 0 < len(part) < 10 and int(part) > 0 for part in parts):
            self.fail(f"{value!r} is not a list of whole numbers above 0, such as 1,256,4096.", param, ctx)
        return tuple(map(int, parts))


def seconds_option(*names: str, default: float, of: str, least: float = 0.0, callback: Any = None) -> Callable[[Command], Command]:
    """An option whose value is a processor time."""
    kind, text = _Finite(least, 1e7, min_open=least == 0.0), f"Processor time {of}"
    return click.option(*names, type=kind, default=default, metavar="SECONDS", help=text, callback=callback)


def time_limit_option(of: str, default: float = ONE_MINUTE) -> Callable[[Command], Command]:
    """The option `--time-limit` of an engine's process, of which a command gets the `ResourceLimits`."""
    return seconds_option("--time-limit", "resources", default=default, of=f"that {of}.", least=0.01, callback=_resources)


def _resources(context: click.Context, parameter: click.Parameter, seconds: float) -> "ResourceLimits":
    from dropspin.comparisons.running.process_limits import ResourceLimits

    return ResourceLimits(processor_time=seconds)


def engines_option(
    what: str = "An engine, with options (dropspin show ENGINE lists them); repeat for more.", *, required: bool = False
) -> Callable[[Command], Command]:
    """The option that names engines."""
    return click.option("-e", "--engine", "engines", multiple=True, required=required, metavar="ENGINE", help=what)


def output_option(default: str, of: str) -> Callable[[Command], Command]:
    """The option `-o`: a folder."""
    return click.option("-o", "--output", default=default, metavar="DIR", help=f"Folder {of}.")


def step_option(of: str) -> Callable[[Command], Command]:
    """The option `--dt` of a command with one time step."""
    return click.option("--dt", default=1e-3, type=float, metavar="SECONDS", help=f"The time step{of}.")


def jobs_option(pieces: str) -> Callable[[Command], Command]:
    """The option `-j`: how many pieces of work to do at a time."""
    text = f"Number of {pieces} at a time; the results do not depend on it. [default: the number of processors]"
    return click.option("-j", "--jobs", type=click.IntRange(min=1), metavar="N", help=text)

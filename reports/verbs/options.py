"""Options that several verbs have."""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

as_json = click.option("--json", "json_output", is_flag=True, help="Print JSON instead of a table.")


def _finite(context: click.Context, parameter: click.Parameter, value: float) -> float:
    if not math.isfinite(value):
        raise click.BadParameter(f"{value} is no time in seconds.", context, parameter)
    return value


def time_limit_option(default: float, of: str) -> Callable[[Command], Command]:
    """The option of what an engine's process may use."""
    return click.option(
        "--time-limit",
        type=click.FloatRange(min=0.0, min_open=True),
        default=default,
        show_default=True,
        metavar="SECONDS",
        callback=_finite,
        help=f"Processor time that {of}.",
    )

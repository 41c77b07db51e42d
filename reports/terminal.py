"""Tables of words, progress and status on a terminal; plain lines elsewhere."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text


def print_rows(rows: list[dict[str, str]], json_output: bool) -> None:
    """Print rows with the same keys as a table, or as JSON."""
    if json_output:
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False))
        return
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_header=list(rows[0]) not in (["what", "is"], ["what", "found"]))
    for number, column in enumerate(rows[0]):
        table.add_column(column, overflow="fold", no_wrap=number == 0 and len(rows[0]) > 2)
    for row in rows:
        table.add_row(*(Text(value) for value in row.values()))
    Console().print(table)


@contextmanager
def progress_bar(total: int) -> Iterator[Callable[[str, str, float], None]]:
    """A bar on a terminal; elsewhere one line a scene. All of it on the standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        seen: set[str] = set()

        def line(scene: str, engine: str, dt: float) -> None:
            if scene not in seen:
                seen.add(scene)
                click.echo(f"running {scene}", err=True)

        yield line
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=total)

        def advance(scene: str, engine: str, dt: float) -> None:
            bar.update(task, advance=1, description=f"{scene} {engine} {dt:g} s")

        yield advance


@contextmanager
def status(text: str) -> Iterator[None]:
    """Say what is going on while it goes on."""
    console = Console(stderr=True)
    if not console.is_terminal:
        click.echo(text, err=True)
        yield
        return
    with console.status(text):
        yield


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar of a share of work done on a terminal; elsewhere one line. On the standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        click.echo(f"running {title}", err=True)
        yield lambda what, share: None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda what, share: bar.update(task, completed=share, description=f"{title}: {what}")

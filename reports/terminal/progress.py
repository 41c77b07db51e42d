"""Progress and status on standard error: bars on a terminal, plain lines elsewhere."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Task, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.text import Text

from dropspin.comparisons.running.progress import OnProgress, Progress
from dropspin.reports.terminal.safe import echo, safe, styled
from dropspin.reports.views.numbers import in_ms
from dropspin.scenarios.text import counted


class RunProgress(NamedTuple):
    """The functions that show the progress of a run.

    Attributes:
        on_progress: To be called as `run` calls it.
        on_finished: To be called with the name of each scene that is finished; scenes run in parallel.
        show_line: Prints a line.
    """

    on_progress: OnProgress
    on_finished: Callable[[str], None]
    show_line: Callable[[str], None]


@contextmanager
def progress_bar(scenes: int, pieces: int) -> Iterator[RunProgress]:
    """A progress bar of scenes on a terminal; elsewhere, a line when a scene starts and when it is finished, with the elapsed time."""
    console, start = Console(stderr=True), time.monotonic()
    started: dict[str, None] = {}
    finished: set[str] = set()

    def starts(progress: Progress) -> bool:
        """Whether a scene starts; one of an interrupted run, of which only the end is reported, is finished."""
        if progress.timing or progress.scene in started or progress.scene in finished:
            return False
        if progress.finished:
            finished.add(progress.scene)
        else:
            started[progress.scene] = None
        return not progress.finished

    def of_all(number: int) -> str:
        return f"{number} of {counted(scenes, 'scene')}"

    if not console.is_terminal:
        timed: list[str] = []

        def line(progress: Progress) -> None:
            if progress.timing and not timed:
                timed.append("timing the steps of each engine")
                echo(timed[0], err=True)
            if starts(progress):
                elapsed = _duration(time.monotonic() - start)
                echo(f"running {progress.scene} ({of_all(len(finished))} finished, {elapsed} elapsed)", err=True)

        def finish(scene: str) -> None:
            finished.add(scene)
            running = ", ".join(one for one in list(started) if one not in finished)
            elapsed = _duration(time.monotonic() - start)
            echo(f"finished {scene} ({of_all(len(finished))}, {elapsed} elapsed{running and f'; still running: {running}'})", err=True)

        yield RunProgress(line, finish, lambda text: echo(text, err=True))
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), TaskProgressColumn(), TimeRemainingColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task, done = bar.add_task("starting", total=float(scenes * pieces)), 0
        shares: dict[str, float] = {}  # of the pieces of work that are not finished, by scene

        def advance(progress: Progress) -> None:
            nonlocal done
            starts(progress)
            done += progress.finished
            shares[progress.scene] = 0.0 if progress.added or progress.finished or not progress.total else progress.done / progress.total
            description = f"{of_all(len(finished))} finished; {_described(progress)}"
            bar.update(task, completed=done + sum(shares.values()), description=safe(description))

        yield RunProgress(advance, finished.add, lambda text: console.print(styled(text), soft_wrap=True))


@contextmanager
def status(text: str) -> Iterator[None]:
    """Show a text while the `with` block runs."""
    console = Console(stderr=True)
    if not console.is_terminal:
        echo(text, err=True)
        yield
        return
    with console.status(text):
        yield


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar on a terminal; elsewhere, one line."""
    console = Console(stderr=True)
    if not console.is_terminal:
        echo(f"running {title}", err=True)
        yield lambda what, share: None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task(safe(title), total=1.0)
        yield lambda what, share: bar.update(task, completed=share, description=safe(f"{title}: {what}"))


EVERY = 5.0
"""Time between two lines [s]."""


@contextmanager
def jobs_bar(total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar of jobs, with their rate and the remaining time, on a terminal; elsewhere, a line every few seconds.

    The first call gives the number of jobs that an earlier run completed; they are not included in the rate.
    """
    console = Console(stderr=True)
    start, before, done, last = time.monotonic(), -1, 0, 0.0

    def rate() -> float:
        return (done - max(before, 0)) / max(time.monotonic() - start, 1e-9)

    def count(jobs: int) -> None:
        nonlocal before, done
        done += jobs
        before = done if before < 0 else before

    if not console.is_terminal:

        def line(jobs: int) -> None:
            nonlocal last
            count(jobs)
            now = time.monotonic()
            if jobs and (now - last >= EVERY or done == total):
                last = now
                left = f", {_duration((total - done) / rate())} left" if rate() > 0.0 else ""
                echo(f"{done:,} of {total:,} jobs, {rate():,.0f} per second{left}", err=True)

        yield line
        return

    class Rate(TextColumn):
        """Jobs per second."""

        def render(self, task: Task) -> Text:
            return Text(f"{rate():,.0f}/s")

    columns = (TextColumn("jobs"), BarColumn(), MofNCompleteColumn(), Rate(""), TimeRemainingColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("jobs", total=total)

        def advance(jobs: int) -> None:
            count(jobs)
            bar.update(task, completed=done)

        yield advance


def _described(progress: Progress) -> str:
    """Scene, engine, time step, and the number of the simulation."""
    if progress.timing:
        return f"timing {progress.engine} in {progress.scene}, {in_ms(progress.dt)}"
    start = f", start {min(progress.done + 1, progress.total)} of {progress.total}" if progress.total and not progress.finished else ""
    return f"{progress.scene}, {progress.engine}, {in_ms(progress.dt)}{' (added)' if progress.added else ''}{start}"


def _duration(seconds: float) -> str:
    minutes, hours = seconds / 60.0, seconds / 3600.0
    return f"{hours:.1f} h" if hours >= 1.0 else f"{minutes:.0f} min" if minutes >= 2.0 else f"{seconds:.0f} s"

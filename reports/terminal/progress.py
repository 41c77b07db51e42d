"""Progress and status on standard error: bars on a terminal, plain lines elsewhere. Each update stops an interrupted command."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from dropspin.comparisons.running.progress import Progress
from dropspin.reports.stories.numbers import in_ms
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo, safe, styled
from dropspin.scenarios.text import counted

EVERY, SELDOM = 5.0, 10.0
"""Times between two lines of a sweep, and of other work [s]."""


class RunProgress:
    """The progress of a run, as a bar of scenes on a terminal; elsewhere, a line when a scene is finished, with the elapsed time."""

    def __init__(self, bar: Bar, scenes: int, pieces: int) -> None:
        self._bar, self._task, self._scenes = bar, bar.add_task("starting", total=float(scenes * pieces)), counted(scenes, "scene")
        self._start, self._done, self._finished, self._has_timed = time.monotonic(), 0, 0, False
        self._shares: dict[str, float] = {}  # of the pieces of work that are not finished, by scene

    def show_line(self, text: str) -> None:
        """Print a line."""
        if self._bar.disable:
            echo(text, err=True)
        else:
            self._bar.console.print(styled(text), soft_wrap=True)

    def on_progress(self, progress: Progress) -> None:
        """Show the progress that `run` reports."""
        stop_if_interrupted()
        if self._bar.disable:
            if progress.timing and not self._has_timed:
                self.show_line("timing the steps of each engine")
            self._has_timed |= progress.timing
            return
        self._done += progress.finished
        is_between = progress.added or progress.finished or not progress.total
        self._shares[progress.scene] = 0.0 if is_between else progress.done / progress.total
        description = safe(f"{self._finished} of {self._scenes} finished; {_described(progress)}")
        self._bar.update(self._task, completed=self._done + sum(self._shares.values()), description=description)

    def on_finished(self, scene: str, count: int) -> None:
        """Show that a scene is finished, and how many are; scenes run in parallel."""
        self._finished = count
        if self._bar.disable:
            self.show_line(f"finished {scene} ({count} of {self._scenes}, {_duration(time.monotonic() - self._start)} elapsed)")


@contextmanager
def progress_bar(scenes: int, pieces: int) -> Iterator[RunProgress]:
    """The progress of a run of some scenes, each with some pieces of work."""
    with _bar(BarColumn(bar_width=20), TaskProgressColumn(), TimeRemainingColumn()) as bar:
        yield RunProgress(bar, scenes, pieces)


@contextmanager
def status(text: str) -> Iterator[None]:
    """Show a text while the `with` block runs."""
    console = Console(stderr=True)
    if not console.is_terminal:
        echo(text, err=True)
    with console.status(text) if console.is_terminal else nullcontext():
        yield


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar on a terminal; elsewhere, a line when the work begins, so that bad input is one line, and one every few seconds."""
    last = -math.inf

    def on_progress(work: str, share: float) -> None:
        nonlocal last
        stop_if_interrupted()
        now = time.monotonic()
        if bar.disable and now - last >= SELDOM:
            echo(f"working on {title}" + f": {share:.0%}, {work}" * math.isfinite(last), err=True)
            last = now
        bar.update(task, completed=share, description=safe(f"{title}: {work}"))

    with _bar(BarColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task(safe(title), total=1.0)
        yield on_progress


@contextmanager
def jobs_bar(total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar of jobs, with their rate and the remaining time, on a terminal; elsewhere, a line every few seconds.

    The first call gives the number of jobs that an earlier run completed; they are not included in the rate.
    """
    start, before, done, last = time.monotonic(), -1, 0, 0.0

    def on_progress(jobs: int) -> None:
        nonlocal before, done, last
        stop_if_interrupted()
        done += jobs
        before = done if before < 0 else before
        now = time.monotonic()
        rate = (done - before) / max(now - start, 1e-9)
        bar.update(task, completed=done, rate=f"{rate:,.0f}/s")
        if bar.disable and jobs and (now - last >= EVERY or done == total):
            last = now
            left = f", {_duration((total - done) / rate)} left" if rate > 0.0 else ""
            echo(f"{done:,} of {total:,} jobs, {rate:,.0f} per second{left}", err=True)

    with _bar(BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn()) as bar:
        task = bar.add_task("jobs", total=total, rate="0/s")
        yield on_progress


def _bar(*columns: Any) -> Bar:
    """A bar after the description of its task; `disable` is set if standard error is not a terminal."""
    console = Console(stderr=True)
    description = TextColumn("{task.description}", markup=False)
    return Bar(description, *columns, console=console, transient=True, disable=not console.is_terminal)


def _described(progress: Progress) -> str:
    """Scene, engine, time step, and the number of the simulation."""
    if progress.timing:
        return f"timing {progress.engine} in {progress.scene}, {in_ms(progress.dt)}"
    start = f", start {min(progress.done + 1, progress.total)} of {progress.total}" if progress.total and not progress.finished else ""
    return f"{progress.scene}, {progress.engine}, {in_ms(progress.dt)}{' (added)' if progress.added else ''}{start}"


def _duration(seconds: float) -> str:
    minutes, hours = seconds / 60.0, seconds / 3600.0
    return f"{hours:.1f} h" if hours >= 1.0 else f"{minutes:.0f} min" if minutes >= 2.0 else f"{seconds:.0f} s"

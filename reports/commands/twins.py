"""`dropspin symmetries twins`."""

import json
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import as_json, jobs_option, time_limit_option
from dropspin.reports.terminal.safe import echo

if TYPE_CHECKING:
    from dropspin.comparisons.symmetries.twins import TwinFinding


@click.command("twins")
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@click.option("-e", "--engine", "engines", multiple=True, required=True, metavar="ENGINE", help="An engine, with options; two or more.")
@click.option("--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The time step.")
@time_limit_option(60.0, "an engine may use for one scene")
@jobs_option("scenes to run")
@as_json
def twins_command(
    scenes: tuple[str, ...], engines: tuple[str, ...], dt: float, time_limit: float, jobs: int | None, json_output: bool
) -> None:
    """Find the time step from which engines of the same algorithm differ, such as MuJoCo and its port to a GPU.

    The motions of each pair of engines are compared at every time step: from which step on they differ at all, by how much before and
    after the first contact, and whether rounding explains it. No exact solution is needed.
    """
    from dropspin.reports.terminal.rows import print_rows, print_sentences
    from dropspin.reports.views import twins as view

    found = _with_progress(scenes, engines, dt, time_limit, jobs)
    if json_output:
        echo(json.dumps(view.as_data(found), indent=1))
        return
    print_rows(view.table(found), json_output=False, left_out_first=("> 1e-12", "> 1e-09"))
    print_sentences(view.sentences(found))


def _with_progress(
    scenes: tuple[str, ...], engines: tuple[str, ...], dt: float, time_limit: float, jobs: int | None
) -> "list[TwinFinding]":
    """The findings of the study, which shows its progress and stops at an interrupt."""
    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.comparisons.symmetries.twins import twins
    from dropspin.reports.terminal.progress import share_bar

    with share_bar("twins") as progress:

        def on_progress(what: str, share: float) -> None:
            stop_if_interrupted()
            progress(what, share)

        return twins(scenes, engines, dt=dt, on_progress=on_progress, resources=ResourceLimits(processor_time=time_limit), jobs=jobs)

"""`dropspin symmetries`."""

import json
import os
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import as_json, jobs_option, time_limit_option
from dropspin.reports.terminal.safe import echo

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.comparisons.symmetries.findings import Finding
    from dropspin.scenarios import Scenario


@click.command("symmetries")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option("-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, with options; repeat for more.")
@click.option("--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The time step.")
@time_limit_option(60.0, "an engine may use for one scene")
@jobs_option("pairs of a scene and an engine to run")
@click.option("-o", "--output", default="out/symmetries", show_default=True, metavar="DIR", help="Folder for the tables.")
@as_json
def symmetries_command(
    scenes: tuple[str, ...], engines: tuple[str, ...], dt: float, time_limit: float, jobs: int | None, output: str, json_output: bool
) -> None:
    """Test whether engines give the same motion for the same scene seen from elsewhere, in other units, or run again.

    Each scene is turned, mirrored, moved, described with other body axes and in other units, and run again: in a batch, in a new
    process, on one core, and stopped and continued. If the engine has other representations of body or floor, or can simulate a second
    body far away, these are compared too. No exact solution is needed. The default is seven scenes with wang, mujoco and pybullet.

    Exit code: 0 whatever is found, 2 bad input; `dropspin run --symmetries` judges.
    """
    from dropspin.comparisons.results.folder import study_folder
    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.comparisons.symmetries.study import SCENES
    from dropspin.reports.study_files import write_symmetries
    from dropspin.reports.terminal.rows import print_rows, print_sentences
    from dropspin.reports.views import symmetries as view
    from dropspin.scenarios import load

    with study_folder(output) as folder:
        loaded = [load(name) for name in scenes or SCENES]
        found = with_progress(loaded, engines, dt, ResourceLimits(processor_time=time_limit), jobs)
        write_symmetries(found, {scene.name: scene for scene in loaded}, dt, folder)
    if json_output:
        echo(json.dumps(view.rows(found), indent=1))
        return
    print_rows(view.worst_rows(found), json_output=False)
    print_sentences([view.legend(found), *view.sentences(found)])
    echo(f"Written: {os.path.join(output, 'symmetries.md')}")
    if view.worst_lost(found):
        echo(f"Replay of the worst case of each engine: {os.path.join(output, 'symmetries.html')}")


def with_progress(
    scenes: "Iterable[Scenario]", engines: "Iterable[str]", dt: float, resources: "ResourceLimits", jobs: int | None
) -> "list[Finding]":
    """The findings of the study, which shows its progress and stops at an interrupt."""
    from dropspin.comparisons.symmetries.study import symmetries
    from dropspin.reports.terminal.progress import share_bar

    with share_bar("symmetries") as progress:

        def on_progress(what: str, share: float) -> None:
            stop_if_interrupted()
            progress(what, share)

        return symmetries(scenes, engines, dt=dt, on_progress=on_progress, resources=resources, jobs=jobs)

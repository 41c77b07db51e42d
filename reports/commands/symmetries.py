"""`dropspin symmetries`."""

import os
from typing import Any

import click

from dropspin.reports.commands.options import (
    as_json,
    engines_option,
    jobs_option,
    output_option,
    scenes_argument,
    step_option,
    time_limit_option,
)


@click.command("symmetries")
@scenes_argument
@engines_option()
@step_option("")
@time_limit_option("an engine may use for one scene")
@jobs_option("pairs of a scene and an engine to run")
@output_option("out/symmetries", "for the tables")
@as_json
def symmetries_command(scenes: tuple[str, ...], dt: float, output: str, json_output: bool, **options: Any) -> None:
    """Test whether engines give the same motion for a scene that is seen from elsewhere, given in other units, or run again.

    Each scene is turned, mirrored, moved, described with other body axes and in other units, and run again: in a batch, in a new
    process, on one core, and stopped and continued. If the engine has other representations of body or floor, or can simulate a second
    body far away, these are compared too. No exact solution is needed. The default is seven scenes with wang, mujoco and pybullet.

    Exit code: 0 whatever is found, 2 bad input; `dropspin run --symmetries` fails if a symmetry is lost.
    """
    from dropspin.comparisons.symmetries.study import SCENES, symmetries
    from dropspin.reports.html.replay import symmetries_page
    from dropspin.reports.stories.symmetries import Symmetries, worst_lost
    from dropspin.reports.study_files import written_study
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.safe_output import echo
    from dropspin.scenarios import load

    with written_study(output, json_output) as keep, share_bar("symmetries") as on_progress:
        loaded = list(map(load, scenes or SCENES))
        findings = symmetries(loaded, dt=dt, **options, on_progress=on_progress)
        folder = keep(Symmetries(findings=findings))
        if worst := worst_lost(findings):
            page = symmetries_page(worst, {scene.name: scene for scene in loaded}, dt)
            (folder / "symmetries.html").write_text(page, encoding="utf-8")
    if worst and not json_output:
        echo(f"Replay of the worst lost symmetry of each engine: {os.path.join(output, 'symmetries.html')}")

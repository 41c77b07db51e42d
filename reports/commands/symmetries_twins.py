"""`dropspin symmetries twins`."""

from typing import Any

import click

from dropspin.reports.commands.options import as_json, engines_option, jobs_option, step_option, time_limit_option


@click.command("twins")
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@engines_option("An engine, with options; two or more.", required=True)
@step_option("")
@time_limit_option("an engine may use for one scene")
@jobs_option("scenes to run")
@as_json
def symmetries_twins_command(json_output: bool, **options: Any) -> None:
    """Find the time step from which engines of the same algorithm differ, such as MuJoCo and its port to a GPU.

    The motions of each pair of engines are compared at every time step. The table shows from which step on they differ at all, by how much
    before and after the first contact, and whether rounding explains the difference. No exact solution is needed.
    """
    from dropspin.comparisons.symmetries.twins import twins
    from dropspin.reports.stories.twins import document
    from dropspin.reports.terminal.progress import share_bar
    from dropspin.reports.terminal.rows import print_json_or

    with share_bar("twins") as on_progress:
        findings = twins(**options, on_progress=on_progress)
    print_json_or(json_output, findings, document(findings))

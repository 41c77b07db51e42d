"""`dropspin record rerun`."""

from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.options import as_json, time_limit_option

if TYPE_CHECKING:
    from dropspin.comparisons.running.process_limits import ResourceLimits


@click.command("rerun")
@click.argument("engine")
@click.argument("release")
@click.argument("scene")
@click.option("-r", "--record", "folder", default="record", metavar="DIR", help="Folder of the record.")
@time_limit_option("the engine may use for one simulation")
@as_json
def record_rerun_command(engine: str, release: str, scene: str, folder: str, resources: "ResourceLimits", json_output: bool) -> int:
    """Measure a cell of the record again, and compare motions and values with the recorded ones.

    ENGINE is an engine with options, RELEASE a release of it and SCENE a scene, as in the record. pip installs the release into a
    temporary environment. The exit code is 1 if a motion differs from that of the record in a bit, or a value of an equal motion
    by more than rounding; the output names the versions and the processor that differ from those of the record.
    """
    from dropspin.comparisons.engines.options import engine_name
    from dropspin.comparisons.record.plan import load_plan
    from dropspin.comparisons.record.rerun import rerun
    from dropspin.reports.stories import rerun as view
    from dropspin.reports.terminal.progress import status
    from dropspin.reports.terminal.rows import print_json_or

    with status(f"installing {engine_name(engine)} {release}, and simulating {scene}"):
        again = rerun(folder, load_plan(), engine, release, scene, time_limit=resources.processor_time)
    print_json_or(json_output, view.as_data(again), view.document(again))
    return 1 if again.moved or again.recomputed else 0

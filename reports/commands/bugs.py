"""`dropspin bugs`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.options import as_json, jobs_option, output_option
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo

if TYPE_CHECKING:
    from dropspin.comparisons.record.bugs import Bug, Outcome


@click.command("bugs")
@click.argument("names", nargs=-1, metavar="[CASE]...")
@click.option(
    "--prepare", "is_to_prepare", is_flag=True, help="First make the environments that are missing; pip and npm install the releases."
)
@click.option("--environments", default="out/bugs-environments", metavar="DIR", help="Folder of the environments, which are kept.")
@output_option("out/bugs", "for the tables")
@jobs_option("releases")
@as_json
def bugs_command(names: tuple[str, ...], is_to_prepare: bool, environments: str, output: str, jobs: int | None, json_output: bool) -> int:
    """Show publicly reported bugs of engines, each in the releases that have it and in those that do not.

    CASE is a reported bug; the default is all. Its scene is run with each release in an environment of its own, and the result is compared
    with the range that follows from the fault.

    Exit code: 1 if the releases do not show a fault as reported, 3 if a release could not be run.
    """
    from dropspin.comparisons.record.bugs import load_bugs, measure, prepare
    from dropspin.comparisons.running.parallel import as_jobs
    from dropspin.reports.stories.bugs import KnownBugs, exit_code
    from dropspin.reports.study_files import written_study

    bugs, folder = load_bugs(names), Path(environments).absolute()

    def on_done(bug: "Bug", outcome: "Outcome") -> None:
        stop_if_interrupted()
        echo(f"{bug.name}: {bug.engine} {outcome.release}: {outcome.state}", err=True)

    if is_to_prepare:
        prepare(bugs, folder, lambda text: echo(f"environment: {text}", err=True))
    with written_study(output, json_output) as keep:
        study = KnownBugs(bugs=bugs, outcomes=measure(bugs, folder, jobs=as_jobs(jobs), on_done=on_done))
        keep(study)
    return exit_code(study.verdicts())

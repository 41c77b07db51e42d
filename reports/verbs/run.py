"""`dropspin run`."""

import json
import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from reports.interrupts import stop_if_interrupted
from reports.verbs.options import as_json, baseline_option, time_limit_option

if TYPE_CHECKING:
    from comparisons import Results
    from comparisons.regressions.checking import Checked
    from reports.gate import Held
    from scenarios import Scenario

CORE_ENGINES = ("document", "mujoco", "pybullet")


@click.command()
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option(
    "-e",
    "--engine",
    "engines",
    multiple=True,
    metavar="ENGINE",
    help="An engine, such as mujoco[integrator=rk4]; repeat for more.",
)
@click.option(
    "--dt",
    "dts",
    multiple=True,
    type=float,
    metavar="SECONDS",
    help="A time step; repeat for more. [default: 0.004, 0.002, 0.001]",
)
@click.option(
    "-o",
    "--output",
    default="out/run",
    show_default=True,
    metavar="DIR",
    help="Folder for the report and the data; an earlier run there is replaced.",
)
@time_limit_option(300.0, "an engine may take for one scene at one step")
@baseline_option
@click.option("--dry-run", is_flag=True, help="Check what is asked for, say what would be measured, and run nothing.")
@click.option("--resume", is_flag=True, help="Go on with a run that was interrupted: measured scenes are not run again.")
@as_json
def run(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    dts: tuple[float, ...],
    output: str,
    time_limit: float,
    baseline: str | None,
    dry_run: bool,
    resume: bool,
    json_output: bool,
) -> int:
    """Run scenes through engines, side by side, and write the report.

    SCENE is a name of the catalogue, the path of a TOML file, or core: the core catalogue. Without arguments: the core catalogue,
    three engines, three steps.

    Exit code: 0 nothing failed, 1 a check failed, 2 bad input, 3 an engine broke down or one named is missing.
    """
    import comparisons
    import reports
    import scenarios
    from comparisons.regressions.baseline import load_baseline
    from reports import look
    from reports.failing import failing
    from reports.folder import Measured, fill, run_folder
    from reports.gate import Held
    from reports.terminal import json_rows, progress_bar, status
    from reports.verbs.check import tell

    loaded = [scene for name in scenes or ["core"] for scene in (_core() if name == "core" else [scenarios.load(name)])]
    chosen = engines or CORE_ENGINES
    steps = dts or comparisons.DEFAULT_DTS
    held = None if baseline is None else Held(load_baseline(baseline), baseline, output)
    if dry_run:
        return _print_plan(look.plan(loaded, chosen, steps), json_output)
    measured = Measured(output)
    try:
        with run_folder(output) as folder:
            if not resume:
                measured.clear()
            with progress_bar(len(loaded) * len(chosen) * len(steps)) as progress:

                def told(scene: str, engine: str, dt: float) -> None:
                    stop_if_interrupted()
                    progress(scene, engine, dt)

                limits = comparisons.Limits(processor_time=time_limit)
                results = comparisons.run(loaded, chosen, steps, told, limits, measured.keep, measured.parts())
            stop_if_interrupted()
            results = replace(results, provenance={**results.provenance, "named": sorted({name.strip() for name in engines})})
            if not json_output:
                reports.print_table(results)
            with status("writing the report"):
                fill(results, folder)
    except KeyboardInterrupt:
        kept = len(measured)
        raise KeyboardInterrupt(f"{kept} of {len(loaded)} scenes are kept, --resume goes on" if kept else "nothing was written") from None
    measured.clear()
    checked = _checked(results, held, json_output)
    if json_output:
        click.echo(json_rows(checked.results.frame))
    else:
        if held is not None:
            tell(checked, held, [one for one in failing(checked.results, baseline) if one.accepted])
        click.echo(f"Report: {os.path.join(output, 'report.html')}")
    return checked.results.exit_code()


def _checked(results: "Results", held: "Held | None", json_output: bool) -> "Checked":
    """What of a run that has been written holds; with nothing to hold it against its rows are told all the same."""
    from comparisons.regressions.checking import NothingAccepted, check
    from reports.terminal import json_rows
    from scenarios import DropspinError

    try:
        return check(results, None if held is None else held.baseline)
    except NothingAccepted as error:
        assert held is not None
        if json_output:
            click.echo(json_rows(results.frame))
        raise DropspinError(f"{held.path}: {error} The run is written: {held.run}.") from None


def _print_plan(plan: dict[str, Any], json_output: bool) -> int:
    from reports import look
    from reports.terminal import print_rows

    if json_output:
        click.echo(json.dumps(plan, indent=1, ensure_ascii=False))
    else:
        print_rows(look.plan_rows(plan), json_output=False)
    return 0


def _core() -> "list[Scenario]":
    """The scenes of the core catalogue."""
    import scenarios

    return [scene for scene in map(scenarios.load, scenarios.names()) if "core" in scene.tags]

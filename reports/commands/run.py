"""`dropspin run`."""

import os
import secrets
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.interrupts import stop_if_interrupted
from dropspin.reports.commands.options import as_json, baseline_option, jobs_option, time_limit_option
from dropspin.reports.terminal.safe import echo

if TYPE_CHECKING:
    from dropspin.comparisons.regressions.checking import Checked
    from dropspin.comparisons.results.results import Results
    from dropspin.comparisons.running.forecast import Forecast
    from dropspin.comparisons.running.progress import Progress
    from dropspin.reports.views.check import BaselineFile
    from dropspin.scenarios import Scenario

CORE_ENGINES = ("wang", "mujoco", "pybullet")


@click.command("run")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option(
    "-e", "--engine", "engines", multiple=True, metavar="ENGINE", help="An engine, such as mujoco[integrator=rk4]; repeat for more."
)
@click.option(
    "--dt", "dts", multiple=True, type=float, metavar="SECONDS", help="A time step; repeat for more. [default: 0.004, 0.002, 0.001]"
)
@click.option(
    "-o",
    "--output",
    default="out/run",
    show_default=True,
    metavar="DIR",
    help="Folder for the report and the data; an earlier run there is replaced.",
)
@click.option("--draw", "count", type=int, metavar="N", help="Add N random scenes, up to 1000, to the named ones.")
@click.option("--seed", type=int, metavar="SEED", help="Seed of the random scenes. [default: a fresh seed, which is printed]")
@click.option("--symmetries", "test_symmetries", is_flag=True, help="Also test the symmetries of each scene at the finest time step.")
@time_limit_option(300.0, "an engine may use for one scene at one time step")
@jobs_option("scenes to run")
@click.option("--quick", is_flag=True, help="Run few starts, for a first answer from a slow engine; fewer checks are decided.")
@baseline_option
@click.option("--resume", is_flag=True, help="Resume an interrupted run: scenes that are already measured are not run again.")
@click.option("-v", "--verbose", is_flag=True, help="Also print a table of every metric for each scene.")
@as_json
def run_command(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    dts: tuple[float, ...],
    output: str,
    count: int | None,
    seed: int | None,
    test_symmetries: bool,
    time_limit: float,
    jobs: int | None,
    quick: bool,
    baseline: str | None,
    resume: bool,
    verbose: bool,
    json_output: bool,
) -> int:
    """Run scenes with several engines, compare them with exact solutions, and write the report.

    SCENE is a name of the catalogue, the path of a TOML file, or core for the core catalogue. The default is the core catalogue
    with three engines at three time steps. With --draw, random scenes are generated, each with an exact solution; the name
    draw-7-012 is scene 12 of seed 7.

    Exit code: 0 nothing failed, 1 a check failed, 2 bad input, 3 an engine broke down, or a named engine is missing.
    """
    from dropspin.comparisons.regressions.baseline import load_baseline
    from dropspin.reports.commands.check import print_checked
    from dropspin.reports.terminal.rows import json_rows
    from dropspin.reports.terminal.run_table import print_table
    from dropspin.reports.terminal.summary import print_summary
    from dropspin.reports.views.check import BaselineFile
    from dropspin.reports.views.failures import failures
    from dropspin.scenarios import load
    from dropspin.scenarios.draw import draw

    if seed is not None and count is None:
        raise click.UsageError("--seed has an effect only with random scenes; add --draw N.")
    if quick and baseline is not None:
        raise click.UsageError("a quick run has too few starts to be compared with a baseline; leave out --quick or --baseline.")
    named = scenes or (() if count is not None else ("core",))
    loaded = [scene for name in named for scene in (_core() if name == "core" else [load(name)])]
    drawn: dict[str, int] = {}
    if count is not None:
        drawn = {"draw": count, "seed": secrets.randbits(32) if seed is None else seed}
        loaded += draw(count, drawn["seed"])
        echo(f"Drawn with --seed {drawn['seed']}", err=json_output)
    file = None if baseline is None else BaselineFile(load_baseline(baseline), baseline, output)
    results = _run(loaded, drawn, engines, dts, output, time_limit, jobs, resume, quick=quick, test_symmetries=test_symmetries)
    try:
        if not json_output:
            (print_table if verbose else print_summary)(results)
        checked = _checked(results, file, json_output)
        if json_output:
            echo(json_rows(checked.results.table))
        else:
            if file is not None:
                print_checked(checked, file, [one for one in failures(checked.results, baseline) if one.accepted])
            echo(f"Report: {os.path.join(output, 'report.html')}")
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the run is written: {output}") from None
    return checked.results.exit_code()


def _run(
    scenes: "list[Scenario]",
    drawn: dict[str, int],
    engines: tuple[str, ...],
    dts: tuple[float, ...],
    output: str,
    time_limit: float,
    jobs: int | None,
    resume: bool,
    *,
    quick: bool,
    test_symmetries: bool,
) -> "Results":
    """Run the scenes and write the run; a run that is interrupted or cannot be written keeps the scenes that were measured."""
    from dropspin.comparisons.running.processes import ResourceLimits
    from dropspin.comparisons.running.run import DEFAULT_DTS, run, what_changed
    from dropspin.comparisons.symmetries.rows import with_symmetries
    from dropspin.reports.commands.symmetries import with_progress
    from dropspin.reports.run_folder import MeasuredScenes, fill, run_folder
    from dropspin.reports.terminal.progress import progress_bar, status
    from dropspin.scenarios.text import counted

    measured, chosen, steps = MeasuredScenes(output), engines or CORE_ENGINES, dts or DEFAULT_DTS
    has_begun = False
    try:
        with run_folder(output) as folder:
            if not resume:
                measured.clear()
            has_begun, earlier = True, measured.parts()
            with progress_bar(len(scenes), len(chosen) * len(steps)) as shown:

                def on_progress(progress: "Progress") -> None:
                    stop_if_interrupted()
                    shown.on_progress(progress)

                def keep(part: "Results") -> None:
                    measured.keep(part)
                    shown.on_finished(*part.scenes)

                resources = ResourceLimits(processor_time=time_limit)
                work = partial(run, scenes, chosen, steps, resources=resources, done=earlier, jobs=jobs, quick=quick)
                results = work(on_progress=on_progress, keep=keep, on_forecast=lambda found: _show_forecast(found, shown.show_line))
            stop_if_interrupted()
            if changes := {what_changed(part.provenance, results.provenance) for part in earlier} - {""}:
                echo(f"measured again, not resumed: since the interrupted run, {'; '.join(sorted(changes))} changed", err=True)
            results = _with_request(results, engines, drawn)
            if test_symmetries:
                finest = min(steps)
                results = with_symmetries(results, with_progress(scenes, chosen, finest, resources, jobs), finest)
            with status("writing the report"):
                fill(results, folder)
    except (KeyboardInterrupt, Exception) as stopped:
        kept = len(measured) if has_begun else 0
        are = f"{kept} of {counted(len(scenes), 'scene')} {'is' if kept == 1 else 'are'} kept; --resume continues the run"
        if isinstance(stopped, KeyboardInterrupt):
            raise KeyboardInterrupt(are if kept else "nothing was written") from None
        if kept:
            stopped.add_note(f"{are}.")
        raise
    measured.clear()
    return results


def _show_forecast(found: "Forecast", show_line: "Callable[[str], None]") -> None:
    from dropspin.reports.views.run import forecast_sentence

    if sentence := forecast_sentence(found):
        show_line(sentence)


def _with_request(results: "Results", engines: tuple[str, ...], drawn: dict[str, int]) -> "Results":
    """The results with what was named on the command line and drawn."""
    asked = {**results.provenance["asked"], **drawn}
    return replace(results, provenance={**results.provenance, "asked": asked, "named": sorted({name.strip() for name in engines})})


def _checked(results: "Results", file: "BaselineFile | None", json_output: bool) -> "Checked":
    """Compare a written run with the baseline. If the run covers no accepted result, its rows are printed before the error message."""
    from dropspin.comparisons.regressions.checking import NothingAccepted, check
    from dropspin.reports.terminal.rows import json_rows
    from dropspin.scenarios import DropspinError

    try:
        return check(results, None if file is None else file.baseline)
    except NothingAccepted as error:
        assert file is not None
        if json_output:
            echo(json_rows(results.table))
        raise DropspinError(f"{file.path}: {error} The run is written: {file.run}.") from None


def _core() -> "list[Scenario]":
    """The scenes of the core catalogue."""
    from dropspin.scenarios import load, names

    return [scene for scene in map(load, names()) if "core" in scene.tags]

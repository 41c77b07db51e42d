"""`dropspin run`."""

import os
import secrets
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from dropspin.reports.commands.options import (
    FIVE_MINUTES,
    as_json,
    baseline_option,
    engines_option,
    jobs_option,
    output_option,
    scenes_argument,
    time_limit_option,
    within_option,
    write_text,
)
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dropspin.comparisons.results.results import Results
    from dropspin.comparisons.running.forecast import Forecast
    from dropspin.scenarios import Scenario

CORE_ENGINES = ("wang", "mujoco", "pybullet")


@click.command("run")
@scenes_argument
@engines_option()
@click.option(
    "--dt", "dts", multiple=True, type=float, metavar="SECONDS", help="A time step; repeat for more. [default: 0.004, 0.002, 0.001]"
)
@output_option("out/run", "for the report and the data; an earlier run there is replaced")
@click.option("--draw", "count", type=int, metavar="N", help="Add N random scenes, up to 1000, to the named ones.")
@click.option("--seed", type=int, metavar="SEED", help="Seed of the random scenes. [default: a fresh seed, which is printed]")
@click.option("--symmetries", "test_symmetries", is_flag=True, help="Also test the symmetries of each scene at the finest time step.")
@time_limit_option("an engine may use for one scene at one time step", FIVE_MINUTES)
@jobs_option("scenes to run")
@click.option(
    "--quick", is_flag=True, help="Run few initial states per scene, for a first answer from a slow engine; some checks stay undecided."
)
@within_option
@baseline_option
@click.option("--resume", is_flag=True, help="Resume an interrupted run: scenes that are already measured are not run again.")
@click.option("-v", "--verbose", is_flag=True, help="Also print a table of every metric for each scene.")
@as_json
def run_command(
    scenes: tuple[str, ...],
    engines: tuple[str, ...],
    output: str,
    count: int | None,
    seed: int | None,
    within: float | None,
    baseline: str | None,
    verbose: bool,
    json_output: bool,
    **options: Any,
) -> int:
    """Run scenes with several engines, compare them with exact solutions or recordings, and write the report.

    SCENE is a name of the catalogue, the path of a TOML file, or core for the core catalogue. The default is the core catalogue
    with three engines at three time steps. With --draw, random scenes are generated, each with an exact solution; the name
    draw-7-012 is scene 12 of seed 7.

    Exit code: 0 nothing failed, 1 a check failed, 2 bad input, 3 an engine broke down, or a named engine is missing.
    """
    from dropspin.comparisons.regressions.ablation import with_explaining_settings
    from dropspin.comparisons.regressions.baseline import load_baseline
    from dropspin.comparisons.regressions.checking import NothingAccepted, check
    from dropspin.reports.junit import junit_xml
    from dropspin.reports.output import json_text
    from dropspin.reports.stories import check as story
    from dropspin.reports.stories.failures import failures
    from dropspin.reports.terminal.rows import print_document
    from dropspin.reports.terminal.run_table import print_table
    from dropspin.scenarios import DropspinError, load, names
    from dropspin.scenarios.draw import draw

    if seed is not None and count is None:
        raise click.UsageError("--seed has an effect only with random scenes; add --draw N.")
    if options["quick"] and baseline is not None:
        raise click.UsageError("a quick run has too few starts to be compared with a baseline; leave out --quick or --baseline.")
    named = scenes or (() if count is not None else ("core",))
    core = [scene for scene in map(load, names()) if "core" in scene.tags] if "core" in named else []
    loaded = [scene for name in named for scene in (core if name == "core" else [load(name)])]
    asked: dict[str, float] = {} if within is None else {"within": within}
    if count is not None:
        seed = secrets.randbits(32) if seed is None else seed
        asked |= {"draw": count, "seed": seed}
        loaded += draw(count, seed)
        echo(f"Drawn with --seed {seed}", err=json_output)
    accepted = None if baseline is None else load_baseline(baseline)
    results = _run(loaded, engines, asked, output, **options)
    try:
        if not json_output:
            print_table(results, summary_only=not verbose)
        try:
            checked = with_explaining_settings(check(results, accepted), accepted, imports=True)
        except NothingAccepted as error:
            if json_output:
                echo(json_text(results.table.to_dict("records")))
            raise DropspinError(f"{baseline}: {error} The run is written: {output}.") from None
        if baseline is not None:
            write_text(os.path.join(output, "junit.xml"), junit_xml(checked.results, baseline).decode())
        if json_output:
            echo(json_text(checked.results.table.to_dict("records")))
        else:
            if baseline is not None:
                failed = [failure for failure in failures(checked.results, baseline) if failure.accepted]
                print_document(story.document(checked, failed, output, baseline))
            echo(f"Report: {os.path.join(output, 'report.html')}")
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the run is written: {output}") from None
    return checked.results.exit_code()


def _run(
    scenes: "Sequence[Scenario]",
    engines: tuple[str, ...],
    asked: "Mapping[str, float]",
    output: str,
    *,
    dts: tuple[float, ...],
    resume: bool,
    test_symmetries: bool,
    **options: Any,
) -> "Results":
    """Run the scenes and write the run; a run that is interrupted or cannot be written keeps the scenes that were measured.

    Args:
        scenes: The scenes.
        engines: The engines that were named.
        asked: Number and seed of the scenes that were drawn, and the tolerance of the conclusion, as far as they were given.
        output: The folder.
        dts: The time steps that were named [s].
        resume: Whether to keep the scenes that an interrupted run measured.
        test_symmetries: Whether to test symmetries too.
        options: The options `jobs`, `resources` and `quick` of `run`.
    """
    from dropspin.comparisons.running.arguments import DEFAULT_DTS
    from dropspin.comparisons.running.run import run, what_changed
    from dropspin.comparisons.symmetries.findings import with_symmetries
    from dropspin.comparisons.symmetries.study import symmetries
    from dropspin.reports.run_folder import MeasuredScenes, fill, run_folder
    from dropspin.reports.stories.run import forecast_sentence
    from dropspin.reports.terminal.progress import progress_bar, share_bar, status
    from dropspin.scenarios.text import counted

    measured, chosen, steps = MeasuredScenes(output), engines or CORE_ENGINES, dts or DEFAULT_DTS
    has_begun = False
    try:
        with run_folder(output) as folder:
            if not resume:
                measured.clear()
            has_begun, earlier = True, measured.parts()
            with progress_bar(len(scenes), len(chosen) * len(steps)) as shown:

                def keep(part: "Results") -> None:
                    measured.keep(part)
                    shown.on_finished(next(iter(part.scenes)), len(measured))

                def on_forecast(forecast: "Forecast") -> None:
                    if sentence := forecast_sentence(forecast):
                        shown.show_line(sentence)

                options |= {"on_progress": shown.on_progress, "keep": keep, "on_forecast": on_forecast}
                results = run(scenes, chosen, steps, done=earlier, **options)
            stop_if_interrupted()
            if changes := {what_changed(part.provenance, results.provenance) for part in earlier} - {""}:
                echo(f"measured again, not resumed: since the interrupted run, {'; '.join(sorted(changes))} changed", err=True)
            named = sorted({name.strip() for name in engines})
            stamp = {"asked": {**results.provenance["asked"], **asked}, "named": named}
            results = replace(results, provenance={**results.provenance, **stamp})
            if test_symmetries:
                finest, kept = min(steps), {name: options[name] for name in ("resources", "jobs")}
                with share_bar("symmetries") as on_share:
                    findings = symmetries(scenes, chosen, dt=finest, on_progress=on_share, **kept)
                results = with_symmetries(results, findings, finest)
            with status("writing the report"):
                fill(results, folder)
    except (KeyboardInterrupt, Exception) as stopped:
        count = len(measured) if has_begun else 0
        are = f"{count} of {counted(len(scenes), 'scene')} {'is' if count == 1 else 'are'} kept; --resume continues the run"
        if isinstance(stopped, KeyboardInterrupt):
            raise KeyboardInterrupt(are if count else "nothing was written") from None
        if count:
            stopped.add_note(f"{are}.")
        raise
    measured.clear()
    return results

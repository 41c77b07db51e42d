"""The command line."""

import io
import json
import os
import sys
import traceback
from importlib.metadata import version
from typing import Literal

import click

from reports.interrupts import heed_interrupts, stop_if_interrupted
from reports.verbs.check import accept, check
from reports.verbs.compare import compare
from reports.verbs.history import history
from reports.verbs.limits import limits
from reports.verbs.options import as_json, time_limit_option
from reports.verbs.replay import replay
from reports.verbs.report import report
from reports.verbs.run import run
from reports.verbs.sweep import sweep
from reports.verbs.tradeoff import tradeoff

INTERRUPTED = 130  # 128 + SIGINT, as shells have it
OWN_ERROR = 70  # EX_SOFTWARE of sysexits.h: neither a verdict nor the user's mistake


def main() -> None:
    """Run the command line; every expected mistake ends in one line and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a sign gets a question mark, not a traceback
    heed_interrupts()
    try:
        sys.exit(_run())
    except (click.Abort, KeyboardInterrupt) as interrupt:
        told = (interrupt.__cause__ or interrupt).args  # click has one of its own for the interrupts of commands
        click.echo(f"dropspin: interrupted; {told[0] if told else 'nothing was written'}.", err=True)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  # the reader has gone; Python would flush into the void at exit
        sys.exit(INTERRUPTED)
    except OSError as error:
        click.echo(f"dropspin: {error}", err=True)
        sys.exit(2)
    except Exception:
        click.echo("dropspin: an error of dropspin's own; please report what follows.", err=True)
        traceback.print_exc()
        sys.exit(OWN_ERROR)


def _run() -> int:
    from scenarios import DropspinError

    try:
        return dropspin(standalone_mode=False) or 0
    except click.ClickException as error:
        error.show()
    except DropspinError as error:
        click.echo(f"dropspin: {error}", err=True)
        from comparisons import EngineMissing

        return 3 if isinstance(error, EngineMissing) else 2
    return 2


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(version("dropspin"), prog_name="dropspin")
def dropspin() -> None:
    """Drop and spin scenes through rigid-body engines, held against the exact answer."""


@dropspin.command("list")
@click.argument("what", type=click.Choice(["scenes", "engines", "metrics"]), default="scenes")
@as_json
def list_(what: str, json_output: bool) -> None:
    """List the scenes, the engines or the metrics there are."""
    from reports import look
    from reports.terminal import print_rows

    print_rows({"scenes": look.scene_rows, "engines": look.engine_rows, "metrics": look.metric_rows}[what](), json_output)


@dropspin.command()
@click.argument("scene")
@click.option("-e", "--engine", "engine_name", metavar="ENGINE", help="Show what this engine builds and with which settings.")
@click.option("--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The step the settings are for.")
@as_json
def show(scene: str, engine_name: str | None, dt: float, json_output: bool) -> None:
    """Show a scene: what is modelled and what is left out, its truth, what it expects; or an engine's settings for it."""
    from reports import look
    from reports.terminal import print_rows
    from scenarios import load

    loaded = load(scene)
    print_rows(look.description(loaded) if engine_name is None else look.built_rows(loaded, engine_name, dt), json_output)


@dropspin.command()
@as_json
def doctor(json_output: bool) -> None:
    """Look at this installation: versions, engines, processor, and whether each engine steps."""
    from comparisons import engine_names
    from reports import look
    from reports.terminal import print_rows

    print_rows(look.doctor_rows(engine_names()), json_output)


@dropspin.command()
@click.argument("engine_name", metavar="ENGINE")
@click.option("--check", "checks", multiple=True, metavar="CHECK", help="Make this check only, by its name in the table; repeat for more.")
@time_limit_option(60.0, "each check may take")
@as_json
def conform(engine_name: str, checks: tuple[str, ...], time_limit: float, json_output: bool) -> int:
    """Is this adapter right? Hold an engine's adapter against the protocol and against motions that tell mistakes apart.

    ENGINE is a name, as in `dropspin list engines`, or your own as my_module:MyEngine.

    Exit code: 0 nothing is wrong, 1 something is, 2 bad input, 3 the engine crashed, hung or is not installed.
    """
    from comparisons import Limits, engine
    from comparisons.conformance import conform as findings
    from reports.terminal import print_rows, status

    chosen = engine(engine_name)
    with status(f"checking {chosen.label}"):
        found = findings(chosen, Limits(processor_time=time_limit), checks)
    stop_if_interrupted()
    print_rows([{"check": one.check, "verdict": one.verdict, "what was found": one.said} for one in found], json_output)
    verdicts = {one.verdict for one in found}
    return 3 if verdicts & {"crashed", "timed_out"} else int("failed" in verdicts)


@dropspin.command()
@click.option("-e", "--engine", "engine_name", default="mujoco", show_default=True, metavar="ENGINE", help="The engine, with options.")
@click.option("--restitution", type=click.FloatRange(0.0, 1.0), required=True, metavar="E", help="Speed after an impact over speed before.")
@click.option("--dt", type=float, required=True, metavar="SECONDS", help="The time step.")
@click.option("--friction", default="none", show_default=True, metavar="F", help="none, infinite or a coefficient.")
@click.option("--shape", type=click.Choice(["ball", "box"]), default="ball", show_default=True, help="What falls.")
@click.option("--as", "language", metavar="LANGUAGE", help="Print nothing but the text to paste: python, mjcf or urdf.")
@as_json
def calibrate(
    engine_name: str,
    restitution: float,
    dt: float,
    friction: str,
    shape: Literal["ball", "box"],
    language: str | None,
    json_output: bool,
) -> None:
    """The settings that give a restitution at a time step, ready to paste, and what they were measured to do.

    MuJoCo has two ways: a damper over one step, and with -e mujoco[spring_steps=20] a spring over so many steps.
    """
    from comparisons import engine
    from comparisons.calibration import calibrate as calibrated
    from reports import look
    from reports.terminal import print_rows, status
    from scenarios.errors import UnknownName

    if language is not None and json_output:
        raise click.UsageError("--as prints one text and --json all of them; give one of the two.")
    chosen = engine(engine_name)
    with status(f"measuring {chosen.label}"):
        found = calibrated(chosen, restitution, dt, look.friction(friction), shape)
    stop_if_interrupted()
    if language is not None:
        if language not in found.programs:
            raise UnknownName(f"{chosen.label}'s language", language, found.programs)
        click.echo(found.programs[language], nl=False)
        return
    if json_output:
        click.echo(json.dumps(look.calibration(found), indent=1, ensure_ascii=False))
        return
    print_rows(look.measured_rows(found), json_output=False)
    print_rows(look.setting_rows(found), json_output=False)
    for name, text in found.programs.items():
        click.echo(f"To paste, as {name}:\n\n{text}")


for verb in (accept, check, compare, history, limits, replay, report, run, sweep, tradeoff):
    dropspin.add_command(verb)

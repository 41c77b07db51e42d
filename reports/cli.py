"""The command line."""

import io
import json
import math
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Callable

    from scenarios import Scenario

CORE_ENGINES = ("document", "mujoco", "pybullet")
INTERRUPTED = 130  # 128 + SIGINT, as shells have it
OWN_ERROR = 70  # EX_SOFTWARE of sysexits.h: neither a verdict nor the user's mistake

as_json = click.option("--json", "json_output", is_flag=True, help="Print JSON instead of a table.")


def main() -> None:
    """Run the command line; every expected mistake ends in one line and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a sign gets a question mark, not a traceback
    # Like Ctrl-C, so that nothing unfinished is left behind.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        sys.exit(_run())
    except (click.Abort, KeyboardInterrupt):
        click.echo("dropspin: interrupted; nothing was written.", err=True)
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
    return 2


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(version("dropspin"), prog_name="dropspin")
def dropspin() -> None:
    """Drop and spin scenes through rigid-body engines, held against the exact answer."""


@dropspin.command()
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
@as_json
def run(scenes: tuple[str, ...], engines: tuple[str, ...], dts: tuple[float, ...], output: str, json_output: bool) -> int:
    """Run scenes through engines, side by side, and write the report.

    SCENE is a name of the catalogue or the path of a TOML file. Without arguments: the core catalogue, three engines, three
    steps.

    Exit code: 0 nothing failed, 1 an expectation failed, 2 bad input, 3 an engine broke down or one named is missing.
    """
    import comparisons
    import reports
    from reports.folder import fill, run_folder

    loaded = [_load(name) for name in scenes] if scenes else _core_catalogue()
    chosen = engines or CORE_ENGINES
    steps = dts or comparisons.DEFAULT_DTS
    with run_folder(output) as folder:
        with _progress(len(loaded) * len(chosen) * len(steps)) as progress:
            results = comparisons.run(loaded, chosen, steps, progress)
        if not json_output:
            reports.print_table(results)
        with _status("writing the report"):
            fill(results, folder)
    if json_output:
        rows = [
            {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()}
            for row in results.frame.to_dict("records")
        ]
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        click.echo(f"Report: {os.path.join(output, 'report.html')}")
    named = frozenset(name.strip() for name in engines)
    return results.exit_code(named)


@dropspin.command("list")
@click.argument("what", type=click.Choice(["scenes", "engines", "metrics"]), default="scenes")
@as_json
def list_(what: str, json_output: bool) -> None:
    """List the scenes, the engines or the metrics there are."""
    rows = {"scenes": _scene_rows, "engines": _engine_rows, "metrics": _metric_rows}[what]()
    _print_rows(rows, json_output)


@dropspin.command()
@click.argument("scene")
@click.option("-e", "--engine", "engine_name", metavar="ENGINE", help="Show what this engine builds and with which settings.")
@click.option("--dt", default=1e-3, show_default=True, type=float, metavar="SECONDS", help="The step the settings are for.")
@as_json
def show(scene: str, engine_name: str | None, dt: float, json_output: bool) -> None:
    """Show a scene: what is modelled and what is left out, its truth, what it expects; or an engine's settings for it."""
    loaded = _load(scene)
    rows = _description(loaded) if engine_name is None else _built(loaded, engine_name, dt)
    _print_rows(rows, json_output)


@dropspin.command()
@as_json
def doctor(json_output: bool) -> None:
    """Look at this installation: versions, engines, processor, and whether each engine steps."""
    from comparisons import EngineMissing, engine, simulate
    from comparisons.provenance import processor, versions
    from scenarios import load

    rows = [{"what": package, "found": found or "not installed"} for package, found in versions().items()]
    rows += [{"what": "python", "found": sys.version.split()[0]}, {"what": "processor", "found": processor()}]
    for name in CORE_ENGINES:
        try:
            motion = simulate(load("drop-ball"), engine(name), 4e-3)
            found = f"works: ball at {motion.position[-1, 1]:.4f} m after {motion.t[-1]:g} s"
        except EngineMissing as error:
            found = f"missing: {error}"
        except Exception as error:  # a doctor reports whatever is wrong with an engine
            found = f"broken: {type(error).__name__}: {error}"
        rows.append({"what": f"engine {name}", "found": found})
    _print_rows(rows, json_output)


def _load(name: str) -> "Scenario":
    from scenarios import load

    return load(name)


def _core_catalogue() -> "list[Scenario]":
    from scenarios import names

    return [scene for scene in map(_load, names()) if "core" in scene.tags]


def _scene_rows() -> list[dict[str, str]]:
    from scenarios import names, truth_for

    rows = []
    for name in names():
        scene = _load(name)
        truth = truth_for(scene)
        rows.append({"scene": name, "truth": truth.name if truth else "", "tags": ", ".join(scene.tags), "summary": scene.summary})
    return rows


def _engine_rows() -> list[dict[str, str]]:
    from comparisons import EngineMissing, engine, engine_names

    rows = []
    for name in engine_names():
        try:
            found = engine(name)
        except EngineMissing as error:
            rows.append({"engine": name, "options": "", "summary": str(error)})
            continue
        options = "; ".join(f"{key} = {' | '.join(values)}" for key, values in found.choices.items())
        rows.append({"engine": name, "options": options, "summary": (type(found).__doc__ or "").strip().splitlines()[0]})
    return rows


def _metric_rows() -> list[dict[str, str]]:
    from comparisons import METRICS

    return [
        {"metric": metric.name, "unit": metric.unit, "needs": metric.needs, "definition": metric.definition} for metric in METRICS.values()
    ]


def _description(scene: "Scenario") -> list[dict[str, str]]:
    from comparisons.verdicts import assert_expectations_can_be_judged
    from reports.html import left_out, modelled
    from reports.numbers import bound
    from scenarios import truth_for

    truth = truth_for(scene)
    assert_expectations_can_be_judged(scene, truth, [])
    start = scene.start
    facts = {
        "scene": scene.name,
        "summary": scene.summary,
        "source": scene.source,
        "duration": f"{scene.duration:g} s",
        "modelled": ", ".join(modelled(scene)),
        "left out": ", ".join(left_out(scene)) or "nothing",
        "inertia": f"{scene.body.inertia_tensor.tolist()} kg m²",
        "start": f"x = {list(start.position)} m, q = {list(start.orientation)}",
        "start rates": f"v = {list(start.velocity)} m/s, ω = {list(start.angular_velocity)} rad/s",
        "truth": truth.statement if truth else "none known",
    }
    if truth and truth.events:
        facts["impacts"] = f"{len(truth.events)}, the first at {truth.events[0].time:.6f} s"
    for expectation in scene.expect:
        below, within, above = expectation.below, expectation.within, expectation.above
        limits = (-below, below) if below else within or (above, float("nan"))
        steps = ", ".join(f"{dt:g}" for dt in expectation.dt or ())
        who = " at ".join(filter(None, [expectation.engine or "any engine", f"{steps} s" if steps else ""]))
        facts[f"expect {expectation.metric} ({who})"] = f"{bound(*limits)}: {expectation.reason}"
    return [{"what": key, "is": value} for key, value in facts.items() if value]


def _built(scene: "Scenario", engine_name: str, dt: float) -> list[dict[str, str]]:
    from comparisons import engine
    from comparisons.building import assert_built_as_meant
    from comparisons.run import assert_step_fits

    assert_step_fits(scene, dt)
    chosen = engine(engine_name)
    refusal = chosen.declines(scene)
    if refusal is not None:
        return [{"what": chosen.label, "is": f"declines {scene.name}: {refusal}"}]
    with chosen.prepare(scene, dt) as simulation:
        assert_built_as_meant(chosen, scene, simulation)
        built = simulation.as_built()
        rows = [{"what": "engine", "is": chosen.label}, {"what": "staggered", "is": str(simulation.staggered)}]
        if built is not None:
            rows += [
                {"what": "mass, read back", "is": f"{built.mass!r} kg"},
                {"what": "inertia, read back", "is": f"{built.inertia.tolist()} kg m²"},
                {"what": "gravity, read back", "is": f"{built.gravity.tolist()} m/s²"},
            ]
        return rows + [{"what": key, "is": str(value)} for key, value in simulation.settings.items()]


def _print_rows(rows: list[dict[str, str]], json_output: bool) -> None:
    if json_output:
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False))
        return
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_header=list(rows[0]) not in (["what", "is"], ["what", "found"]))
    for number, column in enumerate(rows[0]):
        table.add_column(column, overflow="fold", no_wrap=number == 0 and len(rows[0]) > 2)
    for row in rows:
        table.add_row(*(Text(value) for value in row.values()))
    Console().print(table)


@contextmanager
def _progress(total: int) -> "Iterator[Callable[[str, str, float], None]]":
    """A bar on a terminal; elsewhere one line a scene. All of it on the standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        seen: set[str] = set()

        def line(scene: str, engine: str, dt: float) -> None:
            if scene not in seen:
                seen.add(scene)
                click.echo(f"running {scene}", err=True)

        yield line
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=total)

        def advance(scene: str, engine: str, dt: float) -> None:
            bar.update(task, advance=1, description=f"{scene} {engine} {dt:g} s")

        yield advance


@contextmanager
def _status(text: str) -> Iterator[None]:
    from rich.console import Console

    console: Any = Console(stderr=True)
    if not console.is_terminal:
        click.echo(text, err=True)
        yield
        return
    with console.status(text):
        yield

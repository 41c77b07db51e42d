"""The failures of a run in words: where, what, by how much, and the command that reproduces each."""

import math
import shlex
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.judging.convergence import STUDIES
from comparisons.judging.verdicts import FAILURES
from comparisons.results.results import Results
from comparisons.running.processes import ResourceLimits
from reports.views.numbers import bound, formatted, step, subject, word

Row = Mapping[Hashable, Any]


@dataclass(frozen=True)
class Failure:
    """The failed rows of one metric of one engine in one scene, described by the first of them.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        where: The time step, in words.
        what: What is wrong, with value, bound and reason.
        others: How many other rows, at other time steps, fail in the same way.
        reproduce: The command, or the call, that reproduces it.
        broke_down: Whether the engine crashed, hung, diverged, or is missing.
        accepted: Whether an accepted result fails.
    """

    scene: str
    engine: str
    where: str
    what: str
    others: int
    reproduce: str
    broke_down: bool
    accepted: bool

    @property
    def sentence(self) -> str:
        """The failure in one line, without the command."""
        others = f" (and {self.others} other time {'step' if self.others == 1 else 'steps'})" if self.others else ""
        return f"{self.scene} · {self.engine}{self.where}: {self.what}{others}"


def failures(results: Results, baseline: str | None = None) -> list[Failure]:
    """The failures: breakdowns first, then accepted results that moved, the largest changes first, then expectations.

    Args:
        results: The run, with the rows of a check if there was one.
        baseline: The baseline file it was compared with, for the commands.
    """
    rows = results.table[results.breakdowns | results.table["verdict"].isin(FAILURES)]
    urgency = rows["kind"].ne("baseline").astype(int).where(rows["verdict"].isin(FAILURES), -1)
    grouped: dict[tuple[str, ...], list[Row]] = {}
    for row in rows.assign(urgency=urgency).sort_values("urgency", kind="stable").to_dict("records"):
        accepted = row["truth"] if row["kind"] == "baseline" else ""
        grouped.setdefault((row["scene"], row["engine"], row["metric"], row["verdict"], row["kind"], accepted), []).append(row)
    return [_failure(results, group, baseline) for group in grouped.values()]


def _failure(results: Results, group: list[Row], baseline: str | None) -> Failure:
    row = group[0]
    where = "" if math.isnan(row["dt"]) and not row["metric"] else f" · {step(row['dt'])}{'' if math.isnan(row['dt']) else ' s'}"
    return Failure(
        scene=row["scene"],
        engine=row["engine"],
        where=where,
        what=what_fails(row),
        others=len(group) - 1,
        reproduce=reproduce(results, row, baseline),
        broke_down=row["verdict"] not in FAILURES,
        accepted=row["kind"] == "baseline",
    )


def what_fails(row: Row) -> str:
    """Value, bound or interval, and reason of a failed row."""
    if not row["metric"]:
        return str(row["reason"]) if row["verdict"] in FAILURES else f"{word(row['verdict'])}. {row['reason']}"
    what = subject(row["metric"], row["kind"], row["truth"])
    if row["kind"] == "baseline":  # with more digits than elsewhere: tolerances are small
        return f"{what} is {row['value']:.6g}, {row['reason']}"
    limits = bound(row["lower"], row["upper"])
    expected = f", {'95 % interval' if row['kind'] in STUDIES else 'expected'} {limits}" if limits else ""
    value = "undefined" if math.isnan(row["value"]) else formatted(row["value"])
    return f"{what} is {value}{expected}: {row['reason']}"


def reproduce(results: Results, row: Row, baseline: str | None = None) -> str:
    """The command that measures a row again, or the call if its scene or its engine was given as an object."""
    scene, asked = results.scenes[row["scene"]], results.provenance["asked"]
    steps = sorted(asked["dts"], reverse=True) if math.isnan(row["dt"]) or row["kind"] in STUDIES else [row["dt"]]
    engine = results.provenance["names"].get(row["engine"])  # my_module:MyEngine has a name of its own in results
    if not scene.origin or engine is None:
        named_scene = repr(scene.origin) if scene.origin else f"<scene {scene.name!r}>"
        named_engine = f"<engine {row['engine']!r}>" if engine is None else repr(engine)
        return f"dropspin.run({named_scene}, {named_engine}, dt={[float(dt) for dt in steps]})"
    options = [] if baseline is None or row["kind"] != "baseline" else ["--baseline", baseline]
    return shlex.join(["dropspin", "run", scene.origin, "-e", engine, *_options(steps, asked["time_limit"]), *options, "-o", "out/again"])


def reproduce_drawn(results: Results) -> list[str]:
    """A sentence with the seed of a run's drawn scenes and the command that runs them again; empty if none were drawn."""
    asked = results.provenance["asked"]
    if "draw" not in asked:
        return []
    named = [results.scenes[name].origin for name in asked["scenes"][: -asked["draw"]]]
    engines = [word for label in results.engines for word in ("-e", results.provenance["names"][label])]
    options = _options(sorted(asked["dts"], reverse=True), asked["time_limit"])
    command = ["dropspin", "run", *named, "--draw", str(asked["draw"]), "--seed", str(asked["seed"]), *engines, *options, "-o", "out/again"]
    return [f"Scenes drawn with seed {asked['seed']}: {asked['draw']}. Reproduce: {shlex.join(command)}"]


def _options(dts: Sequence[float], time_limit: float) -> list[str]:
    """The options of `dropspin run` for time steps [s] and for a time limit [s] that is not the default one."""
    options = [word for dt in dts for word in ("--dt", repr(float(dt)))]
    return options if time_limit == ResourceLimits().processor_time else [*options, "--time-limit", f"{time_limit:g}"]

"""What failed in a run, as people need it: where, what, by how much, and the command that does it again."""

import math
import shlex
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from comparisons import Limits, Results
from comparisons.studies import STUDIES
from comparisons.verdicts import FAILURES
from reports.numbers import bound, step, subject, word, written

Row = Mapping[Hashable, Any]


@dataclass(frozen=True)
class Failing:
    """The rows that fail of one metric, of one engine in one scene, told by the first of them.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        where: The step, in words.
        what: What is wrong, with value, bound and reason.
        more: How many other rows, at other steps, fail likewise.
        again: The command, or the call, that does it again.
        broke_down: Whether the engine crashed, hung, diverged, or is missing.
        accepted: Whether it is an accepted figure that fails.
    """

    scene: str
    engine: str
    where: str
    what: str
    more: int
    again: str
    broke_down: bool
    accepted: bool

    @property
    def sentence(self) -> str:
        """All of it in one line, but for the command."""
        likewise = f" ({self.more} more of it likewise)" if self.more else ""
        return f"{self.scene} · {self.engine}{self.where}: {self.what}{likewise}"


def failing(results: Results, baseline: str | None = None) -> list[Failing]:
    """What failed, breakdowns first, then accepted figures that moved, most of all first, then expectations.

    Args:
        results: The run, with the rows of a check if there was one.
        baseline: The file of the figures it was held against, for the commands.
    """
    rows = results.frame[results.breakdowns | results.frame["verdict"].isin(FAILURES)]
    urgency = rows["kind"].ne("baseline").astype(int).where(rows["verdict"].isin(FAILURES), -1)
    grouped: dict[tuple[str, ...], list[Row]] = {}
    for row in rows.assign(urgency=urgency).sort_values("urgency", kind="stable").to_dict("records"):
        accepted = row["truth"] if row["kind"] == "baseline" else ""
        grouped.setdefault((row["scene"], row["engine"], row["metric"], row["verdict"], row["kind"], accepted), []).append(row)
    return [_told(results, group, baseline) for group in grouped.values()]


def _told(results: Results, group: list[Row], baseline: str | None) -> Failing:
    row = group[0]
    where = "" if math.isnan(row["dt"]) and not row["metric"] else f" · {step(row['dt'])}{'' if math.isnan(row['dt']) else ' s'}"
    return Failing(
        row["scene"],
        row["engine"],
        where,
        what_fails(row),
        len(group) - 1,
        again(results, row, baseline),
        row["verdict"] not in FAILURES,
        row["kind"] == "baseline",
    )


def what_fails(row: Row) -> str:
    """Value, bound and reason of a row that failed."""
    if not row["metric"]:
        return row["reason"] if row["verdict"] in FAILURES else f"{word(row['verdict'])}. {row['reason']}"
    what = subject(row["metric"], row["kind"], row["truth"])
    if row["kind"] == "baseline":  # to more digits than a table has: tolerances are small
        return f"{what} is {row['value']:.6g}, {row['reason']}"
    allowed = bound(row["lower"], row["upper"])
    expected = f", expected {allowed}" if allowed else ""
    return f"{what} is {written(row['value'])}{expected}: {row['reason']}"


def again(results: Results, row: Row, baseline: str | None = None) -> str:
    """The command that measures a row again, or the call if its scene or its engine was given as an object."""
    scene, asked = results.scenes[row["scene"]], results.provenance["asked"]
    steps = sorted(asked["dts"], reverse=True) if math.isnan(row["dt"]) or row["kind"] in STUDIES else [row["dt"]]
    engine = results.provenance["names"].get(row["engine"])  # my_module:MyEngine has a name of its own in results
    if not scene.origin or engine is None:
        held = f"scenarios.load({scene.origin!r})" if scene.origin else f"<scene {scene.name!r}>"
        named = f"<engine {row['engine']!r}>" if engine is None else repr(engine)
        return f"comparisons.run([{held}], [{named}], {[float(dt) for dt in steps]})"
    options = [word for dt in steps for word in ("--dt", repr(float(dt)))]
    options += [] if asked["time_limit"] == Limits().processor_time else ["--time-limit", f"{asked['time_limit']:g}"]
    options += [] if baseline is None or row["kind"] != "baseline" else ["--baseline", baseline]
    return shlex.join(["dropspin", "run", scene.origin, "-e", engine, *options, "-o", "out/again"])
